//! What a glTF file says of itself: who wrote it, and its clips.

use froufrou::scene::gltf::Gltf;

use super::animation::Facts;
use super::sheet::number;

/// The facts that a file has of itself.
pub fn facts(file: &Gltf) -> Facts {
    let clips = file
        .clips()
        .iter()
        .map(|clip| format!("{} ({} to {} s)", clip.name, number(clip.start_s), number(clip.end_s)));
    let clips = clips.collect::<Vec<_>>().join(", ");
    let told = [
        ("written by", file.generator().map(str::to_owned)),
        ("copyright", file.copyright().map(str::to_owned)),
        ("clips", Some(clips).filter(|clips| !clips.is_empty())),
        ("clip", file.clip().map(|clip| clip.name.clone())),
    ];
    told.into_iter().filter_map(|(label, value)| Some((label, value?))).collect()
}
