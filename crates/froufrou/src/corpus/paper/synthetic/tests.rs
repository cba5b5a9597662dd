use super::*;
use crate::corpus::cloth::spectra::centroid_hz;
use crate::corpus::paper::quadratic_chi::distance;
use crate::corpus::paper::{BINS, SPACING_HZ};

const CM: f64 = 0.01;

fn all() -> Vec<Paper> {
    Paper::names().map(|name| Paper::named(&name).unwrap().unwrap()).collect()
}

/// A rectangle with edges in centimetres: as long as its rulings, and as its curved border.
fn rectangle(ruling_cm: f64, width_cm: f64) -> Shape {
    Shape::rectangle(ruling_cm * CM, 2.0 * width_cm * CM)
}

fn density(paper: &Paper, shape: &Shape) -> Vec<f64> {
    paper.density(Some(shape), 0, SPACING_HZ, BINS)
}

fn apart(paper: &Paper, a: &Shape, b: &Shape) -> f64 {
    distance((&density(paper, a), SPACING_HZ), (&density(paper, b), SPACING_HZ)).unwrap()
}

#[test]
fn sizes_move_spectra_more_than_compression_and_outline_do() {
    // Table 1 of Schreck et al. (2016): sizes 0.04 to 0.16, compression and outline 0.01 to 0.05.
    for paper in all() {
        let base = rectangle(10.0, 10.0);
        let mut sizes = Vec::new();
        for (from, to) in [(5.0, 10.0), (10.0, 20.0), (5.0, 20.0)] {
            sizes.push(apart(&paper, &rectangle(from, 10.0), &rectangle(to, 10.0)));
            sizes.push(apart(&paper, &rectangle(10.0, from), &rectangle(10.0, to)));
        }
        let compressed = |compression| Shape { compression, ..base };
        let trapezoids = [base, Shape { border_taper: 0.6, ..base }, Shape { ruling_taper: 0.6, ..base }];
        let mut others = Vec::new();
        for (a, b) in [(0.2, 0.4), (0.4, 0.8), (0.2, 0.8)] {
            others.push(apart(&paper, &compressed(a), &compressed(b)));
        }
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            others.push(apart(&paper, &trapezoids[a], &trapezoids[b]));
        }
        println!("{}: sizes {sizes:.3?}, others {others:.3?}", paper.name());
        let least = sizes.iter().copied().fold(f64::INFINITY, f64::min);
        let most = others.iter().copied().fold(0.0, f64::max);
        assert!(least > 1.2 * most, "{}: {sizes:?} {others:?}", paper.name());
        assert!(sizes.iter().all(|d| (0.04..0.30).contains(d)), "{sizes:?}");
        assert!(others.iter().all(|d| (0.005..0.07).contains(d)), "{others:?}");
        // From 5 to 20 cm is further than either half of the way.
        assert!(sizes[4] > sizes[0].max(sizes[2]));
    }
}

#[test]
fn spectra_move_up_from_a4_to_a6_and_what_is_flat_is_nearly_white_and_quieter() {
    for paper in all() {
        // Figure 12: A4, half of it, A5 and A6, folded so that half of the sheet is free.
        let sheets = [(21.0, 14.85), (21.0, 7.4), (10.5, 14.85), (10.5, 7.4)];
        let centroids: Vec<f64> =
            sheets.map(|(a, b)| centroid_hz(&density(&paper, &rectangle(a, b)), SPACING_HZ)).to_vec();
        assert!(centroids[0] < centroids[1] && centroids[0] < centroids[2], "{centroids:?}");
        assert!(centroids[1] < centroids[3] && centroids[2] < centroids[3], "{centroids:?}");
        let level = |density: &[f64]| density.iter().map(|a| a * a * SPACING_HZ).sum::<f64>().sqrt();
        let flat = paper.density(None, 0, SPACING_HZ, BINS);
        let folded = density(&paper, &rectangle(21.0, 14.85));
        assert!((0.05..0.5).contains(&(level(&flat) / level(&folded))));
        // White within some decibels from 400 Hz to 12 kHz.
        let band = |hz: f64| 20.0 * flat[(hz / SPACING_HZ) as usize].log10();
        let levels = [400.0, 800.0, 1600.0, 3200.0, 6400.0, 12_000.0].map(band);
        let spread = levels.iter().copied().fold(f64::NEG_INFINITY, f64::max)
            - levels.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(spread < 6.0, "{levels:?}");
    }
}

/// The middle of the energy over frequency, in hertz.
fn pitch_hz(samples: &[f32], rate_hz: f64) -> f64 {
    let mut planner = realfft::RealFftPlanner::<f32>::new();
    let forward = planner.plan_fft_forward(samples.len());
    let (mut input, mut output) = (samples.to_vec(), forward.make_output_vec());
    forward.process(&mut input, &mut output).unwrap();
    let powers: Vec<f64> = output.iter().skip(1).map(|bin| f64::from(bin.norm_sqr())).collect();
    centroid_hz(&powers, rate_hz / samples.len() as f64)
}

#[test]
fn flaps_are_lower_and_longer_the_larger_they_are() {
    for paper in all() {
        let mean = |ruling_cm: f64, width_cm: f64| {
            let shape = rectangle(ruling_cm, width_cm);
            (0..6).map(|n| pitch_hz(&paper.flap(&shape, n, 44_100.0), 44_100.0)).sum::<f64>() / 6.0
        };
        let pitches = [2.5, 5.0, 10.0, 20.0].map(|size| mean(size, size));
        assert!(pitches.windows(2).all(|pair| pair[0] > 1.1 * pair[1]), "{pitches:?}");
        assert!(mean(5.0, 10.0) > mean(20.0, 10.0) && mean(10.0, 5.0) > mean(10.0, 15.0));
        let lengths = [1.25, 5.0, 15.0, 30.0].map(|size| Paper::flap_s(&rectangle(size, size / 2.0)));
        assert!(lengths.windows(2).all(|pair| pair[0] < pair[1]), "{lengths:?}");
        assert!(lengths.iter().all(|length| (0.2..=0.8).contains(length)));
    }
    // Tracing paper is brighter than printing paper, and a bank note duller.
    let flap = |paper: &Paper| -> f64 {
        (0..6).map(|n| pitch_hz(&paper.flap(&rectangle(10.0, 10.0), n, 44_100.0), 44_100.0)).sum()
    };
    let [printer, tracing, banknote] = [&all()[0], &all()[1], &all()[2]].map(flap);
    assert!(banknote < printer && printer < tracing, "{banknote} {printer} {tracing}");
}

#[test]
fn clips_snap_when_they_say_begin_and_end_in_silence_and_are_as_loud_at_any_rate() {
    for paper in all() {
        for rate_hz in [44_100.0, 48_000.0, 96_000.0] {
            let flap = paper.flap(&rectangle(10.0, 10.0), 3, rate_hz);
            assert_eq!(flap.len(), (Paper::flap_s(&rectangle(10.0, 10.0)) * rate_hz).round() as usize);
            let lead = (FLAP_LEAD_S * rate_hz) as usize;
            let energy = |part: &[f32]| part.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / rate_hz;
            assert!(energy(&flap[..lead]) < 0.1 * energy(&flap));
            assert!(energy(&flap[lead..2 * lead]) > 0.1 * energy(&flap));
            let wanted = paper.energies[0] * (rectangle(10.0, 10.0).disk_m() / REFERENCE_DISK_M).powf(1.4);
            assert!((energy(&flap) / wanted - 1.0).abs() < 1e-3);
            assert_eq!(flap[0], 0.0);
            assert!(flap.iter().all(|v| v.abs() < 0.99) && flap[flap.len() - 1].abs() < 1e-4);
            for clac in (0..CLACS as u64).map(|n| paper.clac(n, rate_hz)) {
                // A few milliseconds: nearly all of it in 8.
                let few = (0.008 * rate_hz) as usize;
                assert!(energy(&clac[..few]) > 0.98 * energy(&clac));
                assert!(clac.iter().any(|v| v.abs() > 0.01) && clac.iter().all(|v| v.abs() < 0.99));
            }
        }
    }
}

#[test]
fn models_are_known_by_name_and_their_clips_differ() {
    assert_eq!(Paper::names().count(), 3);
    assert!(Paper::named("corpora/kraft").is_none());
    let error = Paper::named("synthetic/silk").unwrap().unwrap_err().to_string();
    assert!(error.contains("synthetic/printer"), "{error}");
    let paper = Paper::printer();
    let shape = rectangle(5.0, 5.0);
    assert_eq!(paper.flap(&shape, 1, 48_000.0), paper.flap(&shape, 1, 48_000.0));
    assert_ne!(paper.flap(&shape, 1, 48_000.0), paper.flap(&shape, 2, 48_000.0));
    assert_ne!(paper.clac(1, 48_000.0), paper.clac(2, 48_000.0));
    assert!(paper.fibre(0, 48_000.0).iter().any(|v| *v != 0.0));
}
