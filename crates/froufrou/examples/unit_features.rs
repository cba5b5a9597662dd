//! Makes features of sound, for `oracles/cloth_features_speed.py`.
//!
//! ```text
//! unit_features RATE SOUND FEATURES
//! ```
//!
//! The sound is mono, 32-bit floats without a header; features are written as such, three a unit of 4.2 ms. What it took
//! is printed, the best of three times.

use std::time::Instant;

use froufrou::corpus::units::FeatureSettings;
use froufrou::corpus::units::features::Extractor;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [rate, sound, output] = arguments.as_slice() else {
        return Err("expected RATE SOUND FEATURES".into());
    };
    let bytes = std::fs::read(sound)?;
    let sound: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
    let mut best = f64::INFINITY;
    let mut values = Vec::new();
    for _ in 0..3 {
        let started = Instant::now();
        let features = Extractor::new(&FeatureSettings::default(), rate.parse()?)?.features(&sound);
        best = best.min(started.elapsed().as_secs_f64());
        values = features.values().iter().flat_map(|v| v.to_le_bytes()).collect();
    }
    std::fs::write(output, values)?;
    println!("{best}");
    Ok(())
}
