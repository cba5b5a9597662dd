//! Octave bands, and the filter that has a gain for each of them.
//!
//! What walls and air take from a sound is told in octave bands. The filter of eight gains is a sum of eight
//! responses that are made once for a sampling rate. They are symmetric about their middle, so that the filter moves
//! nothing in time, and their sum is an impulse, so that equal gains change nothing but the level.
//!
//! | quantity | value |
//! | --- | --- |
//! | length | 20 ms unless said otherwise ([`BandFilters::with_length`]) |
//! | gain in the middle of a band | within 0.1 dB of what was asked, where no neighbour differs by more than 10 dB |
//! | between two bands that differ by 10 dB | between 63 and 125 Hz, where 20 ms are short, up to 1 dB beyond the louder and 2.4 dB beyond the softer; above up to 0.15 and 0.4 dB |
//! | cost of a filter | about 2.9 multiplications and additions for each tap |

use crate::synth::kernel::{kaiser, sinc};
use crate::{Error, Result};

/// How many bands there are.
pub const BAND_COUNT: usize = 8;

/// A value for each octave band, most often a gain of pressure.
pub type Bands = [f64; BAND_COUNT];

/// The exact middles of the octave bands (IEC 61260-1, base ten: 1000 · 10^(3k/10)) that are called 63, 125, 250, 500
/// Hz, 1, 2, 4 and 8 kHz.
pub const BANDS_HZ: Bands = [
    63.095_734_448_019_33,
    125.892_541_179_416_73,
    251.188_643_150_958,
    501.187_233_627_272_25,
    1_000.0,
    1_995.262_314_968_879_5,
    3_981.071_705_534_973,
    7_943.282_347_242_815,
];

/// How long the responses are unless said otherwise.
const LENGTH_S: f64 = 0.02;

/// Below this length the bands of 63 and 125 Hz are not told apart, in seconds.
const SHORTEST_S: f64 = 0.016;

/// No filter is longer, in seconds: nothing is gained beyond 40 ms.
const LONGEST_S: f64 = 0.1;

/// The length of a transition between two bands times its width. Higher bands need less time.
const TIME_BANDWIDTH: f64 = 2.5;

/// A low pass: 1 up to the middle of one band and 0 from the middle of the next.
struct LowPass {
    /// Its first tap in the whole response.
    first: usize,
    taps: Vec<f32>,
}

/// The responses whose weighted sum is a filter.
pub struct BandFilters {
    centre: usize,
    /// Between each band and the next; none where the next is beyond the Nyquist frequency.
    low_passes: Vec<LowPass>,
}

impl BandFilters {
    /// Filters of 20 ms at a sampling rate of 8 to 192 kHz. Bands whose middle is not below the Nyquist frequency
    /// are left out, and the highest that is reaches up to it.
    ///
    /// ```
    /// use froufrou::space::bands::BandFilters;
    /// let filters = BandFilters::new(48_000.0)?;
    /// let mut response = vec![0.0; filters.taps()];
    /// filters.fill(&[0.9, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3], &mut response);
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    pub fn new(rate_hz: f64) -> Result<Self> {
        Self::with_length(rate_hz, LENGTH_S)
    }

    /// Filters of another length, from 16 to 100 ms. With 40 ms the lowest bands are told apart as well as the
    /// others; shorter ones ring less before the sound and cost less.
    pub fn with_length(rate_hz: f64, length_s: f64) -> Result<Self> {
        if !(8000.0..=192_000.0).contains(&rate_hz) {
            return Err(Error::new(format!(
                "a sampling rate of {rate_hz} Hz; octave bands are filtered at 8000 to 192000 Hz"
            )));
        }
        if !(SHORTEST_S..=LONGEST_S).contains(&length_s) {
            return Err(Error::new(format!(
                "filters of {length_s} s; octave bands are told apart by {SHORTEST_S} to {LONGEST_S} s"
            )));
        }
        Ok(Self::shaped(rate_hz, length_s, TIME_BANDWIDTH))
    }

    /// With a product of time and bandwidth of each transition.
    fn shaped(rate_hz: f64, length_s: f64, time_bandwidth: f64) -> Self {
        let centre = (0.5 * length_s * rate_hz) as usize;
        let low_pass = |band: usize| {
            let width_hz = BANDS_HZ[band + 1] - BANDS_HZ[band];
            let half = ((0.5 * time_bandwidth / width_hz * rate_hz).round() as usize).min(centre);
            LowPass { first: centre - half, taps: low_pass(band, half, rate_hz) }
        };
        let heard = BANDS_HZ.iter().filter(|middle_hz| **middle_hz < 0.5 * rate_hz).count();
        Self { centre, low_passes: (0..heard - 1).map(low_pass).collect() }
    }

    /// How many taps a filter has: an odd number.
    pub fn taps(&self) -> usize {
        2 * self.centre + 1
    }

    /// The tap that is at time 0.
    pub fn centre(&self) -> usize {
        self.centre
    }

    /// Writes the filter of some gains into `out`, which has [`BandFilters::taps`] places (others are set to 0, and
    /// what has no place is left out).
    pub fn fill(&self, gains: &Bands, out: &mut [f32]) {
        out.fill(0.0);
        let heard = self.low_passes.len();
        // Σ g_b (L_b − L_{b−1}), where the last L is an impulse.
        if let Some(centre) = out.get_mut(self.centre) {
            *centre = gains[heard] as f32;
        }
        for (low_pass, pair) in self.low_passes.iter().zip(gains.windows(2)) {
            let step = (pair[0] - pair[1]) as f32;
            if step != 0.0 {
                let places = out.iter_mut().skip(low_pass.first);
                places.zip(&low_pass.taps).for_each(|(place, tap)| *place += step * tap);
            }
        }
    }
}

/// The taps of a low pass of 2 `half` + 1 taps: a sinc under Kaiser's window, mended where it should be exact.
fn low_pass(band: usize, half: usize, rate_hz: f64) -> Vec<f32> {
    let (pass_hz, stop_hz) = (BANDS_HZ[band], BANDS_HZ[band + 1]);
    let taps = 2 * half + 1;
    // What attenuation the length and width allow, and the window for it (Kaiser 1974).
    let attenuation_db = 8.0 + 14.36 * taps as f64 * (stop_hz - pass_hz) / rate_hz;
    let beta = match attenuation_db {
        a if a > 50.0 => 0.1102 * (a - 8.7),
        a if a > 21.0 => 0.5842 * (a - 21.0).powf(0.4) + 0.07886 * (a - 21.0),
        _ => 0.0,
    };
    let cutoff = (pass_hz + stop_hz) / rate_hz;
    let at = |tap: usize| tap as f64 - half as f64;
    let window: Vec<f64> = (0..taps).map(|tap| kaiser(at(tap) / (half as f64 + 0.5), beta)).collect();
    let mut response: Vec<f64> =
        window.iter().enumerate().map(|(tap, w)| w * cutoff * sinc(cutoff * at(tap))).collect();

    // It shall be 1 at 0 Hz and in the middle of this band and of the one below, and 0 in the middle of the two
    // above: add windowed cosines of these frequencies, as many as there are conditions.
    let middles = &BANDS_HZ[band.saturating_sub(1)..(band + 3).min(BAND_COUNT)];
    let conditions: Vec<(f64, f64)> = std::iter::once(0.0)
        .chain(middles.iter().copied())
        .filter(|middle_hz| *middle_hz < 0.5 * rate_hz)
        .map(|middle_hz| {
            (std::f64::consts::TAU * middle_hz / rate_hz, if middle_hz <= pass_hz { 1.0 } else { 0.0 })
        })
        .collect();
    let mut equations: Vec<Vec<f64>> = conditions
        .iter()
        .map(|(row, target)| {
            let found: f64 = response.iter().enumerate().map(|(tap, r)| r * (row * at(tap)).cos()).sum();
            let inner = |column: f64| -> f64 {
                let terms = window.iter().enumerate();
                terms.map(|(tap, w)| w * (row * at(tap)).cos() * (column * at(tap)).cos()).sum()
            };
            conditions.iter().map(|(column, _)| inner(*column)).chain([target - found]).collect()
        })
        .collect();
    for ((frequency, _), weight) in conditions.iter().zip(solve(&mut equations)) {
        for (tap, (r, w)) in response.iter_mut().zip(&window).enumerate() {
            *r += weight * w * (frequency * at(tap)).cos();
        }
    }
    response.into_iter().map(|r| r as f32).collect()
}

/// Solves linear equations whose matrix is symmetric and positive, each given with its right side behind it.
fn solve(rows: &mut [Vec<f64>]) -> Vec<f64> {
    let count = rows.len();
    for pivot in 0..count {
        let (done, rest) = rows.split_at_mut(pivot + 1);
        let Some(upper) = done.last() else { continue };
        for row in rest {
            let factor = row[pivot] / upper[pivot];
            row.iter_mut().zip(upper).for_each(|(value, above)| *value -= factor * above);
        }
    }
    let mut solution = vec![0.0; count];
    for (index, row) in rows.iter().enumerate().rev() {
        let known: f64 = (index + 1..count).map(|column| row[column] * solution[column]).sum();
        solution[index] = (row[count] - known) / row[index];
    }
    solution
}

#[cfg(test)]
mod tests {
    use realfft::RealFftPlanner;
    use realfft::num_complex::Complex;

    use super::*;

    const RATES_HZ: [f64; 7] = [8000.0, 16_000.0, 22_050.0, 44_100.0, 48_000.0, 96_000.0, 192_000.0];

    fn filter(filters: &BandFilters, gains: &Bands) -> Vec<f32> {
        let mut out = vec![7.0; filters.taps()];
        filters.fill(gains, &mut out);
        out
    }

    /// The response about the middle at a frequency; its imaginary part is 0 where it is symmetric.
    fn response(taps: &[f32], frequency_hz: f64, rate_hz: f64) -> Complex<f64> {
        let turn = -std::f64::consts::TAU * frequency_hz / rate_hz;
        let at = |tap: usize| turn * (tap as f64 - (taps.len() / 2) as f64);
        taps.iter().enumerate().map(|(tap, h)| Complex::from_polar(f64::from(*h), at(tap))).sum()
    }

    fn db(gain: f64) -> f64 {
        20.0 * gain.log10()
    }

    /// The bands that are heard at a rate.
    fn heard(rate_hz: f64) -> usize {
        BANDS_HZ.iter().filter(|f| **f < rate_hz / 2.0).count()
    }

    #[test]
    fn equal_gains_are_an_impulse_to_the_last_bit() {
        for rate_hz in RATES_HZ {
            let filters = BandFilters::new(rate_hz).unwrap();
            let mut expected = vec![0.0; filters.taps()];
            expected[filters.centre()] = 0.37;
            assert_eq!(filter(&filters, &[0.37; 8]), expected);
            assert_eq!(filters.taps(), 2 * filters.centre() + 1);
            assert!(filters.taps() as f64 <= 0.02 * rate_hz + 1.0);
        }
    }

    #[test]
    fn the_responses_of_the_bands_add_up_to_an_impulse() {
        for rate_hz in RATES_HZ {
            let filters = BandFilters::new(rate_hz).unwrap();
            let mut sum = vec![0.0f64; filters.taps()];
            for band in 0..8 {
                let one = filter(&filters, &std::array::from_fn(|b| if b == band { 1.0 } else { 0.0 }));
                sum.iter_mut().zip(&one).for_each(|(sum, h)| *sum += f64::from(*h));
                assert_eq!(one.iter().any(|h| *h != 0.0), band < heard(rate_hz));
                assert!((0..one.len()).all(|i| (one[i] - one[one.len() - 1 - i]).abs() < 1e-7), "symmetric");
            }
            sum[filters.centre()] -= 1.0;
            assert!(sum.iter().all(|s| s.abs() < 1e-7), "{rate_hz}");
        }
    }

    #[test]
    fn a_step_of_10_db_is_met_in_the_middle_of_each_band() {
        for rate_hz in RATES_HZ {
            let filters = BandFilters::new(rate_hz).unwrap();
            for (step, up) in (0..heard(rate_hz) - 1).flat_map(|step| [(step, true), (step, false)]) {
                let gains: Bands =
                    std::array::from_fn(|band| if (band > step) == up { 1.0 } else { 0.1f64.sqrt() });
                let taps = filter(&filters, &gains);
                for band in 0..heard(rate_hz) {
                    let found = response(&taps, BANDS_HZ[band], rate_hz);
                    assert!(found.im.abs() < 1e-6);
                    let error_db = db(found.re / gains[band]);
                    assert!(error_db.abs() < 0.1, "{rate_hz} step {step} {up}, band {band}: {error_db}");
                }
                // And nothing strange between them.
                for i in 0..400 {
                    let frequency_hz = 0.5 * rate_hz * 0.975f64.powi(i);
                    let found = db(response(&taps, frequency_hz, rate_hz).norm());
                    assert!((-12.5..1.0).contains(&found), "{rate_hz} step {step} {frequency_hz}: {found}");
                }
            }
        }
    }

    #[test]
    fn gentle_gains_are_met_in_the_middle_of_each_band() {
        let random = crate::random::Random::new(3, 1);
        for rate_hz in RATES_HZ {
            let filters = BandFilters::new(rate_hz).unwrap();
            for trial in 0..50 {
                // Steps of up to 3 dB.
                let mut level_db = 0.0;
                let gains: Bands = std::array::from_fn(|band| {
                    level_db += 6.0 * random.uniform(8 * trial + band as u64) - 3.0;
                    10f64.powf(level_db / 20.0)
                });
                let taps = filter(&filters, &gains);
                for (middle_hz, gain) in BANDS_HZ.iter().zip(gains).take(heard(rate_hz)) {
                    let error_db = db(response(&taps, *middle_hz, rate_hz).re / gain);
                    assert!(error_db.abs() < 0.1, "{rate_hz} {middle_hz}: {error_db}");
                }
            }
        }
    }

    #[test]
    fn the_ends_reach_down_to_0_hz_and_up_to_the_nyquist_frequency() {
        for rate_hz in RATES_HZ {
            let filters = BandFilters::new(rate_hz).unwrap();
            let top = heard(rate_hz) - 1;
            let taps = filter(&filters, &std::array::from_fn(|b| [0.5, 0.25][usize::from(b == top)]));
            assert!(db(response(&taps, 0.0, rate_hz).re / 0.5).abs() < 0.1);
            // The highest may lie all in its transition, where the Nyquist frequency is just above its middle.
            assert!(db(response(&taps, 0.5 * rate_hz, rate_hz).re / 0.25).abs() < 0.2, "{rate_hz}");
        }
    }

    #[test]
    fn the_whole_response_is_that_of_an_fft() {
        // The sum of responses as an FFT sees them: at 48 kHz, 40 ms, no ripple beyond 0.15 dB of a step of 10 dB.
        let filters = BandFilters::with_length(48_000.0, 0.04).unwrap();
        let taps = filter(&filters, &[1.0, 1.0, 1.0, 0.1f64.sqrt(), 0.1f64.sqrt(), 1.0, 1.0, 1.0]);
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(1 << 15);
        let mut buffer = fft.make_input_vec();
        buffer.iter_mut().zip(&taps).for_each(|(to, from)| *to = f64::from(*from));
        let mut bins = fft.make_output_vec();
        fft.process(&mut buffer, &mut bins).unwrap();
        for (bin, found) in bins.iter().enumerate() {
            let frequency_hz = bin as f64 * 48_000.0 / f64::from(1 << 15);
            let level = db(found.norm());
            assert!((-10.4..0.15).contains(&level), "{frequency_hz}: {level}");
            if !(200.0..2500.0).contains(&frequency_hz) {
                assert!(level > -0.3, "{frequency_hz}: {level}");
            }
            if (520.0..960.0).contains(&frequency_hz) {
                assert!((level + 10.0).abs() < 0.4, "{frequency_hz}: {level}");
            }
        }
    }

    #[test]
    fn odd_input_is_refused_or_borne() {
        for rate_hz in [f64::NAN, 0.0, 7999.0, 192_001.0, f64::INFINITY] {
            assert!(BandFilters::new(rate_hz).is_err(), "{rate_hz}");
        }
        for length_s in [f64::NAN, 0.0, 0.01, 0.2] {
            assert!(BandFilters::with_length(48_000.0, length_s).is_err(), "{length_s}");
        }
        let filters = BandFilters::new(8000.0).unwrap();
        let gains = [1.0, 0.5, 0.25, 0.5, 1.0, 0.5, 0.25, 0.5];
        let whole = filter(&filters, &gains);
        for count in [0, 3, filters.taps() - 1, filters.taps() + 10] {
            let mut out = vec![7.0; count];
            filters.fill(&gains, &mut out);
            let both = count.min(whole.len());
            assert_eq!(out[..both], whole[..both]);
            assert!(out[both..].iter().all(|h| *h == 0.0));
        }
    }
}
