//! What plays while bodies slide or roll: grains one after the other, along the pattern of a recording.

use std::collections::VecDeque;
use std::sync::Arc;

use super::{Play, Repertoire, Shader};
use crate::Result;
use crate::corpus::dictionary::{Action, Placed};
use crate::corpus::grains::GrainKind;
use crate::random::Random;
use crate::score::Grain;

/// So many of the grains that fit best are chosen among.
const CHOICE: usize = 4;

/// So many of the last grains are not played again, if there are others.
const MEMORY: usize = 12;

/// How far from its place a grain is looked for at first, in lengths of a median grain.
const REACH: f64 = 0.5;

/// How a contact is at a moment, as far as its grains go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Course {
    /// Speed of grains of sinusoids.
    pub pitch: f64,
    /// Spread of grains of sinusoids.
    pub spread: f64,
    /// How hard the bodies press against each other, in newtons, for shaders.
    pub force_n: f64,
    /// How fast they slide or roll, in metres a second, for shaders.
    pub speed_mps: f64,
}

/// The grains of one contact for as long as it lasts.
#[derive(Debug, Clone)]
pub struct Stream {
    action: Action,
    layers: [Layer; 2],
}

/// The grains of one part of the sound: sinusoids or residual.
#[derive(Debug, Clone)]
struct Layer {
    kind: GrainKind,
    random: Random,
    /// So many random numbers have been drawn.
    drawn: u64,
    /// When the next grain begins, since the beginning.
    next_s: f64,
    /// The recording along whose pattern it goes, by its number among those of its action, and where it is there.
    recording: usize,
    cursor: f64,
    played: VecDeque<u32>,
}

impl Layer {
    fn draw(&mut self, n: usize) -> usize {
        self.drawn += 1;
        self.random.below(self.drawn, n)
    }

    /// Goes to a random place of a random recording.
    fn leap(&mut self, action: Action, repertoire: &Repertoire) {
        let lasting = repertoire.lasting(action);
        self.recording = self.draw(lasting.len());
        let length =
            lasting.get(self.recording).map_or(0, |&(n, _)| repertoire.dictionary().recordings()[n].length);
        self.cursor = self.draw(length.max(1)) as f64;
    }
}

impl Stream {
    /// Begins at a random place of a recording.
    pub fn new(repertoire: &Repertoire, action: Action, random: Random) -> Self {
        let layer = |number: u64, kind| Layer {
            kind,
            random: Random::new(random.bits(number), 1),
            drawn: 0,
            next_s: 0.0,
            recording: 0,
            cursor: 0.0,
            played: VecDeque::with_capacity(MEMORY + 1),
        };
        let mut layers = [layer(1, GrainKind::Sinusoidal), layer(2, GrainKind::Transient)];
        // Both parts begin at the same place, so that they belong together.
        layers[0].leap(action, repertoire);
        (layers[1].recording, layers[1].cursor) = (layers[0].recording, layers[0].cursor);
        Self { action, layers }
    }

    /// The grains that begin before a time, in seconds since the beginning, and have not been given; in order of time.
    /// A shader may decide which.
    ///
    /// # Errors
    /// A shader that fails.
    pub fn until(
        &mut self,
        to_s: f64,
        course: Course,
        repertoire: &Arc<Repertoire>,
        shader: Option<&Shader>,
    ) -> Result<Vec<Play>> {
        let mut plays = Vec::new();
        for layer in 0..self.layers.len() {
            while self.layers[layer].next_s < to_s {
                match self.next(layer, course, repertoire, shader)? {
                    Some(play) => plays.push(play),
                    // The recordings have nothing of this part.
                    None => self.layers[layer].next_s = f64::INFINITY,
                }
            }
        }
        plays.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        Ok(plays)
    }

    fn next(
        &mut self,
        layer: usize,
        course: Course,
        repertoire: &Arc<Repertoire>,
        shader: Option<&Shader>,
    ) -> Result<Option<Play>> {
        let lasting = repertoire.lasting(self.action);
        let dictionary = repertoire.dictionary();
        let rate_hz = f64::from(dictionary.rate_hz());
        let kind = self.layers[layer].kind;
        // A recording may end, or have nothing of this part: another one goes on, or itself from elsewhere.
        for _ in 0..2 * lasting.len().max(1) + 8 {
            let Layer { recording, cursor, .. } = self.layers[layer];
            let Some(&(number, level)) = lasting.get(recording) else { return Ok(None) };
            let about = &dictionary.recordings()[number];
            let candidates = candidates(repertoire, number, kind, cursor, &self.layers[layer].played);
            if candidates.is_empty() {
                self.layers[layer].leap(self.action, repertoire);
                continue;
            }
            let chosen = self.layers[layer].draw(candidates.len());
            let time_s = self.layers[layer].next_s;
            let shade = match shader.filter(|shader| shader.shades(self.action)) {
                Some(shader) => {
                    let layer = &mut self.layers[layer];
                    layer.drawn += 1;
                    let random = Random::new(layer.random.bits(layer.drawn), 1);
                    Some(shader.grain(self.action, &course, &candidates, repertoire, random, time_s)?)
                }
                None => None,
            };
            let placed = candidates[shade.and_then(|shade| shade.choice).unwrap_or(chosen)];
            let entry = &dictionary.grains()[placed.grain as usize];
            let (pitch, spread) =
                shade.map_or((course.pitch, course.spread), |shade| (shade.pitch, shade.spread));
            // Transients keep their spectrum.
            let (speed, spread) = if kind == GrainKind::Sinusoidal { (pitch, spread) } else { (1.0, 0.0) };
            let wait_s = shade.map_or(0.0, |shade| shade.wait_s);
            let time_s = if wait_s > 0.0 { ((time_s + wait_s) * rate_hz).round() / rate_hz } else { time_s };
            let taper = dictionary.settings().extraction.taper;
            let state = &mut self.layers[layer];
            let overlap = 0.5 * taper * entry.length as f64;
            let hop = (entry.length as f64 - overlap).max(1.0).round();
            state.next_s = if speed == 1.0 {
                // On the grid of samples, where grains pass unchanged.
                ((time_s * rate_hz).round() + hop) / rate_hz
            } else {
                time_s + hop / (speed * rate_hz)
            };
            // As far as the grain is long, wherever it was found: so it comes to the end.
            state.cursor += hop;
            state.played.push_back(placed.grain);
            if state.played.len() > MEMORY {
                state.played.pop_front();
            }
            if state.cursor >= about.length as f64 {
                self.layers[layer].leap(self.action, repertoire);
            }
            let gain = f64::from(placed.gain) * repertoire.loudest(self.action) / level;
            let gain = gain * shade.map_or(1.0, |shade| shade.gain);
            return Ok(Some(Play { time_s, grain: Grain { number: placed.grain, gain, speed, spread } }));
        }
        Ok(None)
    }
}

/// The grains of a kind that fit best near a place of a recording, the best first, without those played lately; nearer to
/// it than half a median grain, or where there are none as near as need be.
fn candidates(
    repertoire: &Repertoire,
    recording: usize,
    kind: GrainKind,
    cursor: f64,
    played: &VecDeque<u32>,
) -> Vec<Placed> {
    let dictionary = repertoire.dictionary();
    let about = &dictionary.recordings()[recording];
    let is_of_kind = |placed: &&Placed| dictionary.grains()[placed.grain as usize].kind == kind;
    let (mut reach, mut stale) = (REACH * repertoire.median_length(kind), Vec::new());
    while reach < 2.0 * about.length as f64 {
        let (from, to) = ((cursor - reach).max(0.0) as u64, (cursor + reach) as u64);
        let begin = about.pattern.partition_point(|placed| placed.start < from);
        let end = about.pattern.partition_point(|placed| placed.start <= to);
        let mut found: Vec<Placed> = about.pattern[begin..end].iter().filter(is_of_kind).copied().collect();
        found.sort_by(|a, b| b.correlation.total_cmp(&a.correlation).then(a.grain.cmp(&b.grain)));
        found.dedup_by_key(|placed| placed.grain);
        let fresh: Vec<Placed> =
            found.iter().filter(|placed| !played.contains(&placed.grain)).copied().take(CHOICE).collect();
        if !fresh.is_empty() {
            return fresh;
        }
        if stale.is_empty() {
            stale = found;
        }
        reach *= 2.0;
    }
    // There are few grains of this kind in all: another than the last, if there is one.
    if stale.len() > 1 {
        stale.retain(|placed| Some(&placed.grain) != played.back());
    }
    stale.truncate(CHOICE);
    stale
}
