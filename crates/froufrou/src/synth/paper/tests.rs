use super::*;
use crate::corpus::cloth::spectra::power;
use crate::corpus::paper::SPACING_HZ;
use crate::score::Grain;
use crate::synth::instrument::GrainStart;

const RATE_HZ: f64 = 44_100.0;

fn sound() -> Arc<PaperSound> {
    static SOUND: OnceLock<Arc<PaperSound>> = OnceLock::new();
    let printer = || PaperSound::named("synthetic/printer", std::path::Path::new("")).unwrap();
    SOUND.get_or_init(|| Arc::new(printer())).clone()
}

fn paper(given: &[(&str, f64)]) -> Paper {
    let given: Vec<(String, f64)> = given.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
    Paper::new(sound(), &given).unwrap()
}

/// What a thread is told: controls over time, and clips.
struct Play<'a> {
    rate_hz: f64,
    seconds: f64,
    seed: u64,
    set: &'a dyn Fn(f64) -> Vec<(usize, f64)>,
    clips: &'a [(f64, u32)],
}

fn play(paper: &Paper, play: &Play<'_>) -> Vec<f32> {
    let mut generator = paper.generator(play.rate_hz, Random::new(play.seed, 7)).unwrap();
    let count = stretch_samples(play.rate_hz);
    let values = |time_s: f64| {
        let mut values = vec![0.0; paper.controls().len()];
        (play.set)(time_s + paper.ahead_s()).into_iter().for_each(|(index, value)| values[index] = value);
        values
    };
    let mut out = Vec::new();
    while (out.len() as f64) < play.seconds * play.rate_hz {
        let first = out.len() as u64;
        let times = first as f64 / play.rate_hz..(first + count as u64) as f64 / play.rate_hz;
        let controls: Vec<Ramp> = values(times.start)
            .into_iter()
            .zip(values(times.end))
            .map(|(from, to)| Ramp { from, to })
            .collect();
        let due = play.clips.iter().filter(|(time_s, _)| times.contains(time_s));
        let due: Vec<GrainStart> = due
            .map(|&(time_s, number)| GrainStart {
                time_s,
                grain: Grain { number, gain: 1.0, speed: 1.0, spread: 0.0 },
            })
            .collect();
        let stretch =
            Stretch { first, rate_hz: play.rate_hz, controls: &controls, strikes: &[], grains: &due };
        let begin = out.len();
        out.resize(begin + count, 0.0);
        generator.generate(&stretch, &mut out[begin..]).unwrap();
    }
    out
}

fn steady(paper: &Paper, rate_hz: f64, seconds: f64, set: &[(usize, f64)]) -> Vec<f32> {
    play(paper, &Play { rate_hz, seconds, seed: 1, set: &|_| set.to_vec(), clips: &[] })
}

fn rms(samples: &[f32]) -> f64 {
    (samples.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / samples.len().max(1) as f64).sqrt()
}

/// Mean power in thirds of octaves from 200 Hz to 16 kHz, by Welch's method.
fn thirds(samples: &[f32], rate_hz: f64) -> Vec<f64> {
    let length = 8192;
    let forward = realfft::RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let window = |n: usize| (std::f64::consts::PI * (n as f64 + 0.5) / length as f64).sin().powi(2);
    let squares: f64 = (0..length).map(|n| window(n).powi(2)).sum();
    let mut density = vec![0.0; length / 2 + 1];
    let mut frames = 0.0;
    for frame in (0..samples.len() - length).step_by(length / 2) {
        let mut input: Vec<f64> = (0..length).map(|n| window(n) * f64::from(samples[frame + n])).collect();
        let mut output = forward.make_output_vec();
        forward.process(&mut input, &mut output).unwrap();
        density.iter_mut().zip(&output).for_each(|(d, bin)| *d += 2.0 * bin.norm_sqr() / (rate_hz * squares));
        frames += 1.0;
    }
    bands(|hz| density[(hz * length as f64 / rate_hz).round() as usize] / frames)
}

/// The mean of a density over each third of an octave.
fn bands(density: impl Fn(f64) -> f64) -> Vec<f64> {
    let band = |k: i32| {
        let centre = 200.0 * 2.0f64.powf(f64::from(k) / 3.0);
        (0..64).map(|n| density(centre * 2.0f64.powf((f64::from(n) / 63.0 - 0.5) / 3.0))).sum::<f64>() / 64.0
    };
    (0..19).map(band).collect()
}

/// The density of a spectrum at a frequency, in a straight line between its values.
fn density_at(spectrum: usize, hz: f64) -> f64 {
    let place = hz / SPACING_HZ - 1.0;
    let (low, along) = (place as usize, place.fract());
    let sound = sound();
    let values = &sound.spectra()[spectrum].density;
    values[low] * (1.0 - along) + values[low + 1] * along
}

fn agree(found: &[f64], wanted: &[f64], within_db: f64) {
    for (k, (found, wanted)) in found.iter().zip(wanted).enumerate() {
        let off = 10.0 * (found / wanted).log10();
        assert!(off.abs() < within_db, "band {k} is {off} dB off");
    }
}

#[test]
fn friction_has_the_sum_of_the_spectra_at_any_rate() {
    let plain = paper(&[("slip", 0.0)]);
    let told = [(0, 0.7), (20, 0.2), (60, 0.4)];
    let wanted = bands(|hz| told.iter().map(|&(n, gain)| gain * density_at(n, hz)).sum::<f64>().powi(2));
    for rate_hz in [44_100.0, 48_000.0, 96_000.0] {
        agree(&thirds(&steady(&plain, rate_hz, 12.0, &told), rate_hz), &wanted, 1.0);
    }
}

#[test]
fn powers_add_where_nothing_is_coherent() {
    let apart = paper(&[("slip", 0.0), ("coherence", 0.0)]);
    let told = [(10, 0.5), (11, 0.5), (70, 0.3)];
    let wanted =
        bands(|hz| told.iter().map(|&(n, gain): &(usize, f64)| (gain * density_at(n, hz)).powi(2)).sum());
    agree(&thirds(&steady(&apart, RATE_HZ, 12.0, &told), RATE_HZ), &wanted, 1.0);
    // Two threads are independent, so what two events have in power adds.
    let plain = paper(&[("slip", 0.0)]);
    let thread = |seed| {
        play(&plain, &Play { rate_hz: RATE_HZ, seconds: 6.0, seed, set: &|_| vec![(30, 0.5)], clips: &[] })
    };
    let both: Vec<f32> = thread(1).iter().zip(&thread(2)).map(|(a, b)| a + b).collect();
    let db = 20.0 * (rms(&both) / rms(&thread(1))).log10();
    assert!((db - 3.01).abs() < 0.4, "{db}");
}

#[test]
fn levels_follow_gains_and_spectra_add_sample_by_sample() {
    let plain = paper(&[("slip", 0.0)]);
    let of = |set: &[(usize, f64)]| steady(&plain, RATE_HZ, 0.5, set);
    let (one, other) = (of(&[(12, 0.4)]), of(&[(50, 0.6)]));
    let both = of(&[(12, 0.4), (50, 0.6)]);
    let louder = of(&[(12, 1.2)]);
    for n in 0..both.len() {
        assert!((both[n] - one[n] - other[n]).abs() < 1e-5);
        assert!((louder[n] - 3.0 * one[n]).abs() < 1e-5);
    }
    assert!(rms(&one) > 1e-3);
    // At 1 m/s it is as loud as the spectrum says.
    let level = rms(&steady(&plain, RATE_HZ, 6.0, &[(12, 1.0)])[2048..]);
    let wanted = power(&sound().spectra()[12].density, SPACING_HZ).sqrt();
    assert!((20.0 * (level / wanted).log10()).abs() < 0.3, "{level} {wanted}");
    // What is constrained is quieter.
    let free = sound().spectrum(0.1, 0.2).unwrap();
    let flat = sound().spectrum(0.1, 0.0).unwrap();
    assert!(rms(&of(&[(flat, 0.5)])) < 0.5 * rms(&of(&[(free, 0.5)])));
}

#[test]
fn clips_begin_on_their_sample_and_play_to_their_end() {
    let plain = paper(&[]);
    for rate_hz in [44_100.0, 48_000.0] {
        let begin = (0.1 * rate_hz) as usize;
        for number in [0u32, 4, 9, 100, 251] {
            let wanted = sound().clip_samples(number as usize, rate_hz as u32).unwrap();
            let clips = [(0.1, number)];
            let heard =
                play(&plain, &Play { rate_hz, seconds: 1.1, seed: 1, set: &|_| vec![], clips: &clips });
            assert!(heard[..begin].iter().all(|v| *v == 0.0));
            assert_eq!(&heard[begin..begin + wanted.len()], &wanted[..]);
            assert!(heard[begin + wanted.len()..].iter().all(|v| *v == 0.0));
        }
    }
    assert_eq!(plain.clips(), 252);
}

#[test]
fn slips_are_heard_in_the_first_tenth_of_a_second_after_rest() {
    let slide = |time_s: f64| {
        let slides = (0.3..0.7).contains(&time_s) || (0.72..1.0).contains(&time_s) || time_s >= 1.3;
        vec![(30, if slides { 0.2 } else { 0.0 })]
    };
    let of = |slip: f64| {
        let own = paper(&[("slip", slip)]);
        play(&own, &Play { rate_hz: RATE_HZ, seconds: 1.8, seed: 3, set: &slide, clips: &[] })
    };
    let (none, some, twice) = (of(0.0), of(1.0), of(2.0));
    let slips: Vec<f32> = some.iter().zip(&none).map(|(a, b)| a - b).collect();
    let part = |from: f64, to: f64| rms(&slips[(from * RATE_HZ) as usize..(to * RATE_HZ) as usize]);
    let friction = rms(&none[(0.35 * RATE_HZ) as usize..(0.65 * RATE_HZ) as usize]);
    assert!(part(0.3, 0.4) > 0.3 * friction, "{} {friction}", part(0.3, 0.4));
    assert!(part(0.0, 0.295) == 0.0 && part(0.45, 0.7) < 1e-4 * friction);
    // 20 ms are no rest, 300 ms are.
    assert!(part(0.72, 1.0) < 1e-4 * friction && part(1.3, 1.4) > 0.3 * friction);
    assert_eq!(part(1.25, 1.295), 0.0);
    for (n, twice) in twice.iter().enumerate() {
        assert!((twice - none[n] - 2.0 * slips[n]).abs() < 1e-5);
    }
    // It is a crackle: sharper than the noise.
    let early = &slips[(0.3 * RATE_HZ) as usize..(0.4 * RATE_HZ) as usize];
    let peak = early.iter().fold(0.0f32, |a, b| a.max(b.abs()));
    assert!(f64::from(peak) / rms(early) > 4.0);
}

#[test]
fn tears_crackle_by_their_speed() {
    let plain = paper(&[]);
    let tear = plain.controls().len() - 1;
    assert_eq!(plain.controls()[tear].name, "tear");
    // Slow enough that fibres are heard one by one: counted, they are a Poisson process.
    let slow = steady(&plain, RATE_HZ, 8.0, &[(tear, 0.002)]);
    let gap = (0.002 * RATE_HZ) as usize;
    let (mut clicks, mut quiet) = (0, gap);
    for sample in &slow {
        let is_loud = sample.abs() > 1e-4;
        clicks += usize::from(is_loud && quiet >= gap);
        quiet = if is_loud { 0 } else { quiet + 1 };
    }
    let wanted = 8.0 * 0.002 * sound().paper().fibres_per_m();
    assert!((0.6..1.1).contains(&(clicks as f64 / wanted)), "{clicks} of {wanted}");
    // Powers of fibres add, so ten times as fast is 10 dB louder, also where they are limited.
    let level = |speed: f64| rms(&steady(&plain, RATE_HZ, 4.0, &[(tear, speed)]));
    for (slow, fast) in [(0.02, 0.2), (0.2, 2.0), (2.0, 20.0)] {
        let db = 20.0 * (level(fast) / level(slow)).log10();
        assert!((db - 10.0).abs() < 1.5, "{db}");
    }
    // It stops with the tear.
    let stops = |time_s: f64| vec![(tear, if time_s < 0.5 { 0.3 } else { 0.0 })];
    let heard = play(&plain, &Play { rate_hz: RATE_HZ, seconds: 0.7, seed: 1, set: &stops, clips: &[] });
    assert!(heard[(0.51 * RATE_HZ) as usize..].iter().all(|v| *v == 0.0));
    assert!(rms(&heard[..(0.49 * RATE_HZ) as usize]) > 1e-3);
    let twice = steady(&paper(&[("tearing", 2.0)]), RATE_HZ, 0.2, &[(tear, 0.1)]);
    let once = steady(&plain, RATE_HZ, 0.2, &[(tear, 0.1)]);
    assert!(once.iter().zip(&twice).all(|(a, b)| (2.0 * a - b).abs() < 1e-6));
}

#[test]
fn all_that_sounds_adds_and_rest_is_silent() {
    let plain = paper(&[]);
    let clips = [(0.05, 100), (0.2, 3)];
    let one = |set: &dyn Fn(f64) -> Vec<(usize, f64)>, clips: &[(f64, u32)]| {
        play(&plain, &Play { rate_hz: RATE_HZ, seconds: 0.8, seed: 9, set, clips })
    };
    let tear = plain.controls().len() - 1;
    let all = one(&|_| vec![(40, 0.3), (tear, 0.1)], &clips);
    let parts = [one(&|_| vec![(40, 0.3)], &[]), one(&|_| vec![(tear, 0.1)], &[]), one(&|_| vec![], &clips)];
    for (n, all) in all.iter().enumerate() {
        assert!((all - parts.iter().map(|part| part[n]).sum::<f32>()).abs() < 1e-5);
    }
    assert!(one(&|_| vec![], &[]).iter().all(|v| *v == 0.0));
    // Absurd controls stay finite.
    let wild = one(&|_| vec![(0, f64::MAX), (1, f64::NAN), (2, -1e300), (tear, f64::INFINITY)], &[]);
    assert!(wild.iter().all(|v| v.is_finite()));
}

#[test]
fn parameters_and_controls_are_told() {
    for (name, value) in [("coherence", 2.0), ("slip", -1.0), ("slip-spacing", 0.0), ("tearings", 1.0)] {
        assert!(Paper::new(sound(), &[(name.to_owned(), value)]).is_err());
    }
    let plain = paper(&[]);
    assert_eq!(plain.controls().len(), 85);
    assert_eq!(plain.controls()[17].name, friction_control(17));
    assert!(plain.generator(10.0, Random::new(0, 0)).is_err());
}
