//! A Reaper project of a soundtrack: a track for each stem, the mix beside them, a marker for each
//! sound.
//!
//! A project is a tree of lines: `<NAME …` opens a part, `>` closes it. A text with spaces or quotes in
//! it stands in quotes, of the kind that it does not have itself.

use std::io::{self, Write};

/// A project.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Project {
    /// Frames a second.
    pub rate_hz: u32,
    /// Length in seconds.
    pub length_s: f64,
    /// The time on the ruler at which it begins, in seconds.
    pub offset_s: f64,
    /// Its tracks from top to bottom.
    pub tracks: Vec<Track>,
    /// Its markers, in order of time.
    pub markers: Vec<Marker>,
}

/// A track with one sound file on it, from the beginning of the project on.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Track {
    /// Its name.
    pub name: String,
    /// The file as it is called from the folder of the project.
    pub file: String,
    /// Channels of the file.
    pub channels: usize,
    /// Whether it is not heard.
    pub is_muted: bool,
    /// Red, green and blue; `None`: the colour of all tracks.
    pub colour: Option<[u8; 3]>,
}

/// A place in time with a name.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Marker {
    /// Seconds from the beginning of the project.
    pub time_s: f64,
    /// Its name.
    pub name: String,
    /// Red, green and blue; `None`: the colour of all markers.
    pub colour: Option<[u8; 3]>,
}

impl Project {
    /// Writes the project.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write(&self, to: &mut impl Write) -> io::Result<()> {
        writeln!(to, "<REAPER_PROJECT 0.1 \"7.0/froufrou\" 0")?;
        writeln!(to, "  PROJOFFS {} 0 0", seconds(self.offset_s))?;
        // Time in minutes and seconds; sounds that keep their length when the tempo changes.
        writeln!(to, "  TIMEMODE 0 5 -1 30 0 0 -1")?;
        writeln!(to, "  TIMELOCKMODE 0")?;
        writeln!(to, "  TEMPO 120 4 4")?;
        writeln!(to, "  SAMPLERATE {} 1 0", self.rate_hz)?;
        for (index, marker) in self.markers.iter().enumerate() {
            let name = quoted(&marker.name);
            let colour = colour(marker.colour);
            writeln!(to, "  MARKER {} {} {name} 0 {colour} 1 B", index + 1, seconds(marker.time_s))?;
        }
        for track in &self.tracks {
            self.write_track(track, to)?;
        }
        writeln!(to, ">")
    }

    fn write_track(&self, track: &Track, to: &mut impl Write) -> io::Result<()> {
        let name = quoted(&track.name);
        writeln!(to, "  <TRACK")?;
        writeln!(to, "    NAME {name}")?;
        writeln!(to, "    PEAKCOL {}", colour(track.colour))?;
        writeln!(to, "    VOLPAN 1 0 -1 -1 1")?;
        writeln!(to, "    MUTESOLO {} 0 0", u8::from(track.is_muted))?;
        // Tracks have an even number of channels, two at least.
        writeln!(to, "    NCHAN {}", track.channels.next_multiple_of(2).clamp(2, 128))?;
        writeln!(to, "    MAINSEND 1 0")?;
        writeln!(to, "    <ITEM")?;
        writeln!(to, "      POSITION 0")?;
        writeln!(to, "      LENGTH {}", seconds(self.length_s))?;
        writeln!(to, "      LOOP 0")?;
        writeln!(to, "      FADEIN 1 0 0 1 0 0 0")?;
        writeln!(to, "      FADEOUT 1 0 0 1 0 0 0")?;
        writeln!(to, "      NAME {name}")?;
        let kind = if track.file.to_lowercase().ends_with(".flac") { "FLAC" } else { "WAVE" };
        writeln!(to, "      <SOURCE {kind}")?;
        writeln!(to, "        FILE {}", quoted(&track.file))?;
        writeln!(to, "      >")?;
        writeln!(to, "    >")?;
        writeln!(to, "  >")
    }
}

/// A colour of its own for each name, always the same one: bright, and of any hue.
pub fn colour_of(name: &str) -> [u8; 3] {
    // FNV-1a, then a step around the circle of hues.
    let hash =
        name.bytes().fold(0x811c_9dc5u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
    let hue = f64::from(hash) / f64::from(u32::MAX) * 6.0;
    [0.0, 4.0, 2.0].map(|shift| {
        let distance = ((hue + shift) % 6.0 - 3.0).abs() - 1.0;
        (80.0 + 150.0 * distance.clamp(0.0, 1.0)).round() as u8
    })
}

/// A colour as a number, with the bit that says there is one.
fn colour(colour: Option<[u8; 3]>) -> u32 {
    colour.map_or(16_576, |[red, green, blue]| u32::from_le_bytes([red, green, blue, 1]))
}

/// A time with all its digits; never with an exponent, nor as a negative zero.
fn seconds(time_s: f64) -> String {
    (time_s + 0.0).to_string()
}

/// A text as one word of a line.
fn quoted(text: &str) -> String {
    let line: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    match ['"', '\'', '`'].into_iter().find(|quote| !line.contains(*quote)) {
        Some(quote) => format!("{quote}{line}{quote}"),
        // With all three in it one has to give way, as Reaper does it.
        None => format!("`{}`", line.replace('`', "'")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A part of a project, read back: its lines and the parts in it.
    #[derive(Debug, Default)]
    struct Part {
        lines: Vec<Vec<String>>,
        parts: Vec<Part>,
    }

    impl Part {
        fn values(&self, key: &str) -> Vec<&[String]> {
            self.lines.iter().filter(|line| line[0] == key).map(|line| &line[1..]).collect()
        }
    }

    /// The words of a line, as Reaper takes them apart.
    fn words(line: &str) -> Vec<String> {
        let mut rest = line.trim();
        let mut words = Vec::new();
        while let Some(first) = rest.chars().next() {
            let (word, after) = if "\"'`".contains(first) {
                rest[1..].split_once(first).expect("the quote ends")
            } else {
                rest.split_once(' ').unwrap_or((rest, ""))
            };
            words.push(word.to_owned());
            rest = after.trim_start();
        }
        words
    }

    fn parse(lines: &mut dyn Iterator<Item = &str>, head: &str) -> Part {
        let mut part = Part { lines: vec![words(head)], parts: Vec::new() };
        loop {
            let line = lines.next().expect("the part ends").trim();
            match line.strip_prefix('<') {
                Some(head) => part.parts.push(parse(lines, head)),
                None if line == ">" => return part,
                None => part.lines.push(words(line)),
            }
        }
    }

    fn read_back(project: &Project) -> Part {
        let mut text = Vec::new();
        project.write(&mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let mut lines = text.lines();
        let head = lines.next().unwrap().strip_prefix('<').unwrap();
        let part = parse(&mut lines, head);
        assert_eq!(lines.next(), None);
        part
    }

    #[test]
    fn a_project_reads_back() {
        let names = ["ball", "a \"big\" ball", "it's", "\"'", "", "<TRACK", "> x", "é\n2"];
        let tracks = names.map(|name| Track {
            name: name.into(),
            file: format!("stems/{name}.FLAC"),
            channels: 3,
            is_muted: name == "it's",
            colour: Some([1, 2, 3]),
        });
        let markers = names.map(|name| Marker { time_s: 1.25, name: name.into(), colour: None });
        let project = Project {
            rate_hz: 44_100,
            length_s: 3.5,
            offset_s: 3600.0,
            tracks: tracks.into(),
            markers: markers.into(),
        };
        let part = read_back(&project);
        assert_eq!(part.values("PROJOFFS")[0][0], "3600");
        assert_eq!(part.values("SAMPLERATE")[0][0], "44100");
        assert_eq!(part.parts.len(), names.len());
        let found = part.values("MARKER");
        for (index, name) in names.iter().enumerate() {
            let name = name.replace('\n', " ");
            assert_eq!(found[index][..3], [(index + 1).to_string(), "1.25".into(), name.clone()]);
            let track = &part.parts[index];
            assert_eq!(track.values("NAME")[0], std::slice::from_ref(&name));
            assert_eq!(track.values("NCHAN")[0], ["4"]);
            assert_eq!(track.values("MUTESOLO")[0][0], if name == "it's" { "1" } else { "0" });
            assert_eq!(track.values("PEAKCOL")[0], [(1 << 24 | 3 << 16 | 2 << 8 | 1).to_string()]);
            let item = &track.parts[0];
            assert_eq!(
                (item.values("POSITION")[0], item.values("LENGTH")[0]),
                (&["0".to_owned()][..], &["3.5".to_owned()][..])
            );
            let source = &item.parts[0];
            assert_eq!(source.lines[0], ["SOURCE", "FLAC"]);
            assert_eq!(source.values("FILE")[0], [format!("stems/{name}.FLAC")]);
        }
    }

    #[test]
    fn no_name_breaks_a_line() {
        assert_eq!(quoted("a b"), "\"a b\"");
        assert_eq!(quoted("a\"b"), "'a\"b'");
        assert_eq!(quoted("a\"'b"), "`a\"'b`");
        assert_eq!(quoted("\"'`\n"), "`\"'' `");
        assert_eq!([-0.0, 1e-7, 86_400.5, 36_001.48].map(seconds), ["0", "0.0000001", "86400.5", "36001.48"]);
    }

    #[test]
    fn colours_are_bright_and_told_by_the_name() {
        assert_eq!(colour_of("ball"), colour_of("ball"));
        assert_ne!(colour_of("ball"), colour_of("box"));
        for number in 0..200 {
            let colour = colour_of(&format!("box {number}"));
            assert!(
                colour.iter().all(|c| (80..=230).contains(c))
                    && colour.contains(&80)
                    && colour.contains(&230)
            );
        }
    }
}
