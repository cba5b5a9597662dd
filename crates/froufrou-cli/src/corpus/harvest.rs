//! `froufrou corpus harvest`: clips of paper out of one recording of crumpling.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use froufrou::corpus::paper::harvest::{Piece, harvest};
use froufrou::corpus::paper::synthetic::{PREFIX, Paper};
use froufrou::corpus::recording::Recording;
use froufrou::render::wav::{SampleFormat, WavFormat, WavWriter};
use froufrou::{Error, Result};
use serde::Serialize;

use crate::files;
use crate::grains::tell;
use crate::info::sheet::Sheet;

/// Split a recording of crumpling into clips of paper, and guess their sizes
#[derive(Args)]
#[command(after_help = "\
Clips that are loud for a few milliseconds are clacs, which are constrained; longer ones are flaps, whose size is guessed by
how much they sound like those of a model. The folder gets a WAV file for each and a corpus.toml to be corrected by hand;
`froufrou corpus build FOLDER` makes it ready.

Example:
  froufrou corpus harvest crumple.wav -o kraft --like printer")]
pub struct Harvest {
    /// The recording
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,

    /// The folder of the corpus, which must have no corpus.toml yet
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,

    /// The model by which sizes are guessed, and that tears are like: printer, tracing or banknote
    #[arg(long, value_name = "MODEL", default_value = "printer")]
    like: String,

    /// The channel that is heard, from 0 [default: the average of all]
    #[arg(long, value_name = "NUMBER")]
    channel: Option<usize>,

    /// The energy over 20 ms above which there is a clip [default: 10 dB above what half of the recording is quieter than]
    #[arg(long, value_name = "ENERGY")]
    threshold: Option<f64>,

    /// Write one JSON object, for programs to read
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Told {
    corpus: String,
    clacs: usize,
    flaps: usize,
    clips: Vec<Clip>,
}

#[derive(Serialize)]
struct Clip {
    recording: String,
    from_s: f64,
    length_s: f64,
    ruling_m: f64,
    border_m: f64,
    energy: f64,
    distance: f64,
}

impl Harvest {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let name = format!("{PREFIX}{}", self.like.trim_start_matches(PREFIX));
        let like = Paper::named(&name).unwrap_or_else(|| Ok(Paper::printer()))?;
        let manifest = self.output.join("corpus.toml");
        if manifest.exists() {
            return Err(Error::new("there is a corpus already")
                .in_file(&manifest)
                .help("name another folder, so that what was corrected in it is not lost"));
        }
        let recording = Recording::open(&self.recording)?;
        let samples = match self.channel {
            None => recording.mono(),
            Some(channel) => recording.channel(channel).map(<[f32]>::to_vec).ok_or_else(|| {
                let count = recording.channels.len();
                Error::new(format!("there is no channel {channel}: the recording has {count}"))
                    .in_file(&self.recording)
                    .help("channels are counted from 0")
            })?,
        };
        let rate_hz = recording.rate_hz;
        let pieces =
            harvest(&samples, rate_hz, &like, self.threshold).map_err(|e| e.in_file(&self.recording))?;
        if pieces.is_empty() {
            return Err(Error::new("no clip stands out of the recording")
                .in_file(&self.recording)
                .help("a lower --threshold finds fainter ones"));
        }
        std::fs::create_dir_all(&self.output).map_err(|e| Error::io("make", &self.output, e))?;
        let seconds = |n: usize| n as f64 / f64::from(rate_hz);
        let (mut text, mut clips) = (self.head(&like), Vec::new());
        for (number, piece) in pieces.iter().enumerate() {
            let kind = if piece.is_clac() { "clac" } else { "flap" };
            let file = format!("{kind}-{:04}.wav", number + 1);
            let samples_format = SampleFormat::Float32;
            let format = WavFormat { rate_hz, channels: 1, samples: samples_format, seed: 0, first_frame: 0 };
            let mut writer = WavWriter::create(self.output.join(&file), format)?;
            writer.write(&samples[piece.range.clone()])?;
            writer.finish()?;
            let (from_s, length_s) = (seconds(piece.range.start), seconds(piece.range.len()));
            push_entry(&mut text, &file, from_s, length_s, piece);
            let Piece { ruling_m, border_m, energy, distance, .. } = *piece;
            clips.push(Clip { recording: file, from_s, length_s, ruling_m, border_m, energy, distance });
        }
        files::write(&manifest, text.as_bytes())?;
        let clacs = pieces.iter().filter(|piece| piece.is_clac()).count();
        let corpus = self.output.to_string_lossy().into_owned();
        let told = Told { corpus, clacs, flaps: pieces.len() - clacs, clips };
        let mut sheet = Sheet::default();
        sheet.fact("corpus", &told.corpus).fact("clacs", told.clacs).fact("flaps", told.flaps);
        let rows = told.clips.iter().map(|clip| {
            let cm = |m: f64| if m > 0.0 { format!("{:.1} cm", m * 100.0) } else { "–".to_owned() };
            vec![
                clip.recording.clone(),
                format!("{:.3} s", clip.from_s),
                format!("{:.0} ms", clip.length_s * 1e3),
                cm(clip.ruling_m),
                cm(clip.border_m),
            ]
        });
        sheet.table(&["clip", "from", "length", "l_r", "l_c"], rows);
        tell(&told, &sheet, self.json)
    }

    /// How the corpus.toml begins.
    fn head(&self, like: &Paper) -> String {
        let of =
            self.recording.file_name().unwrap_or_default().to_string_lossy().replace(char::is_control, " ");
        let like = like.name().trim_start_matches(PREFIX).to_owned();
        format!(
            "# Harvested from {of}. Sizes are guesses by the model \"{like}\": listen, and correct them.\n\
             # Friction may be added as [[paper.friction]] with recording, ruling_m, border_m and speed_mps.\n\
             version = 1\n\n[paper]\ntears_like = \"{like}\"\n"
        )
    }
}

fn push_entry(text: &mut String, file: &str, from_s: f64, length_s: f64, piece: &Piece) {
    let size = match piece.is_clac() {
        true => "constrained = true".to_owned(),
        false => format!("ruling_m = {}\nborder_m = {}", piece.ruling_m, piece.border_m),
    };
    let told = match piece.is_clac() {
        true => String::new(),
        false => format!(", distance {:.2}", piece.distance),
    };
    // A string takes any text.
    let _ = write!(
        text,
        "\n# from {from_s:.3} s, {:.0} ms{told}\n[[paper.clip]]\nrecording = \"{file}\"\n{size}\n",
        length_s * 1e3
    );
}
