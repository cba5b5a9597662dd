//! USD files that are cut short, flipped, absurd or malicious: always an error or a reading, never a
//! panic, a hang, or memory beyond a small multiple of the file.

#![cfg(feature = "usd")]

mod damage;

use std::path::Path;
use std::time::Duration;

use damage::{Bounds, Scratch, read_all, turn};
use froufrou::scene::usd::Usd;

fn fixture(name: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/usd").join(name)).expect("a fixture")
}

fn scratch() -> Scratch {
    let bounds = Bounds { time: Duration::from_secs(20), base_bytes: 96 << 20, per_byte: 200 };
    Scratch::new("damaged.usd", |path| read_all(&Usd::open(path)?)).within(bounds)
}

/// The library's panics are caught; their messages would only fill the test's output.
fn quietly() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        let usual = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if std::thread::current().name() != Some("usd") {
                usual(info);
            }
        }));
    });
}

#[test]
fn other_kinds_of_file_are_named() {
    let (_turn, scratch) = (turn(), scratch());
    assert!(scratch.error(b"").contains("not a USD file"));
    assert!(scratch.error(b"Ogawa\xff").contains("not a USD file"));
    assert!(scratch.error(b"PXR-USDC").contains("ends before"));
    assert!(scratch.error(b"PK\x03\x04 and nothing").contains("no directory"));
    let missing = Usd::open(scratch.folder.path().join("none.usd")).expect_err("nothing there").to_string();
    assert!(missing.contains("none.usd"), "{missing}");
}

#[test]
fn truncated_files_are_an_error_or_a_reading() {
    let (_turn, scratch) = (turn(), scratch());
    quietly();
    for (name, step) in [("skeleton.usdc", 397), ("skeleton.usdz", 997), ("skeleton.usda", 1499)] {
        let whole = fixture(name);
        for length in (8..whole.len()).step_by(step) {
            let result = scratch.try_bytes(&whole[..length]);
            assert!(length > whole.len() / 2 || result.is_err(), "{name}: {length} of {} bytes", whole.len());
        }
    }
}

#[test]
fn flipped_bytes_are_an_error_or_a_reading() {
    let (_turn, scratch) = (turn(), scratch());
    quietly();
    let random = froufrou::random::Random::new(7, 1);
    let mut errors = 0;
    // `FROUFROU_FLIPS` asks for more, for a night.
    let flips: u64 = std::env::var("FROUFROU_FLIPS").ok().and_then(|n| n.parse().ok()).unwrap_or(250);
    for (file, name) in ["skeleton.usdc", "skeleton.usda", "baked.usdc"].into_iter().enumerate() {
        let whole = fixture(name);
        for case in 0..flips {
            let mut bytes = whole.clone();
            let uniform = |index: u64| random.uniform((file as u64 * flips + case) * 16 + index);
            for flip in 0..1 + (uniform(0) * 3.0) as u64 {
                // Half of them where the index lies: at the end of a binary layer.
                let share = uniform(2 * flip + 1);
                let share = if case % 2 == 0 { 0.75 + share / 4.0 } else { share };
                let at = ((share * bytes.len() as f64) as usize).clamp(8, bytes.len() - 1);
                bytes[at] = (uniform(2 * flip + 2) * 256.0) as u8;
            }
            errors += u64::from(scratch.try_bytes(&bytes).is_err());
        }
    }
    assert!(errors > flips / 10, "only {errors} of {} were noticed", 3 * flips);
}

#[test]
fn brackets_within_brackets_do_not_exhaust_the_stack() {
    let (_turn, scratch) = (turn(), scratch());
    for open in ["{", "(", "[", "def \"a\" {\n", "def \"a\" (\n customData = {\n dictionary a = {\n"] {
        let text = format!("#usda 1.0\n{}", open.repeat(100_000));
        let error = scratch.error(text.as_bytes());
        assert!(error.contains("brackets within each other"), "{error}");
    }
}

#[test]
fn braces_that_are_not_in_pairs_are_told() {
    // The library would look for ever for the other brace of a path, or call itself without end.
    let (_turn, scratch) = (turn(), scratch());
    for text in [
        "def \"a}b\" {}",
        "def \"root\" { def \"copy\" (prepend references = </root/a}b>) {} }",
        "def \"m\" { rel material:binding = </m{v=x> }",
    ] {
        let error = scratch.error(format!("#usda 1.0\n{text}\n"));
        assert!(error.contains("braces"), "{error}");
    }
}

#[test]
fn what_a_mesh_claims_is_checked() {
    let (_turn, scratch) = (turn(), scratch());
    let mesh = |counts: &str, indices: &str, more: &str| {
        let text = format!(
            "#usda 1.0\ndef Mesh \"M\" {{\n int[] faceVertexCounts = {counts}\n int[] faceVertexIndices = {indices}\n \
             point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n {more}\n}}\n"
        );
        scratch.error(text.as_bytes())
    };
    for (counts, indices, more, says) in [
        ("[4]", "[0, 1, 2]", "", "count 4 corners, but 3"),
        ("[3]", "[0, 1, 3]", "", "name vertex 3, but there are 3"),
        ("[3]", "[0, 1, -2]", "", "no type that belongs here"),
        ("[2147483647, 2147483647]", "[0]", "", "count 4294967294 corners"),
        ("[3]", "[0, 1, 2]", "rel skel:skeleton = </nowhere>", "is not there"),
        ("[3]", "[0, 1, 2]", "uniform token[] xformOpOrder = [\"xformOp:wobble\"]", "wobble"),
    ] {
        let error = mesh(counts, indices, more);
        assert!(error.contains(says) && error.contains("/M"), "{error}");
    }
    for (metadata, says) in [
        ("timeCodesPerSecond = 0", "timeCodesPerSecond"),
        ("metersPerUnit = -1", "metersPerUnit"),
        ("upAxis = \"W\"", "`W`"),
    ] {
        let error = scratch.error(format!("#usda 1.0\n(\n {metadata}\n)\n").as_bytes());
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn references_that_go_round_or_multiply_end() {
    let (_turn, scratch) = (turn(), scratch());
    quietly();
    let error = scratch.error(
        b"#usda 1.0\ndef \"A\" (\n references = </B>\n) {\n}\ndef \"B\" (\n references = </A>\n) {\n}\n",
    );
    assert!(error.contains("cycle"), "{error}");
    // Each level holds ten of the level before: 10^20 prims.
    let mut text = String::from("#usda 1.0\ndef Xform \"L0\" {\n}\n");
    for level in 1..=20 {
        text += &format!("def Xform \"L{level}\" {{\n");
        for child in 0..10 {
            text += &format!(" def \"c{child}\" (\n references = </L{}>\n ) {{\n }}\n", level - 1);
        }
        text += "}\n";
    }
    let error = scratch.error(text.as_bytes());
    assert!(error.contains("too much for the file's size"), "{error}");
}
