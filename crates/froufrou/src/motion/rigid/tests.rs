use super::*;
use crate::motion::event::{Impact, Rub};
use glam::{DMat3, DQuat};

const G: f64 = 9.81;
const GRAVITY: [f64; 3] = [0.0, -G, 0.0];
const RATES: [f64; 3] = [24.0, 30.0, 60.0];

fn transform(at: DVec3, turn: DQuat) -> Transform {
    let c = DMat3::from_quat(turn).to_cols_array_2d();
    let row = |i: usize| [c[0][i], c[1][i], c[2][i], at[i]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

fn upright(x: f64, y: f64, z: f64) -> Transform {
    transform(DVec3::new(x, y, z), DQuat::IDENTITY)
}

/// A floor whose surface is at y = 0, and where it is.
fn floor() -> (Body, Transform) {
    (Body::new("floor", Shape::cuboid([50.0, 0.5, 50.0]), 1000.0).fixed(), upright(0.0, -0.5, 0.0))
}

/// What is told of bodies that move as a function says.
fn told(
    bodies: Vec<Body>,
    rate_hz: f64,
    lasts_s: f64,
    from_s: f64,
    poses: impl Fn(f64) -> Vec<Transform>,
) -> Vec<Event> {
    let mut analyser = Analyser::new(bodies, GRAVITY);
    let mut events = Vec::new();
    for frame in 0..=(lasts_s * rate_hz) as usize {
        let time_s = from_s + frame as f64 / rate_hz;
        analyser.feed(time_s, &poses(time_s)).unwrap();
        events.extend(std::iter::from_fn(|| analyser.next_event()));
    }
    analyser.finish();
    events.extend(std::iter::from_fn(|| analyser.next_event()));
    assert!(events.is_sorted_by(|a, b| a.time_s() <= b.time_s()));
    events
}

fn impacts(events: &[Event]) -> Vec<&Impact> {
    let impact = |event| match event {
        &Event::Impact(ref impact) => Some(impact),
        _ => None,
    };
    events.iter().filter_map(impact).collect()
}

fn rubs(events: &[Event]) -> [Vec<&Rub>; 2] {
    let mut rubs = [Vec::new(), Vec::new()];
    for event in events {
        match event {
            Event::Slide(rub) => rubs[0].push(rub),
            Event::Roll(rub) => rubs[1].push(rub),
            Event::Impact(_) => {}
        }
    }
    rubs
}

/// A ball that is let fall on the floor: its height at a time and when and how fast it hits.
struct Bouncing {
    drop_m: f64,
    restitution: f64,
}

impl Bouncing {
    /// Time and speed of every hit until it is slower than a speed.
    fn hits(&self, least_mps: f64) -> Vec<(f64, f64)> {
        let mut hits = Vec::new();
        let mut speed = (2.0 * G * self.drop_m).sqrt();
        let mut time_s = speed / G;
        while speed >= least_mps {
            hits.push((time_s, speed));
            speed *= self.restitution;
            time_s += 2.0 * speed / G;
        }
        hits
    }

    fn height(&self, time_s: f64) -> f64 {
        let hits = self.hits(1e-9);
        let past = hits.partition_point(|&(hit_s, _)| hit_s <= time_s);
        if past == 0 {
            return self.drop_m - 0.5 * G * time_s * time_s;
        }
        let (hit_s, speed) = hits[past - 1];
        let since_s = time_s - hit_s;
        (self.restitution * speed * since_s - 0.5 * G * since_s * since_s).max(0.0)
    }
}

#[test]
fn a_bouncing_ball_is_told_to_a_millisecond_at_every_rate() {
    let radius = 0.1;
    let mut missed = Vec::new();
    let mut worst_s: f64 = 0.0;
    for rate_hz in RATES {
        for (drop_m, restitution) in
            [(1.0, 0.8), (1.0, 0.5), (0.3, 0.9), (2.0, 0.65), (0.05, 0.7), (1.0, 0.2)]
        {
            for phase in 0..10 {
                let ball = Bouncing { drop_m, restitution };
                let from_s = -f64::from(phase) * 0.1 / rate_hz;
                let body = Body::new("ball", Shape::sphere(radius), 500.0);
                let mass = body.mass_kg();
                let (ground, there) = floor();
                // Before, it was thrown up.
                let height = |time_s: f64| radius + ball.height(time_s);
                let lasts_s = ball.hits(1e-6).last().unwrap().0 + 0.5;
                let events = told(vec![body, ground], rate_hz, lasts_s, from_s, |time_s| {
                    vec![upright(0.3 * time_s, height(time_s), 0.0), there]
                });
                let found = impacts(&events);
                let expected = ball.hits(1.02 * LEAST_IMPACT_MPS);
                let most = ball.hits(0.98 * LEAST_IMPACT_MPS).len();
                let about = format!("{rate_hz} Hz, {drop_m} m, e {restitution}, phase {phase}");
                if found.len() < expected.len() || found.len() > most {
                    missed.push(format!("{about}: {} of {} to {most}", found.len(), expected.len()));
                    continue;
                }
                for (impact, &(time_s, speed)) in found.iter().zip(&expected) {
                    let off_s = (impact.time_s - time_s).abs();
                    worst_s = worst_s.max(off_s);
                    let expected_ns = mass * (1.0 + restitution) * speed;
                    if off_s > 1e-3 || (impact.impulse_ns / expected_ns - 1.0).abs() > 0.1 {
                        missed.push(format!("{about}: {time_s} {expected_ns} {impact:?}"));
                    }
                }
                let order = found.windows(2).filter(|two| two[0].impulse_ns <= two[1].impulse_ns).count();
                if order > 0 {
                    missed.push(format!("{about}: {order} out of order"));
                }
            }
        }
    }
    eprintln!("worst: {worst_s} s");
    assert!(
        missed.is_empty(),
        "{}: {}",
        missed.len(),
        missed.iter().take(20).cloned().collect::<Vec<_>>().join("\n")
    );
}

#[test]
fn a_ball_that_rolls_is_no_train_of_impacts() {
    for rate_hz in RATES {
        for speed in [0.2, 1.0, 3.0] {
            let (ground, there) = floor();
            let body = Body::new("ball", Shape::sphere(0.1), 1000.0);
            let weight = body.mass_kg() * G;
            let events = told(vec![ground, body], rate_hz, 2.0, 0.0, |time_s| {
                let turn = DQuat::from_rotation_z(-speed * time_s / 0.1);
                vec![there, transform(DVec3::new(speed * time_s, 0.1, 0.0), turn)]
            });
            assert!(impacts(&events).is_empty());
            let [slides, rolls] = rubs(&events);
            assert!(slides.is_empty() && rolls.len() >= 199, "{} {} {}", rate_hz, slides.len(), rolls.len());
            for roll in rolls {
                assert!((roll.speed_mps - speed).abs() < 0.02 * speed, "{rate_hz} {speed} {roll:?}");
                assert!(
                    (roll.position_m[0] - speed * roll.time_s).abs() < 1e-6
                        && roll.position_m[1].abs() < 1e-6
                );
                if roll.time_s > 0.5 {
                    assert!((roll.force_n - weight).abs() < 1e-3 * weight, "{} {weight}", roll.force_n);
                }
            }
        }
    }
}

#[test]
fn a_block_that_slides_to_rest_is_told_as_such() {
    let (start, friction) = (2.0, 0.4);
    for rate_hz in RATES {
        let (ground, there) = floor();
        let body = Body::new("block", Shape::cuboid([0.15, 0.05, 0.1]), 700.0);
        let weight = body.mass_kg() * G;
        let stops_s = start / (friction * G);
        let events = told(vec![ground, body], rate_hz, 1.5, 0.0, |time_s| {
            let t = time_s.min(stops_s);
            let x = start * t - 0.5 * friction * G * t * t;
            vec![there, transform(DVec3::new(x, 0.05, 0.0), DQuat::from_rotation_y(0.5))]
        });
        assert!(impacts(&events).is_empty(), "{:?}", impacts(&events));
        let [slides, rolls] = rubs(&events);
        assert!(rolls.is_empty());
        let expected = stops_s / 0.01;
        assert!(
            (slides.len() as f64 - expected).abs() < 0.01 * expected + 100.0 / rate_hz,
            "{} {expected}",
            slides.len()
        );
        for slide in &slides {
            let speed = (start - friction * G * slide.time_s).max(0.0);
            assert!((slide.speed_mps - speed).abs() < 0.02 + friction * G / rate_hz, "{slide:?} {speed}");
            if slide.time_s > 0.1 && slide.time_s < stops_s - 0.1 {
                assert!((slide.speed_mps - speed).abs() < 1e-6, "{slide:?} {speed}");
                assert!((slide.force_n - weight).abs() < 0.01 * weight, "{} {weight}", slide.force_n);
            }
        }
    }
}
