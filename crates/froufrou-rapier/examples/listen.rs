//! A ball that bounces, rolls and rests, and a box that slides: prints what happens, one event a line, as
//! `froufrou events` does.
//!
//!     cargo run --release -p froufrou-rapier --example listen

use froufrou::motion::event;
use froufrou_rapier::Listener;
use rapier3d::prelude::*;

const STEP_S: f64 = 1.0 / 120.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut world = PhysicsWorld::new();
    world.integration_parameters.dt = STEP_S as f32;
    let floor = ColliderBuilder::cuboid(20.0, 0.5, 20.0).translation(Vector::new(0.0, -0.5, 0.0));
    let floor = world.colliders.insert(floor.friction(0.5));
    let ball = RigidBodyBuilder::dynamic()
        .translation(Vector::new(0.0, 1.0, 0.0))
        .linvel(Vector::new(1.0, 0.0, 0.0))
        .angular_damping(1.0);
    let ball = world.bodies.insert(ball);
    let rubber = ColliderBuilder::ball(0.1).mass(0.4).restitution(0.7).friction(0.5);
    world.colliders.insert_with_parent(rubber, ball, &mut world.bodies);
    let crate_ = RigidBodyBuilder::dynamic()
        .translation(Vector::new(0.0, 0.2, 2.0))
        .linvel(Vector::new(3.0, 0.0, 0.0));
    let crate_ = world.bodies.insert(crate_);
    world.colliders.insert_with_parent(
        ColliderBuilder::cuboid(0.3, 0.2, 0.3).mass(8.0).friction(0.5),
        crate_,
        &mut world.bodies,
    );

    let mut listener = Listener::new(STEP_S)?;
    listener.name_collider(floor, "floor");
    listener.name_body(ball, "ball");
    listener.name_body(crate_, "crate");
    let mut out = std::io::stdout().lock();
    for step in 1..=(6.0 / STEP_S) as u32 {
        world.step();
        let time_s = f64::from(step) * STEP_S;
        listener.feed(time_s, &world.narrow_phase, &world.bodies, &world.colliders)?;
        while let Some(found) = listener.pop() {
            event::write(&mut out, &found)?;
        }
    }
    listener.finish();
    while let Some(found) = listener.pop() {
        event::write(&mut out, &found)?;
    }
    Ok(())
}
