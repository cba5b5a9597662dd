//! What is in a scene: its things, sounds and microphones, with the files that they use opened as far
//! as is needed to say that they fit.

use std::path::Path;

use froufrou::Result;
use froufrou::scene::Scene;
use froufrou::scene::contact_log::ContactLog;
use froufrou::scene::file::{Emitter, Enclosing, Motion, Played, Timing};
use froufrou::scene::world::World;
use froufrou::score::Repeat;
use froufrou::space::reverberation;
use serde::Serialize;

use super::Findings;
use super::score::pickup;
use super::sheet::{Sheet, number, position};

#[derive(Serialize)]
pub struct SceneFindings {
    rate_hz: u32,
    seed: u64,
    duration_s: Option<f64>,
    /// The last time at which anything moves.
    motion_end_s: f64,
    speed_of_sound_mps: f64,
    microphones: Vec<MicrophoneFindings>,
    wind_mps: Option<[f64; 3]>,
    /// Whether air takes from what is far.
    air: bool,
    room: Option<RoomFindings>,
    planes: usize,
    instruments: Vec<InstrumentFindings>,
    materials: Vec<MaterialFindings>,
    objects: Vec<ObjectFindings>,
    sounds: Vec<SoundFindings>,
    contacts: Vec<ContactFindings>,
}

#[derive(Serialize)]
struct MicrophoneFindings {
    name: String,
    hears: String,
    carried_by: String,
}

#[derive(Serialize)]
struct RoomFindings {
    size_m: [f64; 3],
    /// The order of reflections that are heard one by one.
    order: usize,
    /// How many images of each source that makes.
    images: usize,
    tail: bool,
    /// The reverberation time of each octave band from 63 Hz to 8 kHz, by Eyring's formula; nothing where it has no
    /// end.
    reverberation_s: Vec<Option<f64>>,
}

impl RoomFindings {
    fn of(scene: &Scene) -> Result<Option<Self>> {
        let Some(Enclosing::Room(about)) = &scene.enclosing else { return Ok(None) };
        let times_s = reverberation::eyring_s(&about.room, &scene.medium());
        Ok(Some(Self {
            size_m: about.room.size_m(),
            order: about.order,
            images: about.room.images(about.order)?.len() - 1,
            tail: about.has_tail,
            reverberation_s: times_s.iter().map(|&time_s| time_s.is_finite().then_some(time_s)).collect(),
        }))
    }

    fn told(&self) -> String {
        let [width, height, depth] = self.size_m.map(number);
        let images = if self.images == 1 { "1 image".into() } else { format!("{} images", self.images) };
        format!("{width} × {height} × {depth} m, {images} of a source")
    }

    fn reverberation(&self) -> Option<String> {
        let short =
            |time_s: f64| format!("{time_s:.2}").trim_end_matches('0').trim_end_matches('.').to_owned();
        let times: Vec<String> =
            self.reverberation_s.iter().map(|time_s| time_s.map_or_else(|| "∞".to_owned(), short)).collect();
        self.tail.then(|| format!("{} s from 63 Hz to 8 kHz", times.join(", ")))
    }
}

#[derive(Serialize)]
struct InstrumentFindings {
    name: String,
    kind: &'static str,
    file: Option<String>,
}

#[derive(Serialize)]
struct MaterialFindings {
    name: String,
    impact: Option<PlayedFindings>,
    slide: Option<PlayedFindings>,
    roll: Option<PlayedFindings>,
    air: Option<PlayedFindings>,
}

/// What something plays: recordings or an instrument.
#[derive(Serialize, Default)]
struct PlayedFindings {
    recordings: Vec<String>,
    instrument: Option<String>,
    repeat: Option<&'static str>,
}

impl PlayedFindings {
    fn of(played: &Played, scene: &Scene) -> Self {
        match played {
            Played::Recordings { recordings, repeat, .. } => Self {
                recordings: recordings.iter().map(|recording| recording.name.clone()).collect(),
                instrument: None,
                repeat: Some(match repeat {
                    Repeat::Once => "once",
                    Repeat::Loop => "loop",
                    Repeat::ExactLoop => "loop exact",
                }),
            },
            Played::Instrument(index) => Self {
                instrument: scene.instruments.get(*index).map(|instrument| instrument.name.clone()),
                ..Self::default()
            },
        }
    }

    /// In a few words.
    fn told(&self) -> String {
        match (self.instrument.as_ref(), self.recordings.as_slice()) {
            (Some(instrument), _) => instrument.clone(),
            (None, []) => "–".to_owned(),
            (None, [one]) => one.clone(),
            (None, [first, rest @ ..]) => format!("{first} and {} more", rest.len()),
        }
    }
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
    /// An ambience around a microphone, or around each.
    ambience: bool,
    #[serde(flatten)]
    played: PlayedFindings,
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
    let objects = scene.objects.iter().zip(&world.objects).map(|(object, bodies)| ObjectFindings {
        name: object.name.clone(),
        carried_by: object.motion.as_ref().map(carrier),
        material: object.material.and_then(|index| scene.materials.get(index)).map(|m| m.name.clone()),
        bodies: bodies.iter().map(|body| body.name.clone()).collect(),
    });
    let sounds = scene.sounds.iter().map(|sound| {
        let (starts, from_s, to_s) = match &sound.timing {
            Timing::Starts(keys) => (keys.len(), keys.first().map_or(0.0, |key| key.time_s), None),
            Timing::Strikes(strikes) => (strikes.len(), strikes.first().map_or(0.0, |s| s.0), None),
            Timing::Span { from_s, to_s } => (1, *from_s, *to_s),
        };
        SoundFindings {
            object: match sound.emitter {
                Emitter::Object(index) => scene.objects.get(index).map(|object| object.name.clone()),
                Emitter::Position(_) | Emitter::Around(_) => None,
            },
            ambience: matches!(sound.emitter, Emitter::Around(_)),
            played: PlayedFindings::of(&sound.played, &scene),
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
                hears: pickup(&microphone.pickup),
                carried_by: carrier(&microphone.motion),
            })
            .collect(),
        wind_mps: scene.wind.map(|wind| wind.velocity_mps),
        air: scene.air.is_some(),
        room: RoomFindings::of(&scene)?,
        planes: match &scene.enclosing {
            Some(Enclosing::Planes(planes)) => planes.len(),
            _ => 0,
        },
        instruments: scene
            .instruments
            .iter()
            .map(|instrument| InstrumentFindings {
                name: instrument.name.clone(),
                kind: instrument.make.kind(),
                file: instrument.make.file().map(str::to_owned),
            })
            .collect(),
        materials: scene
            .materials
            .iter()
            .map(|material| MaterialFindings {
                name: material.name.clone(),
                impact: material.impact.as_ref().map(|i| PlayedFindings::of(&i.played, &scene)),
                slide: material.slide.as_ref().map(|s| PlayedFindings::of(&s.played, &scene)),
                roll: material.roll.as_ref().map(|s| PlayedFindings::of(&s.played, &scene)),
                air: material.air.as_ref().map(|a| PlayedFindings::of(&a.played, &scene)),
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
            .fact("speed of sound", format!("{} m/s", number(self.speed_of_sound_mps)))
            .fact_if("air", self.air.then_some("takes from what is far"))
            .fact_if("room", self.room.as_ref().map(RoomFindings::told))
            .fact_if("reverberation", self.room.as_ref().and_then(RoomFindings::reverberation))
            .fact_if("planes", (self.planes > 0).then_some(self.planes));
        sheet.table(
            &["microphone", "hears", "carried by"],
            self.microphones.iter().map(|m| vec![m.name.clone(), m.hears.clone(), m.carried_by.clone()]),
        );
        let or_dash = |text: &Option<String>| text.clone().unwrap_or_else(|| "–".to_owned());
        sheet.table(
            &["object", "bodies", "material", "carried by"],
            self.objects.iter().map(|object| {
                let bodies = object.bodies.len().to_string();
                vec![object.name.clone(), bodies, or_dash(&object.material), or_dash(&object.carried_by)]
            }),
        );
        if let Some(wind) = self.wind_mps {
            sheet.fact("wind", format!("{} m/s", position(wind)));
        }
        sheet.table(
            &["instrument", "kind", "file"],
            self.instruments.iter().map(|i| vec![i.name.clone(), i.kind.to_owned(), or_dash(&i.file)]),
        );
        let told = |played: &Option<PlayedFindings>| {
            played.as_ref().map_or_else(|| "–".to_owned(), PlayedFindings::told)
        };
        sheet.table(
            &["material", "impact", "slide", "roll", "air"],
            self.materials
                .iter()
                .map(|m| vec![m.name.clone(), told(&m.impact), told(&m.slide), told(&m.roll), told(&m.air)]),
        );
        sheet.table(
            &["sound of", "plays", "repeats", "gain (dB)", "starts", "from (s)", "to (s)"],
            self.sounds.iter().map(|sound| {
                vec![
                    match (&sound.object, sound.ambience) {
                        (Some(object), _) => object.clone(),
                        (None, true) => "around microphones".to_owned(),
                        (None, false) => "a fixed place".to_owned(),
                    },
                    sound.played.told(),
                    sound.played.repeat.unwrap_or("–").to_owned(),
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
