//! Pose logs that are cut short, flipped or absurd: always an error that names a line or a reading, never a panic or
//! memory beyond a small multiple of the file.

mod damage;

use std::io::Write;

use damage::{most_held, read_all, turn};
use froufrou::Error;
use froufrou::scene::world::open_animation;
use proptest::prelude::*;

fn log() -> Vec<u8> {
    let mut text = String::from("t,body,x,y,z,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz\n");
    for step in 0..6 {
        for body in ["ball", "\"the, other\""] {
            text += &format!("0.{step},{body},0.5,1.25,-2.75,0,0.6,0,0.8,1.5,0.25,-0.75,3,2,1\n");
        }
    }
    text.into_bytes()
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}

/// Reads the bytes as a log: how many bodies there are, or what is wrong in which file.
fn try_bytes(bytes: &[u8]) -> Result<usize, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("damaged.csv");
    std::fs::write(&path, bytes).expect("a file");
    let read = || -> Result<usize, Error> { read_all(open_animation(&path)?.as_ref()) };
    let (result, most) = most_held(read);
    assert!(most < (1 << 20) + 64 * bytes.len(), "{most} bytes for a file of {}", bytes.len());
    result.map_err(|error| {
        assert!(error.file().is_some() && error.place().is_some(), "{error}");
        error.to_string()
    })
}

#[test]
fn a_log_is_read_packed_or_not() {
    let _turn = turn();
    assert_eq!(try_bytes(&log()).expect("a log"), 2);
    assert_eq!(try_bytes(&packed(&log())).expect("a log"), 2);
}

#[test]
fn a_log_cut_anywhere_is_told_or_read_as_far_as_it_goes() {
    let _turn = turn();
    let whole = log();
    for length in 0..whole.len() {
        if let Err(error) = try_bytes(&whole[..length]) {
            assert!(error.contains("damaged.csv"), "{length}: {error}");
        }
    }
    // Of a packed log nothing is believed that was not closed.
    let whole = packed(&whole);
    for length in 1..whole.len() {
        assert!(try_bytes(&whole[..length]).is_err(), "{length}");
    }
}

#[test]
fn absurd_numbers_are_told_with_their_line() {
    let _turn = turn();
    for (from, to) in
        [("1.25", "1e31"), ("1.25", "NaN"), ("0.8", "-inf"), ("0.5,", "x,"), ("0,0.6,0,0.8", "0,0,0,0")]
    {
        let text = String::from_utf8(log()).expect("text").replacen(from, to, 1);
        let error = try_bytes(text.as_bytes()).expect_err("this cannot be read");
        assert!(error.contains("damaged.csv:2:"), "{from} {to}: {error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn flipped_bytes_do_no_harm(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), pack: bool) {
        let _turn = turn();
        let mut bytes = if pack { packed(&log()) } else { log() };
        for (index, byte) in flips {
            let place = index.index(bytes.len());
            bytes[place] = byte;
        }
        let _ = try_bytes(&bytes);
    }
}
