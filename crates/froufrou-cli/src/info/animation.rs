//! What is in an animation of any format: its objects, when they change, how big they are and how far
//! they reach; and a few facts that only its own format knows.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use froufrou::Result;
use froufrou::scene::alembic::Alembic;
use froufrou::scene::animation::{Animation, KeyTimes, Mesh, ObjectInfo, ObjectKind, Topology};
use froufrou::scene::conventions::{Conventions, DEFAULT_FRAME_RATE_HZ};
use froufrou::scene::format::AnimationFormat;
use froufrou::scene::gltf::Gltf;
use froufrou::scene::obj::Obj;
use froufrou::scene::point_cache::PointCache;
use froufrou::scene::world::open_animation;
use serde::Serialize;

use super::sheet::{Sheet, number, position};
use super::{Findings, Range};
use super::{alembic, gltf};

/// What only one format knows, by a name that serves people, with spaces, and programs, without.
pub type Facts = BTreeMap<&'static str, String>;

#[derive(Serialize)]
pub struct AnimationFindings {
    format: &'static str,
    facts: Facts,
    times_s: Option<Range>,
    /// The least and greatest corner of all meshes together, over all their samples.
    bounds_m: Option<Bounds>,
    objects: Vec<ObjectFindings>,
}

#[derive(Clone, Copy, Serialize)]
struct Bounds {
    least: [f64; 3],
    greatest: [f64; 3],
}

impl Bounds {
    /// Makes bounds wide enough for all vertices of a mesh.
    fn widen(bounds: &mut Option<Self>, mesh: &Mesh) {
        for position in &mesh.positions {
            let position = position.map(f64::from);
            // A NaN in the file says nothing about how far it reaches.
            if position.iter().all(|c| c.is_finite()) {
                let bounds = bounds.get_or_insert(Self { least: position, greatest: position });
                for (axis, c) in position.into_iter().enumerate() {
                    bounds.least[axis] = bounds.least[axis].min(c);
                    bounds.greatest[axis] = bounds.greatest[axis].max(c);
                }
            }
        }
    }
}

#[derive(Serialize)]
struct ObjectFindings {
    path: String,
    object: &'static str,
    topology: Option<&'static str>,
    /// How often the faces or the number of vertices are others than a sample before.
    topology_changes: usize,
    samples: usize,
    rate_hz: Option<f64>,
    times_s: Option<Range>,
    /// At the first sample.
    vertices: Option<usize>,
    faces: Option<usize>,
    /// The most at any sample.
    most_vertices: Option<usize>,
    most_faces: Option<usize>,
}

/// Reads every mesh of an animation at every sample, one at a time.
pub fn read(file: &Path, format: AnimationFormat) -> Result<AnimationFindings> {
    let (animation, facts) = open(file, format)?;
    let mut found = AnimationFindings {
        format: format.name(),
        facts,
        times_s: None,
        bounds_m: None,
        objects: Vec::with_capacity(animation.objects().len()),
    };
    for (index, object) in animation.objects().iter().enumerate() {
        let times_s = object.key_times.span_s().map(|(from, to)| Range { from, to });
        if let Some(times) = times_s {
            Range::widen(&mut found.times_s, times.from);
            Range::widen(&mut found.times_s, times.to);
        }
        let mesh = (object.kind == ObjectKind::Mesh)
            .then(|| meshes(animation.as_ref(), index, object, &mut found.bounds_m))
            .transpose()?;
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
            topology_changes: mesh.as_ref().map_or(0, |mesh| mesh.changes),
            samples: match &object.key_times {
                KeyTimes::Static => 1,
                times => times.len(),
            },
            rate_hz: object.key_times.rate_hz(),
            times_s,
            vertices: mesh.as_ref().map(|mesh| mesh.vertices.0),
            faces: mesh.as_ref().map(|mesh| mesh.faces.0),
            most_vertices: mesh.as_ref().map(|mesh| mesh.vertices.1),
            most_faces: mesh.as_ref().map(|mesh| mesh.faces.1),
        });
    }
    Ok(found)
}

/// Opens an animation, with what is particular to its format.
fn open(file: &Path, format: AnimationFormat) -> Result<(Arc<dyn Animation>, Facts)> {
    let mut facts = Facts::new();
    let assumed = || format!("{DEFAULT_FRAME_RATE_HZ}, unless the scene says otherwise");
    let animation: Arc<dyn Animation> = match format {
        AnimationFormat::Alembic => {
            let archive = Alembic::open(file)?;
            facts = alembic::facts(&archive);
            Arc::new(archive)
        }
        AnimationFormat::Gltf => {
            let file = Gltf::open(file)?;
            facts = gltf::facts(&file);
            Arc::new(file)
        }
        #[cfg(feature = "usd")]
        AnimationFormat::Usd => {
            let file = froufrou::scene::usd::Usd::open(file)?;
            facts = super::usd::facts(&file);
            Arc::new(file)
        }
        #[cfg(not(feature = "usd"))]
        AnimationFormat::Usd => open_animation(file)?,
        AnimationFormat::Pc2 | AnimationFormat::Mdd => {
            let cache = PointCache::open(file, &Conventions::default())?;
            let faces = cache.faces_file().map(|faces| faces.display().to_string());
            facts.insert("faces from", faces.unwrap_or_else(|| "no file: there are none".to_owned()));
            if format == AnimationFormat::Pc2 {
                facts.insert("frames a second", assumed());
            }
            Arc::new(cache)
        }
        AnimationFormat::ObjSequence => {
            let sequence = Obj::open_sequence(file, &Conventions::default())?;
            let files = sequence.files();
            facts.insert("files", files.len().to_string());
            for (label, file) in [("first file", files.first()), ("last file", files.last())] {
                let name = file.and_then(|file| file.file_name()).unwrap_or_default();
                facts.insert(label, name.to_string_lossy().into_owned());
            }
            facts.insert("frames a second", assumed());
            Arc::new(sequence)
        }
        AnimationFormat::Obj | AnimationFormat::PoseLog => open_animation(file)?,
    };
    Ok((animation, facts))
}

/// What the meshes of one object are like over time.
struct Meshes {
    /// At the first sample, and the most at any.
    vertices: (usize, usize),
    faces: (usize, usize),
    changes: usize,
}

fn meshes(
    animation: &dyn Animation,
    index: usize,
    object: &ObjectInfo,
    bounds: &mut Option<Bounds>,
) -> Result<Meshes> {
    let (mut mesh, mut before) = (Mesh::default(), Mesh::default());
    let mut found = Meshes { vertices: (0, 0), faces: (0, 0), changes: 0 };
    for sample in 0..object.key_times.len().max(1) {
        let time_s = object.key_times.get(sample).unwrap_or_default();
        animation.mesh(index, time_s, &mut mesh)?;
        Bounds::widen(bounds, &mesh);
        let (vertices, faces) = (mesh.positions.len(), mesh.face_sizes.len());
        if sample == 0 {
            (found.vertices.0, found.faces.0) = (vertices, faces);
        } else if object.topology == Topology::Heterogeneous {
            let same = before.positions.len() == vertices
                && before.face_sizes == mesh.face_sizes
                && before.face_vertices == mesh.face_vertices;
            found.changes += usize::from(!same);
        }
        found.vertices.1 = found.vertices.1.max(vertices);
        found.faces.1 = found.faces.1.max(faces);
        std::mem::swap(&mut mesh, &mut before);
    }
    Ok(found)
}

impl Findings for AnimationFindings {
    const KIND: &'static str = "animation";

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
        sheet.fact("kind", self.format);
        for (label, value) in &self.facts {
            sheet.fact(label, value);
        }
        sheet
            .fact_if("times", self.times_s.as_ref().map(|r| format!("{} s", range(r))))
            .fact_if("length", self.times_s.map(|r| format!("{} s", number(r.to - r.from))))
            .fact_if("extent", extent)
            .fact("objects", self.objects.len());
        let rows = self.objects.iter().map(|object| {
            // The tree is shown by how far a name stands in; scenes use the whole path.
            let depth = object.path.matches('/').count().saturating_sub(1);
            let name = object.path.rsplit('/').next().unwrap_or_default();
            let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
            let up_to = |first: Option<usize>, most: Option<usize>| match (first, most) {
                (Some(first), Some(most)) if first != most => format!("{first}, at most {most}"),
                _ => or_dash(first.map(|n| n.to_string())),
            };
            let topology = object.topology.unwrap_or("–");
            vec![
                format!("{}/{name}", "  ".repeat(depth.min(40))),
                object.object.to_owned(),
                object.samples.to_string(),
                or_dash(object.rate_hz.map(number)),
                or_dash(object.times_s.as_ref().map(range)),
                up_to(object.vertices, object.most_vertices),
                up_to(object.faces, object.most_faces),
                match (object.topology_changes, object.topology) {
                    (0, Some("heterogeneous")) => "heterogeneous, never changes".to_owned(),
                    (0, _) => topology.to_owned(),
                    (1, _) => format!("{topology}, changes once"),
                    (n, _) => format!("{topology}, changes {n} times"),
                },
            ]
        });
        let heads = ["object", "kind", "samples", "rate (Hz)", "times (s)", "vertices", "faces", "topology"];
        sheet.table(&heads, rows);
        sheet
    }
}
