//! Point caches, OBJ and sequences of OBJ files against Blender: `oracles/point_cache_fixtures.py` had
//! it write one and the same animated mesh in each format.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use froufrou::Result;
use froufrou::scene::Scene;
use froufrou::scene::animation::{Animation, KeyTimes, Mesh, MeshSize, ObjectKind, Topology};
use froufrou::scene::conventions::{Conventions, UpAxis};
use froufrou::scene::world::{World, open_animation, open_animation_as};

const FRAMES: usize = 8;
const RATE_HZ: f64 = 25.0;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/point_cache").join(name)
}

/// Blender's raw coordinates: Z up.
fn blender() -> Conventions {
    Conventions { up: Some(UpAxis::Z), frame_rate_hz: Some(RATE_HZ), ..Conventions::default() }
}

fn open(name: &str) -> Result<Arc<dyn Animation>> {
    let frame_rate_hz = blender().frame_rate_hz.filter(|_| name.ends_with(".pc2") || name.contains('*'));
    open_animation_as(fixture(name), &Conventions { frame_rate_hz, ..blender() })
}

fn mesh(animation: &dyn Animation, object: usize, time_s: f64) -> Result<Mesh> {
    let mut mesh = Mesh::default();
    animation.mesh(object, time_s, &mut mesh)?;
    Ok(mesh)
}

fn assert_near(found: &[[f32; 3]], expected: &[[f32; 3]], tolerance: f32, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (index, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((0..3).all(|i| (a[i] - b[i]).abs() <= tolerance), "{what}, vertex {index}: {a:?} {b:?}");
    }
}

/// Each face begun at its least vertex, in order: how it begins says nothing.
fn faces(mesh: &Mesh) -> Vec<Vec<u32>> {
    let mut rest = mesh.face_vertices.as_slice();
    let mut faces = Vec::new();
    for size in &mesh.face_sizes {
        let (face, others) = rest.split_at(*size as usize);
        let least = (0..face.len()).min_by_key(|i| face[*i]).unwrap_or(0);
        faces.push([&face[least..], &face[..least]].concat());
        rest = others;
    }
    faces.sort();
    faces
}

/// The modifier reads the files as Blender wrote them and interpolates between frames as we do.
#[test]
fn positions_are_those_of_blenders_mesh_cache() -> Result<()> {
    let text = std::fs::read_to_string(fixture("mesh_cache.json")).expect("a fixture");
    let told: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let indices = told["indices"].as_array().expect("a list");
    assert!(indices.len() >= 8);
    for (name, kind, start_s) in [("cloth.pc2", "PC2", 1.0 / RATE_HZ), ("cloth.mdd", "MDD", 0.0)] {
        let conventions = Conventions { up: None, ..blender() };
        let conventions = if kind == "PC2" { conventions } else { Conventions::default() };
        let animation = open_animation_as(fixture(name), &conventions)?;
        for (index, positions) in indices.iter().zip(told[kind].as_array().expect("a list")) {
            let numbers: Vec<f32> = positions
                .as_array()
                .expect("a list")
                .iter()
                .map(|c| c.as_f64().expect("a number") as f32)
                .collect();
            let time_s = start_s + index.as_f64().expect("a number") / RATE_HZ;
            let found = mesh(animation.as_ref(), 0, time_s)?;
            assert_near(&found.positions, numbers.as_chunks::<3>().0, 1e-5, &format!("{name} at {time_s}"));
        }
    }
    Ok(())
}

#[test]
fn every_format_is_the_archive_once_its_axes_are_said() -> Result<()> {
    let archive = open_animation(fixture("cloth.abc"))?;
    let in_archive = archive.objects().iter().position(|o| o.kind == ObjectKind::Mesh).expect("a mesh");
    for (name, clock_s) in [("cloth.pc2", 0.0), ("cloth.mdd", -1.0 / RATE_HZ), ("frame_*.obj", 0.0)] {
        let animation = open(name)?;
        let [object] = animation.objects() else { panic!("{name}: {:?}", animation.objects()) };
        assert_eq!((object.path.as_str(), object.kind), ("/cloth", ObjectKind::Mesh), "{name}");
        let KeyTimes::Uniform { start_s, step_s, count: FRAMES } = object.key_times else {
            panic!("{name}: {:?}", object.key_times)
        };
        assert!((start_s - clock_s - 1.0 / RATE_HZ).abs() < 1e-12 && (step_s - 1.0 / RATE_HZ).abs() < 1e-8);
        assert_eq!(animation.mesh_size(0)?, Some(MeshSize { vertices: 35, faces: 24 }));
        for half_frame in 1..=18 {
            let time_s = f64::from(half_frame) / 2.0 / RATE_HZ;
            let (found, expected) =
                (mesh(animation.as_ref(), 0, time_s + clock_s)?, mesh(archive.as_ref(), in_archive, time_s)?);
            assert_near(&found.positions, &expected.positions, 1e-5, &format!("{name} at {time_s}"));
            assert_eq!(faces(&found), faces(&expected), "{name}");
        }
    }
    assert_eq!(open("cloth.pc2")?.objects()[0].topology, Topology::Homogeneous);
    // Half frames are samples of their own: the first, with twice as many.
    let (halves, whole) = (open("halves.pc2")?, open("cloth.pc2")?);
    assert_eq!(halves.objects()[0].key_times.len(), 2 * FRAMES - 1);
    for frame in 1..=FRAMES {
        let time_s = frame as f64 / RATE_HZ;
        let (a, b) = (mesh(halves.as_ref(), 0, time_s)?, mesh(whole.as_ref(), 0, time_s)?);
        assert_near(&a.positions, &b.positions, 1e-6, "halves");
    }
    Ok(())
}

#[test]
fn an_obj_file_of_two_objects_is_two_objects() -> Result<()> {
    // Blender's default axes for OBJ are ours.
    let two = open_animation(fixture("two.obj"))?;
    let paths: Vec<&str> = two.objects().iter().map(|o| o.path.as_str()).collect();
    assert_eq!(paths, ["/cloth", "/box"]);
    let (cloth, cube) = (mesh(two.as_ref(), 0, 0.0)?, mesh(two.as_ref(), 1, 0.0)?);
    let expected = mesh(open("cloth.pc2")?.as_ref(), 0, 0.0)?;
    assert_near(&cloth.positions, &expected.positions, 1e-5, "two.obj");
    assert_eq!(faces(&cloth), faces(&expected));
    assert_eq!((cube.positions.len(), cube.face_sizes.as_slice()), (8, &[4; 6][..]));
    assert!(cube.positions.iter().all(|p| (p[0] - 3.0).abs() == 0.5), "{:?}", cube.positions);
    // Outward normals: the volume by the divergence theorem is that of the cube.
    let corner = |face: &[u32], i: usize| glam::DVec3::from(cube.positions[face[i] as usize].map(f64::from));
    let six_volumes: f64 = cube
        .face_vertices
        .chunks(4)
        .flat_map(|face| {
            [[0, 1, 2], [0, 2, 3]]
                .map(|[a, b, c]| corner(face, a).dot(corner(face, b).cross(corner(face, c))))
        })
        .sum();
    assert!((six_volumes - 6.0).abs() < 1e-5, "{six_volumes}");
    Ok(())
}

#[test]
fn faces_are_found_named_or_missing() -> Result<()> {
    let room = tempfile::tempdir().expect("a folder");
    let copy = |from: &str, to: &str| std::fs::copy(fixture(from), room.path().join(to)).expect("a copy");
    let at = |name: &str| room.path().join(name);
    copy("cloth.pc2", "alone.pc2");
    let alone = open_animation(at("alone.pc2"))?;
    assert_eq!(alone.mesh_size(0)?, Some(MeshSize { vertices: 35, faces: 0 }));
    assert_eq!(alone.objects()[0].path, "/alone");
    let with = |faces: PathBuf| {
        open_animation_as(at("alone.pc2"), &Conventions { faces: Some(faces), ..Conventions::default() })
    };
    // Of two objects the one that fits; of an archive its mesh.
    let expected = mesh(open("cloth.pc2")?.as_ref(), 0, 0.0)?;
    for name in ["cloth.obj", "two.obj", "cloth.abc"] {
        assert_eq!(faces(&mesh(with(fixture(name))?.as_ref(), 0, 0.0)?), faces(&expected), "{name}");
    }
    std::fs::write(at("small.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("a file");
    let error = with(at("small.obj")).err().expect("too few").to_string();
    let told = ["alone.pc2", "35 vertices", "small.obj has a mesh of 3", "`faces`"];
    assert!(told.iter().all(|part| error.contains(part)), "{error}");
    // The same beside it.
    std::fs::copy(at("small.obj"), at("alone.obj")).expect("a copy");
    let error = open_animation(at("alone.pc2")).err().expect("too few").to_string();
    assert!(error.contains("alone.obj has a mesh of 3"), "{error}");
    #[cfg(unix)]
    {
        std::fs::remove_file(at("alone.obj")).expect("a file");
        std::os::unix::fs::symlink(fixture("cloth.obj"), at("alone.obj")).expect("a link");
        let error = open_animation(at("alone.pc2")).err().expect("a link").to_string();
        assert!(error.contains("link to another folder"), "{error}");
    }
    Ok(())
}

#[test]
fn conventions_without_use_are_refused() {
    let wrong = |name: &str, conventions: Conventions| {
        open_animation_as(fixture(name), &conventions).err().map(|e| e.to_string()).unwrap_or_default()
    };
    let rate = || Conventions { frame_rate_hz: Some(30.0), ..Conventions::default() };
    for name in ["cloth.mdd", "cloth.abc", "cloth.obj"] {
        assert!(wrong(name, rate()).contains("`frame_rate` means nothing"), "{name}");
    }
    let faces = || Conventions { faces: Some(fixture("cloth.obj")), ..Conventions::default() };
    for name in ["frame_*.obj", "cloth.abc", "cloth.obj"] {
        assert!(wrong(name, faces()).contains("`faces` means nothing"), "{name}");
    }
    for unit_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let unit = Conventions { unit_m: Some(unit_m), ..Conventions::default() };
        assert!(wrong("cloth.obj", unit).contains("a finite number above 0"), "{unit_m}");
    }
}

/// One file taken to mean two things, in a scene.
#[test]
fn a_scene_says_what_its_files_do_not() -> Result<()> {
    let file = fixture("scene.toml");
    let text = "
        [listener]
        track = 'cloth.abc#/cloth'
        unit = 0.5
        [[object]]
        name = 'as it is'
        source = 'cloth.pc2#/cloth'
        point = { vertex = 3 }
        [[object]]
        name = 'centimetres'
        source = 'cloth.pc2#/cloth'
        point = { vertex = 3 }
        up = 'z'
        unit = 0.01
        frame_rate = 25
        faces = 'two.obj'
        [[object]]
        name = 'files'
        source = 'frame_[0-9]*.obj#/*'
        point = { vertex = 3 }
        up = 'z'
        unit = 0.01
        frame_rate = 25
        time_offset = 0.04";
    let scene = Scene::parse(text, &file, false)?;
    let world = World::open(&scene)?;
    let place = |object: usize, time_s: f64| {
        world.objects[object][0].carrier.as_ref().expect("a carrier").position_m(time_s)
    };
    // Time 0 is the first frame of all, at a 25th of a second, where the archive has it.
    for frame in 0..FRAMES {
        let time_s = frame as f64 / RATE_HZ;
        let raw = mesh(open("cloth.pc2")?.as_ref(), 0, time_s + 1.0 / RATE_HZ)?.positions[3].map(f64::from);
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-6);
        assert!(near(place(1, time_s)?, raw.map(|c| c / 100.0)), "{frame}");
        assert!(near(place(2, time_s + 0.04)?, raw.map(|c| c / 100.0)), "{frame}");
        // Frames of film: later, and Z is not turned up.
        let film_s = (frame + 1) as f64 / 24.0 - 1.0 / RATE_HZ;
        assert!(near(place(0, film_s)?, [raw[0], -raw[2], raw[1]]), "{frame}");
    }
    // The files, a frame late, end last.
    assert!((world.end_s() - 8.0 / RATE_HZ).abs() < 1e-9);
    Ok(())
}
