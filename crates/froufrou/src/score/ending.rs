//! The ends of threads that a score leaves open.

use std::collections::{BTreeMap, HashMap, VecDeque};

use super::space::{LineRef, Space};
use super::{Statement, Verb};
use crate::Result;

/// Gives every thread an end: one that the score leaves open goes on as at its last line until its
/// recording is over, or the soundtrack where that loops.
///
/// An iterator over lines in time order; the ends it adds come last.
pub struct Ending<S: Space, L> {
    lines: L,
    lengths_s: HashMap<String, f64>,
    duration_s: Option<f64>,
    open: BTreeMap<(u64, u32), Open<S>>,
    ends: Option<VecDeque<S::Line>>,
}

struct Open<S: Space> {
    /// When its recording is over.
    over_s: f64,
    last_s: f64,
    value: S::Value,
}

impl<S: Space, L: Iterator<Item = Result<S::Line>>> Ending<S, L> {
    /// Watches over the lines of a score. `lengths_s` gives the seconds that each sound lasts at
    /// speed 1, infinite for a loop.
    pub fn new(
        lines: L,
        lengths_s: impl IntoIterator<Item = (String, f64)>,
        duration_s: Option<f64>,
    ) -> Self {
        let lengths_s = lengths_s.into_iter().collect();
        Self { lines, lengths_s, duration_s, open: BTreeMap::new(), ends: None }
    }

    fn note(&mut self, line: &S::Line) {
        let LineRef::Thread(statement) = S::of_line(line) else { return };
        let of = (statement.thread, statement.path);
        match &statement.verb {
            Verb::Path => {
                let Some(direct) = self.open.get(&(statement.thread, 0)) else { return };
                let (over_s, value) = (direct.over_s, statement.value.clone());
                self.open.insert(of, Open { over_s, last_s: statement.time_s, value });
            }
            Verb::Start(start) => {
                let length_s = self.lengths_s.get(&start.sound).copied().unwrap_or(0.0);
                let over_s = statement.time_s + (length_s - start.offset_s).max(0.0) / start.speed;
                let open = Open { over_s, last_s: statement.time_s, value: statement.value.clone() };
                self.open.insert(of, open);
            }
            Verb::Key | Verb::Jump => {
                if let Some(open) = self.open.get_mut(&of) {
                    open.last_s = statement.time_s;
                    open.value.clone_from(&statement.value);
                }
            }
            Verb::End => {
                self.open.remove(&of);
            }
        }
    }

    fn ends(&mut self) -> VecDeque<S::Line> {
        let duration_s = self.duration_s;
        let ends = std::mem::take(&mut self.open).into_iter().map(|((thread, path), open)| {
            let over_s =
                if open.over_s.is_finite() { open.over_s } else { duration_s.unwrap_or(open.last_s) };
            let time_s = over_s.max(open.last_s);
            Statement { thread, path, time_s, verb: Verb::End, value: open.value }
        });
        let mut ends: Vec<Statement<S::Value>> = ends.collect();
        ends.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        ends.into_iter().map(S::thread_line).collect()
    }
}

impl<S: Space, L: Iterator<Item = Result<S::Line>>> Iterator for Ending<S, L> {
    type Item = Result<S::Line>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ends.is_none() {
            match self.lines.next() {
                Some(Ok(line)) => {
                    self.note(&line);
                    return Some(Ok(line));
                }
                Some(Err(fault)) => {
                    // What comes after a fault cannot be known.
                    self.ends = Some(VecDeque::new());
                    return Some(Err(fault));
                }
                None => self.ends = Some(self.ends()),
            }
        }
        self.ends.as_mut()?.pop_front().map(Ok)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::{ChannelReader, ChannelSpace};

    #[test]
    fn what_is_left_open_ends_with_its_recording_or_the_soundtrack() {
        let text = "froufrou-score 1 channel\nduration 9\nchannels m\nsound hit \"a.wav\"\nsound hum \"b.wav\" loop\n\
                    start 1 0.5 hit 1 0.1 speed 2 offset 0.5\nstart 2 1 hum 0.5 0\nkey 2 2 0.25 0\n\
                    start 3 3 hit 1 0\nend 3 4\n";
        let reader = ChannelReader::new(text.as_bytes()).unwrap();
        let lengths = [("hit".to_string(), 1.5), ("hum".to_string(), f64::INFINITY)];
        let lines = Ending::<ChannelSpace, _>::new(reader, lengths, Some(9.0));
        let ends: Vec<_> = lines.map(Result::unwrap).skip(5).collect();
        let found: Vec<_> = ends
            .iter()
            .filter_map(|line| line.statement())
            .map(|l| (l.thread, l.time_s, l.value[0].gain, l.verb == Verb::End))
            .collect();
        assert_eq!(found, [(1, 1.0, 1.0, true), (2, 9.0, 0.25, true)]);
    }
}
