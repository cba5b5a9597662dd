//! Blows as a signal, to set resonators ringing.

use super::{Around, Event};

/// Most blows that touch at one time; of more, the oldest are forgotten.
const MOST: usize = 64;

/// How many samples a blow lasts at least.
const SHORTEST: f64 = 2.0;

/// Each blow is a raised cosine as long as the striker touches, whose samples sum to how hard it is. It
/// may begin between two samples. One that is too short for them to follow is a triangle of two samples,
/// which is just where it should be on average.
#[derive(Debug, Default)]
pub(in crate::synth::procedure) struct Pulse {
    /// Of each blow: samples since it began (below 0: still to come), length in samples, sum.
    blows: Vec<[f64; 3]>,
}

impl Pulse {
    pub(super) fn run(&mut self, around: Around<'_>, out: &mut [f64]) {
        out.fill(0.0);
        for &(at, event) in around.events {
            if let Event::Hit(amount, contact_s) = event {
                if self.blows.len() == MOST {
                    self.blows.remove(0);
                }
                self.blows.push([-at, (contact_s * around.rate_hz).max(SHORTEST), amount]);
            }
        }
        let count = out.len() as f64;
        for [since, length, amount] in &mut self.blows {
            for (index, sample) in out.iter_mut().enumerate() {
                let x = *since + index as f64;
                if x > 0.0 && x < *length {
                    let share = if *length <= SHORTEST {
                        1.0 - (x - 1.0).abs()
                    } else {
                        (1.0 - (std::f64::consts::TAU * x / *length).cos()) / *length
                    };
                    *sample += *amount * share;
                }
            }
            *since += count;
        }
        self.blows.retain(|[since, length, _]| since < length);
    }
}
