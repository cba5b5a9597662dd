//! Cuts recordings into grains and correlates recordings with them, for `oracles/patterns_compare.py`.
//!
//! ```text
//! grain_patterns RATE FOLDER RECORDINGS GRAINS FILE...
//! ```
//!
//! The files are mono sound as 32-bit floats without a header. Grains are cut from all of them, as from impulsive
//! recordings, and evenly thinned to a number of them; the first files are matched. Into the folder go `grains.f32`
//! (their samples), `grains.tsv` (their lengths) and `peaks.tsv` (recording, grain, start, correlation). What it took is printed.

use std::io::Write;
use std::path::Path;
use std::time::Instant;

use froufrou::corpus::grains::patterns::{Matcher, Matching};
use froufrou::corpus::grains::{Extraction, Grain, GrainKind};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [rate, folder, recordings, count, files @ ..] = arguments.as_slice() else {
        return Err("expected RATE FOLDER RECORDINGS GRAINS FILE...".into());
    };
    let (rate_hz, folder): (u32, _) = (rate.parse()?, Path::new(folder));
    let (recordings, count): (usize, usize) = (recordings.parse()?, count.parse()?);
    let read = |file: &String| -> std::io::Result<Vec<f32>> {
        let bytes = std::fs::read(file)?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect())
    };
    let sounds = files.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let started = Instant::now();
    let extraction = Extraction::default();
    let mut grains: Vec<Grain> = Vec::new();
    for sound in &sounds {
        grains.extend(extraction.extract(&[(sound, GrainKind::Impulsive)], rate_hz)?);
    }
    println!("extracted {} grains in {:.3} s", grains.len(), started.elapsed().as_secs_f64());
    let kept = count.min(grains.len());
    let thinned: Vec<&[f32]> = (0..kept).map(|i| &*grains[i * grains.len() / kept].samples).collect();
    let mut lengths = std::io::BufWriter::new(std::fs::File::create(folder.join("grains.tsv"))?);
    let mut samples = std::io::BufWriter::new(std::fs::File::create(folder.join("grains.f32"))?);
    for grain in &thinned {
        writeln!(lengths, "{}", grain.len())?;
        for sample in *grain {
            samples.write_all(&sample.to_le_bytes())?;
        }
    }
    let mut peaks = std::io::BufWriter::new(std::fs::File::create(folder.join("peaks.tsv"))?);
    let correlations: usize = thinned
        .iter()
        .flat_map(|g| sounds[..recordings].iter().map(|s| (s.len() + 1).saturating_sub(g.len())))
        .sum();
    let started = Instant::now();
    let matcher = Matcher::new(Matching::default(), thinned, rate_hz)?;
    let mut found = 0;
    for (number, sound) in sounds[..recordings].iter().enumerate() {
        for peak in matcher.pattern(sound)? {
            writeln!(peaks, "{number}\t{}\t{}\t{:.9}", peak.grain, peak.start, peak.correlation)?;
            found += 1;
        }
    }
    let seconds = started.elapsed().as_secs_f64();
    println!(
        "matched {recordings} recordings with {kept} grains: {found} peaks of {correlations} correlations in {seconds:.3} s"
    );
    Ok(())
}
