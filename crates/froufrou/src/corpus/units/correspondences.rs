//! Which clips of a target should sound like which clips of recordings: `pairs.csv`.
//!
//! ```text
//! target_s,recording,source_s,duration_s
//! 1.25,sheet/take 3.wav,17.4,0.15
//! ```
//!
//! Columns may come in any order. `target_channel` and `source_channel`, counted from 1, may be left out: then it is the
//! first. Clips of 100 to 200 ms are usual; the units of both are paired in order, and there is at least one.

use std::path::Path;

use crate::error::{Error, Place, Result};

/// The most bytes and lines of a file.
const MOST_BYTES: u64 = 16 << 20;
const MOST: usize = 100_000;

/// The columns, and those that may be left out.
const COLUMNS: [&str; 4] = ["target_s", "recording", "source_s", "duration_s"];
const OPTIONAL: [&str; 2] = ["target_channel", "source_channel"];

/// A clip of the target and one of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Correspondence {
    /// Where the clip begins in the target.
    pub target_s: f64,
    /// The channel of the target, from 0.
    pub target_channel: usize,
    /// The recording, by its path in the corpus.
    pub recording: String,
    /// The channel of the recording, from 0.
    pub source_channel: usize,
    /// Where the clip begins there.
    pub source_s: f64,
    /// How long both are.
    pub duration_s: f64,
    /// The line of the file, from 1.
    pub line: usize,
}

/// Reads a file of correspondences.
///
/// # Errors
/// Where it is missing or is not such a file, with the line.
pub fn read(path: &Path) -> Result<Vec<Correspondence>> {
    let metadata = std::fs::metadata(path).map_err(|e| Error::io("open", path, e))?;
    if !metadata.is_file() || metadata.len() > MOST_BYTES {
        return Err(Error::new("expected correspondences, a CSV file of at most 16 MiB").in_file(path));
    }
    let bytes = std::fs::read(path).map_err(|e| Error::io("read", path, e))?;
    parse(&bytes).map_err(|e| e.in_file(path))
}

/// Reads the content of such a file.
///
/// # Errors
/// Those of [`read`].
pub fn parse(bytes: &[u8]) -> Result<Vec<Correspondence>> {
    let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .flexible(true)
        .has_headers(false)
        .from_reader(bytes);
    let help = || format!("the first line names the columns: {}", COLUMNS.join(","));
    let mut heads: Option<Vec<String>> = None;
    let mut all = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|fault| {
            let line = fault.position().map_or(0, csv::Position::line) as usize;
            Error::new(format!("not a line of CSV: {fault}"))
                .at(Place::Line { line, column: 0 })
                .because(fault)
        })?;
        let line = line_of(bytes, record.position().map_or(0, csv::Position::byte) as usize);
        let at = |e: Error| e.at(Place::Line { line, column: 0 });
        let Some(heads) = &heads else {
            let found: Vec<String> = record.iter().map(str::to_owned).collect();
            check_heads(&found).map_err(|e| at(e).help(help()))?;
            heads = Some(found);
            continue;
        };
        if record.len() != heads.len() {
            return Err(at(Error::new(format!("expected {} values, found {}", heads.len(), record.len()))));
        }
        let value = |name: &str| heads.iter().position(|head| head == name).and_then(|i| record.get(i));
        let number = |name: &str, least: f64| -> Result<f64> {
            let text = value(name).unwrap_or_default();
            match text.parse::<f64>() {
                Ok(number) if number.is_finite() && number >= least => Ok(number),
                _ => Err(at(Error::new(format!(
                    "{name} is {text:?}, expected a number of seconds from {least}"
                )))),
            }
        };
        let channel = |name: &str| -> Result<usize> {
            match value(name).filter(|text| !text.is_empty()).map(|text| (text, text.parse::<usize>())) {
                None => Ok(0),
                Some((_, Ok(number @ 1..))) => Ok(number - 1),
                Some((text, _)) => Err(at(Error::new(format!("{name} is {text:?}, expected 1 or more")))),
            }
        };
        let recording = value("recording").unwrap_or_default().to_owned();
        if recording.is_empty() {
            return Err(at(Error::new("no recording is named")));
        }
        let duration_s = number("duration_s", 0.0)?;
        if duration_s == 0.0 {
            return Err(at(Error::new("duration_s is 0, expected more")));
        }
        all.push(Correspondence {
            target_s: number("target_s", 0.0)?,
            target_channel: channel("target_channel")?,
            recording,
            source_channel: channel("source_channel")?,
            source_s: number("source_s", 0.0)?,
            duration_s,
            line,
        });
        if all.len() > MOST {
            return Err(at(Error::new(format!("expected at most {MOST} correspondences"))));
        }
    }
    match heads {
        Some(_) => Ok(all),
        None => Err(Error::new("the file is empty").help(help())),
    }
}

/// The line of a record that begins at a byte or after it: blank lines and remarks may come first.
fn line_of(bytes: &[u8], from: usize) -> usize {
    let (before, rest) = bytes.split_at(from.min(bytes.len()));
    let is_skipped = |line: &&[u8]| line.trim_ascii().is_empty() || line.starts_with(b"#");
    let skipped = rest.split(|byte| *byte == b'\n').take_while(is_skipped).count();
    before.iter().filter(|byte| **byte == b'\n').count() + skipped + 1
}

fn check_heads(found: &[String]) -> Result<()> {
    if let Some(missing) = COLUMNS.iter().find(|name| !found.iter().any(|head| head == *name)) {
        return Err(Error::new(format!("there is no column `{missing}`")));
    }
    let is_known = |head: &String| COLUMNS.iter().chain(&OPTIONAL).any(|name| name == head);
    if let Some(unknown) = found.iter().find(|head| !is_known(head)) {
        return Err(Error::new(format!("the column `{unknown}` is unknown")));
    }
    match found.iter().enumerate().find(|(i, head)| found[..*i].contains(head)) {
        Some((_, head)) => Err(Error::new(format!("there are two columns `{head}`"))),
        None => Ok(()),
    }
}

/// The text of a file of correspondences.
///
/// # Errors
/// Where it cannot be written.
pub fn text(correspondences: &[Correspondence]) -> Result<String> {
    let failed = |e: csv::Error| Error::new(format!("cannot write CSV: {e}")).because(e);
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(COLUMNS.iter().chain(&OPTIONAL)).map_err(failed)?;
    for pair in correspondences {
        let channels = [pair.target_channel + 1, pair.source_channel + 1].map(|c| c.to_string());
        let times = [pair.target_s, pair.source_s, pair.duration_s].map(|s| s.to_string());
        let [target_s, source_s, duration_s] = &times;
        let row = [target_s, &pair.recording, source_s, duration_s, &channels[0], &channels[1]];
        writer.write_record(row).map_err(failed)?;
    }
    let bytes = writer.into_inner().map_err(|e| Error::new(format!("cannot write CSV: {e}")))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_and_written() {
        let content =
            "# by ear\ntarget_s,recording, source_s,duration_s\n1.25,\"a, b.wav\",17.4,0.15\n\n0,c.wav,0,1\n";
        let pairs = parse(content.as_bytes()).unwrap();
        assert_eq!(pairs.len(), 2);
        assert_eq!((pairs[0].recording.as_str(), pairs[0].source_s, pairs[0].line), ("a, b.wav", 17.4, 3));
        assert_eq!((pairs[1].target_channel, pairs[1].duration_s, pairs[1].line), (0, 1.0, 5));
        let mut again = parse(text(&pairs).unwrap().as_bytes()).unwrap();
        again.iter_mut().zip(&pairs).for_each(|(again, pair)| again.line = pair.line);
        assert_eq!(again, pairs);
        let channels = "source_channel,target_s,recording,source_s,duration_s\n2,0,c.wav,0,1\n";
        assert_eq!(parse(channels.as_bytes()).unwrap()[0].source_channel, 1);
    }

    #[test]
    fn faults_are_told_with_their_line() {
        let head = "target_s,recording,source_s,duration_s\n";
        for (content, wanted) in [
            ("", "the file is empty"),
            ("target_s,recording,source_s\n", "1: there is no column `duration_s`"),
            ("target_s,recording,source_s,duration_s,gain\n", "unknown"),
            ("target_s,target_s,recording,source_s,duration_s\n", "two columns"),
            (&format!("{head}1,a.wav,2,0.1\n1,a.wav,2\n"), "3: expected 4 values, found 3"),
            (&format!("{head}one,a.wav,2,0.1\n"), "2: target_s is \"one\""),
            (&format!("{head}1,a.wav,-2,0.1\n"), "2: source_s is \"-2\""),
            (&format!("{head}1,a.wav,2,inf\n"), "duration_s"),
            (&format!("{head}1,a.wav,2,0\n"), "duration_s is 0"),
            (&format!("{head}1,,2,0.1\n"), "no recording"),
            (
                "target_s,recording,source_s,duration_s,target_channel\n1,a.wav,2,0.1,0\n",
                "target_channel is \"0\"",
            ),
        ] {
            let told = parse(content.as_bytes()).unwrap_err().to_string();
            assert!(told.contains(wanted), "{told}");
        }
        assert!(parse(&[0xff, 0xfe, b'\n', 0x80]).is_err());
    }
}
