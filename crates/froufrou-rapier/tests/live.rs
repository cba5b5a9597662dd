//! A simulation that is heard while it runs sounds as what was found in it before.

#[path = "../../froufrou/tests/studio/mod.rs"]
mod studio;

use froufrou::motion::Event;
use froufrou::render::live::{Capture, EngineSettings, Left, Refused};
use froufrou::scene::Scene;
use froufrou::scene::fed::FedPose;
use froufrou_rapier::{Listener, Live, Teller};
use rapier3d::prelude::*;
use studio::{Studio, noise};

const STEP_S: f64 = 1.0 / 120.0;
const RATE_HZ: u32 = 48_000;

/// Balls that fall and roll on a floor, and a box that slides; one ball comes while it runs, and one goes.
struct Stage {
    world: PhysicsWorld,
    step: u32,
    bodies: Vec<(RigidBodyHandle, &'static str)>,
    floor: ColliderHandle,
}

impl Stage {
    fn new() -> Self {
        let mut world = PhysicsWorld::new();
        world.integration_parameters.dt = STEP_S as f32;
        let floor = ColliderBuilder::cuboid(20.0, 0.5, 20.0).translation(Vector::new(0.0, -0.5, 0.0));
        let floor = world.colliders.insert(floor.friction(0.5).restitution(0.5));
        let mut stage = Self { world, step: 0, bodies: Vec::new(), floor };
        let at = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 0.25, 0.0));
        stage.add("ball", at.linvel(Vector::new(1.0, 0.0, 0.0)), ColliderBuilder::ball(0.05).mass(0.3));
        let at = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 0.1, 1.0));
        let box_ = ColliderBuilder::cuboid(0.2, 0.1, 0.2).mass(2.0).friction(0.5);
        stage.add("crate", at.linvel(Vector::new(2.0, 0.0, 0.0)), box_);
        stage
    }

    fn add(&mut self, name: &'static str, body: RigidBodyBuilder, collider: ColliderBuilder) {
        let body = self.world.bodies.insert(body);
        self.world.colliders.insert_with_parent(collider.restitution(0.5), body, &mut self.world.bodies);
        self.bodies.push((body, name));
    }

    /// Goes on by a step; gives its end and who came with it.
    fn go_on(&mut self) -> (f64, Option<(RigidBodyHandle, &'static str)>) {
        self.step += 1;
        let mut came = None;
        if self.step == 60 {
            let at = RigidBodyBuilder::dynamic().translation(Vector::new(-0.5, 0.4, 0.0));
            self.add("ball 2", at, ColliderBuilder::ball(0.03).mass(0.1));
            came = self.bodies.last().copied();
        }
        if self.step == 150 {
            let (ball, _) = self.bodies.remove(0);
            self.world.remove_body(ball);
        }
        self.world.step();
        (f64::from(self.step) * STEP_S, came)
    }
}

const STEPS: u32 = 240;

/// What is found in the simulation, first to last.
fn events() -> Vec<Event> {
    let (mut stage, mut listener, mut events) = (Stage::new(), Listener::new(STEP_S).unwrap(), Vec::new());
    stage.bodies.iter().for_each(|(body, name)| listener.name_body(*body, *name));
    listener.name_collider(stage.floor, "floor");
    for _ in 0..STEPS {
        let (time_s, came) = stage.go_on();
        if let Some((body, name)) = came {
            listener.name_body(body, name);
        }
        let world = &stage.world;
        listener.feed(time_s, &world.narrow_phase, &world.bodies, &world.colliders).unwrap();
        events.extend(std::iter::from_fn(|| listener.pop()));
    }
    listener.finish();
    events.extend(std::iter::from_fn(|| listener.pop()));
    events
}

fn scene(studio: &Studio) -> String {
    for (name, seed) in [("hit 1.wav", 1), ("hit 2.wav", 2)] {
        studio.recording(name, 48_000, &noise(4_800, seed).iter().map(|s| 0.1 * s).collect::<Vec<_>>());
    }
    "seed = 5\n[listener]\nposition = [0, 1, 2]\nlayout = 'stereo'\n\
     [instrument]\nbar = { kind = 'free-bar', with = { frequency = 523, damping = 0.002 } }\n\
     rough = { kind = 'needle' }\n\
     [material.rubber]\nimpact = { recordings = ['hit *.wav'], speed_variation = 0.1 }\n\
     roll = { instrument = 'rough', gain_db = -10 }\nslide = { instrument = 'rough', gain_db = -10 }\n\
     [material.wood]\nimpact = { instrument = 'bar', gain_db = -20, contact = 0.0002 }\n\
     slide = { instrument = 'rough', gain_db = -10 }\n\
     [[object]]\nname = 'balls'\nbody = 'ball*'\nmaterial = 'rubber'\n\
     [[object]]\nname = 'crate'\nmaterial = 'wood'\n"
        .to_owned()
}

/// The same simulation, rendered as a file is.
fn rendered(scene: Scene) -> Vec<f32> {
    let settings = EngineSettings { contact_step_s: STEP_S, ..EngineSettings::default() };
    studio::replayed(scene, settings, |handle| {
        let (mut stage, mut teller) = (Stage::new(), Teller::new(STEP_S).unwrap());
        stage.bodies.iter().for_each(|(body, name)| teller.name_body(*body, *name));
        teller.name_collider(stage.floor, "floor");
        for _ in 0..STEPS {
            let (time_s, came) = stage.go_on();
            if let Some((body, name)) = came {
                teller.name_body(body, name);
            }
            let world = &stage.world;
            teller.feed(handle, time_s, &world.narrow_phase, &world.bodies, &world.colliders).unwrap();
            handle.advance(time_s).unwrap();
        }
        (1..=20).for_each(|n| handle.advance(f64::from(STEPS) * STEP_S + 0.1 * f64::from(n)).unwrap());
    })
}

/// Runs the simulation and hears it; `told` tells the engine more.
fn heard(scene: Scene, movers: &[&str], mut told: impl FnMut(&mut Live, &Stage, f64)) -> Vec<f32> {
    let movers = movers.iter().map(|name| (*name).to_owned()).collect();
    let settings = EngineSettings { contact_step_s: STEP_S, movers, ..EngineSettings::default() };
    let (mut live, player) = Live::start(scene, Capture::unhurried(settings)).unwrap();
    let (mut capture, mut sound, mut stage) = (Capture::new(player), Vec::new(), Stage::new());
    stage.bodies.iter().for_each(|(body, name)| live.name_body(*body, *name));
    live.name_collider(stage.floor, "floor");
    let mut take = |live: &mut Live, time_s: f64| {
        live.handle().advance(time_s).unwrap();
        let each = |frames: &[f32]| {
            sound.extend_from_slice(frames);
            Ok(())
        };
        capture.take(live.handle(), each).unwrap();
    };
    for _ in 0..STEPS {
        let (time_s, came) = stage.go_on();
        if let Some((body, name)) = came {
            live.name_body(body, name);
        }
        let world = &stage.world;
        live.feed(time_s, &world.narrow_phase, &world.bodies, &world.colliders).unwrap();
        told(&mut live, &stage, time_s);
        take(&mut live, time_s);
    }
    (1..=20).for_each(|n| take(&mut live, f64::from(STEPS) * STEP_S + 0.1 * f64::from(n)));
    let (left, statistics) = (live.handle().left_out(), live.handle().statistics());
    assert_eq!(left, Left::default());
    assert_eq!((statistics.held, statistics.skipped_frames, statistics.silent_frames), (0, 0, 0));
    assert!(live.handle().take_fault().is_none());
    sound
}

#[test]
fn what_is_heard_at_once_is_what_was_found_before() {
    let studio = Studio::new();
    let text = scene(&studio);
    let events = events();
    let count = |is: fn(&Event) -> bool| events.iter().filter(|event| is(event)).count();
    let counts = [
        count(|event| matches!(event, Event::Impact(_))),
        count(|event| matches!(event, Event::Slide(_))),
        count(|event| matches!(event, Event::Roll(_))),
    ];
    eprintln!("{counts:?} impacts, moments of sliding and of rolling");
    assert!(counts[0] > 5 && counts[1] > 10 && counts[2] > 10, "{counts:?}");
    assert!(events.iter().any(|event| event.impact().is_some_and(|hit| hit.a == "ball 2")));
    let live = heard(Scene::open(studio.file("live.toml", &text), false).unwrap(), &[], |_, _, _| ());
    let seconds = live.len() as f64 / 2.0 / f64::from(RATE_HZ);
    assert!(seconds > 2.5, "{seconds} s");
    let rendered = rendered(Scene::open(studio.file("replayed.toml", &text), false).unwrap());
    assert!(rendered.iter().any(|sample| sample.abs() > 0.01));
    let differs = live.iter().zip(&rendered).position(|(a, b)| a.to_bits() != b.to_bits() && a != b);
    assert_eq!(differs, None, "to the last bit");
}

/// A loop on the crate, which the engine moves.
#[test]
fn what_is_named_is_moved() {
    let studio = Studio::new();
    studio.tone("tone.wav");
    let text = "[listener]\nposition = [0, 1, 2]\nlayout = 'stereo'\n\
                [[object]]\nname = 'crate'\nposition = [0, 0, 0]\n\
                sound = { recording = 'tone.wav', loop = true, gain_db = -6 }\n";
    let open = || Scene::open(studio.file("live.toml", text), false).unwrap();
    let named = heard(open(), &["crate"], |_, _, _| ());
    // The same, told by hand: under a name that no body has.
    let by_hand = text.replace("'crate'", "'by hand'");
    let scene = Scene::open(studio.file("hand.toml", &by_hand), false).unwrap();
    let by_hand = heard(scene, &["by hand"], |live, stage, time_s| {
        let (body, _) = stage.bodies.iter().find(|(_, name)| *name == "crate").unwrap();
        let object = live.handle().object("by hand").unwrap();
        live.handle().transform(object, time_s, pose(&stage.world.bodies[*body])).unwrap();
    });
    assert_eq!(named, by_hand);
    let still = heard(open(), &[], |_, _, _| ());
    let differs = named.iter().zip(&still).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(differs > 0.1, "it moves: {differs}");
}

/// Where a body is.
fn pose(body: &RigidBody) -> FedPose {
    let (at, turned) = (body.translation(), body.rotation());
    FedPose {
        position_m: [at.x, at.y, at.z].map(f64::from),
        rotation: [turned.x, turned.y, turned.z, turned.w].map(f64::from),
    }
}

/// A loop on the crate, which vanishes from the engine and appears again elsewhere, while it lies on the floor in the
/// simulation.
#[test]
fn what_vanishes_and_appears_again_is_told_of_as_before() {
    let studio = Studio::new();
    studio.tone("tone.wav");
    let text = "[listener]\nposition = [0, 1, 2]\nlayout = 'stereo'\n\
                [[object]]\nname = 'crate'\nposition = [0, 0, 0]\n\
                sound = { recording = 'tone.wav', loop = true, gain_db = -6 }\n";
    let open = |text: &str| Scene::open(studio.file("live.toml", text), false).unwrap();
    let go_and_come = |name: &str, live: &mut Live, stage: &Stage, time_s: f64| match stage.step {
        60 => live.handle().vanish(name, time_s).unwrap(),
        100 => {
            live.handle().appear(name, name, time_s, FedPose::at([-3.0, 0.0, 0.0])).unwrap();
        }
        _ => {}
    };
    let named =
        heard(open(text), &["crate"], |live, stage, time_s| go_and_come("crate", live, stage, time_s));
    let by_hand = |is_moved_again: bool| {
        let scene = open(&text.replace("'crate'", "'by hand'"));
        heard(scene, &["by hand"], |live, stage, time_s| {
            let (body, _) = stage.bodies.iter().find(|(_, name)| *name == "crate").unwrap();
            let object = live.handle().object("by hand");
            if let Some(object) = object.filter(|_| is_moved_again || stage.step < 100) {
                live.handle().transform(object, time_s, pose(&stage.world.bodies[*body])).unwrap();
            }
            go_and_come("by hand", live, stage, time_s);
        })
    };
    assert!(named == by_hand(true), "it is told as by hand, to the last bit");
    assert!(named != by_hand(false));
}

#[test]
fn a_step_or_a_time_that_is_none_is_refused() {
    for step_s in [0.0, -0.01, f64::NAN, f64::INFINITY] {
        assert!(
            Listener::new(step_s).is_err_and(|fault| fault.to_string().contains("a step of the simulation"))
        );
        assert!(Teller::new(step_s).is_err());
    }
    let studio = Studio::new();
    let scene = Scene::open(studio.file("live.toml", &scene(&studio)), false).unwrap();
    let settings = EngineSettings { contact_step_s: STEP_S, ..EngineSettings::default() };
    let (mut live, _player) = Live::start(scene, settings).unwrap();
    let (mut stage, mut refused) = (Stage::new(), Vec::new());
    for time_s in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 1e300] {
        (0..60).for_each(|_| stage.world.step());
        let world = &stage.world;
        refused.push(live.feed(time_s, &world.narrow_phase, &world.bodies, &world.colliders));
    }
    use Refused::{Earlier, NotFinite};
    let none = Err(NotFinite("time_s"));
    assert_eq!(refused, [none, none, none, Err(Earlier), none]);
}
