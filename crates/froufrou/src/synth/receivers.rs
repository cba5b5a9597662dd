//! Who receives what a score's threads give, made ready to be asked.

use std::path::Path;
use std::sync::Arc;

use super::bus::{Bus, Feed, Response};
use super::filter::{ChannelPassage, Filter, Filters};
use super::sinc::Kernel;
use super::tails::{self, Hearing};
use crate::scene::Scene;
use crate::scene::file::Enclosing;
use crate::score::{ChannelHeader, Output};
use crate::space::bands::{BandFilters, Bands};
use crate::space::head::{FieldResponses, Head};
use crate::space::reverberation::Reverberation;
use crate::{Error, Result};

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
/// The file of a head or of a scene with a room that cannot be read; a scene without one.
pub fn load(header: &ChannelHeader, folder: &Path, rate_hz: u32) -> Result<Vec<Receiver>> {
    let outputs = &header.receivers;
    let rate_hz = f64::from(rate_hz);
    let mut receivers: Vec<Receiver> = Vec::with_capacity(outputs.len());
    // The heads of outputs that are one.
    let mut heads: Vec<Option<Arc<Head>>> = Vec::with_capacity(outputs.len());
    let mut channels = 0;
    for output in outputs {
        let head = match output {
            Output::Head { head: None, .. } => Some(Arc::new(Head::spherical(rate_hz))),
            Output::Head { head: Some(file), .. } => Some(Arc::new(Head::open(&folder.join(file), rate_hz)?)),
            Output::Channel(_) | Output::Tail { .. } => None,
        };
        let receiver = match (output, &head) {
            (Output::Tail { scene, channels }, _) => {
                let heard = hearing(outputs, &heads, channels);
                tail(&folder.join(scene), rate_hz, header.seed, &heard)?
            }
            (Output::Head { shared: true, .. }, Some(head)) => {
                Receiver::shared_head(head, [channels, channels + 1])?
            }
            (_, Some(head)) => Receiver::Head(HeadReceiver(head.clone())),
            (_, None) => Receiver::Channel,
        };
        channels += receiver.channels();
        receivers.push(receiver);
        heads.push(head);
    }
    Ok(receivers)
}

/// What hears a tail in some channels: outputs that stand before it.
fn hearing<'a>(
    outputs: &[Output],
    heads: &'a [Option<Arc<Head>>],
    channels: &[(String, f64)],
) -> Vec<Hearing<'a>> {
    let level = |name: &String| {
        channels.iter().filter(|(channel, _)| channel == name).map(|(_, level)| level).sum::<f64>()
    };
    let (mut heard, mut first) = (Vec::new(), 0);
    for (output, head) in outputs.iter().zip(heads) {
        let names = output.channels();
        match (head, names) {
            (Some(head), [left, right]) => {
                let levels = [level(left), level(right)];
                if levels != [0.0; 2] {
                    heard.push(Hearing::Head([first, first + 1], levels, head));
                }
            }
            _ => {
                let each = (first..).zip(names).map(|(channel, name)| (channel, level(name)));
                let each = each.filter(|(_, level)| *level > 0.0);
                heard.extend(each.map(|(channel, level)| Hearing::Channel(channel, level)));
            }
        }
        first += names.len();
    }
    heard
}

/// The tail of the room of a scene.
fn tail(file: &Path, rate_hz: f64, seed: u64, heard: &[Hearing<'_>]) -> Result<Receiver> {
    // A score may name any file, as it may any recording.
    let scene = Scene::open(file, true)?;
    let Some(Enclosing::Room(about)) = &scene.enclosing else {
        let help = "name a scene with a `[room]`, or leave the `tail` out";
        return Err(Error::new("the scene has no room to reverberate").in_file(file).help(help));
    };
    let reverberation = Reverberation::new(&about.room, &scene.medium(), about.order);
    let reverberation = reverberation.map_err(|fault| fault.in_file(file))?;
    Ok(Receiver::Bus(tails::bus(&reverberation, rate_hz, seed, heard)?))
}

/// A head that receives.
#[derive(Clone)]
pub struct HeadReceiver(Arc<Head>);

impl HeadReceiver {
    /// What both ears make of what comes from a place with a colour.
    pub(crate) fn ears(
        &self,
        from_m: [f64; 3],
        bands: Option<Bands>,
        colours: Option<&BandFilters>,
        filters: &mut Filters,
    ) -> [ChannelPassage; 2] {
        // What sounds within the head sounds as it is.
        let mut ears = [0.0; 2].map(|delay_s| (delay_s, 1.0, Filter::identity()));
        if from_m != [0.0; 3] {
            let taps = self.0.taps();
            let (mut left, mut right) = (vec![0.0; taps], vec![0.0; taps]);
            let heard = self.0.hear(from_m, [&mut left, &mut right]);
            for ((ear, heard), taps) in ears.iter_mut().zip(heard).zip([left, right]) {
                *ear = (heard.delay_s, heard.gain, Filter::new(taps, self.0.lead()));
            }
        }
        let colour = bands.zip(colours).map(|(bands, colours)| colour(&bands, colours));
        ears.map(|(delay_s, gain, filter)| {
            let filter = match &colour {
                Some(colour) => filter.then(colour),
                None => filter,
            };
            ChannelPassage { delay_s, gain, filter: filters.push(filter) }
        })
    }
}

/// The filter of some gains of octave bands.
pub(crate) fn colour(bands: &Bands, colours: &BandFilters) -> Filter {
    let mut taps = vec![0.0; colours.taps()];
    colours.fill(bands, &mut taps);
    Filter::new(taps, colours.centre())
}
