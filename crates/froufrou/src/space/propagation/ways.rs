//! All ways from a source to a microphone: straight, by patches of bodies, and from the images that walls make.

use super::super::air;
use super::super::bands::{BAND_COUNT, Bands};
use super::super::microphone::NEAR_M;
use super::super::pickup::{Receiving, Toward};
use super::super::surroundings::{End, Paths};
use super::super::tracing::Tracing;
use super::SILENT;
use super::inbox::{Inbox, distance};
use super::source::Source;
use crate::Result;
use crate::score::{Arrival, ObjectLine};

/// One way from a source to a microphone.
#[derive(Clone, Copy)]
pub(super) struct Way {
    /// From where it is heard.
    toward: Toward,
    length_m: f64,
    delay_s: f64,
    gain: f64,
    /// What walls leave of each band.
    walls: Bands,
    /// Where it leaves its source, or seems to.
    from_m: [f64; 3],
    /// With what gain its sound goes into the tail of a room; only of ways that go straight.
    pub into_tail: f64,
}

/// Memory that is used again and again.
#[derive(Default)]
pub(super) struct Scratch {
    paths: Paths,
    /// Where a path meets walls.
    met: Vec<[f64; 3]>,
}

/// What walls leave where there are none.
const ALL: Bands = [1.0; BAND_COUNT];

impl Way {
    /// What a microphone makes of it, for each of its outputs. Air absorbs so much of it.
    pub fn hear(&self, receiving: &Receiving, absorption: Option<&Bands>, values: &mut Vec<Arrival>) {
        let first = values.len();
        receiving.hear(self.toward, self.length_m, self.gain, self.delay_s, values);
        let mut bands = self.walls;
        if let Some(absorption) = absorption {
            let air = air::gains(absorption, self.length_m);
            bands.iter_mut().zip(air).for_each(|(band, air)| *band *= air);
        }
        values[first..].iter_mut().for_each(|value| value.bands = Some(bands));
    }
}

/// Where all bands of all that arrives are alike it has no colour: it is louder or softer.
pub(super) fn plain(values: &mut [Arrival]) {
    let level = |value: &Arrival| {
        let bands = value.bands.unwrap_or(ALL);
        bands.iter().all(|band| *band == bands[0]).then_some(bands[0])
    };
    if values.iter().all(|value| level(value).is_some()) {
        for value in values {
            value.gain *= level(value).unwrap_or(1.0);
            value.bands = None;
        }
    }
}

/// Finds all ways from a source with a gain to a microphone in one of its takes: straight (of one that is spread as many
/// as it has voices), by each patch and from each image, always as many and in the same order. Ways that are not heard have a gain of 0.
pub(super) fn find<L: Iterator<Item = Result<ObjectLine>>>(
    inbox: &mut Inbox<L>,
    tracing: Option<&mut Tracing>,
    source: &mut Source,
    (ear, take): (usize, usize),
    (time_s, gain): (f64, f64),
    scratch: &mut Scratch,
    ways: &mut Vec<Way>,
) -> Result<()> {
    ways.clear();
    let position_m = source.track.at(time_s).0;
    let radiated = source.radiation(time_s);
    let toward = |m: [f64; 3]| radiated(std::array::from_fn(|i| m[i] - position_m[i]));
    let (pose, delay_s) = inbox.meeting(ear, take, position_m, time_s)?;
    if let Some(spread) = &mut source.spread {
        // What arrives from each direction, as if it came from the middle of what lies there.
        for bin in spread.heard(time_s, pose.position_m)? {
            let from_m = std::array::from_fn(|i| pose.position_m[i] + bin.distance_m * bin.direction[i]);
            let (late, delay_s) = inbox.meeting(ear, take, from_m, time_s)?;
            let (length_m, gain) = (bin.distance_m, gain * bin.energy.sqrt());
            ways.push(Way {
                toward: Toward::new(&late, from_m),
                length_m,
                delay_s,
                gain,
                walls: ALL,
                from_m,
                into_tail: gain,
            });
        }
        // Of the energy that goes into the tail each voice has the part that it has of what is heard.
        let energy: f64 = ways.iter().map(|way| way.gain * way.gain).sum();
        let scale = if energy > 0.0 { gain / energy.sqrt() } else { 0.0 };
        ways.iter_mut().for_each(|way| way.into_tail *= scale);
    } else {
        let from = Toward::new(&pose, position_m);
        let into_tail = gain * source.diffuse();
        let gain = gain * toward(pose.position_m) / from.distance_m.max(NEAR_M);
        let (length_m, from_m) = (from.distance_m, position_m);
        ways.push(Way { toward: from, length_m, delay_s, gain, walls: ALL, from_m, into_tail });
    }
    let Some(Tracing { surroundings, enclosure, .. }) = tracing else { return Ok(()) };

    let end = |position_m| End { position_m, thing: source.thing };
    if !surroundings.is_empty() {
        let to = End { position_m: pose.position_m, thing: None };
        surroundings.paths(time_s, end(position_m), to, &mut scratch.paths)?;
        if source.spread.is_some() {
            for (path, way) in (0u32..).zip(&mut *ways) {
                let share =
                    if way.gain > SILENT { surroundings.share(time_s, end(way.from_m), to)? } else { 1.0 };
                way.gain *= source.shadows.cover(path, ear, time_s, way.gain, share);
            }
        } else {
            ways[0].gain *= source.shadows.follow(0, ear, time_s, scratch.paths.direct);
        }
        for bounce in &scratch.paths.bounces {
            let path = ways.len() as u32;
            // A microphone that moves is met a little later by way of a patch.
            let (late, _) = inbox.pose(ear, take, time_s + inbox.delay_s(bounce.length_m))?;
            let apart = |m: [f64; 3]| distance(m, bounce.point_m);
            let length_m = bounce.length_m + apart(late.position_m) - apart(pose.position_m);
            let open = bounce.gain * toward(bounce.point_m) * gain;
            ways.push(Way {
                toward: Toward::new(&late, bounce.point_m),
                length_m,
                delay_s: inbox.delay_s(length_m.max(0.0)),
                gain: open * source.shadows.cover(path, ear, time_s, bounce.gain, bounce.share),
                walls: ALL,
                from_m: bounce.point_m,
                into_tail: 0.0,
            });
        }
    }

    let Some(enclosure) = enclosure else { return Ok(()) };
    enclosure.pose(time_s)?;
    if !(enclosure.contains(position_m) && enclosure.contains(pose.position_m)) {
        ways.iter_mut().for_each(|way| way.into_tail = 0.0);
    }
    for number in 1..=enclosure.images() {
        let path = ways.len() as u32;
        let Some(image) = enclosure.image(number, position_m, pose.position_m) else {
            source.shadows.forget(path, ear);
            ways.push(Way { gain: 0.0, into_tail: 0.0, ..ways[0] });
            continue;
        };
        let image_m = image.position_m(position_m);
        let (late, delay_s) = inbox.meeting(ear, take, image_m, time_s)?;
        let from = Toward::new(&late, image_m);
        let leaves = image.leaves(std::array::from_fn(|i| late.position_m[i] - image_m[i]));
        let spread = 1.0 / from.distance_m.max(NEAR_M);
        let loudest = image.gains.iter().copied().fold(0.0, f64::max);
        let mut share = 1.0;
        if !surroundings.is_empty() && loudest * spread > SILENT {
            enclosure.way(image, image_m, pose.position_m, &mut scratch.met);
            scratch.met.push(position_m);
            let mut before_m = pose.position_m;
            for &next_m in &scratch.met {
                share *= surroundings.share(time_s, end(next_m), end(before_m))?;
                before_m = next_m;
            }
        }
        let share = source.shadows.cover(path, ear, time_s, loudest * spread, share);
        ways.push(Way {
            toward: from,
            length_m: from.distance_m,
            delay_s,
            gain: gain * radiated(leaves) * spread * share,
            walls: image.gains,
            from_m: image_m,
            into_tail: 0.0,
        });
    }
    Ok(())
}
