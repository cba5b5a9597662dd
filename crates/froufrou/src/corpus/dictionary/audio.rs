//! Stored sound: FLAC files as they are, and Vorbis without what all its files have in common.

use std::path::{Path, PathBuf};

use super::manifest::{AGAIN, Storage};
#[cfg(feature = "vorbis")]
use super::packed::Writer;
use super::packed::{self, Reader};
use crate::corpus::recording::{Recording, ogg};
use crate::error::{Error, Result};
use crate::render::flac;

/// The folder of stored sound and patterns.
pub(super) const STORE: &str = "store";

/// The most bytes of a file of stored sound.
const MOST_BYTES: u64 = 1 << 32;

/// What the first lines of files say.
const VORBIS: &str = "froufrou vorbis 1";
const HEADERS: &str = "froufrou vorbis headers 1";

/// Content and the name of its file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct File {
    pub name: String,
    pub bytes: Vec<u8>,
}

/// Sound as it is stored.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stored {
    /// What names its file.
    pub hash: String,
    /// Its file, and the headers that it shares with others.
    pub files: Vec<File>,
}

/// A file of the store, by its name.
pub(super) fn path(corpus: &Path, name: &str) -> PathBuf {
    corpus.join(STORE).join(name)
}

/// The name of a recording's file.
pub(super) fn name(hash: &str, storage: Storage) -> Option<String> {
    match storage {
        Storage::Flac => Some(format!("{hash}.flac")),
        Storage::Vorbis => Some(format!("{hash}.vorbis")),
        Storage::None => None,
    }
}

/// Reads a file of the store.
pub(super) fn read(corpus: &Path, name: &str) -> Result<Vec<u8>> {
    let path = path(corpus, name);
    let advise = |e: Error| e.help("a file of the corpus is missing; `froufrou grains build` makes it again");
    let metadata = std::fs::metadata(&path).map_err(|e| advise(Error::io("open", &path, e)))?;
    if !metadata.is_file() || metadata.len() > MOST_BYTES {
        return Err(Error::new("expected a file of at most 4 GiB").in_file(path).help(AGAIN));
    }
    std::fs::read(&path).map_err(|e| Error::io("read", &path, e))
}

/// The sound behind a hash, one channel at a rate.
pub(super) fn decode(corpus: &Path, hash: &str, storage: Storage, rate_hz: u32) -> Result<Vec<f32>> {
    let Some(name) = name(hash, storage) else { return Ok(Vec::new()) };
    let file = path(corpus, &name);
    let bytes = read(corpus, &name)?;
    let told = file.to_string_lossy();
    let recording = match storage {
        Storage::Vorbis => {
            let repacked = unpacked(corpus, &bytes).map_err(|e| e.in_file(&file).help(AGAIN))?;
            Recording::decode(&repacked, &told)
        }
        _ => Recording::decode(&bytes, &told),
    };
    let recording = recording.map_err(|e| e.help(AGAIN))?;
    if recording.rate_hz != rate_hz || recording.channels.len() != 1 {
        let (rate, channels) = (recording.rate_hz, recording.channels.len());
        return Err(Error::new(format!(
            "expected one channel at {rate_hz} Hz, found {channels} at {rate} Hz"
        ))
        .in_file(file)
        .help(AGAIN));
    }
    Ok(recording.channels.into_iter().next().unwrap_or_default())
}

/// Sound of 16 bits as it is stored.
pub(super) fn encode(samples: &[i16], rate_hz: u32, storage: Storage, quality: f64) -> Result<Stored> {
    match storage {
        Storage::Flac => {
            let bytes = flac::encode_mono(samples, rate_hz)?;
            let hash = packed::hash(&[&bytes]);
            let name = format!("{hash}.flac");
            Ok(Stored { hash, files: vec![File { name, bytes }] })
        }
        Storage::Vorbis => vorbis(samples, rate_hz, quality),
        Storage::None => {
            let bytes: Vec<u8> = samples.iter().flat_map(|v| v.to_le_bytes()).collect();
            Ok(Stored { hash: packed::hash(&[&bytes, &rate_hz.to_le_bytes()]), files: Vec::new() })
        }
    }
}

/// The packets of a file of ours, with the headers they need, as an Ogg file.
fn unpacked(corpus: &Path, bytes: &[u8]) -> Result<Vec<u8>> {
    let content = packed::open(VORBIS, bytes, false)?;
    let mut reader = Reader::new(&content);
    let hash = reader.take(16)?.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
    let length = reader.number()?;
    let count = reader.count(1)?;
    let mut packets = Vec::with_capacity(count + 3);
    for _ in 0..count {
        let bytes = reader.count(1)?;
        packets.push(reader.take(bytes)?);
    }
    reader.end()?;
    let name = format!("{hash}.headers");
    let headers = read(corpus, &name)?;
    let in_headers = |e: Error| e.in_file(path(corpus, &name));
    let headers = packed::open(HEADERS, &headers, true).map_err(in_headers)?;
    let mut reader = Reader::new(&headers);
    let mut all = Vec::with_capacity(packets.len() + 3);
    for _ in 0..3 {
        let bytes = reader.count(1).map_err(in_headers)?;
        all.push(reader.take(bytes).map_err(in_headers)?);
    }
    all.append(&mut packets);
    Ok(ogg::pages(&all, length))
}

#[cfg(not(feature = "vorbis"))]
fn vorbis(_: &[i16], _: u32, _: f64) -> Result<Stored> {
    Err(Error::new("this froufrou was built without Vorbis").help("store the grains as FLAC"))
}

#[cfg(feature = "vorbis")]
fn vorbis(samples: &[i16], rate_hz: u32, quality: f64) -> Result<Stored> {
    use std::num::{NonZeroU8, NonZeroU32};
    use vorbis_rs::{VorbisBitrateManagementStrategy as Strategy, VorbisEncoderBuilder};
    /// Frames that the encoder is given at a time.
    const BLOCK: usize = 4096;
    let refused = |e: vorbis_rs::VorbisError| {
        Error::new(format!("Vorbis cannot hold sound at {rate_hz} Hz with quality {quality}: {e}")).because(e)
    };
    let rate = NonZeroU32::new(rate_hz).ok_or_else(|| Error::new("the rate is 0 Hz"))?;
    let mut file = Vec::new();
    let mut encoder = VorbisEncoderBuilder::new_with_serial(rate, NonZeroU8::MIN, &mut file, 0)
        .bitrate_management_strategy(Strategy::QualityVbr { target_quality: quality as f32 })
        .build()
        .map_err(refused)?;
    for block in samples.chunks(BLOCK) {
        let block: Vec<f32> = block.iter().map(|v| f32::from(*v) / 32_768.0).collect();
        encoder.encode_audio_block([block]).map_err(refused)?;
    }
    encoder.finish().map_err(refused)?;
    let (packets, length) = ogg::packets(&file)?;
    if packets.len() < 3 || length != samples.len() as u64 {
        return Err(Error::new(format!(
            "the Vorbis encoder gave {length} samples in {} packets, expected {} samples",
            packets.len(),
            samples.len()
        )));
    }
    let (headers, sound) = packets.split_at(3);
    let pack = |packets: &[Vec<u8>], writer: &mut Writer| {
        for packet in packets {
            writer.number(packet.len() as u64);
            writer.bytes.extend_from_slice(packet);
        }
    };
    let mut writer = Writer::default();
    pack(headers, &mut writer);
    let headers = packed::seal(HEADERS, &writer.bytes, true)?;
    let headers_hash = packed::hash(&[&headers]);
    let mut writer = Writer::default();
    for pair in headers_hash.as_bytes().chunks(2) {
        let digits = std::str::from_utf8(pair).unwrap_or_default();
        writer.bytes.push(u8::from_str_radix(digits, 16).unwrap_or_default());
    }
    writer.number(length);
    writer.number(sound.len() as u64);
    pack(sound, &mut writer);
    let bytes = packed::seal(VORBIS, &writer.bytes, false)?;
    let hash = packed::hash(&[&bytes]);
    let files = vec![
        File { name: format!("{headers_hash}.headers"), bytes: headers },
        File { name: format!("{hash}.vorbis"), bytes },
    ];
    Ok(Stored { hash, files })
}
