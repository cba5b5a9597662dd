//! glTF files against a numpy reading of the specification (`oracles/gltf_golden.py`): small ones made
//! for it in `fixtures/gltf`, and two of the Khronos samples.
//!
//! The samples themselves are not in the repository.

mod data;

use std::path::{Path, PathBuf};

use data::data;

use froufrou::scene::animation::{Animation, KeyTimes, Mesh, ObjectKind, Topology};
use froufrou::scene::gltf::Gltf;
use froufrou::scene::world::open_animation;
use serde::Deserialize;

const TOLERANCE_M: f64 = 1e-5;

#[derive(Deserialize)]
struct Golden {
    paths: Vec<String>,
    kinds: Vec<String>,
    clips: Vec<GoldenClip>,
    face_counts: Vec<(usize, usize)>,
    faces: Vec<(usize, Vec<u32>)>,
}

#[derive(Deserialize)]
struct GoldenClip {
    name: Option<String>,
    start_s: f64,
    end_s: f64,
    key_times: Vec<usize>,
    /// Object, time, three rows of its matrix.
    transforms: Vec<(usize, f64, [f64; 12])>,
    /// Object, time, number of vertices, every so-manieth of them.
    meshes: Vec<(usize, f64, usize, Vec<f64>)>,
}

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/gltf")
}

fn golden(name: &str) -> Golden {
    let text = std::fs::read_to_string(fixtures().join(name).with_extension("json")).expect("golden numbers");
    serde_json::from_str(&text).expect("golden numbers")
}

fn compare(path: &Path, golden: &Golden, every: usize) {
    let mut worst = [0.0_f64; 2];
    let mut mesh = Mesh::default();
    for (number, clip) in golden.clips.iter().enumerate() {
        let wanted = clip.name.as_ref().map(|_| number.to_string());
        let animation = Gltf::open_clip(path, wanted.as_deref()).expect("a sound file");
        assert_eq!(animation.clip().map(|clip| &clip.name), clip.name.as_ref());
        if let Some(found) = animation.clip() {
            assert!((found.start_s - clip.start_s).abs() < 2e-6 && (found.end_s - clip.end_s).abs() < 2e-6);
            assert_eq!(found.duration_s(), found.end_s - found.start_s);
        }
        let objects = animation.objects();
        assert_eq!(
            objects.iter().map(|object| &object.path).collect::<Vec<_>>(),
            golden.paths.iter().collect::<Vec<_>>()
        );
        assert_eq!(
            objects.iter().map(|object| format!("{:?}", object.kind)).collect::<Vec<_>>(),
            golden.kinds
        );
        assert_eq!(objects.iter().map(|object| object.key_times.len()).collect::<Vec<_>>(), clip.key_times);
        for &(object, time_s, expected) in &clip.transforms {
            let found = animation.transform(object, time_s).expect("a sound transform");
            for (found, expected) in found.as_flattened().iter().zip(expected) {
                let off = (found - expected).abs();
                assert!(off < TOLERANCE_M, "{} at {time_s}: {found} {expected}", golden.paths[object]);
                worst[0] = worst[0].max(off);
            }
        }
        for (object, time_s, count, expected) in &clip.meshes {
            animation.mesh(*object, *time_s, &mut mesh).expect("a sound mesh");
            assert_eq!(mesh.positions.len(), *count);
            let found: Vec<f32> = mesh.positions.iter().step_by(every).copied().flatten().collect();
            assert_eq!(found.len(), expected.len());
            for (index, (&found, expected)) in found.iter().zip(expected).enumerate() {
                let off = (f64::from(found) - expected).abs();
                let path = &golden.paths[*object];
                assert!(
                    off < TOLERANCE_M,
                    "{path} vertex {} at {time_s}: {found} {expected}",
                    index / 3 * every
                );
                worst[1] = worst[1].max(off);
            }
        }
        for &(object, count) in &golden.face_counts {
            animation.mesh(object, 0.0, &mut mesh).expect("a sound mesh");
            assert_eq!(mesh.face_sizes, vec![3; count]);
            assert_eq!(mesh.face_vertices.len(), 3 * count);
        }
        for (object, expected) in &golden.faces {
            animation.mesh(*object, 0.0, &mut mesh).expect("a sound mesh");
            if number == 0 {
                assert_eq!(&mesh.face_vertices, expected, "{}", golden.paths[*object]);
            }
        }
    }
    let [matrix, vertex] = worst;
    println!("{}: off by {matrix:.1e} in a matrix, {vertex:.1e} m in a vertex", path.display());
}

#[test]
fn tracks_of_every_kind_are_followed() {
    compare(&fixtures().join("interpolation.gltf"), &golden("interpolation"), 1);
}

#[test]
fn a_skin_bends_what_was_morphed() {
    compare(&fixtures().join("skin.glb"), &golden("skin"), 5);
}

#[test]
fn quantised_positions_beside_the_file_are_read() {
    compare(&fixtures().join("quantised.gltf"), &golden("quantised"), 1);
}

#[test]
fn primitives_of_every_mode_make_one_mesh() {
    compare(&fixtures().join("primitives.gltf"), &golden("primitives"), 1);
}

fn sample(file: &str, every: usize) {
    let Some(path) = data(&format!("anim/{file}")) else { return };
    compare(&path, &golden(&format!("data/{file}")), every);
}

#[test]
fn the_fox_runs() {
    sample("Fox.glb", 149);
}

#[test]
fn the_morph_stress_test_is_borne() {
    sample("MorphStressTest.gltf", 37);
}

/// Six times the volume that faces enclose: above 0 where they are counter-clockwise from outside.
fn volume(mesh: &Mesh) -> f64 {
    let corner = |index: u32| mesh.positions[index as usize].map(f64::from);
    let faces = mesh.face_vertices.as_chunks::<3>().0.iter();
    let six = |face: &[u32; 3]| {
        let [a, b, c] = face.map(corner);
        a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    faces.map(six).sum()
}

#[test]
fn faces_are_counter_clockwise_from_outside_under_mirrors_too() {
    let mut mesh = Mesh::default();
    let animation = Gltf::open(fixtures().join("primitives.gltf")).expect("a sound file");
    for (path, expected) in
        [("/plain", 1.0), ("/mirror", 2.0), ("/mirror/again", 1.0), ("/mirror/again.2", 2.0)]
    {
        let object = animation.objects().iter().position(|object| object.path == path).expect(path);
        animation.mesh(object, 0.0, &mut mesh).expect("a sound mesh");
        assert!((volume(&mesh) - expected).abs() < 1e-6, "{path} {}", volume(&mesh));
    }
    // A skinned body under a mirroring node is not mirrored: the node does nothing to it.
    let animation = Gltf::open_clip(fixtures().join("skin.glb"), Some("stand")).expect("a sound file");
    let body = animation.objects().iter().position(|object| object.path == "/body").expect("the body");
    animation.mesh(body, 0.0, &mut mesh).expect("a sound mesh");
    assert!(volume(&mesh) > 0.0);
}

#[test]
fn objects_say_what_they_are_and_how_they_change() {
    let of = |file: &str, clip: Option<&str>, path: &str| {
        let animation = Gltf::open_clip(fixtures().join(file), clip).expect("a sound file");
        animation.objects().iter().find(|object| object.path == path).expect(path).clone()
    };
    let skin = |clip: &str| of("skin.glb", Some(clip), "/body").topology;
    assert_eq!([skin("bend"), skin("stand"), skin("swell")], [Topology::Homogeneous; 3]);
    let leaf = of("interpolation.gltf", None, "/top/middle/low/leaf");
    assert_eq!((leaf.kind, leaf.topology), (ObjectKind::Mesh, Topology::Constant));
    let eye = of("interpolation.gltf", None, "/top/eye");
    assert_eq!((eye.kind, eye.topology), (ObjectKind::Camera, Topology::None));
    assert_eq!(of("primitives.gltf", None, "/plain").key_times, KeyTimes::Static);
    // Joints stand after what hangs on them is no matter; their times are the body's.
    assert_eq!(of("skin.glb", Some("stand"), "/body").key_times.get(1), Some(0.5));
}

#[test]
fn a_vertex_asked_alone_or_after_others_is_the_same() {
    let path = fixtures().join("skin.glb");
    let (mut one, mut other) = (Mesh::default(), Mesh::default());
    let used = Gltf::open(&path).expect("a sound file");
    let body = used.objects().iter().position(|object| object.path == "/body").expect("the body");
    for step in 0..20 {
        let time_s = f64::from((step * 7) % 20) / 20.0;
        used.mesh(body, time_s, &mut one).expect("a sound mesh");
        Gltf::open(&path).expect("a sound file").mesh(body, time_s, &mut other).expect("a sound mesh");
        assert_eq!(one, other);
    }
}

#[test]
fn clips_are_found_by_name_and_number_and_listed_where_not() {
    let path = fixtures().join("skin.glb");
    let animation = Gltf::open(&path).expect("a sound file");
    let names: Vec<&str> = animation.clips().iter().map(|clip| clip.name.as_str()).collect();
    assert_eq!(names, ["bend", "stand", "swell"]);
    assert_eq!(animation.clip().map(|clip| clip.name.as_str()), Some("bend"));
    for wanted in ["swell", "2"] {
        let animation = Gltf::open_clip(&path, Some(wanted)).expect("a sound file");
        assert_eq!(animation.clip().map(|clip| clip.name.as_str()), Some("swell"));
    }
    for wanted in ["dance", "3", ""] {
        let error = Gltf::open_clip(&path, Some(wanted)).expect_err("no such clip").to_string();
        assert!(error.contains("its clips: bend, stand, swell"), "{error}");
    }
}

#[test]
fn a_format_is_told_by_its_content() {
    let folder = tempfile::tempdir().expect("a folder");
    let renamed = folder.path().join("body.abc");
    std::fs::copy(fixtures().join("skin.glb"), &renamed).expect("a copy");
    assert_eq!(open_animation(&renamed).expect("a sound file").objects().len(), 5);
    std::fs::copy(fixtures().join("primitives.gltf"), &renamed).expect("a copy");
    assert_eq!(open_animation(&renamed).expect("a sound file").objects().len(), 6);
    let abc = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/alembic/nesting.abc");
    std::fs::copy(abc, folder.path().join("body.glb")).expect("a copy");
    assert!(open_animation(folder.path().join("body.glb")).is_ok());
}
