//! Writing FLAC files block by block (RFC 9639).
//!
//! The encoder is our own: of the published ones in Rust none has Rice parameters long enough for
//! samples of 24 bits, nor rates above 96 kHz. Blocks are encoded on the cores of the surrounding
//! rayon pool and written in order, so memory does not grow with the sound. What is known only at
//! the end (length, checksum, loudness) is filled in then, where room was left for it.

mod bits;
mod frame;
mod predict;
mod rice;

use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use md5::{Digest, Md5};
use rayon::prelude::*;

use super::format::{SampleFormat, SoundFormat, Written};
use super::labels::Labels;
use super::meter::Report;
use super::quantize::Quantizer;
use super::speakers;
use crate::WholeFile;
use crate::error::{Error, Result};

/// The most channels of a file.
const MAX_CHANNELS: usize = 8;

/// The highest rate that 20 bits hold.
const MAX_RATE_HZ: u32 = (1 << 20) - 1;

/// Frames of a block: about the longest that the streamable subset allows up to 48 kHz.
const BLOCK_FRAMES: usize = 4096;

/// Blocks that are encoded at once.
const BLOCKS: usize = 16;

/// Room for what the tags grow by at the end, and for other programs' tags.
const PADDING_BYTES: usize = 4096;

/// The most bytes of a block of metadata.
const MAX_METADATA_BYTES: usize = (1 << 24) - 1;

/// The most frames that the beginning of a file can tell: 36 bits.
pub(super) const MAX_FRAMES: u64 = (1 << 36) - 1;

/// Writes one FLAC file, block by block.
///
/// ```
/// use froufrou::render::flac::FlacWriter;
/// use froufrou::render::format::{SampleFormat, SoundFormat};
/// let folder = tempfile::tempdir().unwrap();
/// let path = folder.path().join("out.flac");
/// let format =
///     SoundFormat { rate_hz: 48_000, channels: 2, samples: SampleFormat::Int24, seed: 0, first_frame: 0 };
/// let mut writer = FlacWriter::create(&path, format)?;
/// writer.write(&[0.5, -0.5, 0.25, -0.25])?;
/// assert_eq!(writer.finish()?.frames, 2);
/// # Ok::<(), froufrou::Error>(())
/// ```
pub struct FlacWriter {
    path: PathBuf,
    format: SoundFormat,
    quantizer: Quantizer,
    file: BufWriter<WholeFile>,
    labels: Labels,
    /// Bytes before the first frame of sound.
    head_bytes: usize,
    /// Samples that wait for their block to be full.
    pending: Vec<i32>,
    blocks: u64,
    least_bytes: usize,
    most_bytes: usize,
    digest: Md5,
}

impl FlacWriter {
    /// Begins a file of channels as FLAC assigns them by their number. Nothing is seen under its name
    /// before [`FlacWriter::finish`].
    ///
    /// # Errors
    /// Where the folder is missing or cannot be written to, something that is not a file lies under
    /// the name, the samples are floats, the channels are not 1 to 8, or the rate is 0 or above
    /// 1048575 Hz.
    pub fn create(path: impl AsRef<Path>, format: SoundFormat) -> Result<Self> {
        let labels = Labels { channel_mask: speakers::flac_mask(format.channels), broadcast: None };
        Self::labelled(path, format, labels)
    }

    /// Begins a file with tags that say which loudspeakers its channels are for, and what it is.
    ///
    /// FLAC gives channels their places by their number: 1, mono; 2, left and right; 3, with a centre;
    /// 4, with two in the back; 5, both; 6, 5.1; 7, 6.1; 8, 7.1. Channels of other places or of none
    /// are stored all the same, with the tag `WAVEFORMATEXTENSIBLE_CHANNEL_MASK`; a reader that does
    /// not know it takes them for the places of their number.
    ///
    /// # Errors
    /// Those of [`FlacWriter::create`]; a description of more than 16 MB.
    pub fn labelled(path: impl AsRef<Path>, format: SoundFormat, labels: Labels) -> Result<Self> {
        let path = path.as_ref();
        let refuse = |what: String, help: &str| Err(Error::new(what).in_file(path).help(help.to_owned()));
        if format.samples == SampleFormat::Float32 {
            return refuse(
                "FLAC has no float samples".into(),
                "use `--format 24` or `--format 16`, or write a WAV file",
            );
        }
        if !(1..=MAX_CHANNELS).contains(&format.channels) {
            let what = format!("a FLAC file has 1 to {MAX_CHANNELS} channels, not {}", format.channels);
            return refuse(what, "write a WAV file");
        }
        if !(1..=MAX_RATE_HZ).contains(&format.rate_hz) {
            let what = format!("a FLAC file cannot have a rate of {} Hz", format.rate_hz);
            return refuse(what, "take one up to 192000 Hz");
        }
        let comment_bytes = comment(&format, &labels).len();
        if comment_bytes + PADDING_BYTES > MAX_METADATA_BYTES {
            return refuse(format!("the tags take {comment_bytes} bytes"), "give a shorter description");
        }
        let head_bytes = 4 + (4 + 34) + (4 + comment_bytes) + (4 + PADDING_BYTES);
        let mut file = BufWriter::with_capacity(1 << 16, WholeFile::create(path)?);
        file.write_all(&vec![0; head_bytes]).map_err(|fault| Error::io("write", path, fault))?;
        Ok(Self {
            path: path.to_owned(),
            format,
            quantizer: Quantizer::new(format),
            file,
            labels,
            head_bytes,
            pending: Vec::new(),
            blocks: 0,
            least_bytes: usize::MAX,
            most_bytes: 0,
            digest: Md5::new(),
        })
    }

    /// Writes the next frames, their channels interleaved.
    ///
    /// # Errors
    /// Where the length is not a multiple of the channels or the disk is full.
    pub fn write(&mut self, interleaved: &[f32]) -> Result<()> {
        self.quantizer.check(interleaved, &self.path)?;
        let bytes_each = self.format.samples.bytes();
        for part in interleaved.chunks(BLOCKS * BLOCK_FRAMES * self.format.channels) {
            let from = self.pending.len();
            self.quantizer.integers(part, |step| self.pending.push(step));
            let mut bytes = Vec::with_capacity(part.len() * bytes_each);
            let added = &self.pending[from..];
            added.iter().for_each(|step| bytes.extend_from_slice(&step.to_le_bytes()[..bytes_each]));
            self.digest.update(&bytes);
            let block = BLOCK_FRAMES * self.format.channels;
            self.encode(self.pending.len() / block * block)?;
        }
        Ok(())
    }

    /// Encodes so many of the samples that wait.
    fn encode(&mut self, samples: usize) -> Result<()> {
        let SoundFormat { rate_hz, channels, samples: kind, .. } = self.format;
        let bits = u32::from(kind.bits());
        let first = self.blocks;
        let frames: Vec<Vec<u8>> = self.pending[..samples]
            .par_chunks(BLOCK_FRAMES * channels)
            .enumerate()
            .map(|(index, block)| frame::encode(block, channels, bits, rate_hz, first + index as u64))
            .collect();
        for frame in &frames {
            self.least_bytes = self.least_bytes.min(frame.len());
            self.most_bytes = self.most_bytes.max(frame.len());
            self.file.write_all(frame).map_err(|fault| Error::io("write", &self.path, fault))?;
        }
        self.blocks += frames.len() as u64;
        self.pending.drain(..samples);
        Ok(())
    }

    /// Takes what the sound measures into the tags, if there are any.
    pub fn measured(&mut self, report: &Report) {
        if let Some(broadcast) = &mut self.labels.broadcast {
            broadcast.measured(report);
        }
    }

    /// Completes the file and gives it its name, in place of an earlier one.
    ///
    /// # Errors
    /// Where the disk is full or the name has become impossible; then the earlier file is untouched.
    pub fn finish(mut self) -> Result<Written> {
        self.encode(self.pending.len())?;
        let written = self.quantizer.written();
        let head = self.head(written.frames);
        let complete = |file: &mut BufWriter<WholeFile>| {
            file.seek(SeekFrom::Start(0))?;
            file.write_all(&head)?;
            file.flush()
        };
        complete(&mut self.file).map_err(|fault| Error::io("write", &self.path, fault))?;
        let file =
            self.file.into_inner().map_err(|fault| Error::io("write", &self.path, fault.into_error()))?;
        file.finish()?;
        Ok(written)
    }

    /// What comes before the sound.
    fn head(&self, frames: u64) -> Vec<u8> {
        let mut head = b"fLaC".to_vec();
        let block = |head: &mut Vec<u8>, kind: u8, content: &[u8]| {
            head.push(kind);
            head.extend_from_slice(&(content.len() as u32).to_be_bytes()[1..]);
            head.extend_from_slice(content);
        };
        let least = if self.most_bytes == 0 { 0 } else { self.least_bytes };
        let info = stream_info(&self.format, frames, [least, self.most_bytes], &self.digest);
        block(&mut head, 0, &info);
        block(&mut head, 4, &comment(&self.format, &self.labels));
        let padding = self.head_bytes.saturating_sub(head.len() + 4);
        block(&mut head, 0x81, &vec![0; padding]);
        head
    }
}

/// What the beginning of a file tells of its sound, but for its tags.
fn stream_info(format: &SoundFormat, frames: u64, [least, most]: [usize; 2], digest: &Md5) -> Vec<u8> {
    let mut info = Vec::with_capacity(34);
    info.extend_from_slice(&(BLOCK_FRAMES as u16).to_be_bytes());
    info.extend_from_slice(&(BLOCK_FRAMES as u16).to_be_bytes());
    info.extend_from_slice(&(least as u32).to_be_bytes()[1..]);
    info.extend_from_slice(&(most as u32).to_be_bytes()[1..]);
    // Lengths beyond 36 bits are not told.
    let frames = if frames <= MAX_FRAMES { frames } else { 0 };
    let packed = u64::from(format.rate_hz) << 44
        | (format.channels as u64 - 1) << 41
        | (u64::from(format.samples.bits()) - 1) << 36
        | frames;
    info.extend_from_slice(&packed.to_be_bytes());
    info.extend_from_slice(&digest.clone().finalize());
    info
}

/// A whole file in memory of one channel of 16-bit samples, without tags and without room for any.
///
/// # Errors
/// Where the rate is 0 or above 1048575 Hz.
pub(crate) fn encode_mono(samples: &[i16], rate_hz: u32) -> Result<Vec<u8>> {
    if !(1..=MAX_RATE_HZ).contains(&rate_hz) {
        return Err(Error::new(format!("a FLAC file cannot have a rate of {rate_hz} Hz"))
            .help("take one up to 192000 Hz"));
    }
    let format = SoundFormat { rate_hz, channels: 1, samples: SampleFormat::Int16, seed: 0, first_frame: 0 };
    let mut digest = Md5::new();
    samples.iter().for_each(|sample| digest.update(sample.to_le_bytes()));
    let frames: Vec<Vec<u8>> = samples
        .par_chunks(BLOCK_FRAMES)
        .enumerate()
        .map(|(index, block)| {
            let block: Vec<i32> = block.iter().copied().map(i32::from).collect();
            frame::encode(&block, 1, 16, rate_hz, index as u64)
        })
        .collect();
    let sizes = || frames.iter().map(Vec::len);
    let bounds = [sizes().min().unwrap_or(0), sizes().max().unwrap_or(0)];
    let info = stream_info(&format, samples.len() as u64, bounds, &digest);
    let head = [b"fLaC", &[0x80, 0, 0, info.len() as u8][..], &info].concat();
    Ok([head, frames.concat()].concat())
}

/// The tags, as Vorbis comments.
fn comment(format: &SoundFormat, labels: &Labels) -> Vec<u8> {
    let mut tags = labels.broadcast.as_ref().map_or_else(Vec::new, |broadcast| broadcast.to_tags());
    if labels.channel_mask != speakers::flac_mask(format.channels) {
        tags.push(("WAVEFORMATEXTENSIBLE_CHANNEL_MASK", format!("{:#06x}", labels.channel_mask)));
    }
    let mut comment = Vec::new();
    let add = |text: &str, comment: &mut Vec<u8>| {
        comment.extend_from_slice(&(text.len() as u32).to_le_bytes());
        comment.extend_from_slice(text.as_bytes());
    };
    add(concat!("froufrou ", env!("CARGO_PKG_VERSION")), &mut comment);
    comment.extend_from_slice(&(tags.len() as u32).to_le_bytes());
    tags.iter().for_each(|(name, value)| add(&format!("{name}={value}"), &mut comment));
    comment
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corpus::recording::Recording;
    use crate::random::Random;
    use crate::render::wav::WavWriter;

    fn format(samples: SampleFormat, channels: usize) -> SoundFormat {
        SoundFormat { rate_hz: 48_000, channels, samples, seed: 7, first_frame: 0 }
    }

    /// What the same sound is as WAV and as FLAC, which checks its own MD5 as it is read.
    fn both(format: SoundFormat, sound: &[f32]) -> (Recording, Recording, u64) {
        let folder = tempfile::tempdir().unwrap();
        let (wav, flac) = (folder.path().join("x.wav"), folder.path().join("x.flac"));
        let mut plain = WavWriter::create(&wav, format).unwrap();
        plain.write(sound).unwrap();
        let mut writer = FlacWriter::create(&flac, format).unwrap();
        for block in sound.chunks(format.channels * 5003) {
            writer.write(block).unwrap();
        }
        assert_eq!(writer.finish().unwrap(), plain.finish().unwrap());
        let bytes = std::fs::metadata(&flac).unwrap().len();
        (Recording::open(&wav).unwrap(), Recording::open(&flac).unwrap(), bytes)
    }

    /// Sounds that are hard in a way each.
    fn sounds(frames: usize) -> Vec<(&'static str, Vec<f32>)> {
        let random = Random::new(11, 0);
        let make = |f: &dyn Fn(usize) -> f64| (0..frames).map(|i| f(i) as f32).collect::<Vec<_>>();
        vec![
            ("silence", make(&|_| 0.0)),
            ("a constant", make(&|_| -1.0)),
            ("full scale in turn", make(&|i| if i % 2 == 0 { 1.0 } else { -1.0 })),
            ("noise beyond full scale", make(&|i| 3.0 * random.uniform(i as u64) - 1.5)),
            ("loud bits", make(&|i| if random.uniform(i as u64) < 0.5 { -1.0 } else { 0.0 })),
            ("a sine", make(&|i| 0.9 * (0.03 * i as f64).sin())),
            ("a fast sine", make(&|i| (3.1 * i as f64).sin())),
            ("a click", make(&|i| if i == frames / 2 { 1.0 } else { 0.0 })),
            ("even steps", make(&|i| ((random.uniform(i as u64) * 8.0).floor() - 4.0) / 4.0)),
            ("a ramp", make(&|i| i as f64 / frames as f64 - 0.5)),
        ]
    }

    #[test]
    fn every_sound_is_what_a_wav_file_holds() {
        for samples in [SampleFormat::Int16, SampleFormat::Int24] {
            for (name, sound) in sounds(9001) {
                let (wav, flac, bytes) = both(format(samples, 1), &sound);
                assert!(wav == flac, "{name}");
                let verbatim = 9001 * samples.bytes() as u64 + 6000;
                assert!(bytes < verbatim, "{name}: {bytes}");
            }
        }
    }

    #[test]
    fn every_pair_of_sounds_is_held_in_two_channels() {
        let sounds = sounds(4500);
        for (_, left) in &sounds {
            for (_, right) in &sounds {
                let pair: Vec<f32> = left.iter().zip(right).flat_map(|(l, r)| [*l, *r]).collect();
                let (wav, flac, _) = both(format(SampleFormat::Int24, 2), &pair);
                assert!(wav == flac);
            }
        }
    }

    #[test]
    fn every_length_rate_and_number_of_channels_is_held() {
        let sounds = sounds(3000);
        for frames in [1, 2, 3, 5, 15, 16, 17, 63, 64, 65, 255, 2999] {
            for (_, sound) in &sounds {
                let (wav, flac, _) = both(format(SampleFormat::Int16, 1), &sound[..frames]);
                assert!(wav == flac, "{frames}");
            }
        }
        for channels in 1..=8 {
            let sound: Vec<f32> =
                (0..600).flat_map(|i| sounds.iter().take(channels).map(move |s| s.1[i])).collect();
            for rate_hz in [8_000, 11_025, 44_100, 50_000, 77_777, 88_200, 96_000, 100_010, 192_000] {
                let format = SoundFormat { rate_hz, ..format(SampleFormat::Int24, channels) };
                let (wav, flac, _) = both(format, &sound);
                assert!(wav == flac, "{channels} {rate_hz}");
            }
        }
    }

    #[test]
    fn a_tone_takes_few_bits_and_noise_not_more_than_it_has() {
        let sounds = sounds(96_000);
        let bits =
            |index: usize| both(format(SampleFormat::Int24, 1), &sounds[index].1).2 as f64 * 8.0 / 96_000.0;
        assert!(bits(5) < 6.0, "{}", bits(5));
        // A third of the noise is clipped, the rest has 23.4 bits.
        assert!(bits(3) < 24.5, "{}", bits(3));
    }

    #[test]
    fn a_file_in_memory_holds_its_samples() {
        for (name, sound) in sounds(9001) {
            let samples: Vec<i16> = sound.iter().map(|v| (v * 32_767.0) as i16).collect();
            let bytes = encode_mono(&samples, 44_100).unwrap();
            let read = Recording::decode(&bytes, "x.flac").unwrap();
            let wanted: Vec<f32> = samples.iter().map(|v| f32::from(*v) / 32_768.0).collect();
            assert!(read.rate_hz == 44_100 && read.channels == [wanted], "{name}");
        }
        assert!(encode_mono(&[0], 0).is_err());
    }

    #[test]
    fn the_number_of_cores_does_not_matter() {
        let folder = tempfile::tempdir().unwrap();
        let sound: Vec<f32> = sounds(200_000)[3].1.clone();
        let files: Vec<Vec<u8>> = [1, 3]
            .map(|threads| {
                let path = folder.path().join("x.flac");
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let mut writer = FlacWriter::create(&path, format(SampleFormat::Int16, 2)).unwrap();
                    sound.chunks(threads * 30_002).for_each(|block| writer.write(block).unwrap());
                    writer.finish().unwrap();
                });
                std::fs::read(&path).unwrap()
            })
            .into();
        assert!(files[0] == files[1]);
    }

    #[test]
    fn what_flac_cannot_hold_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let at = |format: SoundFormat| {
            let path = folder.path().join("x.flac");
            FlacWriter::create(path, format).err().unwrap().to_string()
        };
        assert!(
            at(format(SampleFormat::Float32, 2)).contains("FLAC has no float samples (use `--format 24`")
        );
        assert!(at(format(SampleFormat::Int16, 9)).contains("1 to 8 channels, not 9 (write a WAV file)"));
        assert!(
            at(SoundFormat { rate_hz: 1 << 20, ..format(SampleFormat::Int16, 1) }).contains("1048576 Hz")
        );
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
