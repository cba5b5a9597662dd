//! Sound while things happen: what a device is given is what is rendered to files, in blocks of any size, and the audio
//! thread takes no memory.

mod allocation;
mod studio;

use std::f64::consts::TAU;

use allocation::calls;
use froufrou::render::live::{self, Player, Settings, Supply};
use froufrou::render::production::{ChannelLines, Production};
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers;
use froufrou::synth::sinc::Kernel;
use studio::{Studio, Take, noise};

const RATE_HZ: u32 = 48_000;

/// Sounds of every kind about a listener: loops that move, hits from a log, what is synthesised and what is random.
fn scene(studio: &Studio, listener: &str, more: &str) -> String {
    studio.recording("hum.wav", 44_100, &noise(30_000, 1).iter().map(|s| 0.1 * s).collect::<Vec<_>>());
    studio.recording("hit.wav", 48_000, &noise(9_600, 2).iter().map(|s| 0.05 * s).collect::<Vec<_>>());
    studio.file(
        "buzz.rhai",
        "param(\"pitch\", 200.0, 20.0, 5000.0);\nlet tone = saw(pitch);\nplay(tone * 0.05);\n\
         fn control() { tone.frequency = pitch * (1.0 + 0.1 * random()); }\n",
    );
    let mut log = String::from("t,a,b,x,y,z,fn,v1,v2\n");
    for step in 1..=900 {
        let time = f64::from(step) * 0.001;
        let force = match step {
            100..=103 | 180..=182 => 400.0,
            400..=700 => 20.0,
            _ => continue,
        };
        let speed = (time - 0.4).max(0.0);
        log += &format!("{time:.3},block,table,{:.6},0.8,0,{force},{speed:.5},0\n", 0.5 * speed * speed);
    }
    studio.file("contacts.csv", &log);
    let keys = |radius: f64| {
        let key = |n: u32| {
            let (s, c) = (TAU * f64::from(n) / 20.0).sin_cos();
            format!("{{ t = {}, position = [{}, 1, {}] }}", f64::from(n) * 0.06, radius * c, radius * s)
        };
        (0..=20).map(key).collect::<Vec<_>>().join(", ")
    };
    format!(
        "duration = 1.2\nseed = 3\n{listener}\n\
         [instrument]\nbar = {{ kind = 'free-bar', with = {{ frequency = 523, damping = 0.002 }} }}\n\
         paper = {{ kind = 'needle' }}\nbuzz = {{ kind = 'procedure', script = 'buzz.rhai', with = {{ pitch = 300 }} }}\n\
         [material.block]\nimpact = {{ instrument = 'bar', gain_db = -30, contact = 0.0002 }}\n\
         slide = {{ instrument = 'paper', gain_db = -20 }}\n\
         [[object]]\nname = 'block'\nmaterial = 'block'\nposition = [0, 1, 0]\n\
         [[object]]\nname = 'fly'\ntrack = [{}]\nsound = {{ recording = 'hum.wav', loop = true, speed = 1.1 }}\n\
         [[object]]\nname = 'bell'\nposition = [2, 1, -1]\nsound = {{ recording = 'hit.wav', at = [0.2, 0.55, 0.9] }}\n\
         [[object]]\nname = 'bees'\nposition = [1, 1.5, 0]\nswarm = {{ count = 3, radius = 0.5, speed = 2 }}\n\
         sound = {{ instrument = 'buzz', set = [{{ t = 0, pitch = 250 }}, {{ t = 1, pitch = 350 }}], pattern = 'cardioid' }}\n\
         [[contacts]]\nlog = 'contacts.csv'\ncolumns = {{ t = 't', a = 'a', b = 'b', position = ['x', 'y', 'z'], \
         normal_force = 'fn', sliding_velocity = ['v1', 'v2'] }}\n{more}",
        keys(3.0)
    )
}

const STEREO: &str = "[[microphone]]\nname = 'left'\nposition = [-0.2, 1, 2]\n[[microphone]]\nname = 'right'\n\
     shape = 'cardioid'\ntrack = [{ t = 0, position = [0.2, 1, 2] }, { t = 1.2, position = [0.5, 1, 1.5], facing = [0.5, 0, -1] }]";

/// Listeners and rooms, of which each goes another way through the mixer.
fn scenes() -> Vec<(&'static str, String, &'static str)> {
    let listener = |layout: &str| format!("[listener]\nposition = [0, 1.2, 2]\nlayout = {layout}");
    let wall = "[material.wall]\nreflect = { absorption = 0.2, paths = 2 }\nocclude = true\n\
                [[object]]\nname = 'wall'\nsize = [3, 3]\nmaterial = 'wall'\nposition = [-2, 1, -1.5]\n";
    let room = "[room]\nsize = [6, 3, 5]\ncorner = [-3, 0, -2.4]\nabsorption = 0.2\n";
    vec![
        ("microphones", STEREO.into(), ""),
        ("microphones and a wall", STEREO.into(), wall),
        ("loudspeakers", listener("'5.1'"), ""),
        ("a head that all share", listener("'binaural'\nshared = true"), ""),
        ("a head", listener("'binaural'"), ""),
        ("microphones in a room", STEREO.into(), room),
    ]
}

type Live<'a> = (Supply<ChannelLines<'a>>, Player);

fn mixer(production: &Production) -> Mixer<ChannelLines<'_>> {
    let header = production.channel_header();
    let receivers = receivers::load(&header, &production.scene.folder, RATE_HZ).unwrap();
    let lines = production.channel_lines().unwrap();
    let mixer = Mixer::new(RATE_HZ, receivers, production.prototypes.clone(), lines).unwrap();
    mixer.with_seed(header.seed)
}

fn open(production: &Production, ahead_s: f64, slice_frames: usize) -> Live<'_> {
    parted(production, mixer(production), ahead_s, slice_frames)
}

fn parted<'a>(
    production: &Production,
    mixer: Mixer<ChannelLines<'a>>,
    ahead_s: f64,
    slice_frames: usize,
) -> Live<'a> {
    let duration_s = production.channel_header().duration_s;
    live::part(mixer, Settings { ahead_s, slice_frames, duration_s, ..Settings::default() }).unwrap()
}

/// All that is played, by blocks of these sizes in turn.
fn played((mut supply, mut player): Live<'_>, sizes: &[usize]) -> Vec<f32> {
    let (mut all, mut block) = (Vec::new(), vec![0.0; 8192 * player.channels()]);
    for size in sizes.iter().cycle() {
        supply.go_on().unwrap();
        let block = &mut block[..size * player.channels()];
        let ((), calls) = calls(|| player.fill(block));
        assert_eq!(calls, 0, "the audio thread takes no memory");
        all.extend_from_slice(block);
        if player.is_over() {
            break;
        }
    }
    let statistics = player.statistics();
    assert_eq!((statistics.held, statistics.skipped_frames, statistics.not_numbers), (0, 0, 0));
    assert_eq!(statistics.limited_frames, 0, "the scene is not too loud");
    // What the limiter still has.
    let mut rest = vec![0.0; player.limiter_latency() * player.channels()];
    player.fill(&mut rest);
    all.extend(rest);
    all.drain(..player.limiter_latency() * player.channels());
    all
}

#[test]
fn what_is_played_is_what_is_rendered() {
    let studio = Studio::new();
    for (what, listener, more) in scenes() {
        let text = scene(&studio, &listener, more);
        let expected = studio.scene(&text, Take::at(RATE_HZ)).unwrap();
        assert!(expected.mix.iter().any(|sample| sample.abs() > 0.01), "{what}: nothing is heard");
        let production = studio.production(&text).unwrap();
        for (sizes, slice_frames) in
            [(&[64][..], 128), (&[4096], 256), (&[32, 100, 1, 128, 777, 4096, 2], 100), (&[8192, 1], 48)]
        {
            let found = played(open(&production, 0.18, slice_frames), sizes);
            assert!(found.len() >= expected.mix.len(), "{what}");
            let (sound, behind) = found.split_at(expected.mix.len());
            let differs =
                sound.iter().zip(&expected.mix).position(|(a, b)| a.to_bits() != b.to_bits() && a != b);
            assert_eq!(
                differs,
                None,
                "{what}, blocks {sizes:?}: {:?}",
                differs.map(|n| (sound[n], expected.mix[n]))
            );
            // Rooms and heads ring on behind the end, where a file is cut off.
            let is_direct =
                ["microphones", "microphones and a wall", "loudspeakers", "a head"].contains(&what);
            assert!(!is_direct || behind.iter().all(|sample| *sample == 0.0), "{what}");
        }
    }
}

/// A tone of 1 kHz that stands still, heard directly and on a head that all share.
#[test]
fn by_the_short_kernel_it_is_nearly_as_in_a_file_and_alike_in_all_blocks() {
    let studio = Studio::new();
    for instrument in [false, true] {
        let text = tone(&studio, "'stereo'", instrument);
        let file = studio.scene(&text, Take::at(RATE_HZ)).unwrap();
        let production = studio.production(&text).unwrap();
        let short = || mixer(&production).with_kernel(Kernel::Short);
        let frames = file.mix.len() / file.channels;
        let mut whole = short();
        whole.read_to(frames as u64).unwrap();
        let expected = whole.voices().render(0, frames, false).mix;
        for (sizes, slice_frames) in [(&[64][..], 128), (&[32, 100, 1, 777, 4096], 100)] {
            let found = played(parted(&production, short(), 0.18, slice_frames), sizes);
            for (n, sample) in found[..file.mix.len()].iter().enumerate() {
                let (channel, frame) = (n % file.channels, n / file.channels);
                assert_eq!(*sample, expected[channel * frames + frame] as f32, "frame {frame}, {sizes:?}");
            }
            // Its images lie 70 dB below.
            let steady = file.channels * 24_000..file.channels * 120_000;
            let pairs = || found[steady.clone()].iter().zip(&file.mix[steady.clone()]);
            assert!(pairs().any(|(a, b)| a != b), "it reads otherwise");
            let farthest = pairs().map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(farthest < 3e-4, "{farthest}");
        }
    }
}

fn tone(studio: &Studio, layout: &str, instrument: bool) -> String {
    studio.tone("tone.wav");
    studio.file("tone.rhai", "play(sine(1000.0) * 0.5);\n");
    let sound = if instrument { "instrument = 'tone'" } else { "recording = 'tone.wav', loop = true" };
    format!(
        "duration = 3\n[listener]\nposition = [0, 1, 0]\nlayout = {layout}\n\
         [instrument]\ntone = {{ kind = 'procedure', script = 'tone.rhai' }}\n\
         [[object]]\nname = 'tone'\nposition = [0.3, 1.2, -1]\nsound = {{ {sound} }}\n"
    )
}

#[test]
fn where_the_worker_is_late_sounds_go_on_and_come_back() {
    const BLOCK: usize = 96;
    let studio = Studio::new();
    for (layout, instrument) in
        [("'mono'", false), ("'binaural'\nshared = true", false), ("'binaural'", false), ("'mono'", true)]
    {
        let text = tone(&studio, layout, instrument);
        let expected = studio.scene(&text, Take::at(RATE_HZ)).unwrap();
        let channels = expected.channels;
        let steady = &expected.mix[channels * 24_000..channels * 48_000];
        let step = |sound: &[f32]| {
            let pairs = sound.iter().zip(&sound[channels..]);
            pairs.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
        };
        for late_s in [0.03, 0.5] {
            let (what, production) =
                (format!("{layout}, {instrument}, {late_s} s"), studio.production(&text).unwrap());
            let (mut supply, mut player) = open(&production, 0.02, 128);
            let late = 48_000..48_000 + (late_s * 48_000.0) as usize;
            let (mut all, mut block) = (Vec::new(), [0.0; BLOCK * 2]);
            while !player.is_over() {
                if !late.contains(&(all.len() / channels)) {
                    supply.go_on().unwrap();
                }
                let block = &mut block[..BLOCK * channels];
                let ((), calls) = calls(|| player.fill(block));
                assert_eq!(calls, 0, "the audio thread takes no memory");
                all.extend_from_slice(block);
            }
            let statistics = player.statistics();
            assert_eq!(statistics.held, 1, "{what}: {statistics:?}");
            assert_eq!(statistics.silent_frames > 1000, late_s > 0.3, "{what}: {statistics:?}");
            // No click: a fade of 10 ms adds little to how steep the tone is. What a synthesised sound or a filter made
            // goes back, whose slope turns there.
            let (found, allowed) = (step(&all[channels * 24_000..channels * 100_000]), 1.06 * step(steady));
            assert!(found <= allowed, "{what}: {found} beside {allowed}");
            // Meanwhile a recording is as loud as before.
            if !instrument && layout == "'mono'" {
                let held = &all[channels * 48_000 + 1200..channels * 48_000 + 1300];
                assert!(held.iter().any(|sample| sample.abs() > 0.4), "{what}");
            }
            // The score waited meanwhile, and went on at the frame that was due.
            let waited = all.len() / channels - expected.mix.len() / channels - player.limiter_latency();
            let behind = 48_000 + (late_s * 48_000.0) as usize + 3_000;
            // The FFTs of buses have come to lie elsewhere, so that they round otherwise.
            let near = if layout.contains("shared") { 1e-6 } else { 0.0 };
            let shift = (waited - BLOCK..=waited + BLOCK).find(|shift| {
                let from = (behind - shift - player.limiter_latency()) * channels;
                let found = &all[behind * channels..(behind + 4_000) * channels];
                found.iter().zip(&expected.mix[from..]).all(|(a, b)| (a - b).abs() <= near)
            });
            assert!(shift.is_some(), "{what}: it does not go on where it was");
        }
    }
}

#[test]
fn where_too_much_is_there_some_is_left_out_without_a_click() {
    let studio = Studio::new();
    let text = tone(&studio, "'mono'", false);
    let production = studio.production(&text).unwrap();
    let (supply, mut player) = open(&production, 0.02, 128);
    let mut supply = supply.following();
    let (mut all, mut block) = (Vec::new(), [0.0; 100]);
    while !player.is_over() {
        // Now and then all comes that there is room for.
        if (all.len() / 100).is_multiple_of(8) || player.ready_frames() < 100 {
            supply.go_on().unwrap();
        }
        let ((), calls) = calls(|| player.fill(&mut block));
        assert_eq!(calls, 0, "the audio thread takes no memory");
        all.extend_from_slice(&block);
    }
    let statistics = player.statistics();
    assert!(statistics.skipped_frames > 10_000 && statistics.held == 0, "{statistics:?}");
    let steps = |sound: &[f32]| sound.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
    let expected = studio.scene(&text, Take::at(RATE_HZ)).unwrap().mix;
    let (found, steady) = (steps(&all[12_000..all.len() - 4_000]), steps(&expected[24_000..48_000]));
    assert!(found <= 1.06 * steady, "{found} beside {steady}");
}

#[test]
fn what_cannot_be_is_refused() {
    let studio = Studio::new();
    let production = studio.production(&tone(&studio, "'mono'", false)).unwrap();
    let fault = |ahead_s: f64, slice_frames: usize| {
        let lines = production.channel_lines().unwrap();
        let receivers = froufrou::synth::receivers::Receiver::plain(1);
        let mixer = Mixer::new(RATE_HZ, receivers, production.prototypes.clone(), lines).unwrap();
        let settings = Settings { ahead_s, slice_frames, ..Settings::default() };
        live::part(mixer, settings).err().map(|fault| fault.to_string()).unwrap_or_default()
    };
    assert!(fault(f64::NAN, 128).contains("`ahead_s` is NaN"));
    assert!(fault(11.0, 128).contains("expected 0 to 10"));
    assert!(fault(0.1, 0).contains("slices of 0 frames"));
    assert_eq!(fault(0.1, 1), "");
}
