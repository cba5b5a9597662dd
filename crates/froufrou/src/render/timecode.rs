//! When a soundtrack begins, in the time of the day that film and broadcast count in.

use std::fmt;
use std::str::FromStr;

use crate::error::{Error, Result};

/// A time since midnight, kept exactly.
///
/// Written as a count of samples (`158760000`), as hours, minutes and seconds (`01:00:00`,
/// `01:00:00.5`), or with frames of film at a rate (`01:00:00:12@25`). The rates are 23.976, 24, 25,
/// 29.97, 30, 47.952, 48, 50, 59.94 and 60; a semicolon before the frames (`01:00:00;02@29.97`) is
/// drop-frame code, in which the first frames of most minutes have no number.
///
/// ```
/// use froufrou::render::timecode::Timecode;
/// let code: Timecode = "01:00:00:12@25".parse()?;
/// assert_eq!(code.samples(48_000), (3600 * 25 + 12) * 1920);
/// // An hour of drop-frame code is an hour but for a few milliseconds.
/// let code: Timecode = "01:00:00;00@29.97".parse()?;
/// assert_eq!(code.samples(48_000), 172_799_827);
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Timecode {
    /// So many samples, at any rate.
    Samples(u64),
    /// So many seconds, as a fraction.
    Seconds {
        /// Above the line.
        numerator: u64,
        /// Below it.
        denominator: u64,
    },
}

impl Default for Timecode {
    fn default() -> Self {
        Self::Samples(0)
    }
}

/// Rates of film: their name, the frames that a second counts, and whether it lasts 1.001 seconds.
const RATES: [(&str, u64, bool); 10] = [
    ("23.976", 24, true),
    ("24", 24, false),
    ("25", 25, false),
    ("29.97", 30, true),
    ("30", 30, false),
    ("47.952", 48, true),
    ("48", 48, false),
    ("50", 50, false),
    ("59.94", 60, true),
    ("60", 60, false),
];

impl Timecode {
    /// The samples since midnight, to the nearest.
    pub fn samples(self, rate_hz: u32) -> u64 {
        match self {
            Self::Samples(samples) => samples,
            Self::Seconds { numerator, denominator } => {
                let (n, d) = (u128::from(numerator) * u128::from(rate_hz), u128::from(denominator.max(1)));
                u64::try_from((n + d / 2) / d).unwrap_or(u64::MAX)
            }
        }
    }
}

impl FromStr for Timecode {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = |what: &str| {
            Error::new(format!("`{text}` is no timecode: {what}")).help(
                "write a count of samples, HH:MM:SS, HH:MM:SS.mmm, or HH:MM:SS:FF@RATE as in 01:00:00:12@25",
            )
        };
        let number = |digits: &str| match digits {
            _ if digits.is_empty() || digits.len() > 18 => None,
            _ if digits.bytes().all(|b| b.is_ascii_digit()) => digits.parse::<u64>().ok(),
            _ => None,
        };
        if let Some(samples) = number(text) {
            return Ok(Self::Samples(samples));
        }
        let (clock, rate) = match text.split_once('@') {
            Some((clock, rate)) => (clock, Some(rate)),
            None => (text, None),
        };
        let is_drop = clock.contains(';');
        let parts: Vec<&str> = clock.split([':', ';']).collect();
        let two = |digits: &str, limit: u64| number(digits).filter(|n| digits.len() == 2 && *n < limit);
        let (hours, minutes) = match parts.as_slice() {
            [hours, minutes, _] | [hours, minutes, _, _] => (
                two(hours, 24).ok_or_else(|| wrong("expected two digits of hours, 00 to 23"))?,
                two(minutes, 60).ok_or_else(|| wrong("expected two digits of minutes, 00 to 59"))?,
            ),
            _ => return Err(wrong("expected hours, minutes and seconds")),
        };
        let seconds_wrong = || wrong("expected two digits of seconds, 00 to 59");
        match (parts.get(3), rate) {
            (None, None) => {
                let (seconds, decimals) = parts[2].split_once('.').unwrap_or((parts[2], "0"));
                let seconds = two(seconds, 60).ok_or_else(seconds_wrong)?;
                if is_drop {
                    return Err(wrong("a semicolon stands only before frames"));
                }
                let fraction = number(decimals).filter(|_| decimals.len() <= 9);
                let fraction = fraction.ok_or_else(|| wrong("expected one to nine decimals of a second"))?;
                let denominator = 10u64.pow(decimals.len() as u32);
                let whole = hours * 3600 + minutes * 60 + seconds;
                Ok(Self::Seconds { numerator: whole * denominator + fraction, denominator })
            }
            (Some(_), None) => Err(wrong("frames need their rate")),
            (None, Some(_)) => Err(wrong("a rate needs frames")),
            (Some(frames), Some(rate)) => {
                let known = RATES.iter().find(|(name, _, _)| *name == rate);
                let Some((_, base, is_slow)) = known else {
                    let names = RATES.map(|(name, _, _)| name).join(", ");
                    return Err(wrong(&format!("the rate is {rate}, expected one of {names}")));
                };
                let seconds = two(parts[2], 60).ok_or_else(seconds_wrong)?;
                let frames = two(frames, *base)
                    .ok_or_else(|| wrong(&format!("expected two digits of frames, 00 to {}", base - 1)))?;
                let total_minutes = hours * 60 + minutes;
                let mut count = (total_minutes * 60 + seconds) * base + frames;
                if is_drop {
                    // The first two (four) numbers of each minute are left out, but for every tenth.
                    let dropped = base / 15;
                    if !matches!(rate, "29.97" | "59.94") {
                        return Err(wrong("only the rates 29.97 and 59.94 drop frames"));
                    }
                    if clock.matches(';').count() != 1 || !clock[6..].contains(';') {
                        return Err(wrong("a semicolon stands only before frames"));
                    }
                    if seconds == 0 && frames < dropped && !minutes.is_multiple_of(10) {
                        return Err(wrong("drop-frame code has no such frame"));
                    }
                    count -= dropped * (total_minutes - total_minutes / 10);
                }
                let (long, short) = if *is_slow { (1001, 1000) } else { (1, 1) };
                Ok(Self::Seconds { numerator: count * long, denominator: base * short })
            }
        }
    }
}

/// A day and a time of it, as broadcast files name them.
///
/// ```
/// use froufrou::render::timecode::Origination;
/// let origination: Origination = "2026-02-28T09:30:00".parse()?;
/// assert_eq!((origination.date(), origination.time()), ("2026-02-28", "09:30:00"));
/// assert!("2026-02-29".parse::<Origination>().is_err());
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origination {
    text: String,
}

impl Origination {
    /// The day, `YYYY-MM-DD`.
    pub fn date(&self) -> &str {
        &self.text[..10]
    }

    /// The time, `HH:MM:SS`.
    pub fn time(&self) -> &str {
        &self.text[11..]
    }
}

impl fmt::Display for Origination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for Origination {
    type Err = Error;

    /// Reads `YYYY-MM-DD`, which is midnight, or `YYYY-MM-DDTHH:MM:SS`.
    fn from_str(text: &str) -> Result<Self> {
        let wrong = || Error::new(format!("`{text}` is no date, expected YYYY-MM-DD or YYYY-MM-DDTHH:MM:SS"));
        let full = if text.len() == 10 { format!("{text}T00:00:00") } else { text.to_owned() };
        let shape: String = full.chars().map(|c| if c.is_ascii_digit() { '0' } else { c }).collect();
        if shape != "0000-00-00T00:00:00" {
            return Err(wrong());
        }
        let number = |from: usize, to: usize| full[from..to].parse::<u32>().unwrap_or(u32::MAX);
        let (year, month, day) = (number(0, 4), number(5, 7), number(8, 10));
        let is_leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
        let days = match month {
            2 if is_leap => 29,
            2 => 28,
            4 | 6 | 9 | 11 => 30,
            1..=12 => 31,
            _ => 0,
        };
        if !(1..=days).contains(&day) || number(11, 13) > 23 || number(14, 16) > 59 || number(17, 19) > 59 {
            return Err(wrong());
        }
        Ok(Self { text: full })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(text: &str, rate_hz: u32) -> u64 {
        text.parse::<Timecode>().unwrap().samples(rate_hz)
    }

    #[test]
    fn clocks_become_samples() {
        assert_eq!(samples("12345", 44_100), 12_345);
        assert_eq!(samples("00:00:01", 44_100), 44_100);
        assert_eq!(samples("23:59:59.999999999", 192_000), 86_400 * 192_000);
        assert_eq!(samples("10:20:30.25", 48_000), (37_230 * 4 + 1) * 12_000);
        assert_eq!(samples("00:00:00:23@24", 48_000), 46_000);
        assert_eq!(samples("00:01:00:00@30", 48_000), 60 * 48_000);
        // A second of 24 frames at 24000/1001 frames a second lasts 1.001 seconds.
        assert_eq!(samples("00:00:10:00@23.976", 48_000), 480_480);
    }

    #[test]
    fn drop_frame_code_counts_every_frame_once() {
        // SMPTE 12M: the frame after 00:00:59;29 is 00:01:00;02, that after 00:09:59;29 is 00:10:00;00.
        let frame = |text: &str| samples(text, 30_000).div_euclid(1001);
        for (before, after) in [
            ("00:00:59;29@29.97", "00:01:00;02@29.97"),
            ("00:09:59;29@29.97", "00:10:00;00@29.97"),
            ("12:58:59;29@29.97", "12:59:00;02@29.97"),
        ] {
            assert_eq!(frame(after), frame(before) + 1, "{before}");
        }
        // Ten minutes have 17982 frames.
        assert_eq!(frame("00:10:00;00@29.97"), 17_982);
        assert_eq!(samples("00:10:00;00@59.94", 60_000), 2 * 17_982 * 1001);
    }

    #[test]
    fn what_is_no_timecode_is_told_why() {
        for (text, expected) in [
            ("", "expected hours"),
            ("1:00:00", "two digits of hours"),
            ("24:00:00", "two digits of hours"),
            ("00:60:00", "minutes"),
            ("00:00:60", "seconds"),
            ("00:00:00.", "decimals"),
            ("00:00:00.1234567890", "decimals"),
            ("00:00:00:12", "frames need their rate"),
            ("00:00:00@25", "a rate needs frames"),
            ("00:00:00:25@25", "00 to 24"),
            ("00:00:00:12@26", "one of 23.976, 24"),
            ("00:01:00;00@29.97", "no such frame"),
            ("00:00:00;00@25", "29.97 and 59.94"),
            ("00;00:00:00@29.97", "only before frames"),
            ("00:00;00", "only before frames"),
            ("-5", "expected hours"),
            ("é:00:00", "hours"),
            ("9999999999999999999", "expected hours"),
        ] {
            let error = text.parse::<Timecode>().unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn days_are_those_of_the_calendar() {
        for good in ["2024-02-29", "2000-02-29T23:59:59", "1999-12-31T00:00:00"] {
            assert!(good.parse::<Origination>().is_ok(), "{good}");
        }
        for bad in [
            "1900-02-29",
            "2023-13-01",
            "2023-00-10",
            "2023-04-31",
            "2023-1-1",
            "2023-01-01T24:00:00",
            "heute",
            "2023-01-01 10:00:00",
            "",
            "éé-01-01",
        ] {
            assert!(bad.parse::<Origination>().is_err(), "{bad}");
        }
    }
}
