use std::f64::consts::TAU;

use proptest::prelude::*;

use super::*;
use crate::random::Random;

const RATE_HZ: u32 = 44_100;
const FIXTURE: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/grains.tsv"));

/// The figures of one kind of row of `oracles/grain_fixtures.py`.
fn figures(what: &str) -> Vec<Vec<f64>> {
    let rows = FIXTURE.lines().filter_map(|line| line.strip_prefix(what)?.strip_prefix('\t'));
    rows.map(|row| row.split('\t').map(|v| v.parse().unwrap()).collect()).collect()
}

/// The sound of `oracles/grain_fixtures.py`.
fn hits() -> Vec<f32> {
    (0..12_000)
        .map(|i| {
            let t = f64::from(i) / f64::from(RATE_HZ);
            let mut value = 0.05 * (TAU * (400.0 + 3000.0 * t) * t).cos();
            for (start, hz) in [(0.03, 900.0), (0.09, 2500.0), (0.17, 5200.0)] {
                let later = f64::max(t - start, 0.0);
                value += 0.5 * (-60.0 * later).exp() * (TAU * hz * later).sin();
            }
            value as f32
        })
        .collect()
}

fn noise(seed: u64, length: usize) -> Vec<f32> {
    let random = Random::new(seed, 0);
    (0..length as u64).map(|i| 2.0 * random.uniform(i) as f32 - 1.0).collect()
}

#[test]
fn the_flux_is_that_of_scipy() {
    let flux = Extraction::default().flux(&hits(), RATE_HZ).unwrap();
    let wanted = figures("flux");
    assert_eq!(flux.len(), wanted.len());
    for row in wanted {
        assert!((flux[row[0] as usize] - row[1]).abs() < 1e-5, "{row:?} {}", flux[row[0] as usize]);
    }
}

#[test]
fn the_inflections_are_those_of_scipy() {
    let extraction = Extraction::default();
    let flux = extraction.flux(&hits(), RATE_HZ).unwrap();
    let smooth = flux::smoothed(&flux, extraction.smoothing_s * f64::from(RATE_HZ) / 128.0);
    let found = flux::inflections(&smooth);
    let last = flux.len() as f64 - 10.0;
    let middle: Vec<_> = found.iter().filter(|i| i.place >= 10.0 && i.place < last).collect();
    let wanted = figures("inflection");
    assert_eq!(middle.len(), wanted.len());
    assert!(wanted.len() > 5);
    for (ours, row) in middle.iter().zip(wanted) {
        assert!((ours.place - row[0]).abs() < 0.05, "{} {row:?}", ours.place);
        assert!((ours.slope - row[1]).abs() < 1e-4, "{} {row:?}", ours.slope);
    }
}

#[test]
fn the_window_and_the_centroid_are_those_of_scipy_and_librosa() {
    let windows = figures("tukey");
    assert!(windows.len() > 100);
    for row in windows {
        let ours = tukey(row[0] as usize, row[1])[row[2] as usize];
        assert!((ours - row[3]).abs() < 1e-9, "{row:?} {ours}");
    }
    let ours = centroid_hz(&hits()[3000..5048], RATE_HZ, &mut RealFftPlanner::new());
    let wanted = figures("centroid")[0][0];
    assert!((ours / wanted - 1.0).abs() < 1e-4, "{ours} {wanted}");
}

#[test]
fn a_change_of_tone_is_cut_out() {
    // From a low tone to a high one and back; the flux has a peak at each change, which bends over on both sides.
    let sound: Vec<f32> = (0..44_100)
        .map(|i| {
            let hz = if (15_000..30_000).contains(&i) { 3000.0 } else { 500.0 };
            (TAU * hz * f64::from(i) / f64::from(RATE_HZ)).sin() as f32
        })
        .collect();
    let extraction = Extraction::default();
    let cuts = extraction.cuts(&sound, RATE_HZ).unwrap();
    for change in [15_000usize, 30_000] {
        let before = cuts.iter().filter(|&&c| c < change).map(|c| change - c).min().unwrap();
        let after = cuts.iter().filter(|&&c| c > change).map(|c| c - change).min().unwrap();
        // One standard deviation of the smoothing, and half the frame that smears the change.
        assert!(before < 450 && after < 450, "{change}: {before} before, {after} after");
        assert!(before.abs_diff(after) < 70, "{change}: {before} before, {after} after");
    }
}

#[test]
fn segments_cover_the_sound_once() {
    let extraction = Extraction::default();
    let sound = [hits(), noise(1, 40_000), vec![0.0; 20_000]].concat();
    let cuts = extraction.cuts(&sound, RATE_HZ).unwrap();
    assert_eq!((cuts[0], cuts[cuts.len() - 1]), (0, sound.len()));
    assert!(cuts.windows(2).all(|pair| (300..=3000).contains(&(pair[1] - pair[0]))));
    let grains = extraction.extract(&[(&sound, GrainKind::Impulsive)], RATE_HZ).unwrap();
    assert!(grains.windows(2).all(|pair| pair[0].start + pair[0].samples.len() <= pair[1].start));
    // Silence makes no grains, and nothing else is lost.
    assert!(grains.iter().all(|g| g.start < 52_000));
    let all = Extraction { threshold_db: f64::NEG_INFINITY, ..extraction };
    let kept: f64 =
        all.extract(&[(&sound, GrainKind::Impulsive)], RATE_HZ).unwrap().iter().map(|g| g.energy).sum();
    assert!((kept / energy(&sound) - 1.0).abs() < 1e-12);
}

#[test]
fn a_grain_is_its_piece_under_the_window() {
    let sound = hits();
    for grain in Extraction::default().extract(&[(&sound, GrainKind::Transient)], RATE_HZ).unwrap() {
        let piece = &sound[grain.start..][..grain.samples.len()];
        let window = tukey(piece.len(), 0.02);
        assert!(
            piece
                .iter()
                .zip(&grain.samples)
                .zip(&window)
                .all(|((p, s), w)| (f64::from(*p) * w - f64::from(*s)).abs() < 1e-6)
        );
        assert_eq!(grain.kind, GrainKind::Transient);
        assert!((grain.energy - energy(piece)).abs() < 1e-12);
        assert!((100.0..15_000.0).contains(&grain.centroid_hz));
    }
    // The power of steady sound is that without a window.
    let hiss = noise(4, 100_000);
    let window = tukey(hiss.len(), 0.02);
    let windowed: f64 = hiss.iter().zip(&window).map(|(v, w)| (f64::from(*v) * w).powi(2)).sum();
    assert!((windowed / energy(&hiss) - 1.0).abs() < 0.001);
}

#[test]
fn a_shift_by_hops_shifts_the_cuts_and_a_gain_leaves_them() {
    let extraction = Extraction::default();
    let quiet = |hops: usize| vec![0.0; 128 * hops];
    let plain = [quiet(100), hits(), quiet(200)].concat();
    let shifted = [quiet(140), hits(), quiet(160)].concat();
    let inside = |sound: &[f32], from: usize| -> Vec<usize> {
        let cuts = extraction.cuts(sound, RATE_HZ).unwrap();
        cuts.into_iter().filter(|c| (from..from + 12_000).contains(c)).map(|c| c - from).collect()
    };
    let cuts = inside(&plain, 12_800);
    assert!(cuts.len() > 5);
    assert_eq!(cuts, inside(&shifted, 17_920));
    let louder: Vec<f32> = plain.iter().map(|v| v * 16.0).collect();
    assert_eq!(cuts, inside(&louder, 12_800));
}

#[test]
fn loud_grains_are_kept_and_quiet_ones_dropped() {
    let sound: Vec<f32> =
        noise(5, 44_100).iter().enumerate().map(|(i, v)| if i < 22_050 { *v } else { v * 0.001 }).collect();
    let count = |threshold_db: f64| {
        let extraction = Extraction { threshold_db, ..Extraction::default() };
        let grains = extraction.extract(&[(&sound, GrainKind::Impulsive)], RATE_HZ).unwrap();
        (grains.len(), grains.iter().filter(|g| g.start > 22_050).count())
    };
    let ((few, late_of_few), (many, late_of_many)) = (count(-50.0), count(-70.0));
    assert!(few > 10 && late_of_few == 0);
    assert!(many > few && late_of_many > 10);
}

#[test]
fn a_continuous_recording_gives_grains_of_both_parts() {
    let sound: Vec<f32> =
        noise(6, 44_100).iter().enumerate().map(|(i, v)| 0.1 * v + 0.5 * (i as f32 * 0.1).sin()).collect();
    let extraction = Extraction::default();
    let model = SpectralModel::default();
    let grains = extraction.extract_recording(&sound, RATE_HZ, Contact::Continuous, &model).unwrap();
    let of = |kind: GrainKind| grains.iter().filter(move |g| g.kind == kind);
    assert!(of(GrainKind::Sinusoidal).count() > 5 && of(GrainKind::Transient).count() > 5);
    assert_eq!(of(GrainKind::Impulsive).count(), 0);
    let mean = |kind: GrainKind| of(kind).map(|g| g.centroid_hz).sum::<f64>() / of(kind).count() as f64;
    assert!(mean(GrainKind::Sinusoidal) < mean(GrainKind::Transient));
    let struck = extraction.extract_recording(&sound, RATE_HZ, Contact::Impulsive, &model).unwrap();
    assert!(struck.iter().all(|g| g.kind == GrainKind::Impulsive));
}

#[test]
fn hits_are_guessed_impulsive_and_hiss_continuous() {
    let hit: Vec<f32> = (0..88_200).map(|i| (-(i as f32) / 2000.0).exp() * (i as f32 * 0.3).sin()).collect();
    assert_eq!(Contact::guess(&hit, RATE_HZ).unwrap(), Contact::Impulsive);
    assert_eq!(Contact::guess(&noise(7, 88_200), RATE_HZ).unwrap(), Contact::Continuous);
    assert_eq!(Contact::guess(&[0.0], RATE_HZ).unwrap(), Contact::Impulsive);
}

#[test]
fn odd_sounds_give_grains_or_errors() {
    let extraction = Extraction::default();
    let grains = |sound: &[f32]| extraction.extract(&[(sound, GrainKind::Impulsive)], RATE_HZ);
    assert_eq!(grains(&[0.0; 10_000]).unwrap(), []);
    assert_eq!(grains(&[0.5]).unwrap().len(), 1);
    assert_eq!(grains(&[0.5; 100]).unwrap()[0].samples.len(), 100);
    let constant = grains(&[0.5; 50_000]).unwrap();
    assert!(constant.iter().all(|g| g.samples.len() <= 3000 && g.centroid_hz < 11_025.0));
    assert_eq!(grains(&[]).unwrap_err().to_string(), "expected sound, found 0 samples");
    assert!(grains(&[0.0, f32::INFINITY]).unwrap_err().to_string().contains("sample 1"));
    assert!(extraction.flux(&[0.0; 9], 10).is_err());
    for bad in [
        Extraction { frame_s: f64::NAN, ..extraction.clone() },
        Extraction { hop_s: -1.0, ..extraction.clone() },
        Extraction { longest_s: 0.01, ..extraction.clone() },
        Extraction { taper: 1.5, ..extraction.clone() },
        Extraction { smoothing_s: f64::INFINITY, ..extraction.clone() },
        Extraction { threshold_db: f64::NAN, ..extraction.clone() },
    ] {
        let message = bad.cuts(&[0.0; 100], RATE_HZ).unwrap_err().to_string();
        assert!(message.contains("expected"), "{message}");
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    let sound = noise(8, 60_000);
    let grains = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Extraction::default().extract(&[(&sound, GrainKind::Impulsive)], RATE_HZ).unwrap())
    };
    assert_eq!(grains(1), grains(3));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn any_sound_at_any_rate_is_cut_into_lengths_that_were_asked_for(
        length in 1usize..20_000,
        seed in any::<u64>(),
        rate_hz in 8_000u32..=192_000,
    ) {
        let sound = noise(seed, length);
        let cuts = Extraction::default().cuts(&sound, rate_hz).unwrap();
        let seconds = |samples: f64| samples * f64::from(rate_hz) / 44_100.0;
        prop_assert_eq!(cuts[cuts.len() - 1], length);
        for pair in cuts.windows(2) {
            let span = (pair[1] - pair[0]) as f64;
            prop_assert!(span <= seconds(3000.0) + 1.0);
            prop_assert!(span >= seconds(300.0) - 1.0 || cuts.len() == 2);
        }
    }
}
