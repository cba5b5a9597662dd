//! What a broadcast wave file says of itself: the `bext` chunk of EBU Tech 3285, version 2.

use serde::Serialize;

use super::format::{SampleFormat, SoundFormat};
use super::meter::Report;
use super::timecode::{Origination, Timecode};
use crate::error::{Error, Result};

/// Bytes of the chunk before the coding history.
const FIXED_BYTES: usize = 602;

/// A loudness that is not told.
const UNTOLD: i16 = 0x7fff;

/// Who makes the files.
const ORIGINATOR: &str = "froufrou";

/// The most bytes of a description.
const DESCRIPTION_BYTES: usize = 256;

/// What the user says of a soundtrack.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Description {
    /// What it is, in words.
    pub text: String,
    /// When it was made. The same input gives the same bytes, so the clock is not asked.
    pub origination: Option<Origination>,
    /// When its time 0 is, since midnight.
    pub start: Timecode,
}

/// The fields of a `bext` chunk.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Broadcast {
    /// What it is.
    pub description: String,
    /// Who made it.
    pub originator: String,
    /// The maker's own name of it.
    pub originator_reference: String,
    /// The day it was made, `YYYY-MM-DD`; empty: not told.
    pub origination_date: String,
    /// The time of that day, `HH:MM:SS`; empty: not told.
    pub origination_time: String,
    /// Samples from midnight to the first frame.
    pub time_reference: u64,
    /// Integrated loudness in LUFS.
    pub loudness_lufs: Option<f64>,
    /// Loudness range in LU.
    pub loudness_range_lu: Option<f64>,
    /// The highest true peak in dBTP.
    pub max_true_peak_dbtp: Option<f64>,
    /// The highest momentary loudness in LUFS.
    pub max_momentary_lufs: Option<f64>,
    /// The highest short-term loudness in LUFS.
    pub max_short_term_lufs: Option<f64>,
    /// Through which codings it went, a line each (EBU R 98).
    pub coding_history: String,
}

impl Broadcast {
    /// Of a file that froufrou writes, not measured yet.
    ///
    /// # Errors
    /// A description with control characters.
    pub fn new(description: &Description, format: &SoundFormat) -> Result<Self> {
        if description.text.chars().any(char::is_control) {
            return Err(Error::new("the description has line breaks or other control characters"));
        }
        let coding = match format.samples {
            SampleFormat::Float32 => "PCM-FLOAT",
            SampleFormat::Int16 | SampleFormat::Int24 => "PCM",
        };
        let mode = match format.channels {
            1 => ",M=mono",
            2 => ",M=stereo",
            _ => "",
        };
        let origination = description.origination.as_ref();
        Ok(Self {
            description: description.text.clone(),
            originator: ORIGINATOR.into(),
            origination_date: origination.map_or_else(String::new, |o| o.date().into()),
            origination_time: origination.map_or_else(String::new, |o| o.time().into()),
            time_reference: description.start.samples(format.rate_hz).saturating_add(format.first_frame),
            coding_history: format!(
                "A={coding},F={},W={}{mode},T={ORIGINATOR} {}\r\n",
                format.rate_hz,
                format.samples.bits(),
                env!("CARGO_PKG_VERSION")
            ),
            ..Self::default()
        })
    }

    /// Takes over what was measured.
    pub fn measured(&mut self, report: &Report) {
        self.loudness_lufs = report.loudness_lufs;
        self.loudness_range_lu = report.loudness_range_lu;
        self.max_true_peak_dbtp = report.true_peak_dbtp;
        self.max_momentary_lufs = report.max_momentary_lufs;
        self.max_short_term_lufs = report.max_short_term_lufs;
    }

    /// The content of the chunk. Its length does not depend on what was measured.
    ///
    /// # Errors
    /// A description beyond 256 bytes or beyond ASCII, which is all that the format knows.
    pub fn to_chunk(&self) -> Result<Vec<u8>> {
        if !self.description.is_ascii() {
            return Err(Error::new("the description of a WAV file can only have ASCII characters")
                .help("leave out accents and other signs, or write FLAC, which takes them"));
        }
        if self.description.len() > DESCRIPTION_BYTES {
            return Err(Error::new(format!(
                "the description has {} characters, a WAV file holds {DESCRIPTION_BYTES}",
                self.description.len()
            ))
            .help("shorten it, or write FLAC, which takes any length"));
        }
        let mut chunk = Vec::with_capacity(FIXED_BYTES + self.coding_history.len());
        let mut text = |text: &str, bytes: usize| {
            let end = chunk.len() + bytes;
            chunk.extend(text.bytes().take(bytes));
            chunk.resize(end, 0);
        };
        text(&self.description, DESCRIPTION_BYTES);
        text(&self.originator, 32);
        text(&self.originator_reference, 32);
        text(&self.origination_date, 10);
        text(&self.origination_time, 8);
        chunk.extend_from_slice(&self.time_reference.to_le_bytes());
        chunk.extend_from_slice(&2u16.to_le_bytes());
        // No UMID.
        chunk.extend_from_slice(&[0; 64]);
        for level in self.levels() {
            let hundredths = level.map(|level| (level * 100.0).round()).filter(|h| h.abs() <= 9_999.0);
            chunk.extend_from_slice(&hundredths.map_or(UNTOLD, |h| h as i16).to_le_bytes());
        }
        chunk.resize(FIXED_BYTES, 0);
        chunk.extend_from_slice(self.coding_history.as_bytes());
        // libsndfile loses its way in RF64 after a chunk of an odd length.
        chunk.resize(chunk.len().next_multiple_of(2), 0);
        Ok(chunk)
    }

    /// Reads the content of a chunk; `None` where it is too short to be one.
    pub fn from_chunk(chunk: &[u8]) -> Option<Self> {
        let text = |from: usize, to: usize| {
            let field = chunk.get(from..to).unwrap_or_default();
            let field = field.split(|byte| *byte == 0).next().unwrap_or_default();
            String::from_utf8_lossy(field).trim_end().to_owned()
        };
        let fixed = chunk.get(..FIXED_BYTES)?;
        let short = |at: usize| u16::from_le_bytes([fixed[at], fixed[at + 1]]);
        let time_reference = fixed[338..346].iter().rev().fold(0u64, |sum, byte| sum << 8 | u64::from(*byte));
        // Only from version 2 on are there levels.
        let level = |at: usize| {
            let value = short(at) as i16;
            (short(346) >= 2 && (-9_999..=9_999).contains(&value)).then(|| f64::from(value) / 100.0)
        };
        Some(Self {
            description: text(0, 256),
            originator: text(256, 288),
            originator_reference: text(288, 320),
            origination_date: text(320, 330),
            origination_time: text(330, 338),
            time_reference,
            loudness_lufs: level(412),
            loudness_range_lu: level(414),
            max_true_peak_dbtp: level(416),
            max_momentary_lufs: level(418),
            max_short_term_lufs: level(420),
            coding_history: text(FIXED_BYTES, chunk.len()),
        })
    }

    /// The same as tags of a FLAC file: only what is told.
    pub fn to_tags(&self) -> Vec<(&'static str, String)> {
        let mut tags = vec![
            ("DESCRIPTION", self.description.clone()),
            ("ORIGINATOR", self.originator.clone()),
            ("ORIGINATORREFERENCE", self.originator_reference.clone()),
            ("ORIGINATIONDATE", self.origination_date.clone()),
            ("ORIGINATIONTIME", self.origination_time.clone()),
            ("TIMEREFERENCE", self.time_reference.to_string()),
        ];
        let names = [
            "LOUDNESSVALUE",
            "LOUDNESSRANGE",
            "MAXTRUEPEAKLEVEL",
            "MAXMOMENTARYLOUDNESS",
            "MAXSHORTTERMLOUDNESS",
        ];
        let levels = self.levels().map(|level| level.map_or_else(String::new, |db| format!("{db:.2}")));
        tags.extend(names.into_iter().zip(levels));
        tags.push(("CODINGHISTORY", self.coding_history.trim_end().to_owned()));
        tags.retain(|(_, value)| !value.is_empty());
        tags
    }

    fn levels(&self) -> [Option<f64>; 5] {
        [
            self.loudness_lufs,
            self.loudness_range_lu,
            self.max_true_peak_dbtp,
            self.max_momentary_lufs,
            self.max_short_term_lufs,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn format() -> SoundFormat {
        SoundFormat { rate_hz: 48_000, channels: 2, samples: SampleFormat::Int24, seed: 0, first_frame: 480 }
    }

    fn broadcast(text: &str) -> Broadcast {
        let description = Description {
            text: text.into(),
            origination: Some("2026-03-04T05:06:07".parse().unwrap()),
            start: "00:00:01".parse().unwrap(),
        };
        Broadcast::new(&description, &format()).unwrap()
    }

    #[test]
    fn fields_stand_where_the_standard_puts_them() {
        let mut broadcast = broadcast("a rustle");
        broadcast.loudness_lufs = Some(-23.004);
        broadcast.max_true_peak_dbtp = Some(-1.0);
        broadcast.loudness_range_lu = Some(1e6);
        let chunk = broadcast.to_chunk().unwrap();
        assert!(chunk.starts_with(b"a rustle\0") && chunk[256..].starts_with(b"froufrou\0"));
        assert_eq!(&chunk[320..338], b"2026-03-0405:06:07");
        assert_eq!(chunk[338..348], [0x60, 0xbd, 0, 0, 0, 0, 0, 0, 2, 0]);
        assert_eq!(chunk[412..418], [4, 0xf7, 0xff, 0x7f, 0x9c, 0xff]);
        assert_eq!(&chunk[602..626], b"A=PCM,F=48000,W=24,M=ste");
        assert!(chunk.ends_with(b"\r\n"));
        // Its length is even whatever stands in it.
        for rate_hz in [8_000, 48_000, 192_000] {
            let format = SoundFormat { rate_hz, ..format() };
            let broadcast = Broadcast::new(&Description::default(), &format).unwrap();
            assert_eq!(broadcast.to_chunk().unwrap().len() % 2, 0);
        }
    }

    #[test]
    fn a_chunk_reads_back() {
        let mut written = broadcast(&"x".repeat(256));
        written.loudness_lufs = Some(-23.5);
        written.max_short_term_lufs = Some(-20.25);
        let mut read = Broadcast::from_chunk(&written.to_chunk().unwrap()).unwrap();
        read.coding_history += "\r\n";
        assert_eq!(read, written);
        assert_eq!(Broadcast::from_chunk(&[0; 601]), None);
        assert_eq!(Broadcast::from_chunk(&[0xff; 602]).unwrap().time_reference, u64::MAX);
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        assert!(broadcast("é").to_chunk().unwrap_err().to_string().contains("ASCII"));
        assert!(broadcast(&"x".repeat(257)).to_chunk().unwrap_err().to_string().contains("257 characters"));
        let lines = Description { text: "a\nb".into(), ..Description::default() };
        assert!(Broadcast::new(&lines, &format()).is_err());
    }

    #[test]
    fn tags_are_what_is_told() {
        let tags = broadcast("ein Geräusch").to_tags();
        assert_eq!(tags[0], ("DESCRIPTION", "ein Geräusch".into()));
        assert!(tags.contains(&("TIMEREFERENCE", "48480".into())));
        assert!(!tags.iter().any(|(name, _)| *name == "LOUDNESSVALUE"));
    }
}
