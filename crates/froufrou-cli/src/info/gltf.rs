//! What is in a glTF file: who wrote it, its clips, and its objects under the first of them.

use std::path::Path;

use froufrou::Result;
use froufrou::scene::gltf::{Clip, Gltf};
use serde::Serialize;

use super::Findings;
use super::objects::Objects;
use super::sheet::{Sheet, number};

/// At how many moments each mesh is looked at for the space it takes.
const MOMENTS: usize = 100;

#[derive(Serialize)]
pub struct GltfFindings {
    application: Option<String>,
    copyright: Option<String>,
    /// The first is the one that the objects move by.
    clips: Vec<ClipFindings>,
    #[serde(flatten)]
    objects: Objects,
}

#[derive(Serialize)]
struct ClipFindings {
    name: String,
    start_s: f64,
    end_s: f64,
    duration_s: f64,
}

/// Reads a file with its first clip, and its meshes one at a time.
pub fn read(file: &Path) -> Result<GltfFindings> {
    let animation = Gltf::open(file)?;
    let clip = |clip: &Clip| ClipFindings {
        name: clip.name.clone(),
        start_s: clip.start_s,
        end_s: clip.end_s,
        duration_s: clip.duration_s(),
    };
    Ok(GltfFindings {
        application: animation.generator().map(str::to_owned),
        copyright: animation.copyright().map(str::to_owned),
        clips: animation.clips().iter().map(clip).collect(),
        objects: Objects::read(&animation, MOMENTS)?,
    })
}

impl Findings for GltfFindings {
    const KIND: &'static str = "gltf";

    fn sheet(&self) -> Sheet {
        let mut sheet = Sheet::default();
        sheet
            .fact("kind", "glTF")
            .fact_if("written by", self.application.as_ref())
            .fact_if("copyright", self.copyright.as_ref())
            .fact("clips", self.clips.len())
            .fact_if("clip", self.clips.first().map(|clip| &clip.name));
        self.objects.facts(&mut sheet);
        let clips = self.clips.iter().map(|clip| {
            let times = format!("{} to {}", number(clip.start_s), number(clip.end_s));
            vec![clip.name.clone(), times, number(clip.duration_s)]
        });
        sheet.table(&["clip", "times (s)", "length (s)"], clips);
        self.objects.table(&mut sheet);
        sheet
    }
}
