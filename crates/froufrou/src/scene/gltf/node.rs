//! Nodes: who stands under whom, and how each is turned, scaled and moved at a time.

use std::sync::Arc;

use glam::{DAffine3, DMat4, DQuat, DVec3};

use super::document::{self, Animation, Kind};
use super::fault::{Budget, damage};
use super::track::{Keys, Track, unit};
use crate::Result;

/// More levels than any scene has.
const MOST_LEVELS: usize = 1000;

/// A node of the document, whether it is in the scene or not.
#[derive(Debug)]
pub(super) struct Node {
    pub(super) parent: Option<usize>,
    local: Local,
    translation: Option<Box<Track>>,
    rotation: Option<Box<Track>>,
    scale: Option<Box<Track>>,
    pub(super) weights: Option<Box<Track>>,
}

/// The transform that is written at the node.
#[derive(Debug, Clone, Copy)]
enum Local {
    Parts { translation: DVec3, rotation: DQuat, scale: DVec3 },
    Matrix(DAffine3),
}

impl Local {
    fn new(node: &document::Node) -> Self {
        match &node.matrix {
            Some(matrix) => Local::Matrix(DAffine3::from_mat4(DMat4::from_cols_array(matrix))),
            None => Local::Parts {
                translation: node.translation.map_or(DVec3::ZERO, DVec3::from_array),
                rotation: node.rotation.map_or(DQuat::IDENTITY, unit),
                scale: node.scale.map_or(DVec3::ONE, DVec3::from_array),
            },
        }
    }

    /// For a node that is animated, of which some parts may stay as they are written.
    fn parts(self) -> (DVec3, DQuat, DVec3) {
        match self {
            Local::Parts { translation, rotation, scale } => (translation, rotation, scale),
            Local::Matrix(matrix) => {
                let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
                (translation, rotation, scale)
            }
        }
    }
}

/// All nodes by their number in the document.
#[derive(Debug)]
pub(super) struct Nodes {
    pub(super) all: Vec<Node>,
    /// Parents before children.
    pub(super) order: Vec<usize>,
}

impl Nodes {
    /// The nodes at rest.
    ///
    /// # Errors
    /// Nodes that are not there, have two parents, contain themselves or nest absurdly.
    pub(super) fn new(written: &[document::Node]) -> Result<Self> {
        let node = |written| Node {
            parent: None,
            local: Local::new(written),
            translation: None,
            rotation: None,
            scale: None,
            weights: None,
        };
        let mut nodes: Vec<Node> = written.iter().map(node).collect();
        for (index, node) in written.iter().enumerate() {
            for &child in &node.children {
                let part = || format!("nodes[{index}].children");
                let Some(below) = nodes.get_mut(child) else {
                    let what = format!("there is no node {child}; there are {}", written.len());
                    return Err(damage(part(), what));
                };
                if let Some(other) = below.parent {
                    return Err(damage(part(), format!("node {child} stands under node {other} already")));
                }
                below.parent = Some(index);
            }
        }
        let mut nodes = Self { all: nodes, order: Vec::new() };
        nodes.order = nodes.levels()?;
        Ok(nodes)
    }

    /// All nodes, parents before children: every way up must end.
    fn levels(&self) -> Result<Vec<usize>> {
        // Levels already known; 0 where not.
        let mut levels = vec![0_usize; self.all.len()];
        let mut way = Vec::new();
        for start in 0..self.all.len() {
            let mut current = Some(start);
            let mut above = 0;
            while let Some(index) = current {
                if levels[index] > 0 {
                    above = levels[index];
                    break;
                }
                if way.len() > MOST_LEVELS {
                    break;
                }
                way.push(index);
                current = self.all[index].parent;
            }
            if above + way.len() > MOST_LEVELS {
                return Err(damage(
                    format!("nodes[{start}]"),
                    format!("the node lies more than {MOST_LEVELS} levels deep or contains itself"),
                ));
            }
            while let Some(index) = way.pop() {
                above += 1;
                levels[index] = above;
            }
        }
        let mut order: Vec<usize> = (0..self.all.len()).collect();
        order.sort_by_key(|&node| levels[node]);
        Ok(order)
    }

    /// Gives the nodes the tracks of a clip. `targets` is how many morph targets a node has.
    ///
    /// # Errors
    /// Tracks that cannot be read or that belong to no node.
    pub(super) fn animate(
        &mut self,
        number: usize,
        clip: &Animation,
        targets: impl Fn(usize) -> usize,
        keys: &mut Keys,
        budget: &mut Budget,
    ) -> Result<()> {
        let count = self.all.len();
        for (index, channel) in clip.channels.iter().enumerate() {
            let of = || format!("animations[{number}].channels[{index}]");
            // Without a node it is an extension's; what is moved by one is not read.
            let Some(target) = channel.target.node else { continue };
            let Some(node) = self.all.get_mut(target) else {
                return Err(damage(of(), format!("there is no node {target}; there are {count}")));
            };
            let Some(sampler) = clip.samplers.get(channel.sampler) else {
                let what =
                    format!("there is no sampler {}; there are {}", channel.sampler, clip.samplers.len());
                return Err(damage(of(), what));
            };
            let mut track = |kind, width| {
                keys.track(sampler, kind, width, budget, &of).map(|track| Some(Box::new(track)))
            };
            match channel.target.path.as_str() {
                "translation" => node.translation = track(Kind::Vec3, 3)?,
                "rotation" => node.rotation = track(Kind::Vec4, 4)?,
                "scale" => node.scale = track(Kind::Vec3, 3)?,
                "weights" => {
                    let width = targets(target);
                    if width > 0 {
                        node.weights = track(Kind::Scalar, width)?;
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// The times of all keys by which a node itself moves; those of weights are its mesh's.
    pub(super) fn key_times(&self, node: usize) -> impl Iterator<Item = &Arc<[f64]>> {
        let tracks = self.all.get(node).map(|node| [&node.translation, &node.rotation, &node.scale]);
        tracks.into_iter().flatten().filter_map(|track| track.as_ref().map(|track| &track.times_s))
    }

    fn local(&self, node: &Node, time_s: f64) -> DAffine3 {
        if let (Local::Matrix(matrix), None, None, None) =
            (node.local, &node.translation, &node.rotation, &node.scale)
        {
            return matrix;
        }
        let (translation, rotation, scale) = node.local.parts();
        DAffine3::from_scale_rotation_translation(
            node.scale.as_ref().map_or(scale, |track| track.vector(time_s)),
            node.rotation.as_ref().map_or(rotation, |track| track.rotation(time_s)),
            node.translation.as_ref().map_or(translation, |track| track.vector(time_s)),
        )
    }

    /// Local to world.
    pub(super) fn world(&self, node: usize, time_s: f64) -> DAffine3 {
        let mut world = DAffine3::IDENTITY;
        let mut current = self.all.get(node);
        while let Some(node) = current {
            world = self.local(node, time_s) * world;
            current = node.parent.and_then(|parent| self.all.get(parent));
        }
        world
    }

    /// Local to world of many nodes, whose common ancestors are asked once.
    pub(super) fn worlds(&self, wanted: &[usize], time_s: f64) -> Vec<DAffine3> {
        let mut known: Vec<Option<DAffine3>> = vec![None; self.all.len()];
        let mut way = Vec::new();
        let of = |&wanted: &usize| {
            let mut current = Some(wanted);
            let mut world = DAffine3::IDENTITY;
            while let Some(index) = current {
                if let Some(found) = known[index] {
                    world = found;
                    break;
                }
                way.push(index);
                current = self.all[index].parent;
            }
            while let Some(index) = way.pop() {
                world *= self.local(&self.all[index], time_s);
                known[index] = Some(world);
            }
            world
        };
        wanted.iter().map(of).collect()
    }
}
