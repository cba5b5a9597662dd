//! Where a sheet crumples: its mean curvature changes sign.
//!
//! Paper is stiff: what flips does so as a whole, however long the front of what has changed its sign takes to pass. So
//! the integral of H over all that vibrates together is followed. It flips when that is 0, which is between the frame
//! that is fed and the one before, so that nothing is told late or early. It has to come from well on its side, and so
//! fast that it will be well on the other. Its energy is the rate at which the integral gets to 0, Σ A·dH/dt in m/s.
//!
//! What is small beside that flips by itself. A vertex is on one side while |H| is more than a least curvature, and
//! stays on it until H is as far on the other side; it begins to cross when H is 0. When vertices begin to cross, all
//! that could follow them is taken together: the *bow*, which is what was on their side and hangs together with them.
//! It flips by the same rule. A bow that makes up much of all that vibrates waits for that; if it goes over alone, it
//! flips when it is as far on the other side as it was.
//!
//! A dent that springs in a bow that stays is small beside the bow. It is told as it springs: when what has crossed does
//! so within some 30 ms, and is most of what moves.
//!
//! What is held on two sides or all around flips when its middle comes through between, see `bridge`; what goes over of it
//! before and after is silent, and of dents are told those that are most of what moves.
//!
//! What crosses after that to the same side among the same resonators belongs to the same flip, until nothing has
//! crossed for a while. What comes over later still does so without a sound, unless it springs.

use std::collections::VecDeque;

use glam::DVec3;

use super::bridge::{Bridges, Frame, Through};
use super::course::Course;
use super::sheet::{Lie, NONE, Sheet};

/// A flip is over when nothing has crossed for so long, in seconds,
const GAP_S: f64 = 0.06;
/// or so long after it was told;
const LONGEST_S: f64 = 0.25;
/// what is under way for longer begins anew.
const OLDEST_S: f64 = 0.5;
/// What flipped as a whole takes with it what is left of it for so many seconds.
const LATE_S: f64 = 0.8;
/// What springs does so within this time, in seconds.
const SPRING_S: f64 = 0.03;
/// What crosses is most of what moves from this part on.
const MOST: f64 = 0.5;
/// A bow that is this part of all that is curved among the same resonators waits for them.
const MUCH: f64 = 0.25;
/// How curved a vertex was is forgotten within so many seconds.
const FORGET_S: f64 = 0.3;
/// So long is looked back, in seconds,
const BACK_S: f64 = 0.25;
/// and so many frames at most, however dense they are.
const MOST_FRAMES: usize = 64;

/// A part of a sheet that flipped.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Flip {
    pub time_s: f64,
    /// When its first vertices crossed.
    pub first_s: f64,
    pub energy_mps: f64,
    pub positive: bool,
    pub position: DVec3,
    /// What flipped.
    pub vertices: Vec<u32>,
}

/// What is known of a vertex.
#[derive(Debug, Clone, Copy)]
struct State {
    /// The side on which it was last: −1 or 1, or 0 where it has been flat so far.
    side: i8,
    /// Whether its curvature is on the other side, if not so far that it counts.
    is_over: bool,
    /// How curved it was at most on this side, fading; the same of the side before, and when it came over.
    most_per_m: f64,
    before_per_m: f64,
    crossed_s: f64,
    /// The flips to either side in whose bows it was last.
    flips: [u32; 2],
    /// The side to which it was to go in the flip that was told last, if it did not, and when that was.
    told: i8,
    told_s: f64,
}

const UNKNOWN: State = State {
    side: 0,
    is_over: false,
    most_per_m: 0.0,
    before_per_m: 0.0,
    crossed_s: f64::NEG_INFINITY,
    flips: [NONE; 2],
    told: 0,
    told_s: f64::NEG_INFINITY,
};

impl State {
    /// How curved it was at most, before what began at a time.
    fn greatest(&self, first_s: f64) -> f64 {
        if self.crossed_s >= first_s { self.before_per_m } else { self.most_per_m }
    }
}

/// A bow that is crossing.
#[derive(Debug, Clone)]
struct Open {
    number: u32,
    positive: bool,
    /// Whether what flipped as a whole before comes over late.
    is_late: bool,
    bow: Vec<u32>,
    /// The integral of H over it as it began.
    turned: f64,
    /// What of it has crossed.
    crossed: Vec<u32>,
    first_s: f64,
    last_s: f64,
    told_s: Option<f64>,
}

impl Open {
    /// Among which resonators it is now.
    fn pool(&self, pools: &[u32]) -> Option<u32> {
        self.bow.iter().map(|&v| pools[v as usize]).find(|&pool| pool != NONE)
    }

    /// Whether it goes to a side in a pool.
    fn is_among(&self, pool: u32, positive: bool, pools: &[u32]) -> bool {
        self.positive == positive && self.bow.iter().any(|&v| pools[v as usize] == pool)
    }

    fn is_over(&self, time_s: f64) -> bool {
        time_s - self.last_s > GAP_S
            || time_s - self.first_s > OLDEST_S
            || self.told_s.is_some_and(|told_s| time_s - told_s > LONGEST_S)
    }
}

/// The frame that is fed.
#[derive(Clone, Copy)]
struct Now<'a> {
    time_s: f64,
    last_s: f64,
    sheet: &'a Sheet,
    lie: &'a Lie,
    mean_per_m: &'a [f64],
    /// Among which resonators each vertex is.
    pools: &'a [u32],
}

/// Follows how one sheet crumples.
#[derive(Debug, Clone)]
pub(super) struct Crumpling {
    least_energy_mps: f64,
    flat_per_m: f64,
    states: Vec<State>,
    /// The last frames: their times, and the curvatures.
    last: VecDeque<(f64, Vec<f64>)>,
    before: Vec<i8>,
    open: Vec<Open>,
    next: u32,
    bridges: Bridges,
}

impl Crumpling {
    /// Begins with nothing known. What is less curved than `flat_per_m` is flat.
    pub fn new(count: usize, flat_per_m: f64, least_energy_mps: f64) -> Self {
        Self {
            least_energy_mps,
            flat_per_m: if flat_per_m.is_finite() { flat_per_m } else { f64::INFINITY },
            states: vec![UNKNOWN; count],
            last: VecDeque::new(),
            before: Vec::new(),
            open: Vec::new(),
            next: 0,
            bridges: Bridges::default(),
        }
    }

    /// Takes the next frame, and tells what has flipped since the last.
    pub fn feed(&mut self, frame: Frame<'_>) -> Vec<Flip> {
        let Frame { time_s, sheet, lie, mean_per_m, pools, .. } = frame;
        let mut flips = Vec::new();
        let through = self.bridges.feed(frame, &self.last);
        if let Some(last_s) = self.last.back().map(|last| last.0) {
            let now = Now { time_s, last_s, sheet, lie, mean_per_m, pools };
            self.cross(now);
            flips = self.tell_bridges(now, through);
            flips.extend(self.tell_wholes(now));
            flips.extend(self.tell_bows(now));
            self.open.retain(|open| !open.is_over(time_s));
        } else {
            let flat_per_m = self.flat_per_m;
            for (state, &h) in self.states.iter_mut().zip(mean_per_m) {
                *state = State { side: side(h, flat_per_m), most_per_m: h.abs(), ..UNKNOWN };
            }
        }
        let is_enough = |last: &VecDeque<(f64, Vec<f64>)>| {
            last.len() >= MOST_FRAMES || last.get(1).is_some_and(|second| time_s - second.0 >= BACK_S)
        };
        let mut room = Vec::new();
        while is_enough(&self.last) {
            room = self.last.pop_front().map(|first| first.1).unwrap_or_default();
        }
        room.clear();
        room.extend_from_slice(mean_per_m);
        self.last.push_back((time_s, room));
        flips
    }

    /// Finds who has crossed, and what bow that is.
    fn cross(&mut self, now: Now<'_>) {
        let Now { time_s, last_s, pools, .. } = now;
        self.before.clear();
        self.before.extend(self.states.iter().map(|state| state.side));
        let fade = (-(time_s - last_s) / FORGET_S).exp();
        // Who has come over zero, and who is so far over that it is on the other side.
        let mut crossing: Vec<(u32, bool)> = Vec::new();
        for (vertex, &h) in now.mean_per_m.iter().enumerate() {
            let side = side(h, self.flat_per_m);
            let state = &mut self.states[vertex];
            let was_over = std::mem::replace(&mut state.is_over, f64::from(state.side) * h < 0.0);
            if side != 0 && side != state.side {
                if state.side != 0 {
                    crossing.push((vertex as u32, true));
                }
                (state.before_per_m, state.crossed_s) = (state.most_per_m, time_s);
                (state.side, state.is_over, state.most_per_m) = (side, false, h.abs());
                // What has come over is not late when it does so again.
                state.told = if state.told == side { 0 } else { state.told };
            } else if !state.is_over {
                state.most_per_m = (state.most_per_m * fade).max(h.abs());
            } else if !was_over {
                crossing.push((vertex as u32, false));
            }
            state.told = if time_s - state.told_s > LATE_S { 0 } else { state.told };
        }
        for (vertex, is_across) in crossing {
            let to = -self.before[vertex as usize];
            let state = self.states[vertex as usize];
            let number = state.flips[usize::from(to > 0)];
            let is_late = state.told == to;
            let pool = pools[vertex as usize];
            if pool == NONE {
                continue;
            }
            let mut same = self.open.iter_mut().filter(|open| open.positive == (to > 0));
            let own = match same.find(|open| open.number == number) {
                Some(open) => Some(open),
                None => self.open.iter_mut().find(|open| {
                    open.positive == (to > 0)
                        && (open.is_late == is_late || open.told_s.is_some())
                        && open.pool(pools) == Some(pool)
                }),
            };
            let at = match own {
                Some(open) => {
                    open.last_s = time_s;
                    open.crossed.extend(is_across.then_some(vertex));
                    if open.number == number {
                        continue;
                    }
                    open.number
                }
                None => {
                    let number = self.next;
                    // The one number that stands for none is left out.
                    self.next = if number + 1 == NONE { 0 } else { number + 1 };
                    self.open.push(Open {
                        number,
                        positive: to > 0,
                        is_late,
                        bow: Vec::new(),
                        turned: 0.0,
                        crossed: is_across.then_some(vertex).into_iter().collect(),
                        first_s: last_s,
                        last_s: time_s,
                        told_s: None,
                    });
                    number
                }
            };
            let bow = self.bow(now, vertex, at);
            let last_per_m = self.last.back().map_or(&[][..], |last| &last.1);
            let turned = now.lie.integral(&bow, last_per_m);
            if let Some(open) = self.open.iter_mut().find(|open| open.number == at) {
                open.turned += turned;
                open.bow.extend(bow);
            }
        }
    }

    /// All that was on the side of a vertex and hangs together with it.
    fn bow(&mut self, now: Now<'_>, seed: u32, number: u32) -> Vec<u32> {
        let Now { sheet, pools, .. } = now;
        let side = self.before[seed as usize];
        let to = usize::from(side < 0);
        let is_late = self.states[seed as usize].told == -side;
        let mut bow = vec![seed];
        self.states[seed as usize].flips[to] = number;
        let mut next = 0;
        while let Some(&vertex) = bow.get(next) {
            next += 1;
            for &edge in sheet.edges_at(vertex) {
                for other in sheet.edges[edge as usize].ends {
                    let state = self.states[other as usize];
                    if state.flips[to] == number
                        || self.before[other as usize] != side
                        || (state.told == -side) != is_late
                        || pools[other as usize] != pools[seed as usize]
                        || self.open.iter().any(|open| open.number == state.flips[to])
                    {
                        continue;
                    }
                    self.states[other as usize].flips[to] = number;
                    bow.push(other);
                }
            }
        }
        bow
    }

    /// Tells which of what is held has flipped.
    fn tell_bridges(&mut self, now: Now<'_>, through: Vec<Through>) -> Vec<Flip> {
        let mut flips = Vec::new();
        for Through { vertices, time_s, positive, energy_mps } in through {
            if energy_mps <= 0.0 || energy_mps < self.least_energy_mps {
                continue;
            }
            let mut pools: Vec<u32> = vertices.iter().map(|&v| now.pools[v as usize]).collect();
            pools.sort_unstable();
            pools.dedup();
            let near = |open: &&mut Open| pools.iter().any(|&pool| open.is_among(pool, positive, now.pools));
            let mut first_s = now.last_s.min(time_s);
            for open in self.open.iter_mut().filter(near) {
                first_s = first_s.min(open.first_s);
                open.told_s = Some(time_s);
            }
            let position = self.position(now, &vertices);
            let flip = Flip { time_s, first_s, energy_mps, positive, position, vertices };
            self.remember(now.time_s, &flip);
            flips.push(flip);
        }
        flips
    }

    /// Tells which pools have flipped as a whole.
    fn tell_wholes(&mut self, now: Now<'_>) -> Vec<Flip> {
        let Now { lie, mean_per_m, pools, .. } = now;
        let Some((_, last_per_m)) = self.last.back() else { return Vec::new() };
        let count = pools.iter().filter(|&&pool| pool != NONE).max().map_or(0, |&last| last as usize + 1);
        let mut sums = vec![[0.0; 2]; count];
        for (vertex, &pool) in pools.iter().enumerate() {
            if pool != NONE {
                let area = lie.vertex_areas[vertex];
                sums[pool as usize][0] += area * last_per_m[vertex];
                sums[pool as usize][1] += area * mean_per_m[vertex];
            }
        }
        let mut flips = Vec::new();
        for (pool, &[before, after]) in sums.iter().enumerate() {
            let positive = after > before;
            let is_over = if positive { before < 0.0 && after >= 0.0 } else { before > 0.0 && after <= 0.0 };
            if !is_over {
                continue;
            }
            let pool = pool as u32;
            if self.bridges.spans(pool) {
                continue;
            }
            let vertices = (0..pools.len() as u32).filter(|&v| pools[v as usize] == pool).collect();
            let near = |open: &&mut Open| open.is_among(pool, positive, pools);
            let first_s =
                self.open.iter_mut().filter(near).map(|open| open.first_s).fold(now.last_s, f64::min);
            let Some(flip) = self.heard(now, vertices, positive, first_s, true) else { continue };
            for open in self.open.iter_mut().filter(near) {
                open.told_s = Some(flip.time_s);
            }
            self.remember(now.time_s, &flip);
            flips.push(flip);
        }
        flips
    }

    /// Tells which bows have flipped by themselves, and what springs in them.
    fn tell_bows(&mut self, now: Now<'_>) -> Vec<Flip> {
        let Now { time_s, last_s, lie, mean_per_m, pools, .. } = now;
        let Some((_, last_per_m)) = self.last.back() else { return Vec::new() };
        let area = |v: u32| lie.vertex_areas[v as usize];
        let mut flips = Vec::new();
        let mut told: Vec<(usize, bool, Vec<u32>)> = Vec::new();
        for (at, open) in self.open.iter().enumerate().filter(|(_, open)| open.told_s.is_none()) {
            let sign = if open.positive { 1.0 } else { -1.0 };
            let gain = |v: u32| sign * area(v) * (mean_per_m[v as usize] - last_per_m[v as usize]);
            let curved = |of: &[u32]| {
                of.iter().map(|&v| area(v) * self.states[v as usize].greatest(open.first_s)).sum::<f64>()
            };
            let [before, after] = [last_per_m, mean_per_m].map(|h| sign * lie.integral(&open.bow, h));
            let pool = open.pool(pools);
            let all = || (0..pools.len() as u32).filter(|&v| Some(pools[v as usize]) == pool);
            let waits = || {
                let all: f64 = all().map(|v| area(v) * self.states[v as usize].greatest(open.first_s)).sum();
                curved(&open.bow) >= MUCH * all
            };
            // Over, or all over.
            let level = -sign * open.turned;
            let is_over = !open.is_late && before < 0.0 && after >= 0.0 && !waits();
            let is_all_over = !open.is_late && level > 0.0 && before < level && after >= level && waits();
            // What is held flips when its middle comes through; its ends went before.
            let is_bridge = pool.is_some_and(|pool| self.bridges.spans(pool));
            // What has just flipped trembles.
            let trembles = |&v: &u32| time_s - self.states[v as usize].told_s <= GAP_S;
            let springs = || {
                let moves: f64 = match is_bridge {
                    // As its ends are turned all of it moves.
                    true => all().map(|v| gain(v).abs()).sum(),
                    false => open.bow.iter().map(|&v| gain(v).max(0.0)).sum(),
                };
                let crosses: f64 = open.crossed.iter().map(|&v| gain(v)).sum();
                crosses >= MOST * moves && curved(&open.crossed) * (time_s - last_s) < SPRING_S * crosses
            };
            if !is_bridge && (is_over || is_all_over) {
                told.push((at, true, open.bow.clone()));
            } else if open.last_s == time_s && springs() && !open.crossed.iter().any(trembles) {
                told.push((at, false, open.crossed.clone()));
            }
        }
        for (at, is_bow, vertices) in told {
            let Open { positive, first_s, .. } = self.open[at];
            let Some(flip) = self.heard(now, vertices, positive, first_s, is_bow) else {
                // It drifts over; what begins to cross from now on is another.
                if is_bow {
                    self.open[at].last_s = f64::NEG_INFINITY;
                }
                continue;
            };
            self.open[at].told_s = Some(flip.time_s);
            if is_bow {
                self.remember(time_s, &flip);
            }
            flips.push(flip);
        }
        flips
    }

    /// The flip of some vertices, if it is one that can be heard.
    fn heard(
        &self,
        now: Now<'_>,
        vertices: Vec<u32>,
        positive: bool,
        first_s: f64,
        is_bow: bool,
    ) -> Option<Flip> {
        let Now { time_s, lie, mean_per_m, .. } = now;
        let sign = if positive { 1.0 } else { -1.0 };
        let before = self.last.iter().map(|(frame_s, h)| (*frame_s, sign * lie.integral(&vertices, h)));
        let course = Course::new(before, (time_s, sign * lie.integral(&vertices, mean_per_m)));
        let (mut greatest, mut area) = (0.0, 0.0);
        for &v in &vertices {
            let own = lie.vertex_areas[v as usize];
            greatest += own * self.states[v as usize].greatest(first_s);
            area += own;
        }
        let (told_s, rate_mps) = course.crossing();
        // A bow goes on as it comes; a dent is small before it springs.
        let energy_mps = if is_bow { rate_mps } else { course.rate() };
        let is_heard = energy_mps > 0.0
            && energy_mps >= self.least_energy_mps
            && course.goes_on(area * self.flat_per_m)
            && course.swings(greatest);
        if !is_heard {
            return None;
        }
        let position = self.position(now, &vertices);
        Some(Flip { time_s: told_s, first_s: first_s.min(told_s), energy_mps, positive, position, vertices })
    }

    /// The middle of what some vertices bend.
    fn position(&self, now: Now<'_>, vertices: &[u32]) -> DVec3 {
        let Now { lie, mean_per_m, .. } = now;
        let Some((_, last_per_m)) = self.last.back() else { return DVec3::ZERO };
        let (mut middle, mut weight) = (DVec3::ZERO, 0.0);
        for &v in vertices {
            let part = lie.vertex_areas[v as usize] * (mean_per_m[v as usize] - last_per_m[v as usize]).abs();
            middle += part * lie.points[v as usize];
            weight += part;
        }
        if weight > 0.0 { middle / weight } else { DVec3::ZERO }
    }

    /// Remembers what was to go over with a flip, and is not there yet.
    fn remember(&mut self, time_s: f64, flip: &Flip) {
        let side = if flip.positive { 1 } else { -1 };
        for &vertex in &flip.vertices {
            let state = &mut self.states[vertex as usize];
            (state.told, state.told_s) = (if state.side == side { 0 } else { side }, time_s);
        }
    }
}

/// The side on which a curvature is; 0 where the sheet is flat.
fn side(h: f64, flat_per_m: f64) -> i8 {
    i8::from(h > flat_per_m) - i8::from(h < -flat_per_m)
}
