//! Whole scenes heard by heads, sound fields and loudspeakers: what arrives is what theory says, nothing clicks,
//! and no sample depends on how it was rendered.

mod studio;

use std::f64::consts::TAU;

use froufrou::scene::listener::Layout;
use froufrou::space::ambisonic;
use froufrou::space::head::Head;
use studio::{Studio, Take};

const RATE_HZ: u32 = 48_000;

const BINAURAL: &str = "layout = 'binaural'";
const SHARED: &str = "layout = 'binaural'\nshared = true";

/// Everything that a listener may be.
fn layouts() -> impl Iterator<Item = String> {
    Layout::names().map(|name| format!("layout = '{name}'")).chain([SHARED.to_owned()])
}

/// A source that stands still, as a scene; the recording is `hit.wav`.
fn still(layout: &str, [x, y, z]: [f64; 3]) -> String {
    format!(
        "duration = 0.3\n[listener]\n{layout}\n\
         [[sound]]\nposition = [{x}, {y}, {z}]\nrecording = 'hit.wav'\nat = [0.1]\n"
    )
}

#[test]
fn a_hit_arrives_at_the_ears_by_the_filters_of_the_head() {
    let studio = Studio::new();
    let mut hit = vec![0.0; 64];
    hit[0] = 0.5;
    studio.recording("hit.wav", RATE_HZ, &hit);
    let rate_hz = f64::from(RATE_HZ);
    let head = Head::spherical(rate_hz);
    for from_m in [[0.0, 0.0, -3.43], [3.43, 0.0, 0.0], [-2.0, 1.0, 1.5], [0.3, -0.2, -0.1]] {
        let sound = studio.scene(&still(BINAURAL, from_m), Take::at(RATE_HZ)).unwrap();
        let mut filters = [vec![0.0; head.taps()], vec![0.0; head.taps()]];
        let [left, right] = &mut filters;
        let ears = head.hear(from_m, [left, right]);
        let distance_m = from_m.iter().map(|c| c * c).sum::<f64>().sqrt();
        for (ear, filter) in filters.iter().enumerate() {
            let found = sound.channel(ear);
            let delay = (0.1 + distance_m / 343.0 + ears[ear].delay_s) * rate_hz - head.lead() as f64;
            // Compared as spectra, where the delay may be any fraction of a sample.
            for frequency_hz in [200.0, 1_000.0, 4_000.0, 10_000.0] {
                let step = TAU * frequency_hz / rate_hz;
                let at = |n: f64| (-step * n).sin_cos();
                let spectrum = |samples: &mut dyn Iterator<Item = (f64, f64)>| {
                    samples.fold((0.0, 0.0), |(re, im), (n, sample)| {
                        let (sine, cosine) = at(n);
                        (re + sample * cosine, im + sample * sine)
                    })
                };
                let heard = spectrum(&mut found.iter().enumerate().map(|(n, &s)| (n as f64, s)));
                let gain = 0.5 * ears[ear].gain / distance_m;
                let expected = spectrum(
                    &mut filter.iter().enumerate().map(|(n, &tap)| (n as f64 + delay, gain * f64::from(tap))),
                );
                let error = (heard.0 - expected.0).hypot(heard.1 - expected.1);
                assert!(
                    error < 1e-3 * expected.0.hypot(expected.1),
                    "{from_m:?} ear {ear} at {frequency_hz} Hz: {heard:?} {expected:?}"
                );
            }
        }
    }
}

#[test]
fn sound_fields_and_loudspeakers_have_the_gains_of_theory() {
    let studio = Studio::new();
    let hum: Vec<f32> =
        (0..RATE_HZ).map(|n| (TAU * 500.0 * f64::from(n) / f64::from(RATE_HZ)).sin() as f32).collect();
    studio.recording("hit.wav", RATE_HZ, &hum);
    let from_m = [1.0, 0.5, -2.0];
    let distance_m = 5.25f64.sqrt();
    let levels = |layout: &str| {
        let sound = studio.scene(&still(layout, from_m), Take::at(RATE_HZ)).unwrap();
        let begin = (0.15 * f64::from(RATE_HZ)) as usize;
        let mono = studio.scene(&still("layout = 'mono'", from_m), Take::at(RATE_HZ)).unwrap().channel(0);
        let along = |samples: &[f64]| -> f64 {
            let product: f64 = samples[begin..].iter().zip(&mono[begin..]).map(|(a, b)| a * b).sum();
            product / mono[begin..].iter().map(|b| b * b).sum::<f64>()
        };
        (0..sound.channels).map(|channel| along(&sound.channel(channel))).collect::<Vec<f64>>()
    };
    let mut expected = [0.0; 16];
    ambisonic::encode(from_m, &mut expected);
    for (found, expected) in levels("layout = 'ambisonic-3'").iter().zip(expected) {
        assert!((found - expected).abs() < 1e-5, "{found} {expected}");
    }
    let gains = levels("layout = '7.1.4'");
    assert!((gains.iter().map(|g| g * g).sum::<f64>() - 1.0).abs() < 1e-5, "{gains:?}");
    assert_eq!(gains[3], 0.0, "nothing goes to the loudspeaker for low effects");
    // Center, right and the top front: the nearest play, and those behind do not.
    assert!(gains[1] > 0.5 && gains[4..8].iter().all(|gain| gain.abs() < 1e-9), "{gains:?} {distance_m}");
}

#[test]
fn nothing_clicks_when_sources_pass_and_heads_turn() {
    let studio = Studio::new();
    studio.tone("tone.wav");
    // A source passes 2 m before the listener at 10 m/s; then one stands while the head turns at 360° a second.
    let passing = "[[object]]\nname = 'source'\ntrack = [{ t = 0, position = [-10, 0.3, -2] }, { t = 2, position = [10, 0.3, -2] }]\ninterpolation = 'linear'\n\
                   sound = { recording = 'tone.wav', loop = true }\n";
    let around: Vec<String> = (0..=48)
        .map(|n| f64::from(n) / 24.0)
        .map(|t| {
            format!(
                "{{ t = {t}, position = [0, 0, 0], facing = [{}, 0, {}] }}",
                (TAU * t).sin(),
                -(TAU * t).cos()
            )
        })
        .collect();
    let turning = format!("track = [{}]\ninterpolation = 'linear'\n", around.join(", "));
    let standing =
        "[[sound]]\nposition = [1, 0.4, -1.5]\nrecording = 'tone.wav'\nloop = true\nfrom = 0\nto = 2\n";
    for layout in layouts() {
        for (name, scene) in [
            ("passing", format!("duration = 2\n[listener]\n{layout}\n{passing}")),
            ("turning", format!("duration = 2\n[listener]\n{layout}\n{turning}{standing}")),
        ] {
            let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap();
            let worst = sound.worst_splash_db();
            println!("{layout}, {name}: {worst:.1} dB");
            assert!(worst < -60.0, "{layout}, {name}: {worst:.1} dB");
        }
    }
}

#[test]
fn level_and_timing_do_not_depend_on_the_rate() {
    let studio = Studio::new();
    studio.band_limited_hit("hit.wav");
    for layout in layouts() {
        let facts = |rate_hz: u32| {
            let sound = studio.scene(&still(&layout, [1.2, 0.4, -0.9]), Take::at(rate_hz)).unwrap();
            (0..sound.channels).map(|channel| sound.energy_and_moment(channel)).collect::<Vec<_>>()
        };
        let usual = facts(48_000);
        let loudest = usual.iter().map(|fact| fact.0).fold(0.0, f64::max);
        for rate_hz in [44_100, 96_000, 192_000] {
            for ((energy, time_s), (usual_energy, usual_s)) in facts(rate_hz).into_iter().zip(&usual) {
                if *usual_energy < 1e-8 * loudest {
                    continue;
                }
                let level_db = 10.0 * (energy / usual_energy).log10();
                let samples = (time_s - usual_s) * f64::from(rate_hz);
                assert!(level_db.abs() < 0.1, "{layout} at {rate_hz} Hz: {level_db} dB");
                assert!(samples.abs() < 1.0, "{layout} at {rate_hz} Hz: {samples} samples");
            }
        }
    }
}

#[test]
fn a_range_alone_is_that_part_of_the_whole() {
    let studio = Studio::new();
    let noise = studio::noise(48_000, 7);
    studio.recording("noise.wav", RATE_HZ, &noise);
    let scene = |layout: &str| {
        format!(
            "duration = 1.5\n[listener]\n{layout}\ntrack = [{{ t = 0, position = [0, 0, 0], facing = [0, 0.2, -1] }}, \
             {{ t = 1.5, position = [1, 0, 0], facing = [1, 0, 0] }}]\n\
             [[object]]\nname = 'a'\ntrack = [{{ t = 0, position = [-3, 1, -2] }}, {{ t = 1.5, position = [3, -1, -2] }}]\n\
             sound = {{ recording = 'noise.wav', loop = true }}\n\
             [[sound]]\nposition = [0, 2, 1]\nrecording = 'noise.wav'\nat = [0.2, 0.7]\n"
        )
    };
    for layout in [BINAURAL, SHARED, "layout = 'ambisonic-2'", "layout = '7.1.4'"] {
        let whole = studio.scene(&scene(layout), Take { cores: 1, ..Take::at(RATE_HZ) }).unwrap();
        for (from_s, to_s) in [(0.0, 0.3), (0.31, 0.32), (0.69999, 1.2), (1.4, 1.5)] {
            let part =
                studio.scene(&scene(layout), Take { from_s, to_s: Some(to_s), ..Take::at(RATE_HZ) }).unwrap();
            let begin = (from_s * f64::from(RATE_HZ)).ceil() as usize * whole.channels;
            assert!(!part.mix.is_empty());
            assert!(part.mix[..] == whole.mix[begin..begin + part.mix.len()], "{layout} from {from_s} s");
        }
    }
}

#[test]
fn a_head_that_rolls_hears_what_is_above_at_its_side() {
    let studio = Studio::new();
    studio.recording("hit.wav", RATE_HZ, &[0.5; 32]);
    // Facing straight up, what is ahead of the feet (−Z) is below the chin; right stays +X.
    let score = |up: &str| {
        format!(
            "froufrou-score 1 object\nduration 0.3\nmicrophone m ambisonic 1 at 0 0 0 facing 0 0 -1 {up}\n\
             sound s \"hit.wav\"\nstart 1 0.05 s at 0 2 0\nend 1 0.06\n"
        )
    };
    let energies = |up: &str| -> Vec<f64> {
        let sound = studio.score(&score(up), Take::at(RATE_HZ)).unwrap();
        (0..4).map(|channel| sound.channel(channel).iter().map(|s| s * s).sum()).collect()
    };
    // W, Y (left), Z (up), X (ahead).
    let level = energies("");
    assert!(level[2] > 0.0 && level[1] == 0.0 && (level[2] / level[0] - 1.0).abs() < 1e-9, "{level:?}");
    let rolled = energies("up 1 0 0");
    assert!(rolled[1] > 0.0 && rolled[2] < 1e-20 && (rolled[1] / rolled[0] - 1.0).abs() < 1e-9, "{rolled:?}");
}

#[test]
fn a_sound_within_the_head_is_as_it_is_and_leaves_it_without_a_click() {
    let studio = Studio::new();
    let tone = studio.tone("tone.wav");
    for shared in ["", " shared"] {
        // All around it, both ears hear the recording itself.
        let score = format!(
            "froufrou-score 1 object\nduration 0.5\nmicrophone m binaural{shared} at 0 0 0\nsound s \"tone.wav\"\n\
                 start 1 0 s around m gain 0.5\nend 1 0.5\n"
        );
        let sound = studio.score(&score, Take::at(RATE_HZ)).unwrap();
        for ear in 0..2 {
            let found = sound.channel(ear);
            let same =
                found.iter().zip(&tone).take(20_000).all(|(a, b)| (a - 0.5 * f64::from(*b)).abs() < 1e-7);
            assert!(same, "ear {ear}{shared}");
        }
        // From the middle of the head to the right of it, through keys that lie in it exactly.
        let score = format!(
            "froufrou-score 1 object\nduration 2\nmicrophone m binaural{shared} at 0 0 0\nsound s \"tone.wav\" loop exact\n\
                 start 1 0 s at -1 0 0 gain 0.1\nkey 1 0.8 at 0 0 0\nkey 1 1 at 0 0 0\nkey 1 1.6 at 1 0.2 0\nend 1 2\n"
        );
        let sound = studio.score(&score, Take::at(RATE_HZ)).unwrap();
        for ear in 0..2 {
            let worst = sound.splash_db(ear);
            assert!(worst < -60.0, "ear {ear}{shared}: {worst:.1} dB");
        }
    }
}
