//! What listening costs beside the step itself: a pile of boxes, in contact points a second.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou_rapier::Listener;
use rapier3d::prelude::*;

fn main() {
    divan::main();
}

const STEP_S: f64 = 1.0 / 60.0;

/// A wall of boxes that never sleep, after a second.
fn wall(boxes: usize) -> PhysicsWorld {
    let mut world = PhysicsWorld::new();
    world.integration_parameters.dt = STEP_S as f32;
    world
        .colliders
        .insert(ColliderBuilder::cuboid(100.0, 0.5, 100.0).translation(Vector::new(0.0, -0.5, 0.0)));
    for number in 0..boxes {
        let at = Vector::new((number / 10) as f32 * 0.25, 0.1 + 0.2 * (number % 10) as f32, 0.0);
        let body = world.bodies.insert(RigidBodyBuilder::dynamic().translation(at).can_sleep(false));
        world.colliders.insert_with_parent(ColliderBuilder::cuboid(0.1, 0.1, 0.1), body, &mut world.bodies);
    }
    (0..60).for_each(|_| world.step());
    world
}

fn points(world: &PhysicsWorld) -> usize {
    let manifolds = world.narrow_phase.contact_pairs().flat_map(|pair| pair.solver_manifolds());
    manifolds.map(|manifold| manifold.data.solver_contacts.len()).sum()
}

#[divan::bench(args = [10, 100, 1000])]
fn feed(bencher: Bencher, boxes: usize) {
    let world = wall(boxes);
    let mut listener = Listener::new(STEP_S).unwrap_or_else(|fault| panic!("{fault}"));
    let mut step = 0u32;
    bencher.counter(ItemsCount::new(points(&world))).bench_local(|| {
        step += 1;
        let time_s = f64::from(step) * STEP_S;
        listener.feed(time_s, &world.narrow_phase, &world.bodies, &world.colliders).unwrap_or_default();
        black_box(std::iter::from_fn(|| listener.pop()).count())
    });
}

/// The simulation itself, for comparison.
#[divan::bench(args = [10, 100, 1000])]
fn step(bencher: Bencher, boxes: usize) {
    let mut world = wall(boxes);
    bencher.counter(ItemsCount::new(points(&world))).bench_local(|| world.step());
}
