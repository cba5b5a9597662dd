//! The order of the lines, and reading a score of any order by time.

use std::io::BufRead;

use super::read::Reader;
use super::space::{Space, rank};
use super::{Header, Order};
use crate::Result;

/// The order of two lines in a sorted score; lines that compare equal keep theirs. It lets a
/// producer sort what it is about to write.
///
/// By time, a microphone's line comes before a thread's of the same time, and a thread's line before
/// that of a thread with a higher number. By thread, the microphones come first, in the order of
/// their declaration. With [`Order::Free`] all are equal.
///
/// ```
/// use froufrou::score::{ChannelLine, ChannelSpace, Order, Statement, Verb, compare};
///
/// let line = |thread, time_s| {
///     ChannelLine::Thread(Statement { thread, path: 0, time_s, verb: Verb::Key, value: vec![] })
/// };
/// let mut lines = [line(2, 1.0), line(1, 1.0), line(3, 0.5)];
/// lines.sort_by(|a, b| compare::<ChannelSpace>(a, b, Order::Time));
/// assert_eq!(lines.map(|line| line.thread()), [3, 1, 2]);
/// ```
pub fn compare<S: Space>(a: &S::Line, b: &S::Line, order: Order) -> std::cmp::Ordering {
    rank::<S>(a).cmp(&rank::<S>(b), order)
}

impl<S: Space, R: BufRead> Reader<S, R> {
    /// The lines that are left, sorted by time as a mixer wants them.
    ///
    /// A score with `order time` is read as it is needed, in bounded memory. Any other is read whole
    /// and sorted first, which takes memory in proportion to its length.
    ///
    /// # Errors
    /// Where a score that has to be read whole is faulty.
    ///
    /// ```
    /// use froufrou::score::ChannelReader;
    ///
    /// let text = r#"froufrou-score 1 channel
    /// channels main
    /// sound drip "drip.wav"
    /// start 1 2.5 drip 0.5 0.01
    /// start 2 0.5 drip 0.5 0.01
    /// "#;
    /// let lines = ChannelReader::new(text.as_bytes())?.by_time()?;
    /// let threads: Vec<u64> = lines.map(|line| line.map(|line| line.thread())).collect::<Result<_, _>>()?;
    /// assert_eq!(threads, [2, 1]);
    /// # Ok::<(), froufrou::Error>(())
    /// ```
    pub fn by_time(self) -> Result<ByTime<S, R>> {
        ByTime::new(self)
    }
}

/// The lines of a score sorted by time: see [`Reader::by_time`].
#[derive(Debug)]
pub struct ByTime<S: Space, R> {
    header: Header<S::Receiver>,
    lines: LinesByTime<S, R>,
}

#[derive(Debug)]
enum LinesByTime<S: Space, R> {
    Streamed(Box<Reader<S, R>>),
    Sorted(std::vec::IntoIter<S::Line>),
}

impl<S: Space, R: BufRead> ByTime<S, R> {
    pub(super) fn new(reader: Reader<S, R>) -> Result<Self> {
        let mut header = reader.header().clone();
        if header.order == Order::Time {
            return Ok(Self { header, lines: LinesByTime::Streamed(Box::new(reader)) });
        }
        let mut lines = reader.collect::<Result<Vec<_>>>()?;
        lines.sort_by(|a, b| compare::<S>(a, b, Order::Time));
        header.order = Order::Time;
        Ok(Self { header, lines: LinesByTime::Sorted(lines.into_iter()) })
    }

    /// What the lines rest on; its order is [`Order::Time`], whatever the text says.
    pub fn header(&self) -> &Header<S::Receiver> {
        &self.header
    }
}

impl<S: Space, R: BufRead> Iterator for ByTime<S, R> {
    type Item = Result<S::Line>;

    fn next(&mut self) -> Option<Self::Item> {
        match &mut self.lines {
            LinesByTime::Streamed(reader) => reader.next(),
            LinesByTime::Sorted(lines) => lines.next().map(Ok),
        }
    }
}
