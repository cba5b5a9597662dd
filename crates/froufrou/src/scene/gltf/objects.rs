//! The objects of a scene: their paths, what they are and when they move.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::document::{Document, Node};
use super::fault::{Budget, damage};
use super::node::Nodes;
use super::shape::Shape;
use super::skin::Skin;
use super::track::nearly;
use crate::Result;
use crate::scene::animation::{KeyTimes, ObjectInfo, ObjectKind, Topology};

/// What an object is made of, by numbers of the document.
#[derive(Debug)]
pub(super) struct Object {
    pub(super) node: usize,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    /// The weights of morph targets that are written at the node.
    pub(super) weights: Option<Vec<f32>>,
}

/// The objects of the scene, parents before children, and what others see of them.
///
/// # Errors
/// What is named but not there; more than the budget allows.
pub(super) fn read(
    document: &mut Document,
    nodes: &Nodes,
    shapes: &[Shape],
    skins: &[Skin],
    budget: &mut Budget,
) -> Result<(Vec<Object>, Vec<ObjectInfo>)> {
    let moving = Moving::new(nodes, skins, budget)?;
    let roots = roots(document, nodes)?;
    let (mut objects, mut infos): (Vec<Object>, Vec<ObjectInfo>) = (Vec::new(), Vec::new());
    // Last in, first out: siblings are pushed in reverse, so that the order is the file's.
    let mut open = Vec::new();
    let push = |open: &mut Vec<_>, siblings: &[usize], parent: Option<usize>, written: &[Node]| {
        let names = names(siblings, written);
        open.extend(siblings.iter().zip(names).rev().map(|(&node, name)| (node, name, parent)));
    };
    push(&mut open, &roots, None, &document.nodes);
    while let Some((node, name, parent)) = open.pop() {
        let index = objects.len();
        let part = || format!("nodes[{node}]");
        let path = format!("{}/{name}", parent.map_or("", |parent: usize| infos[parent].path.as_str()));
        budget.charge((size_of::<Object>() + size_of::<ObjectInfo>() + path.len()) as u64, part)?;
        let written = &mut document.nodes[node];
        let there = |number: Option<usize>, count: usize, what: &str| match number {
            Some(number) if number >= count => {
                Err(damage(part(), format!("there is no {what} {number}; there are {count}")))
            }
            _ => Ok(number),
        };
        let mesh = there(written.mesh, shapes.len(), "mesh")?;
        let skin = there(written.skin, skins.len(), "skin")?.filter(|_| mesh.is_some());
        let weights = nodes.all[node].weights.as_ref().filter(|_| mesh.is_some());
        let weights = weights.map(|track| &track.times_s).filter(|times| times.len() > 1);
        let joints = skin.and_then(|skin| moving.skins[skin].as_ref());
        let times = union(moving.nodes[node].iter().chain(weights).chain(joints), budget, &part)?;
        infos.push(ObjectInfo {
            kind: match (mesh, written.camera) {
                (Some(_), _) => ObjectKind::Mesh,
                (None, Some(_)) => ObjectKind::Camera,
                (None, None) => ObjectKind::Transform,
            },
            topology: match mesh {
                None => Topology::None,
                Some(_) if weights.is_some() || joints.is_some() => Topology::Homogeneous,
                Some(_) => Topology::Constant,
            },
            key_times: key_times(times),
            path,
        });
        objects.push(Object { node, mesh, skin, weights: written.weights.take() });
        let children = std::mem::take(&mut written.children);
        push(&mut open, &children, Some(index), &document.nodes);
    }
    Ok((objects, infos))
}

/// The nodes at the top of the scene that the file opens with.
fn roots(document: &Document, nodes: &Nodes) -> Result<Vec<usize>> {
    let number = document.scene.unwrap_or(0);
    let Some(scene) = document.scenes.get(number) else {
        if document.scene.is_some() {
            let count = document.scenes.len();
            return Err(damage("scene", format!("there is no scene {number}; there are {count}")));
        }
        return Ok((0..nodes.all.len()).filter(|&node| nodes.all[node].parent.is_none()).collect());
    };
    let part = || format!("scenes[{number}]");
    let mut seen = HashSet::new();
    for &node in &scene.nodes {
        match nodes.all.get(node) {
            None => {
                let what = format!("there is no node {node}; there are {}", nodes.all.len());
                return Err(damage(part(), what));
            }
            Some(super::node::Node { parent: Some(parent), .. }) => {
                return Err(damage(part(), format!("node {node} is no root, it stands under node {parent}")));
            }
            Some(_) if !seen.insert(node) => {
                return Err(damage(part(), format!("node {node} stands in the scene twice")));
            }
            Some(_) => {}
        }
    }
    Ok(scene.nodes.clone())
}

/// Names for siblings, each unlike all others.
fn names(siblings: &[usize], written: &[Node]) -> Vec<String> {
    let plain = |&node: &usize| match written.get(node).and_then(|node| node.name.as_deref()) {
        // A slash would look like a level of its own.
        Some(name) if !name.is_empty() => name.replace('/', "_"),
        _ => format!("node{node}"),
    };
    let plain: Vec<String> = siblings.iter().map(plain).collect();
    let mut taken: HashSet<String> = plain.iter().cloned().collect();
    let mut next: HashMap<&str, usize> = HashMap::new();
    let mut names = Vec::with_capacity(plain.len());
    for name in &plain {
        let number = next.entry(name).or_insert(1);
        let mut unique = name.clone();
        if *number > 1 {
            unique = format!("{name}.{number}");
            while taken.contains(&unique) {
                *number += 1;
                unique = format!("{name}.{number}");
            }
            taken.insert(unique.clone());
        }
        *number += 1;
        names.push(unique);
    }
    names
}

/// The times of all keys that move a node, or any joint of a skin; nothing for what stands still.
struct Moving {
    nodes: Vec<Option<Arc<[f64]>>>,
    skins: Vec<Option<Arc<[f64]>>>,
}

impl Moving {
    fn new(nodes: &Nodes, skins: &[Skin], budget: &mut Budget) -> Result<Self> {
        let mut by_node: Vec<Option<Arc<[f64]>>> = vec![None; nodes.all.len()];
        for &node in &nodes.order {
            let above = nodes.all[node].parent.and_then(|parent| by_node[parent].clone());
            // A single key moves nothing.
            let own = nodes.key_times(node).filter(|times| times.len() > 1);
            by_node[node] = union(above.iter().chain(own), budget, &|| format!("nodes[{node}]"))?;
        }
        let of_skin = |(number, skin): (usize, &Skin)| {
            let joints = skin.joints.iter().filter_map(|&joint| by_node[joint].as_ref());
            union(joints, budget, &|| format!("skins[{number}]"))
        };
        let by_skin = skins.iter().enumerate().map(of_skin).collect::<Result<_>>()?;
        Ok(Self { nodes: by_node, skins: by_skin })
    }
}

/// All times of all lists, ascending.
fn union<'a>(
    lists: impl Iterator<Item = &'a Arc<[f64]>>,
    budget: &mut Budget,
    part: &dyn Fn() -> String,
) -> Result<Option<Arc<[f64]>>> {
    // Exporters give many tracks the same times, mostly the same list.
    let mut seen = HashSet::new();
    let mut distinct: Vec<&Arc<[f64]>> = Vec::new();
    for list in lists {
        if seen.insert(list.as_ptr()) && distinct.last().is_none_or(|last| last != &list) {
            distinct.push(list);
        }
    }
    if distinct.len() < 2 {
        return Ok(distinct.first().map(|list| Arc::clone(list)));
    }
    let total: usize = distinct.iter().map(|list| list.len()).sum();
    budget.charge(8 * total as u64, part)?;
    let mut times: Vec<f64> = distinct.iter().flat_map(|list| list.iter().copied()).collect();
    times.sort_by(f64::total_cmp);
    times.dedup_by(|later, earlier| *later - *earlier <= nearly(*later));
    Ok(Some(times.into()))
}

/// Evenly spaced where they are so but for rounding.
fn key_times(times: Option<Arc<[f64]>>) -> KeyTimes {
    let Some(times) = times else { return KeyTimes::Static };
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return KeyTimes::Static };
    let step_s = (last - first) / (times.len() - 1) as f64;
    let even = |(index, time): (usize, &f64)| {
        (first + index as f64 * step_s - time).abs() <= nearly(first.abs().max(last.abs()))
    };
    if times.len() < 2 || last <= first {
        KeyTimes::Static
    } else if step_s > 4.0 * nearly(last) && times.iter().enumerate().all(even) {
        KeyTimes::Uniform { start_s: first, step_s, count: times.len() }
    } else {
        KeyTimes::Listed(times)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(names: &[&str]) -> Vec<Node> {
        let json: Vec<String> = names.iter().map(|name| format!("{{\"name\":\"{name}\"}}")).collect();
        serde_json::from_str(&format!("[{}]", json.join(","))).expect("nodes")
    }

    #[test]
    fn siblings_get_names_of_their_own() {
        let nodes = written(&["a", "a", "", "a.2", "b/c", "a"]);
        assert_eq!(names(&[0, 1, 2, 3, 4, 5], &nodes), ["a", "a.3", "node2", "a.2", "b_c", "a.4"]);
    }

    #[test]
    fn times_of_frames_are_even_and_others_listed() {
        let film: Arc<[f64]> = (0..200).map(|frame| f64::from(frame as f32 / 24.0_f32)).collect();
        let KeyTimes::Uniform { step_s, count: 200, .. } = key_times(Some(film)) else {
            panic!("frames are even")
        };
        assert!((step_s - 1.0 / 24.0).abs() < 1e-8);
        assert!(matches!(key_times(Some([0.0, 0.1, 0.3].into())), KeyTimes::Listed(_)));
        assert_eq!(key_times(Some([1.0].into())), KeyTimes::Static);
        assert_eq!(key_times(Some([1.0, 1.0].into())), KeyTimes::Static);
    }

    #[test]
    fn a_union_holds_each_time_once() {
        let (a, b): (Arc<[f64]>, Arc<[f64]>) = ([0.0, 1.0, 2.0].into(), [0.5, 1.0 + 1e-9].into());
        let mut budget = Budget::new(100);
        let both = union([&a, &b, &a].into_iter(), &mut budget, &String::new).expect("a small list");
        assert_eq!(both.as_deref(), Some(&[0.0, 0.5, 1.0, 2.0][..]));
        assert!(union([&a, &b].into_iter(), &mut Budget::new(9), &|| "part".into()).is_err());
    }
}
