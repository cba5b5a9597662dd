//! The length of a soundtrack must not be seen in the memory that it takes.
//!
//! Everything allocated in this process is counted, so all is one test: others beside it would be
//! counted too. An hour is rendered by `cargo run --release -p froufrou --example one_hour`.

mod allocation;
mod studio;

use std::fmt::Write as _;
use std::io::Write as _;

use allocation::most_held;
use froufrou::render::offline::{self, Extent};
use froufrou::render::production::{ChannelLines, open_score};
use froufrou::score::{ChannelHeader, ChannelWriter, ObjectWriter};
use froufrou::synth::mixer::Mixer;
use froufrou::synth::prototypes::Soundings;
use froufrou::synth::receivers::Receiver;
use froufrou::synth::sinc;
use studio::{Studio, noise};

/// A scene of a length: loops on sources that circle, many impacts of ever new bodies, a listener
/// that walks about.
fn scene(studio: &Studio, seconds: u32) -> String {
    studio.recording("hum.wav", 44_100, &noise(44_100, 1));
    studio.recording("hit.wav", 48_000, &noise(4_800, 2));
    studio.recording("hat.wav", 48_000, &noise(4_000, 3));
    let mut log = std::io::BufWriter::new(std::fs::File::create(studio.path("log.csv")).unwrap());
    writeln!(log, "t,a,b,x,y,z,J").unwrap();
    for blow in 0..u64::from(seconds) * 16 {
        // More pairs than are remembered without need, and all of them within the shorter scene.
        let (time_s, pair) = (0.02 + blow as f64 * 0.0625, blow % 300);
        writeln!(log, "{time_s:.3},ball{},floor{},{},0,1,2", pair % 80, pair / 80, blow % 7).unwrap();
    }
    drop(log);
    let keys = |radius: f64, facing: bool| {
        let mut keys = String::new();
        // The track repeats itself so that its own keys, which are of the scene, take the same room.
        for key in 0..=40 {
            let time_s = f64::from(seconds) * f64::from(key) / 40.0;
            let (s, c) = (f64::from(key) * 0.9).sin_cos();
            let facing = if facing { format!(", facing = [{s}, 0, {c}]") } else { String::new() };
            write!(keys, "{{ t = {time_s}, position = [{}, 1, {}]{facing} }},", radius * c, radius * s)
                .unwrap();
        }
        keys
    };
    let mut scene = format!(
        "duration = {seconds}\nframe_rate = 24\n[listener]\ntrack = [{}]\n\
         [material.wood]\nimpact = {{ recordings = ['h?t.wav'], speed_variation = 0.1, retrigger = 5 }}\n\
         [[object]]\nname = 'ball'\nbody = 'ball*'\nmaterial = 'wood'\n\
         [[contacts]]\nlog = 'log.csv'\nstep = 0.001\n\
         columns = {{ t = 't', a = 'a', b = 'b', position = ['x', 'y', 'z'], normal_impulse = 'J' }}\n",
        keys(2.0, true)
    );
    for (n, radius) in [5.0, 20.0, 60.0].iter().enumerate() {
        write!(
            scene,
            "[[object]]\nname = 'fly{n}'\ntrack = [{}]\nsound = {{ recording = 'hum.wav', loop = true, speed = 1.{n} }}\n",
            keys(*radius, false)
        )
        .unwrap();
    }
    scene
}

/// Renders without keeping anything; gives the threads that have begun.
fn render(header: &ChannelHeader, prototypes: Soundings, lines: ChannelLines<'_>) -> usize {
    let channels = header.receivers.len();
    let extent = Extent { rate_hz: 8_000, from_s: 0.0, to_s: None, duration_s: header.duration_s };
    let mut mixer = Mixer::new(extent.rate_hz, Receiver::plain(channels), prototypes, lines).unwrap();
    let (mut begun, mut heard) = (0, 0);
    offline::render(&mut mixer, channels, &extent, true, |piece| {
        begun += piece.begun.len();
        heard += piece.mix.iter().filter(|&&sample| sample != 0.0).count();
        Ok(())
    })
    .unwrap();
    assert!(heard > 10_000);
    begun
}

/// The peaks of rendering a scene, of writing its scores and of mixing those.
fn peaks(seconds: u32) -> [(&'static str, usize); 5] {
    let studio = Studio::new();
    let text = scene(&studio, seconds);
    let production = studio.production(&text).unwrap();
    let sounds = seconds as usize * 16;
    let ((), rendering) = most_held(|| {
        let header = production.channel_header();
        let begun = render(&header, production.prototypes.clone(), production.channel_lines().unwrap());
        assert!(begun > sounds * 9 / 10, "{begun} sounds of {sounds}");
    });
    let file = |name: &str| std::io::BufWriter::new(std::fs::File::create(studio.path(name)).unwrap());
    let ((), object) = most_held(|| {
        let mut writer = ObjectWriter::new(file("object.score"), &production.header).unwrap();
        production.object_lines().unwrap().for_each(|line| writer.write(&line.unwrap()).unwrap());
        writer.finish().unwrap();
    });
    let ((), channel) = most_held(|| {
        let mut writer = ChannelWriter::new(file("channel.score"), &production.channel_header()).unwrap();
        production.channel_lines().unwrap().for_each(|line| writer.write(&line.unwrap()).unwrap());
        writer.finish().unwrap();
    });
    let mix = |name: &str| {
        let ((), most) = most_held(|| {
            let (header, prototypes, lines) = open_score(&studio.path(name)).unwrap();
            render(&header, prototypes, lines);
        });
        most
    };
    let (from_object, from_channel) = (mix("object.score"), mix("channel.score"));
    [
        ("rendering", rendering),
        ("writing in object space", object),
        ("writing in channel space", channel),
        ("mixing from object space", from_object),
        ("mixing from channel space", from_channel),
    ]
}

#[test]
fn ten_times_as_long_takes_no_more_memory() {
    // What is made once and kept: the kernels of every ratio that comes.
    sinc::prepare(16.0);
    for ((what, short), (_, long)) in peaks(20).into_iter().zip(peaks(200)) {
        println!("{what}: {short} bytes for 20 s, {long} for 200 s");
        // A few per cent, or what the buffers of a busier moment round up to.
        assert!(long < short + short / 20 + 50_000, "{what}: {short} bytes for 20 s, {long} for 200 s");
    }
}
