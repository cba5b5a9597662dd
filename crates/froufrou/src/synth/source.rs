//! The running signal of one thread that is synthesised: made once, heard along each of the thread's
//! paths.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

use super::instrument::{Generator, GrainStart, Instrument, Ramp, Stretch, Strike, stretch_samples};
use super::path::Foresight;
use super::sinc::{self, Samples};
use super::tiny;
use super::voice::Signal;
use crate::random::Random;
use crate::score::Action;
use crate::{Error, Result};

/// After a fault the signal is brought to nothing over this many samples.
const SETTLE: usize = 256;

/// Where nobody knows what is told next, a control goes from its value to the one that it is told within so many seconds.
const GLIDE_S: f64 = 0.01;

/// So long before a sample is heard at the latest must be known what a source is told, in seconds: it is made in whole
/// stretches, and read a kernel's half width ahead, where what moves comes no faster than a quarter of the speed of sound.
pub(crate) fn prompt_s(rate_hz: f64) -> f64 {
    (stretch_samples(rate_hz) + sinc::half_width(1.25) + 2) as f64 / rate_hz
}

/// A generator, what it has been told, and the part of its signal that is still under way.
pub(crate) struct Source {
    /// Never locked: it is here so that a source may be shared while its signal is read.
    generator: Mutex<Option<Box<dyn Generator>>>,
    rate_hz: f64,
    controls: Vec<ControlTrack>,
    rings: bool,
    grain_count: usize,
    /// How far ahead of its sound the generator is told its controls.
    ahead_s: f64,
    foresight: Foresight,
    strikes: VecDeque<Strike>,
    grains: VecDeque<GrainStart>,
    /// The signal from sample `base` on.
    samples: Vec<f32>,
    base: u64,
    /// Scratch memory.
    ramps: Vec<Ramp>,
    due: Vec<Strike>,
    due_grains: Vec<GrainStart>,
}

/// The value of a control over time, even between its keys.
struct ControlTrack {
    name: String,
    /// Seconds since the thread started, and values; there is always one.
    keys: VecDeque<(f64, f64)>,
}

impl ControlTrack {
    fn at(&self, time_s: f64) -> f64 {
        let after = self.keys.partition_point(|&(key_s, _)| key_s <= time_s);
        match (after.checked_sub(1).and_then(|before| self.keys.get(before)), self.keys.get(after)) {
            (Some(&(from_s, from)), Some(&(to_s, to))) => {
                from + (to - from) * ((time_s - from_s) / (to_s - from_s))
            }
            (Some(&(_, value)), None) | (None, Some(&(_, value))) => value,
            (None, None) => 0.0,
        }
    }

    /// From a time on it goes to a value.
    fn glide(&mut self, time_s: f64, value: f64) {
        let from = self.at(time_s);
        while self.keys.back().is_some_and(|&(key_s, _)| key_s >= time_s) {
            self.keys.pop_back();
        }
        // What it is told as it starts it has from the start.
        if time_s > 0.0 {
            self.keys.push_back((time_s, from));
            self.keys.push_back((time_s + GLIDE_S, value));
        } else {
            self.keys.push_back((time_s, value));
        }
    }

    fn forget(&mut self, time_s: f64) {
        while self.keys.get(1).is_some_and(|&(key_s, _)| key_s <= time_s) {
            self.keys.pop_front();
        }
    }
}

impl Source {
    /// A source that starts now.
    pub(crate) fn new(instrument: &dyn Instrument, rate_hz: f64, random: Random) -> Result<Self> {
        let track = |control: &super::instrument::Control| ControlTrack {
            name: control.name.clone(),
            keys: VecDeque::from([(0.0, control.default)]),
        };
        Ok(Self {
            generator: Mutex::new(Some(instrument.generator(rate_hz, random)?)),
            rate_hz,
            controls: instrument.controls().iter().map(track).collect(),
            rings: instrument.ring_s().is_some(),
            grain_count: instrument.clips(),
            ahead_s: instrument.ahead_s(),
            foresight: Foresight::NextKey,
            strikes: VecDeque::new(),
            grains: VecDeque::new(),
            samples: Vec::new(),
            base: 0,
            ramps: Vec::new(),
            due: Vec::new(),
            due_grains: Vec::new(),
        })
    }

    /// The same with another foresight: where it has none, controls glide to what they are told.
    pub(crate) fn with(self, foresight: Foresight) -> Self {
        Self { foresight, ..self }
    }

    /// Takes in what is said to it, `time_s` seconds after its start.
    pub(crate) fn cue(&mut self, time_s: f64, action: &Action) -> Result<()> {
        match action {
            Action::Strike(_) if !self.rings => {
                return Err(Error::new("the sound is struck, and it does not ring")
                    .help("strike a string, a bar, modes or a script that has `fn strike`"));
            }
            Action::Strike(blow) => self.strikes.push_back(Strike {
                time_s,
                impulse_ns: blow.impulse_ns,
                place: blow.place,
                contact_s: blow.contact_s,
            }),
            Action::Grain(grain) => {
                if grain.number as usize >= self.grain_count {
                    let what = match self.grain_count {
                        0 => "the sound is told to play a grain, and it is none of grains".to_owned(),
                        count => format!("there is no grain {}: its corpus has {count}", grain.number),
                    };
                    return Err(
                        Error::new(what).help("grains are counted from 0, and a score fits one corpus")
                    );
                }
                self.grains.push_back(GrainStart { time_s, grain: *grain });
            }
            Action::Set(values) => {
                for (name, value) in values {
                    let Some(track) = self.controls.iter_mut().find(|track| track.name == *name) else {
                        let known: Vec<&str> =
                            self.controls.iter().map(|track| track.name.as_str()).collect();
                        let fault = Error::new(format!("the sound has no control `{name}`"));
                        return Err(match known.as_slice() {
                            [] => fault.help("it has none"),
                            known => fault.help(format!("it has {}", known.join(", "))),
                        });
                    };
                    match self.foresight {
                        Foresight::NextKey => track.keys.push_back((time_s, *value)),
                        Foresight::None if time_s <= 0.0 => track.glide(0.0, *value),
                        // It has asked for what is so far ahead already.
                        Foresight::None => track.glide(time_s + self.ahead_s, *value),
                    }
                }
            }
        }
        Ok(())
    }

    /// Seconds since its start up to which every control that moves is known.
    pub(crate) fn known_s(&self) -> f64 {
        if self.foresight == Foresight::None {
            return f64::INFINITY;
        }
        let last = self.controls.iter().filter(|track| track.keys.len() > 1);
        last.filter_map(|track| track.keys.back()).map(|&(key_s, _)| key_s).fold(f64::INFINITY, f64::min)
            - self.ahead_s
    }

    /// Makes the signal up to sample `to`, and forgets it up to sample `from`.
    pub(crate) fn make(&mut self, from: u64, to: u64) -> Result<()> {
        let forgotten = usize::try_from(from.saturating_sub(self.base)).unwrap_or(usize::MAX);
        let forgotten = forgotten.min(self.samples.len());
        self.samples.drain(..forgotten);
        self.base += forgotten as u64;
        let count = stretch_samples(self.rate_hz);
        while self.base + (self.samples.len() as u64) < to {
            let first = self.base + self.samples.len() as u64;
            let begin = self.samples.len();
            self.samples.resize(begin + count, 0.0);
            let made = self.stretch(first, begin);
            if made.is_err() {
                self.generator = Mutex::new(None);
                self.settle(begin);
            }
            // What nobody will hear is not kept.
            let unheard = from.saturating_sub(self.base).min(self.samples.len() as u64);
            if unheard as usize == self.samples.len() {
                self.samples.clear();
                self.base += unheard;
            }
            made?;
        }
        Ok(())
    }

    /// Makes the stretch at `first`, which is `samples[begin..]`.
    fn stretch(&mut self, first: u64, begin: usize) -> Result<()> {
        let generator = self.generator.get_mut().unwrap_or_else(PoisonError::into_inner);
        let Some(generator) = generator else { return Ok(()) };
        let out = &mut self.samples[begin..];
        let begin_s = first as f64 / self.rate_hz;
        let end_s = (first + out.len() as u64) as f64 / self.rate_hz;
        self.ramps.clear();
        for track in &mut self.controls {
            let [from_s, to_s] = [begin_s, end_s].map(|time_s| time_s + self.ahead_s);
            track.forget(from_s);
            self.ramps.push(Ramp { from: track.at(from_s), to: track.at(to_s) });
        }
        self.due.clear();
        while let Some(strike) = self.strikes.front().filter(|strike| strike.time_s < end_s) {
            // One that is late by a rounding is not lost.
            self.due.push(Strike { time_s: strike.time_s.max(begin_s), ..*strike });
            self.strikes.pop_front();
        }
        self.due_grains.clear();
        while let Some(start) = self.grains.front().filter(|start| start.time_s < end_s) {
            self.due_grains.push(GrainStart { time_s: start.time_s.max(begin_s), ..*start });
            self.grains.pop_front();
        }
        let stretch = Stretch {
            first,
            rate_hz: self.rate_hz,
            controls: &self.ramps,
            strikes: &self.due,
            grains: &self.due_grains,
        };
        generator.generate(&stretch, out)?;
        tiny::flush(out);
        match out.iter().position(|sample| !sample.is_finite()) {
            None => Ok(()),
            Some(index) => {
                let time_s = (first + index as u64) as f64 / self.rate_hz;
                Err(Error::new(format!("the signal is no finite number {time_s} s after its start")))
            }
        }
    }

    /// Lets the signal come to rest where a stretch failed.
    fn settle(&mut self, begin: usize) {
        let last = begin.checked_sub(1).and_then(|before| self.samples.get(before)).copied().unwrap_or(0.0);
        let part = |index: usize| 1.0 - ((index + 1) as f32 / SETTLE as f32).min(1.0);
        let settled = (0..(self.samples.len() - begin).max(SETTLE)).map(|index| last * part(index));
        let settled: Vec<f32> = settled.collect();
        self.samples.truncate(begin);
        self.samples.extend(settled);
    }

    /// What has been made of the signal and is not forgotten.
    pub(crate) fn signal(&self) -> Signal<'_> {
        Signal {
            kernel: sinc::Kernel::Long,
            samples: Samples { samples: &self.samples, looped: false },
            base: self.base as f64,
            rate_hz: self.rate_hz,
        }
    }

    /// How many samples are held, for tests.
    #[cfg(test)]
    pub(crate) fn held(&self) -> usize {
        self.samples.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Blow;
    use crate::synth::instrument::Control;

    /// A signal that tells what it was told: its control, one sample after another, and a one where it
    /// is struck. It fails once the control is above 100.
    struct Telling {
        rings: bool,
    }

    const STRUCK: Telling = Telling { rings: true };
    const STEADY: Telling = Telling { rings: false };

    impl Instrument for Telling {
        fn controls(&self) -> &[Control] {
            static CONTROLS: std::sync::LazyLock<[Control; 1]> =
                std::sync::LazyLock::new(|| [Control { name: "speed".into(), default: 2.0 }]);
            &*CONTROLS
        }

        fn ring_s(&self) -> Option<f64> {
            self.rings.then_some(1.0)
        }

        fn generator(&self, _: f64, _: Random) -> Result<Box<dyn Generator>> {
            Ok(Box::new(Teller))
        }
    }

    struct Teller;

    impl Generator for Teller {
        fn generate(&mut self, stretch: &Stretch<'_>, out: &mut [f32]) -> Result<()> {
            let count = out.len();
            for (index, out) in out.iter_mut().enumerate() {
                *out = stretch.controls[0].at(index, count) as f32;
            }
            for strike in stretch.strikes {
                let index = (strike.time_s * stretch.rate_hz) as u64 - stretch.first;
                out[index as usize] += strike.impulse_ns as f32;
            }
            if stretch.controls[0].to > 100.0 {
                return Err(Error::new("too fast"));
            }
            Ok(())
        }
    }

    fn set(value: f64) -> Action {
        Action::Set(vec![("speed".into(), value)])
    }

    #[test]
    fn controls_change_evenly_and_strikes_fall_on_their_sample() {
        let mut source = Source::new(&STRUCK, 1000.0, Random::new(0, 0)).unwrap();
        assert_eq!(source.known_s(), f64::INFINITY);
        source.cue(0.1, &set(4.0)).unwrap();
        source.cue(0.2, &set(0.0)).unwrap();
        let blow = Blow { impulse_ns: 10.0, place: 0.0, contact_s: 0.0 };
        source.cue(0.0505, &Action::Strike(blow)).unwrap();
        assert_eq!(source.known_s(), 0.2);
        source.make(0, 300).unwrap();
        for (index, &sample) in source.samples[..300].iter().enumerate() {
            let time = index as f64 / 1000.0;
            let expected = if time < 0.1 { 2.0 + 20.0 * time } else { (4.0 - 40.0 * (time - 0.1)).max(0.0) };
            let struck = if index == 50 { 10.0 } else { 0.0 };
            assert!((f64::from(sample) - expected - struck).abs() < 1e-5, "{index}: {sample}");
        }
        assert!(source.cue(0.3, &Action::Set(vec![("sped".into(), 1.0)])).is_err());
        let mut steady = Source::new(&STEADY, 1000.0, Random::new(0, 0)).unwrap();
        assert!(steady.cue(0.3, &Action::Strike(blow)).is_err(), "what cannot ring cannot be struck");
    }

    #[test]
    fn what_is_kept_does_not_change_what_is_made() {
        let tell = |pieces: &[u64]| {
            let mut source = Source::new(&STEADY, 1000.0, Random::new(0, 0)).unwrap();
            source.cue(0.9, &set(9.0)).unwrap();
            let (mut from, mut heard) = (0, Vec::new());
            for &to in pieces {
                source.make(from, to).unwrap();
                heard.extend((from..to).map(|index| source.samples[(index - source.base) as usize]));
                from = to;
            }
            heard
        };
        let whole = tell(&[900]);
        assert_eq!(tell(&[1, 2, 3, 400, 401, 900]), whole);
        // A range alone, with little memory.
        let mut source = Source::new(&STEADY, 1000.0, Random::new(0, 0)).unwrap();
        source.cue(0.9, &set(9.0)).unwrap();
        source.make(850, 900).unwrap();
        assert!(source.held() < 60);
        let late = (850..900).map(|index| source.samples[(index - source.base) as usize]);
        assert!(late.eq(whole[850..].iter().copied()));
    }

    #[test]
    fn after_a_fault_it_comes_to_rest() {
        let mut source = Source::new(&STEADY, 1000.0, Random::new(0, 0)).unwrap();
        source.cue(1.0, &set(202.0)).unwrap();
        let error = source.make(0, 2000).unwrap_err();
        assert!(error.to_string().contains("too fast"));
        source.make(0, 2000).unwrap();
        assert!(source.samples[600..].iter().all(|&sample| sample.abs() <= 110.0));
        assert!(source.samples.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 1.0));
        assert!(source.samples[1000..].iter().all(|&sample| sample == 0.0));
    }
}
