//! From the text of a score to samples: they are all finite, or there is an error.
#![no_main]

use std::sync::Arc;

use froufrou::render::offline::{Extent, render};
use froufrou::render::production::{ChannelLines, Prototypes, lengths_s};
use froufrou::score::ending::Ending;
use froufrou::score::{AnyReader, AnySpace, ChannelHeader, ChannelSpace, ObjectSpace, Repeat, Sound};
use froufrou::space::propagation::{Propagation, channel_header};
use froufrou::synth::mixer::Mixer;
use froufrou::synth::voice::Prototype;
use froufrou_fuzz::target;

const RATE_HZ: u32 = 8_000;
/// More channels take more time and are no other work.
const MOST_CHANNELS: usize = 4;

/// What stands in for every recording: a twentieth of a second of noise.
fn prototypes(sounds: &[Sound]) -> Prototypes {
    let random = froufrou::random::Random::new(1, 1);
    let samples: Arc<[f32]> = (0..400).map(|index| (random.uniform(index) * 2.0 - 1.0) as f32).collect();
    let prototype = |sound: &Sound| Prototype {
        samples: samples.clone(),
        rate_hz: f64::from(RATE_HZ),
        looped: sound.repeat != Repeat::Once,
    };
    sounds.iter().map(|sound| (sound.name.clone(), prototype(sound))).collect()
}

fn mix(header: &ChannelHeader, prototypes: Prototypes, lines: ChannelLines<'_>) {
    let channels = header.receivers.len();
    if channels == 0 || channels > MOST_CHANNELS {
        return;
    }
    let Ok(mut mixer) = Mixer::new(RATE_HZ, channels, prototypes, lines) else { return };
    let to_s = Some(0.2);
    let extent = Extent { rate_hz: RATE_HZ, from_s: 0.0, to_s, duration_s: header.duration_s };
    let mut frames = 0;
    let result = render(&mut mixer, channels, &extent, true, |piece| {
        assert!(piece.mix.iter().all(|sample| sample.is_finite()));
        assert_eq!(piece.mix.len(), (piece.frames.end - piece.frames.start) as usize * channels);
        frames = piece.frames.end;
        Ok(())
    });
    assert!(result.is_err() || frames <= 1600, "{frames} frames");
}

target!(|bytes| {
    match AnyReader::new(bytes) {
        Ok(AnySpace::Object(reader)) => {
            let header = reader.header().clone();
            let prototypes = prototypes(&header.sounds);
            let lengths: Vec<_> = lengths_s(&prototypes).collect();
            let Ok(lines) = reader.by_time() else { return };
            let lines = Ending::<ObjectSpace, _>::new(lines, lengths, header.duration_s);
            mix(&channel_header(&header), prototypes, Box::new(Propagation::new(&header, lines)));
        }
        Ok(AnySpace::Channel(reader)) => {
            let header = reader.header().clone();
            let prototypes = prototypes(&header.sounds);
            let lengths: Vec<_> = lengths_s(&prototypes).collect();
            // The reader borrows the input, the lines are to own what they need.
            let Ok(lines) = reader.by_time() else { return };
            let lines = Ending::<ChannelSpace, _>::new(lines, lengths, header.duration_s);
            mix(&header, prototypes, Box::new(lines));
        }
        Err(_) => {}
    }
});
