//! What must hold between the lines of a score. Reader and writer check the same rules, so that what
//! is written can be read.

use std::collections::hash_map::{Entry, OccupiedEntry};
use std::collections::{BTreeMap, HashMap, HashSet};

use super::lexer::{shown, suggestion};
use super::{Make, MicrophoneKey, Order, Pattern, Radiation, Sound};
use crate::{Error, Place};

/// A broken rule, and which word of the line breaks it, from 0.
#[derive(Debug)]
pub struct Fault {
    /// Index of the word at fault.
    pub word: usize,
    /// What is wrong.
    pub error: Box<Error>,
}

/// The words of a line that the rules speak of.
mod word {
    pub const NAME: usize = 1;
    pub const THREAD: usize = 1;
    pub const TIME: usize = 2;
    pub const SOUND: usize = 3;
}

fn fault(word: usize, what: impl Into<String>) -> Fault {
    Fault { word, error: Box::new(Error::new(what)) }
}

impl Fault {
    fn help(mut self, help: impl Into<String>) -> Self {
        self.error = Box::new(self.error.help(help));
        self
    }
}

/// What a line does, as far as the rules care.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step<'a> {
    Start { sound: &'a str },
    Path,
    Key,
    Jump,
    End,
}

impl Step<'_> {
    fn name(self) -> &'static str {
        match self {
            Step::Start { .. } => "start",
            Step::Path => "path",
            Step::Key => "key",
            Step::Jump => "jump",
            Step::End => "end",
        }
    }
}

/// A thread that has started and not ended.
#[derive(Debug)]
struct Live<V> {
    time_s: f64,
    start_s: f64,
    start_line: usize,
    /// It never ends by itself.
    endless: bool,
    /// What it plays is synthesised.
    made: bool,
    /// When it was last cued.
    cued_s: f64,
    value: Option<V>,
}

/// What was last said of a microphone.
#[derive(Debug, Clone)]
pub struct Heard {
    first_s: f64,
    /// Its last line.
    pub last: Option<MicrophoneKey>,
}

/// Where a line stands among the sorted lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rank {
    /// False for a microphone's line, which comes before the threads'.
    pub thread: bool,
    /// The thread's number or the microphone's index.
    pub id: u64,
    pub time_s: f64,
}

impl Rank {
    /// The order of two lines; equal ones stay as they are.
    pub fn cmp(&self, other: &Self, order: Order) -> std::cmp::Ordering {
        // Adding zero makes the two zeros one. `total_cmp` keeps even a NaN, which no file has, in
        // a total order.
        let times = (self.time_s + 0.0).total_cmp(&(other.time_s + 0.0));
        let whose = self.thread.cmp(&other.thread).then(self.id.cmp(&other.id));
        match order {
            Order::Time => times.then(whose),
            Order::Thread => whose,
            Order::Free => std::cmp::Ordering::Equal,
        }
    }
}

/// What the rules know of a sound.
#[derive(Debug, Clone, Copy)]
struct Kind {
    endless: bool,
    made: bool,
}

/// The state of the rules after the lines so far; `V` is what a thread's next line may leave out.
#[derive(Debug)]
pub struct Rules<V> {
    order: Order,
    has_duration: bool,
    /// Whether the receivers are microphones, which have a place.
    placed: bool,
    sounds: HashMap<String, Kind>,
    patterns: HashSet<String>,
    receivers: HashMap<String, usize>,
    receiver_names: Vec<String>,
    heard: Vec<Option<Heard>>,
    /// Which microphones are placed where they are declared.
    stands: Vec<bool>,
    live: HashMap<(u64, u32), Live<V>>,
    ended: IdSet,
    last: Option<Rank>,
    first_start: Option<(f64, usize)>,
}

impl<V> Rules<V> {
    /// No declarations and no lines yet.
    pub fn new(placed: bool) -> Self {
        Self {
            order: Order::Free,
            has_duration: false,
            placed,
            sounds: HashMap::new(),
            patterns: HashSet::new(),
            receivers: HashMap::new(),
            receiver_names: Vec::new(),
            heard: Vec::new(),
            stands: Vec::new(),
            live: HashMap::new(),
            ended: IdSet::default(),
            last: None,
            first_start: None,
        }
    }

    /// A sound is declared.
    pub fn declare_sound(&mut self, sound: &Sound) -> Result<(), Fault> {
        if sound.name.is_empty() {
            return Err(fault(word::NAME, "the sound has an empty name"));
        }
        let file = match &sound.make {
            Make::Recording { path, .. } => Some(("recording", path)),
            Make::Modes { table: Some(table), .. } => Some(("table", table)),
            Make::Procedure { script } => Some(("script", script)),
            Make::Grains { corpus } | Make::Cloth { corpus } | Make::Paper { corpus } => {
                Some(("corpus", corpus))
            }
            _ => None,
        };
        if let Some((kind, _)) = file.filter(|(_, file)| file.is_empty()) {
            let what = format!("the sound {} has no {kind}", shown(&sound.name));
            return Err(fault(word::NAME + 1, what));
        }
        let made = !matches!(sound.make, Make::Recording { .. });
        if !made && !sound.with.is_empty() {
            let what =
                format!("the sound {} is a recording, which is made with no numbers", shown(&sound.name));
            return Err(fault(word::NAME, what));
        }
        match self.sounds.insert(sound.name.clone(), Kind { endless: sound.is_endless(), made }) {
            None => Ok(()),
            Some(_) => Err(fault(word::NAME, format!("the sound {} is declared twice", shown(&sound.name)))),
        }
    }

    /// A pattern is declared.
    pub fn declare_pattern(&mut self, pattern: &Pattern) -> Result<(), Fault> {
        if pattern.name.is_empty() {
            return Err(fault(word::NAME, "the pattern has an empty name"));
        }
        if let Radiation::Harmonics(harmonics) = &pattern.radiation
            && !matches!(harmonics.len(), 1 | 4 | 9 | 16)
        {
            let what = format!(
                "the pattern {} has {} harmonics, expected 1, 4, 9 or 16",
                shown(&pattern.name),
                harmonics.len()
            );
            return Err(fault(word::NAME, what));
        }
        if self.patterns.insert(pattern.name.clone()) {
            return Ok(());
        }
        Err(fault(word::NAME, format!("the pattern {} is declared twice", shown(&pattern.name))))
    }

    /// A microphone or channel is declared, by a name that is this one on its line, from 0; `stands` where
    /// it has its one place already.
    pub fn declare_receiver(&mut self, number: usize, name: &str, stands: bool) -> Result<(), Fault> {
        let index = self.receiver_names.len();
        let at = word::NAME + number;
        let kind = self.receiver_kind();
        if name.is_empty() {
            return Err(fault(at, format!("the {kind} has an empty name")));
        }
        if self.receivers.insert(name.into(), index).is_some() {
            return Err(fault(at, format!("the {kind} {} is declared twice", shown(name))));
        }
        self.receiver_names.push(name.into());
        self.heard.push(None);
        self.stands.push(stands);
        Ok(())
    }

    fn receiver_kind(&self) -> &'static str {
        if self.placed { "microphone" } else { "channel" }
    }

    /// All is declared; what follows are lines.
    pub fn begin(&mut self, order: Order, has_duration: bool) -> Result<(), Fault> {
        self.order = order;
        self.has_duration = has_duration;
        if self.receiver_names.is_empty() {
            let help = if self.placed { "microphone main omni" } else { "channels left right" };
            let what = format!("the score declares no {}", self.receiver_kind());
            return Err(fault(0, what).help(format!("add a line such as `{help}`")));
        }
        Ok(())
    }

    /// The index of the microphone of this name.
    pub fn microphone(&self, name: &str) -> Result<usize, Fault> {
        self.receivers.get(name).copied().ok_or_else(|| {
            let names = self.receiver_names.iter().map(String::as_str);
            let help = suggestion(name, names.clone())
                .unwrap_or_else(|| format!("the microphones are {}", listed(names)));
            fault(word::NAME, format!("unknown microphone {}", shown(name))).help(help)
        })
    }

    fn check_order(&mut self, rank: Rank) -> Result<(), Fault> {
        if self.order == Order::Free {
            return Ok(());
        }
        if let Some(last) = self.last
            && rank.cmp(&last, self.order).is_lt()
        {
            let name = |rank: Rank| match self.receiver_names.get(rank.id as usize) {
                Some(name) if !rank.thread => format!("microphone {}", shown(name)),
                _ => format!("thread {}", rank.id),
            };
            let (at, order, here, above) = match self.order {
                Order::Time if rank.time_s < last.time_s => {
                    (word::TIME, "time", format!("{} s", rank.time_s), format!("{} s", last.time_s))
                }
                Order::Time => (word::THREAD, "time", name(rank), name(last)),
                _ => (word::THREAD, "thread", name(rank), name(last)),
            };
            return Err(fault(
                at,
                format!("the header says `order {order}`, but {here} comes after {above}"),
            )
            .help("move the line to its place, or sort the score after deleting the `order` line"));
        }
        self.last = Some(rank);
        Ok(())
    }

    /// A line of a microphone; gives what was said of it before.
    pub fn hear(&mut self, microphone: usize, time_s: f64, cut: bool) -> Result<&mut Heard, Fault> {
        self.check_order(Rank { thread: false, id: microphone as u64, time_s })?;
        let name = self.receiver_names.get(microphone);
        let (Some(name), Some(heard)) = (name, self.heard.get_mut(microphone)) else {
            return Err(fault(word::NAME, format!("there is no microphone with index {microphone}")));
        };
        if self.stands[microphone] {
            let what = format!("microphone {} stands still where it was declared", shown(name));
            return Err(fault(word::NAME, what).help("leave the place out there if it is to move"));
        }
        if let Some(Heard { last: Some(last), .. }) = heard {
            if time_s < last.time_s {
                return Err(backwards(&format!("microphone {}", shown(name)), time_s, last.time_s));
            }
            if time_s == last.time_s && !cut {
                return Err(fault(
                    word::TIME,
                    format!("microphone {} has a line at {time_s} s already", shown(name)),
                )
                .help("only a `cut` may share the time of the line before"));
            }
        } else if cut {
            return Err(fault(0, format!("microphone {} is cut before it is anywhere", shown(name)))
                .help("begin it with a `hear`"));
        }
        Ok(heard.get_or_insert(Heard { first_s: time_s, last: None }))
    }

    /// Takes the rank of a thread's line in.
    fn rank_thread(&mut self, id: u64, time_s: f64) -> Result<(), Fault> {
        if self.order == Order::Thread && self.last.is_some_and(|last| last.thread && last.id < id) {
            // No smaller number can come any more: forget them, to keep the memory small.
            self.check_ends()?;
            self.live.clear();
            self.ended = IdSet::default();
        }
        self.check_order(Rank { thread: true, id, time_s })
    }

    /// A line of a path of a thread.
    pub fn thread(
        &mut self,
        step: Step<'_>,
        of: (u64, u32),
        time_s: f64,
        line: usize,
    ) -> Result<Slot<'_, V>, Fault> {
        let (id, path) = of;
        self.rank_thread(id, time_s)?;
        if path > 0 && self.placed {
            let what = format!("thread {id}/{path} is a path of its own, which only channel space has");
            return Err(fault(word::THREAD, what).help(format!("write `{id}`")));
        }
        match step {
            Step::Start { .. } if path > 0 => {
                let what = format!("thread {id}/{path} starts, but a path plays what its thread does");
                return Err(fault(0, what).help(format!("begin it with `path {id}/{path} …`")));
            }
            Step::Start { sound } => return self.start(sound, id, time_s, line),
            Step::Path => return self.path(of, time_s, line),
            _ => {}
        }
        let name = Named(of);
        let Entry::Occupied(mut entry) = self.live.entry(of) else {
            if path == 0 && self.ended.contains(id) {
                return Err(fault(word::THREAD, format!("thread {name} has ended, no line may follow")));
            }
            let what = format!("`{}` of thread {name}, which has not started", step.name());
            let begin = if path > 0 { "path" } else { "start" };
            return Err(fault(word::THREAD, what).help(format!("a `{begin} {name} …` must come before")));
        };
        let live = entry.get_mut();
        if time_s < live.time_s {
            return Err(backwards(&format!("thread {name}"), time_s, live.time_s));
        }
        if time_s == live.time_s && step != Step::Jump {
            return Err(fault(word::TIME, format!("thread {name} has a line at {time_s} s already"))
                .help("only a `jump` may share the time of the line before"));
        }
        live.time_s = time_s;
        if step == Step::End && path == 0 {
            self.ended.insert(id);
        }
        Ok(Slot { entry, ends: step == Step::End, patterns: &self.patterns })
    }

    fn start(&mut self, sound: &str, id: u64, time_s: f64, line: usize) -> Result<Slot<'_, V>, Fault> {
        let Some(&Kind { endless, made }) = self.sounds.get(sound) else {
            let names = self.sounds.keys().map(String::as_str);
            let what = format!("unknown sound {}", shown(sound));
            return Err(match suggestion(sound, names) {
                Some(help) => fault(word::SOUND, what).help(help),
                None => fault(word::SOUND, what)
                    .help("declare it in the header, as `sound NAME \"recording.wav\"`"),
            });
        };
        if self.ended.contains(id) {
            let what = format!("thread {id} has been used already and has ended");
            return Err(fault(word::THREAD, what).help("give every thread a number of its own"));
        }
        if let Some(live) = self.live.get(&(id, 0)) {
            let what = format!("thread {id} started already in line {}", live.start_line);
            return Err(fault(word::THREAD, what).help("give every thread a number of its own"));
        }
        self.check_start(time_s, line)?;
        let live =
            Live { time_s, start_s: time_s, start_line: line, endless, made, cued_s: time_s, value: None };
        let entry = self.live.entry((id, 0)).insert_entry(live);
        Ok(Slot { entry, ends: false, patterns: &self.patterns })
    }

    /// Another path of a thread begins.
    fn path(&mut self, of: (u64, u32), time_s: f64, line: usize) -> Result<Slot<'_, V>, Fault> {
        let (id, path) = of;
        if path == 0 {
            let what = format!("path 0 of thread {id} is the direct one, which the thread starts with");
            return Err(fault(word::THREAD, what).help(format!("number the others from 1, as `{id}/1`")));
        }
        let Some(direct) = self.live.get(&(id, 0)) else {
            let what = format!("a path of thread {id}, which does not sound");
            return Err(fault(word::THREAD, what).help("a path begins while its thread lasts"));
        };
        if time_s < direct.start_s {
            let what =
                format!("a path of thread {id} begins before it, which starts at {} s", direct.start_s);
            return Err(fault(word::TIME, what));
        }
        let endless = direct.endless;
        if let Some(live) = self.live.get(&of) {
            let what = format!("path {id}/{path} began already in line {}", live.start_line);
            return Err(fault(word::THREAD, what).help("it may begin anew after an `end`"));
        }
        let live = Live {
            time_s,
            start_s: time_s,
            start_line: line,
            endless,
            made: false,
            cued_s: time_s,
            value: None,
        };
        let entry = self.live.entry(of).insert_entry(live);
        Ok(Slot { entry, ends: false, patterns: &self.patterns })
    }

    /// Something is said to a synthesised sound.
    pub fn cue(&mut self, verb: &str, id: u64, time_s: f64) -> Result<(), Fault> {
        self.rank_thread(id, time_s)?;
        let Some(live) = self.live.get_mut(&(id, 0)) else {
            let what = format!("`{verb}` of thread {id}, which does not sound");
            return Err(fault(word::THREAD, what).help("it stands between the thread's `start` and `end`"));
        };
        if !live.made {
            let what = format!("`{verb}` of thread {id}, which plays a recording");
            return Err(fault(word::THREAD, what).help("only a synthesised sound can be told something"));
        }
        if time_s < live.cued_s {
            return Err(backwards(&format!("thread {id}"), time_s, live.cued_s));
        }
        live.cued_s = time_s;
        Ok(())
    }

    /// A microphone has to be somewhere when the first sound leaves its source.
    fn check_start(&mut self, time_s: f64, line: usize) -> Result<(), Fault> {
        if self.first_start.is_some_and(|(first_s, _)| first_s <= time_s) {
            return Ok(());
        }
        self.first_start = Some((time_s, line));
        // In any other order a microphone may still say where it was.
        if self.order == Order::Time { self.check_heard() } else { Ok(()) }
    }

    fn check_heard(&self) -> Result<(), Fault> {
        let (Some((start_s, line)), true) = (self.first_start, self.placed) else {
            return Ok(());
        };
        for ((name, heard), stands) in self.receiver_names.iter().zip(&self.heard).zip(&self.stands) {
            if !stands && heard.as_ref().is_none_or(|heard| heard.first_s > start_s) {
                let what = format!(
                    "the first sound starts at {start_s} s, but microphone {} is nowhere yet",
                    shown(name)
                );
                let mut quoted = String::new();
                super::lexer::push_name(&mut quoted, name);
                let mut fault =
                    fault(0, what).help(format!("add a line such as `hear {quoted} 0 at 0 1.6 0` above"));
                fault.error = Box::new(fault.error.at(Place::Line { line, column: 0 }));
                return Err(fault);
            }
        }
        Ok(())
    }

    /// A thread without an end must end by itself.
    fn check_ends(&self) -> Result<(), Fault> {
        if self.has_duration {
            return Ok(());
        }
        let endless = self.live.iter().filter(|(_, live)| live.endless);
        match endless.min_by_key(|(id, live)| (live.start_line, **id)) {
            None => Ok(()),
            Some((id, live)) => {
                let name = Named(*id);
                let what = format!("thread {name} sounds from {} s on and never ends", live.start_s);
                let mut fault =
                    fault(0, what).help(format!("add an `end {name} …` line, or a `duration` to the header"));
                fault.error = Box::new(fault.error.at(Place::Line { line: live.start_line, column: 0 }));
                Err(fault)
            }
        }
    }

    /// The score is over.
    pub fn finish(&self) -> Result<(), Fault> {
        self.check_heard()?;
        self.check_ends()
    }
}

/// A path of a thread as its number stands in the text.
pub struct Named(pub (u64, u32));

impl std::fmt::Display for Named {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            (id, 0) => write!(f, "{id}"),
            (id, path) => write!(f, "{id}/{path}"),
        }
    }
}

fn backwards(whose: &str, time_s: f64, last_s: f64) -> Fault {
    fault(word::TIME, format!("the time of {whose} goes backwards, from {last_s} s to {time_s} s"))
}

/// A few names in a row.
fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    const MOST: usize = 8;
    let mut text = String::new();
    for (index, name) in names.enumerate() {
        if index == MOST {
            text.push_str(", …");
            break;
        }
        if index > 0 {
            text.push_str(", ");
        }
        text.push_str(&shown(name));
    }
    text
}

/// The place where a thread's value is kept for its next line.
#[derive(Debug)]
pub struct Slot<'a, V> {
    entry: OccupiedEntry<'a, (u64, u32), Live<V>>,
    ends: bool,
    patterns: &'a HashSet<String>,
}

impl<V: Clone> Slot<'_, V> {
    /// Refuses what only a recording can be told at its start.
    pub fn plays_recording(&self, keyword: &str) -> Result<(), Error> {
        if !self.entry.get().made {
            return Ok(());
        }
        Err(Error::new(format!("`{keyword}` is for recordings, and this thread's sound is synthesised")))
    }

    /// Refuses a pattern that is not declared.
    pub fn has_pattern(&self, name: &str) -> Result<(), Error> {
        if name.is_empty() || self.patterns.contains(name) {
            return Ok(());
        }
        let what = format!("unknown pattern {}", shown(name));
        let help = suggestion(name, self.patterns.iter().map(String::as_str));
        let declare = || "declare it in the header, as `pattern NAME 1 0 0 0.5`".to_owned();
        Err(Error::new(what).help(help.unwrap_or_else(declare)))
    }

    /// The value at the thread's line before.
    pub fn before(&self) -> Option<&V> {
        self.entry.get().value.as_ref()
    }

    /// Keeps the value, or forgets the thread where it ends.
    pub fn keep(mut self, value: &V) {
        if self.ends {
            self.entry.remove();
            return;
        }
        match &mut self.entry.get_mut().value {
            // Takes over the allocation of the value before.
            Some(kept) => kept.clone_from(value),
            kept => *kept = Some(value.clone()),
        }
    }
}

/// A set of thread numbers as ranges: numbers that count up, as a program gives them, take no memory
/// however many they are.
#[derive(Debug, Default)]
struct IdSet {
    /// First number of each range to its last.
    ranges: BTreeMap<u64, u64>,
}

impl IdSet {
    fn contains(&self, id: u64) -> bool {
        self.ranges.range(..=id).next_back().is_some_and(|(_, &last)| id <= last)
    }

    fn insert(&mut self, id: u64) {
        if self.contains(id) {
            return;
        }
        let after = id.checked_add(1).and_then(|next| self.ranges.remove(&next));
        let last = after.unwrap_or(id);
        if let Some((_, before)) = self.ranges.range_mut(..id).next_back()
            && before.checked_add(1) == Some(id)
        {
            *before = last;
            return;
        }
        self.ranges.insert(id, last);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn rules(order: Order) -> Rules<()> {
        let mut rules = Rules::new(false);
        let sound = Sound::recording("hit", "hit.wav", super::super::Repeat::Once, None);
        rules.declare_sound(&sound).unwrap();
        rules.declare_receiver(0, "left", false).unwrap();
        rules.begin(order, false).unwrap();
        rules
    }

    #[test]
    fn a_million_threads_take_the_memory_of_those_alive() {
        for order in [Order::Time, Order::Free] {
            let mut rules = rules(order);
            for id in 0..1_000_000 {
                let time_s = id as f64;
                if let Some(ends) = u64::checked_sub(id, 3) {
                    rules.thread(Step::End, (ends, 0), time_s, 1).unwrap().keep(&());
                }
                rules.thread(Step::Start { sound: "hit" }, (id, 0), time_s, 1).unwrap().keep(&());
                assert!(rules.live.len() <= 3);
            }
            assert_eq!(rules.ended.ranges.len(), 1);
        }
    }

    #[test]
    fn sorted_by_thread_one_thread_is_kept_even_without_ends() {
        let mut rules = rules(Order::Thread);
        for id in (0..100_000).step_by(7) {
            rules.thread(Step::Start { sound: "hit" }, (id, 0), 0.0, 1).unwrap().keep(&());
            assert_eq!(rules.live.len(), 1);
        }
        assert!(rules.ended.ranges.is_empty());
    }

    proptest! {
        #[test]
        fn the_set_of_numbers_is_a_set(
            ids in prop::collection::vec(prop_oneof![0..40_u64, u64::MAX - 5..=u64::MAX], 0..80),
        ) {
            let mut set = IdSet::default();
            let mut naive = BTreeSet::new();
            for id in ids {
                set.insert(id);
                naive.insert(id);
            }
            for id in (0..45).chain(u64::MAX - 8..=u64::MAX) {
                prop_assert_eq!(set.contains(id), naive.contains(&id));
            }
            // Neighbouring ranges are one.
            let ranges: Vec<_> = set.ranges.into_iter().collect();
            for pair in ranges.windows(2) {
                prop_assert!(pair[0].1 + 1 < pair[1].0);
            }
        }
    }
}
