//! From the text of a scene file to a checked [`Scene`].

use std::collections::{HashMap, HashSet};
use std::path::Path;

use crate::score::{MicrophoneShape, Repeat};
use crate::{Error, Place, Result};

use super::asset::{Asset, Folder, NamePattern};
use super::contact_log::{ContactColumns, Push};
use super::conventions::{Conventions, UpAxis};
use super::file::{
    Contacts, Emitter, ImpactSound, Material, Microphone, Motion, Object, Point, Scene, SceneSound, Source,
    StartKey, Timing,
};
use super::listener::{CARDIOID, Layout, Listener, OMNI};
use super::obj;
use super::toml::{Document, Node, Table, nearest};
use super::track::{Interpolation, Track, TrackKey};

/// The keys of one kind of table.
type Keys = &'static [&'static str];

const SCENE: Keys = &[
    "rate",
    "seed",
    "duration",
    "start",
    "speed_of_sound",
    "frame_rate",
    "listener",
    "microphone",
    "material",
    "object",
    "sound",
    "contacts",
];
const LISTENER: Keys = &[
    "position",
    "facing",
    "track",
    "interpolation",
    "time_offset",
    "up",
    "unit",
    "frame_rate",
    "offset",
    "layout",
    "spacing",
];
const MICROPHONE: Keys = &[
    "name",
    "shape",
    "position",
    "facing",
    "track",
    "interpolation",
    "time_offset",
    "up",
    "unit",
    "frame_rate",
    "offset",
];
const SHAPE: Keys = &["c", "k"];
const LISTENER_KEY: Keys = &["t", "position", "facing"];
const MATERIAL: Keys = &["impact"];
const IMPACT: Keys = &[
    "recordings",
    "gain_db",
    "reference_impulse",
    "floor_impulse",
    "retrigger",
    "speed_variation",
    "reference_distance",
];
const OBJECT: Keys = &[
    "name",
    "source",
    "position",
    "track",
    "interpolation",
    "time_offset",
    "up",
    "unit",
    "frame_rate",
    "faces",
    "offset",
    "point",
    "material",
    "body",
    "sound",
];
const OBJECT_KEY: Keys = &["t", "position"];
const POINT: Keys = &["vertex"];
/// What a sound may have wherever it stands.
const OBJECT_SOUND: Keys = &[
    "recording",
    "recordings",
    "loop",
    "channel",
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
const SOUND: Keys = &[
    "object",
    "position",
    "recording",
    "recordings",
    "loop",
    "channel",
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
const START: Keys = &["t", "gain_db", "speed"];
const CONTACTS: Keys = &["log", "columns", "step", "up", "unit", "time_offset"];
const COLUMNS: Keys =
    &["t", "a", "b", "position", "normal", "normal_force", "normal_impulse", "normal_velocity"];

/// Every kind of table with the keys it may have, under the headings of `docs/scene.md`.
#[cfg(test)]
pub(crate) const ALL_KEYS: &[(&str, Keys)] = &[
    ("The scene", SCENE),
    ("`[listener]`", LISTENER),
    ("`[[microphone]]`", MICROPHONE),
    ("`shape` of a microphone", SHAPE),
    ("A key of a listener's or microphone's `track`", LISTENER_KEY),
    ("`[material.NAME]`", MATERIAL),
    ("`impact` of a material", IMPACT),
    ("`[[object]]`", OBJECT),
    ("A key of an object's `track`", OBJECT_KEY),
    ("`point` of an object", POINT),
    ("`sound` of an object", OBJECT_SOUND),
    ("`[[sound]]`", SOUND),
    ("A key of `at`", START),
    ("`[[contacts]]`", CONTACTS),
    ("`columns` of a contact log", COLUMNS),
];

/// The most output channels of a scene.
const MOST_MICROPHONES: usize = 1024;
/// The most files or patterns in one list of recordings.
const MOST_RECORDINGS: usize = 10_000;
const RATE_HZ: (u64, u64) = (8_000, 192_000);
const INTERPOLATIONS: &[(&str, Interpolation)] =
    &[("smooth", Interpolation::Smooth), ("linear", Interpolation::Linear), ("step", Interpolation::Step)];
const AHEAD: [f64; 3] = [0.0, 0.0, -1.0];

/// The longest scene file that is read, in bytes.
const LONGEST_FILE_BYTES: u64 = 16 << 20;

impl Scene {
    /// Reads a scene file. Its paths start from the folder it lies in, and may leave it only with
    /// `allow_outside`.
    ///
    /// # Errors
    /// A file that cannot be read or is longer than 16 MiB; text that is not TOML;
    /// a key that is unknown, missing or has a value it cannot have; a reference to a file, object
    /// or material that is not there. All name the file, line and key.
    pub fn open(path: impl AsRef<Path>, allow_outside: bool) -> Result<Self> {
        use std::io::Read;
        let path = path.as_ref();
        let fail = |fault| Error::io("read", path, fault);
        let file = std::fs::File::open(path).map_err(fail)?;
        let mut bytes = Vec::new();
        file.take(LONGEST_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(fail)?;
        if bytes.len() as u64 > LONGEST_FILE_BYTES {
            return Err(
                Error::new(format!("longer than {LONGEST_FILE_BYTES} bytes: not a scene")).in_file(path)
            );
        }
        let text = String::from_utf8(bytes).map_err(|fault| {
            let offset = fault.utf8_error().valid_up_to() as u64;
            Error::new("not UTF-8 text").in_file(path).at(Place::Byte(offset)).because(fault)
        })?;
        Self::parse(&text, path, allow_outside)
    }

    /// Reads a scene from text, as if it stood in `file`: messages name that file and paths start
    /// from its folder. The file itself need not exist.
    ///
    /// # Errors
    /// As [`Scene::open`].
    ///
    /// ```
    /// use froufrou::scene::Scene;
    /// let scene = Scene::parse("rate = 96000\n[listener]\nlayout = 'mono'", "scene.toml", false)?;
    /// assert_eq!((scene.rate_hz, scene.microphones.len()), (96000, 1));
    ///
    /// let error = Scene::parse("seed = 1\nrat = 44100", "scene.toml", false).unwrap_err();
    /// assert_eq!(error.to_string(), "scene.toml:2:1: unknown key `rat` (did you mean `rate`?)");
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    pub fn parse(text: &str, file: impl AsRef<Path>, allow_outside: bool) -> Result<Self> {
        let file = file.as_ref();
        let parent = file.parent().unwrap_or(Path::new(""));
        let folder = Folder::new(parent, allow_outside)?;
        scene(text, file, parent, &folder)
    }
}

/// Reads a whole scene.
fn scene(text: &str, file: &Path, folder_path: &Path, folder: &Folder) -> Result<Scene> {
    let document = Document { file: file.to_owned(), text };
    let tree = document.parse()?;
    let top = Table::root(&document, &tree, SCENE)?;
    let number = |key: &str, default: f64| -> Result<f64> {
        top.get(key).map_or(Ok(default), |node| node.positive("a number"))
    };
    let rate = top.get("rate").map_or(Ok(48_000), |n| n.whole("samples a second", RATE_HZ.0, RATE_HZ.1))?;
    let listener = listener(&top, folder)?;
    let mut scene = Scene {
        file: file.to_owned(),
        folder: folder_path.to_owned(),
        rate_hz: u32::try_from(rate).unwrap_or(u32::MAX),
        // TOML's whole numbers end at 2⁶³ − 1.
        seed: top.get("seed").map_or(Ok(0), |n| n.whole("a seed", 0, i64::MAX as u64))?,
        duration_s: top.get("duration").map(|n| n.positive("a number of seconds")).transpose()?,
        start_s: top.get("start").map(|n| n.number("a number of seconds")).transpose()?,
        speed_of_sound_mps: number("speed_of_sound", 343.0)?,
        frame_rate_hz: top
            .get("frame_rate")
            .map_or(Ok(60.0), |n| n.within("frames a second", 1.0, 10_000.0))?,
        microphones: match &listener {
            Some(listener) => listener.microphones(),
            None => microphones(&top, folder)?,
        },
        listener,
        materials: Vec::new(),
        objects: Vec::new(),
        sounds: Vec::new(),
        contacts: Vec::new(),
    };
    if let Some(node) = top.get("material") {
        for (name, node) in node.named()?.entries() {
            scene.materials.push(material(name, &node, folder)?);
        }
    }
    let material_names = scene.materials.iter().enumerate().map(|(i, m)| (m.name.as_str(), i)).collect();
    let mut names = HashMap::new();
    for node in list(&top, "object")? {
        let table = node.table(OBJECT)?;
        let object = object(&table, &material_names, folder)?;
        let index = scene.objects.len();
        if names.insert(object.name.clone(), index).is_some() {
            let name = table.required("name", "a name")?;
            return Err(name.error(format!("there is another object {:?}", object.name)));
        }
        let moves = object.motion.is_some();
        scene.objects.push(object);
        for node in table.get("sound").map_or(Ok(Vec::new()), |n| one_or_many(&n))? {
            if !moves {
                return Err(node.error("the object has no place: it needs `source`, `position` or `track`"));
            }
            scene.sounds.push(sound(&node.table(OBJECT_SOUND)?, Emitter::Object(index), folder)?);
        }
    }
    for node in list(&top, "sound")? {
        let table = node.table(SOUND)?;
        let emitter = emitter(&table, &scene.objects, &names)?;
        scene.sounds.push(sound(&table, emitter, folder)?);
    }
    for node in list(&top, "contacts")? {
        scene.contacts.push(contacts(&node.table(CONTACTS)?, folder)?);
    }
    Ok(scene)
}

/// The tables of a `[[key]]`, none where it is not there.
fn list<'d, 't>(top: &Table<'d, 't>, key: &str) -> Result<Vec<Node<'d, 't>>> {
    top.get(key).map_or(Ok(Vec::new()), |node| node.list(&format!("tables, each under `[[{key}]]`")))
}

/// The elements of a list, or the one value that stands for a list of one.
fn one_or_many<'d, 't>(node: &Node<'d, 't>) -> Result<Vec<Node<'d, 't>>> {
    if node.is_list() { node.list("a list") } else { Ok(vec![node.clone()]) }
}

/// Gives a fault with a file the place of the key that named the file.
fn with_place<T>(node: &Node<'_, '_>, result: Result<T>) -> Result<T> {
    result.map_err(|fault| node.error(fault.to_string()).because(fault))
}

/// Who listens: a listener, or else microphones.
fn listener(top: &Table<'_, '_>, folder: &Folder) -> Result<Option<Listener>> {
    top.at_most_one(&["listener", "microphone"])?;
    if top.get("microphone").is_some() {
        return Ok(None);
    }
    let Some(table) = top.get("listener").map(|node| node.table(LISTENER)).transpose()? else {
        return Ok(Some(Listener {
            motion: Motion::Track(still([0.0; 3], AHEAD)),
            local_offset_m: [0.0; 3],
            local_facing: AHEAD,
            layout: Layout::default(),
            spacing_m: 0.0,
        }));
    };
    let (motion, local_facing) = carrier(&table, folder)?;
    let local_offset_m = offset(&table)?;
    let names = Layout::ALL.map(Layout::name);
    let layout = table.get("layout").map(|node| node.choice(&names)).transpose()?;
    let layout = layout.map_or(Layout::default(), |index| Layout::ALL[index]);
    let spacing_m = table.get("spacing").map_or(Ok(0.0), |node| match layout {
        Layout::Mono => Err(node.error("a mono listener has no `spacing`")),
        Layout::Stereo => node.not_negative("a number of metres"),
    })?;
    Ok(Some(Listener { motion, local_offset_m, local_facing, layout, spacing_m }))
}

fn microphones(top: &Table<'_, '_>, folder: &Folder) -> Result<Vec<Microphone>> {
    let nodes = list(top, "microphone")?;
    if let Some(node) = top.get("microphone")
        && nodes.is_empty()
    {
        return Err(node.error("expected at least one microphone"));
    }
    let mut microphones: Vec<Microphone> = Vec::new();
    if let Some(node) = nodes.get(MOST_MICROPHONES) {
        return Err(node.error(format!("more than {MOST_MICROPHONES} microphones")));
    }
    for node in nodes {
        let table = node.table(MICROPHONE)?;
        let name_node = table.required("name", "a name for the output channel")?;
        let name = name_node.text("a name")?;
        if microphones.iter().any(|m| m.name == name) {
            return Err(name_node.error(format!("there is another microphone {name:?}")));
        }
        let (motion, local_facing) = carrier(&table, folder)?;
        microphones.push(Microphone {
            name,
            shape: table.get("shape").map_or(Ok(OMNI), |node| shape(&node))?,
            motion,
            local_offset_m: offset(&table)?,
            local_facing,
        });
    }
    Ok(microphones)
}

fn shape(node: &Node<'_, '_>) -> Result<MicrophoneShape> {
    if node.is_text() {
        return Ok([OMNI, CARDIOID][node.choice(&["omni", "cardioid"])?]);
    }
    if !node.is_table() {
        return Err(node.expected("`omni`, `cardioid` or a table { c = …, k = … }"));
    }
    let table = node.table(SHAPE)?;
    // A lobe of k = 1000 is 6° wide; beyond it powers run out of their range.
    let part = |key: &str| table.get(key).map_or(Ok(0.0), |n| n.within("a number", 0.0, 1000.0));
    Ok(MicrophoneShape { c: part("c")?, k: part("k")? })
}

fn offset(table: &Table<'_, '_>) -> Result<[f64; 3]> {
    table.get("offset").map_or(Ok([0.0; 3]), |node| node.vector("metres in the local frame"))
}

fn still(position_m: [f64; 3], facing: [f64; 3]) -> Track {
    let key = TrackKey { time_s: 0.0, position_m, facing };
    Track { keys: vec![key], interpolation: Interpolation::Step }
}

/// What carries a listener or microphone, and the direction it faces in the carrier's frame.
fn carrier(table: &Table<'_, '_>, folder: &Folder) -> Result<(Motion, [f64; 3])> {
    table.at_most_one(&["position", "track"])?;
    let facing = table.get("facing").map(|node| node.direction("a direction")).transpose()?;
    match table.get("track") {
        Some(node) if node.is_text() => {
            needs(table, "interpolation", "a hand-set `track`")?;
            Ok((Motion::Source(Box::new(source(&node, table, folder)?)), facing.unwrap_or(AHEAD)))
        }
        Some(node) => {
            needs_file(table)?;
            if let Some(facing) = table.get("facing") {
                return Err(facing.error("a hand-set `track` has `facing` in its keys"));
            }
            Ok((Motion::Track(track(&node, table, LISTENER_KEY)?), AHEAD))
        }
        None => {
            needs(table, "interpolation", "a hand-set `track`")?;
            needs(table, "time_offset", "a `track`")?;
            needs_file(table)?;
            let position = table.get("position").map_or(Ok([0.0; 3]), |node| node.vector("metres"))?;
            Ok((Motion::Track(still(position, facing.unwrap_or(AHEAD))), AHEAD))
        }
    }
}

/// Refuses a key that means nothing here.
fn needs(table: &Table<'_, '_>, key: &str, what: &str) -> Result<()> {
    table.get(key).map_or(Ok(()), |node| Err(node.error(format!("means nothing without {what}"))))
}

/// Refuses keys that say how a file is read where there is no file.
fn needs_file(table: &Table<'_, '_>) -> Result<()> {
    ["up", "unit", "frame_rate", "faces"].iter().try_for_each(|key| needs(table, key, "an animation file"))
}

fn up(table: &Table<'_, '_>) -> Result<Option<UpAxis>> {
    let choice = table.get("up").map(|node| node.choice(&["y", "z"])).transpose()?;
    Ok(choice.map(|index| [UpAxis::Y, UpAxis::Z][index]))
}

fn unit_m(table: &Table<'_, '_>) -> Result<Option<f64>> {
    table.get("unit").map(|node| node.within("a number of metres", 1e-9, 1e9)).transpose()
}

/// How the numbers of an animation file are meant.
fn conventions(table: &Table<'_, '_>, folder: &Folder) -> Result<Conventions> {
    let what = "an animation file with the faces of the mesh";
    Ok(Conventions {
        up: up(table)?,
        unit_m: unit_m(table)?,
        frame_rate_hz: table
            .get("frame_rate")
            .map(|node| node.within("frames a second", 0.001, 1_000_000.0))
            .transpose()?,
        faces: table
            .get("faces")
            .map(|node| with_place(&node, folder.file(&node.text(what)?)).map(|asset| asset.path))
            .transpose()?,
    })
}

fn time_offset(table: &Table<'_, '_>) -> Result<f64> {
    table.get("time_offset").map_or(Ok(0.0), |node| node.number("a number of seconds"))
}

/// `file#/path/of/object`.
fn source(node: &Node<'_, '_>, table: &Table<'_, '_>, folder: &Folder) -> Result<Source> {
    let what = "an animation file and an object in it, as \"file.abc#/object\"";
    let text = node.text(what)?;
    let Some((file, object)) = text.split_once("#/") else { return Err(node.expected(what)) };
    if file.is_empty() || object.is_empty() {
        return Err(node.expected(what));
    }
    let several = with_place(node, folder.files(file))?;
    let file = match <[Asset; 1]>::try_from(several) {
        Ok([one]) if one.name == file => one,
        // Every file of the sequence is inside the folder; they are found again by their pattern.
        _ if obj::is_in_one_folder(file) => Asset { name: file.to_owned(), path: folder.path().join(file) },
        _ => {
            return Err(node.error("a pattern of files may stand in their name and not in that of a folder"));
        }
    };
    Ok(Source {
        file,
        conventions: conventions(table, folder)?,
        object: with_place(node, NamePattern::new(&format!("/{object}")))?,
        time_offset_s: time_offset(table)?,
    })
}

/// A list of keys set by hand, with `interpolation` and `time_offset` beside it.
fn track(node: &Node<'_, '_>, table: &Table<'_, '_>, keys: Keys) -> Result<Track> {
    let words: Vec<&str> = INTERPOLATIONS.iter().map(|(word, _)| *word).collect();
    let choice = table.get("interpolation").map_or(Ok(0), |node| node.choice(&words))?;
    let offset_s = time_offset(table)?;
    let mut track = Track { keys: Vec::new(), interpolation: INTERPOLATIONS[choice].1 };
    for node in node.list("a list of keys { t = …, position = … }")? {
        let key = node.table(keys)?;
        let time = key.required("t", "a number of seconds")?;
        let time_s = time.number("a number of seconds")? + offset_s;
        if let Some(last) = track.keys.last()
            && last.time_s >= time_s
        {
            return Err(time.error(format!(
                "keys must be in ascending order of time: expected more than {}, found {}",
                last.time_s - offset_s,
                time_s - offset_s
            )));
        }
        let position_m = key.required("position", "metres as [x, y, z]")?.vector("metres")?;
        let facing = key.get("facing").map_or(Ok(AHEAD), |node| node.direction("a direction"))?;
        track.keys.push(TrackKey { time_s, position_m, facing });
    }
    if track.keys.is_empty() {
        return Err(node.error("expected at least one key"));
    }
    Ok(track)
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
    // 200 dB is a factor of 10¹⁰, where every mistake is heard before the sound.
    table.get("gain_db").map_or(Ok(0.0), |node| node.within("decibels", -200.0, 200.0))
}

fn reference_distance(table: &Table<'_, '_>) -> Result<f64> {
    table.get("reference_distance").map_or(Ok(1.0), |node| node.positive("a number of metres"))
}

fn speed(table: &Table<'_, '_>) -> Result<f64> {
    table.get("speed").map_or(Ok(1.0), |node| node.within("a playback speed", 0.01, 100.0))
}

fn speed_variation(table: &Table<'_, '_>) -> Result<f64> {
    table.get("speed_variation").map_or(Ok(0.0), |node| node.within("a fraction", 0.0, 0.9))
}

fn material(name: &str, node: &Node<'_, '_>, folder: &Folder) -> Result<Material> {
    if name.is_empty() {
        return Err(node.error("a material needs a name"));
    }
    let table = node.table(MATERIAL)?;
    let impact = table.get("impact").map(|node| impact(&node.table(IMPACT)?, folder)).transpose()?;
    Ok(Material { name: name.to_owned(), impact })
}

fn impact(table: &Table<'_, '_>, folder: &Folder) -> Result<ImpactSound> {
    let newton_seconds = "a number of newton seconds";
    let node = table.required("recordings", "a list of recordings")?;
    Ok(ImpactSound {
        recordings: required_recordings(&node, folder)?,
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

/// "There is no material `wod`": with the nearest of those there are.
fn unknown(node: &Node<'_, '_>, kind: &str, name: &str, names: &[&str]) -> Error {
    let error = node.error(format!("there is no {kind} {name:?}"));
    match nearest(name, names.iter().copied()) {
        Some(near) => error.help(format!("did you mean `{near}`?")),
        None => error,
    }
}

fn object(table: &Table<'_, '_>, materials: &HashMap<&str, usize>, folder: &Folder) -> Result<Object> {
    let name = table.required("name", "a name")?.text("a name")?;
    table.at_most_one(&["source", "position", "track"])?;
    let motion = match (table.get("source"), table.get("track"), table.get("position")) {
        (Some(node), _, _) => Some(Motion::Source(Box::new(source(&node, table, folder)?))),
        (_, Some(node), _) => Some(Motion::Track(track(&node, table, OBJECT_KEY)?)),
        (_, _, Some(node)) => Some(Motion::Track(still(node.vector("metres")?, AHEAD))),
        _ => None,
    };
    if !matches!(motion, Some(Motion::Source(_))) {
        needs_file(table)?;
        needs(table, "point", "a `source`")?;
        needs(table, "offset", "a `source`")?;
        if table.get("track").is_none() {
            needs(table, "time_offset", "a `source` or `track`")?;
        }
    }
    if table.get("track").is_none() {
        needs(table, "interpolation", "a `track`")?;
    }
    table.at_most_one(&["point", "offset"])?;
    let point = match table.get("point") {
        Some(node) => {
            let point = node.table(POINT)?;
            let vertex = point.required("vertex", "the number of a vertex, from 0")?;
            Point::Vertex(vertex.whole("the number of a vertex", 0, u64::from(u32::MAX))? as usize)
        }
        None => Point::Offset(offset(table)?),
    };
    let material = match table.get("material") {
        Some(node) => {
            let wanted = node.text("the name of a material")?;
            let index = materials.get(wanted.as_str()).copied();
            Some(index.ok_or_else(|| {
                // In order, so that of two that are equally near always the same is suggested.
                let mut names: Vec<&str> = materials.keys().copied().collect();
                names.sort_unstable();
                unknown(&node, "material", &wanted, &names)
            })?)
        }
        None => None,
    };
    let body = match table.get("body") {
        Some(node) => with_place(&node, NamePattern::new(&node.text("the name of a body")?))?,
        None => NamePattern::literal(&name),
    };
    Ok(Object { name, motion, point, material, body })
}

fn emitter(table: &Table<'_, '_>, objects: &[Object], names: &HashMap<String, usize>) -> Result<Emitter> {
    table.at_most_one(&["object", "position"])?;
    if let Some(node) = table.get("position") {
        return Ok(Emitter::Position(node.vector("metres")?));
    }
    let node = table.required("object", "the name of an object, or `position` instead")?;
    let name = node.text("the name of an object")?;
    let Some(&index) = names.get(&name) else {
        let names: Vec<&str> = objects.iter().map(|o| o.name.as_str()).collect();
        return Err(unknown(&node, "object", &name, &names));
    };
    if objects.get(index).is_none_or(|object| object.motion.is_none()) {
        return Err(
            node.error(format!("the object {name:?} has no place: it needs `source`, `position` or `track`"))
        );
    }
    Ok(Emitter::Object(index))
}

fn sound(table: &Table<'_, '_>, emitter: Emitter, folder: &Folder) -> Result<SceneSound> {
    let seconds = "a number of seconds";
    table.at_most_one(&["recording", "recordings"])?;
    let recordings = match (table.get("recording"), table.get("recordings")) {
        (Some(node), _) => vec![with_place(&node, folder.file(&node.text("the name of a recording")?))?],
        (_, Some(node)) => required_recordings(&node, folder)?,
        _ => return Err(table.error("`recording` is missing: expected the name of a recording")),
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
    Ok(SceneSound {
        emitter,
        recordings,
        repeat,
        channel: table.get("channel").map(|n| n.whole("a channel", 0, 1023)).transpose()?.map(|c| c as usize),
        gain_db: gain_db(table)?,
        speed: speed(table)?,
        speed_variation: speed_variation(table)?,
        timing: timing(table, repeat)?,
        fade_in_s: table.get("fade_in").map_or(Ok(0.0), |n| n.not_negative(seconds))?,
        fade_out_s: table.get("fade_out").map_or(Ok(0.0), |n| n.not_negative(seconds))?,
        reference_distance_m: reference_distance(table)?,
    })
}

fn timing(table: &Table<'_, '_>, repeat: Repeat) -> Result<Timing> {
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
    if repeat != Repeat::Once {
        return Err(node.error("a loop has no end: it takes `from` and `to`"));
    }
    let mut starts = Vec::new();
    for node in node.list("a list of times or of keys { t = … }")? {
        starts.push(if node.is_table() {
            let key = node.table(START)?;
            let time_s = key.required("t", seconds)?.not_negative(seconds)?;
            StartKey { time_s, gain_db: gain_db(&key)?, speed: speed(&key)? }
        } else {
            StartKey {
                time_s: node.not_negative("a number of seconds or a key { t = … }")?,
                gain_db: 0.0,
                speed: 1.0,
            }
        });
    }
    if starts.is_empty() {
        return Err(node.error("expected at least one time"));
    }
    starts.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(Timing::Starts(starts))
}

fn contacts(table: &Table<'_, '_>, folder: &Folder) -> Result<Contacts> {
    let log = table.required("log", "the name of a CSV file, which may be gzipped")?;
    let asset = with_place(&log, folder.file(&log.text("the name of a CSV file")?))?;
    let columns = table.required("columns", "a table of the log's column names")?.table(COLUMNS)?;
    let name = |key: &str| columns.required(key, "the name of a column")?.text("the name of a column");
    let names = |node: Node<'_, '_>| -> Result<[String; 3]> {
        let what = "the names of three columns";
        let list = node.list(what)?;
        let [x, y, z] = list.as_slice() else { return Err(node.expected(what)) };
        Ok([x.text("a column")?, y.text("a column")?, z.text("a column")?])
    };
    columns.at_most_one(&["normal_force", "normal_impulse"])?;
    let push = match (columns.get("normal_force"), columns.get("normal_impulse")) {
        (Some(node), _) => Push::Force(node.text("the name of a column")?),
        (_, Some(node)) => Push::Impulse(node.text("the name of a column")?),
        _ => return Err(columns.error("`normal_force` or `normal_impulse` is missing: expected one of them")),
    };
    Ok(Contacts {
        log: asset,
        columns: ContactColumns {
            time: name("t")?,
            a: name("a")?,
            b: name("b")?,
            position: names(columns.required("position", "the names of three columns")?)?,
            push,
            normal: columns.get("normal").map(names).transpose()?,
            normal_velocity: columns
                .get("normal_velocity")
                .map(|node| node.text("the name of a column"))
                .transpose()?,
            up: up(table)?.unwrap_or_default(),
            unit_m: unit_m(table)?.unwrap_or(1.0),
            time_offset_s: time_offset(table)?,
        },
        step_s: table.get("step").map(|n| n.within("a number of seconds", 1e-6, 1.0)).transpose()?,
    })
}

#[cfg(test)]
mod tests;
