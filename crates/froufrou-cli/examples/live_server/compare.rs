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
    /// By the system's clock.
    asked_us: u64,
    /// Since the first of them.
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

/// The whole numbers of a table, line by line.
fn numbers<const COLUMNS: usize>(path: &Path) -> Result<Vec<[u64; COLUMNS]>> {
    let text = std::fs::read_to_string(path).map_err(|fault| Error::io("read", path, fault))?;
    let line = |line: &str| {
        let mut cells = line.split(',').map(|cell| cell.parse::<u64>().unwrap_or(0));
        std::array::from_fn(|_| cells.next().unwrap_or(0))
    };
    Ok(text.lines().skip(1).map(line).collect())
}

fn blocks(path: &Path) -> Result<Vec<Block>> {
    let numbers: Vec<[u64; 3]> = numbers(path)?;
    let begun_us = numbers.first().map_or(0, |[asked_us, ..]| *asked_us);
    let mut from = 0;
    let mut block = |[asked_us, took_us, frames]: [u64; 3]| {
        let frames = frames as usize;
        from += frames;
        let seconds = |us: u64| us as f64 * 1e-6;
        let (asked_s, took_s) = (seconds(asked_us - begun_us), seconds(took_us));
        Block { asked_us, asked_s, took_s, from: from - frames, frames }
    };
    Ok(numbers.into_iter().map(&mut block).collect())
}

/// When each core stood still, in microseconds, in order of time; none where nobody watched.
struct Cores(Vec<Vec<[u64; 2]>>);

impl Cores {
    fn open(folder: &Path) -> Result<Self> {
        let mut cores = Vec::new();
        while let path = folder.join(format!("watch-{}.csv", cores.len()))
            && path.exists()
        {
            cores.push(numbers(&path)?);
        }
        Ok(Self(cores))
    }

    /// For how long one of them stood still between two times, at most, in seconds.
    fn still_s(&self, [from_us, to_us]: [u64; 2]) -> f64 {
        let still = |core: &Vec<[u64; 2]>| -> u64 {
            let begin = core.partition_point(|[_, to]| *to <= from_us);
            let within = core[begin..].iter().take_while(|[from, _]| *from < to_us);
            within.map(|[from, to]| to.min(&to_us) - from.max(&from_us)).sum()
        };
        self.0.iter().map(still).max().unwrap_or(0) as f64 * 1e-6
    }
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

impl Block {
    /// For how long it sounds.
    fn sounds_s(&self) -> f64 {
        self.frames as f64 / f64::from(RATE_HZ)
    }

    fn is_late(&self) -> bool {
        self.took_s > self.sounds_s()
    }

    /// From when to when it was made.
    fn span_us(&self) -> [u64; 2] {
        [self.asked_us, self.asked_us + (self.took_s * 1e6) as u64]
    }
}

/// Why there is a gap: in a few words, and all that is known.
fn cause(blocks: &[Block], cores: &Cores, given: usize) -> (&'static str, String) {
    let at = blocks.partition_point(|block| block.from + block.frames <= given);
    let near = &blocks[at.saturating_sub(8)..(at + 8).min(blocks.len())];
    let stood = |still_s: f64| format!("a core stood still for {:.2} ms of that", 1000.0 * still_s);
    let slow = near.iter().max_by(|a, b| (a.took_s / a.sounds_s()).total_cmp(&(b.took_s / b.sounds_s())));
    if let Some(block) = slow.filter(|block| block.is_late()) {
        let still_s = cores.still_s(block.span_us());
        let kind = match block.took_s - still_s > block.sounds_s() {
            true => "a block of ours was slow",
            false => "a block of ours was slow because the machine stood still",
        };
        let took_ms = 1000.0 * block.took_s;
        return (
            kind,
            format!("a block of {} frames took {took_ms:.2} ms; {}", block.frames, stood(still_s)),
        );
    }
    // It is asked for as much as it has played.
    let late_s = |pair: &[Block]| pair[1].asked_s - pair[0].asked_s - pair[1].sounds_s();
    let late = near.windows(2).max_by(|a, b| late_s(a).total_cmp(&late_s(b)));
    if let Some(pair) = late.filter(|pair| late_s(pair) > 0.001) {
        let still_s = cores.still_s([pair[0].asked_us, pair[1].asked_us]);
        let kind = match late_s(pair) - still_s > 0.001 {
            true => "the device asked late",
            false => "the device asked late because the machine stood still",
        };
        let late_ms = 1000.0 * late_s(pair);
        return (
            kind,
            format!("the device asked {late_ms:.2} ms later than the blocks sound; {}", stood(still_s)),
        );
    }
    let span_us =
        near.first().zip(near.last()).map_or([0; 2], |(first, last)| [first.asked_us, last.asked_us]);
    let still_s = cores.still_s(span_us);
    let kind = match still_s > 0.001 {
        true => "nothing on our side, and the machine stood still",
        false => "nothing on our side",
    };
    (kind, format!("nothing on our side: the server; {}", stood(still_s)))
}

/// Tells how a recording differs from what was given.
///
/// # Errors
/// Files that cannot be read, or a recording of something else.
pub fn compare(folder: &Path) -> Result<()> {
    let (recorded, given) = (sound(&folder.join("recorded.f32"))?, sound(&folder.join("given.f32"))?);
    let blocks = blocks(&folder.join("blocks.csv"))?;
    let cores = Cores::open(folder)?;
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
        let (kind, why) = cause(&blocks, &cores, gap.given);
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
    let late: Vec<&Block> = blocks.iter().filter(|block| block.is_late()).collect();
    let ours =
        late.iter().filter(|block| block.took_s - cores.still_s(block.span_us()) > block.sounds_s()).count();
    println!(
        "{} blocks took longer than they sound, {ours} of them even without the time that a core stood still",
        late.len()
    );
    for block in late.iter().take(40) {
        let still_ms = 1000.0 * cores.still_s(block.span_us());
        let (at_s, took_ms, sounds_ms) = (block.asked_s, 1000.0 * block.took_s, 1000.0 * block.sounds_s());
        println!(
            "  at {at_s:.3} s: {took_ms:.2} ms for {sounds_ms:.2} ms of sound, a core stood still for {still_ms:.2} ms of it"
        );
    }
    for (number, core) in cores.0.iter().enumerate() {
        let still_us = core.iter().map(|[from, to]| to - from);
        let (all_ms, most_ms) =
            (still_us.clone().sum::<u64>() as f64 / 1e3, still_us.max().unwrap_or(0) as f64 / 1e3);
        println!(
            "core {number} stood still {} times, {all_ms:.1} ms in all, {most_ms:.2} ms at once",
            core.len()
        );
    }
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
