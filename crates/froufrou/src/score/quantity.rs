//! The numbers of a score: what each one measures, which values it may take, and how it is written
//! so that reading gives back the very same bits.

use std::fmt::Write as _;

use crate::{Error, Result};

/// A kind of number: the reader and the writer refuse the same values with the same words.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// What it measures, with its unit, as an error names it.
    pub name: &'static str,
    bound: Bound,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Bound {
    Finite,
    NotNegative,
    Positive,
}

const fn quantity(name: &'static str, bound: Bound) -> Quantity {
    Quantity { name, bound }
}

pub const SPEED_OF_SOUND: Quantity = quantity("the speed of sound in metres a second", Bound::Positive);
pub const DURATION: Quantity = quantity("the duration in seconds", Bound::Positive);
pub const TIME: Quantity = quantity("the time in seconds", Bound::NotNegative);
pub const GAIN: Quantity = quantity("the gain", Bound::NotNegative);
pub const SIGNED_GAIN: Quantity = quantity("the gain", Bound::Finite);
pub const LEVEL: Quantity = quantity("the level in the channel", Bound::NotNegative);
pub const BAND_GAIN: Quantity = quantity("the gain of the octave band", Bound::NotNegative);
pub const DELAY: Quantity = quantity("the delay in seconds", Bound::NotNegative);
pub const PLAYBACK_SPEED: Quantity = quantity("the playback speed", Bound::Positive);
pub const OFFSET: Quantity = quantity("the offset in seconds", Bound::NotNegative);
pub const SHAPE_C: Quantity = quantity("the shape's c", Bound::NotNegative);
pub const SHAPE_K: Quantity = quantity("the shape's k", Bound::NotNegative);
pub const PARAMETER: Quantity = quantity("the value", Bound::Finite);
pub const HARMONIC: Quantity = quantity("the harmonic", Bound::Finite);
pub const FREQUENCY: Quantity = quantity("the frequency in hertz", Bound::Positive);
pub const DECAY: Quantity = quantity("the decay per second", Bound::Positive);
pub const MODE_GAIN: Quantity = quantity("the gain of the mode", Bound::Finite);
pub const IMPULSE: Quantity = quantity("the impulse in newton seconds", Bound::NotNegative);
pub const STRIKE_PLACE: Quantity = quantity("the place of the strike", Bound::NotNegative);
pub const SPREAD: Quantity = quantity("the spread", Bound::NotNegative);
pub const CONTACT: Quantity = quantity("the time of contact in seconds", Bound::NotNegative);
pub const POSITION: [Quantity; 3] = [
    quantity("the place's x in metres", Bound::Finite),
    quantity("the place's y in metres", Bound::Finite),
    quantity("the place's z in metres", Bound::Finite),
];
pub const TURN: Quantity = quantity("the turn", Bound::Finite);
pub const FROM: [Quantity; 3] = [
    quantity("the place's x in metres from the head", Bound::Finite),
    quantity("the place's y in metres from the head", Bound::Finite),
    quantity("the place's z in metres from the head", Bound::Finite),
];
pub const AZIMUTH: Quantity = quantity("the azimuth in degrees", Bound::Finite);
pub const ELEVATION: Quantity = quantity("the elevation in degrees", Bound::Finite);
pub const UP: [Quantity; 3] = [
    quantity("the upward direction's x", Bound::Finite),
    quantity("the upward direction's y", Bound::Finite),
    quantity("the upward direction's z", Bound::Finite),
];
pub const FACING: [Quantity; 3] = [
    quantity("the facing direction's x", Bound::Finite),
    quantity("the facing direction's y", Bound::Finite),
    quantity("the facing direction's z", Bound::Finite),
];

impl Quantity {
    /// The number itself, if it is one this quantity may have.
    pub fn check(self, number: f64) -> Result<f64> {
        let allowed = match self.bound {
            Bound::Finite => number.is_finite(),
            Bound::NotNegative => number.is_finite() && number >= 0.0,
            Bound::Positive => number.is_finite() && number > 0.0,
        };
        if allowed {
            return Ok(number);
        }
        let must = match self.bound {
            _ if !number.is_finite() => "must be a finite number",
            Bound::Finite | Bound::NotNegative => "must not be negative",
            Bound::Positive => "must be above 0",
        };
        Err(Error::new(format!("{} is {number}, but it {must}", self.name)))
    }

    /// Appends the number's shortest text that reads back as the same bits. A negative zero is
    /// written `-0` and stays one.
    pub fn push(self, text: &mut String, number: f64) -> Result<()> {
        let number = self.check(number)?;
        let magnitude = number.abs();
        // Rust never writes an exponent by itself: 1e300 would fill 301 columns.
        let written = if magnitude == 0.0 || (1e-5..1e16).contains(&magnitude) {
            write!(text, "{number}")
        } else {
            write!(text, "{number:e}")
        };
        written.map_err(|error| Error::new("cannot write a number").because(error))
    }
}

/// A direction must have one: long enough and short enough that its length can be computed.
fn has_length([x, y, z]: [f64; 3]) -> bool {
    (x * x + y * y + z * z).is_normal()
}

/// The direction that a microphone faces.
pub fn check_facing(facing: [f64; 3]) -> Result<[f64; 3]> {
    if has_length(facing) {
        return Ok(facing);
    }
    let [x, y, z] = facing;
    Err(Error::new(format!("the facing direction {x} {y} {z} has no usable length"))
        .help("give any vector that points where the microphone faces, such as `0 0 -1`"))
}

/// The direction that is up for a microphone.
pub fn check_up(up: [f64; 3]) -> Result<[f64; 3]> {
    if has_length(up) {
        return Ok(up);
    }
    let [x, y, z] = up;
    Err(Error::new(format!("the upward direction {x} {y} {z} has no usable length"))
        .help("give any vector that points up for the microphone, such as `0 1 0`"))
}

/// A turn is a quaternion of any length that can be computed.
pub fn check_turn(turn: [f64; 4]) -> Result<[f64; 4]> {
    if turn.iter().map(|c| c * c).sum::<f64>().is_normal() {
        return Ok(turn);
    }
    let [x, y, z, w] = turn;
    Err(Error::new(format!("the turn {x} {y} {z} {w} has no usable length"))
        .help("give a quaternion x y z w, such as `0 0 0 1` for none"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn written(number: f64) -> String {
        let mut text = String::new();
        POSITION[0].push(&mut text, number).unwrap();
        text
    }

    #[test]
    fn numbers_are_written_as_a_person_would() {
        for (number, text) in [
            (0.0, "0"),
            (-0.0, "-0"),
            (343.0, "343"),
            (0.1, "0.1"),
            (-53.25, "-53.25"),
            (0.00001, "0.00001"),
            (0.000001, "1e-6"),
            (1e15, "1000000000000000"),
            (1e16, "1e16"),
            (f64::MAX, "1.7976931348623157e308"),
            (5e-324, "5e-324"),
        ] {
            assert_eq!(written(number), text);
        }
    }

    #[test]
    fn refusals_say_what_must_hold() {
        let message = |result: Result<f64>| result.unwrap_err().to_string();
        assert_eq!(message(GAIN.check(-0.5)), "the gain is -0.5, but it must not be negative");
        assert_eq!(message(PLAYBACK_SPEED.check(0.0)), "the playback speed is 0, but it must be above 0");
        assert_eq!(
            message(POSITION[2].check(f64::NAN)),
            "the place's z in metres is NaN, but it must be a finite number"
        );
        assert_eq!(
            message(DELAY.check(f64::INFINITY)),
            "the delay in seconds is inf, but it must be a finite number"
        );
        assert!(GAIN.check(-0.0).is_ok());
        assert!(check_facing([0.0, 0.0, 0.0]).is_err());
        assert!(check_facing([1e-200, 0.0, 0.0]).is_err());
        assert!(check_facing([0.0, 3.0, -4.0]).is_ok());
    }

    proptest! {
        #[test]
        fn every_finite_number_reads_back_as_the_same_bits(bits: u64) {
            let number = f64::from_bits(bits);
            prop_assume!(number.is_finite());
            prop_assert_eq!(written(number).parse::<f64>().unwrap().to_bits(), bits);
        }
    }
}
