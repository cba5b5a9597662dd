//! Files that are cut short, flipped, absurd or malicious: always an error or a reading, never a
//! panic, a hang, or memory beyond a small multiple of the file.

mod damage;

use std::path::Path;

use damage::{Scratch, most_held, overwritten, read_all, renumbered, turn};
use froufrou::scene::alembic::Alembic;
use froufrou::scene::animation::{Animation, Mesh};
use froufrou::{Error, Place};
use proptest::prelude::*;

fn fixture(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/alembic");
    std::fs::read(folder.join(name).with_extension("abc")).expect("a fixture")
}

/// Opens the bytes as a file and reads everything, cameras' lenses as well.
fn read(path: &Path) -> Result<usize, Error> {
    let animation = Alembic::open(path)?;
    for index in 0..animation.objects().len() {
        animation.lens(index, 0.013)?;
    }
    read_all(&animation)
}

fn scratch() -> Scratch {
    Scratch::new("damaged.abc", read)
}

#[test]
fn other_kinds_of_file_are_named() {
    let (_turn, scratch) = (turn(), scratch());
    assert!(scratch.error(b"\x89HDF\r\n\x1a\n and more").contains("abcconvert"));
    assert!(scratch.error(b"").contains("empty"));
    assert!(scratch.error(b"Oga").contains("not an Alembic archive"));
    assert!(scratch.error(b"# a Wavefront file\nv 0 0 0\n").contains("not an Alembic archive"));
    assert!(scratch.error(b"Ogawa\xff").contains("ends within its first 16 bytes"));
    assert!(Alembic::open(scratch.folder.path()).is_err());
    let missing = Alembic::open(scratch.folder.path().join("none.abc")).expect_err("nothing there");
    assert!(missing.to_string().contains("none.abc"), "{missing}");
}

#[test]
fn an_archive_whose_writer_crashed_is_named() {
    let (_turn, scratch) = (turn(), scratch());
    let mut bytes = fixture("nesting");
    bytes[5] = 0;
    let error = scratch.error(&bytes);
    assert!(error.contains("never finished") && error.contains("byte 5"), "{error}");
    bytes[5] = 0xff;
    bytes[7] = 2;
    assert!(scratch.error(&bytes).contains("version 2"));
}

#[test]
fn a_truncated_file_says_where_it_ends() {
    let (_turn, scratch) = (turn(), scratch());
    let whole = fixture("cameras");
    for length in (1..whole.len()).step_by(7) {
        // The last bytes may belong to something that is not read; half of it never does.
        let result = scratch.try_bytes(&whole[..length]);
        assert!(length > whole.len() / 2 || result.is_err(), "{length} of {} bytes", whole.len());
    }
    let error = scratch.error(&whole[..whole.len() / 2]);
    assert!(error.contains("cut short") && error.contains("byte"), "{error}");
}

#[test]
fn flipped_bytes_all_over_the_file_end_well() {
    let (_turn, scratch) = (turn(), scratch());
    for name in ["instances", "edges"] {
        let whole = fixture(name);
        let mut refused = 0;
        for index in (0..whole.len()).step_by(3) {
            let mut bytes = whole.clone();
            bytes[index] ^= if index % 2 == 0 { 0xff } else { 1 << (index / 2 % 8) };
            refused += usize::from(scratch.try_bytes(&bytes).is_err());
        }
        assert!(refused > whole.len() / 60, "only {refused} of {} were found", whole.len());
    }
}

const FIXTURES: [&str; 9] = [
    "operations",
    "many_operations",
    "nesting",
    "topologies",
    "samplings",
    "instances",
    "repeats",
    "cameras",
    "edges",
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_overwriting_ends_well(bytes in overwritten(&FIXTURES, fixture)) {
        let _turn = turn();
        let _ = scratch().try_bytes(&bytes);
    }

    #[test]
    fn any_number_overwritten_ends_well(bytes in renumbered(&FIXTURES, fixture, 1)) {
        let _turn = turn();
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
        let bytes = [&whole[..from], &whole[to..]].concat();
        let _ = scratch().try_bytes(&bytes);
    }
}

/// Assembles archives that no program would write.
struct Writer {
    bytes: Vec<u8>,
}

const BLOCK: u64 = 1 << 63;

impl Writer {
    fn new() -> Self {
        Self { bytes: b"Ogawa\xff\0\x01\0\0\0\0\0\0\0\0".to_vec() }
    }

    fn group(&mut self, children: &[u64]) -> u64 {
        let position = self.bytes.len() as u64;
        self.bytes.extend((children.len() as u64).to_le_bytes());
        self.bytes.extend(children.iter().flat_map(|child| child.to_le_bytes()));
        position
    }

    fn block(&mut self, bytes: &[u8]) -> u64 {
        let position = self.bytes.len() as u64;
        self.bytes.extend((bytes.len() as u64).to_le_bytes());
        self.bytes.extend(bytes);
        position | BLOCK
    }

    /// An object with its children's names, metadata and groups.
    fn object(&mut self, properties: u64, children: &[(&str, &str, u64)]) -> u64 {
        let mut headers = Vec::new();
        for (name, metadata, _) in children {
            headers.extend((name.len() as u32).to_le_bytes());
            headers.extend(name.bytes());
            headers.push(0xff);
            headers.extend((metadata.len() as u32).to_le_bytes());
            headers.extend(metadata.bytes());
        }
        headers.extend([0; 32]);
        let headers = self.block(&headers);
        let groups: Vec<u64> =
            [properties].into_iter().chain(children.iter().map(|child| child.2)).chain([headers]).collect();
        self.group(&groups)
    }

    /// A mesh of points without faces; per sample the bytes of its points, whose type is 10 for 32
    /// and 11 for 64 bits of floating point.
    fn mesh(&mut self, pod: u32, samples: &[Vec<u8>]) -> u64 {
        let mut blocks = Vec::new();
        for sample in samples {
            blocks.extend([self.block(&[&[0; 16][..], sample].concat()), BLOCK]);
        }
        let property = self.group(&blocks);
        // Array, integers of four bytes, three values; one sample is like all others.
        let alike = if samples.len() == 1 { 0x800 } else { 0 };
        let info: u32 = 2 | 2 << 2 | pod << 4 | alike | 3 << 12;
        let (count, name_size) = (samples.len() as u32, 1_u32);
        let header = self
            .block(&[&info.to_le_bytes()[..], &count.to_le_bytes(), &name_size.to_le_bytes(), b"P"].concat());
        let geometry = self.group(&[property, header]);
        let header = self.block(&[&0_u32.to_le_bytes()[..], &[5], b".geom"].concat());
        let properties = self.group(&[geometry, header]);
        self.object(properties, &[])
    }

    /// An object that is an instance of another.
    fn instance(&mut self, source: &str) -> u64 {
        let sample = self.block(&[&[0; 16], source.as_bytes(), &[0]].concat());
        let property = self.group(&[sample]);
        // Scalar, integers of one byte, string, all alike, one value, one sample.
        let info: u32 = 1 | 12 << 4 | 0x800 | 1 << 12;
        let name = b".instanceSource";
        let header = self.block(&[&info.to_le_bytes()[..], &[1, name.len() as u8], name].concat());
        let properties = self.group(&[property, header]);
        self.object(properties, &[])
    }

    fn finish(mut self, top: u64) -> Vec<u8> {
        let version = self.block(&0_i32.to_le_bytes());
        let library = self.block(&10_800_i32.to_le_bytes());
        let times = self.block(
            &[&1_u32.to_le_bytes()[..], &1_f64.to_le_bytes(), &1_u32.to_le_bytes(), &0_f64.to_le_bytes()]
                .concat(),
        );
        let root = self.group(&[version, library, top, BLOCK, times, BLOCK]);
        self.bytes[8..16].copy_from_slice(&root.to_le_bytes());
        self.bytes
    }
}

#[test]
fn an_assembled_archive_is_sound() {
    let (_turn, scratch) = (turn(), scratch());
    let mut writer = Writer::new();
    let leaf = writer.object(0, &[]);
    let branch = writer.object(0, &[("leaf", "", leaf)]);
    let copy = writer.instance("/branch");
    let top = writer.object(0, &[("branch", "", branch), ("copy", "isInstance=1", copy)]);
    assert_eq!(scratch.try_bytes(&writer.finish(top)).expect("a sound archive"), 4);
    let animation = Alembic::open(scratch.path()).expect("a sound archive");
    let paths: Vec<&str> = animation.objects().iter().map(|object| object.path.as_str()).collect();
    assert_eq!(paths, ["/branch", "/branch/leaf", "/copy", "/copy/leaf"]);
}

#[test]
fn an_object_that_contains_itself_is_refused() {
    let (_turn, scratch) = (turn(), scratch());
    let mut writer = Writer::new();
    // The group will begin after its headers: 8 bytes of size and 4 + 4 + 1 + 4 + 32 of content.
    let own_position = writer.bytes.len() as u64 + 8 + 45;
    let own = writer.object(0, &[("self", "", own_position)]);
    assert_eq!(own, own_position);
    let error = scratch.error(writer.finish(own));
    assert!(error.contains("contains itself") && error.contains("/self/self/self"), "{error}");
}

#[test]
fn many_levels_do_not_exhaust_the_stack() {
    let (_turn, scratch) = (turn(), scratch());
    let deep = |levels: usize| {
        let mut writer = Writer::new();
        let mut group = 0;
        for _ in 0..levels {
            group = writer.object(0, &[("o", "", group)]);
        }
        writer.finish(group)
    };
    assert_eq!(scratch.try_bytes(&deep(990)).expect("deep but sound"), 990);
    assert!(scratch.error(deep(200_000)).contains("1000 levels"));
}

#[test]
fn children_that_are_shared_do_not_multiply_for_ever() {
    let (_turn, scratch) = (turn(), scratch());
    let mut writer = Writer::new();
    let mut group = 0;
    for _ in 0..50 {
        group = writer.object(0, &[("a", "", group), ("b", "", group)]);
    }
    assert!(scratch.error(writer.finish(group)).contains("too much for the file's size"));
    // One long list of children that many objects share: quadratic work.
    let mut writer = Writer::new();
    let children: Vec<(String, u64)> = (0..20_000).map(|i| (format!("{i}"), 0)).collect();
    let children: Vec<(&str, &str, u64)> =
        children.iter().map(|(name, group)| (name.as_str(), "", *group)).collect();
    let long = writer.object(0, &children);
    let sharing: Vec<(&str, &str, u64)> = children.iter().map(|(name, ..)| (*name, "", long)).collect();
    let top = writer.object(0, &sharing);
    assert!(scratch.error(writer.finish(top)).contains("too much for the file's size"));
}

/// Each mesh would keep its last samples; together they are limited.
#[test]
fn meshes_that_share_their_points_do_not_fill_memory() {
    let (_turn, scratch) = (turn(), scratch());
    let mut writer = Writer::new();
    let mesh = writer.mesh(10, &[vec![0; 12 * 100_000]]);
    let names: Vec<String> = (0..500).map(|i| format!("{i}")).collect();
    let meshes: Vec<(&str, &str, u64)> =
        names.iter().map(|name| (name.as_str(), "schema=AbcGeom_PolyMesh_v1", mesh)).collect();
    let top = writer.object(0, &meshes);
    assert_eq!(scratch.try_bytes(&writer.finish(top)).expect("large but sound"), 500);
    let animation = Alembic::open(scratch.path()).expect("large but sound");
    assert_eq!(animation.mesh_size(499).expect("an object").expect("a mesh").vertices, 100_000);
}

#[test]
fn a_long_animation_takes_the_memory_of_a_few_frames() {
    let (_turn, scratch) = (turn(), scratch());
    let mut writer = Writer::new();
    let frame = |index: usize| -> Vec<u8> {
        (0..3000).flat_map(|value| ((index * 3000 + value) as f32).to_le_bytes()).collect()
    };
    let frames: Vec<Vec<u8>> = (0..1000).map(frame).collect();
    let mesh = writer.mesh(10, &frames);
    let top = writer.object(0, &[("mesh", "schema=AbcGeom_PolyMesh_v1", mesh)]);
    std::fs::write(scratch.path(), writer.finish(top)).expect("a file");
    drop(frames);
    let ((), most) = most_held(|| {
        let animation = Alembic::open(scratch.path()).expect("long but sound");
        let mut mesh = Mesh::default();
        for half_frame in 0..1999 {
            animation.mesh(0, f64::from(half_frame) / 2.0, &mut mesh).expect("a sound sample");
            assert_eq!(mesh.positions[0][0], half_frame as f32 * 1500.0);
        }
    });
    assert!(most < 12 * 12_000, "{most} bytes for frames of 12000");
}

#[test]
fn a_nan_is_given_as_it_is() {
    let (_turn, scratch) = (turn(), scratch());
    let single = [1.5_f32, f32::NAN, -2.0].map(f32::to_le_bytes).concat();
    let double = [1.5_f64, f64::NAN, -2.0].map(f64::to_le_bytes).concat();
    for (pod, bytes) in [(10, single), (11, double)] {
        let mut writer = Writer::new();
        let mesh = writer.mesh(pod, &[bytes]);
        let top = writer.object(0, &[("mesh", "schema=AbcGeom_PolyMesh_v1", mesh)]);
        scratch.try_bytes(&writer.finish(top)).expect("odd but sound");
        let animation = Alembic::open(scratch.path()).expect("odd but sound");
        let mut mesh = Mesh::default();
        animation.mesh(0, 0.0, &mut mesh).expect("odd but sound");
        // A transform mixes the coordinates of its point, and no others.
        assert!(mesh.positions.len() == 1 && mesh.positions[0][1].is_nan(), "{mesh:?}");
    }
}

#[test]
fn a_file_cut_while_it_is_open_is_an_error() {
    let (_turn, scratch) = (turn(), scratch());
    let bytes = fixture("topologies");
    std::fs::write(scratch.path(), &bytes).expect("a file");
    let animation = Alembic::open(scratch.path()).expect("a sound archive");
    std::fs::write(scratch.path(), &bytes[..100]).expect("a file");
    let error = animation.mesh(0, 0.0, &mut Mesh::default()).expect_err("its end is gone").to_string();
    assert!(error.contains("/constant") && error.contains("the file ends before"), "{error}");
}

#[test]
fn long_names_do_not_multiply_for_ever() {
    let (_turn, scratch) = (turn(), scratch());
    let mut writer = Writer::new();
    let name = "n".repeat(1 << 20);
    let children: Vec<String> = (0..2000).map(|i| i.to_string()).collect();
    let children: Vec<(&str, &str, u64)> = children.iter().map(|name| (name.as_str(), "", 0)).collect();
    let many = writer.object(0, &children);
    let top = writer.object(0, &[(name.as_str(), "", many)]);
    assert!(scratch.error(writer.finish(top)).contains("too much for the file's size"));
}

#[test]
fn instances_of_nothing_of_themselves_and_of_too_much_are_refused() {
    let (_turn, scratch) = (turn(), scratch());
    for (name, source) in [("a", "/b"), ("a", "/a"), ("a", "/a/a"), ("a", ""), ("a", "/")] {
        let mut writer = Writer::new();
        let instance = writer.instance(source);
        let top = writer.object(0, &[(name, "isInstance=1", instance)]);
        let error = scratch.error(writer.finish(top));
        assert!(error.contains("cannot be found") && error.contains("/a"), "{error}");
    }
    // An instance below its own original.
    let mut writer = Writer::new();
    let instance = writer.instance("/a");
    let original = writer.object(0, &[("again", "isInstance=1", instance)]);
    let top = writer.object(0, &[("a", "", original)]);
    assert!(scratch.error(writer.finish(top)).contains("contains itself"));
    // Each level holds ten instances of the level before: 10^20 objects.
    let mut writer = Writer::new();
    let mut levels = vec![("l0".to_owned(), writer.object(0, &[]))];
    for level in 1..=20 {
        let instance = writer.instance(&format!("/l{}", level - 1));
        let names: Vec<String> = (0..10).map(|i| format!("i{i}")).collect();
        let children: Vec<(&str, &str, u64)> =
            names.iter().map(|name| (name.as_str(), "isInstance=1", instance)).collect();
        levels.push((format!("l{level}"), writer.object(0, &children)));
    }
    let levels: Vec<(&str, &str, u64)> =
        levels.iter().map(|(name, group)| (name.as_str(), "", *group)).collect();
    let top = writer.object(0, &levels);
    assert!(scratch.error(writer.finish(top)).contains("too much for the file's size"));
}

#[test]
fn a_group_or_block_beyond_the_file_is_refused() {
    let (_turn, scratch) = (turn(), scratch());
    for position in [1, 15, 1 << 20, u64::MAX >> 1, BLOCK | 40, u64::MAX] {
        let mut writer = Writer::new();
        let top = writer.object(0, &[("a", "", position)]);
        let error = scratch.try_bytes(&writer.finish(top)).expect_err("no such place");
        assert!(matches!(error.place(), Some(Place::Part(part)) if part.contains("/a")), "{error}");
    }
}

#[test]
fn a_count_or_size_beyond_the_file_is_refused_before_it_is_believed() {
    let (_turn, scratch) = (turn(), scratch());
    for claim in [100_000_u64, 1 << 40, u64::MAX / 8, u64::MAX] {
        let mut writer = Writer::new();
        let child = writer.object(0, &[]);
        let top = writer.object(0, &[("a", "", child)]);
        let mut bytes = writer.finish(top);
        bytes[child as usize..child as usize + 8].copy_from_slice(&claim.to_le_bytes());
        let error = scratch.error(&bytes);
        assert!(error.contains(&format!("claims {claim} children")) && error.contains("/a"), "{error}");

        let mut writer = Writer::new();
        let mesh = writer.mesh(10, &[vec![0; 12]]);
        let top = writer.object(0, &[("mesh", "schema=AbcGeom_PolyMesh_v1", mesh)]);
        let mut bytes = writer.finish(top);
        // The first block is the sample of the points: its size comes right after the header.
        assert_eq!(bytes[16..24], 28_u64.to_le_bytes());
        bytes[16..24].copy_from_slice(&claim.to_le_bytes());
        let error = scratch.error(&bytes);
        assert!(error.contains(&format!("claims {claim} bytes")) && error.contains("/mesh"), "{error}");
    }
}
