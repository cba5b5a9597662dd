//! Procedures against closed forms and scipy: pitch, band limits, filters, ramps, moments.

use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};

use froufrou::Result;
use froufrou::random::Random;
use froufrou::synth::instrument::{Instrument, Ramp, Stretch, Strike, stretch_samples};
use froufrou::synth::procedure::Procedure;

const RATE_HZ: f64 = 48_000.0;

/// How a procedure is played.
struct Play<'a> {
    rate_hz: f64,
    seconds: f64,
    random: Random,
    /// The value of a control at a time; its default where there is none.
    controls: &'a dyn Fn(&str, f64) -> Option<f64>,
    strikes: &'a [Strike],
}

impl Default for Play<'_> {
    fn default() -> Self {
        Self {
            rate_hz: RATE_HZ,
            seconds: 1.0,
            random: Random::new(7, 1),
            controls: &|_, _| None,
            strikes: &[],
        }
    }
}

impl Play<'_> {
    fn render(&self, procedure: &Procedure) -> Result<Vec<f64>> {
        let mut voice = procedure.generator(self.rate_hz, self.random)?;
        let count = stretch_samples(self.rate_hz);
        let (mut samples, mut out) = (Vec::new(), vec![0.0; count]);
        for number in 0..(self.seconds * self.rate_hz / count as f64).ceil() as u64 {
            let first = number * count as u64;
            let (from, to) = (first as f64 / self.rate_hz, (first + count as u64) as f64 / self.rate_hz);
            let ramps: Vec<Ramp> = procedure
                .controls()
                .iter()
                .map(|known| {
                    let at = |time| (self.controls)(&known.name, time).unwrap_or(known.default);
                    Ramp { from: at(from), to: at(to) }
                })
                .collect();
            let due: Vec<Strike> =
                self.strikes.iter().filter(|strike| (from..to).contains(&strike.time_s)).copied().collect();
            let stretch =
                Stretch { first, rate_hz: self.rate_hz, controls: &ramps, strikes: &due, grains: &[] };
            voice.generate(&stretch, &mut out)?;
            samples.extend(out.iter().map(|&sample| f64::from(sample)));
        }
        Ok(samples)
    }

    fn script(&self, source: &str) -> Vec<f64> {
        self.render(&Procedure::new("test.rhai", source, &[]).unwrap()).unwrap()
    }
}

fn script(source: &str, seconds: f64) -> Vec<f64> {
    Play { seconds, ..Play::default() }.script(source)
}

fn shipped(name: &str, given: &[(&str, f64)]) -> Procedure {
    let folder = if name == "bees.rhai" { "bees" } else { "procedures" };
    let file: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(folder).join(name);
    let given: Vec<_> = given.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
    Procedure::open(file, &given).unwrap()
}

fn strike(time_s: f64, contact_s: f64) -> Strike {
    Strike { time_s, impulse_ns: 1.0, place: 0.25, contact_s }
}

/// Times, in samples, at which a signal rises through 0.
fn rises(signal: &[f64]) -> Vec<f64> {
    signal
        .windows(2)
        .enumerate()
        .filter(|(_, pair)| pair[0] < 0.0 && pair[1] >= 0.0)
        .map(|(index, pair)| index as f64 + pair[0] / (pair[0] - pair[1]))
        .collect()
}

fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
    (mean, variance.sqrt())
}

/// Power in each hertz of a second of sound.
fn spectrum(signal: &[f64]) -> Vec<f64> {
    let forward = realfft::RealFftPlanner::<f64>::new().plan_fft_forward(signal.len());
    let (mut input, mut output) = (signal.to_vec(), forward.make_output_vec());
    forward.process(&mut input, &mut output).unwrap();
    output.iter().map(|bin| bin.norm_sqr() * (2.0 / signal.len() as f64).powi(2)).collect()
}

#[test]
fn a_siren_follows_its_closed_form() {
    let procedure = shipped("siren.rhai", &[("level", 1.0), ("rate", 0.7)]);
    let siren = Play { seconds: 6.0, ..Play::default() }.render(&procedure).unwrap();
    // Turns since the beginning: the integral of 700 + 250 sin(2π 0.7 t).
    let turns = |time: f64| 700.0 * time + 250.0 * (1.0 - (TAU * 0.7 * time).cos()) / (TAU * 0.7);
    let rises = rises(&siren);
    let (mut most_off, mut most_late) = (0.0_f64, 0.0_f64);
    for (count, pair) in rises.windows(8).enumerate() {
        let (from, to) = (pair[0] / RATE_HZ, pair[7] / RATE_HZ);
        let expected = (turns(to) - turns(from)) / (to - from);
        most_off = most_off.max((7.0 / (to - from) / expected - 1.0).abs());
        most_late = most_late.max((turns(from) - (count as f64 + 1.0)).abs());
    }
    println!("siren: pitch off by {most_off:.1e}, phase by {most_late:.1e} of a period within 6 s");
    assert!(most_off < 1e-3 && most_late < 0.01, "{most_off} {most_late}");
}

#[test]
fn a_control_moves_a_siren_while_it_sounds() {
    let procedure = shipped("siren.rhai", &[("swing", 0.0), ("level", 1.0)]);
    let controls = |name: &str, time: f64| (name == "pitch").then_some(500.0 + 100.0 * time);
    let siren = Play { seconds: 2.0, controls: &controls, ..Play::default() }.render(&procedure).unwrap();
    let turns = |time: f64| 500.0 * time + 50.0 * time * time;
    for (count, rise) in rises(&siren).into_iter().enumerate() {
        assert!((turns(rise / RATE_HZ) - (count as f64 + 1.0)).abs() < 1e-3, "{count} {rise}");
    }
}

#[test]
fn bees_have_the_pitch_and_spread_that_they_are_given() {
    // The periods themselves, of a pure tone.
    let tone = script("let bee = sine(220.0); bee.jitter = 0.03; play(bee);", 60.0);
    let periods: Vec<f64> = rises(&tone).windows(2).map(|pair| (pair[1] - pair[0]) / RATE_HZ).collect();
    let (mean, deviation) = mean_and_deviation(&periods);
    println!("jitter: mean {:.4} of a period, deviation {:.4}", mean * 220.0, deviation * 220.0);
    assert!((mean * 220.0 - 1.0).abs() < 1e-3 && (deviation * 220.0 - 0.03).abs() < 0.001);

    // The drift of the shipped bee, with its harmonics filtered away.
    for (speed, expected) in [(0.0, 220.0), (10.0, 220.0 * 1.3)] {
        let given = [("jitter", 0.0), ("drift", 0.05), ("drift_time", 0.3), ("speed", speed)];
        let play = Play { rate_hz: 8000.0, seconds: 240.0, ..Play::default() };
        let bee = play.render(&shipped("bees.rhai", &given)).unwrap();
        let mut low = bee;
        for _ in 0..4 {
            let mut state = 0.0;
            low.iter_mut().for_each(|sample| {
                state += (*sample - state) * (TAU * 60.0 / play.rate_hz);
                *sample = state;
            });
        }
        let pitches: Vec<f64> =
            rises(&low[4800..]).windows(2).map(|pair| play.rate_hz / (pair[1] - pair[0])).collect();
        let (mean, deviation) = mean_and_deviation(&pitches);
        println!("bee at {speed} m/s: {mean:.1} Hz, deviation {:.4}", deviation / mean);
        assert!((mean / expected - 1.0).abs() < 0.01, "{mean}");
        assert!((deviation / mean - 0.05).abs() < 0.006, "{}", deviation / mean);
    }
}

#[test]
fn oscillators_do_not_alias() {
    for (name, amplitude) in [
        ("saw", (|n| 2.0 / (PI * n)) as fn(f64) -> f64),
        ("square", |n| (n % 2.0) * 4.0 / (PI * n)),
        ("triangle", |n| (n % 2.0) * 8.0 / (PI * n).powi(2)),
    ] {
        for frequency in [437_usize, 1237, 5011, 9973] {
            let power = spectrum(&script(&format!("play({name}({frequency}.0));"), 1.0));
            let (mut aliases, mut most_off) = (0.0, 0.0_f64);
            for (hz, &power) in power.iter().enumerate().skip(1) {
                if hz % frequency != 0 {
                    aliases += power;
                } else if (hz as f64) < 24_000.0 * 0.62 {
                    let expected = amplitude((hz / frequency) as f64);
                    if expected > 0.0 {
                        most_off = most_off.max((10.0 * power.log10() - 20.0 * expected.log10()).abs());
                    }
                }
            }
            let aliases = 10.0 * (aliases / power[frequency]).log10();
            println!("{name} {frequency} Hz: aliases {aliases:.0} dB, harmonics within {most_off:.4} dB");
            assert!(aliases < -85.0 && most_off < 0.02, "{name} {frequency}: {aliases} {most_off}");
        }
    }
}

#[test]
fn pink_noise_falls_by_ten_decibels_a_decade() {
    for rate_hz in [44_100.0, 48_000.0, 96_000.0] {
        let noise = Play { rate_hz, seconds: 40.0, ..Play::default() }.script("play(pink());");
        let rms = mean_and_deviation(&noise).1;
        assert!((rms * 3.0_f64.sqrt() - 1.0).abs() < 0.05, "{rms}");
        let second = rate_hz as usize;
        let mut power = vec![0.0; second / 2];
        for part in noise.chunks_exact(second) {
            power.iter_mut().zip(spectrum(part)).for_each(|(sum, power)| *sum += power);
        }
        let octave = |hz: usize| power[hz..2 * hz].iter().sum::<f64>();
        let octaves: Vec<f64> = (0..9).map(|n| 10.0 * octave(31 << n).log10()).collect();
        let mean = octaves.iter().sum::<f64>() / 9.0;
        println!("pink noise at {rate_hz}: octaves {octaves:.2?}");
        assert!(octaves.iter().all(|level| (level - mean).abs() < 0.8), "{octaves:?}");
    }
}

#[derive(serde::Deserialize)]
struct Filter {
    shape: String,
    cutoff_hz: f64,
    q: Option<f64>,
    response: Vec<f64>,
}

#[test]
fn filters_are_those_of_scipy() {
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/procedure_filters.json");
    let filters: Vec<Filter> = serde_json::from_str(&std::fs::read_to_string(fixture).unwrap()).unwrap();
    assert_eq!(filters.len(), 18);
    for Filter { shape, cutoff_hz, q, response } in filters {
        let q = q.map_or(String::new(), |q| format!(", {q:?}"));
        let source = format!("let p = pulse(); p.hit(1.0); play({shape}(p, {cutoff_hz:?}{q}));");
        // A blow of no contact at sample 0 is a single sample, the one behind it.
        let found = script(&source, 0.002);
        for (index, expected) in response.iter().enumerate() {
            assert!(
                (found[index + 1] - expected).abs() < 1e-6,
                "{source} {index}: {} {expected}",
                found[index + 1]
            );
        }
    }
}

#[test]
fn resonators_decays_envelopes_and_lines_are_their_closed_forms() {
    let ring = script("let p = pulse(); p.hit(1.0); play(resonator(p, 440.0, 0.3));", 0.5);
    let decay = Play { strikes: &[strike(0.010_003, 0.0)], ..Play::default() }
        .script("let d = decay(0.2); play(d); fn strike(i, p, c) { d.hit(2.0 * i); }");
    let line = script(
        "let l = line(1.0); play(l); l.to(3.0, 0.1); fn control() { if time > 0.2 && time < 0.2021 { l.to(0.0, 0.05); } }",
        0.4,
    );
    let envelope = script(
        "let e = envelope(0.01, 0.1, 0.5, 0.2); play(e); e.on(0.8);
         fn control() { if time > 0.3 && time < 0.3021 { e.off(); } }",
        0.6,
    );
    for index in 0..9600 {
        let time = index as f64 / RATE_HZ;
        let since = time - 1.0 / RATE_HZ;
        let expected =
            if index == 0 { 0.0 } else { 0.001_f64.powf(since / 0.3) * (TAU * 440.0 * since).sin() };
        assert!((ring[index] - expected).abs() < 1e-5, "ring {index}: {} {expected}", ring[index]);
        let since = time - 0.010_003;
        let expected = if since < 0.0 { 0.0 } else { 2.0 * 0.001_f64.powf(since / 0.2) };
        assert!((decay[index] - expected).abs() < 1e-5, "decay {index}: {} {expected}", decay[index]);
        let expected = 1.0 + 2.0 * (time / 0.1).min(1.0);
        assert!((line[index] - expected).abs() < 1e-5, "line {index}: {} {expected}", line[index]);
        let expected =
            if time <= 0.01 { 80.0 * time } else { 0.4 + 0.4 * 0.001_f64.powf((time - 0.01) / 0.1) };
        assert!(
            (envelope[index] - expected).abs() < 0.003,
            "envelope {index}: {} {expected}",
            envelope[index]
        );
    }
    assert!(line[13_000].abs() < 1e-6 && (line[10_800] - 3.0 * (1.0 - 0.023 / 0.05)).abs() < 1e-3);
    assert!((envelope[14_400 - 200] - 0.4).abs() < 1e-3 && envelope[14_496 + 9600] < 0.41e-3);
}

#[test]
fn blows_sum_to_their_amount_and_last_as_long_as_they_touch() {
    for (contact_s, at) in [(0.0, 0.01), (0.0, 0.010_007), (1e-3, 0.0101), (0.01, 0.012_345)] {
        let source = "let p = pulse(); play(p); fn strike(i, place, c) { p.hit(3.0 * i, c); }";
        let blow = Play { seconds: 0.1, strikes: &[strike(at, contact_s)], ..Play::default() }.script(source);
        let sum: f64 = blow.iter().sum();
        assert!((sum - 3.0).abs() < 1e-3, "{contact_s} {at}: {sum}");
        let touched = blow.iter().filter(|&&sample| sample != 0.0).count() as f64;
        assert!((touched - (contact_s * RATE_HZ).max(2.0)).abs() <= 1.0, "{contact_s}: {touched}");
        let middle = blow.iter().enumerate().map(|(index, sample)| index as f64 * sample).sum::<f64>() / sum;
        let expected = at * RATE_HZ + 0.5 * (contact_s * RATE_HZ).max(2.0);
        assert!((middle - expected).abs() < 1e-3, "{contact_s} {at}: {middle} {expected}");
    }
}

#[test]
fn a_delay_says_the_same_later() {
    let late = script("play(delay(sine(1000.0), 0.0101234));", 0.1);
    let again =
        script("let p = pulse(); p.hit(1.0); let d = delay(p, 0.01); d.feedback = -0.5; play(d);", 0.05);
    for (index, late) in late.iter().enumerate().take(4800).skip(600) {
        let expected = (TAU * 1000.0 * (index as f64 / RATE_HZ - 0.010_123_4)).sin();
        assert!((late - expected).abs() < 1e-4, "{index}: {late} {expected}");
    }
    for (index, &sample) in again.iter().enumerate() {
        let expected =
            if index % 480 == 1 && index > 1 { (-0.5_f64).powi(index as i32 / 480 - 1) } else { 0.0 };
        assert!((sample - expected).abs() < 1e-6, "{index}: {sample} {expected}");
    }
}

#[test]
fn what_a_script_moves_does_not_click() {
    let steepest = |sound: &[f64]| sound.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    // To and fro between 0 and 1 in every stretch of 96 samples.
    let level = script("let v = value(0.0); play(v); fn control() { v.value = 1.0 - v.value; }", 0.2);
    assert!((steepest(&level) - 1.0 / 96.0).abs() < 1e-6, "{}", steepest(&level));
    let pitch =
        script("let t = sine(100.0); play(t); fn control() { t.frequency = random(100.0, 4000.0); }", 1.0);
    assert!(steepest(&pitch) <= TAU * 4000.0 / RATE_HZ * 1.001, "{}", steepest(&pitch));
    // A wave whose harmonics come and go as it sweeps over six octaves.
    let sweep = "let t = wave([1.0, 0.5, 0.25, 0.125], 50.0); play(t);
                 fn control() { t.frequency = 60.0 * pow(2.0, 3.0 + 3.0 * sin(20.0 * time)); }";
    assert!(steepest(&script(sweep, 2.0)) <= 4.0 * TAU * 3840.0 / RATE_HZ);
    // What is still under a filter, stays so, however it moves.
    let filter = "let v = value(1.0); let f = lowpass(v, 5000.0, 5.0); play(f);
                  fn control() { if time > 0.1 { f.cutoff = random(50.0, 20000.0); f.q = random(0.5, 50.0); } }";
    assert!(script(filter, 1.0)[4800..].iter().all(|sample| (sample - 1.0).abs() < 1e-6));
    let resonator = "let r = resonator(sine(300.0) * 0.001, 500.0, 0.1); play(r);
                     fn control() { r.frequency = random(400.0, 600.0); r.decay = random(0.05, 0.2); }";
    let sound = script(resonator, 2.0);
    let most = sound.iter().fold(0.0_f64, |most, sample| most.max(sample.abs()));
    assert!(steepest(&sound) < most * TAU * 700.0 / RATE_HZ, "{} {most}", steepest(&sound));
}

#[test]
fn calls_come_in_the_order_of_their_times() {
    let source = "param(\"x\", 0.0); let told = -1.0; let seen = 0.0;
        fn strike(impulse, place, contact) { told = time; seen = x; }
        fn control() { told += 10.0; }
        fn sample() { told }";
    let controls = |_: &str, time: f64| Some(time);
    let strikes = [strike(100.5 / RATE_HZ, 0.0), strike(150.0 / RATE_HZ, 0.0)];
    let play = Play { seconds: 0.006, strikes: &strikes, controls: &controls, ..Play::default() };
    let sound = play.script(source);
    let at = |sample: f64| sample / RATE_HZ;
    for (index, expected) in
        [(0, 9.0), (95, 9.0), (96, 19.0), (100, 19.0), (101, at(100.5)), (149, at(100.5)), (150, at(150.0))]
    {
        assert!((sound[index] - expected).abs() < 1e-6, "{index}: {} {expected}", sound[index]);
    }
    assert!((sound[192] - at(150.0) - 10.0).abs() < 1e-6);
    let sound = play.script(&source.replace("{ told }", "{ seen }"));
    assert!((sound[101] - at(100.5)).abs() < 1e-9 && (sound[150] - at(150.0)).abs() < 1e-9);
    // A sample sees the control of its own moment.
    let sound = play.script("param(\"x\", 0.0); fn sample() { x }");
    assert!(sound.iter().enumerate().all(|(index, sample)| (sample - at(index as f64)).abs() < 1e-9));
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_thread() {
    for name in ["siren.rhai", "bees.rhai", "geiger.rhai", "plucked.rhai", "bell.rhai"] {
        let procedure = shipped(name, &[]);
        let play = |seed: u64| {
            let strikes = [strike(0.01, 0.001), strike(0.1, 0.0)];
            let random = Random::new(seed, 3);
            Play { seconds: 0.3, random, strikes: &strikes, ..Play::default() }.render(&procedure).unwrap()
        };
        let here = play(5);
        let elsewhere: Vec<Vec<f64>> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..3).map(|_| scope.spawn(|| play(5))).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert!(elsewhere.iter().all(|there| *there == here), "{name}");
        let random = ["bees.rhai", "geiger.rhai", "plucked.rhai"].contains(&name);
        assert_eq!(play(6) != here, random, "{name}");
    }
}

#[test]
fn a_string_and_a_bell_have_their_pitch() {
    for (name, pitch, harmonics) in [("plucked.rhai", 196.0, 6), ("bell.rhai", 440.0, 2)] {
        let strikes = [strike(0.0, 0.0)];
        let play = Play { seconds: 1.0, strikes: &strikes, ..Play::default() };
        let sound = play.render(&shipped(name, &[("pitch", pitch)])).unwrap();
        let power = spectrum(&sound[..48_000]);
        for harmonic in 1..=harmonics {
            let expected = pitch * f64::from(harmonic);
            let around = (expected * 0.95) as usize..(expected * 1.05) as usize;
            let peak = around.clone().max_by(|&a, &b| power[a].total_cmp(&power[b])).unwrap();
            // Its buffer is a whole number of samples long.
            assert!((peak as f64 / expected - 1.0).abs() < 0.005, "{name} {harmonic}: {peak} {expected}");
        }
    }
}

#[test]
fn every_example_of_the_reference_runs() {
    let reference = include_str!("../../../docs/procedures.md");
    let examples: Vec<&str> =
        reference.split("```rhai\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    assert_eq!(examples.len(), 3);
    for example in examples {
        let strikes = [strike(0.0, 0.0005)];
        let sound = Play { seconds: 0.2, strikes: &strikes, ..Play::default() }.script(example);
        let most = sound.iter().fold(0.0_f64, |most, sample| most.max(sample.abs()));
        assert!((0.01..2.0).contains(&most), "{most}: {example}");
    }
}

#[test]
fn the_swarm_of_the_reference_flies() {
    let reference = include_str!("../../../docs/procedures.md");
    let script = reference.split("```rhai-swarm\n").nth(1).unwrap().split("```").next().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("fireflies.rhai");
    std::fs::write(&file, script).unwrap();
    let flight = froufrou::synth::procedure::Flight::open(&file, Random::new(1, 2)).unwrap();
    for member in 0..5 {
        // A circle at one height, at an even pace.
        let at = |time| flight.position_m(member, time).unwrap();
        let radius = |p: [f64; 3]| p[0].hypot(p[2]);
        let angle = |p: [f64; 3], q: [f64; 3]| (p[0] * q[2] - p[2] * q[0]).atan2(p[0] * q[0] + p[2] * q[2]);
        let (a, b, c) = (at(0.0), at(0.5), at(1.0));
        assert!((radius(a) - radius(b)).abs() < 1e-9 && (0.5..1.5).contains(&radius(a)));
        assert!(a[1] == b[1] && (angle(a, b) - angle(b, c)).abs() < 1e-9);
        assert!((0.5..1.0).contains(&angle(a, b)), "{}", angle(a, b));
    }
}

#[test]
fn all_rates_and_wrong_ones() {
    let procedure = shipped("bees.rhai", &[]);
    for rate_hz in [8000.0, 44_100.0, 192_000.0] {
        Play { rate_hz, seconds: 0.05, ..Play::default() }.render(&procedure).unwrap();
    }
    for rate_hz in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
        assert!(procedure.generator(rate_hz, Random::new(1, 1)).is_err(), "{rate_hz}");
    }
}
