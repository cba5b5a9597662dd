use super::*;
use crate::random::Random;

fn row(time_s: f64, a: u32, b: u32, position_m: [f64; 3], force_n: f64, sliding: Option<f64>) -> ContactRow {
    ContactRow {
        time_s,
        a,
        b,
        position_m,
        push: Push::Force(force_n),
        normal: Some([0.0, 1.0, 0.0]),
        normal_velocity_mps: None,
        sliding_mps: sliding,
        line: 2,
    }
}

fn found(step: Step, rows: &[(ContactRow, [Option<BodyState>; 2])]) -> Vec<Rubbed> {
    let mut analyser = Analyser::new(step);
    let (mut all, mut last_s): (Vec<Rubbed>, f64) = (Vec::new(), f64::NEG_INFINITY);
    let mut take = |analyser: &mut Analyser| {
        while let Some(rubbed) = analyser.pop() {
            assert!(rubbed.time_s >= last_s, "in order of time");
            last_s = rubbed.time_s;
            all.push(rubbed);
        }
    };
    for (row, states) in rows {
        let settled_s = analyser.settled_s();
        analyser.feed(row, *states);
        assert!(analyser.settled_s() >= settled_s);
        take(&mut analyser);
    }
    analyser.finish();
    take(&mut analyser);
    all
}

fn unknown(rows: Vec<ContactRow>) -> Vec<Rubbed> {
    let rows: Vec<_> = rows.into_iter().map(|row| (row, [None; 2])).collect();
    found(Step::Fixed(0.001), &rows)
}

const RADIUS_M: f64 = 0.06;

/// A ball at a time that goes along X at a speed and turns as if it rolled at another.
fn ball(time_s: f64, speed: f64, turn: f64) -> BodyState {
    BodyState {
        position_m: [speed * time_s, RADIUS_M, 0.0],
        velocity_mps: [speed, 0.0, 0.0],
        rotation: turned(turn * time_s),
        angular_velocity_rps: [0.0, 0.0, -turn / RADIUS_M],
    }
}

/// A ball that has rolled so far.
fn turned(way_m: f64) -> [f64; 4] {
    glam::DQuat::from_rotation_z(-way_m / RADIUS_M).to_array()
}

#[test]
fn a_block_that_slides_steadily_is_told_as_such() {
    // Two points, one bearing three times as much; 20 N in all at 0.5 m/s.
    let rows = (1..=200).flat_map(|step| {
        let time = f64::from(step) * 0.001;
        let at = |x: f64| [x + 0.5 * time, 0.0, 0.0];
        [row(time, 3, 1, at(0.0), 15.0, Some(0.5)), row(time, 1, 3, at(1.0), 5.0, Some(0.5))]
    });
    let found = unknown(rows.collect());
    assert_eq!(found.len(), 20);
    for (index, slide) in found.iter().enumerate() {
        assert_eq!((slide.how, slide.bodies, slide.on_m), (Rubbing::Slide, [1, 3], None));
        assert!((slide.time_s - (index as f64 + 0.5) * 0.01).abs() < 1e-12);
        assert!((slide.force_n - 20.0).abs() < 1e-9 && (slide.speed_mps - 0.5).abs() < 1e-12);
        assert!((slide.position_m[0] - 0.25 - 0.5 * slide.time_s).abs() < 0.001);
    }
}

#[test]
fn flickering_presses_as_hard_as_the_weight_and_rest_is_silent() {
    // In contact every other step, twice as hard.
    let slides = |speed| {
        unknown((1..=50).map(|i| row(f64::from(2 * i) * 0.001, 0, 1, [0.0; 3], 40.0, Some(speed))).collect())
    };
    assert!(!slides(0.2).is_empty() && slides(0.2).iter().all(|slide| (slide.force_n - 20.0).abs() < 1e-9));
    assert!(slides(0.0005).is_empty());
    // Nothing pressed, nothing finite.
    let nothing = [(0.0, 1.0), (f64::MAX, f64::MAX)];
    assert!(unknown(nothing.map(|(force, v)| row(0.1, 0, 1, [0.0; 3], force, Some(v))).into()).is_empty());
}

#[test]
fn a_ball_rolls_with_poses_and_without() {
    let speed = 1.3;
    let rows: Vec<_> = (1..=300)
        .map(|step| {
            let time = f64::from(step) * 0.001;
            // The ball is the second body: the first one is the floor, of which nothing is known.
            (row(time, 0, 1, [speed * time, 0.0, 0.0], 4.9, None), [None, Some(ball(time, speed, speed))])
        })
        .collect();
    let with = found(Step::Fixed(0.001), &rows);
    let told: Vec<_> =
        rows.iter().map(|(row, _)| ContactRow { sliding_mps: Some(1e-4), ..row.clone() }).collect();
    let without = unknown(told);
    for found in [&with, &without] {
        // Without poses the first moment only tells which way it goes.
        assert!(found.len() >= 28, "{}", found.len());
        for roll in found {
            assert_eq!(roll.how, Rubbing::Roll);
            assert!((roll.speed_mps - speed).abs() < 1e-3 && (roll.force_n - 4.9).abs() < 0.5, "{roll:?}");
        }
    }
    // On the floor it is where it is, on the ball it goes around.
    let on = with[10].on_m.unwrap_or_default();
    assert_eq!(on[0], with[10].position_m);
    assert!((on[1].iter().map(|c| c * c).sum::<f64>().sqrt() / RADIUS_M - 1.0).abs() < 0.01, "{on:?}");
}

#[test]
fn a_ball_that_skids_until_it_rolls_changes_once() {
    // Friction turns it up from nothing in 0.2 s, as it slows to 5/7 of its speed.
    let rows: Vec<_> = (1..=400)
        .map(|step| {
            let time: f64 = f64::from(step) * 0.001;
            let part = (time / 0.2).min(1.0);
            let speed = 1.4 * (1.0 - 2.0 / 7.0 * part);
            let x = 1.4 * (time - part * time.min(0.2) / 7.0 - 2.0 / 7.0 * (time - 0.2).max(0.0));
            let way = 0.5 * part * time.min(0.2) + (time - 0.2).max(0.0);
            let position_m = [x, RADIUS_M, 0.0];
            let state = BodyState { position_m, rotation: turned(way), ..ball(0.0, speed, part) };
            (row(time, 0, 1, [x, 0.0, 0.0], 4.9, None), [None, Some(state)])
        })
        .collect();
    let found = found(Step::Fixed(0.001), &rows);
    let first_roll = found.iter().position(|rub| rub.how == Rubbing::Roll).unwrap_or(0);
    assert!(found[first_roll..].iter().all(|rub| rub.how == Rubbing::Roll));
    // It rolls by the rule of the slip where that is 0.3 of the rolling speed.
    assert!((12..=20).contains(&first_roll), "{first_roll}");
    assert_eq!(found.len(), 40);
}

/// Four corners of a box that rests, the pressure wandering between them, each missing now and then.
fn resting(
    seed: u64,
    states: [Option<BodyState>; 2],
    slip: Option<f64>,
) -> Vec<(ContactRow, [Option<BodyState>; 2])> {
    let random = Random::new(seed, 3);
    let mut rows = Vec::new();
    for step in 1..=1000u64 {
        for corner in 0..4u64 {
            let n = 8 * (4 * step + corner);
            if random.uniform(n) < 0.3 {
                continue;
            }
            let at = [f64::from(corner as u32 % 2), 0.0, f64::from(corner as u32 / 2)];
            let at = at.map(|c| 0.2 * c + 1e-5 * random.uniform(n + 1));
            rows.push((row(step as f64 * 0.001, 0, 1, at, 10.0 * random.uniform(n + 2), slip), states));
        }
    }
    rows
}

#[test]
fn a_box_at_rest_is_silent_however_its_pressure_wanders() {
    let trembling = BodyState {
        position_m: [0.1, 0.1, 0.1],
        velocity_mps: [1e-5, 0.0, 2e-5],
        angular_velocity_rps: [1e-4, 0.0, -2e-4],
        ..BodyState::STILL
    };
    for seed in 0..20 {
        assert_eq!(found(Step::Fixed(0.001), &resting(seed, [None, Some(trembling)], None)), []);
        assert_eq!(found(Step::Fixed(0.001), &resting(seed, [None; 2], Some(1e-4))), []);
    }
}

#[test]
fn what_is_about_a_threshold_does_not_chatter() {
    // A slip that goes to and fro about the least, and about what rolling may creep.
    let about = |slips: [f64; 2], speed: f64| {
        let rows: Vec<_> = (1..=1000)
            .map(|step| {
                let time = f64::from(step) * 0.001;
                let slip = slips[(step / 10) as usize % 2];
                let state = ball(time, speed, speed);
                (row(time, 0, 1, [speed * time, 0.0, 0.0], 4.9, Some(slip)), [None, Some(state)])
            })
            .collect();
        let found = found(Step::Fixed(0.001), &rows);
        let changes = found.windows(2).filter(|pair| pair[0].how != pair[1].how).count();
        (found.len(), changes)
    };
    assert_eq!(about([0.0008, 0.0012], 0.0), (0, 0));
    let (count, changes) = about([0.25, 0.45], 1.0);
    assert!(count >= 99 && changes == 0, "{count} {changes}");
    // A single moment of fast sliding is one all the same.
    let scrape: Vec<_> =
        (1..=9).map(|i| row(f64::from(i) * 0.001, 0, 1, [0.0; 3], 40.0, Some(0.5))).collect();
    assert_eq!(unknown(scrape).len(), 1);
}

#[test]
fn a_box_on_a_moving_car_rests_and_one_that_slides_back_slides() {
    let car = |time: f64, speed: f64| BodyState {
        position_m: [speed * time, 0.0, 0.0],
        velocity_mps: [speed, 0.0, 0.0],
        ..BodyState::STILL
    };
    let rows = |of_box: f64| -> Vec<_> {
        (1..=200)
            .map(|step| {
                let time = f64::from(step) * 0.001;
                let at = [of_box * time, 0.0, 0.0];
                (row(time, 0, 1, at, 5.0, None), [Some(car(time, 3.0)), Some(car(time, of_box))])
            })
            .collect()
    };
    assert_eq!(found(Step::Fixed(0.001), &rows(3.0)), []);
    let slides = found(Step::Fixed(0.001), &rows(2.5));
    assert!(
        slides.len() == 20
            && slides.iter().all(|s| s.how == Rubbing::Slide && (s.speed_mps - 0.5).abs() < 1e-9)
    );
}

#[test]
fn steps_longer_than_a_moment_roll_too() {
    let rows: Vec<_> = (1..=60)
        .map(|step| {
            let time = f64::from(step) / 30.0;
            (row(time, 0, 1, [2.0 * time, 0.0, 0.0], 4.9, None), [None, Some(ball(time, 2.0, 2.0))])
        })
        .collect();
    let found = found(Step::Stamped(1.0 / 30.0), &rows);
    assert!(found.len() >= 58 && found.iter().all(|rub| rub.how == Rubbing::Roll), "{}", found.len());
}

#[test]
fn pairs_long_apart_are_forgotten() {
    let mut analyser = Analyser::new(Step::Fixed(0.001));
    for i in 0..20_000u32 {
        analyser.feed(&row(f64::from(i) * 0.001, 2 * i, 2 * i + 1, [0.0; 3], 5.0, Some(1.0)), [None; 2]);
        while analyser.pop().is_some() {}
        assert!(analyser.pairs.len() < 200 && analyser.found.len() < 50);
    }
}
