//! Where a recording of a device differs from what the device was given, and why.

use std::collections::HashMap;
use std::path::Path;

use froufrou::{Error, Result};

use crate::{CHANNELS, RATE_HZ};

/// So many frames in a row are alike where both have found each other again.
const ALIKE: usize = 64;
/// A place is known by so many frames.
const KEY: usize = 8;
/// They are looked for within so many frames.
const FARTHEST: usize = 4 * RATE_HZ as usize;
/// Gaps that are so near, in frames, are one.
const ONE: usize = 2_400;

type Frame = [f32; CHANNELS];

/// A block that the device asked for.
struct Block {
    asked_s: f64,
    took_s: f64,
    /// Its first frame, of what was given.
    from: usize,
    frames: usize,
}

/// Where a recording goes another way.
struct Gap {
    recorded: usize,
    given: usize,
    /// Frames that were recorded and never given, and those that were given and never recorded.
    strange: usize,
    lost: usize,
    is_silent: bool,
}

fn sound(path: &Path) -> Result<Vec<Frame>> {
    let bytes = std::fs::read(path).map_err(|fault| Error::io("read", path, fault))?;
    let sample = |bytes: &[u8]| bytes.try_into().map_or(0.0, f32::from_le_bytes);
    Ok(bytes.chunks_exact(8).map(|frame| [sample(&frame[..4]), sample(&frame[4..])]).collect())
}

fn blocks(path: &Path) -> Result<Vec<Block>> {
    let text = std::fs::read_to_string(path).map_err(|fault| Error::io("read", path, fault))?;
    let mut from = 0;
    let mut block = |line: &str| {
        let mut numbers = line.split(',').map(|cell| cell.parse::<u64>().unwrap_or(0));
        let mut next = || numbers.next().unwrap_or(0);
        let (asked_s, took_s, frames) = (next() as f64 * 1e-6, next() as f64 * 1e-6, next() as usize);
        from += frames;
        Block { asked_s, took_s, from: from - frames, frames }
    };
    Ok(text.lines().skip(1).map(&mut block).collect())
}

type Key = [[u32; CHANNELS]; KEY];

fn key(frames: &[Frame]) -> Option<Key> {
    let mut key = [[0; CHANNELS]; KEY];
    for (key, frame) in key.iter_mut().zip(frames.get(..KEY)?) {
        *key = frame.map(f32::to_bits);
    }
    // Silence is everywhere.
    (key.iter().flatten().filter(|bits| **bits != 0).count() > KEY).then_some(key)
}

fn is_alike(a: &[Frame], b: &[Frame]) -> bool {
    a.len() >= ALIKE && b.len() >= ALIKE && a[..ALIKE] == b[..ALIKE]
}

/// Where a recording and what was given are alike again, at or behind these frames.
fn meet(recorded: &[Frame], given: &[Frame], [r, g]: [usize; 2]) -> Option<[usize; 2]> {
    let mut places: HashMap<Key, usize> = HashMap::new();
    let until = (g + FARTHEST).min(given.len());
    for at in (g..until).rev() {
        if let Some(key) = key(&given[at..]) {
            places.insert(key, at);
        }
    }
    (r..(r + FARTHEST).min(recorded.len())).find_map(|r| {
        let g = *places.get(&key(&recorded[r..])?)?;
        is_alike(&recorded[r..], &given[g..]).then_some([r, g])
    })
}

/// Follows both from where they first are alike to the end of one.
fn follow(recorded: &[Frame], given: &[Frame]) -> Result<([usize; 2], usize, Vec<Gap>)> {
    let begin = given.iter().position(|frame| frame.iter().any(|s| s.abs() > 1e-4));
    let Some(begin) = begin else { return Err(Error::new("nothing was given but silence")) };
    // The server began to record some time before.
    let mut places = HashMap::new();
    for at in begin..(begin + FARTHEST).min(given.len()) {
        if let Some(key) = key(&given[at..]) {
            places.entry(key).or_insert(at);
        }
    }
    let met = (0..recorded.len()).find_map(|r| {
        let g = *places.get(&key(&recorded[r..])?)?;
        is_alike(&recorded[r..], &given[g..]).then_some([r, g])
    });
    let Some(first) = met else { return Err(Error::new("nothing that was given is in the recording")) };
    let ([mut r, mut g], mut same, mut gaps) = (first, 0, Vec::<Gap>::new());
    loop {
        let alike = recorded[r..].iter().zip(&given[g..]).take_while(|(a, b)| a == b).count();
        (r, g, same) = (r + alike, g + alike, same + alike);
        if r + ALIKE >= recorded.len() || g + ALIKE >= given.len() {
            return Ok((first, same, gaps));
        }
        let Some([to_r, to_g]) = meet(recorded, given, [r, g]) else {
            return Err(Error::new(format!(
                "{:.3} s into the recording nothing is alike any more",
                r as f64 / f64::from(RATE_HZ)
            )));
        };
        let (strange, lost) = (to_r - r, to_g - g);
        let is_silent = recorded[r..to_r].iter().flatten().all(|sample| *sample == 0.0);
        gaps.push(Gap { recorded: r, given: g, strange, lost, is_silent });
        (r, g) = (to_r, to_g);
    }
}

/// What went before a gap on our side, if something did.
fn cause(blocks: &[Block], given: usize) -> String {
    let at = blocks.partition_point(|block| block.from + block.frames <= given);
    let near = &blocks[at.saturating_sub(8)..(at + 8).min(blocks.len())];
    let budget_s = |block: &Block| block.frames as f64 / f64::from(RATE_HZ);
    let slow = near.iter().max_by(|a, b| (a.took_s / budget_s(a)).total_cmp(&(b.took_s / budget_s(b))));
    if let Some(block) = slow
        && block.took_s > budget_s(block)
    {
        return format!("a block of {} frames took {:.2} ms", block.frames, 1000.0 * block.took_s);
    }
    // It is asked for as much as it has played.
    let mut late_s: f64 = 0.0;
    for pair in near.windows(2) {
        late_s = late_s.max(pair[1].asked_s - pair[0].asked_s - budget_s(&pair[1]));
    }
    if late_s > 0.001 {
        return format!("the device asked {:.2} ms later than the blocks sound", 1000.0 * late_s);
    }
    "nothing on our side: the server".to_owned()
}

/// Tells how a recording differs from what was given.
///
/// # Errors
/// Files that cannot be read, or a recording of something else.
pub fn compare(folder: &Path) -> Result<()> {
    let (recorded, given) = (sound(&folder.join("recorded.f32"))?, sound(&folder.join("given.f32"))?);
    let blocks = blocks(&folder.join("blocks.csv"))?;
    let seconds = |frames: usize| frames as f64 / f64::from(RATE_HZ);
    let (first, same, gaps) = follow(&recorded, &given)?;
    println!(
        "given {:.3} s, recorded {:.3} s; found from {:.3} s of the recording on",
        seconds(given.len()),
        seconds(recorded.len()),
        seconds(first[0])
    );
    println!("{:.3} s are the same to the last bit", seconds(same));
    let mut causes: HashMap<&str, usize> = HashMap::new();
    let mut last: Option<usize> = None;
    let mut count = 0;
    for gap in &gaps {
        let is_one = last.is_some_and(|last| gap.recorded - last < ONE);
        last = Some(gap.recorded);
        if is_one {
            continue;
        }
        count += 1;
        let why = cause(&blocks, gap.given);
        let kind = match why.get(..7) {
            Some("a block") => "a block of ours was slow",
            Some("the dev") => "the device asked late",
            _ => "nothing on our side",
        };
        *causes.entry(kind).or_default() += 1;
        if count <= 100 {
            println!(
                "gap at {:.3} s ({:.3} s of what was given): {} frames {}, {} lost; {why}",
                seconds(gap.recorded),
                seconds(gap.given),
                gap.strange,
                if gap.is_silent { "of silence" } else { "of something else" },
                gap.lost
            );
        }
    }
    let lost: usize = gaps.iter().map(|gap| gap.lost).sum();
    let strange: usize = gaps.iter().map(|gap| gap.strange).sum();
    println!("{count} gaps: {strange} frames too many, {lost} lost");
    let mut causes: Vec<_> = causes.into_iter().collect();
    causes.sort_unstable();
    causes.iter().for_each(|(why, count)| println!("  {count} where {why}"));
    let mut between: Vec<f64> = blocks.windows(2).map(|pair| pair[1].asked_s - pair[0].asked_s).collect();
    between.sort_by(f64::total_cmp);
    let part = |sorted: &[f64], part: f64| {
        let at = ((sorted.len() as f64 - 1.0) * part).max(0.0) as usize;
        1000.0 * sorted.get(at).copied().unwrap_or(0.0)
    };
    println!(
        "between blocks: median {:.2} ms, one in a hundred {:.2}, one in ten thousand {:.2}, most {:.2}",
        part(&between, 0.5),
        part(&between, 0.99),
        part(&between, 0.9999),
        part(&between, 1.0)
    );
    let mut took: Vec<f64> = blocks.iter().map(|block| block.took_s).collect();
    took.sort_by(f64::total_cmp);
    println!(
        "a block took: median {:.2} ms, one in a hundred {:.2}, most {:.2}",
        part(&took, 0.5),
        part(&took, 0.99),
        part(&took, 1.0)
    );
    let mut sizes: HashMap<usize, usize> = HashMap::new();
    blocks.iter().for_each(|block| *sizes.entry(block.frames).or_default() += 1);
    let mut sizes: Vec<_> = sizes.into_iter().collect();
    sizes.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    println!("frames of a block, and how often: {:?}", &sizes[..sizes.len().min(8)]);
    Ok(())
}
