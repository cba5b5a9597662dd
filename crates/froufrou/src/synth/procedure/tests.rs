//! What scripts sound like, and what they are told when they are wrong.

use super::*;

const RATE_HZ: f64 = 48_000.0;

pub(super) fn shipped(name: &str) -> PathBuf {
    let folder = if name == "bees.rhai" { "bees" } else { "procedures" };
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(folder).join(name)
}

fn given(values: &[(&str, f64)]) -> Vec<(String, f64)> {
    values.iter().map(|&(name, value)| (name.to_owned(), value)).collect()
}

/// Makes seconds of a procedure with its controls as a function of time, and strikes.
fn render_with(
    procedure: &Procedure,
    (rate_hz, seconds): (f64, f64),
    random: Random,
    controls: impl Fn(&str, f64) -> Option<f64>,
    strikes: &[Strike],
) -> Result<Vec<f64>> {
    let mut voice = procedure.generator(rate_hz, random)?;
    let count = stretch_samples(rate_hz);
    let mut samples = Vec::new();
    let mut out = vec![0.0; count];
    for number in 0..(seconds * rate_hz / count as f64).ceil() as u64 {
        let first = number * count as u64;
        let (from, to) = (first as f64 / rate_hz, (first + count as u64) as f64 / rate_hz);
        let ramps: Vec<Ramp> = procedure
            .controls()
            .iter()
            .map(|known| {
                let at = |time| controls(&known.name, time).unwrap_or(known.default);
                Ramp { from: at(from), to: at(to) }
            })
            .collect();
        let due: Vec<Strike> =
            strikes.iter().filter(|strike| (from..to).contains(&strike.time_s)).copied().collect();
        voice
            .generate(&Stretch { first, rate_hz, controls: &ramps, strikes: &due, grains: &[] }, &mut out)?;
        samples.extend(out.iter().map(|&sample| f64::from(sample)));
    }
    Ok(samples)
}

fn render(source: &str, seconds: f64) -> Vec<f64> {
    let procedure = Procedure::new("test.rhai", source, &[]).unwrap();
    render_with(&procedure, (RATE_HZ, seconds), Random::new(7, 1), |_, _| None, &[]).unwrap()
}

fn error(source: &str) -> String {
    match Procedure::new("test.rhai", source, &[]) {
        Ok(_) => panic!("{source} is taken"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn what_ships_sounds() {
    for name in ["siren", "bees", "geiger", "plucked", "bell"] {
        let procedure = Procedure::open(shipped(&format!("{name}.rhai")), &[]).unwrap();
        let strikes = [Strike { time_s: 0.01, impulse_ns: 1.0, place: 0.3, contact_s: 1e-3 }];
        let sound =
            render_with(&procedure, (RATE_HZ, 1.0), Random::new(7, 1), |_, _| None, &strikes).unwrap();
        let most = sound.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        assert!((0.01..=1.5).contains(&most), "{name}: {most}");
        assert_eq!(procedure.ring_s().is_some(), procedure.takes_strikes(), "{name}");
    }
}

#[test]
fn faults_have_a_place_and_a_reason() {
    let mut wrong = String::new();
    for (source, expected) in [
        ("let x = ;", "test.rhai:1:9: "),
        ("play(sine2(440.0));", "test.rhai:1:6: there is no function sine2 (f64) (did you mean `sine`?)"),
        ("play(sine(\"a\"));", "test.rhai:1:6: a number or a unit is wanted here, not string"),
        (
            "play(sine(1, 2));",
            "test.rhai:1:6: there is no function sine (i64, i64) (`sine` is used in another way: sine(frequency))",
        ),
        (
            "let a = sine(1);\nplay(a);\nfn control() {\n  a.cutoff = 3;\n}",
            "test.rhai:4:5: sine has no `cutoff`: it has frequency, jitter",
        ),
        (
            "let a = sine(1);\nplay(a);\nfn control() {\n  a.frequency = 1.0 / 0.0;\n}",
            "test.rhai:4:5: frequency is inf, not from -1000000 to 1000000",
        ),
        (
            "let a = sine(1);\nplay(a);\nfn control() {\n  sine(2);\n}",
            "test.rhai:4:3: units are made at the top",
        ),
        (
            "let n = 1.0;\nplay(white());\nfn helper() {\n n + 1.0 }\nfn control() { helper(); }",
            "test.rhai:4:2: there is no variable `n` (a function that the script itself calls",
        ),
        ("fn sample() {\n  \"loud\"\n}", "test.rhai:1:13: `fn sample` gives string, not a number"),
        ("\nfn sample() { 0.0 / 0.0 }", "test.rhai:2:13: `fn sample` gives NaN at sample 0"),
        (
            "let t = 0;\nfn sample() { t += 1; if t > 100 { sqrt(-1.0) } else { 0.0 } }",
            "test.rhai:2:13: `fn sample` gives NaN at sample 100",
        ),
        (
            "let a = value(1e9);\nlet b = a * a * a * a;\nplay(b * b);",
            "test.rhai: what is played sums to inf at sample 0, 0.000000 s",
        ),
        ("", "test.rhai: nothing is played"),
        ("play(sampled());", "but there is no `fn sample()`"),
        (
            "play(white());\nfn control(time) { }",
            "test.rhai:2:18: `control` takes 0 arguments (write `fn control()`)",
        ),
        ("param(\"a b\", 1);", "test.rhai:1:1: a parameter cannot be called `a b`"),
        ("param(\"time\", 1);", "a parameter cannot be called `time`"),
        ("param(\"a\", 1); param(\"a\", 2);", "test.rhai:1:16: a parameter cannot be called `a`"),
        ("param(\"a\", 1, 2, 3);", "`a` is 1, not from 2 to 3"),
        ("let time = 3;", "test.rhai:1:1: Forbidden variable name: time"),
        ("let a = value(1); let d = delay(a, 0.1); let b = d * 2; d.seconds = b; play(d);", "test.rhai:1:"),
        ("let b = buffer(4);\nb[4] = 1.0;", "test.rhai:2:2: there is no [4] in a buffer of 4"),
        ("throw \"too loud\";", "test.rhai:1:1: too loud"),
        ("eval(\"1\");", "test.rhai:1:1: "),
        ("import \"a\" as b;", "test.rhai:1:1: "),
        ("timestamp();", "there is no function timestamp"),
        ("sleep(10);", "there is no function sleep"),
        ("let f = |x| x; f.call(1);", "test.rhai:1:"),
    ] {
        let found = error(source);
        if !found.contains(expected) {
            wrong += &format!("{source:?}\n gives {found:?}\n  not {expected:?}\n");
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
    let error = Procedure::open(shipped("siren.rhai"), &given(&[("pitsch", 1.0)])).unwrap_err().to_string();
    assert!(
        error.contains("there is no parameter `pitsch` (there are pitch, swing, rate, level)"),
        "{error}"
    );
    let error = Procedure::open(shipped("siren.rhai"), &given(&[("pitch", 1.0)])).unwrap_err().to_string();
    assert!(error.contains("siren.rhai:3:1: `pitch` is set to 1, not from 20 to 10000"), "{error}");
    let twice = Procedure::open(shipped("siren.rhai"), &given(&[("pitch", 99.0), ("pitch", 99.0)]));
    assert!(twice.unwrap_err().to_string().contains("given twice"));
    assert!(Procedure::open("/nowhere.rhai", &[]).unwrap_err().to_string().contains("cannot open"));
}

#[test]
fn print_is_kept_up_to_a_hundred_lines() {
    let procedure = Procedure::new("a", "play(white()); for n in 0..1000 { print(n); }", &[]).unwrap();
    assert_eq!((procedure.printed().len(), procedure.printed()[99].as_str()), (100, "99"));
}

#[test]
fn functions_see_the_top_of_the_script() {
    let source = "const K = 2.0; let tone = value(0.0); let seen = 0.0; let calls = [0, 0];
        param(\"gain\", 3.0); play(tone);
        fn helper(x) { tone.value = tone.value + K * gain * x; tone.value }
        fn control() { calls[0] += 1; seen += 1.0; helper(seen); }";
    // Called at 0 and then at the end of each stretch: 6, then 6 + 12, then 18 + 18.
    let sound = render(source, 0.006);
    assert_eq!((sound[0], sound[48], sound[96], sound[192]), (6.0, 12.0, 18.0, 36.0));
}

#[test]
fn the_reference_names_every_word_and_limit() {
    let reference = include_str!("../../../../../docs/procedures.md");
    for (word, usage) in words::WORDS {
        for way in usage.split(" or ") {
            assert!(reference.contains(&format!("`{way}`")), "{word}: `{way}` is not in the reference");
        }
    }
    for name in words::NAMES.iter().chain(words::PROPERTIES) {
        assert!(reference.contains(&format!("`{name}`")), "`{name}` is not in the reference");
    }
    let rows = [
        ("length of a script", format!("{} KiB", limits::SOURCE_BYTES >> 10)),
        ("operations of the top of the script", limits::TOP_OPERATIONS.to_string()),
        ("operations of one call", limits::CALL_OPERATIONS.to_string()),
        (
            "operations a stretch, on average",
            format!("{} and {} a sample", limits::STRETCH_OPERATIONS, limits::SAMPLE_OPERATIONS),
        ),
        ("operations saved up", limits::SAVED_OPERATIONS.to_string()),
        ("time of one call", format!("{} s", limits::CALL_TIME.as_secs_f64())),
        ("depth of calls", limits::CALL_DEPTH.to_string()),
        ("depth of expressions", limits::EXPRESSION_DEPTH.to_string()),
        ("arguments of a call", limits::ARGUMENTS.to_string()),
        ("functions", limits::FUNCTIONS.to_string()),
        ("variables at a time", limits::VARIABLES.to_string()),
        ("values in an array", limits::ARRAY.to_string()),
        ("values in all variables of a function", limits::VALUES.to_string()),
        ("bytes of a string", limits::STRING.to_string()),
        ("parameters", limits::PARAMETERS.to_string()),
        ("units", limits::UNITS.to_string()),
        ("harmonics of a wave", limits::HARMONICS.to_string()),
        ("all delays together", format!("{} s", limits::DELAYS_S)),
        ("numbers in all buffers", limits::BUFFERS.to_string()),
        ("events in a stretch", limits::EVENTS.to_string()),
        ("lines of `print` kept", limits::PRINTED.to_string()),
    ];
    for (what, most) in rows {
        assert!(
            reference.contains(&format!("| {what} | {most} |")),
            "{what}: {most} is not in the reference"
        );
    }
}
