//! How each line stands in the text, for reading and for writing. What differs between the spaces is
//! in [`space`](super::space).

use std::borrow::Cow;
use std::io::BufRead;

use super::lexer::{Lines, Words, push_name, push_quoted, shown};
use super::note::{Declared, Note};
use super::rules::{Fault, Named, Rules, Step};
use super::space::{ChannelSpace, LineRef, ObjectSpace, Space, once, push_whereabouts, read_whereabouts};
use super::{
    Action, Blow, Cue, Grain, Header, INSTRUMENTS, Make, MicrophoneKey, Mode, Order, Pattern, Radiation,
    Repeat, Sound, Start, Statement, Verb, quantity,
};
use crate::{Error, Place, Result};

/// The version of the text that this library writes, and the newest that it reads.
pub const VERSION: u32 = 1;

const MAGIC: &str = "froufrou-score";
const SPACES: [&str; 2] = [ObjectSpace::NAME, ChannelSpace::NAME];
const DECLARATIONS: [&str; 8] =
    ["order", "speed-of-sound", "duration", "seed", "surroundings", "pattern", "sound", "mode"];
const THREAD_VERBS: [&str; 5] = ["start", "path", "key", "jump", "end"];
const CUE_VERBS: [&str; 3] = ["set", "strike", "grain"];
const START_CLAUSES: [&str; 5] = ["speed", "offset", "object", "cause", "pattern"];
/// What makes a sound of the grains of a corpus.
const GRAINS: &str = "grains";

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
    if header.seed != 0 {
        lines.push((Declared::Seed, format!("seed {}", header.seed)));
    }
    let in_space = |what: &str, has: bool| {
        if has && !S::HAS_PLACES {
            return Err(Error::new(format!("a score in {} space has no {what}", S::NAME)));
        }
        Ok(())
    };
    in_space("surroundings", header.surroundings.is_some())?;
    in_space("patterns", !header.patterns.is_empty())?;
    if let Some(scene) = &header.surroundings {
        let mut text = String::from("surroundings ");
        push_quoted(&mut text, scene);
        lines.push((Declared::Surroundings, text));
    }
    let receivers = S::receiver_lines(&header.receivers)?;
    lines.extend(receivers.into_iter().map(|(index, text)| (Declared::Receiver(index), text)));
    for (index, pattern) in header.patterns.iter().enumerate() {
        let mut text = String::from("pattern ");
        push_name(&mut text, &pattern.name);
        match &pattern.radiation {
            Radiation::Surface => text.push_str(" surface"),
            Radiation::Harmonics(harmonics) => {
                for &harmonic in harmonics {
                    text.push(' ');
                    quantity::HARMONIC.push(&mut text, harmonic)?;
                }
            }
        }
        lines.push((Declared::Pattern(index), text));
    }
    for (index, sound) in header.sounds.iter().enumerate() {
        lines.push((Declared::Sound(index), sound_line(sound)?));
        if let Make::Modes { modes, .. } = &sound.make {
            for (number, mode) in modes.iter().enumerate() {
                lines.push((Declared::Mode(index, number), mode_line(&sound.name, mode)?));
            }
        }
    }
    Ok(lines)
}

/// Reads what follows `sound`.
pub fn read_sound(words: &mut Words<'_>) -> Result<Sound> {
    let name = words.name("the sound's name")?.into_owned();
    let quoted = words.peek() == Some(b'"');
    let file = words.name("the path of the recording, or what makes the sound")?;
    if quoted || !(INSTRUMENTS.contains(&file.as_ref()) || file == GRAINS) {
        return read_recording(name, file.into_owned(), words);
    }
    let make = match (Make::of_word(&file), file.as_ref()) {
        (Some(make), _) => make,
        (None, "modes") => {
            let table = match words.peek() {
                Some(b'"') => Some(words.name("the table of modes")?.into_owned()),
                _ => None,
            };
            Make::Modes { table, modes: Vec::new() }
        }
        (None, GRAINS) => Make::Grains { corpus: words.name("the folder of the corpus")?.into_owned() },
        (None, "cloth") => {
            Make::Cloth { corpus: words.name("the folder of the corpus, or a model")?.into_owned() }
        }
        (None, "paper") => {
            Make::Paper { corpus: words.name("the folder of the database, or a model")?.into_owned() }
        }
        _ => Make::Procedure { script: words.name("the path of the script")?.into_owned() },
    };
    let with = match words.keyword("`with`")? {
        None => Vec::new(),
        Some("with") => read_values(words)?,
        Some(other) => return Err(words.unknown("word", other, ["with"], "`with` and values")),
    };
    Ok(Sound { name, make, with })
}

fn read_recording(name: String, path: String, words: &mut Words<'_>) -> Result<Sound> {
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
    Ok(Sound::recording(name, path, repeat.unwrap_or(Repeat::Once), channel))
}

/// Reads names with values up to the end of the line; at least one.
fn read_values(words: &mut Words<'_>) -> Result<Vec<(String, f64)>> {
    let mut values: Vec<(String, f64)> = Vec::new();
    loop {
        let name = words.name("the name of a value")?.into_owned();
        if name.is_empty() {
            return Err(words.fault("a value has an empty name"));
        }
        if values.iter().any(|(given, _)| *given == name) {
            return Err(words.fault(format!("`{name}` is given twice")));
        }
        values.push((name, words.number_of(quantity::PARAMETER)?));
        if words.peek().is_none() {
            return Ok(values);
        }
    }
}

fn push_values(text: &mut String, values: &[(String, f64)]) -> Result<()> {
    for (index, (name, value)) in values.iter().enumerate() {
        if name.is_empty() || values[..index].iter().any(|(given, _)| given == name) {
            return Err(Error::new(format!("a value is named `{name}`, which is empty or given twice")));
        }
        text.push(' ');
        push_name(text, name);
        text.push(' ');
        quantity::PARAMETER.push(text, *value)?;
    }
    Ok(())
}

fn sound_line(sound: &Sound) -> Result<String> {
    let mut text = String::from("sound ");
    push_name(&mut text, &sound.name);
    text.push(' ');
    match &sound.make {
        Make::Recording { path, repeat, channel } => {
            push_quoted(&mut text, path);
            text.push_str(match repeat {
                Repeat::Once => "",
                Repeat::Loop => " loop",
                Repeat::ExactLoop => " loop exact",
            });
            if let Some(channel) = channel {
                text.push_str(&format!(" channel {channel}"));
            }
        }
        Make::Modes { table, .. } => {
            text.push_str("modes");
            if let Some(table) = table {
                text.push(' ');
                push_quoted(&mut text, table);
            }
        }
        Make::String | Make::Bar(_) | Make::Needle | Make::StickSlip | Make::Turbulence | Make::Membrane => {
            text.push_str(sound.make.kind());
        }
        Make::Procedure { script } => {
            text.push_str("procedure ");
            push_quoted(&mut text, script);
        }
        Make::Grains { corpus } | Make::Cloth { corpus } | Make::Paper { corpus } => {
            text.push_str(sound.make.kind());
            text.push(' ');
            push_quoted(&mut text, corpus);
        }
    }
    if !sound.with.is_empty() {
        text.push_str(" with");
        push_values(&mut text, &sound.with)?;
    }
    Ok(text)
}

/// Reads what follows `mode`: the name of its sound and the mode.
pub fn read_mode<'a>(words: &mut Words<'a>) -> Result<(Cow<'a, str>, Mode)> {
    let sound = words.name("the sound's name")?;
    let mut mode = Mode {
        frequency_hz: words.number_of(quantity::FREQUENCY)?,
        decay_per_s: words.number_of(quantity::DECAY)?,
        gain: words.number_of(quantity::MODE_GAIN)?,
        points: Vec::new(),
    };
    while words.next_is_number() {
        mode.points.push(words.number_of(quantity::MODE_GAIN)?);
    }
    Ok((sound, mode))
}

fn mode_line(sound: &str, mode: &Mode) -> Result<String> {
    let mut text = String::from("mode ");
    push_name(&mut text, sound);
    text.push(' ');
    quantity::FREQUENCY.push(&mut text, mode.frequency_hz)?;
    text.push(' ');
    quantity::DECAY.push(&mut text, mode.decay_per_s)?;
    for &gain in std::iter::once(&mode.gain).chain(&mode.points) {
        text.push(' ');
        quantity::MODE_GAIN.push(&mut text, gain)?;
    }
    Ok(text)
}

/// Reads what follows `pattern`.
pub fn read_pattern(words: &mut Words<'_>) -> Result<Pattern> {
    let name = words.name("the pattern's name")?.into_owned();
    let mut harmonics = Vec::new();
    while words.next_is_number() {
        harmonics.push(words.number_of(quantity::HARMONIC)?);
    }
    let radiation = match words.peek() {
        Some(next) if harmonics.is_empty() && next != b'#' => {
            let expected = "spherical harmonics, or `surface`";
            match words.keyword_here(expected)? {
                "surface" => Radiation::Surface,
                other => return Err(words.unknown("word", other, ["surface"], expected)),
            }
        }
        _ => Radiation::Harmonics(harmonics),
    };
    Ok(Pattern { name, radiation })
}

/// Reads what follows the verb of a thread's line.
pub fn read_statement<S: Space>(
    verb: &str,
    words: &mut Words<'_>,
    header: &Header<S::Receiver>,
    rules: &mut Rules<S::Value>,
) -> Result<S::Line> {
    let (thread, path) = words.thread()?;
    let time_s = words.number_of(quantity::TIME)?;
    let sound = match verb {
        "start" => words.name("the sound's name")?,
        _ => Cow::Borrowed(""),
    };
    let step = match verb {
        "start" => Step::Start { sound: &sound },
        "path" => Step::Path,
        "jump" => Step::Jump,
        "end" => Step::End,
        _ => Step::Key,
    };
    let slot =
        rules.thread(step, (thread, path), time_s, words.number()).map_err(|fault| place(words, fault))?;

    let mut draft = S::Draft::default();
    S::read_plain(words, &header.receivers, &mut draft)?;
    let starts = matches!(step, Step::Start { .. });
    let (mut speed, mut offset_s, mut object, mut cause, mut pattern) = (None, None, None, None, None);
    while let Some(keyword) = words.keyword("a keyword")? {
        match keyword {
            "speed" if starts => {
                slot.plays_recording(keyword).map_err(|error| words.place(error))?;
                let number = words.number_of(quantity::PLAYBACK_SPEED)?;
                once(&mut speed, keyword, words, number)?;
            }
            "offset" if starts => {
                slot.plays_recording(keyword).map_err(|error| words.place(error))?;
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
            "pattern" if starts && S::HAS_PLACES => {
                let name = words.name("the pattern's name")?;
                slot.has_pattern(&name).map_err(|error| words.place(error))?;
                once(&mut pattern, keyword, words, name)?;
            }
            _ if !starts && start_clauses::<S>().contains(&keyword) => {
                return Err(words.fault(format!("`{keyword}` belongs on the thread's `start` line")));
            }
            _ if S::read_clause(keyword, words, &header.receivers, &mut draft)? => {}
            _ => {
                let more: &[&str] = if starts { start_clauses::<S>() } else { &[] };
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
            pattern: pattern.unwrap_or_default().into_owned(),
        }),
        Step::Path => Verb::Path,
        Step::Key => Verb::Key,
        Step::Jump => Verb::Jump,
        Step::End => Verb::End,
    };
    Ok(S::thread_line(Statement { thread, path, time_s, verb, value }))
}

/// What a `start` line may say beside its value.
fn start_clauses<S: Space>() -> &'static [&'static str] {
    // Only sources that are somewhere radiate into directions.
    if S::HAS_PLACES { &START_CLAUSES } else { &START_CLAUSES[..4] }
}

/// Reads what follows `set`, `strike` or `grain`.
pub fn read_cue<V>(verb: &str, words: &mut Words<'_>, rules: &mut Rules<V>) -> Result<Cue> {
    let thread = words.whole("the thread's number")?;
    let time_s = words.number_of(quantity::TIME)?;
    rules.cue(verb, thread, time_s).map_err(|fault| place(words, fault))?;
    let (action, cause) = match verb {
        "set" => (Action::Set(read_values(words)?), None),
        "strike" => read_blow(words)?,
        _ => read_grain(words)?,
    };
    Ok(Cue { thread, time_s, action, cause: cause.unwrap_or_default() })
}

/// Reads why a grain or a strike is.
fn read_cause(cause: &mut Option<String>, keyword: &str, words: &mut Words<'_>) -> Result<()> {
    let text = words.name("the cause, in quotes")?.into_owned();
    once(cause, keyword, words, text)
}

fn read_blow(words: &mut Words<'_>) -> Result<(Action, Option<String>)> {
    let (mut impulse_ns, mut at, mut contact_s, mut cause) = (None, None, None, None);
    let expected = "`impulse J`, `place X`, `contact SECONDS` or `cause \"…\"`";
    while let Some(keyword) = words.keyword(expected)? {
        if keyword == "cause" {
            read_cause(&mut cause, keyword, words)?;
            continue;
        }
        let (part, quantity) = match keyword {
            "impulse" => (&mut impulse_ns, quantity::IMPULSE),
            "place" => (&mut at, quantity::STRIKE_PLACE),
            "contact" => (&mut contact_s, quantity::CONTACT),
            other => {
                return Err(words.unknown("word", other, ["impulse", "place", "contact", "cause"], expected));
            }
        };
        let number = words.number_of(quantity)?;
        once(part, keyword, words, number)?;
    }
    let impulse_ns = impulse_ns.ok_or_else(|| words.fault("a strike without an `impulse`"))?;
    let blow = Blow { impulse_ns, place: at.unwrap_or(0.0), contact_s: contact_s.unwrap_or(0.0) };
    Ok((Action::Strike(blow), cause))
}

fn read_grain(words: &mut Words<'_>) -> Result<(Action, Option<String>)> {
    let number = words.whole("the grain's number")?;
    let (mut gain, mut speed, mut spread, mut cause) = (None, None, None, None);
    let expected = "`gain G`, `speed S`, `spread P` or `cause \"…\"`";
    while let Some(keyword) = words.keyword(expected)? {
        if keyword == "cause" {
            read_cause(&mut cause, keyword, words)?;
            continue;
        }
        let (part, quantity) = match keyword {
            "gain" => (&mut gain, quantity::GAIN),
            "speed" => (&mut speed, quantity::PLAYBACK_SPEED),
            "spread" => (&mut spread, quantity::SPREAD),
            other => {
                return Err(words.unknown("word", other, ["gain", "speed", "spread", "cause"], expected));
            }
        };
        let number = words.number_of(quantity)?;
        once(part, keyword, words, number)?;
    }
    let grain = Grain {
        number,
        gain: gain.unwrap_or(1.0),
        speed: speed.unwrap_or(1.0),
        spread: spread.unwrap_or(0.0),
    };
    Ok((Action::Grain(grain), cause))
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
                Verb::Path => "path ",
                Verb::Key => "key ",
                Verb::Jump => "jump ",
                Verb::End => "end ",
            });
            text.push_str(&Named((statement.thread, statement.path)).to_string());
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
                if !start.pattern.is_empty() {
                    if !S::HAS_PLACES {
                        return Err(Error::new(format!("a score in {} space has no patterns", S::NAME)));
                    }
                    text.push_str(" pattern ");
                    push_name(text, &start.pattern);
                }
            }
        }
        LineRef::Cue(cue) => {
            text.push_str(cue_verb(&cue.action));
            text.push_str(&format!(" {} ", cue.thread));
            quantity::TIME.push(text, cue.time_s)?;
            match &cue.action {
                Action::Set(values) if values.is_empty() => {
                    return Err(Error::new("a `set` without any value"));
                }
                Action::Set(values) => push_values(text, values)?,
                Action::Strike(blow) => {
                    text.push_str(" impulse ");
                    quantity::IMPULSE.push(text, blow.impulse_ns)?;
                    text.push_str(" place ");
                    quantity::STRIKE_PLACE.push(text, blow.place)?;
                    text.push_str(" contact ");
                    quantity::CONTACT.push(text, blow.contact_s)?;
                }
                Action::Grain(grain) => {
                    text.push_str(&format!(" {} gain ", grain.number));
                    quantity::GAIN.push(text, grain.gain)?;
                    // The bits are compared, so that even a negative zero comes back.
                    if grain.speed != 1.0 {
                        text.push_str(" speed ");
                        quantity::PLAYBACK_SPEED.push(text, grain.speed)?;
                    }
                    if grain.spread.to_bits() != 0 {
                        text.push_str(" spread ");
                        quantity::SPREAD.push(text, grain.spread)?;
                    }
                }
            }
            // What is only said has no cause.
            if !cue.cause.is_empty() && !matches!(cue.action, Action::Set(_)) {
                text.push_str(" cause ");
                push_quoted(text, &cue.cause);
            }
        }
        LineRef::Microphone(key) => {
            text.push_str(if key.cut { "cut " } else { "hear " });
            let receiver = receivers
                .get(key.microphone)
                .ok_or_else(|| Error::new(format!("there is no microphone with index {}", key.microphone)))?;
            S::receiver_names(receiver).iter().for_each(|name| push_name(text, name));
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

/// The word that begins the line of a cue.
pub fn cue_verb(action: &Action) -> &'static str {
    match action {
        Action::Set(_) => "set",
        Action::Strike(_) => "strike",
        Action::Grain(_) => "grain",
    }
}

/// Whether the word begins the line of a cue.
pub fn is_cue_verb(keyword: &str) -> bool {
    CUE_VERBS.contains(&keyword)
}

/// Whether the word begins a line of a thread.
pub fn is_thread_verb(keyword: &str) -> bool {
    THREAD_VERBS.contains(&keyword)
}

/// Whether the word begins a line after the header.
pub fn is_verb<S: Space>(keyword: &str) -> bool {
    THREAD_VERBS.contains(&keyword) || is_cue_verb(keyword) || S::RECEIVER_VERBS.contains(&keyword)
}

/// A line begins with a word that cannot begin one here.
pub fn unknown_keyword<S: Space>(words: &Words<'_>, keyword: &str) -> Error {
    let elsewhere = !S::HAS_PLACES && ["surroundings", "pattern"].contains(&keyword);
    if DECLARATIONS.contains(&keyword) && !elsewhere || S::RECEIVER_KEYWORDS.contains(&keyword) {
        return words
            .fault(format!("`{keyword}` stands after the first line of a thread or microphone"))
            .help("move it up into the header, before all those lines");
    }
    let in_object =
        ObjectSpace::RECEIVER_KEYWORDS.contains(&keyword) || ObjectSpace::RECEIVER_VERBS.contains(&keyword);
    let in_object = in_object || elsewhere;
    let in_channel = ChannelSpace::RECEIVER_KEYWORDS.contains(&keyword);
    for (belongs, space) in [(in_object, ObjectSpace::NAME), (in_channel, ChannelSpace::NAME)] {
        if belongs {
            let what = format!(
                "`{keyword}` belongs into a score in {space} space, this one is in {} space",
                S::NAME
            );
            return words.fault(what);
        }
    }
    let known = S::RECEIVER_KEYWORDS.iter().copied().chain(DECLARATIONS).chain(THREAD_VERBS).chain(CUE_VERBS);
    let known = known.chain(S::RECEIVER_VERBS.iter().copied());
    words.unknown("keyword", keyword, known, "a declaration or a line of a thread")
}
