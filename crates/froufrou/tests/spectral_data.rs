//! Real recordings as sinusoids and residual, against sms-tools (`oracles/sms_compare.py`).

mod data;

use data::data;
use froufrou::corpus::recording::Recording;
use froufrou::corpus::spectral::SpectralModel;

fn energy(samples: &[f32]) -> f64 {
    samples.iter().map(|&v| f64::from(v).powi(2)).sum()
}

#[test]
fn no_more_sinusoids_than_sms_tools_leave_no_more_residual() {
    let Some(folder) = data("audio") else { return };
    let table = include_str!("fixtures/sms_residuals.tsv");
    for row in table.lines().skip(1) {
        let [name, hop, count, residual_db, _] = row.split('\t').collect::<Vec<_>>()[..] else {
            panic!("{row}")
        };
        let [hop, count, residual_db] = [hop, count, residual_db].map(|v| v.parse::<f64>().unwrap());
        let recording = Recording::open(folder.join(name)).unwrap();
        let rate = f64::from(recording.rate_hz);
        let mut sound = recording.mono();
        sound.truncate(3 * recording.rate_hz as usize);
        // As many sinusoids as sms-tools has, or fewer: louder ones alone, until they are few enough.
        let model = |threshold_db: f64| SpectralModel {
            hop_s: hop / rate,
            most_partials: 100,
            threshold_db,
            ..SpectralModel::default()
        };
        let frames = sound.len() as f64 / hop;
        let (ours, threshold_db) = (0..20)
            .map(|step| -80.0 + 4.0 * f64::from(step))
            .map(|threshold_db| {
                let quick = SpectralModel { corrections: 0, ..model(threshold_db) };
                let found = quick.analyse(&sound, recording.rate_hz).unwrap();
                (found.partials.iter().map(|p| p.keys.len()).sum::<usize>() as f64 / frames, threshold_db)
            })
            .find(|&(ours, _)| ours <= count)
            .unwrap();
        let split = model(threshold_db).split(&sound, recording.rate_hz).unwrap();
        let left_db = 10.0 * (energy(&split.residual) / energy(&sound)).log10();
        println!(
            "{name}: {ours:.1} sinusoids leave {left_db:.2} dB; sms-tools {count:.1}, {residual_db:.2} dB"
        );
        assert!(left_db <= residual_db, "{name}");
        for ((whole, a), b) in sound.iter().zip(&split.sinusoids).zip(&split.residual) {
            assert!((whole - (a + b)).abs() <= 1e-6, "{name}");
        }
    }
}
