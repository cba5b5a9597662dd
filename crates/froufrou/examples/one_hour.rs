//! Renders a scene of an hour and says what memory that took.
//!
//! ```text
//! cargo run --release -p froufrou --example one_hour              an hour
//! cargo run --release -p froufrou --example one_hour -- 60        a minute, to compare
//! ```
//!
//! Three sources circle about a listener who walks, and eight times a second something is hit.

use std::fmt::Write as _;
use std::io::Write as _;
use std::time::Instant;

use froufrou::Result;
use froufrou::render::broadcast::Description;
use froufrou::render::format::SampleFormat;
use froufrou::render::offline::Extent;
use froufrou::render::production::Production;
use froufrou::render::soundtrack::{self, Output};
use froufrou::scene::Scene;
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers::Receiver;

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let seconds: u32 = std::env::args().nth(1).map_or(Ok(3600), |text| text.parse())?;
    let folder = tempfile::tempdir()?;
    let scene = folder.path().join("scene.toml");
    write_scene(folder.path(), seconds)?;
    let begin = Instant::now();
    let production = Production::open(Scene::open(&scene, false)?)?;
    let extent = Extent { rate_hz: 48_000, from_s: 0.0, to_s: None, duration_s: Some(f64::from(seconds)) };
    let output = Output {
        path: folder.path().join("out.wav"),
        stems: None,
        samples: SampleFormat::Int24,
        seed: 0,
        gain_db: 0.0,
        normalize_dbtp: None,
        channel_names: Vec::new(),
        description: Description::default(),
    };
    let mut mixer =
        Mixer::new(48_000, Receiver::plain(2), production.prototypes.clone(), production.channel_lines()?)?;
    let mut no_log = |_: &_| -> Result<()> { Ok(()) };
    let summary = soundtrack::write(&mut mixer, 2, &extent, &output, &mut |_| {}, &mut no_log)?;
    let taken_s = begin.elapsed().as_secs_f64();
    println!("{seconds} s of sound, {} sounds, rendered in {taken_s:.1} s", summary.threads);
    match peak_memory() {
        Some(peak) => println!("most memory held at once: {peak}"),
        None => println!("this system does not tell the most memory held at once"),
    }
    Ok(())
}

/// What the system says of this process.
fn peak_memory() -> Option<String> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    status.lines().find_map(|line| Some(line.strip_prefix("VmHWM:")?.trim().to_owned()))
}

fn write_scene(folder: &std::path::Path, seconds: u32) -> std::io::Result<()> {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 48_000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    for (name, frames, decay) in
        [("hum.wav", 48_000, 0.0), ("hit.wav", 9_600, 0.001), ("hat.wav", 4_800, 0.002)]
    {
        let mut writer = hound::WavWriter::create(folder.join(name), spec).map_err(std::io::Error::other)?;
        let random = froufrou::random::Random::new(1, frames);
        for index in 0..frames {
            let sample = (random.uniform(index) - 0.5) * (-decay * index as f64).exp();
            writer.write_sample(sample as f32).map_err(std::io::Error::other)?;
        }
        writer.finalize().map_err(std::io::Error::other)?;
    }
    let mut log = std::io::BufWriter::new(std::fs::File::create(folder.join("log.csv"))?);
    writeln!(log, "t,a,b,x,y,z,J")?;
    for blow in 0..u64::from(seconds) * 8 {
        writeln!(log, "{:.3},ball{},floor,{},0,1,2", 0.02 + blow as f64 * 0.125, blow % 80, blow % 7)?;
    }
    log.flush()?;
    let keys = |radius_m: f64| {
        let mut keys = String::new();
        // As many whatever the length: a scene file that grows would be seen in the memory too.
        for key in 0..=60 {
            let time_s = f64::from(seconds) * f64::from(key) / 60.0;
            let (sine, cosine) = (f64::from(key) * 0.9).sin_cos();
            let (x, z) = (radius_m * cosine, radius_m * sine);
            // Writing to a string cannot fail.
            let _ = write!(keys, "{{ t = {time_s}, position = [{x}, 1, {z}] }},");
        }
        keys
    };
    let mut scene = format!(
        "duration = {seconds}\n[listener]\nspacing = 0.2\ntrack = [{}]\n\
         [material.wood]\nimpact = {{ recordings = ['h[ai]t.wav'], gain_db = -20, speed_variation = 0.1 }}\n\
         [[object]]\nname = 'ball'\nbody = 'ball*'\nmaterial = 'wood'\n\
         [[contacts]]\nlog = 'log.csv'\nstep = 0.001\n\
         columns = {{ t = 't', a = 'a', b = 'b', position = ['x', 'y', 'z'], normal_impulse = 'J' }}\n",
        keys(1.0)
    );
    for radius_m in [5.0, 20.0, 60.0] {
        let _ = write!(
            scene,
            "[[object]]\nname = 'fly{radius_m}'\ntrack = [{}]\nsound = {{ recording = 'hum.wav', loop = true }}\n",
            keys(radius_m)
        );
    }
    std::fs::write(folder.join("scene.toml"), scene)
}
