use super::*;
use crate::random::Random;

fn scattered(seed: u64, n: usize, d: usize, scale: f64) -> Vec<f64> {
    let random = Random::new(seed, 0);
    (0..(n * d) as u64).map(|i| scale * random.normal(i)).collect()
}

fn at(warp: &Warp, point: &[f64]) -> Vec<f64> {
    let mut to = vec![0.0; point.len()];
    warp.apply(point, &mut to);
    to
}

#[derive(serde::Deserialize)]
struct Case {
    name: String,
    lambda: f64,
    dimensions: usize,
    from: Vec<f64>,
    to: Vec<f64>,
    at: Vec<f64>,
    warped: Vec<f64>,
}

/// Equals NumPy's solution of the whole system, from `oracles/warp_golden.py`.
#[test]
fn equals_numpy() {
    let cases: Vec<Case> =
        serde_json::from_str(include_str!("../../../../tests/fixtures/units_warp.json")).unwrap();
    assert!(cases.len() >= 5);
    for case in cases {
        let warp = Warp::fit(case.dimensions, &case.from, &case.to, case.lambda).unwrap();
        for (point, wanted) in case.at.chunks(case.dimensions).zip(case.warped.chunks(case.dimensions)) {
            for (ours, theirs) in at(&warp, point).iter().zip(wanted) {
                assert!(
                    (ours - theirs).abs() < 1e-8 * theirs.abs().max(1.0),
                    "{}: {ours} {theirs}",
                    case.name
                );
            }
        }
    }
}

#[test]
fn without_lambda_it_goes_through_all_points() {
    for d in [1, 2, 3, 6, 13] {
        let (from, to) = (scattered(1, 60, d, 3.0), scattered(2, 60, d, 3.0));
        let warp = Warp::fit(d, &from, &to, 0.0).unwrap();
        for (from, to) in from.chunks(d).zip(to.chunks(d)) {
            for (ours, wanted) in at(&warp, from).iter().zip(to) {
                assert!((ours - wanted).abs() < 1e-7, "{d}: {ours} {wanted}");
            }
        }
    }
}

/// What is affine is found as such, however stiff the warp is, and the stiffest warp is affine.
#[test]
fn affine_displacements_are_kept() {
    let from = scattered(3, 40, 3, 2.0);
    let affine = |f: &[f64]| vec![1.0 + 0.5 * f[1], 2.0 * f[1] - f[0], f[2] * 0.1 - 4.0 + f[0]];
    let to: Vec<f64> = from.chunks(3).flat_map(affine).collect();
    for lambda in [0.0, 1.0, 1e5] {
        let warp = Warp::fit(3, &from, &to, lambda).unwrap();
        let far = [10.0, -7.0, 30.0];
        for (ours, wanted) in at(&warp, &far).iter().zip(affine(&far)) {
            assert!((ours - wanted).abs() < 1e-6, "{lambda}: {ours} {wanted}");
        }
    }
}

#[test]
fn lambda_means_the_same_at_any_scale() {
    let (from, to) = (scattered(4, 30, 2, 1.0), scattered(5, 30, 2, 1.0));
    let scaled = |v: &[f64]| -> Vec<f64> { v.iter().map(|x| 1000.0 * x).collect() };
    let small = Warp::fit(2, &from, &to, 0.3).unwrap();
    let large = Warp::fit(2, &scaled(&from), &scaled(&to), 0.3).unwrap();
    let point = [0.3, -0.8];
    for (a, b) in at(&small, &point).iter().zip(at(&large, &scaled(&point))) {
        assert!((1000.0 * a - b).abs() < 1e-6, "{a} {b}");
    }
}

#[test]
fn few_points_move_or_stretch() {
    assert_eq!(at(&Warp::fit(3, &[], &[], 1.0).unwrap(), &[1.0, 2.0, 3.0]), [1.0, 2.0, 3.0]);
    // One: a translation.
    let one = Warp::fit(2, &[1.0, 1.0], &[3.0, 0.0], 0.0).unwrap();
    assert_eq!((at(&one, &[5.0, 5.0]), one.places()), (vec![7.0, 4.0], 0));
    // Two: affine along the line through them, constant across it.
    let two = Warp::fit(2, &[0.0, 0.0, 2.0, 0.0], &[0.0, 1.0, 4.0, 1.0], 5.0).unwrap();
    for (point, wanted) in [([1.0, 0.0], [2.0, 1.0]), ([4.0, 0.0], [8.0, 1.0]), ([1.0, 9.0], [2.0, 10.0])] {
        let ours = at(&two, &point);
        assert!(ours.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{ours:?} {wanted:?}");
    }
    // Three: affine in their plane.
    let from = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let to = [1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 2.0];
    let three = Warp::fit(3, &from, &to, 0.0).unwrap();
    let ours = at(&three, &[1.0, 1.0, 7.0]);
    assert!(ours.iter().zip([0.0, 2.0, 9.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{ours:?}");
}

#[test]
fn coincident_points_are_their_mean() {
    // Twice the same place with two opinions.
    let from = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 2.0];
    let to = [1.0, 0.0, 3.0, 0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 2.0];
    let warp = Warp::fit(2, &from, &to, 0.0).unwrap();
    assert!((at(&warp, &[0.0, 0.0])[0] - 2.0).abs() < 1e-10);
    let same = Warp::fit(2, &[4.0, 4.0, 4.0, 4.0], &[5.0, 4.0, 7.0, 4.0], 0.0).unwrap();
    assert_eq!(at(&same, &[0.0, 0.0]), [2.0, 0.0]);
}

#[test]
fn points_on_a_line_bend_along_it() {
    // y is x² on a line in the plane; nothing moves across.
    let from: Vec<f64> = (0..9).flat_map(|i| [f64::from(i) * 0.5, f64::from(i) * 0.5]).collect();
    let to: Vec<f64> = from.chunks(2).flat_map(|p| [p[0] * p[0], p[1]]).collect();
    let warp = Warp::fit(2, &from, &to, 0.0).unwrap();
    for p in from.chunks(2) {
        assert!((at(&warp, p)[0] - p[0] * p[0]).abs() < 1e-9);
    }
    assert!(at(&warp, &[1.0, -1.0]).iter().all(|v| v.is_finite()));
}

#[test]
fn what_cannot_be_solved_is_an_error() {
    let near = [0.0, 0.0, 1e-13, 0.0, 5.0, 1.0, 1.0, 7.0, 3.0, 3.0];
    let far = [9.0, 0.0, -9.0, 0.0, 5.0, 1.0, 1.0, 7.0, 3.0, 3.0];
    let told = Warp::fit(2, &near, &far, 0.0).unwrap_err().to_string();
    assert!(told.contains("lambda above 0"), "{told}");
    assert!(Warp::fit(2, &near, &far, 0.1).is_ok());
    for (from, to, lambda) in [
        (vec![0.0, f64::NAN], vec![0.0, 0.0], 0.0),
        (vec![0.0, 0.0, 0.0], vec![0.0, 0.0, 0.0], 0.0),
        (vec![0.0, 0.0], vec![0.0], 0.0),
        (vec![0.0, 0.0], vec![0.0, 0.0], -1.0),
    ] {
        assert!(Warp::fit(2, &from, &to, lambda).is_err());
    }
}

#[test]
fn a_file_reads_back_to_the_last_bit_and_damage_is_told() {
    let rows = |flat: Vec<f64>| -> Vec<Vec<f64>> { flat.chunks(3).map(<[f64]>::to_vec).collect() };
    let clip = Clip {
        target_s: 0.5,
        recording: "a \"b\".wav".to_owned(),
        source_s: 1.25,
        duration_s: 0.1,
        from: rows(scattered(8, 12, 3, 2.0)),
        to: rows(scattered(9, 12, 3, 2.0)),
    };
    let basis = Basis::of(&Settings::default(), 96_000);
    let file = WarpFile::fit(basis, 3, vec![clip], 100.0).unwrap();
    let text = file.text().unwrap();
    assert_eq!(WarpFile::parse(&text).unwrap(), file);
    for (from, to, part) in [
        ("froufrou warp", "froufrou wrap", "format"),
        ("version = 1", "version = 2", "version: is 2"),
        ("lambda = 100.0", "lambda = []", "invalid type"),
        ("offset = [", "offset = [nan, ", "linear"),
        ("linear = [[", "linear = [[0.0, ", "expected 3"),
        ("places = [", "places = [[0.0, 0.0, inf],", "weights"),
    ] {
        assert!(text.contains(from), "{from}");
        let told = WarpFile::parse(&text.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(told.contains(part), "{told}");
    }
    for end in (0..text.len() - 1).step_by(97) {
        if text.is_char_boundary(end) {
            let _ = WarpFile::parse(&text[..end]);
        }
    }
}
