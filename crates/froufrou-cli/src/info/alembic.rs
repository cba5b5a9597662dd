//! What is in an Alembic archive: who wrote it, and its objects, when they change and how big they
//! are.

use std::path::Path;

use froufrou::Result;
use froufrou::scene::alembic::Alembic;
use froufrou::scene::animation::{Animation, KeyTimes, Mesh, ObjectKind, Topology};
use serde::Serialize;

use super::sheet::{Sheet, number, position};
use super::{Findings, Range};

#[derive(Serialize)]
pub struct AlembicFindings {
    application: Option<String>,
    date_written: Option<String>,
    alembic_version: Option<String>,
    description: Option<String>,
    frames_per_second: Option<String>,
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

/// Reads the index of an archive and the first mesh of every object, one at a time.
pub fn read(file: &Path) -> Result<AlembicFindings> {
    let archive = Alembic::open(file)?;
    let metadata = |key: &str| archive.metadata(key).filter(|value| !value.is_empty()).map(str::to_owned);
    let mut found = AlembicFindings {
        application: metadata("_ai_Application"),
        date_written: metadata("_ai_DateWritten"),
        alembic_version: metadata("_ai_AlembicVersion"),
        description: metadata("_ai_Description").or_else(|| metadata("description")),
        frames_per_second: metadata("FramesPerTimeUnit"),
        times_s: None,
        bounds_m: None,
        objects: Vec::with_capacity(archive.objects().len()),
    };
    let mut mesh = Mesh::default();
    for (index, object) in archive.objects().iter().enumerate() {
        let times_s = object.key_times.span_s().map(|(from, to)| Range { from, to });
        if let Some(times) = times_s {
            Range::widen(&mut found.times_s, times.from);
            Range::widen(&mut found.times_s, times.to);
        }
        let size = archive.mesh_size(index)?;
        if size.is_some() {
            archive.mesh(index, object.key_times.get(0).unwrap_or_default(), &mut mesh)?;
            for position in &mesh.positions {
                let position = position.map(f64::from);
                // A NaN in the file says nothing about how far it reaches.
                if position.iter().all(|c| c.is_finite()) {
                    let bounds = found.bounds_m.get_or_insert(Bounds { least: position, greatest: position });
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

impl Findings for AlembicFindings {
    const KIND: &'static str = "alembic";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
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
            .fact("kind", "Alembic archive")
            .fact_if("written by", self.application.as_ref())
            .fact_if("on", self.date_written.as_ref())
            .fact_if("library", self.alembic_version.as_ref())
            .fact_if("description", self.description.as_ref())
            .fact_if("frames a second", self.frames_per_second.as_ref())
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
        sheet
    }
}
