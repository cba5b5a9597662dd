//! What plays through a device: from anywhere, one player after another, and with pauses.

mod allocation;
mod studio;

use allocation::calls;
use froufrou::render::live::{self, Player, Settings, Supply, deck};
use froufrou::render::production::{ChannelLines, Production};
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers;
use studio::{Studio, Take, noise};

const RATE_HZ: u32 = 48_000;

/// Sounds that have begun before, that begin, and that ring on.
fn scene(studio: &Studio, listener: &str, more: &str) -> String {
    studio.recording("hum.wav", 44_100, &noise(30_000, 1).iter().map(|s| 0.1 * s).collect::<Vec<_>>());
    studio.recording("hit.wav", 48_000, &noise(9_600, 2).iter().map(|s| 0.05 * s).collect::<Vec<_>>());
    format!(
        "duration = 1.2\nseed = 3\n{listener}\n\
         [instrument]\nbar = {{ kind = 'free-bar', with = {{ frequency = 523, damping = 0.002 }} }}\n\
         [[object]]\nname = 'fly'\nposition = [1, 1, 0]\nsound = {{ recording = 'hum.wav', loop = true, speed = 1.1 }}\n\
         [[object]]\nname = 'bell'\nposition = [2, 1, -1]\nsound = {{ recording = 'hit.wav', at = [0.2, 0.55, 0.9] }}\n\
         [[object]]\nname = 'bar'\nposition = [-1, 1, -1]\n\
         sound = {{ instrument = 'bar', at = [0.1, 0.7], gain_db = -40 }}\n{more}"
    )
}

const STEREO: &str = "[[microphone]]\nname = 'left'\nposition = [-0.2, 1, 2]\n[[microphone]]\nname = 'right'\n\
     shape = 'cardioid'\nposition = [0.2, 1, 2]";

fn open(production: &Production, from_s: f64) -> (Supply<ChannelLines<'_>>, Player) {
    let header = production.channel_header();
    let receivers = receivers::load(&header, &production.scene.folder, RATE_HZ).unwrap();
    let lines = production.channel_lines().unwrap();
    let mixer = Mixer::new(RATE_HZ, receivers, production.prototypes.clone(), lines).unwrap();
    let settings = Settings { ahead_s: 0.1, from_s, duration_s: header.duration_s, ..Settings::default() };
    live::part(mixer.with_seed(header.seed), settings).unwrap()
}

#[test]
fn what_begins_anywhere_is_that_part_of_the_whole() {
    let studio = Studio::new();
    let room = "[room]\nsize = [6, 3, 5]\ncorner = [-3, 0, -2.4]\nabsorption = 0.2\n";
    let head = "[listener]\nposition = [0, 1.2, 2]\nlayout = 'binaural'\nshared = true";
    for (what, listener, more, near) in [
        ("microphones", STEREO, "", 0.0),
        // The FFTs of buses begin elsewhere, so that they round otherwise.
        ("a room", STEREO, room, 1e-6),
        ("a head", head, "", 1e-6),
    ] {
        let text = scene(&studio, listener, more);
        let whole = studio.scene(&text, Take::at(RATE_HZ)).unwrap();
        let production = studio.production(&text).unwrap();
        for from_s in [0.0, 0.37, 0.700_01, 1.19] {
            let (mut supply, mut player) = open(&production, from_s);
            let late = player.limiter_latency();
            let from = (from_s * f64::from(RATE_HZ)).ceil() as usize;
            let (mut found, mut block) = (Vec::new(), [0.0; 300]);
            while !player.is_over() {
                supply.go_on().unwrap();
                player.fill(&mut block);
                found.extend_from_slice(&block);
            }
            let (expected, found) = (&whole.mix[2 * from..], &found[2 * late..]);
            // What the limiter still had from before the beginning is heard first.
            let count = expected.len().min(found.len());
            assert!(count + 2 * late >= expected.len(), "{what} from {from_s}");
            let differs = (0..count).find(|&n| (found[n] - expected[n]).abs() > near);
            assert_eq!(differs, None, "{what} from {from_s}: {:?}", differs.map(|n| (found[n], expected[n])));
        }
        let (mut supply, mut player) = open(&production, 5.0);
        let mut block = [1.0; 300];
        supply.go_on().unwrap();
        player.fill(&mut block);
        assert!(supply.is_over() && block == [0.0; 300], "{what}: nothing is there");
    }
}

/// Plays so many frames.
fn play(deck: &mut deck::Deck, supplies: &mut [&mut Supply<ChannelLines<'_>>], frames: usize) -> Vec<f32> {
    let (mut all, mut block) = (Vec::new(), [0.0; 2 * 96]);
    while all.len() < 2 * frames {
        for supply in &mut *supplies {
            supply.go_on().unwrap();
        }
        let ((), calls) = calls(|| deck.fill(&mut block));
        assert_eq!(calls, 0, "the audio thread takes no memory and frees none");
        all.extend_from_slice(&block);
    }
    all
}

/// The largest step from one frame to the next.
fn step(sound: &[f32]) -> f32 {
    sound.iter().zip(&sound[2..]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn tone(studio: &Studio) -> Production {
    studio.tone("tone.wav");
    let text = format!(
        "duration = 3\n{STEREO}\n[[object]]\nname = 'tone'\nposition = [0.3, 1.2, 1]\n\
         sound = {{ recording = 'tone.wav', loop = true }}\n"
    );
    studio.production(&text).unwrap()
}

#[test]
fn a_pause_is_silent_and_what_follows_goes_on_where_it_was() {
    let studio = Studio::new();
    let production = tone(&studio);
    let (mut supply, player) = open(&production, 0.5);
    let (mut deck, mut changer) = deck::new(2);
    changer.play(player).map_err(|_| "room").unwrap();
    let before = play(&mut deck, &mut [&mut supply], 9_600);
    changer.pause(true);
    let fading = play(&mut deck, &mut [&mut supply], 960);
    let at = supply.statistics().played_frame;
    let silent = play(&mut deck, &mut [&mut supply], 9_600);
    assert_eq!(supply.statistics().played_frame, at, "time stands still");
    assert!(silent.iter().all(|sample| *sample == 0.0));
    changer.pause(false);
    let after = play(&mut deck, &mut [&mut supply], 9_600);
    assert!(supply.statistics().played_frame >= at + 9_600);
    let all = [&before[..], &fading, &silent, &after].concat();
    assert!(step(&all) <= 1.06 * step(&before), "no click");
    // Behind the fade it is what comes next.
    let whole = {
        let (mut supply, mut player) = open(&production, 0.5);
        let mut sound = vec![0.0; 2 * 40_000];
        for block in sound.chunks_mut(192) {
            supply.go_on().unwrap();
            player.fill(block);
        }
        sound
    };
    let from = 2 * (at as usize - 24_000 + 960);
    assert_eq!(after[2 * 960..], whole[from..from + after.len() - 2 * 960]);
    assert_eq!(supply.statistics().held, 0);
}

#[test]
fn another_player_is_faded_in_and_the_old_one_comes_back() {
    let studio = Studio::new();
    let production = tone(&studio);
    let (mut old, player) = open(&production, 0.5);
    let (mut new, next) = open(&production, 1.000_17);
    let (mut deck, mut changer) = deck::new(2);
    changer.play(player).map_err(|_| "room").unwrap();
    let before = play(&mut deck, &mut [&mut old], 9_600);
    changer.play(next).map_err(|_| "room").unwrap();
    let after = play(&mut deck, &mut [&mut old, &mut new], 9_600);
    let all = [&before[..], &after].concat();
    assert!(step(&all) <= 1.06 * step(&before), "no click: {} beside {}", step(&all), step(&before));
    let at = old.statistics().played_frame;
    let end = new.statistics().played_frame;
    play(&mut deck, &mut [&mut old, &mut new], 960);
    assert_eq!(old.statistics().played_frame, at, "it is played no more");
    assert!(new.statistics().played_frame > end);
    changer.tidy();
    let other = open(&production, 0.0).1;
    assert!(deck::new(1).1.play(other).is_err(), "another number of channels");
}
