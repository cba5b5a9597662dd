//! Sounds that come from all over a surface: as loud as their energy, from where they are, and independent from side
//! to side.

mod studio;

use froufrou::space::ambisonic;
use studio::{Studio, Take, noise};

const RATE_HZ: u32 = 48_000;

/// A sail of 4 m by 3 m, `ahead` metres in front of the listener.
fn sail(layout: &str, ahead: f64, pattern: &str, sound: &str) -> String {
    format!(
        "duration = 2\nseed = 5\n[listener]\nlayout = '{layout}'\n[instrument.wind]\nkind = 'turbulence'\n\
         [[object]]\nname = 'sail'\nposition = [0, 0, -{ahead}]\nsize = [4, 3]\n\
         sound = {{ {sound}, pattern = '{pattern}' }}\n"
    )
}

fn energy(samples: &[f64]) -> f64 {
    samples[12_000..].iter().map(|s| s * s).sum::<f64>() / (samples.len() - 12_000) as f64
}

const LOOP: &str = "recording = 'noise.wav', loop = true";

#[test]
fn it_is_as_loud_as_its_energy_and_from_its_side() {
    let studio = Studio::new();
    studio.recording("noise.wav", RATE_HZ, &noise(96_000, 3));
    for ahead in [1.0, 3.0, 30.0] {
        let spread = studio.scene(&sail("ambisonic-1", ahead, "surface", LOOP), Take::at(RATE_HZ)).unwrap();
        let point = studio.scene(&sail("ambisonic-1", ahead, "omni", LOOP), Take::at(RATE_HZ)).unwrap();
        // ∫∫ 1 / (x² + y² + a²) by its area, against 1 / a².
        let (n, mut mean) = (300, 0.0);
        for i in 0..n {
            for j in 0..n {
                let at = |k: i32, size: f64| ((f64::from(k) + 0.5) / f64::from(n) - 0.5) * size;
                mean += 1.0 / (at(i, 4.0).powi(2) + at(j, 3.0).powi(2) + ahead * ahead) / f64::from(n * n);
            }
        }
        let found = energy(&spread.channel(0)) / energy(&point.channel(0));
        let off_db = 10.0 * (found / (mean * ahead * ahead)).log10();
        println!("{ahead} m: {off_db:.2} dB");
        assert!(off_db.abs() < 0.5, "{ahead}: {off_db} dB");
        // The mean direction is ahead: X; the further, the more it is a point.
        let product = |a: usize, b: usize| -> f64 {
            let (a, b) = (spread.channel(a), spread.channel(b));
            a[12_000..].iter().zip(&b[12_000..]).map(|(a, b)| a * b).sum()
        };
        let toward = [3, 1, 2].map(|channel| product(0, channel) / product(0, 0));
        assert!(toward[0] > 0.5 && toward[1].abs() < 0.1 && toward[2].abs() < 0.1, "{toward:?}");
        assert!(ahead < 10.0 || toward[0] > 0.99, "{toward:?}");
        assert_eq!(ambisonic::channels(1), 4);
    }
}

#[test]
fn its_sides_sound_independently() {
    let studio = Studio::new();
    studio.recording("noise.wav", RATE_HZ, &noise(96_000, 3));
    for sound in [LOOP, "instrument = 'wind', set = [{ t = 0, speed = 8 }]"] {
        // Cardioids to the left and to the right of one who stands just before it.
        let near = studio.scene(&sail("stereo", 0.3, "surface", sound), Take::at(RATE_HZ)).unwrap();
        let point = studio.scene(&sail("stereo", 0.3, "omni", sound), Take::at(RATE_HZ)).unwrap();
        let alike = |sound: &studio::Sound| {
            let (left, right) = (sound.channel(0), sound.channel(1));
            let product: f64 = left[12_000..].iter().zip(&right[12_000..]).map(|(a, b)| a * b).sum();
            product / (left.len() - 12_000) as f64 / (energy(&left) * energy(&right)).sqrt()
        };
        assert!(alike(&point) > 0.999, "{}", alike(&point));
        assert!(alike(&near) < 0.9, "{sound}: {}", alike(&near));
    }
}

#[test]
fn ranges_threads_and_stages_make_no_difference() {
    let studio = Studio::new();
    studio.recording("noise.wav", RATE_HZ, &noise(96_000, 3));
    let scene = format!(
        "{}[[object]]\nname = 'other'\ntrack = [{{ t = 0, position = [1, 0, 0] }}, {{ t = 2, position = [0, 2, 1] }}]\n\
         sound = {{ instrument = 'wind', set = [{{ t = 0.5, speed = 3 }}, {{ t = 1.5, speed = 9 }}], pattern = 'surface' }}\nsize = [1, 1, 1]\n",
        sail("binaural", 2.0, "surface", LOOP)
    );
    let whole = studio.scene(&scene, Take { cores: 1, ..Take::at(RATE_HZ) }).unwrap();
    assert_eq!(whole.stems.len(), 2);
    for (from_s, to_s) in [(0.0, 0.4), (0.777, 1.3)] {
        let part = studio.scene(&scene, Take { from_s, to_s: Some(to_s), ..Take::at(RATE_HZ) }).unwrap();
        let begin = (from_s * f64::from(RATE_HZ)).ceil() as usize * 2;
        assert!(part.mix[..] == whole.mix[begin..begin + part.mix.len()], "from {from_s} s");
    }
    // By way of the text of both scores.
    let production = studio.production(&scene).unwrap();
    let mut text = Vec::new();
    let mut writer = froufrou::score::ChannelWriter::new(&mut text, &production.channel_header()).unwrap();
    for line in production.channel_lines().unwrap() {
        writer.write(&line.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    let again = studio.score(std::str::from_utf8(&text).unwrap(), Take::at(RATE_HZ)).unwrap();
    assert!(again.mix == whole.mix);
}

#[test]
fn what_has_no_surface_says_so() {
    let studio = Studio::new();
    studio.recording("noise.wav", RATE_HZ, &noise(4_800, 3));
    let fails = |scene: String, expected: &str| {
        let error = studio
            .production(&scene)
            .and_then(|production| production.channel_lines().map(drop))
            .err()
            .unwrap_or_else(|| panic!("{scene}"))
            .to_string();
        assert!(error.contains(expected), "{error}");
    };
    let object = "[[object]]\nname = 'a'\nposition = [0, 0, 0]\n";
    fails(
        format!("{object}sound = {{ {LOOP}, pattern = 'surface' }}\n"),
        "`a` sounds from all over its surface, and has no mesh",
    );
    fails(
        format!("{object}size = [1, 1]\nsound = {{ recording = 'noise.wav', pattern = 'surface' }}\n"),
        "a recording that plays once cannot come from all over a surface",
    );
    fails(
        "[[sound]]\nposition = [0, 0, 0]\nrecording = 'noise.wav'\nloop = true\npattern = 'surface'\n".into(),
        "only a sound of an object comes from a surface",
    );
    let score = "froufrou-score 1 object\nduration 1\nmicrophone m\npattern skin surface\nsound s \"noise.wav\" loop\n\
                 hear m 0 at 0 0 0\nstart 1 0 s at 0 0 1 object a pattern skin\nend 1 1\n";
    let error = studio.score(score, Take::at(RATE_HZ)).err().unwrap().to_string();
    assert!(error.contains("of which nothing is known"), "{error}");
}
