//! `corpus.toml`, as far as it is about units.

use std::path::{Component, Path};

use crate::corpus::dictionary::builder::scan;
use crate::corpus::dictionary::manifest::{FILE_NAME, line};
use crate::corpus::files::manifest_text;
use crate::corpus::units::settings::Settings;
use crate::error::{Error, Place, Result};

/// The only version so far.
const VERSION: i64 = 1;

const ADVICE: &str = "`froufrou features build RECORDINGS -o CORPUS` makes such a corpus";

fn fault(text: &str, path: &Path, fault: &toml::de::Error) -> Error {
    let error = Error::new(fault.message().to_owned()).in_file(path);
    match fault.span() {
        Some(span) => error.at(line(text, span.start)),
        None => error,
    }
}

/// What is read of the file: the rest is others'.
#[derive(serde::Deserialize)]
struct Tables {
    version: i64,
    units: Option<Settings>,
}

/// The table `[units]` of a corpus.
///
/// # Errors
/// Where there is no such file or table, or it makes no sense, with the line.
pub fn settings(folder: &Path) -> Result<Settings> {
    let path = folder.join(FILE_NAME);
    let text = manifest_text(folder, ADVICE)?;
    let tables: Tables = toml::from_str(&text).map_err(|e| fault(&text, &path, &e))?;
    if tables.version != VERSION {
        let what = format!("version is {}, expected {VERSION}", tables.version);
        return Err(Error::new(what).in_file(path).at(Place::Part("version".to_owned())));
    }
    let settings =
        tables.units.ok_or_else(|| Error::new("there is no table [units]").in_file(&path).help(ADVICE))?;
    settings.check().map_err(|e| e.in_file(path))?;
    Ok(settings)
}

/// True for a corpus that is of units and of nothing else.
pub fn is_of_units_alone(folder: &Path) -> bool {
    let table = manifest_text(folder, ADVICE).ok().and_then(|text| toml::from_str::<toml::Table>(&text).ok());
    table.is_some_and(|table| {
        table.contains_key("units") && table.keys().all(|key| key == "units" || key == "version")
    })
}

/// Gives a folder a `corpus.toml` with these units, or one that is there already a table `[units]`. Other tables stay.
///
/// # Errors
/// Settings that make no sense, a file that is there and is not TOML, or one that cannot be written.
pub fn create(folder: &Path, settings: &Settings) -> Result<()> {
    settings.check()?;
    let path = folder.join(FILE_NAME);
    let mut table = toml::Table::new();
    let mut heading = "# A corpus of units. docs/concatenation.md tells what stands here.\n".to_owned();
    if path.exists() {
        let text = manifest_text(folder, ADVICE)?;
        table = toml::from_str(&text).map_err(|e| fault(&text, &path, &e))?;
        heading = text.lines().take_while(|l| l.starts_with('#')).map(|l| format!("{l}\n")).collect();
    }
    table.entry("version").or_insert(toml::Value::Integer(VERSION));
    let failed = |e: toml::ser::Error| Error::new(format!("cannot write TOML: {e}")).because(e);
    table.insert("units".to_owned(), toml::Value::try_from(settings).map_err(failed)?);
    let text = toml::to_string(&table).map_err(failed)?;
    std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))?;
    super::cache::write(&path, format!("{heading}\n{text}").as_bytes())
}

/// The recordings of a corpus, as paths from its folder, in order.
pub(super) fn names(folder: &Path, settings: &Settings) -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in &settings.recordings {
        let path = Path::new(entry);
        let is_ours = |part| matches!(part, Component::Normal(_) | Component::CurDir | Component::ParentDir);
        if !path.components().all(is_ours) {
            let what = format!("{entry:?} is not a path from the corpus's folder");
            let at = Place::Part("units: recordings".to_owned());
            return Err(Error::new(what).in_file(folder.join(FILE_NAME)).at(at));
        }
        let lies = folder.join(path);
        if !lies.is_dir() {
            names.push(entry.clone());
            continue;
        }
        let prefix = if entry == "." { String::new() } else { format!("{}/", entry.trim_end_matches('/')) };
        let found = scan::names(&lies, folder)?;
        // What other kinds of corpora keep beside their recordings.
        let is_kept =
            |name: &String| prefix.is_empty() && ["cache/", "store/"].iter().any(|p| name.starts_with(p));
        names.extend(found.into_iter().filter(|name| !is_kept(name)).map(|name| format!("{prefix}{name}")));
    }
    names.sort();
    names.dedup();
    Ok(names)
}
