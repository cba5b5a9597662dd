//! Concatenative synthesis of real recordings: what holds of all sound has to hold of theirs.
//!
//! The recordings themselves are not in the repository.

mod data;

use data::data;

use froufrou::corpus::recording::Recording;
use froufrou::corpus::units::concatenation::{Concatenation, InMemory, largest_step};
use froufrou::corpus::units::features::{Extractor, Features};
use froufrou::corpus::units::high_pass::HighPass;
use froufrou::corpus::units::selection::{Index, greedy};
use froufrou::corpus::units::smoothing::smooth;
use froufrou::corpus::units::{FeatureSettings, SelectionSettings};
use froufrou::random::Random;

/// Rustling, tearing, coins and cans: from noise to clicks.
const RECORDINGS: [&str; 6] = [
    "sonniss_gdc_bundle3/Paper_Sound_Effects_Paper_Handling_And_Turning_Sequence.ogg",
    "sonniss_gdc_bundle3/Packaging_And_Wrappers_Wr_041.ogg",
    "sonniss_gdc_bundle3/Punchy_Cardboard_Cardboard_Tearing_02_Slow.ogg",
    "sonniss_gdc_bundle3/Playing_Cards_and_Betting_Chips_Games_Poker_Chips_Dropped_On_To_Stack_8.ogg",
    "sonniss_gdc_bundle3/Junk_And_Debris_Cans_And_Small_Containers-Aluminum_Cans_Rustle_Drop_03.ogg",
    "sonniss_gdc_bundle3/Paperlife_Paper_Rustling_Movement_Handling_50.ogg",
];

/// All channels of a recording, high-passed.
fn channels(name: &str, high_pass_hz: f64) -> Option<Vec<Vec<f32>>> {
    let recording = Recording::open(data(&format!("audio/{name}"))?).expect("a recording");
    let mut channels = recording.channels;
    for channel in &mut channels {
        HighPass::new(high_pass_hz, recording.rate_hz).expect("a high-pass").process(channel);
    }
    Some(channels)
}

#[test]
fn no_step_is_larger_than_one_of_the_recordings() {
    let Some(recordings) =
        RECORDINGS.iter().map(|name| channels(name, 100.0)).collect::<Option<Vec<Vec<Vec<f32>>>>>()
    else {
        return;
    };
    let plain: Vec<Vec<Vec<f32>>> = RECORDINGS.iter().filter_map(|name| channels(name, 0.0)).collect();
    // In a millisecond, rumble that is not filtered away cannot always be joined so evenly.
    for (what, recordings, lengths) in
        [("high-passed", &recordings, &[202usize, 802, 48][..]), ("plain", &plain, &[202, 802])]
    {
        for &unit in lengths {
            let random = Random::new(unit as u64, 0);
            // Of one recording alone, so that its own steps are what counts, and of all.
            let mut sets: Vec<Vec<Vec<f32>>> = recordings.clone();
            sets.push(recordings.concat());
            for (set, streams) in sets.into_iter().enumerate() {
                let largest = streams.iter().map(|stream| largest_step(stream)).fold(0.0, f32::max);
                let memory = InMemory::new(streams, unit);
                let units: usize = memory.units().iter().sum();
                let chosen: Vec<usize> = (0..3000).map(|i| random.below(i, units)).collect();
                let frames = chosen.len() * unit - unit / 3;
                let concatenation = Concatenation::new(&memory, unit, 48_000);
                let made = concatenation.render(&chosen, 0, frames, 0..frames).expect("sound");
                let found = largest_step(&made);
                assert!(found <= largest, "{what}, units of {unit}, set {set}: {found} > {largest}");
            }
        }
    }
}

/// A recording made again of others, by the greedy selection that the paper has.
#[test]
fn nor_where_units_are_chosen_by_what_they_sound_like() {
    let (target, sources) = (RECORDINGS[5], &RECORDINGS[..3]);
    let Some(target) = channels(target, 100.0) else { return };
    let streams: Vec<Vec<f32>> = sources.iter().filter_map(|name| channels(name, 100.0)).flatten().collect();
    let extractor = Extractor::new(&FeatureSettings::default(), 48_000).expect("features");
    let widths = [20.0, 50.0, 10.0];
    let values: Vec<f32> = streams
        .iter()
        .flat_map(|stream| smooth(&extractor.features(stream), &widths).values().to_vec())
        .collect();
    let features = Features::new(3, values);
    let settings = SelectionSettings::default();
    let largest = streams.iter().map(|stream| largest_step(stream)).fold(0.0, f32::max);
    let memory = InMemory::new(streams, extractor.unit_samples());
    let index = Index::new(&features, &memory.units(), settings.look_ahead).expect("an index");
    let wanted: Vec<f64> =
        smooth(&extractor.features(&target[0]), &widths).values().iter().map(|v| f64::from(*v)).collect();
    let chosen = greedy(&index, &wanted, &settings).expect("a selection");
    let chosen: Vec<usize> = chosen.iter().map(|choice| choice.unit).collect();
    let frames = target[0].len();
    let concatenation = Concatenation::new(&memory, extractor.unit_samples(), 48_000);
    let made = concatenation.render(&chosen, 0, frames, 0..frames).expect("sound");
    assert_eq!(made.len(), frames);
    assert!(largest_step(&made) <= largest, "{} > {largest}", largest_step(&made));
}
