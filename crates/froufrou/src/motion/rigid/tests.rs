use super::*;
use crate::motion::event::{Impact, Rub};
use crate::motion::rub::Rubbing;
use crate::scene::animation::Mesh;
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
    events.iter().filter_map(Event::impact).collect()
}

fn rubs(events: &[Event]) -> [Vec<&Rub>; 2] {
    let mut rubs = [Vec::new(), Vec::new()];
    for (how, rub) in events.iter().filter_map(Event::rub) {
        rubs[usize::from(how == Rubbing::Roll)].push(rub);
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

/// A bowling ball that skids at first and then rolls: how far it has come and turned, and when it rolls.
fn bowled(start_mps: f64, friction: f64, radius: f64, time_s: f64) -> (f64, f64, f64) {
    let rolls_s = 2.0 * start_mps / (7.0 * friction * G);
    let t = time_s.min(rolls_s);
    let (x, turn) = (start_mps * t - 0.5 * friction * G * t * t, 0.5 * 2.5 * friction * G / radius * t * t);
    let speed = start_mps - friction * G * rolls_s;
    let on = (time_s - rolls_s).max(0.0);
    (x + speed * on, turn + speed / radius * on, rolls_s)
}

#[test]
fn skidding_and_rolling_are_told_apart_for_most_of_the_time() {
    for rate_hz in RATES {
        for (start_mps, friction) in [(7.0, 0.12), (3.0, 0.3), (1.0, 0.05)] {
            let (radius, lasts_s) = (0.108, 4.0);
            let (ground, there) = floor();
            let ball = Body::new("ball", Shape::sphere(radius), 1300.0);
            let events = told(vec![ball, ground], rate_hz, lasts_s, 0.0, |time_s| {
                let (x, turn, _) = bowled(start_mps, friction, radius, time_s);
                vec![transform(DVec3::new(x, radius, 0.0), DQuat::from_rotation_z(-turn)), there]
            });
            assert!(impacts(&events).is_empty());
            let mut right = 0;
            for event in &events {
                let time_s = event.time_s();
                let (_, _, rolls_s) = bowled(start_mps, friction, radius, time_s);
                // Slip is start − 3.5 μ g t, and the speed over both surfaces (v + ω r)/2.
                let t = time_s.min(rolls_s);
                let slip_mps = start_mps - 3.5 * friction * G * t;
                let rolling_mps = start_mps - friction * G * t - 0.5 * slip_mps;
                let slides = slip_mps > crate::motion::rub::MOST_CREEP * rolling_mps;
                right += usize::from(slides == matches!(event, Event::Slide(_)));
            }
            let all = (lasts_s / 0.01) as usize;
            assert!(right as f64 >= 0.95 * all as f64, "{rate_hz} Hz, {start_mps} m/s: {right} of {all}");
        }
    }
}

/// A ball of longitudes and latitudes, as modelling programs make it.
fn uv_sphere(radius: f64, segments: u32, rings: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for ring in 0..=rings {
        for segment in 0..segments {
            let (polar, around) = (
                std::f64::consts::PI * f64::from(ring) / f64::from(rings),
                std::f64::consts::TAU * f64::from(segment) / f64::from(segments),
            );
            let at = DVec3::new(polar.sin() * around.cos(), polar.cos(), polar.sin() * around.sin()) * radius;
            mesh.positions.push(at.to_array().map(|c| c as f32));
        }
    }
    for ring in 0..rings {
        for segment in 0..segments {
            let next = (segment + 1) % segments;
            let (above, below) = (ring * segments, (ring + 1) * segments);
            mesh.face_vertices.extend([above + segment, above + next, below + next, below + segment]);
            mesh.face_sizes.push(4);
        }
    }
    mesh
}

#[test]
fn meshes_of_any_resolution_are_told_alike() {
    let ball = Bouncing { drop_m: 0.5, restitution: 0.6 };
    let expected = ball.hits(LEAST_IMPACT_MPS * 1.02);
    for (segments, rings) in [(16, 12), (32, 16), (64, 48)] {
        let body = Body::from_mesh("ball", &uv_sphere(0.1, segments, rings), &upright(0.0, 0.0, 0.0), 500.0)
            .unwrap();
        let Kind::Sphere(radius) = body.shape().kind() else { panic!("{:?}", body.shape()) };
        assert!((radius - 0.1).abs() < 1e-4, "{radius}");
        let (ground, there) = floor();
        // It spins as it falls, and rolls in the end.
        let events = told(vec![body, ground], 24.0, 4.0, 0.0, |time_s| {
            let turn = DQuat::from_rotation_z(-10.0 * time_s);
            vec![transform(DVec3::new(time_s, 0.1 + ball.height(time_s), 0.0), turn), there]
        });
        let found = impacts(&events);
        assert_eq!(found.len(), expected.len(), "{segments}");
        assert!(found.iter().zip(&expected).all(|(impact, hit)| (impact.time_s - hit.0).abs() < 1e-3));
        let [slides, rolls] = rubs(&events);
        assert!(slides.is_empty() && rolls.len() > 150, "{} {}", slides.len(), rolls.len());
    }
    // A die is no ball, whatever its corners.
    let cube = uv_sphere(0.1, 4, 2);
    let body = Body::from_mesh("die", &cube, &upright(0.0, 0.0, 0.0), 500.0).unwrap();
    assert_eq!(body.shape().kind(), Kind::Hull);
}

/// A square of two triangles, as floors are made.
fn sheet() -> Mesh {
    Mesh {
        positions: vec![[-9.0, 0.0, -9.0], [-9.0, 0.0, 9.0], [9.0, 0.0, 9.0], [9.0, 0.0, -9.0]],
        face_vertices: vec![0, 1, 2, 3],
        face_sizes: vec![4],
    }
}

#[test]
fn a_floor_without_thickness_and_a_scaled_mirrored_ball_do_as_well() {
    let ball = Bouncing { drop_m: 0.8, restitution: 0.55 };
    let expected = ball.hits(LEAST_IMPACT_MPS * 1.02);
    let scaled = |at: [f64; 3]| {
        [[-2.0, 0.0, 0.0, at[0]], [0.0, 2.0, 0.0, at[1]], [0.0, 0.0, 2.0, at[2]], [0.0, 0.0, 0.0, 1.0]]
    };
    let mesh = uv_sphere(0.1, 32, 16);
    let body = Body::from_mesh("ball", &mesh, &scaled([0.0; 3]), 1000.0).unwrap();
    assert!((body.mass_kg() - 4.18879).abs() < 0.02, "{}", body.mass_kg());
    let ground = Body::from_mesh("floor", &sheet(), &upright(0.0, 0.0, 0.0), 1000.0).unwrap().fixed();
    assert_eq!(ground.shape().kind(), Kind::Triangles);
    for rate_hz in RATES {
        let events = told(vec![ground.clone(), body.clone()], rate_hz, 3.0, 0.0, |time_s| {
            vec![upright(0.0, 0.0, 0.0), scaled([0.3, 0.1 + ball.height(time_s), 0.2])]
        });
        let found = impacts(&events);
        assert_eq!(found.len(), expected.len(), "{rate_hz}: {found:?}");
        assert!(found.iter().zip(&expected).all(|(impact, hit)| (impact.time_s - hit.0).abs() < 1e-3));
        let [slides, rolls] = rubs(&events);
        assert!(slides.is_empty() && rolls.is_empty());
    }
}

#[test]
fn two_balls_that_meet_in_the_air_exchange_what_they_must() {
    for rate_hz in RATES {
        let small = Body::new("small", Shape::sphere(0.1), 1000.0).weighing(1.0);
        let large = Body::new("large", Shape::sphere(0.2), 1000.0).weighing(3.0);
        let (hit_s, restitution) = (0.511, 0.7);
        // Both fall, at ±1 m/s along x; where they meet they are 0.3 m apart.
        let reduced = 0.75;
        let impulse = reduced * 2.0 * (1.0 + restitution);
        let events = told(vec![small, large], rate_hz, 1.0, 0.0, |time_s| {
            let y = 10.0 - 0.5 * G * time_s * time_s;
            let since = time_s - hit_s;
            let after = |before: f64, change: f64| before * since + change * since.max(0.0);
            let (a, b) = (after(1.0, -impulse), 0.3 + after(-1.0, impulse / 3.0));
            vec![upright(a, y, 0.0), upright(b, y, 0.0)]
        });
        let [Event::Impact(impact)] = &events[..] else { panic!("{events:?}") };
        assert!((impact.time_s - hit_s).abs() < 1e-6, "{impact:?}");
        assert!((impact.impulse_ns - impulse).abs() < 1e-4, "{impact:?} {impulse}");
        assert!((impact.speed_mps.unwrap() - 2.0).abs() < 1e-4);
        // From `large`, which comes first by its name, to `small`.
        assert_eq!(impact.a, "large");
        assert!((DVec3::from(impact.normal.unwrap()) - DVec3::NEG_X).length() < 1e-6);
        let on = impact.on_m.unwrap().map(DVec3::from);
        assert!((on[0] - DVec3::NEG_X * 0.2).length() < 1e-4 && (on[1] - DVec3::X * 0.1).length() < 1e-4);
    }
}

#[test]
fn what_stands_hangs_or_is_animated_through_others_is_silent() {
    let cube = |name: &str| Body::new(name, Shape::cuboid([0.1; 3]), 500.0);
    for rate_hz in RATES {
        // A tower of five, with the noise of a solver; a lamp; two bodies that turn through each other.
        let mut bodies: Vec<Body> = (0..5).map(|i| cube(&format!("box{i}"))).collect();
        bodies.extend([cube("lamp"), cube("arm"), cube("hand")]);
        let (ground, there) = floor();
        bodies.push(ground);
        let events = told(bodies, rate_hz, 3.0, 0.0, |time_s| {
            let noise = |i: i32| 2e-5 * (f64::from(i) * 7.1 + time_s * 991.0).sin();
            let mut poses: Vec<Transform> = (0..5)
                .map(|i| upright(noise(i), 0.1 + 0.2 * f64::from(i) + noise(i + 9), noise(i + 5)))
                .collect();
            poses.push(upright(3.0, 2.0, 0.0));
            let sway = (4.0 * time_s).sin();
            poses.push(transform(DVec3::new(-3.0, 1.0, 0.0), DQuat::from_rotation_x(sway)));
            poses.push(transform(DVec3::new(-2.9, 1.0, 0.05 * sway), DQuat::from_rotation_y(time_s)));
            poses.push(there);
            poses
        });
        assert!(events.is_empty(), "{rate_hz}: {} {:?}", events.len(), events.first());
    }
}

#[test]
fn jumps_hit_nothing_on_their_way() {
    let (ground, there) = floor();
    let ball = Body::new("ball", Shape::sphere(0.1), 500.0);
    let wall = Body::new("wall", Shape::cuboid([0.05, 1.0, 1.0]), 500.0).fixed();
    // It lies on one side of a wall, then on the other.
    let events = told(vec![ball, ground, wall], 24.0, 2.0, 0.0, |time_s| {
        vec![upright(if time_s < 1.0 { -2.0 } else { 2.0 }, 0.1, 0.0), there, upright(0.0, 1.0, 0.0)]
    });
    assert!(events.is_empty(), "{events:?}");
}

#[test]
fn bad_frames_are_named_and_short_animations_say_nothing() {
    let ball = || Body::new("ball", Shape::sphere(0.1), 500.0);
    let mut analyser = Analyser::new(vec![ball()], GRAVITY);
    analyser.feed(0.0, &[upright(0.0, 1.0, 0.0)]).unwrap();
    let fault = analyser.feed(0.04, &[upright(f64::NAN, 1.0, 0.0)]).unwrap_err().to_string();
    assert!(fault.contains("ball") && fault.contains("0.04 s"), "{fault}");
    let mut grown = upright(0.0, 1.0, 0.0);
    (0..3).for_each(|i| grown[i][i] = 1.5);
    let fault = analyser.feed(0.04, &[grown]).unwrap_err().to_string();
    assert!(fault.contains("size") && fault.contains("ball"), "{fault}");
    assert!(analyser.feed(0.0, &[upright(0.0, 1.0, 0.0)]).is_err());
    assert!(analyser.feed(f64::NAN, &[upright(0.0, 1.0, 0.0)]).is_err());
    assert!(analyser.feed(0.04, &[]).is_err());
    for frames in 0..4 {
        let mut analyser = Analyser::new(vec![ball(), floor().0], GRAVITY);
        for frame in 0..frames {
            analyser.feed(f64::from(frame) / 24.0, &[upright(0.0, 0.1, 0.0), floor().1]).unwrap();
        }
        analyser.finish();
        assert_eq!(analyser.next_event(), None);
    }
    let empty = Body::from_mesh("nothing", &Mesh::default(), &upright(0.0, 0.0, 0.0), 1.0).unwrap_err();
    assert!(empty.to_string().contains("nothing"), "{empty}");
    let flat = Mesh { face_vertices: vec![0, 0, 1], face_sizes: vec![3], ..sheet() };
    assert!(Body::from_mesh("line", &flat, &upright(0.0, 0.0, 0.0), 1.0).is_err());
    let wrong = Mesh { face_vertices: vec![0, 1, 9], face_sizes: vec![3], ..sheet() };
    assert!(Body::from_mesh("wrong", &wrong, &upright(0.0, 0.0, 0.0), 1.0).is_err());
    let short = Mesh { face_sizes: vec![400], ..sheet() };
    assert!(Body::from_mesh("short", &short, &upright(0.0, 0.0, 0.0), 1.0).is_err());
    let nan = Mesh { positions: vec![[f32::NAN; 3]; 4], ..sheet() };
    assert!(Body::from_mesh("nan", &nan, &upright(0.0, 0.0, 0.0), 1.0).is_err());
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(48))]
    /// Whatever is fed, what is told are numbers, in order of time, and the memory stays with the bodies.
    #[test]
    fn any_motion_is_survived(seed in 0u64..u64::MAX, bodies in 1usize..7, reach in 0.05..5.0f64) {
        let random = |i: usize| {
            let mut x = seed ^ (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        };
        let shape = |i: usize| match i % 4 {
            0 => Body::new(&format!("b{i}"), Shape::sphere(0.05 + random(i)), 300.0),
            1 => Body::new(&format!("b{i}"), Shape::cuboid([0.1, 0.05 + random(i), 0.3]), 300.0),
            2 => Body::from_mesh(&format!("b{i}"), &uv_sphere(0.3, 5, 3), &upright(0.0, 0.0, 0.0), 300.0).unwrap(),
            _ => Body::from_mesh(&format!("b{i}"), &sheet(), &upright(0.0, 0.0, 0.0), 300.0).unwrap(),
        };
        let make = || Analyser::new((0..bodies).map(shape).collect(), GRAVITY);
        let run = || {
            let mut analyser = make();
            let mut events = Vec::new();
            for frame in 0..30 {
                let poses: Vec<Transform> = (0..bodies).map(|body| {
                    let r = |k: usize| random(1000 + (frame * bodies + body) * 8 + k) - 0.5;
                    let turn = DQuat::from_xyzw(r(0), r(1), r(2), r(3) + 0.01).normalize();
                    transform(DVec3::new(r(4), r(5), r(6)) * reach, turn)
                }).collect();
                analyser.feed(f64::from(frame as u32) / 24.0, &poses).unwrap();
                events.extend(std::iter::from_fn(|| analyser.next_event()));
                assert!(analyser.near_pairs() <= bodies * bodies);
            }
            analyser.finish();
            events.extend(std::iter::from_fn(|| analyser.next_event()));
            events
        };
        let events = run();
        for event in &events {
            crate::motion::event::write(&mut Vec::new(), event).unwrap();
        }
        proptest::prop_assert!(events.is_sorted_by(|a, b| a.time_s() <= b.time_s()));
        proptest::prop_assert_eq!(events, run());
    }
}
