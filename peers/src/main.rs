//! What a voice costs beside other engines: see `README.md`.
//!
//! ```text
//! cargo run --release --manifest-path peers/Cargo.toml -- --help
//! ```

#![deny(unsafe_code)]

mod checks;
mod drive;
#[allow(unsafe_code)]
mod dynamic;
mod measure;
mod options;
mod peers;
mod plain;
#[cfg(test)]
mod tests;
mod world;

use std::process::ExitCode;

use measure::Cost;
use options::Options;
use peers::{Kind, Peer, Result};

fn main() -> ExitCode {
    match run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether all that was listened to is as it should be.
fn run() -> Result<bool> {
    let Some(options) = options::read(std::env::args().skip(1))? else {
        println!("{}", options::HELP);
        return Ok(true);
    };
    if options.plain {
        return plain::compare(&options).map(|()| true);
    }
    let (mut peers, absent) = peers::all(options.head.as_deref());
    for why in absent {
        println!("not compared: {why}");
    }
    let names: Vec<String> = peers.iter().map(|peer| peer.name()).collect();
    if let Some(unknown) = options.only.iter().find(|name| !names.contains(name)) {
        return Err(format!("{unknown} is not here; there are {}", names.join(", ")));
    }
    peers.retain(|peer| options.only.is_empty() || options.only.contains(&peer.name()));
    println!();
    for peer in &peers {
        println!("- {}: {}", peer.name(), peer.details());
    }
    println!();
    if options.check { check(&peers, &options) } else { compare(&peers, &options).map(|()| true) }
}

fn check(peers: &[Box<dyn Peer>], options: &Options) -> Result<bool> {
    println!(
        "| | voices heard | near ear louder, right / left | near ear earlier | louder at 300–800 Hz / 5–10 kHz | Doppler | delay |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    let voices = options.voices.iter().copied().max().unwrap_or(1);
    let mut wrong = Vec::new();
    for peer in peers {
        let name = peer.name();
        let heard =
            checks::listen(&**peer, voices, options.plan.block).map_err(|e| format!("{name}: {e}"))?;
        let checks::Heard { voices, sides_db, earlier_us, louder_db, doppler_hz, delay_ms } = heard;
        println!(
            "| {name} | {} of {} | {:.1} / {:.1} dB | {earlier_us:.0} µs | {:.1} / {:.1} dB | {doppler_hz:+.1} Hz | {delay_ms:.1} ms |",
            voices[0], voices[1], sides_db[0], sides_db[1], louder_db[0], louder_db[1],
        );
        wrong.extend(heard.faults(peer.kind()).into_iter().map(|fault| format!("{name}: {fault}")));
    }
    println!();
    for fault in &wrong {
        println!("WRONG: {fault}");
    }
    Ok(wrong.is_empty())
}

fn compare(peers: &[Box<dyn Peer>], options: &Options) -> Result<()> {
    let mut costs: Vec<Vec<Cost>> = vec![Vec::new(); peers.len()];
    for &voices in &options.voices {
        for (row, cost) in costs.iter_mut().zip(measure::measure(peers, voices, options.plan)?) {
            row.push(cost);
        }
    }
    let numbers: Vec<String> = options.voices.iter().map(|n| format!("{n} voices")).collect();
    for (kind, title, beside) in [
        (Kind::Binaural, "binaural", "froufrou-head"),
        (Kind::Stereo, "stereo, without a head", "froufrou-stereo"),
    ] {
        if !peers.iter().any(|peer| peer.kind() == kind) {
            continue;
        }
        let reference = peers.iter().position(|peer| peer.name() == beside);
        println!("| ns per voice-sample: {title} | {} |", numbers.join(" | "));
        println!("| --- |{}", " --- |".repeat(numbers.len()));
        for (peer, row) in peers.iter().zip(&costs).filter(|(peer, _)| peer.kind() == kind) {
            let cell = |(column, cost): (usize, &Cost)| {
                let ratio = reference.map(|of| cost.median_ns / costs[of][column].median_ns);
                let ratio = ratio.map_or(String::new(), |ratio| format!(" ({ratio:.2})"));
                format!("{:.1}{ratio}", cost.median_ns)
            };
            let cells: Vec<String> = row.iter().enumerate().map(cell).collect();
            println!("| {} | {} |", peer.name(), cells.join(" | "));
        }
        println!();
        if reference.is_some() {
            println!("In brackets: beside {beside}.\n");
        }
    }
    let spread = |column: usize| {
        let of = |row: &Vec<Cost>| (row[column].most_ns - row[column].least_ns) / row[column].median_ns;
        format!("{:.0} %", 100.0 * costs.iter().map(of).fold(0.0, f64::max))
    };
    let spreads: Vec<String> = (0..numbers.len()).map(spread).collect();
    println!(
        "Medians of repeats that took turns. From the least to the most these differ by up to so much of the"
    );
    println!("median, in the order of the columns: {}.", spreads.join(", "));
    Ok(())
}
