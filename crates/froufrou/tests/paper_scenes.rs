//! Scenes with paper, all the way from meshes to samples.

mod studio;

use std::collections::BTreeSet;
use std::f64::consts::PI;

use froufrou::corpus::paper::PaperSound;
use froufrou::corpus::paper::synthetic::Paper;
use froufrou::score::{Action, Cue, ObjectLine, Statement, Verb};
use studio::{Studio, Take};

const RATE_HZ: u32 = 44_100;
const FPS: f64 = 60.0;
const FRAMES: usize = 120;
const CELLS: usize = 16;

/// The edge of the sheet, in metres.
const EDGE_M: f64 = 0.2;

/// A sheet that is bent along x by an angle from end to end, keeps its width, and lies or stands somewhere.
fn bent(angle: f64, [x, z]: [f64; 2]) -> [f64; 3] {
    if angle.abs() < 1e-6 {
        return [EDGE_M * x, 0.0, EDGE_M * z];
    }
    let radius = EDGE_M / angle;
    [radius * (angle * x).sin(), radius * ((angle * x).cos() - (angle / 2.0).cos()), EDGE_M * z]
}

fn scene(studio: &Studio, paper: &str, more: &str) -> String {
    studio.file("table.obj", "v -4 0 -4\nv -4 0 4\nv 4 0 4\nv 4 0 -4\nf 1 2 3 4\n");
    format!(
        "seed = 2\nduration = 2.2\nspeed_of_sound = 343\n[[microphone]]\nname = 'm'\nposition = [0, 2, 0]\n\
         [material.sheet]\npaper = {paper}\n{more}\
         [[object]]\nname = 'letter'\nsource = 'letter.pc2#/*'\nframe_rate = 60\nmaterial = 'sheet'\n"
    )
}

const TABLE: &str = "[[object]]\nname = 'table'\nsource = 'table.obj#/*'\n";

/// It lies on the table and is pulled along it for a second, and then it rests.
fn pulled(time_s: f64, corner: [f64; 2]) -> [f64; 3] {
    let [x, _, z] = bent(0.0, corner);
    [x + SPEED_MPS * time_s.min(1.0), 0.002, z]
}

const SPEED_MPS: f64 = 0.3;

fn power(sound: &[f64], from_s: f64, to_s: f64) -> f64 {
    let at = |time_s: f64| (time_s * f64::from(RATE_HZ)) as usize;
    let piece = &sound[at(from_s)..at(to_s)];
    piece.iter().map(|v| v * v).sum::<f64>() / piece.len() as f64
}

#[test]
fn what_is_pulled_flat_is_as_loud_as_its_constrained_spectrum() {
    let studio = Studio::new();
    studio.sheet("letter", CELLS, (FRAMES, FPS), pulled);
    let scene = scene(&studio, "{ corpus = 'synthetic/printer', slip = 0 }", TABLE);
    let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap().channel(0);
    let paper = PaperSound::named("synthetic/printer", &studio.path("")).unwrap();
    let spectrum = &paper.spectra()[paper.spectrum(0.2, 0.0).unwrap()];
    let spacing_hz = froufrou::corpus::paper::SPACING_HZ;
    let density: f64 = spectrum.density.iter().map(|d| (SPEED_MPS * d).powi(2) * spacing_hz).sum();
    // Two metres above the sheet, which is a dipole that faces up.
    let expected = density / 4.0;
    let found = power(&sound, 0.3, 0.95);
    let off_db = 10.0 * (found / expected).log10();
    assert!(off_db.abs() < 1.5, "{off_db} dB");
    assert_eq!(power(&sound, 1.4, 2.0), 0.0, "silent at rest");
}

/// A bowed sheet, by 1.2 rad, that is pulled along the table on its two straight edges.
fn bowed(time_s: f64, corner: [f64; 2]) -> [f64; 3] {
    let [x, y, z] = bent(1.2, corner);
    [x + SPEED_MPS * time_s.min(1.0), y + 0.002, z]
}

/// The names of the controls that friction is told of, and of the sounds that have them.
fn told(studio: &Studio, scene: &str) -> (BTreeSet<String>, BTreeSet<String>) {
    let (mut controls, mut sounds) = (BTreeSet::new(), BTreeSet::new());
    for line in studio.production(scene).unwrap().object_lines().unwrap() {
        match line.unwrap() {
            ObjectLine::Cue(Cue { action: Action::Set(values), .. }) => {
                controls.extend(values.into_iter().filter(|(_, value)| *value > 0.0).map(|(name, _)| name));
            }
            ObjectLine::Thread(Statement { verb: Verb::Start(start), .. }) => {
                sounds.insert(start.sound);
            }
            _ => {}
        }
    }
    (controls, sounds)
}

fn control(ruling_m: f64, border_m: f64) -> String {
    let paper = PaperSound::synthetic(Paper::printer());
    format!("friction-{}", paper.spectrum(ruling_m, border_m).unwrap())
}

#[test]
fn what_is_bowed_rubs_with_its_own_spectrum() {
    let studio = Studio::new();
    studio.sheet("letter", CELLS, (FRAMES, FPS), bowed);
    let (controls, _) = told(&studio, &scene(&studio, "'synthetic/printer'", TABLE));
    // Rulings of 20 cm along z, and two curved borders of 20 cm each.
    assert!(controls.contains(&control(0.2, 0.4)) && controls.len() <= 2, "{controls:?}");
}

#[test]
fn what_is_said_to_be_held_or_to_touch_is_constrained() {
    let studio = Studio::new();
    studio.sheet("letter", CELLS, (FRAMES, FPS), bowed);
    let side = CELLS + 1;
    let all: Vec<usize> = (0..side * side).collect();
    // All of both curved borders.
    let borders: Vec<usize> = (0..side).chain(side * CELLS..side * side).collect();
    let held = format!("{{ corpus = 'synthetic/printer', held = {borders:?} }}");
    let (controls, _) = told(&studio, &scene(&studio, &held, TABLE));
    assert_eq!(controls, BTreeSet::from([control(0.2, 0.0)]));
    // One curved region whose rulings go along z, all of which lies on something.
    let faces: Vec<usize> = (0..CELLS * CELLS).collect();
    let line = serde_json::json!({ "time_s": 0, "touching": all, "regions": [
        { "faces": faces, "kind": "curved", "rulings": [[[0.0, 0.0, -0.1], [0.0, 0.0, 0.1]]] }
    ] });
    studio.file("letter.jsonl", &format!("{line}\n"));
    let known = "{ corpus = 'synthetic/printer', regions = 'letter.jsonl' }";
    let (controls, _) = told(&studio, &scene(&studio, known, TABLE));
    assert_eq!(controls, BTreeSet::from([control(0.2, 0.0)]));
    // Regions of another mesh are told with their line.
    studio.file("letter.jsonl", "{\"time_s\":0,\"regions\":[{\"faces\":[0],\"kind\":\"flat\"}]}\n");
    let fault = studio.scene(&scene(&studio, known, TABLE), Take::at(RATE_HZ)).err().expect("refused");
    let fault = fault.to_string();
    assert!(fault.contains("letter.jsonl:1") && fault.contains("face 1 is in no region"), "{fault}");
}

#[test]
fn a_simulator_may_say_what_tears() {
    let studio = Studio::new();
    studio.sheet("letter", CELLS, (FRAMES, FPS), |_, corner| bent(0.0, corner));
    let side = CELLS + 1;
    let edge = |i: usize| [side * 3 + i, side * 3 + i + 1];
    // An edge more each hundredth of a second, which is more often than there are frames.
    let lines =
        (1..8).map(|i| format!("{{\"time_s\":{},\"torn\":[{:?}]}}\n", 0.3 + 0.01 * i as f64, edge(i)));
    studio.file("letter.jsonl", &lines.collect::<String>());
    let paper = "{ corpus = 'synthetic/printer', regions = 'letter.jsonl' }";
    let scene = scene(&studio, paper, "");
    let events = studio.production(&scene).unwrap().events().unwrap();
    let tears: Vec<_> = events.filter_map(|event| event.unwrap().tear().cloned()).collect();
    let length_m: f64 = tears.iter().map(|tear| tear.length_m).sum();
    assert!((length_m - 7.0 * 0.2 / CELLS as f64).abs() < 1e-6, "{tears:?}");
    assert!(tears.iter().all(|tear| (0.3..0.4).contains(&tear.time_s)), "{tears:?}");
    let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap().channel(0);
    assert_eq!(power(&sound, 0.0, 0.3), 0.0);
    assert!(power(&sound, 0.3, 0.45) > 0.0 && power(&sound, 0.8, 1.0) == 0.0);
}

/// Only the regions that hold in a frame have to be those of its mesh: what comes between two frames may be of a mesh that
/// is never seen.
#[test]
fn regions_between_frames_may_be_of_other_meshes() {
    let studio = Studio::new();
    let cells = [2usize, 3, 2, 2];
    for (frame, &cells) in cells.iter().enumerate() {
        studio.sheet("one", cells, (1, 24.0), |_, [x, z]| [x, 1.0, z]);
        std::fs::rename(studio.path("one.obj"), studio.path(&format!("page_{frame}.obj"))).unwrap();
    }
    let regions = |time_s: f64, cells: usize, torn: &[[usize; 2]]| {
        let faces: Vec<usize> = (0..cells * cells).collect();
        let regions = serde_json::json!([{ "faces": faces, "kind": "flat" }]);
        format!("{}\n", serde_json::json!({ "time_s": time_s, "regions": regions, "torn": torn }))
    };
    let at = |n: u32| f64::from(n) / 60.0;
    // Frames are at 0, 2.5, 5 and 7.5 sixtieths.
    let said = [
        regions(at(0), 2, &[]),
        regions(at(1), 4, &[[23, 24]]),
        regions(at(2), 3, &[]),
        regions(at(3), 5, &[]),
        regions(at(4), 6, &[]),
        regions(at(5), 2, &[]),
        regions(at(6), 2, &[[3, 4]]),
        regions(at(7), 2, &[]),
    ];
    studio.file("page.jsonl", &said.concat());
    let text = "duration = 1\n[[microphone]]\nname = 'm'\nposition = [0, 2, 0]\n\
         [material.paper]\npaper = { corpus = 'synthetic/printer', regions = 'page.jsonl' }\n\
         [[object]]\nname = 'page'\nsource = 'page_*.obj#/*'\nframe_rate = 24\nmaterial = 'paper'\n";
    let production = studio.production(text).unwrap();
    let events: Vec<_> = production.events().unwrap().map(|event| event.unwrap()).collect();
    // What is torn between two frames of one mesh is told, though other regions hold by then.
    let torn = events.iter().filter_map(|event| event.tear()).map(|tear| tear.length_m);
    let torn: Vec<f64> = torn.collect();
    assert!(torn.len() == 1 && (torn[0] - 0.5).abs() < 1e-6, "{torn:?}");
    // One that holds and is of another mesh is refused, with its line.
    studio.file("page.jsonl", &(said[..2].concat() + said[3].as_str()));
    let fault = production.events().unwrap().find_map(|event| event.err()).expect("refused").to_string();
    assert!(fault.contains("page.jsonl:2"), "{fault}");
}

#[test]
fn along_another_material_it_may_sound_otherwise() {
    let studio = Studio::new();
    studio.sheet("letter", CELLS, (FRAMES, FPS), bowed);
    let table = format!("{TABLE}material = 'oak'\n[material.oak]\n");
    let paper = "{ corpus = 'synthetic/printer', against = { oak = 'synthetic/banknote' } }";
    let (_, sounds) = told(&studio, &scene(&studio, paper, &table));
    assert_eq!(sounds, BTreeSet::from(["banknote".to_owned()]));
    let (_, sounds) = told(&studio, &scene(&studio, paper, TABLE));
    assert_eq!(sounds, BTreeSet::from(["printer".to_owned()]));
}

/// It snaps through at 0.5 s, and back at 1.2 s.
fn flipped(time_s: f64, corner: [f64; 2]) -> [f64; 3] {
    let through = |at_s: f64| ((time_s - at_s) / 0.04).tanh();
    let [x, y, z] = bent(0.8 * (through(0.5) - through(1.2) - 1.0), corner);
    [x, y + 1.0, z]
}

#[test]
fn a_flip_plays_a_flap_of_its_size_and_says_why() {
    let studio = Studio::new();
    studio.sheet("letter", CELLS, (FRAMES, FPS), flipped);
    let scene = scene(&studio, "'synthetic/printer'", "");
    let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap();
    let flaps: Vec<_> = sound.begun.iter().filter(|begun| begun.gain > 1e-3).collect();
    assert_eq!(flaps.len(), 2, "{:?}", sound.begun);
    let paper = PaperSound::named("synthetic/printer", &studio.path("")).unwrap();
    let lead_s = paper.clips().iter().map(|clip| clip.lead_s).fold(0.0, f64::max);
    for (flap, at_s) in flaps.iter().zip([0.5, 1.2]) {
        assert!((flap.time_s + lead_s - at_s).abs() < 0.02, "{flap:?}");
        assert!(
            flap.start.cause.contains("letter crumples") && flap.start.cause.contains("20.0 cm"),
            "{flap:?}"
        );
    }
    let samples = sound.channel(0);
    assert_eq!(power(&samples, 0.0, 0.4), 0.0);
    assert!(power(&samples, 0.5, 0.6) > 1e3 * power(&samples, 1.1, 1.18).max(1e-15));
    // The sheet is a dipole that faces up and down: beside it there is next to nothing.
    let beside = scene.replace("position = [0, 2, 0]", "position = [1, 1, 0]");
    let beside = studio.scene(&beside, Take::at(RATE_HZ)).unwrap().channel(0);
    let quieter_db = 10.0 * (power(&samples, 0.45, 1.1) / power(&beside, 0.45, 1.1)).log10();
    assert!(quieter_db > 15.0, "{quieter_db} dB");
}

#[test]
fn ranges_threads_and_the_score_in_between_give_the_same_bits() {
    let studio = Studio::new();
    studio.sheet("letter", CELLS, (FRAMES, FPS), |time_s, corner| {
        let [x, y, z] = bent(0.8 * ((time_s - 0.5) / 0.04).tanh(), corner);
        [x + SPEED_MPS * time_s, y.abs() + 0.002, z]
    });
    let scene = scene(&studio, "'synthetic/banknote'", TABLE);
    let whole = studio.scene(&scene, Take::at(RATE_HZ)).unwrap();
    let one = studio.scene(&scene, Take { cores: 1, ..Take::at(RATE_HZ) }).unwrap();
    assert!(whole.mix == one.mix, "threads change nothing");
    let part = Take { from_s: 0.4, to_s: Some(1.3), ..Take::at(RATE_HZ) };
    let part = studio.scene(&scene, part).unwrap();
    let first = (0.4 * f64::from(RATE_HZ)).round() as usize;
    assert!(part.mix == whole.mix[first..first + part.frames()], "a range is that part of the whole");
    let staged = studio.staged(&scene, Take::at(RATE_HZ)).unwrap();
    assert!(staged.mix == whole.mix, "stages change nothing");
}

#[test]
fn a_sheet_that_comes_apart_tears() {
    let studio = Studio::new();
    // Two halves that lie together along x = 0 until they are torn from one end to the other.
    let mut faces = Vec::new();
    for frame in 0..30 {
        let torn = (frame as f64 - 9.0).max(0.0);
        let mut obj = String::new();
        let columns = CELLS + 2;
        for row in 0..=CELLS {
            for column in 0..columns {
                let right = column > CELLS / 2;
                let x = (column - usize::from(right)) as f64 / CELLS as f64 - 0.5;
                let opens = 0.002 * (torn - row as f64).max(0.0);
                let x = EDGE_M * x + if right { opens } else { -opens };
                obj += &format!("v {x} 1 {}\n", EDGE_M * row as f64 / CELLS as f64);
            }
        }
        for row in 0..CELLS {
            for column in (0..columns - 1).filter(|column| *column != CELLS / 2) {
                let first = row * columns + column + 1;
                obj += &format!("f {first} {} {} {}\n", first + columns, first + columns + 1, first + 1);
            }
        }
        studio.file(&format!("letter_{frame:03}.obj"), &obj);
        faces.push(obj);
    }
    let scene = scene(&studio, "'synthetic/printer'", "").replace("letter.pc2#/*", "letter_*.obj#/*");
    let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap();
    assert!(sound.begun.iter().any(|begun| begun.start.cause.contains("letter tears")), "{:?}", sound.begun);
    let samples = sound.channel(0);
    assert!(power(&samples, 0.2, 0.4) > 1e-9 && power(&samples, 0.0, 0.14) == 0.0);
    assert!(power(&samples, 1.2, 2.0) < 1e-3 * power(&samples, 0.2, 0.4));
}

#[test]
fn a_simulations_forces_are_heard() {
    let studio = Studio::new();
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/alembic/beside.abc");
    std::fs::copy(fixture, studio.path("beside.abc")).unwrap();
    let scene =
        scene(&studio, "{ corpus = 'synthetic/printer', radius = 0.01, force = 'force', slip = 0 }", TABLE)
            .replace("letter.pc2#/*", "beside.abc#/sheet")
            .replace("frame_rate = 60\n", "");
    let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap().channel(0);
    // It presses four times as hard in the second half: 6 dB.
    let louder_db = 10.0 * (power(&sound, 0.62, 0.95) / power(&sound, 0.1, 0.45)).log10();
    assert!((louder_db - 6.0).abs() < 1.0, "{louder_db} dB");
    // In all with 1.5 N in the first half.
    let as_known = scene.replace("force = 'force'", "force = 'force', reference_force = 1.5");
    let unknown = scene.replace("force = 'force'", "floor_speed = 0.03");
    let powers = [as_known, unknown]
        .map(|scene| power(&studio.scene(&scene, Take::at(RATE_HZ)).unwrap().channel(0), 0.1, 0.45));
    assert!((10.0 * (powers[0] / powers[1]).log10()).abs() < 0.5, "{powers:?}");
}

#[test]
fn what_paper_cannot_be_is_told() {
    let studio = Studio::new();
    studio.sheet("letter", 2, (2, FPS), |_, corner| bent(PI / 3.0, corner));
    let refused = |paper: &str| {
        studio.scene(&scene(&studio, paper, ""), Take::at(RATE_HZ)).err().expect("refused").to_string()
    };
    let fault = refused("'synthetic/napkin'");
    assert!(fault.contains("napkin") && fault.contains("printer"), "{fault}");
    let fault = refused("{ corpus = 'synthetic/printer', held = [99] }");
    assert!(fault.contains("99"), "{fault}");
    let fault = refused("{ corpus = 'synthetic/printer', regions = 'letter.jsonl' }");
    assert!(fault.contains("letter.jsonl"), "{fault}");
    let fault = refused("'synthetic/printer'\ncloth = 'synthetic/cotton'");
    assert!(fault.contains("cloth") && fault.contains("paper"), "{fault}");
    let box_of_paper = scene(&studio, "'synthetic/printer'", "")
        .replace("source = 'letter.pc2#/*'\nframe_rate = 60\n", "position = [0, 0, 0]\n");
    let fault = studio.scene(&box_of_paper, Take::at(RATE_HZ)).err().expect("refused").to_string();
    assert!(fault.contains("letter: it is of paper and has no mesh"), "{fault}");
    let used = studio.scene(&scene(&studio, "'synthetic/printer'", ""), Take::at(RATE_HZ)).unwrap();
    assert!(used.begun.iter().all(|begun| begun.start.object == "letter"));
    let verbs = studio.production(&scene(&studio, "'synthetic/printer'", "")).unwrap();
    let starts = verbs
        .object_lines()
        .unwrap()
        .filter(|line| matches!(line, Ok(ObjectLine::Thread(line)) if matches!(line.verb, Verb::Start(_))));
    assert_eq!(starts.count(), used.begun.len());
}
