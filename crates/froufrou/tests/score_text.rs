//! The text of a score as its users meet it: the examples of the documentation, round trips, sorting,
//! and every error message.

use froufrou::score::{
    Action, AnyDocument, AnyReader, AnySpace, Arrival, ChannelDocument, ChannelHeader, ChannelLine,
    ChannelReader, ChannelWriter, Header, Make, Microphone, MicrophoneKey, MicrophoneShape, ObjectDocument,
    ObjectLine, ObjectReader, ObjectWriter, Order, Output, Pickup, Placement, Pose, Repeat, Sound, Start,
    Statement, Verb,
};

const DOCUMENTATION: &str = include_str!("../../../docs/score.md");

/// The scores in the documentation's fenced blocks.
fn examples() -> Vec<&'static str> {
    let parts = DOCUMENTATION.split("```froufrou-score\n").skip(1);
    parts.map(|part| part.split("```").next().unwrap()).collect()
}

fn canonical(text: &str) -> String {
    AnyDocument::read(text.as_bytes()).unwrap().to_text().unwrap()
}

#[test]
fn the_documentation_shows_one_score_in_each_space() {
    let [object, channel] = examples().try_into().unwrap();
    // The first is shown in canonical form, the second as a person writes.
    assert_eq!(canonical(object), object);
    assert_ne!(canonical(channel), channel);

    let AnySpace::Object(object) = AnyDocument::read(object.as_bytes()).unwrap() else {
        panic!("the first example is in object space")
    };
    assert_eq!(object.header.duration_s, Some(4.3));
    assert_eq!(object.header.order, Order::Time);
    assert_eq!(object.header.sounds[0], Sound::recording("siren", "siren.wav", Repeat::ExactLoop, None));
    assert_eq!(
        object.header.receivers[1],
        Microphone {
            name: "right".into(),
            pickup: Pickup::Shape(MicrophoneShape { c: 0.0, k: 1.0 }),
            fixed: None
        }
    );
    assert_eq!(object.lines.len(), 9);
    assert_eq!(
        object.lines[2].line,
        ObjectLine::Thread(Statement {
            thread: 1,
            path: 0,
            time_s: 0.0,
            verb: Verb::Start(Start {
                object: "ambulance".into(),
                cause: "runs through the scene".into(),
                ..Start::new("siren")
            }),
            value: Placement::at([-60.0, 0.0, 12.0], 0.5),
        })
    );
    assert_eq!(
        object.lines[6].line,
        ObjectLine::Microphone(MicrophoneKey {
            microphone: 0,
            time_s: 2.0,
            pose: Pose::upright([3.0, 1.6, 0.0], [1.0, 0.0, 0.0]),
            cut: true,
        })
    );

    let AnySpace::Channel(channel) = AnyDocument::read(channel.as_bytes()).unwrap() else {
        panic!("the second example is in channel space")
    };
    assert_eq!(channel.header.channels(), ["left", "right"]);
    let said = |index: usize| channel.lines[index].line.statement().unwrap().clone();
    assert_eq!(said(2).verb, Verb::Key);
    let as_before = vec![Arrival::new(0.2, 0.09), Arrival::new(0.22, 0.089)];
    assert_eq!(said(2).value, as_before);
    let Verb::Start(start) = said(4).verb else { panic!("thread 2 starts") };
    assert_eq!((start.speed, start.offset_s), (2.0, 0.01));
}

#[test]
fn what_is_left_out_is_as_before() {
    let text = r#"froufrou-score 1 object
microphone m
sound s s.wav
hear m 0 at 1 2 3
hear m 1 facing 0 0 2
hear m 2 at 4 5 6
start 1 0 s at 1 0 0
key 1 1 gain 0.5
key 1 2 at 2 0 0
jump 1 2 gain 2
end 1 3
"#;
    let wanted = r#"froufrou-score 1 object
speed-of-sound 343
microphone m omni
sound s "s.wav"
hear m 0 at 1 2 3 facing 0 0 -1
hear m 1 at 1 2 3 facing 0 0 2
hear m 2 at 4 5 6 facing 0 0 2
start 1 0 s at 1 0 0 gain 1
key 1 1 at 1 0 0 gain 0.5
key 1 2 at 2 0 0 gain 0.5
jump 1 2 at 2 0 0 gain 2
end 1 3 at 2 0 0 gain 2
"#;
    assert_eq!(canonical(text), wanted);
    assert_eq!(canonical(wanted), wanted);
}

#[test]
fn comments_stay_with_their_lines_when_sorted() {
    let text = "\u{feff}froufrou-score 1 object#first\r
   # a drip\r
sound drip \"drip.wav\"   # recorded at home  \r
\tduration 5\r

# the only microphone
microphone main
# thread 2
start 2 1 drip at 0 0 0 # second
end 2 2
# thread 1
start 1 0.5 drip at 0 0 0
jump 1 0.75 at 1 0 0 # a
jump 1 0.75 at 2 0 0 # b
end 1 1 # ends

# here
hear main 0 at 0 0 0
hear main 1 at 0 1 0

# done
";
    let mut score = ObjectDocument::read(text.as_bytes()).unwrap();
    let header = r#"
speed-of-sound 343
duration 5

# the only microphone
microphone main omni
# a drip
sound drip "drip.wav" # recorded at home
"#;
    let body = r#"# thread 2
start 2 1 drip at 0 0 0 gain 1 # second
end 2 2 at 0 0 0 gain 1
# thread 1
start 1 0.5 drip at 0 0 0 gain 1
jump 1 0.75 at 1 0 0 gain 1 # a
jump 1 0.75 at 2 0 0 gain 1 # b
end 1 1 at 2 0 0 gain 1 # ends

# here
hear main 0 at 0 0 0 facing 0 0 -1
hear main 1 at 0 1 0 facing 0 0 -1

# done
"#;
    let free = format!("froufrou-score 1 object #first{header}{body}");
    assert_eq!(score.to_text().unwrap(), free);
    assert_eq!(canonical(&free), free);

    score.sort(Order::Time);
    let by_time = r#"
# here
hear main 0 at 0 0 0 facing 0 0 -1
# thread 1
start 1 0.5 drip at 0 0 0 gain 1
jump 1 0.75 at 1 0 0 gain 1 # a
jump 1 0.75 at 2 0 0 gain 1 # b
hear main 1 at 0 1 0 facing 0 0 -1
end 1 1 at 2 0 0 gain 1 # ends
# thread 2
start 2 1 drip at 0 0 0 gain 1 # second
end 2 2 at 0 0 0 gain 1

# done
"#;
    let by_time = format!("froufrou-score 1 object #first\norder time{header}{by_time}");
    assert_eq!(score.to_text().unwrap(), by_time);
    assert_eq!(canonical(&by_time), by_time);

    score.sort(Order::Thread);
    let by_thread = r#"
# here
hear main 0 at 0 0 0 facing 0 0 -1
hear main 1 at 0 1 0 facing 0 0 -1
# thread 1
start 1 0.5 drip at 0 0 0 gain 1
jump 1 0.75 at 1 0 0 gain 1 # a
jump 1 0.75 at 2 0 0 gain 1 # b
end 1 1 at 2 0 0 gain 1 # ends
# thread 2
start 2 1 drip at 0 0 0 gain 1 # second
end 2 2 at 0 0 0 gain 1

# done
"#;
    let by_thread = format!("froufrou-score 1 object #first\norder thread{header}{by_thread}");
    assert_eq!(score.to_text().unwrap(), by_thread);
    assert_eq!(canonical(&by_thread), by_thread);

    // A comment on the order outlives the order.
    let noted = by_thread.replace("order thread\n", "# sorted\norder thread # so\n");
    let mut score = ObjectDocument::read(noted.as_bytes()).unwrap();
    score.sort(Order::Free);
    let text = score.to_text().unwrap();
    assert!(!text.contains("order thread"));
    assert!(text.contains("# recorded at home\n# sorted\n# so\n"));
}

#[test]
fn keywords_may_be_names() {
    let text = r#"froufrou-score 1 object
speed-of-sound 343
microphone at omni
sound gain "once"
sound "1" "a b.wav" channel 2
sound "" "x"
"#;
    let text = text.replace("sound \"\" \"x\"\n", "hear at 0 at 0 0 0 facing 0 0 -1\n")
        + "start 1 0 gain at 0 0 0 gain 1 object object cause \"at\"\nstart 2 0 \"1\" at 0 0 0 gain 1\n";
    assert_eq!(canonical(&text), text);
}

#[test]
fn the_lines_of_any_score_come_sorted_by_time() {
    let lines = "start 2 3 s 1 0\nend 2 4 1 0\nstart 1 1 s 1 0\nkey 1 3 1 0\nend 1 5 1 0\n";
    let text = |order: &str, lines: &str| {
        format!("froufrou-score 1 channel\n{order}\nchannels m\nsound s \"s.wav\"\n{lines}")
    };
    let mut sorted = ChannelDocument::read(text("", lines).as_bytes()).unwrap();
    sorted.sort(Order::Thread);
    let by_thread = sorted.to_text().unwrap();
    sorted.sort(Order::Time);
    let by_time = sorted.to_text().unwrap();
    for text in [text("", lines), by_thread, by_time] {
        let reader = ChannelReader::new(text.as_bytes()).unwrap().by_time().unwrap();
        assert_eq!(reader.header().order, Order::Time);
        let lines: Vec<_> =
            reader.map(|line| line.unwrap()).map(|line| (line.time_s(), line.thread())).collect();
        assert_eq!(lines, [(1.0, 1), (3.0, 1), (3.0, 2), (4.0, 2), (5.0, 1)]);
    }
}

#[test]
fn files_are_written_read_and_named_in_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.score");
    let example = examples()[0];
    let document = ObjectDocument::read(example.as_bytes()).unwrap();
    let mut writer = ObjectWriter::create(&path, &document.header).unwrap();
    for line in &document.lines {
        writer.write(&line.line).unwrap();
    }
    assert!(!path.exists(), "a file appears when it is whole");
    writer.save().unwrap();
    let AnySpace::Object(reader) = AnyReader::open(&path).unwrap() else { panic!("it is in object space") };
    let lines: Vec<ObjectLine> = reader.collect::<froufrou::Result<_>>().unwrap();
    assert!(document.lines.iter().map(|noted| &noted.line).eq(&lines));
    assert_eq!(ObjectReader::open(&path).unwrap().count(), lines.len());
    assert_eq!(ObjectDocument::open(&path).unwrap().lines.len(), lines.len());
    assert!(matches!(AnyDocument::open(&path).unwrap(), AnySpace::Object(_)));

    let named = |what: &str| format!("{}{what}", path.display());
    let error = ChannelReader::open(&path).unwrap_err();
    assert_eq!(error.to_string(), named(":1: this score is in object space, expected one in channel space"));
    std::fs::write(&path, "froufrou-score 1 object\nmicrophone m\nkey 1 0\n").unwrap();
    let error = ObjectReader::open(&path).unwrap().last().unwrap().unwrap_err();
    assert!(error.to_string().starts_with(&named(":3:5: `key` of thread 1")), "{error}");
    std::fs::write(&path, "froufrou-score 1 object\nmicrophon m\n").unwrap();
    for error in [
        ObjectReader::open(&path).err().unwrap(),
        ObjectDocument::open(&path).err().unwrap(),
        AnyDocument::open(&path).err().unwrap(),
    ] {
        assert!(error.to_string().starts_with(&named(":2:1: unknown keyword")), "{error}");
    }
    let missing = folder.path().join("missing.score");
    let error = AnyReader::open(&missing).err().unwrap();
    assert!(error.to_string().starts_with(&format!("{}: cannot open the file", missing.display())));
    let nowhere = folder.path().join("no/folder.score");
    let error = ObjectWriter::create(&nowhere, &document.header).err().unwrap();
    assert!(error.to_string().contains("cannot create the file"), "{error}");
}

/// The error that reading gives.
fn error_of(text: &str) -> String {
    match AnyDocument::read(text.as_bytes()) {
        Ok(_) => panic!("no error in\n{text}"),
        Err(error) => error.to_string(),
    }
}

/// The error in a score in object space with these lines, the first of which is line 6.
fn object_error(lines: &str) -> String {
    error_of(&format!(
        "froufrou-score 1 object\nmicrophone left\nsound siren \"s.wav\"\nsound wind \"w.wav\" loop\n\
         hear left 0 at 0 0 0\n{lines}"
    ))
}

/// The error in a score in channel space with these lines, the first of which is line 4.
fn channel_error(lines: &str) -> String {
    error_of(&format!("froufrou-score 1 channel\nchannels left right\nsound siren \"s.wav\"\n{lines}"))
}

/// The error in a header in object space with these lines, the first of which is line 2.
fn header_error(lines: &str) -> String {
    error_of(&format!("froufrou-score 1 object\n{lines}"))
}

#[test]
fn errors_of_the_first_line() {
    let help = "(its first line must be `froufrou-score 1 object` or `froufrou-score 1 channel`)";
    for (text, message) in [
        ("", format!("1: this is no froufrou score, it is empty {help}")),
        ("# hello\n", format!("1:1: this is no froufrou score {help}")),
        ("RIFF 1 2\n", format!("1:1: this is no froufrou score, it begins with `RIFF` {help}")),
        (
            "froufrou-score 2 object\n",
            "1:16: found a score of version 2, expected 1: a newer froufrou wrote it".into(),
        ),
        ("froufrou-score 0 object\n", "1:16: found a score of version 0, expected 1".into()),
        (
            "froufrou-score one object\n",
            "1:16: expected the version, a whole number from 0, found `one`".into(),
        ),
        ("froufrou-score 99999999999 object\n", "1:16: the version, `99999999999`, is too large".into()),
        ("froufrou-score 1\n", "1:17: expected `object` or `channel`, found the end of the line".into()),
        (
            "froufrou-score 1 chanel\n",
            "1:18: unknown space `chanel`, expected `object` or `channel` (did you mean `channel`?)".into(),
        ),
        ("froufrou-score 1 object 3\n", "1:25: expected the end of the line, found `3`".into()),
        (
            "\"froufrou-score\" 1 object\n",
            "1:1: expected froufrou-score, found the quoted text `froufrou-score`".into(),
        ),
    ] {
        assert_eq!(error_of(text), message);
    }
}

#[test]
fn errors_of_the_header() {
    for (lines, message) in [
        ("order tine\n", "2:7: unknown order `tine`, expected `time` or `thread` (did you mean `time`?)"),
        ("order\n", "2:6: expected `time` or `thread`, found the end of the line"),
        ("order time\norder time\n", "3:7: `order` is given twice"),
        ("speed-of-sound fast\n", "2:16: expected the speed of sound in metres a second, found `fast`"),
        ("speed-of-sound 0\n", "2:16: the speed of sound in metres a second is 0, but it must be above 0"),
        ("speed-of-sound 1\nspeed-of-sound 2\n", "3:16: `speed-of-sound` is given twice"),
        ("duration -1\n", "2:10: the duration in seconds is -1, but it must be above 0"),
        ("duration 1e999\n", "2:10: the duration in seconds, `1e999`, is too large for a number"),
        ("duration inf\n", "2:10: the duration in seconds is inf, but it must be a finite number"),
        ("duration 1\nduration 1 # again\n", "3:10: `duration` is given twice"),
        (
            "duraton 1\n",
            "2:1: unknown keyword `duraton`, expected a declaration or a line of a thread (did you mean `duration`?)",
        ),
        ("\"duration\" 1\n", "2:1: expected a keyword, found the quoted text `duration`"),
        (
            "channels left\n",
            "2:1: `channels` belongs into a score in channel space, this one is in object space",
        ),
        ("sound\n", "2:6: expected the sound's name, found the end of the line"),
        (
            "sound 2nd \"a.wav\"\n",
            "2:7: expected the sound's name, found `2nd` (a name that is not a letter followed by letters, digits and _ . / - stands in quotes)",
        ),
        (
            "sound a\n",
            "2:8: expected the path of the recording, or what makes the sound, found the end of the line",
        ),
        ("sound \"\" a\n", "2:7: the sound has an empty name"),
        ("sound a \"\"\n", "2:9: the sound `a` has no recording"),
        ("sound a \"a.wav\" loop\nsound a \"b.wav\"\n", "3:7: the sound `a` is declared twice"),
        (
            "sound a \"a.wav\" lop\n",
            "2:17: unknown word `lop`, expected `once`, `loop`, `loop exact` or `channel N` (did you mean `loop`?)",
        ),
        (
            "sound a \"a.wav\" exact\n",
            "2:17: unknown word `exact`, expected `once`, `loop`, `loop exact` or `channel N`",
        ),
        ("sound a \"a.wav\" once loop\n", "2:22: `once or loop` is given twice"),
        (
            "sound a \"a.wav\" channel -1\n",
            "2:25: expected the channel of the recording, a whole number from 0, found `-1`",
        ),
        ("sound a \"a.wav\" channel 1 channel 2\n", "2:35: `channel` is given twice"),
        ("sound a \"a.wav\n", "2:9: the quotes that open here are not closed on this line"),
        ("microphone\n", "2:11: expected the microphone's name, found the end of the line"),
        ("microphone \"\"\n", "2:12: the microphone has an empty name"),
        ("microphone a\nmicrophone a\n", "3:12: the microphone `a` is declared twice"),
        (
            "microphone a cardiod\n",
            "2:14: unknown microphone shape `cardiod`, expected `omni`, `cardioid`, `shape C K`, `binaural`, `ambisonic ORDER` or `loudspeakers` (did you mean `cardioid`?)",
        ),
        ("microphone a shape 0\n", "2:21: expected the shape's k, found the end of the line"),
        ("microphone a shape -1 0\n", "2:20: the shape's c is -1, but it must not be negative"),
        ("microphone a shape 0 NaN\n", "2:22: the shape's k is NaN, but it must be a finite number"),
        (
            "microphone a omni 3\n",
            "2:19: unknown word `3`, expected `at X Y Z`, `facing X Y Z` or `up X Y Z`",
        ),
        ("duration 3\n", "2: the score declares no microphone (add a line such as `microphone main omni`)"),
    ] {
        assert_eq!(header_error(lines), message);
    }
    for (text, message) in [
        ("duration 3\n", "2: the score declares no channel (add a line such as `channels left right`)"),
        ("channels\n", "2:9: expected the name of a channel, found the end of the line"),
        ("channels left \"\"\n", "2:15: the channel has an empty name"),
        ("channels left right left\n", "2:21: the channel `left` is declared twice"),
        (
            "channels left\nchannels right\n",
            "3:1: `channels` is given twice (name all channels on one line, as `channels left right`)",
        ),
        (
            "microphone left\n",
            "2:1: `microphone` belongs into a score in object space, this one is in channel space",
        ),
    ] {
        assert_eq!(error_of(&format!("froufrou-score 1 channel\n{text}")), message);
    }
}

#[test]
fn errors_of_threads() {
    for (lines, message) in [
        (
            "strat 1 0 siren at 0 0 0\n",
            "6:1: unknown keyword `strat`, expected a declaration or a line of a thread (did you mean `start`?)",
        ),
        ("start\n", "6:6: expected the thread's number, a whole number from 0, found the end of the line"),
        ("start -1\n", "6:7: expected the thread's number, a whole number from 0, found `-1`"),
        ("start 18446744073709551616\n", "6:7: the thread's number, `18446744073709551616`, is too large"),
        ("start 1 now\n", "6:9: expected the time in seconds, found `now`"),
        ("start 1 \"0\"\n", "6:9: expected the time in seconds, found the quoted text `0`"),
        ("start 1 -0.5\n", "6:9: the time in seconds is -0.5, but it must not be negative"),
        ("start 1 nan\n", "6:9: the time in seconds is NaN, but it must be a finite number"),
        (
            "start 1 0 at 0 0 0\n",
            "6:11: unknown sound `at` (declare it in the header, as `sound NAME \"recording.wav\"`)",
        ),
        ("start 1 0 sirene at 0 0 0\n", "6:11: unknown sound `sirene` (did you mean `siren`?)"),
        ("start 1 0 siren\n", "6:16: the thread starts nowhere (add where, in metres, as `at X Y Z`)"),
        ("start 1 0 siren at 0 0\n", "6:23: expected the place's z in metres, found the end of the line"),
        (
            "start 1 0 siren at 0 inf 0\n",
            "6:22: the place's y in metres is inf, but it must be a finite number",
        ),
        ("start 1 0 siren at 0 0 0 gain -1\n", "6:31: the gain is -1, but it must not be negative"),
        ("start 1 0 siren at 0 0 0 gain 1 gain 1\n", "6:38: `gain` is given twice"),
        ("start 1 0 siren at 0 0 0 speed 0\n", "6:32: the playback speed is 0, but it must be above 0"),
        (
            "start 1 0 siren at 0 0 0 offset -1\n",
            "6:33: the offset in seconds is -1, but it must not be negative",
        ),
        (
            "start 1 0 siren at 0 0 0 cause\n",
            "6:31: expected the cause, in quotes, found the end of the line",
        ),
        (
            "start 1 0 siren at 0 0 0 object a b\n",
            "6:35: unknown word `b`, expected `at`, `around`, `gain`, `turn`, `speed`, `offset`, `object`, `cause` or `pattern`",
        ),
        (
            "start 1 0 siren at 0 0 0 sped 2\n",
            "6:26: unknown word `sped`, expected `at`, `around`, `gain`, `turn`, `speed`, `offset`, `object`, `cause` or `pattern` (did you mean `speed`?)",
        ),
        ("start 1 0 siren at 0 0 0 \"gain\" 1\n", "6:26: expected a keyword, found the quoted text `gain`"),
        (
            "start 1 0 siren at 0 0 0\nkey 1 1 gian 3\n",
            "7:9: unknown word `gian`, expected `at`, `around`, `gain` or `turn` (did you mean `gain`?)",
        ),
        ("start 1 0 siren at 0 0 0\nkey 1 1 speed 3\n", "7:9: `speed` belongs on the thread's `start` line"),
        (
            "jump 1 1 at 0 0 0\n",
            "6:6: `jump` of thread 1, which has not started (a `start 1 …` must come before)",
        ),
        (
            "start 1 0 siren at 0 0 0\nstart 1 2 siren at 0 0 0\n",
            "7:7: thread 1 started already in line 6 (give every thread a number of its own)",
        ),
        (
            "start 1 0 siren at 0 0 0\nend 1 1\nstart 1 2 siren at 0 0 0\n",
            "8:7: thread 1 has been used already and has ended (give every thread a number of its own)",
        ),
        ("start 1 0 siren at 0 0 0\nend 1 1\nkey 1 2\n", "8:5: thread 1 has ended, no line may follow"),
        (
            "start 1 2 siren at 0 0 0\nkey 1 1.5\n",
            "7:7: the time of thread 1 goes backwards, from 2 s to 1.5 s",
        ),
        (
            "start 1 2 siren at 0 0 0\nend 1 2\n",
            "7:7: thread 1 has a line at 2 s already (only a `jump` may share the time of the line before)",
        ),
        (
            "start 7 2 wind at 0 0 0\nstart 8 3 wind at 0 0 0\n",
            "6: thread 7 sounds from 2 s on and never ends (add an `end 7 …` line, or a `duration` to the header)",
        ),
        (
            "duration 3\nstart 1 0 siren at 0 0 0\nsound b \"b.wav\"\n",
            "6:1: `duration` stands after the first line of a thread or microphone (move it up into the header, before all those lines)",
        ),
        (
            "microphone b\n",
            "6:1: `microphone` stands after the first line of a thread or microphone (move it up into the header, before all those lines)",
        ),
    ] {
        assert_eq!(object_error(lines), message);
    }
}

#[test]
fn errors_of_microphones() {
    for (lines, message) in [
        ("hear lfet 1 at 0 0 0\n", "6:6: unknown microphone `lfet` (did you mean `left`?)"),
        ("hear right 1 at 0 0 0\n", "6:6: unknown microphone `right` (the microphones are `left`)"),
        ("hear left 1 at 0 0\n", "6:19: expected the place's z in metres, found the end of the line"),
        ("hear left 1 at 0 0 0 at 0 0 0\n", "6:29: `at` is given twice"),
        (
            "hear left 1 facing 0 0 0\n",
            "6:24: the facing direction 0 0 0 has no usable length (give any vector that points where the microphone faces, such as `0 0 -1`)",
        ),
        (
            "hear left 1 facign 0 0 1\n",
            "6:13: unknown word `facign`, expected `at X Y Z`, `facing X Y Z` or `up X Y Z` (did you mean `facing`?)",
        ),
        (
            "hear left 1\nhear left 0.5\n",
            "7:11: the time of microphone `left` goes backwards, from 1 s to 0.5 s",
        ),
        (
            "hear left 0\n",
            "6:11: microphone `left` has a line at 0 s already (only a `cut` may share the time of the line before)",
        ),
    ] {
        assert_eq!(object_error(lines), message);
    }
    for (lines, message) in [
        (
            "cut left 0 at 0 0 0\n",
            "4:1: microphone `left` is cut before it is anywhere (begin it with a `hear`)",
        ),
        ("hear left 0\n", "4:12: the microphone is nowhere yet (add where, in metres, as `at X Y Z`)"),
        (
            "start 1 0 s at 0 0 0\n",
            "4: the first sound starts at 0 s, but microphone `left` is nowhere yet (add a line such as `hear left 0 at 0 1.6 0` above)",
        ),
        (
            "hear left 2 at 0 0 0\nstart 1 3 s at 0 0 0\nstart 2 1 s at 0 0 0\n",
            "6: the first sound starts at 1 s, but microphone `left` is nowhere yet (add a line such as `hear left 0 at 0 1.6 0` above)",
        ),
    ] {
        assert_eq!(header_error(&format!("microphone left\nsound s \"s.wav\"\n{lines}")), message);
    }
    // Sorted by time it shows at once, not only at the end.
    let text = "froufrou-score 1 object\norder time\nmicrophone m\nsound s \"s.wav\"\nstart 1 0 s at 0 0 0\n";
    let first = ObjectReader::new(text.as_bytes()).unwrap().next().unwrap();
    assert!(first.unwrap_err().to_string().starts_with("5: the first sound starts at 0 s"));
    let lines = "froufrou-score 1 channel\nchannels left\nhear left 0 at 0 0 0\n";
    assert_eq!(
        error_of(lines),
        "3:1: `hear` belongs into a score in object space, this one is in channel space"
    );
}

#[test]
fn errors_of_channels() {
    let pairs = "expected 2 pairs of gain and delay, one for each channel, found";
    for (lines, message) in [
        (
            "start 1 0 siren\n",
            "4:16: the thread starts without a gain and a delay (add `GAIN DELAY` for every channel after the sound)"
                .into(),
        ),
        ("start 1 0 siren 1 0\n", format!("4:20: {pairs} 1")),
        ("start 1 0 siren 1 0 speed 2\n", format!("4:21: {pairs} 1")),
        ("start 1 0 siren 1 0 1\n", "4:22: expected the delay in seconds, found the end of the line".into()),
        ("start 1 0 siren 1 0 1 0 1\n", format!("4:25: {pairs} more")),
        ("start 1 0 siren 1 -0.1 1 0\n", "4:19: the delay in seconds is -0.1, but it must not be negative".into()),
        ("start 1 0 siren 1 0 nan 0\n", "4:21: the gain is NaN, but it must be a finite number".into()),
        ("start 1 0 siren 1 0 1,5 0\n", "4:21: expected the gain, found `1,5`".into()),
        (
            "start 1 0 siren 1 0 1 0 sped 2\n",
            "4:25: unknown word `sped`, expected `bands`, `speed`, `offset`, `object` or `cause` (did you mean `speed`?)"
                .into(),
        ),
        (
            "start 1 0 siren 1 0 1 0\nkey 1 1 at 0 0 0\n",
            "5:9: unknown word `at`, expected `bands`".into(),
        ),
        (
            "start 1 0 siren 1 0 1 0 bands 1 1 1 1 1 1 1\n",
            "4:44: expected the gain of the octave band, found the end of the line".into(),
        ),
        (
            "start 1 0 siren 1 0 1 0 bands 1 1 1 1 1 1 1 1 0.5\n",
            "4:50: expected the gain of the octave band, found the end of the line".into(),
        ),
        (
            "start 1 0 siren 1 0 1 0 bands 1 1 1 1 -1 1 1 1\n",
            "4:39: the gain of the octave band is -1, but it must not be negative".into(),
        ),
    ] {
        assert_eq!(channel_error(lines), message);
    }
    assert_eq!(
        error_of("froufrou-score 1 channel\nchannels m\nsound s \"s\"\nstart 1 0 s 1 0 1\n"),
        "4:17: expected 1 pair of gain and delay, one for each channel, found more"
    );
}

#[test]
fn errors_of_the_promised_order() {
    let help = "(move the line to its place, or sort the score after deleting the `order` line)";
    for (order, lines, message) in [
        (
            "time",
            "start 1 1 s at 0 0 0\nstart 2 0.5 s at 0 0 0\n",
            "7:9: the header says `order time`, but 0.5 s comes after 1 s",
        ),
        (
            "time",
            "start 2 1 s at 0 0 0\nstart 1 1 s at 0 0 0\n",
            "7:7: the header says `order time`, but thread 1 comes after thread 2",
        ),
        (
            "time",
            "start 2 1 s at 0 0 0\nhear m 1\n",
            "7:6: the header says `order time`, but microphone `m` comes after thread 2",
        ),
        (
            "thread",
            "start 2 1 s at 0 0 0\nstart 1 1 s at 0 0 0\n",
            "7:7: the header says `order thread`, but thread 1 comes after thread 2",
        ),
        (
            "thread",
            "start 1 1 s at 0 0 0\nstart 2 1 s at 0 0 0\nend 1 2\n",
            "8:5: the header says `order thread`, but thread 1 comes after thread 2",
        ),
        (
            "thread",
            "start 2 1 s at 0 0 0\nhear m 1\n",
            "7:6: the header says `order thread`, but microphone `m` comes after thread 2",
        ),
    ] {
        let text = format!("order {order}\nmicrophone m\nsound s \"s.wav\"\nhear m 0 at 0 0 0\n{lines}");
        assert_eq!(header_error(&text), format!("{message} {help}"));
    }
    let text = "order thread\nmicrophone m\nsound s \"s\"\nhear m 0 at 0 0 0\n";
    assert_eq!(
        header_error(&format!("{text}start 1 1 s at 0 0 0\nend 1 2\nkey 1 3\n")),
        "8:5: thread 1 has ended, no line may follow"
    );
    assert_eq!(
        header_error(&format!("{text}start 1 1 s at 0 0 0\nend 1 2\nstart 1 3 s at 0 0 0\n")),
        "8:7: thread 1 has been used already and has ended (give every thread a number of its own)"
    );
}

#[test]
fn a_reader_stops_at_its_first_error() {
    let text = "froufrou-score 1 channel\nchannels m\nsound s \"s\"\nstart 1 0 s 1 0\nkey 1 1 x\nend 1 2\n";
    let mut reader = ChannelReader::new(text.as_bytes()).unwrap();
    assert!(reader.next().unwrap().is_ok());
    assert!(reader.next().unwrap().is_err());
    assert_eq!(reader.line_number(), 5);
    assert!(reader.next().is_none());
}

fn channel_header() -> ChannelHeader {
    let sounds = vec![Sound::recording("s", "s.wav", Repeat::Loop, None)];
    Header { sounds, ..Header::new(Order::Free, vec![Output::Channel("m".into())]) }
}

fn line(verb: Verb, time_s: f64, gain: f64) -> ChannelLine {
    let value = vec![Arrival::new(gain, 0.0)];
    ChannelLine::Thread(Statement { thread: 1, path: 0, time_s, verb, value })
}

fn start(sound: &str) -> Verb {
    Verb::Start(Start::new(sound))
}

#[test]
fn a_writer_refuses_what_could_not_be_read() {
    let write = |lines: &[ChannelLine]| {
        let mut writer = ChannelWriter::new(Vec::new(), &channel_header())?;
        lines.iter().try_for_each(|line| writer.write(line))?;
        writer.finish()
    };
    assert!(write(&[line(start("s"), 0.0, 1.0), line(Verb::End, 1.0, 1.0)]).is_ok());
    let mut two = line(start("s"), 0.0, 1.0);
    let ChannelLine::Thread(statement) = &mut two else { panic!() };
    statement.value.push(Arrival::new(1.0, 0.0));
    let mut wordy = line(start("s"), 0.0, 1.0);
    let ChannelLine::Thread(statement) = &mut wordy else { panic!() };
    if let Verb::Start(start) = &mut statement.verb {
        start.cause = "so ".repeat(30_000);
    }
    for (lines, message) in [
        (
            vec![line(Verb::Key, 0.0, 1.0)],
            "`key` of thread 1, which has not started (a `start 1 …` must come before)",
        ),
        (vec![line(start("t"), 0.0, 1.0)], "unknown sound `t` (did you mean `s`?)"),
        (vec![line(start("s"), f64::NAN, 1.0)], "the time in seconds is NaN, but it must be a finite number"),
        (vec![line(start("s"), -1.0, 1.0)], "the time in seconds is -1, but it must not be negative"),
        (vec![line(start("s"), 0.0, f64::INFINITY)], "the gain is inf, but it must be a finite number"),
        (vec![two], "expected 1 pair of gain and delay, one for each channel, found 2"),
        (
            vec![line(start("s"), 0.0, 1.0), line(start("s"), 1.0, 1.0)],
            "thread 1 started already in line 5 (give every thread a number of its own)",
        ),
        (
            vec![line(start("s"), 0.5, 1.0)],
            "5: thread 1 sounds from 0.5 s on and never ends (add an `end 1 …` line, or a `duration` to the header)",
        ),
        (vec![wordy], "a line of 90024 bytes is longer than 65536, the most a score may have"),
    ] {
        assert_eq!(write(&lines).unwrap_err().to_string(), message);
    }

    let refused = |change: fn(&mut ChannelHeader)| {
        let mut header = channel_header();
        change(&mut header);
        ChannelWriter::new(Vec::new(), &header).err().unwrap().to_string()
    };
    assert!(refused(|header| header.receivers.clear()).starts_with("the score declares no channel"));
    assert_eq!(
        refused(|header| header.receivers.push(Output::Channel("m".into()))),
        "the channel `m` is declared twice"
    );
    assert_eq!(refused(|header| header.sounds[0].name.clear()), "the sound has an empty name");
    assert_eq!(
        refused(|header| header.files_mut().for_each(String::clear)),
        "the sound `s` has no recording"
    );
    assert_eq!(
        refused(|header| header.duration_s = Some(0.0)),
        "the duration in seconds is 0, but it must be above 0"
    );
    assert_eq!(
        refused(|header| header.speed_of_sound_mps = f64::NAN),
        "the speed of sound in metres a second is NaN, but it must be a finite number"
    );

    let header = ObjectDocument::read(examples()[0].as_bytes()).unwrap().header;
    let mut writer = ObjectWriter::new(Vec::new(), &header).unwrap();
    let key = MicrophoneKey {
        microphone: 2,
        time_s: 0.0,
        pose: Pose::upright([0.0; 3], [0.0, 0.0, 1.0]),
        cut: false,
    };
    let error = writer.write(&ObjectLine::Microphone(key)).unwrap_err();
    assert_eq!(error.to_string(), "there is no microphone with index 2");
    let key = MicrophoneKey { microphone: 0, pose: Pose { facing: [0.0; 3], ..key.pose }, ..key };
    let error =
        ObjectWriter::new(Vec::new(), &header).unwrap().write(&ObjectLine::Microphone(key)).unwrap_err();
    assert!(error.to_string().starts_with("the facing direction 0 0 0 has no usable length"));
}

#[test]
fn a_writer_says_when_the_disk_is_full() {
    struct Full;
    impl std::io::Write for Full {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("no space left"))
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let error = ChannelWriter::new(Full, &channel_header()).err().unwrap();
    assert_eq!(error.to_string(), "cannot write the score: no space left");
}

#[test]
fn a_score_sorted_by_time_is_read_as_it_is_needed() {
    /// A score without end; it fails the test where more than a little is asked of it.
    struct Endless {
        waiting: Vec<u8>,
        thread: u64,
        given: usize,
    }
    impl std::io::Read for Endless {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            assert!(self.given < 100_000, "read far ahead of what was asked for");
            while self.waiting.len() < buffer.len() {
                self.thread += 1;
                let lines = format!("start {0} {0} s 1 0\nend {0} {0}.5\n", self.thread);
                self.waiting.extend(lines.into_bytes());
            }
            let rest = self.waiting.split_off(buffer.len());
            buffer.copy_from_slice(&std::mem::replace(&mut self.waiting, rest));
            self.given += buffer.len();
            Ok(buffer.len())
        }
    }
    let header = "froufrou-score 1 channel\norder time\nchannels m\nsound s \"s.wav\"\n";
    let source = Endless { waiting: header.into(), thread: 0, given: 0 };
    let lines = ChannelReader::new(std::io::BufReader::new(source)).unwrap().by_time().unwrap();
    let threads: Vec<u64> = lines.take(6).map(|line| line.unwrap().thread()).collect();
    assert_eq!(threads, [1, 1, 2, 2, 3, 3]);
}

#[test]
fn a_microphone_that_stands_still_needs_no_lines_and_takes_none() {
    let text = "froufrou-score 1 object\norder time\nspeed-of-sound 343\nmicrophone m cardioid at 0 1.6 0 facing 1 0 0 # by the door\n\
                sound s \"s.wav\"\nstart 1 0 s at 1 0 0 gain 1\nend 1 1 at 1 0 0 gain 1\n";
    let document = ObjectDocument::read(text.as_bytes()).unwrap();
    let pose = Pose::upright([0.0, 1.6, 0.0], [1.0, 0.0, 0.0]);
    assert_eq!(document.header.receivers[0].fixed, Some(pose));
    assert_eq!(document.to_text().unwrap(), text);

    let text = text.replace("start 1", "hear m 0 at 1 2 3\nstart 1");
    let error = ObjectDocument::read(text.as_bytes()).unwrap_err().to_string();
    assert_eq!(
        error,
        "6:6: microphone `m` stands still where it was declared (leave the place out there if it is to move)"
    );
}

/// A score that uses all there is for synthesised sounds, paths and ambiences, in canonical form.
const SYNTHESISED: [&str; 2] = [
    r#"froufrou-score 1 object
order time
speed-of-sound 343
duration 4
seed 7
surroundings "scene.toml"
microphone left cardioid at 0 1.6 0 facing -1 0 0
microphone right cardioid at 0 1.6 0 facing 1 0 0
pattern lobe 1 0 0 0.5
sound bell modes "bell.json"
mode bell 440 5.2 1 0 0.5 1
mode bell 1207.5 9 -0.25
sound harp string with frequency 220 damping 0.002
sound siren procedure "siren.rhai" with pitch 700
sound scrape needle
sound wind "wind.wav" loop
start 1 0 bell at 1 0 0 gain 1
strike 1 0 impulse 0.5 place 1 contact 0.001
start 2 0.5 siren at 3 0 0 gain 0.5 turn 0 0 0 1 object car pattern lobe
set 2 0.5 pitch 650 "a name" -1
set 2 1 pitch 700
start 3 1 wind around left gain 0.2
key 3 2 around left gain 0.3
strike 1 2.5 impulse 1 place 0 contact 0
end 1 3 at 1 0 0 gain 1
"#,
    r#"froufrou-score 1 channel
order time
speed-of-sound 343
duration 4
seed 18446744073709551615
channels left right
sound squeak stick-slip with spacing 0.001
start 1 0 squeak 1 0.1 0.5 0.2
set 1 0 speed 0.5
path 1/2 0 0.1 0.3 0.1 0.31
key 1/2 0.25 0.1 0.3 0.1 0.31
end 1/2 0.5 0 0.3 0 0.31
path 1/2 0.75 0 0.3 0 0.31
end 1 1 1 0.1 0.5 0.2
key 1/2 1 0.1 0.3 0.1 0.31
"#,
];

#[test]
fn synthesised_sounds_paths_and_ambiences_read_and_write() {
    for text in SYNTHESISED {
        assert_eq!(canonical(text), text);
    }
    let AnySpace::Object(score) = AnyDocument::read(SYNTHESISED[0].as_bytes()).unwrap() else { panic!() };
    let Make::Modes { table: Some(table), modes } = &score.header.sounds[0].make else { panic!() };
    assert_eq!((table.as_str(), modes.len(), modes[0].points.len()), ("bell.json", 2, 3));
    assert_eq!(score.header.sounds[1].with[1], ("damping".to_string(), 0.002));
    let ObjectLine::Cue(cue) = &score.lines[3].line else { panic!() };
    assert_eq!(cue.action, Action::Set(vec![("pitch".into(), 650.0), ("a name".into(), -1.0)]));
}

/// A score of paper, in canonical form.
const PAPER: &str = r#"froufrou-score 1 channel
order time
speed-of-sound 343
duration 3
channels m
sound kraft paper "corpora/kraft"
sound sheet paper "synthetic/printer" with coherence 0 slip 2
sound "paper" "paper.wav"
start 1 0 sheet 1 0
set 1 0 friction-12 0.3 tear 0.1
grain 1 0.5 17 gain 0.8
start 2 1 "paper" 1 0
end 1 2 1 0
"#;

#[test]
fn paper_reads_and_writes() {
    let text = canonical(PAPER);
    // A sound may be called so too.
    assert_eq!(text, PAPER.replace("\"paper\" ", "paper ").replace("2 1 \"paper\"", "2 1 paper"));
    let AnySpace::Channel(score) = AnyDocument::read(PAPER.as_bytes()).unwrap() else { panic!() };
    let files: Vec<Option<&str>> = score.header.sounds.iter().map(|sound| sound.make.file()).collect();
    // A model is no file that has to be found.
    assert_eq!(files, [Some("corpora/kraft"), None, Some("paper.wav")]);
    assert!(score.header.sounds.iter().take(2).all(|sound| sound.make.kind() == "paper"));
    for (from, to, expected) in [
        ("paper \"corpora/kraft\"", "paper", "expected the folder of the database, or a model"),
        ("paper \"corpora/kraft\"", "paper \"\"", "the sound `kraft` has no corpus"),
        ("slip 2", "slip", "expected the value"),
    ] {
        let wrong = PAPER.replacen(from, to, 1);
        let error = AnyDocument::read(wrong.as_bytes()).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn faults_of_synthesised_sounds_and_paths_name_their_word() {
    let object = SYNTHESISED[0];
    let channel = SYNTHESISED[1];
    let mut wrong = Vec::new();
    for (text, from, to, expected) in [
        (object, "mode bell 440", "mode harp 440", "11:6: a mode of `harp`, which is no sound of `modes`"),
        (object, "pattern lobe 1 0 0 0.5", "pattern lobe 1 0 0", "9:9: the pattern `lobe` has 3 harmonics"),
        (
            object,
            "car pattern lobe",
            "car pattern lob",
            "19:69: unknown pattern `lob` (did you mean `lobe`?)",
        ),
        (object, "with pitch 700", "with pitch", "14:46: expected the value, found the end of the line"),
        (object, "needle", "needle with", "15:25: expected the name of a value"),
        (object, "frequency 220 damping", "damping 220 damping", "13:36: `damping` is given twice"),
        (object, "strike 1 2.5 impulse 1", "strike 1 2.5 place 1", "24:"),
        (object, "set 2 1 pitch 700", "set 3 1 pitch 700", "21:5: `set` of thread 3, which does not sound"),
        (
            object,
            "strike 1 2.5 impulse",
            "strike 3 2.5 impulse",
            "24:8: `strike` of thread 3, which plays a recording",
        ),
        (object, "around left gain 0.3", "at 0 0 0", "23:17: a thread is at places or around microphones"),
        (object, "around left gain 0.3", "around right", "23:21: a thread that is around one microphone"),
        (object, "around left gain 0.2", "around lft", "22:23: unknown microphone `lft`"),
        (object, "turn 0 0 0 1", "turn 0 0 0 0", "19:48: the turn 0 0 0 0 has no usable length"),
        (object, "siren at 3", "siren speed 2 at 3", "19:19: `speed` is for recordings"),
        (object, "key 3 2 around", "key 3/1 2 around", "23:5: thread 3/1 is a path of its own"),
        (channel, "path 1/2 0 0.1", "path 1/0 0 0.1", "10:6: path 0 of thread 1 is the direct one"),
        (channel, "path 1/2 0 0.1", "start 1/2 0 squeak 0.1", "10:1: thread 1/2 starts, but a path plays"),
        (channel, "path 1/2 0 0.1", "path 2/2 0 0.1", "10:6: a path of thread 2, which does not sound"),
        (channel, "path 1/2 0.75", "path 1/2/3 0.75", "13:6: expected the thread's number"),
        (channel, "end 1/2 0.5", "key 1/2 0.5", "13:6: path 1/2 began already in line 10"),
        (
            channel,
            "channels left right",
            "channels left right\nsurroundings \"a\"",
            "7:1: `surroundings` belongs",
        ),
    ] {
        assert!(text.contains(from), "{from}");
        let error = AnyDocument::read(text.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
        if !error.starts_with(expected) {
            wrong.push(format!("{from} → {to}\n  found    {error}\n  expected {expected}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Everything that microphones of several channels may say, as it is written.
const PICKUPS: [&str; 2] = [
    r#"froufrou-score 1 object
order time
speed-of-sound 343
duration 2
microphone ears binaural
microphone camera binaural "heads/a b.sofa" at 0 1.6 0 facing 0 0 -1
microphone crowd binaural shared
microphone both binaural "shared" shared at 0 1.6 0 facing 0 0 -1
microphone field ambisonic 3 at 0 0 0 facing 1 0 0 up 0 0 1
microphone room loudspeakers "left" 30 0 "right" -30 0 "top" 0 90 "lfe" lfe at 1 2 3 facing 0 0 -1
sound siren "siren.wav" loop
hear ears 0 at 0 0 0 facing 0 0 -1
hear crowd 0 at 0 0 0 facing 0 0 -1
start 1 0 siren at 1 2 3 gain 1
hear ears 1 at 0 0 0 facing 0 0 -1 up 1 0 0
hear ears 1.5 at 0 0 0 facing 0 0 -1
end 1 2 at 1 2 3 gain 1
"#,
    r#"froufrou-score 1 channel
order time
speed-of-sound 343
duration 2
channels lfe # to be filled by hand
head left right "kemar.sofa" # whose head
head l r shared # with all
channels spare "spare 2"
sound siren "siren.wav" loop
start 1 0 siren 0 0.1 0.5 0.1 1 0 -3.5 -0.25 0.2 0 0 0 1 0 -1 0
end 1 1 0 0.1 0.5 0.1 2 0 -3.5 -0.25 0.2 0 1e-7 0 1 0 -1 0
"#,
];

#[test]
fn pickups_and_heads_read_and_write() {
    for text in PICKUPS {
        assert_eq!(canonical(text), text);
    }
    let score = ObjectDocument::read(PICKUPS[0].as_bytes()).unwrap();
    let [ears, camera, crowd, both, field, room] = &score.header.receivers[..] else { panic!() };
    assert_eq!(ears.pickup, Pickup::Binaural { head: None, shared: false });
    assert_eq!(camera.pickup, Pickup::Binaural { head: Some("heads/a b.sofa".into()), shared: false });
    assert_eq!(crowd.pickup, Pickup::Binaural { head: None, shared: true });
    assert_eq!(both.pickup, Pickup::Binaural { head: Some("shared".into()), shared: true });
    assert_eq!(field.fixed.unwrap().up, [0.0, 0.0, 1.0]);
    assert_eq!(field.pickup.channels().join(" "), "W Y Z X V T R S U Q O M K L N P");
    assert_eq!(room.pickup.channels(), ["left", "right", "top", "lfe"]);
    let ups = score.lines.iter().filter_map(|noted| match &noted.line {
        ObjectLine::Microphone(key) => Some(key.pose.up[0]),
        _ => None,
    });
    assert_eq!(
        ups.collect::<Vec<_>>(),
        [0.0, 0.0, 1.0, 0.0],
        "what is not said is upright, whatever was before"
    );
    let score = ChannelDocument::read(PICKUPS[1].as_bytes()).unwrap();
    assert_eq!(score.header.channels(), ["lfe", "left", "right", "l", "r", "spare", "spare 2"]);
    let ChannelLine::Thread(start) = &score.lines[0].line else { panic!() };
    let from = |index: usize| start.value[index].from_m;
    assert_eq!((from(0), from(1), from(4)), (None, Some([1.0, 0.0, -3.5]), None));
    assert_eq!((start.value[2].gain, start.value[4].gain), (-0.25, -1.0));
}

#[test]
fn faults_of_pickups_and_heads_name_their_word() {
    let mut wrongly_told = Vec::new();
    for (text, from, to, expected) in [
        (PICKUPS[0], "ambisonic 3", "ambisonic 4", "9:28: expected an order from 1 to 3, found 4"),
        (PICKUPS[0], "\"right\" -30 0", "\"left\" -30 0", "10:42: there are two loudspeakers `left`"),
        (PICKUPS[0], "\"lfe\" lfe", "\"lfe\" low", "10:73: unknown word `low`"),
        (
            PICKUPS[0],
            " \"left\" 30 0 \"right\" -30 0 \"top\" 0 90 \"lfe\" lfe",
            "",
            "10:17: there are no loudspeakers",
        ),
        (PICKUPS[0], "up 1 0 0", "up 0 0 0", "15:43: the upward direction 0 0 0 has no usable length"),
        (
            PICKUPS[0],
            "microphone ears binaural\n",
            "head ears binaural\n",
            "5:1: `head` belongs into a score in channel space",
        ),
        (PICKUPS[1], "0.1 2 0 -3.5", "0.1 2 0", "11:"),
        (PICKUPS[1], "0 1 0 -1 0\n", "0 1 0\n", "10:59: expected 5 groups of numbers"),
        (PICKUPS[1], "head l r shared", "head l", "7:"),
        (PICKUPS[1], "head l r shared", "head l left shared", "7:8: the channel `left` is declared twice"),
        (PICKUPS[1], "r shared #", "r shared shared #", "7:17: "),
        (PICKUPS[1], "channels spare", "channels a\nchannels spare", "9:1: `channels` is given twice"),
    ] {
        assert!(text.contains(from), "{from}");
        let wrong = text.replacen(from, to, 1);
        let error = AnyDocument::read(wrong.as_bytes()).unwrap_err().to_string();
        wrongly_told.extend((!error.starts_with(expected)).then(|| format!("{to}: {error}")));
    }
    assert!(wrongly_told.is_empty(), "{wrongly_told:#?}");
}
