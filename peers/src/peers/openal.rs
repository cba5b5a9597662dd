//! OpenAL Soft with its HRTF on: one source a voice. Doppler comes from the velocity it is told; the way from the
//! source to the listener takes no time.

use super::{Kind, Peer, Rendering, Result};
use crate::dynamic::openal::{Device, OpenAl};
use crate::world::{Motion, RATE_HZ, SPEED_OF_SOUND, World};

/// OpenAL Soft with one of its resamplers.
struct OpenAlSoft {
    library: OpenAl,
    resampler: usize,
    name: String,
    details: String,
}

/// With its default resampler and with its best one, which is the last.
pub fn all(absent: &mut Vec<String>) -> Vec<Box<dyn Peer>> {
    match rows() {
        Ok(rows) => rows,
        Err(error) => {
            absent.push(format!("openal: {error}"));
            Vec::new()
        }
    }
}

fn rows() -> Result<Vec<Box<dyn Peer>>> {
    let library = OpenAl::load()?;
    let device = library.open(RATE_HZ, 1)?;
    let [version, head] = device.names();
    let (resamplers, default) = device.resamplers();
    let mut rows: Vec<Box<dyn Peer>> = Vec::new();
    for (label, resampler) in [("openal", default), ("openal-best", resamplers.len().saturating_sub(1))] {
        let resampler_name = resamplers.get(resampler).ok_or("it tells no resamplers")?;
        let details = format!("{version}, HRTF {head:?}, resampler {resampler_name:?}");
        rows.push(Box::new(OpenAlSoft { library: library.clone(), resampler, name: label.into(), details }));
    }
    Ok(rows)
}

impl Peer for OpenAlSoft {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn details(&self) -> String {
        self.details.clone()
    }

    fn kind(&self) -> Kind {
        Kind::Binaural
    }

    fn start(&self, world: &World) -> Result<Box<dyn Rendering>> {
        let device = self.library.open(RATE_HZ, world.voices.len())?;
        device.set_speed_of_sound(SPEED_OF_SOUND as f32);
        let sounds: Vec<u32> =
            world.sounds.iter().map(|sound| device.add_sound(sound, RATE_HZ)).collect::<Result<_>>()?;
        let mut voices = Vec::with_capacity(world.voices.len());
        for voice in &world.voices {
            voices.push((voice.motion, device.add_voice(sounds[voice.sound], voice.offset, self.resampler)?));
        }
        let mut playing = Playing { device, voices };
        playing.tick(0.0)?;
        let numbers: Vec<u32> = playing.voices.iter().map(|&(_, number)| number).collect();
        playing.device.play(&numbers)?;
        Ok(Box::new(playing))
    }
}

struct Playing {
    device: Device,
    voices: Vec<(Motion, u32)>,
}

impl Rendering for Playing {
    fn tick(&mut self, time_s: f64) -> Result<()> {
        let narrow = |of: [f64; 3]| of.map(|c| c as f32);
        self.device.place(self.voices.iter().map(|(motion, voice)| {
            (*voice, narrow(motion.position(time_s)), narrow(motion.velocity(time_s)))
        }));
        Ok(())
    }

    fn render(&mut self, block: &mut [[f32; 2]]) -> Result<()> {
        self.device.render(block);
        Ok(())
    }
}
