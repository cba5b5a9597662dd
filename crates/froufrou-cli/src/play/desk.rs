//! A scene that plays by itself, under the keys of a terminal.

use std::io::{IsTerminal, Write};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use crossterm::terminal;
use froufrou::render::live::deck::{self, Changer};
use froufrou::render::production::Production;
use froufrou::{Error, Result};

use super::Play;
use super::device::Output;
use super::session::{self, Order, Position, Said, Session, Watch};
use super::speaker::{LAST, LOOK_FOR_DEVICE, Speaker};

/// How far an arrow key seeks, in seconds.
const STEP_S: f64 = 5.0;
/// A changed scene is looked for this often.
const LOOK: Duration = Duration::from_millis(300);

/// Plays a scene until it is over.
///
/// # Errors
/// A scene or a device that cannot be.
pub fn run(play: &Play) -> Result<()> {
    let from_s = play.device.from;
    if !(from_s >= 0.0 && from_s.is_finite()) {
        crate::usage(&format!("--from is {from_s}, expected 0 or later"));
    }
    let production = Production::open(play.scene.open()?)?;
    let channels = session::channels(&production);
    let rate_hz = play.rate.unwrap_or(production.scene.rate_hz);
    let output = Output::find(play.device.device.clone(), channels, rate_hz, play.device.block)?;
    // The device's, which may be another than was asked for.
    let rate_hz = output.rate_hz();
    let (deck, changer) = deck::new(channels);
    let changer = Arc::new(Mutex::new(changer));
    let (orders, to_do) = channel();
    let (to_say, said) = channel();
    let position = Arc::new(Position::default());
    let session = Session {
        scene: play.scene.clone(),
        rate_hz,
        from_s,
        is_looped: play.device.is_looped,
        changer: changer.clone(),
        orders: to_do,
        said: to_say,
        position: position.clone(),
    };
    let mut desk = Desk {
        speaker: Speaker::new(output, deck),
        changer,
        orders,
        said,
        position,
        is_looped: play.device.is_looped,
        length_s: None,
        screen: Screen::new(),
    };
    desk.screen.line(&format!(
        "{}, {} Hz, {} channels",
        desk.speaker.output.name(),
        desk.speaker.output.rate_hz(),
        channels
    ));
    desk.speaker.begin()?;
    let played = std::thread::spawn(move || session.run(production));
    let watch = Watch::new(&play.scene.file.path);
    desk.follow(watch, || played.is_finished());
    // What it ended with: the last of it is still on its way to the ear.
    std::thread::sleep(LAST);
    drop(desk);
    let statistics = played.join().unwrap_or_else(|_| Err(Error::new("playing has failed")))?;
    super::report(&statistics, f64::from(rate_hz));
    Ok(())
}

/// What the keys are for.
struct Desk {
    speaker: Speaker,
    changer: Arc<Mutex<Changer>>,
    orders: Sender<Order>,
    said: Receiver<Said>,
    position: Arc<Position>,
    is_looped: bool,
    length_s: Option<f64>,
    screen: Screen,
}

impl Desk {
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
                if let Some(said) = self.speaker.look_after() {
                    self.screen.line(&said);
                }
            }
            self.show();
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
