//! How fast what comes into the way of a sound may dampen it.
//!
//! The part of a path that is covered changes as fast as its edge crosses the path, and close to source or microphone
//! a path is narrow: there even a slow wall would switch a sound off. What is heard follows what is covered no
//! faster than by so many decibels in a millisecond, and so catches up some 40 ms late at most behind a wall that
//! takes 20 dB.

use std::collections::BTreeMap;

use super::SILENT;

/// What is heard of a path rises and falls by less than this many decibels a millisecond: below half of one with room
/// for what Doppler compresses.
const FASTEST_DB_PER_MS: f64 = 0.45;

/// Below this part of the pressure nothing has to be approached slowly any more: −60 dB.
const FLOOR: f64 = 1e-3;

/// While a shadow is behind what is covered, keys are this far apart in seconds.
pub(super) const CATCHING_UP_S: f64 = 0.004;

/// The shadows that lie on the paths of a thread.
#[derive(Debug, Clone, Default)]
pub(super) struct Shadows {
    /// When each path was last asked for, by its number and that of the microphone, and what was heard of it.
    heard: BTreeMap<(u32, usize), (f64, f64)>,
    behind: bool,
}

impl Shadows {
    /// Begins a new key of all paths.
    pub fn begin(&mut self) {
        self.behind = false;
    }

    /// What is heard of a path, of which occlusion leaves a share now.
    pub fn follow(&mut self, path: u32, ear: usize, time_s: f64, share: f64) -> f64 {
        let before = self.heard.get(&(path, ear)).copied();
        let heard = before.map_or(share, |(before_s, before)| limited(before, time_s - before_s, share));
        self.behind |= heard != share;
        self.heard.insert((path, ear), (time_s, heard));
        heard
    }

    /// The same of a path that has a gain besides. One that is silent is forgotten: when it is heard again it may be
    /// heard at once.
    pub fn cover(&mut self, path: u32, ear: usize, time_s: f64, gain: f64, share: f64) -> f64 {
        if gain > SILENT {
            return self.follow(path, ear, time_s, share);
        }
        self.forget(path, ear);
        share
    }

    /// Forgets a path that is silent.
    pub fn forget(&mut self, path: u32, ear: usize) {
        self.heard.remove(&(path, ear));
    }

    /// Forgets all, where a source or a microphone has jumped.
    pub fn forget_all(&mut self) {
        self.heard.clear();
    }

    /// Whether any path is not yet as loud or as soft as it should be.
    pub fn are_behind(&self) -> bool {
        self.behind
    }
}

/// A share that follows another after some time. Between two keys a gain is a straight line, which is steepest in
/// decibels at its softer end: that one bounds it.
fn limited(before: f64, after_s: f64, share: f64) -> f64 {
    let most = 1.0 + FASTEST_DB_PER_MS * 1e3 * std::f64::consts::LN_10 / 20.0 * after_s.max(0.0);
    let (least, most) = (before / most, before.max(FLOOR) * most);
    if share > most {
        most
    } else if share < least && least > FLOOR {
        least
    } else {
        share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_shadow_falls_or_lifts_faster_than_it_may() {
        // A wall that covers all at once, whatever it lets through and however dense the keys are.
        for through in [0.0, 1e-4, 0.01, 0.1, 0.9] {
            for step_s in [0.0005, 0.0013, 0.004, 0.05] {
                let mut shadows = Shadows::default();
                let (mut before, mut low) = (1.0f64, 1.0f64);
                for n in 0..4000 {
                    let time_s = f64::from(n) * step_s;
                    let covered = (100..1500).contains(&n);
                    shadows.begin();
                    let share = if covered { through } else { 1.0 };
                    let heard = shadows.follow(3, 0, time_s, share);
                    assert_eq!(shadows.are_behind(), heard != share);
                    let steepest = (heard - before) / before.min(heard) / (1e3 * step_s);
                    if before.min(heard) >= FLOOR {
                        let db_per_ms = steepest.abs() * 20.0 / std::f64::consts::LN_10;
                        assert!(db_per_ms < 0.4501, "{through} {step_s}: {db_per_ms}");
                    }
                    (before, low) = (heard, low.min(heard));
                }
                assert_eq!((low, before), (through, 1.0), "it gets there");
            }
        }
    }

    #[test]
    fn what_changes_slowly_is_not_touched_and_what_jumps_neither() {
        let mut shadows = Shadows::default();
        for n in 0..1000 {
            let share = 0.5 + 0.5 * (f64::from(n) * 0.01).cos();
            if share > FLOOR && (n % 314) < 200 {
                shadows.forget(0, 0);
                assert_eq!(shadows.follow(0, 0, f64::from(n), share), share);
                assert_eq!(shadows.follow(0, 0, f64::from(n) + 1.0, share * 0.9), share * 0.9);
            }
        }
        shadows.forget_all();
        assert_eq!(shadows.follow(0, 0, 1001.0, 0.001), 0.001);
        assert_eq!(shadows.follow(0, 1, 1001.0, 1.0), 1.0, "each microphone for itself");
    }
}
