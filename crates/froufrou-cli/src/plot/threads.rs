//! Walks through a score in order of time and tells what sounds from when to when, in the memory of
//! the threads that sound at a time.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashMap};
use std::io::BufRead;
use std::path::{Component, Path};

use froufrou::Result;
use froufrou::corpus::recording::Recording;
use froufrou::score::{
    AnyReader, AnySpace, Arrival, ChannelLine, Header, Make, ObjectLine, Pose, Reader, Repeat, Sound, Space,
    Start, Statement, Verb, Whereabouts,
};

/// A thread at a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// When, in seconds.
    pub time_s: f64,
    /// Its gain; in channel space that of the channel where it is loudest.
    pub gain: f64,
    /// Where it is, in metres; in object space alone.
    pub position_m: Option<[f64; 3]>,
}

/// What a thread does between two of its lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// The number of its object, in the order in which objects first sound.
    pub object: usize,
    /// The threads of one object that sound together have different lanes, from 0.
    pub lane: usize,
    /// True for the first piece of its thread.
    pub first: bool,
    /// How it begins.
    pub from: Place,
    /// How it ends.
    pub to: Place,
}

/// A line of a microphone.
#[derive(Debug, Clone, Copy)]
pub struct MicrophoneStep {
    /// Its number.
    pub index: usize,
    /// When it was where it comes from, in seconds.
    pub from_s: f64,
    /// Where it comes from; nothing where it is suddenly here.
    pub from: Option<Pose>,
    /// When it is here, in seconds.
    pub time_s: f64,
    /// Where it is.
    pub to: Pose,
}

/// What is seen on the way.
pub enum Seen<'a> {
    /// A thread begins.
    Thread {
        /// The number of its object.
        object: usize,
        /// The name of the object, or of what it plays where it has none.
        name: &'a str,
        /// Its lane.
        lane: usize,
    },
    /// A thread sounds.
    Piece(Piece),
    /// A microphone is somewhere.
    Microphone(MicrophoneStep),
}

/// What there is to know of a score as a whole.
pub struct Facts {
    /// Whether it is in object space.
    pub object_space: bool,
    /// Length of the soundtrack, where the header says it, in seconds.
    pub duration_s: Option<f64>,
    /// The names of its microphones or channels.
    pub receivers: Vec<String>,
    /// How many threads it has.
    pub threads: u64,
    /// How many of them have an end that is not known, for their recordings cannot be read.
    pub unended: u64,
}

/// Walks through a score.
///
/// A thread without an `end` lasts until its recording is over, which is read for its length where
/// it lies in the folder of the score or below it; where it cannot be read, until its last line.
///
/// # Errors
/// A score that cannot be read.
pub fn walk(file: &Path, see: &mut dyn FnMut(Seen<'_>)) -> Result<Facts> {
    match AnyReader::open(file)? {
        AnySpace::Object(reader) => {
            let receivers = reader.header().receivers.iter();
            let names = receivers.clone().map(|microphone| microphone.name.clone()).collect();
            for (index, microphone) in receivers.enumerate() {
                if let Some(pose) = microphone.fixed {
                    see(Seen::Microphone(MicrophoneStep {
                        index,
                        from_s: 0.0,
                        from: None,
                        time_s: 0.0,
                        to: pose,
                    }));
                }
            }
            let mut last: BTreeMap<usize, (f64, Pose)> = BTreeMap::new();
            walk_through(file, reader, names, true, see, |line, see| match line {
                ObjectLine::Thread(Statement { thread, time_s, verb, value, .. }) => {
                    let position_m = match value.whereabouts {
                        Whereabouts::At(position_m) => Some(position_m),
                        Whereabouts::Around(_) => None,
                    };
                    let place = Place { time_s, gain: value.gain, position_m };
                    Some((thread, verb, place))
                }
                ObjectLine::Cue(_) => None,
                ObjectLine::Microphone(key) => {
                    let before = last.insert(key.microphone, (key.time_s, key.pose));
                    see(Seen::Microphone(MicrophoneStep {
                        index: key.microphone,
                        from_s: before.map_or(key.time_s, |(time_s, _)| time_s),
                        from: before.filter(|_| !key.cut).map(|(_, pose)| pose),
                        time_s: key.time_s,
                        to: key.pose,
                    }));
                    None
                }
            })
        }
        AnySpace::Channel(reader) => {
            let header = reader.header().clone();
            let names = header.channels();
            walk_through(file, reader, names, false, see, |line, _| {
                // What a thread's further paths do is as much its own, and would only hide it.
                let ChannelLine::Thread(line) = line else { return None };
                if line.path > 0 {
                    return None;
                }
                let gains = header.heard(&line.value).map(|Arrival { gain, .. }| gain.abs());
                let gain = gains.fold(0.0, f64::max);
                Some((line.thread, line.verb, Place { time_s: line.time_s, gain, position_m: None }))
            })
        }
    }
}

fn walk_through<S: Space, R: BufRead>(
    file: &Path,
    reader: Reader<S, R>,
    receivers: Vec<String>,
    object_space: bool,
    see: &mut dyn FnMut(Seen<'_>),
    mut thread_of: impl FnMut(S::Line, &mut dyn FnMut(Seen<'_>)) -> Option<(u64, Verb, Place)>,
) -> Result<Facts> {
    let mut walker = Walker::new(file, reader.header());
    let duration_s = reader.header().duration_s;
    let mut threads = 0;
    for line in reader.by_time()? {
        let Some((thread, verb, place)) = thread_of(line?, see) else { continue };
        walker.end_until(place.time_s, see);
        match verb {
            Verb::Start(start) => {
                threads += 1;
                walker.start(thread, &start, place, see);
            }
            verb => walker.go_on(thread, &verb, place, see),
        }
    }
    walker.end_until(f64::INFINITY, see);
    let unended = walker.live.len() as u64;
    walker.end_all(see);
    Ok(Facts { object_space, duration_s, receivers, threads, unended })
}

/// A thread that sounds.
struct Live {
    object: usize,
    lane: usize,
    first: bool,
    last: Place,
}

/// A time that can be sorted; never NaN.
#[derive(PartialEq)]
struct Moment(f64);

impl Eq for Moment {}

impl PartialOrd for Moment {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Moment {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

struct Walker {
    /// Every sound by its name: how long its recording is, in seconds, where that is known; nothing
    /// for a loop.
    lengths_s: HashMap<String, Length>,
    duration_s: Option<f64>,
    objects: HashMap<String, usize>,
    /// The lanes of every object that are free, and how many there are.
    lanes: Vec<(BinaryHeap<Reverse<usize>>, usize)>,
    live: BTreeMap<u64, Live>,
    /// When recordings are over.
    ends: BinaryHeap<Reverse<(Moment, u64)>>,
}

#[derive(Clone, Copy)]
enum Length {
    Seconds(f64),
    Loop,
    Unknown,
}

impl Walker {
    fn new<R>(file: &Path, header: &Header<R>) -> Self {
        let folder = file.parent().unwrap_or(Path::new(""));
        let lengths = header.sounds.iter().map(|sound| (sound.name.clone(), length_of(sound, folder)));
        Self {
            lengths_s: lengths.collect(),
            duration_s: header.duration_s,
            objects: HashMap::new(),
            lanes: Vec::new(),
            live: BTreeMap::new(),
            ends: BinaryHeap::new(),
        }
    }

    fn start(&mut self, thread: u64, start: &Start, place: Place, see: &mut dyn FnMut(Seen<'_>)) {
        let name = if start.object.is_empty() { &start.sound } else { &start.object };
        let object = match self.objects.get(name) {
            Some(object) => *object,
            None => {
                self.objects.insert(name.clone(), self.lanes.len());
                self.lanes.push((BinaryHeap::new(), 0));
                self.lanes.len() - 1
            }
        };
        let (free, count) = &mut self.lanes[object];
        let lane = free.pop().map_or_else(
            || {
                *count += 1;
                *count - 1
            },
            |Reverse(lane)| lane,
        );
        let end_s = match self.lengths_s.get(&start.sound).copied().unwrap_or(Length::Unknown) {
            Length::Seconds(length_s) => {
                Some(place.time_s + ((length_s - start.offset_s) / start.speed).max(0.0))
            }
            Length::Loop => self.duration_s,
            Length::Unknown => None,
        };
        see(Seen::Thread { object, name, lane });
        if let Some(end_s) = end_s.filter(|end_s| end_s.is_finite()) {
            self.ends.push(Reverse((Moment(end_s.max(place.time_s)), thread)));
        }
        self.live.insert(thread, Live { object, lane, first: true, last: place });
    }

    fn go_on(&mut self, thread: u64, verb: &Verb, place: Place, see: &mut dyn FnMut(Seen<'_>)) {
        // A recording may be over before the last line of its thread.
        let Some(live) = self.live.get_mut(&thread) else { return };
        let to = match verb {
            Verb::Jump => Place { time_s: place.time_s, ..live.last },
            _ => place,
        };
        see(Seen::Piece(Piece {
            object: live.object,
            lane: live.lane,
            first: live.first,
            from: live.last,
            to,
        }));
        live.first = false;
        live.last = place;
        if matches!(verb, Verb::End) {
            self.release(thread);
        }
    }

    /// Ends the threads whose recording is over before a time.
    fn end_until(&mut self, time_s: f64, see: &mut dyn FnMut(Seen<'_>)) {
        while let Some(Reverse((end, _))) = self.ends.peek()
            && end.0 < time_s
        {
            let Some(Reverse((end, thread))) = self.ends.pop() else { return };
            self.hold(thread, end.0, see);
            self.release(thread);
        }
    }

    /// Ends the threads whose end is not known at their last line.
    fn end_all(&mut self, see: &mut dyn FnMut(Seen<'_>)) {
        let threads: Vec<(u64, f64)> =
            self.live.iter().map(|(thread, live)| (*thread, live.last.time_s)).collect();
        for (thread, last_s) in threads {
            self.hold(thread, last_s, see);
            self.release(thread);
        }
    }

    /// Goes on as at the last line.
    fn hold(&mut self, thread: u64, until_s: f64, see: &mut dyn FnMut(Seen<'_>)) {
        let Some(live) = self.live.get(&thread) else { return };
        let to = Place { time_s: until_s.max(live.last.time_s), ..live.last };
        see(Seen::Piece(Piece {
            object: live.object,
            lane: live.lane,
            first: live.first,
            from: live.last,
            to,
        }));
    }

    fn release(&mut self, thread: u64) {
        if let Some(live) = self.live.remove(&thread)
            && let Some((free, _)) = self.lanes.get_mut(live.object)
        {
            free.push(Reverse(live.lane));
        }
    }
}

fn length_of(sound: &Sound, folder: &Path) -> Length {
    let Make::Recording { path, repeat: Repeat::Once, .. } = &sound.make else { return Length::Loop };
    // A score may come from anybody: files outside of its folder are not opened for a picture.
    let path = Path::new(path);
    if !path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return Length::Unknown;
    }
    match Recording::open(folder.join(path)) {
        Ok(recording) => Length::Seconds(recording.duration_s()),
        Err(_) => Length::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces(text: &str) -> Vec<(usize, usize, f64, f64, f64)> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.score");
        std::fs::write(&file, text).unwrap();
        let format = froufrou::render::wav::WavFormat {
            rate_hz: 8000,
            channels: 1,
            samples: froufrou::render::wav::SampleFormat::Int16,
            seed: 0,
            first_frame: 0,
        };
        let mut wav =
            froufrou::render::wav::WavWriter::create(folder.path().join("second.wav"), format).unwrap();
        wav.write(&[0.0; 8000]).unwrap();
        wav.finish().unwrap();
        let mut pieces = Vec::new();
        walk(&file, &mut |seen| {
            if let Seen::Piece(Piece { object, lane, from, to, .. }) = seen {
                pieces.push((object, lane, from.time_s, to.time_s, to.gain));
            }
        })
        .unwrap();
        pieces
    }

    #[test]
    fn threads_last_as_long_as_their_recordings_and_share_lanes() {
        let text = "froufrou-score 1 channel\nduration 9\nchannels main\nsound s \"second.wav\"\n\
            sound l \"second.wav\" loop\nsound gone \"gone.wav\"\n\
            start 1 0 s 1 0 object a\n\
            start 2 0.5 s 1 0 object a speed 2 offset 0.5\n\
            start 3 1.5 s 0.5 0 object a\nend 3 2 0.25 0\n\
            start 4 3 l 1 0\n\
            start 5 4 gone 1 0\nkey 5 5\n";
        let expected = [
            (0, 1, 0.5, 0.75, 1.0),
            (0, 0, 0.0, 1.0, 1.0),
            (0, 0, 1.5, 2.0, 0.25),
            (2, 0, 4.0, 5.0, 1.0),
            (1, 0, 3.0, 9.0, 1.0),
            (2, 0, 5.0, 5.0, 1.0),
        ];
        assert_eq!(pieces(text), expected);
    }

    #[test]
    fn a_recording_that_is_over_ends_its_thread_before_its_lines_do() {
        let text = "froufrou-score 1 channel\nchannels main\nsound s \"second.wav\"\n\
            start 1 0 s 1 0\nkey 1 0.5 0.5 0\nend 1 3\n";
        assert_eq!(pieces(text), [(0, 0, 0.0, 0.5, 0.5), (0, 0, 0.5, 1.0, 0.5)]);
    }
}
