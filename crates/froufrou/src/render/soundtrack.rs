//! The files of a soundtrack: the mix, its stems, and what was measured on the way.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

use super::broadcast::{Broadcast, Description};
use super::flac;
use super::format::{SampleFormat, SoundFormat};
use super::labels::Labels;
use super::meter::{Meter, Report};
use super::offline::{self, Extent, Piece};
use super::sound_file::{Container, SoundWriter};
use super::speakers;
use crate::score::ChannelLine;
use crate::synth::mixer::{Begun, Mixer};
use crate::{Error, Result};

/// What files to write, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Output {
    /// The mix: WAV or FLAC by the ending of its name.
    pub path: PathBuf,
    /// The folder for a file an object, if stems are wanted; it is made if need be.
    pub stems: Option<PathBuf>,
    /// How samples are stored.
    pub samples: SampleFormat,
    /// The seed of the dither.
    pub seed: u64,
    /// Gain of everything, in decibels.
    pub gain_db: f64,
    /// The true peak that the mix is brought to, in dBTP, on top of `gain_db`.
    pub normalize_dbtp: Option<f64>,
    /// The names of the channels, which tell their loudspeakers (see [`speakers`]); none: as usual
    /// for their number.
    pub channel_names: Vec<String>,
    /// What the files say of themselves.
    pub description: Description,
}

/// What was written.
#[derive(Debug)]
pub struct Summary {
    /// What the mix measures.
    pub report: Report,
    /// The gain that was applied, in decibels.
    pub gain_db: f64,
    /// The stems: the object's name and its file.
    pub stems: Vec<(String, PathBuf)>,
    /// Threads that begun.
    pub threads: u64,
    /// Samples that were too loud for the file's format and were clamped.
    pub clipped: u64,
    /// Synthesised sounds that failed and fell silent, where the mixer keeps going.
    pub silenced: u64,
    /// Why the first of them did.
    pub faults: Vec<Error>,
}

/// Renders a soundtrack to files. Nothing is seen under their names before all is done.
///
/// `progress` is told the frames done so far; `log` every thread as it begins, in order.
///
/// # Errors
/// A line of the score that cannot be read; a file that cannot be written; whatever `log` returns.
pub fn write<L: Iterator<Item = Result<ChannelLine>>>(
    mixer: &mut Mixer<L>,
    channels: usize,
    extent: &Extent,
    output: &Output,
    progress: &mut dyn FnMut(u64),
    log: &mut dyn FnMut(&Begun) -> Result<()>,
) -> Result<Summary> {
    let (first_frame, _) = extent.frames();
    let container = Container::of(&output.path)?;
    let format = SoundFormat {
        rate_hz: extent.rate_hz,
        channels,
        samples: output.samples,
        seed: output.seed,
        first_frame,
    };
    let broadcast =
        Broadcast::new(&output.description, &format).map_err(|fault| fault.in_file(&output.path))?;
    let channel_mask = match output.channel_names.as_slice() {
        [] => speakers::usual_mask(channels),
        names => speakers::mask(names),
    };
    let labels = Labels { channel_mask, broadcast: Some(broadcast) };
    let kind = Kind { container, format, labels, is_spooled: output.normalize_dbtp.is_some() };
    let gain = 10f64.powf(output.gain_db / 20.0) as f32;
    let mut meter = Meter::new(extent.rate_hz, channels)?;
    let mut mix = Track::create(&output.path, &kind)?;
    let mut stems =
        Stems { folder: output.stems.as_deref(), kind: &kind, tracks: Vec::new(), names: BTreeSet::new() };
    if let Some(folder) = &output.stems {
        std::fs::create_dir_all(folder).map_err(|fault| Error::io("make the folder", folder, fault))?;
    }
    let mut threads = 0;
    let mut scaled = Vec::new();
    let mut known_end = first_frame;
    offline::render(mixer, channels, extent, output.stems.is_some(), |piece: Piece<'_>| {
        if piece.reaches > known_end {
            known_end = piece.reaches;
            // Said at once, not when the disk is full.
            let done = mix.frames;
            kind.check(piece.reaches.saturating_sub(first_frame), done, &output.path)?;
        }
        for begun in piece.begun {
            threads += 1;
            log(begun)?;
        }
        amplify(&mut scaled, piece.mix, gain)?;
        meter.add(&scaled)?;
        mix.write(&scaled)?;
        stems.write(&piece, gain, &mut scaled)?;
        progress(piece.frames.end.saturating_sub(first_frame));
        Ok(())
    })?;
    let mut report = meter.finish();
    if report.frames == 0 && extent.from_s > 0.0 {
        return Err(Error::new(format!("the soundtrack is over before {} s", extent.from_s))
            .help("begin earlier, or give the scene a longer `duration`"));
    }
    let mut gain_db = output.gain_db;
    let mut gain = 1.0;
    if let (Some(target), Some(peak)) = (output.normalize_dbtp, report.true_peak_dbtp) {
        gain_db += target - peak;
        // What is next to nothing is brought up as far as a number goes.
        gain = 10f64.powf((target - peak) / 20.0).min(f64::from(f32::MAX)) as f32;
        // What is in the file is measured, not what it was made from.
        let mut meter = Meter::new(extent.rate_hz, channels)?;
        mix.replay(gain, |samples| meter.add(samples))?;
        report = meter.finish();
    }
    let mut files = Vec::new();
    for (name, path, track) in stems.tracks {
        track.finish(gain)?;
        files.push((name, path));
    }
    mix.writer.measured(&report);
    // Last, so that where there is a mix there is everything.
    let clipped = mix.finish(gain)?;
    let (silenced, faults) = mixer.take_faults();
    Ok(Summary { report, gain_db, stems: files, threads, clipped, silenced, faults })
}

fn amplify(to: &mut Vec<f32>, from: &[f32], gain: f32) -> Result<()> {
    to.clear();
    to.extend(from.iter().map(|sample| sample * gain));
    if to.iter().all(|sample| sample.is_finite()) {
        return Ok(());
    }
    Err(Error::new("a sound is beyond all numbers").help("a gain is too large"))
}

/// What all files of a soundtrack are like.
struct Kind {
    container: Container,
    format: SoundFormat,
    labels: Labels,
    /// Whether the gain is known only at the end.
    is_spooled: bool,
}

impl Kind {
    /// Refuses a sound that cannot be written to its end, as far as that is known beforehand: of so
    /// many frames, of which some are done.
    fn check(&self, frames: u64, done: u64, path: &Path) -> Result<()> {
        if self.container == Container::Flac && frames > flac::MAX_FRAMES {
            return Err(Error::new("the sound is longer than a FLAC file can be: 2^36 frames")
                .in_file(path)
                .help("render shorter ranges, or a WAV file"));
        }
        let spooled = if self.is_spooled { size_of::<f32>() } else { 0 };
        // How far FLAC will shrink it nobody knows.
        let stored = if self.container == Container::Wav { self.format.samples.bytes() } else { 0 };
        let needed =
            frames.saturating_sub(done).saturating_mul((self.format.channels * (stored + spooled)) as u64);
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        match fs4::available_space(folder) {
            Ok(room) if needed > room => {
                let gigabytes = |bytes: u64| format!("{:.1} GB", bytes as f64 / 1e9);
                let what = format!(
                    "the sound takes {}, and the disk has room for {}",
                    gigabytes(needed),
                    gigabytes(room)
                );
                Err(Error::new(what)
                    .in_file(path)
                    .help("render shorter ranges, fewer channels or fewer bits, or FLAC"))
            }
            // Where the system does not tell, the disk will.
            _ => Ok(()),
        }
    }
}

/// One file on its way: written at once, or, where the gain is known only at the end, kept beside.
struct Track {
    writer: SoundWriter,
    spool: Option<Spool>,
    channels: usize,
    /// Frames so far.
    frames: u64,
}

impl Track {
    fn create(path: &Path, kind: &Kind) -> Result<Self> {
        let writer = SoundWriter::create(kind.container, path, kind.format, kind.labels.clone())?;
        let spool = kind.is_spooled.then(|| Spool::beside(path)).transpose()?;
        Ok(Self { writer, spool, channels: kind.format.channels, frames: 0 })
    }

    fn write(&mut self, samples: &[f32]) -> Result<()> {
        self.frames += (samples.len() / self.channels) as u64;
        match &mut self.spool {
            Some(spool) => spool.write(samples),
            None => self.writer.write(samples),
        }
    }

    /// Passes through what was kept, with a gain.
    fn replay(&mut self, gain: f32, each: impl FnMut(&[f32]) -> Result<()>) -> Result<()> {
        self.spool.as_mut().map_or(Ok(()), |spool| spool.read(gain, each))
    }

    /// Gives the number of samples that were clamped.
    fn finish(mut self, gain: f32) -> Result<u64> {
        if let Some(mut spool) = self.spool.take() {
            spool.read(gain, |samples| self.writer.write(samples))?;
        }
        Ok(self.writer.finish()?.clipped)
    }
}

/// Samples kept in a nameless file.
struct Spool {
    file: File,
    path: PathBuf,
    samples: u64,
}

/// Samples that a spool reads at a time.
const SPOOL_SAMPLES: usize = 1 << 16;

impl Spool {
    /// In the folder of the file it is for, which has the room.
    fn beside(path: &Path) -> Result<Self> {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let file = tempfile::tempfile_in(folder).map_err(|fault| Error::io("write beside", path, fault))?;
        Ok(Self { file, path: path.to_owned(), samples: 0 })
    }

    fn write(&mut self, samples: &[f32]) -> Result<()> {
        let mut file = BufWriter::new(&self.file);
        let written = samples.iter().try_for_each(|sample| file.write_all(&sample.to_le_bytes()));
        written.and_then(|()| file.flush()).map_err(|fault| Error::io("write beside", &self.path, fault))?;
        self.samples += samples.len() as u64;
        Ok(())
    }

    fn read(&mut self, gain: f32, mut each: impl FnMut(&[f32]) -> Result<()>) -> Result<()> {
        let fail = |fault| Error::io("read back what was kept beside", &self.path, fault);
        self.file.rewind().map_err(fail)?;
        let mut file = BufReader::new(&self.file);
        let mut left = self.samples;
        while left > 0 {
            let count = left.min(SPOOL_SAMPLES as u64) as usize;
            let mut bytes = vec![0; 4 * count];
            file.read_exact(&mut bytes).map_err(fail)?;
            let samples = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]) * gain);
            each(&samples.collect::<Vec<f32>>())?;
            left -= count as u64;
        }
        Ok(())
    }
}

/// A file an object.
struct Stems<'a> {
    folder: Option<&'a Path>,
    kind: &'a Kind,
    /// The object's name and its file, by the object's index; those that have sounded.
    tracks: Vec<(String, PathBuf, Track)>,
    names: BTreeSet<String>,
}

impl Stems<'_> {
    fn write(&mut self, piece: &Piece<'_>, gain: f32, scaled: &mut Vec<f32>) -> Result<()> {
        let Some(folder) = self.folder else { return Ok(()) };
        let format = self.kind.format;
        while self.tracks.len() < piece.objects.len() {
            let object = &piece.objects[self.tracks.len()];
            let path = folder.join(self.file_name(object));
            let mut track = Track::create(&path, self.kind)?;
            // Before an object first sounds its stem is silent.
            let silence = vec![0.0; SPOOL_SAMPLES / format.channels * format.channels];
            let frames = piece.frames.start.saturating_sub(format.first_frame);
            let mut left = frames as usize * format.channels;
            while left > 0 {
                let count = left.min(silence.len());
                track.write(&silence[..count])?;
                left -= count;
            }
            self.tracks.push((object.clone(), path, track));
        }
        for (index, (_, _, track)) in self.tracks.iter_mut().enumerate() {
            match piece.stems.iter().find(|(object, _)| *object == index) {
                Some((_, samples)) => amplify(scaled, samples, gain)?,
                None => amplify(scaled, &vec![0.0; piece.mix.len()], gain)?,
            }
            track.write(scaled)?;
        }
        Ok(())
    }

    /// A name that any file system takes, unlike those before.
    fn file_name(&mut self, object: &str) -> String {
        let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let base: String = object.trim_matches('/').chars().map(plain).take(100).collect();
        let base = if base.trim_matches('.').is_empty() { "other".to_owned() } else { base };
        let ending = self.kind.container.ending();
        let mut name = format!("{base}.{ending}");
        let mut number = 2;
        // Some file systems do not tell capitals apart.
        while !self.names.insert(name.to_lowercase()) {
            name = format!("{base}-{number}.{ending}");
            number += 1;
        }
        name
    }
}
