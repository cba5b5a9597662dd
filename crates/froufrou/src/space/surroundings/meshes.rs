//! Meshes and motions for tests.

use glam::{DAffine3, DVec3};

use super::Surface;
use crate::scene::animation::{Mesh, Topology, Transform};
use crate::{Error, Result};

/// An upright wall about the origin that faces +Z, in quads.
pub fn wall(width: f32, height: f32, columns: u32, rows: u32) -> Mesh {
    grid(columns, rows, |u, v| [width * (u - 0.5), height * (v - 0.5), 0.0])
}

fn grid(columns: u32, rows: u32, at: impl Fn(f32, f32) -> [f32; 3]) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            mesh.positions.push(at(column as f32 / columns as f32, row as f32 / rows as f32));
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let a = row * (columns + 1) + column;
            let b = a + columns + 1;
            mesh.face_vertices.extend([a, a + 1, b + 1, b]);
            mesh.face_sizes.push(4);
        }
    }
    mesh
}

/// A box about the origin, each side cut into triangles.
pub fn cuboid(size: [f32; 3], cuts: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            let side = grid(cuts, cuts, |u, v| {
                let mut p = [0.0; 3];
                p[axis] = 0.5 * sign * size[axis];
                p[(axis + 1) % 3] = sign * (u - 0.5) * size[(axis + 1) % 3];
                p[(axis + 2) % 3] = (v - 0.5) * size[(axis + 2) % 3];
                p
            });
            let base = mesh.positions.len() as u32;
            mesh.positions.extend(side.positions);
            for quad in side.face_vertices.chunks(4) {
                let [a, b, c, d] = [0, 1, 2, 3].map(|i| quad[i] + base);
                mesh.face_vertices.extend([a, b, c, a, c, d]);
                mesh.face_sizes.extend([3, 3]);
            }
        }
    }
    mesh
}

/// A ball about the origin in 2 × `rows`² triangles; those at its poles are degenerate.
pub fn ball(radius: f32, rows: u32) -> Mesh {
    grid(rows, rows, |u, v| {
        let (a, b) = (std::f32::consts::TAU * u, std::f32::consts::PI * v);
        // The seam is closed exactly.
        let a = if u == 1.0 { 0.0 } else { a };
        [-radius * b.sin() * a.cos(), -radius * b.cos(), radius * b.sin() * a.sin()]
    })
}

/// A mesh that is moved, bent or cut anew by functions of time.
pub struct Moved {
    pub topology: Topology,
    pub frame: Box<dyn Fn(f64) -> DAffine3 + Send + Sync>,
    pub mesh: Box<dyn Fn(f64) -> Mesh + Send + Sync>,
    /// Keys from 0 on, this far apart.
    pub step_s: f64,
}

impl Moved {
    pub fn rigid(mesh: Mesh, frame: impl Fn(f64) -> DAffine3 + Send + Sync + 'static) -> Self {
        Self {
            topology: Topology::Constant,
            frame: Box::new(frame),
            mesh: Box::new(move |_| mesh.clone()),
            step_s: 0.1,
        }
    }
}

impl Surface for Moved {
    fn topology(&self) -> Topology {
        self.topology
    }

    fn frame(&self, time_s: f64) -> Result<Transform> {
        let at = (self.frame)(time_s);
        let row =
            |n: usize| [at.matrix3.x_axis[n], at.matrix3.y_axis[n], at.matrix3.z_axis[n], at.translation[n]];
        Ok([row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]])
    }

    fn mesh(&self, time_s: f64, mesh: &mut Mesh) -> Result<()> {
        if self.topology == Topology::None {
            return Err(Error::new("it has no mesh"));
        }
        let by = (self.frame)(time_s);
        *mesh = (self.mesh)(time_s);
        for p in &mut mesh.positions {
            *p = by.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().into();
        }
        Ok(())
    }

    fn next_key_s(&self, time_s: f64) -> Option<f64> {
        if time_s < 0.0 {
            Some(0.0)
        } else {
            Some(((time_s / self.step_s + 1e-6).floor() + 1.0) * self.step_s)
        }
    }

    fn name(&self) -> String {
        "moved".to_owned()
    }
}
