//! What is in a scene: its things, sounds and microphones, with the files that they use opened as far
//! as is needed to say that they fit.

use std::path::Path;

use froufrou::Result;
use froufrou::scene::Scene;
use froufrou::scene::contact_log::ContactLog;
use froufrou::scene::file::{Emitter, Motion, Timing};
use froufrou::scene::world::World;
use froufrou::score::Repeat;
use serde::Serialize;

use super::Findings;
use super::score::shape;
use super::sheet::{Sheet, number};

#[derive(Serialize)]
pub struct SceneFindings {
    rate_hz: u32,
    seed: u64,
    duration_s: Option<f64>,
    /// The last time at which anything moves.
    motion_end_s: f64,
    speed_of_sound_mps: f64,
    microphones: Vec<MicrophoneFindings>,
    materials: Vec<MaterialFindings>,
    objects: Vec<ObjectFindings>,
    sounds: Vec<SoundFindings>,
    contacts: Vec<ContactFindings>,
}

#[derive(Serialize)]
struct MicrophoneFindings {
    name: String,
    c: f64,
    k: f64,
    carried_by: String,
}

#[derive(Serialize)]
struct MaterialFindings {
    name: String,
    impact_recordings: Vec<String>,
}

#[derive(Serialize)]
struct ObjectFindings {
    name: String,
    carried_by: Option<String>,
    material: Option<String>,
    /// The names of its bodies: several where its source is a pattern.
    bodies: Vec<String>,
}

#[derive(Serialize)]
struct SoundFindings {
    /// The object, or nothing for a fixed place.
    object: Option<String>,
    recordings: Vec<String>,
    repeat: &'static str,
    gain_db: f64,
    starts: usize,
    from_s: f64,
    to_s: Option<f64>,
}

#[derive(Serialize)]
struct ContactFindings {
    log: String,
    step_s: Option<f64>,
}

/// Reads a scene, opens its animations, finds its objects in them and its columns in its logs.
pub fn read(file: &Path, allow_outside: bool) -> Result<SceneFindings> {
    let scene = Scene::open(file, allow_outside)?;
    let world = World::open(&scene)?;
    for contacts in &scene.contacts {
        // Opening holds the header against the columns that the scene names.
        ContactLog::open(&contacts.log.path, &contacts.columns)?;
    }
    let names = |recordings: &[froufrou::scene::asset::Asset]| -> Vec<String> {
        recordings.iter().map(|recording| recording.name.clone()).collect()
    };
    let objects = scene.objects.iter().zip(&world.objects).map(|(object, bodies)| ObjectFindings {
        name: object.name.clone(),
        carried_by: object.motion.as_ref().map(carrier),
        material: object.material.and_then(|index| scene.materials.get(index)).map(|m| m.name.clone()),
        bodies: bodies.iter().map(|body| body.name.clone()).collect(),
    });
    let sounds = scene.sounds.iter().map(|sound| {
        let (starts, from_s, to_s) = match &sound.timing {
            Timing::Starts(keys) => (keys.len(), keys.first().map_or(0.0, |key| key.time_s), None),
            Timing::Span { from_s, to_s } => (1, *from_s, *to_s),
        };
        SoundFindings {
            object: match sound.emitter {
                Emitter::Object(index) => scene.objects.get(index).map(|object| object.name.clone()),
                Emitter::Position(_) => None,
            },
            recordings: names(&sound.recordings),
            repeat: match sound.repeat {
                Repeat::Once => "once",
                Repeat::Loop => "loop",
                Repeat::ExactLoop => "loop exact",
            },
            gain_db: sound.gain_db,
            starts,
            from_s,
            to_s,
        }
    });
    Ok(SceneFindings {
        rate_hz: scene.rate_hz,
        seed: scene.seed,
        duration_s: scene.duration_s,
        motion_end_s: world.end_s(),
        speed_of_sound_mps: scene.speed_of_sound_mps,
        microphones: scene
            .microphones
            .iter()
            .map(|microphone| MicrophoneFindings {
                name: microphone.name.clone(),
                c: microphone.shape.c,
                k: microphone.shape.k,
                carried_by: carrier(&microphone.motion),
            })
            .collect(),
        materials: scene
            .materials
            .iter()
            .map(|material| MaterialFindings {
                name: material.name.clone(),
                impact_recordings: material.impact.as_ref().map(|i| names(&i.recordings)).unwrap_or_default(),
            })
            .collect(),
        objects: objects.collect(),
        sounds: sounds.collect(),
        contacts: scene
            .contacts
            .iter()
            .map(|contacts| ContactFindings { log: contacts.log.name.clone(), step_s: contacts.step_s })
            .collect(),
    })
}

/// What carries something, in the words of the scene file.
fn carrier(motion: &Motion) -> String {
    match motion {
        Motion::Source(source) => format!("{}#{}", source.file.name, source.object.text()),
        Motion::Track(track) if track.keys.len() == 1 => "stands still".to_owned(),
        Motion::Track(track) => format!("track of {} keys", track.keys.len()),
    }
}

impl Findings for SceneFindings {
    const KIND: &'static str = "scene";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        let duration = self.duration_s.map(|s| format!("{} s", number(s)));
        sheet
            .fact("kind", "scene")
            .fact("rate", format!("{} Hz", self.rate_hz))
            .fact("seed", self.seed)
            .fact("duration", duration.unwrap_or_else(|| "until everything has ended and arrived".to_owned()))
            .fact("motion", format!("until {} s", number(self.motion_end_s)))
            .fact("speed of sound", format!("{} m/s", number(self.speed_of_sound_mps)));
        let files = |names: &[String]| match names {
            [] => "–".to_owned(),
            [one] => one.clone(),
            [first, rest @ ..] => format!("{first} and {} more", rest.len()),
        };
        sheet.table(
            &["microphone", "shape", "carried by"],
            self.microphones.iter().map(|m| vec![m.name.clone(), shape(m.c, m.k), m.carried_by.clone()]),
        );
        let or_dash = |text: &Option<String>| text.clone().unwrap_or_else(|| "–".to_owned());
        sheet.table(
            &["object", "bodies", "material", "carried by"],
            self.objects.iter().map(|object| {
                let bodies = object.bodies.len().to_string();
                vec![object.name.clone(), bodies, or_dash(&object.material), or_dash(&object.carried_by)]
            }),
        );
        sheet.table(
            &["material", "impact"],
            self.materials.iter().map(|m| vec![m.name.clone(), files(&m.impact_recordings)]),
        );
        sheet.table(
            &["sound of", "recording", "plays", "gain (dB)", "starts", "from (s)", "to (s)"],
            self.sounds.iter().map(|sound| {
                vec![
                    sound.object.clone().unwrap_or_else(|| "a fixed place".to_owned()),
                    files(&sound.recordings),
                    sound.repeat.to_owned(),
                    number(sound.gain_db),
                    sound.starts.to_string(),
                    number(sound.from_s),
                    sound.to_s.map_or_else(|| "–".to_owned(), number),
                ]
            }),
        );
        sheet.table(
            &["contact log", "step (s)"],
            self.contacts.iter().map(|contacts| {
                let step = contacts.step_s.map_or_else(|| "from its times".to_owned(), number);
                vec![contacts.log.clone(), step]
            }),
        );
        sheet
    }
}
