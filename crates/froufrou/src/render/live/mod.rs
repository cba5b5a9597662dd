//! Sound while things happen: the parts that render to files, driven by an audio device.
//!
//! ```text
//! lines ─► Mixer ─ Cutter ─► slices of time ═══► Desk ─► buses ─► limiter ─► blocks
//!            a worker: Supply       ▲    lock-free    the audio thread: Player
//!                                   ╚═══════ used slices ═══════╝
//! ```
//!
//! **Who does what.** All that may take memory, a lock or a while is a worker's: it reads lines, finds the ways of
//! threads, runs instruments and scripts, loads, and passes what has filters of its own (a head that is not shared, the
//! colours of octave bands) through them. [`Supply::go_on`] is its step. What is left is reading signals along their ways,
//! gains, and the long responses of buses: that is done where a device asks for a block, by [`Player::fill`].
//!
//! **What is handed over.** Every output sample is a function of its frame number. So the worker cuts time into
//! [`Slice`](crate::synth::mixer::Slice)s, each with all that is needed to render its frames, in the order of sums of
//! [`offline`]; the audio thread renders them in blocks of any size, with the same bits as a file has. A voice
//! that starts is in the next slice, and one that has ended is in none: nothing is inserted or removed while it plays.
//! Slices go through a ring ([rtrb](https://docs.rs/rtrb), one writer, one reader, no lock), and used ones back through another. The
//! worker fills them again or frees them; the audio thread frees nothing. There are no more of them than both rings
//! hold, so neither can overflow, and memory is bounded.
//!
//! **An engine** ([`start`]) has a worker of its own, which is told what happens while it does. The game thread tells a
//! [`Handle`] contacts, poses, meshes, what appears, vanishes or becomes of another material, and how far time has come; nothing of
//! that waits, and what cannot be taken is counted. It goes through a third ring to the worker, where a chain of the same stages as
//! ever pulls: a feed finds what happens, by `motion::lives` and by the analysers of cloth and paper; the composer makes a score of
//! it, propagation finds what is heard, and the mixer reads its lines. Where nobody knows yet
//! what comes next, the chain waits (the worker does, and no one else). [`Handle::advance`] lets it go on:
//! [`Event::Quiet`](crate::motion::event::Event::Quiet) tells the composer that nothing more comes before a time, and a thread
//! that is silent ([`PULSE`](super::production::PULSE)) has a key every few milliseconds, so that every stage has a next line. The
//! same feed rendered as a file is ([`replay`]) gives the same samples. The worker has helpers of its own for what can be done side
//! by side; what moves in the scene by itself is looked at a little ahead by other threads, for a frame of a large cloth takes longer
//! than what is told may wait.
//!
//! **Nothing is foreseen of what is told.** To files the engine knows the future: a way is smooth through the next key, a grain begins
//! before its impact, a blow is summed over its steps. Told as it happens, all that would be latency. So keys are dense, and a way
//! ends with its last one ([`Foresight::None`](crate::synth::path::Foresight)); a listener is met where it is when the sound leaves; a blow is told with the
//! step in which it begins ([`prompt`](crate::motion::impact::Settings::prompt)); what slides glides to what its last moment says, and so do the controls of
//! instruments; a pop is chosen by the energies of those before it. What has to be looked at for longer comes later by
//! a steady time ([`Delays`]), and nothing else waits for it.
//!
//! **What is loaded when.** All sounds before it begins, or, where [`EngineSettings::loads_behind`] says so, on a thread of their own
//! while others are heard: what plays a sound that is not there yet is silent, and what runs through the scene begins once it is.
//!
//! **How time advances.** The player counts the frames of the score that it has played and lets the worker know. The
//! worker stays [`Settings::ahead_s`] ahead of that, and no line is read earlier than its slice asks for. The audio thread
//! never waits: where the next slice is late, all that sounds goes on as it was, recordings along the last of their
//! ways for 0.2 s, synthesised sounds for as long as they need to come to rest; then all fades. Meanwhile the time of the score
//! stands still. Once so many slices are there again as at the beginning, what comes next is faded in over 10 ms, at the very
//! frame that was due. Where too much is there (the clock of what feeds it is faster than that of the device), some is
//! left out in the same way. Both are counted in [`Statistics`].
//!
//! **Where there is no time for all voices.** What a reading takes is measured while the sound plays: as much as only one block
//! in ten of the last second took more of, blocks left out during which the thread had to wait for others. A slice says
//! how much work its readings are, so it is known before a block whether it would take more than [`Settings::budget`] of
//! its time. Then the least audible voices are released: gain and level of the signal, found by the worker, put them in order. They
//! fade, are not read any more, and come back one after the other, 400 a second at most, when there has been room for half a
//! second; the others keep their bits. A voice
//! that begins where there is no room for it is not heard. What is released is counted, and so are blocks that are late all
//! the same.
//!
//! **What the latency is made of.** From the time of a line to the device: its way through the air; what the mixer has to
//! know ahead ([`Mixer::look_ahead`], small for a mixer that is
//! [uncoloured](Mixer::uncoloured) and does not [look ahead](Mixer::looking_ahead)) and, for what moves, the two keys behind;
//! [`Settings::ahead_s`]; [`Player::limiter_latency`]; a block of the device. In an engine it is one key
//! ([`EngineSettings::key_step_s`]) and 2 ms instead of those, and `ahead_s` is the time between two calls of [`Handle::advance`] and a block:
//! [`Handle::latency`] says all of it. So that it stays the same, an engine begins with the newest that there is, and does so again where
//! it was late ([`Settings::catches_up`]).
//!
//! **What of the system is called.** No lock and no allocation; for the load in [`Statistics`] the clock is read twice a block,
//! and with a budget twice more in each slice, which common systems do without a system call. A player is to be dropped elsewhere than in the callback of a device.
//!
//! **What is taken before it begins.** Room for 256 frames of all channels, lanes and one voice (blocks are rendered in such
//! pieces), the rings, the limiter's frames, and the tables of the resampling kernels, which the worker makes as far
//! as the fastest way in a slice needs them.
//!
//! **No denormals.** The audio thread has no recursion that decays: signals are read and convolved, and the limiter counts
//! in whole numbers. What decays by itself, such as modes, does so in the worker. What is below −300 dB is 0 where recordings and
//! synthesised sounds come in, in the gains of lanes and in what goes there.
//!
//! **No noise from numbers that are none.** They are left out where they would enter a bus, and where they would reach the
//! device, and counted. The limiter changes no bit of what is not louder than full scale; see [`limiter`].
//!
//! | quantity | value |
//! | --- | --- |
//! | cost a voice | that of mixing; a slice more or less costs a copy of the segments that are heard in it |
//! | a budget | two readings of the clock a slice and block; where there is no room for all, a pass over all threads |
//! | memory | that of a mixer, and of slices for three times [`Settings::ahead_s`] |
//!
//! ```no_run
//! use froufrou::render::live::{self, Settings};
//! use froufrou::render::production::Production;
//! use froufrou::scene::Scene;
//! use froufrou::synth::{mixer::Mixer, receivers};
//!
//! let production = Production::open(Scene::open("scene.toml", false)?)?;
//! let header = production.channel_header();
//! let receivers = receivers::load(&header, &production.scene.folder, 48_000)?;
//! let mixer = Mixer::new(48_000, receivers, production.prototypes.clone(), production.channel_lines()?)?;
//! let (mut supply, mut player) = live::part(mixer.with_seed(header.seed), Settings::default())?;
//! // The callback of a device would own the player.
//! let audio = std::thread::spawn(move || {
//!     let mut block = vec![0.0f32; 512 * player.channels()];
//!     while !player.is_over() {
//!         player.fill(&mut block);
//!     }
//! });
//! while !supply.is_over() {
//!     supply.go_on()?;
//!     std::thread::sleep(std::time::Duration::from_millis(1));
//! }
//! # audio.join().ok();
//! # Ok::<(), froufrou::Error>(())
//! ```

pub mod deck;
pub mod limiter;
pub mod lines;

mod budget;
mod capture;
mod counters;
mod engine;
mod feed;
mod handle;
mod meshes;
mod player;
mod supply;
mod told;

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

pub use budget::Clock;
pub use capture::Capture;
pub use counters::Statistics;
pub use engine::{EngineSettings, replay, start};
pub use feed::Delays;
pub use handle::{BodyId, Handle, Latency, Left, MoverId, Refused};
pub use player::Player;
pub use supply::Supply;

use super::offline;
use crate::score::ChannelLine;
use crate::synth::bus::Ringing;
use crate::synth::mixer::{Cutter, Desk, Mixer};
use crate::synth::voice::first_frame;
use crate::{Error, Result};
use budget::Budget;
use counters::Counters;
use limiter::Limiter;
use player::{JOIN_S, PIECE_FRAMES, Running};

/// How far ahead a worker is of what is played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// So much of the score is handed over before it is played, in seconds: what a worker may be late.
    pub ahead_s: f64,
    /// It is handed over in slices of so many frames.
    pub slice_frames: usize,
    /// Where so much more than that is there to be played, some is left out.
    pub slack_s: f64,
    /// Whether whatever more than that is there is left out where it begins, or begins again after it was late: for what is
    /// told as it happens, so that its latency stays the same.
    pub catches_up: bool,
    /// Where it begins, in seconds: what sounds there of what was before is heard.
    pub from_s: f64,
    /// Where all is over, in seconds; `None`: with the score.
    pub duration_s: Option<f64>,
    /// Rendering a block may take this part of the time that the block lasts. Where it would take longer, the least audible
    /// voices are released: they fade within 8 ms, and come back once there has been room for a while. Infinite, as it
    /// is by default: none ever is, and what is played has the bits of a file however slow the machine is. What plays
    /// through a device wants some 0.8.
    pub budget: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            ahead_s: 0.02,
            slice_frames: 128,
            slack_s: 0.05,
            catches_up: false,
            from_s: 0.0,
            duration_s: None,
            budget: f32::INFINITY,
        }
    }
}

/// No more of a score may be handed over ahead, in seconds.
const LONGEST_AHEAD_S: f64 = 10.0;

/// A slice is no longer, in frames.
const LONGEST_SLICE: usize = 8192;

/// Parts a mixer into what a worker does with it and what an audio thread plays.
///
/// # Errors
/// Settings that cannot be; a mixer without channels; lines before its beginning that cannot be read.
pub fn part<L>(mut mixer: Mixer<L>, settings: Settings) -> Result<(Supply<L>, Player)>
where
    L: Iterator<Item = Result<ChannelLine>>,
{
    let Settings { ahead_s, slice_frames, slack_s, catches_up, from_s, duration_s, budget } = settings;
    for (name, value_s) in [("ahead_s", ahead_s), ("slack_s", slack_s)] {
        if !(0.0..=LONGEST_AHEAD_S).contains(&value_s) {
            return Err(Error::new(format!("`{name}` is {value_s}, expected 0 to {LONGEST_AHEAD_S}")));
        }
    }
    if !(1..=LONGEST_SLICE).contains(&slice_frames) {
        let what = format!("slices of {slice_frames} frames, expected 1 to {LONGEST_SLICE}");
        return Err(Error::new(what));
    }
    if !(from_s >= 0.0 && from_s.is_finite()) {
        return Err(Error::new(format!("it begins at {from_s} s, expected 0 or later")));
    }
    if budget.is_nan() || budget <= 0.0 {
        return Err(Error::new(format!("`budget` is {budget}, expected more than 0")));
    }
    let (rate_hz, channels) = (mixer.voices().rate_hz(), mixer.voices().channels());
    let from = first_frame(from_s, rate_hz);
    // What rings on is played from further back, unheard.
    let begin = mixer.voices().buses().map(|bus| bus.mixed_from(from)).fold(from, u64::min);
    offline::skip_to(&mut mixer, rate_hz, begin)?;
    let voices = mixer.voices();
    if channels == 0 {
        return Err(Error::new("nobody hears anything: there are no channels"));
    }
    // There is always one that is played and one that comes next.
    let ahead_frames = ((ahead_s * rate_hz).ceil() as u64).max(2 * slice_frames as u64);
    let slices_before = ahead_frames.div_ceil(slice_frames as u64) as usize;
    let slack_frames = (slack_s * rate_hz).ceil() as u64;
    let most_slices = slices_before + 2 + slack_frames.div_ceil(slice_frames as u64) as usize;
    // Those, the one that is played, one that is held and one on its way.
    let most_under_way = most_slices + 4;
    let (slices, coming) = rtrb::RingBuffer::new(most_under_way);
    let (back, used) = rtrb::RingBuffer::new(most_under_way);
    let counters = Arc::new(Counters::default());
    counters.played.store(begin, Relaxed);
    let join = ((JOIN_S * rate_hz) as usize).clamp(1, ahead_frames as usize);
    let rise = |n: usize| 0.5 - 0.5 * (std::f64::consts::PI * (n as f64 + 0.5) / join as f64).cos();
    let running = voices.buses().map(|bus| Running {
        ringing: Ringing::new(bus, begin).with_room(PIECE_FRAMES),
        lead: bus.lead() as u64,
        lanes: bus.lanes(),
        input: vec![0.0; PIECE_FRAMES * bus.lanes()],
        held_input: vec![0.0; PIECE_FRAMES * bus.lanes()],
    });
    let mut player = Player {
        channels,
        rate_hz,
        desk: Desk::new(voices, PIECE_FRAMES),
        slices: coming,
        used: back,
        current: None,
        frame: begin,
        held: None,
        joined: None,
        has_begun: false,
        passed_over: 0,
        slice_frames,
        slices_before,
        most_slices,
        catches_up,
        rests: None,
        buses: running.collect(),
        mix: vec![0.0; PIECE_FRAMES * channels],
        held_mix: vec![0.0; PIECE_FRAMES * channels],
        rise: (0..join).map(rise).collect(),
        limiter: Limiter::new(channels, rate_hz),
        // What is played unheard, to begin with, has time.
        budget: Budget::new(f32::INFINITY, rate_hz),
        load: 0.0,
        not_numbers: 0,
        counters: counters.clone(),
    };
    let mut supply = Supply {
        cutter: Cutter::new(voices, begin),
        mixer,
        slices,
        used,
        spare: VecDeque::new(),
        under_way: 0,
        most_under_way,
        slice_frames: slice_frames as u64,
        ahead_frames: Some(ahead_frames),
        rate_hz,
        duration_s,
        counters,
    };
    let mut unheard = [0.0; PIECE_FRAMES];
    while player.frame < from && !player.is_over() {
        supply.go_on()?;
        let frames = ((from - player.frame) as usize).min((PIECE_FRAMES / channels).max(1));
        match unheard.get_mut(..frames * channels) {
            Some(unheard) => player.fill(unheard),
            None => player.fill(&mut vec![0.0; frames * channels]),
        }
    }
    player.budget = Budget::new(budget, rate_hz);
    Ok((supply, player))
}
