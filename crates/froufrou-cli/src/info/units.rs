//! What is in a corpus of units: its recordings, how many units they make, and its settings.

use froufrou::corpus::units::Channels;
use froufrou::corpus::units::folder::{Survey, Surveyed};

use super::Findings;
use super::sheet::Sheet;

impl Findings for Survey {
    const KIND: &'static str = "units";

    fn sheet(&self) -> Sheet {
        let (settings, mut sheet) = (&self.settings, Sheet::default());
        let (features, selection) = (&settings.features, &settings.selection);
        let unit_ms = 1e3 * self.unit_samples as f64 / f64::from(self.rate_hz);
        let mut channels: Vec<usize> = self.recordings.iter().map(|recording| recording.channels).collect();
        channels.sort_unstable();
        channels.dedup();
        let channels: Vec<String> = channels.iter().map(usize::to_string).collect();
        let joined = match features.channels {
            Channels::Separate => "each by itself",
            Channels::Joint => "all of a recording at once",
        };
        let widths: Vec<String> = settings.widths.iter().map(f64::to_string).collect();
        sheet
            .fact("kind", "corpus of units")
            .fact("rate", format!("{} Hz", self.rate_hz))
            .fact("recordings", format!("{}, {:.2} s", self.recordings.len(), self.duration_s))
            .fact("channels", format!("{}, {joined}", channels.join(" or ")))
            .fact("units", format!("{} of {} samples, {unit_ms:.3} ms", self.units, self.unit_samples))
            .fact("features", format!("{} of {} mel bands", features.coefficients, features.mel_bands))
            .fact_if(
                "high-pass",
                (features.high_pass_hz > 0.0).then(|| format!("{} Hz", features.high_pass_hz)),
            )
            .fact_if("widths", (!widths.is_empty()).then(|| format!("{} units", widths.join(", "))))
            .fact("lambda", settings.lambda)
            .fact("look-ahead", format!("{} units", selection.look_ahead))
            .fact("d_max", selection.d_max)
            .fact("cool-off", format!("{} units", selection.cool_off));
        let row = |recording: &Surveyed| {
            vec![
                recording.name.clone(),
                format!("{} Hz", recording.rate_hz),
                recording.channels.to_string(),
                format!("{:.2} s", recording.duration_s),
                recording.units.to_string(),
            ]
        };
        sheet.table(&["recording", "rate", "channels", "length", "units"], self.recordings.iter().map(row));
        sheet
    }
}
