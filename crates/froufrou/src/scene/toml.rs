//! Walking a parsed TOML file so that every fault is told with its line, its key and what was
//! expected there.
//!
//! A [`Node`] is a value with the path of keys that leads to it; a [`Table`] is a node whose keys
//! have been checked against the ones that may stand there.

use std::path::PathBuf;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::{Error, Place, Result};

/// The text being read, for turning offsets into lines.
#[derive(Debug)]
pub(crate) struct Document<'t> {
    /// The file's name, for messages.
    pub(crate) file: PathBuf,
    /// All of its text.
    pub(crate) text: &'t str,
}

impl<'t> Document<'t> {
    /// Parses the whole text.
    pub(crate) fn parse(&self) -> Result<Spanned<DeTable<'t>>> {
        DeTable::parse(self.text).map_err(|fault| {
            let offset = fault.span().map_or(0, |span| span.start);
            self.error(offset, format!("not valid TOML: {}", fault.message()))
        })
    }

    /// Line and column, from 1, of an offset in bytes.
    pub(crate) fn place(&self, offset: usize) -> Place {
        let mut end = offset.min(self.text.len());
        while !self.text.is_char_boundary(end) {
            end -= 1;
        }
        let before = &self.text[..end];
        let line = before.bytes().filter(|&b| b == b'\n').count() + 1;
        let start = before.rfind('\n').map_or(0, |i| i + 1);
        Place::Line { line, column: before[start..].chars().count() + 1 }
    }

    /// An error at an offset of this file.
    pub(crate) fn error(&self, offset: usize, what: impl Into<String>) -> Error {
        Error::new(what).in_file(self.file.clone()).at(self.place(offset))
    }
}

/// The closest of some names, where one is close enough to be a slip of the hand.
///
/// Near is one edit in every three characters, and at least one; a swap of neighbours is one edit.
pub(crate) fn nearest<'n>(name: &str, names: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    // Names beyond any sensible length are not compared: the distance is quadratic.
    if name.len() > 200 {
        return None;
    }
    let lower = name.to_lowercase();
    let allowed = (name.chars().count() / 3).max(1);
    names
        .into_iter()
        .filter(|other| other.len() <= 200)
        .map(|other| (strsim::damerau_levenshtein(&lower, &other.to_lowercase()), other))
        .filter(|(distance, _)| *distance <= allowed)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, other)| other)
}

/// "`a`, `b` or `c`".
pub(crate) fn alternatives<'n>(names: impl IntoIterator<Item = &'n str>) -> String {
    let names: Vec<String> = names.into_iter().map(|n| format!("`{n}`")).collect();
    match names.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        Some((last, _)) => last.clone(),
        None => String::new(),
    }
}

/// A value and the keys that lead to it.
#[derive(Debug, Clone)]
pub(crate) struct Node<'d, 't> {
    document: &'d Document<'t>,
    path: String,
    value: &'d Spanned<DeValue<'t>>,
}

impl<'d, 't> Node<'d, 't> {
    /// The dotted path of keys, such as `object[2].track`.
    pub(crate) fn path(&self) -> &str {
        &self.path
    }

    /// Where the value begins, in bytes.
    pub(crate) fn offset(&self) -> usize {
        self.value.span().start
    }

    /// An error at this value that names its key.
    pub(crate) fn error(&self, what: impl std::fmt::Display) -> Error {
        self.document.error(self.offset(), format!("`{}`: {what}", self.path))
    }

    /// The error of a value of another kind than expected.
    pub(crate) fn expected(&self, what: &str) -> Error {
        let found = match self.value.get_ref() {
            DeValue::String(text) => format!("the text {:?}", shortened(text)),
            DeValue::Integer(number) => format!("the whole number {}", shortened(number.as_str())),
            DeValue::Float(number) => format!("the number {}", shortened(number.as_str())),
            DeValue::Boolean(value) => format!("{value}"),
            DeValue::Datetime(_) => "a date or time".to_owned(),
            DeValue::Array(array) => format!("a list of {}", array.len()),
            DeValue::Table(_) => "a table".to_owned(),
        };
        self.error(format!("expected {what}, found {found}"))
    }

    /// True for text.
    pub(crate) fn is_text(&self) -> bool {
        self.value.get_ref().is_str()
    }

    /// True for a list.
    pub(crate) fn is_list(&self) -> bool {
        self.value.get_ref().is_array()
    }

    /// True for a table.
    pub(crate) fn is_table(&self) -> bool {
        self.value.get_ref().is_table()
    }

    /// True or false, where it is either.
    pub(crate) fn as_flag(&self) -> Option<bool> {
        self.value.get_ref().as_bool()
    }

    /// Text that is not empty.
    pub(crate) fn text(&self, what: &str) -> Result<String> {
        match self.value.get_ref().as_str() {
            Some("") => Err(self.error(format!("expected {what}, found an empty text"))),
            Some(text) => Ok(text.to_owned()),
            None => Err(self.expected(what)),
        }
    }

    /// A finite number.
    pub(crate) fn number(&self, what: &str) -> Result<f64> {
        let number = match self.value.get_ref() {
            DeValue::Float(number) => number.as_str().parse::<f64>().ok(),
            // Beyond 64 bits a whole number is refused rather than rounded.
            DeValue::Integer(number) => {
                i64::from_str_radix(number.as_str(), number.radix()).ok().map(|n| n as f64)
            }
            _ => None,
        };
        number.filter(|n| n.is_finite()).ok_or_else(|| self.expected(what))
    }

    /// A finite number above 0.
    pub(crate) fn positive(&self, what: &str) -> Result<f64> {
        let what = format!("{what} above 0");
        let number = self.number(&what)?;
        if number > 0.0 { Ok(number) } else { Err(self.expected(&what)) }
    }

    /// A finite number of 0 or above.
    pub(crate) fn not_negative(&self, what: &str) -> Result<f64> {
        let what = format!("{what} of 0 or above");
        let number = self.number(&what)?;
        if number >= 0.0 { Ok(number) } else { Err(self.expected(&what)) }
    }

    /// A finite number within bounds, both included.
    pub(crate) fn within(&self, what: &str, least: f64, most: f64) -> Result<f64> {
        let what = format!("{what} from {least} to {most}");
        let number = self.number(&what)?;
        if (least..=most).contains(&number) { Ok(number) } else { Err(self.expected(&what)) }
    }

    /// A whole number within bounds, both included.
    pub(crate) fn whole(&self, what: &str, least: u64, most: u64) -> Result<u64> {
        let number = match self.value.get_ref() {
            DeValue::Integer(number) => u64::from_str_radix(number.as_str(), number.radix()).ok(),
            _ => None,
        };
        number
            .filter(|n| (least..=most).contains(n))
            .ok_or_else(|| self.expected(&format!("{what}, a whole number from {least} to {most}")))
    }

    /// The elements of a list.
    pub(crate) fn list(&self, what: &str) -> Result<Vec<Node<'d, 't>>> {
        let array = self.value.get_ref().as_array().ok_or_else(|| self.expected(what))?;
        let element =
            |(i, value)| Node { document: self.document, path: format!("{}[{i}]", self.path), value };
        Ok(array.iter().enumerate().map(element).collect())
    }

    /// Three finite numbers.
    pub(crate) fn vector(&self, what: &str) -> Result<[f64; 3]> {
        let what = format!("{what} as [x, y, z]");
        let list = self.list(&what)?;
        let [x, y, z] = list.as_slice() else { return Err(self.expected(&what)) };
        Ok([x.number("a number")?, y.number("a number")?, z.number("a number")?])
    }

    /// Three finite numbers that are not all 0, scaled to length 1.
    pub(crate) fn direction(&self, what: &str) -> Result<[f64; 3]> {
        let v = self.vector(what)?;
        // Scaled by the largest first, so that neither huge nor tiny ones overflow or vanish.
        let largest = v.iter().fold(0.0f64, |m, c| m.max(c.abs()));
        if largest == 0.0 {
            return Err(self.error("a direction cannot be [0, 0, 0]"));
        }
        let v = v.map(|c| c / largest);
        let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
        Ok(v.map(|c| c / length))
    }

    /// One of some words, as its place among them.
    pub(crate) fn choice(&self, words: &[&str]) -> Result<usize> {
        let Some(word) = self.value.get_ref().as_str() else {
            return Err(self.expected(&alternatives(words.iter().copied())));
        };
        words.iter().position(|w| *w == word).ok_or_else(|| {
            let error = self.expected(&alternatives(words.iter().copied()));
            match nearest(word, words.iter().copied()) {
                Some(near) => error.help(format!("did you mean `{near}`?")),
                None => error,
            }
        })
    }

    /// The table, after a check that it has no keys but these.
    pub(crate) fn table(&self, keys: &'static [&'static str]) -> Result<Table<'d, 't>> {
        let table = self.value.get_ref().as_table().ok_or_else(|| self.expected("a table"))?;
        Table::new(self.document, self.path.clone(), self.offset(), table, Some(keys))
    }

    /// The table, whose keys are names that the author chose.
    pub(crate) fn named(&self) -> Result<Table<'d, 't>> {
        let table = self.value.get_ref().as_table().ok_or_else(|| self.expected("a table"))?;
        Table::new(self.document, self.path.clone(), self.offset(), table, None)
    }
}

/// The beginning of a text that may be very long.
fn shortened(text: &str) -> String {
    let mut short: String = text.chars().take(60).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}

/// A table whose keys have been checked.
#[derive(Debug, Clone)]
pub(crate) struct Table<'d, 't> {
    document: &'d Document<'t>,
    path: String,
    offset: usize,
    table: &'d DeTable<'t>,
}

impl<'d, 't> Table<'d, 't> {
    /// The outermost table of a document.
    pub(crate) fn root(
        document: &'d Document<'t>,
        tree: &'d Spanned<DeTable<'t>>,
        keys: &'static [&'static str],
    ) -> Result<Self> {
        Self::new(document, String::new(), 0, tree.get_ref(), Some(keys))
    }

    fn new(
        document: &'d Document<'t>,
        path: String,
        offset: usize,
        table: &'d DeTable<'t>,
        keys: Option<&'static [&'static str]>,
    ) -> Result<Self> {
        if let Some(keys) = keys {
            // The first in the file, whatever the order of the map.
            let unknown = table.keys().filter(|k| !keys.contains(&k.get_ref().as_ref()));
            if let Some(key) = unknown.min_by_key(|k| k.span().start) {
                let name = key.get_ref().as_ref();
                let place = if path.is_empty() { String::new() } else { format!(" in `{path}`") };
                let error =
                    document.error(key.span().start, format!("unknown key `{}`{place}", shortened(name)));
                return Err(match nearest(name, keys.iter().copied()) {
                    Some(near) => error.help(format!("did you mean `{near}`?")),
                    None => error.help(format!("expected {}", alternatives(keys.iter().copied()))),
                });
            }
        }
        Ok(Self { document, path, offset, table })
    }

    /// An error about the table as a whole.
    pub(crate) fn error(&self, what: impl std::fmt::Display) -> Error {
        if self.path.is_empty() {
            self.document.error(self.offset, what.to_string())
        } else {
            self.document.error(self.offset, format!("`{}`: {what}", self.path))
        }
    }

    /// The value of a key, where it is there.
    pub(crate) fn get(&self, key: &str) -> Option<Node<'d, 't>> {
        self.table.get(key).map(|value| Node { document: self.document, path: self.join(key), value })
    }

    /// The value of a key that must be there.
    pub(crate) fn required(&self, key: &str, what: &str) -> Result<Node<'d, 't>> {
        self.get(key).ok_or_else(|| self.error(format!("`{key}` is missing: expected {what}")))
    }

    /// All keys with their values, in the order of the file.
    pub(crate) fn entries(&self) -> Vec<(&'d str, Node<'d, 't>)> {
        let mut entries: Vec<_> = self.table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        let node = |name: &str, value| Node { document: self.document, path: self.join(name), value };
        entries.into_iter().map(|(k, v)| (k.get_ref().as_ref(), node(k.get_ref(), v))).collect()
    }

    /// Refuses keys that do not go together.
    pub(crate) fn at_most_one(&self, keys: &[&str]) -> Result<()> {
        let mut given = keys.iter().filter_map(|k| self.get(k));
        match (given.next(), given.next()) {
            (Some(first), Some(second)) => {
                Err(second.error(format!("cannot stand beside `{}`", first.path())))
            }
            _ => Ok(()),
        }
    }

    fn join(&self, key: &str) -> String {
        if self.path.is_empty() { shortened(key) } else { format!("{}.{}", self.path, shortened(key)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_counts_characters_not_bytes() {
        let document = Document { file: "x.toml".into(), text: "a = 1\ngrüße = \"ä\"  # ß\nb = 2" };
        assert_eq!(document.place(0), Place::Line { line: 1, column: 1 });
        let after_u = document.text.find("ße").map_or(0, |i| i);
        assert_eq!(document.place(after_u), Place::Line { line: 2, column: 4 });
        assert_eq!(document.place(usize::MAX), Place::Line { line: 3, column: 6 });
    }

    #[test]
    fn only_near_names_are_suggested() {
        let names = ["position", "track", "source"];
        assert_eq!(nearest("postion", names), Some("position"));
        assert_eq!(nearest("Track", names), Some("track"));
        assert_eq!(nearest("soruce", names), Some("source"));
        assert_eq!(nearest("material", names), None);
        assert_eq!(nearest(&"x".repeat(1_000_000), names), None);
    }

    #[test]
    fn faults_of_syntax_have_a_line() {
        let document = Document { file: "x.toml".into(), text: "a = 1\nb = [1,\nc" };
        let error = document.parse().err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.starts_with("x.toml:3:"), "{error}");
    }
}
