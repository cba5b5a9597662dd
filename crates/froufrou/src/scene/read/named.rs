//! What is said by a name alone, such as that of a corpus, or by a table that has the name among other keys.

use super::super::asset::Folder;
use super::super::toml::{Node, Table};
use super::sounds::{gain_in, reference_distance};
use super::{Keys, with_place};
use crate::Result;

/// The name, and the table where there is one.
pub(super) struct Named<'d, 't> {
    name: Node<'d, 't>,
    table: Option<Table<'d, 't>>,
}

impl<'d, 't> Named<'d, 't> {
    /// A name, or a table of these keys that has it as its `corpus`; `what` is expected there.
    ///
    /// # Errors
    /// A table with other keys, or without the name.
    pub fn corpus(node: &Node<'d, 't>, keys: Keys, what: &str) -> Result<Self> {
        let table = if node.is_table() { Some(node.table(keys)?) } else { None };
        let name = match &table {
            Some(table) => table.required("corpus", what)?,
            None => node.clone(),
        };
        Ok(Self { name, table })
    }

    /// The name, whatever it is.
    pub fn name(&self) -> &Node<'d, 't> {
        &self.name
    }

    /// What a key has; nothing where the name stands alone.
    pub fn get(&self, key: &str) -> Option<Node<'d, 't>> {
        self.table.as_ref()?.get(key)
    }

    /// A text, where there is one; `what` is expected.
    pub fn text(&self, key: &str, what: &str) -> Result<Option<String>> {
        self.get(key).map(|node| node.text(what)).transpose()
    }

    /// A number, each of a range.
    pub fn within(&self, key: &str, default: f64, what: &str, least: f64, most: f64) -> Result<f64> {
        self.get(key).map_or(Ok(default), |node| node.within(what, least, most))
    }

    /// A number above 0.
    pub fn positive(&self, key: &str, default: f64, what: &str) -> Result<f64> {
        self.get(key).map_or(Ok(default), |node| node.positive(what))
    }

    /// A number of 0 or above.
    pub fn not_negative(&self, key: &str, default: f64, what: &str) -> Result<f64> {
        self.get(key).map_or(Ok(default), |node| node.not_negative(what))
    }

    /// A gain in decibels; 0 where nothing is said.
    pub fn gain_db(&self, key: &str) -> Result<f64> {
        self.table.as_ref().map_or(Ok(0.0), |table| gain_in(table, key))
    }

    /// The distance at which it is heard at its gain, in metres; 1 where nothing is said.
    pub fn reference_distance_m(&self) -> Result<f64> {
        self.table.as_ref().map_or(Ok(1.0), reference_distance)
    }
}

/// The name of a corpus: of a model, if `model` knows one by that prefix, or else of a folder, which must be there.
///
/// # Errors
/// No name, a model or a folder that there is not.
pub(super) fn corpus_of<M>(
    node: &Node<'_, '_>,
    folder: &Folder,
    what: &str,
    model: impl Fn(&str) -> Option<Result<M>>,
) -> Result<String> {
    let name = node.text(what)?;
    match model(&name) {
        Some(model) => with_place(node, model.map(|_| name.clone())),
        None => Ok(with_place(node, folder.folder(&name))?.name),
    }
}
