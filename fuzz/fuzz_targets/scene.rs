//! Scene files: what is read refers to nothing outside its folder, and can be opened and composed or
//! gives an error.
#![no_main]

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use froufrou::render::production::Production;
use froufrou::scene::Scene;
use froufrou::scene::asset::Asset;
use froufrou::scene::file::Motion;
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
        ("alembic/cameras.abc", "secret.abc"),
    ] {
        std::fs::copy(fixtures.join(from), root.join(to)).expect("a fixture");
    }
    let log = "t,a,b,x,y,z,F\n0.1,p,q,0,0,0,5\n0.2,p,q,1,0,0,9\n";
    std::fs::write(folder.join("log.csv"), log).expect("a log");
    #[cfg(unix)]
    std::os::unix::fs::symlink("../secret.wav", folder.join("link.wav")).expect("a link");
    folder.canonicalize().expect("the folder")
});

fn assets(scene: &Scene) -> impl Iterator<Item = &Asset> {
    let recordings = scene.sounds.iter().flat_map(|sound| &sound.recordings);
    let impacts = scene.materials.iter().flat_map(|material| &material.impact).flat_map(|i| &i.recordings);
    let motions = scene.objects.iter().flat_map(|object| &object.motion);
    let motions = motions.chain(scene.microphones.iter().map(|microphone| &microphone.motion));
    let sources = motions.filter_map(|motion| match motion {
        Motion::Source(source) => Some(&source.file),
        Motion::Track(_) => None,
    });
    recordings.chain(impacts).chain(sources).chain(scene.contacts.iter().map(|contacts| &contacts.log))
}

target!(|bytes| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(scene) = Scene::parse(text, FOLDER.join("scene.toml"), false) else { return };
    assert!(!scene.microphones.is_empty());
    for asset in assets(&scene) {
        let path = asset.path.canonicalize().expect("a file that is there");
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
            let whole =
                line.value.iter().all(|arrival| arrival.gain.is_finite() && arrival.delay_s.is_finite());
            assert!(whole && line.time_s.is_finite(), "{line:?}");
        }
    }
});
