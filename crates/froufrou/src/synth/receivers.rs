//! Who receives what a score's threads give, made ready to be asked.

use std::path::Path;
use std::sync::Arc;

use super::bus::{Bus, Feed};
use super::filter::{Filter, Filters};
use super::path::PathKey;
use crate::Result;
use crate::score::{LONGEST_DELAY_S, Output};
use crate::space::head::Head;

/// Where what arrives goes.
#[derive(Clone)]
pub enum Receiver {
    /// Into one channel, as it is.
    Channel,
    /// To a head, whose ears are two channels.
    Head(HeadReceiver),
    /// Into the lanes of a bus, and from there by its responses into channels: its own, which follow those of the
    /// receiver before, and any others.
    Bus(Bus),
}

impl Receiver {
    /// So many plain channels.
    pub fn plain(channels: usize) -> Vec<Self> {
        vec![Receiver::Channel; channels]
    }

    /// How many channels it has.
    pub fn channels(&self) -> usize {
        match self {
            Receiver::Channel => 1,
            Receiver::Head(_) => 2,
            Receiver::Bus(bus) => bus.channels(),
        }
    }

    /// By how many paths, each with its own delay, a thread arrives at it.
    pub(crate) fn paths(&self) -> usize {
        match self {
            Receiver::Channel | Receiver::Bus(_) => 1,
            Receiver::Head(_) => 2,
        }
    }

    /// Whether it matters from where something comes.
    pub(crate) fn has_places(&self) -> bool {
        match self {
            Receiver::Channel => false,
            Receiver::Head(_) => true,
            Receiver::Bus(bus) => bus.feed() == Feed::Field,
        }
    }

    /// For how many frames the filters that sounds pass on their way to it make them heard before and behind
    /// their time.
    pub(crate) fn reach(&self) -> [usize; 2] {
        match self {
            Receiver::Channel | Receiver::Bus(_) => [0; 2],
            Receiver::Head(HeadReceiver(head)) => [head.lead(), head.taps().saturating_sub(head.lead())],
        }
    }
}

/// Prepares the outputs of a score for a rate. `folder` is that of the score.
///
/// # Errors
/// The file of a head that cannot be read.
pub fn load(outputs: &[Output], folder: &Path, rate_hz: u32) -> Result<Vec<Receiver>> {
    let rate_hz = f64::from(rate_hz);
    let receiver = |output: &Output| match output {
        Output::Channel(_) => Ok(Receiver::Channel),
        Output::Head { head: None, .. } => {
            Ok(Receiver::Head(HeadReceiver(Arc::new(Head::spherical(rate_hz)))))
        }
        Output::Head { head: Some(file), .. } => {
            Ok(Receiver::Head(HeadReceiver(Arc::new(Head::open(&folder.join(file), rate_hz)?))))
        }
    };
    outputs.iter().map(receiver).collect()
}

/// A head that receives.
#[derive(Clone)]
pub struct HeadReceiver(Arc<Head>);

impl HeadReceiver {
    /// The keys of both ears for what would arrive at the centre of the head by `plain` if there were none.
    pub(crate) fn ears(&self, plain: PathKey, from_m: [f64; 3], filters: &mut Filters) -> [PathKey; 2] {
        if from_m == [0.0; 3] {
            // It sounds within the head, as it is; a filter all the same, for it may come from elsewhere next.
            let filter = filters.push(Filter { taps: [1.0].into(), lead: 0 });
            return [PathKey { filter, ..plain }; 2];
        }
        let taps = self.0.taps();
        let (mut left, mut right) = (vec![0.0; taps], vec![0.0; taps]);
        let arrivals = self.0.hear(from_m, [&mut left, &mut right]);
        let numbers =
            [left, right].map(|taps| filters.push(Filter { taps: taps.into(), lead: self.0.lead() }));
        std::array::from_fn(|ear| PathKey {
            delay_s: (plain.delay_s + arrivals[ear].delay_s).clamp(0.0, LONGEST_DELAY_S),
            gain: plain.gain * arrivals[ear].gain,
            filter: numbers[ear],
            ..plain
        })
    }
}
