//! Needle, stick–slip and turbulence: spectra, rates and levels against what they are defined to be.

use std::f64::consts::TAU;

use froufrou::random::Random;
use froufrou::synth::instrument::{Instrument, Ramp, Stretch, stretch_samples};
use froufrou::synth::needle::Needle;
use froufrou::synth::stick_slip::{HALF, StickSlip};
use froufrou::synth::turbulence::Turbulence;
use proptest::prelude::*;
use realfft::RealFftPlanner;

fn parameters(given: &[(&str, f64)]) -> Vec<(String, f64)> {
    given.iter().map(|&(name, value)| (name.to_owned(), value)).collect()
}

/// Renders with a speed that is given at each time; other controls are 1.
fn render(instrument: &dyn Instrument, rate_hz: f64, seconds: f64, speed: impl Fn(f64) -> f64) -> Vec<f32> {
    let mut generator = instrument.generator(rate_hz, Random::new(3, 4)).unwrap();
    let count = stretch_samples(rate_hz);
    let mut out = vec![f32::NAN; (seconds * rate_hz) as usize / count * count];
    for (index, out) in out.chunks_mut(count).enumerate() {
        let first = (index * count) as u64;
        let time_s = |frame: u64| frame as f64 / rate_hz;
        let mut controls = vec![Ramp { from: speed(time_s(first)), to: speed(time_s(first + count as u64)) }];
        controls.resize(instrument.controls().len(), Ramp::still(1.0));
        generator
            .generate(&Stretch { first, rate_hz, controls: &controls, strikes: &[], grains: &[] }, out)
            .unwrap();
    }
    out
}

const WINDOW: usize = 1 << 14;

/// Power a hertz by Welch's method with Hann windows: index times the rate over the window.
fn welch(signal: &[f32], rate_hz: f64) -> Vec<f64> {
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(WINDOW);
    let hann: Vec<f64> = (0..WINDOW).map(|n| 0.5 - 0.5 * (TAU * n as f64 / WINDOW as f64).cos()).collect();
    let scale = 2.0 / (rate_hz * hann.iter().map(|w| w * w).sum::<f64>());
    let mut sum = vec![0.0; WINDOW / 2 + 1];
    let (mut spectrum, mut windows) = (fft.make_output_vec(), 0);
    for start in (0..=signal.len() - WINDOW).step_by(WINDOW / 2) {
        let mut input: Vec<f64> =
            signal[start..start + WINDOW].iter().zip(&hann).map(|(&x, w)| f64::from(x) * w).collect();
        fft.process(&mut input, &mut spectrum).unwrap();
        for (sum, bin) in sum.iter_mut().zip(&spectrum) {
            *sum += bin.norm_sqr() * scale;
        }
        windows += 1;
    }
    sum.iter().map(|power| power / f64::from(windows)).collect()
}

/// Mean power a hertz in a band.
fn density(spectrum: &[f64], rate_hz: f64, low_hz: f64, high_hz: f64) -> f64 {
    let bin = |hz: f64| (hz * WINDOW as f64 / rate_hz).round() as usize;
    let band = &spectrum[bin(low_hz)..bin(high_hz)];
    band.iter().sum::<f64>() / band.len() as f64
}

fn db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

fn power(signal: &[f32]) -> f64 {
    signal.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>() / signal.len() as f64
}

/// Levels of third octaves against a law, in decibels: centre frequency and deviation.
fn thirds(
    spectrum: &[f64],
    rate_hz: f64,
    from_hz: f64,
    to_hz: f64,
    law: impl Fn(f64) -> f64,
) -> Vec<(f64, f64)> {
    let mut levels = Vec::new();
    let mut low = from_hz;
    while low * 1.26 < to_hz {
        let bins =
            (low * WINDOW as f64 / rate_hz).ceil() as usize..(low * 1.26 * WINDOW as f64 / rate_hz) as usize;
        let expected: f64 = bins.clone().map(|bin| law(bin as f64 * rate_hz / WINDOW as f64)).sum();
        levels.push((low * 1.12, db(spectrum[bins].iter().sum::<f64>() / expected)));
        low *= 1.26;
    }
    levels
}

/// The slope in decibels an octave of what deviates from a law.
fn fit(levels: &[(f64, f64)]) -> f64 {
    let n = levels.len() as f64;
    let (mx, my) = levels.iter().fold((0.0, 0.0), |(a, b), (hz, level)| (a + hz.log2() / n, b + level / n));
    let (mut xy, mut xx) = (0.0, 0.0);
    for (hz, level) in levels {
        xy += (hz.log2() - mx) * (level - my);
        xx += (hz.log2() - mx).powi(2);
    }
    xy / xx
}

#[test]
fn a_needle_has_its_slope_at_every_speed_and_rate() {
    let (finest, coarsest, octaves) = (1e-5, 1e-5 * 2048.0, 11.0);
    for (slope, speed, rate_hz) in [
        (-3.0, 1.0, 48_000.0),
        (-3.0, 0.3, 48_000.0),
        (-3.0, 0.613, 44_100.0),
        (-6.0, 0.45, 48_000.0),
        (0.0, 0.55, 96_000.0),
        (3.0, 0.4, 48_000.0),
    ] {
        let given = parameters(&[("slope", slope), ("finest", finest), ("coarsest", coarsest)]);
        let out = render(&Needle::new(&given).unwrap(), rate_hz, 40.0, |_| speed);
        let spectrum = welch(&out[4800..], rate_hz);
        // The law in full: the variance of 1/16 spread over all octaves of the profile.
        let exponent: f64 = -slope / 3.0;
        let (low, high): (f64, f64) = (0.5 / finest * 2f64.powf(-octaves), 1.0 / finest);
        // From the middle of the crossover at the coarse end to the finest wavelength.
        let low = 2.0 * low;
        let integral = if exponent == 1.0 {
            (high / low).ln()
        } else {
            (high.powf(1.0 - exponent) - low.powf(1.0 - exponent)) / (1.0 - exponent)
        };
        let law = |hz: f64| (hz / speed).powf(-exponent) / speed / integral / 16.0;
        let from_hz = (2.5 * speed / coarsest).max(30.0);
        let to_hz = (rate_hz / 2.0).min(speed / finest) * 5.0 / 6.0;
        let levels = thirds(&spectrum, rate_hz, from_hz, to_hz, law);
        assert!(levels.len() >= 18, "six octaves at least");
        let off = fit(&levels);
        let worst = levels.iter().fold(0.0f64, |a, (_, level)| a.max(level.abs()));
        println!(
            "slope {slope} at {speed} m/s, {rate_hz} Hz: off by {off:.3} dB/octave, worst third {worst:.2} dB"
        );
        assert!(off.abs() < 0.1, "{slope} {speed}: {off} dB an octave: {levels:?}");
        assert!(worst < 1.0, "{slope} {speed}: {levels:?}");
    }
}

#[test]
fn a_needle_at_twice_the_speed_reads_the_same_twice_as_fast() {
    // All of the profile below both Nyquist frequencies: read at 2v, sample n is sample 2n at v.
    let fine = Needle::new(&parameters(&[("finest", 1e-4), ("coarsest", 0.1)])).unwrap();
    let slow = render(&fine, 48_000.0, 2.0, |_| 0.9);
    let fast = render(&fine, 48_000.0, 1.0, |_| 1.8);
    let error = |slow: &[f32], fast: &[f32]| {
        let error: f64 = (4800..fast.len()).map(|n| f64::from(fast[n] - slow[2 * n]).powi(2)).sum();
        db(error / fast[4800..].iter().map(|&x| f64::from(x).powi(2)).sum::<f64>())
    };
    println!("within the finest octave: {:.1} dB", error(&slow, &fast));
    assert!(error(&slow, &fast) < -100.0);
    // Read from two octaves of resolution: their shares below both Nyquist frequencies agree.
    let brown = Needle::new(&parameters(&[("slope", -12.0), ("finest", 1e-6), ("coarsest", 0.01)])).unwrap();
    let slow = render(&brown, 48_000.0, 2.0, |_| 0.3);
    let fast = render(&brown, 48_000.0, 1.0, |_| 0.6);
    println!("across octaves: {:.1} dB", error(&slow, &fast));
    assert!(error(&slow, &fast) < -60.0);
    // And their spectra are each other's, moved by an octave.
    let pink = Needle::new(&[]).unwrap();
    let slow = welch(&render(&pink, 48_000.0, 40.0, |_| 0.11)[4800..], 48_000.0);
    let fast = welch(&render(&pink, 48_000.0, 40.0, |_| 0.22)[4800..], 48_000.0);
    for low in [50.0, 200.0, 800.0, 3200.0] {
        let (a, b) =
            (density(&slow, 48_000.0, low, 1.9 * low), density(&fast, 48_000.0, 2.0 * low, 3.8 * low));
        assert!(db(a / b / 2.0).abs() < 0.5, "{low}: {}", db(a / b / 2.0));
    }
}

/// The greatest second difference of a range.
fn splash(signal: &[f32]) -> f32 {
    signal.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).fold(0.0, f32::max)
}

#[test]
fn a_needle_never_clicks_and_rests_in_silence() {
    // Speeds jump within one stretch, across many octaves of resolution, and to a stop and back.
    let speeds = [0.0, 1.0, 0.004, 0.7, 0.0, 0.3, 9.0, 0.02, 0.0];
    let needle = Needle::new(&parameters(&[("slope", -6.0)])).unwrap();
    let out = render(&needle, 48_000.0, 2.7, |t| speeds[((t / 0.3) as usize).min(8)]);
    let steady = |speed: f64| splash(&render(&needle, 48_000.0, 3.0, |_| speed)[9600..]);
    for (n, pair) in speeds.windows(2).enumerate() {
        let at = (n + 1) * 14_400;
        let jump = splash(&out[at - 200..at + 600]);
        // While the speed passes through all between, the louder of what it would give at either.
        let bound = pair.iter().chain(&[0.3]).map(|&speed| steady(speed)).fold(0.0, f32::max);
        println!("{} to {} m/s: {jump:.4}, steady {bound:.4}", pair[0], pair[1]);
        assert!(jump < 1.2 * bound, "{pair:?}: {jump} {bound}");
    }
    assert!(out[..14_000].iter().all(|&x| x == 0.0));
    // Silent 0.1 s after the stop, and for as long as it lasts.
    assert!(
        out[62_400..71_900].iter().all(|&x| x == 0.0) && out[8 * 14_400 + 4800..].iter().all(|&x| x == 0.0)
    );
    assert!(power(&out[15_000..28_000]) > 0.001);
}

/// The spectrum of a signal below a frequency, under a Hann window of a quarter of a second.
fn below(signal: &[f32], rate_hz: f64, limit_hz: f64) -> Vec<realfft::num_complex::Complex<f64>> {
    let count = (rate_hz / 4.0) as usize;
    let hann = |n: usize| 0.5 - 0.5 * (TAU * n as f64 / count as f64).cos();
    let mut input: Vec<f64> =
        (0..count).map(|n| f64::from(signal[count + n]) * hann(n) / count as f64).collect();
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(count);
    let mut spectrum = fft.make_output_vec();
    fft.process(&mut input, &mut spectrum).unwrap();
    spectrum.truncate((limit_hz / 4.0) as usize);
    spectrum
}

#[test]
fn a_needle_is_the_same_at_every_rate_and_nothing_folds_back() {
    // Most of this profile's power lies beyond 24 kHz: what folded back would be heard at the low rate.
    let needle = |slope: f64| Needle::new(&parameters(&[("slope", slope), ("finest", 1e-5)])).unwrap();
    for (slope, speed) in [(6.0, 0.93), (3.0, 0.5), (-3.0, 0.71), (-3.0, 3.1)] {
        let low = below(&render(&needle(slope), 48_000.0, 0.6, |_| speed), 48_000.0, 19_000.0);
        let high = below(&render(&needle(slope), 192_000.0, 0.6, |_| speed), 192_000.0, 19_000.0);
        let error: f64 = low.iter().zip(&high).map(|(a, b)| (a - b).norm_sqr()).sum();
        let all: f64 = high.iter().map(|b| b.norm_sqr()).sum();
        println!("slope {slope} at {speed} m/s, 48 against 192 kHz: {:.1} dB", db(error / all));
        assert!(db(error / all) < -100.0, "{slope} {speed}");
    }
    // All of a fine profile, and nothing that is too fast for the rate.
    let profile = Needle::new(&[]).unwrap();
    let level = power(&render(&profile, 48_000.0, 20.0, |_| 0.3)[4800..]).sqrt();
    assert!((level - 0.25).abs() < 0.015, "{level}");
    assert!(render(&profile, 48_000.0, 1.0, |_| 600.0)[9600..].iter().all(|&x| x == 0.0));
}

/// Times at which a sawtooth drops through its middle, in samples.
fn drops(signal: &[f32]) -> Vec<f64> {
    let falls = |(n, w): (usize, &[f32])| {
        (w[0] > 0.0 && w[1] <= 0.0).then(|| n as f64 + f64::from(w[0] / (w[0] - w[1])))
    };
    signal.windows(2).enumerate().filter_map(falls).collect()
}

#[test]
fn slips_follow_the_speed() {
    let even = StickSlip::new(&parameters(&[("variation", 0.0)])).unwrap();
    let varied = StickSlip::new(&parameters(&[("variation", 0.5)])).unwrap();
    for speed in [0.003, 0.02, 0.11, 0.4, 0.77, 1.9, 3.3] {
        let seconds = 4.0f64.max(20.0 / (speed / 1e-3));
        let out = render(&even, 48_000.0, seconds, |_| -speed);
        let times = drops(&out[4800..]);
        let rate = (times.len() - 1) as f64 / (times[times.len() - 1] - times[0]) * 48_000.0;
        assert!((rate / (speed / 1e-3) - 1.0).abs() < 1e-3, "{speed} m/s: {rate} Hz");
        // The mean over many teeth, whose lengths vary.
        let long = render(&varied, 48_000.0, (2000.0 / (speed / 1e-3)).max(5.0), |_| speed);
        let times = drops(&long[4800..]);
        let rate = (times.len() - 1) as f64 / (times[times.len() - 1] - times[0]) * 48_000.0;
        println!("{speed} m/s: {rate:.2} slips a second with variation");
        assert!((rate / (speed / 1e-3) - 1.0).abs() < 0.01, "{speed} m/s varied: {rate} Hz");
        let lengths: Vec<f64> = times.windows(2).map(|w| (w[1] - w[0]) / 48_000.0 * speed / 1e-3).collect();
        let spread = (lengths.iter().map(|l| (l - 1.0).powi(2)).sum::<f64>() / lengths.len() as f64).sqrt();
        assert!((spread - 0.5 / 3f64.sqrt()).abs() < 0.03, "{spread}");
    }
    // A ramp: as many slips as the way that was gone.
    let ramp = |t: f64| 0.05 + 0.6 * t;
    let out = render(&even, 48_000.0, 3.0, ramp);
    let times = drops(&out);
    let way = |n: f64| {
        let t = n / 48_000.0;
        0.05 * t + 0.3 * t * t
    };
    for (slip, pair) in times.windows(2).enumerate().skip(5) {
        let gone = way(pair[1] - HALF as f64) - way(pair[0] - HALF as f64);
        assert!((gone / 1e-3 - 1.0).abs() < 0.01, "slip {slip}: {gone}");
    }
}

#[test]
fn a_sawtooth_has_its_partials_and_no_aliases() {
    // A rate on no divisor of the sample rate, and on a bin of a long window.
    let even = StickSlip::new(&parameters(&[("variation", 0.0)])).unwrap();
    let rate_hz = 48_000.0;
    for bin in [401usize, 1009, 2503] {
        let slips_hz = bin as f64 * rate_hz / 32_768.0;
        let out = render(&even, rate_hz, 2.0, |_| slips_hz * 1e-3);
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(32_768);
        let mut input: Vec<f64> = out[20_000..20_000 + 32_768].iter().map(|&x| f64::from(x)).collect();
        let mut spectrum = fft.make_output_vec();
        fft.process(&mut input, &mut spectrum).unwrap();
        let level = |k: usize| spectrum[k].norm() / 16_384.0;
        let mut worst = 0.0f64;
        for k in 1..16_384 {
            if k % bin == 0 {
                let partial = (k / bin) as f64;
                let expected = 2.0 / (std::f64::consts::PI * partial);
                // Flat to 0.4 of the sample rate.
                if (k as f64) < 0.39 * 32_768.0 {
                    assert!(
                        db((level(k) / expected).powi(2)).abs() < 0.05,
                        "partial {partial}: {}",
                        level(k)
                    );
                }
            } else {
                worst = worst.max(level(k));
            }
        }
        println!("{slips_hz:.0} slips a second: aliases {:.1} dB", 20.0 * worst.log10());
        assert!(20.0 * worst.log10() < -90.0);
    }
}

#[test]
fn slipping_is_as_loud_as_the_force_and_rests_in_silence() {
    let body = StickSlip::new(&[]).unwrap();
    let with_force = |force: f64| {
        let mut generator = body.generator(48_000.0, Random::new(1, 1)).unwrap();
        let mut all = Vec::new();
        for index in 0..200 {
            let mut out = [0.0; 96];
            let controls = [Ramp::still(if index < 100 { 0.5 } else { 0.0 }), Ramp::still(force)];
            let stretch = Stretch {
                first: index * 96,
                rate_hz: 48_000.0,
                controls: &controls,
                strikes: &[],
                grains: &[],
            };
            generator.generate(&stretch, &mut out).unwrap();
            all.extend(out);
        }
        all
    };
    let (one, three) = (with_force(1.0), with_force(3.0));
    assert!(one.iter().zip(&three).all(|(a, b)| (3.0 * a - b).abs() < 1e-5));
    assert!(one[9600 + 4800..].iter().all(|&x| x == 0.0));
    // Coming to rest lets go of the force gently.
    assert!(one[9600 + 2 * HALF..].windows(2).all(|w| (w[1] - w[0]).abs() < 0.005));
    // Faster than the sample rate can tell, nothing is left.
    let fast = render(&body, 48_000.0, 0.5, |_| 25.0);
    assert!(fast[9600..].iter().all(|x| x.abs() < 1e-4));
}

#[test]
fn turbulence_is_white_and_as_loud_as_speed_times_air() {
    let air = |air: f64| Turbulence::new(&parameters(&[("air", air)])).unwrap();
    let one = render(&air(0.1), 48_000.0, 20.0, |_| 1.0);
    for (out, factor) in [
        (render(&air(0.1), 48_000.0, 20.0, |_| -2.0), 2.0),
        (render(&air(0.4), 48_000.0, 20.0, |_| 1.0), 4.0),
        (render(&air(0.3), 48_000.0, 20.0, |_| 5.0), 15.0),
    ] {
        assert!((db(power(&out) / power(&one)) - 2.0 * db(factor)).abs() < 1e-4);
    }
    assert!((power(&one).sqrt() - 0.025).abs() < 0.0002);
    let spectrum = welch(&one, 48_000.0);
    for (hz, level) in thirds(&spectrum, 48_000.0, 100.0, 23_900.0, |_| 0.025 * 0.025 / 24_000.0) {
        assert!(level.abs() < 0.5, "{hz} Hz: {level} dB");
    }
    // As loud a hertz at every rate, with colour or without.
    let coloured = Turbulence::new(&parameters(&[("air", 0.1), ("size", 0.002)])).unwrap();
    let corner_hz: f64 = 0.2 * 10.0 / 0.002;
    for rate_hz in [22_050.0, 48_000.0, 192_000.0] {
        let spectrum = welch(&render(&air(0.1), rate_hz, 20.0, |_| 10.0), rate_hz);
        let dark = welch(&render(&coloured, rate_hz, 20.0, |_| 10.0), rate_hz);
        let white = 0.0625 / 24_000.0;
        for (low, high) in
            [(100.0, 400.0), (1000.0, 1100.0), (2000.0, 2200.0), (5000.0, 5200.0), (10_000.0, 10_400.0)]
        {
            assert!(db(density(&spectrum, rate_hz, low, high) / white).abs() < 0.3);
            let middle = f64::midpoint(low, high);
            let law = white / (1.0 + (middle / corner_hz).powi(2));
            let off = db(density(&dark, rate_hz, low, high) / law);
            assert!(off.abs() < 1.0, "{rate_hz} Hz, {middle} Hz: {off} dB");
        }
    }
}

fn any_speed() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(0.0),
        Just(f64::MAX),
        Just(f64::NAN),
        Just(f64::NEG_INFINITY),
        (-30i32..30).prop_map(|e| 10f64.powi(e)),
        -2.0..2.0f64,
    ]
}

/// A kind of sound and parameters that it takes.
fn sliding() -> impl Strategy<Value = (u8, Vec<(String, f64)>)> {
    let exponential = |low: f64, high: f64| (low.ln()..high.ln()).prop_map(f64::exp);
    prop_oneof![
        (-12.0..6.0f64, exponential(1e-7, 1.0), 0.0..1.0f64).prop_map(|(slope, finest, part)| {
            let coarsest = (finest * (1000.0 / finest).powf(part)).clamp(finest, 1000.0);
            (0, parameters(&[("slope", slope), ("finest", finest), ("coarsest", coarsest)]))
        }),
        (exponential(1e-6, 10.0), 0.0..0.95f64).prop_map(|(spacing, variation)| (
            1,
            parameters(&[("spacing", spacing), ("variation", variation)])
        )),
        (0.0..1000.0f64, prop_oneof![Just(0.0), exponential(1e-9, 1000.0)])
            .prop_map(|(air, size)| (2, parameters(&[("air", air), ("size", size)]))),
    ]
}

fn instrument((kind, given): &(u8, Vec<(String, f64)>)) -> Box<dyn Instrument> {
    match kind {
        0 => Box::new(Needle::new(given).unwrap()),
        1 => Box::new(StickSlip::new(given).unwrap()),
        _ => Box::new(Turbulence::new(given).unwrap()),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn sliding_is_finite_whatever_the_speed(
        sound in sliding(),
        rate_hz in prop::sample::select(vec![8_000.0, 22_050.0, 48_000.0, 192_000.0]),
        speeds in prop::collection::vec(any_speed(), 12),
    ) {
        let at = |t: f64| speeds[((t / 0.004).round() as usize).min(speeds.len() - 1)];
        let instrument = instrument(&sound);
        let out = render(instrument.as_ref(), rate_hz, 0.05, at);
        prop_assert!(out.iter().all(|x| x.is_finite()));
        let again = render(instrument.as_ref(), rate_hz, 0.05, at);
        prop_assert_eq!(out, again);
    }
}

#[test]
fn bad_parameters_are_refused() {
    for bad in [("finest", 0.0), ("slope", 7.0), ("coarsest", 1e-6), ("grain", 1.0), ("slope", f64::NAN)] {
        Needle::new(&parameters(&[bad])).unwrap_err();
    }
    for bad in [("spacing", 0.0), ("variation", 1.0), ("speed", 1.0)] {
        StickSlip::new(&parameters(&[bad])).unwrap_err();
    }
    for bad in [("air", -1.0), ("size", f64::INFINITY), ("colour", 1.0)] {
        Turbulence::new(&parameters(&[bad])).unwrap_err();
    }
}
