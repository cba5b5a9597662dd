//! Air, a room and planes.

use crate::Result;
use crate::scene::file::{Enclosing, MovingPlane, Object, RoomAbout};
use crate::scene::toml::{Node, Table};
use crate::space::air::{ATMOSPHERE_KPA, Air};
use crate::space::bands::{BAND_COUNT, Bands};
use crate::space::room::{Room, Walls};

use super::{Keys, list, with_place};

pub(super) const AIR: Keys = &["temperature", "humidity", "pressure"];
pub(super) const ROOM: Keys = &["size", "corner", "turn", "absorption", "order", "tail"];
pub(super) const WALLS: Keys = &["left", "right", "floor", "ceiling", "front", "back"];
pub(super) const PLANE: Keys = &["object", "position", "normal", "absorption"];

/// What walls absorb unless it is said: painted plaster.
const ABSORPTION: f64 = 0.1;

/// Images of a room have this order unless it is said.
const ORDER: usize = 2;

/// An order beyond which images are too many.
const HIGHEST_ORDER: u64 = 19;

/// More planes than this do not reflect each other.
const MOST_PLANES: usize = 6;

/// The air, if a scene tells what it is like.
pub(super) fn air(top: &Table<'_, '_>) -> Result<Option<Air>> {
    let Some(node) = top.get("air") else { return Ok(None) };
    let table = node.table(AIR)?;
    let number =
        |key: &str, what: &str, default: f64| table.get(key).map_or(Ok(default), |node| node.number(what));
    let temperature_c = number("temperature", "degrees Celsius", 20.0)?;
    let humidity = number("humidity", "a percentage", 50.0)?;
    let pressure_kpa = number("pressure", "kilopascals", ATMOSPHERE_KPA)?;
    let air = Air::new(temperature_c, humidity, pressure_kpa);
    air.map(Some).map_err(|fault| node.error(fault.to_string()))
}

/// The room or the planes about a scene.
pub(super) fn enclosing(top: &Table<'_, '_>, objects: &[Object]) -> Result<Option<Enclosing>> {
    top.at_most_one(&["room", "plane"])?;
    if let Some(node) = top.get("room") {
        return room(&node).map(|room| Some(Enclosing::Room(Box::new(room))));
    }
    let nodes = list(top, "plane")?;
    if let Some(node) = nodes.get(MOST_PLANES) {
        return Err(node.error(format!("more than {MOST_PLANES} planes")));
    }
    let planes: Vec<MovingPlane> = nodes.iter().map(|node| plane(node, objects)).collect::<Result<_>>()?;
    Ok((!planes.is_empty()).then_some(Enclosing::Planes(planes)))
}

fn room(node: &Node<'_, '_>) -> Result<RoomAbout> {
    let table = node.table(ROOM)?;
    let size_m = table.required("size", "width, height and depth in metres")?.vector("metres")?;
    let corner_m = table.get("corner").map_or(Ok([0.0; 3]), |node| node.vector("a place in metres"))?;
    let turn = table.get("turn").map_or(Ok(0.0), |node| node.number("degrees"))?;
    let walls = match table.get("absorption") {
        None => Walls::all([ABSORPTION; BAND_COUNT]),
        Some(node) if node.is_table() => {
            let table = node.table(WALLS)?;
            let wall = |name: &str| table.get(name).map_or(Ok([ABSORPTION; BAND_COUNT]), |n| absorption(&n));
            Walls {
                left: wall("left")?,
                right: wall("right")?,
                floor: wall("floor")?,
                ceiling: wall("ceiling")?,
                front: wall("front")?,
                back: wall("back")?,
            }
        }
        Some(node) => Walls::all(absorption(&node)?),
    };
    let order =
        table.get("order").map_or(Ok(ORDER as u64), |node| node.whole("an order", 0, HIGHEST_ORDER))?;
    let has_tail = table
        .get("tail")
        .map_or(Ok(true), |node| node.as_flag().ok_or_else(|| node.expected("`true` or `false`")))?;
    let room = Room::new(corner_m, size_m, turn, &walls).map_err(|fault| node.error(fault.to_string()))?;
    Ok(RoomAbout { room, order: usize::try_from(order).unwrap_or(ORDER), has_tail })
}

fn plane(node: &Node<'_, '_>, objects: &[Object]) -> Result<MovingPlane> {
    let table = node.table(PLANE)?;
    let object = match table.get("object") {
        None => None,
        Some(node) => {
            let name = node.text("the name of an object")?;
            let index = objects.iter().position(|object| object.name == name);
            let index = index.ok_or_else(|| node.error(format!("there is no object {name:?}")))?;
            if objects[index].motion.is_none() {
                return Err(node.error("the object has no place: it needs `source`, `position` or `track`"));
            }
            Some(index)
        }
    };
    let point_m = table.get("position").map_or(Ok([0.0; 3]), |node| node.vector("a place in metres"))?;
    let normal = table.get("normal").map_or(Ok([0.0, 1.0, 0.0]), |node| node.direction("a direction"))?;
    let absorption = table.get("absorption").map_or(Ok([0.0; BAND_COUNT]), |node| absorption(&node))?;
    let plane = MovingPlane { object, point_m, normal, absorption };
    let fits = crate::space::room::Plane::new(point_m, normal, &absorption);
    with_place(node, fits.map(|_| plane))
}

/// The part of the energy that is absorbed: of all bands, or of each.
fn absorption(node: &Node<'_, '_>) -> Result<Bands> {
    if !node.is_list() {
        return Ok([node.within("the part of the energy that is absorbed", 0.0, 1.0)?; BAND_COUNT]);
    }
    let what = "the part of the energy that is absorbed at 63, 125, 250, 500, 1000, 2000, 4000 and 8000 Hz";
    let nodes = node.list(what)?;
    let parts: Vec<f64> = nodes.iter().map(|node| node.within(what, 0.0, 1.0)).collect::<Result<_>>()?;
    Bands::try_from(parts).map_err(|parts| {
        node.error(format!("expected one number or {BAND_COUNT}, found {}: {what}", parts.len()))
    })
}
