//! Steam Audio: for each voice its direct effect for distance, its binaural effect, and its mixing. It plays no
//! recordings; its users do, as is done here, without resampling. So there is no Doppler, and no delay.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::{Kind, Peer, Rendering, Result};
use crate::dynamic::phonon::{Channels, Effects, Interpolation, Phonon};
use crate::world::{Motion, RATE_HZ, Sound, World};

struct SteamAudio {
    library: String,
    head: PathBuf,
    interpolation: Interpolation,
    /// The head for blocks of a length, when it has been read.
    loaded: RefCell<Option<(usize, Rc<Phonon>)>>,
}

/// With both of its ways to fill in directions.
pub fn all(head: Option<&Path>, absent: &mut Vec<String>) -> Vec<Box<dyn Peer>> {
    let Ok(library) = std::env::var("PHONON_LIBRARY") else {
        absent
            .push("steam-audio: PHONON_LIBRARY does not name its library (libphonon.so, phonon.dll)".into());
        return Vec::new();
    };
    let Some(head) = head else {
        absent.push("steam-audio: no measured head; name a SOFA file with --head".into());
        return Vec::new();
    };
    let row = |interpolation| SteamAudio {
        library: library.clone(),
        head: head.into(),
        interpolation,
        loaded: RefCell::default(),
    };
    let rows = [Interpolation::Bilinear, Interpolation::Nearest].map(row);
    // Whether it is one is seen at once.
    if let Err(error) = rows[0].phonon(1024) {
        absent.push(format!("steam-audio: {error}"));
        return Vec::new();
    }
    rows.into_iter().map(|row| Box::new(row) as Box<dyn Peer>).collect()
}

impl SteamAudio {
    fn phonon(&self, frames: usize) -> Result<Rc<Phonon>> {
        let mut loaded = self.loaded.borrow_mut();
        match &*loaded {
            Some((of, phonon)) if *of == frames => Ok(phonon.clone()),
            _ => {
                let phonon = Phonon::load(&self.library, &self.head, RATE_HZ, frames)?;
                *loaded = Some((frames, phonon.clone()));
                Ok(phonon)
            }
        }
    }
}

impl Peer for SteamAudio {
    fn name(&self) -> String {
        match self.interpolation {
            Interpolation::Bilinear => "steam-audio",
            Interpolation::Nearest => "steam-audio-nearest",
        }
        .into()
    }

    fn details(&self) -> String {
        format!("4.8, the measured head, {:?} directions, no resampler", self.interpolation)
    }

    fn kind(&self) -> Kind {
        Kind::Binaural
    }

    fn start(&self, world: &World) -> Result<Box<dyn Rendering>> {
        let phonon = self.phonon(world.block)?;
        let mut voices = Vec::with_capacity(world.voices.len());
        for voice in &world.voices {
            voices.push(Voice {
                motion: voice.motion,
                sound: world.sounds[voice.sound].clone(),
                at: voice.offset,
                direction: [0.0, 0.0, -1.0],
                gain: 1.0,
                effects: Effects::new(&phonon)?,
            });
        }
        let mut playing = Playing {
            phonon,
            interpolation: self.interpolation,
            voices,
            dry: Channels::new(world.block),
            wet: Channels::new(world.block),
            sum: Channels::new(world.block),
        };
        playing.tick(0.0)?;
        Ok(Box::new(playing))
    }
}

struct Voice {
    motion: Motion,
    sound: Sound,
    /// The frame of the sound that comes next.
    at: usize,
    direction: [f32; 3],
    gain: f32,
    effects: Effects,
}

struct Playing {
    phonon: Rc<Phonon>,
    interpolation: Interpolation,
    voices: Vec<Voice>,
    dry: Channels<1>,
    wet: Channels<2>,
    sum: Channels<2>,
}

impl Rendering for Playing {
    fn tick(&mut self, time_s: f64) -> Result<()> {
        for voice in &mut self.voices {
            let at = voice.motion.position(time_s);
            let distance = at.iter().map(|c| c * c).sum::<f64>().sqrt();
            voice.direction = at.map(|c| (c / distance) as f32);
            voice.gain = (1.0 / distance.max(1.0)) as f32;
        }
        Ok(())
    }

    fn render(&mut self, block: &mut [[f32; 2]]) -> Result<()> {
        let Self { phonon, interpolation, voices, dry, wet, sum } = self;
        for samples in &mut sum.samples {
            samples.fill(0.0);
        }
        for voice in voices {
            let [samples] = &mut dry.samples;
            let mut left = &mut samples[..];
            while !left.is_empty() {
                let count = left.len().min(voice.sound.len() - voice.at);
                let (now, later) = left.split_at_mut(count);
                now.copy_from_slice(&voice.sound[voice.at..voice.at + count]);
                voice.at = (voice.at + count) % voice.sound.len();
                left = later;
            }
            voice.effects.apply(voice.direction, voice.gain, *interpolation, dry, wet);
            phonon.mix(wet, sum);
        }
        let [left, right] = &sum.samples;
        for ((frame, &left), &right) in block.iter_mut().zip(left).zip(right) {
            *frame = [left, right];
        }
        Ok(())
    }
}
