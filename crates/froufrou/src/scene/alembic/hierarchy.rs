//! The tree of objects: walked once at opening, and unfolded where objects are instances of others.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::archive::{Archive, Metadata};
use super::camera::Camera;
use super::fault::{Allowance, Fault, Outcome};
use super::ogawa::{Child, Group};
use super::polymesh::PolyMesh;
use super::time_sampling::union;
use super::xform::Xform;
use crate::scene::animation::{KeyTimes, MeshSize, ObjectInfo, ObjectKind, Topology};
use crate::scene::sample_cache::Ledger;
use crate::{Error, Result};

/// More levels than any scene has. Objects that contain themselves, by a damaged position or by
/// their instances, end here.
const MOST_LEVELS: u32 = 1000;

/// Instances that lead to instances, one after another.
const MOST_LINKS: usize = 64;

/// What an object is, with its properties; instances share it.
#[derive(Debug, Clone)]
pub(super) enum Schema {
    Xform(Arc<Xform>),
    Mesh(Arc<PolyMesh>),
    Camera(Arc<Camera>),
    Other,
}

/// An object as others see it.
#[derive(Debug)]
pub(super) struct Node {
    /// The object above, of lower index.
    pub(super) parent: Option<usize>,
    pub(super) schema: Schema,
    /// Vertices and faces of the first sample.
    pub(super) first_size: Option<MeshSize>,
}

/// All objects, parents before children, and what is known of each.
pub(super) struct Hierarchy {
    pub(super) objects: Vec<ObjectInfo>,
    pub(super) nodes: Vec<Node>,
}

/// An object as it is written.
struct Written {
    name: String,
    parent: usize,
    children: Vec<usize>,
    schema: Schema,
    first_size: Option<MeshSize>,
    own_times: KeyTimes,
    /// The path of the object this is an instance of.
    source: Option<String>,
}

/// Index of the object that holds all others and is none itself.
const TOP: usize = 0;

/// Reads the tree of an archive.
///
/// # Errors
/// Damage; objects that contain themselves; instances of what is not there.
pub(super) fn read(
    path: &Path,
    archive: &Archive,
    ledger: &Arc<Ledger>,
    reading: &mut Allowance,
    memory: &mut Allowance,
) -> Result<Hierarchy> {
    let written = Tree::walk(path, archive, ledger, reading, memory)?;
    written.unfold(path, memory)
}

/// All objects as they are written.
struct Tree(Vec<Written>);

impl Tree {
    fn walk(
        file: &Path,
        archive: &Archive,
        ledger: &Arc<Ledger>,
        reading: &mut Allowance,
        memory: &mut Allowance,
    ) -> Result<Self> {
        let top = Written {
            name: String::new(),
            parent: TOP,
            children: Vec::new(),
            schema: Schema::Other,
            first_size: None,
            own_times: KeyTimes::Static,
            source: None,
        };
        let mut tree = Tree(vec![top]);
        // A list instead of recursion: a damaged file must not exhaust the stack.
        let mut open = vec![(TOP, archive.top, 0)];
        while let Some((parent, group, level)) = open.pop() {
            let in_parent = |fault: Fault, tree: &Tree| fault.in_object(file, &tree.path(parent));
            if level > MOST_LEVELS {
                return Err(in_parent(too_deep(group), &tree));
            }
            let (children, headers) =
                archive.object(group, reading).map_err(|fault| in_parent(fault, &tree))?;
            // The first child is the object's properties.
            for (header, child) in headers.into_iter().zip(children.into_iter().skip(1)) {
                let index = tree.0.len();
                tree.0.push(Written {
                    name: header.name,
                    parent,
                    children: Vec::new(),
                    schema: Schema::Other,
                    first_size: None,
                    own_times: KeyTimes::Static,
                    source: None,
                });
                tree.0[parent].children.push(index);
                let mut load = || -> Outcome<()> {
                    memory.charge((size_of::<Written>() + tree.0[index].name.len()) as u64)?;
                    let Child::Group(position) = child else {
                        return Err(Fault::damage(group.position, "an object should be a group"));
                    };
                    let own = archive.ogawa.group(position)?;
                    tree.0[index].load(own, &header.metadata, archive, ledger, reading, memory)?;
                    open.push((index, own, level + 1));
                    Ok(())
                };
                load().map_err(|fault| fault.in_object(file, &tree.path(index)))?;
            }
        }
        Ok(tree)
    }

    /// The path of an object as it is written.
    fn path(&self, object: usize) -> String {
        if object == TOP {
            return "/".into();
        }
        let mut names = Vec::new();
        let mut index = object;
        while index != TOP {
            names.push(self.0[index].name.as_str());
            index = self.0[index].parent;
        }
        names.iter().rev().fold(String::new(), |path, name| path + "/" + *name)
    }

    /// Gives every instance the objects it stands for.
    fn unfold(&self, file: &Path, memory: &mut Allowance) -> Result<Hierarchy> {
        let targets = self.targets(file)?;
        let mut hierarchy = Hierarchy { objects: Vec::new(), nodes: Vec::new() };
        // Last in, first out: children are pushed in reverse, so that the order is the file's.
        let push_children = |open: &mut Vec<_>, of: usize, parent: Option<usize>, level: u32| {
            open.extend(self.0[of].children.iter().rev().map(|&child| (child, parent, level)));
        };
        let mut open = Vec::new();
        push_children(&mut open, TOP, None, 1);
        while let Some((written, parent, level)) = open.pop() {
            let index = hierarchy.objects.len();
            let above = parent.map_or("", |parent: usize| hierarchy.objects[parent].path.as_str());
            let path = format!("{above}/{}", self.0[written].name);
            // What it is, is written at the object it stands for, if it is an instance.
            let target = targets.get(&written).copied().unwrap_or(written);
            let Written { schema, first_size, own_times, .. } = &self.0[target];
            let mut info = || -> Outcome<ObjectInfo> {
                if level > MOST_LEVELS {
                    return Err(too_deep(Group { position: 0, children: 0 }));
                }
                memory.charge((size_of::<ObjectInfo>() + size_of::<Node>() + path.len()) as u64)?;
                let above = parent.map_or(&KeyTimes::Static, |parent| &hierarchy.objects[parent].key_times);
                Ok(ObjectInfo {
                    path: path.clone(),
                    kind: match schema {
                        Schema::Xform(_) => ObjectKind::Transform,
                        Schema::Mesh(_) => ObjectKind::Mesh,
                        Schema::Camera(_) => ObjectKind::Camera,
                        Schema::Other => ObjectKind::Other,
                    },
                    topology: if let Schema::Mesh(mesh) = schema { mesh.topology() } else { Topology::None },
                    key_times: union(own_times, above, memory)?,
                })
            };
            let info = info().map_err(|fault| fault.in_object(file, &path))?;
            hierarchy.objects.push(info);
            hierarchy.nodes.push(Node { parent, schema: schema.clone(), first_size: *first_size });
            push_children(&mut open, target, Some(index), level + 1);
        }
        Ok(hierarchy)
    }

    /// Which object each instance stands for.
    fn targets(&self, file: &Path) -> Result<HashMap<usize, usize>> {
        if self.0.iter().all(|object| object.source.is_none()) {
            return Ok(HashMap::new());
        }
        let by_name: HashMap<(usize, &str), usize> = (self.0.iter().enumerate().skip(1))
            .map(|(index, object)| ((object.parent, object.name.as_str()), index))
            .collect();
        let find = |source: &str| {
            // A path may lead through further instances.
            let mut rest: Vec<&str> = source.split('/').filter(|name| !name.is_empty()).rev().collect();
            let (mut found, mut links) = (TOP, 0);
            loop {
                if let Some(onward) = &self.0[found].source {
                    links += 1;
                    if links > MOST_LINKS || rest.len() > MOST_LEVELS as usize {
                        return None;
                    }
                    rest.extend(onward.split('/').filter(|name| !name.is_empty()).rev());
                    found = TOP;
                }
                let Some(name) = rest.pop() else { return (found != TOP).then_some(found) };
                found = *by_name.get(&(found, name))?;
            }
        };
        let mut targets = HashMap::new();
        for (index, object) in self.0.iter().enumerate() {
            let Some(source) = &object.source else { continue };
            let missing = || -> Error {
                Fault::new(
                    format!("the object is an instance of `{source}`, which cannot be found"),
                    "export the file again, with the original or without instances",
                )
                .in_object(file, &self.path(index))
            };
            targets.insert(index, find(source).ok_or_else(missing)?);
        }
        Ok(targets)
    }
}

impl Written {
    /// Reads the index of an object's properties.
    fn load(
        &mut self,
        group: Group,
        metadata: &Metadata,
        archive: &Archive,
        ledger: &Arc<Ledger>,
        reading: &mut Allowance,
        memory: &mut Allowance,
    ) -> Outcome<()> {
        let kind = metadata.get("schema").unwrap_or_default();
        let is_instance = metadata.get("isInstance") == Some("1");
        let known = matches!(
            kind,
            "AbcGeom_Xform_v3" | "AbcGeom_PolyMesh_v1" | "AbcGeom_SubD_v1" | "AbcGeom_Camera_v1"
        );
        if group.children == 0 || !(known || is_instance) {
            return Ok(());
        }
        let Child::Group(position) = archive.ogawa.child(group, 0)? else { return Ok(()) };
        let properties = archive.compound(position, reading)?;
        if is_instance {
            self.source = match properties.property(".instanceSource", archive)? {
                Some(property) if !property.is_empty() => {
                    let bytes = property.bytes(0, &archive.ogawa)?;
                    memory.charge(bytes.len() as u64)?;
                    let name = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
                    Some(String::from_utf8_lossy(name).into_owned())
                }
                _ => Some(String::new()),
            };
            return Ok(());
        }
        // The title names the compound: `AbcGeom_Xform_v3:.xform`.
        let usual = if kind == "AbcGeom_Xform_v3" { ".xform" } else { ".geom" };
        let titled = metadata.get("schemaObjTitle").and_then(|title| title.split_once(':'));
        let name = titled.map_or(usual, |(_, name)| name);
        let Some(compound) = properties.compound(name, archive, reading)? else { return Ok(()) };
        match kind {
            "AbcGeom_Xform_v3" => {
                let xform = Xform::new(&compound, archive, ledger, memory)?;
                self.own_times = xform.key_times(memory)?;
                memory.charge(size_of::<Xform>() as u64)?;
                self.schema = Schema::Xform(Arc::new(xform));
            }
            "AbcGeom_Camera_v1" => {
                let camera = Camera::new(&compound, archive)?;
                self.own_times = camera.key_times(memory)?;
                self.schema = Schema::Camera(Arc::new(camera));
            }
            _ => {
                let arbitrary = compound.compound(".arbGeomParams", archive, reading)?;
                let mesh = PolyMesh::new(&compound, arbitrary, archive, ledger)?;
                self.own_times = mesh.key_times(memory)?;
                self.first_size = Some(mesh.first_size(&archive.ogawa)?);
                memory.charge(size_of::<PolyMesh>() as u64)?;
                self.schema = Schema::Mesh(Arc::new(mesh));
            }
        }
        Ok(())
    }
}

fn too_deep(group: Group) -> Fault {
    let fault = Fault::new(
        format!("the objects are nested more than {MOST_LEVELS} levels deep; one of them contains itself"),
        "the file is damaged, or an instance lies below its own original: export it again without instances",
    );
    if group.position == 0 { fault } else { fault.at(group.position) }
}
