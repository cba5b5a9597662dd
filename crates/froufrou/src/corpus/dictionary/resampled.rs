//! A dictionary at another rate, for soundtracks that have it.

use super::assemble::{Cut, Sound};
use super::{Dictionary, Part, prepare};
use crate::Result;
use crate::corpus::grains::Segment;

impl Dictionary {
    /// The same grains at another rate, without patterns. The parts of recordings are resampled, and each grain is cut from
    /// them where it was before, to the nearest sample, under the window of its new length: so neighbours fit to each other
    /// as before.
    ///
    /// # Errors
    /// A rate that is not one of sound or too far from the dictionary's.
    pub fn at_rate(&self, rate_hz: u32) -> Result<Self> {
        let ratio = f64::from(rate_hz) / f64::from(self.rate_hz);
        let place = |sample: usize| (sample as f64 * ratio).round() as usize;
        let sound = |number: usize| -> Result<Sound> {
            let recording = &self.recordings[number];
            let parts = self.parts[number].iter().map(|part| {
                let samples = prepare::at_rate(part.samples.clone(), self.rate_hz, rate_hz)?;
                Ok(Part { kind: part.kind, samples })
            });
            let parts: Vec<Part> = parts.collect::<Result<_>>()?;
            let length = parts.first().map_or(0, |part| part.samples.len());
            let segments = self.grains[recording.grains.clone()].iter().map(|grain| {
                let start = place(grain.start).min(length);
                let end = place(grain.start + grain.length).clamp(start, length);
                Segment { kind: grain.kind, start, length: end - start, energy: grain.energy }
            });
            let segments = segments.collect();
            let name = recording.name.clone();
            Ok(Sound { name, contact: recording.contact, action: recording.action, parts, segments })
        };
        let sounds = (0..self.recordings.len()).map(sound).collect::<Result<_>>()?;
        Ok(Cut::new(rate_hz, &self.settings, sounds).into_dictionary())
    }
}
