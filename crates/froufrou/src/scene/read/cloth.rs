//! A material of cloth.

use super::super::asset::Folder;
use super::super::toml::{Node, Table};
use super::Keys;
use super::named::{Named, corpus_of};
use super::sounds::gain_in;
use crate::Result;
use crate::corpus::cloth::{preset, synthetic};
use crate::scene::file::{Cloth, Sheet};

pub(super) const CLOTH: Keys = &[
    "corpus",
    "preset",
    "against",
    "radius",
    "floor_speed",
    "speed_scale",
    "speed_exponent",
    "force",
    "pressure",
    "blur",
    "least_energy",
    "jitter",
    "patches",
    "membrane",
    "gain_db",
    "friction_db",
    "pops_db",
    "reference_distance",
];

pub(super) const SHEET: Keys = &["stiffness", "density", "damping", "size", "snap", "contact", "gain_db"];

/// The longest that a pop comes after its buckle, in seconds: two frames of the animations of An et al.
const MOST_JITTER_S: f64 = 1.0 / 30.0;

/// The most patches of a cloth.
const MOST_PATCHES: u64 = 64;

/// Where nothing is said: a vertex is as near to what it rubs on.
const RADIUS_M: f64 = 0.02;

/// Where nothing is said: weaker buckles are the trembling of a simulation.
const LEAST_ENERGY_MPS: f64 = 0.1;

/// Where nothing is said: a hand strokes 200 cm² of cloth with 2 N.
const PRESSURE_PA: f64 = 100.0;

/// Where nothing is said: what bends within a shorter way is the trembling of a mesh.
const BLUR_M: f64 = 0.01;

/// Where nothing is said: what is slower rests.
const FLOOR_MPS: f64 = 0.02;

pub(super) fn cloth(node: &Node<'_, '_>, folder: &Folder) -> Result<Cloth> {
    let said = Named::corpus(node, CLOTH, CORPUS)?;
    let within = |key: &str, default: f64, what: &str, least: f64, most: f64| {
        said.within(key, default, what, least, most)
    };
    let preset = said.get("preset").map(|node| preset(&node)).transpose()?;
    let of_all_db = said.gain_db("gain_db")?;
    Ok(Cloth {
        corpus: corpus(said.name(), folder)?,
        against: said
            .get("against")
            .map_or(Ok(Vec::new()), |node| against(&node.named()?, |node| corpus(node, folder)))?,
        radius_m: within("radius", preset.map_or(RADIUS_M, |p| p.contact_radius_m), "metres", 1e-4, 10.0)?,
        floor_speed_mps: within(
            "floor_speed",
            preset.map_or(FLOOR_MPS, |p| p.silent_below_mps),
            "metres a second",
            0.0,
            100.0,
        )?,
        speed_scale_mps: within("speed_scale", 1.0, "metres a second", 1e-6, 1e6)?,
        speed_exponent: within("speed_exponent", 1.0, "a power", 0.05, 20.0)?,
        force: said.text("force", "the name of an attribute of vertices")?,
        pressure_pa: within("pressure", PRESSURE_PA, "pascals", 1e-3, 1e9)?,
        blur_m: within("blur", BLUR_M, "metres", 0.0, 1.0)?,
        least_energy_mps: within("least_energy", LEAST_ENERGY_MPS, "metres a second", 0.0, 1e9)?,
        jitter_s: within("jitter", 0.0, "seconds", 0.0, MOST_JITTER_S)?,
        patches: said
            .get("patches")
            .map_or(Ok(16), |node| node.whole("a number of patches", 1, MOST_PATCHES))?
            as usize,
        membrane: said.get("membrane").map(|node| sheet(&node, of_all_db)).transpose()?.flatten(),
        friction_db: of_all_db + said.gain_db("friction_db")?,
        pops_db: of_all_db + said.gain_db("pops_db")?,
        reference_distance_m: said.reference_distance_m()?,
    })
}

/// How it sounds as a membrane: `true`, `false`, or a table.
fn sheet(node: &Node<'_, '_>, of_all_db: f64) -> Result<Option<Sheet>> {
    let table = match node.as_flag() {
        Some(false) => return Ok(None),
        Some(true) => None,
        None => Some(node.table(SHEET)?),
    };
    let within = |key: &str, default: f64, what: &str, from: f64, to: f64| {
        let node = table.as_ref().and_then(|table| table.get(key));
        node.map_or(Ok(default), |node| node.within(what, from, to))
    };
    Ok(Some(Sheet {
        stiffness_n_per_m: within("stiffness", 5000.0, "newtons a metre", 0.0, 1e7)?,
        density_kg_per_m2: within("density", 0.15, "kilograms a square metre", 0.001, 100.0)?,
        damping: within("damping", 0.1, "a part of the critical damping", 0.0001, 1.0)?,
        size_m: within("size", 0.3, "metres", 0.01, 100.0)?,
        snap_mps: within("snap", 1.0, "metres a second", 0.0, 1e6)?,
        contact_s: within("contact", 0.002, "seconds", 0.0, 1.0)?,
        gain_db: of_all_db + table.as_ref().map_or(Ok(0.0), |table| gain_in(table, "gain_db"))?,
    }))
}

/// What is expected where a corpus is named.
pub(super) const CORPUS: &str = "the folder of a corpus of cloth, or a model such as \"synthetic/cotton\"";

/// The name of a corpus, which must be there, or that of a model.
pub(super) fn corpus(node: &Node<'_, '_>, folder: &Folder) -> Result<String> {
    corpus_of(node, folder, CORPUS, synthetic::Cloth::named)
}

/// The corpora along other materials.
pub(super) fn against(
    table: &Table<'_, '_>,
    corpus: impl Fn(&Node<'_, '_>) -> Result<String>,
) -> Result<Vec<(String, String)>> {
    let entries = table.entries().into_iter();
    entries.map(|(name, node)| Ok((name.to_owned(), corpus(&node)?))).collect()
}

fn preset(node: &Node<'_, '_>) -> Result<&'static preset::AnimationPreset> {
    let name = node.text("a cloth and an animation of An et al., such as \"cotton/sheet\"")?;
    let found = name.split_once('/').and_then(|(cloth, animation)| preset::of_animation(cloth, animation));
    found.ok_or_else(|| {
        let names = preset::ANIMATIONS.iter().map(|preset| format!("{}/{}", preset.cloth, preset.animation));
        let known: Vec<String> = names.collect();
        node.error(format!("there is no preset {name:?}: there are {}", known.join(", ")))
    })
}
