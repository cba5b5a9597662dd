//! What a vertex costs in a frame of a glTF file: `cargo bench --bench gltf`. Items are vertices and
//! frames; a billion items a second is a nanosecond for each.

use std::io::Write;
use std::path::PathBuf;

use divan::counter::ItemsCount;
use froufrou::scene::animation::{Animation, Mesh};
use froufrou::scene::gltf::Gltf;
use tempfile::TempDir;

/// A whole number of triangles.
const VERTICES: usize = 20_001;
const FRAMES: usize = 16;
const JOINTS: usize = 32;

fn main() {
    divan::main();
}

/// Numbers that look like no pattern.
fn noise(index: usize) -> f32 {
    (index.wrapping_mul(2_654_435_761) % 1000) as f32 / 1000.0
}

struct File {
    _folder: TempDir,
    path: PathBuf,
}

/// Accessors one after another in one buffer: their type, component type, bytes and count.
fn write(rest: &str, arrays: &[(&str, u32, Vec<u8>, usize)]) -> File {
    let (mut views, mut accessors, mut binary) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (kind, component, bytes, count)) in arrays.iter().enumerate() {
        views.push(format!(r#"{{"buffer":0,"byteOffset":{},"byteLength":{}}}"#, binary.len(), bytes.len()));
        accessors.push(format!(
            r#"{{"bufferView":{index},"componentType":{component},"count":{count},"type":"{kind}"}}"#
        ));
        binary.extend_from_slice(bytes);
    }
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("file.bin"), &binary).expect("a file");
    let path = folder.path().join("file.gltf");
    let mut file = std::fs::File::create(&path).expect("a file");
    write!(
        file,
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{},"uri":"file.bin"}}],"bufferViews":[{}],"accessors":[{}],{rest}}}"#,
        binary.len(),
        views.join(","),
        accessors.join(",")
    )
    .expect("a file");
    File { _folder: folder, path }
}

fn floats(count: usize) -> Vec<u8> {
    (0..count).flat_map(|index| noise(index).to_le_bytes()).collect()
}

fn frames(animation: &Gltf, object: usize, mesh: &mut Mesh) -> f32 {
    let at = |frame: usize| 0.01 + frame as f64 / FRAMES as f64;
    let sum = |frame| {
        animation.mesh(object, at(frame), mesh).expect("a sound mesh");
        mesh.positions[7][0]
    };
    (0..FRAMES).map(sum).sum()
}

/// As many joints pull at each vertex.
#[divan::bench(args = [1, 2, 4])]
fn skinned(bencher: divan::Bencher, influences: usize) {
    let joints = (0..4 * VERTICES).map(|index| (noise(index) * JOINTS as f32) as u8).collect();
    let weights =
        (0..4 * VERTICES).map(|index| if index % 4 < influences { 1.0 / influences as f32 } else { 0.0 });
    let weights = weights.flat_map(f32::to_le_bytes).collect();
    let nodes: Vec<String> = (0..JOINTS).map(|_| r#"{"rotation":[0,0,0,1]}"#.to_owned()).collect();
    let channels: Vec<String> = (0..JOINTS)
        .map(|joint| format!(r#"{{"sampler":0,"target":{{"node":{},"path":"rotation"}}}}"#, joint + 1))
        .collect();
    let numbers: Vec<String> = (1..=JOINTS).map(|joint| joint.to_string()).collect();
    let file = write(
        &format!(
            r#""nodes":[{{"mesh":0,"skin":0}},{}],"skins":[{{"joints":[{}]}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"JOINTS_0":1,"WEIGHTS_0":2}}}}]}}],"animations":[{{"samplers":[{{"input":3,"output":4}}],"channels":[{}]}}]"#,
            nodes.join(","),
            numbers.join(","),
            channels.join(",")
        ),
        &[
            ("VEC3", 5126, floats(3 * VERTICES), VERTICES),
            ("VEC4", 5121, joints, VERTICES),
            ("VEC4", 5126, weights, VERTICES),
            ("SCALAR", 5126, [0.0_f32, 1.0].map(f32::to_le_bytes).concat(), 2),
            ("VEC4", 5126, [0.0_f32, 0.0, 0.0, 1.0, 0.6, 0.0, 0.0, 0.8].map(f32::to_le_bytes).concat(), 2),
        ],
    );
    measure(bencher, &file);
}

/// As many morph targets have a weight at once.
#[divan::bench(args = [1, 2, 8])]
fn morphed(bencher: divan::Bencher, targets: usize) {
    let names: Vec<String> = (0..targets).map(|target| format!(r#"{{"POSITION":{}}}"#, target + 3)).collect();
    let mut arrays = vec![
        ("VEC3", 5126, floats(3 * VERTICES), VERTICES),
        ("SCALAR", 5126, [0.0_f32, 1.0].map(f32::to_le_bytes).concat(), 2),
        ("SCALAR", 5126, floats(2 * targets).iter().map(|&byte| byte | 1).collect(), 2 * targets),
    ];
    arrays.extend((0..targets).map(|_| ("VEC3", 5126, floats(3 * VERTICES), VERTICES)));
    let file = write(
        &format!(
            r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"targets":[{}]}}]}}],"animations":[{{"samplers":[{{"input":1,"output":2}}],"channels":[{{"sampler":0,"target":{{"node":0,"path":"weights"}}}}]}}]"#,
            names.join(",")
        ),
        &arrays,
    );
    measure(bencher, &file);
}

fn measure(bencher: divan::Bencher, file: &File) {
    let animation = Gltf::open(&file.path).expect("a sound file");
    let mut mesh = Mesh::default();
    frames(&animation, 0, &mut mesh);
    bencher.counter(ItemsCount::new(VERTICES * FRAMES)).bench_local(|| frames(&animation, 0, &mut mesh));
}

/// Opening a file of many nodes and keys.
#[divan::bench]
fn opened(bencher: divan::Bencher) {
    let keys = 1000;
    let nodes: Vec<String> = (0..1000).map(|node| format!(r#"{{"name":"n{node}"}}"#)).collect();
    let channels: Vec<String> = (0..1000)
        .map(|node| format!(r#"{{"sampler":0,"target":{{"node":{node},"path":"translation"}}}}"#))
        .collect();
    let times = (0..keys).flat_map(|key| (key as f32 / 24.0).to_le_bytes()).collect();
    let file = write(
        &format!(
            r#""nodes":[{}],"animations":[{{"samplers":[{{"input":0,"output":1}}],"channels":[{}]}}]"#,
            nodes.join(","),
            channels.join(",")
        ),
        &[("SCALAR", 5126, times, keys), ("VEC3", 5126, floats(3 * keys), keys)],
    );
    bencher.bench(|| Gltf::open(&file.path).expect("a sound file"));
}
