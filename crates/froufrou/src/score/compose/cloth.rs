//! Cloth: what sounds while it rubs, and when it buckles (An, James & Marschner 2012).
//!
//! Each patch of a cloth has a thread for each object that it rubs along, which is told how much of it slides how fast;
//! each buckle plays a pop in a thread of its patch, whose energy is as rare among the pops as that of the buckle is among
//! those of the cloth; and where the cloth is a membrane, a thread of each patch is told how taut and how fast it is.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::going::{Does, Going};
use super::voice::{Place, Telling};
use super::{Composer, cue_at, from_db, line_at, palette, tidy};
use crate::corpus::cloth::ClothSound;
use crate::corpus::cloth::playback::{Learning, Playback};
use crate::motion::event::{Buckle, Event, Flap, Friction};
use crate::random::Random;
use crate::scene::carrier::Carrier;
use crate::scene::file::Cloth;
use crate::scene::world::Body;
use crate::score::{Action, Blow, Grain, Start};
use crate::synth::friction::voice::settings;
use crate::synth::friction::{FrictionTable, PARTS, SpeedHistogram};
use crate::{Error, Result};

/// Keeps the times of pops apart from other random numbers of the same seed.
const POPS: u64 = 0x70b5_0000_0000_0000;

/// Where a membrane is struck as it snaps: none of its low modes rests there.
const SNAPS_AT: f64 = 0.3;

/// What cloths sound like, and what is known of them.
#[derive(Default)]
pub(super) struct Wardrobe {
    /// By the name of the sound.
    sounds: BTreeMap<String, Worn>,
    /// How pops are chosen, by the name of the cloth.
    playbacks: BTreeMap<String, Playback>,
    /// How many pops a cloth has played.
    counts: BTreeMap<String, u64>,
    /// How they are chosen where bucklings are told as they happen, by the name of the cloth and its corpus.
    learning: BTreeMap<(String, String), Learning>,
    /// How many of those there were so far, with the ones that are forgotten.
    learnt: u64,
}

/// The sound of a cloth.
struct Worn {
    sound: Arc<ClothSound>,
    friction: Option<(Arc<FrictionTable>, f64)>,
}

impl Wardrobe {
    /// From what is known of the sounds of a score, and the energies of the buckles of each cloth.
    ///
    /// # Errors
    /// Energies that are none.
    pub fn new<E: Iterator<Item = Result<Event>>>(
        composer: &Composer<'_, E>,
        energies: &BTreeMap<String, Vec<f64>>,
    ) -> Result<Self> {
        let scene = composer.scene;
        let mut wardrobe = Self::default();
        for (name, facts) in &composer.facts {
            if let Some(sound) = &facts.cloth {
                wardrobe.learn(name, sound);
            }
        }
        for (number, (cloth, energies)) in energies.iter().enumerate() {
            let Some(material) = composer.cloth_of(cloth) else { continue };
            let Some(worn) = wardrobe.sounds.get(&composer.sound_of(&material.corpus)?) else { continue };
            let pops: Vec<f64> = worn.sound.pops().iter().map(|pop| pop.energy).collect();
            if pops.is_empty() || energies.is_empty() {
                continue;
            }
            let random = Random::new(scene.seed ^ POPS, number as u64);
            let playback = Playback::new(&pops, energies, material.jitter_s, random)
                .map_err(|fault| fault.in_file(&scene.file))?;
            wardrobe.playbacks.insert(cloth.clone(), playback);
        }
        Ok(wardrobe)
    }

    /// Takes in what a cloth sounds like.
    pub fn learn(&mut self, name: &str, sound: &Arc<ClothSound>) {
        let friction = sound
            .friction()
            .map(|friction| (Arc::new(FrictionTable::new(&friction.spectra)), friction.area_m2));
        self.sounds.insert(name.to_owned(), Worn { sound: sound.clone(), friction });
    }

    /// Forgets a cloth that is no more.
    pub fn forget(&mut self, cloth: &str) {
        self.learning.retain(|(name, _), _| name != cloth);
    }

    /// How long before its buckle the longest pop begins, in seconds.
    pub fn longest_lead_s(&self) -> f64 {
        let pops = self.sounds.values().flat_map(|worn| worn.sound.pops());
        pops.map(|pop| pop.lead_s).fold(0.0, f64::max)
    }
}

impl<'s, E: Iterator<Item = Result<Event>>> Composer<'s, E> {
    /// The cloth that something in the world is of.
    fn cloth_of(&self, name: &str) -> Option<&'s Cloth> {
        self.material_of(name, self.index_of(name)?)?.cloth.as_ref()
    }

    /// The object that something in the world belongs to.
    pub(super) fn index_of(&self, name: &str) -> Option<usize> {
        if let Some(appeared) = self.presence.appeared(name) {
            return Some(appeared.kind);
        }
        let there = !self.presence.is_gone(name);
        let is_of = |bodies: &Vec<_>| bodies.iter().any(|body: &Body| body.name == name);
        self.world.objects.iter().position(is_of).filter(|_| there)
    }

    /// A patch of a cloth rubs for a moment.
    pub(super) fn rustle(&mut self, friction: &Friction) -> Result<()> {
        if friction.time_s < 0.0 {
            return Ok(());
        }
        let Some(cloth) = self.cloth_of(&friction.cloth) else { return Ok(()) };
        let other = self.index_of(&friction.other);
        let along = other.and_then(|index| Some(&self.material_of(&friction.other, index)?.name));
        let corpus = cloth.against.iter().find(|(name, _)| Some(name) == along);
        let name = self.sound_of(corpus.map_or(&cloth.corpus, |(_, corpus)| corpus))?;
        let Some((table, area_m2)) = self.wardrobe.sounds.get(&name).and_then(|worn| worn.friction.clone())
        else {
            return Ok(());
        };
        let mut histogram = SpeedHistogram::new(&table);
        for [speed_mps, slides_m2] in &friction.speeds {
            histogram.add(&table, *speed_mps, slides_m2 / area_m2);
        }
        let mut told = settings(&histogram.parts(&table, PARTS));
        told.iter_mut().for_each(|(_, value)| *value = tidy(*value));
        let time_s = friction.time_s;
        let gain = from_db(cloth.friction_db) * cloth.reference_distance_m;
        let going = Going::new(&friction.cloth, friction.patch, Does::Rub(friction.other.clone()));
        let id = self.thread(going, time_s, friction.position_m, || Start {
            cause: format!("{} rubs along {}, {}", friction.cloth, friction.other, friction.cause),
            ..Start::new(name)
        });
        let moment = (time_s, friction.lasts_s);
        let place = Carrier::still(friction.position_m);
        self.go_on(id, moment, place, gain, vec![(time_s, Action::Set(told))]);
        Ok(())
    }

    /// A part of a cloth buckles.
    pub(super) fn crumple(&mut self, buckle: &Buckle) -> Result<()> {
        if buckle.time_s < 0.0 {
            return Ok(());
        }
        let Some(cloth) = self.cloth_of(&buckle.cloth) else { return Ok(()) };
        let name = self.sound_of(&cloth.corpus)?;
        let Wardrobe { sounds, playbacks, counts, learning, learnt } = &mut self.wardrobe;
        let Some(worn) = sounds.get(&name) else { return Ok(()) };
        let chosen = match playbacks.get(&buckle.cloth) {
            Some(playback) => {
                let count = counts.entry(buckle.cloth.clone()).or_default();
                *count += 1;
                playback.choose(*count - 1, buckle.time_s, buckle.energy_mps)
            }
            None if self.pulses && !worn.sound.pops().is_empty() => {
                let learning = learning.entry((buckle.cloth.clone(), name.clone())).or_insert_with(|| {
                    let pops: Vec<f64> = worn.sound.pops().iter().map(|pop| pop.energy).collect();
                    let random = Random::new(self.scene.seed ^ POPS, *learnt);
                    *learnt += 1;
                    Learning::new(&pops, cloth.jitter_s, random)
                });
                learning.choose(buckle.time_s, buckle.energy_mps)?
            }
            None => return Ok(()),
        };
        let Some(pop) = worn.sound.pops().get(chosen.pop) else { return Ok(()) };
        let now_s = (buckle.time_s - self.foresight_s).max(0.0);
        let begin_s = (chosen.time_s - pop.lead_s).max(now_s);
        let end_s = begin_s + pop.length_s;
        let Buckle { energy_mps, vertices, cause, .. } = buckle;
        let going = Going::new(&buckle.cloth, buckle.patch, Does::Pop);
        let id = self.thread(going, now_s, buckle.patch_m, || Start {
            cause: format!("{} buckles, {cause}", buckle.cloth),
            ..Start::new(name)
        });
        let cause = format!(
            "{} buckles, {energy_mps:.4} m/s over {vertices} vertices: pop {}, {cause}",
            buckle.cloth, chosen.pop
        );
        let gain = from_db(cloth.pops_db);
        let grain = Grain { number: chosen.pop as u32, gain, speed: 1.0, spread: 0.0 };
        if let Some(voice) = self.voices.get_mut(&id) {
            voice.gain = vec![(now_s, cloth.reference_distance_m)];
            voice.end_s = voice.end_s.max(end_s);
            voice.place = Place::Carrier(Carrier::still(buckle.patch_m));
            voice.tell(Telling { time_s: begin_s, action: Action::Grain(grain), cause });
            if voice.start.is_none() && voice.passed_s < now_s {
                voice.due_s = now_s;
                self.due.push(line_at(now_s, id));
            }
        }
        self.due.push(cue_at(begin_s, id));
        Ok(())
    }

    /// A patch of a cloth beats the air for a moment.
    pub(super) fn flap(&mut self, flap: &Flap) -> Result<()> {
        if flap.time_s < 0.0 {
            return Ok(());
        }
        let Some(cloth) = self.cloth_of(&flap.cloth) else { return Ok(()) };
        let Some(sheet) = &cloth.membrane else { return Ok(()) };
        let Some(name) = self.name_of_sound(&palette::membrane(sheet)) else { return Ok(()) };
        let time_s = flap.time_s;
        // What it is blown at with stirs it as what it beats.
        let wind = self.world.wind.as_ref().map_or([0.0; 3], |wind| wind.velocity_mps(time_s));
        let wind_mps = wind.iter().map(|v| v * v).sum::<f64>().sqrt();
        let controls = [("tension", flap.tension_n_per_m), ("speed", flap.speed_mps.hypot(wind_mps))];
        let controls = controls.map(|(name, value)| (name.to_owned(), tidy(value))).to_vec();
        let mut told = vec![(time_s, Action::Set(controls))];
        if let Some(impulse_ns) = flap.impulse_ns {
            let blow = Blow { impulse_ns: tidy(impulse_ns), place: SNAPS_AT, contact_s: sheet.contact_s };
            told.push((time_s, Action::Strike(blow)));
        }
        let going = Going::new(&flap.cloth, flap.patch, Does::Flap);
        let id = self.thread(going, time_s, flap.position_m, || Start {
            cause: format!("{} beats the air, {}", flap.cloth, flap.cause),
            ..Start::new(name)
        });
        let gain = from_db(sheet.gain_db) * cloth.reference_distance_m;
        self.go_on(id, (time_s, flap.lasts_s), Carrier::still(flap.position_m), gain, told);
        Ok(())
    }

    /// The name of the sound of a corpus of cloth.
    fn sound_of(&self, corpus: &str) -> Result<String> {
        self.name_of_sound(&palette::cloth(corpus)).ok_or_else(|| {
            Error::new("the cloth of a material is not among the sounds of its score")
                .in_file(&self.scene.file)
        })
    }
}
