//! `froufrou grains resynth`: recordings made again, and how near they come.

use std::path::PathBuf;

use clap::Args;
use froufrou::Result;
use froufrou::corpus::dictionary::Dictionary;
use froufrou::corpus::distance::{log_spectral_distance_db, signal_to_noise_db};
use froufrou::corpus::resynthesis::{by_power, resynthesise};
use froufrou::render::format::SampleFormat;
use serde::Serialize;

use super::{Allowed, Sounding, find, tell};
use crate::info::sheet::Sheet;

/// Make recordings again of grains that fit, and tell how near they come
#[derive(Args)]
#[command(after_help = "\
Examples:
  froufrou grains resynth stone                            a table of all recordings
  froufrou grains resynth stone hit_3 --without-own -o a.wav")]
pub struct Resynth {
    /// The corpus
    corpus: PathBuf,

    /// The recording, by its name or a part of it; else all of them
    recording: Option<String>,

    /// The sound file to write: WAV or FLAC by its ending
    #[arg(short, long, value_name = "OUT.wav|OUT.flac", requires = "recording")]
    output: Option<PathBuf>,

    #[command(flatten)]
    allowed: Allowed,

    /// Write JSON, for programs to read
    #[arg(long)]
    json: bool,
}

/// How near a recording comes.
#[derive(Serialize)]
struct Nearness {
    recording: String,
    grains: usize,
    /// None where nothing is lost or there is nothing.
    signal_to_noise_db: Option<f64>,
    log_spectral_distance_db: Option<f64>,
    /// That of others' grains chosen by their power alone.
    by_power_db: Option<f64>,
}

impl Resynth {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let dictionary = Dictionary::open(&self.corpus)?;
        let wanted = match &self.recording {
            Some(name) => Some(find(&dictionary, &self.corpus, name)?),
            None => None,
        };
        let numbers = match wanted {
            Some(number) => number..number + 1,
            None => 0..dictionary.recordings().len(),
        };
        let all: Vec<Nearness> =
            numbers.map(|number| self.nearness(&dictionary, number)).collect::<Result<_>>()?;
        if let (Some(output), Some(number)) = (self.output.clone(), wanted) {
            let sounding = Sounding { output, format: SampleFormat::Int24, json: self.json };
            let sequence = resynthesise(&dictionary, number, self.allowed.own())?;
            sounding.save(&dictionary, &sequence)?;
        }
        let mut sheet = Sheet::default();
        let db = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |db| format!("{db:.1} dB"));
        let heads = ["recording", "grains", "signal to noise", "log-spectral distance", "by power alone"];
        sheet.table(
            &heads,
            all.iter().map(|near| {
                let Nearness { recording, grains, signal_to_noise_db, .. } = near;
                let rest = [near.log_spectral_distance_db, near.by_power_db].map(db);
                let first = [recording.clone(), grains.to_string(), db(*signal_to_noise_db)];
                [first.to_vec(), rest.to_vec()].concat()
            }),
        );
        if all.len() > 1 {
            let middle = |of: &dyn Fn(&Nearness) -> Option<f64>| {
                let mut values: Vec<f64> = all.iter().filter_map(of).collect();
                values.sort_by(f64::total_cmp);
                db(values.get(values.len() / 2).copied())
            };
            sheet
                .fact("median signal to noise", middle(&|near| near.signal_to_noise_db))
                .fact("median log-spectral distance", middle(&|near| near.log_spectral_distance_db))
                .fact("median by power alone", middle(&|near| near.by_power_db));
        }
        tell(&all, &sheet, self.json)
    }

    fn nearness(&self, dictionary: &Dictionary, number: usize) -> Result<Nearness> {
        let wanted = dictionary.sound(number);
        let sequence = resynthesise(dictionary, number, self.allowed.own())?;
        let sound = sequence.render(dictionary);
        let power = by_power(dictionary, number)?.render(dictionary);
        Ok(Nearness {
            recording: dictionary.recordings()[number].name.clone(),
            grains: sequence.chosen.len(),
            signal_to_noise_db: signal_to_noise_db(&sound, &wanted),
            log_spectral_distance_db: log_spectral_distance_db(&sound, &wanted),
            by_power_db: log_spectral_distance_db(&power, &wanted),
        })
    }
}
