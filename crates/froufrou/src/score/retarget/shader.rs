//! Audio shaders: a sound designer's script decides which grains a contact plays, when, how loud and at what pitch
//! (Picard, Tsingos & Faure 2009, section 5). `docs/grains.md` is the reference of its words.

use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;

use rhai::{Dynamic, Engine};

use super::{Course, Play, Repertoire};
use crate::corpus::dictionary::{Action, Placed};
use crate::random::Random;
use crate::score::Grain;
use crate::synth::procedure::script::{Script, Told, number, wrong};
use crate::{Error, Result};

/// The functions that a shader may have, and how many arguments each takes.
const CALLED: [(&str, usize, &str); 3] = [
    ("impact", 3, "fn impact(impulse, speed, slip)"),
    ("slide", 2, "fn slide(force, speed)"),
    ("roll", 2, "fn roll(force, speed)"),
];

/// The most hits that one impact plays.
const MOST_HITS: usize = 64;

/// Hits come at most this long after their impact, in seconds.
const LATEST_S: f64 = 10.0;

/// The greatest gain that a shader gives.
const LOUDEST: f64 = 1000.0;

/// Speeds that a shader may give.
const PITCHES: std::ops::RangeInclusive<f64> = 0.05..=20.0;

/// A script that decides what contacts sound like.
#[derive(Clone)]
pub struct Shader {
    script: Arc<Script>,
}

impl std::fmt::Debug for Shader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shader").field("file", &self.script.file()).finish_non_exhaustive()
    }
}

/// An impact, as a shader is told of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Struck {
    /// In newton seconds.
    pub impulse_ns: f64,
    /// The relative speed along the normal in metres a second; 0 where it is not known.
    pub speed_mps: f64,
    /// The same across the normal.
    pub slip_mps: f64,
    /// The impulse that the strongest hits are for.
    pub reference_impulse_ns: f64,
    /// When, in seconds.
    pub time_s: f64,
}

/// What a shader says of the next grain of a contact that lasts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shade {
    pub choice: Option<usize>,
    pub gain: f64,
    pub pitch: f64,
    pub spread: f64,
    pub wait_s: f64,
}

/// What the call that runs may ask and has said.
enum Stage {
    Impact {
        repertoire: Arc<Repertoire>,
        strength: f64,
        random: Random,
        picks: u64,
        last: Option<usize>,
        voices: Vec<Voice>,
    },
    Rub {
        repertoire: Arc<Repertoire>,
        choices: Vec<Placed>,
        shade: Shade,
    },
}

/// A hit that an impact plays.
#[derive(Debug, Clone, Copy)]
struct Voice {
    hit: usize,
    after_s: f64,
    gain: f64,
    pitch: f64,
}

thread_local! {
    static STAGE: RefCell<Option<Stage>> = const { RefCell::new(None) };
}

fn with<T>(reach: impl FnOnce(&mut Stage) -> Told<T>) -> Told<T> {
    STAGE.with_borrow_mut(|stage| match stage {
        Some(stage) => reach(stage),
        None => wrong("there is no contact to speak of: ask within `impact`, `slide` or `roll`"),
    })
}

fn in_impact<T>(reach: impl FnOnce(&mut Stage) -> Option<T>) -> Told<T> {
    with(|stage| reach(stage).map_or_else(|| wrong("this is for `impact` alone"), Ok))
}

fn in_rub<T>(reach: impl FnOnce(&mut Stage) -> Option<T>) -> Told<T> {
    with(|stage| reach(stage).map_or_else(|| wrong("this is for `slide` and `roll` alone"), Ok))
}

fn within(value: &Dynamic, what: &str, least: f64, most: f64) -> Told<f64> {
    let value = number(value)?;
    if (least..=most).contains(&value) {
        Ok(value)
    } else {
        wrong(format!("{what} is {value}, not from {least} to {most}"))
    }
}

/// A hit by its number.
fn hit_of(stage: &Stage, hit: i64) -> Told<(&Arc<Repertoire>, usize)> {
    let Stage::Impact { repertoire, .. } = stage else { return wrong("this is for `impact` alone") };
    match usize::try_from(hit) {
        Ok(index) if index < repertoire.hits().len() => Ok((repertoire, index)),
        _ => wrong(format!("there is no hit {hit}: the corpus has {}", repertoire.hits().len())),
    }
}

fn choice_of(stage: &Stage, choice: i64) -> Told<(&Arc<Repertoire>, usize, Placed)> {
    let Stage::Rub { repertoire, choices, .. } = stage else {
        return wrong("this is for `slide` and `roll` alone");
    };
    match usize::try_from(choice).ok().and_then(|index| Some((index, *choices.get(index)?))) {
        Some((index, placed)) => Ok((repertoire, index, placed)),
        None => wrong(format!("there is no choice {choice}: here are {}", choices.len())),
    }
}

fn teach(engine: &mut Engine) {
    engine.register_fn("hits", || {
        in_impact(|stage| match stage {
            Stage::Impact { repertoire, .. } => Some(repertoire.hits().len() as i64),
            Stage::Rub { .. } => None,
        })
    });
    engine.register_fn("strength", || {
        in_impact(|stage| match stage {
            Stage::Impact { strength, .. } => Some(*strength),
            Stage::Rub { .. } => None,
        })
    });
    engine.register_fn("level", |hit: i64| {
        with(|stage| {
            let (repertoire, hit) = hit_of(stage, hit)?;
            let strongest_db = repertoire.hits().last().map_or(0.0, |hit| hit.level_db);
            Ok(repertoire.hits()[hit].level_db - strongest_db)
        })
    });
    engine.register_fn("length", |hit: i64| {
        with(|stage| hit_of(stage, hit).map(|(repertoire, hit)| repertoire.hits()[hit].length_s))
    });
    engine.register_fn("pick", |strength: Dynamic| {
        let strength = within(&strength, "a strength", 0.0, f64::MAX)?;
        in_impact(|stage| match stage {
            Stage::Impact { repertoire, random, picks, last, .. } => {
                let hit = repertoire.hit(20.0 * strength.log10(), *random, *picks, *last)?;
                *picks += 1;
                *last = Some(hit);
                Some(hit as i64)
            }
            Stage::Rub { .. } => None,
        })
    });
    engine.register_fn("play", |hit: i64, after: Dynamic, gain: Dynamic, pitch: Dynamic| {
        let after_s = within(&after, "a delay", 0.0, LATEST_S)?;
        let gain = within(&gain, "a gain", 0.0, LOUDEST)?;
        let pitch = within(&pitch, "a pitch", *PITCHES.start(), *PITCHES.end())?;
        with(|stage| {
            let (_, hit) = hit_of(stage, hit)?;
            let Stage::Impact { voices, .. } = stage else { return Ok(()) };
            if voices.len() == MOST_HITS {
                return wrong(format!("an impact plays more than {MOST_HITS} hits"));
            }
            voices.push(Voice { hit, after_s, gain, pitch });
            Ok(())
        })
    });
    engine.register_fn("choices", || {
        in_rub(|stage| match stage {
            Stage::Rub { choices, .. } => Some(choices.len() as i64),
            Stage::Impact { .. } => None,
        })
    });
    engine.register_fn("fit", |choice: i64| {
        with(|stage| choice_of(stage, choice).map(|(_, _, placed)| f64::from(placed.correlation)))
    });
    engine.register_fn("brightness", |number: i64| {
        with(|stage| match stage {
            Stage::Impact { .. } => {
                hit_of(stage, number).map(|(repertoire, hit)| repertoire.hits()[hit].centroid_hz)
            }
            Stage::Rub { .. } => {
                let (repertoire, _, placed) = choice_of(stage, number)?;
                Ok(repertoire.dictionary().grains()[placed.grain as usize].centroid_hz)
            }
        })
    });
    engine.register_fn("choose", |choice: i64| {
        with(|stage| {
            let (_, index, _) = choice_of(stage, choice)?;
            if let Stage::Rub { shade, .. } = stage {
                shade.choice = Some(index);
            }
            Ok(())
        })
    });
    type Part = fn(&mut Shade) -> &mut f64;
    let words: [(&str, &str, f64, f64, Part); 4] = [
        ("gain", "a gain", 0.0, LOUDEST, |shade| &mut shade.gain),
        ("pitch", "a pitch", *PITCHES.start(), *PITCHES.end(), |shade| &mut shade.pitch),
        ("spread", "a spread", 0.0, 1.0, |shade| &mut shade.spread),
        ("wait", "a wait", 0.0, LATEST_S, |shade| &mut shade.wait_s),
    ];
    for (name, what, least, most, part) in words {
        engine.register_fn(name, move |value: Dynamic| {
            let value = within(&value, what, least, most)?;
            in_rub(|stage| match stage {
                Stage::Rub { shade, .. } => {
                    *part(shade) = value;
                    Some(())
                }
                Stage::Impact { .. } => None,
            })
        });
    }
}

/// The function for a kind of contact that lasts.
fn name_of(action: Action) -> &'static str {
    if action == Action::Roll { "roll" } else { "slide" }
}

impl Shader {
    /// Reads a script.
    ///
    /// # Errors
    /// A file that cannot be read; a script that is wrong, breaks a limit, or has none of the functions that are
    /// called.
    pub fn open(file: impl AsRef<Path>) -> Result<Self> {
        let script = Script::open(file.as_ref(), Random::new(0, 0), teach)?;
        for (name, arguments, usage) in CALLED {
            if script.functions().any(|known| known == name) && !script.has(name, arguments) {
                let error = Error::new(format!("`{name}` takes {arguments} arguments"));
                return Err(script.placed(name, error.help(format!("write `{usage}`"))));
            }
        }
        if !CALLED.iter().any(|(name, arguments, _)| script.has(name, *arguments)) {
            let usages = CALLED.map(|(_, _, usage)| format!("`{usage}`")).join(", ");
            let what = "the script has none of the functions of a shader";
            return Err(Error::new(what).help(format!("write one of {usages}")).in_file(script.file()));
        }
        Ok(Self { script: Arc::new(script) })
    }

    fn on_stage(
        &self,
        name: &str,
        arguments: impl rhai::FuncArgs,
        random: Random,
        time_s: f64,
        stage: Stage,
    ) -> Result<Option<Stage>> {
        STAGE.set(Some(stage));
        let result = self.script.call(name, arguments, random, time_s);
        let stage = STAGE.take();
        result.map(|_| stage)
    }

    /// Whether it decides what impacts sound like.
    pub fn has_impact(&self) -> bool {
        self.script.has("impact", 3)
    }

    /// What an impact plays, with times since its onset, and which hit it picked last; all that is random in it follows
    /// from `random`.
    ///
    /// # Errors
    /// A script that fails or breaks a limit.
    pub fn impact(
        &self,
        struck: &Struck,
        repertoire: &Arc<Repertoire>,
        random: Random,
        last: Option<usize>,
    ) -> Result<(Vec<Play>, Option<usize>)> {
        let stage = Stage::Impact {
            repertoire: repertoire.clone(),
            strength: struck.impulse_ns / struck.reference_impulse_ns,
            random,
            picks: 0,
            last,
            voices: Vec::new(),
        };
        let arguments = (struck.impulse_ns, struck.speed_mps, struck.slip_mps);
        let script_random = Random::new(random.bits(u64::MAX), 1);
        let stage = self.on_stage("impact", arguments, script_random, struck.time_s, stage)?;
        let Some(Stage::Impact { voices, last, .. }) = stage else { return Ok((Vec::new(), last)) };
        let mut plays = Vec::new();
        for voice in voices {
            let hit = &repertoire.hits()[voice.hit];
            let gain = voice.gain * repertoire.gain(voice.hit);
            plays.extend(hit.plays.iter().map(|play| Play {
                time_s: voice.after_s + play.time_s / voice.pitch,
                grain: Grain { gain: play.grain.gain * gain, speed: voice.pitch, ..play.grain },
            }));
        }
        plays.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        Ok((plays, last))
    }

    /// Whether it decides what goes on while bodies slide or roll.
    pub(super) fn shades(&self, action: Action) -> bool {
        self.script.has(name_of(action), 2)
    }

    /// What is said of the next grain of a contact that lasts, of those that fit.
    pub(super) fn grain(
        &self,
        action: Action,
        course: &Course,
        choices: &[Placed],
        repertoire: &Arc<Repertoire>,
        random: Random,
        time_s: f64,
    ) -> Result<Shade> {
        let name = name_of(action);
        let shade =
            Shade { choice: None, gain: 1.0, pitch: course.pitch, spread: course.spread, wait_s: 0.0 };
        let stage = Stage::Rub { repertoire: repertoire.clone(), choices: choices.to_vec(), shade };
        let arguments = (course.force_n, course.speed_mps);
        let stage = self.on_stage(name, arguments, random, time_s, stage)?;
        Ok(match stage {
            Some(Stage::Rub { shade, .. }) => shade,
            _ => shade,
        })
    }
}
