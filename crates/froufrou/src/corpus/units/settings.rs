//! The table `[units]` of a corpus.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Place, Result};

/// The most mel bands, and the longest unit and window.
const MOST_BANDS: usize = 128;
const LONGEST_S: f64 = 1.0;

/// The most units that are looked ahead, and that a unit is barred for.
const MOST_UNITS: usize = 1000;

/// What an FFT's power is multiplied with before it becomes features.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Window {
    /// 0.5 − 0.5 cos(2π i / n).
    #[default]
    Hann,
    /// 1 throughout.
    Rectangular,
}

/// How a mel band's power becomes a level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Logarithm {
    /// ln p, as the paper has it: its distances are in this unit.
    #[default]
    Natural,
    /// 10 log₁₀ p.
    Decibels,
}

/// What a stream of units is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channels {
    /// Each channel of a recording; each channel of a target is replaced by itself.
    #[default]
    Separate,
    /// All channels of a recording at once, as for two ears: their features stand side by side.
    Joint,
}

/// How units become features.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureSettings {
    /// Length of a unit, which is rounded to whole samples: 4.2 ms are 403 at 96 kHz.
    pub unit_s: f64,
    /// Length of the window, whose middle is the unit's; that of a unit where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window_s: Option<f64>,
    /// Its shape.
    pub window: Window,
    /// How many mel bands lie between the lowest and the highest frequency.
    pub mel_bands: usize,
    /// How many coefficients of their cosine transform are kept, the lowest ones.
    pub coefficients: usize,
    /// Where the mel bands begin.
    pub lowest_hz: f64,
    /// Where they end; at half the rate where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub highest_hz: Option<f64>,
    /// How power becomes a level.
    pub logarithm: Logarithm,
    /// Recordings and targets are high-passed here, by a Butterworth filter of 5th order; 0 for not at all.
    pub high_pass_hz: f64,
    /// What a stream of units is.
    pub channels: Channels,
}

impl Default for FeatureSettings {
    fn default() -> Self {
        Self {
            unit_s: 0.0042,
            window_s: None,
            window: Window::Hann,
            mel_bands: 3,
            coefficients: 3,
            lowest_hz: 0.0,
            highest_hz: None,
            logarithm: Logarithm::Natural,
            high_pass_hz: 100.0,
            channels: Channels::Separate,
        }
    }
}

impl FeatureSettings {
    /// Samples of a unit.
    pub fn unit_samples(&self, rate_hz: u32) -> usize {
        ((self.unit_s * f64::from(rate_hz)).round() as usize).max(1)
    }

    /// Samples of the window.
    pub fn window_samples(&self, rate_hz: u32) -> usize {
        let window_s = self.window_s.unwrap_or(self.unit_s);
        ((window_s * f64::from(rate_hz)).round() as usize).max(1)
    }

    /// # Errors
    /// Names the first setting that makes no sense.
    pub fn check(&self) -> Result<()> {
        for (key, value) in [("unit_s", Some(self.unit_s)), ("window_s", self.window_s)] {
            if let Some(value) = value.filter(|value| !(*value >= 1e-4 && *value <= LONGEST_S)) {
                return Err(fault(key, format!("is {value}, expected 0.0001 to {LONGEST_S} seconds")));
            }
        }
        if !(1..=MOST_BANDS).contains(&self.mel_bands) {
            return Err(fault("mel_bands", format!("is {}, expected 1 to {MOST_BANDS}", self.mel_bands)));
        }
        if !(1..=self.mel_bands).contains(&self.coefficients) {
            let what = format!("is {}, expected 1 to mel_bands, {}", self.coefficients, self.mel_bands);
            return Err(fault("coefficients", what));
        }
        if !(self.lowest_hz >= 0.0 && self.lowest_hz.is_finite()) {
            return Err(fault("lowest_hz", format!("is {}, expected 0 or more", self.lowest_hz)));
        }
        if let Some(highest_hz) = self.highest_hz.filter(|hz| !(hz.is_finite() && *hz > self.lowest_hz)) {
            return Err(fault("highest_hz", format!("is {highest_hz}, expected more than lowest_hz")));
        }
        if !(self.high_pass_hz >= 0.0 && self.high_pass_hz.is_finite()) {
            return Err(fault("high_pass_hz", format!("is {}, expected 0 or more", self.high_pass_hz)));
        }
        Ok(())
    }
}

/// How units are chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SelectionSettings {
    /// How many units after the present one are compared as well, L.
    pub look_ahead: usize,
    /// How far a unit may be from what it stands for; only where none is so near may it be farther.
    pub d_max: f64,
    /// How many units of the target a unit is barred for when it has been chosen, L_c.
    pub cool_off: usize,
    /// What the optimal selection pays where a unit does not follow the one before in its recording.
    pub jump_cost: f64,
    /// How many units the optimal selection considers for each of the target.
    pub candidates: usize,
}

impl Default for SelectionSettings {
    fn default() -> Self {
        Self { look_ahead: 5, d_max: 2.0, cool_off: 20, jump_cost: 1.0, candidates: 32 }
    }
}

impl SelectionSettings {
    /// # Errors
    /// Names the first setting that makes no sense.
    pub fn check(&self) -> Result<()> {
        for (key, value) in [("look_ahead", self.look_ahead), ("cool_off", self.cool_off)] {
            if value > MOST_UNITS {
                return Err(fault(key, format!("is {value}, expected at most {MOST_UNITS}")));
            }
        }
        if self.d_max.is_nan() || self.d_max < 0.0 {
            return Err(fault("d_max", format!("is {}, expected 0 or more", self.d_max)));
        }
        if !(self.jump_cost >= 0.0 && self.jump_cost.is_finite()) {
            return Err(fault("jump_cost", format!("is {}, expected 0 or more", self.jump_cost)));
        }
        if !(1..=100_000).contains(&self.candidates) {
            return Err(fault("candidates", format!("is {}, expected 1 to 100000", self.candidates)));
        }
        Ok(())
    }
}

/// All of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Recordings, and folders of them, from the corpus's folder.
    pub recordings: Vec<String>,
    /// Samples a second; the rate of most recordings where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<u32>,
    /// Widths of the Gaussians that smooth each coefficient over time, in units; none for no smoothing.
    pub widths: Vec<f64>,
    /// How stiff the warp is, λ; 0 for one that goes through all correspondences.
    pub lambda: f64,
    /// How units become features.
    pub features: FeatureSettings,
    /// How units are chosen.
    pub selection: SelectionSettings,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            recordings: vec![".".to_owned()],
            rate_hz: None,
            widths: Vec::new(),
            lambda: 0.0,
            features: FeatureSettings::default(),
            selection: SelectionSettings::default(),
        }
    }
}

impl Settings {
    /// The names of [`Settings::preset`].
    pub const PRESETS: [&str; 5] =
        ["cotton", "polyester", "windbreaker", "windbreaker first-person", "corduroy"];

    /// The settings of the paper's tables for a kind of cloth; none for other names.
    pub fn preset(name: &str) -> Option<Self> {
        let make = |lambda: f64, look_ahead: usize, widths: [f64; 3]| Self {
            widths: widths.to_vec(),
            lambda,
            selection: SelectionSettings { look_ahead, ..SelectionSettings::default() },
            ..Self::default()
        };
        Some(match name {
            "cotton" => make(1e2, 5, [20.0, 50.0, 10.0]),
            "polyester" => make(1e5, 10, [10.0, 50.0, 20.0]),
            "windbreaker" => make(1e5, 5, [20.0, 30.0, 10.0]),
            "windbreaker first-person" => {
                let mut settings = make(1e5, 5, [20.0, 30.0, 10.0]);
                settings.features.channels = Channels::Joint;
                settings
            }
            "corduroy" => {
                let mut settings = make(0.0, 10, [20.0, 30.0, 10.0]);
                settings.features.unit_s = 0.0167;
                settings.selection.d_max = 3.0;
                settings
            }
            _ => return None,
        })
    }

    /// # Errors
    /// Names the first setting that makes no sense.
    pub fn check(&self) -> Result<()> {
        let widths = self.widths.len();
        if widths != 0 && widths != self.features.coefficients {
            return Err(fault(
                "widths",
                format!(
                    "has {widths} widths, expected one for each of {} coefficients",
                    self.features.coefficients
                ),
            ));
        }
        if let Some(width) = self.widths.iter().find(|width| !(**width >= 0.0 && **width <= 1e5)) {
            return Err(fault("widths", format!("has {width}, expected 0 to 100000 units")));
        }
        if !(self.lambda >= 0.0 && self.lambda.is_finite()) {
            return Err(fault("lambda", format!("is {}, expected 0 or more", self.lambda)));
        }
        if let Some(rate_hz) = self.rate_hz.filter(|rate| !super::super::spectral::RATES_HZ.contains(rate)) {
            return Err(fault("rate_hz", format!("is {rate_hz}, expected 1000 to 768000 Hz")));
        }
        if self.recordings.is_empty() {
            return Err(fault("recordings", "names no recordings and no folders".to_owned()));
        }
        self.features.check()?;
        self.selection.check()
    }
}

fn fault(key: &str, what: String) -> Error {
    Error::new(what).at(Place::Part(format!("units: {key}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_those_of_the_paper_and_make_sense() {
        for name in Settings::PRESETS {
            let settings = Settings::preset(name).unwrap();
            settings.check().unwrap();
            let text = toml::to_string(&settings).unwrap();
            assert_eq!(toml::from_str::<Settings>(&text).unwrap(), settings, "{text}");
        }
        let corduroy = Settings::preset("corduroy").unwrap();
        assert_eq!(corduroy.features.unit_samples(96_000), 1603);
        assert_eq!((corduroy.selection.d_max, corduroy.selection.look_ahead), (3.0, 10));
        assert_eq!(FeatureSettings::default().unit_samples(96_000), 403);
        assert_eq!(Settings::preset("tweed"), None);
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        let check = |change: &dyn Fn(&mut Settings)| {
            let mut settings = Settings::default();
            change(&mut settings);
            settings.check().unwrap_err().to_string()
        };
        let cases: [(&dyn Fn(&mut Settings), &str); 11] = [
            (&|s| s.widths = vec![1.0], "units: widths: has 1 widths, expected one for each of 3"),
            (&|s| s.widths = vec![1.0, f64::NAN, 2.0], "has NaN"),
            (&|s| s.lambda = -1.0, "lambda"),
            (&|s| s.features.unit_s = 0.0, "unit_s"),
            (&|s| s.features.window_s = Some(f64::INFINITY), "window_s"),
            (&|s| s.features.coefficients = 4, "coefficients: is 4, expected 1 to mel_bands, 3"),
            (&|s| s.features.mel_bands = 0, "mel_bands"),
            (&|s| s.features.highest_hz = Some(0.0), "highest_hz"),
            (&|s| s.selection.d_max = f64::NAN, "d_max"),
            (&|s| s.selection.look_ahead = 10_000, "look_ahead"),
            (&|s| s.selection.jump_cost = f64::NAN, "jump_cost"),
        ];
        for (change, part) in cases {
            assert!(check(change).contains(part), "{}", check(change));
        }
    }
}
