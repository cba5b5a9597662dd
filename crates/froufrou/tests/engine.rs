//! Sound of what is told as it happens: it is the sound of the same feed rendered to a file, it comes when it is said to
//! come, and whatever is told, nothing breaks.

mod allocation;
mod studio;

use std::collections::VecDeque;
use std::sync::Arc;

use allocation::calls;
use froufrou::motion::body::BodyState;
use froufrou::motion::lives::Touch;
use froufrou::random::Random;
use froufrou::render::live::{self, EngineSettings, Handle, Left, Player, Refused};
use froufrou::render::offline::{self, Extent};
use froufrou::scene::Scene;
use froufrou::scene::contact_log::{ContactRow, Push};
use froufrou::scene::fed::{Faces, FedPose};
use studio::sheets::{CELLS, letter, linen, vertices};
use studio::{Studio, Take, noise};

const RATE_HZ: u32 = 48_000;

/// A game frame.
const FRAME_S: f64 = 1.0 / 60.0;

const STEREO: &str = "[[microphone]]\nname = 'left'\nposition = [-0.2, 1, 2]\n[[microphone]]\nname = 'right'\n\
     shape = 'cardioid'\nposition = [0.2, 1, 2]";

/// Things of every kind: a block that rings and scrapes on a table, a fly that hums, a bell, a cloth and a sheet of paper.
fn scene(studio: &Studio, listener: &str) -> Scene {
    studio.recording("hum.wav", 44_100, &noise(30_000, 1).iter().map(|s| 0.1 * s).collect::<Vec<_>>());
    studio.recording("hit.wav", 48_000, &noise(9_600, 2).iter().map(|s| 0.05 * s).collect::<Vec<_>>());
    studio.sheet("linen", CELLS, (2, 60.0), |_, corner| linen(0.0, corner));
    studio.sheet("letter", CELLS, (2, 60.0), |_, corner| letter(0.0, corner));
    studio.file("floor.obj", "v -4 0 -4\nv -4 0 4\nv 4 0 4\nv 4 0 -4\nf 1 2 3 4\n");
    let text = format!(
        "duration = 2\nseed = 3\n{listener}\n\
         [instrument]\nbar = {{ kind = 'free-bar', with = {{ frequency = 523, damping = 0.002 }} }}\n\
         rough = {{ kind = 'needle' }}\n\
         [material.wood]\nimpact = {{ instrument = 'bar', gain_db = -30, contact = 0.0002 }}\n\
         slide = {{ instrument = 'rough', gain_db = -20 }}\n\
         [material.tin]\nimpact = {{ recordings = ['h?t.wav'], gain_db = -6, speed_variation = 0.1 }}\n\
         [material.linen]\ncloth = {{ corpus = 'synthetic/cotton', floor_speed = 0.1, least_energy = 0 }}\n\
         [material.paper]\npaper = 'synthetic/printer'\n\
         [[object]]\nname = 'block'\nmaterial = 'wood'\nbody = 'block*'\n\
         [[object]]\nname = 'table'\nmaterial = 'tin'\n\
         [[object]]\nname = 'fly'\nposition = [0.5, 1, 0]\nsound = {{ recording = 'hum.wav', loop = true, speed = 1.1 }}\n\
         [[object]]\nname = 'bell'\nposition = [2, 1, -1]\nsound = {{ recording = 'hit.wav', at = [0.2, 0.55] }}\n\
         [[object]]\nname = 'sheet'\nsource = 'linen.obj#/*'\nmaterial = 'linen'\n\
         [[object]]\nname = 'letter'\nsource = 'letter.obj#/*'\nmaterial = 'paper'\n\
         [[object]]\nname = 'floor'\nsource = 'floor.obj#/*'\n"
    );
    Scene::open(studio.file("told.toml", &text), false).unwrap()
}

fn settings() -> EngineSettings {
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    EngineSettings {
        movers: names(&["fly"]),
        meshes: names(&["sheet", "letter"]),
        moves_listener: true,
        ..unhurried()
    }
}

/// An engine that has the bits of a file, however slow the machine is.
fn unhurried() -> EngineSettings {
    EngineSettings { budget: f32::INFINITY, ..EngineSettings::default() }
}

fn row(time_s: f64, x: f64, push: Push<f64>, sliding_mps: Option<f64>) -> ContactRow {
    let position_m = [x, 0.8, 0.0];
    let (normal, normal_velocity_mps) = (None, None);
    ContactRow { time_s, a: 0, b: 0, position_m, push, normal, normal_velocity_mps, sliding_mps, line: 0 }
}

/// What happens in a frame: a bit of everything.
fn tell(handle: &mut Handle, frame: u32) {
    tell_from(handle, frame, 0.0);
}

/// The same by a clock that begins with another time.
fn tell_from(handle: &mut Handle, frame: u32, begin_s: f64) {
    let now_s = f64::from(frame) * FRAME_S;
    let time_s = begin_s + now_s;
    let at = |x: f64, y: f64, z: f64| FedPose::at([x, y, z]);
    let fly = handle.object("fly").unwrap();
    handle.transform(fly, time_s, at((2.0 * now_s).sin(), 1.2, (3.0 * now_s).cos())).unwrap();
    handle.listener(time_s, at(0.3 * now_s, 1.2, 2.0)).unwrap();
    for (name, place) in [("sheet", linen as fn(f64, [f64; 2]) -> [f64; 3]), ("letter", letter)] {
        if let Some(mesh) = handle.object(name) {
            handle.mesh(mesh, time_s, &vertices(now_s, place)).unwrap();
        }
    }
    let bodies = ["block", "table"].map(|name| handle.body(name).unwrap());
    match frame {
        12 | 90 => handle.contact(bodies, &row(time_s - 0.003, 0.1, Push::Impulse(0.5), None)).unwrap(),
        30..60 => {
            let speed_mps = 0.05 * f64::from(frame - 29);
            let slides = row(time_s, 0.01 * f64::from(frame), Push::Impulse(0.1), Some(speed_mps));
            handle.contact(bodies, &slides).unwrap();
        }
        _ => {}
    }
    match frame {
        40 => assert!(handle.appear("fly", "wasp", time_s - 0.01, at(-1.0, 1.0, 1.0)).is_ok()),
        41..70 => {
            let wasp = handle.object("wasp").unwrap();
            handle.transform(wasp, time_s, at(-1.0 + 0.1 * f64::from(frame - 40), 1.0, 1.0)).unwrap();
        }
        70 => handle.vanish("wasp", time_s).unwrap(),
        // The table is of wood from now on.
        75 => handle.material("table", "wood", time_s).unwrap(),
        80 => handle.vanish("letter", time_s).unwrap(),
        _ => {}
    }
    handle.advance(time_s).unwrap();
}

/// Pulls blocks as a device does that runs with the game's clock, and waits for the worker where that would be late.
struct Device {
    player: Player,
    block: Vec<f32>,
    sound: Vec<f32>,
}

impl Device {
    fn new(player: Player, frames: usize) -> Self {
        Self { block: vec![0.0; frames * player.channels()], player, sound: Vec::new() }
    }

    fn frames(&self) -> usize {
        self.sound.len() / self.player.channels()
    }

    /// Plays until a time of the game at which more is told.
    fn play(&mut self, handle: &Handle, now_s: f64) {
        // The worker is given the time that it needs: how fast it is shall not matter here. Where the player has no room for
        // more it does not wait for what is told.
        let begun = std::time::Instant::now();
        let (mut ready, mut since) = (self.player.ready_frames(), begun);
        while !handle.is_waiting() && handle.is_running() && since.elapsed().as_secs() < 3 {
            if self.player.ready_frames() != ready {
                (ready, since) = (self.player.ready_frames(), std::time::Instant::now());
            }
            assert!(begun.elapsed().as_secs() < 20);
            std::thread::yield_now();
        }
        let rate_hz = f64::from(RATE_HZ);
        // A device asks for a block as it begins to play it.
        while (self.frames() as f64) < now_s * rate_hz {
            let ((), calls) = calls(|| self.player.fill(&mut self.block));
            assert_eq!(calls, 0, "the audio thread takes no memory");
            self.sound.extend_from_slice(&self.block);
        }
    }

    /// What was played of the score, and the frame of it that this begins with.
    fn score(&self) -> (usize, &[f32]) {
        let statistics = self.player.statistics();
        let silent = statistics.silent_frames as usize;
        let first = statistics.played_frame as usize - (self.frames() - silent);
        // What it began in the midst of was faded in, and a head sounds on.
        let faded = (0.05 * f64::from(RATE_HZ)) as usize;
        let played = (silent + faded + self.player.limiter_latency()) * self.player.channels();
        (first + faded, &self.sound[played..])
    }
}

/// Plays some frames of the game live.
fn live(
    scene: Scene,
    settings: EngineSettings,
    frames: u32,
    block: usize,
    tell: impl Fn(&mut Handle, u32),
) -> (usize, Vec<f32>) {
    let ahead_s = FRAME_S + block as f64 / f64::from(RATE_HZ) + 0.003;
    let (mut handle, player) = live::start(scene, EngineSettings { ahead_s, ..settings }).unwrap();
    let mut device = Device::new(player, block);
    for frame in 1..=frames {
        device.play(&handle, f64::from(frame) * FRAME_S);
        tell(&mut handle, frame);
    }
    if let Some(fault) = handle.take_fault() {
        panic!("{fault}");
    }
    assert_eq!(handle.left_out(), Left::default());
    let statistics = handle.statistics();
    let troubles = (statistics.held, statistics.skipped_frames, statistics.not_numbers);
    assert_eq!(troubles, (0, 0, 0), "{statistics:?}");
    let (first, sound) = device.score();
    (first, sound.to_vec())
}

/// The same feed rendered as a file is.
fn replayed(
    scene: Scene,
    settings: EngineSettings,
    frames: u32,
    tell: impl Fn(&mut Handle, u32) + Send + Sync,
) -> Vec<f32> {
    studio::replayed(scene, settings, |handle| (1..=frames).for_each(|frame| tell(handle, frame)))
}

/// How far two sounds are from each other, beside the louder peak, as far as both go.
fn distance(a: &[f32], b: &[f32]) -> f32 {
    let frames = a.len().min(b.len());
    let (a, b) = (&a[..frames], &b[..frames]);
    let peak = b.iter().fold(0.0f32, |peak, sample| sample.abs().max(peak));
    assert!(frames > 48_000 && peak > 0.01, "{frames}, {peak}");
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / peak
}

fn power(sound: &[f32], channels: usize, from_s: f64, to_s: f64) -> f64 {
    let at = |time_s: f64| (time_s * f64::from(RATE_HZ)) as usize * channels;
    let piece = &sound[at(from_s)..at(to_s)];
    piece.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / piece.len() as f64
}

#[test]
fn a_feed_sounds_live_as_it_does_when_it_is_replayed() {
    let studio = Studio::new();
    for (listener, near) in [
        (STEREO, 0.0),
        ("[listener]\nposition = [0, 1.2, 2]\nlayout = 'binaural'\nshared = true", 1e-6),
        ("[listener]\nposition = [0, 1.2, 2]\nlayout = 'binaural'", 0.0),
    ] {
        let replayed = replayed(scene(&studio, listener), settings(), 120, tell);
        for block in [32, 441, 4096] {
            let (first, live) = live(scene(&studio, listener), settings(), 120, block, tell);
            let heard_s = live.len() as f64 / 2.0 / f64::from(RATE_HZ);
            assert!(heard_s > 1.6, "{heard_s} s");
            assert!(first < 9_000, "it begins at {first}");
            let found = distance(&live, &replayed[2 * first..]);
            assert!(found <= near, "{listener}, blocks of {block}: {found} of the peak away");
        }
        // Another ring, another time in which it is told, the same sound.
        let other = EngineSettings { room: 16, ..settings() };
        assert_eq!(self::replayed(scene(&studio, listener), other, 120, tell), replayed);
    }
}

#[test]
fn what_is_close_by_is_the_same_in_whatever_slices_it_is_made() {
    let studio = Studio::new();
    let close = "[[microphone]]\nname = 'close'\nposition = [0.1, 0.81, 0.01]";
    let strikes = |handle: &mut Handle, frame: u32| {
        let time_s = f64::from(frame) * FRAME_S;
        let bodies = ["block", "table"].map(|name| handle.body(name).unwrap());
        if frame.is_multiple_of(3) {
            let hits = row(time_s, 0.1, Push::Impulse(0.3), None);
            let at_s = Some(time_s - 0.000_37 * f64::from(frame % 40));
            handle.touch(bodies, &Touch { row: hits, states: [None; 2], at_s }).unwrap();
        }
        let slides = row(time_s, 0.1, Push::Impulse(0.1), Some(f64::from(frame % 10)));
        handle.contact(bodies, &slides).unwrap();
        handle.advance(time_s).unwrap();
    };
    for slice_frames in [37, 64, 128] {
        let settings = EngineSettings { slice_frames, ..unhurried() };
        let replayed = replayed(scene(&studio, close), settings.clone(), 120, strikes);
        let (first, live) = live(scene(&studio, close), settings, 120, 128, strikes);
        assert_eq!(distance(&live, &replayed[first..]), 0.0, "slices of {slice_frames}");
    }
}

#[test]
fn what_was_told_before_anything_is_played_is_passed_over_at_once() {
    let studio = Studio::new();
    let (mut handle, mut player) = live::start(scene(&studio, STEREO), settings()).unwrap();
    // Three seconds pass before a device asks for the first time.
    (1..=180).for_each(|frame| tell(&mut handle, frame));
    let mut block = vec![0.0; 2 * 128];
    let first = (0..1_000_000).find_map(|_| {
        player.fill(&mut block);
        let played = handle.statistics().played_frame;
        std::thread::yield_now();
        (played > 0).then(|| played - 128)
    });
    // What comes is the newest, but for what has to be there beforehand, and nothing is left out of it later.
    let first_s = first.unwrap() as f64 / f64::from(RATE_HZ);
    assert!((2.8..3.0).contains(&first_s), "it begins with {first_s} s");
    player.fill(&mut block);
    let statistics = handle.statistics();
    assert_eq!((statistics.skipped_frames, statistics.held), (0, 0));
}

#[test]
fn a_games_clock_may_begin_late_and_leap_by_mistake() {
    let studio = Studio::new();
    let late = |handle: &mut Handle, frame: u32| tell_from(handle, frame, 1e5);
    let replayed = replayed(scene(&studio, STEREO), settings(), 120, late);
    let (first, live) = live(scene(&studio, STEREO), settings(), 120, 441, late);
    assert!(first < 9_000, "the scene begins with it, not at {first}");
    assert_eq!(distance(&live, &replayed[2 * first..]), 0.0);

    let (mut handle, _player) = live::start(scene(&studio, STEREO), settings()).unwrap();
    let fly = handle.object("fly").unwrap();
    let here = FedPose::at([1.0; 3]);
    handle.advance(0.0).unwrap();
    for (n, beyond_s) in [1e300, 1e13, f64::NAN, f64::INFINITY].into_iter().enumerate() {
        let now_s = 0.1 * n as f64;
        assert!(matches!(handle.advance(beyond_s), Err(Refused::NotFinite(_))), "{beyond_s}");
        handle.transform(fly, now_s + 0.05, here).unwrap();
        handle.advance(now_s + 0.1).unwrap();
    }
    handle.advance(1e9).unwrap();
    assert_eq!(handle.transform(fly, 0.55, here), Err(Refused::Earlier));
    handle.advance(0.6).unwrap();
    handle.transform(fly, 0.65, here).unwrap();
    handle.advance(0.7).unwrap();
    assert_eq!(handle.advance(0.3), Err(Refused::Earlier));
    assert_eq!(handle.transform(fly, 0.7, here), Err(Refused::Earlier));
    assert_eq!(handle.transform(fly, 9.0, here), Err(Refused::Ahead));
    let unturned = FedPose { rotation: [0.0; 4], ..here };
    assert_eq!(handle.transform(fly, 0.8, unturned), Err(Refused::Unturned));
}

#[test]
fn a_replay_ends_where_nobody_listens_any_more() {
    let studio = Studio::new();
    let extent = Extent { rate_hz: RATE_HZ, from_s: 0.0, to_s: None, duration_s: Some(0.5) };
    let mut frames = 0;
    let rendered = live::replay(
        scene(&studio, STEREO),
        EngineSettings { room: 32, loads_behind: true, ..settings() },
        |handle| {
            let all = (1..=20_000).map(|frame| f64::from(frame) * FRAME_S);
            for time_s in all {
                handle.advance(time_s).map_err(Refused::fault)?;
            }
            Ok(())
        },
        |mixer, header| {
            offline::render(mixer, header.channels().len(), &extent, false, |piece| {
                frames += piece.mix.len() / 2;
                Ok(())
            })
        },
    );
    rendered.unwrap();
    assert_eq!(frames, 24_000);
}

#[test]
fn all_that_is_told_is_heard_when_it_should_be() {
    let studio = Studio::new();
    // One after the other, without the fly of the scene.
    let only = |what: &'static str| {
        move |handle: &mut Handle, frame: u32| {
            let time_s = f64::from(frame) * FRAME_S;
            let bodies = ["block", "table"].map(|name| handle.body(name).unwrap());
            if frame == 1 {
                handle.vanish("fly", time_s).unwrap();
                handle.vanish("bell", time_s).unwrap();
            }
            match (what, frame) {
                ("wasp", 40) => {
                    let wasp = handle.appear("fly", "wasp", time_s, FedPose::at([0.0, 1.0, 1.0]));
                    assert!(wasp.is_ok());
                }
                ("wasp", 70) => handle.vanish("wasp", time_s).unwrap(),
                ("cloth", 40..70) => {
                    let mesh = handle.object("sheet").unwrap();
                    handle.mesh(mesh, time_s, &vertices(time_s, linen)).unwrap();
                }
                ("paper", 40..70) => {
                    let mesh = handle.object("letter").unwrap();
                    handle.mesh(mesh, time_s, &vertices(time_s, letter)).unwrap();
                }
                // What is hit as it appears.
                ("born", 40) => {
                    assert!(handle.appear("block", "block 2", time_s, FedPose::at([0.0, 0.8, 0.0])).is_ok());
                    let bodies = ["block 2", "table"].map(|name| handle.body(name).unwrap());
                    handle.contact(bodies, &row(time_s, 0.0, Push::Impulse(0.5), None)).unwrap();
                }
                ("material", 39) => handle.material("block", "tin", time_s).unwrap(),
                ("material" | "hit", 40) => {
                    handle.contact(bodies, &row(time_s, 0.0, Push::Impulse(0.5), None)).unwrap();
                }
                ("slide", 40..70) => {
                    let slides = row(time_s, 0.0, Push::Impulse(0.1), Some(0.5));
                    handle.contact(bodies, &slides).unwrap();
                }
                _ => {}
            }
            handle.advance(time_s).unwrap();
        }
    };
    let sound = |what: &'static str| replayed(scene(&studio, STEREO), settings(), 120, only(what));
    let loud = |sound: &[f32], from_s: f64, to_s: f64| {
        power(sound, 2, from_s, to_s.min(sound.len() as f64 / 96_000.0))
    };
    for (what, least_db) in [
        ("wasp", -70.0),
        ("cloth", -110.0),
        ("paper", -90.0),
        ("hit", -80.0),
        ("born", -80.0),
        ("slide", -80.0),
    ] {
        let sound = sound(what);
        assert_eq!(loud(&sound, 0.1, 0.64), 0.0, "{what} is not heard before it is there");
        let db = 10.0 * loud(&sound, 0.7, 1.0).log10();
        eprintln!("{what}: {db:.1} dB");
        assert!(db > least_db, "{what}: {db} dB");
        // The block rings for long.
        if !["hit", "born", "slide"].contains(&what) {
            let last = sound.iter().rposition(|sample| *sample != 0.0).unwrap();
            let end_s = last as f64 / 96_000.0;
            eprintln!("{what} ends at {end_s:.3} s");
            assert!(end_s < 1.7, "{what} is heard behind its end, {end_s} s");
        }
    }
    assert!(distance(&sound("material")[..100_000], &sound("hit")[..100_000]) > 0.1, "it is of tin");
}

#[test]
fn impacts_and_slides_are_those_of_a_log() {
    let studio = Studio::new();
    let mut log = String::from("t,a,b,x,y,z,fn,v1,v2\n");
    let mut rows = Vec::new();
    for step in 1..=1500u32 {
        let time_s = f64::from(step) * 0.001;
        let force_n = match step {
            100 | 250 => 400.0,
            400..=1000 => 20.0,
            _ => continue,
        };
        let x = 0.5 * (time_s - 0.4).max(0.0).powi(2);
        let speed_mps = (time_s - 0.4).max(0.0);
        log += &format!("{time_s:.3},block,table,{x:.6},0.8,0,{force_n},{speed_mps:.5},0\n");
        rows.push(row(time_s, x, Push::Force(force_n), Some(speed_mps)));
    }
    studio.file("contacts.csv", &log);
    let told = scene(&studio, STEREO);
    let text = std::fs::read_to_string(studio.path("told.toml")).unwrap();
    let silent = text.split("[[object]]\nname = 'fly'").next().unwrap().to_owned();
    let logged = format!(
        "{silent}[[contacts]]\nlog = 'contacts.csv'\nstep = 0.001\ncolumns = {{ t = 't', a = 'a', b = 'b', \
         position = ['x', 'y', 'z'], normal_force = 'fn', sliding_velocity = ['v1', 'v2'] }}\n"
    );
    drop(told);
    let expected = studio.scene(&logged, Take::at(RATE_HZ)).unwrap().mix;
    let settings = EngineSettings { contact_step_s: 0.001, ..unhurried() };
    let delay_s = {
        let scene = Scene::open(studio.file("silent.toml", &silent), false).unwrap();
        live::start(scene, settings.clone()).unwrap().0.latency().delays.rubbing_s
    };
    let scene = Scene::open(studio.path("silent.toml"), false).unwrap();
    let found = replayed(scene, settings, 120, |handle, frame| {
        let now_s = f64::from(frame) * FRAME_S;
        let bodies = ["block", "table"].map(|name| handle.body(name).unwrap());
        let before_s = f64::from(frame - 1) * FRAME_S;
        let in_frame = |row: &&ContactRow| row.time_s > before_s && row.time_s <= now_s;
        rows.iter().filter(in_frame).for_each(|row| handle.contact(bodies, row).unwrap());
        handle.advance(now_s).unwrap();
    });
    // Blows of one step are the same; keys of ways that stand still make no difference.
    let impacts = 2 * 19_000;
    let (same, loud) = (distance(&found[..2 * 48_000], &expected[..2 * 48_000]), &expected[..impacts]);
    let peak = loud.iter().fold(0.0f32, |peak, s| peak.max(s.abs()));
    let worst = found[..impacts].iter().zip(loud).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(peak > 0.01 && worst < 1e-6 * peak, "{worst} of {peak}, {same}");
    // What slides is as loud, so much later: each tenth of a second.
    for tenth in 5..9 {
        let from_s = 0.1 * f64::from(tenth);
        // The middle of the glide to each moment.
        let later_s = delay_s + 0.005;
        let off_db = 10.0
            * (power(&found, 2, from_s + later_s, from_s + later_s + 0.1)
                / power(&expected, 2, from_s, from_s + 0.1))
            .log10();
        eprintln!("from {from_s:.1} s: {off_db:.2} dB");
        assert!(off_db.abs() < 1.5, "from {from_s} s: {off_db} dB");
    }
}

#[test]
fn what_is_told_to_move_is_where_it_is_told_to_be() {
    let studio = Studio::new();
    studio.tone("tone.wav");
    let text = |place: &str| {
        format!(
            "duration = 3\n[listener]\nposition = [0, 1, 0]\nlayout = 'stereo'\n\
             [[object]]\nname = 'tone'\nposition = {place}\nsound = {{ recording = 'tone.wav', loop = true }}\n"
        )
    };
    let expected = studio.scene(&text("[0.3, 1.2, -1]"), Take::at(RATE_HZ)).unwrap().mix;
    let (movers, half) = (vec!["tone".to_owned()], std::f64::consts::FRAC_1_SQRT_2);
    let settings = EngineSettings { movers, moves_listener: true, ..unhurried() };
    // All is turned to the left and shifted, listener and object: nothing changes for the ear.
    let scene = Scene::open(studio.file("told.toml", &text("[7, 1, 8]")), false).unwrap();
    let turned = [0.0, half, 0.0, half];
    let (first, live) = live(scene, settings, 120, 256, |handle, frame| {
        if frame == 1 {
            let tone = handle.object("tone").unwrap();
            let at = FedPose { position_m: [9.0, 3.2, 4.7], rotation: turned };
            handle.transform(tone, 0.0, at).unwrap();
            handle.listener(0.0, FedPose { position_m: [10.0, 3.0, 5.0], rotation: turned }).unwrap();
        }
        handle.advance(f64::from(frame) * FRAME_S).unwrap();
    });
    let found = distance(&live, &expected[2 * first..]);
    eprintln!("{found} of the peak away");
    assert!(found < 1e-5, "{found}");
}

#[test]
fn what_is_told_is_heard_after_the_latency_that_is_said() {
    let studio = Studio::new();
    let mut click = vec![0.0f32; 480];
    click[0] = 0.5;
    studio.recording("click.wav", RATE_HZ, &click);
    // The microphone is at the contact, so that no air is between them.
    let text = "duration = 9\n[[microphone]]\nname = 'm'\nposition = [0, 0.8, 0]\n\
                [material.wood]\nimpact = { recordings = ['click.wav'] }\n\
                [[object]]\nname = 'block'\nmaterial = 'wood'\n";
    for (frame_s, key_step_s) in [(FRAME_S, 0.005), (0.004, 0.001)] {
        for block in [32, 128, 1024, 4096] {
            let block_s = block as f64 / f64::from(RATE_HZ);
            // A frame of the game passes between two calls, and a block is asked for at once.
            let ahead_s = frame_s + block_s + 0.0015;
            let scene = Scene::open(studio.file("told.toml", text), false).unwrap();
            let settings = EngineSettings {
                contact_step_s: frame_s,
                ahead_s,
                key_step_s,
                slice_frames: 64,
                ..unhurried()
            };
            let (mut handle, player) = live::start(scene, settings).unwrap();
            let latency_s = handle.latency().all_s;
            let mut device = Device::new(player, block);
            let bodies = ["block", "ground"].map(|name| handle.body(name).unwrap());
            let frames = (1.2 / frame_s) as u32;
            let mut told_s = Vec::new();
            for frame in 1..=frames {
                let now_s = f64::from(frame) * frame_s;
                device.play(&handle, now_s);
                // Now and then, at odd places within frames; it is told at the end of its frame.
                if frame % (0.25 / frame_s) as u32 == 7 {
                    let time_s = now_s - 0.3 * frame_s;
                    handle.contact(bodies, &row(time_s, 0.0, Push::Impulse(1.0), None)).unwrap();
                    told_s.push(time_s);
                }
                handle.advance(now_s).unwrap();
            }
            let statistics = handle.statistics();
            assert_eq!((statistics.held, statistics.skipped_frames), (0, 0), "{statistics:?}");
            let mut heard_s = Vec::new();
            for (frame, sample) in device.sound.iter().enumerate() {
                let time_s = frame as f64 / f64::from(RATE_HZ);
                let is_new = heard_s.last().is_none_or(|last| time_s - last > 0.05);
                if sample.abs() > 0.1 && is_new {
                    heard_s.push(time_s);
                }
            }
            // What was told before the device first asked is not heard.
            let late = |heard: &f64| told_s.iter().rfind(|told| *told < heard).map(|told| heard - told);
            let late: Vec<f64> = heard_s.iter().filter_map(late).collect();
            assert!(late.len() >= 3, "{heard_s:?} {told_s:?}");
            let [least, most] = [f64::min as fn(f64, f64) -> f64, f64::max]
                .map(|of| late.iter().copied().reduce(of).unwrap());
            // Nobody knows better here than that a blow is in the middle of its step, which its contact is 0.3 of it before
            // the end of.
            let early_s = 0.5 * frame_s;
            eprintln!(
                "frames of {:.1} ms, blocks of {block}: heard {:.1} to {:.1} ms later, {:.1} ms are said",
                1e3 * frame_s,
                1e3 * least,
                1e3 * most,
                1e3 * latency_s
            );
            // It may be a block later that the device first asks, when so much is there.
            assert!(most <= latency_s + block_s.min(frame_s), "{late:?}");
            assert!(least > latency_s - early_s - block_s - 0.003, "{late:?}");
            // The same for all: what is told keeps its rhythm.
            assert!(most - least < 1e-3, "{late:?}");
        }
    }
}

#[test]
fn sounds_are_loaded_while_others_are_heard() {
    let studio = Studio::new();
    drop(scene(&studio, STEREO));
    let text = std::fs::read_to_string(studio.path("told.toml")).unwrap();
    // One that is no recording, and one that is told what it has no control for.
    studio.file("broken.wav", "RIFF, but not for long");
    let wrong = "[[object]]\nname = 'broken'\nposition = [0, 0, 0]\nsound = { recording = 'broken.wav' }\n\
                 [[object]]\nname = 'wrong'\nposition = [0, 0, 0]\n\
                 sound = { instrument = 'other', set = [{ t = 0, cheese = 3 }] }\n[[object]]\nname = 'bell'";
    let other = "[instrument]\nother = { kind = 'needle' }\n";
    let text = text.replace("[[object]]\nname = 'bell'", wrong).replace("[instrument]\n", other);
    let scene = |text: &str| Scene::open(studio.file("behind.toml", text), false).unwrap();
    let behind = || EngineSettings { loads_behind: true, ahead_s: FRAME_S + 0.01, ..settings() };
    assert!(live::start(scene(&text), settings()).is_err(), "all is loaded first, and one cannot be");
    let (mut handle, player) = live::start(scene(&text), behind()).unwrap();
    let mut device = Device::new(player, 256);
    let (mut frame, mut loaded_s, mut faults) = (0, None, 0);
    while loaded_s.is_none_or(|loaded_s| f64::from(frame) * FRAME_S < loaded_s + 2.0) {
        frame += 1;
        let now_s = f64::from(frame) * FRAME_S;
        device.play(&handle, now_s);
        let bodies = ["block", "table"].map(|name| handle.body(name).unwrap());
        if frame % 10 == 0 {
            handle.contact(bodies, &row(now_s, 0.0, Push::Impulse(0.5), None)).unwrap();
        }
        let sheet = handle.object("sheet").unwrap();
        handle.mesh(sheet, now_s, &vertices(now_s, linen)).unwrap();
        handle.advance(now_s).unwrap();
        if let Some(fault) = handle.take_fault() {
            assert!(handle.is_running(), "{fault}");
            faults += 1;
        }
        let [there, all] = handle.loaded();
        if there == all && loaded_s.is_none() {
            assert!(all > 5, "{all} sounds");
            loaded_s = Some(now_s);
        }
        assert!(frame < 20_000, "{there} of {all}");
    }
    assert_eq!(faults, 2, "what cannot be loaded or used is told, and does not end it");
    let end_s = device.frames() as f64 / f64::from(RATE_HZ);
    let sound = &device.sound;
    // The fly goes on, the cloth rustles, the block rings.
    assert!(handle.statistics().threads >= 4 && power(sound, 2, end_s - 1.0, end_s) > 1e-6);
    assert_eq!(handle.left_out(), Left::default());
}

/// What nobody should tell, for some seconds in frames of 4 ms: numbers that are none, times that leap, floods, births and
/// deaths. For how long says `FROUFROU_HOSTILE_S`; beyond a minute memory is looked at as well:
///
///     FROUFROU_HOSTILE_S=600 cargo test --release -p froufrou --test engine -- --nocapture hostile
#[test]
fn a_hostile_feed_is_contained() {
    let seconds =
        std::env::var("FROUFROU_HOSTILE_S").map_or(12.0, |text| text.parse().expect("a number of seconds"));
    let frames = (seconds * 250.0) as u64;
    let studio = Studio::new();
    let scene = scene(&studio, STEREO);
    let settings = EngineSettings { room: 4096, budget: 0.8, ..settings() };
    let (mut handle, mut player) = live::start(scene, settings).unwrap();
    let random = Random::new(9, 9);
    let number = |n: u64| match random.below(2 * n, 12) {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => -1e300,
        3 => 1e11,
        _ => 4.0 * random.uniform(2 * n + 1) - 2.0,
    };
    let bodies = ["block", "table"].map(|name| handle.body(name).unwrap());
    let [sheet, page, fly] = ["sheet", "letter", "fly"].map(|name| handle.object(name).unwrap());
    let mut block = vec![0.0; 2 * 1024];
    let (mut now_s, mut refused, mut faults, mut born) = (0.0f64, 0, 0, 0u64);
    // The most memory in either half.
    let (mut memory, mut alive) = ([0; 2], VecDeque::new());
    for n in 0..frames {
        let m = 1000 * n;
        let mut refuse = |is_refused: bool| refused += u64::from(is_refused);
        // Now and then more than there is room for.
        let contacts = if n % 97 == 0 { 3000 } else { 3 };
        for k in 0..contacts {
            let m = m + 20 * (k % 20);
            let row = ContactRow {
                time_s: now_s + if (n + k) % 7 == 0 { number(m) } else { 0.001 },
                a: 7,
                b: 9,
                position_m: [number(m + 1), number(m + 2), number(m + 3)],
                push: Push::Impulse(number(m + 4) * 100.0),
                normal: (n % 2 == 0).then(|| [number(m + 5), number(m + 6), 0.0]),
                normal_velocity_mps: (n % 3 == 0).then(|| number(m + 7)),
                sliding_mps: (n % 5 != 0).then(|| number(m + 8)),
                line: 0,
            };
            let state = BodyState {
                position_m: [number(m + 9); 3],
                velocity_mps: [number(m + 10); 3],
                ..BodyState::STILL
            };
            let at_s = (n % 11 == 0).then(|| number(m + 11));
            let touch = Touch { row, states: [(n % 4 == 0).then_some(state), None], at_s };
            refuse(handle.touch(bodies, &touch).is_err());
        }
        let pose = |m: u64| FedPose {
            position_m: [number(m), number(m + 1), number(m + 2)],
            rotation: [number(m + 3), number(m + 4), number(m + 5), number(m + 6)],
        };
        refuse(handle.transform(fly, now_s + 0.001, pose(m + 500)).is_err());
        refuse(handle.listener(now_s + 0.001, pose(m + 510)).is_err());
        let mut positions = vertices(now_s, linen);
        if n % 5 == 0 {
            positions[n as usize % 169][1] = number(m + 520) as f32;
        }
        // Another mesh, or one that its faces are not of.
        if n % 61 == 0 {
            positions.truncate((n % 180) as usize);
        }
        if n % 3 == 0 {
            refuse(handle.mesh(sheet, now_s + 0.001, &positions).is_err());
            let torn = Faces {
                vertices: (0..90).map(|k| (random.bits(m + k) % 180) as u32).collect(),
                sizes: vec![3; 30],
            };
            let torn = handle.mesh_with_faces(page, now_s + 0.001, &vertices(now_s, letter), Arc::new(torn));
            refuse(torn.is_err());
        }
        // Thousands of births and deaths a second, of what is hit as soon as it is there.
        for k in 0..8 {
            let name = format!("block {born}");
            born += 1;
            let kind = ["block", "fly", "sheet", "nothing"][random.below(m + 600 + k, 4)];
            refuse(
                handle
                    .appear(kind, &name, now_s + 0.001, FedPose::at([number(m + 700 + k), 1.0, 0.0]))
                    .is_err(),
            );
            match handle.body(&name) {
                Ok(body) => {
                    let hit = row(now_s + 0.0015, 0.0, Push::Impulse(0.1), Some(0.2));
                    refuse(handle.contact([body, bodies[1]], &hit).is_err());
                }
                Err(_) => refuse(true),
            }
            refuse(
                handle
                    .material(
                        &name,
                        ["wood", "tin", "linen", "cheese"][random.below(m + 800 + k, 4)],
                        now_s + 0.0015,
                    )
                    .is_err(),
            );
            alive.push_back(name);
        }
        // Who could not be told to vanish is told again.
        while let Some(oldest) = alive.front().filter(|_| alive.len() > 60) {
            match handle.vanish(oldest, now_s + 0.0015) {
                Ok(()) | Err(Refused::Unknown) => drop(alive.pop_front()),
                Err(_) => break,
            }
        }
        let wrong_s = match n % 4 {
            0 => f64::NAN,
            2 => 1e300,
            _ => -number(m + 900).abs(),
        };
        refuse(handle.advance(wrong_s).is_err());
        // A clock that leaps by mistake and comes back.
        if n % 499 == 0 {
            refuse(handle.advance(now_s + 1e8).is_err());
        }
        now_s += match n % 1009 {
            1008 => 1e4,
            _ => 0.004,
        };
        refuse(handle.advance(now_s).is_err());
        let block = &mut block[..2 * (1 + (n % 383) as usize)];
        let ((), calls) = calls(|| player.fill(block));
        assert_eq!(calls, 0, "the audio thread takes no memory");
        assert!(block.iter().all(|sample| sample.abs() <= 1.0));
        if let Some(fault) = handle.take_fault() {
            faults += 1;
            assert!(handle.is_running(), "the worker ended: {fault}");
        }
        // Real time, in all.
        std::thread::sleep(std::time::Duration::from_micros(3_500));
        if n % 250 == 0 {
            let most = &mut memory[usize::from(n >= frames / 2)];
            *most = resident().max(*most);
        }
    }
    let (left, statistics) = (handle.left_out(), handle.statistics());
    eprintln!("{left:?}\n{statistics:?}\n{faults} faults, {born} births, {memory:?} bytes");
    let counted = left.not_finite + left.earlier + left.full + left.unknown + left.ahead;
    assert!(left.not_finite > frames && counted >= refused, "all that is left out is counted: {refused}");
    assert!(left.full > 0 && faults > 0 && statistics.played_frame > 48_000);
    // What grows for ever would have doubled.
    let [early, late] = memory;
    assert!(seconds < 60.0 || late as f64 <= 1.2 * early as f64, "{early} bytes have become {late}");
}

/// The memory that the process holds, in bytes; 0 where nobody knows.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kibibytes = line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
    kibibytes.unwrap_or_default() << 10
}
