use super::super::contacts::LogEvents;
use super::super::event::{Event, Impact};
use super::*;
use crate::random::Random;
use crate::scene::asset::Asset;
use crate::scene::contact_log::{ContactColumns, ContactLog, UpAxis};
use crate::scene::file::Contacts;
use crate::scene::world::RigidBodies;
use proptest::prelude::*;

const RATES_HZ: [f64; 4] = [1000.0, 240.0, 60.0, 30.0];
const G: f64 = 9.81;

/// A log in the making: impulses of body 0 on body 1, collected into steps as an engine does.
struct Steps {
    rate_hz: f64,
    impulses_ns: Vec<f64>,
}

impl Steps {
    fn new(rate_hz: f64, length_s: f64) -> Self {
        Self { rate_hz, impulses_ns: vec![0.0; (length_s * rate_hz) as usize] }
    }

    /// A blow of no duration.
    fn blow(&mut self, time_s: f64, impulse_ns: f64) {
        if let Some(step) = self.impulses_ns.get_mut((time_s * self.rate_hz) as usize) {
            *step += impulse_ns;
        }
    }

    /// A steady force from a time on.
    fn weight(&mut self, from_s: f64, force_n: f64) {
        for (i, step) in self.impulses_ns.iter_mut().enumerate() {
            let end_s = (i + 1) as f64 / self.rate_hz;
            *step += force_n * (end_s - from_s).clamp(0.0, 1.0 / self.rate_hz);
        }
    }

    /// A half sine of a blow: J(t) = J (1 − cos π t/T) / 2.
    fn soft_blow(&mut self, time_s: f64, length_s: f64, impulse_ns: f64) {
        let done = |t: f64| {
            let u = ((t - time_s) / length_s).clamp(0.0, 1.0);
            impulse_ns * (1.0 - (std::f64::consts::PI * u).cos()) / 2.0
        };
        for (i, step) in self.impulses_ns.iter_mut().enumerate() {
            *step += done((i + 1) as f64 / self.rate_hz) - done(i as f64 / self.rate_hz);
        }
    }

    fn rows(&self) -> Vec<ContactRow> {
        let touching = self.impulses_ns.iter().enumerate().filter(|(_, j)| **j > 1e-12);
        touching.map(|(i, j)| row((i + 1) as f64 / self.rate_hz, 0, 1, [0.0; 3], j * self.rate_hz)).collect()
    }
}

fn row(time_s: f64, a: u32, b: u32, position_m: [f64; 3], force_n: f64) -> ContactRow {
    let push = Push::Force(force_n);
    ContactRow {
        time_s,
        a,
        b,
        position_m,
        push,
        normal: None,
        normal_velocity_mps: None,
        sliding_mps: None,
        line: 1,
    }
}

fn blows(rate_hz: f64, rows: &[ContactRow]) -> Result<Vec<Blow>> {
    let mut analyser = Analyser::new(Settings::new(Step::Stamped(1.0 / rate_hz)));
    let mut blows = Vec::new();
    let mut now_s = f64::NEG_INFINITY;
    for row in rows {
        analyser.feed(row, [None; 2])?;
        now_s = row.time_s;
        while let Some(blow) = analyser.next_blow() {
            blows.push(blow);
        }
    }
    let late_s = 0.02f64.max(6.0 / rate_hz) + 2.0 / rate_hz;
    analyser.finish();
    while let Some(blow) = analyser.next_blow() {
        assert!(blow.time_s >= now_s - late_s - 1e-9, "came out later than promised: {blow:?}");
        blows.push(blow);
    }
    assert!(blows.windows(2).all(|w| w[0].time_s <= w[1].time_s));
    Ok(blows)
}

/// Times and impulses of a dropped ball: tₙ₊₁ = tₙ + 2 eⁿ⁺¹ v / g, J = m (1 + e) eⁿ v.
fn bounces(height_m: f64, mass_kg: f64, restitution: f64) -> Vec<(f64, f64)> {
    let mut speed = (2.0 * G * height_m).sqrt();
    let mut time = speed / G;
    let mut bounces = Vec::new();
    while speed > 1e-6 {
        bounces.push((time, mass_kg * (1.0 + restitution) * speed));
        speed *= restitution;
        time += 2.0 * speed / G;
    }
    bounces
}

#[test]
fn a_dropped_ball_is_heard_at_every_bounce_and_then_no_more() -> Result<()> {
    let mass_kg = 0.5;
    for rate_hz in RATES_HZ {
        let all = bounces(1.0, mass_kg, 0.6);
        let mut steps = Steps::new(rate_hz, 5.0);
        all.iter().for_each(|(t, j)| steps.blow(*t, *j));
        if let Some((rest_s, _)) = all.last() {
            steps.weight(*rest_s, mass_kg * G);
        }
        let gap_s = Settings::new(Step::Fixed(1.0 / rate_hz)).gap() + 2.0 / rate_hz;
        let apart = all.windows(2).take_while(|w| w[1].0 - w[0].0 > gap_s).count();
        // The next bounce may come within the same window as this one.
        let clear = apart.min(all.windows(2).take_while(|w| w[1].0 - w[0].0 > 0.005).count());
        let found = blows(rate_hz, &steps.rows())?;
        assert!(clear >= 3 && found.len() >= clear, "{rate_hz}: {clear} {found:?}");
        for ((time_s, impulse_ns), blow) in all.iter().zip(&found).take(clear) {
            assert!((blow.time_s - time_s).abs() <= 0.5001 / rate_hz, "{rate_hz}: {time_s} {blow:?}");
            assert!((blow.impulse_ns / impulse_ns - 1.0).abs() < 1e-9, "{rate_hz}: {impulse_ns} {blow:?}");
        }
        // What follows is one with the last bounce or two, not a rattle.
        assert!(found.len() <= clear + 2, "{rate_hz}: {clear} {found:?}");
    }
    Ok(())
}

#[test]
fn a_soft_blow_keeps_its_impulse_and_its_middle_wherever_it_falls() -> Result<()> {
    for rate_hz in RATES_HZ {
        for i in 0..40 {
            let time_s = 1.0 + f64::from(i) / 40.0 / rate_hz;
            let mut steps = Steps::new(rate_hz, 2.0);
            steps.soft_blow(time_s, 0.004, 0.8);
            let found = blows(rate_hz, &steps.rows())?;
            assert_eq!(found.len(), 1, "{rate_hz} {i}: {found:?}");
            assert!((found[0].impulse_ns - 0.8).abs() < 1e-9, "{rate_hz} {i}: {found:?}");
            let late_s = (found[0].time_s - time_s - 0.002).abs();
            assert!(late_s < if rate_hz > 500.0 { 1e-4 } else { 0.5 / rate_hz }, "{rate_hz} {i}: {late_s}");
        }
    }
    Ok(())
}

#[test]
fn what_lands_and_stays_gives_its_momentum_without_its_weight() -> Result<()> {
    for rate_hz in RATES_HZ {
        let (mass_kg, speed_mps) = (2.0, 1.5);
        // At the end of a step: an engine takes the weight of the whole step.
        let time_s = (0.5 * rate_hz).round() / rate_hz;
        let mut steps = Steps::new(rate_hz, 3.0);
        steps.blow(time_s + 1e-6, mass_kg * speed_mps);
        steps.weight(time_s, mass_kg * G);
        let found = blows(rate_hz, &steps.rows())?;
        assert_eq!(found.len(), 1, "{rate_hz}: {found:?}");
        assert!((found[0].impulse_ns - 3.0).abs() < 1e-6, "{rate_hz}: {found:?}");
    }
    Ok(())
}

#[test]
fn a_blow_on_a_body_at_rest_is_heard_without_its_weight() -> Result<()> {
    for rate_hz in RATES_HZ {
        let mut steps = Steps::new(rate_hz, 2.0);
        steps.weight(0.0, 20.0);
        let impulse_ns = 20.0 * 5.0 / rate_hz.min(200.0);
        steps.blow(1.0 + 0.3 / rate_hz, impulse_ns);
        let found = blows(rate_hz, &steps.rows())?;
        assert_eq!(found.len(), 1, "{rate_hz}: {found:?}");
        assert!((found[0].impulse_ns - impulse_ns).abs() < 1e-6, "{rate_hz}: {found:?}");
        assert!((found[0].time_s - 1.0).abs() < 1.0 / rate_hz, "{rate_hz}: {found:?}");
    }
    Ok(())
}

#[test]
fn resting_and_sliding_bodies_are_silent() -> Result<()> {
    for rate_hz in RATES_HZ {
        let random = Random::new(1, rate_hz as u64);
        for start_s in [0.0, 7.3] {
            let mut rows = Vec::new();
            for i in 0..(4.0 * rate_hz) as u64 {
                // A crate on four corners, whose load wanders between them and jitters as a whole.
                let load = 30.0 * (0.8 + 0.4 * random.uniform(2 * i));
                let share = random.uniform(2 * i + 1);
                for (corner, force) in [share, 1.0 - share, 0.5, 0.5].into_iter().enumerate() {
                    let time_s = start_s + (i + 1) as f64 / rate_hz;
                    rows.push(row(time_s, 0, 1, [corner as f64, 0.0, i as f64 * 0.01], load * force / 2.0));
                }
            }
            let found = blows(rate_hz, &rows)?;
            assert!(found.is_empty(), "{rate_hz} {start_s}: {found:?}");
        }
    }
    Ok(())
}

#[test]
fn a_rolling_ball_whose_contact_flickers_falls_silent() -> Result<()> {
    for rate_hz in RATES_HZ {
        for (seed, duty) in [(1, 0.5), (2, 0.7), (3, 0.9)] {
            let random = Random::new(seed, 0);
            let mut rows = Vec::new();
            let mut owed = 0.0;
            for i in 0..(4.0 * rate_hz) as u64 {
                // Its weight adds up while it does not touch, and it never flies for long.
                owed += 0.5 * G;
                if random.uniform(i) < duty || owed > 0.5 * G * 2.5 {
                    rows.push(row((i + 1) as f64 / rate_hz, 0, 1, [0.0; 3], owed));
                    owed = 0.0;
                }
            }
            let found = blows(rate_hz, &rows)?;
            // How hard it rests cannot be known at its first touches.
            assert!(found.len() <= 3, "{rate_hz} {duty}: {found:?}");
            assert!(found.iter().all(|b| b.time_s < 0.2), "{rate_hz} {duty}: {found:?}");
        }
    }
    Ok(())
}

#[test]
fn impulses_need_no_step_and_forces_take_the_logs_own() -> Result<()> {
    let mut impulse = row(1.0, 0, 1, [0.0; 3], 0.0);
    impulse.push = Push::Impulse(0.7);
    assert_eq!(blows(60.0, &[impulse])?[0].impulse_ns, 0.7);
    // A simulation whose step changes: each force acts for its own step.
    let rows = [
        row(0.999, 5, 6, [0.0; 3], 1.0),
        row(1.0, 0, 1, [0.0; 3], 100.0),
        row(1.0014, 2, 3, [0.0; 3], 100.0),
    ];
    let found: Vec<f64> =
        blows(1000.0, &rows)?.iter().filter(|b| b.bodies[0] < 4).map(|b| b.impulse_ns).collect();
    assert!((found[0] - 0.1).abs() < 1e-9 && (found[1] - 0.14).abs() < 1e-9, "{found:?}");
    Ok(())
}

#[test]
fn the_place_and_normal_are_weighted_by_impulse() -> Result<()> {
    let mut left = row(1.0, 4, 2, [-1.0, 0.0, 0.0], 300.0);
    let mut right = row(1.0, 2, 4, [1.0, 2.0, 0.0], 100.0);
    left.normal = Some([0.0, -1.0, 0.0]);
    right.normal = Some([0.0, 1.0, 0.0]);
    left.normal_velocity_mps = Some(-2.0);
    right.normal_velocity_mps = Some(1.0);
    let found = blows(1000.0, &[left, right])?;
    assert_eq!(found.len(), 1);
    assert!((found[0].position_m[0] + 0.5).abs() < 1e-12 && (found[0].position_m[1] - 0.5).abs() < 1e-12);
    assert_eq!((found[0].bodies, found[0].normal), ([2, 4], Some([0.0, 1.0, 0.0])));
    assert_eq!(found[0].speed_mps, Some(2.0));
    Ok(())
}

#[test]
fn time_that_goes_backwards_is_refused() {
    let rows = [row(1.0, 0, 1, [0.0; 3], 1.0), row(0.9, 0, 1, [0.0; 3], 1.0)];
    assert!(blows(60.0, &rows).is_err_and(|e| e.to_string() == "time goes backwards: 0.9 follows 1"));
}

#[test]
fn pairs_long_apart_are_forgotten() -> Result<()> {
    let mut analyser = Analyser::new(Settings::new(Step::Fixed(0.001)));
    let mut count = 0;
    for i in 0..200_000u32 {
        analyser.feed(&row(f64::from(i) * 0.001, 2 * i, 2 * i + 1, [0.0; 3], 50.0), [None; 2])?;
        while analyser.next_blow().is_some() {
            count += 1;
        }
        assert!(analyser.pairs.len() <= 2048 && analyser.found.len() < 16 && analyser.open.len() < 16);
    }
    assert!(count > 199_000);
    Ok(())
}

/// A crowd of bodies that bounce on, rest on and slide over each other.
fn crowd(seed: u64) -> Vec<ContactRow> {
    let random = Random::new(seed, 9);
    let mut rows = Vec::new();
    for i in 0..600u64 {
        for pair in 0..6u64 {
            let n = 64 * (i * 6 + pair);
            let busy = (i / (20 + 13 * pair)) % 2 == 0;
            if busy && random.uniform(n) < 0.9 {
                let force = 10.0
                    * (0.5 + random.uniform(n + 1))
                    * if random.below(n + 2, 40) == 0 { 40.0 } else { 1.0 };
                for point in 0..=random.below(n + 3, 4) as u64 {
                    let at = std::array::from_fn(|c| random.uniform(n + 8 + 3 * point + c as u64));
                    let mut row = row((i + 1) as f64 * 0.001, pair as u32, pair as u32 + 1, at, force);
                    row.normal_velocity_mps = Some(random.uniform(n + 5) - 0.5);
                    row.normal = Some([0.0, 1.0, 0.0]);
                    rows.push(row);
                }
            }
        }
    }
    rows
}

fn same(a: &[Blow], b: &[Blow]) -> bool {
    let near = |x: f64, y: f64| (x - y).abs() <= 1e-12 * (1.0 + x.abs());
    a.len() == b.len()
        && a.iter().zip(b).all(|(a, b)| {
            near(a.time_s, b.time_s)
                && near(a.impulse_ns, b.impulse_ns)
                && (0..3).all(|n| near(a.position_m[n], b.position_m[n]))
                && a.bodies == b.bodies
                && a.speed_mps == b.speed_mps
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn how_a_log_is_written_does_not_matter(seed in 0u64..1000) {
        let random = Random::new(seed, 1);
        let rows = crowd(seed);
        let plain = blows(1000.0, &rows)?;
        prop_assert!(plain.len() > 5);
        let mut index = 0u64;
        let mut next = || { index += 1; index };

        let mut swapped = rows.clone();
        for row in &mut swapped {
            if random.below(next(), 2) == 0 {
                std::mem::swap(&mut row.a, &mut row.b);
                row.normal = row.normal.map(|n| n.map(|c| -c));
            }
        }
        let found = blows(1000.0, &swapped)?;
        prop_assert!(same(&plain, &found));
        prop_assert!(plain.iter().zip(&found).all(|(a, b)| a.normal == b.normal));

        let mut shuffled = rows.clone();
        shuffled.sort_by_cached_key(|row| ((row.time_s * 1000.0).round() as u64, random.bits(next())));
        prop_assert_eq!(&plain, &blows(1000.0, &shuffled)?);

        let halves: Vec<ContactRow> = rows.iter().flat_map(|row| {
            let Push::Force(force) = row.push else { return vec![row.clone()] };
            let half = ContactRow { push: Push::Force(force / 2.0), ..row.clone() };
            vec![half.clone(), half]
        }).collect();
        prop_assert!(same(&plain, &blows(1000.0, &halves)?));
    }

    #[test]
    fn any_numbers_give_finite_blows(
        values in proptest::collection::vec(
            (prop_oneof![0.0f64..0.01, 0.0f64..1e-300, Just(0.0)], 0u32..3, 0u32..3, -1e30f64..1e30, -1e6f64..1e30, any::<bool>()),
            0..200,
        )
    ) {
        let mut time_s = 0.0;
        let rows: Vec<ContactRow> = values.into_iter().map(|(dt, a, b, x, push, impulse)| {
            time_s += dt;
            let push = if impulse { Push::Impulse(push) } else { Push::Force(push) };
            ContactRow { push, ..row(time_s, a, b, [x, 1.0, -1.0], 0.0) }
        }).collect();
        for blow in blows(1000.0, &rows)? {
            prop_assert!(blow.time_s.is_finite() && blow.impulse_ns > 0.0);
            prop_assert!(blow.position_m.iter().all(|c| c.is_finite()), "{:?}", blow);
        }
    }
}

fn contacts(path: std::path::PathBuf, up: UpAxis) -> Contacts {
    let text = |s: &str| s.to_owned();
    Contacts {
        log: Asset { name: "log.csv".to_owned(), path },
        columns: ContactColumns {
            time: text("t"),
            a: text("bodyA"),
            b: text("bodyB"),
            position: ["px", "py", "pz"].map(text),
            push: Push::Force(text("Fn")),
            normal: Some(["nx", "ny", "nz"].map(text)),
            normal_velocity: Some(text("vrel_n")),
            sliding_velocity: Vec::new(),
            up,
            unit_m: 1.0,
            time_offset_s: 0.0,
        },
        step_s: None,
        gravity_mps2: [0.0, -G, 0.0],
    }
}

fn log_events(text: &str, step_s: Option<f64>) -> Result<Vec<Event>> {
    let fail = |fault| Error::io("write", "log.csv", fault);
    let folder = tempfile::tempdir().map_err(fail)?;
    let path = folder.path().join("log.csv");
    std::fs::write(&path, text).map_err(fail)?;
    LogEvents::open(&Contacts { step_s, ..contacts(path, UpAxis::Y) }, RigidBodies::default())?.collect()
}

#[test]
fn events_name_bodies_in_order_and_the_lines_that_told_of_them() -> Result<()> {
    let header = "t,bodyA,bodyB,px,py,pz,Fn,nx,ny,nz,vrel_n\n";
    let text = format!(
        "{header}1.000,\"zinc, \"\"old\"\"\",Würfel [1],0,0,0,200,0,1,0,-3\n1.001,x,y,0,0,0,9,0,1,0,0\n"
    );
    let events = log_events(&text, Some(0.001))?;
    let Event::Impact(impact) = &events[0] else { panic!() };
    assert_eq!((impact.a.as_str(), impact.b.as_str()), ("Würfel [1]", "zinc, \"old\""));
    assert_eq!(impact.normal, Some([0.0, -1.0, 0.0]));
    assert_eq!(impact.cause.to_string().rsplit(':').next(), Some("2-2"));
    assert_eq!(log_events(header, None)?, []);
    Ok(())
}

#[test]
fn a_log_that_does_not_tell_its_step_is_refused_with_advice() {
    let header = "t,bodyA,bodyB,px,py,pz,Fn,nx,ny,nz,vrel_n\n";
    let row = |t: f64| format!("{t},a,b,0,0,0,200,0,1,0,-3\n");
    let text = |rows: &[f64]| header.to_owned() + rows.iter().map(|t| row(*t)).collect::<String>().as_str();
    for times in [&[0.5, 1.3, 1.9][..], &[0.5][..]] {
        let fault = log_events(&text(times), None).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(fault.contains("log.csv") && fault.contains("`step`"), "{fault}");
        assert_eq!(log_events(&text(times), Some(0.001)).map_or(0, |e| e.len()), times.len());
    }
}

/// The folder of test data, which is not part of the repository.
fn data() -> Option<std::path::PathBuf> {
    let beside = || std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("FROUFROU_DATA").map_or_else(beside, Into::into);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("SKIPPED: no test data at {} (set FROUFROU_DATA)", folder.display());
    None
}

/// Velocities from the log of poses, Z up: (time, body, velocity).
fn velocities(data: &std::path::Path) -> Result<Vec<(f64, String, [f64; 3])>> {
    let path = data.join("contacts/pybullet_mixed_1kHz_poses.csv.gz");
    let file = std::fs::File::open(&path).map_err(|fault| Error::io("open", &path, fault))?;
    let mut reader = csv::Reader::from_reader(flate2::read::MultiGzDecoder::new(file));
    let fail = |fault: csv::Error| Error::new(fault.to_string());
    let mut found = Vec::new();
    for record in reader.records() {
        let record = record.map_err(fail)?;
        let number = |i: usize| record.get(i).and_then(|f| f.parse::<f64>().ok()).unwrap_or(f64::NAN);
        found.push((number(0), record[1].to_owned(), [number(9), number(10), number(11)]));
    }
    Ok(found)
}

/// A ball and a block dropped on a ramp, rolling and sliding down it and on over the ground, where
/// the ball hits a stack of bricks; a coin dropped to spin down.
#[test]
fn the_impacts_of_a_simulated_scene_are_those_of_its_poses() -> Result<()> {
    let Some(data) = data() else { return Ok(()) };
    let path = data.join("contacts/pybullet_mixed_1kHz_contacts.csv.gz");
    let log = LogEvents::open(&contacts(path, UpAxis::Z), RigidBodies::default())?;
    assert!((log.settings().step.typical_s() - 0.001).abs() < 1e-6);
    let impacts: Vec<Impact> = log
        .map(|event| {
            event.map(|event| match event {
                Event::Impact(impact) => impact,
                other => panic!("{other:?}"),
            })
        })
        .collect::<Result<_>>()?;
    for impact in &impacts {
        println!("{:.4} s {} on {}: {:.4} N s", impact.time_s, impact.a, impact.b, impact.impulse_ns);
    }
    let velocities = velocities(&data)?;
    let of = |a: &str, b: &str| -> Vec<&Impact> { impacts.iter().filter(|i| i.a == a && i.b == b).collect() };

    // Masses from the forces at rest; the change of velocity is that of the impulse and gravity.
    for (body, other, mass_kg, time_s) in [
        ("ball", "ramp", 0.5, 0.1435),
        ("block_slide", "ramp", 1.0, 0.1445),
        ("coin", "ground", 0.05, 0.2365),
        ("ball", "ground", 0.5, 1.5205),
    ] {
        let hit =
            of(body.min(other), body.max(other)).into_iter().find(|i| (i.time_s - time_s).abs() < 0.001);
        let Some(hit) = hit else { panic!("{body} does not hit {other} at {time_s}") };
        let mut path = velocities.iter().filter(|(_, name, _)| name == body);
        let Some((before_s, _, before)) = path.clone().rfind(|(t, ..)| *t < hit.time_s - 0.0005) else {
            panic!()
        };
        let Some((after_s, _, after)) = path.find(|(t, ..)| *t > hit.time_s) else { panic!() };
        let fall = [0.0, 0.0, -G * (after_s - before_s)];
        let change = (0..3).map(|n| (after[n] - before[n] - fall[n]).powi(2)).sum::<f64>().sqrt() * mass_kg;
        // Friction changes the velocity too, along the surface: never more than the half here.
        assert!(hit.impulse_ns <= change * 1.03 && hit.impulse_ns > change * 0.9, "{change} {hit:?}");
    }
    // The ball hits the lowest brick at its own height and lifts off, and the stack hums no more.
    let on_stack = of("ball", "brick0");
    assert!((on_stack[0].time_s - 1.9135).abs() < 1e-6 && (on_stack[0].position_m[1] - 0.06).abs() < 0.001);
    assert!(impacts.iter().all(|i| i.time_s < 2.0), "all has come to rest by then");
    // The bricks start 1 mm apart and fall onto each other from the bottom up, once.
    for pair in [("brick0", "brick1"), ("brick1", "brick2"), ("brick2", "brick3"), ("brick3", "brick4")] {
        let hits = of(pair.0, pair.1);
        assert!((1..=3).contains(&hits.len()) && hits.iter().all(|i| i.time_s < 0.04), "{pair:?} {hits:?}");
    }
    // Rolling and sliding down the ramp is silent.
    let ramp = impacts.iter().filter(|i| i.b == "ramp" && i.time_s > 0.2).count();
    assert_eq!(ramp, 0);
    // The coin rattles only while it settles.
    assert!(of("coin", "ground").iter().all(|i| i.time_s < 0.6));
    assert!((15..40).contains(&impacts.len()), "{}", impacts.len());
    Ok(())
}

/// The same scene logged at lower rates: the force of a step is then the mean over it.
#[test]
fn the_great_impacts_are_found_in_logs_of_any_rate() -> Result<()> {
    let Some(data) = data() else { return Ok(()) };
    let contacts = contacts(data.join("contacts/pybullet_mixed_1kHz_contacts.csv.gz"), UpAxis::Z);
    let mut log = ContactLog::open(&contacts.log.path, &contacts.columns)?;
    let rows: Vec<ContactRow> = log.by_ref().collect::<Result<_>>()?;
    let number = |name: &str| log.bodies().iter().position(|b| &**b == name).unwrap_or(usize::MAX) as u32;
    for every in [4u64, 16, 33] {
        let rate_hz = 1000.0 / every as f64;
        let slow: Vec<ContactRow> = rows
            .iter()
            .map(|row| {
                let Push::Force(force) = row.push else { return row.clone() };
                let step = ((row.time_s * 1000.0).round() as u64).div_ceil(every);
                let time_s = step as f64 / rate_hz;
                ContactRow { time_s, push: Push::Force(force / every as f64), ..row.clone() }
            })
            .collect();
        let found = blows(rate_hz, &slow)?;
        for (a, b, mass_kg, time_s, impulse_ns) in [
            ("ball", "ramp", 0.5, 0.1435, 0.768),
            ("block_slide", "ramp", 1.0, 0.1445, 1.545),
            ("coin", "ground", 0.05, 0.2365, 0.119),
            ("ball", "ground", 0.5, 1.5205, 0.757),
            ("ball", "brick0", 0.5, 1.9135, 0.582),
        ] {
            let pair = [number(a).min(number(b)), number(a).max(number(b))];
            let near =
                |blow: &&Blow| blow.bodies == pair && (blow.time_s - time_s).abs() < 1.0 / rate_hz + 0.001;
            let Some(hit) = found.iter().find(near) else { panic!("{rate_hz}: {a} on {b}: {found:?}") };
            // A log cannot tell what of the first step was weight, nor two blows in one step apart.
            let tolerance_ns = 0.12 * impulse_ns + mass_kg * G / rate_hz;
            assert!((hit.impulse_ns - impulse_ns).abs() < tolerance_ns, "{rate_hz}: {a} on {b}: {hit:?}");
        }
        assert!(found.iter().all(|b| b.time_s < 2.1), "{rate_hz}: {found:?}");
    }
    Ok(())
}
