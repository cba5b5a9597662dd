//! Whole scenes in rooms, over planes and in air: what arrives is what walls and air leave of it.

mod studio;

use std::f64::consts::TAU;

use froufrou::space::bands::BANDS_HZ;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use studio::{Studio, Take, noise};

const RATE_HZ: u32 = 48_000;
const SPEED_MPS: f64 = 343.0;

#[derive(serde::Deserialize)]
struct Fixture {
    size: [f64; 3],
    absorption: [[f64; 8]; 6],
    source: [f64; 3],
    listener: [f64; 3],
    order: usize,
    speed_of_sound: f64,
    images: Vec<Seen>,
}

#[derive(serde::Deserialize)]
struct Seen {
    position: [f64; 3],
    gains: Vec<f64>,
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// The spectrum of some samples at a frequency, with time 0 at the first of them.
fn bin(samples: &[f64], frequency_hz: f64, rate_hz: f64) -> Complex<f64> {
    let step = -TAU * frequency_hz / rate_hz;
    samples.iter().enumerate().map(|(n, sample)| Complex::from_polar(*sample, step * n as f64)).sum()
}

/// A click of height 1 and nothing else.
fn click(studio: &Studio) {
    let mut click = vec![0.0; 16];
    click[0] = 1.0;
    studio.recording("click.wav", RATE_HZ, &click);
}

#[test]
fn a_click_in_a_room_arrives_by_every_image_of_pyroomacoustics() {
    let studio = Studio::new();
    click(&studio);
    for (name, text) in [
        ("cube", include_str!("fixtures/room/cube.json")),
        ("corner", include_str!("fixtures/room/corner.json")),
    ] {
        let room: Fixture = serde_json::from_str(text).unwrap();
        let scene = format!(
            "speed_of_sound = {}\nduration = 0.6\n[room]\nsize = {:?}\nabsorption = {}\norder = {}\ntail = false\n\
             [[microphone]]\nname = 'm'\nposition = {:?}\n[[sound]]\nposition = {:?}\nrecording = 'click.wav'\nat = [0.1]\n",
            room.speed_of_sound, room.size, room.absorption[0][0], room.order, room.listener, room.source
        );
        let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap();
        let found = sound.channel(0);
        let rate_hz = f64::from(RATE_HZ);
        let (mut error, mut power) = (0.0, 0.0);
        for step in 1..400 {
            let frequency_hz = 45.0 * f64::from(step);
            let expected: Complex<f64> = room
                .images
                .iter()
                .map(|image| {
                    let distance_m = distance(image.position, room.listener);
                    let delay_s = 0.1 + distance_m / room.speed_of_sound;
                    Complex::from_polar(image.gains[0] / distance_m, -TAU * frequency_hz * delay_s)
                })
                .sum();
            error += (bin(&found, frequency_hz, rate_hz) - expected).norm_sqr();
            power += expected.norm_sqr();
        }
        let error_db = 10.0 * (error / power).log10();
        println!("{name}: {} images, {error_db:.1} dB", room.images.len());
        // Its places are kept to a hundredth of a millimetre.
        assert!(error_db < -60.0, "{name}: {error_db} dB");
    }
}

/// The echo of a click at (0, 20, 0) that is heard there by way of what lies below, at 48 kHz: 100 ms about its moment.
fn echo(studio: &Studio, scene: &str, at_s: f64) -> Vec<f64> {
    let sound = studio.scene(scene, Take::at(RATE_HZ)).unwrap();
    let middle = (at_s * f64::from(RATE_HZ)).round() as usize;
    sound.channel(0)[middle - 2400..middle + 2400].to_vec()
}

#[test]
fn walls_and_air_take_from_each_band_what_they_should() {
    let studio = Studio::new();
    click(&studio);
    let absorption = [0.1, 0.2, 0.3, 0.5, 0.6, 0.4, 0.3, 0.2];
    // 20 m above a plane; the click comes back after 40 m.
    let scene = |more: &str| {
        format!(
            "speed_of_sound = {SPEED_MPS}\nduration = 0.5\n{more}[[microphone]]\nname = 'm'\nposition = [0, 20, 0]\n\
             [[sound]]\nposition = [0, 20, 0]\nrecording = 'click.wav'\nat = [0.1]\n"
        )
    };
    let plane = format!("[[plane]]\nabsorption = {absorption:?}\n");
    let air = "[air]\ntemperature = 20\nhumidity = 70\n";
    let at_s = 0.1 + 40.0 / SPEED_MPS;
    let rate_hz = f64::from(RATE_HZ);
    let begin_s = (at_s * rate_hz).round() / rate_hz - 0.05;
    // ISO 9613-2, table 2: dB/km at 20 °C and 70 %.
    let lost = [0.1, 0.3, 1.1, 2.8, 5.0, 9.0, 22.9, 76.6];
    let with_air = scene(&format!("{air}{plane}"));
    let of_walls = echo(&studio, &scene(&plane), at_s);
    let of_both = echo(&studio, &with_air, at_s);
    for (band, &middle_hz) in BANDS_HZ.iter().enumerate() {
        let expected = (1.0f64 - absorption[band]).sqrt() / 40.0;
        let delay = Complex::from_polar(1.0, -TAU * middle_hz * (at_s - begin_s));
        let found = bin(&of_walls, middle_hz, rate_hz) / delay;
        let error_db = 20.0 * (found.norm() / expected).log10();
        assert!(error_db.abs() < 0.1, "band {band}: {error_db} dB");
        // A tenth of a sample is 3.6° at 1 kHz.
        let samples = found.arg() / TAU / middle_hz * rate_hz;
        assert!(samples.abs() < 0.1 || found.arg().abs() < 1e-3, "band {band}: {samples} samples");
        let with_air = bin(&of_both, middle_hz, rate_hz) / delay;
        let air_db = 20.0 * (with_air / found).norm().log10();
        assert!((air_db + 0.04 * lost[band]).abs() < 0.05, "band {band}: {air_db} dB by air");
    }
    // Without a plane nothing comes back, and outdoors nothing reverberates.
    assert!(echo(&studio, &scene(air), at_s).iter().all(|sample| sample.abs() < 1e-9));
}

/// A source that flies through a room and a head that turns in it.
fn flight(layout: &str, recording: &str) -> String {
    format!(
        "duration = 2\n[air]\n[room]\nsize = [7, 3, 6]\ncorner = [-3, 0, -4]\norder = 2\ntail = false\n\
         absorption = {{ left = 0.1, right = [0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4, 0.5], floor = 0.4 }}\n\
         [listener]\nlayout = '{layout}'\ntrack = [{{ t = 0, position = [0, 1.6, 0], facing = [0, 0, -1] }}, \
         {{ t = 2, position = [1, 1.6, 0], facing = [1, 0, 0] }}]\n\
         [[object]]\nname = 'bee'\ninterpolation = 'linear'\n\
         track = [{{ t = 0, position = [-2.5, 1, -2] }}, {{ t = 2, position = [3.5, 1.5, -2] }}]\n\
         sound = {{ recording = '{recording}', loop = true }}\n"
    )
}

#[test]
fn a_range_alone_is_that_part_of_the_whole_with_walls_and_air() {
    let studio = Studio::new();
    studio.recording("noise.wav", RATE_HZ, &noise(48_000, 7));
    for layout in ["stereo", "binaural", "ambisonic-1"] {
        let scene = flight(layout, "noise.wav");
        let whole = studio.scene(&scene, Take { cores: 1, ..Take::at(RATE_HZ) }).unwrap();
        assert!(whole.mix.iter().any(|sample| sample.abs() > 0.01));
        for (from_s, to_s) in [(0.0, 0.3), (0.31, 0.32), (0.69999, 1.2), (1.9, 2.0)] {
            let take = Take { from_s, to_s: Some(to_s), ..Take::at(RATE_HZ) };
            let part = studio.scene(&scene, take).unwrap();
            let begin = (from_s * f64::from(RATE_HZ)).ceil() as usize * whole.channels;
            assert!(part.mix[..] == whole.mix[begin..begin + part.mix.len()], "{layout} from {from_s} s");
        }
    }
}

#[test]
fn nothing_clicks_in_a_room() {
    let studio = Studio::new();
    studio.tone("tone.wav");
    for layout in ["mono", "binaural", "ambisonic-3"] {
        let sound = studio.scene(&flight(layout, "tone.wav"), Take::at(RATE_HZ)).unwrap();
        let worst = sound.worst_splash_db();
        println!("{layout}: {worst:.1} dB");
        assert!(worst < -60.0, "{layout}: {worst} dB");
    }
}

#[test]
fn a_disk_over_a_table_has_the_comb_of_the_closed_form() {
    let studio = Studio::new();
    click(&studio);
    let rate_hz = f64::from(RATE_HZ);
    for (height_m, listener, axis) in [
        (0.05, [0.4, 0.9, 0.3], [0.0, 1.0, 0.0]),
        (0.2, [1.2, 0.5, -0.8], [0.0, 1.0, 0.0]),
        (0.2, [1.2, 0.5, -0.8], [1.0, 0.0, 0.0]),
        (0.6, [-0.7, 1.1, 0.2], [0.6, 0.0, -0.8]),
    ] {
        // The table has risen by 0.3 m when the disk sounds.
        let scene = format!(
            "speed_of_sound = {SPEED_MPS}\nduration = 0.6\n[[microphone]]\nname = 'm'\nposition = {listener:?}\n\
             [[object]]\nname = 'table'\ntrack = [{{ t = 0, position = [9, -0.3, 4] }}, {{ t = 0.1, position = [9, 0, 4] }}]\n\
             [[plane]]\nobject = 'table'\n\
             [[sound]]\nposition = [0, {height_m}, 0]\nrecording = 'click.wav'\nat = [0.2]\n\
             pattern = {{ disk = 0.5, axis = {axis:?} }}\n"
        );
        let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap();
        let mut samples = sound.channel(0);
        const LENGTH: usize = 1 << 14;
        samples = samples.split_off((0.2 * rate_hz) as usize);
        samples.truncate(LENGTH);
        assert_eq!(samples.len(), LENGTH);
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(LENGTH);
        let mut spectrum = fft.make_output_vec();
        fft.process(&mut samples, &mut spectrum).unwrap();
        let magnitudes: Vec<f64> = spectrum.iter().map(|bin| bin.norm()).collect();
        let top_hz = 19_000.0;
        let bin_hz = rate_hz / LENGTH as f64;
        let found: Vec<f64> = (1..(top_hz / bin_hz) as usize)
            .filter(|&n| magnitudes[n] < magnitudes[n - 1] && magnitudes[n] <= magnitudes[n + 1])
            .map(|n| n as f64 * bin_hz)
            .collect();
        // a³ cos θ / R by either way: of a disk that lies, the image moves the other way.
        let [x, y, z]: [f64; 3] = listener;
        let ways: Vec<(f64, f64)> = [(y - height_m, axis), (y + height_m, [axis[0], -axis[1], axis[2]])]
            .map(|(y, axis): (f64, [f64; 3])| {
                let length = (x * x + y * y + z * z).sqrt();
                (0.125 * (axis[0] * x + axis[1] * y + axis[2] * z) / length / length, length)
            })
            .into();
        let opposite = ways[0].0 * ways[1].0 < 0.0;
        let tooth_hz = SPEED_MPS / (ways[1].1 - ways[0].1);
        let expected: Vec<f64> = (0..10_000)
            .map(|k| f64::from(k) + if opposite { 1.0 } else { 0.5 })
            .map(|k| k * tooth_hz)
            .take_while(|hz| *hz < top_hz - 2.0 * bin_hz)
            .collect();
        assert!(!expected.is_empty());
        for notch_hz in &expected {
            let nearest = found.iter().map(|hz| (hz - notch_hz).abs()).fold(f64::INFINITY, f64::min);
            assert!(nearest <= bin_hz, "{height_m} {axis:?}: {notch_hz} Hz, off by {nearest} Hz");
        }
        assert!(found.len() <= expected.len() + 1, "{found:?} {expected:?}");
        // And the whole spectrum.
        for (n, magnitude) in magnitudes.iter().enumerate().take((top_hz / bin_hz) as usize).skip(1) {
            let omega = TAU * n as f64 * bin_hz / SPEED_MPS;
            let theory: Complex<f64> =
                ways.iter().map(|&(gain, length)| Complex::from_polar(gain, omega * length)).sum();
            let loudest = ways[0].0.abs() + ways[1].0.abs();
            assert!((magnitude - theory.norm()).abs() < 2e-3 * loudest, "{n}: {magnitude} {}", theory.norm());
        }
    }
}

#[test]
fn what_stands_in_the_way_hides_an_echo_and_not_the_direct_sound() {
    let studio = Studio::new();
    click(&studio);
    // Source and microphone 4 m apart and 2 m above a floor; a board lies where the echo meets the floor.
    let scene = |board: &str| {
        format!(
            "speed_of_sound = {SPEED_MPS}\nduration = 0.3\n[[microphone]]\nname = 'm'\nposition = [4, 2, 0]\n[[plane]]\n\
             [material.board]\nocclude = {{ transmission_db = -20 }}\n{board}\
             [[sound]]\nposition = [0, 2, 0]\nrecording = 'click.wav'\nat = [0.1]\n"
        )
    };
    let board = |x: f64| {
        format!(
            "[[object]]\nname = 'board'\nposition = [{x}, 0.05, 0]\nsize = [3, 0.02, 3]\nmaterial = 'board'\n"
        )
    };
    let heights = |board: &str| {
        let sound = studio.scene(&scene(board), Take::at(RATE_HZ)).unwrap().channel(0);
        [4.0f64, 32f64.sqrt()].map(|length_m| {
            let at = ((0.1 + length_m / SPEED_MPS) * f64::from(RATE_HZ)).round() as usize;
            bin(&sound[at - 60..at + 60], 1000.0, f64::from(RATE_HZ)).norm() * length_m
        })
    };
    let open = heights("");
    assert!(open.iter().all(|height| (height - 1.0).abs() < 0.02), "{open:?}");
    let hidden = heights(&board(2.0));
    assert!((hidden[0] - open[0]).abs() < 0.01, "{hidden:?}");
    // Both stretches pass the board.
    assert!(hidden[1] < 0.05, "{hidden:?}");
    let aside = heights(&board(30.0));
    assert!((aside[1] - open[1]).abs() < 1e-6, "{aside:?}");
}

#[test]
fn rooms_and_planes_that_cannot_be_say_so() {
    let studio = Studio::new();
    let wrong = [
        ("[room]\n", "`size` is missing"),
        ("[room]\nsize = [0, 3, 4]\n", "the size of the room is 0 by 3 by 4 m"),
        ("[room]\nsize = [5, 3, 4]\nabsorption = 1.5\n", "expected the part of the energy"),
        ("[room]\nsize = [5, 3, 4]\nabsorption = [0.1, 0.2]\n", "expected one number or 8, found 2"),
        ("[room]\nsize = [5, 3, 4]\nabsorption = { wall = 0.1 }\n", "unknown key `wall`"),
        ("[room]\nsize = [5, 3, 4]\norder = 20\n", "expected an order"),
        ("[room]\nsize = [5, 3, 4]\ntail = 3\n", "expected `true` or `false`"),
        ("[room]\nsize = [5, 3, 4]\n[[plane]]\n", "plane"),
        ("[air]\nhumidity = 140\n", "the air's relative humidity is 140 %"),
        ("[[plane]]\nobject = 'table'\n", "there is no object \"table\""),
        ("[[plane]]\nnormal = [0, 0, 0]\n", "a direction cannot be"),
        ("[[object]]\nname = 'a'\nbody = 'x'\n[[plane]]\nobject = 'a'\n", "the object has no place"),
        (&"[[plane]]\n".repeat(7), "more than 6 planes"),
    ];
    for (scene, expected) in wrong {
        let error = studio.production(scene).err().unwrap_or_else(|| panic!("{scene}")).to_string();
        assert!(error.contains(expected) && error.contains("scene.toml:"), "{scene}: {error}");
    }
    let two = "[[object]]\nname = 'bees'\nposition = [0, 0, 0]\nswarm = { count = 3 }\n[[plane]]\nobject = 'bees'\n";
    let production = studio.production(two).unwrap();
    let error = production.channel_lines().err().unwrap().to_string();
    assert!(error.contains("which carries a plane, is 3 bodies"), "{error}");
}

/// A click in a room whose walls take 30 %, by a layout.
fn hall(layout: &str, order: usize, tail: bool) -> String {
    format!(
        "seed = 3\n[room]\nsize = [8, 4, 6]\nabsorption = 0.3\norder = {order}\ntail = {tail}\n\
         [listener]\nlayout = '{layout}'\nposition = [5, 1.7, 4]\n\
         [[object]]\nname = 'a'\nposition = [2, 1.2, 1.5]\nsound = {{ recording = 'click.wav', at = [0.1] }}\n\
         [[object]]\nname = 'b'\nposition = [3, 1.2, 2.5]\nsound = {{ recording = 'click.wav', at = [0.3], gain_db = -6 }}\n"
    )
}

#[test]
fn a_room_reverberates_as_long_as_eyring_says_and_rings_out() {
    let studio = Studio::new();
    click(&studio);
    let rate_hz = f64::from(RATE_HZ);
    // 24 ln 10 V / (c S (−ln 0.7)), and 90 dB of it behind the images.
    let (volume, area) = (8.0 * 4.0 * 6.0, 2.0 * (8.0 * 4.0 + 8.0 * 6.0 + 4.0 * 6.0));
    let eyring_s = 24.0 * 10f64.ln() * volume / (SPEED_MPS * area * -(0.7f64.ln()));
    for layout in ["mono", "binaural", "ambisonic-1", "5.1"] {
        let sound = studio.scene(&hall(layout, 3, true), Take::at(RATE_HZ)).unwrap();
        let dry = studio.scene(&hall(layout, 3, false), Take::at(RATE_HZ)).unwrap();
        assert!(sound.frames() as f64 / rate_hz > 0.3 + 1.5 * eyring_s, "{layout}");
        assert!(sound.frames() > dry.frames() + RATE_HZ as usize / 3);
        for channel in 0..sound.channels {
            let samples = sound.channel(channel);
            if samples.iter().all(|sample| *sample == 0.0) {
                assert_eq!((layout, channel), ("5.1", 3), "only the channel for low effects is silent");
                continue;
            }
            // Schroeder's backward integral from 0.15 s after the second click, over 30 dB.
            let begin = (0.45 * rate_hz) as usize;
            let mut left: Vec<f64> = samples[begin..]
                .iter()
                .rev()
                .scan(0.0, |sum, sample| {
                    *sum += sample * sample;
                    Some(*sum)
                })
                .collect();
            left.reverse();
            let below =
                |db: f64| left.iter().position(|e| *e < left[0] * 10f64.powf(-db / 10.0)).unwrap() as f64;
            let found_s = 2.0 * (below(35.0) - below(5.0)) / rate_hz;
            println!("{layout} {channel}: {found_s:.3} s, Eyring {eyring_s:.3} s");
            assert!((found_s / eyring_s - 1.0).abs() < 0.08, "{layout} {channel}: {found_s} s");
        }
    }
}

#[test]
fn images_and_tail_together_are_as_loud_whatever_the_order() {
    let studio = Studio::new();
    click(&studio);
    let energies: Vec<f64> = [0, 2, 5]
        .map(|order| {
            let sound = studio.scene(&hall("mono", order, true), Take::at(RATE_HZ)).unwrap();
            sound.channel(0).iter().map(|s| s * s).sum()
        })
        .into();
    for energy in &energies {
        let off_db = 10.0 * (energy / energies[2]).log10();
        // Of one place in the room; a tail has the mean over all.
        assert!(off_db.abs() < 1.0, "{energies:?}");
    }
}

#[test]
fn stems_ranges_threads_and_stages_hold_in_a_room_that_reverberates() {
    let studio = Studio::new();
    click(&studio);
    for layout in ["binaural", "stereo"] {
        let scene = hall(layout, 1, true);
        let whole = studio.scene(&scene, Take { cores: 1, ..Take::at(RATE_HZ) }).unwrap();
        assert_eq!(whole.stems.len(), 2);
        for (n, sample) in whole.mix.iter().enumerate() {
            let sum: f32 = whole.stems.iter().map(|(_, stem)| stem[n]).sum();
            assert!((sum - sample).abs() < 1e-6, "{n}: {sum} {sample}");
        }
        for (from_s, to_s) in [(0.0, 0.05), (0.2, 0.35), (0.61, 0.62)] {
            let part = studio.scene(&scene, Take { from_s, to_s: Some(to_s), ..Take::at(RATE_HZ) }).unwrap();
            let begin = (from_s * f64::from(RATE_HZ)).ceil() as usize * 2;
            assert!(part.mix[..] == whole.mix[begin..begin + part.mix.len()], "{layout} from {from_s} s");
        }
        let production = studio.production(&scene).unwrap();
        let mut writer =
            froufrou::score::ChannelWriter::new(Vec::new(), &production.channel_header()).unwrap();
        for line in production.channel_lines().unwrap() {
            writer.write(&line.unwrap()).unwrap();
        }
        let text = String::from_utf8(writer.finish().unwrap()).unwrap();
        assert!(text.contains("tail \"scene.toml\" left"), "{text}");
        let again = studio.score(&text, Take::at(RATE_HZ)).unwrap();
        assert!(again.mix == whole.mix, "{layout}");
    }
}

#[test]
fn what_is_outside_is_not_heard_to_reverberate() {
    let studio = Studio::new();
    click(&studio);
    let at = |x: f64| {
        format!(
            "duration = 0.6\n[room]\nsize = [8, 4, 6]\n[[microphone]]\nname = 'm'\nposition = [5, 1.7, 4]\n\
             [[sound]]\nposition = [{x}, 1.5, 3]\nrecording = 'click.wav'\nat = [0.1]\n"
        )
    };
    let later = |x: f64| -> f64 {
        let sound = studio.scene(&at(x), Take::at(RATE_HZ)).unwrap().channel(0);
        sound[(0.2 * f64::from(RATE_HZ)) as usize..].iter().map(|s| s * s).sum()
    };
    assert!(later(3.0) > 1e-4);
    assert_eq!(later(-2.0), 0.0);
}

#[test]
fn a_room_sounds_alike_at_every_rate() {
    let studio = Studio::new();
    studio.band_limited_hit("hit.wav");
    let scene = |layout: &str| {
        format!(
            "duration = 0.4\n[air]\n[room]\nsize = [8, 4, 6]\norder = 2\ntail = false\n\
             absorption = [0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4, 0.5]\n[listener]\nlayout = '{layout}'\nposition = [5, 1.7, 4]\n\
             [[sound]]\nposition = [2, 1.2, 1.5]\nrecording = 'hit.wav'\nat = [0.1]\n"
        )
    };
    for layout in ["mono", "binaural"] {
        let facts = |rate_hz: u32| {
            let sound = studio.scene(&scene(layout), Take::at(rate_hz)).unwrap();
            sound.energy_and_moment(sound.channels - 1)
        };
        let usual = facts(48_000);
        for rate_hz in [44_100, 96_000, 192_000] {
            let found = facts(rate_hz);
            let level_db = 10.0 * (found.0 / usual.0).log10();
            let samples = (found.1 - usual.1) * f64::from(rate_hz);
            println!("{layout} at {rate_hz} Hz: {level_db:.3} dB, {samples:.2} samples");
            assert!(level_db.abs() < 0.1 && samples.abs() < 1.0, "{layout} {rate_hz}: {level_db} {samples}");
        }
    }
}
