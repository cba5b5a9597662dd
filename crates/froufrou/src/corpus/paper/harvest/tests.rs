use super::*;
use crate::random::Random;

const RATE_HZ: u32 = 44_100;

/// The model's own clips at known times over the noise of a room: times, l_r and l_c, and the sound.
fn crumple(paper: &Paper, seed: u64) -> (Vec<(f64, f64, f64)>, Vec<f32>) {
    let rate_hz = f64::from(RATE_HZ);
    let random = Random::new(seed, 0);
    let mut pieces = Vec::new();
    let mut sound: Vec<f32> = Vec::new();
    let mut at_s = 0.3;
    for n in 0..40u64 {
        let is_clac = random.uniform(4 * n) < 0.5;
        let pick = |index: u64| LENGTHS_M[random.below(4 * n + index, LENGTHS_M.len())];
        let (ruling_m, border_m) = if is_clac { (0.0, 0.0) } else { (pick(1), pick(2)) };
        let clip = if is_clac {
            paper.clac(n % 9, rate_hz)
        } else {
            // Others of the same size than those that it is held against.
            paper.flap(&Shape::rectangle(ruling_m, border_m), 1000 + n, rate_hz)
        };
        let first = (at_s * rate_hz) as usize;
        sound.resize(sound.len().max(first + clip.len()), 0.0);
        sound[first..].iter_mut().zip(&clip).for_each(|(sum, sample)| *sum += sample);
        pieces.push((at_s, ruling_m, border_m));
        at_s += clip.len() as f64 / rate_hz + 0.08 + 0.2 * random.uniform(4 * n + 3);
    }
    sound.resize((at_s * rate_hz) as usize, 0.0);
    let noise = Random::new(seed, 1);
    (0u64..).zip(sound.iter_mut()).for_each(|(n, sample)| *sample += 2e-4 * noise.normal(n) as f32);
    (pieces, sound)
}

#[test]
fn known_pieces_are_found_and_told_apart() {
    for (paper, seed) in Paper::names().zip(0..).map(|(name, n)| (Paper::named(&name).unwrap().unwrap(), n)) {
        let (pieces, sound) = crumple(&paper, seed);
        let found = harvest(&sound, RATE_HZ, &paper, None).unwrap();
        assert!(found.windows(2).all(|pair| pair[0].range.end <= pair[1].range.start));
        let (mut right, mut class, mut octaves, mut flaps) = (0, 0, 0.0, 0);
        for (at_s, ruling_m, border_m) in &pieces {
            let near = |piece: &&Piece| (piece.range.start as f64 / f64::from(RATE_HZ) - at_s).abs() < 0.03;
            let Some(piece) = found.iter().find(near) else { continue };
            right += 1;
            class += usize::from(piece.is_clac() == (*border_m == 0.0));
            if !piece.is_clac() && *border_m > 0.0 {
                let area = |ruling_m: f64, border_m: f64| (ruling_m * border_m).sqrt();
                octaves += (area(piece.ruling_m, piece.border_m) / area(*ruling_m, *border_m)).log2().abs();
                flaps += 1;
            }
        }
        let octaves: f64 = octaves / f64::from(flaps);
        println!(
            "{}: {} found, {right} right, {class} class, {octaves:.2} octaves",
            paper.name(),
            found.len()
        );
        assert!(right >= 38 && class >= 37, "{right} {class} of 40");
        // Beside them a few faint buckles of flaps are taken for pieces of their own.
        assert!(found.len() <= 48, "{}", found.len());
        // The size of a flap, as the root of its area, is guessed to within half an octave or so.
        assert!(octaves < 0.5, "{octaves}");
    }
}

#[test]
fn a_recording_gives_plausible_pieces() {
    let data = std::env::var_os("FROUFROU_DATA").map_or_else(
        || std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        std::path::PathBuf::from,
    );
    // A wrapper that is crumpled, and pages that are turned: many short ones, and few long ones.
    for (name, counts, are_clacs) in [
        ("Packaging_And_Wrappers_Wr_021", 20..200, true),
        ("Paper_Sound_Effects_Paper_Handling_And_Turning_Sequence", 4..40, false),
    ] {
        let path = data.join(format!("audio/sonniss_gdc_bundle3/{name}.ogg"));
        if !path.exists() {
            println!("skipped: {} is not there", path.display());
            continue;
        }
        let recording = crate::corpus::recording::Recording::open(&path).unwrap();
        let found = harvest(&recording.mono(), recording.rate_hz, &Paper::printer(), None).unwrap();
        let clacs = found.iter().filter(|piece| piece.is_clac()).count();
        println!("{name}: {clacs} clacs, {} flaps in {:.1} s", found.len() - clacs, recording.duration_s());
        assert!(counts.contains(&found.len()), "{}", found.len());
        assert_eq!(6 * clacs > found.len(), are_clacs, "{clacs} of {}", found.len());
    }
}

#[test]
fn silence_has_no_pieces_and_bad_settings_are_told() {
    let paper = Paper::printer();
    assert!(harvest(&[0.0; 9000], RATE_HZ, &paper, None).unwrap().is_empty());
    assert!(harvest(&[], RATE_HZ, &paper, None).is_err());
    assert!(harvest(&[0.5; 100], RATE_HZ, &paper, Some(0.0)).is_err());
    assert!(harvest(&[0.5; 100], 10, &paper, None).is_err());
    // A short and a slow recording.
    harvest(&[0.5; 7], RATE_HZ, &paper, None).unwrap();
    let (_, sound) = crumple(&paper, 4);
    let slow = crate::corpus::dictionary::prepare::at_rate(sound[..88_200].to_vec(), RATE_HZ, 8000).unwrap();
    assert!(!harvest(&slow, 8000, &paper, None).unwrap().is_empty());
}
