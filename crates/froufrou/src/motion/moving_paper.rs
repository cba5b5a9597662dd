//! What the sheets of paper of a scene do, told by how their meshes and those of what they touch move.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::event::Event;
use super::mesh_frames::{self, Body, MeshFrames};
use super::paper::ready_made::{Partition, Reader};
use super::paper::{Analyser, PaperSettings, Participant};
use crate::scene::Scene;
use crate::scene::file::Paper;
use crate::scene::world::{Carrier, World};
use crate::{Error, Result};

/// What sheets do, frame by frame: an iterator over events in order of time. It ends after its first error.
///
/// Frames are those of the sheet with the most of them; other meshes are asked where they are then.
pub struct MovingPaper {
    analyser: Analyser,
    frames: MeshFrames,
    /// What is known of sheets beforehand.
    known: Vec<Known>,
    over: bool,
}

/// The regions of a sheet, as its animator has them: those of a time hold until the next.
struct Known {
    object: usize,
    reader: Reader<BufReader<File>>,
    now: Option<Partition>,
    next: Option<Partition>,
}

impl Known {
    fn open(object: usize, path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|fault| Error::io("open", path, fault))?;
        let mut reader = Reader::new(BufReader::new(file), path);
        let next = reader.next().transpose()?;
        Ok(Self { object, reader, now: None, next })
    }

    /// Those of a time.
    fn at(&mut self, time_s: f64) -> Result<Option<Partition>> {
        // Times that are printed are rounded.
        while let Some(next) = self.next.take_if(|next| next.time_s <= time_s + 1e-6) {
            self.now = Some(next);
            self.next = self.reader.next().transpose()?;
        }
        Ok(self.now.clone())
    }
}

impl MovingPaper {
    /// Begins with some objects and what carries their meshes; `file` is the scene, which messages name.
    ///
    /// # Errors
    /// An object without a mesh.
    pub fn new(bodies: Vec<(Participant, Carrier)>, file: impl Into<PathBuf>) -> Result<Self> {
        let of =
            |(participant, carrier): &(Participant, Carrier)| (carrier.clone(), participant.paper.is_some());
        let named = bodies.iter().map(|body| {
            let (carrier, leads) = of(body);
            (body.0.name.as_str(), carrier, leads)
        });
        let frames = MeshFrames::new("paper", named, file.into())?;
        let participants = bodies.into_iter().map(|(participant, _)| participant).collect();
        Ok(Self { analyser: Analyser::new(participants), frames, known: Vec::new(), over: false })
    }

    /// Takes the regions of a sheet, by its number, from a file.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn known(mut self, object: usize, path: &Path) -> Result<Self> {
        self.known.push(Known::open(object, path)?);
        Ok(self)
    }

    /// The objects, in the order of their numbers.
    pub fn participants(&self) -> &[Participant] {
        self.analyser.participants()
    }

    /// Feeds the next frame.
    fn step(&mut self) -> Result<()> {
        let Some(time_s) = self.frames.advance()? else {
            self.over = true;
            return Ok(());
        };
        for known in &mut self.known {
            if let Some(partition) = known.at(time_s)? {
                self.analyser.give(known.object, partition)?;
            }
        }
        self.analyser.feed(time_s, self.frames.meshes())
    }
}

impl Iterator for MovingPaper {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(event) = self.analyser.next_event() {
                return Some(Ok(event));
            }
            if self.over {
                return None;
            }
            if let Err(fault) = self.step() {
                self.over = true;
                return Some(Err(fault.in_file(self.frames.file.clone())));
            }
        }
    }
}

/// How the paper of a scene is looked at.
fn settings(paper: &Paper) -> PaperSettings {
    PaperSettings {
        ridge_rad: paper.ridge_rad,
        flat_rad: paper.flat_rad,
        average_m: paper.average_m,
        radius_m: paper.radius_m,
        threshold_mps: paper.floor_speed_mps,
        least_energy_mps: paper.least_energy_mps,
        held: paper.held.clone(),
        ..PaperSettings::default()
    }
}

/// What the sheets of paper of a scene do, in order of time: the objects whose materials have a `paper`, along all that
/// have a mesh. Swarms are left out.
///
/// # Errors
/// An object of paper without a mesh, regions that cannot be read; what cannot be read, later on.
pub fn events(scene: &Scene, world: &World) -> Result<impl Iterator<Item = Result<Event>> + Send + use<>> {
    let mut regions: Vec<(usize, &Path)> = Vec::new();
    let mut sheets = Vec::new();
    for Body { name, carrier, material } in
        mesh_frames::bodies(scene, world, "paper", |material| material.paper.is_some())?
    {
        let paper = material.and_then(|material| material.paper.as_ref());
        let file = paper.and_then(|paper| paper.regions.as_ref());
        regions.extend(file.map(|file| (sheets.len(), file.path.as_path())));
        sheets.push((Participant { name: name.to_owned(), paper: paper.map(settings) }, carrier));
    }
    let moving = match sheets.iter().any(|(participant, _)| participant.paper.is_some()) {
        true => {
            let moving = MovingPaper::new(sheets, &scene.file)?;
            Some(regions.into_iter().try_fold(moving, |moving, (object, path)| moving.known(object, path))?)
        }
        false => None,
    };
    Ok(moving.into_iter().flatten())
}
