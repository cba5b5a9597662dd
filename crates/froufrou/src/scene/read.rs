//! From the text of a scene file to a checked [`Scene`].

use std::collections::HashMap;
use std::path::Path;

use crate::score::{Loudspeaker, MicrophoneShape, Pickup};
use crate::{Error, Place, Result};

use super::asset::{Asset, Folder, NamePattern};
use super::contact_log::{ContactColumns, Push};
use super::conventions::{Conventions, UpAxis};
use super::file::{
    Contacts, Emitter, Microphone, Motion, Object, Point, Scene, Size, Source, Swarm, Touching, Wind,
};
use super::listener::{CARDIOID, Layout, Listener, OMNI};
use super::obj;
use super::pose_log::PoseColumns;
use super::toml::{Document, Node, Table, nearest};
use super::track::{Interpolation, Track, TrackKey};

mod cloth;
mod enclosure;
mod named;
mod paper;
mod sounds;

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
    "wind",
    "air",
    "room",
    "plane",
    "instrument",
    "material",
    "object",
    "sound",
    "ambient",
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
    "clip",
    "columns",
    "offset",
    "layout",
    "spacing",
    "head",
    "shared",
];
const LOUDSPEAKER: Keys = &["name", "azimuth", "elevation", "lfe"];
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
    "clip",
    "columns",
    "offset",
];
const SHAPE: Keys = &["c", "k"];
const LISTENER_KEY: Keys = &["t", "position", "facing"];
const OBJECT: Keys = &[
    "name",
    "source",
    "position",
    "track",
    "interpolation",
    "time_offset",
    "swarm",
    "size",
    "up",
    "unit",
    "frame_rate",
    "faces",
    "clip",
    "columns",
    "offset",
    "point",
    "material",
    "mass",
    "body",
    "sound",
];
const OBJECT_KEY: Keys = &["t", "position"];
const POINT: Keys = &["vertex"];
const SWARM: Keys = &["count", "radius", "speed", "script"];
const WIND: Keys = &["velocity", "gusts", "gust_period"];
const CONTACTS: Keys = &["log", "bodies", "columns", "step", "up", "unit", "time_offset", "gravity"];
const POSE_COLUMNS: Keys = &["t", "body", "position", "rotation", "velocity", "angular_velocity"];
const COLUMNS: Keys = &[
    "t",
    "a",
    "b",
    "position",
    "normal",
    "normal_force",
    "normal_impulse",
    "normal_velocity",
    "sliding_velocity",
];

/// Every kind of table with the keys it may have, under the headings of `docs/scene.md`.
#[cfg(test)]
pub(crate) const ALL_KEYS: &[(&str, Keys)] = &[
    ("The scene", SCENE),
    ("`[listener]`", LISTENER),
    ("A loudspeaker of `layout`", LOUDSPEAKER),
    ("`[[microphone]]`", MICROPHONE),
    ("`shape` of a microphone", SHAPE),
    ("A key of a listener's or microphone's `track`", LISTENER_KEY),
    ("`[wind]`", WIND),
    ("`[air]`", enclosure::AIR),
    ("`[room]`", enclosure::ROOM),
    ("`absorption` of the walls of a room", enclosure::WALLS),
    ("`[[plane]]`", enclosure::PLANE),
    ("`[instrument.NAME]`", sounds::INSTRUMENT),
    ("A mode of `modes`", sounds::MODE),
    ("`[material.NAME]`", sounds::MATERIAL),
    ("`impact` of a material", sounds::IMPACT),
    ("`slide` and `roll` of a material", sounds::RUB),
    ("`grains` of a material", sounds::GRAINS),
    ("`cloth` of a material", cloth::CLOTH),
    ("`membrane` of a cloth", cloth::SHEET),
    ("`paper` of a material", paper::PAPER),
    ("`air` of a material", sounds::AIR),
    ("`reflect` of a material", sounds::REFLECT),
    ("`occlude` of a material", sounds::OCCLUDE),
    ("`[[object]]`", OBJECT),
    ("A key of an object's `track`", OBJECT_KEY),
    ("`point` of an object", POINT),
    ("`swarm` of an object", SWARM),
    ("`sound` of an object", sounds::OBJECT_SOUND),
    ("`[[sound]]`", sounds::SOUND),
    ("`[[ambient]]`", sounds::AMBIENT),
    ("Patterns", sounds::PATTERN),
    ("A key of `at`", sounds::START),
    ("A key of `at` of an instrument", sounds::STRIKE),
    ("Kinds of instruments", sounds::KINDS),
    ("`[[contacts]]`", CONTACTS),
    ("`columns` of a contact log", COLUMNS),
    ("`columns` of a pose log", POSE_COLUMNS),
];

/// The most output channels of a scene.
const MOST_MICROPHONES: usize = 1024;
/// The most members of a swarm.
const MOST_IN_SWARM: u64 = 10_000;
const RATE_HZ: (u64, u64) = (8_000, 192_000);
const INTERPOLATIONS: &[(&str, Interpolation)] =
    &[("smooth", Interpolation::Smooth), ("linear", Interpolation::Linear), ("step", Interpolation::Step)];
/// Gravity, where the author says nothing else.
const GRAVITY_MPS2: [f64; 3] = [0.0, -9.81, 0.0];
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
    let air = enclosure::air(&top)?;
    let usual_mps = air.map_or(343.0, |air| air.speed_of_sound_mps());
    let mut scene = Scene {
        file: file.to_owned(),
        folder: folder_path.to_owned(),
        rate_hz: u32::try_from(rate).unwrap_or(u32::MAX),
        // TOML's whole numbers end at 2⁶³ − 1.
        seed: top.get("seed").map_or(Ok(0), |n| n.whole("a seed", 0, i64::MAX as u64))?,
        duration_s: top.get("duration").map(|n| n.positive("a number of seconds")).transpose()?,
        start_s: top.get("start").map(|n| n.number("a number of seconds")).transpose()?,
        speed_of_sound_mps: number("speed_of_sound", usual_mps)?,
        frame_rate_hz: top
            .get("frame_rate")
            .map_or(Ok(60.0), |n| n.within("frames a second", 1.0, 10_000.0))?,
        microphones: match &listener {
            Some(listener) => listener.microphones(),
            None => microphones(&top, folder)?,
        },
        listener,
        air,
        enclosing: None,
        wind: top.get("wind").map(|node| wind(&node)).transpose()?,
        instruments: sounds::instruments(&top, folder)?,
        materials: Vec::new(),
        objects: Vec::new(),
        sounds: Vec::new(),
        contacts: Vec::new(),
        touching: Vec::new(),
    };
    if let Some(node) = top.get("material") {
        for (name, node) in node.named()?.entries() {
            scene.materials.push(sounds::material(name, &node, &scene.instruments, folder)?);
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
            let table = node.table(sounds::OBJECT_SOUND)?;
            scene.sounds.push(sounds::sound(&table, Emitter::Object(index), &scene.instruments, folder)?);
        }
        scene.sounds.extend(sounds::air(&scene, index));
    }
    scene.enclosing = enclosure::enclosing(&top, &scene.objects)?;
    for node in list(&top, "sound")? {
        let table = node.table(sounds::SOUND)?;
        let emitter = emitter(&table, &scene.objects, &names)?;
        scene.sounds.push(sounds::sound(&table, emitter, &scene.instruments, folder)?);
    }
    for node in list(&top, "ambient")? {
        let table = node.table(sounds::AMBIENT)?;
        let around = microphone(&table, &scene.microphones)?;
        let emitter = Emitter::Around(around);
        scene.sounds.push(sounds::sound(&table, emitter, &scene.instruments, folder)?);
    }
    for node in list(&top, "contacts")? {
        let table = node.table(CONTACTS)?;
        table.at_most_one(&["log", "bodies"])?;
        match table.get("bodies") {
            Some(bodies) => scene.touching.push(touching(&table, &bodies)?),
            None => scene.contacts.push(contacts(&table, folder)?),
        }
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
            head: None,
            shared: false,
        }));
    };
    let (motion, local_facing) = carrier(&table, folder)?;
    let local_offset_m = offset(&table)?;
    let layout = table.get("layout").map_or(Ok(Layout::default()), |node| layout(&node))?;
    let spacing_m = table.get("spacing").map_or(Ok(0.0), |node| match layout {
        Layout::Stereo => node.not_negative("a number of metres"),
        _ => Err(node.error("`spacing` is for a listener whose layout is `stereo`")),
    })?;
    let head = match table.get("head") {
        None => None,
        Some(node) if layout == Layout::Binaural => {
            Some(with_place(&node, folder.file(&node.text("the file of a head")?))?)
        }
        Some(node) => return Err(node.error("`head` is for a listener whose layout is `binaural`")),
    };
    let shared = table.get("shared").map_or(Ok(false), |node| match layout {
        Layout::Binaural => node.as_flag().ok_or_else(|| node.expected("true or false")),
        _ => Err(node.error("`shared` is for a listener whose layout is `binaural`")),
    })?;
    Ok(Some(Listener { motion, local_offset_m, local_facing, layout, spacing_m, head, shared }))
}

/// How a listener hears: the name of a layout, or loudspeakers.
fn layout(node: &Node<'_, '_>) -> Result<Layout> {
    if !node.is_list() {
        let names: Vec<&str> = Layout::names().collect();
        return Ok(Layout::named(names[node.choice(&names)?]).unwrap_or_default());
    }
    let mut all: Vec<Loudspeaker> = Vec::new();
    for node in node.list("a name or a list of loudspeakers")? {
        let table = node.table(LOUDSPEAKER)?;
        let name_node = table.required("name", "a name for the output channel")?;
        let name = name_node.text("a name")?;
        if all.iter().any(|other| other.name == name) {
            return Err(name_node.error(format!("there is another loudspeaker {name:?}")));
        }
        let is_lfe = table
            .get("lfe")
            .map_or(Ok(false), |node| node.as_flag().ok_or_else(|| node.expected("`true` or `false`")))?;
        if is_lfe && let Some(node) = table.get("azimuth").or(table.get("elevation")) {
            return Err(
                node.error("low effects come from nowhere: a loudspeaker that is `lfe` has no direction")
            );
        }
        let azimuth_deg = match table.get("azimuth") {
            Some(node) => node.within("degrees to the left", -360.0, 360.0)?,
            None if is_lfe => 0.0,
            None => table.required("azimuth", "degrees to the left")?.number("degrees to the left")?,
        };
        let elevation_deg =
            table.get("elevation").map_or(Ok(0.0), |node| node.within("degrees upwards", -90.0, 90.0))?;
        all.push(Loudspeaker { name, azimuth_deg, elevation_deg, is_lfe });
    }
    let layout = Layout::Loudspeakers(all);
    layout.check().map_err(|fault| node.error(fault.to_string()))?;
    Ok(layout)
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
            pickup: Pickup::Shape(table.get("shape").map_or(Ok(OMNI), |node| shape(&node))?),
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

/// The microphone that an ambience is around, if it is around one alone.
fn microphone(table: &Table<'_, '_>, microphones: &[Microphone]) -> Result<Option<usize>> {
    let Some(node) = table.get("microphone") else { return Ok(None) };
    let name = node.text("the name of a microphone")?;
    let index = microphones.iter().position(|microphone| microphone.name == name);
    index.map(Some).ok_or_else(|| {
        let names: Vec<&str> = microphones.iter().map(|microphone| microphone.name.as_str()).collect();
        unknown(&node, "microphone", &name, &names)
    })
}

fn wind(node: &Node<'_, '_>) -> Result<Wind> {
    let table = node.table(WIND)?;
    Ok(Wind {
        velocity_mps: table
            .required("velocity", "metres a second as [x, y, z]")?
            .vector("metres a second")?,
        gusts: table.get("gusts").map_or(Ok(0.3), |node| node.within("a fraction", 0.0, 2.0))?,
        gust_period_s: table
            .get("gust_period")
            .map_or(Ok(4.0), |node| node.within("a number of seconds", 0.01, 1e6))?,
    })
}

/// Two lengths make a rectangle, three a box.
fn size(node: &Node<'_, '_>) -> Result<Size> {
    let what = "[width, height] or [x, y, z] in metres";
    let lengths = node.list(what)?;
    let lengths: Vec<f64> =
        lengths.iter().map(|node| node.within("a number of metres", 1e-4, 1e6)).collect::<Result<_>>()?;
    match lengths[..] {
        [width, height] => Ok(Size::Rectangle([width, height])),
        [x, y, z] => Ok(Size::Box([x, y, z])),
        _ => Err(node.expected(what)),
    }
}

fn swarm(node: &Node<'_, '_>, folder: &Folder) -> Result<Swarm> {
    let table = node.table(SWARM)?;
    table.at_most_one(&["script", "radius"])?;
    table.at_most_one(&["script", "speed"])?;
    let script = table.get("script").map(|node| {
        let name = node.text("the name of a script")?;
        with_place(&node, folder.file(&name))
    });
    Ok(Swarm {
        count: table.required("count", "how many there are")?.whole("how many", 1, MOST_IN_SWARM)? as usize,
        radius_m: table.get("radius").map_or(Ok(1.0), |node| node.positive("a number of metres"))?,
        speed_mps: table.get("speed").map_or(Ok(2.0), |node| node.within("metres a second", 0.0, 300.0))?,
        script: script.transpose()?,
    })
}

/// Refuses a key that means nothing here.
fn needs(table: &Table<'_, '_>, key: &str, what: &str) -> Result<()> {
    table.get(key).map_or(Ok(()), |node| Err(node.error(format!("means nothing without {what}"))))
}

/// Refuses keys that say how a file is read where there is no file.
fn needs_file(table: &Table<'_, '_>) -> Result<()> {
    ["up", "unit", "frame_rate", "faces", "clip", "columns"]
        .iter()
        .try_for_each(|key| needs(table, key, "an animation file"))
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
        clip: table.get("clip").map(|node| node.text("the name of a clip")).transpose()?,
        faces: table
            .get("faces")
            .map(|node| with_place(&node, folder.file(&node.text(what)?)).map(|asset| asset.path))
            .transpose()?,
        columns: table.get("columns").map(|node| pose_columns(&node)).transpose()?,
    })
}

/// The names of as many columns as there are places.
fn column_names<const N: usize>(node: Node<'_, '_>) -> Result<[String; N]> {
    let what = format!("the names of {} columns", if N == 3 { "three" } else { "four" });
    let list: Vec<String> =
        node.list(&what)?.iter().map(|node| node.text("a column")).collect::<Result<_>>()?;
    list.try_into().map_err(|_| node.expected(&what))
}

/// The names of the columns of a pose log, as far as they are said.
fn pose_columns(node: &Node<'_, '_>) -> Result<PoseColumns> {
    let table = node.table(POSE_COLUMNS)?;
    let name = |key: &str| table.get(key).map(|node| node.text("the name of a column")).transpose();
    Ok(PoseColumns {
        time: name("t")?,
        body: name("body")?,
        position: table.get("position").map(column_names).transpose()?,
        rotation: table.get("rotation").map(column_names).transpose()?,
        velocity: table.get("velocity").map(column_names).transpose()?,
        angular_velocity: table.get("angular_velocity").map(column_names).transpose()?,
    })
}

fn time_offset(table: &Table<'_, '_>) -> Result<f64> {
    table.get("time_offset").map_or(Ok(0.0), |node| node.number("a number of seconds"))
}

/// `file#/path/of/object`.
fn source(node: &Node<'_, '_>, table: &Table<'_, '_>, folder: &Folder) -> Result<Source> {
    let what = "an animation file and an object in it, as \"file.abc#/object\"";
    let text = node.text(what)?;
    // The bodies of a log have no paths, so that a slash before their name says nothing.
    let of_log = |(file, _): &(&str, &str)| [".csv", ".csv.gz"].iter().any(|end| file.ends_with(end));
    let named = text.split_once("#/").or_else(|| text.split_once('#').filter(of_log));
    let Some((file, object)) = named else { return Err(node.expected(what)) };
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
    let size = table.get("size").map(|node| size(&node)).transpose()?;
    let mass_kg = table.get("mass").map(|node| node.within("kilograms", 1e-9, 1e12)).transpose()?;
    let swarm = table.get("swarm").map(|node| swarm(&node, folder)).transpose()?;
    if swarm.is_some() && motion.is_none() {
        return Err(table.error("a swarm needs a middle: `source`, `position` or `track`"));
    }
    Ok(Object { name, motion, swarm, size, point, material, body, mass_kg })
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

/// Objects whose contacts are found from how they move.
fn touching(table: &Table<'_, '_>, bodies: &Node<'_, '_>) -> Result<Touching> {
    for key in ["columns", "step", "up", "unit", "time_offset"] {
        needs(table, key, "a `log`")?;
    }
    let what = "the names of objects, or patterns";
    let pattern = |node: &Node<'_, '_>| with_place(node, NamePattern::new(&node.text(what)?));
    let patterns: Vec<NamePattern> = one_or_many(bodies)?.iter().map(pattern).collect::<Result<_>>()?;
    if patterns.is_empty() {
        return Err(bodies.expected(what));
    }
    let gravity_mps2 =
        table.get("gravity").map_or(Ok(GRAVITY_MPS2), |node| node.vector("m/s² as [x, y, z]"))?;
    Ok(Touching { bodies: patterns, gravity_mps2 })
}

fn contacts(table: &Table<'_, '_>, folder: &Folder) -> Result<Contacts> {
    let log = table.required("log", "the name of a CSV file, which may be gzipped, or `bodies` instead")?;
    let asset = with_place(&log, folder.file(&log.text("the name of a CSV file")?))?;
    let columns = table.required("columns", "a table of the log's column names")?.table(COLUMNS)?;
    let name = |key: &str| columns.required(key, "the name of a column")?.text("the name of a column");
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
            position: column_names(columns.required("position", "the names of three columns")?)?,
            push,
            normal: columns.get("normal").map(column_names).transpose()?,
            normal_velocity: columns
                .get("normal_velocity")
                .map(|node| node.text("the name of a column"))
                .transpose()?,
            sliding_velocity: columns.get("sliding_velocity").map_or(Ok(Vec::new()), |node| {
                let list = one_or_many(&node)?;
                if list.is_empty() || list.len() > 3 {
                    return Err(node.expected("the names of one to three columns"));
                }
                list.iter().map(|node| node.text("the name of a column")).collect()
            })?,
            up: up(table)?.unwrap_or_default(),
            unit_m: unit_m(table)?.unwrap_or(1.0),
            time_offset_s: time_offset(table)?,
        },
        gravity_mps2: table
            .get("gravity")
            .map_or(Ok(GRAVITY_MPS2), |node| node.vector("metres a second squared"))?,
        step_s: table.get("step").map(|n| n.within("a number of seconds", 1e-6, 1.0)).transpose()?,
    })
}

#[cfg(test)]
mod tests;
