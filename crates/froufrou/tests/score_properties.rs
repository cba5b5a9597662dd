//! What holds for every score: nothing is lost between memory and text, nothing panics, and the time
//! that reading takes grows with the length of the text and no faster.

use std::fmt::Debug;
use std::time::{Duration, Instant};

use froufrou::score::{
    Action, AnyDocument, Arrival, Blow, ChannelLine, ChannelReader, ChannelSpace, ChannelWriter, Cue,
    Document, Grain, Header, Held, Loudspeaker, Make, Microphone, MicrophoneKey, MicrophoneShape, Mode,
    ObjectLine, ObjectSpace, Order, Output, Pattern, Pickup, Placement, Pose, Radiation, Reader, Repeat,
    Sound, Space, Start, Statement, Verb, Whereabouts, Writer, compare,
};
use proptest::prelude::*;
use proptest::sample::{Index, select};

/// Any number that is allowed where a number may not be negative: all sizes, and both zeros.
fn not_negative() -> BoxedStrategy<f64> {
    prop_oneof![
        3 => 0.0..100.0,
        1 => Just(-0.0),
        1 => prop::num::f64::POSITIVE | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
    ]
    .prop_filter("finite and not negative", |number: &f64| number.is_finite() && *number >= 0.0)
    .boxed()
}

fn positive() -> BoxedStrategy<f64> {
    not_negative().prop_filter("above 0", |number| *number > 0.0).boxed()
}

fn coordinate() -> BoxedStrategy<f64> {
    (not_negative(), any::<bool>()).prop_map(|(number, minus)| if minus { -number } else { number }).boxed()
}

fn facing() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(coordinate())
        .prop_filter("has a direction", |[x, y, z]| (x * x + y * y + z * z).is_normal())
}

/// Plain names, the language's own words, and anything at all.
fn text() -> BoxedStrategy<String> {
    prop_oneof![
        2 => "[a-zA-Z_][a-zA-Z0-9_./-]{0,8}",
        1 => select(vec!["at", "gain", "key", "start", "speed", "1", "-0", "nan", "#", "\"", "\\"])
            .prop_map(String::from),
        1 => prop::collection::vec(any::<char>(), 0..12).prop_map(String::from_iter),
    ]
    .boxed()
}

fn names(most: usize) -> impl Strategy<Value = Vec<String>> {
    let name = text().prop_filter("not empty", |name| !name.is_empty());
    prop::collection::hash_set(name, 1..=most).prop_map(Vec::from_iter)
}

/// Named numbers.
fn values() -> impl Strategy<Value = Vec<(String, f64)>> {
    (names(3), prop::collection::vec(coordinate(), 3))
        .prop_map(|(names, values)| names.into_iter().zip(values).collect())
}

fn sounds() -> impl Strategy<Value = Vec<Sound>> {
    names(4).prop_flat_map(|names| {
        let sound = |name: String| {
            let file = || text().prop_filter("not empty", |path| !path.is_empty());
            let repeat = select(vec![Repeat::Once, Repeat::Loop, Repeat::ExactLoop]);
            let recording = (file(), repeat, prop::option::of(any::<usize>()))
                .prop_map(|(path, repeat, channel)| Make::Recording { path, repeat, channel });
            let mode = (positive(), positive(), coordinate(), prop::collection::vec(coordinate(), 0..3));
            let mode = mode.prop_map(|(frequency_hz, decay_per_s, gain, points)| Mode {
                frequency_hz,
                decay_per_s,
                gain,
                points,
            });
            let modes = (prop::option::of(file()), prop::collection::vec(mode, 0..3))
                .prop_map(|(table, modes)| Make::Modes { table, modes });
            let plain =
                vec![Make::String, Make::Bar(Held::Free), Make::Needle, Make::StickSlip, Make::Turbulence];
            let make = prop_oneof![
                3 => recording,
                1 => modes,
                1 => select(plain),
                1 => file().prop_map(|script| Make::Procedure { script }),
                1 => file().prop_map(|corpus| Make::Grains { corpus }),
                1 => file().prop_map(|corpus| Make::Cloth { corpus }),
                1 => file().prop_map(|corpus| Make::Paper { corpus }),
            ];
            (Just(name), make, values()).prop_map(|(name, make, with)| {
                let with = if matches!(make, Make::Recording { .. }) { vec![] } else { with };
                Sound { name, make, with }
            })
        };
        names.into_iter().map(sound).collect::<Vec<_>>()
    })
}

fn header<R: Debug + Clone>(receivers: Vec<R>) -> impl Strategy<Value = Header<R>> {
    // With a duration every thread may go without an end.
    (positive(), positive(), sounds(), any::<u64>()).prop_map(
        move |(speed_of_sound_mps, duration_s, sounds, seed)| Header {
            speed_of_sound_mps,
            duration_s: Some(duration_s),
            seed,
            sounds,
            ..Header::new(Order::Free, receivers.clone())
        },
    )
}

/// What one thread does, before its times and its number are settled.
#[derive(Debug, Clone)]
struct Sketch<V> {
    thread: u64,
    sound: Index,
    start: Start,
    /// Time, and whether the line is a jump, which may share its time with the line before.
    keys: Vec<(f64, bool, V)>,
    ends: bool,
    /// What is said to it at each key, where it is synthesised.
    cues: Vec<Action>,
}

/// A line of a thread, in either space.
#[derive(Debug, Clone)]
enum Line<V> {
    Statement(Statement<V>),
    Cue(Cue),
}

fn action() -> impl Strategy<Value = Action> {
    let blow = (not_negative(), not_negative(), not_negative());
    let blow = blow.prop_map(|(impulse_ns, place, contact_s)| Blow { impulse_ns, place, contact_s });
    let grain = (any::<u32>(), not_negative(), positive(), not_negative());
    let grain = grain.prop_map(|(number, gain, speed, spread)| Grain { number, gain, speed, spread });
    prop_oneof![values().prop_map(Action::Set), blow.prop_map(Action::Strike), grain.prop_map(Action::Grain)]
}

fn sketch<V: Debug + Clone + 'static>(value: BoxedStrategy<V>) -> impl Strategy<Value = Sketch<V>> {
    let start = (positive(), not_negative(), text(), text()).prop_map(|(speed, offset_s, object, cause)| {
        Start { speed, offset_s, object, cause, ..Start::new("") }
    });
    let thread = prop_oneof![1..20_u64, any::<u64>()];
    let time = prop_oneof![not_negative(), (0..6_u8).prop_map(f64::from)];
    let keys = prop::collection::vec((time, any::<bool>(), value), 1..6);
    let cues = prop::collection::vec(action(), 0..6);
    (thread, any::<Index>(), start, keys, any::<bool>(), cues).prop_map(
        |(thread, sound, start, keys, ends, cues)| Sketch { thread, sound, start, keys, ends, cues },
    )
}

/// The lines of a thread that keep the rules.
fn statements<V: Clone>(sketch: &Sketch<V>, sounds: &[Sound], paths: bool) -> Vec<Line<V>> {
    let mut keys = sketch.keys.clone();
    keys.sort_by(|a, b| a.0.partial_cmp(&b.0).unwrap());
    let last = keys.len() - 1;
    let sound = sketch.sound.get(sounds);
    let mut start = Start { sound: sound.name.clone(), ..sketch.start.clone() };
    let made = !matches!(sound.make, Make::Recording { .. });
    if made {
        (start.speed, start.offset_s) = (1.0, 0.0);
    }
    let mut lines: Vec<Line<V>> = Vec::new();
    let mut before_s = None;
    for (index, (time_s, jumps, value)) in keys.into_iter().enumerate() {
        let same_time = before_s.replace(time_s) == Some(time_s);
        let verb = match index {
            0 => Verb::Start(start.clone()),
            _ if same_time || jumps => Verb::Jump,
            _ if index == last && sketch.ends => Verb::End,
            _ => Verb::Key,
        };
        let thread = sketch.thread;
        let starts = index == 0;
        let of_path =
            |verb| Line::Statement(Statement { thread, path: 7, time_s, verb, value: value.clone() });
        if verb == Verb::End && paths && !same_time {
            lines.push(of_path(Verb::End));
        }
        let ends = verb == Verb::End;
        lines.push(Line::Statement(Statement { thread, path: 0, time_s, verb, value: value.clone() }));
        if starts && paths {
            lines.push(of_path(Verb::Path));
        }
        if let Some(action) = sketch.cues.get(index).filter(|_| made && !ends) {
            lines.push(Line::Cue(Cue { thread, time_s, action: action.clone(), cause: cause_of(action) }));
        }
    }
    lines
}

/// Some causes, of what may have one.
fn cause_of(action: &Action) -> String {
    match action {
        Action::Grain(grain) if grain.number % 2 == 0 => {
            format!("\"{}\" is a cause, \\ and so on", grain.number)
        }
        Action::Strike(_) => "a blow".to_owned(),
        Action::Set(_) | Action::Grain(_) => String::new(),
    }
}

/// All lines of all threads, as a person may have mixed them.
fn mixed<V: Clone>(sketches: &[Sketch<V>], sounds: &[Sound], paths: bool) -> Vec<Line<V>> {
    let mut used = std::collections::HashSet::new();
    let mut threads: Vec<_> = sketches
        .iter()
        .filter(|sketch| used.insert(sketch.thread))
        .map(|sketch| statements(sketch, sounds, paths).into_iter())
        .collect();
    let mut lines = Vec::new();
    while !threads.is_empty() {
        threads.retain_mut(|thread| thread.next().map(|line| lines.push(line)).is_some());
    }
    lines
}

fn channel_score() -> impl Strategy<Value = Document<ChannelSpace>> {
    outputs().prop_flat_map(|outputs| {
        let arrival = |output: &Output| {
            let is_head = matches!(output, Output::Head { .. });
            (coordinate(), not_negative(), prop::array::uniform3(coordinate())).prop_map(
                move |(gain, delay_s, from_m)| Arrival {
                    from_m: is_head.then_some(from_m),
                    ..Arrival::new(gain, delay_s)
                },
            )
        };
        let count = outputs.len();
        let plain = outputs.iter().map(arrival).collect::<Vec<_>>();
        let bands = prop_oneof![
            Just(None),
            prop::array::uniform8(not_negative()).prop_map(move |bands| Some(vec![bands; count])),
            prop::collection::vec(prop::array::uniform8(not_negative()), count).prop_map(Some),
        ];
        // Either all that arrives has bands, or nothing has.
        let value = (plain, bands)
            .prop_map(|(mut value, bands)| {
                for (arrival, bands) in value.iter_mut().zip(bands.into_iter().flatten()) {
                    arrival.bands = Some(bands);
                }
                value
            })
            .boxed();
        let sketches = prop::collection::vec(sketch(value), 0..5);
        (header(outputs), sketches).prop_map(|(header, sketches)| {
            let lines = mixed(&sketches, &header.sounds, true).into_iter().map(|line| match line {
                Line::Statement(statement) => ChannelLine::Thread(statement),
                Line::Cue(cue) => ChannelLine::Cue(cue),
            });
            Document::new(header, lines.collect::<Vec<_>>())
        })
    })
}

/// Channels and heads, in any order.
fn outputs() -> impl Strategy<Value = Vec<Output>> {
    let file = select(vec![None, Some("a \"head\".sofa".to_owned()), Some("shared".to_owned())]);
    let tail = prop::option::of(prop::collection::vec(not_negative(), 1..4));
    (names(4), any::<[bool; 4]>(), file, any::<bool>(), tail).prop_map(
        |(names, heads, file, shared, tail)| {
            let mut names = names.into_iter();
            let mut outputs = Vec::new();
            for is_head in heads {
                let Some(name) = names.next() else { break };
                match names.next() {
                    Some(right) if is_head => {
                        let head = file.clone();
                        outputs.push(Output::Head { ears: [name, right], head, shared });
                    }
                    other => outputs.extend([Some(name), other].into_iter().flatten().map(Output::Channel)),
                }
            }
            let declared: Vec<String> = outputs.iter().flat_map(Output::channels).cloned().collect();
            let channels: Vec<(String, f64)> = declared.into_iter().zip(tail.unwrap_or_default()).collect();
            if !channels.is_empty() {
                outputs.push(Output::Tail { scene: "a room.toml".into(), channels });
            }
            outputs
        },
    )
}

/// What a microphone may pick up.
fn pickup() -> impl Strategy<Value = Pickup> {
    let number = || prop_oneof![select(vec![0.0, 1.0, -0.0]), not_negative()];
    let loudspeakers = names(4).prop_flat_map(|names| {
        let loudspeaker = |name: String| {
            (Just(name), coordinate(), coordinate(), any::<bool>()).prop_map(
                |(name, azimuth_deg, elevation_deg, is_lfe)| {
                    let direction = if is_lfe { (0.0, 0.0) } else { (azimuth_deg, elevation_deg) };
                    Loudspeaker { name, azimuth_deg: direction.0, elevation_deg: direction.1, is_lfe }
                },
            )
        };
        names.into_iter().map(loudspeaker).collect::<Vec<_>>()
    });
    prop_oneof![
        3 => (number(), number()).prop_map(|(c, k)| Pickup::Shape(MicrophoneShape { c, k })),
        1 => (select(vec![None, Some("heads/a b.sofa".to_owned())]), any::<bool>())
            .prop_map(|(head, shared)| Pickup::Binaural { head, shared }),
        1 => (1..=3usize).prop_map(|order| Pickup::Ambisonic { order }),
        1 => loudspeakers.prop_map(Pickup::Loudspeakers),
    ]
}

/// Up is where it is for one who stands, or anywhere.
fn up() -> impl Strategy<Value = [f64; 3]> {
    prop_oneof![Just([0.0, 1.0, 0.0]), Just([-0.0, 1.0, 0.0]), facing()]
}

fn microphones() -> impl Strategy<Value = Vec<Microphone>> {
    names(3).prop_flat_map(|names| {
        let microphone = |name: String| {
            let pose = (prop::array::uniform3(coordinate()), facing(), up());
            let pose = pose.prop_map(|(position_m, facing, up)| Pose { position_m, facing, up });
            (Just(name), pickup(), prop::option::of(pose)).prop_map(|(name, pickup, fixed)| Microphone {
                name,
                pickup,
                fixed,
            })
        };
        names.into_iter().map(microphone).collect::<Vec<_>>()
    })
}

fn object_score() -> impl Strategy<Value = Document<ObjectSpace>> {
    microphones().prop_flat_map(|microphones| {
        let turn =
            prop::array::uniform4(-1.0..1.0f64).prop_filter("a turn", |t| t.iter().any(|c| c.abs() > 0.1));
        let place = (prop::array::uniform3(coordinate()), not_negative(), prop::option::of(turn));
        let around = 0..microphones.len() * 4;
        let value = (place, around).prop_map(move |((position_m, gain, turn), around)| {
            let whereabouts = match around {
                around if around % 4 == 0 => Whereabouts::Around(around / 4),
                _ => Whereabouts::At(position_m),
            };
            Placement { whereabouts, gain, turn }
        });
        let value = value.boxed();
        let sketches = prop::collection::vec(sketch(value), 0..5);
        let pose = || (prop::array::uniform3(coordinate()), facing(), up());
        let key = move || (not_negative(), any::<bool>(), pose());
        let keys = prop::collection::vec((key(), prop::collection::vec(key(), 0..4)), microphones.len());
        (header(microphones), sketches, keys).prop_map(|(header, sketches, keys)| {
            let (mut header, mut sketches) = (header, sketches);
            // A pattern, which every other thread has; and what a thread's lines must have in common.
            let harmonics = vec![1.0, -0.0, 0.25, 1e-300];
            header.patterns = vec![
                Pattern { name: "a lobe".into(), radiation: Radiation::Harmonics(harmonics) },
                Pattern { name: "skin".into(), radiation: Radiation::Surface },
            ];
            header.surroundings = Some("scene \"1\".toml".into());
            for sketch in &mut sketches {
                if sketch.thread % 2 == 0 {
                    sketch.start.pattern = "a lobe".into();
                }
                sketch.keys.sort_by(|a, b| a.0.partial_cmp(&b.0).unwrap());
                let mut before: Option<Placement> = None;
                for (_, _, value) in &mut sketch.keys {
                    if let Some(before) = before {
                        if matches!(before.whereabouts, Whereabouts::Around(_))
                            || matches!(value.whereabouts, Whereabouts::Around(_))
                        {
                            value.whereabouts = before.whereabouts;
                        }
                        value.turn = before.turn.and(value.turn.or(before.turn));
                    }
                    before = Some(*value);
                }
            }
            let mut lines = Vec::new();
            let moving = keys.into_iter().enumerate().filter(|&(m, _)| header.receivers[m].fixed.is_none());
            for (microphone, (first, mut others)) in moving {
                let pose = |(position_m, facing, up)| Pose { position_m, facing, up };
                lines.push(MicrophoneKey { microphone, time_s: 0.0, pose: pose(first.2), cut: false });
                others.sort_by(|a, b| a.0.partial_cmp(&b.0).unwrap());
                for (time_s, cut, place) in others {
                    let cut = cut || lines.last().is_some_and(|last| last.time_s == time_s);
                    lines.push(MicrophoneKey { microphone, time_s, pose: pose(place), cut });
                }
            }
            let threads = mixed(&sketches, &header.sounds, false).into_iter().map(|line| match line {
                Line::Statement(statement) => ObjectLine::Thread(statement),
                Line::Cue(cue) => ObjectLine::Cue(cue),
            });
            let lines: Vec<_> = lines.into_iter().map(ObjectLine::Microphone).chain(threads).collect();
            Document::new(header, lines)
        })
    })
}

fn orders() -> impl Strategy<Value = Order> {
    select(vec![Order::Free, Order::Time, Order::Thread])
}

/// Everything that is to say of a score: written by `Debug`, which tells apart all bits of a number.
fn said<S: Space>(header: &Header<S::Receiver>, lines: &[S::Line]) -> String {
    format!("{header:?}\n{lines:#?}")
}

/// Through text and back, as a document and as a stream.
fn round_trip<S: Space>(mut score: Document<S>, order: Order) -> Result<(), TestCaseError> {
    score.sort(order);
    let lines: Vec<S::Line> = score.lines.iter().map(|noted| noted.line.clone()).collect();
    let said_before = said::<S>(&score.header, &lines);
    let text = score.to_text().unwrap();

    let mut writer = Writer::<S, _>::new(Vec::new(), &score.header).unwrap();
    for line in &lines {
        writer.write(line).unwrap();
    }
    prop_assert_eq!(&String::from_utf8(writer.finish().unwrap()).unwrap(), &text);

    let mut reader = Reader::<S, _>::new(text.as_bytes()).unwrap();
    let read: Vec<S::Line> = reader.by_ref().collect::<froufrou::Result<_>>().unwrap();
    prop_assert_eq!(said::<S>(reader.header(), &read), said_before);

    let again = Document::<S>::read(text.as_bytes()).unwrap();
    prop_assert_eq!(&again.to_text().unwrap(), &text);

    let by_time = Reader::<S, _>::new(text.as_bytes()).unwrap().by_time().unwrap();
    let by_time: Vec<S::Line> = by_time.collect::<froufrou::Result<_>>().unwrap();
    prop_assert_eq!(by_time.len(), lines.len());
    prop_assert!(by_time.windows(2).all(|pair| compare::<S>(&pair[0], &pair[1], Order::Time).is_le()));
    Ok(())
}

/// A comment or an empty line, as it stands above a line.
fn comment() -> impl Strategy<Value = String> {
    let text = prop::collection::vec(any::<char>(), 0..10).prop_map(String::from_iter);
    text.prop_map(|text: String| format!("#{}", text.replace('\n', " ")))
}

/// Whatever is read can be written, and writing it once more changes nothing.
fn settles(text: &[u8]) -> Result<(), TestCaseError> {
    if let Ok(score) = AnyDocument::read(text) {
        let once = score.to_text().unwrap();
        let again = AnyDocument::read(once.as_bytes()).unwrap();
        prop_assert_eq!(again.to_text().unwrap(), once);
    }
    Ok(())
}

proptest! {
    #[test]
    fn object_scores_round_trip(score in object_score(), order in orders()) {
        round_trip(score, order)?;
    }

    #[test]
    fn channel_scores_round_trip(score in channel_score(), order in orders()) {
        round_trip(score, order)?;
    }

    #[test]
    fn comments_and_loose_spacing_survive(
        score in channel_score(),
        order in orders(),
        comments in prop::collection::vec((any::<Index>(), comment(), any::<bool>()), 0..8),
    ) {
        let mut score = score;
        score.sort(order);
        let plain = score.to_text().unwrap();
        let mut lines: Vec<String> = plain.lines().map(String::from).collect();
        for (at, comment, beside) in &comments {
            let at = at.index(lines.len());
            match beside {
                true if lines[at].starts_with('#') || lines[at].contains(" \t#") => {}
                true => lines[at] = format!("  {} \t{comment}", lines[at]),
                false => lines.insert(at + 1, format!("\t{comment}")),
            }
        }
        let loose = lines.join("\r\n");
        let document = Document::<ChannelSpace>::read(loose.as_bytes()).unwrap();
        let tidy = document.to_text().unwrap();
        let again = Document::<ChannelSpace>::read(tidy.as_bytes()).unwrap();
        prop_assert_eq!(again.to_text().unwrap(), tidy.clone());
        // The same lines, and not a comment lost.
        let bare = |document: &Document<ChannelSpace>| {
            let lines: Vec<_> = document.lines.iter().map(|noted| noted.line.clone()).collect();
            said::<ChannelSpace>(&document.header, &lines)
        };
        prop_assert_eq!(bare(&document), bare(&score));
        let count = |text: &str| text.matches('#').count();
        prop_assert_eq!(count(&tidy), count(&loose));
    }

    #[test]
    fn no_text_panics(text in prop::collection::vec(any::<char>(), 0..200)) {
        let text = String::from_iter(text);
        settles(text.as_bytes())?;
        settles(format!("froufrou-score 1 object\nmicrophone m\nsound s s\n{text}").as_bytes())?;
        settles(format!("froufrou-score 1 channel\nchannels m\nsound s s\n{text}").as_bytes())?;
    }

    #[test]
    fn no_mutilated_score_panics(
        object in object_score(),
        channel in channel_score(),
        order in orders(),
        cuts in prop::collection::vec((any::<Index>(), any::<u8>(), 0..3_u8), 1..4),
    ) {
        let (mut object, mut channel) = (object, channel);
        object.sort(order);
        channel.sort(order);
        for text in [object.to_text().unwrap(), channel.to_text().unwrap()] {
            let mut bytes = text.into_bytes();
            for (at, byte, kind) in &cuts {
                let at = at.index(bytes.len());
                match kind {
                    0 => bytes[at] = *byte,
                    1 => bytes.insert(at, *byte),
                    _ => { bytes.remove(at); }
                }
            }
            settles(&bytes)?;
            // Two lines the wrong way round.
            let mut lines: Vec<&[u8]> = bytes.split(|&byte| byte == b'\n').collect();
            let (one, other) = (cuts[0].0.index(lines.len()), usize::from(cuts[0].1) % lines.len());
            lines.swap(one, other);
            settles(&lines.join(&b'\n'))?;
        }
    }
}

/// A score of this many lines, as a program writes it: many short threads.
fn long_score(lines: usize) -> Vec<u8> {
    let header = Header {
        sounds: vec![Sound::recording("hit", "hit.wav", Repeat::Once, None)],
        ..Header::new(Order::Time, ["left", "right"].map(|name| Output::Channel(name.into())).to_vec())
    };
    let start = Start::new("hit");
    let mut writer = ChannelWriter::new(Vec::new(), &header).unwrap();
    for line in 0..lines {
        let time_s = line as f64 / 3.0;
        let verb = if line % 2 == 0 { Verb::Start(start.clone()) } else { Verb::End };
        let value = vec![Arrival::new(0.5, time_s.sin().abs()); 2];
        let statement = Statement { thread: line as u64 / 2, path: 0, time_s, verb, value };
        writer.write(&ChannelLine::Thread(statement)).unwrap();
    }
    writer.finish().unwrap()
}

#[test]
fn reading_takes_time_in_proportion_to_the_length() {
    let read = |text: &[u8]| -> Duration {
        let begin = Instant::now();
        let count = ChannelReader::new(text).unwrap().by_time().unwrap().count();
        assert!(count > 0);
        begin.elapsed()
    };
    let fastest = |text: &[u8]| (0..3).map(|_| read(text)).min().unwrap();
    let (short, long) = (long_score(5_000), long_score(160_000));
    let growth = fastest(&long).as_secs_f64() / fastest(&short).as_secs_f64();
    // 32 times the lines; were it quadratic, it would take 1024 times as long.
    assert!(growth < 200.0, "reading 32 times the lines took {growth} times as long");
}
