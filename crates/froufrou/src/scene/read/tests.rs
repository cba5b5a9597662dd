use super::super::file::{Played, StartKey, Timing};
use super::*;
use crate::score::Repeat;
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// The folder that all examples of these tests lie in.
static ROOM: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let room = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    std::fs::create_dir(room.path().join("hits")).unwrap_or_else(|e| panic!("{e}"));
    for name in [
        "tower.abc",
        "siren.wav",
        "hits/b.wav",
        "hits/a.wav",
        "contacts.csv.gz",
        "c.obj",
        "c_1.obj",
        "c_2.obj",
    ] {
        std::fs::write(room.path().join(name), "").unwrap_or_else(|e| panic!("{e}"));
    }
    room
});

fn parse(text: &str) -> Result<Scene> {
    Scene::parse(text, ROOM.path().join("s.toml"), false)
}

/// The error of a text, without the folder.
fn fault(text: &str) -> String {
    let found = parse(text).err().map(|e| e.to_string()).unwrap_or_default();
    found.rsplit_once("s.toml:").map_or(found.clone(), |(_, rest)| rest.to_owned())
}

const REFERENCE: &str = include_str!("../../../../../docs/scene.md");

/// The keys of every table of the reference, by heading.
fn documented() -> BTreeMap<String, Vec<String>> {
    let mut found: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut heading = String::new();
    for line in REFERENCE.lines() {
        if let Some(text) = line.strip_prefix("## ").or(line.strip_prefix("### ")) {
            heading = text.to_owned();
        } else if let Some(row) = line.strip_prefix("| `") {
            let key = row.split('`').next().unwrap_or_default();
            found.entry(heading.clone()).or_default().push(key.to_owned());
        }
    }
    found
}

#[test]
fn the_reference_has_every_key_that_is_read_and_no_other() {
    let mut documented = documented();
    for (heading, keys) in ALL_KEYS {
        let mut written = documented.remove(*heading).unwrap_or_default();
        let mut read: Vec<String> = keys.iter().map(|k| (*k).to_owned()).collect();
        written.sort();
        read.sort();
        assert_eq!(read, written, "{heading}");
    }
    assert!(documented.is_empty(), "tables of nothing that is read: {documented:?}");
}

fn example() -> &'static str {
    REFERENCE.split("```toml\n").nth(1).and_then(|t| t.split("```").next()).unwrap_or_default()
}

#[test]
fn the_example_of_the_reference_reads_as_it_says() -> Result<()> {
    let scene = parse(example())?;
    assert_eq!((scene.rate_hz, scene.seed, scene.duration_s), (48000, 7, None));
    let names: Vec<&str> = scene.microphones.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["left", "right"]);
    assert_eq!(scene.microphones[0].local_facing, [-1.0, 0.0, 0.0]);
    assert_eq!(scene.microphones[1].local_offset_m, [0.09, 0.0, 0.0]);
    let Some(impact) = &scene.materials[0].impact else { panic!("no impact") };
    let Played::Recordings { recordings, .. } = &impact.played else { panic!() };
    let hits: Vec<&str> = recordings.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(hits, ["hits/a.wav", "hits/b.wav"]);
    assert_eq!((impact.reference_impulse_ns, impact.floor_impulse_ns, impact.retrigger_s), (0.5, 0.01, 0.03));
    assert_eq!(scene.objects[0].material, Some(0));
    assert!(scene.objects[0].body.matches("ball"));
    let Some(Motion::Source(source)) = &scene.objects[0].motion else { panic!("no source") };
    assert_eq!((source.file.name.as_str(), source.object.text()), ("tower.abc", "/Ball"));
    let Some(Motion::Track(track)) = &scene.objects[1].motion else { panic!("no track") };
    assert_eq!(track.position_m(2.15), [0.0, 0.0, 12.0]);
    assert_eq!(scene.sounds[0].emitter, Emitter::Object(1));
    assert!(matches!(scene.sounds[0].played, Played::Recordings { repeat: Repeat::Loop, .. }));
    assert_eq!(scene.sounds[0].timing, Timing::Span { from_s: 0.0, to_s: None });
    let Timing::Starts(starts) = &scene.sounds[1].timing else { panic!("no starts") };
    assert_eq!(starts[0], StartKey { time_s: 0.5, gain_db: 0.0, speed: 1.0 });
    assert_eq!(starts[1], StartKey { time_s: 1.25, gain_db: -3.0, speed: 1.1 });
    assert_eq!(scene.contacts[0].columns.push, Push::Force("Fn".to_owned()));
    assert_eq!(scene.contacts[0].columns.up, UpAxis::Z);
    Ok(())
}

/// A value that differs from the default for every key: what is read must change the scene.
#[test]
fn no_key_is_read_and_ignored() -> Result<()> {
    let object = "[[object]]\nname = 'o'\nsource = 'tower.abc#/A'\n";
    let track = "[[object]]\nname = 'o'\ntrack = [{ t = 0, position = [0, 0, 0] }]\n";
    let sound = "[[sound]]\nposition = [0, 0, 0]\nrecording = 'siren.wav'\n";
    let mic = "[[microphone]]\nname = 'm'\n";
    let impact = "[material.m.impact]\nrecordings = 'siren.wav'\n";
    let log = "[[contacts]]\nlog = 'contacts.csv.gz'\n[contacts.columns]\nt = 't'\na = 'a'\nb = 'b'\n\
               position = ['x', 'y', 'z']\nnormal_force = 'F'\n";
    let step = "[[contacts]]\nlog = 'contacts.csv.gz'\ncolumns = { t = 't', a = 'a', b = 'b', \
                position = ['x', 'y', 'z'], normal_impulse = 'J' }\n";
    let cases: &[(&str, &[&str])] = &[
        ("", &["rate = 44100", "seed = 1", "duration = 2", "speed_of_sound = 340", "frame_rate = 50"]),
        (
            "[listener]\n",
            &[
                "position = [1, 0, 0]",
                "facing = [1, 0, 0]",
                "track = 'tower.abc#/Camera'",
                "track = [{ t = 1, position = [1, 2, 3], facing = [0, 0, 1] }]",
                "offset = [0, 1, 0]",
                "layout = 'mono'",
                "spacing = 1",
            ],
        ),
        (
            "[listener]\ntrack = 'tower.abc#/C'\n",
            &["facing = [1, 0, 0]", "time_offset = 1", "up = 'z'", "unit = 0.01", "frame_rate = 30"],
        ),
        (
            "[[microphone]]\nname = 'm'\ntrack = 'tower.abc#/C'\n",
            &["time_offset = 1", "up = 'z'", "unit = 0.01", "frame_rate = 30"],
        ),
        (
            "[listener]\ntrack = [{ t = 0, position = [0, 0, 0] }]\n",
            &["interpolation = 'step'", "time_offset = 1"],
        ),
        (mic, &["shape = 'cardioid'", "shape = { c = 1 }", "shape = { k = 2 }", "position = [1, 0, 0]"]),
        (mic, &["facing = [1, 0, 0]", "offset = [1, 0, 0]", "track = 'tower.abc#/C'"]),
        (
            impact,
            &[
                "gain_db = 1",
                "reference_impulse = 2",
                "floor_impulse = 0",
                "retrigger = 1",
                "speed_variation = 0.1",
                "reference_distance = 2",
            ],
        ),
        (object, &["time_offset = 1", "offset = [1, 0, 0]", "point = { vertex = 3 }", "body = 'b*'"]),
        (object, &["up = 'z'", "unit = 0.01", "frame_rate = 30", "faces = 'c.obj'"]),
        (object, &["sound = { recording = 'siren.wav' }", "sound = [{ recordings = ['hits/*'] }]"]),
        (track, &["interpolation = 'linear'", "time_offset = 1"]),
        (
            sound,
            &[
                "loop = true",
                "loop = 'exact'",
                "channel = 0",
                "gain_db = 1",
                "speed = 2",
                "speed_variation = 0.1",
                "at = [1]",
                "from = 1",
                "to = 1",
                "fade_in = 1",
                "fade_out = 1",
                "reference_distance = 2",
            ],
        ),
        (log, &["normal = ['a', 'b', 'c']", "normal_velocity = 'v'", "sliding_velocity = ['v', 'w']"]),
        (step, &["step = 0.01", "up = 'z'", "unit = 2", "time_offset = 1"]),
    ];
    for (base, keys) in cases {
        let plain = parse(base)?;
        for key in *keys {
            let text = format!("{base}{key}\n");
            let found = parse(&text).map_err(|e| e.help(text.clone()))?;
            assert_ne!(found, plain, "{text}");
        }
    }
    Ok(())
}

#[test]
fn faults_name_the_line_the_key_and_the_remedy() {
    let object = "[[object]]\nname = 'o'\n";
    let sound = "[[sound]]\nposition = [0, 0, 0]\nrecording = 'siren.wav'\n";
    for (text, expected) in [
        (
            "rate = 7999",
            "1:8: `rate`: expected samples a second, a whole number from 8000 to 192000, found the whole number 7999",
        ),
        (
            "rate = '48k'",
            "1:8: `rate`: expected samples a second, a whole number from 8000 to 192000, found the text \"48k\"",
        ),
        ("seed = -1", "1:8: `seed`: expected a seed, a whole number"),
        ("duration = nan", "1:12: `duration`: expected a number of seconds above 0, found the number nan"),
        (
            "duration = 1e999",
            "1:12: `duration`: expected a number of seconds above 0, found the number 1e999",
        ),
        ("[listner]\n", "1:2: unknown key `listner` (did you mean `listener`?)"),
        ("[listener]\nlayuot = 'mono'", "2:1: unknown key `layuot` in `listener` (did you mean `layout`?)"),
        (
            "[listener]\nlayout = 'sterio'",
            "2:10: `listener.layout`: expected `mono`, `stereo`, `binaural`, `ambisonic-1`, `ambisonic-2`, `ambisonic-3`, `quad`, `5.1`, `7.1`, `5.1.2`, `5.1.4` or `7.1.4`, found the text \"sterio\" (did you mean `stereo`?)",
        ),
        ("[listener]\nfacing = [0, 0, 0]", "2:10: `listener.facing`: a direction cannot be [0, 0, 0]"),
        ("[listener]\n[[microphone]]\nname = 'm'", "2:1: `microphone`: cannot stand beside `listener`"),
        (
            "[[microphone]]\n",
            "1:1: `microphone[0]`: `name` is missing: expected a name for the output channel",
        ),
        (
            "[[microphone]]\nname = 'm'\n[[microphone]]\nname = 'm'",
            "4:8: `microphone[1].name`: there is another microphone \"m\"",
        ),
        (
            "[listener]\ntrack = 'tower.abc'",
            "2:9: `listener.track`: expected an animation file and an object",
        ),
        ("[listener]\ntrack = 'towr.abc#/C'", "2:9: `listener.track`: there is no file \"towr.abc\""),
        (
            "[listener]\ntrack = [{ t = 1, position = [0, 0, 0] }, { t = 1, position = [0, 0, 0] }]",
            "2:49: `listener.track[1].t`: keys must be in ascending order of time: expected more than 1, found 1",
        ),
        (
            "[[object]]\nname = 'o'\nmaterial = 'wod'\n[material.wood]",
            "3:12: `object[0].material`: there is no material \"wod\" (did you mean `wood`?)",
        ),
        (
            &format!("{object}position = [0, 0, 0]\nunit = 0.01"),
            "4:8: `object[0].unit`: means nothing without an animation file",
        ),
        (
            &format!("{object}source = 'c.obj#/c'\nfaces = 'd.obj'"),
            "4:9: `object[0].faces`: there is no file \"d.obj\"",
        ),
        (&format!("{object}source = 'd_*.obj#/d'"), "3:10: `object[0].source`: no file matches \"d_*.obj\""),
        (
            &format!("{object}source = '{{.,hits}}/../c_*.obj#/c'"),
            "3:10: `object[0].source`: no file matches",
        ),
        (&format!("{object}source = '**/c_*.obj#/c'"), "3:10: `object[0].source`: a pattern of files may"),
        (
            &format!("{object}source = '../c_*.obj#/c'"),
            "3:10: `object[0].source`: \"../c_*.obj\" leaves the scene's folder",
        ),
        (&format!("{object}{object}"), "4:8: `object[1].name`: there is another object \"o\""),
        (
            &format!("{object}point = {{ vertex = 1 }}"),
            "3:9: `object[0].point`: means nothing without a `source`",
        ),
        (
            &format!("{object}position = [0, 0]"),
            "3:12: `object[0].position`: expected metres as [x, y, z], found a list of 2",
        ),
        (
            &format!("{object}sound = {{ recording = 'siren.wav' }}"),
            "3:9: `object[0].sound`: the object has no place",
        ),
        (
            "[[sound]]\nobject = 'o'\nrecording = 'siren.wav'",
            "2:10: `sound[0].object`: there is no object \"o\"",
        ),
        (&format!("{sound}at = [1]\nfrom = 1"), "5:8: `sound[0].from`: cannot stand beside `sound[0].at`"),
        (&format!("{sound}at = [1]\nloop = true"), "4:6: `sound[0].at`: a loop has no end"),
        (&format!("{sound}to = 0"), "4:6: `sound[0].to`: expected a time after the start at 0, found 0"),
        (
            "[[sound]]\nposition = [0, 0, 0]\nrecording = '../x.wav'",
            "3:13: `sound[0].recording`: \"../x.wav\" leaves the scene's folder (a scene may use files outside its folder only with --allow-outside)",
        ),
        (
            "[[sound]]\nposition = [0, 0, 0]\nrecordings = 'x*.wav'",
            "3:14: `sound[0].recordings`: no file matches \"x*.wav\"",
        ),
        (
            "[[contacts]]\nlog = 'contacts.csv.gz'\ncolumns = { t = 't', a = 'a', b = 'b', position = ['x', 'y', 'z'] }",
            "3:11: `contacts[0].columns`: `normal_force` or `normal_impulse` is missing",
        ),
        ("sound = 1", "1:9: `sound`: expected tables, each under `[[sound]]`, found the whole number 1"),
    ] {
        let found = fault(text);
        assert!(found.starts_with(expected), "{text}\nexpected {expected}\nfound    {found}");
    }
}

#[test]
fn files_of_absurd_size_or_depth_are_refused() -> Result<()> {
    assert!(fault(&format!("rate = {}1{}", "[".repeat(100_000), "]".repeat(100_000))).starts_with("1:"));
    assert!(fault(&format!("{} = 1", "a.".repeat(100_000) + "b")).starts_with("1:"));
    let room = tempfile::tempdir().map_err(|e| Error::io("make", "room", e))?;
    let path = room.path().join("big.toml");
    let comment = vec![b'#'; (1 << 24) + 1];
    std::fs::write(&path, &comment).map_err(|e| Error::io("write", &path, e))?;
    assert!(Scene::open(&path, false).is_err_and(|e| e.to_string().contains("not a scene")));
    std::fs::write(&path, &comment[1..]).map_err(|e| Error::io("write", &path, e))?;
    assert_eq!(Scene::open(&path, false)?.microphones.len(), 2);
    std::fs::write(&path, b"rate = \xff").map_err(|e| Error::io("write", &path, e))?;
    assert!(Scene::open(&path, false).is_err_and(|e| e.to_string().contains("byte 7: not UTF-8")));
    assert!(Scene::open(room.path().join("none.toml"), false).is_err());
    Ok(())
}

#[test]
fn a_sequence_is_named_by_its_pattern() -> Result<()> {
    let scene = parse("[[object]]\nname = 'o'\nsource = 'c_*.obj#/c'\nunit = 0.01")?;
    let Some(Motion::Source(source)) = &scene.objects[0].motion else { panic!("no source") };
    assert_eq!((source.file.name.as_str(), source.object.text()), ("c_*.obj", "/c"));
    assert_eq!(source.file.path, ROOM.path().join("c_*.obj"));
    assert_eq!(source.conventions, Conventions { unit_m: Some(0.01), ..Conventions::default() });
    Ok(())
}

#[test]
fn a_listener_that_turns_has_its_ears_turn_with_it() -> Result<()> {
    let scene = parse("[listener]\nfacing = [1, 0, 0]\nspacing = 2\nposition = [5, 0, 0]")?;
    let Motion::Track(track) = &scene.microphones[1].motion else { panic!("not a track") };
    let frame = track.frame(0.0);
    let right = scene.microphones[1].local_offset_m;
    let world: [f64; 3] =
        std::array::from_fn(|n| frame[n][3] + (0..3).map(|c| frame[n][c] * right[c]).sum::<f64>());
    assert_eq!(world, [5.0, 0.0, 1.0]);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn damaged_scenes_are_told_not_crashed_on(
        cut in 0usize..1200, at in 0usize..1200, with in "[\\[\\]{}=,.'\"0-9a-z\\-\n#*é]{0,4}", which: bool
    ) {
        let whole: Vec<char> = example().chars().collect();
        let at = at.min(whole.len());
        let rest = if which { at } else { (at + with.chars().count()).min(whole.len()) };
        let text: String = whole[..at].iter().copied().chain(with.chars()).chain(whole[rest..].iter().copied()).collect();
        let text: String = text.chars().take(cut.max(at)).collect();
        if let Err(error) = parse(&text) {
            prop_assert!(error.file().is_some() && error.place().is_some(), "{}", error);
        }
    }
}

#[test]
fn contacts_are_of_a_log_or_of_bodies() -> Result<()> {
    let scene = parse(
        "[material.oak]\ndensity = 700\n[[object]]\nname = 'ball'\nposition = [0, 0, 0]\nmass = 2.5\nmaterial = 'oak'\n\
         [[contacts]]\nbodies = ['ball', 'box*']\ngravity = [0, -1.62, 0]\n[[contacts]]\nbodies = '*'",
    )?;
    assert_eq!((scene.materials[0].density, scene.objects[0].mass_kg), (700.0, Some(2.5)));
    let texts = |index: usize| scene.touching[index].bodies.iter().map(NamePattern::text).collect::<Vec<_>>();
    assert_eq!((texts(0), texts(1)), (vec!["ball", "box*"], vec!["*"]));
    assert_eq!(scene.touching[0].gravity_mps2, [0.0, -1.62, 0.0]);
    assert_eq!(scene.touching[1].gravity_mps2, [0.0, -9.81, 0.0]);
    assert!(scene.contacts.is_empty());

    let both = fault("[[contacts]]\nbodies = ['*']\nlog = 'contacts.csv.gz'");
    assert!(both.contains("log") && both.contains("bodies"), "{both}");
    assert!(fault("[[contacts]]\nbodies = []").contains("names of objects"));
    assert!(fault("[[contacts]]\nbodies = ['*']\nstep = 0.01").contains("`log`"));
    assert!(fault("[[contacts]]\nbodies = ['[']").contains("2:"));
    assert!(fault("[[object]]\nname = 'x'\nmass = 0").contains("mass"));
    assert!(fault("[material.x]\ndensity = -1").contains("density"));
    Ok(())
}
