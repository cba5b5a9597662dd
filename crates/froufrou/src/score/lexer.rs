//! Text into words: lines of bounded length, words with their columns, quoting, comments.

use std::borrow::Cow;
use std::io::BufRead;

use super::quantity::Quantity;
use crate::{Error, Place, Result};

/// The longest line of a score, in bytes without its line end. It bounds the memory that reading
/// takes, and is enough for the gains and delays of a thousand channels.
pub const MAX_LINE_BYTES: usize = 64 * 1024;

/// Lines of text, one at a time, in one buffer.
#[derive(Debug)]
pub struct Lines<R> {
    read: R,
    buffer: Vec<u8>,
    number: usize,
    again: bool,
}

impl<R: BufRead> Lines<R> {
    pub fn new(read: R) -> Self {
        Self { read, buffer: Vec::new(), number: 0, again: false }
    }

    /// The number of the current line, from 1.
    pub fn number(&self) -> usize {
        self.number
    }

    /// Lets the next call of [`next`](Self::next) give the current line once more.
    pub fn give_again(&mut self) {
        self.again = true;
    }

    /// The next line's words, or `None` at the end of the text.
    pub fn next(&mut self) -> Result<Option<Words<'_>>> {
        if self.again {
            self.again = false;
        } else if !self.fill()? {
            return Ok(None);
        }
        let number = self.number;
        let mut bytes = self.buffer.as_slice();
        if number == 1 {
            // Some editors of other systems begin a text with a byte order mark.
            bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
        }
        match std::str::from_utf8(bytes) {
            Ok(line) => Ok(Some(Words { line, number, start: 0, at: 0 })),
            Err(error) => {
                let good = String::from_utf8_lossy(bytes.get(..error.valid_up_to()).unwrap_or_default());
                let place = Place::Line { line: number, column: good.chars().count() + 1 };
                Err(Error::new("found bytes that are not text (UTF-8)").at(place))
            }
        }
    }

    /// Reads a line into the buffer, without its end. False: there is none.
    fn fill(&mut self) -> Result<bool> {
        self.buffer.clear();
        let mut begun = false;
        loop {
            let number = self.number + usize::from(!begun);
            let available = match self.read.fill_buf() {
                Ok(available) => available,
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                Err(error) => {
                    let place = Place::Line { line: number, column: 0 };
                    return Err(Error::new(format!("cannot read on: {error}")).at(place).because(error));
                }
            };
            if available.is_empty() {
                return Ok(begun);
            }
            if !begun {
                begun = true;
                self.number += 1;
            }
            let newline = available.iter().position(|&byte| byte == b'\n');
            let part = available.get(..newline.unwrap_or(available.len())).unwrap_or(available);
            if self.buffer.len() + part.len() > MAX_LINE_BYTES {
                return Err(Error::new(format!(
                    "this line is longer than {MAX_LINE_BYTES} bytes, the most a score may have"
                ))
                .at(Place::Line { line: self.number, column: 0 }));
            }
            self.buffer.extend_from_slice(part);
            let used = part.len() + usize::from(newline.is_some());
            self.read.consume(used);
            if newline.is_some() {
                return Ok(true);
            }
        }
    }
}

/// A word of a line.
#[derive(Debug, Clone, PartialEq)]
pub enum Word<'a> {
    /// As it stands.
    Bare(&'a str),
    /// What stood between quotes, without its escapes.
    Quoted(Cow<'a, str>),
}

/// The words of one line, from left to right.
#[derive(Debug, Clone)]
pub struct Words<'a> {
    line: &'a str,
    number: usize,
    /// Byte at which the last word given starts.
    start: usize,
    /// Byte at which reading goes on.
    at: usize,
}

/// White space between words. A lone carriage return is one too, so that line ends of any system
/// read alike.
fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r')
}

impl<'a> Words<'a> {
    fn rest(&self) -> &'a str {
        self.line.get(self.at..).unwrap_or_default()
    }

    fn skip_space(&mut self) {
        let rest = self.rest();
        self.at += rest.bytes().position(|byte| !is_space(byte)).unwrap_or(rest.len());
    }

    /// The first byte of the next word; `None` where only a comment or nothing follows.
    pub fn peek(&mut self) -> Option<u8> {
        self.skip_space();
        self.rest().bytes().next().filter(|&byte| byte != b'#')
    }

    /// The comment that ends the line, from its `#`, once all words are taken.
    pub fn comment(&mut self) -> Option<&'a str> {
        self.skip_space();
        let rest = self.rest();
        rest.starts_with('#').then(|| rest.trim_end())
    }

    /// The next word; `None` where only a comment or nothing follows.
    pub fn next(&mut self) -> Result<Option<Word<'a>>> {
        let first = self.peek();
        self.start = self.at;
        let word = match first {
            None => return Ok(None),
            Some(b'"') => Word::Quoted(self.quoted()?),
            Some(_) => {
                let rest = self.rest();
                let end = rest.bytes().position(|byte| is_space(byte) || byte == b'"' || byte == b'#');
                let word = rest.get(..end.unwrap_or(rest.len())).unwrap_or(rest);
                self.at += word.len();
                Word::Bare(word)
            }
        };
        match self.rest().bytes().next() {
            Some(byte) if !is_space(byte) && byte != b'#' => {
                self.start = self.at;
                Err(self.fault("expected a space between two words"))
            }
            _ => Ok(Some(word)),
        }
    }

    /// A text between quotes; reading stands at the first quote.
    fn quoted(&mut self) -> Result<Cow<'a, str>> {
        let body = self.rest().get(1..).unwrap_or_default();
        let mut unescaped: Option<String> = None;
        let mut characters = body.char_indices();
        while let Some((at, character)) = characters.next() {
            match character {
                '"' => {
                    self.at += at + 2;
                    let plain = body.get(..at).unwrap_or_default();
                    return Ok(unescaped.map_or(Cow::Borrowed(plain), Cow::Owned));
                }
                '\\' => {
                    let so_far = unescaped.get_or_insert_with(|| body.get(..at).unwrap_or_default().into());
                    match characters.next() {
                        Some((_, '"')) => so_far.push('"'),
                        Some((_, '\\')) => so_far.push('\\'),
                        Some((_, 'n')) => so_far.push('\n'),
                        Some((_, 't')) => so_far.push('\t'),
                        Some((_, 'r')) => so_far.push('\r'),
                        other => {
                            self.start = self.at + 1 + at;
                            let found = other.map_or(String::new(), |(_, other)| other.to_string());
                            return Err(self
                                .fault(format!("unknown escape {}", shown(&format!("\\{found}"))))
                                .help(r#"the escapes are \" \\ \n \t \r"#));
                        }
                    }
                }
                other => {
                    if let Some(so_far) = &mut unescaped {
                        so_far.push(other);
                    }
                }
            }
        }
        Err(self.fault("the quotes that open here are not closed on this line"))
    }

    fn column(&self, byte: usize) -> usize {
        self.line.get(..byte).map_or(0, |before| before.chars().count() + 1)
    }

    /// The number of the line, from 1.
    pub fn number(&self) -> usize {
        self.number
    }

    /// Puts an error at the last word given.
    pub fn place(&self, error: Error) -> Error {
        error.at(Place::Line { line: self.number, column: self.column(self.start) })
    }

    /// Puts an error at the line's word of this index, from 0.
    pub fn place_at_word(&self, index: usize, error: Error) -> Error {
        let mut again = Words { line: self.line, number: self.number, start: 0, at: 0 };
        for _ in 0..=index {
            if !matches!(again.next(), Ok(Some(_))) {
                break;
            }
        }
        again.place(error)
    }

    /// An error at the last word given.
    pub fn fault(&self, what: impl Into<String>) -> Error {
        self.place(Error::new(what))
    }

    /// An error at what should have been another word.
    fn unexpected(&self, expected: &str, found: Option<&Word<'_>>) -> Error {
        let found = match found {
            None => "the end of the line".into(),
            Some(Word::Bare(word)) => shown(word),
            Some(Word::Quoted(word)) => format!("the quoted text {}", shown(word)),
        };
        self.fault(format!("expected {expected}, found {found}"))
    }

    /// An error at the last word given, which is none of the known ones.
    pub fn unknown<'k>(
        &self,
        kind: &str,
        found: &str,
        known: impl IntoIterator<Item = &'k str>,
        expected: &str,
    ) -> Error {
        let error = self.fault(format!("unknown {kind} {}, expected {expected}", shown(found)));
        match suggestion(found, known) {
            Some(help) => error.help(help),
            None => error,
        }
    }

    /// Whether the next word is written like a number, be it a forbidden one.
    pub fn next_is_number(&mut self) -> bool {
        match self.peek() {
            None | Some(b'"') => false,
            Some(byte) if !byte.is_ascii_alphabetic() => true,
            Some(_) => match self.clone().next() {
                Ok(Some(Word::Bare(word))) => word.parse::<f64>().is_ok(),
                _ => false,
            },
        }
    }

    /// Takes the next word if it is this word of the language, without quotes.
    pub fn takes(&mut self, keyword: &str) -> bool {
        let mut following = self.clone();
        let is_this = matches!(following.next(), Ok(Some(Word::Bare(word))) if word == keyword);
        if is_this {
            *self = following;
        }
        is_this
    }

    /// A word of the language, or `None` at the end of the line.
    pub fn keyword(&mut self, expected: &str) -> Result<Option<&'a str>> {
        match self.next()? {
            None => Ok(None),
            Some(Word::Bare(word)) => Ok(Some(word)),
            Some(word) => Err(self.unexpected(expected, Some(&word))),
        }
    }

    /// A word of the language that must be there.
    pub fn keyword_here(&mut self, expected: &str) -> Result<&'a str> {
        self.keyword(expected)?.ok_or_else(|| self.unexpected(expected, None))
    }

    /// A name: a plain word, or anything in quotes.
    pub fn name(&mut self, expected: &str) -> Result<Cow<'a, str>> {
        match self.next()? {
            Some(Word::Quoted(name)) => Ok(name),
            Some(Word::Bare(name)) if is_plain(name) => Ok(Cow::Borrowed(name)),
            other => {
                let error = self.unexpected(expected, other.as_ref());
                Err(match other {
                    Some(_) => error.help(
                        "a name that is not a letter followed by letters, digits and _ . / - stands in quotes",
                    ),
                    None => error,
                })
            }
        }
    }

    /// A number that this quantity may have.
    pub fn number_of(&mut self, quantity: Quantity) -> Result<f64> {
        let word = match self.next()? {
            Some(Word::Bare(word)) => word,
            other => return Err(self.unexpected(quantity.name, other.as_ref())),
        };
        let number =
            word.parse::<f64>().map_err(|_| self.unexpected(quantity.name, Some(&Word::Bare(word))))?;
        if number.is_infinite() && word.bytes().any(|byte| byte.is_ascii_digit()) {
            return Err(self.fault(format!("{}, {}, is too large for a number", quantity.name, shown(word))));
        }
        quantity.check(number).map_err(|error| self.place(error))
    }

    /// Three numbers.
    pub fn numbers_of(&mut self, quantities: [Quantity; 3]) -> Result<[f64; 3]> {
        let [x, y, z] = quantities;
        Ok([self.number_of(x)?, self.number_of(y)?, self.number_of(z)?])
    }

    /// A whole number from 0.
    pub fn whole<T: std::str::FromStr>(&mut self, expected: &str) -> Result<T> {
        match self.next()? {
            Some(Word::Bare(word)) if word.bytes().all(|byte| byte.is_ascii_digit()) => {
                word.parse().map_err(|_| self.fault(format!("{expected}, {}, is too large", shown(word))))
            }
            other => Err(self.unexpected(&format!("{expected}, a whole number from 0"), other.as_ref())),
        }
    }

    /// A thread's number, and that of its path behind a stroke, which is 0 where it is left out.
    pub fn thread(&mut self) -> Result<(u64, u32)> {
        let expected = "the thread's number, a whole number from 0";
        let word = match self.next()? {
            Some(Word::Bare(word)) => word,
            other => return Err(self.unexpected(expected, other.as_ref())),
        };
        let (number, path) = word.split_once('/').unwrap_or((word, "0"));
        let digits = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
        if !digits(number) || !digits(path) {
            return Err(self.unexpected(expected, Some(&Word::Bare(word))));
        }
        let large = |_| self.fault(format!("the thread's number, {}, is too large", shown(word)));
        Ok((number.parse().map_err(large)?, path.parse().map_err(large)?))
    }

    /// Makes sure that nothing but a comment is left.
    pub fn end(&mut self) -> Result<()> {
        match self.next()? {
            None => Ok(()),
            word => Err(self.unexpected("the end of the line", word.as_ref())),
        }
    }
}

/// A word as an error shows it: in backticks, without control characters, and not endless.
pub fn shown(word: &str) -> String {
    const LONGEST: usize = 40;
    let mut text: String = word.chars().take(LONGEST).flat_map(char::escape_debug).collect();
    if word.chars().nth(LONGEST).is_some() {
        text.push('…');
    }
    // What was escaped for its quotes alone needs no escape between backticks.
    format!("`{}`", text.replace("\\\"", "\"").replace("\\'", "'"))
}

/// The nearest of the known names, as a help: "did you mean …?".
pub fn suggestion<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    // The distance takes the product of both lengths: names worth guessing are short.
    const LONGEST: usize = 64;
    if found.len() > LONGEST {
        return None;
    }
    let allowed = (found.chars().count() / 3).max(1);
    known
        .into_iter()
        .filter(|name| name.len() <= LONGEST)
        .map(|name| (strsim::damerau_levenshtein(found, name), name))
        .filter(|&(distance, _)| distance <= allowed)
        .min()
        .map(|(_, name)| format!("did you mean {}?", shown(name)))
}

/// Whether a name needs no quotes.
fn is_plain(name: &str) -> bool {
    let mut bytes = name.bytes();
    bytes.next().is_some_and(|byte| byte.is_ascii_alphabetic() || byte == b'_')
        && bytes.all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'.' | b'/' | b'-'))
}

/// Appends a name, in quotes where it needs them.
pub fn push_name(text: &mut String, name: &str) {
    if is_plain(name) {
        text.push_str(name);
    } else {
        push_quoted(text, name);
    }
}

/// Appends a text in quotes.
pub fn push_quoted(text: &mut String, content: &str) {
    text.push('"');
    for character in content.chars() {
        match character {
            '"' => text.push_str("\\\""),
            '\\' => text.push_str("\\\\"),
            '\n' => text.push_str("\\n"),
            '\t' => text.push_str("\\t"),
            '\r' => text.push_str("\\r"),
            other => text.push(other),
        }
    }
    text.push('"');
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn words(line: &str) -> Result<Vec<String>> {
        let mut words = Words { line, number: 1, start: 0, at: 0 };
        let mut found = Vec::new();
        while let Some(word) = words.next()? {
            found.push(match word {
                Word::Bare(word) => word.into(),
                Word::Quoted(word) => word.into_owned(),
            });
        }
        Ok(found)
    }

    #[test]
    fn words_end_at_spaces_and_comments() {
        assert_eq!(words("  key\t1 0.5# now").unwrap(), ["key", "1", "0.5"]);
        assert_eq!(words(r#"a "b # c" "d\"\\\n\t\r" # e"#).unwrap(), ["a", "b # c", "d\"\\\n\t\r"]);
        assert_eq!(words("# only this").unwrap(), [""; 0]);
    }

    #[test]
    fn faults_name_the_column_in_characters() {
        let message = |line| words(line).unwrap_err().to_string();
        assert_eq!(message(r#""é" a"b""#), "1:6: expected a space between two words");
        assert_eq!(message(r#"a "b\x""#), r#"1:5: unknown escape `\\x` (the escapes are \" \\ \n \t \r)"#);
        assert_eq!(message(r#"é "b"#), "1:3: the quotes that open here are not closed on this line");
    }

    #[test]
    fn an_endless_line_is_refused() {
        let mut lines = Lines::new(std::io::BufReader::new(std::io::repeat(b'a')));
        assert_eq!(
            lines.next().unwrap_err().to_string(),
            "1: this line is longer than 65536 bytes, the most a score may have"
        );
        let longest = "a".repeat(MAX_LINE_BYTES);
        assert!(Lines::new(longest.as_bytes()).next().is_ok());
    }

    #[test]
    fn bytes_that_are_no_text_are_refused() {
        let mut lines = Lines::new(&b"fine\n\xc3\xa9\xff\n"[..]);
        assert!(lines.next().is_ok());
        assert_eq!(lines.next().unwrap_err().to_string(), "2:2: found bytes that are not text (UTF-8)");
    }

    #[test]
    fn a_failing_source_is_told_apart_from_its_end() {
        struct Broken;
        impl std::io::Read for Broken {
            fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
                Err(std::io::Error::other("the disk is gone"))
            }
        }
        let mut lines = Lines::new(std::io::BufReader::new(Broken));
        assert_eq!(lines.next().unwrap_err().to_string(), "1: cannot read on: the disk is gone");
    }

    #[test]
    fn shown_words_are_short_and_harmless() {
        assert_eq!(shown("a\u{1b}[31m\"'"), "`a\\u{1b}[31m\"'`");
        assert_eq!(shown(&"x".repeat(50)), format!("`{}…`", "x".repeat(40)));
    }

    #[test]
    fn the_nearest_name_is_suggested() {
        assert_eq!(suggestion("strat", ["key", "start"]).as_deref(), Some("did you mean `start`?"));
        assert_eq!(suggestion("banana", ["key", "start"]), None);
        assert_eq!(suggestion(&"a".repeat(60_000), ["a"]), None);
    }

    proptest! {
        #[test]
        fn every_name_reads_back(name: String) {
            let mut text = String::new();
            push_name(&mut text, &name);
            prop_assert!(!text.contains('\n'));
            prop_assert_eq!(words(&text).unwrap(), [name]);
        }

        #[test]
        fn no_line_panics(line: String) {
            let _ = words(&line);
        }
    }
}
