//! A material of paper.

use super::super::asset::Folder;
use super::super::toml::Node;
use super::cloth::against;
use super::named::{Named, corpus_of};
use super::{Keys, with_place};
use crate::Result;
use crate::corpus::paper::synthetic;
use crate::scene::file::Paper;

pub(super) const PAPER: Keys = &[
    "corpus",
    "against",
    "regions",
    "held",
    "force",
    "reference_force",
    "radius",
    "floor_speed",
    "ridge",
    "flat",
    "average",
    "least_energy",
    "reference_energy",
    "slip",
    "tearing",
    "coherence",
    "gain_db",
    "crumple_db",
    "friction_db",
    "reference_distance",
];

/// What is expected where a database is named.
pub(super) const CORPUS: &str = "the folder of a database of paper, or a model such as \"synthetic/printer\"";

/// Where nothing is said: what a sheet of A4 has that is bowed by a tenth and flips through.
const REFERENCE_MPS: f64 = 2.0;

/// Where nothing is said: the weight of a sheet of A4.
const WEIGHT_N: f64 = 0.05;

/// The most vertices that are said to be held.
const MOST_HELD: u64 = u32::MAX as u64;

pub(super) fn paper(node: &Node<'_, '_>, folder: &Folder) -> Result<Paper> {
    let said = Named::corpus(node, PAPER, CORPUS)?;
    let within = |key: &str, default: f64, what: &str, least: f64, most: f64| {
        said.within(key, default, what, least, most)
    };
    let of_all_db = said.gain_db("gain_db")?;
    let regions =
        |node: Node<'_, '_>| with_place(&node, folder.file(&node.text("the name of a file of regions")?));
    Ok(Paper {
        corpus: corpus(said.name(), folder)?,
        against: said
            .get("against")
            .map_or(Ok(Vec::new()), |node| against(&node.named()?, |node| corpus(node, folder)))?,
        regions: said.get("regions").map(regions).transpose()?,
        held: said.get("held").map_or(Ok(Vec::new()), |node| held(&node))?,
        force: said.text("force", "the name of an attribute of vertices")?,
        reference_force_n: within("reference_force", WEIGHT_N, "newtons", 1e-9, 1e9)?,
        radius_m: within("radius", 0.005, "metres", 0.0, 10.0)?,
        floor_speed_mps: within("floor_speed", 0.03, "metres a second", 0.0, 100.0)?,
        ridge_rad: within("ridge", 0.5, "radians", 0.0, 3.2)?,
        flat_rad: within("flat", 0.25, "radians", 0.0, 100.0)?,
        average_m: said.get("average").map(|node| node.within("metres", 0.0, 10.0)).transpose()?,
        least_energy_mps: within("least_energy", 0.1, "metres a second", 0.0, 1e9)?,
        reference_energy_mps: within("reference_energy", REFERENCE_MPS, "metres a second", 1e-9, 1e9)?,
        slip: within("slip", 1.0, "a factor", 0.0, 100.0)?,
        tearing: within("tearing", 1.0, "a factor", 0.0, 1000.0)?,
        coherence: within("coherence", 1.0, "a number", 0.0, 1.0)?,
        crumple_db: of_all_db + said.gain_db("crumple_db")?,
        friction_db: of_all_db + said.gain_db("friction_db")?,
        reference_distance_m: said.reference_distance_m()?,
    })
}

/// The name of a database, which must be there, or that of a model.
pub(super) fn corpus(node: &Node<'_, '_>, folder: &Folder) -> Result<String> {
    corpus_of(node, folder, CORPUS, synthetic::Paper::named)
}

/// The numbers of vertices.
fn held(node: &Node<'_, '_>) -> Result<Vec<u32>> {
    let nodes = node.list("a list of vertices, by their numbers from 0")?;
    let number = |node: &Node<'_, '_>| node.whole("the number of a vertex", 0, MOST_HELD).map(|n| n as u32);
    nodes.iter().map(number).collect()
}
