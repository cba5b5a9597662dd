//! The sounds of a score, each with a name of its own.

use super::super::{Make, Sound};
use crate::scene::Scene;
use crate::scene::file::{GrainSound, Instrument, Paper, Played, Sheet};

/// The sounds that a scene may play.
pub(super) fn sounds(scene: &Scene) -> Vec<Sound> {
    let mut palette = Palette::default();
    let impacts = scene.materials.iter().filter_map(|material| material.impact.as_ref());
    let rubs = scene.materials.iter().flat_map(|material| material.slide.iter().chain(&material.roll));
    let played = scene.sounds.iter().map(|sound| &sound.played);
    let played = played.chain(impacts.map(|impact| &impact.played));
    for played in played.chain(rubs.map(|rub| &rub.played)) {
        played_sounds(played, &scene.instruments).for_each(|(base, sound)| palette.add(&base, sound));
    }
    for sound in scene.materials.iter().filter_map(|material| material.grains.as_ref()) {
        let folder = sound.corpus.name.trim_end_matches('/');
        palette.add(folder.rsplit('/').next().unwrap_or_default(), grains(sound));
    }
    for cloth in scene.materials.iter().filter_map(|material| material.cloth.as_ref()) {
        let along = cloth.against.iter().map(|(_, corpus)| corpus);
        for corpus in std::iter::once(&cloth.corpus).chain(along) {
            let folder = corpus.trim_end_matches('/');
            palette.add(folder.rsplit('/').next().unwrap_or_default(), self::cloth(corpus));
        }
        if let Some(sheet) = &cloth.membrane {
            palette.add("membrane", membrane(sheet));
        }
    }
    for paper in scene.materials.iter().filter_map(|material| material.paper.as_ref()) {
        let along = paper.against.iter().map(|(_, corpus)| corpus);
        for corpus in std::iter::once(&paper.corpus).chain(along) {
            let folder = corpus.trim_end_matches('/');
            palette.add(folder.rsplit('/').next().unwrap_or_default(), self::paper(paper, corpus));
        }
    }
    palette.sounds
}

/// What something plays: each sound without its name, and what it might be called.
fn played_sounds<'a>(
    played: &'a Played,
    instruments: &'a [Instrument],
) -> Box<dyn Iterator<Item = (String, Sound)> + 'a> {
    match played {
        Played::Recordings { recordings, .. } => Box::new((0..recordings.len()).map(move |index| {
            let stem = recordings[index].name.rsplit('/').next().unwrap_or_default();
            let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
            (stem.to_owned(), sound_of(played, index, instruments))
        })),
        Played::Instrument(instrument) => {
            let name = instruments.get(*instrument).map_or("", |instrument| &instrument.name);
            Box::new(std::iter::once((name.to_owned(), sound_of(played, 0, instruments))))
        }
    }
}

/// One of the sounds of what plays, without its name.
pub(super) fn sound_of(played: &Played, index: usize, instruments: &[Instrument]) -> Sound {
    let (make, with) = match played {
        Played::Recordings { recordings, repeat, channel } => {
            let path = recordings.get(index).map_or(String::new(), |asset| asset.name.clone());
            (Make::Recording { path, repeat: *repeat, channel: *channel }, Vec::new())
        }
        Played::Instrument(instrument) => match instruments.get(*instrument) {
            Some(instrument) => (instrument.make.clone(), instrument.with.clone()),
            None => (Make::Modes { table: None, modes: Vec::new() }, Vec::new()),
        },
    };
    Sound { name: String::new(), make, with }
}

/// Whether two sounds are the same but for their names.
pub(super) fn same(a: &Sound, b: &Sound) -> bool {
    a.make == b.make && a.with == b.with
}

/// The sound of a material's grains, without its name.
pub(super) fn grains(sound: &GrainSound) -> Sound {
    Sound { name: String::new(), make: Make::Grains { corpus: sound.corpus.name.clone() }, with: Vec::new() }
}

/// The sound of a cloth, without its name.
pub(super) fn cloth(corpus: &str) -> Sound {
    Sound { name: String::new(), make: Make::Cloth { corpus: corpus.to_owned() }, with: Vec::new() }
}

/// The sound of a paper by one of its databases, without its name.
pub(super) fn paper(paper: &Paper, corpus: &str) -> Sound {
    // What is as it is anyhow is not said.
    let with = [("coherence", paper.coherence), ("slip", paper.slip), ("tearing", paper.tearing)];
    let with = with.iter().filter(|(_, value)| *value != 1.0);
    let with = with.map(|(name, value)| ((*name).to_owned(), *value)).collect();
    Sound { name: String::new(), make: Make::Paper { corpus: corpus.to_owned() }, with }
}

/// The sound of a cloth as a membrane, without its name.
pub(super) fn membrane(sheet: &Sheet) -> Sound {
    let with = [
        ("width", sheet.size_m),
        ("height", sheet.size_m),
        ("density", sheet.density_kg_per_m2),
        ("damping", sheet.damping),
        ("modes", 60.0),
    ];
    let with = with.map(|(name, value)| (name.to_owned(), value)).to_vec();
    Sound { name: String::new(), make: Make::Membrane, with }
}

#[derive(Default)]
struct Palette {
    sounds: Vec<Sound>,
}

impl Palette {
    fn add(&mut self, called: &str, sound: Sound) {
        if self.sounds.iter().any(|known| same(known, &sound)) {
            return;
        }
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
        let mut base: String = called.chars().map(plain).collect();
        if !base.starts_with(|c: char| c.is_ascii_alphabetic()) {
            base.insert(0, '_');
        }
        let taken = |name: &str| self.sounds.iter().any(|sound| sound.name == name);
        let numbered = (2..).map(|number| format!("{base}-{number}"));
        let name = std::iter::once(base.clone()).chain(numbered).find(|name| !taken(name)).unwrap_or(base);
        self.sounds.push(Sound { name, ..sound });
    }
}
