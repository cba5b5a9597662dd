//! What happens, as lines of text: a stream that a program in any language can write, one JSON object a line.
//!
//! ```text
//! {"t":1.25,"contact":["ball","floor"],"position":[0,0,0],"impulse":0.2}
//! {"t":1.25,"object":"crate","position":[0.5,0.2,0],"rotation":[0,0,0,1]}
//! {"t":1.25,"listener":true,"position":[0,1.6,4],"rotation":[0,0,0,1]}
//! {"t":1.25,"mesh":"sheet","positions":[[0,1,0],[0.1,1,0],[0,1,0.1]],"faces":[[0,1,2]]}
//! {"t":1.25,"appear":"crate 7","as":"crate","position":[0,2,0]}
//! {"t":1.25,"material":"ice","of":"crate 7"}
//! {"t":1.25,"vanish":"crate 7"}
//! {"advance":1.25}
//! ```
//!
//! Metres, seconds, newtons or newton seconds, Y up; what each line may say stands in `docs/live.md`. A line that is wrong is
//! told with its number and left out, and the next is read. Lines take the memory of the longest one.
//!
//! ```no_run
//! use froufrou::render::live::{self, EngineSettings};
//! use froufrou::render::live::lines::Lines;
//! use froufrou::scene::Scene;
//!
//! let scene = Scene::open("scene.toml", false)?;
//! let (mut handle, player) = live::start(scene, EngineSettings::default())?;
//! // The callback of a device owns the player.
//! # drop(player);
//! for line in Lines::new(std::io::stdin().lock(), "stdin") {
//!     if let Err(fault) = line.and_then(|line| line.tell(&mut handle)) {
//!         eprintln!("{fault}");
//!     }
//! }
//! # Ok::<(), froufrou::Error>(())
//! ```

use std::io::BufRead;
use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;

use super::handle::{Handle, MoverId, Refused};
use crate::json_lines::JsonLines;
use crate::scene::contact_log::{ContactRow, Push};
use crate::scene::fed::{Faces, FedPose};
use crate::{Error, Place, Result};

/// The longest line that is read, in bytes: a mesh of some 200 000 vertices and its faces.
pub const LONGEST_LINE_BYTES: usize = 1 << 24;

/// One line: something that happens, or how far time has come.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "Keys")]
pub enum Line {
    /// Two bodies touch in a step of a simulation. The numbers of the row's bodies are not looked at.
    Contact {
        /// Their names.
        bodies: [String; 2],
        /// What is known of it.
        row: ContactRow,
    },
    /// An object is somewhere.
    Object {
        /// Its name in the scene.
        name: String,
        /// When, in seconds.
        time_s: f64,
        /// Where.
        pose: FedPose,
    },
    /// The listener is somewhere.
    Listener {
        /// When, in seconds.
        time_s: f64,
        /// Where.
        pose: FedPose,
    },
    /// The vertices of an object are somewhere.
    Mesh {
        /// Its name in the scene, or the one that it appeared by.
        name: String,
        /// When, in seconds.
        time_s: f64,
        /// Where, in metres.
        positions_m: Vec<[f32; 3]>,
        /// Its faces, where they are told.
        faces: Option<Arc<Faces>>,
    },
    /// Something appears.
    Appear {
        /// Its name.
        name: String,
        /// The object of the scene that it is as.
        kind: String,
        /// When, in seconds.
        time_s: f64,
        /// Where.
        pose: FedPose,
    },
    /// Something is no more.
    Vanish {
        /// Its name.
        name: String,
        /// When, in seconds.
        time_s: f64,
    },
    /// Something becomes of another material.
    Material {
        /// Its name.
        name: String,
        /// The name of the material in the scene.
        material: String,
        /// When, in seconds.
        time_s: f64,
    },
    /// All that happens before a time has been told, in seconds.
    Advance(f64),
}

/// All keys of all lines.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    contact: Option<[String; 2]>,
    object: Option<String>,
    listener: Option<bool>,
    mesh: Option<String>,
    appear: Option<String>,
    vanish: Option<String>,
    material: Option<String>,
    advance: Option<f64>,
    t: Option<f64>,
    position: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    impulse: Option<f64>,
    force: Option<f64>,
    normal: Option<[f64; 3]>,
    normal_velocity: Option<f64>,
    sliding: Option<f64>,
    positions: Option<Vec<[f32; 3]>>,
    faces: Option<Vec<Vec<u32>>>,
    r#as: Option<String>,
    of: Option<String>,
}

/// What a line tells, by the key that says so, and the other keys that it may have.
const KINDS: [(&str, &[&str]); 8] = [
    ("contact", &["t", "position", "impulse", "force", "normal", "normal_velocity", "sliding"]),
    ("object", &["t", "position", "rotation"]),
    ("listener", &["t", "position", "rotation"]),
    ("mesh", &["t", "positions", "faces"]),
    ("appear", &["t", "as", "position", "rotation"]),
    ("vanish", &["t"]),
    ("material", &["t", "of"]),
    ("advance", &[]),
];

impl Keys {
    /// The keys that are there.
    fn there(&self) -> impl Iterator<Item = &'static str> {
        let there = [
            ("contact", self.contact.is_some()),
            ("object", self.object.is_some()),
            ("listener", self.listener.is_some()),
            ("mesh", self.mesh.is_some()),
            ("appear", self.appear.is_some()),
            ("vanish", self.vanish.is_some()),
            ("material", self.material.is_some()),
            ("advance", self.advance.is_some()),
            ("t", self.t.is_some()),
            ("position", self.position.is_some()),
            ("rotation", self.rotation.is_some()),
            ("impulse", self.impulse.is_some()),
            ("force", self.force.is_some()),
            ("normal", self.normal.is_some()),
            ("normal_velocity", self.normal_velocity.is_some()),
            ("sliding", self.sliding.is_some()),
            ("positions", self.positions.is_some()),
            ("faces", self.faces.is_some()),
            ("as", self.r#as.is_some()),
            ("of", self.of.is_some()),
        ];
        there.into_iter().filter_map(|(key, is_there)| is_there.then_some(key))
    }

    fn pose(&self, position_m: [f64; 3]) -> FedPose {
        let unturned = FedPose::at(position_m);
        FedPose { rotation: self.rotation.unwrap_or(unturned.rotation), ..unturned }
    }
}

/// Keys as people read them.
fn listed<'a>(keys: impl IntoIterator<Item = &'a str>) -> String {
    keys.into_iter().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", ")
}

impl TryFrom<Keys> for Line {
    type Error = String;

    fn try_from(mut keys: Keys) -> Result<Self, String> {
        let told: Vec<_> = KINDS.iter().filter(|(kind, _)| keys.there().any(|key| key == *kind)).collect();
        let [(kind, allowed)] = told.as_slice() else {
            return Err(format!("expected one of {}", listed(KINDS.map(|(kind, _)| kind))));
        };
        if let Some(strange) = keys.there().find(|key| key != kind && !allowed.contains(key)) {
            let has =
                if allowed.is_empty() { "no other key".to_owned() } else { listed(allowed.iter().copied()) };
            return Err(format!("`{strange}` is no key of a line with `{kind}`, which has {has}"));
        }
        let missing = |key: &str| format!("a line with `{kind}` needs `{key}`");
        if let Some(time_s) = keys.advance {
            return Ok(Self::Advance(time_s));
        }
        let time_s = keys.t.ok_or_else(|| missing("t"))?;
        if let Some(name) = keys.mesh.take() {
            let positions_m = keys.positions.take().ok_or_else(|| missing("positions"))?;
            let faces = keys.faces.take().map(|faces| {
                let sizes = faces.iter().map(|face| face.len() as u32).collect();
                Arc::new(Faces { vertices: faces.into_iter().flatten().collect(), sizes })
            });
            return Ok(Self::Mesh { name, time_s, positions_m, faces });
        }
        if let Some(name) = keys.vanish.take() {
            return Ok(Self::Vanish { name, time_s });
        }
        if let Some(material) = keys.material.take() {
            let name = keys.of.take().ok_or_else(|| missing("of"))?;
            return Ok(Self::Material { name, material, time_s });
        }
        let position_m = keys.position.ok_or_else(|| missing("position"))?;
        if let Some(bodies) = keys.contact.take() {
            let push = match (keys.impulse, keys.force) {
                (Some(impulse_ns), None) => Push::Impulse(impulse_ns),
                (None, Some(force_n)) => Push::Force(force_n),
                _ => return Err("a contact has either an `impulse` or a `force`".to_owned()),
            };
            let row = ContactRow {
                time_s,
                a: 0,
                b: 0,
                position_m,
                push,
                normal: keys.normal,
                normal_velocity_mps: keys.normal_velocity,
                sliding_mps: keys.sliding,
                line: 0,
            };
            return Ok(Self::Contact { bodies, row });
        }
        let pose = keys.pose(position_m);
        if let Some(name) = keys.appear.take() {
            let kind = keys.r#as.take().ok_or_else(|| missing("as"))?;
            return Ok(Self::Appear { name, kind, time_s, pose });
        }
        match keys.object.take() {
            Some(name) => Ok(Self::Object { name, time_s, pose }),
            None if keys.listener == Some(true) => Ok(Self::Listener { time_s, pose }),
            None => Err("`listener` is `true` in a line that tells of it".to_owned()),
        }
    }
}

impl Line {
    /// Tells a handle of it.
    ///
    /// # Errors
    /// What is left out, and counted by the handle.
    pub fn tell(&self, handle: &mut Handle) -> Result<()> {
        let told = match self {
            Self::Contact { bodies: [a, b], row } => {
                let bodies = handle.body(a).and_then(|a| Ok([a, handle.body(b)?]));
                bodies.and_then(|bodies| handle.contact(bodies, row))
            }
            Self::Object { name, time_s, pose } => {
                let object = mover(handle, name)?;
                handle.transform(object, *time_s, *pose)
            }
            Self::Mesh { name, time_s, positions_m, faces } => {
                let object = mover(handle, name)?;
                match faces {
                    Some(faces) => handle.mesh_with_faces(object, *time_s, positions_m, faces.clone()),
                    None => handle.mesh(object, *time_s, positions_m),
                }
            }
            Self::Appear { name, kind, time_s, pose } => {
                handle.appear(kind, name, *time_s, *pose).map(|_| ())
            }
            Self::Vanish { name, time_s } => handle.vanish(name, *time_s),
            Self::Material { name, material, time_s } => handle.material(name, material, *time_s),
            Self::Listener { time_s, pose } => match handle.listener(*time_s, *pose) {
                Err(Refused::Unknown) => {
                    return Err(Error::new("the listener was not said to be moved when it began"));
                }
                told => told,
            },
            Self::Advance(time_s) => handle.advance(*time_s),
        };
        told.map_err(Refused::fault)
    }

    /// The time that it tells of, in seconds.
    pub fn time_s(&self) -> f64 {
        match self {
            Self::Contact { row, .. } => row.time_s,
            Self::Object { time_s, .. }
            | Self::Listener { time_s, .. }
            | Self::Mesh { time_s, .. }
            | Self::Appear { time_s, .. }
            | Self::Vanish { time_s, .. }
            | Self::Material { time_s, .. }
            | Self::Advance(time_s) => *time_s,
        }
    }
}

/// The object of a name that is moved.
fn mover(handle: &mut Handle, name: &str) -> Result<MoverId> {
    handle.object(name).ok_or_else(|| {
        let _ = handle.leave::<()>(Refused::Unknown);
        Error::new(format!("no object `{name}` was said to be moved when it began, and none appeared"))
    })
}

/// Reads lines as they come: an iterator that goes on behind a line that is wrong. It ends where the stream does, or where it
/// cannot be read.
#[derive(Debug)]
pub struct Lines<R>(JsonLines<R, Line>);

impl<R: BufRead> Lines<R> {
    /// Reads from anywhere; `file` is its name in messages.
    pub fn new(inner: R, file: impl AsRef<Path>) -> Self {
        let what = "a line of what happens";
        Self(JsonLines::new(inner, file.as_ref(), what, LONGEST_LINE_BYTES).going_on())
    }

    /// Where it is: the line that was read last.
    pub fn place(&self) -> Place {
        Place::Line { line: self.0.line(), column: 0 }
    }
}

impl<R: BufRead> Iterator for Lines<R> {
    type Item = Result<Line>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Vec<Result<Line, String>> {
        Lines::new(text.as_bytes(), "feed").map(|line| line.map_err(|fault| fault.to_string())).collect()
    }

    #[test]
    fn every_kind_is_read() {
        let text = r#"
{"t":1.25,"contact":["ball","floor"],"position":[0,1,2],"impulse":0.2}
 {"force":3e1,"t":1.25,"contact":["a","b"],"position":[0,0,0],"normal":[0,1,0],"normal_velocity":-2,"sliding":0.5}

{"t":2,"object":"crate","position":[1,2,3],"rotation":[0,1,0,0]}
{"t":2,"listener":true,"position":[1,2,3]}
{"advance":1.2667}
{"t":2,"mesh":"sheet","positions":[[0,1,0],[0.5,1,0],[0,1,0.5],[1,1,1]],"faces":[[0,1,2],[0,1,3,2]]}
{"t":2,"mesh":"sheet","positions":[]}
{"t":2,"appear":"crate 7","as":"crate","position":[1,2,3],"rotation":[0,1,0,0]}
{"t":3,"material":"ice","of":"crate 7"}
{"t":4,"vanish":"crate 7"}"#;
        let lines: Vec<Line> = read(text).into_iter().collect::<Result<_, _>>().unwrap();
        let Line::Contact { bodies, row } = &lines[0] else { panic!("{lines:?}") };
        assert_eq!((bodies[0].as_str(), bodies[1].as_str()), ("ball", "floor"));
        assert_eq!((row.time_s, row.position_m, row.push), (1.25, [0.0, 1.0, 2.0], Push::Impulse(0.2)));
        let Line::Contact { row, .. } = &lines[1] else { panic!("{lines:?}") };
        assert_eq!((row.push, row.normal), (Push::Force(30.0), Some([0.0, 1.0, 0.0])));
        assert_eq!((row.normal_velocity_mps, row.sliding_mps), (Some(-2.0), Some(0.5)));
        let pose = FedPose { position_m: [1.0, 2.0, 3.0], rotation: [0.0, 1.0, 0.0, 0.0] };
        assert_eq!(lines[2], Line::Object { name: "crate".into(), time_s: 2.0, pose });
        assert_eq!(lines[3], Line::Listener { time_s: 2.0, pose: FedPose::at([1.0, 2.0, 3.0]) });
        assert_eq!(lines[4], Line::Advance(1.2667));
        let positions_m = vec![[0.0, 1.0, 0.0], [0.5, 1.0, 0.0], [0.0, 1.0, 0.5], [1.0; 3]];
        let faces = Arc::new(Faces { vertices: vec![0, 1, 2, 0, 1, 3, 2], sizes: vec![3, 4] });
        let sheet = |positions_m, faces| Line::Mesh { name: "sheet".into(), time_s: 2.0, positions_m, faces };
        assert_eq!(lines[5], sheet(positions_m, Some(faces)));
        assert_eq!(lines[6], sheet(Vec::new(), None));
        let (name, kind) = ("crate 7".to_owned(), "crate".to_owned());
        assert_eq!(lines[7], Line::Appear { name: name.clone(), kind, time_s: 2.0, pose });
        let ice = Line::Material { name: name.clone(), material: "ice".into(), time_s: 3.0 };
        assert_eq!(lines[8..], [ice, Line::Vanish { name, time_s: 4.0 }]);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line_and_the_next_is_read() {
        let long = format!("{{\"advance\":{}1}}", " ".repeat(LONGEST_LINE_BYTES));
        let cases = [
            (r#"{"advance":1,"at":2}"#, "unknown field `at`, expected one of `contact`, `object`"),
            (r#"{"advance":1,"t":2}"#, "`t` is no key of a line with `advance`, which has no other key"),
            (r#"{"t":1,"object":"a","position":[0,0,0],"force":1}"#, "which has `t`, `position`, `rotation`"),
            (r#"{"t":1,"position":[0,0,0]}"#, "expected one of `contact`, `object`, `listener`, `mesh`"),
            (r#"{"t":1,"listener":true,"object":"a","position":[0,0,0]}"#, "expected one of `contact`"),
            (r#"{"t":1,"listener":false,"position":[0,0,0]}"#, "`listener` is `true`"),
            (r#"{"t":1,"object":"a"}"#, "a line with `object` needs `position`"),
            (r#"{"contact":["a","b"],"position":[0,0,0],"force":1}"#, "a line with `contact` needs `t`"),
            (r#"{"t":1,"contact":["a","b"],"position":[0,0,0]}"#, "either an `impulse` or a `force`"),
            (r#"{"t":1,"contact":["a"],"position":[0,0,0],"force":1}"#, "invalid length 1"),
            (r#"{"t":1,"mesh":"a"}"#, "a line with `mesh` needs `positions`"),
            (r#"{"t":1,"mesh":"a","positions":[[0,0]]}"#, "invalid length 2"),
            (r#"{"t":1,"mesh":"a","positions":[],"faces":[[-1]]}"#, "invalid value: integer `-1`"),
            (r#"{"t":1,"appear":"a","position":[0,0,0]}"#, "a line with `appear` needs `as`"),
            (r#"{"t":1,"vanish":"a","of":"b"}"#, "`of` is no key of a line with `vanish`, which has `t`"),
            (r#"{"t":1,"material":"ice"}"#, "a line with `material` needs `of`"),
            (r#"{"t":NaN,"advance":1}"#, "expected value"),
            (r#"{"t":"1","advance":1}"#, "invalid type: string"),
            (r#"{"advance":1,"advance":2}"#, "duplicate field `advance`"),
            ("advance 1", "expected value"),
            ("[1, 2]", "a line of what happens"),
            ("\u{0}", "expected value"),
            (&long, "longer than 16777216 bytes"),
        ];
        let text: String = cases.iter().map(|(line, _)| format!("{line}\n{{\"advance\":7}}\n")).collect();
        let lines = read(&text);
        assert_eq!(lines.len(), 2 * cases.len());
        for (number, ((line, expected), found)) in cases.iter().zip(lines.chunks_exact(2)).enumerate() {
            let fault = found[0].as_ref().unwrap_err();
            assert!(fault.starts_with(&format!("feed:{}:", 2 * number + 1)), "{fault}");
            assert!(fault.contains(expected), "{:.80}: {fault}", line);
            assert_eq!(found[1], Ok(Line::Advance(7.0)));
        }
    }
}
