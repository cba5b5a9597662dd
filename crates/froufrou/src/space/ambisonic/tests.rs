use super::*;
use crate::random::Random;
use crate::space::direction::{from_angles_deg, to_angles_deg};
use crate::space::layout::Layout;
use crate::space::sphere::{cross, even_directions};

fn speakers(directions: impl IntoIterator<Item = [f64; 3]>) -> Vec<Loudspeaker> {
    let all = directions.into_iter().enumerate();
    all.map(|(i, direction)| {
        let (azimuth, elevation) = to_angles_deg(direction);
        Loudspeaker::new(format!("s{i}"), azimuth, elevation)
    })
    .collect()
}

fn signs(v: [f64; 3]) -> Vec<[f64; 3]> {
    let mut all: Vec<[f64; 3]> = Vec::new();
    for i in 0..8 {
        let one = [0, 1, 2].map(|bit| if i >> bit & 1 == 0 { v[bit] } else { 0.0 - v[bit] });
        if !all.contains(&one) {
            all.push(one);
        }
    }
    all
}

fn turns(v: [f64; 3]) -> impl Iterator<Item = [f64; 3]> {
    (0..3).flat_map(move |shift| signs([v[shift], v[(shift + 1) % 3], v[(shift + 2) % 3]]))
}

fn icosahedron() -> Vec<Loudspeaker> {
    speakers(turns([0.0, 1.0, 0.5 + 1.25f64.sqrt()]))
}

fn dodecahedron() -> Vec<Loudspeaker> {
    let golden = 0.5 + 1.25f64.sqrt();
    speakers(signs([1.0; 3]).into_iter().chain(turns([0.0, 1.0 / golden, golden])))
}

fn sources(count: u64) -> impl Iterator<Item = [f64; 3]> {
    let random = Random::new(4, 4);
    (0..count).map(move |i| {
        let elevation = (2.0 * random.uniform(2 * i) - 1.0).asin().to_degrees();
        from_angles_deg(360.0 * random.uniform(2 * i + 1), elevation)
    })
}

fn play(decoder: &Decoder, order: usize, source: [f64; 3]) -> Vec<f64> {
    let mut signals = vec![0.0; channels(order)];
    encode(source, &mut signals);
    let mut gains = vec![0.0; decoder.rows().len()];
    decoder.decode(&signals, &mut gains);
    gains
}

/// Angle to the source in degrees and length of Σ g^power l / Σ g^power.
fn vector(speakers: &[Loudspeaker], gains: &[f64], power: i32, source: [f64; 3]) -> (f64, f64) {
    let total: f64 = gains.iter().map(|g| g.powi(power)).sum();
    let sum =
        |k: usize| speakers.iter().zip(gains).map(|(s, g)| g.powi(power) * s.direction()[k]).sum::<f64>();
    let v = [0, 1, 2].map(|k| sum(k) / total);
    let across = cross(v, source);
    (dot(across, across).sqrt().atan2(dot(v, source)).to_degrees(), dot(v, v).sqrt())
}

/// The lengths of the velocity and energy vectors, from the integrals over the sphere: a source is heard from the
/// angle with cosine μ as Σ (2n + 1) aₙ Pₙ(μ).
fn theory(order: usize, weights: Weights) -> (f64, f64) {
    let a = weights.of(order);
    let heard = |m: f64| {
        let p = [1.0, m, 0.5 * (3.0 * m * m - 1.0), 0.5 * m * (5.0 * m * m - 3.0)];
        (0..4).map(|n| (2 * n + 1) as f64 * a[n] * p[n]).sum::<f64>()
    };
    let mean = |f: &dyn Fn(f64) -> f64| gauss_legendre(8).map(|(m, w)| w * f(m)).sum::<f64>();
    let velocity = mean(&|m| m * heard(m)) / mean(&heard);
    (velocity, mean(&|m| m * heard(m).powi(2)) / mean(&|m| heard(m).powi(2)))
}

const ALL: [Weights; 3] = [Weights::Basic, Weights::MaxRe, Weights::InPhase];

#[test]
fn weights_have_the_vectors_of_the_literature() {
    for order in 1..=3 {
        let n = order as f64;
        let r = [0.577_350_269_189_625_8, 0.774_596_669_241_483_4, 0.861_136_311_594_052_6][order - 1];
        let expected = [(1.0, n / (n + 1.0)), (r, r), (n / (n + 2.0), n / (n + 1.0))];
        for (weights, (velocity, energy)) in ALL.into_iter().zip(expected) {
            let found = theory(order, weights);
            assert!(
                (found.0 - velocity).abs() < 1e-12 && (found.1 - energy).abs() < 1e-12,
                "{weights:?} {order}"
            );
            assert_eq!(weights.of(order)[0], 1.0);
            assert!(weights.of(order)[order + 1..].iter().all(|&a| a == 0.0));
        }
    }
    assert_eq!(Weights::MaxRe.of(4), [0.0; 4]);
}

#[test]
fn the_design_is_one_of_degree_seven() {
    let corners: Vec<[f64; 3]> = design().collect();
    assert_eq!(corners.len(), 24);
    // Means of monomials over the sphere: products of double factorials, 0 for odd powers.
    let odd = |n: u32| (1..=n).step_by(2).map(f64::from).product::<f64>();
    for powers in (0..512).map(|i| [i % 8, i / 8 % 8, i / 64]).filter(|p| p.iter().sum::<u32>() <= 7) {
        let power = |c: &[f64; 3]| (0..3).map(|k| c[k].powi(powers[k] as i32)).product::<f64>();
        let found = corners.iter().map(power).sum::<f64>() / 24.0;
        let even = powers.iter().all(|p| p % 2 == 0);
        let product: f64 = powers.iter().map(|&p| odd(p.saturating_sub(1))).product();
        let expected = if even { product / odd(powers.iter().sum::<u32>() + 1) } else { 0.0 };
        assert!((found - expected).abs() < 1e-14, "{powers:?} {found} {expected}");
    }
}

#[test]
fn regular_layouts_play_sources_as_theory_says() {
    // Layouts and the order up to which their corners are a design of degree 2 N + 1.
    for (layout, most) in [(icosahedron(), 2), (dodecahedron(), 2), (speakers(design()), 3)] {
        for order in 1..=most {
            for weights in ALL {
                let decoder = Decoder::mode_matching(&layout, order, weights, Level::Energy).unwrap();
                let (velocity, energy) = theory(order, weights);
                for source in sources(200) {
                    let gains = play(&decoder, order, source);
                    for (power, expected) in [(1, velocity), (2, energy)] {
                        let (off_deg, length) = vector(&layout, &gains, power, source);
                        assert!(off_deg < 1e-5, "{weights:?} {order} {power}: {off_deg}");
                        assert!((20.0 * (length / expected).log10()).abs() < 1e-7, "{length} {expected}");
                    }
                    assert!((gains.iter().map(|g| g * g).sum::<f64>() - 1.0).abs() < 1e-9);
                }
                let decoder = Decoder::mode_matching(&layout, order, weights, Level::Pressure).unwrap();
                for source in sources(10) {
                    assert!((play(&decoder, order, source).iter().sum::<f64>() - 1.0).abs() < 1e-9);
                }
            }
        }
    }
    // The corners of a dodecahedron are enough to match the modes of order 3: the velocity vector is whole.
    let layout = dodecahedron();
    assert_eq!(layout.len(), 20);
    let decoder = Decoder::mode_matching(&layout, 3, Weights::Basic, Level::Pressure).unwrap();
    for source in sources(200) {
        let (off_deg, length) = vector(&layout, &play(&decoder, 3, source), 1, source);
        assert!(off_deg < 1e-5 && (length - 1.0).abs() < 1e-9);
    }
}

#[test]
fn in_phase_decoding_is_never_out_of_phase() {
    let layout = speakers(design());
    let decoder = Decoder::mode_matching(&layout, 3, Weights::InPhase, Level::Energy).unwrap();
    for source in sources(300) {
        assert!(play(&decoder, 3, source).iter().all(|&g| g > -1e-12));
    }
}

#[test]
fn turning_is_encoding_elsewhere() {
    let random = Random::new(1, 1);
    for (i, axis) in sources(40).enumerate() {
        // Rodrigues.
        let (sin, cos) = (std::f64::consts::TAU * random.uniform(i as u64)).sin_cos();
        let turn = |v: [f64; 3]| -> [f64; 3] {
            let across = cross(axis, v);
            std::array::from_fn(|k| cos * v[k] + sin * across[k] + (1.0 - cos) * dot(axis, v) * axis[k])
        };
        let columns = [turn([1.0, 0.0, 0.0]), turn([0.0, 1.0, 0.0]), turn([0.0, 0.0, 1.0])];
        let rotation = Rotation::new([0, 1, 2].map(|row| columns.map(|column| column[row])));
        for source in sources(20) {
            for order in 0..=3 {
                let (mut found, mut expected) = (vec![0.0; channels(order)], vec![0.0; channels(order)]);
                encode(source, &mut found);
                rotation.apply(&mut found);
                encode(turn(source), &mut expected);
                assert!(
                    found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12),
                    "{found:?} {expected:?}"
                );
            }
        }
    }
}

#[test]
fn all_round_decoding_is_near_to_theory_on_even_layouts() {
    let layout = speakers(design());
    for weights in ALL {
        let decoder = Decoder::all_rad(&layout, 3, weights, Level::Energy).unwrap();
        for source in sources(200) {
            let gains = play(&decoder, 3, source);
            let (off_deg, length) = vector(&layout, &gains, 2, source);
            assert!(off_deg < 2.0, "{weights:?}: {off_deg}");
            assert!((20.0 * (length / theory(3, weights).1).log10()).abs() < 1.0, "{length}");
            let energy: f64 = gains.iter().map(|g| g * g).sum();
            assert!((10.0 * energy.log10()).abs() < 0.2, "{energy}");
        }
    }
}

#[test]
fn all_round_decoding_serves_every_named_layout() {
    for name in Layout::names() {
        let layout = Layout::named(name).unwrap();
        for order in 1..=3 {
            let decoder = Decoder::all_rad(layout.speakers(), order, Weights::MaxRe, Level::Energy).unwrap();
            let mut energies = Vec::new();
            for [x, y, z] in even_directions(500) {
                let (one, other) = (play(&decoder, order, [x, y, z]), play(&decoder, order, [-x, y, z]));
                energies.push(one.iter().map(|g| g * g).sum::<f64>());
                for (i, speaker) in layout.speakers().iter().enumerate() {
                    let mirrored = layout.speakers().iter().position(|other| {
                        other.azimuth_deg == -speaker.azimuth_deg
                            && other.elevation_deg == speaker.elevation_deg
                            && other.is_lfe == speaker.is_lfe
                    });
                    let mirrored = mirrored.expect("every layout is alike on both sides");
                    assert!((one[i] - other[mirrored]).abs() < 1e-9, "{name}");
                    assert!(!speaker.is_lfe || one[i] == 0.0);
                }
            }
            let mean = energies.iter().sum::<f64>() / 500.0;
            assert!((mean - 1.0).abs() < 0.01, "{name} {mean}");
        }
    }
}

/// oracles/panning_fixtures.py: the pseudo-inverse of NumPy, and panning of its own.
#[test]
fn decoders_are_those_of_the_oracle() {
    let text = include_str!("../../../tests/fixtures/decoders.tsv");
    let (mut layout, mut rows) = (Vec::new(), 0);
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let words: Vec<&str> = line.split('\t').collect();
        let numbers: Vec<f64> = words[1..].iter().map(|n| n.parse().unwrap()).collect();
        let places =
            numbers.chunks(2).enumerate().map(|(i, p)| Loudspeaker::new(format!("s{i}"), p[0], p[1]));
        let (decoder, near) = match words[0] {
            "layout" => {
                layout = places.collect();
                continue;
            }
            "basic" => (Decoder::mode_matching(&layout, 3, Weights::Basic, Level::Energy), 1e-9),
            _ => (Decoder::all_rad(&layout, 3, Weights::MaxRe, Level::Energy), 1e-3),
        };
        // The oracle has N3D: SN3D is larger by √(2n + 1). A pseudo-inverse has no level yet.
        let energy = numbers.iter().map(|g| g * g).sum::<f64>().sqrt();
        let decoder = decoder.unwrap();
        assert_eq!(numbers.len(), 16 * decoder.rows().len());
        for (row, expected) in decoder.rows().iter().zip(numbers.chunks(16)) {
            for (i, (found, expected)) in row.iter().zip(expected).enumerate() {
                let expected = expected / energy * ((2 * ORDERS[i] + 1) as f64).sqrt();
                assert!((found - expected).abs() < near, "{} {i}: {found} {expected}", words[0]);
            }
        }
        rows += 1;
    }
    assert_eq!(rows, 6);
}

#[test]
fn what_cannot_be_decoded_is_refused() {
    let layout = icosahedron();
    for order in [0, 4] {
        for fault in [
            Decoder::mode_matching(&layout, order, Weights::Basic, Level::Energy),
            Decoder::all_rad(&layout, order, Weights::Basic, Level::Energy),
        ] {
            assert!(fault.unwrap_err().to_string().contains("expected 1, 2 or 3"));
        }
    }
    assert!(Decoder::mode_matching(&[], 1, Weights::Basic, Level::Energy).is_err());
    assert!(Decoder::all_rad(&[], 1, Weights::Basic, Level::Energy).is_err());
    // Too few loudspeakers, a ring, one alone: numbers, whatever they are good for.
    for name in Layout::names() {
        let layout = Layout::named(name).unwrap();
        for weights in ALL {
            let decoder = Decoder::mode_matching(layout.speakers(), 3, weights, Level::Energy).unwrap();
            assert!(decoder.rows().iter().flatten().all(|g| g.is_finite()));
        }
    }
}

#[test]
fn odd_directions_are_heard_all_around() {
    for odd in [[0.0; 3], [f64::NAN; 3], [f64::INFINITY, 0.0, 0.0]] {
        let mut signals = [7.0; 20];
        encode(odd, &mut signals);
        assert_eq!(signals[0], 1.0);
        assert!(signals[1..].iter().all(|&s| s == 0.0));
    }
    assert_eq!(CHANNEL_NAMES.len(), channels(MOST_ORDER));
}
