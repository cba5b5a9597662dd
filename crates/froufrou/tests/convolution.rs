//! What filters and convolves while a sound runs takes no memory.

mod allocation;

use allocation::{most_held, turn};
use froufrou::random::Random;
use froufrou::space::bands::BandFilters;
use froufrou::space::convolution::Convolver;
use froufrou::space::room::{Plane, Reflections};

#[test]
fn nothing_is_allocated_while_a_sound_runs() {
    let _turn = turn();
    let random = Random::new(1, 1);
    let noise: Vec<f32> = (0..40_000).map(|i| random.uniform(i) as f32 - 0.5).collect();
    let mut convolver = Convolver::new(&[&noise, &noise[..300]]).unwrap();
    let mut out = vec![0.0; 2 * 1000];
    let filters = BandFilters::new(48_000.0).unwrap();
    let mut taps = vec![0.0; filters.taps()];
    let planes = [
        Plane::new([0.0; 3], [0.0, 1.0, 0.0], &[0.1; 8]).unwrap(),
        Plane::new([0.0, 3.0, 0.0], [0.0, -1.0, 0.0], &[0.1; 8]).unwrap(),
    ];
    let reflections = Reflections::new(2, 4).unwrap();
    let mut images = Vec::with_capacity(reflections.len());
    let (worked, held) = most_held(|| {
        convolver.start(12_345);
        convolver.skip(&noise[..5000]).unwrap();
        for input in noise.chunks_exact(1000) {
            convolver.process(input, &mut out).unwrap();
        }
        filters.fill(&[0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2], &mut taps);
        reflections.images(&planes, &mut images).unwrap();
        out[0].is_finite() && taps[0].is_finite() && images.len() == 9
    });
    assert!(worked);
    assert_eq!(held, 0, "bytes");
    // And counting counts.
    assert!(most_held(|| vec![0u8; 100].len()).1 >= 100);
}
