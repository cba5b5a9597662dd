//! What a scene says of sounds: recordings and instruments, when they sound, and what materials sound
//! like.

use std::collections::HashSet;

use super::super::asset::{Asset, Folder};
use super::super::file::{
    Acoustics, AirSound, Emitter, GrainSound, ImpactSound, Instrument, Material, Played, Reflect, RubSound,
    Scene, SceneSound, SetKey, StartKey, Timing,
};
use super::super::toml::{Node, Table};
use super::named::Named;
use super::{Keys, cloth, one_or_many, paper, unknown, with_place};
use crate::Result;
use crate::score::{Blow, INSTRUMENTS, Make, Mode, Radiation, Repeat};
use crate::space::dipole;
use crate::space::directivity::Directivity;

pub(super) const INSTRUMENT: Keys = &["kind", "table", "modes", "script", "corpus", "with"];
pub(super) const MODE: Keys = &["frequency", "decay", "gain", "points"];
/// Of what nobody says what it weighs, in kilograms a cubic metre: water.
const DENSITY: f64 = 1000.0;

pub(super) const MATERIAL: Keys =
    &["impact", "slide", "roll", "grains", "cloth", "paper", "air", "reflect", "occlude", "density"];
pub(super) const GRAINS: Keys = &[
    "corpus",
    "shader",
    "gain_db",
    "reference_impulse",
    "floor_impulse",
    "retrigger",
    "reference_power",
    "floor_speed",
    "reference_speed",
    "pitch",
    "reference_force",
    "spread",
    "reference_distance",
];
pub(super) const REFLECT: Keys = &["absorption", "diffuse", "sharpness", "paths", "sides"];
pub(super) const OCCLUDE: Keys = &["transmission_db"];
pub(super) const IMPACT: Keys = &[
    "recordings",
    "instrument",
    "place",
    "contact",
    "gain_db",
    "reference_impulse",
    "floor_impulse",
    "retrigger",
    "speed_variation",
    "reference_distance",
];
pub(super) const RUB: Keys =
    &["instrument", "recording", "gain_db", "reference_force", "floor_speed", "reference_distance"];
pub(super) const AIR: Keys = &["instrument", "gain_db", "reference_distance"];
/// What a sound may have wherever it stands.
pub(super) const OBJECT_SOUND: Keys = &[
    "recording",
    "recordings",
    "loop",
    "channel",
    "instrument",
    "set",
    "pattern",
    "gain_db",
    "speed",
    "speed_variation",
    "at",
    "from",
    "to",
    "fade_in",
    "fade_out",
    "reference_distance",
];
/// What a sound that stands by itself may have.
pub(super) const SOUND: Keys = &[
    "object",
    "position",
    "recording",
    "recordings",
    "loop",
    "channel",
    "instrument",
    "set",
    "pattern",
    "gain_db",
    "speed",
    "speed_variation",
    "at",
    "from",
    "to",
    "fade_in",
    "fade_out",
    "reference_distance",
];
/// What an ambience may have.
pub(super) const AMBIENT: Keys = &[
    "microphone",
    "recording",
    "recordings",
    "loop",
    "channel",
    "instrument",
    "set",
    "gain_db",
    "speed",
    "speed_variation",
    "from",
    "to",
    "fade_in",
    "fade_out",
];
pub(super) const PATTERN: Keys = &["lobe", "disk", "axis"];
pub(super) const START: Keys = &["t", "gain_db", "speed"];
pub(super) const STRIKE: Keys = &["t", "impulse", "place", "contact"];

/// What makes an instrument.
pub(super) const KINDS: Keys = INSTRUMENTS;

/// The most files or patterns in one list of recordings.
const MOST_RECORDINGS: usize = 10_000;
/// The most modes that may stand in a scene.
const MOST_MODES: usize = 100_000;

/// The instruments of a scene.
pub(super) fn instruments(top: &Table<'_, '_>, folder: &Folder) -> Result<Vec<Instrument>> {
    let Some(node) = top.get("instrument") else { return Ok(Vec::new()) };
    let entries = node.named()?.entries();
    entries.into_iter().map(|(name, node)| instrument(name, &node, folder)).collect()
}

fn instrument(name: &str, node: &Node<'_, '_>, folder: &Folder) -> Result<Instrument> {
    if name.is_empty() {
        return Err(node.error("an instrument needs a name"));
    }
    let table = node.table(INSTRUMENT)?;
    let kind = KINDS[table.required("kind", "what makes the sound")?.choice(KINDS)?];
    for (key, of) in [("table", "modes"), ("modes", "modes"), ("script", "procedure")] {
        if let Some(node) = table.get(key).filter(|_| kind != of) {
            return Err(node.error(format!("is for the kind {of:?}, and this is a {kind:?}")));
        }
    }
    if let Some(node) = table.get("corpus").filter(|_| !["cloth", "paper"].contains(&kind)) {
        return Err(node.error(format!("is for the kinds \"cloth\" and \"paper\", and this is a {kind:?}")));
    }
    let file = |key: &str| -> Result<Option<String>> {
        let Some(node) = table.get(key) else { return Ok(None) };
        Ok(Some(with_place(&node, folder.file(&node.text("the name of a file")?))?.name))
    };
    let make = match kind {
        "cloth" => {
            let node = table.required("corpus", cloth::CORPUS)?;
            Make::Cloth { corpus: cloth::corpus(&node, folder)? }
        }
        "paper" => {
            let node = table.required("corpus", paper::CORPUS)?;
            Make::Paper { corpus: paper::corpus(&node, folder)? }
        }
        "modes" => {
            let modes = Make::Modes { table: file("table")?, modes: modes(&table)? };
            if matches!(&modes, Make::Modes { table: None, modes } if modes.is_empty()) {
                return Err(table.error("`table` or `modes` is missing: expected how it rings"));
            }
            modes
        }
        "procedure" => {
            let missing = || table.error("`script` is missing: expected the name of a script");
            Make::Procedure { script: file("script")?.ok_or_else(missing)? }
        }
        plain => Make::of_word(plain).ok_or_else(|| table.error("it is no kind of instrument"))?,
    };
    let with = table.get("with").map_or(Ok(Vec::new()), |node| values(&node.named()?, &[]))?;
    Ok(Instrument { name: name.to_owned(), make, with })
}

fn modes(table: &Table<'_, '_>) -> Result<Vec<Mode>> {
    let Some(node) = table.get("modes") else { return Ok(Vec::new()) };
    let nodes = node.list("a list of modes { frequency = …, decay = … }")?;
    if let Some(node) = nodes.get(MOST_MODES) {
        return Err(node.error(format!("more than {MOST_MODES} modes")));
    }
    let mode = |node: &Node<'_, '_>| -> Result<Mode> {
        let mode = node.table(MODE)?;
        let points = mode.get("points").map_or(Ok(Vec::new()), |node| node.list("a list of factors"))?;
        Ok(Mode {
            frequency_hz: mode.required("frequency", "a number of hertz")?.positive("a number of hertz")?,
            decay_per_s: mode.required("decay", "a decay a second")?.positive("a decay a second")?,
            gain: mode.get("gain").map_or(Ok(1.0), |node| node.number("a gain"))?,
            points: points.iter().map(|node| node.number("a factor")).collect::<Result<_>>()?,
        })
    };
    nodes.iter().map(mode).collect()
}

/// Numbers by the names that the author gave them, but for some names.
fn values(table: &Table<'_, '_>, but: &[&str]) -> Result<Vec<(String, f64)>> {
    let entries = table.entries().into_iter().filter(|(name, _)| !but.contains(name));
    entries.map(|(name, node)| Ok((name.to_owned(), node.number("a number")?))).collect()
}

fn played_instrument(table: &Table<'_, '_>, instruments: &[Instrument]) -> Result<Option<Played>> {
    let Some(node) = table.get("instrument") else { return Ok(None) };
    let name = node.text("the name of an instrument")?;
    let index = instruments.iter().position(|instrument| instrument.name == name);
    index.map(|index| Some(Played::Instrument(index))).ok_or_else(|| {
        let names: Vec<&str> = instruments.iter().map(|instrument| instrument.name.as_str()).collect();
        unknown(&node, "instrument", &name, &names)
    })
}

fn recordings(nodes: &[Node<'_, '_>], folder: &Folder) -> Result<Vec<Asset>> {
    if let Some(node) = nodes.get(MOST_RECORDINGS) {
        return Err(node.error(format!("more than {MOST_RECORDINGS} names in one list")));
    }
    let (mut found, mut seen) = (Vec::new(), HashSet::new());
    for node in nodes {
        let pattern = node.text("the name of a recording or a pattern such as \"hits/*.wav\"")?;
        for asset in with_place(node, folder.files(&pattern))? {
            // A file that two patterns match is one recording.
            if seen.insert(asset.name.clone()) {
                found.push(asset);
            }
        }
    }
    Ok(found)
}

fn required_recordings(node: &Node<'_, '_>, folder: &Folder) -> Result<Vec<Asset>> {
    let found = recordings(&one_or_many(node)?, folder)?;
    if found.is_empty() { Err(node.error("expected at least one recording")) } else { Ok(found) }
}

fn gain_db(table: &Table<'_, '_>) -> Result<f64> {
    gain_in(table, "gain_db")
}

pub(super) fn gain_in(table: &Table<'_, '_>, key: &str) -> Result<f64> {
    // 200 dB is a factor of 10¹⁰, where every mistake is heard before the sound.
    table.get(key).map_or(Ok(0.0), |node| node.within("decibels", -200.0, 200.0))
}

pub(super) fn reference_distance(table: &Table<'_, '_>) -> Result<f64> {
    table.get("reference_distance").map_or(Ok(1.0), |node| node.positive("a number of metres"))
}

fn speed(table: &Table<'_, '_>) -> Result<f64> {
    table.get("speed").map_or(Ok(1.0), |node| node.within("a playback speed", 0.01, 100.0))
}

fn speed_variation(table: &Table<'_, '_>) -> Result<f64> {
    table.get("speed_variation").map_or(Ok(0.0), |node| node.within("a fraction", 0.0, 0.9))
}

/// Refuses what only recordings have.
fn only_recordings(table: &Table<'_, '_>, keys: &[&str]) -> Result<()> {
    match keys.iter().find_map(|key| table.get(key)) {
        Some(node) => Err(node.error("is for recordings, and an instrument is synthesised")),
        None => Ok(()),
    }
}

/// Refuses what only instruments have.
fn only_instruments(table: &Table<'_, '_>, keys: &[&str]) -> Result<()> {
    match keys.iter().find_map(|key| table.get(key)) {
        Some(node) => Err(node.error("is for an `instrument`, not for recordings")),
        None => Ok(()),
    }
}

pub(super) fn material(
    name: &str,
    node: &Node<'_, '_>,
    instruments: &[Instrument],
    folder: &Folder,
) -> Result<Material> {
    if name.is_empty() {
        return Err(node.error("a material needs a name"));
    }
    let table = node.table(MATERIAL)?;
    table.at_most_one(&["cloth", "paper"])?;
    Ok(Material {
        name: name.to_owned(),
        impact: table
            .get("impact")
            .map(|node| impact(&node.table(IMPACT)?, instruments, folder))
            .transpose()?,
        slide: table.get("slide").map(|node| rub(&node.table(RUB)?, instruments, folder)).transpose()?,
        roll: table.get("roll").map(|node| rub(&node.table(RUB)?, instruments, folder)).transpose()?,
        grains: table.get("grains").map(|node| grains(&node, folder)).transpose()?,
        cloth: table.get("cloth").map(|node| cloth::cloth(&node, folder)).transpose()?,
        paper: table.get("paper").map(|node| paper::paper(&node, folder)).transpose()?,
        air: table.get("air").map(|node| air_sound(&node.table(AIR)?, instruments)).transpose()?,
        acoustics: Acoustics {
            reflect: table.get("reflect").map(|node| reflect(&node)).transpose()?.flatten(),
            transmission: table.get("occlude").map(|node| occlude(&node)).transpose()?.flatten(),
        },
        density: table
            .get("density")
            .map_or(Ok(DENSITY), |node| node.within("kilograms a cubic metre", 1e-3, 1e6))?,
    })
}

/// `true`, or a table; nothing for `false`.
fn flag_or_table<'d, 't>(node: &Node<'d, 't>, keys: Keys) -> Result<Option<Option<Table<'d, 't>>>> {
    match node.as_flag() {
        Some(true) => Ok(Some(None)),
        Some(false) => Ok(None),
        None if node.is_table() => Ok(Some(Some(node.table(keys)?))),
        None => Err(node.expected("true or a table")),
    }
}

fn reflect(node: &Node<'_, '_>) -> Result<Option<Reflect>> {
    let Some(table) = flag_or_table(node, REFLECT)? else { return Ok(None) };
    let part = |key: &str, default: f64, least: f64, most: f64| {
        let node = table.as_ref().and_then(|table| table.get(key));
        node.map_or(Ok(default), |node| node.within("a number", least, most))
    };
    let get = |key: &str| table.as_ref().and_then(|table| table.get(key));
    let paths = get("paths").map_or(Ok(4), |node| node.whole("paths", 1, 64))?;
    let sides = get("sides").map_or(Ok(0), |node| node.choice(&["auto", "front", "both"]))?;
    Ok(Some(Reflect {
        absorption: part("absorption", 0.1, 0.0, 1.0)?,
        diffuse: part("diffuse", 0.5, 0.0, 1.0)?,
        sharpness: part("sharpness", 10.0, 1.0, 1e6)?,
        paths: paths as usize,
        both_sides: [None, Some(false), Some(true)][sides],
    }))
}

fn occlude(node: &Node<'_, '_>) -> Result<Option<f64>> {
    let Some(table) = flag_or_table(node, OCCLUDE)? else { return Ok(None) };
    let node = table.as_ref().and_then(|table| table.get("transmission_db"));
    let db = node.map_or(Ok(-20.0), |node| node.within("decibels", -200.0, 0.0))?;
    Ok(Some(10f64.powf(db / 20.0)))
}

fn impact(table: &Table<'_, '_>, instruments: &[Instrument], folder: &Folder) -> Result<ImpactSound> {
    let newton_seconds = "a number of newton seconds";
    table.at_most_one(&["recordings", "instrument"])?;
    let played = match played_instrument(table, instruments)? {
        Some(instrument) => {
            only_recordings(table, &["speed_variation"])?;
            instrument
        }
        None => {
            only_instruments(table, &["place", "contact"])?;
            let node = table.required("recordings", "a list of recordings, or an `instrument` instead")?;
            let recordings = required_recordings(&node, folder)?;
            Played::Recordings { recordings, repeat: Repeat::Once, channel: None }
        }
    };
    let place = match table.get("place") {
        None => [0.0, 1.0],
        Some(node) if node.is_list() => {
            let what = "a number, or two between which it is struck at random";
            let list = node.list(what)?;
            let [from, to] = list.as_slice() else { return Err(node.expected(what)) };
            [from.not_negative("a number")?, to.not_negative("a number")?]
        }
        Some(node) => [node.not_negative("a number")?; 2],
    };
    Ok(ImpactSound {
        played,
        place,
        contact_s: contact(table)?,
        gain_db: gain_db(table)?,
        reference_impulse_ns: table
            .get("reference_impulse")
            .map_or(Ok(1.0), |n| n.positive(newton_seconds))?,
        floor_impulse_ns: table.get("floor_impulse").map_or(Ok(0.01), |n| n.not_negative(newton_seconds))?,
        retrigger_s: table.get("retrigger").map_or(Ok(0.03), |n| n.not_negative("a number of seconds"))?,
        speed_variation: speed_variation(table)?,
        reference_distance_m: reference_distance(table)?,
    })
}

fn contact(table: &Table<'_, '_>) -> Result<f64> {
    table.get("contact").map_or(Ok(0.0), |node| node.within("a number of seconds", 0.0, 1.0))
}

fn rub(table: &Table<'_, '_>, instruments: &[Instrument], folder: &Folder) -> Result<RubSound> {
    table.at_most_one(&["recording", "instrument"])?;
    let played = match (played_instrument(table, instruments)?, table.get("recording")) {
        (Some(instrument), _) => instrument,
        (None, Some(node)) => Played::Recordings {
            recordings: vec![with_place(&node, folder.file(&node.text("the name of a recording")?))?],
            repeat: Repeat::Loop,
            channel: None,
        },
        (None, None) => {
            return Err(table.error("`instrument` is missing: expected the name of one, or a `recording`"));
        }
    };
    Ok(RubSound {
        played,
        gain_db: gain_db(table)?,
        reference_force_n: table
            .get("reference_force")
            .map_or(Ok(10.0), |node| node.positive("a number of newtons"))?,
        floor_speed_mps: table
            .get("floor_speed")
            .map_or(Ok(0.005), |node| node.not_negative("metres a second"))?,
        reference_distance_m: reference_distance(table)?,
    })
}

/// The folder of a corpus, or a table.
fn grains(node: &Node<'_, '_>, folder: &Folder) -> Result<GrainSound> {
    let what = "the folder of a corpus";
    let said = Named::corpus(node, GRAINS, what)?;
    let shader =
        said.get("shader").map(|node| with_place(&node, folder.file(&node.text("the name of a script")?)));
    Ok(GrainSound {
        corpus: with_place(said.name(), folder.folder(&said.name().text(what)?))?,
        shader: shader.transpose()?,
        gain_db: said.gain_db("gain_db")?,
        reference_impulse_ns: said.positive("reference_impulse", 1.0, "a number of newton seconds")?,
        floor_impulse_ns: said.not_negative("floor_impulse", 0.01, "a number of newton seconds")?,
        retrigger_s: said.not_negative("retrigger", 0.03, "a number of seconds")?,
        reference_power_w: said.positive("reference_power", 10.0, "a number of watts")?,
        floor_speed_mps: said.not_negative("floor_speed", 0.005, "metres a second")?,
        reference_speed_mps: said.positive("reference_speed", 1.0, "metres a second")?,
        pitch: said.within("pitch", 0.25, "a power", -2.0, 2.0)?,
        reference_force_n: said.positive("reference_force", 10.0, "a number of newtons")?,
        spread: said.within("spread", 0.005, "a part of the pitch", 0.0, 0.2)?,
        reference_distance_m: said.reference_distance_m()?,
    })
}

fn air_sound(table: &Table<'_, '_>, instruments: &[Instrument]) -> Result<AirSound> {
    let missing = || table.error("`instrument` is missing: expected the name of one");
    Ok(AirSound {
        played: played_instrument(table, instruments)?.ok_or_else(missing)?,
        gain_db: gain_db(table)?,
        reference_distance_m: reference_distance(table)?,
    })
}

/// The sound of an object's material in the air, for all of the scene.
pub(super) fn air(scene: &Scene, object: usize) -> Option<SceneSound> {
    let of = scene.objects.get(object).filter(|object| object.motion.is_some())?;
    let air = scene.materials.get(of.material?)?.air.as_ref()?;
    Some(SceneSound {
        emitter: Emitter::Object(object),
        played: air.played.clone(),
        set: Vec::new(),
        pattern: None,
        gain_db: air.gain_db,
        speed: 1.0,
        speed_variation: 0.0,
        timing: Timing::Span { from_s: 0.0, to_s: None },
        fade_in_s: 0.0,
        fade_out_s: 0.0,
        reference_distance_m: air.reference_distance_m,
    })
}

pub(super) fn sound(
    table: &Table<'_, '_>,
    emitter: Emitter,
    instruments: &[Instrument],
    folder: &Folder,
) -> Result<SceneSound> {
    let seconds = "a number of seconds";
    table.at_most_one(&["recording", "recordings"])?;
    table.at_most_one(&["recording", "instrument"])?;
    table.at_most_one(&["recordings", "instrument"])?;
    let (played, timing) = match played_instrument(table, instruments)? {
        Some(instrument) => {
            only_recordings(table, &["loop", "channel", "speed", "speed_variation"])?;
            (instrument, timing(table, false, true)?)
        }
        None => {
            only_instruments(table, &["set"])?;
            let played = recorded(table, folder)?;
            let timing = timing(table, played.is_endless(), false)?;
            (played, timing)
        }
    };
    let radiation = table.get("pattern").map(|node| pattern(&node)).transpose()?;
    if let (Some(Radiation::Surface), Some(node)) = (&radiation, table.get("pattern")) {
        if !matches!(emitter, Emitter::Object(_)) {
            return Err(node.error("only a sound of an object comes from a surface"));
        }
        if !played.is_endless() {
            return Err(node.error(
                "a recording that plays once cannot come from all over a surface: it needs `loop`, or an `instrument`",
            ));
        }
    }
    Ok(SceneSound {
        emitter,
        played,
        set: set_keys(table)?,
        pattern: radiation,
        gain_db: gain_db(table)?,
        speed: speed(table)?,
        speed_variation: speed_variation(table)?,
        timing,
        fade_in_s: table.get("fade_in").map_or(Ok(0.0), |n| n.not_negative(seconds))?,
        fade_out_s: table.get("fade_out").map_or(Ok(0.0), |n| n.not_negative(seconds))?,
        reference_distance_m: reference_distance(table)?,
    })
}

fn recorded(table: &Table<'_, '_>, folder: &Folder) -> Result<Played> {
    let recordings = match (table.get("recording"), table.get("recordings")) {
        (Some(node), _) => vec![with_place(&node, folder.file(&node.text("the name of a recording")?))?],
        (_, Some(node)) => required_recordings(&node, folder)?,
        _ => {
            return Err(table.error(
                "`recording` is missing: expected the name of a recording, or an `instrument` instead",
            ));
        }
    };
    let repeat = match table.get("loop") {
        None => Repeat::Once,
        Some(node) => match node.as_flag() {
            Some(true) => Repeat::Loop,
            Some(false) => Repeat::Once,
            None if node.is_text() => {
                node.choice(&["exact"])?;
                Repeat::ExactLoop
            }
            None => return Err(node.expected("true, false or \"exact\"")),
        },
    };
    let channel = table.get("channel").map(|n| n.whole("a channel", 0, 1023)).transpose()?;
    Ok(Played::Recordings { recordings, repeat, channel: channel.map(|channel| channel as usize) })
}

/// How a sound radiates: a name, the sharpness of a lobe, or its spherical harmonics.
fn pattern(node: &Node<'_, '_>) -> Result<Radiation> {
    if node.is_text() && node.choice(&["omni", "cardioid", "dipole", "surface"])? == 3 {
        return Ok(Radiation::Surface);
    }
    harmonics(node).map(Radiation::Harmonics)
}

/// The spherical harmonics of a pattern.
fn harmonics(node: &Node<'_, '_>) -> Result<Vec<f64>> {
    let what = "a name, { lobe = … }, or 1, 4, 9 or 16 spherical harmonics";
    if node.is_text() {
        let known = [Directivity::OMNI, Directivity::CARDIOID, Directivity::DIPOLE];
        let choice = node.choice(&["omni", "cardioid", "dipole"])?;
        return Ok(known[choice].coefficients[..4].to_vec());
    }
    if node.is_table() {
        let table = node.table(PATTERN)?;
        table.at_most_one(&["lobe", "disk"])?;
        let Some(radius) = table.get("disk") else {
            if let Some(axis) = table.get("axis") {
                return Err(axis.error("`axis` is for a `disk`"));
            }
            let sharpness = table.required("lobe", "the sharpness of a lobe, or the radius of a `disk`")?;
            let lobe = Directivity::lobe(sharpness.within("a number", 0.0, 1000.0)?);
            return Ok(lobe.coefficients.to_vec());
        };
        let radius_m = radius.within("a radius in metres", 0.0, 10.0)?;
        let axis = table.get("axis").map_or(Ok([0.0, 1.0, 0.0]), |node| node.direction("a direction"))?;
        let Directivity { coefficients } = dipole::directivity(axis);
        return Ok(coefficients[..4].iter().map(|weight| radius_m.powi(3) * weight).collect());
    }
    let list = node.list(what)?;
    if !matches!(list.len(), 1 | 4 | 9 | 16) {
        return Err(node.expected(what));
    }
    list.iter().map(|node| node.within("a number", -1000.0, 1000.0)).collect()
}

/// What an instrument is told: keys with a time, whose other names are its controls.
fn set_keys(table: &Table<'_, '_>) -> Result<Vec<SetKey>> {
    let Some(node) = table.get("set") else { return Ok(Vec::new()) };
    let mut keys: Vec<SetKey> = Vec::new();
    for node in node.list("a list of keys { t = …, NAME = … }")? {
        let key = node.named()?;
        let time = key.required("t", "a number of seconds")?;
        let time_s = time.not_negative("a number of seconds")?;
        if keys.last().is_some_and(|last| last.time_s > time_s) {
            return Err(time.error("keys must be in ascending order of time"));
        }
        let values = values(&key, &["t"])?;
        if values.is_empty() {
            return Err(key.error("says nothing: expected a control and its value beside `t`"));
        }
        keys.push(SetKey { time_s, values });
    }
    Ok(keys)
}

fn timing(table: &Table<'_, '_>, loops: bool, struck: bool) -> Result<Timing> {
    let seconds = "a number of seconds";
    table.at_most_one(&["at", "from"])?;
    table.at_most_one(&["at", "to"])?;
    let Some(node) = table.get("at") else {
        let from_s = table.get("from").map_or(Ok(0.0), |n| n.not_negative(seconds))?;
        let Some(to) = table.get("to") else { return Ok(Timing::Span { from_s, to_s: None }) };
        let to_s = to.number(seconds)?;
        if to_s <= from_s {
            return Err(to.error(format!("expected a time after the start at {from_s}, found {to_s}")));
        }
        return Ok(Timing::Span { from_s, to_s: Some(to_s) });
    };
    if loops {
        return Err(node.error("a loop has no end: it takes `from` and `to`"));
    }
    let nodes = node.list("a list of times or of keys { t = … }")?;
    if nodes.is_empty() {
        return Err(node.error("expected at least one time"));
    }
    let time = |node: &Node<'_, '_>| node.not_negative("a number of seconds or a key { t = … }");
    if struck {
        let strike = |node: &Node<'_, '_>| -> Result<(f64, Blow)> {
            if !node.is_table() {
                return Ok((time(node)?, Blow { impulse_ns: 1.0, place: 0.5, contact_s: 0.0 }));
            }
            let key = node.table(STRIKE)?;
            let part = |name: &str, default: f64| {
                key.get(name).map_or(Ok(default), |node| node.within("a number", 0.0, 1e9))
            };
            let blow = Blow {
                impulse_ns: part("impulse", 1.0)?,
                place: part("place", 0.5)?,
                contact_s: contact(&key)?,
            };
            Ok((key.required("t", seconds)?.not_negative(seconds)?, blow))
        };
        let mut strikes = nodes.iter().map(strike).collect::<Result<Vec<_>>>()?;
        strikes.sort_by(|a, b| a.0.total_cmp(&b.0));
        return Ok(Timing::Strikes(strikes));
    }
    let start = |node: &Node<'_, '_>| -> Result<StartKey> {
        if !node.is_table() {
            return Ok(StartKey { time_s: time(node)?, gain_db: 0.0, speed: 1.0 });
        }
        let key = node.table(START)?;
        let time_s = key.required("t", seconds)?.not_negative(seconds)?;
        Ok(StartKey { time_s, gain_db: gain_db(&key)?, speed: speed(&key)? })
    };
    let mut starts = nodes.iter().map(start).collect::<Result<Vec<_>>>()?;
    starts.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(Timing::Starts(starts))
}
