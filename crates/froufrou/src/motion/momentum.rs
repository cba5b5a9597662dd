//! Contacts between the samples of a thinned log, by the momentum that bodies gain and lose.
//!
//! A log that keeps every n-th step of a simulation misses most blows, and what it has of the others is the force of
//! one step. But poses with velocities tell what was missed: from one frame to the next a body of mass m gains
//!
//! > m·(v₁ − v₀ − g·Δt) = Σ J·n
//!
//! from its contacts. The impulses J ≥ 0 of all pairs that touch at either frame are found from that for all bodies
//! together (projected Gauss–Seidel, as engines do), friction left aside. What they leave unexplained of a
//! body is a blow between the frames by somebody it touches at another time: of those the nearest whose normal fits and
//! who is where it then must be. So each frame is given the impulses of a whole log at the frame's rate, and
//! [`impact`](super::impact) finds blows in them as in any.
//!
//! When within the frame they act, positions tell: x₁ − x₀ − v₀·Δt − g·Δt²/2 is J/m times what is left of the frame.
//!
//! The cost is that of all bodies in every frame, and of the pairs that touch in it times the rounds in which they
//! come to agree, some tens where bodies are stacked.
//!
//! Masses are those that the scene gives, or else the log is read once more before: Σ F·n = m·(a − g) wherever a body's
//! velocity changes evenly, and the median of that.

use glam::DVec3;

use super::body::BodyState;
use super::contacts::Poses;
use crate::Result;
use crate::scene::contact_log::{ContactLog, ContactRow, Push};
use crate::scene::file::Contacts;

/// So many samples of a mass are kept.
const MOST_SAMPLES: usize = 512;
/// So many partners of a body are remembered.
const MOST_PARTNERS: usize = 32;
/// Rounds in which impulses come to agree.
const MOST_ROUNDS: usize = 400;
/// A frame that is so many times as long as usual tells nothing of impulses.
const LONGEST_FRAME: f64 = 3.0;
/// What is faster than this, in metres a second, and eight times as fast as before and after, has jumped.
const JUMP_MPS: f64 = 20.0;

/// Somebody whom a body touches at some time, and how.
#[derive(Debug, Clone, Copy)]
struct Partner {
    other: u32,
    /// The direction in which it is pushed.
    normal: DVec3,
    /// How far the contact lies below its centre along the normal.
    reach_m: f64,
    /// How far up the normal the contact lies from the other's centre, or from the origin where that stands still.
    offset_m: f64,
    line: u64,
}

/// What a log tells of its bodies as a whole.
#[derive(Debug, Default)]
pub(super) struct Survey {
    /// In kilograms; nothing for what stands still or cannot be told.
    masses_kg: Vec<Option<f64>>,
    partners: Vec<Vec<Partner>>,
    /// The farthest from its centre that each was touched, in metres.
    radii_m: Vec<f64>,
    /// 1 where a normal is the way the first body of its row is pushed, −1 where it is the second.
    sign: f64,
}

#[derive(Debug, Default)]
struct Samples {
    kept: Vec<f64>,
    stride: u64,
    count: u64,
}

impl Samples {
    fn add(&mut self, sample: f64) {
        let stride = self.stride.max(1);
        if self.count.is_multiple_of(stride) {
            self.kept.push(sample);
        }
        self.count += 1;
        if self.kept.len() >= MOST_SAMPLES {
            let mut index = 0;
            self.kept.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.stride = 2 * stride;
        }
    }

    fn median(&mut self) -> Option<f64> {
        self.kept.sort_by(f64::total_cmp);
        self.kept.get(self.kept.len() / 2).copied()
    }
}

impl Survey {
    /// Reads a whole log, whose frames are so far apart.
    pub(super) fn of(contacts: &Contacts, poses: &mut Poses, spacing_s: f64) -> Result<Self> {
        let mut log = ContactLog::open(&contacts.log.path, &contacts.columns)?;
        let mut survey = Self::default();
        let mut samples: Vec<Samples> = Vec::new();
        let mut agreement = 0.0;
        let (mut frame, mut next): (Vec<ContactRow>, _) = (Vec::new(), log.next().transpose()?);
        while let Some(first) = next.take() {
            let time_s = first.time_s;
            frame.clear();
            frame.push(first);
            for row in log.by_ref() {
                let row = row?;
                if row.time_s > time_s {
                    next = Some(row);
                    break;
                }
                frame.push(row);
            }
            poses.meet(&log);
            survey.partners.resize_with(log.bodies().len(), Vec::new);
            survey.radii_m.resize(log.bodies().len(), 0.0);
            samples.resize_with(log.bodies().len(), Samples::default);
            survey.take(contacts, &frame, poses, spacing_s, &mut samples, &mut agreement)?;
        }
        survey.sign = if agreement < 0.0 { -1.0 } else { 1.0 };
        for partner in survey.partners.iter_mut().flatten() {
            // They were taken as if the sign were 1.
            partner.normal *= survey.sign;
            partner.reach_m *= survey.sign;
            partner.offset_m *= survey.sign;
        }
        let masses = samples.iter_mut().enumerate().map(|(body, samples)| {
            let told = poses.mass_kg(body).or_else(|| samples.median().map(|mass| mass * survey.sign));
            told.filter(|mass| mass.is_finite() && *mass > 0.0 && poses.states_velocity(body))
        });
        survey.masses_kg = masses.collect();
        Ok(survey)
    }

    fn take(
        &mut self,
        contacts: &Contacts,
        frame: &[ContactRow],
        poses: &mut Poses,
        spacing_s: f64,
        samples: &mut [Samples],
        agreement: &mut f64,
    ) -> Result<()> {
        let gravity = DVec3::from(contacts.gravity_mps2);
        let mut loads: Vec<(u32, DVec3, Option<DVec3>, bool)> = Vec::new();
        for row in frame {
            let Some(normal) = row.normal.and_then(|n| DVec3::from(n).try_normalize()) else { continue };
            let Some(force_n) = force_n(row, contacts.step_s).filter(|force| *force > 0.0) else { continue };
            let point = DVec3::from(row.position_m);
            for (body, other, normal) in [(row.a, row.b, normal), (row.b, row.a, -normal)] {
                let Some(state) = poses.state(body, row.time_s)? else { continue };
                let arm = DVec3::from(state.position_m) - point;
                *agreement += force_n * arm.normalize_or_zero().dot(normal);
                let centre =
                    poses.state(other, row.time_s)?.map_or(DVec3::ZERO, |other| other.position_m.into());
                let radius_m = &mut self.radii_m[body as usize];
                *radius_m = radius_m.max(arm.length());
                let partners = &mut self.partners[body as usize];
                let (reach_m, offset_m) = (arm.dot(normal), (point - centre).dot(normal));
                let known = partners.iter().any(|partner| {
                    let near = (partner.reach_m - reach_m).abs() < 0.3 * reach_m.abs();
                    partner.other == other && partner.normal.dot(normal) > 0.95 && near
                });
                if !known && partners.len() < MOST_PARTNERS {
                    partners.push(Partner { other, normal, reach_m, offset_m, line: row.line });
                }
                match loads.iter_mut().find(|(loaded, ..)| *loaded == body) {
                    Some((_, load, first, parallel)) => {
                        *load += force_n * normal;
                        *parallel &= first.is_some_and(|first| first.dot(normal).abs() > 0.999);
                    }
                    None => loads.push((body, force_n * normal, Some(normal), true)),
                }
            }
        }
        let Some(time_s) = frame.first().map(|row| row.time_s) else { return Ok(()) };
        let size = gravity.length();
        for (body, load, first, parallel) in loads {
            let mut velocity = [DVec3::ZERO; 3];
            for (v, at_s) in velocity.iter_mut().zip([time_s - spacing_s, time_s, time_s + spacing_s]) {
                *v = poses.fresh_state(body, at_s)?.unwrap_or(BodyState::STILL).velocity_mps.into();
            }
            let bend = velocity[2] - 2.0 * velocity[1] + velocity[0];
            if bend.length() > 0.1 * size * spacing_s {
                continue;
            }
            let pull = (velocity[2] - velocity[0]) / (2.0 * spacing_s) - gravity;
            // Along the normal friction does not count.
            let along = first.filter(|_| parallel).unwrap_or(pull.normalize_or_zero());
            if pull.dot(along).abs() > 0.3 * size && size > 0.0 {
                samples[body as usize].add(load.dot(along) / pull.dot(along));
            }
        }
        Ok(())
    }

    /// True where the mass of any body is known.
    pub(super) fn knows_a_mass(&self) -> bool {
        self.masses_kg.iter().any(Option::is_some)
    }

    fn share(&self, body: u32) -> f64 {
        self.masses_kg.get(body as usize).copied().flatten().map_or(0.0, f64::recip)
    }
}

/// The force of a row in newtons; nothing where it is an impulse of a step that nobody knows.
fn force_n(row: &ContactRow, step_s: Option<f64>) -> Option<f64> {
    match row.push {
        Push::Force(force_n) => Some(force_n),
        Push::Impulse(impulse_ns) => step_s.map(|step_s| impulse_ns / step_s),
    }
}

/// A pair that touches.
#[derive(Debug, Clone, Copy)]
struct Touching {
    bodies: [u32; 2],
    /// The way the first one is pushed.
    normal: DVec3,
    point: DVec3,
    /// When it was there.
    point_s: f64,
    lines: [u64; 2],
    force_n: f64,
    impulse_ns: f64,
}

/// A body between two frames.
#[derive(Debug, Clone, Copy)]
struct Flight {
    body: u32,
    /// 1/m.
    share: f64,
    before: BodyState,
    /// What its velocity gains from contacts.
    gain: DVec3,
    /// What its position does.
    shift: DVec3,
    /// What is left of the gain.
    left: DVec3,
}

/// The impulse of a pair in a frame: a row that a whole log would have, and when in it that acts.
pub(super) struct Impulse {
    pub(super) row: ContactRow,
    pub(super) at_s: Option<f64>,
    /// The time of the row's position.
    pub(super) point_s: f64,
}

/// Is fed the frames of a thinned log in order of time.
#[derive(Debug)]
pub(super) struct Momentum {
    survey: Survey,
    gravity: DVec3,
    spacing_s: f64,
    step_s: Option<f64>,
    before_s: Option<f64>,
    before: Vec<Touching>,
}

impl Momentum {
    pub(super) fn new(survey: Survey, contacts: &Contacts, spacing_s: f64) -> Self {
        let gravity = DVec3::from(contacts.gravity_mps2);
        Self { survey, gravity, spacing_s, step_s: contacts.step_s, before_s: None, before: Vec::new() }
    }

    /// The impulses from the frame before to one with these rows.
    pub(super) fn frame(
        &mut self,
        time_s: f64,
        rows: &[ContactRow],
        poses: &mut Poses,
    ) -> Result<Vec<Impulse>> {
        let now = self.touching(rows);
        let last = std::mem::replace(&mut self.before, now);
        let Some(before_s) = self.before_s.replace(time_s) else { return Ok(Vec::new()) };
        let span_s = time_s - before_s;
        if span_s <= 0.0 || span_s > LONGEST_FRAME * self.spacing_s {
            return Ok(Vec::new());
        }
        let mut flights = self.flights(before_s, time_s, poses)?;
        let mut pairs: Vec<Touching> = self.before.clone();
        for pair in &last {
            // Those of one frame are in order.
            match self.before.binary_search_by_key(&pair.bodies, |other| other.bodies) {
                Ok(index) => pairs[index].impulse_ns = pair.impulse_ns,
                Err(_) => pairs.push(*pair),
            }
        }
        pairs.retain(|pair| pair.bodies.iter().any(|&body| self.survey.share(body) > 0.0));
        solve(&mut pairs, &mut flights);
        let missed = self.missed(&pairs, &flights, before_s, time_s, poses)?;
        if !missed.is_empty() {
            pairs.extend(missed);
            solve(&mut pairs, &mut flights);
        }
        pairs.sort_by_key(|pair| pair.bodies);
        for pair in &mut self.before {
            let found = pairs.binary_search_by_key(&pair.bodies, |other| other.bodies);
            pair.impulse_ns = found.map_or(0.0, |index| pairs[index].impulse_ns);
        }
        let told = pairs.iter().filter_map(|pair| {
            let flight = |body: u32| {
                let index = flights.binary_search_by_key(&body, |flight| flight.body).ok()?;
                flights.get(index)
            };
            let movers = pair.bodies.into_iter().filter_map(flight);
            let mover = movers.max_by(|a, b| a.share.total_cmp(&b.share))?;
            // Less than a thousandth of its weight is no contact.
            if pair.impulse_ns * mover.share <= 1e-3 * self.gravity.length() * span_s {
                return None;
            }
            let normal = if mover.body == pair.bodies[0] { pair.normal } else { -pair.normal };
            let gain = mover.gain.dot(normal);
            let left_s = mover.shift.dot(normal) / gain;
            let at_s = (gain > 0.0 && left_s.is_finite()).then(|| time_s - left_s.clamp(0.0, span_s));
            Some(Impulse {
                row: ContactRow {
                    time_s,
                    a: pair.bodies[0],
                    b: pair.bodies[1],
                    position_m: pair.point.to_array(),
                    push: Push::Impulse(pair.impulse_ns),
                    normal: Some((pair.normal * self.survey.sign).to_array()),
                    normal_velocity_mps: None,
                    sliding_mps: None,
                    line: pair.lines[0],
                },
                at_s,
                point_s: pair.point_s,
            })
        });
        Ok(told.collect())
    }

    /// True where the momentum of a body of a row is known.
    pub(super) fn knows(&self, row: &ContactRow) -> bool {
        self.survey.share(row.a) > 0.0 || self.survey.share(row.b) > 0.0
    }

    /// The rows of a frame as far as a whole log would have them: pushed as hard as the impulses found.
    pub(super) fn weighted(&self, row: &ContactRow) -> ContactRow {
        let bodies = [row.a.min(row.b), row.a.max(row.b)];
        let force = force_n(row, self.step_s).unwrap_or(0.0);
        let index = self.before.binary_search_by_key(&bodies, |pair| pair.bodies).ok();
        let pair = index.and_then(|index| self.before.get(index)).filter(|pair| pair.force_n > 0.0);
        let share = pair.map(|pair| pair.impulse_ns * force / pair.force_n);
        let impulse_ns = share.unwrap_or(force * self.spacing_s);
        ContactRow { push: Push::Impulse(impulse_ns), ..row.clone() }
    }

    /// The pairs of a frame.
    fn touching(&self, rows: &[ContactRow]) -> Vec<Touching> {
        let mut sorted: Vec<&ContactRow> = rows.iter().collect();
        sorted.sort_by(|x, y| {
            let bodies = |row: &ContactRow| [row.a.min(row.b), row.a.max(row.b)];
            let place = || (0..3).map(|n| x.position_m[n].total_cmp(&y.position_m[n])).find(|o| o.is_ne());
            bodies(x).cmp(&bodies(y)).then_with(|| place().unwrap_or(std::cmp::Ordering::Equal))
        });
        let mut found: Vec<Touching> = Vec::new();
        for row in sorted {
            let Some(normal) = row.normal.map(DVec3::from) else { continue };
            let Some(force_n) = force_n(row, self.step_s).filter(|force| *force > 0.0) else { continue };
            let swapped = row.a > row.b;
            let bodies = if swapped { [row.b, row.a] } else { [row.a, row.b] };
            let push = normal * (self.survey.sign * force_n * if swapped { -1.0 } else { 1.0 });
            let point = DVec3::from(row.position_m) * force_n;
            match found.last_mut().filter(|pair| pair.bodies == bodies) {
                Some(pair) => {
                    pair.normal += push;
                    pair.point += point;
                    pair.force_n += force_n;
                    pair.lines = [pair.lines[0].min(row.line), pair.lines[1].max(row.line)];
                }
                None => found.push(Touching {
                    bodies,
                    normal: push,
                    point,
                    point_s: row.time_s,
                    lines: [row.line; 2],
                    force_n,
                    impulse_ns: 0.0,
                }),
            }
        }
        for pair in &mut found {
            pair.normal = pair.normal.normalize_or_zero();
            pair.point /= pair.force_n;
        }
        found.retain(|pair| pair.point.is_finite() && pair.normal != DVec3::ZERO);
        found
    }

    /// All bodies whose masses are known, between two frames.
    fn flights(&self, before_s: f64, time_s: f64, poses: &mut Poses) -> Result<Vec<Flight>> {
        let span_s = time_s - before_s;
        let mut found = Vec::new();
        for body in (0..self.survey.masses_kg.len() as u32).filter(|&body| self.survey.share(body) > 0.0) {
            let (before, after) = (poses.fresh_state(body, before_s)?, poses.fresh_state(body, time_s)?);
            let (Some(before), Some(after)) = (before, after) else { continue };
            let [v0, v1] = [before, after].map(|state| DVec3::from(state.velocity_mps));
            let moved = DVec3::from(after.position_m) - DVec3::from(before.position_m);
            let around = v0.length().max(v1.length());
            if moved.length() > JUMP_MPS * span_s && moved.length() > 8.0 * around * span_s {
                continue;
            }
            let gain = v1 - v0 - self.gravity * span_s;
            let shift = moved - v0 * span_s - self.gravity * (0.5 * span_s * span_s);
            let share = self.survey.share(body);
            found.push(Flight { body, share, before, gain, shift, left: gain });
        }
        Ok(found)
    }

    /// Pairs that must have touched between the frames: they explain what is left of what bodies gained.
    fn missed(
        &self,
        pairs: &[Touching],
        flights: &[Flight],
        before_s: f64,
        time_s: f64,
        poses: &mut Poses,
    ) -> Result<Vec<Touching>> {
        let span_s = time_s - before_s;
        let mut found: Vec<Touching> = Vec::new();
        for flight in flights {
            let left = flight.left.length();
            if left <= 0.5 * self.gravity.length() * span_s {
                continue;
            }
            let mut best: Option<(f64, Touching)> = None;
            for partner in &self.survey.partners[flight.body as usize] {
                let bodies = [flight.body.min(partner.other), flight.body.max(partner.other)];
                let along = partner.normal.dot(flight.left) / left;
                if along < 0.8 || pairs.iter().chain(&found).any(|pair| pair.bodies == bodies) {
                    continue;
                }
                let gain = flight.gain.dot(partner.normal);
                let left_s = (flight.shift.dot(partner.normal) / gain).clamp(0.0, span_s);
                let at_s = time_s - left_s;
                let so_far_s = span_s - left_s;
                let centre = DVec3::from(flight.before.position_m)
                    + DVec3::from(flight.before.velocity_mps) * so_far_s
                    + self.gravity * (0.5 * so_far_s * so_far_s);
                let other = poses.fresh_state(partner.other, at_s)?;
                let other = other.map_or(DVec3::ZERO, |state| state.position_m.into());
                // How far the centre is above the other's surface: by no more than the body is large.
                let height_m = (centre - other).dot(partner.normal) - partner.offset_m;
                let radius_m = self.survey.radii_m[flight.body as usize].max(partner.reach_m);
                let gap_m = (partner.reach_m - height_m).max(height_m - radius_m).max(0.0);
                let reach_m = radius_m + gain.abs() * 0.1 * span_s;
                // What is no number is near nobody.
                if gap_m > 0.3 * reach_m || gap_m.is_nan() || reach_m.is_nan() {
                    continue;
                }
                let fit = gap_m / reach_m + (1.0 - along);
                if best.as_ref().is_none_or(|(least, _)| fit < *least) {
                    let normal = if flight.body == bodies[0] { partner.normal } else { -partner.normal };
                    let point = centre - partner.normal * height_m;
                    let lines = [partner.line; 2];
                    let pair = Touching {
                        bodies,
                        normal,
                        point,
                        point_s: at_s,
                        lines,
                        force_n: 0.0,
                        impulse_ns: 0.0,
                    };
                    best = Some((fit, pair));
                }
            }
            found.extend(best.map(|(_, pair)| pair));
        }
        Ok(found)
    }
}

/// Finds the impulses, none below 0, that explain what bodies gained, and what is left of that.
fn solve(pairs: &mut [Touching], flights: &mut [Flight]) {
    let place =
        |flights: &[Flight], body: u32| flights.binary_search_by_key(&body, |flight| flight.body).ok();
    let ends: Vec<[Option<usize>; 2]> =
        pairs.iter().map(|pair| pair.bodies.map(|body| place(flights, body))).collect();
    flights.iter_mut().for_each(|flight| flight.left = flight.gain);
    let push = |flights: &mut [Flight], ends: [Option<usize>; 2], normal: DVec3, impulse_ns: f64| {
        for (end, sign) in ends.into_iter().zip([1.0, -1.0]) {
            if let Some(flight) = end.and_then(|end| flights.get_mut(end)) {
                flight.left -= normal * (sign * impulse_ns * flight.share);
            }
        }
    };
    for (pair, &ends) in pairs.iter().zip(&ends) {
        push(flights, ends, pair.normal, pair.impulse_ns);
    }
    for _ in 0..MOST_ROUNDS {
        let mut change: f64 = 0.0;
        for (pair, &ends) in pairs.iter_mut().zip(&ends) {
            let of = |end: Option<usize>| end.and_then(|end| flights.get(end));
            let [a, b] = ends.map(of);
            let shares = a.map_or(0.0, |a| a.share) + b.map_or(0.0, |b| b.share);
            if shares <= 0.0 {
                pair.impulse_ns = 0.0;
                continue;
            }
            let wanted =
                a.map_or(0.0, |a| a.left.dot(pair.normal)) - b.map_or(0.0, |b| b.left.dot(pair.normal));
            let next_ns = (pair.impulse_ns + wanted / shares).max(0.0);
            let step_ns = next_ns - pair.impulse_ns;
            change = change.max((step_ns * shares).abs());
            pair.impulse_ns = next_ns;
            push(flights, ends, pair.normal, step_ns);
        }
        if change < 1e-9 {
            break;
        }
    }
}
