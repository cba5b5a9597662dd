//! Writing WAV files block by block.
//!
//! A file appears under its name when it is complete: until then it is a temporary one in the same
//! folder, and what lay under the name before is untouched.

use std::fmt;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::WholeFile;
use crate::error::{Error, Result};
use crate::random::Random;

/// The size in its header has 32 bits; the header itself takes fewer bytes than what is left here.
const MAX_DATA_BYTES: u64 = u32::MAX as u64 - 128;

/// The most channels of a file.
const MAX_CHANNELS: usize = 64;

/// How samples are stored.
///
/// ```
/// use froufrou::render::wav::SampleFormat;
/// assert_eq!("24".parse::<SampleFormat>()?, SampleFormat::Int24);
/// assert_eq!(SampleFormat::Float32.to_string(), "32f");
/// assert!("20".parse::<SampleFormat>().is_err());
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleFormat {
    /// Integers of 16 bits, with triangular dither of ±1 step.
    Int16,
    /// Integers of 24 bits, rounded.
    Int24,
    /// Floats of 32 bits, as they are.
    Float32,
}

impl SampleFormat {
    /// Bits that one sample takes.
    pub fn bits(self) -> u16 {
        match self {
            Self::Int16 => 16,
            Self::Int24 => 24,
            Self::Float32 => 32,
        }
    }
}

impl FromStr for SampleFormat {
    type Err = Error;

    /// Reads "16", "24" or "32f".
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "16" => Ok(Self::Int16),
            "24" => Ok(Self::Int24),
            "32f" => Ok(Self::Float32),
            _ => Err(Error::new(format!("unknown sample format `{text}`, expected `16`, `24` or `32f`"))),
        }
    }
}

impl fmt::Display for SampleFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Int16 => "16",
            Self::Int24 => "24",
            Self::Float32 => "32f",
        })
    }
}

/// What a WAV file is to be like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WavFormat {
    /// Frames a second.
    pub rate_hz: u32,
    /// Channels, 1 to 64.
    pub channels: usize,
    /// How samples are stored.
    pub samples: SampleFormat,
    /// The seed of the dither.
    pub seed: u64,
    /// The index, in the whole soundtrack, of the first frame of this file. The dither of a frame
    /// depends on its index in the soundtrack: a range rendered alone has the same bytes as that
    /// range of the whole.
    pub first_frame: u64,
}

impl WavFormat {
    /// Refuses more frames than such a file can hold.
    ///
    /// # Errors
    /// Where they would take more than 4 GiB.
    pub fn check_frames(&self, frames: u64) -> Result<()> {
        let frame_bytes = self.channels as u64 * u64::from(self.samples.bits() / 8);
        if frames.checked_mul(frame_bytes).is_some_and(|bytes| bytes <= MAX_DATA_BYTES) {
            return Ok(());
        }
        Err(Error::new("the sound is longer than a WAV file can be: 4 GiB")
            .help("render shorter ranges, fewer channels or fewer bits"))
    }
}

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Written {
    /// Frames.
    pub frames: u64,
    /// Samples, over all channels, beyond what integers hold ([−1, 1) once rounded): they were clamped.
    /// Floats are never clamped and this is 0.
    pub clipped: u64,
    /// Samples that were not a number, written as silence to integers and as they are to floats.
    pub not_a_number: u64,
}

/// Writes one WAV file, block by block.
///
/// ```
/// use froufrou::render::wav::{SampleFormat, WavFormat, WavWriter};
/// let folder = tempfile::tempdir().unwrap();
/// let path = folder.path().join("out.wav");
/// let format =
///     WavFormat { rate_hz: 48_000, channels: 2, samples: SampleFormat::Int24, seed: 0, first_frame: 0 };
/// let mut writer = WavWriter::create(&path, format)?;
/// writer.write(&[0.5, -0.5, 0.25, -0.25])?;
/// assert!(!path.exists());
/// assert_eq!(writer.finish()?.frames, 2);
/// assert!(path.exists());
/// # Ok::<(), froufrou::Error>(())
/// ```
pub struct WavWriter {
    path: PathBuf,
    format: WavFormat,
    dither: Vec<Random>,
    file: WholeFile,
    writer: hound::WavWriter<BufWriter<File>>,
    written: Written,
}

impl WavWriter {
    /// Begins a file. Nothing is seen under its name before [`WavWriter::finish`].
    ///
    /// # Errors
    /// Where the folder is missing or cannot be written to, something that is not a file lies under
    /// the name, the rate is 0, or the channels are not 1 to 64.
    pub fn create(path: impl AsRef<Path>, format: WavFormat) -> Result<Self> {
        let path = path.as_ref();
        if !(1..=MAX_CHANNELS).contains(&format.channels) {
            return Err(Error::new(format!(
                "a WAV file of {} channels was asked for, expected 1 to {MAX_CHANNELS}",
                format.channels
            ))
            .in_file(path));
        }
        // The header gives the bytes of a second in 32 bits.
        let frame_bytes = format.channels as u32 * u32::from(format.samples.bits() / 8);
        if format.rate_hz == 0 || format.rate_hz.checked_mul(frame_bytes).is_none() {
            return Err(
                Error::new(format!("a WAV file cannot have a rate of {} Hz", format.rate_hz)).in_file(path)
            );
        }
        let file = WholeFile::create(path)?;
        let handle = file.handle()?;
        let spec = hound::WavSpec {
            channels: format.channels as u16,
            sample_rate: format.rate_hz,
            bits_per_sample: format.samples.bits(),
            sample_format: match format.samples {
                SampleFormat::Float32 => hound::SampleFormat::Float,
                _ => hound::SampleFormat::Int,
            },
        };
        let writer = hound::WavWriter::new(BufWriter::with_capacity(1 << 16, handle), spec)
            .map_err(|e| failed(path, e))?;
        let dither = (0..format.channels as u64).map(|channel| Random::new(format.seed, channel)).collect();
        let written = Written { frames: 0, clipped: 0, not_a_number: 0 };
        Ok(Self { path: path.to_owned(), format, dither, file, writer, written })
    }

    /// Writes the next frames, their channels interleaved.
    ///
    /// # Errors
    /// Where the length is not a multiple of the channels, the disk is full, or the file would grow
    /// beyond 4 GiB (then nothing of the block is written).
    pub fn write(&mut self, interleaved: &[f32]) -> Result<()> {
        let channels = self.format.channels;
        if !interleaved.len().is_multiple_of(channels) {
            return Err(Error::new(format!(
                "a block of {} samples was given, expected a multiple of the {channels} channels",
                interleaved.len()
            ))
            .in_file(&self.path));
        }
        let frames = self.written.frames + (interleaved.len() / channels) as u64;
        self.format.check_frames(frames).map_err(|fault| fault.in_file(&self.path))?;
        for frame in interleaved.chunks_exact(channels) {
            let index = self.format.first_frame.wrapping_add(self.written.frames);
            for (sample, dither) in frame.iter().zip(&self.dither) {
                self.written.not_a_number += u64::from(sample.is_nan());
                let result = match self.format.samples {
                    SampleFormat::Float32 => self.writer.write_sample(*sample),
                    SampleFormat::Int24 => {
                        let steps = f64::from(*sample) * 8_388_608.0;
                        self.writer.write_sample(round(steps, 24, &mut self.written.clipped))
                    }
                    SampleFormat::Int16 => {
                        let steps = f64::from(*sample) * 32_768.0;
                        // Silence stays silence.
                        let noise = if *sample == 0.0 { 0.0 } else { triangular(*dither, index) };
                        self.writer.write_sample(round(steps + noise, 16, &mut self.written.clipped))
                    }
                };
                result.map_err(|e| failed(&self.path, e))?;
            }
            self.written.frames += 1;
        }
        Ok(())
    }

    /// Completes the file and gives it its name, in place of an earlier one.
    ///
    /// # Errors
    /// Where the disk is full or the name has become impossible; then the earlier file is untouched.
    pub fn finish(self) -> Result<Written> {
        let Self { path, file, writer, written, .. } = self;
        writer.finalize().map_err(|e| failed(&path, e))?;
        file.finish()?;
        Ok(written)
    }

    /// What has been written so far.
    pub fn written(&self) -> Written {
        self.written
    }
}

/// The error of a write that failed.
fn failed(path: &Path, error: hound::Error) -> Error {
    match error {
        hound::Error::IoError(error) => Error::io("write", path, error),
        other => Error::new(format!("cannot write the file: {other}")).in_file(path).because(other),
    }
}

/// The nearest step that so many bits hold; counts those beyond. Not a number gives 0.
fn round(steps: f64, bits: u32, clipped: &mut u64) -> i32 {
    let limit = f64::from(1u32 << (bits - 1));
    let rounded = steps.round();
    *clipped += u64::from(rounded < -limit || rounded >= limit);
    rounded.clamp(-limit, limit - 1.0) as i32
}

/// A number in (−1, 1) of triangular density: the difference of two uniform ones.
fn triangular(random: Random, index: u64) -> f64 {
    let bits = random.bits(index);
    ((bits >> 32) as f64 - (bits & 0xffff_ffff) as f64) / 4_294_967_296.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corpus::recording::Recording;

    fn format(samples: SampleFormat, channels: usize) -> WavFormat {
        WavFormat { rate_hz: 48_000, channels, samples, seed: 7, first_frame: 0 }
    }

    fn write(path: &Path, format: WavFormat, interleaved: &[f32]) -> Written {
        let mut writer = WavWriter::create(path, format).unwrap();
        writer.write(interleaved).unwrap();
        writer.finish().unwrap()
    }

    fn sound(frames: usize, channels: usize) -> Vec<f32> {
        (0..frames * channels).map(|i| 0.7 * (i as f32 * 0.37).sin()).collect()
    }

    #[test]
    fn what_is_written_is_read_in_every_format_and_channel_count() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.wav");
        let formats = [
            (SampleFormat::Int16, 1.51 / 32768.0),
            (SampleFormat::Int24, 0.51 / 8388608.0),
            (SampleFormat::Float32, 0.0),
        ];
        for (samples, tolerance) in formats {
            for (channels, rate_hz) in
                [(1, 8_000), (2, 44_100), (6, 48_000), (8, 192_000), (19, 96_000), (64, 48_000)]
            {
                let sound = sound(100, channels);
                let written = write(&path, WavFormat { rate_hz, ..format(samples, channels) }, &sound);
                assert_eq!(written, Written { frames: 100, clipped: 0, not_a_number: 0 });
                let recording = Recording::open(&path).unwrap();
                assert_eq!((recording.rate_hz, recording.channels.len()), (rate_hz, channels));
                assert_eq!(recording.frames(), 100);
                for (i, expected) in sound.iter().enumerate() {
                    let error = (recording.channels[i % channels][i / channels] - expected).abs();
                    assert!(error <= tolerance, "{samples} {channels}: {error}");
                }
            }
        }
    }

    #[test]
    fn a_range_alone_has_the_bytes_of_that_range_of_the_whole() {
        let folder = tempfile::tempdir().unwrap();
        let (whole, part) = (folder.path().join("whole.wav"), folder.path().join("part.wav"));
        let sound = sound(1000, 2);
        write(&whole, format(SampleFormat::Int16, 2), &sound);
        let mut writer =
            WavWriter::create(&part, WavFormat { first_frame: 300, ..format(SampleFormat::Int16, 2) })
                .unwrap();
        // In blocks of another size, too.
        for block in sound[600..1400].chunks(14) {
            writer.write(block).unwrap();
        }
        writer.finish().unwrap();
        let (whole, part) = (std::fs::read(whole).unwrap(), std::fs::read(part).unwrap());
        assert_eq!(part[44..], whole[44 + 1200..44 + 2800]);
    }

    #[test]
    fn dither_is_triangular_and_makes_the_error_independent_of_the_sound() {
        // A constant of a third of a step would vanish without dither: with it, its mean stays.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.wav");
        for steps in [0.1f64, 0.33, 0.5, 7.25] {
            let value = (steps / 32768.0) as f32;
            write(&path, format(SampleFormat::Int16, 1), &vec![value; 40_000]);
            let recording = Recording::open(&path).unwrap();
            let errors: Vec<f64> =
                recording.channels[0].iter().map(|v| f64::from(*v) * 32768.0 - steps).collect();
            let mean = errors.iter().sum::<f64>() / errors.len() as f64;
            let power = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
            assert!(mean.abs() < 0.012, "{steps}: {mean}");
            // A uniform rounding error and triangular noise: 1/12 + 1/6 of a step squared.
            assert!((power - 0.25).abs() < 0.012, "{steps}: {power}");
        }
        let [a, b] = [0, 1].map(|channel| triangular(Random::new(7, channel), 5));
        assert_ne!(a, b, "channels have dither of their own");
    }

    #[test]
    fn silence_stays_silence() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.wav");
        write(&path, format(SampleFormat::Int16, 2), &[0.0, -0.0, 0.0, 0.0]);
        assert!(std::fs::read(&path).unwrap()[44..].iter().all(|b| *b == 0));
    }

    #[test]
    fn integers_clamp_and_count_what_is_beyond_and_floats_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.wav");
        let sound = [1.5, -1.5, 1.0, -1.0, f32::NAN, f32::INFINITY, 0.5, 0.0];
        let written = write(&path, format(SampleFormat::Int24, 1), &sound);
        assert_eq!((written.clipped, written.not_a_number), (4, 1));
        let top = 8_388_607.0 / 8_388_608.0;
        let recording = Recording::open(&path).unwrap();
        assert_eq!(recording.channels[0], [top, -1.0, top, -1.0, 0.0, top, 0.5, 0.0]);
        let written = write(&path, format(SampleFormat::Float32, 1), &[2.5, -7.0]);
        assert_eq!(written.clipped, 0);
        assert_eq!(Recording::open(&path).unwrap().channels[0], [2.5, -7.0]);
    }

    #[test]
    fn an_unfinished_file_leaves_the_earlier_one_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.wav");
        write(&path, format(SampleFormat::Int24, 1), &[0.5; 10]);
        let earlier = std::fs::read(&path).unwrap();
        let mut writer = WavWriter::create(&path, format(SampleFormat::Int24, 1)).unwrap();
        writer.write(&[0.1; 100_000]).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
        assert_eq!(std::fs::read(&path).unwrap(), earlier);
        drop(writer);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert_eq!(std::fs::read(&path).unwrap(), earlier);
    }

    #[test]
    fn a_file_beyond_4_gib_is_refused_before_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer =
            WavWriter::create(folder.path().join("x.wav"), format(SampleFormat::Float32, 2)).unwrap();
        // As if so many frames had been written.
        writer.written.frames = (MAX_DATA_BYTES / 8) - 1;
        writer.write(&[0.0; 2]).unwrap();
        let error = writer.write(&[0.0; 2]).unwrap_err().to_string();
        assert!(error.contains("4 GiB") && error.contains("x.wav"), "{error}");
    }

    #[test]
    fn what_cannot_be_written_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str, format| {
            WavWriter::create(folder.path().join(name), format).err().unwrap().to_string()
        };
        let good = format(SampleFormat::Int16, 2);
        assert!(at("missing/x.wav", good).contains("cannot create"));
        assert!(at("", good).contains("a folder"));
        assert!(at("x.wav", WavFormat { channels: 0, ..good }).contains("0 channels"));
        assert!(at("x.wav", WavFormat { channels: 65, ..good }).contains("65 channels"));
        assert!(at("x.wav", WavFormat { rate_hz: 0, ..good }).contains("0 Hz"));
        let mut writer = WavWriter::create(folder.path().join("x.wav"), good).unwrap();
        assert!(writer.write(&[0.0; 3]).unwrap_err().to_string().contains("multiple of the 2 channels"));
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_not_replaced_by_a_file_and_a_link_is_followed() {
        let good = format(SampleFormat::Int16, 1);
        assert!(WavWriter::create("/dev/null", good).err().unwrap().to_string().contains("a device"));
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file.wav"), folder.path().join("link.wav"));
        write(&file, good, &[0.0; 10]);
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write(&link, good, &[0.0; 20]);
        assert!(link.is_symlink());
        assert_eq!(Recording::open(&file).unwrap().frames(), 20);
        use std::os::unix::fs::PermissionsExt;
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
        let plain = folder.path().join("plain");
        File::create(&plain).unwrap();
        assert_eq!(mode(&file), mode(&plain));
    }

    #[test]
    fn formats_have_names() {
        for format in [SampleFormat::Int16, SampleFormat::Int24, SampleFormat::Float32] {
            assert_eq!(format.to_string().parse::<SampleFormat>().unwrap(), format);
        }
        let error = "32".parse::<SampleFormat>().unwrap_err().to_string();
        assert_eq!(error, "unknown sample format `32`, expected `16`, `24` or `32f`");
    }
}
