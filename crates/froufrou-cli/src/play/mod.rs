//! `froufrou play`: a scene through the machine's sound device.

mod device;
mod session;

use std::io::{IsTerminal, Write};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use clap::Args;
use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use crossterm::terminal;
use froufrou::render::live::deck::{self, Changer, Deck};
use froufrou::render::production::Production;
use froufrou::{Error, Result};

use self::device::{Home, Output, Playing};
use self::session::{Order, Position, Said, Session, Watch};
use crate::render::SceneOptions;

/// How far an arrow key seeks, in seconds.
const STEP_S: f64 = 5.0;
/// A changed scene is looked for this often,
const LOOK: Duration = Duration::from_millis(300);
/// and a lost device so often: sound servers complain each time.
const LOOK_FOR_DEVICE: Duration = Duration::from_secs(1);
/// What has left the program is heard after so long at the latest.
const LAST: Duration = Duration::from_millis(400);

/// Play a scene through the sound device
#[derive(Args)]
#[command(after_help = "\
Keys: space pauses, ← and → seek by 5 s, 0 goes to the beginning, l loops, r loads again, q ends.
The scene is loaded again when it or a script beside it is saved.

Example:
  froufrou play scene.toml --from 12 --loop")]
pub struct Play {
    #[command(flatten)]
    scene: SceneOptions,

    /// Where to begin, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    from: f64,

    /// Begin again at the end
    #[arg(long = "loop")]
    is_looped: bool,

    /// The device, by a part of its name
    #[arg(long, value_name = "NAME")]
    device: Option<String>,

    /// Frames a second, if the device can; else the scene's, or what the device prefers
    #[arg(long, value_name = "HZ")]
    rate: Option<u32>,

    /// Ask the device for blocks of so many frames: fewer are heard sooner, and are late more easily
    #[arg(long, value_name = "FRAMES", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(16..=65536))]
    block: u32,
}

/// The command `froufrou devices`
#[derive(Args)]
#[command(
    about = "Name the devices that `froufrou play` can use",
    after_help = "\
Example:
  froufrou devices"
)]
pub struct Devices {}

impl Devices {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let names = device::names();
        if names.is_empty() {
            return Err(Error::new("this machine has no device to play to"));
        }
        for name in names {
            println!("{name}");
        }
        Ok(())
    }
}

impl Play {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if !(self.from >= 0.0 && self.from.is_finite()) {
            crate::usage(&format!("--from is {}, expected 0 or later", self.from));
        }
        let production = Production::open(self.scene.open()?)?;
        let channels = session::channels(&production);
        let rate_hz = self.rate.unwrap_or(production.scene.rate_hz);
        let output = Output::find(self.device.clone(), channels, rate_hz, self.block)?;
        // The device's, which may be another than was asked for.
        let rate_hz = output.rate_hz();
        let (deck, changer) = deck::new(channels);
        let changer = Arc::new(Mutex::new(changer));
        let (orders, to_do) = channel();
        let (to_say, said) = channel();
        let position = Arc::new(Position::default());
        let session = Session {
            scene: self.scene.clone(),
            rate_hz,
            from_s: self.from,
            is_looped: self.is_looped,
            changer: changer.clone(),
            orders: to_do,
            said: to_say,
            position: position.clone(),
        };
        let mut desk = Desk {
            output,
            home: Home::new(),
            playing: None,
            deck: Some(deck),
            changer,
            orders,
            said,
            position,
            is_looped: self.is_looped,
            length_s: None,
            screen: Screen::new(),
        };
        desk.screen.line(&format!(
            "{}, {} Hz, {} channels",
            desk.output.name(),
            desk.output.rate_hz(),
            channels
        ));
        desk.begin()?;
        let played = std::thread::spawn(move || session.run(production));
        let watch = Watch::new(&self.scene.file.path);
        desk.follow(watch, || played.is_finished());
        // What it ended with: the last of it is still on its way to the ear.
        std::thread::sleep(LAST);
        drop(desk);
        let statistics = played.join().unwrap_or_else(|_| Err(Error::new("playing has failed")))?;
        let late_s = statistics.held_frames as f64 / f64::from(rate_hz);
        if statistics.held > 0 {
            eprintln!("{} times what came next was late, {late_s:.2} s in all", statistics.held);
        }
        if statistics.limited_frames > 0 {
            eprintln!("{} frames were beyond full scale, and made softer", statistics.limited_frames);
        }
        Ok(())
    }
}

/// What the keys are for.
struct Desk {
    output: Output,
    home: Home,
    playing: Option<Playing>,
    /// At home while nothing plays it.
    deck: Option<Deck>,
    changer: Arc<Mutex<Changer>>,
    orders: Sender<Order>,
    said: Receiver<Said>,
    position: Arc<Position>,
    is_looped: bool,
    length_s: Option<f64>,
    screen: Screen,
}

impl Desk {
    /// Lets the device play.
    fn begin(&mut self) -> Result<()> {
        let Some(deck) = self.deck.take().or_else(|| self.home.take()) else {
            return Err(Error::new("the device does not let go of what it played"));
        };
        match self.output.play(deck, &self.home) {
            Ok(playing) => {
                self.playing = Some(playing);
                Ok(())
            }
            Err(fault) => {
                self.deck = self.home.take();
                Err(fault)
            }
        }
    }

    /// Follows keys, the device and the scene until all is over.
    fn follow(&mut self, mut watch: Watch, is_over: impl Fn() -> bool) {
        let mut looked = Instant::now();
        let mut looked_for_device = Instant::now();
        while !is_over() {
            if self.screen.is_raw {
                self.keys();
            } else {
                std::thread::sleep(Duration::from_millis(20));
            }
            for said in self.said.try_iter() {
                match said {
                    Said::Line(line) => self.screen.line(&line),
                    Said::Loaded(length_s) => self.length_s = length_s,
                }
            }
            if looked.elapsed() >= LOOK {
                looked = Instant::now();
                if watch.has_changed() {
                    self.order(Order::Reload);
                }
            }
            if looked_for_device.elapsed() >= LOOK_FOR_DEVICE {
                looked_for_device = Instant::now();
                self.look_after_device();
            }
            self.show();
        }
    }

    /// Plays on once a lost device is there again. Meanwhile time stands still.
    fn look_after_device(&mut self) {
        if self.playing.as_ref().is_some_and(Playing::is_lost) {
            self.playing = None;
            self.deck = self.home.take();
            self.screen.line("the device is lost; it goes on when there is one again");
        }
        if self.playing.is_none() && self.output.find_again().is_ok() && self.begin().is_ok() {
            self.screen.line(&format!("on {}", self.output.name()));
        }
    }

    fn order(&self, order: Order) {
        // Where all is over nobody takes it.
        let _ = self.orders.send(order);
    }

    fn keys(&mut self) {
        if !event::poll(Duration::from_millis(30)).unwrap_or(false) {
            return;
        }
        let Ok(Event::Key(key)) = event::read() else { return };
        if key.kind == KeyEventKind::Release {
            return;
        }
        let is_control = key.modifiers.contains(KeyModifiers::CONTROL);
        match key.code {
            KeyCode::Char('q') | KeyCode::Esc => self.order(Order::Stop),
            KeyCode::Char('c') if is_control => self.order(Order::Stop),
            KeyCode::Char(' ') => {
                if let Ok(changer) = self.changer.lock() {
                    changer.pause(!changer.is_paused());
                }
            }
            KeyCode::Left => self.order(Order::Seek(self.position.get() - STEP_S)),
            KeyCode::Right => self.order(Order::Seek(self.position.get() + STEP_S)),
            KeyCode::Char('0') | KeyCode::Home => self.order(Order::Seek(0.0)),
            KeyCode::Char('l') => {
                self.is_looped = !self.is_looped;
                self.order(Order::Loop(self.is_looped));
            }
            KeyCode::Char('r') => self.order(Order::Reload),
            _ => {}
        }
    }

    fn show(&mut self) {
        let is_paused = self.changer.lock().is_ok_and(|changer| changer.is_paused());
        let length = self.length_s.map_or_else(String::new, |length_s| format!(" / {length_s:.1}"));
        let state = match (is_paused, self.is_looped) {
            (true, _) => "  paused",
            (false, true) => "  again and again",
            (false, false) => "",
        };
        self.screen.status(&format!("{:.1}{length} s{state}", self.position.get()));
    }
}

/// The terminal, if there is one: lines, and under them where it is.
struct Screen {
    is_raw: bool,
    shown: String,
}

impl Screen {
    fn new() -> Self {
        let is_terminal = std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
        Self { is_raw: is_terminal && terminal::enable_raw_mode().is_ok(), shown: String::new() }
    }

    fn line(&mut self, line: &str) {
        if self.is_raw {
            eprint!("\r\x1b[K{line}\r\n");
            self.shown.clear();
        } else {
            eprintln!("{line}");
        }
    }

    fn status(&mut self, status: &str) {
        if self.is_raw && self.shown != status {
            eprint!("\r\x1b[K{status}");
            let _ = std::io::stderr().flush();
            status.clone_into(&mut self.shown);
        }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        if self.is_raw {
            eprint!("\r\x1b[K");
            let _ = terminal::disable_raw_mode();
        }
    }
}
