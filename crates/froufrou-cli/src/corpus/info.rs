//! `froufrou corpus info`: what a cloth or paper sounds like, in figures and as a picture.

use std::path::{Path, PathBuf};

use clap::Args;
use froufrou::Result;
use froufrou::corpus::cloth::spectra::{centroid_hz, power};
use froufrou::corpus::cloth::synthetic::PREFIX;
use froufrou::corpus::cloth::{ClothSound, PopEntry};
use froufrou::corpus::paper::PaperSound;
use serde::Serialize;

use super::paper::PaperFindings;
use crate::grains::tell;
use crate::info::sheet::{Sheet, number};
use crate::plot::{PictureSize, cloth, paper};

/// Tell what is in a corpus: of cloth its friction at each measured speed and its pops, of paper its sizes
#[derive(Args)]
#[command(after_help = "\
Examples:
  froufrou corpus info cotton --plot cotton.png
  froufrou corpus info synthetic/printer --plot printer.png")]
pub struct Info {
    /// The folder of the corpus, or a model such as synthetic/cotton or synthetic/printer
    #[arg(value_name = "CORPUS")]
    corpus: PathBuf,

    /// A picture of its spectra, and of its pops or sizes, a PNG file
    #[arg(long, value_name = "PNG")]
    plot: Option<PathBuf>,

    #[command(flatten)]
    size: PictureSize,

    /// Write one JSON object, for programs to read
    #[arg(long)]
    json: bool,
}

/// What is in a corpus.
#[derive(Serialize)]
pub struct Findings {
    name: String,
    is_synthetic: bool,
    friction: Option<FrictionFindings>,
    pops: Option<PopFindings>,
}

#[derive(Serialize)]
struct FrictionFindings {
    area_m2: f64,
    highest_hz: f64,
    spectra: Vec<SpectrumFindings>,
}

/// What is measured at one speed.
#[derive(Serialize)]
struct SpectrumFindings {
    speed_mps: f64,
    /// Root mean square against full scale.
    level_db: Option<f64>,
    /// By amplitude.
    centroid_hz: f64,
}

#[derive(Serialize)]
struct PopFindings {
    count: usize,
    length_s: f64,
    least_energy: f64,
    median_energy: f64,
    greatest_energy: f64,
}

impl Findings {
    /// What there is to tell of a cloth.
    pub fn of(sound: &ClothSound) -> Self {
        let friction = sound.friction().map(|friction| {
            let spacing_hz = friction.spectra.spacing_hz();
            let spectra = friction.spectra.measured().iter().map(|spectrum| {
                let power = power(&spectrum.density, spacing_hz);
                SpectrumFindings {
                    speed_mps: spectrum.speed_mps,
                    level_db: (power > 0.0).then(|| 10.0 * power.log10()),
                    centroid_hz: centroid_hz(&spectrum.density, spacing_hz),
                }
            });
            FrictionFindings {
                area_m2: friction.area_m2,
                highest_hz: friction.spectra.values() as f64 * spacing_hz,
                spectra: spectra.collect(),
            }
        });
        let is_synthetic = sound.name().starts_with(PREFIX);
        Self { name: sound.name().to_owned(), is_synthetic, friction, pops: pops(sound.pops()) }
    }

    /// The same for people.
    pub fn facts(&self, sheet: &mut Sheet) {
        sheet.fact("cloth", &self.name);
        sheet.fact_if("made", self.is_synthetic.then_some("synthetic: by a model, not from recordings"));
        if let Some(friction) = &self.friction {
            let spectra = format!(
                "{} speeds, up to {} Hz, of {} m² of cloth",
                friction.spectra.len(),
                number(friction.highest_hz),
                number(friction.area_m2)
            );
            sheet.fact("friction", spectra);
            let rows = friction.spectra.iter().map(|spectrum| {
                let level = spectrum.level_db.map_or("silent".to_owned(), |db| format!("{db:.1} dB"));
                vec![
                    format!("{:.3} m/s", spectrum.speed_mps),
                    level,
                    format!("{:.0} Hz", spectrum.centroid_hz),
                ]
            });
            sheet.table(&["speed", "level", "centroid"], rows);
        }
        if let Some(pops) = &self.pops {
            sheet.fact("pops", format!("{}, {:.2} s in all", pops.count, pops.length_s)).fact(
                "energies",
                format!(
                    "{:.3e} to {:.3e}, half of them below {:.3e}",
                    pops.least_energy, pops.greatest_energy, pops.median_energy
                ),
            );
        }
    }
}

fn pops(all: &[PopEntry]) -> Option<PopFindings> {
    let mut energies: Vec<f64> = all.iter().map(|pop| pop.energy).collect();
    energies.sort_by(f64::total_cmp);
    let (Some(&least), Some(&greatest)) = (energies.first(), energies.last()) else { return None };
    Some(PopFindings {
        count: all.len(),
        length_s: all.iter().map(|pop| pop.length_s).sum(),
        least_energy: least,
        median_energy: energies[energies.len() / 2],
        greatest_energy: greatest,
    })
}

impl Info {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if super::paper::is_paper(&self.corpus) {
            return self.paper();
        }
        let sound = ClothSound::named(&self.corpus.to_string_lossy(), Path::new(""))?;
        if let Some(png) = &self.plot {
            let size = self.size;
            cloth::draw(&sound, size)?.save(png)?;
        }
        let findings = Findings::of(&sound);
        let mut sheet = Sheet::default();
        findings.facts(&mut sheet);
        tell(&findings, &sheet, self.json)
    }

    /// Tells of paper.
    fn paper(&self) -> Result<()> {
        let sound = PaperSound::named(&self.corpus.to_string_lossy(), Path::new(""))?;
        if let Some(png) = &self.plot {
            paper::draw(&sound, self.size)?.save(png)?;
        }
        let findings = PaperFindings::of(&sound);
        let mut sheet = Sheet::default();
        findings.facts(&mut sheet);
        tell(&findings, &sheet, self.json)
    }
}
