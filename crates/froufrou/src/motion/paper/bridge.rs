//! What is held on two sides or all around, and bows between.
//!
//! It flips when its middle comes through between what holds it: the clamps may have turned the sheet's ends long
//! before, so that the integral of its curvature says little of that. The *bow* is how far the middle is from the plane
//! through what is held, to where the sheet faces. Folds may come and go in it meanwhile.

use std::collections::VecDeque;

use glam::{DMat3, DVec3};

use super::course::Course;
use super::resonators::Hold;
use super::sheet::{Lie, NONE, Sheet};
use crate::motion::cloth::geodesic::Ways;
use crate::motion::cloth::triangulation::Triangulation;

/// What is held spans a plane if it is at most this part as thick as it is wide.
const THIN: f64 = 0.25;
/// The middle is at least this part as far from what is held as what is farthest,
const MIDDLE: f64 = 0.9;
/// and of that what is this part as far from free borders as what is farthest from these.
const INNER: f64 = 0.75;
/// It is on a side where it is this part of the span from the plane,
const BOWED: f64 = 0.02;
/// and comes through if it goes on to be this part of the span beyond.
const BEYOND: f64 = 0.01;
/// How fast it turned within so many seconds tells how loud it flips.
const TURNED_S: f64 = 0.5;
/// So far back bows and integrals are looked at, in seconds.
const BACK_S: f64 = 0.1;

/// A bow that has come through.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Through {
    /// What bows, and what holds it.
    pub vertices: Vec<u32>,
    pub time_s: f64,
    /// Whether it bows the way the sheet faces now.
    pub positive: bool,
    /// The greatest rate at which the integral of H went that way, in m/s.
    pub energy_mps: f64,
}

/// A part of a sheet that hangs together, and what is held beside it.
#[derive(Debug, Clone)]
struct Bridge {
    supports: Vec<u32>,
    members: Vec<u32>,
    /// The vertices of its middle, and how much each counts.
    middle: Vec<(u32, f64)>,
    span_m: f64,
    /// Times, and how far the middle was from the plane.
    bows: VecDeque<(f64, f64)>,
    /// Times, and the integral of H, and the rates at which that changed.
    turns: VecDeque<(f64, f64)>,
    rates: VecDeque<(f64, f64)>,
    /// The side on which it was since it came through: −1 or 1, or 0 for none.
    side: i8,
    /// Whether it was on any yet.
    has_bowed: bool,
}

/// All such parts of a sheet.
#[derive(Debug, Clone, Default)]
pub(super) struct Bridges {
    all: Vec<Bridge>,
    /// What was held when they were found.
    held: Vec<u32>,
    /// The pools of those that are there and bowed before.
    pools: Vec<u32>,
}

/// A sheet in the frame that is fed.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a> {
    pub time_s: f64,
    pub sheet: &'a Sheet,
    pub surface: &'a Triangulation,
    pub positions: &'a [[f32; 3]],
    pub lie: &'a Lie,
    pub mean_per_m: &'a [f64],
    pub holds: &'a [Hold],
    /// Among which resonators each vertex is.
    pub pools: &'a [u32],
}

impl Bridges {
    /// Takes the next frame, and tells which bows have come through since the last. `last` are the curvatures in the
    /// frames before.
    pub fn feed(&mut self, frame: Frame<'_>, last: &VecDeque<(f64, Vec<f64>)>) -> Vec<Through> {
        let held = (0..).zip(frame.holds).filter(|(_, hold)| hold.is_held).map(|(vertex, _)| vertex);
        if !held.clone().eq(self.held.iter().copied()) {
            self.held = held.collect();
            self.find(frame, last);
        }
        self.pools.clear();
        let mut through = Vec::new();
        for bridge in &mut self.all {
            let has_bowed = bridge.has_bowed;
            through.extend(bridge.feed(frame));
            if has_bowed && bridge.bows.len() > 1 {
                self.pools.extend(bridge.members.iter().map(|&vertex| frame.pools[vertex as usize]));
            }
        }
        self.pools.sort_unstable();
        self.pools.dedup();
        through
    }

    /// Whether a pool is of what flips when its bow comes through.
    pub fn spans(&self, pool: u32) -> bool {
        self.pools.binary_search(&pool).is_ok()
    }

    /// Finds what is between what is held.
    fn find(&mut self, frame: Frame<'_>, last: &VecDeque<(f64, Vec<f64>)>) {
        let is_held = |vertex: u32| frame.holds[vertex as usize].is_held;
        // What holds it goes on to, whatever else is held, as long as its middle is free.
        let goes_on = |bridge: &Bridge| {
            bridge.supports.iter().all(|&vertex| is_held(vertex))
                && !bridge.middle.iter().any(|&(vertex, _)| is_held(vertex))
        };
        let (all, old): (Vec<Bridge>, Vec<Bridge>) =
            std::mem::take(&mut self.all).into_iter().partition(goes_on);
        self.all = all;
        // What a free vertex belongs to; what is held may be beside several.
        let mut of = vec![NONE; frame.sheet.vertex_count];
        for (number, bridge) in (0..).zip(&self.all) {
            bridge.members.iter().for_each(|&vertex| of[vertex as usize] = number);
        }
        let mut number = self.all.len() as u32;
        for seed in self.held.iter().flat_map(|&held| frame.surface.ring(held)).copied() {
            if is_held(seed) || of[seed as usize] != NONE {
                continue;
            }
            let (mut members, mut supports) = (vec![seed], Vec::new());
            number += 1;
            of[seed as usize] = number;
            let mut next = 0;
            while let Some(&vertex) = members.get(next) {
                next += 1;
                for &other in frame.surface.ring(vertex) {
                    if is_held(other) {
                        supports.push(other);
                    } else if of[other as usize] == NONE {
                        of[other as usize] = number;
                        members.push(other);
                    }
                }
            }
            supports.sort_unstable();
            supports.dedup();
            let Some(mut bridge) = Bridge::new(frame, members, supports) else { continue };
            let is_known = |known: &&Bridge| {
                let same =
                    known.supports.iter().filter(|&support| bridge.supports.binary_search(support).is_ok());
                2 * same.count() >= known.supports.len()
            };
            if let Some(known) = old.iter().find(is_known) {
                bridge.bows.clone_from(&known.bows);
                bridge.rates.clone_from(&known.rates);
                (bridge.side, bridge.has_bowed) = (known.side, known.has_bowed);
            }
            bridge.turns.extend(last.iter().map(|(at_s, h)| (*at_s, frame.lie.integral(&bridge.members, h))));
            self.all.push(bridge);
        }
    }
}

impl Bridge {
    /// Takes up what is held by some vertices, if these span a plane.
    fn new(frame: Frame<'_>, mut members: Vec<u32>, supports: Vec<u32>) -> Option<Self> {
        let Frame { sheet, surface, positions, lie, .. } = frame;
        plane(lie, &supports)?;
        let mut ways = Ways::new(surface, positions);
        let mut ways_m = |from: &[u32]| {
            let mut all_m = vec![f64::INFINITY; sheet.vertex_count];
            for (vertex, way_m) in ways.within(from, f64::INFINITY) {
                all_m[vertex as usize] = way_m;
            }
            all_m
        };
        let held_m = ways_m(&supports);
        let is_free =
            |vertex: &u32| sheet.edges_at(*vertex).iter().any(|&edge| sheet.edges[edge as usize].is_border);
        let borders: Vec<u32> = members.iter().copied().filter(is_free).collect();
        let free_m = ways_m(&borders);
        let part = |all_m: &[f64], vertex: u32, farthest_m: f64, least: f64| {
            let part = all_m[vertex as usize] / farthest_m;
            // Where there are no borders all is as far from them.
            if part.is_nan() { 1.0 } else { (part - least) / (1.0 - least) }
        };
        let farthest = |all_m: &[f64], of: &[u32]| of.iter().map(|&v| all_m[v as usize]).fold(0.0, f64::max);
        let span_m = 2.0 * farthest(&held_m, &members);
        let far = |&vertex: &u32| part(&held_m, vertex, 0.5 * span_m, MIDDLE) > 0.0;
        let across: Vec<u32> = members.iter().copied().filter(far).collect();
        let inner_m = farthest(&free_m, &across);
        let weight = |&vertex: &u32| {
            let inner = part(&free_m, vertex, inner_m, INNER).max(0.0);
            (vertex, part(&held_m, vertex, 0.5 * span_m, MIDDLE) * inner * lie.vertex_areas[vertex as usize])
        };
        let middle: Vec<(u32, f64)> = across.iter().map(weight).filter(|of| of.1 > 0.0).collect();
        members.extend(&supports);
        members.sort_unstable();
        (!middle.is_empty()).then(|| Self {
            supports,
            members,
            middle,
            span_m,
            bows: VecDeque::new(),
            turns: VecDeque::new(),
            rates: VecDeque::new(),
            side: 0,
            has_bowed: false,
        })
    }

    fn feed(&mut self, frame: Frame<'_>) -> Option<Through> {
        let Frame { time_s, mean_per_m, .. } = frame;
        let Some(bow_m) = self.bow_m(frame) else {
            self.bows.clear();
            self.side = 0;
            return None;
        };
        let turned = frame.lie.integral(&self.members, mean_per_m);
        let rate = Course::new(self.turns.iter().copied(), (time_s, turned)).rate();
        self.rates.push_back((time_s, rate));
        let before_m = self.bows.back().map_or(0.0, |last| last.1);
        let side = f64::from(self.side);
        let mut through = None;
        if side * before_m > 0.0 && side * bow_m <= 0.0 {
            let towards = self.bows.iter().map(|&(at_s, bow_m)| (at_s, -side * bow_m));
            let course = Course::new(towards, (time_s, -side * bow_m));
            let rates = self.rates.iter().filter(|&&(at_s, _)| time_s - at_s <= TURNED_S);
            let energy_mps = rates.map(|&(_, rate)| -side * rate).fold(0.0, f64::max);
            if course.goes_on(BEYOND * self.span_m) {
                let time_s = course.crossing().0;
                let vertices = self.members.clone();
                through = Some(Through { vertices, time_s, positive: self.side < 0, energy_mps });
            }
            self.side = 0;
        }
        if bow_m.abs() >= BOWED * self.span_m {
            self.side = if bow_m > 0.0 { 1 } else { -1 };
            self.has_bowed = true;
        }
        self.bows.push_back((time_s, bow_m));
        self.turns.push_back((time_s, turned));
        let drop = |from: &mut VecDeque<(f64, f64)>, back_s: f64| {
            while from.get(1).is_some_and(|second| time_s - second.0 >= back_s) {
                from.pop_front();
            }
        };
        drop(&mut self.bows, BACK_S);
        drop(&mut self.turns, BACK_S);
        drop(&mut self.rates, TURNED_S);
        through
    }

    /// How far the middle is from the plane of what holds it, to where it faces; nothing where there is no such plane
    /// or the middle is not between.
    fn bow_m(&self, frame: Frame<'_>) -> Option<f64> {
        let Frame { sheet, lie, .. } = frame;
        let (centre, normal, spread) = plane(lie, &self.supports)?;
        let (mut middle, mut faces, mut sum) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for &(vertex, weight) in &self.middle {
            middle += weight * lie.points[vertex as usize];
            sum += weight;
            faces +=
                sheet.faces_at(vertex).iter().map(|&face| weight * lie.normals[face as usize]).sum::<DVec3>();
        }
        let away = middle / sum - centre;
        let within = away.reject_from_normalized(normal);
        let is_between = within.dot(spread.inverse() * within) <= 1.0;
        is_between.then(|| away.dot(normal) * faces.dot(normal).signum())
    }
}

/// The plane through some vertices: their mean, its normal, and how they are spread along it, squared; along the normal
/// they are as far as any.
fn plane(lie: &Lie, vertices: &[u32]) -> Option<(DVec3, DVec3, DMat3)> {
    let points = || vertices.iter().map(|&vertex| lie.points[vertex as usize]);
    let centre = points().sum::<DVec3>() / vertices.len() as f64;
    let mut spread = DMat3::ZERO;
    for point in points() {
        let away = (point - centre) / (vertices.len() as f64).sqrt();
        spread += DMat3::from_cols(away * away.x, away * away.y, away * away.z);
    }
    let trace = spread.x_axis.x + spread.y_axis.y + spread.z_axis.z;
    if !(trace > 0.0 && trace.is_finite()) {
        return None;
    }
    // The inverse, squared again and again, is all along the least of its axes.
    let mut inverse = (spread * (1.0 / trace) + DMat3::IDENTITY * 1e-9).inverse();
    for _ in 0..6 {
        let most = inverse.to_cols_array().iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        inverse *= 1.0 / most;
        inverse *= inverse;
    }
    let longest = |a: DVec3, b: DVec3| if b.length_squared() > a.length_squared() { b } else { a };
    let normal = longest(longest(inverse.x_axis, inverse.y_axis), inverse.z_axis).try_normalize()?;
    // The squares along the other two axes have this sum and this product.
    let thickness = normal.dot(spread * normal).max(0.0);
    let squared = spread * spread;
    let all = 0.5 * (trace * trace - (squared.x_axis.x + squared.y_axis.y + squared.z_axis.z));
    let sum = trace - thickness;
    let product = all - thickness * sum;
    let width = 0.5 * (sum - (sum * sum - 4.0 * product).max(0.0).sqrt());
    let is_plane = width > 1e-6 * sum && thickness <= THIN * THIN * width;
    let across = DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
    is_plane.then(|| (centre, normal, spread + across * trace))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn lie(points: Vec<DVec3>) -> (Lie, Vec<u32>) {
        let all = (0..points.len() as u32).collect();
        (Lie { points, ..Lie::default() }, all)
    }

    #[test]
    fn a_plane_is_found_and_nothing_else_is() {
        let random = Random::new(3, 0);
        let number = |at: u64| random.uniform(at) - 0.5;
        for case in 0..50 {
            let at = |i: u64| {
                DVec3::new(number(case * 1000 + i), number(case * 1000 + i + 1), number(case * 1000 + i + 2))
            };
            let (a, b, centre) = (at(900).normalize(), at(903).normalize(), at(906));
            let normal = a.cross(b).normalize();
            let b = normal.cross(a);
            let points = |wide: f64, thick: f64| {
                let point = |i: u64| {
                    let p = at(3 * i);
                    centre + p.x * a + wide * p.y * b + thick * p.z * normal
                };
                lie((0..100).map(point).collect())
            };
            let (sheet, all) = points(0.3, 0.001);
            let (found, across, spread) = plane(&sheet, &all).expect("a plane");
            assert!(across.dot(normal).abs() > 0.9999, "{across} {normal}");
            let mean = sheet.points.iter().sum::<DVec3>() / 100.0;
            assert!(found.distance(mean) < 1e-12);
            // Uniform numbers from −½ to ½ have a variance of 1/12.
            let along = a.dot(spread * a);
            assert!((along * 12.0 - 1.0).abs() < 0.4, "{along}");
            for (wide, thick) in [(0.0, 0.0), (1e-4, 1e-4), (0.3, 0.3), (1.0, 1.0)] {
                let (sheet, all) = points(wide, thick);
                assert!(plane(&sheet, &all).is_none(), "{wide} {thick}");
            }
        }
        let (sheet, all) = lie(vec![DVec3::ONE; 4]);
        assert!(plane(&sheet, &all).is_none() && plane(&sheet, &[]).is_none());
        let (sheet, all) = lie(vec![DVec3::NAN, DVec3::ONE, DVec3::X, DVec3::Y]);
        assert!(plane(&sheet, &all).is_none());
    }
}
