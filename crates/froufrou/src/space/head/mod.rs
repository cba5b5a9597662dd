//! What a head does to sound from a direction: how much later and how differently it reaches each ear.
//!
//! A [`Head`] at one output rate is asked for a direction and gives, for each ear, a filter, a delay and a
//! gain. It is either [a sphere](Head::spherical), so that something binaural works without any file, or
//! [measured](Measured): head-related impulse responses from a SOFA file.
//!
//! | room | what it knows |
//! | --- | --- |
//! | `sphere` | the way of sound about a sphere, and its shadow (Brown & Duda 1998) |
//! | `hdf`, `sofa`, `coordinates` | the file: HDF5 within, the SOFA convention, its coordinates |
//! | `onset` | when a response begins (Nam et al. 2008) |
//! | `grid` | which measured directions lie about another |
//! | `measured` | the set with its onsets; whole responses at the file's own rate |
//! | `aligned` | the set at an output rate, and mixtures of it |
//!
//! # What a set may look like
//!
//! Any sampling rate and any directions: holes are bridged, and a ring or a single direction do. Of directions
//! measured at several distances the farthest are taken, with those up to a tenth nearer; the nearness of a
//! source is what this module adds itself. Where `ReceiverPosition` has the ears exchanged, as the
//! responses show clearly, the responses are believed.
//!
//! # Near the head
//!
//! The caller lets sound fall as 1 / distance from the head's *centre*. Within a few metres one ear is clearly
//! nearer than the other: `hear` gives for each ear the factor from the centre's distance to the length of its
//! own way, and the difference of ways as delay, both relative to the distance where the set was measured.
//! Within [`NEAR_M`] of the centre what depends on direction fades out, so that a source may pass through.

mod aligned;
mod coordinates;
mod field;
mod grid;
mod hdf;
mod measured;
mod onset;
mod sofa;
mod sphere;
#[cfg(test)]
mod tests;

use std::path::Path;

pub use field::FieldResponses;
pub use measured::Measured;

use super::microphone::NEAR_M;
use crate::Result;
use aligned::Aligned;
use measured::side;
use sphere::{RADIUS_M, SPEED_OF_SOUND_MPS, Shadow, alpha, detour_m};

/// Where one looks who is asked about no direction at all.
const AHEAD: [f64; 3] = [0.0, 0.0, -1.0];

/// A head at one output rate, ready to be asked.
///
/// ```
/// use froufrou::space::head::Head;
/// let head = Head::spherical(48_000.0);
/// let mut taps = [vec![0.0; head.taps()], vec![0.0; head.taps()]];
/// let [left, right] = &mut taps;
/// // From the right, 2 m away.
/// let ears = head.hear([2.0, 0.0, 0.0], [left, right]);
/// assert!(ears[0].delay_s - ears[1].delay_s > 0.0006);
/// ```
#[derive(Debug)]
pub struct Head {
    rate_hz: f64,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Sphere(Shadow),
    Measured(Aligned),
}

/// How sound arrives at an ear, besides the ear's filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EarArrival {
    /// How much later than at the head's centre, in seconds, if the head were not there; negative on the near
    /// side.
    pub delay_s: f64,
    /// The factor between what falls as 1 / distance from the head's centre and what reaches the ear: 1 far away.
    pub gain: f64,
}

impl Head {
    /// A sphere of radius 8.75 cm with its ears at both ends of an axis, after Brown & Duda (1998).
    pub fn spherical(rate_hz: f64) -> Self {
        let rate_hz = sane(rate_hz);
        Self { rate_hz, kind: Kind::Sphere(Shadow::new(rate_hz)) }
    }

    /// A measured head from a SOFA file of the convention SimpleFreeFieldHRIR.
    ///
    /// # Errors
    /// Where the file cannot be read, is damaged, or holds something else.
    pub fn open(path: &Path, rate_hz: f64) -> Result<Self> {
        Ok(Measured::open(path)?.head(rate_hz))
    }

    /// The output rate in hertz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// The length of each ear's filter.
    pub fn taps(&self) -> usize {
        match &self.kind {
            Kind::Sphere(shadow) => shadow.taps.len(),
            Kind::Measured(aligned) => aligned.taps,
        }
    }

    /// The tap that stands at time 0: those before it begin a little before the arrival that [`EarArrival`] tells,
    /// as a band-limited response must. An ear hears x(t) as the sum over all taps k of
    /// gain · filter\[k\] · x(t − delay_s − (k − lead) / rate).
    pub fn lead(&self) -> usize {
        match &self.kind {
            Kind::Sphere(shadow) => shadow.lead,
            Kind::Measured(aligned) => aligned.lead,
        }
    }

    /// What sound from a place does at the left and the right ear.
    ///
    /// `from_m` is where it comes from in the head's own frame (ahead −Z, right +X, up +Y) in metres; its length
    /// matters near the head alone, and not at all where it is infinitely far. Both ears' `filters` are filled, of
    /// [`taps`](Self::taps) each; the result is continuous in `from_m`. Nothing is allocated.
    pub fn hear(&self, from_m: [f64; 3], filters: [&mut [f32]; 2]) -> [EarArrival; 2] {
        let distance_m = coordinates::length(from_m);
        let towards = coordinates::unit(from_m).unwrap_or(AHEAD);
        // Within this distance directions fade out.
        let share = if distance_m < NEAR_M { distance_m / NEAR_M } else { 1.0 };
        let distance_m = if distance_m.is_finite() { distance_m.max(NEAR_M) } else { f64::INFINITY };
        match &self.kind {
            Kind::Sphere(shadow) => {
                for (ear, filter) in filters.into_iter().enumerate() {
                    filter.fill(0.0);
                    shadow.fill(1.0 + share * (alpha(side(towards, ear)) - 1.0), filter);
                }
                [0, 1].map(|ear| near(share, [distance_m, f64::INFINITY], side(towards, ear), RADIUS_M)).map(
                    |(arrival, far_m)| EarArrival {
                        delay_s: arrival.delay_s + share * far_m / SPEED_OF_SOUND_MPS,
                        ..arrival
                    },
                )
            }
            Kind::Measured(aligned) => {
                let delays_s = aligned.mix(towards, share, filters);
                let corners = &aligned.corners;
                [0, 1].map(|ear| {
                    let distances_m = [distance_m, corners.distance_m];
                    let (arrival, _) = near(share, distances_m, side(towards, ear), corners.radius_m);
                    EarArrival { delay_s: arrival.delay_s + delays_s[ear], ..arrival }
                })
            }
        }
    }
}

/// What a source's distance adds to what is heard of a source at another distance (the second), and by how much
/// the way of that is longer than to the centre, in metres.
fn near(share: f64, distances_m: [f64; 2], cosine: f64, radius_m: f64) -> (EarArrival, f64) {
    let [detour, far] = distances_m.map(|distance_m| detour_m(distance_m, cosine, radius_m));
    // The distance over the length of the way.
    let [gain, at_far] = [(distances_m[0], detour), (distances_m[1], far)].map(|(distance_m, detour)| {
        1.0 / (1.0 + if distance_m.is_finite() { detour / distance_m } else { 0.0 })
    });
    let arrival = EarArrival {
        delay_s: share * (detour - far) / SPEED_OF_SOUND_MPS,
        gain: 1.0 + share * (gain / at_far - 1.0),
    };
    (arrival, far)
}

/// A rate that filters can be made for.
fn sane(rate_hz: f64) -> f64 {
    if rate_hz.is_finite() { rate_hz.clamp(1000.0, 4e6) } else { 48_000.0 }
}
