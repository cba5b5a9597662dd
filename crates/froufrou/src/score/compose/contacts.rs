//! Contacts of bodies: what sounds at an impact, and while bodies slide or roll along each other.

use std::collections::VecDeque;

use super::voice::{Place, Telling, Voice};
use super::{Composer, Group, cue_at, from_db, line_at, tidy};
use crate::Result;
use crate::motion::event::{Cause, Event, Impact, Rub};
use crate::motion::rub::Rubbing;
use crate::random::Random;
use crate::scene::carrier::Carrier;
use crate::scene::file::{ImpactSound, Material, Played, RubSound};
use crate::scene::world::body_named;
use crate::score::{Action, Blow, Start};

/// Two bodies that slide or roll and are not told to any more have stopped after so long.
pub(super) const RUB_GAP_S: f64 = 0.03;

/// So many pairs of bodies are never too many to remember.
pub(super) const LEAST_QUIET: usize = 256;

/// Keeps the places of strikes apart from other random numbers of the same seed.
const STRIKES: u64 = 0x57a1_0000_0000_0000;

/// One of two bodies in contact, as it sounds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side<'r> {
    pub body: &'r str,
    /// What it is in contact with.
    pub other: &'r str,
    /// The object that it is.
    pub index: usize,
}

fn verb(how: Rubbing) -> &'static str {
    match how {
        Rubbing::Slide => "slides",
        Rubbing::Roll => "rolls",
    }
}

/// What a material sounds like then.
fn sound_of(material: &Material, how: Rubbing) -> Option<&RubSound> {
    match how {
        Rubbing::Slide => material.slide.as_ref(),
        Rubbing::Roll => material.roll.as_ref(),
    }
}

impl<'s, E: Iterator<Item = Result<Event>>> Composer<'s, E> {
    /// The object that a body is, which is one or none: logs have names of their own, what is told by motion alone
    /// has those of the world.
    fn object_of(&self, body: &str, cause: &Cause) -> Option<usize> {
        if let Some(appeared) = self.presence.appeared(body) {
            return Some(appeared.kind);
        }
        if self.presence.is_gone(body) {
            return None;
        }
        let of_log = || self.scene.objects.iter().position(|object| object.body.matches(body));
        let of_world =
            || self.world.objects.iter().position(|bodies| bodies.iter().any(|other| other.name == body));
        match cause {
            Cause::Log(_) => of_log(),
            Cause::Motion(_) => of_world().or_else(of_log),
        }
    }

    /// Both bodies in contact, with their materials, where they have them.
    fn sides<'r>(&self, a: &'r str, b: &'r str, cause: &Cause) -> Vec<(Side<'r>, &'s Material)> {
        let side = |(body, other): (&'r str, &'r str)| {
            let index = self.object_of(body, cause)?;
            let material = self.material_of(body, index)?;
            Some((Side { body, other, index }, material))
        };
        [(a, b), (b, a)].into_iter().filter_map(side).collect()
    }

    /// Lets both bodies of an impact sound, as their materials have it.
    pub(super) fn strike(&mut self, impact: &Impact) -> Result<()> {
        if impact.time_s < 0.0 {
            return Ok(());
        }
        for (side, material) in self.sides(&impact.a, &impact.b, &impact.cause) {
            // A sound of its own comes before the grains of the material.
            let (floor_ns, retrigger_s) = match (&material.impact, &material.grains) {
                (Some(sound), _) => (sound.floor_impulse_ns, sound.retrigger_s),
                (None, Some(grains)) => (grains.floor_impulse_ns, grains.retrigger_s),
                (None, None) => continue,
            };
            let pair = (side.body.to_owned(), side.other.to_owned(), side.index);
            let quiet = self.quiet_until_s.get(&pair).is_some_and(|&until_s| impact.time_s < until_s);
            if impact.impulse_ns < floor_ns || quiet {
                continue;
            }
            if self.quiet_until_s.len() >= self.most_quiet {
                self.quiet_until_s.retain(|_, &mut until_s| until_s > impact.time_s);
                self.most_quiet = LEAST_QUIET.max(2 * self.quiet_until_s.len());
            }
            self.quiet_until_s.insert(pair, impact.time_s + retrigger_s);
            match (&material.impact, &material.grains) {
                (Some(sound), _) => self.strike_one(impact, side, sound)?,
                (None, Some(grains)) => self.strike_grains(impact, side, grains)?,
                (None, None) => {}
            }
        }
        Ok(())
    }

    /// What carries a body of a log, and the name of its stem.
    pub(super) fn carried(
        &self,
        index: usize,
        body: &str,
        position_m: [f64; 3],
        time_s: f64,
    ) -> Result<(Carrier, String)> {
        if let Some(carrier) = self.carrier_of(body) {
            return Ok((carrier.holding(position_m, time_s)?, body.to_owned()));
        }
        let bodies = &self.world.objects[index];
        let named = body_named(bodies, &self.scene.objects[index].name, body).or(bodies.first());
        let carrier = match named.and_then(|b| b.carrier.as_ref()) {
            Some(carrier) => carrier.holding(position_m, time_s)?,
            None => Carrier::still(position_m),
        };
        let object = named
            .filter(|_| bodies.len() > 1)
            .map_or_else(|| self.scene.objects[index].name.clone(), |b| b.name.clone());
        Ok((carrier, object))
    }

    fn strike_one(&mut self, impact: &Impact, side: Side<'_>, sound: &ImpactSound) -> Result<()> {
        let Side { body, other, index } = side;
        let time_s = impact.time_s;
        let (name, speed) = self.pick(Group::Impact(index), &sound.played, sound.speed_variation)?;
        let facts = self.facts.get(&name);
        if facts.is_none() && self.learns {
            return Ok(());
        }
        let ring_s = facts.and_then(|facts| facts.ring_s);
        let struck = matches!(sound.played, Played::Instrument(_));
        let count = self.picks.get(&Group::Impact(index)).map_or(0, |picks| picks.count);
        let [from, to] = sound.place;
        let place = from + (to - from) * Random::new(self.scene.seed, STRIKES + index as u64).uniform(count);
        let blow = Blow { impulse_ns: impact.impulse_ns, place: tidy(place), contact_s: sound.contact_s };
        let cause = format!("{body} struck by {other}, {:.4} N s, {}", impact.impulse_ns, impact.cause);
        let ringing = (index, body.to_owned());
        if struck && let Some(ring_s) = ring_s {
            // What still rings is struck again.
            if let Some(&id) = self.ringing.get(&ringing)
                && let Some(voice) = self.voices.get_mut(&id)
            {
                voice.end_s = voice.end_s.max(time_s + ring_s);
                voice.cues.push_back(Telling { time_s, action: Action::Strike(blow), cause });
                self.due.push(cue_at(time_s, id));
                return Ok(());
            }
        }
        let length_s =
            if struck { ring_s.unwrap_or(0.0) } else { facts.map_or(0.0, |facts| facts.length_s) / speed };
        let (carrier, object) = self.carried(index, body, impact.position_m, time_s)?;
        // Pressure is proportional to impulse; an instrument is so by itself.
        let level = if struck { 1.0 } else { impact.impulse_ns } / sound.reference_impulse_ns;
        let gain = from_db(sound.gain_db) * level * sound.reference_distance_m;
        let start = Start { speed, object, cause, ..Start::new(name) };
        let strike = struck.then(|| Telling::from((time_s, Action::Strike(blow))));
        let cues = VecDeque::from_iter(strike);
        let id = self.begin(
            time_s,
            Voice {
                start: Some(start),
                of: body.to_owned(),
                place: Place::Carrier(carrier),
                turns: false,
                gain: vec![(time_s, gain)],
                end_s: time_s + length_s,
                passed_s: time_s,
                due_s: time_s,
                beat_s: 0.0,
                cues,
                speed: None,
            },
        );
        if struck {
            let voices = &self.voices;
            self.ringing.retain(|_, id| voices.contains_key(id));
            self.ringing.insert(ringing, id);
        }
        Ok(())
    }

    /// Lets both bodies sound that slide or roll along each other, as their materials have it.
    pub(super) fn rub(&mut self, rub: &Rub, how: Rubbing) -> Result<()> {
        if rub.time_s < 0.0 {
            return Ok(());
        }
        for (side, material) in self.sides(&rub.a, &rub.b, &rub.cause) {
            match (sound_of(material, how), &material.grains) {
                (Some(sound), _) if rub.speed_mps >= sound.floor_speed_mps => {
                    self.rub_one(rub, how, side, sound)?;
                }
                (None, Some(grains)) if rub.speed_mps >= grains.floor_speed_mps => {
                    self.rub_grains(rub, how, side, grains)?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn rub_one(&mut self, rub: &Rub, how: Rubbing, side: Side<'_>, sound: &RubSound) -> Result<()> {
        let gain =
            from_db(sound.gain_db) * rub.force_n / sound.reference_force_n * sound.reference_distance_m;
        let id = match self.rubs_already(side, how) {
            Some(id) => id,
            None => {
                let (name, _) = self.pick(Group::Rub(how, side.index), &sound.played, 0.0)?;
                if self.learns && !self.facts.contains_key(&name) {
                    return Ok(());
                }
                self.begin_rub(rub, how, side, name)?
            }
        };
        let name = self.name_of(&sound.played, 0);
        let controls = name.and_then(|name| self.facts.get(&name)).map(|facts| facts.controls.as_slice());
        let has =
            |control: &str| controls.is_some_and(|controls| controls.iter().any(|name| name == control));
        let told = [("speed", rub.speed_mps), ("force", rub.force_n)].into_iter();
        let told: Vec<(String, f64)> =
            told.filter(|(name, _)| has(name)).map(|(name, value)| (name.to_owned(), tidy(value))).collect();
        let told = if told.is_empty() { Vec::new() } else { vec![(rub.time_s, Action::Set(told))] };
        let moment = (rub.time_s, rub.lasts_s);
        self.go_on(id, moment, Carrier::still(rub.position_m), gain, told);
        Ok(())
    }

    /// The thread of two bodies that rub along each other already.
    pub(super) fn rubs_already(&self, side: Side<'_>, how: Rubbing) -> Option<u64> {
        let pair = (side.body.to_owned(), side.other.to_owned(), side.index, how);
        self.rubbing.get(&pair).copied().filter(|id| self.voices.contains_key(id))
    }

    /// Begins the thread of two bodies that begin to rub along each other; what it sounds like is still to be told.
    pub(super) fn begin_rub(
        &mut self,
        rub: &Rub,
        how: Rubbing,
        side: Side<'_>,
        sound: String,
    ) -> Result<u64> {
        let Side { body, other, index } = side;
        let time_s = rub.time_s;
        let (_, object) = self.carried(index, body, rub.position_m, time_s)?;
        let cause = format!("{body} {} along {other}, {}", verb(how), rub.cause);
        let start = Start { object, cause, ..Start::new(sound) };
        let voice = Voice { of: body.to_owned(), ..Voice::at(start, rub.position_m, time_s) };
        let voices = &self.voices;
        self.rubbing.retain(|_, id| voices.contains_key(id));
        self.streams.retain(|id, _| voices.contains_key(id));
        let id = self.begin(time_s, voice);
        self.rubbing.insert((body.to_owned(), other.to_owned(), index, how), id);
        Ok(id)
    }

    /// Tells a thread of things that rub along each other of a moment: when and where that is, and how long they go on
    /// unless more is told.
    pub(super) fn go_on(
        &mut self,
        id: u64,
        (time_s, lasts_s): (f64, f64),
        place: Carrier,
        gain: f64,
        told: Vec<(f64, Action)>,
    ) {
        let told: Vec<Telling> = told.into_iter().map(Telling::from).collect();
        let end_s = time_s + RUB_GAP_S + lasts_s;
        let (pulses, beat_s) = (self.pulses, self.beat_s);
        let Some(voice) = self.voices.get_mut(&id) else { return };
        // It dies away where it is told nothing more.
        if pulses {
            // Nobody knows what comes next: until then it goes evenly to where it is told to be.
            let reached_s = time_s + lasts_s;
            let before = if voice.start.is_some() { 0.0 } else { voice.gain_at(time_s) };
            voice.gain = vec![(time_s, before), (reached_s, gain), (end_s, 0.0)];
            voice.place = match &voice.place {
                Place::Carrier(before) if voice.start.is_none() => {
                    Place::Carrier(before.passing_to(&place, [time_s, reached_s], beat_s))
                }
                _ => Place::Carrier(place),
            };
        } else {
            voice.gain = vec![(time_s, gain), (end_s, 0.0)];
            voice.place = Place::Carrier(place);
            // No key comes before more is told: it would stand where it is, and die away.
            voice.beat_s = 1.5 * lasts_s;
        }
        voice.end_s = end_s;
        // Two logs may tell of one pair at one time.
        if voice.start.is_some() || voice.passed_s < time_s {
            voice.due_s = time_s;
            self.due.push(line_at(time_s, id));
        }
        if let Some(cue_s) = told.first().map(|first| first.time_s) {
            if voice.cues.front().is_none_or(|next| cue_s < next.time_s) {
                self.due.push(cue_at(cue_s.max(time_s), id));
            }
            voice.cues.extend(told);
        }
    }
}
