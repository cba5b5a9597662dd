//! What plays: a scene from somewhere on, again and again, and as it is changed.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, Sender};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

use froufrou::render::live::deck::Changer;
use froufrou::render::live::{self, Player, Settings, Statistics, Supply};
use froufrou::render::production::{ChannelLines, Production};
use froufrou::synth::mixer::Mixer;
use froufrou::synth::receivers;
use froufrou::{Error, Result};

use crate::render::SceneOptions;

/// The part of a block's time that rendering may take, so that the device is never late for voices that nobody hears.
const BUDGET: f32 = 0.8;

/// So much is handed over before it is played: seeking and loading take a while.
const AHEAD_S: f64 = 0.3;
const SLICE_FRAMES: usize = 512;

/// How deep scripts are looked for below a scene, and how many files at most.
const DEEPEST: usize = 4;
const MOST_FILES: usize = 10_000;

/// What is asked of it.
pub enum Order {
    /// Go on from somewhere else, in seconds.
    Seek(f64),
    /// Load the scene again.
    Reload,
    /// Begin again at its end, or do not.
    Loop(bool),
    /// That is all.
    Stop,
}

/// Where it is, in seconds, for whoever shows it.
#[derive(Default)]
pub struct Position(AtomicU64);

impl Position {
    pub fn get(&self) -> f64 {
        f64::from_bits(self.0.load(Relaxed))
    }

    fn set(&self, time_s: f64) {
        self.0.store(time_s.to_bits(), Relaxed);
    }
}

/// What it says meanwhile.
pub enum Said {
    /// A line for people.
    Line(String),
    /// The scene was loaded, and is so long, in seconds, if it says so.
    Loaded(Option<f64>),
}

/// What a session needs.
pub struct Session {
    pub scene: SceneOptions,
    pub rate_hz: u32,
    pub from_s: f64,
    pub is_looped: bool,
    pub changer: std::sync::Arc<std::sync::Mutex<Changer>>,
    pub orders: Receiver<Order>,
    pub said: Sender<Said>,
    pub position: std::sync::Arc<Position>,
}

/// A scene that is being opened meanwhile.
type Loading = JoinHandle<Result<Production>>;

/// Why a scene is played no more.
enum End {
    Stopped(Statistics),
    Changed(Box<Production>),
}

impl Session {
    /// Plays until it is over or told to stop; gives what has happened on the audio thread of the last player. Where what it
    /// was changed into cannot be played, to its end or at all, it goes on with what it was before.
    ///
    /// # Errors
    /// A scene that cannot be played.
    pub fn run(mut self, production: Production) -> Result<Statistics> {
        let (mut playing, mut before) = (Box::new(production), None);
        let mut loading = None;
        loop {
            self.say(Said::Loaded(playing.channel_header().duration_s));
            match (self.play(&playing, &mut loading), before.take()) {
                (Ok(End::Stopped(statistics)), _) => return Ok(statistics),
                (Ok(End::Changed(changed)), _) => before = Some(std::mem::replace(&mut playing, changed)),
                (Err(fault), Some(former)) => {
                    self.say(Said::Line(format!("as before: {fault}")));
                    playing = former;
                }
                (Err(fault), None) => return Err(fault),
            }
            self.from_s = self.position.get();
        }
    }

    fn say(&self, said: Said) {
        // Nobody listens where all is over.
        let _ = self.said.send(said);
    }

    /// Plays one state of the scene.
    fn play(&mut self, production: &Production, loading: &mut Option<Loading>) -> Result<End> {
        loop {
            let (mut supply, player) = self.begin(production)?;
            let mut waiting = Some(player);
            'played: loop {
                if let Some(player) = waiting.take() {
                    waiting = self.hand_over(player)?;
                }
                supply.go_on()?;
                supply.take_begun();
                let statistics = supply.statistics();
                self.position.set(statistics.played_frame as f64 / f64::from(self.rate_hz));
                if supply.is_over() {
                    if !self.is_looped {
                        return Ok(End::Stopped(statistics));
                    }
                    self.from_s = 0.0;
                    break;
                }
                for order in self.orders.try_iter() {
                    match order {
                        Order::Stop => return Ok(End::Stopped(statistics)),
                        Order::Loop(is_looped) => self.is_looped = is_looped,
                        Order::Seek(time_s) => {
                            self.from_s = time_s.max(0.0);
                            break 'played;
                        }
                        Order::Reload => {
                            let scene = self.scene.clone();
                            *loading = Some(std::thread::spawn(move || Production::open(scene.open()?)));
                        }
                    }
                }
                if let Some(loaded) = loading.take_if(|loading| loading.is_finished()) {
                    match loaded.join().unwrap_or_else(|_| Err(Error::new("loading it again failed"))) {
                        Ok(changed) if channels(&changed) != channels(production) => {
                            self.say(Said::Line(
                                "its layout has changed: start again to hear it so".to_owned(),
                            ));
                        }
                        Ok(changed) => return Ok(End::Changed(Box::new(changed))),
                        Err(fault) => self.say(Said::Line(format!("as before: {fault}"))),
                    }
                }
                if let Ok(mut changer) = self.changer.lock() {
                    changer.tidy();
                }
                std::thread::sleep(Duration::from_millis(2));
            }
        }
    }

    /// Lets a player be played. It comes back where too many wait for that already, such as for a device that is lost; all have
    /// the same channels.
    fn hand_over(&self, player: Player) -> Result<Option<Player>> {
        let mut changer = self.changer.lock().map_err(|_| Error::new("what plays has failed"))?;
        Ok(changer.play(player).err().map(|player| *player))
    }

    /// What plays from the position on.
    fn begin<'a>(&self, production: &'a Production) -> Result<(Supply<ChannelLines<'a>>, Player)> {
        let header = production.channel_header();
        let receivers = receivers::load(&header, &production.scene.folder, self.rate_hz)?;
        let lines = production.channel_lines()?;
        let mixer = Mixer::new(self.rate_hz, receivers, production.prototypes.clone(), lines)?;
        let mixer = mixer.with_seed(header.seed).keeping_going(true);
        let settings = Settings {
            ahead_s: AHEAD_S,
            slice_frames: SLICE_FRAMES,
            slack_s: 10.0,
            catches_up: false,
            from_s: self.from_s,
            duration_s: header.duration_s,
            budget: BUDGET,
        };
        let (mut supply, player) = live::part(mixer, settings)?;
        supply.go_on()?;
        Ok((supply, player))
    }
}

/// How many channels a scene is heard by.
pub fn channels(production: &Production) -> usize {
    production.channel_header().receivers.iter().map(|output| output.channels().len()).sum()
}

/// When a scene or a script beside it was changed last.
pub struct Watch {
    scene: PathBuf,
    changed: Option<SystemTime>,
}

impl Watch {
    pub fn new(scene: &Path) -> Self {
        Self { scene: scene.to_owned(), changed: newest(scene) }
    }

    /// Whether one has been changed since this was last asked.
    pub fn has_changed(&mut self) -> bool {
        let now = newest(&self.scene);
        // A file that is being saved may be away for a moment.
        now.is_some() && std::mem::replace(&mut self.changed, now) != now
    }
}

/// The time of the last change of the scene and of the scripts below its folder.
fn newest(scene: &Path) -> Option<SystemTime> {
    let changed = |path: &Path| std::fs::metadata(path).and_then(|about| about.modified()).ok();
    let mut newest = changed(scene)?;
    let folder = scene.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut folders = vec![(folder.to_owned(), 0)];
    let mut files = 0;
    while let Some((folder, depth)) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            files += 1;
            if files > MOST_FILES {
                return Some(newest);
            }
            let path = entry.path();
            match entry.file_type() {
                Ok(kind) if kind.is_dir() && depth < DEEPEST => folders.push((path, depth + 1)),
                Ok(_) if path.extension().is_some_and(|ending| ending == "rhai") => {
                    newest = newest.max(changed(&path).unwrap_or(newest));
                }
                _ => {}
            }
        }
    }
    Some(newest)
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::sync::{Arc, Mutex};

    use froufrou::render::live::deck::{self, Deck};

    use super::*;
    use crate::render::SceneFile;

    const RATE_HZ: u32 = 48_000;
    const LOG: &str = "[[contacts]]\nlog = 'log.csv'\nstep = 0.01\n\
        columns = { t = 't', a = 'a', b = 'b', position = ['x', 'y', 'z'], normal_impulse = 'J' }\n";

    /// A session that plays a tone, and a deck in place of a device.
    struct Stage {
        folder: tempfile::TempDir,
        deck: Deck,
        orders: Sender<Order>,
        said: Receiver<Said>,
        position: Arc<Position>,
        played: JoinHandle<Result<Statistics>>,
    }

    impl Stage {
        fn new() -> Self {
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(folder.path().join("tone.rhai"), "play(sine(440.0) * 0.3);\n").unwrap();
            std::fs::write(folder.path().join("log.csv"), "t,a,b,x,y,z,J\n0.01,a,b,0,0,0,1\n0.9,a,b,none\n")
                .unwrap();
            let path = folder.path().join("scene.toml");
            save(&path, "duration = 60", "");
            let (orders, to_do) = channel();
            let (to_say, said) = channel();
            let (deck, changer) = deck::new(1);
            let position = Arc::new(Position::default());
            let session = Session {
                scene: SceneOptions {
                    file: SceneFile { path, allow_outside: false },
                    seed: None,
                    layout: None,
                },
                rate_hz: RATE_HZ,
                from_s: 0.0,
                is_looped: false,
                changer: Arc::new(Mutex::new(changer)),
                orders: to_do,
                said: to_say,
                position: position.clone(),
            };
            let production = Production::open(session.scene.open().unwrap()).unwrap();
            let played = std::thread::spawn(move || session.run(production));
            Self { folder, deck, orders, said, position, played }
        }

        fn save(&self, duration: &str, more: &str) {
            save(&self.folder.path().join("scene.toml"), duration, more);
            self.orders.send(Order::Reload).unwrap();
        }

        /// Plays on until something is so of the lines that are said meanwhile, of the position and of the loudest sample of a
        /// block.
        fn until(&mut self, is_heard: bool, mut is_so: impl FnMut(&[String], f64, f32) -> bool) {
            let (mut block, mut lines) = ([0.0f32; 256], Vec::new());
            for _ in 0..30_000 {
                if is_heard {
                    self.deck.fill(&mut block);
                }
                lines.extend(self.said.try_iter().filter_map(|said| match said {
                    Said::Line(line) => Some(line),
                    Said::Loaded(_) => None,
                }));
                let peak = block.iter().fold(0.0, |peak, sample: &f32| sample.abs().max(peak));
                if is_so(&lines, self.position.get(), peak) {
                    return;
                }
                std::thread::sleep(Duration::from_millis(1));
            }
            panic!("it never is, at {} s; {lines:?}", self.position.get());
        }
    }

    fn save(path: &Path, duration: &str, more: &str) {
        let scene = "[listener]\nposition = [0, 0, 1]\nlayout = 'mono'\n\
            [instrument]\ntone = { kind = 'procedure', script = 'tone.rhai' }\n\
            [[object]]\nname = 'tone'\nposition = [0, 0, 0]\nsound = { instrument = 'tone' }\n";
        std::fs::write(path, format!("{duration}\n{scene}{more}")).unwrap();
    }

    #[test]
    fn a_change_that_cannot_be_played_leaves_it_as_before() {
        let mut stage = Stage::new();
        stage.until(true, |_, _, peak| peak > 0.1);
        // It opens, but does not say when it ends; it breaks off in a log; it does not open.
        for (duration, more, fault) in [
            ("", "", "duration"),
            ("duration = 60", LOG, "log.csv:3"),
            ("duration = 'long'", "", "scene.toml:1"),
        ] {
            stage.save(duration, more);
            stage.until(true, |lines, _, _| {
                lines.iter().any(|line| line.starts_with("as before: ") && line.contains(fault))
            });
            let before_s = stage.position.get();
            stage.until(true, |_, position_s, peak| peak > 0.1 && position_s > before_s + 0.5);
        }
        // What can be is played.
        stage.save("duration = 3", "");
        let played = &stage.played;
        let mut block = [0.0; 256];
        while !played.is_finished() {
            stage.deck.fill(&mut block);
            std::thread::sleep(Duration::from_micros(500));
        }
        let statistics = stage.played.join().unwrap().unwrap();
        assert!(statistics.played_frame < 4 * u64::from(RATE_HZ), "{statistics:?}");
    }

    #[test]
    fn what_is_wanted_last_is_played_once_a_device_is_there() {
        let mut stage = Stage::new();
        for second in 1..=20 {
            stage.orders.send(Order::Seek(f64::from(second))).unwrap();
            stage.until(false, |_, position_s, _| (position_s - f64::from(second)).abs() < 0.01);
        }
        stage.until(true, |_, position_s, peak| peak > 0.1 && position_s > 20.5);
        stage.orders.send(Order::Stop).unwrap();
        stage.played.join().unwrap().unwrap();
    }

    #[test]
    fn saving_the_scene_or_a_script_is_seen_once() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene.toml");
        let script = folder.path().join("scripts/wind.rhai");
        std::fs::create_dir(folder.path().join("scripts")).unwrap();
        for path in [&scene, &script, &folder.path().join("hit.wav")] {
            std::fs::write(path, "").unwrap();
        }
        let mut watch = Watch::new(&scene);
        assert!(!watch.has_changed());
        let save = |path: &Path, later_s: u64| {
            let file = std::fs::File::options().write(true).open(path).unwrap();
            file.set_modified(SystemTime::now() + Duration::from_secs(later_s)).unwrap();
        };
        save(&scene, 10);
        assert!(watch.has_changed() && !watch.has_changed());
        save(&script, 20);
        assert!(watch.has_changed() && !watch.has_changed());
        save(&folder.path().join("hit.wav"), 30);
        assert!(!watch.has_changed());
        std::fs::remove_file(&scene).unwrap();
        assert!(!watch.has_changed(), "it is being saved");
    }
}
