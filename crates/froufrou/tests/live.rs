//! Sound while things happen: what a device is given is what is rendered to files, in blocks of any size, and the audio
//! thread takes no memory.

mod allocation;
mod studio;

use std::f64::consts::TAU;

use allocation::calls;
use froufrou::random::Random;
use froufrou::render::live::{self, EngineSettings, Handle, Left, Player, Settings, Supply};
use froufrou::render::offline::{self, Extent};
use froufrou::render::production::{ChannelLines, PULSE, Production};
use froufrou::scene::Scene;
use froufrou::scene::contact_log::{ContactRow, Push};
use froufrou::scene::fed::FedPose;
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers;
use froufrou::synth::voice::Prototype;
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

fn open(production: &Production, ahead_s: f64, slice_frames: usize) -> Live<'_> {
    let header = production.channel_header();
    let receivers = receivers::load(&header, &production.scene.folder, RATE_HZ).unwrap();
    let lines = production.channel_lines().unwrap();
    let mixer = Mixer::new(RATE_HZ, receivers, production.prototypes.clone(), lines).unwrap();
    let settings = Settings { ahead_s, slice_frames, duration_s: header.duration_s, ..Settings::default() };
    live::part(mixer.with_seed(header.seed), settings).unwrap()
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

/// A block that is struck and slides, by rows of contacts that some are told and some are in a log.
fn struck(studio: &Studio, logged: bool) -> String {
    scene(studio, STEREO_STILL, "");
    let log = "[[contacts]]\nlog = 'contacts.csv'\nstep = 0.001\ncolumns = { t = 't', a = 'a', b = 'b', \
               position = ['x', 'y', 'z'], normal_force = 'fn', sliding_velocity = ['v1', 'v2'] }\n";
    format!(
        "duration = 1.2\nseed = 3\n{STEREO_STILL}\n\
         [instrument]\nbar = {{ kind = 'free-bar', with = {{ frequency = 523, damping = 0.002 }} }}\n\
         paper = {{ kind = 'needle' }}\n\
         [material.block]\nimpact = {{ instrument = 'bar', gain_db = -30, contact = 0.0002 }}\n\
         slide = {{ instrument = 'paper', gain_db = -20 }}\n\
         [material.table]\nimpact = {{ recordings = ['h?t.wav'], gain_db = -6, speed_variation = 0.1 }}\n\
         [[object]]\nname = 'block'\nmaterial = 'block'\n\
         [[object]]\nname = 'table'\nmaterial = 'table'\n\
         [[object]]\nname = 'bell'\nposition = [2, 1, -1]\nsound = {{ recording = 'hit.wav', at = [0.2, 0.55, 0.9] }}\n{}",
        if logged { log } else { "" }
    )
}

const STEREO_STILL: &str = "[[microphone]]\nname = 'left'\nposition = [-0.2, 1, 2]\n[[microphone]]\nname = 'right'\n\
     shape = 'cardioid'\nposition = [0.2, 1, 2]";

/// The rows of the log of [`struck`].
fn rows(studio: &Studio) -> Vec<ContactRow> {
    let log = std::fs::read_to_string(studio.path("contacts.csv")).unwrap();
    let row = |line: &str| {
        let numbers = line.split(',').map(|cell| cell.parse().unwrap_or(0.0)).collect::<Vec<f64>>();
        ContactRow {
            time_s: numbers[0],
            a: 0,
            b: 0,
            position_m: [numbers[3], numbers[4], numbers[5]],
            push: Push::Force(numbers[6]),
            normal: None,
            normal_velocity_mps: None,
            sliding_mps: Some(numbers[7].hypot(numbers[8])),
            line: 0,
        }
    };
    log.lines().skip(1).map(row).collect()
}

/// Starts an engine, tells it rows in frames of 10 ms, and plays whatever there is to be played.
fn told(
    studio: &Studio,
    text: &str,
    rows: Vec<ContactRow>,
    settings: EngineSettings,
    mut more: impl FnMut(&mut Handle, f64),
) -> Vec<f32> {
    let scene = Scene::open(studio.file("told.toml", text), false).unwrap();
    let (mut handle, mut player) = live::start(scene, settings).unwrap();
    let channels = player.channels();
    let mut rows = rows.iter().peekable();
    let bodies = ["block", "table"].map(|name| handle.body(name).unwrap());
    let (mut all, mut block) = (Vec::new(), vec![0.0; channels * 256]);
    for frame in 1..=160 {
        let now_s = f64::from(frame) * 0.01;
        while let Some(row) = rows.next_if(|row| row.time_s <= now_s) {
            handle.contact(bodies, row).unwrap();
        }
        more(&mut handle, now_s);
        handle.advance(now_s).unwrap();
        let due = (now_s - handle.latency_s()) * f64::from(RATE_HZ);
        let begun = std::time::Instant::now();
        while begun.elapsed().as_secs() < 20 {
            if player.ready_frames() >= 256 {
                let ((), calls) = calls(|| player.fill(&mut block));
                assert_eq!(calls, 0, "the audio thread takes no memory");
                all.extend_from_slice(&block);
            } else if (handle.statistics().played_frame + 256) as f64 >= due {
                break;
            } else {
                std::thread::yield_now();
            }
        }
    }
    assert!(handle.take_fault().is_none());
    assert_eq!(handle.left_out(), Left::default());
    let statistics = handle.statistics();
    assert_eq!(
        (statistics.held, statistics.skipped_frames, statistics.not_numbers),
        (0, 0, 0),
        "{statistics:?}"
    );
    all.drain(..channels * (statistics.silent_frames as usize + player.limiter_latency()));
    all
}

/// An engine that has the bits of a file, however slow the machine is.
fn unhurried() -> EngineSettings {
    EngineSettings { budget: f32::INFINITY, ..EngineSettings::default() }
}

/// The same events, known beforehand and rendered to the end, with keys as an engine has them.
fn recorded(studio: &Studio, text: &str, logged: &str) -> Vec<f32> {
    let events = studio.production(logged).unwrap().events().unwrap().collect::<Vec<_>>();
    let production = studio.production(text).unwrap();
    let header = production.channel_header();
    let (lines, _) = production.told_lines(events.into_iter(), EngineSettings::default().key_step_s).unwrap();
    let receivers = receivers::load(&header, &production.scene.folder, RATE_HZ).unwrap();
    let pulse = Prototype { samples: std::sync::Arc::new([]), rate_hz: 48_000.0, looped: false };
    let sounds = production.prototypes.clone().into_iter().chain([(PULSE.to_owned(), pulse.into())]);
    let mut mixer = Mixer::new(RATE_HZ, receivers, sounds, lines).unwrap().with_seed(header.seed);
    let mut mix = Vec::new();
    let extent = Extent { rate_hz: RATE_HZ, from_s: 0.0, to_s: None, duration_s: Some(1.2) };
    offline::render(&mut mixer, header.channels().len(), &extent, false, |piece| {
        mix.extend_from_slice(piece.mix);
        Ok(())
    })
    .unwrap();
    mix
}

/// How far two sounds are from each other, beside the louder peak, as far as the second goes.
fn distance(a: &[f32], b: &[f32]) -> f32 {
    let peak = b.iter().fold(0.0f32, |peak, sample| sample.abs().max(peak));
    assert!(a.len() >= b.len() && peak > 0.01, "{} of {}, {peak}", a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / peak
}

#[test]
fn what_is_told_sounds_as_what_is_logged() {
    let studio = Studio::new();
    let (text, logged) = (struck(&studio, false), struck(&studio, true));
    let settings = EngineSettings { contact_step_s: 0.001, ..unhurried() };
    let live = told(&studio, &text, rows(&studio), settings, |_, _| ());
    let recorded = recorded(&studio, &text, &logged);
    let rendered = studio.scene(&logged, Take::at(RATE_HZ)).unwrap().mix;
    let of_slides = distance(&live, &rendered);
    let first = live.iter().zip(&rendered).position(|(a, b)| (a - b).abs() > 1e-6);
    eprintln!("slides are {of_slides} of the peak away from those of the file, first at {first:?}");
    assert_eq!(distance(&live, &recorded), 0.0, "to the last bit");
    // A file of the scene with the log has fewer keys. Up to the slide, where nothing moves, that changes nothing.
    assert!(distance(&live, &rendered[..2 * 19_200]) < 1e-6);
    assert!(of_slides < 0.02);
}

#[test]
fn what_is_told_to_move_is_where_it_is_told_to_be() {
    let studio = Studio::new();
    let text = tone(&studio, "'stereo'", false);
    let place = "position = [0.3, 1.2, -1]\nsound";
    assert!(text.contains(place));
    let expected = studio.scene(&text, Take::at(RATE_HZ)).unwrap().mix;
    let (movers, half) = (vec!["tone".to_owned()], std::f64::consts::FRAC_1_SQRT_2);
    let settings = EngineSettings { movers, moves_listener: true, ..unhurried() };
    // All is turned to the left and shifted, listener and object: nothing changes for the ear.
    let elsewhere = text.replace(place, "position = [7, 1, 8]\nsound");
    let turned = [0.0, half, 0.0, half];
    let live = told(&studio, &elsewhere, Vec::new(), settings, |handle, now_s| {
        if now_s < 0.015 {
            let tone = handle.object("tone").unwrap();
            let at = FedPose { position_m: [9.0, 3.2, 4.7], rotation: turned };
            handle.transform(tone, 0.0, at).unwrap();
            handle.listener(0.0, FedPose { position_m: [10.0, 3.0, 5.0], rotation: turned }).unwrap();
        }
    });
    let frames = live.len().min(expected.len());
    let found = distance(&live, &expected[..frames]);
    eprintln!("{found} of the peak away");
    assert!(frames > 2 * 48_000 && found < 1e-5, "{found}");
}

#[test]
fn a_hostile_feed_is_contained() {
    let studio = Studio::new();
    let text = struck(&studio, false);
    let scene = Scene::open(studio.file("told.toml", &text), false).unwrap();
    let settings = EngineSettings { room: 64, movers: vec!["block".into()], ..EngineSettings::default() };
    let (mut handle, mut player) = live::start(scene, settings).unwrap();
    let random = Random::new(9, 9);
    let number = |n: u64| match random.below(2 * n, 9) {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => -1e300,
        3 => 1e11,
        _ => 4.0 * random.uniform(2 * n + 1) - 2.0,
    };
    let bodies = [handle.body("block").unwrap(), handle.body("table").unwrap()];
    let block_object = handle.object("block").unwrap();
    let mut block = vec![0.0; 2 * 333];
    let (mut now_s, mut refused) = (0.0, 0);
    for n in 0..6_000u64 {
        let m = 40 * n;
        let row = ContactRow {
            time_s: now_s + if n % 7 == 0 { number(m) } else { 0.001 },
            a: 7,
            b: 9,
            position_m: [number(m + 1), number(m + 2), number(m + 3)],
            push: Push::Impulse(number(m + 4) * 100.0),
            normal: (n % 2 == 0).then(|| [number(m + 5), number(m + 6), 0.0]),
            normal_velocity_mps: (n % 3 == 0).then(|| number(m + 7)),
            sliding_mps: (n % 5 != 0).then(|| number(m + 8)),
            line: 0,
        };
        // What lies ahead in time would hold up what comes behind it.
        if row.time_s.is_nan() || row.time_s < now_s + 0.002 {
            refused += u64::from(handle.contact(bodies, &row).is_err());
        }
        let rotation = [number(m + 9), number(m + 10), number(m + 11), number(m + 12)];
        let pose = FedPose { position_m: [number(m + 13), number(m + 14), number(m + 15)], rotation };
        refused += u64::from(handle.transform(block_object, now_s + 0.001, pose).is_err());
        let wrong_s = if n % 2 == 0 { f64::NAN } else { -number(m + 16).abs() };
        refused += u64::from(handle.advance(wrong_s).is_err());
        now_s += 0.002;
        refused += u64::from(handle.advance(now_s).is_err());
        let block = &mut block[..2 * (1 + (n % 333) as usize)];
        let ((), calls) = calls(|| player.fill(block));
        assert_eq!(calls, 0, "the audio thread takes no memory");
        assert!(block.iter().all(|sample| sample.abs() <= 1.0));
        if n % 20 == 0 {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }
    let (left, statistics) = (handle.left_out(), handle.statistics());
    eprintln!("{left:?} {statistics:?} {refused}");
    let counted = left.not_finite + left.earlier + left.full + left.unknown;
    assert!(left.not_finite > 1000 && counted == refused, "all that is left out is counted");
    if let Some(fault) = handle.take_fault() {
        panic!("the worker ended: {fault}");
    }
}
