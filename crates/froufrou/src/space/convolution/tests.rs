use super::*;
use crate::random::Random;

fn noise(seed: u64, count: usize) -> Vec<f32> {
    let random = Random::new(seed, 3);
    (0..count as u64).map(|i| 2.0 * random.uniform(i) as f32 - 1.0).collect()
}

/// Some responses: of every kind of part, with a silence before it or within it.
fn responses() -> Vec<Vec<f32>> {
    let mut late = noise(2, 20_000);
    late[..3000].fill(0.0);
    late[9000..17_000].fill(0.0);
    vec![noise(1, 30_000), late, noise(3, 77), Vec::new()]
}

fn convolver(responses: &[Vec<f32>]) -> Convolver {
    Convolver::new(&responses.iter().map(Vec::as_slice).collect::<Vec<_>>()).unwrap()
}

/// All outputs, each response apart, of an input that is fed in some lengths.
fn fed(convolver: &mut Convolver, input: &[f32], responses: usize, lengths: &[usize]) -> Vec<Vec<f32>> {
    let mut all = vec![Vec::new(); responses];
    let mut rest = input;
    for length in lengths.iter().cycle() {
        if rest.is_empty() {
            break;
        }
        let (now, later) = rest.split_at((*length).min(rest.len()));
        let mut out = vec![f32::NAN; responses * now.len()];
        convolver.process(now, &mut out).unwrap();
        if !now.is_empty() {
            all.iter_mut().zip(out.chunks(now.len())).for_each(|(all, out)| all.extend(out));
        }
        rest = later;
    }
    all
}

#[test]
fn the_output_is_the_convolution() {
    let responses = responses();
    let input = noise(9, 60_000);
    let found = fed(&mut convolver(&responses), &input, 4, &[1000]);
    for (response, found) in responses.iter().zip(&found) {
        let peak = found.iter().fold(0.0f32, |m, v| m.max(v.abs()));
        assert_eq!(found.len(), input.len());
        // Frames here and there, each added up in double precision.
        for frame in (0..input.len()).step_by(97).chain(0..300) {
            let expected: f64 = response
                .iter()
                .take(frame + 1)
                .enumerate()
                .map(|(tap, h)| f64::from(*h) * f64::from(input[frame - tap]))
                .sum();
            let error = (f64::from(found[frame]) - expected).abs();
            assert!(error <= 3e-7 * f64::from(peak), "{frame}: {error} of {peak}");
        }
    }
    assert!(found[3].iter().all(|v| *v == 0.0), "no response");
}

#[test]
fn lengths_of_feeding_change_nothing() {
    let responses = responses();
    let input = noise(9, 50_000);
    let expected = fed(&mut convolver(&responses), &input, 4, &[50_000]);
    for lengths in [&[1, 0, 2, 127, 128, 129][..], &[441], &[8192], &[7, 20_000]] {
        assert_eq!(fed(&mut convolver(&responses), &input, 4, lengths), expected, "{lengths:?}");
    }
}

#[test]
fn any_range_alone_is_that_part_of_the_whole() {
    let responses = responses();
    let mut convolver = convolver(&responses);
    let input = noise(9, 160_000);
    convolver.start(-5000);
    let whole = fed(&mut convolver, &input, 4, &[3000]);
    for frame in [60_000i64, 65_536, 73_727, 99_999, 131_071] {
        let from = convolver.fed_from(frame);
        // What matters is the length of the response, and the grid.
        assert!(from <= frame - 30_000 && from >= frame - 30_000 - 3 * COARSEST as i64, "{frame} {from}");
        convolver.start(from);
        assert_eq!(convolver.frame(), from);
        let place = |frame: i64| (frame + 5000) as usize;
        convolver.skip(&input[place(from)..place(from) + 100]).unwrap();
        convolver.skip(&input[place(from) + 100..place(frame)]).unwrap();
        let found = fed(&mut convolver, &input[place(frame)..place(frame) + 20_000], 4, &[555]);
        for (found, whole) in found.iter().zip(&whole) {
            assert_eq!(found[..], whole[place(frame)..place(frame) + 20_000], "{frame}");
        }
    }
    // Frames before time 0.
    convolver.start(-90_000);
    let early = fed(&mut convolver, &input[..100_000], 4, &[100_000]);
    convolver.start(-90_000 + 4 * COARSEST as i64);
    let late = fed(&mut convolver, &input[..100_000], 4, &[100_000]);
    assert_eq!(early, late, "the grid moves along");
}

#[test]
fn silence_comes_out_of_silence() {
    let responses = responses();
    let mut convolver = convolver(&responses);
    let mut input = noise(9, 200_000);
    input[10_000..150_000].fill(0.0);
    let found = fed(&mut convolver, &input, 4, &[4096]);
    for found in &found {
        // The last of the first stretch is due 30 000 frames later, to which its part is added.
        assert!(found[10_000 + 30_000 + 2 * COARSEST..150_000].iter().all(|v| *v == 0.0));
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    assert!(Convolver::new(&[&[1.0, f32::NAN]]).is_err());
    let error = Convolver::new(&[&[0.0], &[1.0, 2.0, f32::INFINITY]]).err().unwrap().to_string();
    assert_eq!(error, "tap 2 of response 1 is not a finite number");
    let mut two = Convolver::new(&[&[1.0], &[2.0]]).unwrap();
    assert!(two.process(&[1.0, 2.0], &mut [0.0; 3]).is_err());
    let mut out = [0.0; 4];
    two.process(&[1.0, 2.0], &mut out).unwrap();
    assert_eq!(out, [1.0, 2.0, 2.0, 4.0]);
    let mut none = Convolver::new(&[]).unwrap();
    none.process(&[1.0, 2.0], &mut []).unwrap();
    assert_eq!(none.frame(), 2);
    // What is not a number stays so, and nothing falls over.
    let mut long = Convolver::new(&[&noise(1, 3000)]).unwrap();
    let mut out = vec![0.0; 3000];
    long.process(&[f32::NAN; 3000], &mut out).unwrap();
    assert!(out.iter().any(|v| v.is_nan()));
}

#[test]
fn another_sound_has_a_way_of_its_own() {
    let responses = responses();
    let (mut one, expected) = (convolver(&responses), noise(9, 50_000));
    let expected = fed(&mut one, &expected, 4, &[1000]);
    // What is under way in the first is not in the second, and neither disturbs the other.
    let mut other = one.another();
    assert!(other.is_silent() && !one.is_silent());
    assert_eq!((other.frame(), other.responses(), other.taps()), (0, 4, 30_000));
    assert_eq!(fed(&mut other, &noise(9, 50_000), 4, &[777]), expected);
    assert!(Arc::ptr_eq(&one.stages[0].parts_of, &other.stages[0].parts_of));
    // It falls silent once all has passed.
    other.skip(&vec![0.0; 30_000 + 2 * COARSEST]).unwrap();
    assert!(!other.is_silent(), "the last part still sounds");
    fed(&mut other, &vec![0.0; 3 * COARSEST], 4, &[1000]);
    assert!(other.is_silent());
    assert!(fed(&mut other, &[0.0; 300], 4, &[300]).iter().flatten().all(|out| *out == 0.0));
}
