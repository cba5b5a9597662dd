//! `froufrou warp plot`.

use std::path::PathBuf;

use clap::Args;
use froufrou::corpus::units::warp::WarpFile;
use froufrou::{Error, Result};

use crate::features::open;
use crate::plot::{Cloud, PictureSize, clouds};

/// The most units of the recordings that are drawn.
const MOST_UNITS: usize = 20_000;

/// Draw the space of features before and after a warp
#[derive(Args)]
#[command(after_help = "\
Grey are the units of the recordings. Each clip has a colour: filled dots are its units in the target, before and after
the warp, rings those of the recording; larger marks are their means.

Example:
  froufrou warp plot warp.toml cotton -o warp.png")]
pub struct PlotWarp {
    /// The warp
    warp: PathBuf,

    /// The corpus that it is of
    corpus: PathBuf,

    /// The picture, a PNG file; left out, it lies beside the warp with the ending `.png`
    #[arg(short, long, value_name = "PNG")]
    output: Option<PathBuf>,

    /// The two coefficients that are drawn, counted from 0
    #[arg(long, value_name = "ACROSS,UP", value_delimiter = ',', num_args = 2, default_value = "0,1")]
    coefficients: Vec<usize>,

    #[command(flatten)]
    size: PictureSize,
}

impl PlotWarp {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let file = WarpFile::open(&self.warp)?;
        let (corpus, _) = open(&self.corpus)?;
        corpus.check_basis(&file.basis).map_err(|e| e.in_file(&self.warp))?;
        let dimensions = corpus.features().dimensions();
        // A feature space of one coefficient is drawn against itself.
        let axes = [self.coefficients[0], self.coefficients[1].min(dimensions.max(2) - 1)];
        let axes = if dimensions == 1 { [axes[0], axes[0]] } else { axes };
        if let Some(axis) = axes.iter().chain(&self.coefficients).find(|axis| **axis >= dimensions.max(2)) {
            return Err(Error::new(format!(
                "there is no coefficient {axis}, the last is {}",
                dimensions - 1
            )));
        }
        let pick = |row: &[f64]| axes.map(|axis| row[axis]);
        let step = corpus.features().len().div_ceil(MOST_UNITS).max(1);
        let ground: Vec<[f64; 2]> = (0..corpus.features().len())
            .step_by(step)
            .map(|unit| axes.map(|axis| f64::from(corpus.features().row(unit)[axis])))
            .collect();
        let warped = |row: &Vec<f64>| {
            let mut to = vec![0.0; row.len()];
            file.warp.apply(row, &mut to);
            pick(&to)
        };
        let all: Vec<Cloud> = file
            .clips
            .iter()
            .map(|clip| Cloud {
                before: clip.from.iter().map(|row| pick(row)).collect(),
                after: clip.from.iter().map(warped).collect(),
                wanted: clip.to.iter().map(|row| pick(row)).collect(),
            })
            .collect();
        let output = self.output.unwrap_or_else(|| self.warp.with_extension("png"));
        let title = self.warp.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let size = self.size;
        clouds(&output, &title, axes, &ground, &all, size)
    }
}
