//! From the text of a score to samples: they are all finite, or there is an error.
#![no_main]

use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

use froufrou::render::offline::{Extent, render};
use froufrou::render::production::{ChannelLines, lengths_s};
use froufrou::score::ending::Ending;
use froufrou::score::{AnyReader, AnySpace, ChannelHeader, ChannelSpace, Make, ObjectSpace, Output, Repeat, Sound};
use froufrou::space::propagation::{Propagation, channel_header};
use froufrou::synth::mixer::{Mixer, Sounding};
use froufrou::synth::prototypes::{Soundings, load};
use froufrou::synth::receivers;
use froufrou::synth::voice::Prototype;
use froufrou_fuzz::target;

const RATE_HZ: u32 = 8_000;
/// More channels take more time and are no other work.
const MOST_CHANNELS: usize = 4;

/// The files that a sound may name.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder").keep();
    let table =
        r#"[{"frequency": 440, "decay_per_s": 5, "points": [1, 0.5]}, {"frequency": 1210, "rt60_s": 1}]"#;
    std::fs::write(folder.join("bell.json"), table).expect("a table");
    let script =
        "param(\"pitch\", 700.0); let t = sine(pitch); play(t); fn control() { t.frequency = pitch; }";
    std::fs::write(folder.join("siren.rhai"), script).expect("a script");
    std::fs::write(folder.join("cell.toml"), "[room]\nsize = [1, 1, 1]\nabsorption = 0.9\n").expect("a room");
    folder
});

/// Every recording is a twentieth of a second of noise, what is synthesised is what it says.
fn soundings(sounds: &[Sound]) -> Option<Soundings> {
    let random = froufrou::random::Random::new(1, 1);
    let samples: Arc<[f32]> = (0..400).map(|index| (random.uniform(index) * 2.0 - 1.0) as f32).collect();
    let sounding = |sound: &Sound| -> Option<(String, Sounding)> {
        match &sound.make {
            Make::Recording { repeat, .. } => {
                let looped = *repeat != Repeat::Once;
                let prototype = Prototype { samples: samples.clone(), rate_hz: f64::from(RATE_HZ), looped };
                Some((sound.name.clone(), prototype.into()))
            }
            // The file of no other name is there; what lies elsewhere is not for a fuzzer.
            make if make.file().is_none_or(|file| ["bell.json", "siren.rhai"].contains(&file)) => {
                load(std::slice::from_ref(sound), &FOLDER).ok()?.pop()
            }
            _ => None,
        }
    };
    sounds.iter().map(sounding).collect()
}

fn sphere(output: &Output) -> Output {
    match output {
        Output::Head { ears, shared, .. } => Output::Head { ears: ears.clone(), head: None, shared: *shared },
        // A tail that is soon over: it is made anew at every input.
        Output::Tail { channels, .. } => Output::Tail { scene: "cell.toml".into(), channels: channels.clone() },
        channel => channel.clone(),
    }
}

fn mix(header: &ChannelHeader, soundings: Soundings, lines: ChannelLines<'_>) {
    let channels = header.channels().len();
    if channels == 0 || channels > MOST_CHANNELS {
        return;
    }
    // Heads are spheres here: files would be read at every input.
    let mut spheres = header.clone();
    spheres.receivers = header.receivers.iter().map(sphere).collect();
    let Ok(receivers) = receivers::load(&spheres, &FOLDER, RATE_HZ) else { return };
    let Ok(mut mixer) = Mixer::new(RATE_HZ, receivers, soundings, lines) else { return };
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
            let Some(soundings) = soundings(&header.sounds) else { return };
            let lengths: Vec<_> = lengths_s(&soundings).collect();
            let Ok(lines) = reader.by_time() else { return };
            let lines = Ending::<ObjectSpace, _>::new(lines, lengths, header.duration_s);
            let Ok(lines) = Propagation::new(&header, lines) else { return };
            mix(&channel_header(&header, false), soundings, Box::new(lines));
        }
        Ok(AnySpace::Channel(reader)) => {
            let header = reader.header().clone();
            let Some(soundings) = soundings(&header.sounds) else { return };
            let lengths: Vec<_> = lengths_s(&soundings).collect();
            // The reader borrows the input, the lines are to own what they need.
            let Ok(lines) = reader.by_time() else { return };
            let lines = Ending::<ChannelSpace, _>::new(lines, lengths, header.duration_s);
            mix(&header, soundings, Box::new(lines));
        }
        Err(_) => {}
    }
});
