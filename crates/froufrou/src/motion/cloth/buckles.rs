//! Where a cloth buckles: its mean curvature changes sign.
//!
//! Simulators let the vertices of stiff cloth tremble against each other, so that the curvature at one vertex changes
//! sign all the time. So H is blurred first, to what is seen of it at a length: it is the mean over a vertex and its
//! neighbours, by area, again and again as the length asks for.
//!
//! A vertex is on one side while |H| is more than a least curvature, and stays on it until H is as far on the other
//! side; so a flat cloth does not chatter. When it gets there, it has crossed: at the time at which H last was 0,
//! interpolated between two frames, and at the rate |ΔH|/Δt of its way from the frame before that time to where it is
//! now. Its energy is its area times that rate. What takes a tenth of a second to get there from 0 is silent.
//!
//! Crossings of one sign that are neighbours along edges and in time are one buckle. It is followed from frame to frame
//! while it moves, until nothing joins it for a while or it has gone on for long; then what moves on is the next. So
//! the same motion gives the same buckles at any frame rate and resolution that show it.

use std::cmp::Ordering;

use super::curvature::Curvature;
use super::triangulation::Triangulation;

/// Nobody has crossed yet.
const NONE: u32 = u32::MAX;

/// A vertex and its neighbours average with this part of their squared distance as their variance: six of seven on a
/// ring, whose variance along either axis is half.
const RING: f64 = 3.0 / 7.0;
/// More often than this nothing is averaged, however fine the mesh is.
const MOST_ROUNDS: f64 = 64.0;

/// What counts as a buckle, and which crossings are one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BuckleSettings {
    /// How far H is blurred, in metres: the standard deviation along either axis. Meshes whose edges are longer than
    /// that or so are left as they are; 0 leaves all so.
    pub blur_m: f64,
    /// |H| up to which a surface is flat, in 1/m; without it a fiftieth of 1/√area, by the area of the first frame: a
    /// sheet that is bent by some 2° from end to end.
    pub flat_per_m: Option<f64>,
    /// A buckle of less energy is none, in metres a second.
    pub least_energy_mps: f64,
    /// Crossings that are further apart, in seconds, are not one buckle.
    pub gap_s: f64,
    /// A buckle that goes on ends after so many seconds, and another begins.
    pub longest_s: f64,
    /// A vertex that gets to the other side so long after its curvature was 0, in seconds, does so without a sound, and
    /// nobody has to wait for it.
    pub latest_s: f64,
}

impl BuckleSettings {
    /// The same for who cannot wait for long: what is slow to cross is silent, and what goes on is told in shorter pieces.
    #[must_use]
    pub fn prompt(self) -> Self {
        Self { gap_s: 1.0 / 60.0, longest_s: 1.0 / 30.0, latest_s: 1.0 / 30.0, ..self }
    }

    /// So long after it happened a buckle is told at the latest, in seconds, and a frame.
    pub fn behind_s(&self) -> f64 {
        self.gap_s + self.longest_s + self.latest_s
    }
}

impl Default for BuckleSettings {
    /// Everything that is not flat and wider than some centimetres, within a thirtieth of a second, as the time of a
    /// recorded pop is no surer.
    fn default() -> Self {
        Self {
            blur_m: 0.01,
            flat_per_m: None,
            least_energy_mps: 0.0,
            gap_s: 1.0 / 30.0,
            longest_s: 1.0 / 15.0,
            latest_s: 0.1,
        }
    }
}

/// A part of a cloth that buckled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Buckled {
    /// When: the mean over its vertices, weighted by their energy, in seconds.
    pub time_s: f64,
    /// From the first crossing to the last, in seconds.
    pub span_s: [f64; 2],
    /// Where: the mean over its vertices as they cross, weighted by their energy, in metres.
    pub position_m: [f64; 3],
    /// Σ A·|dH/dt| over its vertices, in metres a second.
    pub energy_mps: f64,
    /// Whether H goes from below 0 to above it.
    pub positive: bool,
    /// The number of crossings in it.
    pub vertices: u32,
}

/// What is known of a vertex.
#[derive(Debug, Clone, Copy)]
struct State {
    /// The side on which it was last: −1 or 1, or 0 where it has been flat so far.
    side: i8,
    /// The curvature and time of the frame before H last was 0, and when and where that was.
    before_per_m: f64,
    before_s: f64,
    zero_s: f64,
    zero_m: [f64; 3],
    /// The buckle in which it crossed last, and when.
    buckle: u32,
    crossed_s: f64,
}

const UNKNOWN: State = State {
    side: 0,
    before_per_m: 0.0,
    before_s: 0.0,
    zero_s: 0.0,
    zero_m: [0.0; 3],
    buckle: NONE,
    crossed_s: f64::NEG_INFINITY,
};

/// A buckle that goes on.
#[derive(Debug, Clone, Copy)]
struct Open {
    /// The number of the buckle that it has become part of; its own while it has not.
    joined: u32,
    first_s: f64,
    last_s: f64,
    /// Sums weighted by energy.
    energy: f64,
    time: f64,
    position: [f64; 3],
    positive: bool,
    vertices: u32,
    over: bool,
}

/// Finds the buckles of one cloth, frame after frame.
#[derive(Debug, Clone)]
pub struct Buckles {
    settings: BuckleSettings,
    flat_per_m: f64,
    /// How often curvature is averaged.
    rounds: u32,
    /// Curvature as it is now, and room for averaging it.
    now_per_m: Vec<f64>,
    room: Vec<f64>,
    states: Vec<State>,
    /// The curvatures, positions and time of the last frame.
    last: Option<f64>,
    last_per_m: Vec<f64>,
    last_m: Vec<[f32; 3]>,
    /// Buckles by number; those before `settled` are over and told.
    buckles: Vec<Open>,
    found: Vec<Buckled>,
}

impl Buckles {
    /// Begins with nothing known.
    pub fn new(settings: BuckleSettings) -> Self {
        Self {
            settings,
            flat_per_m: 0.0,
            rounds: 0,
            now_per_m: Vec::new(),
            room: Vec::new(),
            states: Vec::new(),
            last: None,
            last_per_m: Vec::new(),
            last_m: Vec::new(),
            buckles: Vec::new(),
            found: Vec::new(),
        }
    }

    /// |H| up to which the surface is flat here, in 1/m; known from the first frame on.
    pub fn flat_per_m(&self) -> f64 {
        self.flat_per_m
    }

    /// Takes the next frame, whose curvature is measured, and gives the buckles that are over, in order of time. What
    /// is given later is not earlier than [`Buckles::settled_s`].
    pub fn feed(
        &mut self,
        time_s: f64,
        surface: &Triangulation,
        curvature: &Curvature,
        positions: &[[f32; 3]],
    ) -> Vec<Buckled> {
        if self.last.is_none() {
            self.begin(curvature, surface, positions);
        }
        self.blur(surface, curvature);
        if self.last.is_none() {
            let flat_per_m = self.flat_per_m;
            for (state, &h) in self.states.iter_mut().zip(&self.now_per_m) {
                state.side = side(h, flat_per_m);
            }
        } else if let Some(last_s) = self.last {
            self.cross(last_s, time_s, surface, curvature, positions);
        }
        self.last = Some(time_s);
        std::mem::swap(&mut self.last_per_m, &mut self.now_per_m);
        self.last_m.clear();
        self.last_m.extend_from_slice(positions);
        self.settle(time_s)
    }

    /// The buckles that go on at the end, and those that are left.
    pub fn finish(&mut self) -> Vec<Buckled> {
        self.last = None;
        let buckles = self.settle(f64::INFINITY);
        self.states.clear();
        buckles
    }

    /// No buckle that is still to come is earlier than this.
    pub fn settled_s(&self) -> f64 {
        let Some(last_s) = self.last else { return f64::NEG_INFINITY };
        let open = self.buckles.iter().filter(|buckle| !buckle.over).map(|buckle| buckle.first_s);
        open.fold(last_s - self.settings.latest_s, f64::min)
    }

    fn begin(&mut self, curvature: &Curvature, surface: &Triangulation, positions: &[[f32; 3]]) {
        let area_m2: f64 = curvature.area_m2().iter().sum();
        // Single precision shakes vertices by so much, and curvature by that over the square of an edge.
        let most_m = positions.as_flattened().iter().fold(0.0_f32, |most, c| most.max(c.abs()));
        let edge_m = surface.mean_edge_m(positions);
        let noise_per_m = 4.0 * f64::from(f32::EPSILON * most_m) / (edge_m * edge_m);
        let flat_per_m = self.settings.flat_per_m.unwrap_or(0.02 / area_m2.sqrt()).max(noise_per_m);
        self.flat_per_m = if flat_per_m.is_nan() { f64::INFINITY } else { flat_per_m };
        self.states.clear();
        self.states.resize(surface.vertex_count(), UNKNOWN);
        let rounds = (self.settings.blur_m / edge_m).powi(2) / RING;
        self.rounds = if rounds.is_nan() { 0 } else { rounds.min(MOST_ROUNDS).round() as u32 };
    }

    /// Takes up the curvature of the frame that is now.
    fn blur(&mut self, surface: &Triangulation, curvature: &Curvature) {
        self.now_per_m.clear();
        self.now_per_m.extend_from_slice(curvature.mean_per_m());
        let (areas, inner) = (curvature.area_m2(), surface.inner());
        for _ in 0..self.rounds {
            self.room.clear();
            let now_per_m = &self.now_per_m;
            let mean = |vertex: usize| {
                let own = (areas[vertex] * now_per_m[vertex], areas[vertex]);
                let add = |(sum, area): (f64, f64), other: usize| {
                    if inner[other] {
                        (sum + areas[other] * now_per_m[other], area + areas[other])
                    } else {
                        (sum, area)
                    }
                };
                let ring = surface.ring(vertex as u32).iter().map(|&other| other as usize);
                let (sum, area) = ring.fold(own, add);
                if inner[vertex] && area > 0.0 { sum / area } else { 0.0 }
            };
            self.room.extend((0..now_per_m.len()).map(mean));
            std::mem::swap(&mut self.now_per_m, &mut self.room);
        }
    }

    /// Finds who crosses between two frames, and which buckle that is.
    fn cross(
        &mut self,
        last_s: f64,
        time_s: f64,
        surface: &Triangulation,
        curvature: &Curvature,
        positions: &[[f32; 3]],
    ) {
        let areas = curvature.area_m2();
        let step_s = time_s - last_s;
        for vertex in 0..self.states.len() {
            let (before, now) = (self.last_per_m[vertex], self.now_per_m[vertex]);
            let state = &mut self.states[vertex];
            if (before < 0.0) != (now < 0.0) {
                let part = (before / (before - now)).clamp(0.0, 1.0);
                state.zero_s = last_s + part * step_s;
                state.zero_m = std::array::from_fn(|axis| {
                    let (from, to) = (self.last_m[vertex][axis], positions[vertex][axis]);
                    f64::from(from) * (1.0 - part) + f64::from(to) * part
                });
                (state.before_per_m, state.before_s) = (before, last_s);
            }
            let side = side(now, self.flat_per_m);
            if side == 0 || side == state.side {
                continue;
            }
            let is_first = state.side == 0;
            state.side = side;
            let (at_s, position) = (state.zero_s, state.zero_m);
            if is_first || time_s - at_s > self.settings.latest_s {
                continue;
            }
            let energy = areas[vertex] * (now - state.before_per_m).abs() / (time_s - state.before_s);
            let at_s = state.zero_s.max(time_s - self.settings.latest_s);
            self.join(vertex as u32, surface, side > 0, at_s, energy, position);
        }
    }

    /// Adds a crossing to the buckle of its neighbours, or begins one.
    fn join(
        &mut self,
        vertex: u32,
        surface: &Triangulation,
        positive: bool,
        at_s: f64,
        energy: f64,
        position: [f64; 3],
    ) {
        let mut own = NONE;
        for other in surface.ring(vertex).iter().copied().chain([vertex]) {
            let state = self.states[other as usize];
            if state.buckle == NONE || (at_s - state.crossed_s).abs() > self.settings.gap_s {
                continue;
            }
            let number = self.root(state.buckle);
            let buckle = &self.buckles[number as usize];
            let begins_s = buckle.first_s.min(at_s);
            let ends_s = buckle.last_s.max(at_s);
            if buckle.over || buckle.positive != positive || ends_s - begins_s > self.settings.longest_s {
                continue;
            }
            if own == NONE {
                own = number;
            } else if own != number {
                own = self.unite(own, number);
            }
        }
        if own == NONE {
            own = self.buckles.len() as u32;
            self.buckles.push(Open {
                joined: own,
                first_s: at_s,
                last_s: at_s,
                energy: 0.0,
                time: 0.0,
                position: [0.0; 3],
                positive,
                vertices: 0,
                over: false,
            });
        }
        let buckle = &mut self.buckles[own as usize];
        buckle.first_s = buckle.first_s.min(at_s);
        buckle.last_s = buckle.last_s.max(at_s);
        buckle.energy += energy;
        buckle.time += energy * at_s;
        buckle.vertices += 1;
        for (sum, c) in buckle.position.iter_mut().zip(position) {
            *sum += energy * c;
        }
        let state = &mut self.states[vertex as usize];
        (state.buckle, state.crossed_s) = (own, at_s);
    }

    fn root(&self, mut number: u32) -> u32 {
        while self.buckles[number as usize].joined != number {
            number = self.buckles[number as usize].joined;
        }
        number
    }

    /// Makes one of two buckles, if that is not too long; gives the one to go on with.
    fn unite(&mut self, a: u32, b: u32) -> u32 {
        let (into, from) = (a.min(b), a.max(b));
        let taken = self.buckles[from as usize];
        let buckle = &mut self.buckles[into as usize];
        let (first_s, last_s) = (buckle.first_s.min(taken.first_s), buckle.last_s.max(taken.last_s));
        if last_s - first_s > self.settings.longest_s {
            return a;
        }
        (buckle.first_s, buckle.last_s) = (first_s, last_s);
        buckle.energy += taken.energy;
        buckle.time += taken.time;
        buckle.vertices += taken.vertices;
        for (sum, c) in buckle.position.iter_mut().zip(taken.position) {
            *sum += c;
        }
        let taken = &mut self.buckles[from as usize];
        (taken.joined, taken.over) = (into, true);
        into
    }

    /// Ends what nothing joins any more, and gives what is early enough.
    fn settle(&mut self, time_s: f64) -> Vec<Buckled> {
        let Self { settings, buckles, found, .. } = self;
        for (number, buckle) in buckles.iter_mut().enumerate() {
            // What joins may be told late.
            let joins = time_s - settings.latest_s
                <= (buckle.last_s + settings.gap_s).min(buckle.first_s + settings.longest_s);
            if buckle.over || joins {
                continue;
            }
            buckle.over = true;
            if buckle.joined != number as u32 || buckle.energy.is_nan() || buckle.energy <= 0.0 {
                continue;
            }
            if buckle.energy >= settings.least_energy_mps {
                found.push(Buckled {
                    time_s: buckle.time / buckle.energy,
                    span_s: [buckle.first_s, buckle.last_s],
                    position_m: buckle.position.map(|c| c / buckle.energy),
                    energy_mps: buckle.energy,
                    positive: buckle.positive,
                    vertices: buckle.vertices,
                });
            }
        }
        if self.buckles.iter().all(|buckle| buckle.over) && !self.buckles.is_empty() {
            // Numbers begin anew, so that they do not grow with the length of an animation.
            self.buckles.clear();
            for state in &mut self.states {
                state.buckle = NONE;
            }
        }
        let settled_s = if time_s == f64::INFINITY { time_s } else { self.settled_s() };
        let by_time = |a: &Buckled, b: &Buckled| a.time_s.total_cmp(&b.time_s).then(place(a, b));
        self.found.sort_by(by_time);
        let ready = self.found.partition_point(|buckled| buckled.time_s < settled_s);
        self.found.drain(..ready).collect()
    }
}

fn place(a: &Buckled, b: &Buckled) -> Ordering {
    let pairs = a.position_m.iter().zip(&b.position_m);
    pairs.map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}

/// The side on which a curvature is; 0 where the surface is flat.
fn side(h: f64, flat_per_m: f64) -> i8 {
    i8::from(h > flat_per_m) - i8::from(h < -flat_per_m)
}

#[cfg(test)]
mod tests;
