//! What is in a database of paper, in figures: the matrix of its sizes (Figure 9 of Schreck et al. 2016), and each of its spectra.

use std::path::Path;

use froufrou::corpus::cloth::spectra::{centroid_hz, power};
use froufrou::corpus::paper::manifest::Manifest;
use froufrou::corpus::paper::synthetic::{PREFIX, Paper};
use froufrou::corpus::paper::{PaperSound, SPACING_HZ};
use serde::Serialize;

use crate::info::sheet::Sheet;

/// What is in a database.
#[derive(Serialize)]
pub struct PaperFindings {
    name: String,
    is_synthetic: bool,
    clips: usize,
    spectra: usize,
    /// Of all clips.
    length_s: f64,
    places: Vec<PlaceFindings>,
}

/// What there is of one size.
#[derive(Serialize)]
struct PlaceFindings {
    ruling_m: f64,
    border_m: f64,
    is_constrained: bool,
    /// Numbers of clips, as `grain` lines of a score tell them.
    clips: Vec<usize>,
    mean_clip_s: Option<f64>,
    spectra: Vec<SpectrumFindings>,
}

#[derive(Serialize)]
struct SpectrumFindings {
    /// The number of its control, `friction-NUMBER`.
    number: usize,
    /// Root mean square at 1 m/s against full scale.
    level_db: Option<f64>,
    /// By amplitude.
    centroid_hz: f64,
}

/// Whether a name is that of a model of paper, or of a folder with a database of paper.
pub fn is_paper(name: &Path) -> bool {
    Paper::is_model(&name.to_string_lossy()) || Manifest::is_paper(name)
}

impl PaperFindings {
    /// What there is to tell of a paper.
    pub fn of(sound: &PaperSound) -> Self {
        let places = sound.places().iter().map(|place| {
            let lengths = place.clips.iter().map(|clip| sound.clips()[*clip].length_s).sum::<f64>();
            let spectra = place.spectra.iter().map(|&number| {
                let density = &sound.spectra()[number].density;
                let power = power(density, SPACING_HZ);
                SpectrumFindings {
                    number,
                    level_db: (power > 0.0).then(|| 10.0 * power.log10()),
                    centroid_hz: centroid_hz(density, SPACING_HZ),
                }
            });
            PlaceFindings {
                ruling_m: place.ruling_m,
                border_m: place.border_m,
                is_constrained: place.border_m == 0.0,
                clips: place.clips.clone(),
                mean_clip_s: (!place.clips.is_empty()).then(|| lengths / place.clips.len() as f64),
                spectra: spectra.collect(),
            }
        });
        Self {
            name: sound.name().to_owned(),
            is_synthetic: sound.name().starts_with(PREFIX),
            clips: sound.clips().len(),
            spectra: sound.spectra().len(),
            length_s: sound.clips().iter().map(|clip| clip.length_s).sum(),
            places: places.collect(),
        }
    }

    /// The same for people.
    pub fn facts(&self, sheet: &mut Sheet) {
        sheet.fact("paper", &self.name);
        sheet.fact_if("made", self.is_synthetic.then_some("synthetic: by a model, not from recordings"));
        sheet.fact("clips", format!("{}, {:.2} s in all", self.clips, self.length_s));
        sheet.fact("spectra", self.spectra);
        for place in self.places.iter().filter(|place| place.is_constrained) {
            let told = format!("{} clips, {} spectra", place.clips.len(), place.spectra.len());
            sheet.fact("constrained", told);
        }
        let cm = |m: f64| format!("{} cm", crate::info::sheet::number(m * 100.0));
        let free = || self.places.iter().filter(|place| !place.is_constrained);
        let sorted = |mut lengths: Vec<f64>| {
            lengths.sort_by(f64::total_cmp);
            lengths.dedup();
            lengths
        };
        let rulings = sorted(free().map(|place| place.ruling_m).collect());
        let borders = sorted(free().map(|place| place.border_m).collect());
        let heads: Vec<String> =
            ["l_r \\ l_c".to_owned()].into_iter().chain(borders.iter().map(|b| cm(*b))).collect();
        let rows = rulings.iter().map(|ruling_m| {
            let cell = |border_m: &f64| {
                let place = free().find(|p| p.ruling_m == *ruling_m && p.border_m == *border_m);
                place.map_or("·".to_owned(), |p| format!("{}+{}", p.clips.len(), p.spectra.len()))
            };
            [cm(*ruling_m)].into_iter().chain(borders.iter().map(cell)).collect()
        });
        if !rulings.is_empty() {
            sheet.fact("matrix", "clips + spectra of each length of rulings and of free border");
        }
        sheet.table(&heads, rows);
    }
}
