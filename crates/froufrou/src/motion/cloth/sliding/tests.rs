use super::*;
use crate::motion::cloth::curvature::Curvature;
use crate::motion::cloth::proximity::Proximity;
use crate::motion::cloth::shapes;
use crate::scene::animation::Mesh;
use glam::DQuat;

/// What a cloth (the first mesh) slides at the times of frames.
fn run(settings: SlidingSettings, times: &[f64], place: impl Fn(f64) -> [Mesh; 2]) -> Vec<Sliding> {
    let mut objects: Vec<Touchable> =
        place(times[0]).iter().map(|mesh| Touchable::new(mesh).expect("a sound mesh")).collect();
    let mut proximity = Proximity::new(0, &objects[0], settings.radius_m, 2.0 * settings.radius_m);
    let mut slides = Slides::new(settings, 0, proximity.vertices());
    let mut curvature = Curvature::default();
    let mut told = Vec::new();
    for &time_s in times {
        for (object, mesh) in objects.iter_mut().zip(place(time_s)) {
            object.follow(&mesh.positions).expect("as many vertices");
        }
        curvature.measure(objects[0].surface(), objects[0].positions());
        let contacts = proximity.contacts(&objects).to_vec();
        slides.feed(time_s, &contacts, &objects, curvature.area_m2(), false);
        let from = told.len();
        told.extend(std::iter::from_fn(|| slides.next_sliding()));
        assert!(told[from..].iter().all(|sliding: &Sliding| sliding.time_s < slides.settled_s()));
    }
    slides.finish(&objects);
    told.extend(std::iter::from_fn(|| slides.next_sliding()));
    assert_eq!(told.iter().map(|sliding| sliding.time_s).collect::<Vec<_>>(), times);
    told
}

fn frames(rate_hz: f64, count: u32) -> Vec<f64> {
    (0..count).map(|frame| f64::from(frame) / rate_hz).collect()
}

fn table() -> Mesh {
    shapes::sheet(3, 3, |u, v| [6.0 * u - 3.0, 0.0, 6.0 * v - 3.0])
}

/// A sheet a centimetre above the table, pushed along it.
fn pushed(along_m: f64, lifted_m: f64) -> Mesh {
    shapes::sheet(6, 6, |u, v| [u - 0.5 + 0.6 * along_m, 0.01 + lifted_m, v - 0.5 + 0.8 * along_m])
}

#[test]
fn the_speed_is_that_along_the_other_alone() {
    // Pushed at 0.5 m/s, rising slowly at the same time.
    let told = run(SlidingSettings::default(), &frames(60.0, 12), |t| [pushed(0.5 * t, 0.02 * t), table()]);
    for sliding in &told {
        assert_eq!(sliding.vertex, (0..49).collect::<Vec<_>>());
        assert!(sliding.speed_mps.iter().all(|s| (s - 0.5).abs() < 1e-4), "{:?}", sliding.speed_mps);
        assert!(sliding.slope_mps2.iter().all(|s| s.abs() < 0.05));
        assert!(sliding.other.iter().all(|other| *other == 1));
        let area: f64 = sliding.area_m2.iter().sum();
        assert!((area - 1.0).abs() < 1e-6);
    }
}

#[test]
fn what_moves_as_one_body_does_not_slide() {
    // Turning at a turn a second, and flying.
    let whirl = |mesh: &Mesh, t: f64| {
        let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 6.0 * t);
        shapes::placed(mesh, turn, 1.0, DVec3::new(3.0 * t, -t, 0.5))
    };
    let settings = SlidingSettings { threshold_mps: 0.0, ..SlidingSettings::default() };
    let rides = |t: f64| [whirl(&pushed(0.0, 0.02), t), whirl(&table(), t)];
    for sliding in run(settings, &frames(60.0, 10), rides) {
        assert!(sliding.speed_mps.iter().all(|s| *s < 1e-3), "{:?}", sliding.speed_mps);
    }
    // On top of that it slides.
    let both = |t: f64| [whirl(&pushed(0.5 * t, 0.02), t), whirl(&table(), t)];
    for sliding in run(settings, &frames(240.0, 10), both) {
        assert!(sliding.speed_mps.iter().all(|s| (s - 0.5).abs() < 5e-3), "{:?}", sliding.speed_mps);
    }
}

#[test]
fn without_a_contact_there_is_no_speed() {
    // It lifts off between 0.2 and 0.3 s, and comes back.
    let height = |t: f64| if (0.2..0.3).contains(&t) { 0.1 } else { 0.0 };
    let told = run(SlidingSettings::default(), &frames(60.0, 40), |t| [pushed(0.5 * t, height(t)), table()]);
    for sliding in &told {
        let touches = height(sliding.time_s) == 0.0;
        assert_eq!(sliding.vertex.is_empty(), !touches, "{}", sliding.time_s);
    }
}

#[test]
fn between_frames_the_speed_is_the_monotone_cubic() {
    // It speeds up, stops, and speeds up again, at uneven times.
    let along = |t: f64| {
        if t < 0.5 {
            t * t
        } else if t < 0.7 {
            0.25
        } else {
            0.25 + 2.0 * (t - 0.7).powi(2)
        }
    };
    let times: Vec<f64> = (0..30).map(|i| 0.033 * f64::from(i) + 0.01 * f64::from(i % 3)).collect();
    let settings = SlidingSettings { threshold_mps: 0.0, ..SlidingSettings::default() };
    let told = run(settings, &times, |t| [pushed(along(t), 0.0), table()]);
    let keys: Vec<f64> = told.iter().map(|sliding| sliding.speed_of(24).0).collect();
    for i in 0..29 {
        let step_s = times[i + 1] - times[i];
        let expected = (along(times[i + 1]) - along(times[i])) / step_s;
        assert!((keys[i] - expected).abs() < 1e-4, "{} {expected}", keys[i]);
        let (low, high) = (keys[i].min(keys[i + 1]), keys[i].max(keys[i + 1]));
        for part in 0..=10 {
            let time_s = times[i] + 0.1 * f64::from(part) * step_s;
            let speed = told[i].speed_between(&told[i + 1], 24, time_s);
            assert!((low - 1e-12..=high + 1e-12).contains(&speed), "{low} {speed} {high}");
        }
        // The slope at a key is that of its neighbours' secants, as in `hermite`.
        if i > 0 && i < 28 {
            let length = |i: usize| times[i + 1] - times[i];
            let secant = |i: usize| (keys[i + 1] - keys[i]) / length(i);
            let slope = hermite::monotone_slope(length(i - 1), length(i), secant(i - 1), secant(i));
            assert!((told[i].speed_of(24).1 - slope).abs() < 1e-12);
        }
    }
    assert_eq!(keys[29], keys[28]);
}

#[test]
fn a_vertex_that_is_never_fast_is_silent_and_another_is_heard_a_while_before() {
    // The sheet turns slowly about its first corner, so that vertices are the faster the further they are from it.
    let turned = |t: f64| {
        let angle = if t < 0.5 { 0.05 * t } else { 0.025 + 0.5 * (t - 0.5) };
        let sheet = shapes::sheet(6, 6, |u, v| [u, 0.01, v]);
        [shapes::placed(&sheet, DQuat::from_rotation_y(angle), 1.0, DVec3::ZERO), table()]
    };
    let settings = SlidingSettings { threshold_mps: 0.2, look_ahead_s: 0.2, ..SlidingSettings::default() };
    let told = run(settings, &frames(50.0, 60), turned);
    let sheet = shapes::sheet(6, 6, |u, v| [u, 0.01, v]);
    for sliding in &told {
        for vertex in 0..49u32 {
            let [x, _, z] = sheet.positions[vertex as usize].map(f64::from);
            let out_m = x.hypot(z);
            // Of two frames a tenth of a second apart nobody can tell in which it was.
            let (is_ever_fast, is_soon_fast) = (0.5 * out_m > 0.201, sliding.time_s > 0.5 - 0.2 - 0.03);
            let is_told = sliding.vertex.binary_search(&vertex).is_ok();
            let is_slow = 0.5 * out_m < 0.199;
            if is_slow || (is_ever_fast && !is_soon_fast) {
                assert!(!is_told, "{vertex} at {}", sliding.time_s);
            } else if is_ever_fast && sliding.time_s > 0.5 - 0.2 + 0.03 {
                assert!(is_told, "{vertex} at {}", sliding.time_s);
            }
        }
    }
}

#[test]
fn the_speed_is_bent_as_asked() {
    let settings = SlidingSettings { scale_mps: 4.0, exponent: 0.5, ..SlidingSettings::default() };
    let told = run(settings, &frames(60.0, 6), |t| [pushed(t, 0.0), table()]);
    assert!(told.iter().flat_map(|s| &s.speed_mps).all(|s| (s - 0.5).abs() < 1e-4));
    // The threshold is of the speed as it is.
    let settings = SlidingSettings { threshold_mps: 1.1, scale_mps: 0.01, ..SlidingSettings::default() };
    let told = run(settings, &frames(60.0, 6), |t| [pushed(t, 0.0), table()]);
    assert!(told.iter().all(|s| s.vertex.is_empty()));
}

#[test]
fn one_frame_has_no_speed_and_two_have_one() {
    let told = run(SlidingSettings::default(), &[0.0, 0.1], |t| [pushed(t, 0.0), table()]);
    assert!(told.iter().all(|s| s.speed_of(10).1 == 0.0 && (s.speed_of(10).0 - 1.0).abs() < 1e-4));
    let objects = [Touchable::new(&pushed(0.0, 0.0)).expect("a sound mesh")];
    let mut slides = Slides::new(SlidingSettings::default(), 0, &[0]);
    slides.feed(0.0, &[None], &objects, &[1.0; 49], false);
    slides.finish(&objects);
    assert_eq!(slides.next_sliding(), None);
}
