//! Point caches and OBJ files that are cut short, flipped, absurd or malicious: always an error or a
//! reading, never a panic, a hang, or memory beyond a small multiple of the file.

mod damage;

use std::path::Path;

use damage::{Scratch, most_held, read_all, turn};
use froufrou::Error;
use froufrou::scene::animation::{KeyTimes, Mesh};
use froufrou::scene::world::open_animation;
use proptest::prelude::*;

const FIXTURES: [&str; 5] = ["cloth.pc2", "halves.pc2", "cloth.mdd", "two.obj", "frame_0001.obj"];

fn fixture(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/point_cache");
    std::fs::read(folder.join(name)).expect("a fixture")
}

/// Opens the bytes as a file and reads everything.
fn read(path: &Path) -> Result<usize, Error> {
    read_all(open_animation(path)?.as_ref())
}

/// A place to put what was a fixture, under a name that ends as it did.
fn scratch(name: &str) -> Scratch {
    let ending = name.rsplit('.').next().unwrap_or_default();
    let names = [("pc2", "damaged.pc2"), ("mdd", "damaged.mdd"), ("obj", "damaged.obj")];
    let name = names.into_iter().find(|(known, _)| *known == ending).expect("a known ending").1;
    Scratch::new(name, read)
}

fn pc2(version: i32, points: i32, start: f32, step: f32, samples: i32, numbers: usize) -> Vec<u8> {
    let mut bytes = b"POINTCACHE2\0".to_vec();
    bytes.extend([version.to_le_bytes(), points.to_le_bytes(), start.to_le_bytes()].concat());
    bytes.extend([step.to_le_bytes(), samples.to_le_bytes()].concat());
    bytes.extend((0..numbers).flat_map(|n| (n as f32).to_le_bytes()));
    bytes
}

fn mdd(frames: u32, points: u32, times_s: &[f32], numbers: usize) -> Vec<u8> {
    let mut bytes = [frames.to_be_bytes(), points.to_be_bytes()].concat();
    bytes.extend(times_s.iter().flat_map(|time| time.to_be_bytes()));
    bytes.extend((0..numbers).flat_map(|n| (n as f32).to_be_bytes()));
    bytes
}

#[test]
fn the_fixtures_are_sound() {
    let _turn = turn();
    for name in FIXTURES {
        let objects = if name == "two.obj" { 2 } else { 1 };
        assert_eq!(scratch(name).try_bytes(&fixture(name)).expect(name), objects);
    }
}

#[test]
fn a_cache_cut_anywhere_or_too_long_is_refused() {
    let _turn = turn();
    for name in ["cloth.pc2", "cloth.mdd"] {
        let (scratch, whole) = (scratch(name), fixture(name));
        for length in 0..whole.len() {
            let error = scratch.error(&whole[..length]);
            assert!(error.contains("damaged"), "{length}: {error}");
        }
        assert!(scratch.error([&whole[..], b"\0"].concat()).contains("vertices make a file of"));
    }
}

#[test]
fn counts_that_are_absurd_are_refused_before_they_are_believed() {
    let (_turn, scratch) = (turn(), scratch("a.pc2"));
    for (bytes, told) in [
        (pc2(2, 1, 0.0, 1.0, 1, 3), "version 2"),
        (pc2(1, -1, 0.0, 1.0, 1, 3), "-1 vertices"),
        (pc2(1, 1, 0.0, 1.0, -2, 3), "-2 samples"),
        (pc2(1, 1, 0.0, 1.0, 0, 0), "no samples"),
        (pc2(1, i32::MAX, 0.0, 1.0, i32::MAX, 3), "make a file of 55340232169589047340 bytes"),
        (pc2(1, 1, 0.0, 0.0, 2, 6), "a sample every 0 frames"),
        (pc2(1, 1, 0.0, -1.0, 2, 6), "a sample every -1 frames"),
        (pc2(1, 1, 0.0, f32::NAN, 2, 6), "a sample every NaN frames"),
        (pc2(1, 1, f32::INFINITY, 1.0, 2, 6), "from frame inf on"),
        (pc2(1, 1, 1e30, 1.0, 2, 6), "a sample every 1 frames"),
    ] {
        let error = scratch.error(&bytes);
        assert!(error.contains(told), "{told}: {error}");
    }
    let scratch = Scratch::new("damaged.mdd", read);
    for (bytes, told) in [
        (mdd(0, 0, &[], 0), "there are no frames"),
        (mdd(u32::MAX, u32::MAX, &[], 3), "make a file of"),
        (mdd(2, 1, &[0.0, -1.0], 6), "frame 1 is at -1 s, before the frame before it at 0 s"),
        (mdd(2, 1, &[0.0, f32::NAN], 6), "frame 1 is at NaN s"),
        (mdd(1, 1, &[f32::INFINITY], 3), "frame 0 is at inf s"),
    ] {
        let error = scratch.error(&bytes);
        assert!(error.contains(told), "{told}: {error}");
    }
    let error = Scratch::new("damaged.pc2", read).error(mdd(1, 1, &[0.0], 4));
    assert!(error.contains("signature"), "{error}");
}

#[test]
fn meshes_of_nothing_and_one_frame_are_read() {
    let (_turn, scratch) = (turn(), scratch("a.pc2"));
    // Two thousand million samples of no vertices take no bytes, and no time.
    for bytes in [pc2(1, 0, 0.0, 1.0, i32::MAX, 0), pc2(1, 2, f32::NAN, 0.0, 1, 6)] {
        assert_eq!(scratch.try_bytes(&bytes).expect("odd but sound"), 1);
        let animation = open_animation(scratch.path()).expect("odd but sound");
        assert_eq!(animation.objects()[0].key_times, KeyTimes::Static);
    }
    let scratch = Scratch::new("damaged.mdd", read);
    for bytes in [mdd(3, 0, &[0.0, 1.0, 5.0], 0), mdd(1, 1, &[7.0], 3)] {
        assert_eq!(scratch.try_bytes(&bytes).expect("odd but sound"), 1);
    }
}

#[test]
fn of_frames_at_one_time_the_last_counts() {
    let (_turn, scratch) = (turn(), scratch("a.mdd"));
    let first = |time_s: f64| {
        let animation = open_animation(scratch.path()).expect("a sound cache");
        let mut mesh = Mesh::default();
        animation.mesh(0, time_s, &mut mesh).expect("a sound sample");
        (animation.objects()[0].key_times.len(), mesh.positions[0][0])
    };
    scratch.try_bytes(&mdd(5, 1, &[0.0, 0.0, 1.0, 1.0, 3.0], 15)).expect("a sound cache");
    assert_eq!([first(0.0), first(0.5), first(1.0), first(2.0)], [(3, 3.0), (3, 6.0), (3, 9.0), (3, 10.5)]);
    scratch.try_bytes(&mdd(2, 1, &[4.0, 4.0], 6)).expect("a sound cache");
    assert_eq!(first(0.0), (0, 3.0));
}

#[test]
fn a_nan_is_given_as_it_is() {
    let (_turn, scratch) = (turn(), scratch("a.pc2"));
    let mut bytes = pc2(1, 2, 0.0, 1.0, 2, 12);
    bytes[36..40].copy_from_slice(&f32::NAN.to_le_bytes());
    scratch.try_bytes(&bytes).expect("odd but sound");
    let mut mesh = Mesh::default();
    open_animation(scratch.path()).expect("a cache").mesh(0, 0.5 / 24.0, &mut mesh).expect("a sample");
    assert!(mesh.positions[0][1].is_nan());
    assert_eq!((mesh.positions[0][0], mesh.positions[1]), (3.0, [6.0, 7.0, 8.0]));
}

#[test]
fn a_long_cache_takes_the_memory_of_a_few_frames() {
    let _turn = turn();
    let (frames, points) = (1000, 1000);
    let times_s: Vec<f32> = (0..frames).map(|frame| frame as f32).collect();
    for (name, bytes) in [
        ("damaged.pc2", pc2(1, points, 0.0, 24.0, frames, 3 * 1_000_000)),
        ("damaged.mdd", mdd(frames as u32, points as u32, &times_s, 3 * 1_000_000)),
    ] {
        let scratch = Scratch::new(name, read);
        std::fs::write(scratch.path(), bytes).expect("a file");
        let ((), most) = most_held(|| {
            let animation = open_animation(scratch.path()).expect("long but sound");
            let mut mesh = Mesh::default();
            for half_frame in 0..1999 {
                animation.mesh(0, f64::from(half_frame) / 2.0, &mut mesh).expect("a sound sample");
                assert_eq!(mesh.positions[0][0], half_frame as f32 * 1500.0);
            }
        });
        assert!(most < 12 * 12_000, "{most} bytes for frames of 12000");
    }
}

#[test]
fn a_long_sequence_takes_the_memory_of_a_few_files() {
    let _turn = turn();
    let room = tempfile::tempdir().expect("a folder");
    for frame in 1..=200 {
        let text: String = (0..2000).map(|v| format!("v {frame} {v} 0\n")).collect();
        std::fs::write(room.path().join(format!("f{frame}.obj")), text + "f 1 2 3\n").expect("a file");
    }
    let ((), most) = most_held(|| {
        let animation = open_animation(room.path().join("f*.obj")).expect("a sequence");
        let mut mesh = Mesh::default();
        for half_frame in 2..=400 {
            animation.mesh(0, f64::from(half_frame) / 48.0, &mut mesh).expect("a sound file");
            assert!((mesh.positions[0][0] - half_frame as f32 / 2.0).abs() < 1e-4);
        }
        // 24 kB a frame, read into lists that double, with a block of text; and 200 names.
    });
    assert!(most < 400_000, "{most} bytes");
}

#[test]
fn a_file_cut_while_it_is_open_is_an_error() {
    let (_turn, scratch) = (turn(), scratch("a.pc2"));
    std::fs::write(scratch.path(), fixture("cloth.pc2")).expect("a file");
    let animation = open_animation(scratch.path()).expect("a sound cache");
    std::fs::write(scratch.path(), b"short").expect("a file");
    let error = animation.mesh(0, 0.0, &mut Mesh::default()).expect_err("its end is gone").to_string();
    assert!(error.contains("byte 32") && error.contains("the file ends before"), "{error}");
}

#[test]
fn many_names_and_long_lines_are_no_trouble() {
    let (_turn, scratch) = (turn(), scratch("a.obj"));
    let names: String = (0..200_000).map(|n| format!("o {n}\n")).collect();
    assert_eq!(scratch.try_bytes(names.as_bytes()).expect("many but sound"), 200_000);
    // As many runs, that all share their vertices.
    let runs: String = (0..100_000).map(|n| format!("g {}\nf 1 2 3\n", n % 2)).collect();
    assert_eq!(scratch.try_bytes(format!("v 0 0 0\nv 0 0 0\nv 0 0 0\n{runs}").as_bytes()).expect("sound"), 2);
    assert!(scratch.error(vec![b'v'; 8 << 20]).contains("a line longer than"));
    assert!(scratch.error("v 0 0 0 \\\n".repeat(1 << 20).as_bytes()).contains("a line longer than"));
    assert!(scratch.error([0; 1000]).contains("binary data"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn any_bytes_overwritten_end_well(
        name in prop::sample::select(&FIXTURES[..]),
        places in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        // Half of the time near the beginning, where the counts are.
        early: bool,
    ) {
        let _turn = turn();
        let mut bytes = fixture(name);
        let length = if early { 64 } else { bytes.len() };
        for (place, value) in places {
            bytes[place.index(length)] = value;
        }
        let _ = scratch(name).try_bytes(&bytes);
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
        let _ = scratch(name).try_bytes(&bytes);
    }

    #[test]
    fn any_statements_end_well(
        text in "(?s)([vfog]( -?[0-9]{1,12}(/[0-9]?){0,2}| nan| \\\\\n){0,6}\r?\n|.){0,40}"
    ) {
        let _turn = turn();
        let _ = scratch("a.obj").try_bytes(text.as_bytes());
    }
}
