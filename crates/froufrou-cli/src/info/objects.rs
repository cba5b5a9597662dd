//! What is told of any animation: its objects, when they change and how big they are.

use froufrou::Result;
use froufrou::scene::animation::{Animation, KeyTimes, Mesh, ObjectKind, Topology};
use serde::Serialize;

use super::Range;
use super::sheet::{Sheet, number, position};

#[derive(Serialize)]
pub struct Objects {
    times_s: Option<Range>,
    /// The least and greatest corner of all meshes together, each at its first sample.
    bounds_m: Option<Bounds>,
    objects: Vec<ObjectFindings>,
}

#[derive(Clone, Copy, Serialize)]
struct Bounds {
    least: [f64; 3],
    greatest: [f64; 3],
}

#[derive(Serialize)]
struct ObjectFindings {
    path: String,
    object: &'static str,
    topology: Option<&'static str>,
    samples: usize,
    rate_hz: Option<f64>,
    times_s: Option<Range>,
    vertices: Option<usize>,
    faces: Option<usize>,
}

impl Objects {
    /// Reads the first mesh of every object, one at a time.
    pub fn read(animation: &dyn Animation) -> Result<Self> {
        let mut found =
            Objects { times_s: None, bounds_m: None, objects: Vec::with_capacity(animation.objects().len()) };
        let mut mesh = Mesh::default();
        for (index, object) in animation.objects().iter().enumerate() {
            let times_s = object.key_times.span_s().map(|(from, to)| Range { from, to });
            if let Some(times) = times_s {
                Range::widen(&mut found.times_s, times.from);
                Range::widen(&mut found.times_s, times.to);
            }
            let size = animation.mesh_size(index)?;
            if size.is_some() {
                animation.mesh(index, object.key_times.get(0).unwrap_or_default(), &mut mesh)?;
                for position in &mesh.positions {
                    let position = position.map(f64::from);
                    // A NaN in the file says nothing about how far it reaches.
                    if position.iter().all(|c| c.is_finite()) {
                        let bounds =
                            found.bounds_m.get_or_insert(Bounds { least: position, greatest: position });
                        for (axis, c) in position.into_iter().enumerate() {
                            bounds.least[axis] = bounds.least[axis].min(c);
                            bounds.greatest[axis] = bounds.greatest[axis].max(c);
                        }
                    }
                }
            }
            found.objects.push(ObjectFindings {
                path: object.path.clone(),
                object: match object.kind {
                    ObjectKind::Transform => "transform",
                    ObjectKind::Mesh => "mesh",
                    ObjectKind::Camera => "camera",
                    ObjectKind::Other => "other",
                },
                topology: match object.topology {
                    Topology::None => None,
                    Topology::Constant => Some("constant"),
                    Topology::Homogeneous => Some("homogeneous"),
                    Topology::Heterogeneous => Some("heterogeneous"),
                },
                samples: match &object.key_times {
                    KeyTimes::Static => 1,
                    times => times.len(),
                },
                rate_hz: object.key_times.rate_hz(),
                times_s,
                vertices: size.map(|size| size.vertices),
                faces: size.map(|size| size.faces),
            });
        }
        Ok(found)
    }

    /// Tells people of them.
    pub fn tell(&self, sheet: &mut Sheet) {
        let range = |range: &Range| format!("{} to {}", number(range.from), number(range.to));
        let extent = self.bounds_m.map(|bounds| {
            let size: [f64; 3] = std::array::from_fn(|i| bounds.greatest[i] - bounds.least[i]);
            format!(
                "{} m: from {} to {}",
                size.map(number).join(" × "),
                position(bounds.least),
                position(bounds.greatest)
            )
        });
        sheet
            .fact_if("times", self.times_s.as_ref().map(|r| format!("{} s", range(r))))
            .fact_if("extent", extent)
            .fact("objects", self.objects.len());
        let rows = self.objects.iter().map(|object| {
            // The tree is shown by how far a name stands in; scenes use the whole path.
            let depth = object.path.matches('/').count().saturating_sub(1);
            let name = object.path.rsplit('/').next().unwrap_or_default();
            let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
            vec![
                format!("{}/{name}", "  ".repeat(depth.min(40))),
                object.object.to_owned(),
                object.samples.to_string(),
                or_dash(object.rate_hz.map(number)),
                or_dash(object.times_s.as_ref().map(range)),
                or_dash(object.vertices.map(|n| n.to_string())),
                or_dash(object.faces.map(|n| n.to_string())),
                object.topology.unwrap_or("–").to_owned(),
            ]
        });
        let heads = ["object", "kind", "samples", "rate (Hz)", "times (s)", "vertices", "faces", "topology"];
        sheet.table(&heads, rows);
    }
}
