//! Writing WAV files block by block.
//!
//! A file appears under its name when it is complete: until then it is a temporary one in the same
//! folder, and what lay under the name before is untouched.
//!
//! The sizes in a WAV file have 32 bits. A file that outgrows them becomes RF64 (EBU Tech 3306): room for
//! the longer sizes, a `ds64` chunk, is kept at the beginning of every file as a `JUNK` chunk, which
//! every reader skips.

use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::format::Written;
pub use super::format::{SampleFormat, SoundFormat as WavFormat};
use super::labels::Labels;
use super::meter::Report;
use super::quantize::Quantizer;
use super::speakers;
use crate::WholeFile;
use crate::error::{Error, Result};

/// The most channels of a file.
const MAX_CHANNELS: usize = 64;

/// Sizes up to here fit in the 32 bits of a plain WAV file; the last number means "see ds64".
const MAX_RIFF_BYTES: u64 = u32::MAX as u64 - 1;

/// Bytes of a `ds64` chunk without a table: sizes of the file and its data, frames, length of the table.
const DS64_BYTES: u32 = 28;

/// Where the chunk stands that is `JUNK` or `ds64`.
const DS64_AT: usize = 12;

/// The identifier of an extensible format, after the two bytes of its kind.
const SUBFORMAT: [u8; 14] = [0, 0, 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71];

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
    quantizer: Quantizer,
    file: BufWriter<WholeFile>,
    header: Header,
    /// The samples of a block as they stand in the file.
    bytes: Vec<u8>,
    /// The size beyond which the file is RF64.
    riff_bytes: u64,
}

impl WavWriter {
    /// Begins a file of mono, stereo or unknown channels. Nothing is seen under its name before
    /// [`WavWriter::finish`].
    ///
    /// # Errors
    /// Where the folder is missing or cannot be written to, something that is not a file lies under
    /// the name, the rate is 0, or the channels are not 1 to 64.
    pub fn create(path: impl AsRef<Path>, format: WavFormat) -> Result<Self> {
        let labels = Labels { channel_mask: speakers::usual_mask(format.channels), broadcast: None };
        Self::labelled(path, format, labels)
    }

    /// Begins a file that says which loudspeakers its channels are for and, in a `bext` chunk, what
    /// it is.
    ///
    /// # Errors
    /// Those of [`WavWriter::create`]; a description that the chunk does not hold.
    pub fn labelled(path: impl AsRef<Path>, format: WavFormat, labels: Labels) -> Result<Self> {
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
        let header = Header { format, labels };
        let begin = header.bytes(0, MAX_RIFF_BYTES).map_err(|fault| fault.in_file(path))?;
        let mut file = BufWriter::with_capacity(1 << 16, WholeFile::create(path)?);
        file.write_all(&begin).map_err(|fault| Error::io("write", path, fault))?;
        Ok(Self {
            path: path.to_owned(),
            format,
            quantizer: Quantizer::new(format),
            file,
            header,
            bytes: Vec::new(),
            riff_bytes: MAX_RIFF_BYTES,
        })
    }

    /// Writes the next frames, their channels interleaved.
    ///
    /// # Errors
    /// Where the length is not a multiple of the channels or the disk is full.
    pub fn write(&mut self, interleaved: &[f32]) -> Result<()> {
        self.quantizer.check(interleaved, &self.path)?;
        // A long block in parts, so that its bytes do not take as much memory again.
        for part in interleaved.chunks((1 << 14) / self.format.channels * self.format.channels) {
            let bytes = &mut self.bytes;
            bytes.clear();
            match self.format.samples {
                SampleFormat::Float32 => {
                    self.quantizer.floats(part);
                    part.iter().for_each(|sample| bytes.extend_from_slice(&sample.to_le_bytes()));
                }
                SampleFormat::Int24 => {
                    self.quantizer.integers(part, |step| bytes.extend_from_slice(&step.to_le_bytes()[..3]));
                }
                SampleFormat::Int16 => {
                    self.quantizer.integers(part, |step| bytes.extend_from_slice(&step.to_le_bytes()[..2]));
                }
            }
            self.file.write_all(bytes).map_err(|fault| Error::io("write", &self.path, fault))?;
        }
        Ok(())
    }

    /// Takes what the sound measures into the `bext` chunk, if there is one.
    pub fn measured(&mut self, report: &Report) {
        if let Some(broadcast) = &mut self.header.labels.broadcast {
            broadcast.measured(report);
        }
    }

    /// Completes the file and gives it its name, in place of an earlier one.
    ///
    /// # Errors
    /// Where the disk is full or the name has become impossible; then the earlier file is untouched.
    pub fn finish(mut self) -> Result<Written> {
        let written = self.quantizer.written();
        let header = self.header.bytes(written.frames, self.riff_bytes)?;
        let data_bytes = written.frames * self.header.frame_bytes();
        let complete = |file: &mut BufWriter<WholeFile>| {
            if data_bytes % 2 == 1 {
                // Chunks begin at even offsets.
                file.write_all(&[0])?;
            }
            file.seek(SeekFrom::Start(0))?;
            file.write_all(&header)?;
            file.flush()
        };
        complete(&mut self.file).map_err(|fault| Error::io("write", &self.path, fault))?;
        let file =
            self.file.into_inner().map_err(|fault| Error::io("write", &self.path, fault.into_error()))?;
        file.finish()?;
        Ok(written)
    }

    /// What has been written so far.
    pub fn written(&self) -> Written {
        self.quantizer.written()
    }
}

/// What comes before the sound.
struct Header {
    format: WavFormat,
    labels: Labels,
}

impl Header {
    fn frame_bytes(&self) -> u64 {
        (self.format.channels * self.format.samples.bytes()) as u64
    }

    /// The header of a file of so many frames. It has the same length for any number of them.
    fn bytes(&self, frames: u64, riff_bytes: u64) -> Result<Vec<u8>> {
        let data_bytes = frames.saturating_mul(self.frame_bytes());
        let mut header = b"RIFF\0\0\0\0WAVEJUNK".to_vec();
        header.extend_from_slice(&DS64_BYTES.to_le_bytes());
        header.resize(header.len() + DS64_BYTES as usize, 0);
        if let Some(broadcast) = &self.labels.broadcast {
            chunk(&mut header, b"bext", &broadcast.to_chunk()?);
        }
        chunk(&mut header, b"fmt ", &self.format_chunk());
        let is_float = self.format.samples == SampleFormat::Float32;
        if is_float {
            // Formats other than integers tell their frames once more.
            chunk(&mut header, b"fact", &u32::try_from(frames).unwrap_or(u32::MAX).to_le_bytes());
        }
        header.extend_from_slice(b"data");
        let size_at = header.len();
        header.extend_from_slice(&[0; 4]);
        let file_bytes = (header.len() as u64).saturating_add(data_bytes).saturating_add(data_bytes & 1);
        let is_long = file_bytes - 8 > riff_bytes;
        let short = |size: u64| if is_long { [0xff; 4] } else { (size as u32).to_le_bytes() };
        header[size_at..].copy_from_slice(&short(data_bytes));
        header[4..8].copy_from_slice(&short(file_bytes - 8));
        if is_long {
            header[..4].copy_from_slice(b"RF64");
            header[DS64_AT..DS64_AT + 4].copy_from_slice(b"ds64");
            for (index, number) in [file_bytes - 8, data_bytes, frames].into_iter().enumerate() {
                let at = DS64_AT + 8 + 8 * index;
                header[at..at + 8].copy_from_slice(&number.to_le_bytes());
            }
        }
        Ok(header)
    }

    /// The content of the `fmt ` chunk: the extensible one where the plain one would not say it all.
    fn format_chunk(&self) -> Vec<u8> {
        let WavFormat { rate_hz, channels, samples, .. } = self.format;
        let kind: u16 = if samples == SampleFormat::Float32 { 3 } else { 1 };
        let mask = self.labels.channel_mask;
        let is_plain =
            samples == SampleFormat::Int16 && channels <= 2 && mask == speakers::usual_mask(channels);
        let frame_bytes = self.frame_bytes() as u32;
        let mut chunk = Vec::with_capacity(40);
        chunk.extend_from_slice(&if is_plain { kind } else { 0xfffe }.to_le_bytes());
        chunk.extend_from_slice(&(channels as u16).to_le_bytes());
        chunk.extend_from_slice(&rate_hz.to_le_bytes());
        chunk.extend_from_slice(&(rate_hz * frame_bytes).to_le_bytes());
        chunk.extend_from_slice(&(frame_bytes as u16).to_le_bytes());
        chunk.extend_from_slice(&samples.bits().to_le_bytes());
        if !is_plain {
            chunk.extend_from_slice(&22u16.to_le_bytes());
            chunk.extend_from_slice(&samples.bits().to_le_bytes());
            chunk.extend_from_slice(&mask.to_le_bytes());
            chunk.extend_from_slice(&kind.to_le_bytes());
            chunk.extend_from_slice(&SUBFORMAT);
        }
        chunk
    }
}

/// Adds a chunk, which begins and ends at an even offset.
fn chunk(to: &mut Vec<u8>, name: &[u8; 4], content: &[u8]) {
    to.extend_from_slice(name);
    to.extend_from_slice(&(content.len() as u32).to_le_bytes());
    to.extend_from_slice(content);
    if content.len() % 2 == 1 {
        to.push(0);
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;

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
        assert_eq!(part[80..], whole[80 + 1200..80 + 2800]);
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
    }

    #[test]
    fn silence_stays_silence() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.wav");
        write(&path, format(SampleFormat::Int16, 2), &[0.0, -0.0, 0.0, 0.0]);
        assert!(std::fs::read(&path).unwrap()[80..].iter().all(|b| *b == 0));
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

    /// Chunks of a file: name, offset of the content, size as it is written.
    fn chunks(bytes: &[u8]) -> Vec<(String, usize, u32)> {
        let mut found = Vec::new();
        let mut at = 12;
        while at + 8 <= bytes.len() {
            let size = u32::from_le_bytes(bytes[at + 4..at + 8].try_into().unwrap());
            found.push((String::from_utf8_lossy(&bytes[at..at + 4]).into_owned(), at + 8, size));
            at = at.saturating_add(8 + size as usize + (size & 1) as usize);
        }
        found
    }

    #[test]
    fn a_file_that_outgrows_32_bits_is_rf64() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.wav");
        for samples in [SampleFormat::Int16, SampleFormat::Int24, SampleFormat::Float32] {
            let sound = sound(101, 3);
            let written = |riff_bytes: u64| {
                let mut writer = WavWriter::create(&path, format(samples, 3)).unwrap();
                writer.riff_bytes = riff_bytes;
                writer.write(&sound).unwrap();
                writer.finish().unwrap();
                std::fs::read(&path).unwrap()
            };
            let short = written(MAX_RIFF_BYTES);
            let size = short.len() as u64 - 8;
            assert_eq!(short, written(size), "as long as there is room it is a plain file");
            let long = written(size - 1);
            assert!(
                short.starts_with(b"RIFF") && long.starts_with(b"RF64\xff\xff\xff\xffWAVEds64\x1c\0\0\0")
            );
            assert_eq!((long.len(), long.len() % 2), (short.len(), 0));
            let data_bytes = (101 * 3 * samples.bytes()) as u64;
            for (at, expected) in [(20, size), (28, data_bytes), (36, 101)] {
                assert_eq!(u64::from_le_bytes(long[at..at + 8].try_into().unwrap()), expected);
            }
            assert_eq!(chunks(&long).last().unwrap().2, u32::MAX);
            let (name, at, size) = chunks(&short).into_iter().find(|c| c.0 == "data").unwrap();
            assert_eq!((name.as_str(), u64::from(size)), ("data", data_bytes));
            assert!(long[at..] == short[at..]);
            // It is read as what it is, and not when something is missing.
            assert_eq!(Recording::decode(&long, "x").unwrap(), Recording::decode(&short, "x").unwrap());
            let cut = Recording::decode(&long[..long.len() - 4], "x").unwrap_err().to_string();
            assert!(cut.contains("cut short"), "{cut}");
        }
    }

    #[test]
    fn a_header_beyond_4_gib_tells_the_sizes() {
        let labels = Labels { channel_mask: 3, broadcast: None };
        let header = Header { format: format(SampleFormat::Float32, 2), labels };
        let length = header.bytes(0, MAX_RIFF_BYTES).unwrap().len() as u64;
        // The last length that 32 bits hold, and one frame more.
        let frames = (MAX_RIFF_BYTES + 8 - length) / 8;
        assert!(header.bytes(frames, MAX_RIFF_BYTES).unwrap().starts_with(b"RIFF"));
        let long = header.bytes(frames + 1, MAX_RIFF_BYTES).unwrap();
        assert!(long.starts_with(b"RF64"));
        assert_eq!(u64::from_le_bytes(long[28..36].try_into().unwrap()), (frames + 1) * 8);
        let huge = header.bytes(1 << 40, MAX_RIFF_BYTES).unwrap();
        assert_eq!(u64::from_le_bytes(huge[36..44].try_into().unwrap()), 1 << 40);
        assert!(huge.windows(12).any(|w| w == b"fact\x04\0\0\0\xff\xff\xff\xff"));
    }

    #[test]
    fn the_header_names_loudspeakers_where_there_is_need() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.wav");
        let format_of = |samples, channels: usize, channel_mask| {
            let labels = Labels { channel_mask, broadcast: None };
            let mut writer = WavWriter::labelled(&path, format(samples, channels), labels).unwrap();
            writer.write(&vec![0.0; channels]).unwrap();
            writer.finish().unwrap();
            let bytes = std::fs::read(&path).unwrap();
            let (_, at, size) = chunks(&bytes).into_iter().find(|c| c.0 == "fmt ").unwrap();
            bytes[at..at + size as usize].to_vec()
        };
        let plain = format_of(SampleFormat::Int16, 2, 3);
        assert_eq!((plain.len(), plain[0]), (16, 1));
        for (samples, channels, mask) in [
            (SampleFormat::Int16, 2, 0),
            (SampleFormat::Int16, 1, 1),
            (SampleFormat::Int24, 1, 4),
            (SampleFormat::Float32, 2, 3),
            (SampleFormat::Int16, 6, 0x3f),
            (SampleFormat::Int24, 64, 0),
        ] {
            let chunk = format_of(samples, channels, mask);
            assert_eq!((chunk.len(), &chunk[..2]), (40, &[0xfe, 0xff][..]));
            assert_eq!(u32::from_le_bytes(chunk[20..24].try_into().unwrap()), mask);
            assert_eq!(chunk[24], if samples == SampleFormat::Float32 { 3 } else { 1 });
        }
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
}
