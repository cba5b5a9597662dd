use super::*;
use crate::random::Random;
use crate::space::direction::{from_angles_deg, to_angles_deg};
use crate::space::layout::Layout;

fn custom(places: &[(f64, f64)]) -> Vec<Loudspeaker> {
    places.iter().enumerate().map(|(i, &(a, e))| Loudspeaker::new(format!("s{i}"), a, e)).collect()
}

/// Layouts that are hard in one way or another.
fn odd_layouts() -> Vec<Vec<Loudspeaker>> {
    vec![
        custom(&[(20.0, 10.0)]),
        custom(&[(90.0, 0.0), (-90.0, 0.0)]),
        custom(&[(0.0, 90.0), (0.0, -90.0)]),
        custom(&[(30.0, 20.0), (-150.0, -20.0)]),
        custom(&[(10.0, 40.0), (60.0, -30.0)]),
        custom(&[(5.0, 0.0), (10.0, 0.0), (50.0, 0.0)]),
        custom(&[(0.0, 0.0), (90.0, 0.0), (180.0, 0.0), (-170.0, 0.0)]),
        // In the median plane, and in the plane that is across.
        custom(&[(0.0, -20.0), (0.0, 0.0), (0.0, 45.0), (180.0, 60.0)]),
        custom(&[(90.0, 0.0), (90.0, 60.0), (-90.0, 60.0), (-90.0, 0.0)]),
        // A wall in front; one loudspeaker over two; a cube; a tetrahedron.
        custom(&[(30.0, 20.0), (-30.0, 20.0), (30.0, -20.0), (-30.0, -20.0)]),
        custom(&[(30.0, 0.0), (-30.0, 0.0), (0.0, 90.0)]),
        custom(&[
            (45.0, 35.264),
            (-45.0, 35.264),
            (135.0, 35.264),
            (-135.0, 35.264),
            (45.0, -35.264),
            (-45.0, -35.264),
            (135.0, -35.264),
            (-135.0, -35.264),
        ]),
        custom(&[(0.0, 90.0), (0.0, -19.47), (120.0, -19.47), (-120.0, -19.47)]),
        // Nearly, but not quite, on a ring; opposite pairs.
        custom(&[(30.0, 1.0), (-30.0, -0.5), (110.0, 0.3), (-110.0, 0.0)]),
        custom(&[(90.0, 20.0), (-90.0, -20.0), (0.0, 0.0), (0.0, 90.0)]),
        custom(&[(90.0, 0.0), (-90.0, 0.0), (0.0, 0.0), (180.0, 0.0), (0.0, 90.0), (0.0, -90.0)]),
        (0..64).map(|i| Loudspeaker::new(format!("s{i}"), f64::from(i) * 5.625, 0.0)).collect(),
    ]
}

fn random_layouts() -> impl Iterator<Item = Vec<Loudspeaker>> {
    (0..150).filter_map(|seed| {
        let random = Random::new(seed, 8);
        let count = 2 + random.below(0, if seed < 130 { 14 } else { 62 });
        let half = seed % 3 == 0;
        let coarse = seed % 2 == 0;
        let angle = |i: u64, from: f64, to: f64| {
            let value = from + (to - from) * random.uniform(i);
            if coarse { (value / 15.0).round() * 15.0 } else { value }
        };
        // Tiny shifts, which decide whether loudspeakers are in one plane.
        let shift = if seed % 4 == 0 { 10f64.powi(-(seed as i32 % 9)) * 1e-2 } else { 0.0 };
        let places: Vec<(f64, f64)> = (0..count as u64)
            .map(|i| {
                let azimuth = angle(2 * i + 1, -180.0, 180.0) + shift * random.uniform(500 + i);
                let elevation = angle(2 * i + 2, if half { 0.0 } else { -90.0 }, 89.0);
                (azimuth, (elevation + shift * random.uniform(600 + i)).min(90.0))
            })
            .collect();
        // Two in one direction are refused; a test of its own says so. Nothing else is.
        let speakers = custom(&places);
        match Panner::new(&speakers) {
            Ok(_) => Some(speakers),
            Err(fault) => {
                assert!(fault.to_string().contains("same direction"), "{speakers:?} {fault}");
                None
            }
        }
    })
}

fn all_layouts() -> Vec<Vec<Loudspeaker>> {
    let named = Layout::names().map(|name| Layout::named(name).unwrap().speakers().to_vec());
    named.chain(odd_layouts()).collect()
}

fn gains(panner: &Panner, direction: [f64; 3]) -> Vec<f64> {
    let mut out = vec![f64::NAN; panner.channels()];
    panner.gains(direction, &mut out);
    out
}

fn angle_deg(a: [f64; 3], b: [f64; 3]) -> f64 {
    let c = cross(a, b);
    dot(c, c).sqrt().atan2(dot(a, b)).to_degrees()
}

/// Σ g^power l: the velocity vector for 1, the energy vector for 2.
fn vector(speakers: &[Loudspeaker], gains: &[f64], power: i32) -> [f64; 3] {
    let total: f64 = gains.iter().map(|g| g.powi(power)).sum();
    let sum =
        |k: usize| speakers.iter().zip(gains).map(|(s, g)| g.powi(power) * s.direction()[k]).sum::<f64>();
    [0, 1, 2].map(|k| sum(k) / total)
}

fn sphere(step_deg: usize) -> impl Iterator<Item = [f64; 3]> {
    let elevations = (-90..=90).step_by(step_deg);
    elevations.flat_map(move |e| {
        (-180..180).step_by(step_deg).map(move |a| from_angles_deg(f64::from(a) + 0.37, f64::from(e)))
    })
}

#[test]
fn energy_is_one_and_gains_are_not_negative_everywhere() {
    for speakers in all_layouts().into_iter().chain(random_layouts()) {
        let panner = Panner::new(&speakers).unwrap();
        for direction in sphere(7) {
            let found = gains(&panner, direction);
            let energy: f64 = found.iter().map(|g| g * g).sum();
            assert!((energy - 1.0).abs() < 1e-12, "{speakers:?} {direction:?} {found:?}");
            assert!(found.iter().all(|&g| g >= 0.0));
            for (speaker, gain) in speakers.iter().zip(&found) {
                assert!(!speaker.is_lfe || *gain == 0.0);
            }
        }
    }
}

#[test]
fn toward_a_loudspeaker_only_that_one_plays() {
    for speakers in all_layouts().into_iter().chain(random_layouts()) {
        let panner = Panner::new(&speakers).unwrap();
        for (i, speaker) in speakers.iter().enumerate().filter(|(_, s)| !s.is_lfe) {
            for (k, gain) in gains(&panner, speaker.direction()).into_iter().enumerate() {
                let expected = if i == k { 1.0 } else { 0.0 };
                assert!((gain - expected).abs() < 1e-9, "{speakers:?} {}: {gain}", speaker.name);
            }
        }
    }
}

/// Between loudspeakers of one ring: the law of tangents (Bennett et al. 1985), and the vectors that follow from it.
#[test]
fn two_loudspeakers_follow_the_law_of_tangents() {
    for name in ["stereo", "quad", "5.1", "7.1"] {
        let layout = Layout::named(name).unwrap();
        let speakers = layout.speakers();
        let panner = Panner::new(speakers).unwrap();
        let mut ring: Vec<usize> = (0..speakers.len()).filter(|&i| !speakers[i].is_lfe).collect();
        ring.sort_by(|&a, &b| speakers[a].azimuth_deg.total_cmp(&speakers[b].azimuth_deg));
        for (n, &right) in ring.iter().enumerate() {
            let left = ring[(n + 1) % ring.len()];
            let width = (speakers[left].azimuth_deg - speakers[right].azimuth_deg).rem_euclid(360.0);
            if width > 160.0 {
                continue;
            }
            let middle = speakers[right].azimuth_deg + width / 2.0;
            let base = (width / 2.0).to_radians().tan();
            for step in -20..=20 {
                let off = f64::from(step) / 20.0 * width / 2.0;
                let source = from_angles_deg(middle + off, 0.0);
                let found = gains(&panner, source);
                let (l, r) = (found[left], found[right]);
                assert!((l * l + r * r - 1.0).abs() < 1e-12, "none but the two");
                let ratio = off.to_radians().tan() / base;
                assert!(((l - r) / (l + r) - ratio).abs() < 1e-12);
                // g ∝ 1 ± ratio, so that the energy vector is known too.
                let (a, b) = ((1.0 + ratio).powi(2), (1.0 - ratio).powi(2));
                let (along, across) = ((width / 2.0).to_radians().cos(), (width / 2.0).to_radians().sin());
                let across = across * (a - b) / (a + b);
                let energy = vector(speakers, &found, 2);
                let expected = from_angles_deg(middle + across.atan2(along).to_degrees(), 0.0);
                assert!(angle_deg(energy, expected) < 1e-6);
                let magnitude = dot(energy, energy).sqrt() / along.hypot(across);
                assert!((20.0 * magnitude.log10()).abs() < 1e-9);
                let velocity = vector(speakers, &found, 1);
                assert!(angle_deg(velocity, source) < 1e-6);
                let expected = (width / 2.0).to_radians().cos() / off.to_radians().cos();
                assert!((dot(velocity, velocity).sqrt() - expected).abs() < 1e-12);
            }
        }
    }
}

/// Where no imaginary loudspeaker beyond the faces is needed the velocity vector points at the source.
#[test]
fn the_velocity_vector_points_at_the_source() {
    let surrounded = odd_layouts().into_iter().filter(|speakers| {
        let directions: Vec<_> = speakers.iter().map(Loudspeaker::direction).collect();
        directions.len() > 3 && hull(&directions).iter().all(|face| face.distance > OPEN)
    });
    let mut count = 0;
    for speakers in surrounded.chain(random_layouts().filter(|speakers| {
        let directions: Vec<_> = speakers.iter().map(Loudspeaker::direction).collect();
        directions.len() > 3 && hull(&directions).iter().all(|face| face.distance > OPEN)
    })) {
        count += 1;
        let panner = Panner::new(&speakers).unwrap();
        for source in sphere(4) {
            let found = vector(&speakers, &gains(&panner, source), 1);
            assert!(angle_deg(found, source) < 1e-6, "{source:?}");
        }
    }
    assert!(count > 10, "{count}");
    // Of layouts with nothing below: on and above the ring, up to the loudspeakers overhead.
    for name in ["5.1.4", "7.1.4"] {
        let layout = Layout::named(name).unwrap();
        let panner = Panner::new(layout.speakers()).unwrap();
        let mut count = 0;
        for source in sphere(2).filter(|&source| to_angles_deg(source).1 >= 0.0) {
            let found = vector(layout.speakers(), &gains(&panner, source), 1);
            assert!(angle_deg(found, source) < 1e-6, "{name} {source:?} {}", angle_deg(found, source));
            count += 1;
        }
        assert!(count > 500);
    }
}

#[test]
fn gains_have_no_steps() {
    for speakers in all_layouts().into_iter().chain(random_layouts().step_by(3)) {
        let panner = Panner::new(&speakers).unwrap();
        // The largest change along great circles, for two lengths of step.
        let change = |steps: u32| {
            let mut most: f64 = 0.0;
            for circle in 0..8 {
                let random = Random::new(5, circle);
                let point =
                    |i| from_angles_deg(360.0 * random.uniform(i), 180.0 * random.uniform(i + 1) - 90.0);
                let a = if circle == 0 { [0.0, 1.0, 0.0] } else { point(0) };
                let b = unit(cross(a, point(2)));
                let mut before = gains(&panner, a);
                for step in 1..=steps {
                    let (sin, cos) = (std::f64::consts::TAU * f64::from(step) / f64::from(steps)).sin_cos();
                    let now = gains(&panner, std::array::from_fn(|k| cos * a[k] + sin * b[k]));
                    let moved = now.iter().zip(&before).map(|(a, b)| (a - b).abs());
                    most = moved.fold(most, f64::max);
                    before = now;
                }
            }
            most
        };
        let (coarse, fine) = (change(900), change(9000));
        assert!(fine < 0.2 * coarse + 1e-9, "{speakers:?}: {coarse} {fine}");
    }
    for name in Layout::names() {
        let panner = Panner::new(Layout::named(name).unwrap().speakers()).unwrap();
        for elevation in [0.0, 10.0, 30.0, 60.0, -40.0] {
            let at = |i: i32| gains(&panner, from_angles_deg(f64::from(i) * 0.1, elevation));
            for i in 0..3600 {
                let moved = at(i).iter().zip(at(i + 1)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(moved < 0.008, "{name}, {i}: {moved}");
            }
        }
    }
}

#[test]
fn both_sides_are_alike() {
    for name in Layout::names() {
        let layout = Layout::named(name).unwrap();
        let panner = Panner::new(layout.speakers()).unwrap();
        for [x, y, z] in sphere(5) {
            let (one, other) = (gains(&panner, [x, y, z]), gains(&panner, [-x, y, z]));
            for (speaker, gain) in layout.speakers().iter().zip(&one).filter(|(s, _)| !s.is_lfe) {
                let mirrored = layout.speakers().iter().position(|other| {
                    other.azimuth_deg == -speaker.azimuth_deg && other.elevation_deg == speaker.elevation_deg
                });
                assert!(
                    (gain - other[mirrored.unwrap()]).abs() < 1e-9,
                    "{name} {} {x} {y} {z}",
                    speaker.name
                );
            }
        }
    }
}

#[test]
fn what_no_loudspeaker_is_near_to_is_still_where_one_expects_it() {
    let stereo = Panner::new(Layout::named("stereo").unwrap().speakers()).unwrap();
    for azimuth in [31.0, 60.0, 90.0, 129.0] {
        let found = gains(&stereo, from_angles_deg(azimuth, 0.0));
        assert!((found[0] - 1.0).abs() < 1e-12, "{azimuth} {found:?}");
    }
    for direction in [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]] {
        let found = gains(&stereo, direction);
        assert!((found[0] - found[1]).abs() < 1e-12);
    }
    // Overhead all five play, those alone at the rear more.
    let five = Panner::new(Layout::named("5.1").unwrap().speakers()).unwrap();
    let found = gains(&five, [0.0, 1.0, 0.0]);
    let shares = [55.0, 55.0, 30.0, 0.0, 110.0, 110.0].map(|degrees: f64| (degrees / 360.0).sqrt());
    for (found, expected) in found.iter().zip(shares) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
}

#[test]
fn wide_sources_are_wide() {
    for name in Layout::names() {
        let layout = Layout::named(name).unwrap();
        let speakers = layout.speakers();
        let panner = Panner::new(speakers).unwrap();
        let wide = |source, width_deg| {
            let mut out = vec![f64::NAN; panner.channels()];
            panner.spread_gains(source, width_deg, &mut out);
            out
        };
        for [x, y, z] in sphere(9) {
            let source = [x, y, z];
            assert_eq!(wide(source, 0.0), gains(&panner, source));
            assert_eq!(wide(source, f64::NAN), gains(&panner, source));
            let narrow = wide(source, 1e-3);
            assert!(narrow.iter().zip(gains(&panner, source)).all(|(a, b)| (a - b).abs() < 1e-4));
            for width_deg in [10.0, 60.0, 180.0, 360.0, 1e9] {
                let (one, other) = (wide(source, width_deg), wide([-x, y, z], width_deg));
                assert!((one.iter().map(|g| g * g).sum::<f64>() - 1.0).abs() < 1e-12);
                for (i, speaker) in speakers.iter().enumerate() {
                    let mirrored = speakers.iter().position(|other| {
                        other.azimuth_deg == -speaker.azimuth_deg
                            && other.elevation_deg == speaker.elevation_deg
                            && other.is_lfe == speaker.is_lfe
                    });
                    let mirrored = mirrored.expect("every layout is alike on both sides");
                    assert!((one[i] - other[mirrored]).abs() < 1e-9);
                    assert!(!speaker.is_lfe || one[i] == 0.0);
                }
            }
        }
    }
    // All about a listener: the wider, the shorter the energy vector; the velocity vector where it was.
    let cube = odd_layouts().swap_remove(11);
    let panner = Panner::new(&cube).unwrap();
    let mut out = vec![0.0; cube.len()];
    for source in sphere(10) {
        let mut before = f64::INFINITY;
        for width_deg in [30.0, 90.0, 150.0, 220.0, 300.0, 360.0] {
            panner.spread_gains(source, width_deg, &mut out);
            let energy = vector(&cube, &out, 2);
            let length = dot(energy, energy).sqrt();
            assert!(length < before + 0.02, "{source:?} {width_deg} {length} {before}");
            before = length;
            if width_deg < 350.0 {
                assert!(angle_deg(vector(&cube, &out, 1), source) < 1e-6);
            }
        }
        assert!(before < 0.1, "{before}");
    }
    // About the zenith, where the points about a source spin, steps stay small.
    let seven = Panner::new(Layout::named("7.1.4").unwrap().speakers()).unwrap();
    let (mut one, mut other) = ([0.0; 12], [0.0; 12]);
    for azimuth in 0..360 {
        seven.spread_gains(from_angles_deg(f64::from(azimuth), 89.9), 60.0, &mut one);
        seven.spread_gains(from_angles_deg(f64::from(azimuth) + 90.0, 89.9), 60.0, &mut other);
        assert!(one.iter().zip(&other).all(|(a, b)| (a - b).abs() < 0.03));
    }
}

#[test]
fn odd_directions_are_played_by_all() {
    let layout = Layout::named("5.1").unwrap();
    let panner = Panner::new(layout.speakers()).unwrap();
    for odd in [[0.0; 3], [f64::NAN, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0]] {
        let found = gains(&panner, odd);
        assert!(
            found
                .iter()
                .enumerate()
                .all(|(i, g)| (g - if i == 3 { 0.0 } else { 0.2f64.sqrt() }).abs() < 1e-12)
        );
    }
    // Length does not count; room for too few or too many is no panic.
    let mut few = [1.0; 2];
    panner.gains([0.0, 0.0, -1e9], &mut few);
    let mut many = [1.0; 9];
    panner.gains([-1e-9, 0.0, -1e-9], &mut many);
    assert_eq!(many[6..], [0.0; 3]);
    assert!((many.iter().map(|g| g * g).sum::<f64>() - 1.0).abs() < 1e-12);
}

#[test]
fn what_cannot_be_panned_to_is_refused() {
    let fault = |speakers: &[Loudspeaker]| Panner::new(speakers).unwrap_err().to_string();
    let twice = custom(&[(30.0, 0.0), (-30.0, 0.0), (30.2, 0.1)]);
    assert!(fault(&twice).contains("`s0` and `s2` stand in the same direction"));
    assert!(fault(&custom(&[(0.0, 90.0), (77.0, 90.0)])).contains("same direction"));
    assert!(fault(&[]).contains("no loudspeaker"));
    let many: Vec<(f64, f64)> = (0..65).map(|i| (f64::from(i), 0.0)).collect();
    assert!(fault(&custom(&many)).contains("65 loudspeakers"));
    assert!(fault(&custom(&[(f64::INFINITY, 0.0)])).contains("azimuth"));
}

/// oracles/panning_fixtures.py: NumPy over all pairs and triplets of SciPy's hull.
#[test]
fn gains_are_those_of_the_oracle() {
    let text = include_str!("../../../tests/fixtures/panning.tsv");
    let (mut speakers, mut panner, mut rows) = (Vec::new(), None, 0);
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let words: Vec<&str> = line.split('\t').collect();
        let numbers: Vec<f64> = words[1..].iter().map(|n| n.parse().unwrap()).collect();
        if words[0] == "layout" {
            speakers = custom(&numbers.chunks(2).map(|p| (p[0], p[1])).collect::<Vec<_>>());
            panner = Some(Panner::new(&speakers).unwrap());
            continue;
        }
        let found = gains(panner.as_ref().unwrap(), [numbers[0], numbers[1], numbers[2]]);
        assert_eq!(found.len(), numbers.len() - 3);
        for (a, b) in found.iter().zip(&numbers[3..]) {
            assert!((a - b).abs() < 1e-9, "{speakers:?} {line} {found:?}");
        }
        rows += 1;
    }
    assert!(rows > 200);
}
