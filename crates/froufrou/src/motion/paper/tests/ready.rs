//! Regions that whatever animates a sheet has.

use super::super::ready_made::{Kind, Part, Reader};
use super::*;

fn read(text: &str) -> Result<Vec<Partition>> {
    Reader::new(text.as_bytes(), "sheet.jsonl").collect()
}

fn fault(text: &str) -> String {
    read(text).expect_err("a fault").to_string()
}

const LINE: &str = r#"{"time_s":0.5,"regions":[{"faces":[0,1],"kind":"flat"},{"faces":[2],"kind":"curved","rulings":[[[0,0,0],[0,0.2,0]]]}],"held":[3],"touching":[]}"#;

#[test]
fn frames_are_read_line_by_line() {
    let found = read(&format!("{LINE}\n\n{}", LINE.replace("0.5", "0.75"))).expect("two frames");
    assert_eq!(found.iter().map(|p| p.time_s).collect::<Vec<_>>(), [0.5, 0.75]);
    assert_eq!(found[0].regions.as_ref().expect("regions")[1].rulings, [[[0.0; 3], [0.0, 0.2, 0.0]]]);
    assert_eq!((found[0].held.as_deref(), found[0].touching.as_deref()), (Some(&[3][..]), Some(&[][..])));
    let bare = read(r#"{"time_s":0,"regions":[]}"#).expect("a frame");
    assert_eq!((&bare[0].held, &bare[0].touching), (&None, &None));
}

#[test]
fn faults_name_the_line_and_what_was_expected() {
    let second = |line: &str| fault(&format!("{LINE}\n{line}"));
    assert!(second("{").starts_with("sheet.jsonl:2:1: not the regions of a sheet: EOF"), "{}", second("{"));
    assert!(
        second(&LINE.replace("flat", "plane"))
            .contains("unknown variant `plane`, expected `flat` or `curved`")
    );
    assert!(second(&LINE.replace("\"held\"", "\"pinned\"")).contains("unknown field `pinned`"));
    assert!(second(&LINE.replace("0.5", "1e999")).contains("number out of range"));
    assert!(
        second(&LINE.replace("[3]", "[-3]")).contains("expected u32"),
        "{}",
        second(&LINE.replace("[3]", "[-3]"))
    );
    assert!(
        second(LINE).starts_with("sheet.jsonl:2: regions at 0.5 s after those at 0.5 s"),
        "{}",
        second(LINE)
    );
    assert!(
        second(&LINE.replace(",[0,0.2,0]", "")).contains("expected an array of length 2"),
        "{}",
        second(&LINE.replace(",[0,0.2,0]", ""))
    );
}

#[test]
fn damaged_files_are_told_and_never_more() {
    let text = format!("{LINE}\n{}\n", LINE.replace("0.5", "0.75"));
    let random = Random::new(1, 1);
    for cut in 0..text.len() {
        let _ = read(&text[..cut]);
    }
    for seed in 0..2000 {
        let mut bytes = text.clone().into_bytes();
        let at = (random.uniform(2 * seed) * bytes.len() as f64) as usize;
        bytes[at] = (random.uniform(2 * seed + 1) * 256.0) as u8;
        let found: Result<Vec<Partition>> = Reader::new(bytes.as_slice(), "x").collect();
        let Ok(found) = found else { continue };
        for partition in found {
            let mesh = shapes::sheet(1, 2, |u, v| [u, 0.0, v]);
            let mut analyser = Analyser::new(vec![paper(PaperSettings::default())]);
            if analyser.give(0, partition).is_ok() {
                let _ = analyser.feed(0.0, std::slice::from_ref(&mesh));
            }
        }
    }
}

/// A sheet of which the left half is a cylinder of slanted rulings, and the right half the plane beside it.
fn place(u: f64, v: f64) -> [f64; 3] {
    let (x, r) = ((u - 0.5) * LONG_M, 0.1);
    if x > 0.0 {
        [x, 0.0, -v * SHORT_M]
    } else {
        [r * (x / r).sin(), r * (1.0 - (x / r).cos()), -v * SHORT_M]
    }
}

fn partition(mesh: &Mesh) -> Partition {
    let (mut curved, mut flat) = (Vec::new(), Vec::new());
    for face in 0..mesh.face_sizes.len() {
        if middle(mesh, face).x < 0.0 { curved.push(face as u32) } else { flat.push(face as u32) }
    }
    let ruling = |i: u32| {
        let [x, y, _] = place(0.05 * f64::from(i), 0.0);
        [[x, y, 0.0], [x, y, -SHORT_M]]
    };
    Partition {
        time_s: 0.0,
        regions: Some(vec![
            Part { faces: curved, kind: Kind::Curved, rulings: (0..10).map(ruling).collect() },
            Part { faces: flat, kind: Kind::Flat, rulings: Vec::new() },
        ]),
        ..Partition::default()
    }
}

#[test]
fn what_is_known_counts_and_what_follows_is_the_same() {
    for mesh in [shapes::sheet(28, 20, place), shapes::sheet(56, 40, place)] {
        let mut analyser = Analyser::new(vec![paper(PaperSettings::default())]);
        analyser.give(0, partition(&mesh)).expect("a sheet");
        analyser.feed(0.0, std::slice::from_ref(&mesh)).expect("a sound frame");
        let regions = analyser.regions(0).expect("a sheet");
        assert!(regions.regions.len() == 2 && regions.regions[0].is_curved && !regions.regions[1].is_curved);
        let found = analyser.resonators_at(0, &near(&mesh, place(0.9, 0.5)));
        assert_eq!(found.len(), 2, "the flat one, and what hangs together with it: {found:?}");
        let curved = found.iter().find(|one| one.is_unconstrained()).expect("the curved one");
        assert!((curved.ruling_m / SHORT_M - 1.0).abs() < 0.01, "{curved:?}");
        assert!((curved.border_m / LONG_M - 1.0).abs() < 0.05, "{curved:?}");
        // Its borders are held: the ends of v.
        let mut held = partition(&mesh);
        let ends = |v: &u32| {
            let [x, _, z] = mesh.positions[*v as usize].map(f64::from);
            x <= 1e-6 && !(-0.9999 * SHORT_M..=-1e-6).contains(&z)
        };
        held.held = Some((0..mesh.positions.len() as u32).filter(ends).collect());
        held.time_s = 1.0;
        analyser.give(0, held).expect("a sheet");
        analyser.feed(1.0, std::slice::from_ref(&mesh)).expect("a sound frame");
        let found = analyser.resonators_at(0, &near(&mesh, place(0.25, 0.5)));
        assert!(found.iter().all(|one| !one.is_unconstrained()), "{found:?}");
    }
}

#[test]
fn regions_that_are_not_of_the_mesh_are_refused() {
    let mesh = shapes::sheet(1, 2, |u, v| [u, 0.0, v]);
    let refused = |regions: Vec<Part>, held: Option<Vec<u32>>| {
        let mut analyser = Analyser::new(vec![paper(PaperSettings::default()), other("floor")]);
        let given = Partition { regions: Some(regions), held, ..Partition::default() };
        assert!(analyser.give(1, given.clone()).is_err() && analyser.give(2, given.clone()).is_err());
        analyser.give(0, given).expect("a sheet");
        analyser.feed(0.0, &[mesh.clone(), mesh.clone()]).expect_err("refused").to_string()
    };
    let flat = |faces: Vec<u32>| Part { faces, kind: Kind::Flat, rulings: Vec::new() };
    assert!(refused(vec![flat(vec![0, 1, 2])], None).contains("paper: face 3 is in no region"));
    assert!(
        refused(vec![flat(vec![0, 1, 2, 3]), flat(vec![2])], None)
            .contains("face 2 is in region 0 and in region 1")
    );
    assert!(refused(vec![flat(vec![0, 4])], None).contains("region 0 has face 4, but the mesh has 4"));
    assert!(
        refused(vec![flat((0..4).collect())], Some(vec![6]))
            .contains("vertex 6 is named, but the mesh has 6")
    );
    let curved = Part { kind: Kind::Curved, ..flat((0..4).collect()) };
    assert!(refused(vec![curved], None).contains("region 0 is curved and has no rulings"));
}

#[test]
fn tears_are_told_where_the_mesh_stays_whole() {
    // Edges of three cells in a row along u, one of them twice, and one elsewhere.
    let mesh = shapes::sheet(28, 20, |u, v| [u * LONG_M, 0.0, -v * SHORT_M]);
    let at = |i: u32, j: u32| j * 29 + i;
    let torn = vec![
        [at(3, 5), at(4, 5)],
        [at(5, 5), at(4, 5)],
        [at(4, 5), at(5, 5)],
        [at(5, 5), at(6, 5)],
        [at(20, 10), at(20, 11)],
    ];
    let mut analyser = Analyser::new(vec![paper(PaperSettings::default())]);
    let mut tears = Vec::new();
    for frame in 0..4 {
        let time_s = 0.1 * f64::from(frame);
        if frame == 2 {
            let told = Partition { time_s, torn: torn.clone(), ..Partition::default() };
            analyser.give(0, told).expect("a sheet");
        }
        analyser.feed(time_s, std::slice::from_ref(&mesh)).expect("a sound frame");
        tears.extend(events(&mut analyser).into_iter().filter_map(|event| event.tear().cloned()));
    }
    assert!(analyser.regions(0).is_some_and(|regions| regions.regions.len() == 1), "they are found still");
    let [long, short] = &tears[..] else { panic!("two: {tears:?}") };
    assert!(tears.iter().all(|tear| tear.time_s == 0.2), "{tears:?}");
    assert!((long.length_m - 3.0 * LONG_M / 28.0).abs() < 1e-6, "{long:?}");
    assert!((short.length_m - SHORT_M / 20.0).abs() < 1e-6, "{short:?}");
    let middle = DVec3::new(4.5 * LONG_M / 28.0, 0.0, -5.0 * SHORT_M / 20.0);
    assert!(DVec3::from(long.position_m).distance(middle) < 1e-6, "{long:?}");
    let faults = [([7, 7], "from vertex 7 to itself"), ([0, 609], "vertex 609 is named")];
    for (time_s, (ends, expected)) in [1.0, 2.0].into_iter().zip(faults) {
        let told = Partition { torn: vec![ends], ..Partition::default() };
        analyser.give(0, told).expect("a sheet");
        let refused = analyser.feed(time_s, std::slice::from_ref(&mesh)).expect_err("refused").to_string();
        assert!(refused.contains(expected), "{refused}");
    }
}

#[test]
fn a_tear_that_is_told_and_seen_is_one() {
    let whole = shapes::sheet(2, 2, |u, v| [u, 0.0, v]);
    // The end of an edge becomes two: one of what is to the left of it, and one of what is to the right.
    let mut torn = whole.clone();
    torn.positions.push([0.6, 0.0, 0.0]);
    let x = |vertex: &u32| whole.positions[*vertex as usize][0];
    for corners in torn.face_vertices.chunks_mut(3).filter(|corners| corners.iter().map(x).sum::<f32>() > 1.5)
    {
        corners.iter_mut().filter(|vertex| **vertex == 1).for_each(|vertex| *vertex = 9);
    }
    let lengths = |told: Option<Partition>| {
        let mut analyser = Analyser::new(vec![paper(PaperSettings::default())]);
        analyser.feed(0.0, std::slice::from_ref(&whole)).expect("a sound frame");
        if let Some(told) = told {
            analyser.give(0, told).expect("a sheet");
        }
        analyser.feed(0.1, std::slice::from_ref(&torn)).expect("a sound frame");
        let tears =
            events(&mut analyser).into_iter().filter_map(|event| event.tear().map(|tear| tear.length_m));
        tears.collect::<Vec<f64>>()
    };
    let seen = lengths(None);
    assert!(seen.len() == 1 && (seen[0] - 0.5).abs() < 1e-6, "{seen:?}");
    let told = lengths(Some(Partition { torn: vec![[1, 4]], ..Partition::default() }));
    assert!(told.len() == 1 && (told[0] - 0.5).abs() < 1e-6, "{told:?}");
}
