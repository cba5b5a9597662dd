//! Simulations whose ends are known: what bounces, rolls, slides and rests, against closed forms.

use froufrou::motion::Event;
use froufrou::motion::event::{Cause, Impact, Rub};
use froufrou::motion::rub::Rubbing;
use froufrou_rapier::Listener;
use rapier3d::prelude::*;

const G: f64 = 9.81;

/// A floor and what is on it.
struct Stage {
    world: PhysicsWorld,
    listener: Listener,
    step_s: f64,
}

impl Stage {
    fn new(rate_hz: f64) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::new(0.0, -G as f32, 0.0);
        world.integration_parameters.dt = (1.0 / rate_hz) as f32;
        let floor = ColliderBuilder::cuboid(50.0, 0.5, 50.0).translation(Vector::new(0.0, -0.5, 0.0));
        let floor = world.colliders.insert(floor.friction(0.5).restitution(0.0));
        let mut listener = Listener::new(1.0 / rate_hz).unwrap();
        listener.name_collider(floor, "floor");
        Self { world, listener, step_s: 1.0 / rate_hz }
    }

    fn add(&mut self, name: &str, body: RigidBodyBuilder, collider: ColliderBuilder) -> RigidBodyHandle {
        let body = self.world.bodies.insert(body.can_sleep(false));
        self.world.colliders.insert_with_parent(collider, body, &mut self.world.bodies);
        self.listener.name_body(body, name);
        body
    }

    fn run(&mut self, seconds: f64) -> Vec<Event> {
        let mut events: Vec<Event> = Vec::new();
        for step in 1..=(seconds / self.step_s).round() as u32 {
            self.world.step();
            let time_s = f64::from(step) * self.step_s;
            let (narrow, bodies, colliders) =
                (&self.world.narrow_phase, &self.world.bodies, &self.world.colliders);
            self.listener.feed(time_s, narrow, bodies, colliders).expect("a step");
            events.extend(std::iter::from_fn(|| self.listener.pop()));
        }
        self.listener.finish();
        events.extend(std::iter::from_fn(|| self.listener.pop()));
        assert!(events.is_sorted_by(|a, b| a.time_s() <= b.time_s()));
        events
    }
}

fn impacts(events: &[Event]) -> Vec<&Impact> {
    events.iter().filter_map(Event::impact).collect()
}

fn ball(restitution: f64) -> ColliderBuilder {
    let rule = CoefficientCombineRule::Max;
    ColliderBuilder::ball(0.05).mass(0.3).restitution(restitution as f32).restitution_combine_rule(rule)
}

#[test]
fn a_ball_bounces_when_and_as_hard_as_it_must() {
    for (rate_hz, restitution) in [(60.0, 0.6), (60.0, 0.0), (240.0, 0.6), (1000.0, 0.6)] {
        let mut stage = Stage::new(rate_hz);
        let fall_m: f64 = 0.8;
        let at = Vector::new(0.0, (fall_m + 0.05) as f32, 0.0);
        stage.add("ball", RigidBodyBuilder::dynamic().translation(at), ball(restitution));
        let events = stage.run(4.0);
        let impacts = impacts(&events);
        let speed = (2.0 * G * fall_m).sqrt();
        let (mut time_s, mut fast) = (speed / G, speed);
        let mut worst_steps: f64 = 0.0;
        let bounces = if restitution > 0.0 { 4 } else { 1 };
        for (number, impact) in impacts.iter().take(bounces).enumerate() {
            let impulse_ns = 0.3 * (1.0 + restitution) * fast;
            let steps = (impact.time_s - time_s) / stage.step_s;
            println!(
                "{rate_hz} Hz, e = {restitution}, bounce {number}: {steps:+.2} steps, impulse {:+.1} %, speed {:+.1} %",
                100.0 * (impact.impulse_ns / impulse_ns - 1.0),
                100.0 * (impact.speed_mps.unwrap_or(0.0) / fast - 1.0)
            );
            worst_steps = worst_steps.max(steps.abs() / (number + 1) as f64);
            assert_eq!((impact.a.as_str(), impact.b.as_str()), ("ball", "floor"));
            // Each bounce begins where the step before it ended: errors of a step each add up.
            assert!(steps.abs() <= 1.0 + 1.5 * number as f64, "{steps}");
            let tolerance = 0.02 + 3.0 * G * stage.step_s / fast;
            assert!((impact.impulse_ns / impulse_ns - 1.0).abs() < tolerance, "{impact:?} {impulse_ns}");
            let Cause::Motion(moved) = &impact.cause else { panic!("{impact:?}") };
            assert!(moved.from_s <= impact.time_s && impact.time_s <= moved.to_s, "{impact:?}");
            let on = impact.on_m.expect("a body")[0];
            assert!((on[1] + 0.05).abs() < 0.01, "{on:?}");
            fast *= restitution;
            time_s += 2.0 * fast / G;
        }
        assert!(impacts.len() >= bounces, "{}", impacts.len());
        // It does not tremble at rest.
        assert!(impacts.iter().all(|impact| impact.time_s < 3.0), "{:?}", impacts.last());
        if restitution == 0.0 {
            assert!(impacts.len() <= 2, "{impacts:?}");
        }
        // All that stopped it: m (v + v' + v' + ...) at every bounce, which is m (1 + e) v at each.
        println!("{rate_hz} Hz: {} impacts, worst {worst_steps:.2} steps a bounce", impacts.len());
        assert!(events.iter().all(|e| e.impact().is_some()), "nothing rubs");
    }
}

fn moments(events: &[Event], from_s: f64) -> (Vec<&Rub>, Vec<&Rub>) {
    let late = events.iter().filter(|event| event.time_s() > from_s).filter_map(Event::rub);
    let (slides, rolls): (Vec<_>, Vec<_>) = late.partition(|(how, _)| *how == Rubbing::Slide);
    let rubs = |moments: Vec<(Rubbing, _)>| moments.into_iter().map(|(_, rub)| rub).collect();
    (rubs(slides), rubs(rolls))
}

#[test]
fn a_ball_that_is_pushed_skids_and_then_rolls() {
    for rate_hz in [60.0, 240.0] {
        let mut stage = Stage::new(rate_hz);
        let body = RigidBodyBuilder::dynamic()
            .translation(Vector::new(0.0, 0.05, 0.0))
            .linvel(Vector::new(2.0, 0.0, 0.0));
        stage.add("ball", body, ball(0.0).friction(0.5));
        let events = stage.run(1.5);
        let (slides, rolls) = moments(&events, 0.0);
        // It skids for 2 v / 7 μ g and then goes on at 5/7 v.
        let skids_s = 2.0 * 2.0 / (7.0 * 0.5 * G);
        println!("{rate_hz} Hz: {} slide, {} roll, skids for {skids_s:.3} s", slides.len(), rolls.len());
        let last = slides.last().expect("a slide").time_s;
        assert!(last < skids_s + 0.02 && last > 0.4 * skids_s, "{last} {skids_s}");
        let share = rolls.len() as f64 * rolls[0].lasts_s / (1.5 - skids_s);
        assert!(share > 0.95, "{share}");
        for roll in rolls.iter().filter(|roll| roll.time_s > skids_s + 0.1) {
            assert!((roll.speed_mps / (2.0 * 5.0 / 7.0) - 1.0).abs() < 0.03, "{roll:?}");
            assert!((roll.force_n / (0.3 * G) - 1.0).abs() < 0.15, "{roll:?}");
        }
        assert!(impacts(&events).len() <= 1, "rolling is no train of impacts: {:?}", impacts(&events));
    }
}

#[test]
fn a_box_slides_until_it_rests_in_silence() {
    for rate_hz in [60.0, 240.0] {
        let mut stage = Stage::new(rate_hz);
        let body = RigidBodyBuilder::dynamic()
            .translation(Vector::new(0.0, 0.05, 0.0))
            .linvel(Vector::new(2.0, 0.0, 0.0));
        let collider = ColliderBuilder::cuboid(0.2, 0.05, 0.2).mass(2.0).friction(0.5);
        stage.add("box", body, collider);
        let events = stage.run(2.0);
        let (slides, rolls) = moments(&events, 0.0);
        let slid_s = 2.0 / (0.5 * G);
        println!("{rate_hz} Hz: {} slide, {} roll, slides for {slid_s:.3} s", slides.len(), rolls.len());
        assert!(rolls.is_empty());
        let last = slides.last().expect("a slide").time_s;
        assert!((last - slid_s).abs() < 0.05, "{last} {slid_s}");
        for slide in slides.iter().filter(|s| s.time_s > 0.05 && s.time_s < slid_s - 0.05) {
            let speed = 2.0 - 0.5 * G * slide.time_s;
            assert!((slide.speed_mps - speed).abs() < 0.05 + 0.5 * G * stage.step_s, "{slide:?} {speed}");
            assert!((slide.force_n / (2.0 * G) - 1.0).abs() < 0.1, "{slide:?}");
        }
    }
}

#[test]
fn a_stack_at_rest_is_silent_also_asleep() {
    let mut stage = Stage::new(60.0);
    for level in 0..5 {
        let at = Vector::new(0.0, 0.1 + 0.2 * level as f32, 0.0);
        let body = stage.world.bodies.insert(RigidBodyBuilder::dynamic().translation(at));
        let collider = ColliderBuilder::cuboid(0.1, 0.1, 0.1);
        stage.world.colliders.insert_with_parent(collider, body, &mut stage.world.bodies);
    }
    let events = stage.run(10.0);
    assert!(events.iter().all(|event| event.time_s() < 0.5), "{:?}", events.last());
}

#[test]
fn a_time_that_is_none_is_refused() {
    let mut stage = Stage::new(60.0);
    let world = &stage.world;
    let mut feed = |time_s| stage.listener.feed(time_s, &world.narrow_phase, &world.bodies, &world.colliders);
    assert!(feed(0.5).is_ok());
    assert!(feed(0.4).is_err_and(|fault| fault.to_string().contains("backwards")));
    assert!(feed(f64::NAN).is_err());
}
