//! oddio: a `SpatialScene`. Each ear hears a voice later and softer by its own way, with Doppler; there is no
//! filter of a head.

use ::oddio::{Cycle, Frames, Seek, Spatial, SpatialOptions, SpatialScene, SpatialSceneControl};

use super::{Kind, Peer, Rendering, Result};
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
