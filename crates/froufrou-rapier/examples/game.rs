use std::time::{Duration, Instant};

use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use froufrou::render::live::EngineSettings;
use froufrou::scene::{Scene, fed::FedPose};
use froufrou_rapier::Live;
use rapier3d::prelude::*;

const SCENE: &str = "
    listener = { layout = 'binaural', shared = true }
    instrument.bar = { kind = 'free-bar', with = { frequency = 523 } }
    instrument.rough = { kind = 'needle' }
    material.wood = { impact = { instrument = 'bar', gain_db = -20 }, slide = { instrument = 'rough', gain_db = -30 } }
    object = [{ name = 'crate', material = 'wood' }]";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The game: a crate on a floor, 60 steps a second.
    let mut world = PhysicsWorld::new();
    world.insert_collider(ColliderBuilder::cuboid(9.0, 0.1, 9.0), None);
    let on_high = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 1.0, 0.0));
    let (body, _) = world.insert(on_high, ColliderBuilder::cuboid(0.2, 0.2, 0.2).mass(5.0));

    // Its sound: an engine, and a device that plays it.
    let settings = EngineSettings { moves_listener: true, ..EngineSettings::default() };
    let (mut live, mut player) = Live::start(Scene::parse(SCENE, "scene.toml", false)?, settings)?;
    live.name_body(body, "crate");
    let device = cpal::default_host().default_output_device().ok_or("no sound device")?;
    let (channels, buffer_size) = (player.channels() as u16, cpal::BufferSize::Fixed(512));
    let config = cpal::StreamConfig { channels, sample_rate: 48_000, buffer_size };
    let fill = move |block: &mut [f32], _: &cpal::OutputCallbackInfo| player.fill(block);
    let stream = device.build_output_stream(config, fill, |fault| eprintln!("{fault}"), None)?;
    stream.play()?;

    // Both run: the crate is kicked every second, and the listener walks around it.
    let begun = Instant::now();
    for frame in 1..=60 * 4 {
        if frame % 60 == 0 {
            world.bodies[body].set_linvel(Vector::new(1.0, 3.0, 0.0), true);
        }
        world.step();
        let now_s = f64::from(frame) / 60.0;
        live.feed(now_s, &world.narrow_phase, &world.bodies, &world.colliders)?;
        live.handle().listener(now_s, FedPose::at([2.0 * now_s.sin(), 1.6, 2.0 * now_s.cos()]))?;
        live.handle().advance(now_s)?;
        let due = begun + Duration::from_secs_f64(now_s);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
    println!("{:?}", live.handle().statistics());
    Ok(())
}
