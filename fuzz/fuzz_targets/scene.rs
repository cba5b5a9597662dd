//! Scene files: what is read refers to nothing outside its folder, and can be opened and composed or
//! gives an error.
#![no_main]

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use froufrou::render::production::Production;
use froufrou::scene::Scene;
use froufrou::scene::asset::Asset;
use froufrou::scene::file::{Motion, Played};
use froufrou::scene::format::AnimationFormat;
use froufrou_fuzz::target;

/// A folder with a file of each kind that a scene can name, beside one that it must not reach.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let root = tempfile::tempdir().expect("a folder").keep();
    let folder = root.join("scene");
    std::fs::create_dir_all(folder.join("hits")).expect("a folder");
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/froufrou/tests/fixtures"));
    for (from, to) in [
        ("audio/mono_8000_u8.wav", "scene/a.wav"),
        ("audio/mono_8000_u8.wav", "scene/hits/b.wav"),
        ("audio/mono_8000_u8.wav", "scene/hits/c.wav"),
        ("audio/mono_8000_u8.wav", "secret.wav"),
        ("alembic/cameras.abc", "scene/x.abc"),
        ("gltf/skin.glb", "scene/x.glb"),
        ("point_cache/cloth.pc2", "scene/x.pc2"),
        ("point_cache/cloth.obj", "scene/x.obj"),
        ("alembic/cameras.abc", "secret.abc"),
    ] {
        std::fs::copy(fixtures.join(from), root.join(to)).expect("a fixture");
    }
    let log = "t,a,b,x,y,z,F\n0.1,p,q,0,0,0,5\n0.2,p,q,1,0,0,9\n";
    std::fs::write(folder.join("log.csv"), log).expect("a log");
    let script =
        "param(\"pitch\", 700.0); let t = sine(pitch); play(t); fn control() { t.frequency = pitch; }";
    std::fs::write(folder.join("siren.rhai"), script).expect("a script");
    std::fs::write(folder.join("flight.rhai"), "fn place(m, t) { [sin(t), m * 0.1, random()] }")
        .expect("a script");
    std::fs::write(folder.join("bell.json"), r#"[{"frequency": 440, "rt60_s": 1}]"#).expect("a table");
    #[cfg(unix)]
    std::os::unix::fs::symlink("../secret.wav", folder.join("link.wav")).expect("a link");
    folder.canonicalize().expect("the folder")
});

/// The files that a scene refers to.
fn files(scene: &Scene) -> Vec<PathBuf> {
    let impacts = scene.materials.iter().flat_map(|material| &material.impact).map(|impact| &impact.played);
    let slides = scene.materials.iter().flat_map(|material| &material.slide).map(|slide| &slide.played);
    let played = scene.sounds.iter().map(|sound| &sound.played).chain(impacts).chain(slides);
    let recordings = played.flat_map(|played| match played {
        Played::Recordings { recordings, .. } => recordings.as_slice(),
        Played::Instrument(_) => &[],
    });
    let motions = scene.objects.iter().flat_map(|object| &object.motion);
    let motions = motions.chain(scene.microphones.iter().map(|microphone| &microphone.motion));
    let sources: Vec<_> = motions
        .filter_map(|motion| match motion {
            Motion::Source(source) => Some(source),
            Motion::Track(_) => None,
        })
        .collect();
    let scripts = scene.objects.iter().flat_map(|object| &object.swarm).flat_map(|swarm| &swarm.script);
    let logs = scene.contacts.iter().map(|contacts| &contacts.log);
    let assets: Vec<&Asset> =
        recordings.chain(sources.iter().map(|source| &source.file)).chain(scripts).chain(logs).collect();
    let made = scene.instruments.iter().filter_map(|instrument| instrument.make.file());
    let faces = sources.iter().filter_map(|source| source.conventions.faces.clone());
    assets
        .into_iter()
        .map(|asset| asset.path.clone())
        .chain(made.map(|f| scene.folder.join(f)))
        .chain(faces)
        .collect()
}

target!(|bytes| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(scene) = Scene::parse(text, FOLDER.join("scene.toml"), false) else { return };
    assert!(!scene.microphones.is_empty());
    for file in files(&scene) {
        // The pattern of a sequence is no file: its folder counts.
        let file = if AnimationFormat::of_pattern(&file).is_some() { file.with_file_name("") } else { file };
        let path = file.canonicalize().expect("a file that is there");
        assert!(path.starts_with(&*FOLDER), "{} is outside", path.display());
    }
    let Ok(production) = Production::open(scene) else { return };
    if let Ok(lines) = production.object_lines() {
        for line in lines.take(100) {
            if line.is_err() {
                break;
            }
        }
    }
    if let Ok(lines) = production.channel_lines() {
        for line in lines.take(100) {
            let Ok(line) = line else { break };
            let mut arrivals = line.statement().into_iter().flat_map(|statement| &statement.value);
            let whole = arrivals.all(|arrival| arrival.gain.is_finite() && arrival.delay_s.is_finite());
            assert!(whole && line.time_s().is_finite(), "{line:?}");
        }
    }
});
