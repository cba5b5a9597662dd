//! Rolling neither drones nor repeats: no period of its envelope and no line of its spectrum that the recordings lack.

mod data;

use std::f64::consts::TAU;
use std::sync::Arc;

use data::data;
use froufrou::corpus::dictionary::{Action, Dictionary, Example, Settings};
use froufrou::corpus::grains::Contact;
use froufrou::corpus::recording::Recording;
use froufrou::random::Random;
use froufrou::score::retarget::{Course, Repertoire, Stream};
use realfft::RealFftPlanner;

const COURSE: Course = Course { pitch: 1.0, spread: 0.0, force_n: 10.0, speed_mps: 1.0 };

fn rolling(name: &str, samples: Vec<f32>, rate_hz: u32) -> Example {
    Example { name: name.into(), samples, rate_hz, contact: Contact::Continuous, action: Action::Roll }
}

/// So many seconds of a corpus that rolls, as a game at 60 steps a second asks for it.
fn roll(repertoire: &Arc<Repertoire>, seconds: f64) -> Vec<f64> {
    let mut stream = Stream::new(repertoire, Action::Roll, Random::new(4, 4));
    let dictionary = repertoire.dictionary();
    let rate_hz = f64::from(dictionary.rate_hz());
    let mut sound = vec![0.0; (seconds * rate_hz) as usize];
    for step in 1..=(seconds * 60.0) as u32 {
        for play in stream.until(f64::from(step) / 60.0, COURSE, repertoire, None).unwrap() {
            let begin = (play.time_s * rate_hz).round() as usize;
            for (n, &sample) in dictionary.samples(play.grain.number as usize).iter().enumerate() {
                if let Some(to) = sound.get_mut(begin + n) {
                    *to += play.grain.gain * f64::from(sample);
                }
            }
        }
    }
    sound
}

/// By how much the normalised autocorrelation of an envelope's ups and downs rises again, at lags from 50 ms to 2 s or half
/// of the sound: what swells slowly is alike for a while, and only what repeats is alike again.
fn periodicity(sound: &[f64], rate_hz: f64) -> f64 {
    let step = (0.005 * rate_hz) as usize;
    let envelope: Vec<f64> =
        sound.chunks_exact(step).map(|piece| piece.iter().map(|v| v * v).sum::<f64>().sqrt()).collect();
    let mean = envelope.iter().sum::<f64>() / envelope.len() as f64;
    let swings: Vec<f64> = envelope.iter().map(|v| v - mean).collect();
    let at = |lag: usize| swings.iter().zip(&swings[lag..]).map(|(a, b)| a * b).sum::<f64>();
    let (mut least, mut rise) = (f64::INFINITY, 0.0f64);
    for lag in 10..400.min(swings.len() / 2) {
        let alike = at(lag) / at(0);
        least = least.min(alike);
        rise = rise.max(alike - least);
    }
    rise
}

/// Mean power in bins of 8192 samples.
fn spectrum(sound: &[f64]) -> Vec<f64> {
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(8192);
    let mut sums = vec![0.0; 4097];
    for frame in sound.windows(8192).step_by(4096) {
        let window = |n: usize| 0.5 - 0.5 * (TAU * n as f64 / 8192.0).cos();
        let mut input: Vec<f64> = frame.iter().enumerate().map(|(n, v)| v * window(n)).collect();
        let mut bins = fft.make_output_vec();
        fft.process(&mut input, &mut bins).unwrap();
        sums.iter_mut().zip(&bins).for_each(|(sum, bin)| *sum += bin.norm_sqr());
    }
    sums
}

/// By how much a bin stands out from its neighbours, in decibels.
fn line_db(spectrum: &[f64], bin: usize) -> f64 {
    let around: f64 =
        (bin - 20..bin - 4).chain(bin + 5..bin + 21).map(|bin| spectrum[bin]).sum::<f64>() / 32.0;
    10.0 * (spectrum[bin] / around).log10()
}

/// Holds what a corpus rolls like against its recordings.
fn check(name: &str, examples: Vec<Example>) {
    let repertoire =
        Arc::new(Repertoire::new(Arc::new(Dictionary::build(examples, None, &Settings::default()).unwrap())));
    let dictionary = repertoire.dictionary();
    let rate_hz = f64::from(dictionary.rate_hz());
    let recorded: Vec<Vec<f64>> = (0..dictionary.recordings().len())
        .map(|n| dictionary.sound(n).iter().map(|&v| f64::from(v)).collect())
        .collect();
    let sound = roll(&repertoire, 60.0);
    let own = recorded.iter().map(|sound| periodicity(sound, rate_hz)).fold(0.0, f64::max);
    let found = periodicity(&sound, rate_hz);
    // A second of it in a loop would be found.
    let looped: Vec<f64> = sound.iter().take(rate_hz as usize).copied().cycle().take(sound.len()).collect();
    assert!(periodicity(&looped, rate_hz) > 0.8, "{name}");
    let (lines, own_lines) = (spectrum(&sound), spectrum(&recorded.concat()));
    // Within a bin to either side: a line lies where it likes between two of them.
    let own_db = |bin: usize| (bin - 1..=bin + 1).map(|bin| line_db(&own_lines, bin)).fold(0.0, f64::max);
    let (bin, off_db) = (25..4000)
        .map(|bin| (bin, line_db(&lines, bin) - own_db(bin)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap();
    println!(
        "{name}: envelope repeats by {found:.3}, recordings by {own:.3}; lines stand out by at most {off_db:.1} dB more, at {:.0} Hz",
        bin as f64 * rate_hz / 8192.0
    );
    assert!(found < own.max(0.1) + 0.05, "{name}: {found} {own}");
    assert!(off_db < 6.0, "{name}: {off_db} dB");
}

#[test]
fn rough_noise_with_a_hum_does_not_drone() {
    let rumble = |seed: u64| {
        let random = Random::new(seed, 77);
        let (mut low, mut swell) = (0.0, 0.0);
        let samples = (0..4 * 44_100u64).map(|n| {
            low += 0.1 * (random.normal(n) - low);
            swell += 0.001 * (random.normal(1 << 40 | n) - swell);
            let hum = (TAU * 740.0 * n as f64 / 44_100.0).sin();
            ((low * (1.0 + 20.0 * swell) + 0.05 * hum) * 0.2) as f32
        });
        rolling(&format!("rumble {seed}"), samples.collect(), 44_100)
    };
    check("rumble", vec![rumble(8), rumble(9)]);
}

#[test]
fn real_recordings_do_not_drone() {
    let Some(folder) = data("audio/sonniss_gdc_bundle3") else { return };
    for name in [
        "Marbles_Handling_Marbles_02",
        "Metal_Metal_Metal_Tube_Rolling_On_Metal_Bars_U87",
        "Rolling_Objects_Aluminum_Can_Rolling_And_Bouncing_On_Concrete",
        "Rolling_Objects_Metallic_Ball_Rolling_On_Concrete_02",
    ] {
        let recording = Recording::open(folder.join(format!("{name}.ogg"))).unwrap();
        let mut samples = recording.mono();
        samples.truncate(8 * recording.rate_hz as usize);
        check(name, vec![rolling(name, samples, recording.rate_hz)]);
    }
}
