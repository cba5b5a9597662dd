//! What an audio thread does where there is no time for all voices: the least audible ones are let go without a click and
//! come back, by a clock that is made up.

mod allocation;

use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use allocation::calls;
use froufrou::random::Random;
use froufrou::render::live::{self, Clock, Player, Settings, Supply};
use froufrou::score::{Arrival, ChannelLine, Header, Order, Output, Start, Statement, Verb};
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers;
use froufrou::synth::voice::Prototype;

const RATE_HZ: u32 = 48_000;
const VOICES: u64 = 400;
const FITTING: usize = 120;
const BLOCK: usize = 128;
const BUDGET: f64 = 0.8;
const FADE_FRAMES: f64 = 384.0;

type Lines = std::vec::IntoIter<froufrou::Result<ChannelLine>>;

/// A clock on which work takes as long as is said, in seconds for a unit and frame, as bits.
struct Made {
    now_s: f64,
    work_s: Arc<AtomicU64>,
}

impl Clock for Made {
    fn now_s(&mut self) -> f64 {
        self.now_s
    }

    fn rendered(&mut self, work: f64, frames: usize) {
        self.now_s += f64::from_bits(self.work_s.load(Relaxed)) * work * frames as f64;
    }
}

/// How loud a voice is: in no order, and none as loud as another.
fn gain(thread: u64) -> f64 {
    2e-6 * (1.0 + ((thread * 377) % VOICES) as f64)
}

fn is_among_the_loudest(thread: u64) -> bool {
    (thread * 377) % VOICES >= VOICES - FITTING as u64
}

/// Tones of 94 to 188 Hz, all as loud but for their gains, that stand still.
fn lines(end_s: f64, is_there: impl Fn(u64) -> bool) -> Lines {
    let mut lines = Vec::new();
    for (time_s, ends) in [(0.0, false), (end_s, true)] {
        for thread in (0..VOICES).filter(|thread| is_there(*thread)) {
            let speed = 0.5 + 0.5 * Random::new(1, 1).uniform(thread);
            let start = Start { speed, ..Start::new("tone") };
            let verb = if ends { Verb::End } else { Verb::Start(start) };
            let value = vec![Arrival::new(gain(thread), 0.01)];
            lines.push(Ok(ChannelLine::Thread(Statement { thread, path: 0, time_s, verb, value })));
        }
    }
    lines.into_iter()
}

fn open(output: &Output, lines: Lines, budget: f32) -> (Supply<Lines>, Player) {
    let from_m = matches!(output, Output::Head { .. }).then_some([0.0, 0.0, 2.0]);
    let placed = |line| match line {
        Ok(ChannelLine::Thread(mut line)) => {
            line.value.iter_mut().for_each(|arrival| arrival.from_m = from_m);
            Ok(ChannelLine::Thread(line))
        }
        line => line,
    };
    let lines = lines.map(placed).collect::<Vec<_>>().into_iter();
    // Each 1024 samples are as loud as all others.
    let samples = (0..4096).map(|n| (TAU * f64::from(n) / 256.0).sin() as f32).collect();
    let tone = Prototype { samples, rate_hz: f64::from(RATE_HZ), looped: true };
    let header = Header::new(Order::Time, vec![output.clone()]);
    let receivers = receivers::load(&header, std::path::Path::new(""), RATE_HZ).unwrap();
    let mixer = Mixer::new(RATE_HZ, receivers, [("tone".to_owned(), tone.into())], lines).unwrap();
    live::part(mixer, Settings { budget, ..Settings::default() }).unwrap()
}

/// Some blocks of a player; no memory is taken.
fn play((supply, player): &mut (Supply<Lines>, Player), blocks: usize) -> Vec<f32> {
    let mut all = Vec::new();
    let mut block = vec![0.0; BLOCK * player.channels()];
    for _ in 0..blocks {
        supply.go_on().unwrap();
        let ((), calls) = calls(|| player.fill(&mut block));
        assert_eq!(calls, 0, "the audio thread takes no memory");
        all.extend_from_slice(&block);
    }
    all
}

fn outputs() -> [Output; 2] {
    [
        Output::Channel("microphone".to_owned()),
        Output::Head { ears: ["left".to_owned(), "right".to_owned()], head: None, shared: true },
    ]
}

/// What a voice's work takes where as many fit as are to, and a few more would not.
fn fitting_s(output: &Output) -> f64 {
    // A voice's work is measured by the clock itself.
    let one = Arc::new(AtomicU64::new(1f64.to_bits()));
    let (supply, player) = open(output, lines(1.0, |thread| thread == 0), f32::INFINITY);
    let counted = Arc::new(AtomicU64::new(0));
    struct Counting(Arc<AtomicU64>, Made);
    impl Clock for Counting {
        fn now_s(&mut self) -> f64 {
            self.1.now_s()
        }
        fn rendered(&mut self, work: f64, _: usize) {
            self.0.fetch_max(work as u64, Relaxed);
        }
    }
    let clock = Counting(counted.clone(), Made { now_s: 0.0, work_s: one });
    play(&mut (supply, player.with_clock(Box::new(clock))), 20);
    let work = counted.load(Relaxed) as f64;
    BUDGET / f64::from(RATE_HZ) / ((FITTING as f64 + 0.5) * work)
}

#[test]
fn the_loudest_are_heard_as_if_there_were_no_others() {
    for output in outputs() {
        let work_s = Arc::new(AtomicU64::new(fitting_s(&output).to_bits()));
        let clock = Box::new(Made { now_s: 0.0, work_s: work_s.clone() });
        let (supply, player) = open(&output, lines(20.0, |_| true), BUDGET as f32);
        let mut limited = (supply, player.with_clock(clock));
        let mut all = open(&output, lines(20.0, |_| true), f32::INFINITY);
        let mut loudest = open(&output, lines(20.0, is_among_the_loudest), f32::INFINITY);
        let channels = limited.1.channels();

        // There is no time for all from the beginning on.
        let found = play(&mut limited, 120);
        let [of_all, of_loudest] = [&mut all, &mut loudest].map(|player| play(player, 120));
        let statistics = limited.1.statistics();
        assert_eq!(statistics.released as usize, VOICES as usize - FITTING, "{statistics:?}");
        assert_eq!(statistics.stolen, u64::from(statistics.released), "none flutters");
        assert!((1..=12).contains(&statistics.late_blocks), "{statistics:?}");
        let behind = channels * BLOCK * 40;
        assert!(found[behind..] == of_loudest[behind..], "the loudest are heard to the last bit");
        assert!(of_all[behind..] != of_loudest[behind..]);
        // No click: no step is greater than those of the sound, and of the whole of it fading.
        let step = |sound: &[f32]| {
            let pairs = sound.iter().zip(&sound[channels..]);
            pairs.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
        };
        let peak = |sound: &[f32]| sound.iter().fold(0.0, |peak, sample| sample.abs().max(peak));
        let allowed = |sound: &[f32]| step(sound) + f64::from(peak(sound)) * 0.5 * PI / FADE_FRAMES;
        let begun = channels * BLOCK * 5;
        assert!(step(&found) <= allowed(&of_all), "{} beside {}", step(&found), allowed(&of_all));
        assert!(peak(&found[begun..]) > 1e-3);

        // With more room they all come back, as smoothly, and sound as ever.
        let steady_s = f64::from_bits(work_s.load(Relaxed));
        work_s.store((steady_s * 0.2).to_bits(), Relaxed);
        let found = play(&mut limited, 1000);
        let expected = play(&mut all, 1000);
        assert!(step(&found) <= allowed(&expected), "{} beside {}", step(&found), allowed(&expected));
        let stolen = statistics.stolen;
        let statistics = limited.1.statistics();
        assert_eq!((statistics.released, statistics.stolen), (0, stolen), "{statistics:?}");
        assert!(found[channels * BLOCK * 950..] == expected[channels * BLOCK * 950..]);
    }
}

/// A clock on which work takes more or less at random, by 30 %, and twenty times as much once in two hundred blocks, when
/// others are let in.
struct Jittering {
    made: Made,
    pieces: u64,
    /// What the time is, as bits, and how often others have been let in.
    told: Arc<[AtomicU64; 2]>,
}

impl Clock for Jittering {
    fn now_s(&mut self) -> f64 {
        self.told[0].store(self.made.now_s.to_bits(), Relaxed);
        self.made.now_s
    }

    fn rendered(&mut self, work: f64, frames: usize) {
        let random = Random::new(3, 3);
        let others = random.uniform(2 * self.pieces) < 1.0 / 200.0;
        let takes = 0.7 + 0.6 * random.uniform(2 * self.pieces + 1);
        self.told[1].fetch_add(u64::from(others), Relaxed);
        self.pieces += 1;
        self.made.rendered(work * takes * if others { 20.0 } else { 1.0 }, frames);
    }
}

#[test]
fn no_voice_flutters_where_time_is_not_steady() {
    for output in outputs() {
        let told: Arc<[AtomicU64; 2]> = Arc::default();
        let work_s = Arc::new(AtomicU64::new(fitting_s(&output).to_bits()));
        let made = Made { now_s: 0.0, work_s };
        let clock = Jittering { made, pieces: 0, told: told.clone() };
        let (supply, player) = open(&output, lines(20.0, |_| true), BUDGET as f32);
        let mut limited = (supply, player.with_clock(Box::new(clock)));
        let read = || (f64::from_bits(told[0].load(Relaxed)), told[1].load(Relaxed));
        let (mut taken, mut begun) = (Vec::new(), 0);
        for n in 0..1500 {
            let before = read();
            play(&mut limited, 1);
            let after = read();
            // The estimate takes a second to be sure.
            if n == 375 {
                begun = limited.1.statistics().stolen;
            }
            if n >= 375 && after.1 == before.1 {
                taken.push((after.0 - before.0) * f64::from(RATE_HZ) / BLOCK as f64);
            }
        }
        taken.sort_by(f64::total_cmp);
        let [most, nearly, half] =
            [1.0, 0.9, 0.5].map(|part| taken[((taken.len() - 1) as f64 * part) as usize]);
        let statistics = limited.1.statistics();
        eprintln!(
            "{statistics:?}\n{begun} released in the first second; blocks took {half:.3}, {nearly:.3}, {most:.3}"
        );
        let needed = (VOICES as usize - FITTING) as f64;
        assert!(statistics.stolen as f64 <= 1.2 * needed, "{statistics:?}");
        assert!(f64::from(statistics.released) >= needed);
        assert!(statistics.stolen - begun <= VOICES / 50, "{begun}, {statistics:?}");
        // Not much time is left over either.
        assert!(nearly <= BUDGET && most <= 1.1 * BUDGET && half > 0.7 * BUDGET, "{half} {nearly} {most}");
    }
}

#[test]
fn a_player_that_has_time_changes_no_bit() {
    for output in outputs() {
        let (supply, player) = open(&output, lines(1.0, |_| true), BUDGET as f32);
        let work_s = Arc::new(AtomicU64::new((0.1 * fitting_s(&output)).to_bits()));
        let mut limited = (supply, player.with_clock(Box::new(Made { now_s: 0.0, work_s })));
        let mut all = open(&output, lines(1.0, |_| true), f32::INFINITY);
        assert!(play(&mut limited, 380) == play(&mut all, 380));
        let statistics = limited.1.statistics();
        assert_eq!((statistics.late_blocks, statistics.stolen, statistics.released), (0, 0, 0));
    }
}

#[test]
fn a_voice_for_which_there_is_no_time_does_not_begin() {
    let output = &outputs()[0];
    // The softer ones begin when the loudest have sounded for a while.
    let late = |line: froufrou::Result<ChannelLine>| match line {
        Ok(ChannelLine::Thread(mut line)) if !is_among_the_loudest(line.thread) => {
            line.time_s = (line.time_s + 0.5).min(5.0);
            Ok(ChannelLine::Thread(line))
        }
        line => line,
    };
    let mut lines: Vec<_> = lines(5.0, |_| true).map(late).collect();
    lines.sort_by(|a, b| {
        let time_s = |line: &froufrou::Result<ChannelLine>| line.as_ref().map_or(0.0, ChannelLine::time_s);
        time_s(a).total_cmp(&time_s(b))
    });
    let (supply, player) = open(output, lines.into_iter(), BUDGET as f32);
    let work_s = Arc::new(AtomicU64::new(fitting_s(output).to_bits()));
    let mut limited = (supply, player.with_clock(Box::new(Made { now_s: 0.0, work_s })));
    let mut loudest = open(output, self::lines(5.0, is_among_the_loudest), f32::INFINITY);
    assert!(play(&mut limited, 300) == play(&mut loudest, 300), "they are not heard, not even for a moment");
    let statistics = limited.1.statistics();
    assert_eq!((statistics.late_blocks, statistics.stolen as usize), (0, VOICES as usize - FITTING));
}

#[test]
fn a_budget_that_cannot_be_is_refused() {
    for budget in [f32::NAN, 0.0, -1.0] {
        let header = Header::new(Order::Time, vec![outputs()[0].clone()]);
        let receivers = receivers::load(&header, std::path::Path::new(""), RATE_HZ).unwrap();
        let mixer = Mixer::new(RATE_HZ, receivers, [], lines(1.0, |_| false)).unwrap();
        let refused = live::part(mixer, Settings { budget, ..Settings::default() });
        assert!(refused.err().unwrap().to_string().contains("`budget` is"));
    }
}
