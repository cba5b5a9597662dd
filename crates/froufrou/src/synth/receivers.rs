//! Who receives what a score's threads give, made ready to be asked.

use std::path::Path;
use std::sync::Arc;

use super::bus::{Bus, Feed, Response};
use super::filter::{Filter, Filters};
use super::path::PathKey;
use super::sinc::Kernel;
use crate::Result;
use crate::score::{LONGEST_DELAY_S, Output};
use crate::space::head::{FieldResponses, Head};

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

    /// A head that all voices share, whose ears are these two channels, its own: arrivals go to it as a sound field
    /// of order 3, read by the short kernel. What is lost is told by [`FieldResponses`].
    ///
    /// # Errors
    /// As [`Head::field`].
    pub fn shared_head(head: &Head, ears: [usize; 2]) -> Result<Self> {
        let FieldResponses { responses, lead } = head.field()?;
        let mut lanes: Vec<Vec<Response>> =
            responses.into_iter().map(|[left, right]| vec![(ears[0], left), (ears[1], right)]).collect();
        // What sounds within the head is heard as it is.
        let mut as_it_is = vec![0.0; lead + 1];
        as_it_is[lead] = 1.0;
        lanes.push(ears.map(|ear| (ear, as_it_is.clone())).to_vec());
        let bus = Bus::new(Feed::Field, &lanes, lead)?;
        Ok(Receiver::Bus(bus.with_channels(2).with_kernel(Kernel::Short)))
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
    let mut channels = 0;
    let mut receivers = Vec::with_capacity(outputs.len());
    for output in outputs {
        let receiver = match output {
            Output::Channel(_) => Receiver::Channel,
            Output::Head { head, shared, .. } => {
                let head = match head {
                    None => Head::spherical(rate_hz),
                    Some(file) => Head::open(&folder.join(file), rate_hz)?,
                };
                if *shared {
                    Receiver::shared_head(&head, [channels, channels + 1])?
                } else {
                    Receiver::Head(HeadReceiver(Arc::new(head)))
                }
            }
        };
        channels += receiver.channels();
        receivers.push(receiver);
    }
    Ok(receivers)
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
