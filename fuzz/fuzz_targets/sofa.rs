//! SOFA files: what is read is a head that can be asked.
#![no_main]

use froufrou::space::head::Measured;
use froufrou_fuzz::{target, with_file};

target!(|bytes| {
    with_file(bytes, "sofa", |path| {
        let Ok(set) = Measured::open(path) else { return };
        // Rates far apart would make a set as large as no file is.
        let head = set.head(set.rate_hz().min(48_000.0));
        let mut taps = [vec![0.0; head.taps()], vec![0.0; head.taps()]];
        for from_m in [[1.0, 0.2, 0.1], [-0.1, -2.0, 0.4], [0.03, 0.0, -0.05]] {
            let [left, right] = &mut taps;
            let arrivals = head.hear(from_m, [left, right]);
            assert!(arrivals.iter().all(|ear| ear.delay_s.is_finite() && ear.gain.is_finite()));
            assert!(taps.concat().iter().all(|tap| tap.is_finite()));
        }
        let _ = set.hrir([0.3, 0.2, -0.9]);
    });
});
