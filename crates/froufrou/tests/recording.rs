//! Recordings of every kind against the closed form of the sound they hold (see
//! `oracles/recording_fixtures.py`), and against damage.

mod data;

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use data::data;
use froufrou::corpus::recording::Recording;
use proptest::prelude::*;

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/audio")
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(fixtures().join(name)).unwrap()
}

/// Channel `channel` of the known sound at a frame.
fn known(rate_hz: u32, channel: usize, frame: i64) -> f64 {
    let c = channel as f64;
    let f = 250.0 + 70.0 * c;
    let turn = TAU * frame as f64 / f64::from(rate_hz);
    0.4 * (f * turn).sin() + 0.2 * (1.7 * f * turn + c).sin()
}

fn open(name: &str, rate_hz: u32, channels: usize, frames: usize) -> Recording {
    let recording = Recording::open(fixtures().join(name)).unwrap();
    assert_eq!(recording.rate_hz, rate_hz, "{name}");
    assert_eq!(recording.channels.len(), channels, "{name}");
    assert!(recording.channels.iter().all(|c| c.len() == frames), "{name}: {} frames", recording.frames());
    assert_eq!(recording.frames(), frames);
    assert!((recording.duration_s() - frames as f64 / f64::from(rate_hz)).abs() < 1e-12);
    recording
}

#[test]
fn lossless_files_hold_the_known_sound_to_their_quantisation() {
    // Half a step of the coding.
    let integer = |bits: i32| 1.001 * 2f64.powi(-bits);
    let float = 2f64.powi(-25);
    for (name, rate_hz, channels, frames, tolerance) in [
        ("mono_8000_u8.wav", 8_000, 1, 801, integer(8)),
        ("stereo_44100_s16.wav", 44_100, 2, 1103, integer(16)),
        ("six_48000_s16_extensible.wav", 48_000, 6, 501, integer(16)),
        ("eight_44100_s24_extensible.wav", 44_100, 8, 301, integer(24)),
        ("mono_96000_s24.wav", 96_000, 1, 1501, integer(24)),
        ("stereo_192000_s32.wav", 192_000, 2, 901, float),
        ("mono_44100_f32.wav", 44_100, 1, 1103, float),
        ("stereo_96000_f64.wav", 96_000, 2, 501, float),
        ("mono_44100_s16.rf64", 44_100, 1, 1103, integer(16)),
        ("mono_44100_s16_rifx.wav", 44_100, 1, 1103, integer(16)),
        ("stereo_44100_s16_piped_ffmpeg.wav", 44_100, 2, 1103, integer(16)),
        ("stereo_44100_s16_piped_sox.wav", 44_100, 2, 1103, integer(16)),
        ("stereo_44100_s16.aiff", 44_100, 2, 1103, integer(16)),
        ("mono_96000_s24.aiff", 96_000, 1, 1501, integer(24)),
        ("mono_44100_f32.aifc", 44_100, 1, 1103, float),
        ("stereo_44100_s16_sowt.aifc", 44_100, 2, 1103, integer(16)),
        ("stereo_44100_s16.flac", 44_100, 2, 2203, integer(16)),
        ("mono_192000_s24.flac", 192_000, 1, 2001, integer(24)),
        ("six_48000_s24.flac", 48_000, 6, 501, integer(24)),
    ] {
        let recording = open(name, rate_hz, channels, frames);
        for (number, channel) in recording.channels.iter().enumerate() {
            for (frame, sample) in channel.iter().enumerate() {
                let error = (f64::from(*sample) - known(rate_hz, number, frame as i64)).abs();
                assert!(error <= tolerance, "{name}, channel {number}, frame {frame}: off by {error:e}");
            }
        }
    }
    // The companding laws have steps in proportion to the sample.
    for name in ["mono_8000_alaw.wav", "mono_8000_mulaw.wav"] {
        let recording = open(name, 8_000, 1, 801);
        for (frame, sample) in recording.channels[0].iter().enumerate() {
            let expected = known(8_000, 0, frame as i64);
            let error = (f64::from(*sample) - expected).abs();
            assert!(error <= 0.035 * expected.abs() + 0.0005, "{name}, frame {frame}: off by {error:e}");
        }
    }
}

/// Signal to noise ratio in dB of a channel against the known sound `lag` frames later.
fn ratio_db(channel: &[f32], rate_hz: u32, number: usize, lag: i64, edge: usize) -> f64 {
    let (mut signal, mut noise) = (0.0, 0.0);
    for (frame, sample) in channel.iter().enumerate().take(channel.len() - edge).skip(edge) {
        let expected = known(rate_hz, number, frame as i64 + lag);
        signal += expected * expected;
        noise += (f64::from(*sample) - expected).powi(2);
    }
    10.0 * (signal / noise).log10()
}

#[test]
fn lossy_files_hold_the_known_sound_in_its_place_and_length() {
    for (name, rate_hz, channels, frames, least_db) in [
        ("mono_8000_vorbis.ogg", 8_000, 1, 801, 25.0),
        ("stereo_44100_vorbis.ogg", 44_100, 2, 2205, 25.0),
        ("six_48000_vorbis.ogg", 48_000, 6, 2401, 20.0),
        ("mono_44100_pages_vorbis.ogg", 44_100, 1, 34_001, 25.0),
        ("stereo_44100_ffmpeg_vorbis.ogg", 44_100, 2, 2205, 25.0),
        ("stereo_44100.mp3", 44_100, 2, 2205, 25.0),
        ("mono_44100_variable.mp3", 44_100, 1, 4411, 25.0),
        ("mono_8000.mp3", 8_000, 1, 1601, 25.0),
        ("stereo_48000_ffmpeg.mp3", 48_000, 2, 2401, 20.0),
    ] {
        let recording = open(name, rate_hz, channels, frames);
        for (number, channel) in recording.channels.iter().enumerate() {
            if channels == 6 && number == 3 {
                // The encoder takes nearly all of the sound from the low-frequency channel, which
                // shows that it is the fourth.
                let power = |samples: &[f32]| samples[600..1800].iter().map(|v| v * v).sum::<f32>();
                assert!(power(channel) < 0.01 * power(&recording.channels[0]), "{name}");
                continue;
            }
            // The abrupt ends of the sound are smeared by every lossy codec.
            let at = |lag| ratio_db(channel, rate_hz, number, lag, frames / 8);
            let best = (-40..=40).max_by(|a, b| at(*a).total_cmp(&at(*b))).unwrap();
            assert_eq!(best, 0, "{name}, channel {number}: {} dB at lag {best}", at(best));
            assert!(at(0) >= least_db, "{name}, channel {number}: {} dB", at(0));
        }
    }
}

#[test]
fn an_mp3_without_a_tag_keeps_all_that_was_decoded() {
    let recording = Recording::open(fixtures().join("mono_44100_no_tag.mp3")).unwrap();
    // 2205 frames, the encoder's delay of 576 and the decoder's of 529, in whole blocks of 1152.
    assert_eq!(recording.frames(), 3 * 1152);
    let delay = 576 + 529;
    let ratio = ratio_db(&recording.channels[0][delay..delay + 2205], 44_100, 0, 0, 300);
    assert!(ratio > 20.0, "{ratio} dB");
}

#[test]
fn the_mix_and_single_channels_are_given() {
    let recording = open("six_48000_s16_extensible.wav", 48_000, 6, 501);
    let mono = recording.mono();
    for (frame, sample) in mono.iter().enumerate() {
        let expected = (0..6).map(|c| known(48_000, c, frame as i64)).sum::<f64>() / 6.0;
        assert!((f64::from(*sample) - expected).abs() < 2e-5);
    }
    assert_eq!(recording.channel(5), Some(recording.channels[5].as_slice()));
    assert_eq!(recording.channel(6), None);
    let single = open("mono_44100_f32.wav", 44_100, 1, 1103);
    assert_eq!(single.mono(), single.channels[0]);
}

/// The message of a file that is not to be read.
fn refusal(bytes: &[u8], name: &str) -> String {
    match Recording::decode(bytes, name) {
        Ok(recording) => panic!("{name}: read {} frames", recording.frames()),
        Err(error) => error.to_string(),
    }
}

#[test]
fn what_is_not_read_is_named() {
    for (content, expected) in [
        (&b""[..], "empty"),
        (b"Once upon a time", "not audio"),
        (b"RIFF\0\0\0\0AVI LIST", "not audio"),
        (b"....ftypM4A isom", "MP4"),
        (b"caff\0\x01\0\0desc", "CAF"),
        (b"\xff\xf1\x50\x80\0\0\0", "AAC"),
        (b"\xff\xfd\x50\x80\0\0\0", "layer II "),
        (b"RIFF\x04\0\0\0WAVE", "cut short"),
        (b"ID3\x04\0\0\0\0\0\x00", "cut short"),
        (b"fLaC", "cut short"),
        (b"OggS", "cut short"),
    ] {
        let message = refusal(content, "thing.bin");
        assert!(message.starts_with("thing.bin:") && message.contains(expected), "{message}");
    }
    assert!(refusal(&bytes("mono_48000_opus.ogg"), "x.ogg").contains("Opus"));
    assert!(refusal(&bytes("mono_8000_adpcm.wav"), "x.wav").contains("IMA ADPCM"));
    assert!(refusal(b"not frames of sound", "x.mp3").contains("MP3"));
}

#[test]
fn what_cannot_be_opened_is_named() {
    let missing = Recording::open(fixtures().join("missing.wav")).unwrap_err().to_string();
    assert!(missing.contains("missing.wav") && missing.contains("cannot open"), "{missing}");
    let folder = Recording::open(fixtures()).unwrap_err().to_string();
    assert!(folder.contains("a folder"), "{folder}");
}

#[test]
fn absurd_headers_are_refused() {
    let good = bytes("stereo_44100_s16.wav");
    let with = |at: usize, bytes: &[u8]| {
        let mut changed = good.clone();
        changed[at..at + bytes.len()].copy_from_slice(bytes);
        refusal(&changed, "x.wav")
    };
    assert!(with(22, &[0, 0]).contains("0 channels"));
    assert!(with(22, &[0xff, 0xff]).contains("65535 channels"));
    assert!(with(24, &[0, 0, 0, 0]).contains("rate of 0 Hz"));
    assert!(with(24, &[0xff, 0xff, 0xff, 0x7f]).contains("rate of 2147483647 Hz"));
    assert!(with(32, &[7]).contains("7 bytes a frame, expected 4"));
    assert!(with(34, &[17]).contains("bytes a frame"));
    assert!(with(20, &[0x55]).contains("MP3"));
    let message = with(40, &[0, 0x20, 0, 0]);
    assert!(message.contains("byte 4456") && message.contains("8192 bytes of sound"), "{message}");
    let aiff = bytes("stereo_44100_s16.aiff");
    let mut changed = aiff.clone();
    let common = aiff.windows(4).position(|w| w == b"COMM").unwrap();
    changed[common + 10] = 0x70;
    assert!(refusal(&changed, "x.aiff").contains("frames"));
}

#[test]
fn a_sample_that_is_not_a_number_is_named() {
    let mut changed = bytes("mono_44100_f32.wav");
    let end = changed.len();
    changed[end - 8..end - 4].copy_from_slice(&f32::NAN.to_le_bytes());
    let message = refusal(&changed, "x.wav");
    assert!(message.contains("frame 1101, channel 0") && message.contains("NaN"), "{message}");
}

#[test]
fn a_recording_without_sound_is_refused() {
    let mut empty = bytes("stereo_44100_s16.wav")[..44].to_vec();
    empty[4..8].copy_from_slice(&36u32.to_le_bytes());
    empty[40..44].copy_from_slice(&0u32.to_le_bytes());
    assert!(refusal(&empty, "x.wav").contains("no sound"));
}

#[test]
fn tags_before_the_sound_are_skipped() {
    let mut tagged = b"ID3\x04\0\0\0\0\0\x05title".to_vec();
    tagged.extend_from_slice(&bytes("stereo_44100_s16.flac"));
    let plain = Recording::open(fixtures().join("stereo_44100_s16.flac")).unwrap();
    assert_eq!(Recording::decode(&tagged, "x").unwrap(), plain);
    let mut tagged = bytes("mono_8000.mp3");
    let plain = Recording::decode(&tagged, "x").unwrap();
    tagged.extend_from_slice(b"TAG");
    tagged.extend_from_slice(&[0xff; 125]);
    assert_eq!(Recording::decode(&tagged, "x").unwrap(), plain);
}

/// The fixtures that are to be read whole.
fn readable() -> Vec<PathBuf> {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(fixtures()).unwrap().map(|e| e.unwrap().path()).collect();
    paths.retain(|path| {
        let name = path.to_string_lossy();
        !name.contains("opus") && !name.contains("adpcm")
    });
    paths.sort();
    assert!(paths.len() >= 30);
    paths
}

#[test]
fn a_file_cut_short_is_refused_wherever_its_length_is_known() {
    for path in readable() {
        let name = path.to_string_lossy().into_owned();
        // A streamed WAV and an MP3 without a tag may end anywhere.
        if name.contains("piped") || name.contains("no_tag") {
            continue;
        }
        let whole = std::fs::read(&path).unwrap();
        for part in [1, 3, 5, 9] {
            let length = whole.len() * part / 10;
            let message = refusal(&whole[..length], &name);
            assert!(message.starts_with(&name), "{message}");
        }
    }
}

#[test]
fn a_streamed_wav_cut_short_is_read_to_its_end() {
    let whole = bytes("stereo_44100_s16_piped_ffmpeg.wav");
    let full = Recording::decode(&whole, "x").unwrap();
    let part = Recording::decode(&whole[..whole.len() - 402], "x").unwrap();
    // 402 bytes are 100 frames and a half.
    assert_eq!(part.frames(), full.frames() - 101);
    assert_eq!(part.channels[1], full.channels[1][..part.frames()]);
}

/// What must hold however a file is damaged: an error, or a recording in one piece.
fn survives(bytes: &[u8]) -> Result<(), TestCaseError> {
    if let Ok(recording) = Recording::decode(bytes, "damaged") {
        let frames = recording.frames();
        prop_assert!(frames > 0);
        prop_assert!(recording.channels.iter().all(|c| c.len() == frames));
        prop_assert!(recording.channels.iter().flatten().all(|v| v.is_finite()));
        // No file of these formats and this size holds a minute.
        prop_assert!(frames < 60 * 192_000);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]
    #[test]
    fn damage_neither_panics_nor_hangs(
        file in any::<prop::sample::Index>(),
        end in any::<prop::sample::Index>(),
        is_cut in any::<bool>(),
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), any::<bool>()), 0..6),
    ) {
        let path = file.get(&readable()).clone();
        let mut bytes = std::fs::read(path).unwrap();
        for (at, flip, is_header) in flips {
            // Half of the damage goes to the headers.
            let range = if is_header { bytes.len().min(64) } else { bytes.len() };
            bytes[at.index(range)] ^= flip;
        }
        if is_cut {
            bytes.truncate(end.index(bytes.len() + 1));
        }
        survives(&bytes)?;
    }

    #[test]
    fn noise_after_a_magic_word_neither_panics_nor_hangs(
        magic in 0usize..7,
        noise in prop::collection::vec(any::<u8>(), 0..3000),
    ) {
        let magic: &[u8] = [
            &b"RIFF\xff\xff\0\0WAVE"[..],
            b"FORM\0\0\xff\xffAIFC",
            b"fLaC\0\0\0\x22",
            b"OggS\0\x02",
            b"\xff\xfb\x90\x64",
            b"ID3\x04\0\0\0\0\0\0",
            b"RF64\xff\xff\xff\xffWAVEds64",
        ][magic];
        survives(&[magic, &noise].concat())?;
    }
}

#[test]
fn the_shared_recordings_are_as_their_index_says() {
    let Some(folder) = data("audio") else { return };
    let index = std::fs::read_to_string(folder.join("INDEX.tsv")).unwrap();
    let mut lines = index.lines();
    let head: Vec<&str> = lines.next().unwrap().split('\t').collect();
    let column = |name: &str| head.iter().position(|h| *h == name).unwrap();
    let (file, duration, rate, count) = (column("file"), column("dur_s"), column("sr"), column("ch"));
    let mut read = 0;
    for line in lines {
        let fields: Vec<&str> = line.split('\t').collect();
        let recording = Recording::open(folder.join(fields[file])).unwrap();
        assert_eq!(recording.rate_hz, fields[rate].parse::<u32>().unwrap(), "{}", fields[file]);
        assert_eq!(recording.channels.len(), fields[count].parse::<usize>().unwrap(), "{}", fields[file]);
        let expected_s: f64 = fields[duration].parse().unwrap();
        assert!(
            (recording.duration_s() - expected_s).abs() <= 0.0051,
            "{}: {} s, expected {expected_s} s",
            fields[file],
            recording.duration_s()
        );
        read += 1;
    }
    assert!(read >= 600, "{read}");
}
