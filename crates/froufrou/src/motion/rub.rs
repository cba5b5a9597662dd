//! Whether two bodies that touch rest on each other, slide or roll.
//!
//! Two surfaces meet at a contact point c, which itself moves: with ċ in the world, with u_a = ċ − v_a and
//! u_b = ċ − v_b over each body, where v = v_centre + ω × r is the velocity of the body's material there. All of it
//! is taken along the surfaces, that is across the contact's normal. Then
//!
//! - the *slip* is |v_a − v_b| = |u_b − u_a|: how fast the surfaces move along each other;
//! - the *rolling speed* is |u_a + u_b| / 2: how fast the place where they touch moves along both.
//!
//! A ball that rolls has a slip of 0 and a rolling speed; a block that slides along a floor has the same point of its
//! own touching all the time (u_a = 0), so its rolling speed is half its slip; wheels that spin on the spot have a slip
//! and no rolling speed. What rolls may creep a little ([`MOST_CREEP`]).

use super::slide::LEAST_MPS;

/// What rolls slips by less than this part of its rolling speed.
pub const MOST_CREEP: f64 = 0.3;

/// How two bodies that touch move along each other, where they do not rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rubbing {
    /// Their surfaces slide along each other.
    Slide,
    /// One rolls along the other.
    Roll,
}

/// How two surfaces that touch move, in metres a second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// How fast the surfaces move along each other.
    pub slip_mps: f64,
    /// How fast the place where they touch moves along both, on average.
    pub rolling_mps: f64,
}

impl Surface {
    /// From the velocities of the material of `a` and of `b` at the contact point and of that point itself, in
    /// metres a second, and the contact's normal, of length 1 with either sign.
    pub fn new(a_mps: [f64; 3], b_mps: [f64; 3], point_mps: [f64; 3], normal: [f64; 3]) -> Self {
        let across = |v: [f64; 3]| {
            let along: f64 = (0..3).map(|i| v[i] * normal[i]).sum();
            (0..3).map(|i| (v[i] - along * normal[i]).powi(2)).sum::<f64>().sqrt()
        };
        Self {
            slip_mps: across(std::array::from_fn(|i| a_mps[i] - b_mps[i])),
            rolling_mps: across(std::array::from_fn(|i| point_mps[i] - 0.5 * (a_mps[i] + b_mps[i]))),
        }
    }
}

/// Tells rest, sliding and rolling apart: what is slower than [`LEAST_MPS`] in both ways rests. It looks at one moment
/// alone; a caller that follows a contact does well to ask for some agreement before it changes its mind.
///
/// ```
/// use froufrou::motion::rub::{Rubbing, Surface, classify};
/// // A wheel at 2 m/s that locks.
/// assert_eq!(classify(Surface { slip_mps: 0.01, rolling_mps: 2.0 }), Some(Rubbing::Roll));
/// assert_eq!(classify(Surface { slip_mps: 2.0, rolling_mps: 1.0 }), Some(Rubbing::Slide));
/// assert_eq!(classify(Surface { slip_mps: 0.0, rolling_mps: 0.0 }), None);
/// ```
pub fn classify(surface: Surface) -> Option<Rubbing> {
    let Surface { slip_mps, rolling_mps } = surface;
    if rolling_mps >= LEAST_MPS && slip_mps < MOST_CREEP * rolling_mps {
        Some(Rubbing::Roll)
    } else if slip_mps >= LEAST_MPS {
        Some(Rubbing::Slide)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const UP: [f64; 3] = [0.0, 1.0, 0.0];

    /// A ball of 10 cm on a floor, which moves on at `speed` and turns so fast that it would roll at `turn`.
    fn ball(speed: f64, turn: f64) -> Surface {
        Surface::new([speed - turn, 0.0, 0.0], [0.0; 3], [speed, 0.0, 0.0], UP)
    }

    #[test]
    fn balls_and_blocks_are_told_apart() {
        assert_eq!(classify(ball(1.0, 1.0)), Some(Rubbing::Roll));
        // Skidding without turning, spinning without moving, backspin.
        assert_eq!(classify(ball(1.0, 0.0)), Some(Rubbing::Slide));
        assert_eq!(classify(ball(0.0, 1.0)), Some(Rubbing::Slide));
        assert_eq!(classify(ball(1.0, -1.0)), Some(Rubbing::Slide));
        assert_eq!(classify(ball(0.0, 0.0)), None);
        assert_eq!(classify(ball(0.0005, 0.0005)), None);
        // A block carries its contact point along; so does a conveyor under a block that is held.
        assert_eq!(
            classify(Surface::new([0.5, 0.0, 0.0], [0.0; 3], [0.5, 0.0, 0.0], UP)),
            Some(Rubbing::Slide)
        );
        assert_eq!(classify(Surface::new([0.0; 3], [0.5, 0.0, 0.0], [0.0; 3], UP)), Some(Rubbing::Slide));
        // A block that rides on a cart rests, and so does a ball that is carried.
        let cart = [3.0, 0.0, 1.0];
        assert_eq!(classify(Surface::new(cart, cart, cart, UP)), None);
        // What comes straight at each other does not rub.
        assert_eq!(classify(Surface::new([0.0, -2.0, 0.0], [0.0; 3], [0.0, -1.0, 0.0], UP)), None);
    }

    #[test]
    fn two_gears_roll_and_the_speed_is_that_of_the_contact_over_both() {
        // Both surfaces go by at 2 m/s where they touch, and the point stays.
        let surface = Surface::new([2.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0; 3], UP);
        assert_eq!(surface, Surface { slip_mps: 0.0, rolling_mps: 2.0 });
        assert_eq!(classify(surface), Some(Rubbing::Roll));
    }

    #[test]
    fn nonsense_rests() {
        assert_eq!(classify(Surface { slip_mps: f64::NAN, rolling_mps: f64::NAN }), None);
        assert_eq!(classify(Surface { slip_mps: f64::NAN, rolling_mps: 1.0 }), None);
    }

    proptest! {
        /// Who is `a`, which way the normal points and how fast the observer moves do not matter.
        #[test]
        fn it_is_the_same_for_every_observer(
            a in prop::array::uniform3(-3.0..3.0f64),
            b in prop::array::uniform3(-3.0..3.0f64),
            c in prop::array::uniform3(-3.0..3.0f64),
            moving in prop::array::uniform3(-3.0..3.0f64),
        ) {
            let here = Surface::new(a, b, c, UP);
            let seen = |v: [f64; 3]| std::array::from_fn(|i| v[i] + moving[i]);
            for other in [Surface::new(b, a, c, UP), Surface::new(a, b, c, UP.map(|n| -n)), Surface::new(seen(a), seen(b), seen(c), UP)] {
                prop_assert!((other.slip_mps - here.slip_mps).abs() < 1e-12);
                prop_assert!((other.rolling_mps - here.rolling_mps).abs() < 1e-12);
            }
        }
    }
}
