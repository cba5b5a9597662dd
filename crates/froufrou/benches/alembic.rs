//! How fast Alembic archives are opened and read: `cargo bench --bench alembic`. The animation is the
//! largest of the test data (`$FROUFROU_DATA/anim`, else `../shared/data/anim` beside the repository);
//! `oracles/alembic_speed.py` times the C++ library beside it.

use std::path::{Path, PathBuf};

use froufrou::scene::alembic::Alembic;
use froufrou::scene::animation::{Animation, Mesh, ObjectKind};

fn main() {
    if archive().is_none() {
        println!("skipped: there is no rumba_dress.abc (set FROUFROU_DATA to the folder of test data)");
        return;
    }
    divan::main();
}

fn archive() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("FROUFROU_DATA").map_or_else(beside, PathBuf::from);
    Some(data.join("anim/rumba_dress.abc")).filter(|path| path.exists())
}

fn open() -> Alembic {
    Alembic::open(archive().expect("main has looked for it")).expect("a sound archive")
}

/// Opening alone: the index.
#[divan::bench]
fn index() -> Alembic {
    open()
}

/// Opening, and every mesh of every frame in world space.
#[divan::bench]
fn all_frames() -> f32 {
    read(1)
}

/// The same at four times the frame rate, so that three of four meshes are interpolated.
#[divan::bench]
fn all_frames_four_times_as_dense() -> f32 {
    read(4)
}

fn read(density: u32) -> f32 {
    let animation = open();
    let mut mesh = Mesh::default();
    let mut sum = 0.0;
    for (index, object) in animation.objects().iter().enumerate() {
        if object.kind != ObjectKind::Mesh {
            continue;
        }
        let (first_s, last_s) = object.key_times.span_s().unwrap_or_default();
        let steps = (object.key_times.len().saturating_sub(1) as u32) * density;
        for step in 0..=steps {
            let time_s = first_s + (last_s - first_s) * f64::from(step) / f64::from(steps.max(1));
            animation.mesh(index, time_s, &mut mesh).expect("a sound sample");
            sum += mesh.positions[0][0];
        }
    }
    sum
}
