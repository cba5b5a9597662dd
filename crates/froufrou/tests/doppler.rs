//! Doppler is nowhere modelled: it follows from delays that change. Here the pitch that comes out of
//! the whole chain is compared with the closed form at every sample.
//!
//! Two recordings ride along one path, a cosine and a sine. What arrives of them is the real and the
//! imaginary part of one complex tone, whose phase gives the frequency from sample to sample without
//! any filter in between.

mod studio;

use std::f64::consts::TAU;
use std::fmt::Write;

use studio::{Sound, Studio, Take, tone};

const TONE_HZ: f64 = 1000.0;
const SPEED_OF_SOUND_MPS: f64 = 343.0;
const RATE_HZ: u32 = 48_000;

type Vector = [f64; 3];

/// Something that moves: place and velocity at a time.
type Motion<'a> = &'a dyn Fn(f64) -> (Vector, Vector);

fn minus(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: Vector, b: Vector) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

/// What leaves the source at a time t arrives at a, where |s(t) − m(a)| = c (a − t). From its
/// derivative by a, with the unit vector u from the microphone to the source,
///
/// ```text
/// dt/da = (1 + u · m' / c) / (1 + u · s' / c)
/// ```
///
/// which is f' / f.
fn heard(source: Motion, microphone: Motion, arrival_s: f64) -> f64 {
    let (place, velocity) = microphone(arrival_s);
    // c (a − t) − |s(t) − m(a)| falls with t for whatever is slower than sound.
    let (mut early, mut late) = (arrival_s - 10.0, arrival_s);
    for _ in 0..100 {
        let middle = 0.5 * (early + late);
        let apart = minus(source(middle).0, place);
        let ahead = SPEED_OF_SOUND_MPS * (arrival_s - middle) > dot(apart, apart).sqrt();
        if ahead { early = middle } else { late = middle }
    }
    let (there, source_velocity) = source(early);
    let apart = minus(there, place);
    let towards = apart.map(|c| c / dot(apart, apart).sqrt());
    (1.0 + dot(towards, velocity) / SPEED_OF_SOUND_MPS)
        / (1.0 + dot(towards, source_velocity) / SPEED_OF_SOUND_MPS)
}

fn studio() -> Studio {
    let studio = Studio::new();
    for (name, phase) in [("cosine.wav", 0.25), ("sine.wav", 0.0)] {
        studio.recording(name, RATE_HZ, &tone(RATE_HZ, TONE_HZ, RATE_HZ as usize, phase));
    }
    studio
}

/// The frequency at every sample at which the tone sounds, with its time, from the phase between the
/// samples before and after.
fn frequencies(sound: &Sound) -> Vec<(f64, f64)> {
    let (real, imaginary) = (sound.stem("cosine"), sound.stem("sine"));
    let loudest = real.iter().fold(0.0f32, |a, b| a.max(b.abs()));
    let sample = |n: usize| (f64::from(real[n]), f64::from(imaginary[n]));
    let mut found = Vec::new();
    for n in 1..real.len().saturating_sub(1) {
        let ((a, b), (c, d)) = (sample(n - 1), sample(n + 1));
        // Only the very ends, which fade from and to nothing, are too faint for a phase.
        if a.hypot(b).min(c.hypot(d)) > 1e-4 * f64::from(loudest) {
            let turn = (d * a - c * b).atan2(c * a + d * b) / TAU;
            found.push((n as f64 / sound.rate_hz, turn / 2.0 * sound.rate_hz));
        }
    }
    found
}

/// The greatest deviation from the closed form, relative, over all samples.
fn worst_error(found: &[(f64, f64)], source: Motion, microphone: Motion) -> f64 {
    let error = |&(time_s, found_hz): &(f64, f64)| {
        (found_hz / (TONE_HZ * heard(source, microphone, time_s)) - 1.0).abs()
    };
    found.iter().map(error).fold(0.0, f64::max)
}

fn check(what: &str, sound: &Sound, seconds: f64, source: Motion, microphone: Motion) {
    let found = frequencies(sound);
    assert!(found.len() as f64 > 0.98 * seconds * sound.rate_hz, "{what}: {} samples", found.len());
    let worst = worst_error(&found, source, microphone);
    println!("{what}: within {:.5} %", 100.0 * worst);
    assert!(worst < 0.001, "{what}: {:.4} % off the closed form", 100.0 * worst);
}

/// A scene in which a source passes at a constant speed, as a track of two keys.
fn pass(speed_mps: f64, distance_m: f64, half_way_s: f64, frame_rate_hz: f64) -> String {
    let reach_m = speed_mps * half_way_s;
    let sound = |part: &str| {
        format!(
            "sound = {{ recording = '{part}.wav', loop = 'exact', from = 0.25, to = {} }}\n",
            2.0 * half_way_s - 0.25
        )
    };
    let track = format!(
        "track = [{{ t = 0, position = [{}, 0, {distance_m}] }}, {{ t = {}, position = [{reach_m}, 0, {distance_m}] }}]\ninterpolation = 'linear'\n",
        -reach_m,
        2.0 * half_way_s
    );
    let mut scene = format!("frame_rate = {frame_rate_hz}\n[listener]\nlayout = 'mono'\n");
    for part in ["cosine", "sine"] {
        write!(scene, "[[object]]\nname = '{part}'\n{track}{}", sound(part)).unwrap();
    }
    scene
}

const STILL: &dyn Fn(f64) -> (Vector, Vector) = &|_| ([0.0; 3], [0.0; 3]);

#[test]
fn a_straight_pass_has_the_pitch_of_the_closed_form_at_every_sample() {
    let studio = studio();
    for frame_rate_hz in [24.0, 60.0] {
        for (speed_mps, distance_m, half_way_s) in [
            (100.0 / 3.6, 12.0, 3.0),
            (30.0, 1.0, 1.5),
            (5.0, 0.5, 1.5),
            (60.0, 4.0, 1.5),
            (100.0, 20.0, 1.0),
            (1.0, 3.0, 1.5),
        ] {
            let scene = pass(speed_mps, distance_m, half_way_s, frame_rate_hz);
            let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap();
            let source = |t: f64| ([speed_mps * (t - half_way_s), 0.0, distance_m], [speed_mps, 0.0, 0.0]);
            let what = format!("{speed_mps:.2} m/s at {distance_m} m, {frame_rate_hz} fps");
            let seconds = 2.0 * half_way_s - 0.5;
            check(&what, &sound, seconds * (1.0 - 0.5 * speed_mps / SPEED_OF_SOUND_MPS), &source, STILL);
        }
    }
}

/// A score in which a source and a microphone move, with a key every frame.
fn moving(frame_rate_hz: f64, seconds: f64, source: Motion, microphone: Motion) -> String {
    let mut lines: Vec<(f64, u8, String)> = Vec::new();
    // The microphone moves on while the last sound is under way.
    for frame in 0..=((seconds + 1.0) * frame_rate_hz) as u32 {
        let time_s = f64::from(frame) / frame_rate_hz;
        let [x, y, z] = microphone(time_s).0;
        lines.push((time_s, 0, format!("hear main {time_s} at {x} {y} {z}")));
        if time_s <= seconds {
            let [x, y, z] = source(time_s).0;
            for (thread, part) in [(1, "cosine"), (2, "sine")] {
                let line = match frame {
                    0 => format!("start {thread} {time_s} {part} at {x} {y} {z} object {part}"),
                    _ if time_s + 1.0 / frame_rate_hz > seconds => {
                        format!("end {thread} {time_s} at {x} {y} {z}")
                    }
                    _ => format!("key {thread} {time_s} at {x} {y} {z}"),
                };
                lines.push((time_s, thread, line));
            }
        }
    }
    lines.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut score = "froufrou-score 1 object\norder time\nmicrophone main\n\
                     sound cosine \"cosine.wav\" loop exact\nsound sine \"sine.wav\" loop exact\n"
        .to_string();
    lines.iter().for_each(|(_, _, line)| writeln!(score, "{line}").unwrap());
    score
}

#[test]
fn circles_and_moving_microphones_have_the_pitch_of_the_closed_form_at_every_sample() {
    let studio = studio();
    let circle = |radius_m: f64, turn_s: f64| {
        move |t: f64| {
            let (sine, cosine) = (TAU * t / turn_s).sin_cos();
            let speed_mps = TAU * radius_m / turn_s;
            ([radius_m * cosine, 1.0, radius_m * sine], [-speed_mps * sine, 0.0, speed_mps * cosine])
        }
    };
    let line = |speed_mps: f64, distance_m: f64| {
        move |t: f64| ([speed_mps * (t - 1.0), 0.0, distance_m], [speed_mps, 0.0, 0.0])
    };
    let stands = |place: Vector| move |_: f64| (place, [0.0; 3]);
    let pairs: [(&str, Motion, Motion); 6] = [
        ("a circle about the microphone", &circle(5.0, 2.0), STILL),
        ("a circle beside the microphone", &circle(5.0, 4.0), &stands([8.0, 0.0, 0.0])),
        ("a microphone that drives by", &stands([0.0, 1.0, 3.0]), &line(25.0, 0.0)),
        ("a microphone that circles", &stands([3.0, 0.0, 0.0]), &circle(10.0, 5.0)),
        ("two that meet", &line(20.0, 6.0), &line(-15.0, 0.0)),
        ("two that go together", &line(25.0, 6.0), &line(25.0, 0.0)),
    ];
    for (what, source, microphone) in pairs {
        for frame_rate_hz in [24.0, 60.0] {
            let score = moving(frame_rate_hz, 2.0, source, microphone);
            let sound = studio.score(&score, Take::at(RATE_HZ)).unwrap();
            check(&format!("{what}, {frame_rate_hz} fps"), &sound, 1.7, source, microphone);
        }
    }
}

#[test]
fn two_that_go_together_keep_their_pitch() {
    // The closed form says so too; this does not rest on it.
    let studio = studio();
    let beside = |z: f64| move |t: f64| ([25.0 * t, 0.0, z], [25.0, 0.0, 0.0]);
    let score = moving(24.0, 1.0, &beside(6.0), &beside(0.0));
    let sound = studio.score(&score, Take::at(RATE_HZ)).unwrap();
    let worst = frequencies(&sound).iter().map(|(_, hz)| (hz / TONE_HZ - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-4, "{worst}");
}

/// The ambulance of Takala & Hahn (1992): at 100 km/h its pitch swings by about ±1.5 semitones,
/// measured where it is five times as far as when it passes.
#[test]
fn the_ambulance_swings_by_a_semitone_and_a_half_to_either_side() {
    let (speed_mps, distance_m) = (100.0 / 3.6, 12.0);
    let studio = studio();
    let sound = studio.scene(&pass(speed_mps, distance_m, 3.0, 60.0), Take::at(RATE_HZ)).unwrap();
    let found = frequencies(&sound);
    // Five times as far: √(5² − 1²) distances to either side, heard 5 distances / c later.
    let away_s = 24f64.sqrt() * distance_m / speed_mps;
    let delay_s = 5.0 * distance_m / SPEED_OF_SOUND_MPS;
    let at = |time_s: f64| found.iter().find(|(t, _)| *t >= time_s).unwrap().1;
    let (before, after) = (at(3.0 - away_s + delay_s), at(3.0 + away_s + delay_s));
    let semitones = |hz: f64| 12.0 * (hz / TONE_HZ).log2();
    println!("+{:.3} and {:.3} semitones", semitones(before), semitones(after));
    let swing = (semitones(before) - semitones(after)) / 2.0;
    assert!((swing - 1.5).abs() < 0.15, "±{swing}");
    // By closed form: 12 log2((1 + β) / (1 − β)) / 2, β = v cos / c.
    let beta = speed_mps * (24f64.sqrt() / 5.0) / SPEED_OF_SOUND_MPS;
    let closed = 6.0 * ((1.0 + beta) / (1.0 - beta)).log2();
    assert!((swing - closed).abs() < 0.001, "±{swing} instead of ±{closed}");
    // And it is five times as loud as it passes.
    let level = |time_s: f64| {
        let n = (time_s * sound.rate_hz) as usize;
        f64::from(sound.stem("cosine")[n]).hypot(f64::from(sound.stem("sine")[n]))
    };
    let ratio = level(3.0 + distance_m / SPEED_OF_SOUND_MPS) / level(3.0 - away_s + delay_s);
    assert!((ratio - 5.0).abs() < 0.01, "{ratio}");
}
