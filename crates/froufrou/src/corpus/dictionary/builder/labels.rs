//! What bodies do in recordings: said in `labels.toml`, by folders, by names, or guessed from the sound.

use std::path::Path;

use globset::{Glob, GlobMatcher};
use toml::Spanned;

use super::scan::Found;
use crate::corpus::dictionary::Action;
use crate::corpus::dictionary::manifest::{LabelledBy, Listed, Manifest, line};
use crate::corpus::grains::Contact;
use crate::corpus::recording::Recording;
use crate::error::{Error, Result};

/// The file beside recordings that says what they are.
pub const FILE_NAME: &str = "labels.toml";

/// Words of names, and what they tell. Of several in a name, the last counts: “rock impact slide” slides.
const WORDS: [(&str, Action); 26] = [
    ("hit", Action::Hit),
    ("impact", Action::Hit),
    ("impulsive", Action::Hit),
    ("knock", Action::Hit),
    ("strike", Action::Hit),
    ("drop", Action::Hit),
    ("step", Action::Hit),
    ("bounce", Action::Hit),
    ("break", Action::Break),
    ("broke", Action::Break),
    ("shatter", Action::Break),
    ("smash", Action::Break),
    ("crack", Action::Break),
    ("crumbl", Action::Break),
    ("collaps", Action::Break),
    ("slide", Action::Slide),
    ("sliding", Action::Slide),
    ("scrap", Action::Slide),
    ("drag", Action::Slide),
    ("rub", Action::Slide),
    ("friction", Action::Slide),
    ("continuous", Action::Slide),
    ("roll", Action::Roll),
    ("tumble", Action::Roll),
    ("wheel", Action::Roll),
    ("mining", Action::Hit),
];

/// The centroid below which what goes on is guessed to roll: rolling is duller than sliding.
const ROLLING_BELOW_HZ: f64 = 1500.0;

/// The labels of recordings, in their order.
pub(super) fn label(recordings: &Path, found: &[Found], before: Option<&Manifest>) -> Result<Vec<Listed>> {
    let manifest = said(recordings)?;
    let mut listed = Vec::with_capacity(found.len());
    for found in found {
        let former = before.and_then(|b| b.recording.iter().find(|listed| listed.name == found.name));
        let (contact, action, labelled_by) = match former {
            Some(former) if former.labelled_by == LabelledBy::Hand => {
                (former.contact, former.action, LabelledBy::Hand)
            }
            // The same sound would be guessed the same.
            Some(former) if former.labelled_by == LabelledBy::Guess && former.hash == found.hash => {
                match by_words(&manifest, &found.name) {
                    Some((action, by)) => (action.contact(), action, by),
                    None => (former.contact, former.action, LabelledBy::Guess),
                }
            }
            _ => match by_words(&manifest, &found.name) {
                Some((action, by)) => (action.contact(), action, by),
                None => {
                    let action = guess(&Recording::open(&found.path)?).map_err(|e| e.in_file(&found.path))?;
                    (action.contact(), action, LabelledBy::Guess)
                }
            },
        };
        listed.push(Listed {
            halvings: 0,
            name: found.name.clone(),
            contact,
            action,
            labelled_by,
            hash: found.hash.clone(),
            audio: String::new(),
        });
    }
    Ok(listed)
}

/// What words say of a recording, and where they stand.
fn by_words(manifest: &[(GlobMatcher, Action)], name: &str) -> Option<(Action, LabelledBy)> {
    if let Some((_, action)) = manifest.iter().find(|(glob, _)| glob.is_match(name)) {
        return Some((*action, LabelledBy::Manifest));
    }
    let (folders, file) = name.rsplit_once('/').unwrap_or(("", name));
    // The innermost folder is the most particular.
    if let Some(action) = folders.rsplit('/').find_map(word) {
        return Some((action, LabelledBy::Folder));
    }
    word(file).map(|action| (action, LabelledBy::Name))
}

/// The last word of a name that tells what bodies do. Words begin where letters do.
fn word(name: &str) -> Option<Action> {
    let lower = name.to_lowercase();
    let words = lower.rsplit(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty());
    let known = |word: &str| WORDS.iter().find(|(known, _)| word.starts_with(known));
    words.filter_map(known).next().map(|(_, action)| *action)
}

/// `labels.toml`: patterns of names, and what bodies do there; the first that fits counts.
fn said(recordings: &Path) -> Result<Vec<(GlobMatcher, Action)>> {
    let path = recordings.join(FILE_NAME);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = std::fs::read_to_string(&path).map_err(|e| Error::io("read", &path, e))?;
    let help = "a line is `\"PATTERN\" = \"hit\"`, or break, slide, roll";
    let parsed: Result<Vec<(String, Spanned<Action>)>, _> =
        toml::from_str::<Ordered>(&text).map(|ordered| ordered.0);
    let rows = parsed.map_err(|fault| {
        let at = fault.span().map_or(0, |span| span.start);
        Error::new(fault.message().to_owned()).in_file(&path).at(line(&text, at)).help(help)
    })?;
    rows.into_iter()
        .map(|(pattern, action)| {
            let at = line(&text, action.span().start);
            let glob = Glob::new(&pattern).map_err(|e| {
                Error::new(format!("not a pattern of names: {e}")).in_file(&path).at(at).help(help)
            })?;
            Ok((glob.compile_matcher(), action.into_inner()))
        })
        .collect()
}

/// A table in the order of its lines.
struct Ordered(Vec<(String, Spanned<Action>)>);

impl<'de> serde::Deserialize<'de> for Ordered {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Lines;
        impl<'de> serde::de::Visitor<'de> for Lines {
            type Value = Ordered;

            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("patterns of names and what bodies do there")
            }

            fn visit_map<A: serde::de::MapAccess<'de>>(self, mut map: A) -> Result<Ordered, A::Error> {
                let mut rows = Vec::new();
                while let Some(row) = map.next_entry()? {
                    rows.push(row);
                }
                rows.sort_by_key(|(_, action): &(String, Spanned<Action>)| action.span().start);
                Ok(Ordered(rows))
            }
        }
        deserializer.deserialize_map(Lines)
    }
}

/// What a sound is like: what is short hits, what goes on and is dull rolls, and else it slides.
fn guess(recording: &Recording) -> Result<Action> {
    let sound = recording.mono();
    if Contact::guess(&sound, recording.rate_hz)? == Contact::Impulsive {
        return Ok(Action::Hit);
    }
    // The mean frequency of the power: that of the differences over that of the samples.
    let power: f64 = sound.iter().map(|v| f64::from(*v).powi(2)).sum();
    let slope: f64 = sound.windows(2).map(|w| f64::from(w[1] - w[0]).powi(2)).sum();
    let turn = 2.0 * ((slope / power.max(f64::MIN_POSITIVE)).sqrt() / 2.0).min(1.0).asin();
    let centroid_hz = turn / std::f64::consts::TAU * f64::from(recording.rate_hz);
    Ok(if centroid_hz < ROLLING_BELOW_HZ { Action::Roll } else { Action::Slide })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_tell() {
        let told = |name: &str| by_words(&[], name);
        assert_eq!(told("Rolling/impact_3.wav"), Some((Action::Roll, LabelledBy::Folder)));
        assert_eq!(told("a/hits/b/x.wav"), Some((Action::Hit, LabelledBy::Folder)));
        assert_eq!(told("Rock_Impact_Slide_Wood.ogg"), Some((Action::Slide, LabelledBy::Name)));
        assert_eq!(told("stone_scrapes_01.ogg"), Some((Action::Slide, LabelledBy::Name)));
        // A word within a word is none.
        assert_eq!(told("white_noise.wav"), None);
    }

    #[test]
    fn sounds_are_guessed() {
        let rate_hz = 44_100;
        let random = crate::random::Random::new(1, 1);
        let hiss: Vec<f32> = (0..88_200).map(|i| random.uniform(i) as f32 - 0.5).collect();
        let guessed = |samples: Vec<f32>| guess(&Recording { rate_hz, channels: vec![samples] }).unwrap();
        assert_eq!(guessed(hiss.clone()), Action::Slide);
        let (mut low, mut lower) = (0.0, 0.0);
        let rumble = hiss.iter().map(|v| {
            low += 0.03 * (v - low);
            lower += 0.03 * (low - lower);
            lower
        });
        assert_eq!(guessed(rumble.collect()), Action::Roll);
        let hit = hiss.iter().enumerate().map(|(i, v)| v * (-(i as f32) / 900.0).exp());
        assert_eq!(guessed(hit.collect()), Action::Hit);
    }
}
