//! The unit generators of one voice, and how they are plugged together.

use super::limits;
use super::unit::{Around, Event, INPUTS, Kind, Signal};
use crate::synth::instrument::Ramp;

/// Line and column in the script, from 1; 0 where unknown.
pub(super) type Spot = (usize, usize);

/// What is plugged into an input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Plug {
    /// A number. Set while it sounds, it is reached at the end of the stretch.
    Number(f64),
    /// Another unit, by its number.
    Unit(usize),
}

#[derive(Debug)]
struct Unit {
    kind: Kind,
    plugs: [Plug; INPUTS],
    /// What the numbers were at the beginning of the stretch.
    before: [f64; INPUTS],
    spot: Spot,
}

/// A voice's units.
#[derive(Debug, Default)]
pub(super) struct Graph {
    units: Vec<Unit>,
    played: Vec<usize>,
    /// The units in an order in which each comes after what is plugged into it.
    order: Vec<usize>,
    outputs: Vec<Vec<f64>>,
    rooms: [Vec<f64>; 3],
    /// What is still to happen: to which unit, at which sample since the thread began.
    events: Vec<(usize, f64, Event)>,
    due: Vec<(f64, Event)>,
    takes_samples: bool,
}

/// A stretch that cannot be heard.
#[derive(Debug, PartialEq)]
pub(super) struct Unheard {
    /// What it is.
    pub what: String,
    /// Where the unit that made it was made.
    pub spot: Spot,
    /// In which sample of the stretch.
    pub sample: usize,
}

/// The controls and what the script gave for a stretch.
pub(super) struct Given<'a> {
    pub first: u64,
    pub rate_hz: f64,
    pub controls: &'a [Ramp],
    /// What `fn sample` gave: one number a sample, or nothing.
    pub sampled: &'a [f64],
}

impl Graph {
    /// Adds a unit.
    pub(super) fn add(&mut self, kind: Kind, plugs: &[Plug], spot: Spot) -> Result<usize, String> {
        if self.units.len() == limits::UNITS {
            return Err(format!("more than {} units", limits::UNITS));
        }
        self.takes_samples |= matches!(kind, Kind::Sampled);
        self.units.push(Unit { kind, plugs: [Plug::Number(0.0); INPUTS], before: [0.0; INPUTS], spot });
        let unit = self.units.len() - 1;
        for (input, &plug) in plugs.iter().enumerate() {
            self.plug_at(unit, input, plug)?;
        }
        Ok(unit)
    }

    /// Plugs something into an input by its name.
    pub(super) fn plug(&mut self, unit: usize, name: &str, plug: Plug) -> Result<(), String> {
        let input = self.input(unit, name)?;
        self.plug_at(unit, input, plug)
    }

    fn plug_at(&mut self, unit: usize, input: usize, plug: Plug) -> Result<(), String> {
        let target = &mut self.units[unit];
        let (name, least, most) = target.kind.inputs()[input];
        if let Plug::Number(number) = plug
            && !(least..=most).contains(&number)
        {
            return Err(format!("{name} is {number}, not from {least} to {most}"));
        }
        target.plugs[input] = plug;
        Ok(())
    }

    /// The number that an input is set to; nothing where a unit is plugged in.
    pub(super) fn number(&self, unit: usize, name: &str) -> Result<Option<f64>, String> {
        Ok(match self.units[unit].plugs[self.input(unit, name)?] {
            Plug::Number(number) => Some(number),
            Plug::Unit(_) => None,
        })
    }

    fn input(&self, unit: usize, name: &str) -> Result<usize, String> {
        let kind = &self.units[unit].kind;
        let inputs = kind.inputs();
        inputs.iter().position(|(known, ..)| *known == name).ok_or_else(|| {
            let known: Vec<&str> = inputs.iter().map(|(known, ..)| *known).collect();
            match known.as_slice() {
                [] => format!("{} has no `{name}`: it has none", kind.name()),
                known => format!("{} has no `{name}`: it has {}", kind.name(), known.join(", ")),
            }
        })
    }

    /// Something happens to a unit at a sample since the thread began.
    pub(super) fn happen(&mut self, unit: usize, at: f64, event: Event) -> Result<(), String> {
        let kind = &self.units[unit].kind;
        if !kind.takes(event) {
            let word = match event {
                Event::On(_) => "on",
                Event::Off => "off",
                Event::Hit(..) => "hit",
                Event::To(..) => "to",
            };
            return Err(format!("{} has no `{word}`", kind.name()));
        }
        if self.events.len() == limits::EVENTS {
            return Err(format!("more than {} events in a stretch", limits::EVENTS));
        }
        self.events.push((unit, at, event));
        Ok(())
    }

    /// How many units there are.
    pub(super) fn len(&self) -> usize {
        self.units.len()
    }

    /// Lets a unit be heard.
    pub(super) fn play(&mut self, unit: usize) -> Result<(), String> {
        if self.played.len() == limits::UNITS {
            return Err(format!("more than {} units are played", limits::UNITS));
        }
        self.played.push(unit);
        Ok(())
    }

    pub(super) fn is_played(&self) -> bool {
        !self.played.is_empty()
    }

    /// Does a unit say what `fn sample` gives?
    pub(super) fn takes_samples(&self) -> bool {
        self.takes_samples
    }

    /// Puts the units in order once all are made, and makes room for stretches.
    ///
    /// # Errors
    /// Units that are plugged into each other in a circle: where one of them was made.
    pub(super) fn finish(&mut self, samples: usize) -> Result<(), Spot> {
        // 0: not seen; 1: being followed; 2: done.
        let mut state = vec![0_u8; self.units.len()];
        for start in 0..self.units.len() {
            let mut open = vec![(start, 0)];
            while let Some((unit, input)) = open.pop() {
                if state[unit] == 2 {
                    continue;
                }
                state[unit] = 1;
                if input == INPUTS {
                    state[unit] = 2;
                    self.order.push(unit);
                    continue;
                }
                open.push((unit, input + 1));
                if let Plug::Unit(other) = self.units[unit].plugs[input] {
                    match state[other] {
                        0 => open.push((other, 0)),
                        1 => return Err(self.units[unit].spot),
                        _ => (),
                    }
                }
            }
        }
        self.outputs = vec![vec![0.0; samples]; self.units.len()];
        self.rooms = std::array::from_fn(|_| vec![0.0; samples]);
        Ok(())
    }

    /// From here on numbers that are set are reached at the end of the stretch.
    pub(super) fn begin_stretch(&mut self) {
        for unit in &mut self.units {
            for (before, plug) in unit.before.iter_mut().zip(unit.plugs) {
                if let Plug::Number(number) = plug {
                    *before = number;
                }
            }
        }
    }

    /// Makes a stretch and adds up what is played.
    ///
    /// # Errors
    /// Samples that are not numbers.
    pub(super) fn run(&mut self, given: &Given<'_>, out: &mut [f32]) -> Result<(), Unheard> {
        let count = out.len();
        // What happens after the last sample is first heard in the next stretch.
        let last = given.first as f64 + count as f64 - 1.0;
        for &index in &self.order {
            let mut output = std::mem::take(&mut self.outputs[index]);
            self.due.clear();
            for &(unit, at, event) in &self.events {
                if unit == index && at <= last {
                    self.due.push(((at - given.first as f64).max(-1.0), event));
                }
            }
            let unit = &mut self.units[index];
            let outputs = &self.outputs;
            let inputs = std::array::from_fn(|input| match unit.plugs[input] {
                Plug::Number(to) => Signal::Ramp(Ramp { from: unit.before[input], to }),
                Plug::Unit(other) => Signal::Samples(&outputs[other][..count]),
            });
            let around = Around {
                first: given.first,
                rate_hz: given.rate_hz,
                events: &self.due,
                controls: given.controls,
                sampled: given.sampled,
                rooms: &mut self.rooms,
            };
            unit.kind.run(inputs, around, &mut output[..count]);
            self.outputs[index] = output;
        }
        self.events.retain(|&(_, at, _)| at > last);
        // What `fn sample` gives is played itself, unless a unit takes it on.
        let sampled = if self.takes_samples { &[][..] } else { given.sampled };
        for (index, sample) in out.iter_mut().enumerate() {
            let played: f64 = self.played.iter().map(|&unit| self.outputs[unit][index]).sum();
            *sample = (played + sampled.get(index).copied().unwrap_or(0.0)) as f32;
        }
        if out.iter().all(|sample| sample.is_finite()) { Ok(()) } else { Err(self.blame(out)) }
    }

    /// Which unit first gave what is not a number.
    #[cold]
    fn blame(&self, out: &[f32]) -> Unheard {
        let first = |samples: &[f64]| samples.iter().position(|value| !value.is_finite());
        for &index in &self.order {
            if let Some(sample) = first(&self.outputs[index][..out.len()]) {
                let unit = &self.units[index];
                let what = format!("{} gives {}", unit.kind.name(), self.outputs[index][sample]);
                return Unheard { what, spot: unit.spot, sample };
            }
        }
        let sample = out.iter().position(|value| !value.is_finite()).unwrap_or(0);
        Unheard { what: format!("what is played sums to {}", out[sample]), spot: (0, 0), sample }
    }
}
