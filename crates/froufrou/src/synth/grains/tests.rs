use super::*;
use crate::corpus::dictionary::{Action, Example, Settings};
use crate::corpus::grains::Contact;
use crate::score::Grain;
use crate::synth::instrument::stretch_samples;
use std::f64::consts::TAU;

const RATE_HZ: f64 = 48_000.0;

/// A corpus of a second of a tone of 1 kHz at a rate, and the number of its longest grain.
fn tone(rate_hz: u32) -> (Grains, u32) {
    let tone = (0..rate_hz).map(|n| (0.5 * (TAU * 1000.0 * f64::from(n) / f64::from(rate_hz)).sin()) as f32);
    let example = Example {
        name: "tone".into(),
        samples: tone.collect(),
        rate_hz,
        contact: Contact::Impulsive,
        action: Action::Hit,
    };
    let dictionary = Dictionary::build([example], None, &Settings::default()).unwrap();
    // The longest one.
    let longest = (0..dictionary.grains().len()).max_by_key(|&n| dictionary.samples(n).len()).unwrap();
    (Grains::new(Arc::new(dictionary)), longest as u32)
}

/// Makes seconds of what a thread is told, in stretches.
fn play(grains: &Grains, told: &[(f64, Grain)], seconds: f64) -> Vec<f32> {
    let mut player = grains.generator(RATE_HZ, Random::new(1, 2)).unwrap();
    let count = stretch_samples(RATE_HZ);
    let mut sound = Vec::new();
    while (sound.len() as f64) < seconds * RATE_HZ {
        let first = sound.len() as u64;
        let range = first as f64 / RATE_HZ..(first + count as u64) as f64 / RATE_HZ;
        let due: Vec<GrainStart> = told
            .iter()
            .filter(|(time_s, _)| range.contains(time_s))
            .map(|&(time_s, grain)| GrainStart { time_s, grain })
            .collect();
        let mut out = vec![0.0; count];
        let stretch = Stretch { first, rate_hz: RATE_HZ, controls: &[], strikes: &[], grains: &due };
        player.generate(&stretch, &mut out).unwrap();
        sound.extend(out);
    }
    sound
}

fn plain(number: u32) -> Grain {
    Grain { number, gain: 1.0, speed: 1.0, spread: 0.0 }
}

/// The mean frequency of a sound and the standard deviation about it, by energy, in hertz.
fn band(sound: &[f32]) -> (f64, f64) {
    let mut planner = realfft::RealFftPlanner::<f64>::new();
    let size = (4 * sound.len()).next_power_of_two();
    let fft = planner.plan_fft_forward(size);
    let mut input = fft.make_input_vec();
    // Hann's window: the lobes of a grain's own edges say nothing.
    let length = sound.len() as f64;
    for (n, (to, from)) in input.iter_mut().zip(sound).enumerate() {
        *to = f64::from(*from) * (0.5 - 0.5 * (TAU * n as f64 / length).cos());
    }
    let mut bins = fft.make_output_vec();
    fft.process(&mut input, &mut bins).unwrap();
    let hz = |bin: usize| bin as f64 * RATE_HZ / size as f64;
    let sum: f64 = bins.iter().map(|bin| bin.norm_sqr()).sum();
    let mean = bins.iter().enumerate().map(|(k, bin)| hz(k) * bin.norm_sqr()).sum::<f64>() / sum;
    let variance =
        bins.iter().enumerate().map(|(k, bin)| (hz(k) - mean).powi(2) * bin.norm_sqr()).sum::<f64>() / sum;
    (mean, variance.sqrt())
}

#[test]
fn a_grain_at_its_own_speed_and_rate_passes_unchanged() {
    let (grains, number) = tone(48_000);
    let samples = grains.dictionary.samples(number as usize).to_vec();
    // On a sample in the middle of a stretch; another one at half the gain begins while it sounds.
    let (first, second) = (1234, 1300);
    let half = Grain { gain: 0.5, ..plain(number) };
    let told = [(first as f64 / RATE_HZ, plain(number)), (second as f64 / RATE_HZ, half)];
    let sound = play(&grains, &told, 0.3);
    for (n, &found) in sound.iter().enumerate() {
        let of = |begin: usize| n.checked_sub(begin).and_then(|n| samples.get(n)).copied().unwrap_or(0.0);
        assert_eq!(found, of(first) + 0.5 * of(second), "{n}");
    }
}

#[test]
fn speed_and_rate_change_pitch_and_length_as_they_should() {
    for (rate_hz, speed) in [(48_000, 1.5), (48_000, 0.5), (44_100, 1.0), (44_100, 2.0), (96_000, 1.0)] {
        let (grains, number) = tone(rate_hz);
        let length_s = grains.dictionary.samples(number as usize).len() as f64 / f64::from(rate_hz) / speed;
        let begin_s = 0.010_003;
        let sound = play(&grains, &[(begin_s, Grain { speed, ..plain(number) })], length_s + 0.05);
        let first = sound.iter().position(|&sample| sample != 0.0).unwrap();
        let last = sound.iter().rposition(|&sample| sample != 0.0).unwrap();
        assert!((first as f64 - begin_s * RATE_HZ).abs() <= 2.0, "{first}");
        assert!((last as f64 - (begin_s + length_s) * RATE_HZ).abs() <= 3.0, "{last}");
        let (mean_hz, _) = band(&sound[first..=last]);
        assert!((mean_hz / (1000.0 * speed) - 1.0).abs() < 0.003, "{rate_hz}, {speed}: {mean_hz}");
    }
}

#[test]
fn spread_broadens_a_tone_in_proportion_and_leaves_its_pitch() {
    // Many grains together, as the band of a single one is random.
    let (grains, number) = tone(48_000);
    let width = |spread: f64| {
        let mut squares = 0.0;
        let mut means = 0.0;
        let count = 40;
        for n in 0..count {
            // Later grains have other random numbers.
            let told: Vec<(f64, Grain)> = (0..=n)
                .map(|k| (0.0, Grain { spread, gain: f64::from(u8::from(k == n)), ..plain(number) }))
                .collect();
            let length_s = grains.dictionary.samples(number as usize).len() as f64 / RATE_HZ;
            let (mean_hz, width_hz) = band(&play(&grains, &told, length_s));
            // About where it was: a grain is so short that its band wanders as a whole.
            squares += (width_hz.powi(2) + (mean_hz - 1000.0).powi(2)) / f64::from(count);
            means += mean_hz / f64::from(count);
        }
        (means, squares.sqrt())
    };
    let (_, narrow_hz) = width(0.0);
    for spread in [0.05, 0.1] {
        let (mean_hz, broad_hz) = width(spread);
        let own_hz = (broad_hz.powi(2) - narrow_hz.powi(2)).sqrt();
        println!("spread {spread}: {mean_hz:.1} ± {own_hz:.1} Hz");
        assert!((own_hz / (1000.0 * spread) - 1.0).abs() < 0.25, "{spread}: {own_hz}");
        assert!((mean_hz / 1000.0 - 1.0).abs() < 0.02, "{mean_hz}");
    }
}

#[test]
fn neighbours_of_another_rate_fit_to_each_other_as_at_their_own() {
    // All grains of a tone where they were: the tone again, but for its seams.
    let seams = |corpus_hz: u32, begin_s: f64| {
        let (grains, _) = tone(corpus_hz);
        let entries = grains.dictionary.grains().iter().enumerate();
        let told: Vec<(f64, Grain)> = entries
            .map(|(number, entry)| {
                (begin_s + entry.start as f64 / f64::from(corpus_hz), plain(number as u32))
            })
            .collect();
        let sound = play(&grains, &told, 1.0);
        let tone = |n: usize, phase: f64| (TAU * (n as f64 / 48.0 + phase)).sin();
        let piece = 4_800..43_000;
        let (mut c, mut s) = (0.0, 0.0);
        for n in piece.clone() {
            c += 2.0 * f64::from(sound[n]) * tone(n, 0.0) / piece.len() as f64;
            s += 2.0 * f64::from(sound[n]) * tone(n, 0.25) / piece.len() as f64;
        }
        let rest = |n: usize| f64::from(sound[n]) - c * tone(n, 0.0) - s * tone(n, 0.25);
        let power = piece.clone().map(|n| rest(n).powi(2)).sum::<f64>() / piece.len() as f64;
        10.0 * (power / (0.5 * (c * c + s * s))).log10()
    };
    let own_db = seams(48_000, 0.01);
    for begin_s in [0.01, 0.010_007, 0.010_013] {
        let found_db = seams(44_100, begin_s);
        println!("{begin_s} s: seams of {found_db:.1} dB; at their own rate {own_db:.1} dB");
        assert!(found_db < own_db + 3.0, "{begin_s} s: {found_db} dB, {own_db} dB");
    }
}

#[test]
fn a_grain_that_there_is_not_is_told() {
    use crate::score::Action;
    use crate::synth::source::Source;
    let (grains, _) = tone(48_000);
    let count = grains.dictionary.grains().len() as u32;
    let mut source = Source::new(&grains, RATE_HZ, Random::new(0, 0)).unwrap();
    assert!(source.cue(0.0, &Action::Grain(plain(count - 1))).is_ok());
    let fault = source.cue(0.0, &Action::Grain(plain(count))).unwrap_err().to_string();
    assert!(fault.contains(&format!("its corpus has {count}")), "{fault}");
}
