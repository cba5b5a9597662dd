//! What the whole-program tests share: a folder to make recordings, scenes and scores in, and the
//! way from those to samples in memory.
#![allow(dead_code)] // Each test program uses a part of it.

pub mod sheets;

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use froufrou::Result;
use froufrou::render::live::{self, EngineSettings, Handle};
use froufrou::render::offline::{self, Extent};
use froufrou::render::production::{ChannelLines, Production, open_score};
use froufrou::scene::Scene;
use froufrou::score::{ChannelHeader, ObjectWriter};
use froufrou::synth::mixer::{Begun, Mixer};
use froufrou::synth::prototypes::Soundings;
use froufrou::synth::receivers;
use realfft::RealFftPlanner;
use tempfile::TempDir;

/// A folder that is gone when the test is over.
pub struct Studio {
    folder: TempDir,
}

/// What to render of a score or scene.
#[derive(Debug, Clone, Copy)]
pub struct Take {
    pub rate_hz: u32,
    pub from_s: f64,
    pub to_s: Option<f64>,
    pub cores: usize,
}

impl Take {
    pub fn at(rate_hz: u32) -> Self {
        Self { rate_hz, from_s: 0.0, to_s: None, cores: 2 }
    }
}

/// Samples in memory.
pub struct Sound {
    pub rate_hz: f64,
    pub channels: usize,
    /// Interleaved.
    pub mix: Vec<f32>,
    /// Name and interleaved samples of each object, in the order in which they first sounded.
    pub stems: Vec<(String, Vec<f32>)>,
    pub begun: Vec<Begun>,
    /// The most threads in memory at once.
    pub most_threads: usize,
}

impl Sound {
    pub fn frames(&self) -> usize {
        self.mix.len() / self.channels
    }

    pub fn channel(&self, channel: usize) -> Vec<f64> {
        self.mix.iter().skip(channel).step_by(self.channels).map(|&s| f64::from(s)).collect()
    }

    pub fn stem(&self, name: &str) -> &[f32] {
        &self.stems.iter().find(|(stem, _)| stem == name).unwrap_or_else(|| panic!("no stem {name}")).1
    }
}

impl Sound {
    /// The energy of a channel, and when on average it arrives, in seconds.
    pub fn energy_and_moment(&self, channel: usize) -> (f64, f64) {
        let samples = self.channel(channel);
        let energy: f64 = samples.iter().map(|s| s * s).sum::<f64>() / self.rate_hz;
        let moment: f64 = samples.iter().enumerate().map(|(n, s)| n as f64 * s * s).sum();
        (energy, moment / self.rate_hz.powi(2) / energy)
    }

    /// The splash of the channel that splashes most.
    pub fn worst_splash_db(&self) -> f64 {
        (0..self.channels).map(|channel| self.splash_db(channel)).fold(f64::MIN, f64::max)
    }

    /// What the loudest moment of a channel holds away from its tone of 1 kHz, against the tone at its loudest, in
    /// decibels.
    pub fn splash_db(&self, channel: usize) -> f64 {
        const WINDOW: usize = 2048;
        let samples = self.channel(channel);
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(WINDOW);
        let mut spectrum = fft.make_output_vec();
        let (mut tone, mut splash) = (0.0f64, 0.0f64);
        // The beginning and the end fade, which is no click.
        for begin in (4_800..samples.len() - 9_600).step_by(WINDOW / 4) {
            // Blackman & Harris: side lobes of −92 dB.
            let weight = |n: usize| {
                let angle = TAU * n as f64 / WINDOW as f64;
                0.35875 - 0.48829 * angle.cos() + 0.14128 * (2.0 * angle).cos()
                    - 0.01168 * (3.0 * angle).cos()
            };
            let mut windowed: Vec<f64> = (0..WINDOW).map(|n| weight(n) * samples[begin + n]).collect();
            fft.process(&mut windowed, &mut spectrum).unwrap();
            for (bin, value) in spectrum.iter().enumerate() {
                let frequency_hz = bin as f64 * self.rate_hz / WINDOW as f64;
                if (800.0..1_200.0).contains(&frequency_hz) {
                    tone = tone.max(value.norm());
                } else if !(500.0..=1_500.0).contains(&frequency_hz) {
                    splash = splash.max(value.norm());
                }
            }
        }
        if tone > 0.0 { 20.0 * (splash / tone).log10() } else { f64::MIN }
    }
}

impl Studio {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a mono recording of 32-bit floats.
    pub fn recording(&self, name: &str, rate_hz: u32, samples: &[f32]) {
        write_wav(&self.path(name), rate_hz, 1, samples);
    }

    /// Writes a second of a tone of 1 kHz, and gives its samples: whole periods, so that its loop has no seam.
    pub fn tone(&self, name: &str) -> Vec<f32> {
        let tone: Vec<f32> = (0..48_000).map(|n| (0.5 * (TAU * f64::from(n) / 48.0).sin()) as f32).collect();
        self.recording(name, 48_000, &tone);
        tone
    }

    /// Writes a short hit that no sampling rate cuts off: the same at every rate that it is read at.
    pub fn band_limited_hit(&self, name: &str) {
        let hit: Vec<f32> = (0..960)
            .map(|n| {
                let x = (f64::from(n) - 480.0) / 96_000.0;
                ((-(x * 6_000.0).powi(2)).exp() * (TAU * 2_000.0 * x).cos()) as f32
            })
            .collect();
        self.recording(name, 96_000, &hit);
    }

    pub fn file(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
        path
    }

    /// The point cache and the faces of a square sheet of so many cells along each side: where each of its vertices is at
    /// a time, by its place from −0.5 to 0.5 on both sides.
    pub fn sheet(
        &self,
        name: &str,
        cells: usize,
        (frames, fps): (usize, f64),
        place: impl Fn(f64, [f64; 2]) -> [f64; 3],
    ) {
        let side = cells + 1;
        let corner =
            |i: usize| [(i % side) as f64 / cells as f64 - 0.5, (i / side) as f64 / cells as f64 - 0.5];
        let mut bytes = b"POINTCACHE2\0".to_vec();
        bytes.extend(1i32.to_le_bytes());
        bytes.extend((side as i32 * side as i32).to_le_bytes());
        bytes.extend(0f32.to_le_bytes());
        bytes.extend(1f32.to_le_bytes());
        bytes.extend((frames as i32).to_le_bytes());
        for frame in 0..frames {
            for i in 0..side * side {
                let position = place(frame as f64 / fps, corner(i));
                position.iter().for_each(|c| bytes.extend((*c as f32).to_le_bytes()));
            }
        }
        std::fs::write(self.path(&format!("{name}.pc2")), bytes).unwrap();
        let mut obj = String::new();
        for i in 0..side * side {
            let [x, z] = corner(i);
            obj += &format!("v {x} 0 {z}\n");
        }
        for row in 0..cells {
            for column in 0..cells {
                let first = row * side + column + 1;
                obj += &format!("f {first} {} {} {}\n", first + side, first + side + 1, first + 1);
            }
        }
        self.file(&format!("{name}.obj"), &obj);
    }

    pub fn production(&self, scene: &str) -> Result<Production> {
        Production::open(Scene::open(self.file("scene.toml", scene), false)?)
    }

    pub fn scene(&self, scene: &str, take: Take) -> Result<Sound> {
        let production = self.production(scene)?;
        let lines = production.channel_lines()?;
        let folder = &production.scene.folder;
        render(&production.channel_header(), folder, production.prototypes.clone(), lines, take)
    }

    /// A scene by way of its score in object space, written and read again.
    pub fn staged(&self, scene: &str, take: Take) -> Result<Sound> {
        let production = self.production(scene)?;
        let mut writer = ObjectWriter::new(Vec::new(), &production.header)?;
        for line in production.object_lines()? {
            writer.write(&line?)?;
        }
        self.score(&String::from_utf8(writer.finish()?).expect("a score is text"), take)
    }

    pub fn score(&self, score: &str, take: Take) -> Result<Sound> {
        let (header, prototypes, lines) = open_score(&self.file("test.score", score))?;
        render(&header, &self.path(""), prototypes, lines, take)
    }
}

pub fn write_wav(path: &Path, rate_hz: u32, channels: u16, interleaved: &[f32]) {
    let (bits_per_sample, sample_format) = (32, hound::SampleFormat::Float);
    let spec = hound::WavSpec { channels, sample_rate: rate_hz, bits_per_sample, sample_format };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    interleaved.iter().for_each(|&sample| writer.write_sample(sample).unwrap());
    writer.finalize().unwrap();
}

pub fn render(
    header: &ChannelHeader,
    folder: &Path,
    prototypes: Soundings,
    lines: ChannelLines<'_>,
    take: Take,
) -> Result<Sound> {
    let channels = header.channels().len();
    let Take { rate_hz, from_s, to_s, cores } = take;
    let extent = Extent { rate_hz, from_s, to_s, duration_s: header.duration_s };
    let receivers = receivers::load(header, folder, rate_hz)?;
    let mut mixer = Mixer::new(rate_hz, receivers, prototypes, lines)?.with_seed(header.seed);
    let mut sound = Sound {
        rate_hz: f64::from(rate_hz),
        channels,
        mix: vec![],
        stems: vec![],
        begun: vec![],
        most_threads: 0,
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(cores).build().unwrap();
    pool.install(|| {
        offline::render(&mut mixer, channels, &extent, true, |piece| {
            let before = sound.mix.len();
            sound.mix.extend(piece.mix);
            sound.begun.extend(piece.begun.iter().cloned());
            for object in &piece.objects[sound.stems.len()..] {
                sound.stems.push((object.clone(), vec![0.0; before]));
            }
            for (object, samples) in piece.stems {
                sound.stems[*object].1.extend(samples);
            }
            for (_, samples) in &mut sound.stems {
                samples.resize(sound.mix.len(), 0.0);
            }
            Ok(())
        })
    })?;
    Ok(sound)
}

/// What a live engine is told, rendered as a file is.
pub fn replayed(scene: Scene, settings: EngineSettings, tell: impl FnOnce(&mut Handle) + Send) -> Vec<f32> {
    let (rate_hz, mut mix) = (settings.rate_hz, Vec::new());
    let tell = |handle: &mut Handle| {
        tell(handle);
        Ok(())
    };
    live::replay(scene, settings, tell, |mixer, header| {
        let extent = Extent { rate_hz, from_s: 0.0, to_s: None, duration_s: None };
        offline::render(mixer, header.channels().len(), &extent, false, |piece| {
            mix.extend_from_slice(piece.mix);
            Ok(())
        })
    })
    .unwrap();
    mix
}

/// A number in (−1, 1) for every index: white noise that is the same in every run.
pub fn noise(length: usize, seed: u64) -> Vec<f32> {
    let random = froufrou::random::Random::new(seed, 99);
    (0..length as u64).map(|i| (random.uniform(i) * 2.0 - 1.0) as f32).collect()
}

/// A whole number of periods of a sine of amplitude 1 that begins at a phase, in turns.
pub fn tone(rate_hz: u32, frequency_hz: f64, frames: usize, phase: f64) -> Vec<f32> {
    let turns = |n: usize| frequency_hz * n as f64 / f64::from(rate_hz) + phase;
    (0..frames).map(|n| (turns(n) * std::f64::consts::TAU).sin() as f32).collect()
}
