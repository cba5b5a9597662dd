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

/// Why a scene is played no more.
enum End {
    Stopped(Statistics),
    Changed(Box<Production>),
}

impl Session {
    /// Plays until it is over or told to stop; gives what has happened on the audio thread of the last player.
    ///
    /// # Errors
    /// A scene that cannot be played.
    pub fn run(mut self, mut production: Production) -> Result<Statistics> {
        loop {
            self.say(Said::Loaded(production.channel_header().duration_s));
            match self.play(&production)? {
                End::Stopped(statistics) => return Ok(statistics),
                End::Changed(changed) => production = *changed,
            }
        }
    }

    fn say(&self, said: Said) {
        // Nobody listens where all is over.
        let _ = self.said.send(said);
    }

    /// Plays one state of the scene.
    fn play(&mut self, production: &Production) -> Result<End> {
        let mut loading: Option<JoinHandle<Result<Production>>> = None;
        loop {
            let (mut supply, player) = self.begin(production)?;
            let mut changer = self.changer.lock().map_err(|_| Error::new("what plays has failed"))?;
            if changer.play(player).is_err() {
                return Err(Error::new("it has other channels than before").help("start again"));
            }
            drop(changer);
            'played: loop {
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
                            loading = Some(std::thread::spawn(move || Production::open(scene.open()?)));
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
                        Ok(changed) => {
                            self.from_s = self.position.get();
                            return Ok(End::Changed(Box::new(changed)));
                        }
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
    use super::*;

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
