//! How hard the vertices of objects press against what they touch in the frame to come, where a simulation says it.

use super::triangulation::Triangulation;
use crate::scene::animation::Mesh;
use crate::{Error, Place, Result};

/// The forces of some objects, vertex by vertex, in newtons.
#[derive(Debug, Clone, Default)]
pub(in crate::motion) struct Pressing(Vec<(u32, Vec<f64>)>);

impl Pressing {
    /// Takes those of an object; of one that was taken before the later ones hold.
    ///
    /// # Errors
    /// A force that is negative or no number.
    pub fn say(&mut self, object: u32, name: &str, force_n: &[f32]) -> Result<()> {
        if let Some(vertex) = force_n.iter().position(|force| !(force.is_finite() && *force >= 0.0)) {
            let force = force_n[vertex];
            return Err(Error::new(format!("vertex {vertex} presses with {force} N: expected 0 or more"))
                .at(Place::Part(name.to_owned())));
        }
        self.0.retain(|(other, _)| *other != object);
        self.0.push((object, force_n.iter().map(|force| f64::from(*force)).collect()));
        Ok(())
    }

    /// Whether each vertex of the meshes of a frame has its force.
    ///
    /// # Errors
    /// Another number of forces than of vertices.
    pub fn check(&self, time_s: f64, meshes: &[Mesh], name: impl Fn(u32) -> String) -> Result<()> {
        for (object, force_n) in &self.0 {
            let (forces, vertices) = (force_n.len(), meshes[*object as usize].positions.len());
            if forces != vertices {
                return Err(Error::new(format!("{forces} forces, and {vertices} vertices, at {time_s} s"))
                    .at(Place::Part(name(*object)))
                    .help("a force is needed for each vertex"));
            }
        }
        Ok(())
    }

    /// The forces of an object's vertices, where they are known: what lies in one place presses as one.
    pub fn of(&self, object: u32, surface: &Triangulation) -> Option<Vec<f64>> {
        let (_, force_n) = self.0.iter().find(|(other, _)| *other == object)?;
        let mut pressing_n = vec![0.0; force_n.len()];
        for (vertex, force_n) in force_n.iter().enumerate() {
            let stands = surface.welded(vertex as u32).unwrap_or(vertex as u32);
            pressing_n[stands as usize] += force_n;
        }
        Some(pressing_n)
    }
}
