//! Which vertices of a sheet are held, and which touch something and slide along it.
//!
//! A vertex is held while it stays in its place for a while in which the sheet as a whole moves; where it touches a
//! body, its place is on that body. When all is still, what was held stays so. Vertices can be named that are held
//! whatever they do.

use glam::DVec3;

use super::resonators::Hold;
use super::sheet::Lie;
use crate::motion::cloth::proximity::{Contact, Touchable};
use crate::motion::cloth::sliding::moved_m;
use crate::motion::cloth::triangulation::Triangulation;

/// What stays within this part of the size of the sheet stays in its place.
const STILL: f64 = 0.002;
/// The sheet as a whole moves if it does so by this many times as much,
const MOVES: f64 = 20.0;
/// and this is how long the vertex stays at least, in seconds.
const LEAST_S: f64 = 0.2;
/// What touches goes on to touch until it is this many times as far.
pub(super) const LET_GO: f64 = 1.25;

/// What is held and touched, from frame to frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Holding {
    named: Vec<bool>,
    vertices: Vec<u32>,
    radius_m: f64,
    /// Of each vertex: how far it has gone from its place, since when it is there, and how far the sheet had moved then.
    drifts: Vec<DVec3>,
    since_s: Vec<f64>,
    since_m: Vec<f64>,
    /// How far the sheet has moved, in metres.
    moved_m: f64,
    pub holds: Vec<Hold>,
    contacts: Vec<Option<Contact>>,
    /// Of each of the vertices that may touch something: how fast it slid along what it touched, and its number.
    pub slid: Vec<Option<(f64, u32)>>,
}

impl Holding {
    /// Begins with the vertices that may touch something, and some that are held.
    pub fn new(time_s: f64, count: usize, vertices: &[u32], named: Vec<bool>, radius_m: f64) -> Self {
        let holds = named.iter().map(|&is_held| Hold { is_held, touches: false }).collect();
        Self {
            named,
            vertices: vertices.to_vec(),
            radius_m,
            drifts: vec![DVec3::ZERO; count],
            since_s: vec![time_s; count],
            since_m: vec![0.0; count],
            moved_m: 0.0,
            holds,
            contacts: vec![None; vertices.len()],
            slid: vec![None; vertices.len()],
        }
    }

    /// Takes the next frame: what is touched now, and where the objects have come to lie since the last one.
    pub fn feed(
        &mut self,
        time_s: f64,
        step_s: f64,
        own: u32,
        contacts: &[Option<Contact>],
        objects: &[Touchable],
        lie: &Lie,
    ) {
        if step_s > 0.0 {
            self.follow(time_s, step_s, own, objects, lie);
        }
        for ((&vertex, contact), known) in self.vertices.iter().zip(contacts).zip(&mut self.contacts) {
            let hold = &mut self.holds[vertex as usize];
            let within_m = if hold.touches { LET_GO * self.radius_m } else { self.radius_m };
            *known = contact.filter(|contact| contact.distance_m <= within_m);
            hold.touches = known.is_some();
        }
    }

    fn follow(&mut self, time_s: f64, step_s: f64, own: u32, objects: &[Touchable], lie: &Lie) {
        let still_m = STILL * lie.size_m();
        let Some(object) = objects.get(own as usize) else { return };
        let mut squares = 0.0;
        let mut reset = |drift: &mut DVec3, vertex: usize, moved: DVec3, sum_m: f64| {
            *drift += moved;
            if drift.length() > still_m {
                *drift = DVec3::ZERO;
                self.since_s[vertex] = time_s;
                self.since_m[vertex] = sum_m;
            }
        };
        for ((&vertex, contact), slid) in self.vertices.iter().zip(&self.contacts).zip(&mut self.slid) {
            let Some([from, to]) = object.vertex(vertex) else { continue };
            let carried = contact.and_then(|contact| {
                let touched = objects.get(contact.object as usize)?;
                Some((contact.object, touched.carried(contact.triangle, contact.barycentric)?))
            });
            let moved = match carried {
                Some((other, triangle)) => {
                    let moved = moved_m([from, to], triangle);
                    let normal = triangle[0].1.normalize_or_zero();
                    let speed_mps = moved.reject_from_normalized(normal).length() / step_s;
                    *slid = Some((speed_mps, other));
                    moved
                }
                None => {
                    *slid = None;
                    to - from
                }
            };
            squares += moved.length_squared() * lie.vertex_areas[vertex as usize];
            reset(&mut self.drifts[vertex as usize], vertex as usize, moved, self.moved_m);
        }
        if lie.area_m2 > 0.0 {
            self.moved_m += (squares / lie.area_m2).sqrt();
        }
        for &vertex in &self.vertices {
            let vertex = vertex as usize;
            let is_new = self.since_s[vertex] == time_s;
            let stays = time_s - self.since_s[vertex] >= LEAST_S
                && self.moved_m - self.since_m[vertex] > MOVES * still_m;
            let hold = &mut self.holds[vertex];
            hold.is_held = self.named[vertex] || stays || hold.is_held && !is_new;
        }
    }

    /// Takes vertices that are known to be held, or to touch something, instead of those that were found.
    pub fn name(&mut self, surface: &Triangulation, held: Option<&[u32]>, touching: Option<&[u32]>) {
        let mut set = |named: Option<&[u32]>, take: fn(&mut Hold) -> &mut bool| {
            let Some(named) = named else { return };
            self.holds.iter_mut().for_each(|hold| *take(hold) = false);
            for vertex in named.iter().filter_map(|&vertex| surface.welded(vertex)) {
                *take(&mut self.holds[vertex as usize]) = true;
            }
        };
        set(held, |hold| &mut hold.is_held);
        set(touching, |hold| &mut hold.touches);
    }

    /// Tells that an object has changed its faces: what touched it before cannot be followed.
    pub fn lose(&mut self, object: u32) {
        for contact in &mut self.contacts {
            if contact.is_some_and(|contact| contact.object == object) {
                *contact = None;
            }
        }
    }

    /// The vertices that may touch something, ascending.
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }
}
