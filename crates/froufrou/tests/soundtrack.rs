//! What a soundtrack must be, whatever is in it: the laws of sound and of the engine, held against
//! whole renders.

mod studio;

use std::f64::consts::TAU;
use std::fmt::Write;

use froufrou::score::{AnyDocument, ChannelWriter, ObjectWriter, Order};
use realfft::RealFftPlanner;
use studio::{Sound, Studio, Take, noise, tone};

const RATE_HZ: u32 = 48_000;

fn decibels(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

fn root_mean_square(samples: &[f64]) -> f64 {
    (samples.iter().map(|s| s * s).sum::<f64>() / samples.len() as f64).sqrt()
}

/// The greatest difference of two sounds, relative to the greatest sample of the first.
fn difference(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    let loudest = a.iter().fold(0.0f64, |peak, s| peak.max(f64::from(s.abs())));
    let apart = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs()).fold(0.0, f64::max);
    assert!(loudest > 0.0);
    apart / loudest
}

/// Amplitude of a tone in samples, and what is left of them without it (root mean square), by least
/// squares.
fn fit(samples: &[f64], cycles_a_sample: f64) -> (f64, f64) {
    let [mut cc, mut cs, mut ss, mut xc, mut xs] = [0.0; 5];
    let turn = |n: usize| (TAU * cycles_a_sample * n as f64).sin_cos();
    for (n, x) in samples.iter().enumerate() {
        let (s, c) = turn(n);
        cc += c * c;
        cs += c * s;
        ss += s * s;
        xc += x * c;
        xs += x * s;
    }
    let determinant = cc * ss - cs * cs;
    let (a, b) = ((xc * ss - xs * cs) / determinant, (xs * cc - xc * cs) / determinant);
    let rest: Vec<f64> = samples
        .iter()
        .enumerate()
        .map(|(n, x)| {
            let (s, c) = turn(n);
            x - a * c - b * s
        })
        .collect();
    (a.hypot(b), root_mean_square(&rest))
}

/// A scene with everything in it: loops that move, steps, fades, picks, impacts of a log, a listener
/// that turns.
fn busy(studio: &Studio) -> String {
    studio.recording("hum.wav", 44_100, &noise(20_000, 1));
    for (n, name) in ["a", "b", "c"].iter().enumerate() {
        let fading: Vec<f32> = noise(6_000, 2 + n as u64)
            .iter()
            .enumerate()
            .map(|(i, s)| s * (-(i as f32) / 900.0).exp())
            .collect();
        studio.recording(&format!("{name}.wav"), 48_000, &fading);
    }
    let mut log = "t,a,b,x,y,z,J\n".to_string();
    for blow in 0..40 {
        writeln!(
            log,
            "{:.3},ball,floor,{},0,1,{}",
            0.1 + 0.07 * f64::from(blow),
            0.1 * f64::from(blow),
            1 + blow % 3
        )
        .unwrap();
    }
    studio.file("log.csv", &log);
    "rate = 48000\nseed = 5\nduration = 3.1\n\
     [listener]\nspacing = 0.2\ninterpolation = 'linear'\n\
     track = [{ t = 0, position = [0, 1, 3], facing = [0, 0, -1] }, { t = 3, position = [1, 1, 2], facing = [1, 0, 0] }]\n\
     [material.stone]\nimpact = { recordings = ['[abc].wav'], speed_variation = 0.2, reference_impulse = 3 }\n\
     [[object]]\nname = 'ball'\nmaterial = 'stone'\n\
     [[object]]\nname = 'car'\ntrack = [{ t = 0, position = [-30, 0, 4] }, { t = 1.5, position = [0, 0, 5] }, { t = 3, position = [40, 0, 2] }]\n\
     sound = [{ recording = 'hum.wav', loop = true, gain_db = -6 }, { recordings = '[ab].wav', at = [0.2, 0.9, { t = 1.1, speed = 1.7 }] }]\n\
     [[object]]\nname = 'ghost'\ninterpolation = 'step'\n\
     track = [{ t = 0, position = [-3, 0, 0] }, { t = 1, position = [3, 0, 0] }, { t = 2, position = [0, 4, 0] }]\n\
     sound = { recording = 'hum.wav', loop = true, from = 0.3, to = 2.7, fade_in = 0.2, fade_out = 0.5, speed = 1.3 }\n\
     [[contacts]]\nlog = 'log.csv'\nstep = 0.001\n\
     columns = { t = 't', a = 'a', b = 'b', position = ['x', 'y', 'z'], normal_impulse = 'J' }\n"
        .to_string()
}

#[test]
fn any_range_on_any_number_of_cores_is_that_part_of_the_whole() {
    let studio = Studio::new();
    let scene = busy(&studio);
    let whole = studio.scene(&scene, Take { cores: 1, ..Take::at(RATE_HZ) }).unwrap();
    assert_eq!(whole.frames(), 148_800);
    assert!(whole.stems.len() == 3 && whole.begun.len() > 30, "{} sounds", whole.begun.len());
    for (cores, from_s, to_s) in [
        (2, 0.0, None),
        (5, 0.0, None),
        (2, 0.7, Some(0.701)),
        (3, 1.0, Some(2.9)),
        (1, 2.123_456, None),
        (2, 1.999_99, Some(99.0)),
    ] {
        let take = Take { rate_hz: RATE_HZ, from_s, to_s, cores };
        let part = studio.scene(&scene, take).unwrap();
        let frame = |time_s: f64| ((time_s * 48_000.0).ceil() as usize).min(whole.frames());
        let range = 2 * frame(from_s)..2 * to_s.map_or(whole.frames(), frame);
        assert!(part.mix == whole.mix[range.clone()], "{take:?}");
        for (name, samples) in &part.stems {
            assert!(*samples == whole.stem(name)[range.clone()], "{take:?}: {name}");
        }
    }
}

#[test]
fn rendering_in_stages_is_rendering_at_once() {
    let studio = Studio::new();
    let scene = busy(&studio);
    let whole = studio.scene(&scene, Take::at(RATE_HZ)).unwrap();
    let production = studio.production(&scene).unwrap();
    let mut object = ObjectWriter::new(Vec::new(), &production.header).unwrap();
    production.object_lines().unwrap().for_each(|line| object.write(&line.unwrap()).unwrap());
    let mut channel = ChannelWriter::new(Vec::new(), &production.channel_header()).unwrap();
    production.channel_lines().unwrap().for_each(|line| channel.write(&line.unwrap()).unwrap());
    for text in [object.finish().unwrap(), channel.finish().unwrap()] {
        let text = String::from_utf8(text).unwrap();
        let mixed = studio.score(&text, Take::at(RATE_HZ)).unwrap();
        assert!(mixed.mix == whole.mix && mixed.stems == whole.stems);
        let mut document = AnyDocument::read(text.as_bytes()).unwrap();
        assert!(document.to_text().unwrap() == text, "reading and writing changes nothing");
        document.sort(Order::Thread);
        let sorted = document.to_text().unwrap();
        assert!(sorted != text);
        assert!(studio.score(&sorted, Take::at(RATE_HZ)).unwrap().mix == whole.mix);
        document.sort(Order::Time);
        assert!(document.to_text().unwrap() == text, "sorting there and back changes nothing");
    }
}

#[test]
fn stems_sum_to_the_mix() {
    let studio = Studio::new();
    let whole = studio.scene(&busy(&studio), Take::at(RATE_HZ)).unwrap();
    let mut sum = vec![0.0f32; whole.mix.len()];
    for (_, samples) in &whole.stems {
        sum.iter_mut().zip(samples).for_each(|(sum, sample)| *sum += sample);
    }
    assert!(difference(&whole.mix, &sum) < 3e-7, "{}", difference(&whole.mix, &sum));
}

#[test]
fn a_seed_picks_and_another_picks_otherwise() {
    let studio = Studio::new();
    let scene = busy(&studio);
    let render = |scene: &str| studio.scene(scene, Take::at(RATE_HZ)).unwrap();
    let picks = |sound: &Sound| -> Vec<String> {
        sound.begun.iter().filter(|b| b.start.object == "ball").map(|b| b.start.sound.clone()).collect()
    };
    let first = render(&scene);
    assert!(first.mix == render(&scene).mix);
    let other = render(&scene.replace("seed = 5", "seed = 6"));
    assert!(other.mix != first.mix && picks(&other) != picks(&first));
    for sound in [&first, &other] {
        let picked = picks(sound);
        assert!(picked.len() > 30, "{} impacts", picked.len());
        assert!(picked.windows(2).all(|pair| pair[0] != pair[1]), "{picked:?}");
        for name in ["a", "b", "c"] {
            assert!(picked.iter().filter(|p| *p == name).count() > picked.len() / 6, "{picked:?}");
        }
    }
}

const HEAD: &str =
    "froufrou-score 1 channel\nchannels main\nsound x \"x.wav\"\nsound loop \"x.wav\" loop exact\n";
const WORLD: &str = "froufrou-score 1 object\nmicrophone main omni at 0 0 0\nsound x \"x.wav\"\nsound loop \"x.wav\" loop exact\n";

/// A thread that swings past the microphone, each key so many samples later.
fn swing(thread: u32, shift: u32, gain: f64) -> String {
    let mut lines = String::new();
    for key in 0..=60u32 {
        let t = f64::from(key) / 60.0;
        let time_s = (f64::from(key * 800 + shift)) / 48_000.0;
        let (x, z) = (6.0 * (3.0 * t + f64::from(thread)).sin(), 2.0 + t);
        let verb = match key {
            0 => format!("start {thread} {time_s} x gain {gain}"),
            60 => format!("end {thread} {time_s}"),
            _ => format!("key {thread} {time_s}"),
        };
        writeln!(lines, "{verb} at {x} 0 {z}").unwrap();
    }
    lines
}

#[test]
fn sounds_add_up() {
    let studio = Studio::new();
    studio.recording("x.wav", 44_100, &noise(40_000, 3));
    let render = |lines: &str| studio.score(&format!("{WORLD}{lines}"), Take::at(RATE_HZ)).unwrap().mix;
    let (a, b) = (swing(1, 0, 1.0), swing(2, 777, 0.6));
    let (mut sum, other, both) = (render(&a), render(&b), render(&format!("{a}{b}")));
    sum.resize(both.len(), 0.0);
    sum.iter_mut().zip(&other).for_each(|(sum, sample)| *sum += sample);
    assert!(other.iter().any(|&s| s != 0.0) && difference(&both, &sum) < 3e-7);
}

#[test]
fn gain_is_linear() {
    let studio = Studio::new();
    studio.recording("x.wav", 44_100, &noise(40_000, 3));
    let render =
        |gain| studio.score(&format!("{WORLD}{}", swing(1, 0, gain)), Take::at(RATE_HZ)).unwrap().mix;
    let one = render(1.0);
    // Powers of two scale floats exactly.
    for gain in [0.25, 2.0, 4096.0] {
        let scaled: Vec<f32> = one.iter().map(|s| s * gain).collect();
        assert!(render(f64::from(gain)) == scaled, "{gain}");
    }
    let scaled: Vec<f32> = one.iter().map(|s| s * 0.3).collect();
    assert!(difference(&render(0.3), &scaled) < 2e-7);
}

#[test]
fn what_happens_later_sounds_the_same() {
    let studio = Studio::new();
    studio.recording("x.wav", 48_000, &noise(40_000, 3));
    let still = |shift: u32, delay: f64| {
        let (from, to) = (f64::from(1000 + shift) / 48_000.0, f64::from(31_000 + shift) / 48_000.0);
        format!("{HEAD}start 1 {from} x 0.7 {delay}\nend 1 {to} 0.3 {delay}\n")
    };
    let render = |score: &str, shift: u32| {
        let mix = studio.score(score, Take::at(RATE_HZ)).unwrap().mix;
        assert!(mix[..shift as usize].iter().all(|&s| s == 0.0));
        mix[shift as usize..].to_vec()
    };
    for shift in [1, 48_000, 48_000 * 7 + 13] {
        // The delay is a whole number of samples: every sample is what it was but for the gain, whose
        // own rounding is far below that of a float.
        let (now, later) = (render(&still(0, 0.005), 0), render(&still(shift, 0.005), shift));
        assert!(difference(&now, &later) < 1.2e-7, "{}", difference(&now, &later));
        // Any other delay: the place between two samples is a difference of times.
        let (now, later) = (render(&still(0, 0.0123), 0), render(&still(shift, 0.0123), shift));
        assert!(decibels(difference(&now, &later)) < -120.0, "{}", decibels(difference(&now, &later)));
        let moving = |shift| format!("{WORLD}{}", swing(1, shift, 1.0));
        let (now, later) = (render(&moving(0), 0), render(&moving(shift), shift));
        let length = now.len().min(later.len());
        assert!(now.len().abs_diff(later.len()) <= 1);
        let apart = decibels(difference(&now[..length], &later[..length]));
        assert!(apart < -120.0, "{apart} dB after {shift} samples");
    }
    // At constant gain and a whole-sample delay not a bit is different.
    let flat = |shift: u32| {
        let (from, to) = (f64::from(1000 + shift) / 48_000.0, f64::from(31_000 + shift) / 48_000.0);
        format!("{HEAD}start 1 {from} x 0.7 0.005\nend 1 {to}\n")
    };
    let now = render(&flat(0), 0);
    for shift in [1, 48_000, 48_000 * 7 + 13] {
        let later = render(&flat(shift), shift);
        // The fade of 10 ms at the end is a function of time, which is rounded.
        assert!(now[..31_200] == later[..31_200]);
    }
}

#[test]
fn a_stereo_pair_sums_to_a_microphone_that_hears_all_around() {
    let studio = Studio::new();
    studio.recording("x.wav", 44_100, &noise(40_000, 3));
    let scene = |layout: &str| {
        format!(
            "[listener]\nposition = [0, 1, 2]\nfacing = [1, 2, 3]\nlayout = '{layout}'\n\
             [[object]]\nname = 'fly'\ntrack = [{{ t = 0, position = [-3, 0, 2] }}, {{ t = 0.5, position = [0, 1.2, 2.3] }}, {{ t = 1, position = [2, 0, -4] }}]\n\
             sound = {{ recording = 'x.wav', loop = true }}\n"
        )
    };
    let pair = studio.scene(&scene("stereo"), Take::at(RATE_HZ)).unwrap();
    let mono = studio.scene(&scene("mono"), Take::at(RATE_HZ)).unwrap();
    let sum: Vec<f32> = pair.channel(0).iter().zip(pair.channel(1)).map(|(l, r)| (l + r) as f32).collect();
    assert!(pair.channel(0) != pair.channel(1));
    assert!(difference(&mono.mix, &sum) < 3e-7, "{}", difference(&mono.mix, &sum));
}

#[test]
fn pressure_falls_with_distance_and_sound_takes_its_time() {
    let studio = Studio::new();
    studio.recording("x.wav", RATE_HZ, &tone(RATE_HZ, 1000.0, 48_000, 0.0));
    for distance_m in [0.2f64, 1.0, 2.0, 17.15, 100.0, 3430.0] {
        let score = format!("{WORLD}start 1 0 x at 0 {distance_m} 0\n");
        let sound = studio.score(&score, Take::at(RATE_HZ)).unwrap();
        let delay = distance_m / 343.0 * f64::from(RATE_HZ);
        let all = sound.channel(0);
        let inside = &all[delay as usize + 500..delay as usize + 40_000];
        let (amplitude, _) = fit(inside, 1000.0 / 48_000.0);
        assert!(decibels(amplitude * distance_m).abs() < 0.01, "{distance_m} m: {amplitude}");
        // Before the onset there is no more than the ringing of the kernel.
        let before = (delay as usize).saturating_sub(100);
        assert!(all[..before].iter().all(|&s| s == 0.0), "{distance_m} m");
        assert!(all[delay as usize..][..48].iter().any(|s| s.abs() > 0.5 / distance_m));
    }
    // On the microphone itself it is as loud as 10 cm away.
    let here = studio.score(&format!("{WORLD}start 1 0 x at 0 0 0\n"), Take::at(RATE_HZ)).unwrap();
    assert!((fit(&here.channel(0)[500..40_000], 1000.0 / 48_000.0).0 - 10.0).abs() < 0.01);
}

/// The share of a stretch of sound above 10 kHz, in decibels of energy.
fn click(samples: &[f64]) -> f64 {
    let length = samples.len();
    let mut input: Vec<f64> = (0..length)
        .map(|n| {
            // Blackman–Harris: side lobes below −92 dB.
            let x = TAU * n as f64 / length as f64;
            let window = 0.35875 - 0.48829 * x.cos() + 0.14128 * (2.0 * x).cos() - 0.01168 * (3.0 * x).cos();
            window * samples[n]
        })
        .collect();
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let mut spectrum = transform.make_output_vec();
    transform.process(&mut input, &mut spectrum).unwrap();
    let first = length * 10_000 / RATE_HZ as usize;
    let energy = |bins: &[realfft::num_complex::Complex<f64>]| bins.iter().map(|c| c.norm_sqr()).sum::<f64>();
    10.0 * (energy(&spectrum[first..]) / energy(&spectrum)).log10()
}

#[test]
fn what_jumps_does_not_click() {
    let studio = Studio::new();
    studio.recording("x.wav", RATE_HZ, &tone(RATE_HZ, 500.0, 48_000, 0.0));
    let step = "[listener]\nlayout = 'mono'\n[[object]]\nname = 'ghost'\ninterpolation = 'step'\n\
         track = [{ t = 0, position = [1.1, 0, 0] }, { t = 0.5, position = [0, 2.3, 0] }, { t = 1, position = [0, 0, 3] }]\n\
         sound = { recording = 'x.wav', loop = 'exact' }\n";
    let jump = format!(
        "{WORLD}start 1 0 loop at 1.1 0 0\nkey 1 0.5 at 1.1 0 0\njump 1 0.5 at 0 2.3 0\nend 1 1 at 0 2.3 0\n"
    );
    // A frame to the next one, as an animation does it: faster than anything could move.
    let leap = format!(
        "{WORLD}start 1 0 loop at 1.1 0 0\nkey 1 0.49 at 1.1 0 0\nkey 1 0.5 at 0 9 0\nend 1 1 at 0 9 0\n"
    );
    let cut = "froufrou-score 1 object\nmicrophone main\nsound loop \"x.wav\" loop exact\n\
               hear main 0 at 0 0 0\ncut main 0.5 at 0 0 5\nstart 1 0 loop at 1.1 0 0\nend 1 1\n";
    // What begins within itself fades in.
    let offset = format!("{HEAD}start 1 0.5 loop 1 0 offset 0.0005\nend 1 1\n");
    let worst = |sound: &Sound| -> f64 {
        let samples = sound.channel(0);
        assert!(samples.len() > 44_000);
        let (from, to) = (20_000, samples.len().min(46_000) - 4096);
        (from..to).step_by(256).map(|at| click(&samples[at..at + 4096])).fold(f64::NEG_INFINITY, f64::max)
    };
    // Where nothing is heard yet there is nothing to measure.
    let only_after = |sound: &Sound| click(&sound.channel(0)[22_000..22_000 + 4096]);
    let at = Take::at(RATE_HZ);
    for (what, found) in [
        ("step", worst(&studio.scene(step, at).unwrap())),
        ("jump", worst(&studio.score(&jump, at).unwrap())),
        ("leap", worst(&studio.score(&leap, at).unwrap())),
        ("cut", worst(&studio.score(cut, at).unwrap())),
        ("offset", only_after(&studio.score(&offset, at).unwrap())),
    ] {
        println!("{what}: {found:.1} dB above 10 kHz");
        assert!(found < -60.0, "{what}: {found} dB above 10 kHz");
    }
    // The same, switched from one sample to the next.
    let naive: Vec<f64> = (0..4096)
        .map(|n| {
            let (distance_m, t) = if n < 2048 { (1.1, n as f64) } else { (2.3, n as f64) };
            (TAU * 500.0 * (t / 48_000.0 - distance_m / 343.0)).sin() / distance_m
        })
        .collect();
    assert!(click(&naive) > -60.0, "a hard switch clicks: {}", click(&naive));
}

#[test]
fn resampling_keeps_what_fits_and_nothing_else() {
    let studio = Studio::new();
    let mut worst = (0.0f64, f64::NEG_INFINITY, f64::NEG_INFINITY);
    for (recording_hz, rate_hz, speed) in [
        (48_000, 48_000, 0.5),
        (48_000, 48_000, 0.73),
        (48_000, 48_000, 1.37),
        (48_000, 48_000, 2.0),
        (44_100, 48_000, 1.0),
        (48_000, 44_100, 1.0),
        (44_100, 48_000, 1.9),
        (96_000, 48_000, 1.0),
        (22_050, 44_100, 1.0),
    ] {
        let (input, output) = (f64::from(recording_hz), f64::from(rate_hz));
        // In the recording's own frequencies: what the output can hold lies below its Nyquist
        // frequency divided by the speed.
        let lower = 0.5 * input.min(output / speed);
        let render = |frequency_hz: f64| {
            studio.recording(
                "x.wav",
                recording_hz,
                &tone(recording_hz, frequency_hz, recording_hz as usize, 0.1),
            );
            let score = format!("{HEAD}start 1 0 x 1 0 speed {speed}\n");
            let sound = studio.score(&score, Take::at(rate_hz)).unwrap().channel(0);
            // Without the edges, where the tone begins and ends.
            let length = (output / speed).min(sound.len() as f64) as usize;
            sound[500..length - 500].to_vec()
        };
        for part in [0.01, 0.2, 0.45, 0.7, 5.0 / 6.0] {
            let frequency_hz = part * lower;
            let (amplitude, rest) = fit(&render(frequency_hz), frequency_hz * speed / output);
            worst.0 = worst.0.max(decibels(amplitude).abs());
            worst.1 = worst.1.max(decibels(rest * 2f64.sqrt()));
        }
        // What would fold down again must be gone.
        for part in [1.001, 1.1, 1.4, 1.9] {
            if part * lower < 0.5 * input {
                worst.2 = worst.2.max(decibels(root_mean_square(&render(part * lower)) * 2f64.sqrt()));
            }
        }
    }
    println!(
        "flat within {:.4} dB, images below {:.1} dB, aliases below {:.1} dB",
        worst.0, worst.1, worst.2
    );
    assert!(worst.0 < 0.05 && worst.1 < -100.0 && worst.2 < -100.0, "{worst:?}");
}

#[test]
fn a_whole_sample_delay_at_ratio_1_passes_every_sample() {
    let studio = Studio::new();
    let samples = noise(30_000, 8);
    for rate_hz in [8_000, 44_100, 48_000, 192_000] {
        studio.recording("x.wav", rate_hz, &samples);
        for (start, delay) in [(0u32, 0u32), (11, 100), (4321, 17)] {
            let seconds = |frames: u32| f64::from(frames) / f64::from(rate_hz);
            let score = format!("{HEAD}start 1 {} x 1 {}\n", seconds(start), seconds(delay));
            let mix = studio.score(&score, Take::at(rate_hz)).unwrap().mix;
            let at = (start + delay) as usize;
            assert!(mix[..at].iter().all(|&s| s == 0.0) && mix[at..][..samples.len()] == samples);
            assert!(mix[at + samples.len()..].iter().all(|&s| s == 0.0));
        }
    }
}

#[test]
fn every_rate_plays_every_recording_at_its_pitch_and_level() {
    let studio = Studio::new();
    let rates = [8_000, 11_025, 22_050, 32_000, 44_100, 48_000, 88_200, 96_000, 176_400, 192_000];
    for recording_hz in rates {
        studio.recording("x.wav", recording_hz, &tone(recording_hz, 500.0, recording_hz as usize / 2, 0.0));
        for rate_hz in rates {
            let scene =
                "[listener]\nlayout = 'mono'\n[[sound]]\nposition = [0, 0, -2]\nrecording = 'x.wav'\n";
            let sound = studio.scene(scene, Take::at(rate_hz)).unwrap();
            let length = sound.frames();
            let seconds = length as f64 / f64::from(rate_hz);
            assert!((seconds - 0.5 - 2.0 / 343.0 - 0.01).abs() < 0.001, "{seconds} s");
            let (from, to) = (length / 10, length * 8 / 10);
            let (amplitude, rest) = fit(&sound.channel(0)[from..to], 500.0 / f64::from(rate_hz));
            assert!(decibels(amplitude / 0.5).abs() < 0.05, "{recording_hz} → {rate_hz}: {amplitude}");
            assert!(decibels(rest / amplitude) < -95.0, "{recording_hz} → {rate_hz}: {rest}");
        }
    }
}

#[test]
fn there_may_be_many_microphones() {
    let studio = Studio::new();
    studio.recording("x.wav", RATE_HZ, &tone(RATE_HZ, 1000.0, 24_000, 0.0));
    let mut scene = "[[sound]]\nposition = [0, 0, 0]\nrecording = 'x.wav'\n".to_string();
    for n in 1..=64 {
        writeln!(scene, "[[microphone]]\nname = 'm{n}'\nposition = [{n}, 0, 0]").unwrap();
    }
    let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap();
    assert_eq!(sound.channels, 64);
    for n in [1, 2, 33, 64] {
        let (amplitude, _) = fit(&sound.channel(n - 1)[10_000..23_000], 1000.0 / 48_000.0);
        assert!((amplitude * n as f64 - 1.0).abs() < 0.001, "{n}: {amplitude}");
    }
}

#[test]
fn nothing_is_also_a_soundtrack() {
    let studio = Studio::new();
    studio.recording("x.wav", RATE_HZ, &noise(4_800, 1));
    studio.recording("silence.wav", RATE_HZ, &[0.0; 4_800]);
    let frames = |scene: &str| {
        let sound = studio.scene(scene, Take::at(RATE_HZ)).unwrap();
        (sound.frames(), sound.mix.iter().any(|&s| s != 0.0))
    };
    assert_eq!(frames(""), (0, false));
    assert_eq!(frames("duration = 0.5\n"), (24_000, false));
    let silence = "[[sound]]\nposition = [0, 0, 0]\nrecording = 'silence.wav'\n";
    assert_eq!(frames(silence), (4_800 + 480, false));
    let late = "duration = 0.5\n[[sound]]\nposition = [0, 0, 0]\nrecording = 'x.wav'\nfrom = 2\n";
    assert_eq!(frames(late), (24_000, false));
    let one_key = "[listener]\nlayout = 'mono'\n[[object]]\nname = 'box'\ntrack = [{ t = 0.2, position = [0, 0, 0] }]\nsound = { recording = 'x.wav' }\n";
    assert_eq!(frames(one_key), (4_800 + 480, true), "at the listener, for a moment");
    assert_eq!(studio.score(HEAD, Take::at(RATE_HZ)).unwrap().frames(), 0);
    assert_eq!(studio.score(WORLD, Take::at(RATE_HZ)).unwrap().frames(), 0);
    // A single sample is a sound too.
    studio.recording("x.wav", RATE_HZ, &[0.5]);
    let one = studio.score(&format!("{HEAD}start 1 0.001 x 1 0\n"), Take::at(RATE_HZ)).unwrap();
    assert_eq!((one.mix[48], one.mix.iter().filter(|&&s| s != 0.0).count()), (0.5, 1));
    studio.recording("x.wav", RATE_HZ, &[]);
    let error = studio.score(&format!("{HEAD}start 1 0 x 1 0\n"), Take::at(RATE_HZ)).err().unwrap();
    assert!(error.to_string().contains("x.wav"), "{error}");
}

#[test]
fn a_loop_without_end_is_refused() {
    let studio = Studio::new();
    studio.recording("x.wav", RATE_HZ, &noise(4_800, 1));
    let scene = "[[sound]]\nposition = [0, 0, 0]\nrecording = 'x.wav'\nloop = true\n";
    let error = studio.scene(scene, Take::at(RATE_HZ)).err().unwrap();
    assert!(error.to_string().contains("duration"), "{error}");
    let error = studio.score(&format!("{HEAD}start 1 0 loop 1 0\n"), Take::at(RATE_HZ)).err().unwrap();
    assert!(error.to_string().contains("duration"), "{error}");
}

#[test]
fn a_soundtrack_lasts_until_all_has_arrived() {
    let studio = Studio::new();
    studio.recording("x.wav", RATE_HZ, &noise(48_000, 1));
    // What is far away when it jumps near arrives after what is near.
    let score = format!("{HEAD}start 1 0 x 1 5\njump 1 0.5 1 0\nend 1 0.6\n");
    let sound = studio.score(&score, Take::at(RATE_HZ)).unwrap();
    let last = sound.mix.iter().rposition(|&s| s != 0.0).unwrap() as f64 / 48_000.0;
    assert!((last - 5.51).abs() < 0.001, "{last} s");
    assert!((sound.frames() as f64 / 48_000.0 - 5.51).abs() < 0.001);
}

#[test]
fn an_onset_that_rings_for_long_does_not_depend_on_the_range() {
    let studio = Studio::new();
    studio.recording("x.wav", 8_000, &noise(100, 1));
    // A ten-thousandth of the speed: the kernel reaches some fifty seconds ahead.
    let score = "froufrou-score 1 channel\nduration 9\nchannels main\nsound x \"x.wav\"\n\
                 start 1 5 x 1 0 speed 0.0001\n";
    let whole = studio.score(score, Take::at(RATE_HZ)).unwrap();
    for from_s in [0.5, 2.5, 3.25, 4.25, 4.875] {
        let take = Take { from_s, to_s: Some(from_s + 0.6), ..Take::at(RATE_HZ) };
        let part = studio.score(score, take).unwrap().mix;
        let from = (from_s * 48_000.0f64).ceil() as usize;
        assert!(part == whole.mix[from..from + part.len()], "from {from_s} s");
    }
}

#[test]
fn what_is_at_rest_does_not_stir_the_air() {
    let scene = r#"
        duration = 6
        [listener]
        layout = "mono"
        [instrument.swish]
        kind = "turbulence"
        [material.cane]
        air = { instrument = "swish" }
        [[object]]
        name = "cane"
        material = "cane"
        interpolation = "linear"
        track = [
            { t = 0, position = [0, 0, -1] },
            { t = 2.5, position = [0, 0, -1] },
            { t = 3.5, position = [5, 0, -1] },
        ]
    "#;
    let sound = Studio::new().scene(scene, Take::at(48_000)).unwrap();
    let loudest = |from_s: f64, to_s: f64| {
        let part = &sound.mix[(from_s * 48e3) as usize..(to_s * 48e3) as usize];
        part.iter().fold(0.0_f32, |most, sample| most.max(sample.abs()))
    };
    assert!(loudest(2.6, 3.4) > 0.1);
    // It starts and stops within the time between two frames and the way of its sound.
    assert_eq!((loudest(0.0, 2.47), loudest(3.56, 6.0)), (0.0, 0.0));
}
