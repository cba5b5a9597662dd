//! A body as it is at one time.

use glam::{DAffine3, DMat3, DVec3};

use super::beam::{Beam, Meeting};
use super::form::Form;
use super::patch::{Patch, Reflection};
use super::tree::Go;
use super::{Body, Shape, Sides};
use crate::scene::animation::{Mesh, Topology, Transform};
use crate::{Error, Place, Result};

/// A body, its shape and where it is.
pub(crate) struct Posed {
    body: Body,
    both_sides: bool,
    way: Way,
    /// The patches in the world.
    patches: Vec<Patch>,
    /// The mesh last read, kept for its memory.
    mesh: Mesh,
}

/// How a shape changes.
enum Way {
    /// Not at all; it is moved as a whole, local to world.
    Rigid { form: Form, to_world: DAffine3 },
    /// Its points move; held in world space.
    Bends { form: Form },
    /// Its faces change from key to key: the shapes at the key before and, if any, the one after, and how far
    /// the time is on the way between them. What is asked for lies between the two.
    Changes { before: (f64, Form), after: Option<(f64, Form)>, part: f64 },
}

impl Posed {
    pub fn new(body: Body) -> Result<Self> {
        check(&body)?;
        let mut mesh = Mesh::default();
        let most = body.patches.max(1);
        let first_s = body.surface.next_key_s(f64::NEG_INFINITY).unwrap_or(0.0);
        let rigid = |form| Way::Rigid { form, to_world: DAffine3::IDENTITY };
        let way = match body.shape {
            shape @ (Shape::Rectangle { .. } | Shape::Box { .. }) => {
                rigid(Form::new(&simple(shape).unwrap_or_default(), most))
            }
            Shape::Mesh => {
                let topology = body.surface.topology();
                if topology == Topology::None {
                    return Err(fault(&body, "has no mesh").help("give it a shape: a rectangle or a box"));
                }
                if topology == Topology::Heterogeneous {
                    read_at_key(&body, first_s, &mut mesh)?;
                } else {
                    body.surface.mesh(first_s, &mut mesh)?;
                }
                let mut form = Form::new(&mesh, most);
                let frame = affine(&body.surface.frame(first_s)?);
                let into = frame.inverse();
                match topology {
                    // Scaled to nothing or far too small to be undone: read anew each time.
                    Topology::Constant if into.is_finite() && frame.matrix3.determinant().abs() > 1e-12 => {
                        form.transform(&into);
                        rigid(form)
                    }
                    Topology::Heterogeneous => {
                        Way::Changes { before: (first_s, form), after: None, part: 0.0 }
                    }
                    _ => Way::Bends { form },
                }
            }
        };
        let both_sides = match body.sides {
            Sides::Auto => !way.form().closed,
            Sides::Front => false,
            Sides::Both => true,
        };
        let mut posed = Self { body, both_sides, way, patches: Vec::new(), mesh };
        posed.pose(first_s)?;
        Ok(posed)
    }

    /// Brings it to a time.
    pub fn pose(&mut self, time_s: f64) -> Result<()> {
        let body = &self.body;
        match &mut self.way {
            Way::Rigid { to_world, .. } => *to_world = affine(&body.surface.frame(time_s)?),
            Way::Bends { form } => {
                body.surface.mesh(time_s, &mut self.mesh)?;
                if !form.refit(&self.mesh) {
                    *form = Form::following(&self.mesh, form);
                }
            }
            Way::Changes { before, after, part } => {
                if time_s < before.0 {
                    // Back to the first key: what a patch is follows from the frames before alone.
                    let first_s = body.surface.next_key_s(f64::NEG_INFINITY).unwrap_or(0.0);
                    if first_s < before.0 {
                        read_at_key(body, first_s, &mut self.mesh)?;
                        *before = (first_s, Form::new(&self.mesh, body.patches.max(1)));
                        *after = None;
                    }
                }
                loop {
                    if after.is_none()
                        && let Some(next_s) = body.surface.next_key_s(before.0)
                    {
                        read_at_key(body, next_s, &mut self.mesh)?;
                        let mut form = before.1.clone();
                        if !form.refit(&self.mesh) {
                            form = Form::following(&self.mesh, &before.1);
                        }
                        *after = Some((next_s, form));
                    }
                    match after.take_if(|(next_s, _)| *next_s <= time_s) {
                        Some(next) => *before = next,
                        None => break,
                    }
                }
                *part = match after {
                    Some((next_s, _)) => ((time_s - before.0) / (*next_s - before.0)).clamp(0.0, 1.0),
                    None => 0.0,
                };
            }
        }
        self.patches.clear();
        match &self.way {
            Way::Rigid { form, to_world } => {
                self.patches.extend(form.patches.iter().map(|p| p.posed(to_world)));
            }
            Way::Bends { form } => self.patches.extend_from_slice(&form.patches),
            Way::Changes { before, after: Some(after), part } => {
                let pairs = before.1.patches.iter().zip(&after.1.patches);
                self.patches.extend(pairs.map(|(a, b)| a.toward(b, *part)));
            }
            Way::Changes { before, after: None, .. } => self.patches.extend_from_slice(&before.1.patches),
        }
        Ok(())
    }

    /// The areas of the patches that reflect.
    pub fn areas_m2(&self) -> impl Iterator<Item = f64> {
        let count = if self.body.patches == 0 { 0 } else { self.patches.len() };
        self.patches[..count].iter().map(Patch::area_m2)
    }

    pub fn belongs_to(&self, things: [Option<u64>; 2]) -> bool {
        self.body.thing.is_some() && things.contains(&self.body.thing)
    }

    pub fn occludes(&self) -> bool {
        self.body.occludes
    }

    pub fn reflect(&self, patch: usize, from: DVec3, to: DVec3) -> Reflection {
        self.patches[patch].reflect(&self.body.material, self.both_sides, from, to)
    }

    pub fn next_key_s(&self, time_s: f64) -> Option<f64> {
        self.body.surface.next_key_s(time_s)
    }

    /// The corners of the box about it; of its local one where it is moved as a whole.
    pub fn corners(&self) -> [DVec3; 8] {
        let (bounds, to_world) = match &self.way {
            Way::Rigid { form, to_world } => (form.tree.bounds(), *to_world),
            Way::Bends { form } => (form.tree.bounds(), DAffine3::IDENTITY),
            Way::Changes { before, after, part } => {
                let mut bounds = before.1.tree.bounds();
                if let Some((_, form)) = after {
                    let next = form.tree.bounds();
                    bounds.low = bounds.low.lerp(next.low, *part);
                    bounds.high = bounds.high.lerp(next.high, *part);
                }
                (bounds, DAffine3::IDENTITY)
            }
        };
        std::array::from_fn(|i| {
            let pick = |bit: usize, n: usize| if i & bit == 0 { bounds.low[n] } else { bounds.high[n] };
            to_world.transform_point3(DVec3::new(pick(1, 0), pick(2, 1), pick(4, 2)))
        })
    }

    /// Lets a path go past it; its triangles in one patch are not in the way of what that patch reflects.
    pub fn cover(&self, beam: &mut Beam, but: Option<usize>) {
        match &self.way {
            Way::Rigid { form, to_world } => cover(beam, form, to_world, 1.0, but),
            Way::Bends { form } => cover(beam, form, &DAffine3::IDENTITY, 1.0, but),
            Way::Changes { before, after, part } => {
                cover(beam, &before.1, &DAffine3::IDENTITY, 1.0 - part, but);
                if let Some((_, form)) = after {
                    cover(beam, form, &DAffine3::IDENTITY, *part, but);
                }
            }
        }
        beam.pass(self.body.material.transmission);
    }
}

impl Way {
    fn form(&self) -> &Form {
        match self {
            Way::Rigid { form, .. } | Way::Bends { form } => form,
            Way::Changes { before, .. } => &before.1,
        }
    }
}

fn cover(beam: &mut Beam, form: &Form, to_world: &DAffine3, part: f64, but: Option<usize>) {
    if part == 0.0 {
        return;
    }
    let from_local = beam.local_map(to_world);
    form.tree.walk(
        beam,
        |beam, bounds, is_leaf| match beam.meet(&from_local, bounds) {
            Meeting::Misses => Go::Past,
            Meeting::Fine { y, z, radius } if but.is_none() && !is_leaf => {
                beam.cover_disc(y, z, radius);
                Go::Past
            }
            Meeting::Fine { .. } | Meeting::Crosses => Go::Down,
        },
        |beam, triangle| {
            if but != Some(form.patch_of(triangle)) {
                let corners = form.corners(triangle).map(|c| from_local.transform_point3(c));
                beam.cover_triangle(corners);
            }
        },
    );
    beam.fold(part);
}

/// Reads a mesh at a key, not the one before it by the rounding of its time.
fn read_at_key(body: &Body, key_s: f64, mesh: &mut Mesh) -> Result<()> {
    body.surface.mesh(key_s + 1e-7, mesh)
}

/// A transform as glam has it.
pub(in crate::space) fn affine(frame: &Transform) -> DAffine3 {
    let column = |k: usize| DVec3::new(frame[0][k], frame[1][k], frame[2][k]);
    let matrix3 = DMat3::from_cols(column(0), column(1), column(2));
    DAffine3 { matrix3, translation: column(3) }
}

fn fault(body: &Body, what: impl Into<String>) -> Error {
    Error::new(what).at(Place::Part(body.surface.name()))
}

/// Holds what a body is against what it can be.
fn check(body: &Body) -> Result<()> {
    let size = match body.shape {
        Shape::Mesh => [1.0; 3],
        Shape::Rectangle { width_m, height_m } => [width_m, height_m, 1.0],
        Shape::Box { size_m } => size_m,
    };
    if let Some(odd) = size.iter().find(|s| !(**s > 0.0 && **s <= 1e6)) {
        return Err(fault(body, format!("a side of {odd} m; sides must be above 0 and at most 1e6 m")));
    }
    let m = &body.material;
    for (name, value) in
        [("absorption", m.absorption), ("diffuse", m.diffuse), ("transmission", m.transmission)]
    {
        if !(0.0..=1.0).contains(&value) {
            return Err(fault(body, format!("{name} is {value}; it must lie from 0 to 1")));
        }
    }
    if !(1.0..=1e6).contains(&m.sharpness) {
        let found = m.sharpness;
        return Err(fault(body, format!("sharpness is {found}; it must lie from 1 to 1e6")));
    }
    Ok(())
}

/// A rectangle whose front faces −Z.
/// The mesh of a simple shape about its origin; none of one that has its own.
pub(in crate::space) fn simple(shape: Shape) -> Option<Mesh> {
    match shape {
        Shape::Mesh => None,
        Shape::Rectangle { width_m, height_m } => Some(rectangle(width_m, height_m)),
        Shape::Box { size_m } => Some(cuboid(size_m)),
    }
}

fn rectangle(width_m: f64, height_m: f64) -> Mesh {
    let (x, y) = ((0.5 * width_m) as f32, (0.5 * height_m) as f32);
    Mesh {
        positions: vec![[-x, -y, 0.0], [-x, y, 0.0], [x, y, 0.0], [x, -y, 0.0]],
        face_vertices: vec![0, 1, 2, 3],
        face_sizes: vec![4],
    }
}

fn cuboid(size_m: [f64; 3]) -> Mesh {
    let corner = |i: usize| {
        let side = |n: usize| if i >> n & 1 == 0 { -0.5 * size_m[n] } else { 0.5 * size_m[n] };
        [side(0) as f32, side(1) as f32, side(2) as f32]
    };
    Mesh {
        positions: (0..8).map(corner).collect(),
        face_vertices: vec![0, 4, 6, 2, 1, 3, 7, 5, 0, 1, 5, 4, 2, 6, 7, 3, 0, 2, 3, 1, 4, 5, 7, 6],
        face_sizes: vec![4; 6],
    }
}
