//! Who receives what a score's threads give, made ready to be asked.

use std::path::Path;
use std::sync::Arc;

use super::filter::{ChannelPassage, Filter, Filters};
use crate::Result;
use crate::score::Output;
use crate::space::bands::{BandFilters, Bands};
use crate::space::head::Head;

/// Where what arrives goes.
#[derive(Clone)]
pub enum Receiver {
    /// Into one channel, as it is.
    Channel,
    /// To a head, whose ears are two channels.
    Head(HeadReceiver),
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
        }
    }

    /// For how many frames the filters that sounds pass on their way to it make them heard before and behind
    /// their time.
    pub(crate) fn reach(&self) -> [usize; 2] {
        match self {
            Receiver::Channel => [0; 2],
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
    /// What both ears make of what comes from a place with a colour.
    pub(crate) fn ears(
        &self,
        from_m: [f64; 3],
        bands: Option<Bands>,
        colours: Option<&BandFilters>,
        filters: &mut Filters,
    ) -> [ChannelPassage; 2] {
        // What sounds within the head sounds as it is.
        let mut ears = [(0.0, 1.0, Filter::identity()), (0.0, 1.0, Filter::identity())];
        if from_m != [0.0; 3] {
            let taps = self.0.taps();
            let (mut left, mut right) = (vec![0.0; taps], vec![0.0; taps]);
            let heard = self.0.hear(from_m, [&mut left, &mut right]);
            for ((ear, heard), taps) in ears.iter_mut().zip(heard).zip([left, right]) {
                *ear = (heard.delay_s, heard.gain, Filter { taps: taps.into(), lead: self.0.lead() });
            }
        }
        let colour = bands.zip(colours).map(|(bands, colours)| colour(&bands, colours));
        ears.map(|(delay_s, gain, filter)| {
            let filter = colour.as_ref().map_or_else(|| filter.clone(), |colour| filter.then(colour));
            ChannelPassage { delay_s, gain, filter: filters.push(filter) }
        })
    }
}

/// The filter of some gains of octave bands.
pub(crate) fn colour(bands: &Bands, colours: &BandFilters) -> Filter {
    let mut taps = vec![0.0; colours.taps()];
    colours.fill(bands, &mut taps);
    Filter { taps: taps.into(), lead: colours.centre() }
}
