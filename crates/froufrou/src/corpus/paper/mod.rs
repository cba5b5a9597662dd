//! What paper sounds like (Schreck et al. 2016): a database of short clips of its crumpling and of spectra of its friction,
//! sampled over the size of the resonator, (l_r, l_c). Nothing here knows of meshes.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`PaperSound`] | the database of one paper: what is nearest to a resonator |
//! | [`manifest`], [`folder`] | a database on disk: its `corpus.toml`, and what is computed of its recordings |
//! | [`harvest`] | splits a recording of crumpling into clips, and guesses their sizes |
//! | [`synthetic`] | papers that sound with no recordings, by a [`plate`] model |
//! | [`quadratic_chi`] | how unlike two spectra are |
//!
//! | quantity | meaning |
//! | --- | --- |
//! | l_r, `ruling_m` | the mean length of a resonator's rulings |
//! | l_c, `border_m` | the length of its free curved borders; 0 where it is constrained |
//! | *clac* | a clip of what is constrained, a few milliseconds |
//! | *flap* | a clip of what is not, hundreds of milliseconds |

pub mod folder;
pub mod harvest;
pub mod manifest;
mod measure;
pub mod plate;
pub mod quadratic_chi;
pub mod synthetic;

use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use self::plate::Shape;
use self::synthetic::{CLAC_LEAD_S, CLAC_S, CLACS, FLAP_LEAD_S, FLAPS, FLAT_SPECTRA, LENGTHS_M, Paper};
use super::dictionary::prepare;
use crate::error::Result;
use crate::random::Random;

/// Values of a spectrum.
pub const BINS: usize = 2048;

/// What lies between two of them: the first is at this frequency, the last at 22.05 kHz.
pub const SPACING_HZ: f64 = 22_050.0 / BINS as f64;

/// A clip, without its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct ClipEntry {
    /// l_r; 0 where it is constrained.
    pub ruling_m: f64,
    /// l_c; 0 where it is constrained.
    pub border_m: f64,
    /// The recording that it is from, or the model.
    pub from: String,
    /// When it begins there, in seconds.
    pub begin_s: f64,
    /// How long it is.
    pub length_s: f64,
    /// From its beginning to the moment of its event.
    pub lead_s: f64,
}

/// A spectrum of friction.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectrumEntry {
    /// l_r; 0 where it is constrained.
    pub ruling_m: f64,
    /// l_c; 0 where it is constrained.
    pub border_m: f64,
    /// The recording that it is from, or the model.
    pub from: String,
    /// The amplitude density at 1 m/s in full scale by √Hz, at [`BINS`] multiples of [`SPACING_HZ`].
    pub density: Vec<f64>,
}

/// What a place of the database has: a size, and the numbers of its clips and spectra.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// l_r; 0 where it is constrained.
    pub ruling_m: f64,
    /// l_c; 0 where it is constrained.
    pub border_m: f64,
    /// Clips, by their numbers.
    pub clips: Vec<usize>,
    /// Spectra, by their numbers.
    pub spectra: Vec<usize>,
}

impl Place {
    fn is_constrained(&self) -> bool {
        self.border_m <= 0.0
    }

    /// The square of how far it is from a resonator, in the plane of (l_r, l_c).
    fn off(&self, ruling_m: f64, border_m: f64) -> f64 {
        (self.ruling_m - ruling_m).powi(2) + (self.border_m - border_m).powi(2)
    }
}

/// Where the samples of clips come from.
#[derive(Debug, Clone, PartialEq)]
enum Clips {
    /// From recordings: the rate and samples of each.
    Recorded(Vec<(u32, Arc<[f32]>)>),
    /// From a model, at any rate: the number of each at its place.
    Synthetic(Vec<u64>),
}

/// The database of one paper.
///
/// ```
/// use froufrou::corpus::paper::PaperSound;
/// use froufrou::random::Random;
/// let paper = PaperSound::named("synthetic/printer", std::path::Path::new(""))?;
/// // A resonator of rulings of 11 cm and borders of 21 cm takes a clip of 10 cm and 20 cm.
/// let clip = paper.clip(0.11, 0.21, None, Random::new(7, 0), 0).expect("a clip");
/// assert_eq!((paper.clips()[clip].ruling_m, paper.clips()[clip].border_m), (0.1, 0.2));
/// let next = paper.clip(0.11, 0.21, Some(clip), Random::new(7, 0), 1);
/// assert_ne!(next, Some(clip));
/// # Ok::<(), froufrou::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PaperSound {
    name: String,
    places: Vec<Place>,
    clips: Vec<ClipEntry>,
    spectra: Vec<SpectrumEntry>,
    source: Clips,
    /// Its model, or the one that its tears are like.
    paper: Paper,
}

impl PaperSound {
    /// The sound of a paper by its name: `synthetic/printer` and other [models](synthetic), else a folder as seen from another.
    ///
    /// # Errors
    /// A model that there is not, or a database that cannot be read.
    pub fn named(name: &str, folder: &Path) -> Result<Self> {
        match Paper::named(name) {
            Some(paper) => Ok(Self::synthetic(paper?)),
            None => Self::open(&folder.join(name)),
        }
    }

    /// The sound of a model.
    pub fn synthetic(paper: Paper) -> Self {
        let name = paper.name();
        let sizes = LENGTHS_M.iter().flat_map(|&ruling_m| LENGTHS_M.map(|border_m| (ruling_m, border_m)));
        let sizes: Vec<(f64, f64)> = sizes.collect();
        let (mut clips, mut numbers) = (Vec::new(), Vec::new());
        let entry = |(ruling_m, border_m), length_s, lead_s| ClipEntry {
            ruling_m,
            border_m,
            from: name.clone(),
            begin_s: 0.0,
            length_s,
            lead_s,
        };
        for number in 0..CLACS as u64 {
            clips.push(entry((0.0, 0.0), CLAC_S, CLAC_LEAD_S));
            numbers.push(number);
        }
        for (place, &(ruling_m, border_m)) in (0u64..).zip(&sizes) {
            let length_s = Paper::flap_s(&Shape::rectangle(ruling_m, border_m));
            for number in 0..FLAPS as u64 {
                clips.push(entry((ruling_m, border_m), length_s, FLAP_LEAD_S));
                numbers.push(CLACS as u64 + place * FLAPS as u64 + number);
            }
        }
        let flat = (0..FLAT_SPECTRA as u64).map(|number| (number, (0.0, 0.0)));
        let free = (FLAT_SPECTRA as u64..).zip(sizes.iter().copied());
        let wanted: Vec<(u64, (f64, f64))> = flat.chain(free).collect();
        let spectra = wanted.into_par_iter().map(|(number, (ruling_m, border_m))| {
            let shape = (border_m > 0.0).then(|| Shape::rectangle(ruling_m, border_m));
            let density = paper.density(shape.as_ref(), number, SPACING_HZ, BINS);
            SpectrumEntry { ruling_m, border_m, from: name.clone(), density }
        });
        let spectra = spectra.collect();
        Self::new(name.clone(), clips, spectra, Clips::Synthetic(numbers), paper)
    }

    fn new(
        name: String,
        clips: Vec<ClipEntry>,
        spectra: Vec<SpectrumEntry>,
        source: Clips,
        paper: Paper,
    ) -> Self {
        let mut places: Vec<Place> = Vec::new();
        let mut at = |ruling_m: f64, border_m: f64| {
            let same = |place: &Place| place.ruling_m == ruling_m && place.border_m == border_m;
            places.iter().position(same).unwrap_or_else(|| {
                places.push(Place { ruling_m, border_m, clips: Vec::new(), spectra: Vec::new() });
                places.len() - 1
            })
        };
        let clip_places: Vec<usize> = clips.iter().map(|clip| at(clip.ruling_m, clip.border_m)).collect();
        let spectrum_places: Vec<usize> = spectra.iter().map(|s| at(s.ruling_m, s.border_m)).collect();
        for (number, place) in clip_places.into_iter().enumerate() {
            places[place].clips.push(number);
        }
        for (number, place) in spectrum_places.into_iter().enumerate() {
            places[place].spectra.push(number);
        }
        places.sort_by(|a, b| a.ruling_m.total_cmp(&b.ruling_m).then(a.border_m.total_cmp(&b.border_m)));
        Self { name, places, clips, spectra, source, paper }
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The sizes that it has, by l_r and then l_c, from what is constrained on.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// All clips.
    pub fn clips(&self) -> &[ClipEntry] {
        &self.clips
    }

    /// All spectra.
    pub fn spectra(&self) -> &[SpectrumEntry] {
        &self.spectra
    }

    /// The model that its tears are those of.
    pub fn paper(&self) -> &Paper {
        &self.paper
    }

    /// The place nearest to a resonator that fits: a constrained one for `border_m` of 0, else one that is not.
    fn nearest(&self, ruling_m: f64, border_m: f64, fits: impl Fn(&Place) -> bool) -> Option<&Place> {
        let wanted = self.places.iter().filter(|p| p.is_constrained() == (border_m <= 0.0) && fits(p));
        // Of two that are as near the first, which is the smaller one.
        wanted.min_by(|a, b| a.off(ruling_m, border_m).total_cmp(&b.off(ruling_m, border_m)))
    }

    /// A clip for a resonator: at random one of those at the nearest place, but not the `last` one that was taken. A place
    /// with no other clip than that is passed over; where there is no other place either, the same clip is taken again. Nothing where
    /// the database has no clips of the kind, constrained or not. The index addresses what is random.
    pub fn clip(
        &self,
        ruling_m: f64,
        border_m: f64,
        last: Option<usize>,
        random: Random,
        index: u64,
    ) -> Option<usize> {
        let other = |number: &usize| Some(*number) != last;
        let Some(place) = self.nearest(ruling_m, border_m, |place| place.clips.iter().any(other)) else {
            return self.nearest(ruling_m, border_m, |place| !place.clips.is_empty()).and(last);
        };
        let others: Vec<usize> = place.clips.iter().copied().filter(other).collect();
        others.get(random.below(index, others.len())).copied()
    }

    /// The spectrum for a resonator: that of the nearest place; the first where it has several, and nothing where
    /// the database has none of the kind, constrained or not.
    pub fn spectrum(&self, ruling_m: f64, border_m: f64) -> Option<usize> {
        self.spectra_at(ruling_m, border_m).first().copied()
    }

    /// All spectra at the place nearest to a resonator, of which one may be chosen for each event.
    pub fn spectra_at(&self, ruling_m: f64, border_m: f64) -> &[usize] {
        self.nearest(ruling_m, border_m, |place| !place.spectra.is_empty())
            .map_or(&[], |place| place.spectra.as_slice())
    }

    /// The samples of a clip at a rate; none where there is no such clip.
    ///
    /// # Errors
    /// A rate that is not one of sound.
    pub fn clip_samples(&self, number: usize, rate_hz: u32) -> Result<Vec<f32>> {
        super::spectral::check_sound(&[0.0], rate_hz)?;
        let Some(entry) = self.clips.get(number) else { return Ok(Vec::new()) };
        Ok(match &self.source {
            Clips::Recorded(clips) => match clips.get(number) {
                Some((own_hz, samples)) => prepare::at_rate(samples.to_vec(), *own_hz, rate_hz)?,
                None => Vec::new(),
            },
            Clips::Synthetic(numbers) => {
                let own = numbers.get(number).copied().unwrap_or(0);
                let rate_hz = f64::from(rate_hz);
                if entry.border_m > 0.0 {
                    self.paper.flap(&Shape::rectangle(entry.ruling_m, entry.border_m), own, rate_hz)
                } else {
                    self.paper.clac(own, rate_hz)
                }
            }
        })
    }
}

#[cfg(test)]
mod tests;
