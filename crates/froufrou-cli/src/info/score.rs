//! What is in a score: its space and order, who hears it, what it plays and for whom.

use std::collections::BTreeMap;
use std::io::BufRead;
use std::path::Path;

use froufrou::Result;
use froufrou::score::{
    AnyReader, AnySpace, Arrival, ChannelLine, Make, ObjectLine, Order, Pickup, Reader, Repeat, Space, Start,
    Statement, Verb,
};
use serde::Serialize;

use super::sheet::{Sheet, number, position};
use super::{Findings, Range};

#[derive(Serialize)]
pub struct ScoreFindings {
    space: &'static str,
    order: &'static str,
    speed_of_sound_mps: f64,
    duration_s: Option<f64>,
    microphones: Vec<Receiver>,
    channels: Vec<String>,
    sounds: Vec<SoundFindings>,
    threads: u64,
    lines: u64,
    microphone_lines: u64,
    /// Lines that tell synthesised sounds something.
    cues: u64,
    /// Paths besides the direct ones.
    paths: u64,
    times_s: Option<Range>,
    gains: Option<Range>,
    objects: Vec<ObjectFindings>,
    threads_without_object: u64,
}

#[derive(Serialize)]
struct Receiver {
    name: String,
    /// What it picks up.
    hears: String,
    /// Where it stands, if it never moves.
    position_m: Option<[f64; 3]>,
}

#[derive(Serialize)]
struct SoundFindings {
    name: String,
    kind: &'static str,
    /// The recording, table or script.
    file: Option<String>,
    /// What it is made with, or how it repeats.
    with: BTreeMap<String, f64>,
    repeat: Option<&'static str>,
    channel: Option<usize>,
    threads: u64,
}

#[derive(Serialize)]
struct ObjectFindings {
    name: String,
    threads: u64,
}

/// Reads a score line by line, in the memory of its header, its objects and what sounds at a time.
pub fn read(file: &Path) -> Result<ScoreFindings> {
    match AnyReader::open(file)? {
        AnySpace::Object(reader) => {
            let receivers = reader.header().receivers.iter().map(|microphone| Receiver {
                name: microphone.name.clone(),
                hears: pickup(&microphone.pickup),
                position_m: microphone.fixed.map(|pose| pose.position_m),
            });
            let microphones = receivers.collect();
            let found = count(reader, |line| match line {
                ObjectLine::Thread(Statement { time_s, verb, value, .. }) => {
                    (time_s, Said::Thread(verb, vec![value.gain]))
                }
                ObjectLine::Cue(cue) => (cue.time_s, Said::Cue),
                ObjectLine::Microphone(key) => (key.time_s, Said::Microphone),
            })?;
            Ok(ScoreFindings { microphones, ..found })
        }
        AnySpace::Channel(reader) => {
            let header = reader.header().clone();
            let channels = header.channels();
            let found = count(reader, |line| match line {
                ChannelLine::Thread(line) => {
                    let gains = header.heard(&line.value).map(|Arrival { gain, .. }| gain.abs()).collect();
                    (line.time_s, Said::Thread(line.verb, gains))
                }
                ChannelLine::Cue(cue) => (cue.time_s, Said::Cue),
            })?;
            Ok(ScoreFindings { channels, ..found })
        }
    }
}

/// What a line says.
enum Said {
    Thread(Verb, Vec<f64>),
    Cue,
    Microphone,
}

fn count<S: Space, R: BufRead>(
    reader: Reader<S, R>,
    parts: impl Fn(S::Line) -> (f64, Said),
) -> Result<ScoreFindings> {
    let header = reader.header();
    let mut found = ScoreFindings {
        space: S::NAME,
        order: match header.order {
            Order::Time => "time",
            Order::Thread => "thread",
            Order::Free => "free",
        },
        speed_of_sound_mps: header.speed_of_sound_mps,
        duration_s: header.duration_s,
        microphones: Vec::new(),
        channels: Vec::new(),
        sounds: Vec::new(),
        threads: 0,
        lines: 0,
        microphone_lines: 0,
        cues: 0,
        paths: 0,
        times_s: None,
        gains: None,
        objects: Vec::new(),
        threads_without_object: 0,
    };
    let sounds = header.sounds.clone();
    let mut played: BTreeMap<String, u64> = BTreeMap::new();
    let mut objects: BTreeMap<String, u64> = BTreeMap::new();
    for line in reader {
        found.lines += 1;
        let (time_s, said) = parts(line?);
        Range::widen(&mut found.times_s, time_s);
        let (verb, gains) = match said {
            Said::Thread(verb, gains) => (verb, gains),
            Said::Cue => {
                found.cues += 1;
                continue;
            }
            Said::Microphone => {
                found.microphone_lines += 1;
                continue;
            }
        };
        gains.into_iter().for_each(|gain| Range::widen(&mut found.gains, gain));
        found.paths += u64::from(verb == Verb::Path);
        if let Verb::Start(Start { sound, object, .. }) = verb {
            found.threads += 1;
            *played.entry(sound).or_default() += 1;
            if object.is_empty() {
                found.threads_without_object += 1;
            } else {
                *objects.entry(object).or_default() += 1;
            }
        }
    }
    let sounds = sounds.into_iter().map(|sound| SoundFindings {
        threads: played.get(&sound.name).copied().unwrap_or(0),
        name: sound.name,
        kind: sound.make.kind(),
        file: sound.make.file().map(str::to_owned),
        with: sound.with.into_iter().collect(),
        repeat: match sound.make {
            Make::Recording { repeat: Repeat::Once, .. } => Some("once"),
            Make::Recording { repeat: Repeat::Loop, .. } => Some("loop"),
            Make::Recording { repeat: Repeat::ExactLoop, .. } => Some("loop exact"),
            _ => None,
        },
        channel: match sound.make {
            Make::Recording { channel, .. } => channel,
            _ => None,
        },
    });
    found.sounds = sounds.collect();
    found.objects = objects.into_iter().map(|(name, threads)| ObjectFindings { name, threads }).collect();
    Ok(found)
}

impl Findings for ScoreFindings {
    const KIND: &'static str = "score";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        let range = |range: &Range| format!("{} to {}", number(range.from), number(range.to));
        sheet
            .fact("kind", format!("score in {} space", self.space))
            .fact("order", self.order)
            .fact_if("duration", self.duration_s.map(|s| format!("{} s", number(s))))
            .fact("speed of sound", format!("{} m/s", number(self.speed_of_sound_mps)))
            .fact("threads", self.threads)
            .fact_if("further paths", Some(self.paths).filter(|&paths| paths > 0))
            .fact(
                "lines",
                format!(
                    "{}, {} of them of microphones, {} cues",
                    self.lines, self.microphone_lines, self.cues
                ),
            )
            .fact_if("times", self.times_s.as_ref().map(|r| format!("{} s", range(r))))
            .fact_if("gains", self.gains.as_ref().map(range));
        if !self.channels.is_empty() {
            sheet.fact("channels", self.channels.join(", "));
        }
        let microphones = self.microphones.iter().map(|microphone| {
            let place = microphone.position_m.map_or_else(|| "as its lines say".to_owned(), position);
            vec![microphone.name.clone(), microphone.hears.clone(), place]
        });
        sheet.table(&["microphone", "hears", "position (m)"], microphones);
        let sounds = self.sounds.iter().map(|sound| {
            let channel = sound.channel.map(|channel| format!("channel {channel}"));
            let with = sound.with.iter().map(|(name, value)| format!("{name} {}", number(*value)));
            let made = sound.repeat.map(str::to_owned).into_iter().chain(channel).chain(with);
            vec![
                sound.name.clone(),
                sound.kind.to_owned(),
                sound.file.clone().unwrap_or_default(),
                made.collect::<Vec<_>>().join(", "),
                sound.threads.to_string(),
            ]
        });
        sheet.table(&["sound", "kind", "file", "plays", "threads"], sounds);
        let objects = self.objects.iter().map(|object| (object.name.clone(), object.threads));
        let without = Some(("(none)".to_owned(), self.threads_without_object)).filter(|(_, n)| *n > 0);
        let objects = objects.chain(without).map(|(name, threads)| vec![name, threads.to_string()]);
        sheet.table(&["object", "threads"], objects);
        sheet
    }
}

/// What a microphone picks up, in the words of the score.
pub fn pickup(pickup: &Pickup) -> String {
    match pickup {
        Pickup::Shape(shape) => match (shape.c, shape.k) {
            (_, 0.0) => "omni".to_owned(),
            (0.0, 1.0) => "cardioid".to_owned(),
            (c, k) => format!("shape {} {}", number(c), number(k)),
        },
        Pickup::Binaural { head, shared } => {
            let head = head.as_ref().map_or(String::new(), |head| format!(" {head}"));
            format!("binaural{head}{}", if *shared { " shared" } else { "" })
        }
        Pickup::Ambisonic { order } => format!("ambisonic {order}"),
        Pickup::Loudspeakers(all) => format!("{} loudspeakers", all.len()),
    }
}
