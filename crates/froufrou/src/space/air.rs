//! What air takes from a sound on its way, and how fast it lets it pass (ISO 9613-1:1993).
//!
//! Air absorbs by its viscosity and by molecules of oxygen and nitrogen that begin to vibrate, which depends much
//! on how much water is in it. Over a room's width it is next to nothing below 2 kHz; over 100 m it takes 10 dB
//! from the band of 8 kHz.

use super::bands::{BANDS_HZ, Bands};
use crate::{Error, Result};

/// The pressure of one atmosphere, in kPa.
pub const ATMOSPHERE_KPA: f64 = 101.325;

/// 20 °C, at which the formulas of the standard are anchored, in K.
const REFERENCE_K: f64 = 293.15;

/// Where ice, water and vapour of water are in balance, in K: +0.01 °C.
const TRIPLE_K: f64 = 273.16;

/// Air of one temperature, humidity and pressure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Air {
    kelvin: f64,
    /// Of one atmosphere.
    atmospheres: f64,
    /// Molecules of water in a hundred of air.
    water_percent: f64,
}

/// What sound goes through: how fast, and what it loses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Medium {
    speed_of_sound_mps: f64,
    absorption_db_per_m: Bands,
}

impl Medium {
    /// A medium of a speed of sound that takes so much from each octave band in each metre.
    pub fn new(speed_of_sound_mps: f64, absorption_db_per_m: Bands) -> Self {
        Self { speed_of_sound_mps, absorption_db_per_m }
    }

    /// The speed of sound in m/s.
    pub fn speed_of_sound_mps(&self) -> f64 {
        self.speed_of_sound_mps
    }

    /// By how many dB each octave band falls in each metre.
    pub fn band_absorption_db_per_m(&self) -> Bands {
        self.absorption_db_per_m
    }
}

impl Default for Medium {
    /// The air of a room.
    fn default() -> Self {
        Air::default().medium()
    }
}

impl Default for Air {
    /// A room: 20 °C, half saturated, one atmosphere.
    fn default() -> Self {
        Self::of(20.0, 50.0, ATMOSPHERE_KPA)
    }
}

impl Air {
    /// Air of −73 to 60 °C, of a relative humidity of 0 to 100 %, at 1 to 200 kPa. The standard's formulas err by
    /// less than 10 % between −20 and 50 °C where there is between 0.05 and 5 % of water in the air, and by less than
    /// 50 % elsewhere.
    ///
    /// ```
    /// use froufrou::space::air::{ATMOSPHERE_KPA, Air};
    /// let air = Air::new(15.0, 80.0, ATMOSPHERE_KPA)?;
    /// assert!((air.absorption_db_per_m(1000.0) - 0.0041).abs() < 0.0001);
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    pub fn new(temperature_c: f64, humidity_percent: f64, pressure_kpa: f64) -> Result<Self> {
        let within = |what: &str, unit: &str, value: f64, (least, most): (f64, f64)| {
            if (least..=most).contains(&value) {
                return Ok(());
            }
            Err(Error::new(format!(
                "the air's {what} is {value} {unit}; expected a number from {least} to {most}"
            )))
        };
        within("temperature", "°C", temperature_c, (-73.0, 60.0))?;
        within("relative humidity", "%", humidity_percent, (0.0, 100.0))?;
        within("pressure", "kPa", pressure_kpa, (1.0, 200.0))?;
        Ok(Self::of(temperature_c, humidity_percent, pressure_kpa))
    }

    fn of(temperature_c: f64, humidity_percent: f64, pressure_kpa: f64) -> Self {
        let (kelvin, atmospheres) = (temperature_c + 273.15, pressure_kpa / ATMOSPHERE_KPA);
        // Of one atmosphere (equation B.2 and B.3).
        let saturation = 10f64.powf(4.6151 - 6.8346 * (TRIPLE_K / kelvin).powf(1.261));
        Self { kelvin, atmospheres, water_percent: humidity_percent * saturation / atmospheres }
    }

    /// The speed of sound in m/s: 343.2 at 20 °C, and as the root of the absolute temperature.
    pub fn speed_of_sound_mps(&self) -> f64 {
        343.2 * (self.kelvin / REFERENCE_K).sqrt()
    }

    /// As what sound goes through.
    pub fn medium(&self) -> Medium {
        Medium::new(self.speed_of_sound_mps(), self.band_absorption_db_per_m())
    }

    /// By how many dB a pure tone falls in each metre (equations 3 to 5).
    pub fn absorption_db_per_m(&self, frequency_hz: f64) -> f64 {
        let (water, atmospheres) = (self.water_percent, self.atmospheres);
        let warmth = self.kelvin / REFERENCE_K;
        let oxygen_hz = atmospheres * (24.0 + 4.04e4 * water * (0.02 + water) / (0.391 + water));
        let nitrogen_hz = atmospheres / warmth.sqrt()
            * (9.0 + 280.0 * water * (-4.170 * (warmth.powf(-1.0 / 3.0) - 1.0)).exp());
        let square = frequency_hz * frequency_hz;
        let classical = 1.84e-11 / atmospheres * warmth.sqrt();
        let oxygen = 0.01275 * (-2239.1 / self.kelvin).exp() / (oxygen_hz + square / oxygen_hz);
        let nitrogen = 0.1068 * (-3352.0 / self.kelvin).exp() / (nitrogen_hz + square / nitrogen_hz);
        8.686 * square * (classical + warmth.powf(-2.5) * (oxygen + nitrogen))
    }

    /// By how many dB each octave band falls in each metre: that of the pure tone at its exact middle, as the
    /// standard takes it for bands.
    pub fn band_absorption_db_per_m(&self) -> Bands {
        BANDS_HZ.map(|frequency_hz| self.absorption_db_per_m(frequency_hz))
    }
}

/// What is left of the pressure of each band after a distance, where it falls by so many dB in each metre
/// ([`Air::band_absorption_db_per_m`], which needs to be made only once).
pub fn gains(absorption_db_per_m: &Bands, distance_m: f64) -> Bands {
    absorption_db_per_m.map(|db| 10f64.powf(-db * distance_m / 20.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absorption_is_that_of_the_standards_table() {
        // ISO 9613-2:1996, table 2: dB/km for the octave bands from 63 Hz to 8 kHz, by the formulas of part 1.
        let table = [
            (10.0, 70.0, ["0.1", "0.4", "1.0", "1.9", "3.7", "9.7", "32.8", "117"]),
            (20.0, 70.0, ["0.1", "0.3", "1.1", "2.8", "5.0", "9.0", "22.9", "76.6"]),
            (30.0, 70.0, ["0.1", "0.3", "1.0", "3.1", "7.4", "12.7", "23.1", "59.3"]),
            (15.0, 20.0, ["0.3", "0.6", "1.2", "2.7", "8.2", "28.2", "88.8", "202"]),
            (15.0, 50.0, ["0.1", "0.5", "1.2", "2.2", "4.2", "10.8", "36.2", "129"]),
            (15.0, 80.0, ["0.1", "0.3", "1.1", "2.4", "4.1", "8.3", "23.7", "82.8"]),
        ];
        for (temperature_c, humidity_percent, row) in table {
            let air = Air::new(temperature_c, humidity_percent, ATMOSPHERE_KPA).unwrap();
            for (db, expected) in air.band_absorption_db_per_m().into_iter().zip(row) {
                let decimals = expected.split('.').nth(1).map_or(0, str::len);
                let (unit, expected) = (0.1f64.powi(decimals as i32), expected.parse::<f64>().unwrap());
                // 4.151 stands there as 4.1, rounded by way of 4.15.
                let error = (1000.0 * db - expected).abs();
                assert!(error < 0.52 * unit, "{temperature_c} °C, {humidity_percent} %: {db}, {expected}");
            }
        }
    }

    #[test]
    fn absorption_and_speed_are_those_of_python_acoustics() {
        let text = include_str!("../../tests/fixtures/air.tsv");
        let mut rows = 0;
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            let row: Vec<f64> = line.split('\t').map(|n| n.parse().unwrap()).collect();
            let air = Air::new(row[0], row[1], row[2]).unwrap();
            let found = air.absorption_db_per_m(row[3]);
            assert!((found / row[4] - 1.0).abs() < 1e-12, "{row:?}: {found}");
            assert!((air.speed_of_sound_mps() / row[5] - 1.0).abs() < 1e-12, "{row:?}");
            rows += 1;
        }
        assert_eq!(rows, 72);
    }

    #[test]
    fn the_speed_of_sound_is_what_tables_say() {
        for (temperature_c, expected) in [(-20.0, 318.9), (0.0, 331.3), (20.0, 343.2), (40.0, 354.7)] {
            let found = Air::new(temperature_c, 0.0, ATMOSPHERE_KPA).unwrap().speed_of_sound_mps();
            assert!((found - expected).abs() < 0.06, "{temperature_c}: {found}");
        }
    }

    #[test]
    fn gains_multiply_over_distances() {
        let absorption = Air::default().band_absorption_db_per_m();
        let (once, twice) = (gains(&absorption, 250.0), gains(&absorption, 500.0));
        for ((once, twice), db) in once.into_iter().zip(twice).zip(absorption) {
            assert!((once * once - twice).abs() < 1e-14);
            assert!((-20.0 * once.log10() - 250.0 * db).abs() < 1e-9);
        }
        assert_eq!(gains(&absorption, 0.0), [1.0; 8]);
        assert!(once.windows(2).all(|pair| pair[0] > pair[1]));
    }

    #[test]
    fn dry_thin_and_cold_air_has_an_absorption() {
        for air in [Air::new(-73.0, 0.0, 1.0), Air::new(60.0, 100.0, 200.0), Air::new(-73.0, 100.0, 200.0)] {
            let absorption = air.unwrap().band_absorption_db_per_m();
            assert!(absorption.iter().all(|db| db.is_finite() && *db > 0.0), "{absorption:?}");
        }
    }

    #[test]
    fn what_is_no_air_is_refused() {
        for (c, percent, kpa) in [
            (f64::NAN, 50.0, 100.0),
            (-300.0, 50.0, 100.0),
            (20.0, -1.0, 100.0),
            (20.0, 101.0, 100.0),
            (20.0, 50.0, 0.0),
        ] {
            assert!(Air::new(c, percent, kpa).is_err(), "{c} {percent} {kpa}");
        }
        let error = Air::new(2000.0, 50.0, 100.0).unwrap_err().to_string();
        assert_eq!(error, "the air's temperature is 2000 °C; expected a number from -73 to 60");
    }
}
