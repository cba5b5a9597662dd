//! The file of grains and patterns: numbers alone, which with the sound make a dictionary.

use std::ops::Range;

use super::packed::{self, Reader, Writer};
use crate::corpus::grains::patterns::Peak;
use crate::corpus::grains::{Contact, GrainKind, Segment};
use crate::error::{Error, Result};

/// What the first line of the file says.
const KIND: &str = "froufrou grains 1";

/// No recording has so many samples.
const LONGEST: usize = 1 << 40;

/// Steps of the correlation from 0 to 1.
const STEPS: f32 = 255.0;

/// A stretch of a recording that sounds as a stretch of another does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Share {
    pub start: usize,
    pub length: usize,
    /// The recording that it is taken from.
    pub recording: usize,
    /// Where there.
    pub from: usize,
    pub gain: f32,
}

/// What is known of one recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Item {
    /// The hash of its stored sound.
    pub audio: String,
    /// In samples.
    pub length: usize,
    pub segments: Vec<Segment>,
    pub shares: Vec<Share>,
    /// Those that are kept, in order of start and grain.
    pub peaks: Vec<Peak>,
}

/// A correlation as it is kept: the nearest of 256 steps.
pub(super) fn stepped(correlation: f32) -> f32 {
    (correlation.clamp(0.0, 1.0) * STEPS).round() / STEPS
}

/// The parts that grains of a recording are cut from.
fn kinds(contact: Contact) -> &'static [GrainKind] {
    match contact {
        Contact::Impulsive => &[GrainKind::Impulsive],
        Contact::Continuous => &[GrainKind::Sinusoidal, GrainKind::Transient],
    }
}

/// The file of some recordings.
pub(super) fn write(items: &[Item], contacts: &[Contact]) -> Result<Vec<u8>> {
    let mut writer = Writer::default();
    writer.number(items.len() as u64);
    let begins: Vec<usize> = begins(items);
    for (item, contact) in items.iter().zip(contacts) {
        writer.number(item.audio.len() as u64);
        writer.bytes.extend_from_slice(item.audio.as_bytes());
        writer.number(item.length as u64);
        for kind in kinds(*contact) {
            let of_kind = || item.segments.iter().filter(|segment| segment.kind == *kind);
            writer.number(of_kind().count() as u64);
            of_kind().fold(0, |last, segment| {
                writer.number((segment.start - last) as u64);
                segment.start
            });
            of_kind().for_each(|segment| writer.number(segment.length as u64));
        }
        writer.number(item.shares.len() as u64);
        for share in &item.shares {
            [share.start, share.length, share.recording, share.from]
                .iter()
                .for_each(|n| writer.number(*n as u64));
            writer.float(share.gain);
        }
    }
    for item in items {
        writer.number(item.peaks.len() as u64);
        item.peaks.iter().fold(0, |last, peak| {
            writer.number(peak.start - last);
            peak.start
        });
        let recording = |grain: u32| begins.partition_point(|b| *b <= grain as usize).saturating_sub(1);
        let peaks = || item.peaks.iter();
        peaks().for_each(|peak| writer.number(recording(peak.grain) as u64));
        peaks().for_each(|peak| {
            writer.number((peak.grain as usize - begins[recording(peak.grain)]) as u64);
        });
        peaks().for_each(|peak| writer.bytes.push((stepped(peak.correlation) * STEPS).round() as u8));
    }
    packed::seal(KIND, &writer.bytes, true)
}

/// The number of each recording's first grain. Of recordings without grains, the last of those that begin at a number
/// is the one that has it.
fn begins(items: &[Item]) -> Vec<usize> {
    items
        .iter()
        .scan(0, |next, item| {
            let from = *next;
            *next += item.segments.len();
            Some(from)
        })
        .collect()
}

/// Reads such a file; all numbers are good for what they point at, but lengths are not held against the sound.
pub(super) fn read(bytes: &[u8], contacts: &[Contact]) -> Result<Vec<Item>> {
    let content = packed::open(KIND, bytes, true)?;
    let mut reader = Reader::new(&content);
    let count = reader.count(1)?;
    if count != contacts.len() {
        return Err(Error::new(format!(
            "the file has grains of {count} recordings, expected {}",
            contacts.len()
        )));
    }
    let mut items = Vec::with_capacity(count);
    for contact in contacts {
        items.push(item(&mut reader, *contact, count)?);
    }
    let begins = begins(&items);
    let grains: usize = items.iter().map(|item| item.segments.len()).sum();
    if u32::try_from(grains).is_err() {
        return Err(Error::new(format!("expected fewer than 2³² grains, found {grains}")));
    }
    let lengths: Vec<usize> = items.iter().flat_map(|item| item.segments.iter().map(|s| s.length)).collect();
    for item in &mut items {
        item.peaks = peaks(&mut reader, item.length, &begins, &lengths)?;
    }
    reader.end()?;
    Ok(items)
}

fn item(reader: &mut Reader, contact: Contact, count: usize) -> Result<Item> {
    let bytes = reader.count(1)?;
    let audio = String::from_utf8_lossy(reader.take(bytes)?).into_owned();
    let length = reader.below(LONGEST, "the length of a recording")?;
    let mut segments: Vec<Segment> = Vec::new();
    for kind in kinds(contact) {
        let number = reader.count(2)?;
        let mut start = 0;
        let from = segments.len();
        for _ in 0..number {
            start += reader.below((length + 1).saturating_sub(start), "the start of a grain")?;
            segments.push(Segment { kind: *kind, start, length: 0, energy: 0.0 });
        }
        let mut sum = 0usize;
        for segment in &mut segments[from..] {
            segment.length = reader.below(length - segment.start + 1, "the length of a grain")?;
            if segment.length == 0 {
                return Err(reader.fault("a grain has no samples"));
            }
            sum = sum.saturating_add(segment.length);
        }
        // A window is at most twice as long as what lies between its cuts, and that does not overlap.
        if sum > length.saturating_mul(2).saturating_add(2 * number) {
            return Err(reader.fault("the grains are longer than their recording"));
        }
    }
    let number = reader.count(8)?;
    let mut shares = Vec::with_capacity(number);
    for _ in 0..number {
        let start = reader.below(length, "the start of a shared stretch")?;
        let length = reader.below(length - start + 1, "the length of a shared stretch")?;
        let recording = reader.below(count, "the number of a recording")?;
        let from = reader.number()?;
        let from = usize::try_from(from).map_err(|_| reader.fault("a place is too far"))?;
        shares.push(Share { start, length, recording, from, gain: reader.float()? });
    }
    if !shares.is_sorted_by(|a: &Share, b| a.start + a.length <= b.start) {
        return Err(reader.fault("shared stretches overlap"));
    }
    Ok(Item { audio, length, segments, shares, peaks: Vec::new() })
}

fn peaks(reader: &mut Reader, length: usize, begins: &[usize], lengths: &[usize]) -> Result<Vec<Peak>> {
    let count = reader.count(4)?;
    let mut starts = Vec::with_capacity(count);
    let mut start = 0usize;
    for _ in 0..count {
        start += reader.below((length + 1).saturating_sub(start), "the start of a peak")?;
        starts.push(start);
    }
    let mut ranges: Vec<Range<usize>> = Vec::with_capacity(count);
    for _ in 0..count {
        let recording = reader.below(begins.len(), "the number of a recording")?;
        ranges.push(begins[recording]..begins.get(recording + 1).copied().unwrap_or(lengths.len()));
    }
    let mut peaks = Vec::with_capacity(count);
    for (start, range) in starts.into_iter().zip(ranges) {
        let grain = range.start + reader.below(range.len(), "the number of a grain")?;
        if start + lengths[grain] > length {
            return Err(reader.fault(format!("grain {grain} at {start} reaches beyond the recording")));
        }
        peaks.push(Peak { grain: grain as u32, start: start as u64, correlation: 0.0 });
    }
    for peak in &mut peaks {
        peak.correlation = f32::from(reader.byte()?) / STEPS;
    }
    Ok(peaks)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn items() -> (Vec<Item>, Vec<Contact>) {
        let segment = |kind, start, length| Segment { kind, start, length, energy: 0.0 };
        let hit = Item {
            audio: "0123456789abcdef0123456789abcdef".into(),
            length: 5000,
            segments: (0..9).map(|i| segment(GrainKind::Impulsive, 500 * i, 520)).collect(),
            shares: vec![Share { start: 1000, length: 500, recording: 2, from: 70, gain: -0.5 }],
            peaks: (0..40)
                .map(|i| Peak { grain: i as u32 % 13, start: 90 * i, correlation: i as f32 / 51.0 })
                .collect(),
        };
        let silent = Item { audio: hit.audio.clone(), length: 70, ..Item::default() };
        let slide = Item {
            segments: vec![
                segment(GrainKind::Sinusoidal, 0, 900),
                segment(GrainKind::Sinusoidal, 880, 700),
                segment(GrainKind::Transient, 30, 400),
                segment(GrainKind::Transient, 4000, 1000),
            ],
            shares: Vec::new(),
            ..hit.clone()
        };
        (vec![hit, silent, slide], vec![Contact::Impulsive, Contact::Impulsive, Contact::Continuous])
    }

    #[test]
    fn what_is_written_is_read() {
        let (items, contacts) = items();
        let bytes = write(&items, &contacts).unwrap();
        let read = read(&bytes, &contacts).unwrap();
        for (a, b) in items.iter().zip(&read) {
            let rounded: Vec<Peak> =
                a.peaks.iter().map(|p| Peak { correlation: stepped(p.correlation), ..*p }).collect();
            assert_eq!(
                (&a.audio, a.length, &a.segments, &a.shares),
                (&b.audio, b.length, &b.segments, &b.shares)
            );
            assert_eq!(rounded, b.peaks);
        }
        assert!(super::read(&bytes, &contacts[1..]).is_err());
        assert!(super::read(&bytes, &[Contact::Continuous; 3]).is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        /// A checksum tells damage, but not malice.
        #[test]
        fn what_is_read_of_anything_points_at_what_is_there(
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
            cut in prop::option::of(any::<prop::sample::Index>()),
        ) {
            let (items, contacts) = items();
            let bytes = write(&items, &contacts).unwrap();
            let mut content = packed::open(KIND, &bytes, true).unwrap();
            for (index, value) in changes {
                let at = index.index(content.len());
                content[at] = value;
            }
            if let Some(cut) = cut {
                content.truncate(cut.index(content.len()));
            }
            let sealed = packed::seal(KIND, &content, true).unwrap();
            let Ok(items) = read(&sealed, &contacts) else { return Ok(()) };
            let lengths: Vec<usize> = items.iter().flat_map(|i| i.segments.iter().map(|s| s.length)).collect();
            for item in &items {
                prop_assert!(item.segments.iter().all(|s| s.start + s.length <= item.length && s.length > 0));
                let sum: usize = item.segments.iter().map(|s| s.length).sum();
                prop_assert!(sum <= 4 * item.length + 64);
                prop_assert!(item.shares.iter().all(|s| s.start + s.length <= item.length && s.gain.is_finite()));
                for peak in &item.peaks {
                    prop_assert!(peak.start as usize + lengths[peak.grain as usize] <= item.length);
                }
            }
        }
    }
}
