use super::*;
use crate::score::{Header, MicrophoneKey, MicrophoneShape, Pose};
use crate::space::surroundings::meshes::{Moved, wall};
use crate::space::surroundings::{Body, Material, Settings, Shape, Sides, Surroundings};
use glam::{DAffine3, DVec3};

const OMNI: MicrophoneShape = MicrophoneShape { c: 0.0, k: 0.0 };

fn header(fixed: Option<[f64; 3]>) -> ObjectHeader {
    let pose = |position_m| Pose::upright(position_m, [0.0, 0.0, -1.0]);
    let microphone = Microphone { name: "m".into(), pickup: Pickup::Shape(OMNI), fixed: fixed.map(pose) };
    Header { speed_of_sound_mps: 340.0, ..Header::new(Order::Time, vec![microphone]) }
}

fn line(thread: u64, time_s: f64, verb: Verb, position_m: [f64; 3]) -> Result<ObjectLine> {
    let value = Placement::at(position_m, 2.0);
    Ok(ObjectLine::Thread(Statement { thread, path: 0, time_s, verb, value }))
}

fn start() -> Verb {
    Verb::Start(Start::new("s"))
}

fn hear(time_s: f64, position_m: [f64; 3], cut: bool) -> Result<ObjectLine> {
    let pose = Pose::upright(position_m, [1.0, 0.0, 0.0]);
    Ok(ObjectLine::Microphone(MicrophoneKey { microphone: 0, time_s, pose, cut }))
}

fn propagate(header: &ObjectHeader, lines: Vec<Result<ObjectLine>>) -> Vec<Statement<Vec<Arrival>>> {
    let lines = Propagation::new(header, lines.into_iter()).unwrap().map(|line| line.unwrap());
    let lines: Vec<_> = lines.filter_map(|line| line.statement().cloned()).collect();
    assert!(lines.windows(2).all(|w| w[0].time_s <= w[1].time_s), "in time order");
    lines
}

#[test]
fn a_source_at_rest_has_its_delay_and_gain_to_the_bit() {
    let lines = propagate(
        &header(Some([0.0, 3.0, 0.0])),
        vec![line(1, 0.5, start(), [4.0, 0.0, 0.0]), line(1, 7.0, Verb::End, [4.0, 0.0, 0.0])],
    );
    assert_eq!(lines.len(), 2);
    for line in &lines {
        assert_eq!(line.value, [Arrival::new(0.4, 5.0 / 340.0)]);
    }
}

#[test]
fn a_passing_source_meets_the_closed_form_between_keys() {
    // A straight pass at 40 m/s, 2 m away, from two keys; and the path that the mixer makes of it.
    let lines = propagate(
        &header(Some([0.0; 3])),
        vec![line(1, 0.0, start(), [-40.0, 0.0, 2.0]), line(1, 2.0, Verb::End, [40.0, 0.0, 2.0])],
    );
    let key = |l: &Statement<Vec<Arrival>>| crate::synth::path::PathKey {
        emission_s: l.time_s,
        delay_s: l.value[0].delay_s,
        gain: l.value[0].gain,
        filter: crate::synth::path::UNFILTERED,
        spread: crate::synth::path::UNSPREAD,
    };
    let mut segments = Vec::new();
    let mut path = crate::synth::path::PathBuilder::new(key(&lines[0]), false, 0.0);
    for l in &lines[1..] {
        path.key(key(l), &mut |s| segments.push(s));
    }
    let mut worst = (0.0f64, 0.0f64, 0.0f64);
    for segment in &segments {
        for part in [0.05, 0.3, 0.5, 0.8] {
            let arrival = segment.begin_s + part * (segment.end_s - segment.begin_s);
            let moment = segment.at(arrival);
            // |x(t)| = c (a - t) solved for the emission time t, x = (-40 + 40 t, 2).
            let (c2, v) = (340.0f64 * 340.0, 40.0f64);
            let (a2, b2, c0) =
                (c2 - v * v, -2.0 * (c2 * arrival - v * 40.0), c2 * arrival * arrival - 1604.0);
            let t = (-b2 - (b2 * b2 - 4.0 * a2 * c0).sqrt()) / (2.0 * a2);
            let x = -40.0 + 40.0 * t;
            let d = x.hypot(2.0);
            let rate = 1.0 / (1.0 + v * x / d / 340.0);
            worst.0 = worst.0.max((moment.delay_s - (arrival - t)).abs());
            worst.1 = worst.1.max((moment.rate / rate - 1.0).abs());
            worst.2 = worst.2.max((20.0 * (moment.gain * d / 2.0).log10()).abs());
        }
    }
    assert!(worst.0 < 1e-6 && worst.1 < 5e-4 && worst.2 < 0.03, "{worst:?}");
    assert!(lines.len() < 150, "{} keys", lines.len());
}

#[test]
fn a_microphone_is_met_where_it_is_when_the_sound_arrives() {
    // The microphone recedes at 34 m/s from 34 m: d = 34 + 34 a, a = d / 340, so a = 1/9 s.
    let mut lines: Vec<_> =
        (0..=40).map(|i| hear(f64::from(i) * 0.1, [34.0 + 3.4 * f64::from(i), 0.0, 0.0], false)).collect();
    lines.insert(1, line(1, 0.0, start(), [0.0; 3]));
    lines.insert(12, line(1, 1.0, Verb::End, [0.0; 3]));
    let lines = propagate(&header(None), lines);
    assert!((lines[0].value[0].delay_s - 1.0 / 9.0).abs() < 1e-9, "{:?}", lines[0]);
    let end = lines.last().unwrap();
    // From t = 1 s: 340 (a - 1) = 34 + 34 a.
    assert!((end.value[0].delay_s - (374.0 / 306.0 - 1.0)).abs() < 1e-9, "{end:?}");
}

#[test]
fn a_cut_is_heard_when_it_is_seen() {
    // The camera cuts at 2 s from 34 m to 68 m away: what leaves at 1.9 s meets it.
    let mut lines = vec![hear(0.0, [34.0, 0.0, 0.0], false), line(1, 0.0, start(), [0.0; 3])];
    lines.extend((1..20).map(|i| hear(f64::from(i) * 0.1, [34.0, 0.0, 0.0], false)));
    lines.push(hear(2.0, [68.0, 0.0, 0.0], true));
    lines.extend((1..20).map(|i| hear(2.0 + f64::from(i) * 0.1, [68.0, 0.0, 0.0], false)));
    lines.insert(35, line(1, 3.0, Verb::End, [0.0; 3]));
    lines.sort_by(|a, b| line_s(a).total_cmp(&line_s(b)));
    let lines = propagate(&header(None), lines);
    let jumps: Vec<_> = lines.iter().filter(|l| l.verb == Verb::Jump).collect();
    assert_eq!(jumps.len(), 1);
    assert!((jumps[0].time_s - 1.9).abs() < 1e-9, "{jumps:?}");
    assert!((jumps[0].value[0].delay_s - 0.2).abs() < 1e-9);
    for line in &lines {
        let expected =
            if line.time_s < jumps[0].time_s || line.verb == Verb::Key && line.time_s == jumps[0].time_s {
                0.1
            } else {
                0.2
            };
        assert!((line.value[0].delay_s - expected).abs() < 1e-9, "{line:?}");
    }
}

#[test]
fn a_cut_that_nobody_foresees_is_heard_at_once() {
    // Keys come as things happen; the camera cuts from 34 m to 68 m away between two of them.
    let mut lines = vec![hear(0.0, [34.0, 0.0, 0.0], false), line(1, 0.0, start(), [0.0; 3])];
    for step in 1..=40 {
        let time_s = f64::from(step) * 0.005;
        let from_m = if step < 21 { 34.0 } else { 68.0 };
        lines.push(hear(time_s, [from_m, 0.0, 0.0], step == 21));
        lines.push(line(1, time_s, if step == 40 { Verb::End } else { Verb::Key }, [0.0; 3]));
    }
    let lines = Propagation::new(&header(None), lines.into_iter()).unwrap();
    let lines = lines.with_foresight(Foresight::None).map(|line| line.unwrap());
    let lines: Vec<_> = lines.filter_map(|line| line.statement().cloned()).collect();
    let jumps: Vec<usize> = (0..lines.len()).filter(|&n| lines[n].verb == Verb::Jump).collect();
    let &[jump] = &jumps[..] else { panic!("{jumps:?}") };
    assert!((lines[jump].time_s - 0.105).abs() < 1e-12);
    // Until then it is heard where it was, to the very moment.
    assert_eq!(lines[jump - 1].time_s, lines[jump].time_s);
    for (n, line) in lines.iter().enumerate() {
        let delay_s = if n < jump { 0.1 } else { 0.2 };
        assert!((line.value[0].delay_s - delay_s).abs() < 1e-9, "{n}: {line:?}");
    }
    assert_eq!(lines.last().unwrap().verb, Verb::End);
}

fn line_s(line: &Result<ObjectLine>) -> f64 {
    match line.as_ref().unwrap() {
        ObjectLine::Thread(statement) => statement.time_s,
        ObjectLine::Cue(cue) => cue.time_s,
        ObjectLine::Microphone(key) => key.time_s,
    }
}

#[test]
fn what_is_faster_than_sound_could_follow_has_jumped() {
    let lines = propagate(
        &header(Some([0.0; 3])),
        vec![
            line(1, 0.0, start(), [10.0, 0.0, 0.0]),
            line(1, 0.1, Verb::Key, [10.0, 0.0, 0.0]),
            line(1, 0.2, Verb::Key, [60.0, 0.0, 0.0]),
            line(1, 0.3, Verb::End, [60.0, 0.0, 0.0]),
        ],
    );
    let jump = lines.iter().position(|l| l.verb == Verb::Jump).unwrap();
    assert_eq!((lines[jump].time_s, lines[jump].value[0].delay_s), (0.2, 60.0 / 340.0));
    assert_eq!((lines[jump - 1].time_s, lines[jump - 1].value[0].delay_s), (0.2, 10.0 / 340.0));
    assert_eq!(lines.len(), 5);
}

#[test]
fn a_microphone_without_a_place_is_an_error() {
    let lines = vec![line(1, 0.0, start(), [1.0; 3]), line(1, 1.0, Verb::End, [1.0; 3])];
    let error = Propagation::new(&header(None), lines.into_iter()).unwrap().find_map(Result::err).unwrap();
    assert!(error.to_string().contains("microphone 1 of the score has no place"), "{error}");
}

/// What is heard of a source at the origin, 4 m from a microphone, when an endless wall comes in between at a speed,
/// so far from the source: the lines of the direct path.
fn behind_a_wall(at_m: f64, speed_mps: f64, transmission: f64) -> Vec<Statement<Vec<Arrival>>> {
    // Its edge passes the straight way at 0.5 s.
    let pass = move |t: f64| {
        DAffine3::from_translation(DVec3::new(at_m, 0.0, speed_mps * (0.5 - t) + 50.0))
            * DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2)
    };
    let body = Body {
        surface: std::sync::Arc::new(Moved::rigid(wall(100.0, 100.0, 1, 1), pass)),
        shape: Shape::Mesh,
        material: Material { transmission, ..Material::default() },
        sides: Sides::Auto,
        patches: 0,
        occludes: true,
        thing: None,
    };
    let surroundings = Surroundings::new(Settings::default(), vec![body]).unwrap();
    let lines = vec![line(1, 0.0, start(), [0.0; 3]), line(1, 2.0, Verb::End, [0.0; 3])];
    Propagation::new(&header(Some([4.0, 0.0, 0.0])), lines.into_iter())
        .unwrap()
        .among(Some(Tracing::about(surroundings)))
        .map(|line| line.unwrap().statement().unwrap().clone())
        .collect()
}

#[test]
fn no_wall_dampens_by_half_a_decibel_in_a_millisecond() {
    let mut worst = 0.0f64;
    for at_m in [0.1, 0.3, 1.0, 2.0, 3.9] {
        for speed_mps in [1.0, 10.0, 30.0] {
            for transmission in [0.0, 0.1, 0.5] {
                let lines = behind_a_wall(at_m, speed_mps, transmission);
                // Linear between keys, so steepest in decibels at the softer of two; down to −60 dB.
                let steepest = lines.windows(2).map(|pair| {
                    let [a, b] = [&pair[0], &pair[1]].map(|line| (2.0 * line.value[0].gain).max(1e-3));
                    let (soft, ms) = (a.min(b), 1e3 * (pair[1].time_s - pair[0].time_s));
                    (a - b).abs() / soft / ms * 20.0 / std::f64::consts::LN_10
                });
                worst = worst.max(steepest.fold(0.0, f64::max));
                let gains: Vec<f64> = lines.iter().map(|line| 2.0 * line.value[0].gain).collect();
                assert!(gains.windows(2).all(|pair| pair[1] <= pair[0] + 1e-9), "only ever softer");
                assert!((gains[0] - 1.0).abs() < 1e-3 || speed_mps == 1.0, "{}", gains[0]);
                let last = gains[gains.len() - 1];
                assert!((last - transmission).abs() < 1e-3, "{at_m} {speed_mps} {transmission}: {last}");
                // Where the wall is slow and the way wide, the shadow is that of the wall.
                if at_m == 2.0 && speed_mps == 1.0 && transmission == 0.5 {
                    let middle = lines.iter().position(|line| line.time_s >= 0.5).unwrap();
                    assert!((gains[middle] - 0.75).abs() < 0.02, "{}", gains[middle]);
                }
            }
        }
    }
    println!("steepest: {worst:.3} dB/ms");
    assert!((0.3..0.4501).contains(&worst), "{worst} dB/ms");
}
