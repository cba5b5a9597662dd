//! What slides in one frame, gathered by what it slides along.

use super::super::event::{Cause, Friction, Moved};
use super::sliding::Sliding;

/// Sums for each object, in arrays that are used again.
#[derive(Debug, Clone, Default)]
pub(super) struct Gather {
    sums: Vec<Sum>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    area_m2: f64,
    /// Weighted by area.
    speed: f64,
    /// Weighted by area and speed.
    position: [f64; 3],
}

impl Gather {
    /// An event for each object that something slides along.
    pub fn events(&mut self, sliding: &Sliding, name: impl Fn(u32) -> String) -> Vec<Friction> {
        self.sums.clear();
        for index in 0..sliding.vertex.len() {
            let (other, speed, area) =
                (sliding.other[index] as usize, sliding.speed_mps[index], sliding.area_m2[index]);
            // What begins to slide is there for its slope.
            if speed <= 0.0 || area <= 0.0 {
                continue;
            }
            if self.sums.len() <= other {
                self.sums.resize(other + 1, Sum::default());
            }
            let sum = &mut self.sums[other];
            sum.area_m2 += area;
            sum.speed += area * speed;
            for (sum, c) in sum.position.iter_mut().zip(sliding.position_m[index]) {
                *sum += area * speed * f64::from(c);
            }
        }
        let event = |(other, sum): (usize, &Sum)| {
            (sum.speed > 0.0).then(|| Friction {
                time_s: sliding.time_s,
                lasts_s: sliding.lasts_s,
                cloth: name(sliding.cloth),
                other: name(other as u32),
                position_m: sum.position.map(|c| c / sum.speed),
                area_m2: sum.area_m2,
                speed_mps: sum.speed / sum.area_m2,
                cause: Cause::Motion(Moved {
                    from_s: sliding.time_s,
                    to_s: sliding.time_s + sliding.lasts_s,
                }),
            })
        };
        self.sums.iter().enumerate().filter_map(event).collect()
    }
}
