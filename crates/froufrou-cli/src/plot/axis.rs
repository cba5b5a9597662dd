//! Axes: what a value's place is, and which values are labelled.

/// A value that is labelled.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// The value.
    pub value: f64,
    /// What stands beside it.
    pub label: String,
}

/// How values lie along an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// At equal distances.
    Linear {
        /// The value at its beginning.
        from: f64,
        /// The value at its end.
        to: f64,
    },
    /// At equal ratios; both ends above 0.
    Logarithmic {
        /// The value at its beginning.
        from: f64,
        /// The value at its end.
        to: f64,
    },
}

impl Scale {
    /// Where a value lies: 0 at the beginning, 1 at the end.
    pub fn place(&self, value: f64) -> f64 {
        match *self {
            Self::Linear { from, to } => (value - from) / (to - from),
            Self::Logarithmic { from, to } => (value / from).ln() / (to / from).ln(),
        }
    }

    /// The value at a place.
    pub fn value(&self, place: f64) -> f64 {
        match *self {
            Self::Linear { from, to } => from + place * (to - from),
            Self::Logarithmic { from, to } => from * (to / from).powf(place),
        }
    }
}

/// A number with a true minus sign and no more digits than the step between ticks needs.
pub fn number(value: f64, step: f64) -> String {
    // Rounding noise of a sum must not appear as −0.
    let value = if value.abs() < step.abs() * 1e-9 { 0.0 } else { value };
    let digits = (-(step.abs() * 1.000_001).log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{:.digits$}", value.abs());
    if value < 0.0 { format!("−{text}") } else { text }
}

/// The smallest of 1, 2 and 5 times a power of ten that is not below a number above 0.
fn round_step(least: f64) -> f64 {
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0]
        .map(|m| m * power)
        .into_iter()
        .find(|&step| step >= least * 0.999_999)
        .unwrap_or(10.0 * power)
}

/// The multiples of a step within a range.
fn multiples(from: f64, to: f64, step: f64) -> impl Iterator<Item = f64> {
    let first = (from / step - 1e-6).ceil();
    let count = ((to / step + 1e-6).floor() - first).max(-1.0) as usize + 1;
    // A range at 1e15 s with steps of 1 ms would otherwise never end.
    (0..count.min(1000)).map(move |i| (first + i as f64) * step)
}

/// Ticks at round numbers, at most `most` of them or a few more.
pub fn linear_ticks(from: f64, to: f64, most: usize) -> Vec<Tick> {
    let step = round_step(((to - from) / most.max(1) as f64).max(f64::MIN_POSITIVE));
    multiples(from, to, step).map(|value| Tick { value, label: number(value, step) }).collect()
}

/// Ticks of a time axis in seconds, and the unit of their labels: milliseconds for what is short,
/// minutes and hours for what is long.
pub fn time_ticks(from_s: f64, to_s: f64, most: usize) -> (Vec<Tick>, &'static str) {
    let span_s = to_s - from_s;
    let last_s = from_s.abs().max(to_s.abs());
    if span_s <= 0.2 && last_s < 10.0 {
        let ticks = linear_ticks(from_s * 1e3, to_s * 1e3, most);
        let seconds = |tick: Tick| Tick { value: tick.value / 1e3, ..tick };
        return (ticks.into_iter().map(seconds).collect(), "ms");
    }
    if last_s <= 200.0 || span_s < most as f64 {
        return (linear_ticks(from_s, to_s, most), "s");
    }
    let least = span_s / most.max(1) as f64;
    let steps = [1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 900.0, 1800.0, 3600.0, 7200.0];
    let step = steps.into_iter().find(|&s| s >= least).unwrap_or_else(|| round_step(least / 3600.0) * 3600.0);
    let hours = last_s >= 3600.0;
    let label = |time_s: f64| {
        let (sign, whole) = (if time_s < 0.0 { "−" } else { "" }, time_s.abs().round() as u64);
        let (minutes, seconds) = (whole / 60, whole % 60);
        match hours {
            true => format!("{sign}{}:{:02}:{seconds:02}", minutes / 60, minutes % 60),
            false => format!("{sign}{minutes}:{seconds:02}"),
        }
    };
    let ticks = multiples(from_s, to_s, step).map(|value| Tick { value, label: label(value) }).collect();
    (ticks, if hours { "h:min:s" } else { "min:s" })
}

/// The values 1, 2 and 5 times the powers of ten within a range above 0, or where these are more than
/// `most`, the powers of ten, or only every second, third … of them.
fn log_values(from: f64, to: f64, most: usize) -> Vec<f64> {
    let (first, last) = (from.log10().floor() as i32, to.log10().ceil() as i32);
    let inside = |value: &f64| (from * 0.999_999..=to * 1.000_001).contains(value);
    let with = |factors: &[f64], every: i32| -> Vec<f64> {
        let powers = (first..=last).filter(|power| power.rem_euclid(every) == 0);
        powers.flat_map(|p| factors.iter().map(move |f| f * 10f64.powi(p))).filter(inside).collect()
    };
    let fine = with(&[1.0, 2.0, 5.0], 1);
    if fine.len() <= most {
        return fine;
    }
    (1..).map(|every| with(&[1.0], every)).find(|ticks| ticks.len() <= most.max(1)).unwrap_or_default()
}

/// Ticks of a logarithmic axis.
pub fn log_ticks(from: f64, to: f64, most: usize) -> Vec<Tick> {
    let ticks = log_values(from, to, most).into_iter();
    ticks.map(|value| Tick { value, label: plain_or_power(value) }).collect()
}

/// A round number, in digits where these are few, else with an exponent.
fn plain_or_power(value: f64) -> String {
    if (0.000_099..99_999.0).contains(&value) {
        return number(value, 10f64.powf(value.log10().floor()));
    }
    format!("{value:.0e}").replace('-', "−")
}

/// Ticks of a frequency axis in hertz.
pub fn frequency_ticks(from_hz: f64, to_hz: f64, most: usize) -> Vec<Tick> {
    let label = |hz: f64| match hz {
        hz if hz >= 999.0 => format!("{} kHz", number(hz / 1e3, 1.0)),
        hz => format!("{} Hz", number(hz, 1.0)),
    };
    log_values(from_hz, to_hz, most).into_iter().map(|value| Tick { value, label: label(value) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(ticks: &[Tick]) -> Vec<&str> {
        ticks.iter().map(|tick| tick.label.as_str()).collect()
    }

    #[test]
    fn linear_ticks_stand_at_round_numbers() {
        assert_eq!(labels(&linear_ticks(0.0, 1.0, 5)), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(&linear_ticks(-1.0, 1.0, 4)), ["−1.0", "−0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(labels(&linear_ticks(37.2, 93.0, 6)), ["40", "50", "60", "70", "80", "90"]);
        assert_eq!(labels(&linear_ticks(-90.0, 0.0, 3)), ["−50", "0"]);
        // A span of nothing, and one beyond what steps can count, end all the same.
        assert!(linear_ticks(1.0, 1.0, 5).len() < 1001);
        assert!(linear_ticks(1e18, 1e18 + 1024.0, 5).len() < 1001);
    }

    #[test]
    fn times_are_told_in_the_unit_that_suits_them() {
        let (ticks, unit) = time_ticks(0.0, 0.01, 5);
        assert_eq!((labels(&ticks), unit), (vec!["0", "2", "4", "6", "8", "10"], "ms"));
        assert!((ticks[5].value - 0.01).abs() < 1e-12);
        let (ticks, unit) = time_ticks(0.0, 4.0, 5);
        assert_eq!((labels(&ticks), unit), (vec!["0", "1", "2", "3", "4"], "s"));
        let (ticks, unit) = time_ticks(0.0, 3600.0, 6);
        assert_eq!(unit, "h:min:s");
        assert_eq!(labels(&ticks)[..3], ["0:00:00", "0:10:00", "0:20:00"]);
        let (ticks, unit) = time_ticks(60.0, 300.0, 8);
        assert_eq!((labels(&ticks)[0], unit), ("1:00", "min:s"));
        // Between two ticks of a long time the seconds are still told apart.
        assert_eq!(labels(&time_ticks(3000.0, 3000.5, 5).0)[1], "3000.1");
    }

    #[test]
    fn frequencies_are_labelled_in_hertz_and_kilohertz() {
        let all = frequency_ticks(20.0, 24_000.0, 20);
        assert_eq!(
            labels(&all),
            ["20 Hz", "50 Hz", "100 Hz", "200 Hz", "500 Hz", "1 kHz", "2 kHz", "5 kHz", "10 kHz", "20 kHz"]
        );
        assert_eq!(labels(&frequency_ticks(20.0, 24_000.0, 4)), ["100 Hz", "1 kHz", "10 kHz"]);
        assert_eq!(labels(&frequency_ticks(20.0, 24_000.0, 2)), ["100 Hz", "10 kHz"]);
    }

    #[test]
    fn logarithmic_ticks_thin_out() {
        assert_eq!(labels(&log_ticks(0.05, 1.0, 9)), ["0.05", "0.1", "0.2", "0.5", "1"]);
        assert_eq!(labels(&log_ticks(1e-6, 1.0, 4)), ["1e−6", "1e−4", "0.01", "1"]);
    }

    #[test]
    fn a_place_and_its_value_are_inverse() {
        for scale in [Scale::Linear { from: -3.0, to: 9.0 }, Scale::Logarithmic { from: 20.0, to: 24e3 }] {
            for place in [0.0, 0.3, 1.0] {
                assert!((scale.place(scale.value(place)) - place).abs() < 1e-12);
            }
        }
        assert!((Scale::Logarithmic { from: 10.0, to: 1000.0 }.place(100.0) - 0.5).abs() < 1e-12);
    }
}
