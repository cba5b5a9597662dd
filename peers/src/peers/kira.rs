//! kira: a spatial track for each voice. It pans between two ears by gains alone and lets sound fall with
//! distance; there is no filter, no delay and no Doppler.

use ::kira::backend::{Backend, Renderer};
use ::kira::listener::ListenerHandle;
use ::kira::sound::Region;
use ::kira::sound::static_sound::{StaticSoundData, StaticSoundHandle, StaticSoundSettings};
use ::kira::track::{MainTrackBuilder, SpatialTrackBuilder, SpatialTrackHandle};
use ::kira::{
    AudioManager, AudioManagerSettings, Capacities, Decibels, Easing, Frame, Panning, StartTime, Tween,
};
use std::sync::Arc;
use std::time::Duration;

use super::{Kind, Peer, Rendering, Result};
use crate::plain::Plain;
use crate::world::{Motion, RATE_HZ, Sound, TICKS_HZ, World};

pub struct Kira;

/// A backend that hands its renderer to whoever asks for blocks.
struct Offline(Option<Renderer>);

impl Backend for Offline {
    type Settings = ();
    type Error = ();

    fn setup((): (), _internal_buffer_size: usize) -> std::result::Result<(Self, u32), ()> {
        Ok((Self(None), RATE_HZ))
    }

    fn start(&mut self, renderer: Renderer) -> std::result::Result<(), ()> {
        self.0 = Some(renderer);
        Ok(())
    }
}

impl Peer for Kira {
    fn name(&self) -> String {
        "kira".into()
    }

    fn details(&self) -> String {
        "0.12.6, 4-point Hermite resampler, gains only".into()
    }

    fn kind(&self) -> Kind {
        Kind::Stereo
    }

    fn start(&self, world: &World) -> Result<Box<dyn Rendering>> {
        let sub_track_capacity = world.voices.len();
        let capacities = Capacities { sub_track_capacity, ..Capacities::default() };
        let mut manager = manager(capacities, MainTrackBuilder::new())?;
        let ahead = mint::Quaternion { v: [0.0; 3].into(), s: 1.0 };
        let listener = manager.add_listener(point([0.0; 3]), ahead).map_err(|error| say(&error))?;
        let frames = |sound: &Sound| sound.iter().map(|&sample| Frame::from_mono(sample)).collect();
        let sounds: Vec<Arc<[Frame]>> = world.sounds.iter().map(frames).collect();
        let mut tracks = Vec::with_capacity(world.voices.len());
        for voice in &world.voices {
            let track = SpatialTrackBuilder::new()
                .sound_capacity(1)
                .sub_track_capacity(1)
                .spatialization_strength(1.0);
            let at = point(voice.motion.position(0.0));
            let mut track =
                manager.add_spatial_sub_track(&listener, at, track).map_err(|error| say(&error))?;
            let settings = StaticSoundSettings::new()
                .loop_region(Region::from(..))
                .start_position(voice.offset as f64 / f64::from(RATE_HZ));
            let frames = sounds[voice.sound].clone();
            let data = StaticSoundData { sample_rate: RATE_HZ, frames, settings, slice: None };
            track.play(data).map_err(|error| say(&error))?;
            tracks.push((voice.motion, track));
        }
        Ok(Box::new(Playing { manager, _listener: listener, tracks, samples: Vec::new() }))
    }
}

fn say(error: &dyn std::fmt::Debug) -> String {
    format!("{error:?}")
}

fn manager(capacities: Capacities, main_track_builder: MainTrackBuilder) -> Result<AudioManager<Offline>> {
    let settings = AudioManagerSettings {
        capacities,
        main_track_builder,
        internal_buffer_size: 128,
        backend_settings: (),
    };
    AudioManager::new(settings).map_err(|error| say(&error))
}

fn point([x, y, z]: [f64; 3]) -> mint::Vector3<f32> {
    [x as f32, y as f32, z as f32].into()
}

struct Playing {
    manager: AudioManager<Offline>,
    _listener: ListenerHandle,
    tracks: Vec<(Motion, SpatialTrackHandle)>,
    samples: Vec<f32>,
}

impl Rendering for Playing {
    fn tick(&mut self, time_s: f64) -> Result<()> {
        let duration = Duration::from_secs_f64(1.0 / f64::from(TICKS_HZ));
        let tween = Tween { start_time: StartTime::Immediate, duration, easing: Easing::Linear };
        for (motion, track) in &mut self.tracks {
            track.set_position(point(motion.position(time_s)), tween);
        }
        Ok(())
    }

    fn render(&mut self, block: &mut [[f32; 2]]) -> Result<()> {
        render(&mut self.manager, &mut self.samples, block)
    }
}

fn render(manager: &mut AudioManager<Offline>, samples: &mut Vec<f32>, block: &mut [[f32; 2]]) -> Result<()> {
    let renderer = manager.backend_mut().0.as_mut().ok_or("kira did not start")?;
    samples.resize(2 * block.len(), 0.0);
    renderer.on_start_processing();
    renderer.process(samples, 2);
    for (frame, samples) in block.iter_mut().zip(samples.chunks_exact(2)) {
        *frame = [samples[0], samples[1]];
    }
    Ok(())
}

/// Sounds of the main track.
pub fn plain(plain: &Plain) -> Result<Box<dyn Rendering>> {
    let main = MainTrackBuilder::new().sound_capacity(plain.voices.len());
    let mut manager = manager(Capacities::default(), main)?;
    let frames: Arc<[Frame]> = plain.sound.iter().map(|&sample| Frame::from_mono(sample)).collect();
    let mut sounds = Vec::with_capacity(plain.voices.len());
    for voice in &plain.voices {
        let settings = StaticSoundSettings::new()
            .loop_region(Region::from(..))
            .start_position(voice.offset as f64 / f64::from(plain.rate_hz))
            .playback_rate(plain.speed)
            .volume(Decibels(20.0 * voice.gain.log10() as f32))
            .panning(Panning(voice.pan as f32));
        let data =
            StaticSoundData { sample_rate: plain.rate_hz, frames: frames.clone(), settings, slice: None };
        sounds.push(manager.play(data).map_err(|error| say(&error))?);
    }
    Ok(Box::new(PlainPlaying { manager, _sounds: sounds, samples: Vec::new() }))
}

struct PlainPlaying {
    manager: AudioManager<Offline>,
    _sounds: Vec<StaticSoundHandle>,
    samples: Vec<f32>,
}

impl Rendering for PlainPlaying {
    fn tick(&mut self, _: f64) -> Result<()> {
        Ok(())
    }

    fn render(&mut self, block: &mut [[f32; 2]]) -> Result<()> {
        render(&mut self.manager, &mut self.samples, block)
    }
}
