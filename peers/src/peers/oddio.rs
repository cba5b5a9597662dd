//! oddio: a `SpatialScene`. Each ear hears a voice later and softer by its own way, with Doppler; there is no
//! filter of a head.

use ::oddio::{
    Cycle, Frames, Mixer, MixerControl, Seek, Signal, Spatial, SpatialOptions, SpatialScene,
    SpatialSceneControl, Speed,
};

use super::{Kind, Peer, Rendering, Result};
use crate::plain::Plain;
use crate::world::{Motion, RATE_HZ, World};

pub struct Oddio;

impl Peer for Oddio {
    fn name(&self) -> String {
        "oddio".into()
    }

    fn details(&self) -> String {
        "0.7.4, linear resampler, gain and delay an ear".into()
    }

    fn kind(&self) -> Kind {
        Kind::Stereo
    }

    fn start(&self, world: &World) -> Result<Box<dyn Rendering>> {
        let (mut control, scene) = SpatialScene::new();
        let sounds: Vec<_> = world.sounds.iter().map(|sound| Frames::from_slice(RATE_HZ, sound)).collect();
        let mut voices = Vec::with_capacity(world.voices.len());
        for voice in &world.voices {
            let mut signal = Cycle::new(sounds[voice.sound].clone());
            signal.seek(voice.offset as f32 / RATE_HZ as f32);
            let options = SpatialOptions {
                position: narrow(voice.motion.position(0.0)).into(),
                velocity: narrow(voice.motion.velocity(0.0)).into(),
                radius: 1.0,
            };
            voices.push((voice.motion, control.play(signal, options)));
        }
        Ok(Box::new(Playing { _control: control, scene, voices }))
    }
}

fn narrow(of: [f64; 3]) -> [f32; 3] {
    of.map(|c| c as f32)
}

struct Playing {
    _control: SpatialSceneControl,
    scene: SpatialScene,
    voices: Vec<(Motion, Spatial)>,
}

impl Rendering for Playing {
    fn tick(&mut self, time_s: f64) -> Result<()> {
        for (motion, voice) in &mut self.voices {
            let (position, velocity) = (motion.position(time_s), motion.velocity(time_s));
            voice.set_motion(narrow(position).into(), narrow(velocity).into(), false);
        }
        Ok(())
    }

    fn render(&mut self, block: &mut [[f32; 2]]) -> Result<()> {
        ::oddio::run(&mut self.scene, RATE_HZ, block);
        Ok(())
    }
}

/// Voices of a mixer. Oddio has gains, but no pan without distance; so this is a signal of ours, the plainest that there can
/// be, in place of one of its gains.
pub fn plain(plain: &Plain) -> Result<Box<dyn Rendering>> {
    let (mut control, mixer) = Mixer::new();
    let sound = Frames::from_slice(plain.rate_hz, &plain.sound);
    for voice in &plain.voices {
        let mut signal = Cycle::new(sound.clone());
        signal.seek((voice.offset as f64 / f64::from(plain.rate_hz)) as f32);
        let gains = voice.gains().map(|gain| gain as f32);
        if plain.speed == 1.0 {
            control.play(Panned { signal, gains, read: [0.0; MOST_FRAMES] });
        } else {
            let (mut speed, signal) = Speed::new(signal);
            speed.set_speed(plain.speed as f32);
            control.play(Panned { signal, gains, read: [0.0; MOST_FRAMES] });
        }
    }
    Ok(Box::new(PlainPlaying { _control: control, mixer }))
}

/// Frames that are panned at a time.
const MOST_FRAMES: usize = 256;

struct Panned<S> {
    signal: S,
    gains: [f32; 2],
    read: [f32; MOST_FRAMES],
}

impl<S: Signal<Frame = f32>> Signal for Panned<S> {
    type Frame = [f32; 2];

    fn sample(&mut self, interval: f32, out: &mut [[f32; 2]]) {
        for out in out.chunks_mut(MOST_FRAMES) {
            let read = &mut self.read[..out.len()];
            self.signal.sample(interval, read);
            for (out, read) in out.iter_mut().zip(read) {
                *out = self.gains.map(|gain| gain * *read);
            }
        }
    }
}

struct PlainPlaying {
    _control: MixerControl<[f32; 2]>,
    mixer: Mixer<[f32; 2]>,
}

impl Rendering for PlainPlaying {
    fn tick(&mut self, _: f64) -> Result<()> {
        Ok(())
    }

    fn render(&mut self, block: &mut [[f32; 2]]) -> Result<()> {
        ::oddio::run(&mut self.mixer, RATE_HZ, block);
        Ok(())
    }
}
