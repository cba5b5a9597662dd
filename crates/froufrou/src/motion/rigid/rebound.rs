//! What becomes of a gap that has just closed: whether it opens again, how fast, and how often it closes until the
//! frames that follow.
//!
//! Along the normal of a contact, motion between frames is simple: the gap s closes at τ with a speed u, opens with u′,
//! and is then pulled by an even acceleration a (gravity, where one body stands still), so that s(τ + h) = u′h + ah²/2. If it
//! closes again it opens again with the same restitution e = u′/u. The frames that follow say how wide the gap is at
//! one or two later moments. Of the ways that could be, the one is taken that the frames agree with best: the
//! restitution that this pair had before, none at all, or one that is fitted.

/// A gap that is told to be smaller than this, in metres, is closed.
pub(super) const CLOSED_M: f64 = 3e-4;
/// The restitution of a pair that is known holds if the frames agree to this, in metres, ...
const AGREES_M: f64 = 5e-5;
/// ... or to this part of the height of the bounce.
const AGREES_PART: f64 = 0.05;
/// What bounces more slowly, in metres a second, does so no more.
const STILL_MPS: f64 = 1e-3;

/// What is seen of a gap after it closed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    /// How fast it closed, in metres a second, above 0.
    pub closing_mps: f64,
    /// How it accelerates while it is open, in m/s²; below 0 where it closes again.
    pub acceleration: f64,
    /// Seconds from the closing to a frame, and how wide the gap is there, in metres.
    pub next: (f64, f64),
    /// The same one frame later, where nothing else has happened until then.
    pub then: Option<(f64, f64)>,
    /// The restitution of this pair, where it has bounced before.
    pub restitution: Option<f64>,
    /// Whether it may close again before the frames: a ball does so at the same place, a box elsewhere.
    pub repeats: bool,
}

/// How it goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rebound {
    /// How fast it opens again, in metres a second; 0 where it stays closed.
    pub opening_mps: f64,
    /// By how much the frames disagree, in metres.
    pub misfit_m: f64,
    /// True where the restitution was told by the frames alone, and is that of one bounce.
    pub is_measured: bool,
}

/// Nothing opens again.
pub(super) const STAYS: Rebound = Rebound { opening_mps: 0.0, misfit_m: 0.0, is_measured: false };

/// How wide a gap is, some time after it opened at a speed, if it bounces with a restitution.
fn follow(opening_mps: f64, acceleration: f64, restitution: f64, after_s: f64) -> f64 {
    let (mut u, mut h) = (opening_mps, after_s);
    if acceleration >= -1e-9 {
        return u * h + 0.5 * acceleration * h * h;
    }
    loop {
        if u < STILL_MPS {
            return 0.0;
        }
        let flight_s = 2.0 * u / -acceleration;
        if h <= flight_s {
            return u * h + 0.5 * acceleration * h * h;
        }
        h -= flight_s;
        u *= restitution.min(0.999);
    }
}

impl Seen {
    fn misfit(&self, opening_mps: f64, restitution: f64) -> f64 {
        let at = |(h, s): (f64, f64)| {
            let found = if self.repeats {
                follow(opening_mps, self.acceleration, restitution, h)
            } else {
                opening_mps * h + 0.5 * self.acceleration * h * h
            };
            (found - s).abs()
        };
        at(self.next).max(self.then.map_or(0.0, at))
    }

    /// The way of going on that the frames agree with best.
    pub fn rebound(&self) -> Rebound {
        let u = self.closing_mps;
        let made = |opening_mps: f64, is_measured| {
            let misfit_m = self.misfit(opening_mps, opening_mps / u);
            Rebound { opening_mps, misfit_m, is_measured }
        };
        let height = |opening_mps: f64| opening_mps.powi(2) / (2.0 * self.acceleration.abs().max(1e-3));
        if let Some(restitution) = self.restitution.filter(|_| self.repeats) {
            let known = made(restitution * u, false);
            let enough = AGREES_M.max(AGREES_PART * height(known.opening_mps).min(0.01));
            if known.misfit_m <= enough {
                // One more bounce that the frames tell by themselves makes it better known.
                return self.single().filter(|one| one.misfit_m < 0.1 * known.misfit_m).unwrap_or(known);
            }
        }
        let widest = self.next.1.max(self.then.map_or(0.0, |(_, s)| s));
        if widest <= CLOSED_M {
            return Rebound { opening_mps: 0.0, misfit_m: widest.max(0.0), is_measured: false };
        }
        let mut best = self.single();
        let mut consider = |other: Rebound| {
            if best.is_none_or(|best| other.misfit_m < 0.5 * best.misfit_m) {
                best = Some(other);
            }
        };
        // By the next frame alone, in case it closes again behind it.
        let (h, s) = self.next;
        consider(made(((s - 0.5 * self.acceleration * h * h) / h).max(0.0), true));
        if self.repeats && self.acceleration < 0.0 {
            let steps = 256;
            for step in 1..steps {
                consider(made(u * f64::from(step) / f64::from(steps), false));
            }
        }
        best.unwrap_or(Rebound { opening_mps: 0.0, misfit_m: f64::INFINITY, is_measured: false })
    }

    /// One bounce after which nothing happens until the last frame that is seen.
    fn single(&self) -> Option<Rebound> {
        let seen = [Some(self.next), self.then];
        let (mut top, mut below) = (0.0, 0.0);
        for (h, s) in seen.into_iter().flatten() {
            top += h * (s - 0.5 * self.acceleration * h * h);
            below += h * h;
        }
        let opening_mps = (top / below).max(0.0);
        let misfit_m = self.misfit(opening_mps, opening_mps / self.closing_mps);
        opening_mps.is_finite().then_some(Rebound { opening_mps, misfit_m, is_measured: true })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = -9.81;

    fn seen(u: f64, e: f64, first_s: f64, step_s: f64, known: Option<f64>) -> Seen {
        let at = |h: f64| (h, follow(e * u, G, e, h));
        Seen {
            closing_mps: u,
            acceleration: G,
            next: at(first_s),
            then: Some(at(first_s + step_s)),
            restitution: known,
            repeats: true,
        }
    }

    #[test]
    fn one_bounce_is_told_by_two_frames() {
        for first_s in [1e-5, 0.01, 0.04] {
            let rebound = seen(3.0, 0.7, first_s, 0.0417, None).rebound();
            assert!((rebound.opening_mps - 2.1).abs() < 1e-9, "{first_s}: {rebound:?}");
            assert!(rebound.is_measured);
        }
    }

    #[test]
    fn many_bounces_in_a_frame_are_told_by_what_is_known() {
        // 0.08 m/s: 16 ms, 13 ms, 10 ms; the frames come every 42 ms.
        let rebound = seen(0.1, 0.8, 0.03, 0.0417, Some(0.8)).rebound();
        assert!((rebound.opening_mps - 0.08).abs() < 1e-9, "{rebound:?}");
        // Not knowing it, the frames can still tell.
        let rebound = seen(0.4, 0.5, 0.03, 0.0417, None).rebound();
        assert!((rebound.opening_mps - 0.2).abs() < 2e-3, "{rebound:?}");
    }

    #[test]
    fn what_stays_closed_stays() {
        let still = Seen { next: (0.02, 1e-6), then: Some((0.06, 0.0)), ..seen(2.0, 0.5, 0.02, 0.04, None) };
        assert_eq!(still.rebound().opening_mps, 0.0);
        // Even if it has bounced before.
        let still = Seen { restitution: Some(0.5), ..still };
        assert_eq!(still.rebound().opening_mps, 0.0);
    }

    #[test]
    fn without_a_pull_it_opens_for_good() {
        let seen = Seen {
            acceleration: 0.0,
            next: (0.01, 0.02),
            then: Some((0.05, 0.1)),
            ..seen(3.0, 0.5, 0.01, 0.04, None)
        };
        let rebound = seen.rebound();
        assert!((rebound.opening_mps - 2.0).abs() < 1e-12 && rebound.misfit_m < 1e-12);
    }
}
