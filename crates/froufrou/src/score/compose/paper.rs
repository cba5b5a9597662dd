//! Paper: what sounds as it crumples, rubs and tears (Schreck et al. 2016).
//!
//! A crumpling plays a clip for each resonator that it sets vibrating, in a thread of its own; resonators share its power
//! by their areas. All that rubs of a sheet along what has one sound is one thread, which is told how loud each spectrum of
//! the database is: its speed, the third power of its size against the database's, and the root of how hard it presses. All
//! that tears of a sheet is one thread. Clips and friction radiate as a small disk does, a dipole across the paper.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;

use super::going::{Does, Going};
use super::voice::{Place, Voice};
use super::{Composer, from_db, palette, tidy};
use crate::corpus::paper::PaperSound;
use crate::motion::event::{Buckle, Cause, Event, Friction, Resonator, Tear};
use crate::random::Random;
use crate::scene::carrier::Carrier;
use crate::scene::file::Paper;
use crate::score::{Action, Grain, Radiation, Start};
use crate::space::directivity::Directivity;
use crate::synth::paper::friction_control;
use crate::{Error, Result};

/// Keeps the choice of clips apart from other random numbers of the same seed.
const CLIPS: u64 = 0x7061_0000_0000_0000;

/// A resonator is louder or softer than the size it is taken for by this at most.
const MOST_SIZE: f64 = 2.0;

/// How a piece of paper radiates: across itself.
pub(super) fn radiation() -> Radiation {
    Radiation::Harmonics(Directivity::DIPOLE.coefficients[..4].to_vec())
}

/// What papers sound like, and what is known of their sheets.
#[derive(Default)]
pub(super) struct Papers {
    /// Databases, by the name of the sound.
    sounds: BTreeMap<String, Arc<PaperSound>>,
    /// The spectra that threads of friction were told of last, by the thread.
    told: BTreeMap<u64, Vec<usize>>,
    /// The clips that a sheet has played: how many, and the last one.
    played: BTreeMap<String, (u64, Option<usize>)>,
}

/// What rubs at once and sounds alike.
#[derive(Default)]
struct Gathered {
    /// How loud each spectrum is.
    levels: BTreeMap<usize, f64>,
    /// Places and normals, weighted by that.
    position: DVec3,
    normal: DVec3,
    weight: f64,
    along: String,
}

impl Gathered {
    fn add(&mut self, spectrum: usize, level: f64, resonator: &Resonator) {
        *self.levels.entry(spectrum).or_default() += level;
        let normal = DVec3::from(resonator.normal);
        self.position += level * DVec3::from(resonator.position_m);
        // Both sides of a paper are one.
        self.normal += if self.normal.dot(normal) < 0.0 { -level } else { level } * normal;
        self.weight += level;
    }
}

impl Papers {
    /// From what is known of the sounds of a score.
    pub fn new<E: Iterator<Item = Result<Event>>>(composer: &Composer<'_, E>) -> Self {
        let paper = |(name, facts): (&String, &super::SoundFacts)| Some((name.clone(), facts.paper.clone()?));
        Self { sounds: composer.facts.iter().filter_map(paper).collect(), ..Self::default() }
    }

    /// Takes in what a paper sounds like.
    pub fn learn(&mut self, name: &str, sound: &Arc<PaperSound>) {
        self.sounds.insert(name.to_owned(), sound.clone());
    }

    /// Forgets a sheet that is no more.
    pub fn forget(&mut self, sheet: &str) {
        self.played.remove(sheet);
    }

    /// How long before its crumpling the longest clip begins, in seconds.
    pub fn longest_lead_s(&self) -> f64 {
        let clips = self.sounds.values().flat_map(|sound| sound.clips());
        clips.map(|clip| clip.lead_s).fold(0.0, f64::max)
    }
}

/// How much louder a disk is than another, by their radii: a³.
fn size(resonator: &Resonator, ruling_m: f64, border_m: f64) -> f64 {
    if border_m <= 0.0 || resonator.area_m2 <= 0.0 {
        return 1.0;
    }
    let radius_m = |area_m2: f64| (area_m2 / PI).sqrt();
    let ratio = radius_m(resonator.area_m2) / radius_m(ruling_m * border_m / 2.0);
    ratio.powi(3).clamp(1.0 / MOST_SIZE, MOST_SIZE)
}

/// A place that faces as a sheet does.
fn facing(position_m: [f64; 3], normal: [f64; 3]) -> Carrier {
    let facing = DVec3::from(normal).normalize_or(DVec3::NEG_Z);
    Carrier::still_facing(position_m, facing.to_array())
}

impl<'s, E: Iterator<Item = Result<Event>>> Composer<'s, E> {
    /// The paper that something in the world is of.
    pub(super) fn paper_of(&self, name: &str) -> Option<&'s Paper> {
        self.material_of(name, self.index_of(name)?)?.paper.as_ref()
    }

    /// A sheet crumples: a clip for each resonator.
    pub(super) fn crumple_paper(&mut self, buckle: &Buckle, paper: &'s Paper) -> Result<()> {
        if buckle.time_s < 0.0 {
            return Ok(());
        }
        let name = self.sheet_of(paper, &paper.corpus)?;
        let Some(sound) = self.papers.sounds.get(&name).cloned() else { return Ok(()) };
        let number = self.sheet_number(&buckle.cloth);
        let loud = buckle.energy_mps / paper.reference_energy_mps;
        let gain = from_db(paper.crumple_db) * paper.reference_distance_m * loud;
        let all_m2: f64 = buckle.resonators.iter().map(|resonator| resonator.area_m2).sum();
        for resonator in &buckle.resonators {
            // Clips have nothing to do with one another: their powers add.
            let share = if all_m2 > 0.0 { (resonator.area_m2 / all_m2).sqrt() } else { 1.0 };
            let random = Random::new(self.scene.seed ^ CLIPS, number);
            let (count, last) = self.papers.played.entry(buckle.cloth.clone()).or_default();
            let Some(clip) = sound.clip(resonator.ruling_m, resonator.border_m, *last, random, *count) else {
                continue;
            };
            (*count, *last) = (*count + 1, Some(clip));
            let Some(entry) = sound.clips().get(clip) else { continue };
            let begin_s = (buckle.time_s - entry.lead_s.min(self.foresight_s)).max(0.0);
            let cause = format!(
                "{} crumples, {:.4} m/s over {} vertices, {} of {:.1} cm with {:.1} cm of free border: clip {clip}, {}",
                buckle.cloth,
                buckle.energy_mps,
                buckle.vertices,
                if resonator.is_unconstrained() { "rulings" } else { "held rulings" },
                100.0 * resonator.ruling_m,
                100.0 * resonator.border_m,
                buckle.cause,
            );
            let start = Start {
                object: buckle.cloth.clone(),
                cause,
                pattern: self.disk(),
                ..Start::new(name.clone())
            };
            let mut voice = Voice::at(start, resonator.position_m, begin_s);
            voice.place = Place::Carrier(facing(resonator.position_m, resonator.normal));
            voice.gain =
                vec![(begin_s, tidy(gain * share * size(resonator, entry.ruling_m, entry.border_m)))];
            voice.end_s = begin_s + entry.length_s;
            let grain = Grain { number: clip as u32, gain: 1.0, speed: 1.0, spread: 0.0 };
            voice.tell((begin_s, Action::Grain(grain)).into());
            self.begin(begin_s, voice);
        }
        Ok(())
    }

    /// A sheet rubs for a moment: all of its parts that do, at once.
    pub(super) fn rub_paper(&mut self, frictions: &[Friction], paper: &'s Paper) -> Result<()> {
        let Some(first) = frictions.first().filter(|first| first.time_s >= 0.0) else { return Ok(()) };
        let mut gathered: BTreeMap<String, Gathered> = BTreeMap::new();
        for friction in frictions {
            let index = self.index_of(&friction.other);
            let along = index.and_then(|index| Some(&self.material_of(&friction.other, index)?.name));
            let corpus = paper.against.iter().find(|(name, _)| Some(name) == along);
            let name = self.sheet_of(paper, corpus.map_or(&paper.corpus, |(_, corpus)| corpus))?;
            let Some(sound) = self.papers.sounds.get(&name) else { continue };
            let sums = gathered.entry(name).or_default();
            if !sums.along.contains(&friction.other) {
                sums.along += if sums.along.is_empty() { "" } else { ", " };
                sums.along += &friction.other;
            }
            // The power of the sound grows with what truly touches, and that with the force.
            let pressed = friction.force_n.map_or(1.0, |force_n| (force_n / paper.reference_force_n).sqrt());
            let all_m2: f64 = friction.resonators.iter().map(|resonator| resonator.area_m2).sum();
            for resonator in &friction.resonators {
                let spectrum = sound.spectrum(resonator.ruling_m, resonator.border_m);
                let Some(number) = spectrum else { continue };
                let entry = &sound.spectra()[number];
                let size = size(resonator, entry.ruling_m, entry.border_m);
                // However many parts a sheet is found to have, it is no louder.
                let share = if all_m2 > 0.0 { resonator.area_m2 / all_m2 } else { 1.0 };
                sums.add(number, friction.speed_mps * size * share * pressed, resonator);
            }
        }
        for (name, sums) in gathered {
            if sums.weight > 0.0 {
                self.rub_thread(first, paper, name, &sums)?;
            }
        }
        Ok(())
    }

    /// Tells the thread of what rubs and sounds alike.
    fn rub_thread(&mut self, first: &Friction, paper: &Paper, name: String, sums: &Gathered) -> Result<()> {
        let Friction { time_s, lasts_s, cloth, cause, .. } = first;
        let position_m = (sums.position / sums.weight).to_array();
        let going = Going::new(cloth, 0, Does::Rub(name.clone()));
        let pattern = self.disk();
        let thread = self.thread(going, *time_s, position_m, || Start {
            cause: format!("{cloth} rubs along {}, {cause}", sums.along),
            pattern,
            ..Start::new(name)
        });
        let voices = &self.voices;
        self.papers.told.retain(|thread, _| voices.contains_key(thread));
        let spectra = sums.levels.keys().copied().collect();
        let before = self.papers.told.insert(thread, spectra).unwrap_or_default();
        // What sounds no more is told so.
        let mut told: Vec<(String, f64)> = Vec::new();
        for &spectrum in before.iter().filter(|spectrum| !sums.levels.contains_key(spectrum)) {
            told.push((friction_control(spectrum), 0.0));
        }
        told.extend(sums.levels.iter().map(|(spectrum, level)| (friction_control(*spectrum), tidy(*level))));
        let gain = from_db(paper.friction_db) * paper.reference_distance_m;
        let place = facing(position_m, sums.normal.to_array());
        self.go_on(thread, (*time_s, *lasts_s), place, gain, vec![(*time_s, Action::Set(told))]);
        Ok(())
    }

    /// A sheet tears.
    pub(super) fn tear_paper(&mut self, tear: &Tear) -> Result<()> {
        let Some(paper) = self.paper_of(&tear.sheet) else { return Ok(()) };
        let Cause::Motion(moved) = &tear.cause else { return Ok(()) };
        let (from_s, lasts_s) = (moved.from_s.max(0.0), moved.to_s - moved.from_s.max(0.0));
        if lasts_s <= 0.0 {
            return Ok(());
        }
        let name = self.sheet_of(paper, &paper.corpus)?;
        // It is known as soon as it has happened, so it sounds a frame late.
        let time_s = tear.time_s.max(from_s);
        let going = Going::new(&tear.sheet, 0, Does::Tear);
        let thread = self.thread(going, time_s, tear.position_m, || Start {
            cause: format!("{} tears, {}", tear.sheet, tear.cause),
            ..Start::new(name)
        });
        let speed_mps = tidy(tear.length_m / lasts_s);
        let told = vec![(time_s, Action::Set(vec![("tear".to_owned(), speed_mps)]))];
        let gain = from_db(paper.friction_db) * paper.reference_distance_m;
        self.go_on(thread, (time_s, lasts_s), Carrier::still(tear.position_m), gain, told);
        Ok(())
    }

    /// The name in the header of how paper radiates.
    fn disk(&self) -> String {
        let pattern = self.header.patterns.iter().find(|pattern| pattern.radiation == radiation());
        pattern.map_or(String::new(), |pattern| pattern.name.clone())
    }

    /// A number of a sheet among all, for the addresses of random numbers.
    fn sheet_number(&self, name: &str) -> u64 {
        let Some(object) = self.index_of(name) else { return 0 };
        if let Some(appeared) = self.presence.appeared(name) {
            return ((object as u64) << 32) + (1 << 31) + appeared.number;
        }
        let body = self.world.objects[object].iter().position(|body| body.name == name);
        ((object as u64) << 32) + body.unwrap_or_default() as u64
    }

    /// The name of the sound of one of the databases of a paper.
    fn sheet_of(&self, paper: &Paper, corpus: &str) -> Result<String> {
        self.name_of_sound(&palette::paper(paper, corpus)).ok_or_else(|| {
            Error::new("the paper of a material is not among the sounds of its score")
                .in_file(&self.scene.file)
        })
    }
}
