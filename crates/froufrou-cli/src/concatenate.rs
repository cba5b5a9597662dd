//! `froufrou concatenate`: a target sound made again of a corpus's units.

use std::fmt::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use froufrou::Result;
use froufrou::corpus::recording::Recording;
use froufrou::corpus::units::concatenation::Concatenation;
use froufrou::corpus::units::folder::Selected;
use froufrou::corpus::units::warp::WarpFile;
use froufrou::render::format::{SampleFormat, SoundFormat};
use froufrou::render::labels::Labels;
use froufrou::render::sound_file::{Container, SoundWriter};
use froufrou::render::speakers;
use serde::Serialize;

use crate::features::open;
use crate::grains::{format, tell};
use crate::info::sheet::Sheet;
use crate::warp;

/// How many frames are made at a time.
const BLOCK: usize = 1 << 17;

/// Make a sound again of units of recordings
#[derive(Args)]
#[command(after_help = "\
The corpus is made by `froufrou features build`, a warp by `froufrou warp fit` or `froufrou warp suggest --auto`.

Examples:
  froufrou concatenate target.wav cotton --warp warp.toml -o out.wav
  froufrou concatenate target.wav cotton --pairs pairs.csv -o out.wav     fit and hear at once")]
pub struct Concatenate {
    /// The sound that is to be made again
    target: PathBuf,

    /// The corpus of units
    corpus: PathBuf,

    /// What carries the target's features to where the recordings have theirs
    #[arg(long, value_name = "TOML", conflicts_with = "pairs")]
    warp: Option<PathBuf>,

    /// Correspondences that a warp is fitted to before
    #[arg(long, value_name = "CSV")]
    pairs: Option<PathBuf>,

    /// The best selection, not the greedy one
    #[arg(long)]
    optimal: bool,

    /// The sound file to write: WAV or FLAC by its ending
    #[arg(short, long, value_name = "OUT.wav|OUT.flac")]
    output: PathBuf,

    /// Which unit stands for which of the target, as CSV
    #[arg(long, value_name = "CSV")]
    units: Option<PathBuf>,

    /// Sample format: 16 (dithered), 24 or 32f bits; 32f only of WAV
    #[arg(long, value_name = "BITS", default_value = "24", value_parser = format)]
    format: SampleFormat,

    /// Write one JSON object, for programs to read
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Told {
    output: String,
    rate_hz: u32,
    channels: usize,
    duration_s: f64,
    units: usize,
    /// How many do not follow the one before in its recording.
    jumps: usize,
    /// How many are farther from the target than d_max.
    beyond: usize,
    /// What the selection costs, and what the greedy one does.
    cost: f64,
    greedy_cost: f64,
    /// Whether it is proved that no selection from the candidates costs less, and none at all; never of the greedy one.
    is_best_of_candidates: bool,
    is_best: bool,
    /// Samples beyond full scale.
    clipped: u64,
    seconds: f64,
}

impl Concatenate {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let started = Instant::now();
        let container = Container::of(&self.output)?;
        let (corpus, _) = open(&self.corpus)?;
        let target = corpus.target(Recording::open(&self.target)?).map_err(|e| e.in_file(&self.target))?;
        let warp = match (&self.warp, &self.pairs) {
            (Some(path), _) => {
                let file = WarpFile::open(path)?;
                corpus.check_basis(&file.basis).map_err(|e| e.in_file(path))?;
                Some(file.warp)
            }
            (None, Some(pairs)) => Some(warp::fitted(&corpus, &target, pairs, None)?.warp),
            (None, None) => None,
        };
        let selected = corpus.select(&target, warp.as_ref(), self.optimal)?;
        if let Some(path) = &self.units {
            let mut text = "channel,target_s,recording,source_channel,source_s,distance,within\n".to_owned();
            for (channel, lane) in selected.iter().enumerate() {
                for (i, chosen) in lane.found.chosen.iter().enumerate() {
                    let (name, source, source_s) = corpus.at(chosen.unit);
                    let name = format!("\"{}\"", name.replace('"', "\"\""));
                    let (target_s, source) = (i as f64 * corpus.unit_s(), source + 1);
                    let _ = writeln!(
                        text,
                        "{},{target_s:.6},{name},{source},{source_s:.6},{:.6},{}",
                        channel + 1,
                        chosen.distance,
                        chosen.is_within
                    );
                }
            }
            crate::files::write(path, text.as_bytes())?;
        }
        let rate_hz = corpus.rate_hz();
        let channels = target.channels;
        let format = SoundFormat { rate_hz, channels, samples: self.format, seed: 0, first_frame: 0 };
        let labels = Labels { channel_mask: speakers::usual_mask(channels), broadcast: None };
        let mut writer = SoundWriter::create(container, &self.output, format, labels)?;
        let concatenation = Concatenation::new(&corpus, corpus.unit_samples(), rate_hz);
        let units: Vec<Vec<usize>> = selected
            .iter()
            .map(|lane| lane.found.chosen.iter().map(|chosen| chosen.unit).collect())
            .collect();
        for from in (0..target.frames).step_by(BLOCK) {
            let to = (from + BLOCK).min(target.frames);
            let mut block = vec![0.0; (to - from) * channels];
            for channel in 0..channels {
                let lane = &units[channel.min(units.len() - 1)];
                let sound = concatenation.render(lane, channel, target.frames, from..to)?;
                block.iter_mut().skip(channel).step_by(channels).zip(sound).for_each(|(to, from)| *to = from);
            }
            writer.write(&block)?;
        }
        let clipped = writer.finish()?.clipped;
        let sum = |of: &dyn Fn(&Selected) -> f64| selected.iter().map(of).sum::<f64>();
        let told = Told {
            output: self.output.to_string_lossy().into_owned(),
            rate_hz,
            channels,
            duration_s: target.frames as f64 / f64::from(rate_hz),
            units: units.iter().map(Vec::len).sum(),
            jumps: selected.iter().map(|lane| lane.jumps).sum(),
            beyond: selected.iter().map(|lane| lane.found.cost.beyond).sum(),
            cost: sum(&|lane| lane.found.cost.sum),
            greedy_cost: sum(&|lane| lane.found.greedy_cost.sum),
            is_best_of_candidates: selected.iter().all(|lane| lane.found.is_best_of_candidates),
            is_best: selected.iter().all(|lane| lane.found.is_best),
            clipped,
            seconds: started.elapsed().as_secs_f64(),
        };
        let proved = match (told.is_best, told.is_best_of_candidates) {
            (true, _) => "nothing costs less",
            (false, true) => "nothing that was considered costs less",
            (false, false) => "not that it is the best: ways that might cost less were left out",
        };
        let mut sheet = Sheet::default();
        sheet
            .fact("written", &told.output)
            .fact("length", format!("{:.3} s at {rate_hz} Hz, channels {channels}", told.duration_s))
            .fact("units", format!("{}, {} of them after a jump", told.units, told.jumps))
            .fact("beyond d_max", told.beyond)
            .fact("cost", format!("{:.3}", told.cost))
            .fact_if("greedy cost", self.optimal.then(|| format!("{:.3}", told.greedy_cost)))
            .fact_if("proved", self.optimal.then_some(proved))
            .fact_if("beyond full scale", (clipped > 0).then(|| format!("{clipped} samples")))
            .fact("took", format!("{:.2} s", told.seconds));
        tell(&told, &sheet, self.json)
    }
}
