//! A warp as a file: TOML, with the correspondences that it was fitted to.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Basis, MOST_PLACES, Warp};
use crate::corpus::dictionary::manifest::line;
use crate::error::{Error, Place, Result};

/// What the file says it is, and the only version so far.
const FORMAT: &str = "froufrou warp";
const VERSION: u32 = 1;

/// The most bytes of the file.
const MOST_BYTES: u64 = 64 << 20;

/// A clip of the target and what it should sound like, unit by unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clip {
    /// Where it begins in the target.
    pub target_s: f64,
    /// The recording, by its path in the corpus.
    pub recording: String,
    /// Where it begins there.
    pub source_s: f64,
    /// How long both are.
    pub duration_s: f64,
    /// Features of the target's units.
    pub from: Vec<Vec<f64>>,
    /// Features of the recording's units.
    pub to: Vec<Vec<f64>>,
}

/// What stands in the file.
#[derive(Debug, Clone, PartialEq)]
pub struct WarpFile {
    /// What features the warp is of.
    pub basis: Basis,
    /// λ.
    pub lambda: f64,
    /// What it was fitted to.
    pub clips: Vec<Clip>,
    /// The warp.
    pub warp: Warp,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    format: String,
    version: u32,
    lambda: f64,
    offset: Vec<f64>,
    linear: Vec<Vec<f64>>,
    places: Vec<Vec<f64>>,
    weights: Vec<Vec<f64>>,
    basis: Basis,
    #[serde(default)]
    clip: Vec<Clip>,
}

impl WarpFile {
    /// Fits a warp to clips.
    ///
    /// # Errors
    /// Those of [`Warp::fit`].
    pub fn fit(basis: Basis, dimensions: usize, clips: Vec<Clip>, lambda: f64) -> Result<Self> {
        let flat = |of: &dyn Fn(&Clip) -> &Vec<Vec<f64>>| -> Vec<f64> {
            clips.iter().flat_map(|clip| of(clip).iter().flatten().copied()).collect()
        };
        let warp = Warp::fit(dimensions, &flat(&|clip| &clip.from), &flat(&|clip| &clip.to), lambda)?;
        Ok(Self { basis, lambda, clips, warp })
    }

    /// The text of the file; its numbers read back to the last bit.
    ///
    /// # Errors
    /// Where a value cannot be written as TOML.
    pub fn text(&self) -> Result<String> {
        let warp = &self.warp;
        let rows = |flat: &[f64]| flat.chunks_exact(warp.dimensions).map(<[f64]>::to_vec).collect();
        let text = Text {
            format: FORMAT.to_owned(),
            version: VERSION,
            lambda: self.lambda,
            offset: warp.offset.clone(),
            linear: rows(&warp.linear),
            places: rows(&warp.places),
            weights: rows(&warp.weights),
            basis: self.basis.clone(),
            clip: self.clips.clone(),
        };
        toml::to_string(&text).map_err(|e| Error::new(format!("cannot write TOML: {e}")).because(e))
    }

    /// Reads such a file.
    ///
    /// # Errors
    /// Where it is missing or not such a file, with the line.
    pub fn open(path: &Path) -> Result<Self> {
        let metadata = std::fs::metadata(path).map_err(|e| Error::io("open", path, e))?;
        if !metadata.is_file() || metadata.len() > MOST_BYTES {
            return Err(Error::new("expected a warp, a file of at most 64 MiB").in_file(path));
        }
        let bytes = std::fs::read(path).map_err(|e| Error::io("read", path, e))?;
        let text = String::from_utf8(bytes).map_err(|e| {
            let at = Place::Byte(e.utf8_error().valid_up_to() as u64);
            Error::new("expected text in UTF-8").in_file(path).at(at)
        })?;
        Self::parse(&text).map_err(|e| e.in_file(path).help("a warp is made by `froufrou warp fit`"))
    }

    /// Reads the text of such a file.
    ///
    /// # Errors
    /// Those of [`WarpFile::open`].
    pub fn parse(text: &str) -> Result<Self> {
        let read: Text = toml::from_str(text).map_err(|fault| {
            let error = Error::new(fault.message().to_owned());
            match fault.span() {
                Some(span) => error.at(line(text, span.start)),
                None => error,
            }
        })?;
        let fault = |key: &str, what: String| Err(Error::new(what).at(Place::Part(key.to_owned())));
        if read.format != FORMAT {
            return fault("format", format!("is {:?}, expected {FORMAT:?}", read.format));
        }
        if read.version != VERSION {
            return fault("version", format!("is {}, expected {VERSION}", read.version));
        }
        let d = read.offset.len();
        if d == 0 || read.linear.len() != d {
            return fault("linear", format!("has {} rows, expected {d} as offset", read.linear.len()));
        }
        if read.places.len() != read.weights.len() || read.places.len() > MOST_PLACES {
            let (places, weights) = (read.places.len(), read.weights.len());
            return fault("weights", format!("has {weights} rows for {places} places"));
        }
        let clips = read.clip.iter().flat_map(|clip| clip.from.iter().chain(&clip.to));
        let rows = read.linear.iter().chain(&read.places).chain(&read.weights).chain(clips);
        if let Some(row) = rows.clone().find(|row| row.len() != d) {
            return fault("a row", format!("has {} numbers, expected {d}", row.len()));
        }
        if let Some(value) = rows.flatten().chain(&read.offset).find(|value| !value.is_finite()) {
            return fault("a number", format!("is {value}, expected a finite one"));
        }
        if let Some(clip) = read.clip.iter().find(|clip| clip.from.len() != clip.to.len()) {
            return fault("clip", format!("pairs {} units with {}", clip.from.len(), clip.to.len()));
        }
        let flat = |rows: Vec<Vec<f64>>| rows.into_iter().flatten().collect();
        let warp = Warp {
            dimensions: d,
            places: flat(read.places),
            weights: flat(read.weights),
            offset: read.offset,
            linear: flat(read.linear),
        };
        Ok(Self { basis: read.basis, lambda: read.lambda, clips: read.clip, warp })
    }
}
