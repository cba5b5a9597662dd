//! SOFA files that are cut short, flipped or absurd: always an error or a reading, never a panic, a hang, or
//! memory beyond a small multiple of the file.

mod damage;

use std::path::Path;

use damage::{Bounds, Scratch, overwritten, renumbered, turn};
use froufrou::Error;
use froufrou::space::head::Measured;
use proptest::prelude::*;

fn fixture(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/head");
    std::fs::read(folder.join(name).with_extension("sofa")).expect("a fixture")
}

/// Opens the bytes as a set and asks it for some directions; how many it has.
fn read(path: &Path) -> Result<usize, Error> {
    let set = Measured::open(path)?;
    let head = set.head(48_000.0);
    let mut taps = [vec![0.0; head.taps()], vec![0.0; head.taps()]];
    for from_m in [[1.0, 0.2, 0.1], [-0.1, -2.0, 0.4], [0.03, 0.0, -0.05]] {
        let [left, right] = &mut taps;
        let arrivals = head.hear(from_m, [left, right]);
        assert!(arrivals.iter().all(|ear| ear.delay_s.is_finite() && ear.gain.is_finite()));
        assert!(taps.concat().iter().all(|tap| tap.is_finite()));
    }
    Ok(set.directions().len())
}

fn scratch() -> Scratch {
    Scratch::new("damaged.sofa", read).within(Bounds { base_bytes: 128 << 20, ..Bounds::default() })
}

const FIXTURES: [&str; 6] = ["sphere", "delays", "cartesian", "ring", "one", "shells"];

#[test]
fn other_kinds_of_file_are_named() {
    let (_turn, scratch) = (turn(), scratch());
    assert!(scratch.error(b"").contains("empty"));
    assert!(scratch.error(b"RIFF....WAVE").contains("not a SOFA file"));
    assert!(scratch.error(b"\x89HDF\r\n\x1a\n and no more").contains("cut short"));
    assert!(Measured::open(scratch.folder.path()).is_err());
}

#[test]
fn a_file_cut_short_is_an_error() {
    let (_turn, scratch) = (turn(), scratch());
    for name in FIXTURES {
        let whole = fixture(name);
        for part in 1..24 {
            let error = scratch.error(&whole[..whole.len() * part / 24]);
            assert!(error.contains("damaged.sofa"), "{error}");
        }
    }
}

#[test]
fn flipped_bytes_all_over_the_file_end_well() {
    let (_turn, scratch) = (turn(), scratch());
    for name in ["one", "ring"] {
        let whole = fixture(name);
        for index in (0..whole.len()).step_by(37) {
            let mut bytes = whole.clone();
            bytes[index] ^= if index % 2 == 0 { 0xff } else { 1 << (index / 2 % 8) };
            let _ = scratch.try_bytes(&bytes);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_overwriting_ends_well(bytes in overwritten(&FIXTURES, fixture)) {
        let _turn = turn();
        let _ = scratch().try_bytes(&bytes);
    }

    #[test]
    fn any_number_overwritten_ends_well(bytes in renumbered(&FIXTURES, fixture, 8)) {
        // Descriptions lie at multiples of eight bytes, and for the most part at the beginning.
        let _turn = turn();
        let _ = scratch().try_bytes(&bytes);
    }
}
