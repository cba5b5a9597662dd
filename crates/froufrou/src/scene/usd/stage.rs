//! Reads a composed stage into what is needed of it.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use glam::DMat4;
use openusd::sdf::Value;
use openusd::usd::{Prim, PrimStatus, Stage};

use super::fault::{Budget, Damage};
use super::layers::Log;
use super::mesh::{Faces, Polygons};
use super::samples::{Samples, key_times, merged};
use super::skeleton::{Animation, BlendShape, Skeleton, Skin};
use super::xform::{Kind, Operation, Xform};
use super::{Facts, value};
use crate::scene::animation::{KeyTimes, ObjectInfo, ObjectKind, Topology};
use crate::{Error, Place, Result};

/// How many prims even a small file may have. References that multiply are stopped there: composing
/// a prim takes some tenths of a millisecond and 8 kB.
const SMALL_PRIMS: u64 = 8 << 10;

/// Beyond that, a prim needs so many bytes of layers.
const PRIM_BYTES: u64 = 32;

/// More levels than any scene has.
const MOST_LEVELS: usize = 1000;

/// An object, and what moves it.
#[derive(Debug)]
pub(super) struct Node {
    /// The object above, of lower index.
    pub(super) parent: Option<usize>,
    pub(super) xform: Xform,
    pub(super) polygons: Option<Box<Polygons>>,
}

/// All objects, parents before children.
#[derive(Debug)]
pub(super) struct Objects {
    pub(super) infos: Vec<ObjectInfo>,
    pub(super) nodes: Vec<Node>,
    pub(super) facts: Facts,
}

/// Reads everything that is used.
///
/// # Errors
/// What is damaged, of the wrong type or too much for the file's size.
pub(super) fn read(stage: &Stage, file: &Path, log: &Log) -> Result<Objects> {
    let facts = facts(stage, file)?;
    let objects = Objects { infos: Vec::new(), nodes: Vec::new(), facts };
    let mut reader = Reader {
        stage,
        file,
        log,
        budget: Budget::of(0),
        objects,
        own_times: Vec::new(),
        skeletons: HashMap::new(),
        by_path: HashMap::new(),
        skinned: Vec::new(),
    };
    reader.walk()?;
    reader.bind()?;
    reader.time()?;
    Ok(reader.objects)
}

/// What holds for the whole stage.
fn facts(stage: &Stage, file: &Path) -> Result<Facts> {
    let metadata = |name: &str| -> Result<Option<Value>> {
        stage.stage_metadata(name).map_err(|fault| {
            let help = super::fault::DAMAGED;
            Error::new(format!("{fault:#}")).in_file(file).at(Place::Part(name.to_owned())).help(help)
        })
    };
    let number = |name: &str| -> Result<Option<f64>> {
        let Some(found) = metadata(name)? else { return Ok(None) };
        let number = value::numbers(found).and_then(|list| list.first().copied());
        match number {
            Some(number) if number.is_finite() && number > 0.0 => Ok(Some(number)),
            _ => Err(Error::new(format!("{name} is no number above 0"))
                .in_file(file)
                .at(Place::Part(name.to_owned()))
                .help("write how it is meant, such as 24 or 1")),
        }
    };
    let z_up = match metadata("upAxis")?.and_then(value::token).as_deref() {
        None | Some("Y") => false,
        Some("Z") => true,
        Some(other) => {
            return Err(Error::new(format!("up is `{other}`"))
                .in_file(file)
                .at(Place::Part("upAxis".into()))
                .help("it is Y or Z"));
        }
    };
    let metres_per_unit = number("metersPerUnit")?;
    let codes_per_second = match number("timeCodesPerSecond")? {
        Some(rate) => Some(rate),
        None => number("framesPerSecond")?,
    };
    Ok(Facts {
        z_up,
        // Without a word USD means centimetres, and 24 time codes a second.
        metres_per_unit: metres_per_unit.unwrap_or(0.01),
        unit_is_written: metres_per_unit.is_some(),
        codes_per_second: codes_per_second.unwrap_or(24.0),
        frames_per_second: number("framesPerSecond")?,
        comment: metadata("documentation")?.and_then(value::token).filter(|text| !text.is_empty()),
    })
}

struct Reader<'a> {
    stage: &'a Stage,
    file: &'a Path,
    log: &'a Log,
    budget: Budget,
    objects: Objects,
    /// When each object changes, whatever is above it.
    own_times: Vec<Vec<f64>>,
    skeletons: HashMap<String, Arc<Skeleton>>,
    by_path: HashMap<String, usize>,
    /// Meshes that hang on a skeleton: their object, and the skeleton's path.
    skinned: Vec<(usize, Prim, String)>,
}

impl Reader<'_> {
    fn error(&self, damage: Damage, prim: &Prim) -> Error {
        damage.in_prim(self.file, prim.path().as_str())
    }

    fn failed(&self, fault: impl std::fmt::Display, part: &str) -> Error {
        let help = super::fault::DAMAGED;
        Error::new(format!("{fault:#}")).in_file(self.file).at(Place::Part(part.to_owned())).help(help)
    }

    /// Takes memory, as far as the layers that are read by now cover it.
    fn charge(&mut self, bytes: u64) -> std::result::Result<(), Damage> {
        self.budget.widen(self.log.bytes());
        self.budget.charge(bytes)
    }

    /// Takes in every prim that is there: defined, active and no mere class.
    fn walk(&mut self) -> Result<()> {
        let root = self.stage.prim(openusd::sdf::Path::abs_root());
        let mut open = vec![(root, None, 0)];
        let mut prims = 0;
        while let Some((prim, parent, level)) = open.pop() {
            prims += 1;
            let most = SMALL_PRIMS + self.log.bytes() / PRIM_BYTES;
            if prims > most {
                let what = format!("the stage has more than {most} prims, too much for the file's size");
                return Err(self.error(Damage::plain(what), &prim));
            }
            let mut parent = parent;
            if level > MOST_LEVELS {
                let damage = Damage::plain(format!("more than {MOST_LEVELS} levels of prims"));
                return Err(self.error(damage, &prim));
            }
            if level > 0 {
                let status = self.stage.prim_status(prim.path().clone());
                let status = status.map_err(|fault| self.failed(fault, prim.path().as_str()))?;
                let needed = PrimStatus::ACTIVE | PrimStatus::LOADED | PrimStatus::DEFINED;
                if !status.contains(needed) || status.contains(PrimStatus::ABSTRACT) {
                    continue;
                }
                parent = self.object(&prim, parent)?.or(parent);
            }
            let children = prim.children().map_err(|fault| self.failed(fault, prim.path().as_str()))?;
            open.extend(children.into_iter().rev().map(|child| (child, parent, level + 1)));
        }
        Ok(())
    }

    /// Takes in a prim, if it can be moved at all.
    fn object(&mut self, prim: &Prim, parent: Option<usize>) -> Result<Option<usize>> {
        let path = prim.path().as_str().to_owned();
        let name = prim.type_name().map_err(|fault| self.failed(fault, &path))?;
        let name = name.as_ref().map_or("", |name| name.as_str()).to_owned();
        let order = self.constant(prim, "xformOpOrder", value::tokens)?;
        let kind = match name.as_str() {
            "Xform" | "SkelRoot" => ObjectKind::Transform,
            "Mesh" => ObjectKind::Mesh,
            "Camera" => ObjectKind::Camera,
            "Skeleton" | "Cube" | "Sphere" | "Cylinder" | "Cone" | "Capsule" | "Plane" | "Points"
            | "TetMesh" | "BasisCurves" | "NurbsCurves" | "HermiteCurves" | "NurbsPatch"
            | "PointInstancer" | "Volume" => ObjectKind::Other,
            light if light.ends_with("Light") => ObjectKind::Other,
            _ if order.is_some() => ObjectKind::Transform,
            _ => return Ok(None),
        };
        let xform = self.xform(prim, order.unwrap_or_default())?;
        let mut own_times = xform.times_s().to_vec();
        let mut topology = Topology::None;
        let index = self.objects.infos.len();
        let mut polygons = None;
        if kind == ObjectKind::Mesh {
            let mesh = self.polygons(prim)?;
            own_times = merged([own_times.as_slice(), &mesh.times_s()]);
            topology = mesh.topology();
            polygons = Some(Box::new(mesh));
            if let Some(skeleton) = self.inherited_target(prim, "skel:skeleton")? {
                self.skinned.push((index, prim.clone(), skeleton));
            }
        }
        self.by_path.insert(path.clone(), index);
        self.objects.infos.push(ObjectInfo { path, kind, topology, key_times: KeyTimes::Static });
        self.objects.nodes.push(Node { parent, xform, polygons });
        self.own_times.push(own_times);
        Ok(Some(index))
    }

    /// An attribute that may change, each value as `convert` has it. Blocked values are left out.
    fn samples<T: PartialEq>(
        &mut self,
        prim: &Prim,
        name: &str,
        convert: impl Fn(Value) -> Option<T>,
    ) -> Result<Option<Samples<T>>> {
        let attribute = prim.attribute(name);
        let part = attribute.path().as_str().to_owned();
        let codes = attribute.time_sample_times().map_err(|fault| self.failed(fault, &part))?;
        let samples = if codes.is_empty() {
            None
        } else {
            self.stage.time_samples(attribute.path().clone()).map_err(|fault| self.failed(fault, &part))?
        };
        let mut found: Vec<(f64, T)> = Vec::new();
        let rate = self.objects.facts.codes_per_second;
        let Some(samples) = samples else {
            let value = attribute.get::<Value>().map_err(|fault| self.failed(fault, &part))?;
            return match value {
                None | Some(Value::ValueBlock | Value::None) => Ok(None),
                Some(value) => Ok(Some(Samples::constant(self.converted(value, &part, &convert)?))),
            };
        };
        for (code, value) in samples {
            if !code.is_finite() {
                return Err(self.failed("a sample at a time that is not a number", &part));
            }
            if !matches!(value, Value::ValueBlock | Value::None) {
                found.push((code / rate, self.converted(value, &part, &convert)?));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(Samples::new(found))
    }

    fn converted<T>(&mut self, value: Value, part: &str, convert: impl Fn(Value) -> Option<T>) -> Result<T> {
        let charged = self.charge(value::bytes(&value));
        charged.map_err(|damage| damage.in_prim(self.file, part))?;
        let kind: &'static str = (&value).into();
        convert(value)
            .ok_or_else(|| self.failed(format!("the value is of no type that belongs here ({kind})"), part))
    }

    /// An attribute that does not change, or its first value.
    fn constant<T: PartialEq + Clone>(
        &mut self,
        prim: &Prim,
        name: &str,
        convert: impl Fn(Value) -> Option<T>,
    ) -> Result<Option<T>> {
        Ok(self.samples(prim, name, convert)?.map(|samples| T::clone(samples.first())))
    }

    fn xform(&mut self, prim: &Prim, order: Vec<String>) -> Result<Xform> {
        // What comes before a reset is not done.
        let reset = order.iter().rposition(|name| name == "!resetXformStack!");
        let mut operations = Vec::new();
        for name in &order[reset.map_or(0, |reset| reset + 1)..] {
            let (inverted, attribute) = match name.strip_prefix("!invert!") {
                Some(attribute) => (true, attribute),
                None => (false, name.as_str()),
            };
            let short = attribute.strip_prefix("xformOp:").and_then(|rest| rest.split(':').next());
            let Some(kind) = short.and_then(Kind::new) else {
                let what = format!("the transform has an operation `{name}`, which is not known");
                return Err(self.error(Damage::plain(what), prim));
            };
            let right = |value| value::numbers(value).filter(|list| list.len() == kind.numbers());
            let Some(numbers) = self.samples(prim, attribute, right)? else { continue };
            operations.push(Operation { kind, inverted, numbers });
        }
        let xform = Xform::new(operations, reset.is_some());
        self.charge(256 * xform.times_s().len() as u64).map_err(|damage| self.error(damage, prim))?;
        Ok(xform)
    }

    fn polygons(&mut self, prim: &Prim) -> Result<Polygons> {
        let points = self.samples(prim, "points", value::points)?;
        let indices = self.samples(prim, "faceVertexIndices", value::indices)?;
        let sizes = self.samples(prim, "faceVertexCounts", value::indices)?;
        let orientation = self.constant(prim, "orientation", value::token)?;
        let left_handed = orientation.as_deref() == Some("leftHanded");
        let times_s = merged([
            indices.as_ref().map_or(&[][..], Samples::times_s),
            sizes.as_ref().map_or(&[][..], Samples::times_s),
        ]);
        let at = |time_s| {
            let list = |samples: &Option<Samples<Vec<u32>>>| {
                samples.as_ref().map_or_else(Vec::new, |samples| Vec::clone(samples.held(time_s)))
            };
            Faces::new(list(&indices), list(&sizes), left_handed)
        };
        let faces = match times_s.as_slice() {
            [] => at(0.0).map(Samples::constant),
            times_s => times_s
                .iter()
                .map(|&time_s| Ok((time_s, at(time_s)?)))
                .collect::<std::result::Result<_, Damage>>()
                .map(|list| Samples::new(list).unwrap_or_else(|| Samples::constant(Faces::default()))),
        };
        Ok(Polygons {
            points: points.unwrap_or_else(|| Samples::constant(Vec::new())),
            faces: faces.map_err(|damage| self.error(damage, prim))?,
            skin: None,
        })
    }

    /// Where a relationship leads, of the prim or the next one above that has it.
    fn inherited_target(&self, prim: &Prim, name: &str) -> Result<Option<String>> {
        let mut path = Some(prim.path().clone());
        while let Some(at) = path {
            let targets = self.stage.prim(at.clone()).relationship(name).targets();
            let targets = targets.map_err(|fault| self.failed(fault, at.as_str()))?;
            if let Some(target) = targets.first() {
                return Ok(Some(target.as_str().to_owned()));
            }
            path = at.parent().filter(|parent| parent.as_str() != "/");
        }
        Ok(None)
    }

    /// Hangs meshes on their skeletons.
    fn bind(&mut self) -> Result<()> {
        for (object, prim, path) in std::mem::take(&mut self.skinned) {
            let Some(skeleton) = self.skeleton(&path)? else {
                let damage = Damage::plain(format!("the skeleton `{path}` is not there"));
                return Err(self.error(damage, &prim));
            };
            let skin = self.skin(&prim, skeleton)?;
            let moved = skin.times_s();
            let above = self.above(skin.skeleton.object);
            if let Some(polygons) = self.objects.nodes[object].polygons.as_deref_mut() {
                polygons.skin = Some(skin);
                self.objects.infos[object].topology = polygons.topology();
            }
            let own = &mut self.own_times[object];
            *own = merged([own.as_slice(), &moved, &above]);
        }
        Ok(())
    }

    /// When an object changes by itself or by what is above it.
    fn above(&self, object: usize) -> Vec<f64> {
        let mut lists = Vec::new();
        let mut current = Some(object);
        while let Some(index) = current {
            lists.push(self.own_times[index].as_slice());
            let node = &self.objects.nodes[index];
            current = node.parent.filter(|_| !node.xform.resets);
        }
        merged(lists)
    }

    fn skeleton(&mut self, path: &str) -> Result<Option<Arc<Skeleton>>> {
        if let Some(known) = self.skeletons.get(path) {
            return Ok(Some(Arc::clone(known)));
        }
        let Some(&object) = self.by_path.get(path) else { return Ok(None) };
        let parsed = openusd::sdf::path(path).map_err(|fault| self.failed(fault, path))?;
        let prim = self.stage.prim(parsed);
        let joints = self.constant(&prim, "joints", value::tokens)?.unwrap_or_default();
        let binding = self.constant(&prim, "bindTransforms", value::matrices)?.unwrap_or_default();
        let rest = self.constant(&prim, "restTransforms", value::matrices)?.unwrap_or_default();
        let animation = match self.inherited_target(&prim, "skel:animationSource")? {
            Some(source) => Some(self.animation(&source)?),
            None => None,
        };
        let skeleton = Skeleton::new(joints, binding, rest, animation, object);
        let skeleton = Arc::new(skeleton.map_err(|damage| self.error(damage, &prim))?);
        self.skeletons.insert(path.to_owned(), Arc::clone(&skeleton));
        Ok(Some(skeleton))
    }

    fn animation(&mut self, path: &str) -> Result<Animation> {
        let parsed = openusd::sdf::path(path).map_err(|fault| self.failed(fault, path))?;
        let prim = self.stage.prim(parsed);
        Ok(Animation {
            joints: self.constant(&prim, "joints", value::tokens)?.unwrap_or_default(),
            translations: self.samples(&prim, "translations", value::points)?,
            rotations: self.samples(&prim, "rotations", value::rotations)?,
            scales: self.samples(&prim, "scales", value::points)?,
            shapes: self.constant(&prim, "blendShapes", value::tokens)?.unwrap_or_default(),
            shape_weights: self.samples(&prim, "blendShapeWeights", value::floats)?,
        })
    }

    fn skin(&mut self, prim: &Prim, skeleton: Arc<Skeleton>) -> Result<Skin> {
        let indices = self.constant(prim, "primvars:skel:jointIndices", value::indices)?.unwrap_or_default();
        let weights = self.constant(prim, "primvars:skel:jointWeights", value::floats)?.unwrap_or_default();
        let bind = self.constant(prim, "primvars:skel:geomBindTransform", value::matrix)?;
        let attribute = prim.attribute("primvars:skel:jointIndices");
        let part = attribute.path().as_str().to_owned();
        let metadata =
            |name: &str| attribute.get_metadata::<Value>(name).map_err(|fault| self.failed(fault, &part));
        let per_point =
            metadata("elementSize")?.and_then(value::numbers).and_then(|list| list.first().copied());
        let rigid = metadata("interpolation")?.and_then(value::token).as_deref() == Some("constant");
        let per_point = per_point.filter(|&size| (1.0..=1e6).contains(&size)).map_or(1, |size| size as usize);
        let mut joints = Vec::new();
        for joint in self.constant(prim, "skel:joints", value::tokens)?.unwrap_or_default() {
            let known = skeleton.joints.iter().position(|known| *known == joint);
            let damage = || Damage::plain(format!("the skeleton has no joint `{joint}`"));
            joints.push(known.ok_or_else(damage).map_err(|damage| self.error(damage, prim))?);
        }
        let shapes = self.shapes(prim, &skeleton)?;
        Ok(Skin {
            skeleton,
            joints,
            indices,
            weights,
            per_point,
            rigid,
            bind: bind.unwrap_or(DMat4::IDENTITY),
            shapes,
        })
    }

    fn shapes(&mut self, prim: &Prim, skeleton: &Skeleton) -> Result<Vec<BlendShape>> {
        let names = self.constant(prim, "skel:blendShapes", value::tokens)?.unwrap_or_default();
        let targets = prim.relationship("skel:blendShapeTargets").targets();
        let targets = targets.map_err(|fault| self.failed(fault, prim.path().as_str()))?;
        let mut shapes = Vec::new();
        for (name, target) in names.iter().zip(targets) {
            let Some(weight) = skeleton.shape(name) else { continue };
            let shape = self.stage.prim(target);
            let mut steps = Vec::new();
            let properties =
                shape.property_names().map_err(|fault| self.failed(fault, shape.path().as_str()))?;
            for property in properties {
                let Some(between) = property.as_str().strip_prefix("inbetweens:") else { continue };
                // Normals have a name of three parts.
                if between.contains(':') {
                    continue;
                }
                let at = shape.attribute(property.as_str()).get_metadata::<Value>("weight");
                let at = at.map_err(|fault| self.failed(fault, shape.path().as_str()))?;
                let at = at.and_then(value::numbers).and_then(|list| list.first().copied());
                let offsets = self.constant(&shape, property.as_str(), value::points)?;
                if let (Some(at), Some(offsets)) = (at.filter(|at| at.is_finite()), offsets) {
                    steps.push((at, offsets));
                }
            }
            let whole = self.constant(&shape, "offsets", value::points)?.unwrap_or_default();
            let points = self.constant(&shape, "pointIndices", value::indices)?.unwrap_or_default();
            // The shapes at 0 and 1 are the mesh itself and the whole.
            steps.retain(|(at, _)| *at > 0.0 && *at != 1.0);
            steps.push((1.0, whole));
            steps.sort_by(|a, b| a.0.total_cmp(&b.0));
            steps.dedup_by(|a, b| a.0 == b.0);
            shapes.push(BlendShape { weight, points, steps });
        }
        Ok(shapes)
    }

    /// Tells every object when it changes, by what is above it too.
    fn time(&mut self) -> Result<()> {
        let mut whole: Vec<Arc<[f64]>> = Vec::with_capacity(self.objects.nodes.len());
        for (index, own) in std::mem::take(&mut self.own_times).into_iter().enumerate() {
            let node = &self.objects.nodes[index];
            let above = node.parent.filter(|_| !node.xform.resets).map(|parent| Arc::clone(&whole[parent]));
            let above = above.unwrap_or_else(|| Arc::from([]));
            let times_s: Arc<[f64]> = if own.is_empty() || own[..] == above[..] {
                above
            } else {
                let merged = merged([&own[..], &above[..]]);
                let charged = self.charge(16 * merged.len() as u64);
                charged.map_err(|damage| damage.in_prim(self.file, &self.objects.infos[index].path))?;
                merged.into()
            };
            self.objects.infos[index].key_times = key_times(&times_s);
            whole.push(times_s);
        }
        Ok(())
    }
}
