//! glTF files that are cut short, flipped, absurd or malicious: always an error or a reading, never a
//! panic, a hang, or memory beyond a multiple of the file.

mod damage;

use std::path::{Path, PathBuf};
use std::time::Duration;

use damage::{Bounds, Scratch, most_held, overwritten, read_all, turn};
use froufrou::scene::animation::{Animation, Mesh, ObjectKind};
use froufrou::scene::gltf::Gltf;
use proptest::prelude::*;

const FIXTURES: [&str; 4] = ["interpolation.gltf", "skin.glb", "quantised.gltf", "primitives.gltf"];

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/gltf")
}

fn fixture(name: &str) -> Vec<u8> {
    std::fs::read(fixtures().join(name)).expect("a fixture")
}

/// A folder for one damaged file after another, beside the buffer that a fixture names.
fn scratch() -> Scratch {
    let bounds = Bounds { time: Duration::from_secs(8), base_bytes: 80 << 20, per_byte: 500 };
    let scratch = Scratch::new("damaged.gltf", |path| read_all(&Gltf::open(path)?)).within(bounds);
    let beside = "quantised data.bin";
    std::fs::copy(fixtures().join(beside), scratch.folder.path().join(beside)).expect("a copy");
    scratch
}

/// The error of a document with these members besides what every one has.
fn refused(scratch: &Scratch, members: &str) -> String {
    scratch.error(document(members))
}

/// A document with one buffer of `BYTES` bytes, 0, 1, 2 and so on, and these members.
fn document(members: &str) -> String {
    let text: String = (0..BYTES).map(|byte| format!("%{byte:02x}")).collect();
    format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{BYTES},"uri":"data:,{text}"}}],{members}}}"#
    )
}

const BYTES: usize = 240;

/// A mesh of the positions in accessor 0, in a scene; `rest` is more of its primitive.
fn mesh(accessors: &str, rest: &str) -> String {
    format!(
        r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}{rest}}}]}}],"bufferViews":[{{"buffer":0,"byteLength":{BYTES}}}],"accessors":[{accessors}]"#
    )
}

/// An accessor into the view 0.
fn accessor(component: u32, kind: &str, count: u64) -> String {
    format!(r#"{{"bufferView":0,"componentType":{component},"type":"{kind}","count":{count}}}"#)
}

#[test]
fn other_kinds_of_file_are_named() {
    let (_turn, scratch) = (turn(), scratch());
    assert!(scratch.error("").contains("neither binary glTF nor JSON"));
    assert!(scratch.error("# a Wavefront file\nv 0 0 0\n").contains("neither binary glTF nor JSON"));
    assert!(scratch.error("{}").contains("no `asset`"));
    assert!(scratch.error("{\"asset\":").contains(":1:9: not the JSON"));
    assert!(scratch.error(r#"{"asset":{"version":"1.0"}}"#).contains("needs glTF \"1.0\""));
    assert!(scratch.error(r#"{"asset":{"version":"2.1","minVersion":"2.1"}}"#).contains("2.1"));
    assert!(scratch.error(b"glTF\x01\0\0\0\x14\0\0\0\0\0\0\0\0\0\0\0").contains("version 1"));
    assert!(scratch.error(b"glTF\x02\0").contains("ends within its header"));
    assert_eq!(scratch.try_bytes(br#"{"asset":{"version":"2.0"}}"#).expect("empty but sound"), 0);
    assert!(Gltf::open(scratch.folder.path()).is_err());
    let missing = Gltf::open(scratch.folder.path().join("none.glb")).expect_err("nothing there");
    assert!(missing.to_string().contains("none.glb"), "{missing}");
}

#[test]
fn what_an_extension_hides_is_said() {
    let (_turn, scratch) = (turn(), scratch());
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression"] {
        let error = refused(&scratch, &format!(r#""extensionsRequired":["{name}"]"#));
        assert!(error.contains(name) && error.contains("without compression"), "{error}");
    }
    let error = refused(&scratch, r#""extensionsRequired":["EXT_mesh_gpu_instancing"]"#);
    assert!(error.contains("EXT_mesh_gpu_instancing") && error.contains("extensionsRequired[0]"), "{error}");
    for name in
        ["KHR_materials_unlit", "KHR_texture_transform", "KHR_lights_punctual", "KHR_mesh_quantization"]
    {
        let text = document(&format!(r#""extensionsRequired":["{name}"]"#));
        assert!(scratch.try_bytes(text.as_bytes()).is_ok(), "{name}");
    }
    // A file that could do without its compression, but does not.
    let hidden = mesh(r#"{"componentType":5126,"type":"VEC3","count":3}"#, "");
    assert!(scratch.try_bytes(document(&hidden).as_bytes()).is_ok());
    let used = format!(r#""extensionsUsed":["KHR_draco_mesh_compression"],{hidden}"#);
    assert!(refused(&scratch, &used).contains("KHR_draco_mesh_compression"));
}

/// Things that strict readers stumble over and that are sound, or no business of ours.
#[test]
fn what_is_no_fault_is_read() {
    let (_turn, scratch) = (turn(), scratch());
    for members in [
        r#""scenes":[{"name":"empty"}]"#,
        r#""extras":5,"nodes":[{"extras":[1,2],"name":null}]"#,
        r#""textures":[{"extensions":{"EXT_texture_webp":{"source":0}}}]"#,
        r#""nodes":[{}],"animations":[{"samplers":[],"channels":[{"sampler":0,"target":{"path":"pointer"}}]}]"#,
        r#""materials":[{"alphaMode":"DITHERED"}],"images":5"#,
    ] {
        assert!(scratch.try_bytes(document(members).as_bytes()).is_ok(), "{members}");
    }
    let text = format!("\u{feff}\n {}", document(r#""nodes":[{}]"#));
    assert_eq!(scratch.try_bytes(text.as_bytes()).expect("a mark of byte order"), 1);
}

#[test]
fn nodes_that_cannot_be_a_tree_are_refused() {
    let (_turn, scratch) = (turn(), scratch());
    for (members, expected) in [
        (r#""nodes":[{"children":[0]}]"#, "contains itself"),
        (r#""nodes":[{"children":[1]},{"children":[0]}],"scenes":[{"nodes":[]}]"#, "contains itself"),
        (r#""nodes":[{"children":[2]},{"children":[2]},{}]"#, "stands under node 0 already"),
        (r#""nodes":[{"children":[1,1]},{}]"#, "already"),
        (r#""nodes":[{"children":[7]}]"#, "no node 7"),
        (r#""nodes":[{"children":[1]},{}],"scenes":[{"nodes":[1]}]"#, "no root"),
        (r#""nodes":[{}],"scenes":[{"nodes":[0,0]}]"#, "twice"),
        (r#""nodes":[{}],"scenes":[{"nodes":[4294967296]}]"#, "no node 4294967296"),
        (r#""scene":3,"scenes":[{}]"#, "no scene 3"),
        (r#""nodes":[{"mesh":1}]"#, "no mesh 1"),
        (r#""nodes":[{"mesh":0,"skin":1}],"meshes":[{}]"#, "no skin 1"),
        (r#""nodes":[{}],"skins":[{"joints":[1]}]"#, "no node 1 for a joint"),
    ] {
        let error = refused(&scratch, members);
        assert!(error.contains(expected), "{members}: {error}");
    }
    let chain = |levels: usize| {
        let nodes: Vec<String> = (1..levels).map(|child| format!(r#"{{"children":[{child}]}}"#)).collect();
        document(&format!(r#""nodes":[{},{{}}]"#, nodes.join(",")))
    };
    assert_eq!(scratch.try_bytes(chain(1000).as_bytes()).expect("deep but sound"), 1000);
    assert!(scratch.error(chain(200_000)).contains("1000 levels"));
}

#[test]
fn arrays_beyond_their_buffer_are_refused_before_they_are_believed() {
    let (_turn, scratch) = (turn(), scratch());
    for count in [21, 1 << 20, 1 << 40, u64::MAX / 12, u64::MAX] {
        let error = refused(&scratch, &mesh(&accessor(5126, "VEC3", count), ""));
        assert!(error.contains("do not fit") || error.contains("too many"), "{error}");
        // Without a buffer they are zeros, of which a small file may have some.
        let zeros = mesh(&format!(r#"{{"componentType":5126,"type":"VEC3","count":{count}}}"#), "");
        assert!(count < 1 << 30 || refused(&scratch, &zeros).contains("too many"), "{count}");
    }
    let with_view = |view: &str| {
        mesh(&accessor(5126, "VEC3", 3), "").replace(&format!(r#""buffer":0,"byteLength":{BYTES}"#), view)
    };
    for (view, expected) in [
        (r#""buffer":0,"byteLength":241"#, "the buffer ends at 240"),
        (r#""buffer":0,"byteLength":40,"byteOffset":18446744073709551600"#, "the buffer ends at 240"),
        (r#""buffer":0,"byteLength":240,"byteStride":4"#, "4 bytes apart"),
        (r#""buffer":0,"byteLength":240,"byteStride":18446744073709551600"#, "do not fit"),
        (r#""buffer":9,"byteLength":240"#, "no buffer 9"),
    ] {
        let error = refused(&scratch, &with_view(view));
        assert!(error.contains(expected) && error.contains("accessors[0]"), "{error}");
    }
    assert!(refused(&scratch, &mesh("", "")).contains("no accessor 0"));
    assert!(refused(&scratch, &mesh(&accessor(5130, "VEC3", 3), "")).contains("component type 5130"));
    assert!(refused(&scratch, &mesh(&accessor(5126, "VEC2", 3), "")).contains("type Vec3"));
    assert!(refused(&scratch, &mesh(&accessor(5126, "VEC9", 3), "")).contains("VEC9"));
    let short = document("\"nodes\":[]").replace(r#""byteLength":240"#, r#""byteLength":241"#);
    assert!(scratch.error(short).contains("should have 241 bytes and has 240"));
}

#[test]
fn vertices_and_joints_that_are_not_there_are_refused() {
    let (_turn, scratch) = (turn(), scratch());
    // The bytes of the buffer are 0, 1, 2 and so on: as indices they exceed three vertices.
    let positions = accessor(5121, "VEC3", 3);
    let indices = format!("{positions},{}", accessor(5121, "SCALAR", 6));
    let error = refused(&scratch, &mesh(&indices, r#","indices":1"#));
    assert!(error.contains("name vertex 3, but there are 3") && error.contains("primitives[0]"), "{error}");
    assert!(refused(&scratch, &mesh(&accessor(5121, "VEC3", 4), "")).contains("4 corners make no triangles"));
    assert!(refused(&scratch, &mesh(&positions, r#","mode":7"#)).contains("no mode 7"));
    let target = format!("{positions},{}", accessor(5121, "VEC3", 2));
    assert!(refused(&scratch, &mesh(&target, r#","targets":[{"POSITION":1}]"#)).contains("has 2 elements"));
    let four = |component| accessor(component, "VEC4", 3);
    let skinned = format!("{positions},{},{}", four(5121), four(5121));
    let skinned = mesh(&skinned, "").replace(r#""POSITION":0"#, r#""POSITION":0,"JOINTS_0":1,"WEIGHTS_0":2"#);
    let skinned = skinned.replace(r#"{"mesh":0}"#, r#"{"mesh":0,"skin":0},{},{}"#);
    let error = refused(&scratch, &format!(r#"{skinned},"skins":[{{"joints":[1,2]}}]"#));
    assert!(error.contains("hangs on joint 11, but the skin has 2"), "{error}");
    let alone = skinned.replace(r#","WEIGHTS_0":2"#, "");
    assert!(refused(&scratch, &format!(r#"{alone},"skins":[{{"joints":[1]}}]"#)).contains("no WEIGHTS_0"));
    let sparse = r#"{"componentType":5121,"type":"VEC3","count":3,"sparse":{"count":4,"indices":{"bufferView":0,"componentType":5121},"values":{"bufferView":0}}}"#;
    assert!(refused(&scratch, &mesh(sparse, "")).contains("names element 3; there are 3"));
    let sparse = sparse.replace(r#""count":4"#, r#""count":18446744073709551615"#);
    assert!(refused(&scratch, &mesh(&sparse, "")).contains("do not fit"));
}

#[test]
fn tracks_that_make_no_sense_are_refused() {
    let (_turn, scratch) = (turn(), scratch());
    let clip = |times: [f32; 3], sampler: &str, channel: &str, output: &str| {
        let bytes: String =
            times.iter().flat_map(|time| time.to_le_bytes()).map(|b| format!("%{b:02x}")).collect();
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":12,"uri":"data:,{bytes}"}}],"bufferViews":[{{"buffer":0,"byteLength":12}}],"accessors":[{{"bufferView":0,"componentType":5126,"type":"SCALAR","count":3}},{output}],"nodes":[{{}}],"animations":[{{"samplers":[{{"input":0,"output":1{sampler}}}],"channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}{channel}}}]}}]}}"#
        )
    };
    let zeros = r#"{"componentType":5126,"type":"VEC3","count":3}"#;
    let good = clip([0.0, 1.0, 2.0], "", "", zeros);
    assert_eq!(scratch.try_bytes(good.as_bytes()).expect("a sound clip"), 1);
    assert!(scratch.error(clip([0.0, 2.0, 1.0], "", "", zeros)).contains("go back from 2 s to 1 s"));
    for odd in [f32::NAN, f32::INFINITY] {
        assert!(scratch.error(clip([0.0, odd, 1.0], "", "", zeros)).contains("at the time"));
    }
    let cubic = clip([0.0, 1.0, 2.0], r#","interpolation":"CUBICSPLINE""#, "", zeros);
    assert!(scratch.error(cubic).contains("should have 27 values and have 9"));
    let other = clip([0.0, 1.0, 2.0], r#","interpolation":"CATMULL""#, "", zeros);
    assert!(scratch.error(other).contains("no interpolation \"CATMULL\""));
    assert!(scratch.error(good.replace(r#""sampler":0"#, r#""sampler":5"#)).contains("no sampler 5"));
    assert!(scratch.error(good.replace(r#""node":0"#, r#""node":5"#)).contains("no node 5"));
}

#[test]
fn a_nan_is_given_as_it_is() {
    let (_turn, scratch) = (turn(), scratch());
    let nan: String = f32::NAN.to_le_bytes().iter().map(|byte| format!("%{byte:02x}")).collect();
    let text = document(&mesh(&accessor(5126, "VEC3", 3), "")).replace("%00%01%02%03", &nan);
    assert_eq!(scratch.try_bytes(text.as_bytes()).expect("odd but sound"), 1);
    let mut mesh = Mesh::default();
    Gltf::open(scratch.path()).expect("odd but sound").mesh(0, 0.0, &mut mesh).expect("odd but sound");
    assert!(mesh.positions[0][0].is_nan() && mesh.positions[1][0].is_finite());
}

#[test]
fn buffers_elsewhere_are_refused() {
    let (_turn, scratch) = (turn(), scratch());
    for uri in ["http://example.org/a.bin", "file:///etc/passwd", "/etc/passwd", "../a.bin", "none.bin", "."]
    {
        let text = format!(r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":1,"uri":"{uri}"}}]}}"#);
        let error = scratch.error(text);
        assert!(error.contains("buffers[0]") && error.contains("beside the glTF file"), "{error}");
    }
}

#[test]
fn parts_that_are_shared_do_not_multiply_for_ever() {
    let (_turn, scratch) = (turn(), scratch());
    let bytes = 600_000;
    std::fs::write(scratch.folder.path().join("big.bin"), vec![0; bytes]).expect("a file");
    let big = |members: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{bytes},"uri":"big.bin"}}],"bufferViews":[{{"buffer":0,"byteLength":{bytes}}}],{members}}}"#
        )
    };
    // A thousand primitives, each with vertices of its own in the same bytes.
    let accessors = vec![accessor(5121, "VEC3", 200_000); 1000].join(",");
    let primitives: Vec<String> =
        (0..1000).map(|index| format!(r#"{{"attributes":{{"POSITION":{index}}},"mode":0}}"#)).collect();
    let error = scratch.error(big(&format!(
        r#""accessors":[{accessors}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{}]}}]"#,
        primitives.join(",")
    )));
    assert!(error.contains("too many for the file's size"), "{error}");
    // The same vertices are shared and cost nothing; their faces do.
    let primitives = vec![r#"{"attributes":{"POSITION":0},"mode":5}"#; 1000].join(",");
    let error = scratch.error(big(&format!(
        r#""accessors":[{accessors}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{primitives}]}}]"#
    )));
    assert!(error.contains("too many for the file's size"), "{error}");
    // Many sets of joints, and many morph targets.
    let joints: String = (0..1000).map(|set| format!(r#","JOINTS_{set}":1,"WEIGHTS_{set}":1"#)).collect();
    let two = format!("{},{}", accessor(5121, "VEC3", 150_000), accessor(5121, "VEC4", 150_000));
    let error = scratch.error(big(&format!(
        r#""accessors":[{two}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0{joints}}}}}]}}]"#
    )));
    assert!(error.contains("too many for the file's size"), "{error}");
    let targets = vec![r#"{"POSITION":0}"#; 20_000].join(",");
    let error = scratch.error(big(&format!(
        r#""accessors":[{two}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"targets":[{targets}]}}]}}]"#
    )));
    assert!(error.contains("too many for the file's size"), "{error}");
    // Keys of many clips in the same bytes.
    let accessors = vec![accessor(5126, "SCALAR", 150_000); 1000].join(",");
    let clips: Vec<String> =
        (0..1000).map(|index| format!(r#"{{"samplers":[{{"input":{index},"output":0}}]}}"#)).collect();
    let error =
        scratch.error(big(&format!(r#""accessors":[{accessors}],"animations":[{}]"#, clips.join(","))));
    assert!(error.contains("too much for the file's size"), "{error}");
    // A long name above many nodes.
    let children: Vec<String> = (1..=20_000).map(|child| child.to_string()).collect();
    let error = scratch.error(big(&format!(
        r#""nodes":[{{"name":"{}","children":[{}]}}{}]"#,
        "n".repeat(1 << 20),
        children.join(","),
        ",{}".repeat(20_000)
    )));
    assert!(error.contains("too much for the file's size"), "{error}");
    // Many empty nodes are as big as they are.
    let nodes = vec!["{}"; 100_000].join(",");
    let text = format!(r#"{{"asset":{{"version":"2.0"}},"nodes":[{nodes}]}}"#);
    assert_eq!(scratch.try_bytes(text.as_bytes()).expect("large but sound"), 100_000);
}

/// A mesh cache: a morph target for every frame.
#[test]
fn a_long_animation_is_read_in_bounded_memory() {
    let (_turn, scratch) = (turn(), scratch());
    let (vertices, frames) = (30_000, 400);
    let size = 12 * vertices;
    let name = scratch.folder.path().join("frames.bin");
    let file = std::fs::File::create(name).expect("a file");
    let mut file = std::io::BufWriter::new(file);
    for frame in 0..frames {
        let all = (frame as f32).to_le_bytes().repeat(3 * vertices);
        std::io::Write::write_all(&mut file, &all).expect("a file");
    }
    for time in 0..frames {
        std::io::Write::write_all(&mut file, &(time as f32).to_le_bytes()).expect("a file");
    }
    for index in 0..frames * frames {
        let weight: f32 = if index / frames == index % frames { 1.0 } else { 0.0 };
        std::io::Write::write_all(&mut file, &weight.to_le_bytes()).expect("a file");
    }
    std::io::Write::flush(&mut file).expect("a file");
    let end = size * frames;
    let total = end + 4 * frames + 4 * frames * frames;
    let accessors: Vec<String> = (0..frames)
        .map(|frame| {
            format!(
                r#"{{"bufferView":0,"byteOffset":{},"componentType":5126,"type":"VEC3","count":{vertices}}}"#,
                frame * size
            )
        })
        .collect();
    let targets: Vec<String> = (0..frames).map(|frame| format!(r#"{{"POSITION":{frame}}}"#)).collect();
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{total},"uri":"frames.bin"}}],"bufferViews":[{{"buffer":0,"byteLength":{end}}},{{"buffer":0,"byteOffset":{end},"byteLength":{}}}],"accessors":[{},{{"bufferView":1,"componentType":5126,"type":"SCALAR","count":{frames}}},{{"bufferView":1,"byteOffset":{},"componentType":5126,"type":"SCALAR","count":{}}}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"mode":0,"targets":[{}]}}]}}],"animations":[{{"samplers":[{{"input":{frames},"output":{}}}],"channels":[{{"sampler":0,"target":{{"node":0,"path":"weights"}}}}]}}]}}"#,
        4 * frames + 4 * frames * frames,
        accessors.join(","),
        4 * frames,
        frames * frames,
        targets.join(","),
        frames + 1
    );
    std::fs::write(scratch.path(), text).expect("a file");
    let read = || {
        let animation = Gltf::open(scratch.path()).expect("long but sound");
        let mut mesh = Mesh::default();
        for half in 0..2 * frames - 1 {
            animation.mesh(0, half as f64 / 2.0, &mut mesh).expect("a sound mesh");
            assert_eq!(mesh.positions[vertices - 1][2], half as f32 / 2.0);
        }
    };
    let ((), most) = most_held(read);
    println!("{most} bytes for a file of {total}");
    assert!(most < 75 << 20, "{most} bytes for a file of {total}");
}

#[test]
fn a_truncated_file_is_refused() {
    let (_turn, scratch) = (turn(), scratch());
    let whole = fixture("skin.glb");
    for length in (1..whole.len()).step_by(7) {
        assert!(scratch.try_bytes(&whole[..length]).is_err(), "{length} of {} bytes", whole.len());
    }
    let error = scratch.error(&whole[..whole.len() - 1]);
    assert!(error.contains("should be") && error.contains("byte 8"), "{error}");
    let text = fixture("quantised.gltf");
    let beside = scratch.folder.path().join("quantised data.bin");
    std::fs::write(&beside, &fixture("quantised data.bin")[..500]).expect("a file");
    assert!(scratch.error(&text).contains("should have 576 bytes and has 500"));
}

#[test]
fn a_file_cut_while_it_is_open_is_an_error() {
    let (_turn, scratch) = (turn(), scratch());
    let bytes = fixture("skin.glb");
    std::fs::write(scratch.path(), &bytes).expect("a file");
    let animation = Gltf::open(scratch.path()).expect("a sound file");
    let body = animation.objects().iter().position(|o| o.kind == ObjectKind::Mesh).expect("a body");
    std::fs::write(scratch.path(), &bytes[..100]).expect("a file");
    let error = animation.mesh(body, 0.0, &mut Mesh::default()).expect_err("its end is gone").to_string();
    assert!(error.contains("accessors[") && error.contains("cut short"), "{error}");
}

#[test]
fn flipped_bytes_all_over_the_file_end_well() {
    let (_turn, scratch) = (turn(), scratch());
    for name in FIXTURES {
        let whole = fixture(name);
        let mut refused = 0;
        for index in (0..whole.len()).step_by(5) {
            let mut bytes = whole.clone();
            bytes[index] ^= if index % 2 == 0 { 0xff } else { 1 << (index / 2 % 8) };
            refused += usize::from(scratch.try_bytes(&bytes).is_err());
        }
        assert!(refused > whole.len() / 100, "only {refused} of {} were found", whole.len());
    }
}

/// Where the numbers of the JSON are.
fn numbers(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let mut found: Vec<std::ops::Range<usize>> = Vec::new();
    let end = bytes.iter().rposition(|&byte| byte == b'}').expect("an object");
    for (index, byte) in bytes[..end].iter().enumerate() {
        if !byte.is_ascii_digit() {
            continue;
        }
        match found.last_mut() {
            Some(last) if last.end == index => last.end = index + 1,
            _ if index > 0 && b":,[".contains(&bytes[index - 1]) => found.push(index..index + 1),
            _ => {}
        }
    }
    found
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_overwriting_ends_well(bytes in overwritten(&FIXTURES, fixture)) {
        let _turn = turn();
        let _ = scratch().try_bytes(&bytes);
    }

    #[test]
    fn any_other_number_ends_well(
        name in prop::sample::select(&FIXTURES[..]),
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop_oneof![
            Just("0".to_owned()), Just("18446744073709551615".to_owned()), Just("4294967296".to_owned()),
            Just("-1".to_owned()), Just("1e308".to_owned()), Just("9223372036854775807".to_owned()),
            (0_u64..40).prop_map(|small| small.to_string()), (0_u64..70_000).prop_map(|n| n.to_string()),
            (5119_u64..5128).prop_map(|code| code.to_string()),
        ]), 1..4),
    ) {
        let _turn = turn();
        let mut bytes = fixture(name);
        for (place, value) in changes {
            let all = numbers(&bytes);
            bytes.splice(all[place.index(all.len())].clone(), value.bytes());
        }
        if bytes.starts_with(b"glTF") {
            // The chunk of the JSON ends where its last brace does; what follows begins a chunk.
            let start = bytes.windows(4).position(|four| four == b"BIN\0").expect("a chunk") - 4;
            let length = bytes.len() as u32;
            bytes[8..12].copy_from_slice(&length.to_le_bytes());
            bytes[12..16].copy_from_slice(&(start as u32 - 20).to_le_bytes());
        }
        let _ = scratch().try_bytes(&bytes);
    }

    #[test]
    fn any_cut_and_any_repetition_ends_well(
        name in prop::sample::select(&FIXTURES[..]),
        from in any::<prop::sample::Index>(),
        to in any::<prop::sample::Index>(),
    ) {
        let _turn = turn();
        let whole = fixture(name);
        let (from, to) = (from.index(whole.len()), to.index(whole.len()));
        let _ = scratch().try_bytes(&[&whole[..from], &whole[to..]].concat());
    }
}
