//! How each line stands in the text, for reading and for writing. What differs between the spaces is
//! in [`space`](super::space).

use std::borrow::Cow;
use std::io::BufRead;

use super::lexer::{Lines, Words, push_name, push_quoted, shown};
use super::note::{Declared, Note};
use super::rules::{Fault, Rules, Step};
use super::space::{ChannelSpace, LineRef, ObjectSpace, Space, once, push_whereabouts, read_whereabouts};
use super::{Header, MicrophoneKey, Order, Repeat, Sound, Start, Statement, Verb, quantity};
use crate::{Error, Place, Result};

/// The version of the text that this library writes, and the newest that it reads.
pub const VERSION: u32 = 1;

const MAGIC: &str = "froufrou-score";
const SPACES: [&str; 2] = [ObjectSpace::NAME, ChannelSpace::NAME];
const DECLARATIONS: [&str; 4] = ["order", "speed-of-sound", "duration", "sound"];
const THREAD_VERBS: [&str; 4] = ["start", "key", "jump", "end"];
const START_CLAUSES: [&str; 4] = ["speed", "offset", "object", "cause"];

/// Reads the first line, which tells the space.
pub fn read_first_line<R: BufRead>(lines: &mut Lines<R>, note: &mut Option<Note>) -> Result<&'static str> {
    let no_score = "this is no froufrou score";
    let help = format!("its first line must be `{MAGIC} {VERSION} object` or `{MAGIC} {VERSION} channel`");
    let Some(mut words) = lines.next()? else {
        let place = Place::Line { line: 1, column: 0 };
        return Err(Error::new(format!("{no_score}, it is empty")).at(place).help(help));
    };
    match words.keyword(MAGIC)? {
        Some(MAGIC) => {}
        Some(other) => {
            return Err(words.fault(format!("{no_score}, it begins with {}", shown(other))).help(help));
        }
        None => return Err(words.fault(no_score).help(help)),
    }
    let version: u32 = words.whole("the version")?;
    if version != VERSION {
        let newer = if version > VERSION { ": a newer froufrou wrote it" } else { "" };
        return Err(words.fault(format!("found a score of version {version}, expected {VERSION}{newer}")));
    }
    let expected = "`object` or `channel`";
    let found = words.keyword_here(expected)?;
    let space = SPACES
        .into_iter()
        .find(|&space| space == found)
        .ok_or_else(|| words.unknown("space", found, SPACES, expected))?;
    words.end()?;
    if let Some(note) = note {
        note.set_beside(words.comment());
    }
    Ok(space)
}

/// The lines of a header in their canonical order.
pub fn header_lines<S: Space>(header: &Header<S::Receiver>) -> Result<Vec<(Declared, String)>> {
    let mut lines = vec![(Declared::FirstLine, format!("{MAGIC} {VERSION} {}", S::NAME))];
    match header.order {
        Order::Time => lines.push((Declared::Order, "order time".into())),
        Order::Thread => lines.push((Declared::Order, "order thread".into())),
        Order::Free => {}
    }
    let mut text = String::from("speed-of-sound ");
    quantity::SPEED_OF_SOUND.push(&mut text, header.speed_of_sound_mps)?;
    lines.push((Declared::SpeedOfSound, text));
    if let Some(duration_s) = header.duration_s {
        let mut text = String::from("duration ");
        quantity::DURATION.push(&mut text, duration_s)?;
        lines.push((Declared::Duration, text));
    }
    let receivers = S::receiver_lines(&header.receivers)?;
    lines.extend(receivers.into_iter().enumerate().map(|(index, text)| (Declared::Receiver(index), text)));
    let sounds = header.sounds.iter().enumerate();
    lines.extend(sounds.map(|(index, sound)| (Declared::Sound(index), sound_line(sound))));
    Ok(lines)
}

/// Reads what follows `sound`.
pub fn read_sound(words: &mut Words<'_>) -> Result<Sound> {
    let name = words.name("the sound's name")?.into_owned();
    let recording = words.name("the path of the recording")?.into_owned();
    let (mut repeat, mut channel) = (None, None);
    let expected = "`once`, `loop`, `loop exact` or `channel N`";
    let mut may_be_exact = false;
    while let Some(keyword) = words.keyword(expected)? {
        match keyword {
            "exact" if may_be_exact => repeat = Some(Repeat::ExactLoop),
            "once" => once(&mut repeat, "once or loop", words, Repeat::Once)?,
            "loop" => once(&mut repeat, "once or loop", words, Repeat::Loop)?,
            "channel" => {
                let index = words.whole("the channel of the recording")?;
                once(&mut channel, keyword, words, index)?;
            }
            other => {
                return Err(words.unknown("word", other, ["once", "loop", "channel"], expected));
            }
        }
        may_be_exact = keyword == "loop";
    }
    Ok(Sound { name, recording, repeat: repeat.unwrap_or(Repeat::Once), channel })
}

fn sound_line(sound: &Sound) -> String {
    let mut text = String::from("sound ");
    push_name(&mut text, &sound.name);
    text.push(' ');
    push_quoted(&mut text, &sound.recording);
    text.push_str(match sound.repeat {
        Repeat::Once => "",
        Repeat::Loop => " loop",
        Repeat::ExactLoop => " loop exact",
    });
    if let Some(channel) = sound.channel {
        text.push_str(&format!(" channel {channel}"));
    }
    text
}

/// Reads what follows the verb of a thread's line.
pub fn read_statement<S: Space>(
    verb: &str,
    words: &mut Words<'_>,
    header: &Header<S::Receiver>,
    rules: &mut Rules<S::Value>,
) -> Result<S::Line> {
    let thread = words.whole("the thread's number")?;
    let time_s = words.number_of(quantity::TIME)?;
    let sound = match verb {
        "start" => words.name("the sound's name")?,
        _ => Cow::Borrowed(""),
    };
    let step = match verb {
        "start" => Step::Start { sound: &sound },
        "jump" => Step::Jump,
        "end" => Step::End,
        _ => Step::Key,
    };
    let slot = rules.thread(step, thread, time_s, words.number()).map_err(|fault| place(words, fault))?;

    let mut draft = S::Draft::default();
    S::read_plain(words, &header.receivers, &mut draft)?;
    let starts = matches!(step, Step::Start { .. });
    let (mut speed, mut offset_s, mut object, mut cause) = (None, None, None, None);
    while let Some(keyword) = words.keyword("a keyword")? {
        match keyword {
            "speed" if starts => {
                let number = words.number_of(quantity::PLAYBACK_SPEED)?;
                once(&mut speed, keyword, words, number)?;
            }
            "offset" if starts => {
                let number = words.number_of(quantity::OFFSET)?;
                once(&mut offset_s, keyword, words, number)?;
            }
            "object" if starts => {
                let name = words.name("the object's name")?;
                once(&mut object, keyword, words, name)?;
            }
            "cause" if starts => {
                let text = words.name("the cause, in quotes")?;
                once(&mut cause, keyword, words, text)?;
            }
            _ if START_CLAUSES.contains(&keyword) => {
                return Err(words.fault(format!("`{keyword}` belongs on the thread's `start` line")));
            }
            _ if S::read_clause(keyword, words, &mut draft)? => {}
            _ => {
                let more: &[&str] = if starts { &START_CLAUSES } else { &[] };
                let known = S::CLAUSES.iter().chain(more);
                let expected: Vec<String> = known.clone().map(|word| format!("`{word}`")).collect();
                let expected = match expected.as_slice() {
                    [] => "the end of the line".into(),
                    [before @ .., last] if !before.is_empty() => {
                        format!("{} or {last}", before.join(", "))
                    }
                    only => only.concat(),
                };
                return Err(words.unknown("word", keyword, known.copied(), &expected));
            }
        }
    }
    let value = S::value(draft, slot.before()).map_err(|error| words.place(error))?;
    slot.keep(&value);
    let verb = match step {
        Step::Start { .. } => Verb::Start(Start {
            sound: sound.into_owned(),
            speed: speed.unwrap_or(1.0),
            offset_s: offset_s.unwrap_or(0.0),
            object: object.unwrap_or_default().into_owned(),
            cause: cause.unwrap_or_default().into_owned(),
        }),
        Step::Key => Verb::Key,
        Step::Jump => Verb::Jump,
        Step::End => Verb::End,
    };
    Ok(S::thread_line(Statement { thread, time_s, verb, value }))
}

/// Reads what follows `hear` or `cut`.
pub fn read_microphone_key<V>(
    cut: bool,
    words: &mut Words<'_>,
    rules: &mut Rules<V>,
) -> Result<MicrophoneKey> {
    let name = words.name("the microphone's name")?;
    let time_s = words.number_of(quantity::TIME)?;
    let microphone = rules.microphone(&name).map_err(|fault| place(words, fault))?;
    let heard = rules.hear(microphone, time_s, cut).map_err(|fault| place(words, fault))?;
    let pose = read_whereabouts(words, heard.last.as_ref())?;
    let key = MicrophoneKey { microphone, time_s, pose, cut };
    heard.last = Some(key);
    Ok(key)
}

/// Appends a line after the header.
pub fn push_line<S: Space>(text: &mut String, line: &S::Line, receivers: &[S::Receiver]) -> Result<()> {
    match S::of_line(line) {
        LineRef::Thread(statement) => {
            text.push_str(match statement.verb {
                Verb::Start(_) => "start ",
                Verb::Key => "key ",
                Verb::Jump => "jump ",
                Verb::End => "end ",
            });
            text.push_str(&statement.thread.to_string());
            text.push(' ');
            quantity::TIME.push(text, statement.time_s)?;
            if let Verb::Start(start) = &statement.verb {
                text.push(' ');
                push_name(text, &start.sound);
            }
            S::push_value(text, &statement.value, receivers)?;
            if let Verb::Start(start) = &statement.verb {
                // The bits are compared, so that even a negative zero comes back.
                if start.speed != 1.0 {
                    text.push_str(" speed ");
                    quantity::PLAYBACK_SPEED.push(text, start.speed)?;
                }
                if start.offset_s.to_bits() != 0 {
                    text.push_str(" offset ");
                    quantity::OFFSET.push(text, start.offset_s)?;
                }
                if !start.object.is_empty() {
                    text.push_str(" object ");
                    push_name(text, &start.object);
                }
                if !start.cause.is_empty() {
                    text.push_str(" cause ");
                    push_quoted(text, &start.cause);
                }
            }
        }
        LineRef::Microphone(key) => {
            text.push_str(if key.cut { "cut " } else { "hear " });
            let receiver = receivers
                .get(key.microphone)
                .ok_or_else(|| Error::new(format!("there is no microphone with index {}", key.microphone)))?;
            push_name(text, S::receiver_name(receiver));
            text.push(' ');
            quantity::TIME.push(text, key.time_s)?;
            push_whereabouts(text, &key.pose)?;
        }
    }
    Ok(())
}

/// Puts a broken rule at its word.
pub fn place(words: &Words<'_>, fault: Fault) -> Error {
    words.place_at_word(fault.word, *fault.error)
}

/// Whether the word begins a line of a thread.
pub fn is_thread_verb(keyword: &str) -> bool {
    THREAD_VERBS.contains(&keyword)
}

/// Whether the word begins a line after the header.
pub fn is_verb<S: Space>(keyword: &str) -> bool {
    THREAD_VERBS.contains(&keyword) || S::RECEIVER_VERBS.contains(&keyword)
}

/// A line begins with a word that cannot begin one here.
pub fn unknown_keyword<S: Space>(words: &Words<'_>, keyword: &str) -> Error {
    if DECLARATIONS.contains(&keyword) || keyword == S::RECEIVER_KEYWORD {
        return words
            .fault(format!("`{keyword}` stands after the first line of a thread or microphone"))
            .help("move it up into the header, before all those lines");
    }
    let in_object =
        ObjectSpace::RECEIVER_KEYWORD == keyword || ObjectSpace::RECEIVER_VERBS.contains(&keyword);
    for (belongs, space) in
        [(in_object, ObjectSpace::NAME), (keyword == ChannelSpace::RECEIVER_KEYWORD, ChannelSpace::NAME)]
    {
        if belongs {
            let what = format!(
                "`{keyword}` belongs into a score in {space} space, this one is in {} space",
                S::NAME
            );
            return words.fault(what);
        }
    }
    let known = [S::RECEIVER_KEYWORD].into_iter().chain(DECLARATIONS).chain(THREAD_VERBS);
    let known = known.chain(S::RECEIVER_VERBS.iter().copied());
    words.unknown("keyword", keyword, known, "a declaration or a line of a thread")
}
