use super::*;
use crate::corpus::cloth::spectra::{centroid_hz, power};

#[test]
fn every_model_has_spectra_that_rise_with_speed_and_its_level() {
    for cloth in CLOTHS {
        let sound = cloth.sound();
        let spectra = &sound.friction().unwrap().spectra;
        let centroids: Vec<f64> =
            spectra.measured().iter().map(|s| centroid_hz(&s.density, SPACING_HZ)).collect();
        assert!(centroids.windows(2).all(|pair| pair[1] > pair[0]), "{}: {centroids:?}", cloth.name);
        let level = power(&spectra.at(REFERENCE_MPS), SPACING_HZ).sqrt();
        assert!((level / cloth.yarns.level - 1.0).abs() < 1e-9);
    }
    // A windbreaker is brighter than polyester, which is brighter than cotton, and corduroy is the dullest.
    let order = ["corduroy", "cotton", "polyester", "windbreaker"].map(|name| {
        let cloth = Cloth::named(&format!("synthetic/{name}")).unwrap().unwrap();
        centroid_hz(&cloth.yarns.density(0.4), SPACING_HZ)
    });
    assert!(order.windows(2).all(|pair| pair[1] > pair[0]), "{order:?}");
}

#[test]
fn the_wales_of_corduroy_are_humps_that_move_with_speed() {
    let corduroy = Cloth::named("synthetic/corduroy").unwrap().unwrap();
    let spectra = corduroy.sound().friction.unwrap().spectra;
    for speed in [0.8, 0.9, 1.0, 1.4, 1.6] {
        let density = spectra.at(speed);
        let rate_hz = speed * 350.0;
        let at = |hz: f64| density[(hz / SPACING_HZ).round() as usize - 1];
        assert!(at(rate_hz) > 1.5 * at(1.5 * rate_hz), "{speed} m/s");
        assert!(at(2.0 * rate_hz) > 1.2 * at(1.5 * rate_hz), "{speed} m/s");
    }
}

#[test]
fn pops_have_their_energies_at_every_rate_and_begin_and_end_in_silence() {
    for cloth in CLOTHS.iter().filter(|cloth| cloth.buckles.is_some()) {
        let buckles = cloth.buckles.unwrap();
        for rate_hz in [44_100.0, 48_000.0, 192_000.0] {
            let pops = cloth.pops(rate_hz);
            assert_eq!(pops.len(), POPS);
            for (number, pop) in pops.iter().enumerate() {
                let energy: f64 = pop.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / rate_hz;
                assert!((energy / buckles.energy(number) - 1.0).abs() < 1e-4);
                let peak = pop.iter().fold(0.0f32, |a, b| a.max(b.abs()));
                assert!(peak < 1.0, "{} {number}: {peak}", cloth.name);
                assert!(pop[0].abs() < 1e-3 * peak && pop[pop.len() - 1].abs() < 1e-3 * peak);
            }
        }
        // At 48 kHz they are those of 96 kHz, but for what only that can hold.
        let [low, high] = [48_000.0, 96_000.0].map(|rate_hz| cloth.pops(rate_hz));
        let (low, high) = (&low[50], &high[50]);
        let off: f64 = low.iter().zip(high.iter().step_by(2)).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        let whole: f64 = low.iter().map(|v| f64::from(*v).powi(2)).sum();
        assert!(off < 0.02 * whole, "{}: {}", cloth.name, off / whole);
    }
}

#[test]
fn energies_follow_their_power_law() {
    let buckles = CLOTHS[0].buckles.unwrap();
    let energies: Vec<f64> = (0..POPS).map(|number| buckles.energy(number)).collect();
    assert!(energies.windows(2).all(|pair| pair[1] > pair[0]));
    // P(above E) of the law, by its closed form.
    let [least, greatest] = buckles.energies;
    let above = |e: f64| {
        let p = |e: f64| e.powf(1.0 - buckles.slope);
        (p(e) - p(greatest)) / (p(least) - p(greatest))
    };
    for e in [5e-8, 2e-7, 1e-6] {
        let found = energies.iter().filter(|energy| **energy > e).count() as f64 / POPS as f64;
        assert!((found - above(e)).abs() < 0.015, "{e}: {found}, {}", above(e));
    }
}

#[test]
fn names_find_models_and_others_are_told() {
    assert!(Cloth::named("corpora/cotton").is_none());
    let error = Cloth::named("synthetic/silk").unwrap().unwrap_err().to_string();
    assert!(error.contains("synthetic/cotton, synthetic/polyester"), "{error}");
    assert!(Cloth::names().all(|name| Cloth::named(&name).unwrap().is_ok()));
    let sound = ClothSound::named("synthetic/windbreaker", std::path::Path::new(".")).unwrap();
    assert_eq!((sound.name(), sound.pops().len()), ("synthetic/windbreaker", POPS));
    assert_eq!(sound.pop_samples(22_050).unwrap().len(), POPS);
    assert!(sound.pop_samples(10).is_err());
}
