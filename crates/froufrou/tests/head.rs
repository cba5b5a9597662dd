//! Heads against closed forms and small sets of a rigid sphere, in `fixtures/head` (written by
//! `oracles/head_fixtures.py`). Real sets are asked in `src/space/head/tests.rs`.

use std::path::{Path, PathBuf};

use froufrou::space::head::{EarArrival, Head, Measured};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/head").join(name)
}

fn open(name: &str) -> Measured {
    Measured::open(&fixture(name)).expect("a sound set")
}

/// The rows of a table.
fn table(name: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(fixture(name)).expect("a table");
    let rows = text.lines().filter(|line| !line.starts_with('#'));
    rows.map(|row| row.split('\t').map(|cell| cell.parse().expect("a number")).collect()).collect()
}

fn hear(head: &Head, from_m: [f64; 3]) -> ([Vec<f32>; 2], [EarArrival; 2]) {
    let mut taps = [vec![9.0; head.taps()], vec![9.0; head.taps()]];
    let [left, right] = &mut taps;
    let arrivals = head.hear(from_m, [left, right]);
    (taps, arrivals)
}

/// The complex response of taps at a frequency, without what `lead` delays.
fn response(head: &Head, taps: &[f32], frequency_hz: f64) -> (f64, f64) {
    taps.iter().enumerate().fold((0.0, 0.0), |(re, im), (k, tap)| {
        let turn = std::f64::consts::TAU * frequency_hz / head.rate_hz() * (k as f64 - head.lead() as f64);
        (re + f64::from(*tap) * turn.cos(), im - f64::from(*tap) * turn.sin())
    })
}

fn level_db(head: &Head, taps: &[f32], frequency_hz: f64) -> f64 {
    let (re, im) = response(head, taps, frequency_hz);
    20.0 * re.hypot(im).log10()
}

/// A direction at an angle from the left ear's axis.
fn from_left(angle_deg: f64) -> [f64; 3] {
    let (sine, cosine) = angle_deg.to_radians().sin_cos();
    [-cosine, 0.6 * sine, -0.8 * sine]
}

#[test]
fn a_sphere_is_that_of_brown_and_duda() {
    const FREQUENCIES_HZ: [f64; 8] = [100.0, 300.0, 1000.0, 2000.0, 4000.0, 8000.0, 12_000.0, 16_000.0];
    for rate_hz in [44_100.0, 48_000.0, 96_000.0, 192_000.0] {
        let head = Head::spherical(rate_hz);
        let (mut worst_db, mut off_db) = (0.0_f64, Vec::new());
        for row in table("sphere.tsv") {
            let (taps, arrivals) = hear(&head, from_left(row[0]).map(|x| x * 1e9));
            assert!((arrivals[0].delay_s - row[1]).abs() < 1e-11, "{row:?}: {arrivals:?}");
            assert!((arrivals[0].gain - 1.0).abs() < 1e-9);
            for (frequency_hz, expected) in FREQUENCIES_HZ.iter().zip(row[2..].chunks_exact(2)) {
                let found_db = level_db(&head, &taps[0], *frequency_hz);
                worst_db = worst_db.max((found_db - 20.0 * expected[0].log10()).abs());
                off_db.push((found_db - 20.0 * expected[1].log10()).abs());
            }
        }
        off_db.sort_by(f64::total_cmp);
        eprintln!(
            "{rate_hz} Hz: within {worst_db:.4} dB of the formulas; off the rigid sphere's series by {:.2} dB at \
             the median, {:.2} dB at most",
            off_db[off_db.len() / 2],
            off_db[off_db.len() - 1]
        );
        assert!(worst_db < 0.02, "{rate_hz} Hz: {worst_db} dB");
        // Brown & Duda's model is coarse where the shadow is deep.
        assert!(off_db[off_db.len() / 2] < 1.5 && off_db[off_db.len() - 1] < 10.0);
    }
}

#[test]
fn both_ears_are_mirrored() {
    let head = Head::spherical(48_000.0);
    for from_m in [[0.3, 0.1, -2.0], [-1.0, 0.0, 0.0], [0.02, 0.05, 0.01], [0.1, -0.05, 0.1]] {
        let (taps, arrivals) = hear(&head, from_m);
        let (mirrored, swapped) = hear(&head, [-from_m[0], from_m[1], from_m[2]]);
        assert_eq!((&taps[0], &taps[1]), (&mirrored[1], &mirrored[0]));
        assert_eq!((arrivals[0], arrivals[1]), (swapped[1], swapped[0]));
    }
}

/// The gains near the head are those of the ways' lengths; the exact sphere says how good that is.
#[test]
fn near_sources_are_louder_on_their_side_as_on_a_rigid_sphere() {
    let head = Head::spherical(48_000.0);
    let (mut low_db, mut high_db, mut without_db) = (Vec::new(), Vec::new(), Vec::new());
    for row in table("near.tsv") {
        let [distance_m, angle_deg, low, high] = row[..] else { panic!("{row:?}") };
        let (_, arrivals) = hear(&head, from_left(angle_deg).map(|x| x * distance_m));
        let (_, far) = hear(&head, from_left(angle_deg).map(|x| x * 10.0));
        let gain_db = 20.0 * (arrivals[0].gain / far[0].gain).log10();
        low_db.push((gain_db - low).abs());
        // On the far side waves that come round from all sides add up: not what a length of way can say.
        if angle_deg <= 90.0 {
            high_db.push((gain_db - high).abs());
        }
        without_db.push(low.abs());
    }
    let figures = |what: &str, values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let (median, most) = (values[values.len() / 2], values[values.len() - 1]);
        eprintln!("{what}: off the rigid sphere by {median:.2} dB at the median, {most:.2} dB at most");
        (median, most)
    };
    let low = figures("250 Hz", &mut low_db);
    let high = figures("4 kHz, near side", &mut high_db);
    let without = figures("250 Hz without gains", &mut without_db);
    assert!(low.0 < 0.5 && low.1 < 5.0, "{low:?}");
    assert!(high.0 < 0.5 && high.1 < 5.0, "{high:?}");
    assert!(low.0 < 0.5 * without.0 && low.1 < 0.5 * without.1);
}

#[test]
fn a_source_passes_through_a_head_smoothly() {
    let set = open("sphere.sofa").head(48_000.0);
    for head in [Head::spherical(48_000.0), set] {
        let mut last = hear(&head, [-0.3, 0.01, 0.02]);
        for step in 1..=6000 {
            let now = hear(&head, [-0.3 + 0.0001 * f64::from(step), 0.01, 0.02]);
            for ear in 0..2 {
                assert!((now.1[ear].delay_s - last.1[ear].delay_s).abs() < 3e-5 / 2.0, "step {step}");
                assert!((now.1[ear].gain - last.1[ear].gain).abs() < 0.05 * now.1[ear].gain, "step {step}");
                let change = now.0[ear].iter().zip(&last.0[ear]).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
                let size = now.0[ear].iter().map(|x| x * x).sum::<f32>();
                assert!(change < 0.01 * size, "step {step}: {}", change / size);
            }
            last = now;
        }
    }
}

#[test]
fn strange_places_are_heard_as_well() {
    for head in [Head::spherical(48_000.0), open("ring.sofa").head(48_000.0)] {
        for from_m in
            [[0.0; 3], [f64::NAN; 3], [f64::INFINITY, 0.0, 0.0], [1e-300; 3], [1e300, 1e300, -1e300]]
        {
            let (taps, arrivals) = hear(&head, from_m);
            assert!(taps.concat().iter().all(|tap| tap.is_finite()), "{from_m:?}");
            assert!(arrivals.iter().all(|ear| ear.delay_s.is_finite() && ear.gain.is_finite()), "{from_m:?}");
        }
    }
}

#[test]
fn a_packed_set_is_read_as_h5py_reads_it() {
    let set = open("sphere.sofa");
    assert_eq!((set.rate_hz(), set.directions().len()), (44_100.0, 66));
    for row in table("values.tsv") {
        let hrir = set.hrir(set.directions()[row[0] as usize]);
        assert_eq!(hrir[row[1] as usize][row[2] as usize], row[3], "{row:?}");
    }
    // Azimuth 90 degrees is left.
    let horizon: Vec<_> = set.directions().iter().filter(|direction| direction[1].abs() < 1e-9).collect();
    assert!((horizon[0][2] + 1.0).abs() < 1e-12 && (horizon[4][0] + 1.0).abs() < 1e-12);
    let (_, arrivals) = hear(&set.head(48_000.0), [-1.5, 0.0, 0.0]);
    assert!(arrivals[0].delay_s < arrivals[1].delay_s - 5e-4);
    assert!(!set.has_ears_exchanged());
}

/// The same set with onsets told by `Data.Delay`, in the newer format of HDF5, in 32 bits.
#[test]
fn delays_of_their_own_are_heard() {
    let (whole, delayed) = (open("sphere.sofa"), open("delays.sofa"));
    let (a, b) = (whole.head(48_000.0), delayed.head(48_000.0));
    for direction in whole.directions() {
        let (expected, found) = (whole.hrir(*direction), delayed.hrir(*direction));
        let (taps_a, arrivals_a) = hear(&a, *direction);
        let (taps_b, arrivals_b) = hear(&b, *direction);
        for ear in 0..2 {
            let energy: f64 = expected[ear].iter().map(|x| x * x).sum();
            let at = |hrir: &[f64], n: usize| hrir.get(n).copied().unwrap_or(0.0);
            let error: f64 = (0..120).map(|n| (at(&expected[ear], n) - at(&found[ear], n)).powi(2)).sum();
            // Its responses are shorter: the last of them, and a little before the onset, is missing.
            assert!(error < 1e-4 * energy, "{direction:?}: {}", error / energy);
            assert!((arrivals_a[ear].delay_s - arrivals_b[ear].delay_s).abs() < 1e-5);
            for frequency_hz in [500.0, 2000.0, 8000.0] {
                let (a, b) =
                    (level_db(&a, &taps_a[ear], frequency_hz), level_db(&b, &taps_b[ear], frequency_hz));
                assert!((a - b).abs() < 0.4, "{direction:?}, {frequency_hz} Hz: {a} {b}");
            }
        }
    }
}

/// The same set in cartesian coordinates of a turned listener, receivers exchanged, in big-endian numbers.
#[test]
fn coordinates_of_all_kinds_mean_the_same() {
    let (whole, other) = (open("sphere.sofa"), open("cartesian.sofa"));
    assert_eq!(other.directions().len(), whole.directions().len() / 2);
    assert!(!other.has_ears_exchanged());
    for (n, direction) in other.directions().iter().enumerate() {
        let expected = whole.directions()[2 * n];
        assert!((0..3).all(|k| (direction[k] - expected[k]).abs() < 1e-12), "{direction:?} {expected:?}");
        let (expected, found) = (whole.hrir(expected), other.hrir(*direction));
        for ear in 0..2 {
            assert_eq!(found[ear], expected[ear][..40]);
        }
    }
}

#[test]
fn a_ring_or_one_direction_is_a_head_as_well() {
    let whole = open("sphere.sofa");
    let ring = open("ring.sofa");
    assert_eq!(ring.directions().len(), 16);
    // On the ring it is the set itself; above, something between, without a jump.
    for azimuth_deg in 0..360 {
        let azimuth = f64::from(azimuth_deg).to_radians();
        let towards = [-azimuth.sin(), 0.0, -azimuth.cos()];
        let (expected, found) = (whole.hrir(towards), ring.hrir(towards));
        for ear in 0..2 {
            let energy: f64 = expected[ear].iter().map(|x| x * x).sum();
            let error: f64 = expected[ear].iter().zip(&found[ear]).map(|(a, b)| (a - b).powi(2)).sum();
            assert!(error < 1e-4 * energy, "{azimuth_deg}: {}", error / energy);
        }
    }
    let head = ring.head(48_000.0);
    let mut last = hear(&head, [0.0, 0.0, -2.0]).1;
    for step in 1..=720 {
        let angle = f64::from(step).to_radians() / 2.0;
        let now = hear(&head, [0.5 * angle.sin(), 1.9 * angle.sin(), -2.0 * angle.cos()]).1;
        assert!((0..2).all(|ear| (now[ear].delay_s - last[ear].delay_s).abs() < 2e-5), "step {step}");
        last = now;
    }
    let above = hear(&head, [0.0, 2.0, 0.0]).1;
    assert!((above[0].delay_s - above[1].delay_s).abs() < 1e-5, "{above:?}");

    let one = open("one.sofa").head(48_000.0);
    let (expected, _) = hear(&one, [0.0, 0.0, -1.5]);
    for from_m in [[0.0, 0.0, 1.5], [1.0, 1.0, 0.4], [-3.0, 0.1, 0.0]] {
        let (found, _) = hear(&one, from_m);
        for (found, expected) in found.iter().zip(&expected) {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5));
        }
    }
}

#[test]
fn of_several_distances_the_farthest_is_taken() {
    let (ring, shells) = (open("ring.sofa"), open("shells.sofa"));
    assert_eq!(shells.directions().len(), 16);
    for direction in ring.directions() {
        assert_eq!(ring.hrir(*direction), shells.hrir(*direction));
    }
}

#[test]
fn what_is_no_set_of_a_head_is_named() {
    let error = Measured::open(&fixture("other_convention.sofa")).expect_err("of rooms").to_string();
    assert!(error.contains("MultiSpeakerBRIR") && error.contains("SimpleFreeFieldHRIR"), "{error}");
    let error = Head::open(&fixture("nothing.h5"), 48_000.0).expect_err("just HDF5").to_string();
    assert!(error.contains("nothing.h5") && error.contains("SOFA convention"), "{error}");
    let error = Head::open(&fixture("sphere.tsv"), 48_000.0).expect_err("a table").to_string();
    assert!(error.contains("not a SOFA file") && error.contains(".sofa"), "{error}");
    let error = Head::open(&fixture("none.sofa"), 48_000.0).expect_err("not there").to_string();
    assert!(error.contains("none.sofa"), "{error}");
}
