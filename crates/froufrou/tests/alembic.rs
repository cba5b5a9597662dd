//! Alembic archives against what the C++ library reads from them: `oracles/alembic_fixtures.py`
//! writes the archives and the numbers beside them, `oracles/alembic_golden.py` the numbers of the
//! animations that are too big to be kept here.

use std::path::{Path, PathBuf};

use froufrou::scene::alembic::Alembic;
use froufrou::scene::animation::{Animation, KeyTimes, Mesh, ObjectKind, Topology, Transform};
use serde::Deserialize;

/// Metres, or parts of a matrix.
const TOLERANCE: f64 = 1e-6;

#[derive(Deserialize)]
struct GoldenObject {
    path: String,
    kind: String,
    key_times_s: Vec<f64>,
    at: Vec<GoldenMoment>,
}

#[derive(Deserialize)]
struct GoldenMoment {
    time_s: f64,
    transform: Vec<f64>,
    positions: Option<Vec<[f64; 3]>>,
    face_vertices: Option<Vec<u32>>,
    face_sizes: Option<Vec<u32>>,
    horizontal_field_of_view_rad: Option<f64>,
}

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/alembic")
}

fn open(name: &str) -> Alembic {
    Alembic::open(fixtures().join(name).with_extension("abc")).expect("a sound fixture")
}

fn find(animation: &Alembic, path: &str) -> usize {
    animation.objects().iter().position(|object| object.path == path).unwrap_or_else(|| panic!("{path}"))
}

fn mesh(animation: &Alembic, object: usize, time_s: f64) -> Mesh {
    let mut mesh = Mesh::default();
    animation.mesh(object, time_s, &mut mesh).expect("a sound sample");
    mesh
}

fn largest_difference(a: impl IntoIterator<Item = f64>, b: impl IntoIterator<Item = f64>) -> f64 {
    let (a, b): (Vec<f64>, Vec<f64>) = (a.into_iter().collect(), b.into_iter().collect());
    assert_eq!(a.len(), b.len());
    // A NaN is a difference.
    a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, |most, d| if d <= most { most } else { d })
}

fn numbers(transform: Transform) -> impl Iterator<Item = f64> {
    transform.into_iter().flatten()
}

fn coordinates(positions: &[[f32; 3]]) -> impl Iterator<Item = f64> {
    positions.iter().flatten().map(|value| f64::from(*value))
}

/// Each face the other way round.
fn turned(face_vertices: &[u32], face_sizes: &[u32]) -> Vec<u32> {
    let mut rest = face_vertices;
    let mut turned = Vec::new();
    for size in face_sizes {
        let (face, others) = rest.split_at(*size as usize);
        turned.extend(face.iter().rev());
        rest = others;
    }
    turned
}

fn determinant(m: &[f64]) -> f64 {
    m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8])
        + m[2] * (m[4] * m[9] - m[5] * m[8])
}

fn compare_with_golden(name: &str) {
    let animation = open(name);
    let text = std::fs::read_to_string(fixtures().join(name).with_extension("json")).expect("golden numbers");
    let golden: Vec<GoldenObject> = serde_json::from_str(&text).expect("golden numbers");
    let paths: Vec<&str> = animation.objects().iter().map(|object| object.path.as_str()).collect();
    assert_eq!(paths, golden.iter().map(|object| object.path.as_str()).collect::<Vec<_>>());
    for (index, (object, golden)) in animation.objects().iter().zip(&golden).enumerate() {
        let path = &object.path;
        assert_eq!(format!("{:?}", object.kind), golden.kind, "{path}");
        let times: Vec<f64> =
            (0..object.key_times.len()).map(|i| object.key_times.get(i).expect("below its length")).collect();
        assert_eq!(times.len(), golden.key_times_s.len(), "{path}: {:?}", object.key_times);
        assert!(largest_difference(times, golden.key_times_s.iter().copied()) < 1e-9, "{path}");
        for moment in &golden.at {
            let at = format!("{path} at {} s", moment.time_s);
            let transform = animation.transform(index, moment.time_s).expect("a sound sample");
            let difference = largest_difference(numbers(transform), moment.transform.iter().copied());
            assert!(difference < 1e-9, "{at}: transform off by {difference}");
            if let (Some(positions), Some(face_vertices), Some(face_sizes)) =
                (&moment.positions, &moment.face_vertices, &moment.face_sizes)
            {
                let mesh = mesh(&animation, index, moment.time_s);
                let difference =
                    largest_difference(coordinates(&mesh.positions), positions.iter().flatten().copied());
                assert!(difference < TOLERANCE, "{at}: vertices off by {difference}");
                assert_eq!(mesh.face_sizes, *face_sizes, "{at}");
                // Alembic winds clockwise; a mirroring transform has turned that round already.
                let mirrored = determinant(&moment.transform) < 0.0;
                let expected =
                    if mirrored { face_vertices.clone() } else { turned(face_vertices, face_sizes) };
                assert_eq!(mesh.face_vertices, expected, "{at}");
            }
            if let Some(expected) = moment.horizontal_field_of_view_rad {
                let lens = animation.lens(index, moment.time_s).expect("a sound sample").expect("a lens");
                assert!((lens.horizontal_field_of_view_rad() - expected).abs() < 1e-9, "{at}");
            }
        }
    }
}

macro_rules! golden {
    ($($name:ident),*) => { $(
        #[test]
        fn $name() {
            compare_with_golden(stringify!($name));
        }
    )* };
}

golden!(
    operations,
    many_operations,
    nesting,
    topologies,
    samplings,
    instances,
    repeats,
    cameras,
    edges,
    beside
);

#[derive(Deserialize)]
struct GoldenNumbers {
    name: String,
    time_s: f64,
    values: Vec<f64>,
}

#[test]
fn numbers_beside_points_are_read() {
    let animation = open("beside");
    let sheet = find(&animation, "/sheet");
    let text = std::fs::read_to_string(fixtures().join("beside_numbers.json")).expect("golden numbers");
    let golden: Vec<GoldenNumbers> = serde_json::from_str(&text).expect("golden numbers");
    let mut values = Vec::new();
    let mut get = |name: &str, time_s: f64| {
        animation.vertex_values(sheet, name, time_s, &mut values).expect("a sound sample");
        values.iter().map(|value| f64::from(*value)).collect::<Vec<_>>()
    };
    for GoldenNumbers { name, time_s, values } in &golden {
        let found = get(name, *time_s);
        assert!(largest_difference(found, values.iter().copied()) < 1e-6, "{name} at {time_s} s");
    }
    // Between frames they are linear: from 0.02 to 0.08 times the column.
    let between = get("force", 11.25 / 24.0);
    assert!((between[3] - 4.0 * 0.035).abs() < 1e-6, "{between:?}");
    let unknown = animation.vertex_values(sheet, "weight", 0.0, &mut Vec::new()).expect_err("no such name");
    assert!(unknown.to_string().contains("force, push, shared"), "{unknown}");
    let bare = open("topologies");
    let cube = find(&bare, "/constant");
    let unknown = bare.vertex_values(cube, "force", 0.0, &mut Vec::new()).expect_err("no numbers at all");
    assert!(unknown.to_string().contains("there are: none"), "{unknown}");
}

#[test]
fn topologies_are_told_apart() {
    let animation = open("topologies");
    for (path, topology, vertices, faces) in [
        ("/constant", Topology::Constant, 8, 6),
        ("/homogeneous", Topology::Homogeneous, 8, 6),
        ("/heterogeneous", Topology::Heterogeneous, 8, 6),
        ("/rewired", Topology::Heterogeneous, 8, 6),
        ("/subdivision", Topology::Constant, 8, 6),
    ] {
        let index = find(&animation, path);
        assert_eq!(animation.objects()[index].topology, topology, "{path}");
        let size = animation.mesh_size(index).expect("a sound sample").expect("a mesh");
        assert_eq!((size.vertices, size.faces), (vertices, faces), "{path}");
    }
    let cameras = open("cameras");
    let camera = find(&cameras, "/stand/still");
    assert_eq!(cameras.objects()[camera].topology, Topology::None);
    assert_eq!(cameras.mesh_size(camera).expect("an object"), None);
}

#[test]
fn equal_samplings_stay_uniform() {
    let animation = open("nesting");
    let times = &animation.objects()[find(&animation, "/outer/inner/cube")].key_times;
    assert_eq!(*times, KeyTimes::Uniform { start_s: 0.0, step_s: 1.0 / 24.0, count: 6 });
    assert_eq!(times.rate_hz(), Some(24.0));
    let (first_s, last_s) = times.span_s().expect("it moves");
    assert!(first_s == 0.0 && (last_s - 5.0 / 24.0).abs() < 1e-12);
    let other = &animation.objects()[find(&animation, "/outer/inner/other_rate")].key_times;
    assert!(matches!(other, KeyTimes::Listed(_)), "{other:?}");
}

/// A mesh moves linearly between two samples, and with it under a transform that moves too.
#[test]
fn between_samples_positions_are_linear() {
    for (file, path) in [
        ("topologies", "/homogeneous"),
        ("topologies", "/heterogeneous"),
        ("samplings", "/cyclic"),
        ("samplings", "/acyclic"),
    ] {
        let animation = open(file);
        let object = find(&animation, path);
        let times = &animation.objects()[object].key_times;
        for share in [0.1, 0.5, 0.93] {
            let (before_s, after_s) = (times.get(0).expect("a time"), times.get(1).expect("a time"));
            let (before, after) = (mesh(&animation, object, before_s), mesh(&animation, object, after_s));
            let found = mesh(&animation, object, before_s + share * (after_s - before_s));
            let expected = coordinates(&before.positions)
                .zip(coordinates(&after.positions))
                .map(|(before, after)| before + share * (after - before));
            let difference = largest_difference(coordinates(&found.positions), expected);
            assert!(difference < TOLERANCE, "{path}: {difference}");
            assert_ne!(before.positions, after.positions, "{path} must move for this to be a test");
        }
    }
}

/// Where the faces differ, the sample before holds, up to the very next sample.
#[test]
fn between_samples_of_other_faces_the_earlier_holds() {
    let animation = open("topologies");
    for (path, from) in [("/heterogeneous", 1), ("/heterogeneous", 2), ("/rewired", 0)] {
        let object = find(&animation, path);
        let times = &animation.objects()[object].key_times;
        let (before_s, after_s) = (times.get(from).expect("a time"), times.get(from + 1).expect("a time"));
        for share in [0.01, 0.5, 0.99] {
            let found = mesh(&animation, object, before_s + share * (after_s - before_s));
            assert_eq!(found, mesh(&animation, object, before_s), "{path}");
        }
        assert_ne!(mesh(&animation, object, after_s), mesh(&animation, object, before_s));
    }
}

#[test]
fn between_samples_rotations_are_spherical() {
    let animation = open("operations");
    let step_s = 1.0 / 24.0;
    let at = |path: &str, frames: f64| {
        animation.transform(find(&animation, path), step_s * (1.0 + frames)).expect("a sound sample")
    };
    for frames in [0.25_f64, 1.5, 2.75] {
        let angle = (10.0 * frames).to_radians();
        let expected = [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, angle.cos(), -angle.sin(), 0.0],
            [0.0, angle.sin(), angle.cos(), 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        assert!(largest_difference(numbers(at("/moving_rotate_x", frames)), numbers(expected)) < 1e-12);
        let translation = at("/moving_translate", frames);
        let (frame, share) = (frames.floor(), frames.fract());
        let square = frame * frame + share * (2.0 * frame + 1.0);
        let expected = [frames, square, -frames];
        assert!(largest_difference((0..3).map(|row| translation[row][3]), expected) < 1e-12);
    }
    let half = at("/moving_scale", 0.5);
    assert!(largest_difference((0..3).map(|i| half[i][i]), [1.5, 1.0, 0.75]) < 1e-12);
}

#[test]
fn before_the_first_and_after_the_last_sample_the_world_stands_still() {
    for (file, path) in [
        ("nesting", "/outer/inner/cube"),
        ("samplings", "/cyclic_move/acyclic"),
        ("topologies", "/heterogeneous"),
    ] {
        let animation = open(file);
        let object = find(&animation, path);
        let (first_s, last_s) = animation.objects()[object].key_times.span_s().expect("it moves");
        for far in [1e-3, 1.0, 1e9, 1e300, f64::INFINITY] {
            assert_eq!(mesh(&animation, object, first_s - far), mesh(&animation, object, first_s));
            assert_eq!(mesh(&animation, object, last_s + far), mesh(&animation, object, last_s));
        }
        assert_ne!(mesh(&animation, object, first_s), mesh(&animation, object, last_s));
    }
}

/// The same answers in any order of times and from many threads at once.
#[test]
fn order_and_threads_do_not_matter() {
    let animation = open("topologies");
    let object = find(&animation, "/heterogeneous");
    let times_s: Vec<f64> = (0..200).map(|i| f64::from(i * 37 % 200) * 0.0011).collect();
    let alone: Vec<Mesh> = times_s.iter().map(|time_s| mesh(&open("topologies"), object, *time_s)).collect();
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for (time_s, expected) in times_s.iter().zip(&alone) {
                    assert_eq!(mesh(&animation, object, *time_s), *expected, "{time_s}");
                }
            });
        }
    });
}

#[test]
fn what_is_not_there_is_an_error() {
    let animation = open("edges");
    let other = find(&animation, "/points");
    let mut mesh = Mesh::default();
    let error = animation.mesh(other, 0.0, &mut mesh).expect_err("points are no mesh").to_string();
    assert!(error.contains("edges.abc") && error.contains("/points") && error.contains("no mesh"), "{error}");
    let count = animation.objects().len();
    assert!(animation.transform(count, 0.0).expect_err("no such object").to_string().contains("there are"));
    assert!(animation.mesh_size(count).is_err());
    assert!(animation.transform(0, f64::NAN).expect_err("no time").to_string().contains("not a number"));
    assert_eq!(animation.lens(other, 0.0).expect("an object"), None);
}

/// Everything an object can be asked for at a few times; returns how many errors there were.
fn read_all(animation: &Alembic) -> usize {
    let mut errors = 0;
    let mut mesh = Mesh::default();
    for (index, object) in animation.objects().iter().enumerate() {
        let (first_s, last_s) = object.key_times.span_s().unwrap_or((0.0, 0.0));
        for time_s in [first_s, first_s + 0.013, (first_s + last_s) / 2.0, last_s] {
            errors += usize::from(animation.transform(index, time_s).is_err());
            errors += usize::from(animation.lens(index, time_s).is_err());
            if object.kind == ObjectKind::Mesh {
                errors += usize::from(animation.mesh(index, time_s, &mut mesh).is_err());
            }
        }
    }
    errors
}

#[test]
fn sound_fixtures_are_read_without_an_error() {
    for name in
        ["operations", "nesting", "topologies", "samplings", "instances", "repeats", "cameras", "edges"]
    {
        assert_eq!(read_all(&open(name)), 0, "{name}");
    }
}
