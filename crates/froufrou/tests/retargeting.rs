//! Contacts that sound like the grains of a corpus, from recordings and a scene all the way to samples.

mod studio;

use froufrou::corpus::dictionary::builder::{self, Options};
use froufrou::score::{Action, ObjectLine};
use studio::{Studio, Take};

const RATE_HZ: u32 = 44_100;

/// A studio with a corpus of six knocks of different strength and two scrapes, and a log in which a block is hit at 0.3 s
/// and four times as softly at 0.7 s, slides from 1 to 2 s, and rests until 3 s.
fn workshop() -> Studio {
    let studio = Studio::new();
    let rate_hz = f64::from(RATE_HZ);
    std::fs::create_dir_all(studio.path("recordings/hit")).unwrap();
    std::fs::create_dir_all(studio.path("recordings/slide")).unwrap();
    let noise = studio::noise(90_000, 3);
    for n in 0..6 {
        let loud = 0.6 * 10f64.powf(-f64::from(n) * 0.2);
        let knock: Vec<f32> = (0..30_000)
            .map(|i| {
                // A little silence before the onset.
                let age_s = f64::from(i - 2000) / rate_hz;
                if age_s < 0.0 {
                    return 0.0;
                }
                let ring = (std::f64::consts::TAU * (500.0 + 90.0 * f64::from(n)) * age_s).cos();
                (loud * ring * (-age_s * 25.0).exp()) as f32
            })
            .collect();
        studio.recording(&format!("recordings/hit/knock{n}.wav"), RATE_HZ, &knock);
    }
    for n in 0..2 {
        let scrape: Vec<f32> = (0..80_000)
            .map(|i| {
                let hum = (f64::from(i) * (0.09 + 0.02 * f64::from(n))).sin() as f32;
                0.2 * noise[i as usize + 5000 * n as usize] + 0.1 * hum
            })
            .collect();
        studio.recording(&format!("recordings/slide/scrape{n}.wav"), RATE_HZ, &scrape);
    }
    builder::build(
        &studio.path("recordings"),
        &studio.path("corpora/wood"),
        &Options::default(),
        &mut |_| {},
    )
    .unwrap();
    let mut log = String::from("t,a,b,x,y,z,fn,v\n");
    for step in 1..=3000 {
        let time_s = f64::from(step) * 0.001;
        let (force, speed) = match step {
            300 => (1000.0, 0.0),
            700 => (250.0, 0.0),
            1000..=1999 => (20.0, 0.5),
            2000.. => (20.0, 0.0),
            _ => continue,
        };
        log += &format!("{time_s:.3},block,table,0,0,0,{force},{speed}\n");
    }
    studio.file("contacts.csv", &log);
    studio
}

/// The scene of it, with more said of the grains.
fn scene(more: &str) -> String {
    format!(
        "seed = 4\nduration = 3\nspeed_of_sound = 343\n[[microphone]]\nname = 'm'\nposition = [0, 1, 0]\n\
         [material.wood]\ngrains = {{ corpus = 'corpora/wood'{more} }}\n\
         [[object]]\nname = 'block'\nmaterial = 'wood'\nposition = [0, 0, 0]\n\
         [[contacts]]\nlog = 'contacts.csv'\n\
         columns = {{ t = 't', a = 'a', b = 'b', position = ['x', 'y', 'z'], normal_force = 'fn', sliding_velocity = ['v'] }}\n"
    )
}

fn energy(sound: &[f64], from_s: f64, to_s: f64) -> f64 {
    let at = |time_s: f64| (time_s * f64::from(RATE_HZ)) as usize;
    sound[at(from_s)..at(to_s)].iter().map(|v| v * v).sum()
}

#[test]
fn impacts_slides_and_rest_sound_as_they_should() {
    let studio = workshop();
    let sound = studio.scene(&scene(""), Take::at(RATE_HZ)).unwrap();
    let left = sound.channel(0);
    let delay_s = 1.0 / 343.0;
    for at_s in [0.2995, 0.6995] {
        // The middle of its step, and the way through the air.
        let from = ((at_s + delay_s - 0.05) * f64::from(RATE_HZ)) as usize;
        let piece = &left[from..from + 6000];
        let peak = piece.iter().fold(0.0f64, |peak, v| peak.max(v.abs()));
        let onset = piece.iter().position(|v| v.abs() >= 0.1 * peak).unwrap() + from;
        let off_s = onset as f64 / f64::from(RATE_HZ) - at_s - delay_s;
        println!("onset off by {:.2} ms", off_s * 1e3);
        assert!(off_s.abs() < 0.001, "{off_s}");
    }
    let ratio_db = 10.0 * (energy(&left, 0.28, 0.6) / energy(&left, 0.68, 1.0)).log10();
    assert!((ratio_db - 12.04).abs() < 1.0, "a quarter of the impulse is 12 dB softer: {ratio_db} dB");
    // Sliding has no gap, at 10 watts and 0 dB it is as loud as was recorded, and rest is silent.
    let recorded = {
        let sound: Vec<f32> = hound::WavReader::open(studio.path("recordings/slide/scrape0.wav"))
            .unwrap()
            .samples::<f32>()
            .map(|v| v.unwrap())
            .collect();
        sound.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / sound.len() as f64
    };
    for piece in 0..88 {
        let from_s = 1.06 + 0.01 * f64::from(piece);
        let power = energy(&left, from_s, from_s + 0.01) / (0.01 * f64::from(RATE_HZ));
        let level_db = 10.0 * (power / recorded).log10();
        assert!(level_db.abs() < 6.0, "{from_s} s: {level_db} dB");
    }
    let level_db = 10.0 * (energy(&left, 1.1, 1.9) / (0.8 * f64::from(RATE_HZ)) / recorded).log10();
    println!("sliding: {level_db:.2} dB of the recording's power");
    assert!(level_db.abs() < 1.0, "{level_db}");
    assert_eq!(energy(&left, 2.1, 3.0), 0.0, "what rests is silent");
}

#[test]
fn ranges_threads_and_the_score_in_between_change_nothing() {
    let studio = workshop();
    let scene = scene("");
    let whole = studio.scene(&scene, Take { cores: 1, ..Take::at(RATE_HZ) }).unwrap();
    assert!(studio.scene(&scene, Take::at(RATE_HZ)).unwrap().mix == whole.mix, "two threads");
    let part = studio.scene(&scene, Take { from_s: 0.31, to_s: Some(1.5), ..Take::at(RATE_HZ) }).unwrap();
    let from = (0.31 * f64::from(RATE_HZ)).round() as usize;
    assert!(part.mix == whole.mix[from..from + part.mix.len()], "a range alone");
    // Another rate of the soundtrack sounds the same.
    let other = studio.scene(&scene, Take::at(48_000)).unwrap();
    let power = |mix: &[f32], rate_hz: f64| mix.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / rate_hz;
    let off_db = 10.0 * (power(&other.mix, 48_000.0) / power(&whole.mix, 44_100.0)).log10();
    assert!(off_db.abs() < 0.05, "{off_db} dB");
}

#[test]
fn no_impact_repeats_the_one_before_and_each_names_its_recording() {
    let studio = workshop();
    let mut log = String::from("t,a,b,x,y,z,fn,v\n");
    for n in 1..=40 {
        log += &format!("{:.3},block,table,0,0,0,500,0\n", 0.1 * f64::from(n));
    }
    studio.file("contacts.csv", &log);
    let production = studio.production(&format!("{}step = 0.001\n", scene(""))).unwrap();
    let lines: Vec<ObjectLine> = production.object_lines().unwrap().collect::<froufrou::Result<_>>().unwrap();
    let firsts: Vec<u32> = {
        let mut threads = std::collections::BTreeMap::new();
        for line in &lines {
            if let ObjectLine::Cue(cue) = line
                && let Action::Grain(grain) = cue.action
            {
                threads.entry(cue.thread).or_insert(grain.number);
            }
        }
        threads.into_values().collect()
    };
    assert_eq!(firsts.len(), 40);
    assert!(firsts.windows(2).all(|pair| pair[0] != pair[1]), "{firsts:?}");
    let causes = lines.iter().filter_map(|line| match line {
        ObjectLine::Thread(statement) => match &statement.verb {
            froufrou::score::Verb::Start(start) => Some(start.cause.clone()),
            _ => None,
        },
        _ => None,
    });
    let causes: Vec<String> = causes.collect();
    assert!(causes.iter().all(|cause| cause.contains("as hit/knock")), "{:?}", causes[0]);
}

#[test]
fn a_shader_makes_one_impact_two_and_slides_higher() {
    let studio = workshop();
    studio.file(
        "twice.rhai",
        "fn impact(impulse, speed, slip) {\n    let h = pick(strength());\n    play(h, 0.0, strength(), 1.0);\n    play(h, 0.15, strength(), 2.0);\n}\n\
         fn slide(force, speed) { gain(0.0); }\n",
    );
    let plain = studio.scene(&scene(""), Take::at(RATE_HZ)).unwrap().channel(0);
    let shaded = studio.scene(&scene(", shader = 'twice.rhai'"), Take::at(RATE_HZ)).unwrap().channel(0);
    let at = |from_s: f64, sound: &[f64]| energy(sound, from_s, from_s + 0.05);
    assert!(at(0.455, &shaded) > 20.0 * at(0.455, &plain), "the second hit");
    assert_eq!(energy(&shaded, 1.05, 2.0), 0.0, "a shader may silence what slides");
    // Each grain waits longer than any moment of the contact is told of ahead.
    studio.file("twice.rhai", "fn slide(force, speed) { wait(0.15); }\n");
    let waiting = studio.scene(&scene(", shader = 'twice.rhai'"), Take::at(RATE_HZ)).unwrap().channel(0);
    for from_s in [1.0, 1.3, 1.6] {
        assert!(energy(&waiting, from_s, from_s + 0.4) > 0.0, "grains at {from_s} s");
    }
    assert!(at(1.0, &waiting) + at(1.05, &waiting) == 0.0, "it waits");
    let fault = |script: &str| {
        studio.file("twice.rhai", script);
        studio
            .scene(&scene(", shader = 'twice.rhai'"), Take::at(RATE_HZ))
            .map(|_| ())
            .unwrap_err()
            .to_string()
    };
    let told = fault("fn impact(impulse, speed, slip) {\n    play(99, 0.0, 1.0, 1.0);\n}\n");
    assert!(told.contains("twice.rhai:2:5: there is no hit 99"), "{told}");
}

#[test]
fn a_corpus_that_is_not_there_is_told() {
    let studio = workshop();
    let fault = |scene: &str| studio.scene(scene, Take::at(RATE_HZ)).map(|_| ()).unwrap_err().to_string();
    let missing = fault(&scene("").replace("corpora/wood", "corpora/woad"));
    assert!(
        missing.contains("scene.toml:8:21") && missing.contains("there is no folder \"corpora/woad\""),
        "{missing}"
    );
    let no_corpus = fault(&scene("").replace("corpora/wood", "recordings"));
    assert!(no_corpus.contains("froufrou grains build"), "{no_corpus}");
}
