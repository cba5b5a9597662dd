//! Contacts of bodies that sound like the grains of a corpus (Picard, Tsingos & Faure 2009, section 4).

use std::collections::VecDeque;
use std::sync::Arc;

use super::contacts::Side;
use super::voice::{Place, Voice};
use super::{Composer, Group, from_db, tidy};
use crate::corpus::dictionary;
use crate::motion::event::{Event, Impact, Rub};
use crate::motion::rub::Rubbing;
use crate::random::Random;
use crate::scene::carrier::Carrier;
use crate::scene::file::GrainSound;
use crate::score::retarget::{Course, LONGEST_LEAD_S, Play, Repertoire, Stream, Struck};
use crate::score::{Action, Grain, Start};
use crate::{Error, Result};

/// Keeps the grains that are chosen apart from other random numbers of the same seed.
const GRAINS: u64 = 0x6ea1_0000_0000_0000;

/// Grains are played from two octaves down to two octaves up.
const PITCHES: (f64, f64) = (0.25, 4.0);

/// Grains are spread by this part of their frequencies at most.
const WIDEST: f64 = 0.2;

/// The grains of two bodies that rub along each other, and when they began.
pub(super) struct Flow {
    begin_s: f64,
    stream: Stream,
}

impl<E: Iterator<Item = Result<Event>>> Composer<'_, E> {
    /// The name of the sound of a material's grains, and what there is to choose from; nothing while they are being loaded.
    fn repertoire(&self, sound: &GrainSound) -> Result<Option<(String, Arc<Repertoire>)>> {
        let name = self.name_of_sound(&super::palette::grains(sound));
        let known = name.and_then(|name| Some((name.clone(), self.repertoires.get(&name)?.clone())));
        if known.is_none() && !self.learns {
            return Err(Error::new("the grains of a material are not among the sounds of its score")
                .in_file(&self.scene.file));
        }
        Ok(known)
    }

    pub(super) fn strike_grains(
        &mut self,
        impact: &Impact,
        side: Side<'_>,
        sound: &GrainSound,
    ) -> Result<()> {
        let Side { body, other, index } = side;
        let Some((name, repertoire)) = self.repertoire(sound)? else { return Ok(()) };
        let group = Group::Impact(index);
        let random = Random::new(self.scene.seed, GRAINS ^ group.number());
        let picks = self.picks.entry(group).or_default();
        let strength = impact.impulse_ns / sound.reference_impulse_ns;
        let shader = sound.shader.as_ref().and_then(|shader| self.shaders.get(&shader.name));
        let (plays, level) = match shader.filter(|shader| shader.has_impact()) {
            Some(shader) => {
                let struck = Struck {
                    impulse_ns: impact.impulse_ns,
                    speed_mps: impact.speed_mps.unwrap_or(0.0),
                    slip_mps: impact.tangential_mps.unwrap_or(0.0),
                    reference_impulse_ns: sound.reference_impulse_ns,
                    time_s: impact.time_s,
                };
                let random = Random::new(random.bits(picks.count), 2);
                let (plays, last) = shader.impact(&struck, &repertoire, random, picks.last)?;
                picks.last = last;
                (plays, 1.0)
            }
            None => match repertoire.hit(20.0 * strength.log10(), random, picks.count, picks.last) {
                Some(hit) => {
                    picks.last = Some(hit);
                    (repertoire.hits()[hit].plays.clone(), strength * repertoire.gain(hit))
                }
                None => return Ok(()),
            },
        };
        picks.count += 1;
        let Some(first) = plays.first() else { return Ok(()) };
        let gain = from_db(sound.gain_db) * level * sound.reference_distance_m;
        // What comes before the onset begins before the impact, where there is time.
        let lead_s = (-first.time_s).max(0.0);
        let begin_s = (impact.time_s - lead_s.min(LONGEST_LEAD_S.min(self.foresight_s))).max(0.0);
        let onset_s = begin_s + lead_s;
        let dictionary = repertoire.dictionary();
        let (rate_hz, grains) = (f64::from(dictionary.rate_hz()), dictionary.grains());
        let end_s = |play: &Play| {
            let length = grains[play.grain.number as usize].length as f64;
            onset_s + play.time_s + length / (rate_hz * play.grain.speed)
        };
        let last_s = plays.iter().map(end_s).fold(begin_s, f64::max);
        let (carrier, object) = self.carried(index, body, impact.position_m, impact.time_s)?;
        let of = &dictionary.recordings()[grains[first.grain.number as usize].recording].name;
        let cause =
            format!("{body} struck by {other}, {:.4} N s, as {of}, {}", impact.impulse_ns, impact.cause);
        let start = Start { object, cause, ..Start::new(name) };
        let cues = plays.iter().map(|play| (onset_s + play.time_s, Action::Grain(play.grain)).into());
        let voice = Voice {
            start: Some(start),
            of: body.to_owned(),
            place: Place::Carrier(carrier),
            turns: false,
            gain: vec![(begin_s, gain)],
            end_s: last_s,
            passed_s: begin_s,
            due_s: begin_s,
            beat_s: 0.0,
            cues: cues.collect::<VecDeque<_>>(),
            speed: None,
        };
        self.begin(begin_s, voice);
        Ok(())
    }

    pub(super) fn rub_grains(
        &mut self,
        rub: &Rub,
        how: Rubbing,
        side: Side<'_>,
        sound: &GrainSound,
    ) -> Result<()> {
        let Some((name, repertoire)) = self.repertoire(sound)? else { return Ok(()) };
        let action = match how {
            Rubbing::Slide => dictionary::Action::Slide,
            Rubbing::Roll => dictionary::Action::Roll,
        };
        if repertoire.lasting(action).is_empty() {
            return Ok(());
        }
        let id = match self.rubs_already(side, how) {
            Some(id) => id,
            None => {
                let id = self.begin_rub(rub, how, side, name)?;
                let random = Random::new(self.scene.seed ^ GRAINS, id);
                let stream = Stream::new(&repertoire, action, random);
                self.streams.insert(id, Flow { begin_s: rub.time_s, stream });
                id
            }
        };
        let shader = sound.shader.as_ref().and_then(|shader| self.shaders.get(&shader.name)).cloned();
        let Some(flow) = self.streams.get_mut(&id) else { return Ok(()) };
        let power_w = rub.force_n * rub.speed_mps;
        let gain = from_db(sound.gain_db) * power_w / sound.reference_power_w * sound.reference_distance_m;
        let course = Course {
            pitch: tidy(
                (rub.speed_mps / sound.reference_speed_mps).powf(sound.pitch).clamp(PITCHES.0, PITCHES.1),
            ),
            spread: tidy((sound.spread * rub.force_n / sound.reference_force_n).min(WIDEST)),
            force_n: rub.force_n,
            speed_mps: rub.speed_mps,
        };
        // The moment that follows is told at its middle: until then there must be no gap.
        let to_s = rub.time_s - flow.begin_s + rub.lasts_s + super::contacts::RUB_GAP_S;
        let plays = flow.stream.until(to_s, course, &repertoire, shader.as_ref())?;
        let told = plays.into_iter().map(|Play { time_s, grain }| {
            let grain = Grain { gain: tidy(grain.gain), ..grain };
            (flow.begin_s + time_s, Action::Grain(grain))
        });
        let told = told.collect();
        self.go_on(id, (rub.time_s, rub.lasts_s), Carrier::still(rub.position_m), gain, told);
        Ok(())
    }
}
