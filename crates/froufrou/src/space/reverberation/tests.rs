use realfft::RealFftPlanner;

use super::super::air::{ATMOSPHERE_KPA, Air};
use super::super::room::Walls;
use super::*;

fn cube(absorbed: f64) -> Room {
    Room::new([0.0; 3], [4.0, 4.0, 4.0], 0.0, &Walls::all([absorbed; 8])).unwrap()
}

/// A hall whose walls differ, and its bands.
fn hall() -> Room {
    let plaster = [0.10, 0.11, 0.12, 0.13, 0.14, 0.14, 0.15, 0.16];
    let seats = [0.30, 0.33, 0.36, 0.40, 0.42, 0.45, 0.45, 0.45];
    let mut walls = Walls::all(plaster);
    walls.floor = seats;
    Room::new([0.0; 3], [18.0, 9.0, 26.0], 0.0, &walls).unwrap()
}

#[derive(serde::Deserialize)]
struct Fixture {
    size: [f64; 3],
    absorption: [Bands; 6],
    speed_of_sound: f64,
    sabine: Bands,
    eyring: Bands,
    air_per_m: Bands,
}

#[test]
fn the_times_are_those_of_pyroomacoustics() {
    for text in [
        include_str!("../../../tests/fixtures/room/cube.json"),
        include_str!("../../../tests/fixtures/room/corridor.json"),
        include_str!("../../../tests/fixtures/room/corner.json"),
    ] {
        let fixture: Fixture = serde_json::from_str(text).unwrap();
        let [left, right, floor, ceiling, front, back] = fixture.absorption;
        let walls = Walls { left, right, floor, ceiling, front, back };
        let room = Room::new([0.0; 3], fixture.size, 0.0, &walls).unwrap();
        let air = Medium::default();
        // The same decays in other air: rates add up.
        let other = |time_s: f64, air_per_m: f64, speed: f64| SIXTY_DB / (time_s * speed) - air_per_m;
        let (sabine, eyring) = (sabine_s(&room, &air), eyring_s(&room, &air));
        for band in 0..8 {
            let here = (energy_per_m(&air)[band], air.speed_of_sound_mps());
            let there = fixture.speed_of_sound;
            let expected = other(fixture.sabine[band], fixture.air_per_m[band], there);
            assert!((other(sabine[band], here.0, here.1) / expected - 1.0).abs() < 1e-9);
            let expected = other(fixture.eyring[band], 0.0, there);
            assert!((other(eyring[band], here.0, here.1) / expected - 1.0).abs() < 1e-9);
        }
    }
}

/// The energies of an octave band of a response in each millisecond, through the magnitude of Butterworth's filter of
/// order 8. Of the upper bands, where there is noise enough, only the middle three quarters are taken, so that neighbours which
/// reverberate for longer stay out.
fn octave(taps: &[f32], rate_hz: f64, band: usize) -> Vec<f64> {
    let length = (taps.len() + rate_hz as usize).next_power_of_two();
    let mut planner = RealFftPlanner::<f64>::new();
    let forward = planner.plan_fft_forward(length);
    let mut samples = forward.make_input_vec();
    samples.iter_mut().zip(taps).for_each(|(to, from)| *to = f64::from(*from));
    let mut bins = forward.make_output_vec();
    forward.process(&mut samples, &mut bins).unwrap();
    for (bin, value) in bins.iter_mut().enumerate() {
        let ratio = bin as f64 * rate_hz / length as f64 / BANDS_HZ[band];
        // The edges of an octave lie at 10^±0.15 of the middle.
        let edge = 10f64.powf(if band < 4 { 0.15 } else { 0.11 });
        let off = (ratio - 1.0 / ratio) / (edge - 1.0 / edge);
        *value *= 1.0 / (1.0 + off.powi(16)).sqrt();
    }
    planner.plan_fft_inverse(length).process(&mut bins, &mut samples).unwrap();
    let bin = (rate_hz / 1000.0).round() as usize;
    let scale = 1.0 / (length as f64).powi(2);
    samples[..taps.len()].chunks(bin).map(|bin| bin.iter().map(|v| v * v * scale).sum()).collect()
}

/// By what power of e the energy that is still to come falls from one bin to the next, between 5 and 35 dB below all
/// of it.
fn slope(energies: &[f64]) -> Option<f64> {
    let mut rest: f64 = energies.iter().sum();
    let (most, least) = (rest * 10f64.powf(-0.5), rest * 10f64.powf(-3.5));
    let (mut n, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (bin, energy) in energies.iter().enumerate() {
        if rest <= most && rest >= least {
            let (at, level) = (bin as f64, rest.ln());
            n += 1.0;
            x += at;
            y += level;
            xx += at * at;
            xy += at * level;
        }
        rest -= energy;
    }
    let spread = n * xx - x * x;
    (n >= 3.0 && spread > 0.0).then(|| (n * xy - x * y) / spread)
}

fn measured_s(taps: &[f32], rate_hz: f64, band: usize) -> f64 {
    let bin_s = (rate_hz / 1000.0).round() / rate_hz;
    -SIXTY_DB * bin_s / slope(&octave(taps, rate_hz, band)).unwrap()
}

#[test]
fn a_tail_reverberates_as_long_as_its_room() {
    let mut worst: f64 = 0.0;
    for room in [cube(0.1), hall()] {
        let reverberation = Reverberation::new(&room, &Medium::default(), 4).unwrap();
        for (rate_hz, seed) in [(44_100.0, 1), (48_000.0, 2), (96_000.0, 3)] {
            for channel in 0..2 {
                let tail = reverberation.tail(rate_hz, seed, channel).unwrap();
                for (band, expected_s) in reverberation.times_s().iter().enumerate() {
                    let error = measured_s(&tail, rate_hz, band) / expected_s - 1.0;
                    assert!(error.abs() < 0.05, "{rate_hz} {band}: {expected_s} {error}");
                    worst = worst.max(error.abs());
                }
            }
        }
    }
    println!("worst error of a reverberation time: {:.1} %", 100.0 * worst);
}

#[test]
fn the_energy_of_a_tail_is_the_same_at_every_rate() {
    let reverberation = Reverberation::new(&hall(), &Medium::default(), 3).unwrap();
    for rate_hz in [44_100.0, 48_000.0, 96_000.0] {
        let tail = reverberation.tail(rate_hz, 9, 5).unwrap();
        for band in 0..8 {
            let energy = octave(&tail, rate_hz, band).iter().sum::<f64>() / width(rate_hz, band);
            let step_s = 1e-3;
            let expected: f64 =
                (0..10_000).map(|i| step_s * reverberation.energy_per_s(step_s * f64::from(i))[band]).sum();
            let error_db = 10.0 * (energy / expected).log10();
            assert!(error_db.abs() < 0.5, "{rate_hz} {band}: {error_db} dB");
        }
    }
}

/// The energy of an octave band of an impulse, which has the energy 1 at any rate.
fn width(rate_hz: f64, band: usize) -> f64 {
    let mut impulse = vec![0.0f32; rate_hz as usize];
    impulse[rate_hz as usize / 2] = 1.0;
    octave(&impulse, rate_hz, band).iter().sum()
}

/// The energy of images and tail in each of some milliseconds, averaged over places.
struct Decay {
    early: Vec<f64>,
    tail: Vec<f64>,
}

const BIN_S: f64 = 0.004;

fn decay(room: &Room, order: usize, band: usize, places: u64) -> Decay {
    let (rate_hz, air) = (16_000.0, Medium::default());
    let (images, reverberation) =
        (room.images(order).unwrap(), Reverberation::new(room, &air, order).unwrap());
    let bins = (reverberation.end_s(band) / BIN_S) as usize;
    let (mut early, mut tail) = (vec![0.0; bins], vec![0.0; bins]);
    let random = Random::new(4, 4);
    let absorption = energy_per_m(&air)[band];
    for place in 0..places {
        let at = |which: u64| -> [f64; 3] {
            std::array::from_fn(|i| room.size_m()[i] * random.uniform(6 * place + which + i as u64))
        };
        let (source, listener) = (at(0), at(3));
        for image in &images {
            let position = image.position_m(source);
            let square: f64 = (0..3).map(|i| (position[i] - listener[i]).powi(2)).sum();
            let distance = square.sqrt();
            if let Some(bin) = early.get_mut((distance / air.speed_of_sound_mps() / BIN_S) as usize) {
                *bin += image.gains[band].powi(2) / square * (-absorption * distance).exp() / places as f64;
            }
        }
    }
    let channels = 8;
    for channel in 0..channels {
        let taps = reverberation.tail(rate_hz, 1, channel).unwrap();
        let scale = 1.0 / (channels as f64 * width(rate_hz, band));
        for (bin, energies) in tail.iter_mut().zip(octave(&taps, rate_hz, band).chunks(4)) {
            *bin += energies.iter().sum::<f64>() * scale;
        }
    }
    Decay { early, tail }
}

fn still_to_come(energies: impl DoubleEndedIterator<Item = f64>) -> Vec<f64> {
    let mut sum = 0.0;
    let mut curve: Vec<f64> = energies
        .rev()
        .map(|energy| {
            sum += energy;
            sum
        })
        .collect();
    curve.reverse();
    curve
}

#[test]
fn images_and_tail_together_decay_as_the_room_does() {
    for (room, order) in
        [(cube(0.1), 2), (cube(0.1), 5), (cube(0.3), 4), (hall_alike(), 3), (hall_alike(), 6)]
    {
        let air = Medium::default();
        let band = 4;
        let Decay { early, tail } = decay(&room, order, band, 400);
        let both = still_to_come(early.iter().zip(&tail).map(|(a, b)| a + b));
        let level = 4.0 * PI * air.speed_of_sound_mps() / room.volume_m3();
        let rate = SIXTY_DB / eyring_s(&room, &air)[band];
        // From the direct sound on, whose energy near a source is much at the mercy of places, leave a little out.
        let mut worst: f64 = 0.0;
        for (bin, found) in
            both.iter().enumerate().skip((0.5 * room.size_m()[0] / 343.0 / BIN_S) as usize + 1)
        {
            let time_s = bin as f64 * BIN_S;
            let expected = level / rate * (-rate * time_s).exp();
            if rate * time_s > 0.66 * SIXTY_DB {
                break;
            }
            worst = worst.max((10.0 * (found / expected).log10()).abs());
        }
        println!("{:?} order {order}: {worst:.2} dB from the diffuse decay", room.size_m());
        assert!(worst < 1.0, "{:?} {order}: {worst} dB", room.size_m());
    }
}

/// A hall of moderate proportions, whose walls are alike.
fn hall_alike() -> Room {
    Room::new([0.0; 3], [18.0, 11.0, 25.0], 0.0, &Walls::all([0.2; 8])).unwrap()
}

#[test]
fn images_and_tail_join_without_a_bump_even_where_walls_differ() {
    // Where walls differ, images decay other than by Eyring's formula; the tail takes up their level. The energy
    // in a stretch about the joint lies between what is on its sides, but for 1 dB.
    for (room, order) in [(hall(), 2), (hall(), 5), (cube(0.3), 2)] {
        let band = 3;
        let reverberation = Reverberation::new(&room, &Medium::default(), order).unwrap();
        let images = Images::new(&room, &Medium::default(), order);
        let speed = Medium::default().speed_of_sound_mps();
        let level = 4.0 * PI * speed / room.volume_m3();
        let decay = SIXTY_DB / reverberation.times_s()[band];
        // The sum of both, less the decay: a line without bumps.
        let flat: Vec<f64> = (1..200)
            .map(|i| {
                let time_s = reverberation.step_s * f64::from(i);
                let early = level * images.energies(time_s * speed).0[band];
                10.0 * ((early + reverberation.energy_per_s(time_s)[band]) * (decay * time_s).exp() / level)
                    .log10()
            })
            .collect();
        let steepest = flat.windows(20).map(|w| (w[19] - w[0]).abs()).fold(0.0, f64::max);
        println!("{:?} order {order}: {:.2} dB in all", room.size_m(), flat.last().unwrap());
        assert!(steepest < 1.0, "{:?} {order}: {flat:?}", room.size_m());
    }
}

#[test]
fn channels_are_independent_and_equal_in_level() {
    let reverberation = Reverberation::new(&hall(), &Medium::default(), 3).unwrap();
    let tails: Vec<Vec<f32>> =
        (0..4).map(|channel| reverberation.tail(48_000.0, 7, channel).unwrap()).collect();
    let inner = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
    for (i, a) in tails.iter().enumerate() {
        for b in &tails[i + 1..] {
            let (aa, bb, ab) = (inner(a, a), inner(b, b), inner(a, b));
            assert!((10.0 * (aa / bb).log10()).abs() < 0.2, "{}", 10.0 * (aa / bb).log10());
            assert!((ab / (aa * bb).sqrt()).abs() < 0.05, "{}", ab / (aa * bb).sqrt());
        }
    }
    assert_eq!(tails[2], reverberation.tail(48_000.0, 7, 2).unwrap());
    assert_ne!(tails[2], reverberation.tail(48_000.0, 8, 2).unwrap());
}

#[test]
fn a_tail_begins_silently_and_ends_90_db_down() {
    let reverberation = Reverberation::new(&hall(), &Medium::default(), 6).unwrap();
    let tail = reverberation.tail(48_000.0, 1, 1).unwrap();
    let longest = reverberation.times_s().iter().copied().fold(0.0, f64::max);
    assert!(tail.len() as f64 / 48_000.0 > 1.5 * longest);
    assert!((tail.len() as f64) / 48_000.0 < 1.5 * longest + 0.5);
    let peak = |range: std::ops::Range<usize>| tail[range].iter().fold(0.0f32, |m, v| m.max(v.abs()));
    let all = peak(0..tail.len());
    // No image of order 7 comes within 30 ms in a hall of this size.
    assert_eq!(peak(0..1440), 0.0);
    assert!(peak(tail.len() - 48..tail.len()) < 1e-5 * all);
    assert!(tail.iter().all(|v| v.is_finite()));
}

#[test]
fn rooms_without_end_or_echo_are_told_apart() {
    let air = Medium::default();
    let error = Reverberation::new(&cube(0.0), &air, 3).unwrap_err().to_string();
    assert!(error.contains("the room reverberates for") && error.contains("at 63 Hz"), "{error}");
    assert!(Reverberation::new(&cube(0.3), &air, 1001).is_err());
    // Walls that absorb everything leave no tail.
    let dead = Reverberation::new(&cube(1.0), &air, 3).unwrap();
    assert_eq!(dead.times_s(), &[0.0; 8]);
    assert!(dead.tail(48_000.0, 1, 1).unwrap().is_empty());
    // In one band only: the others sound.
    let mut absorption = [0.3; 8];
    absorption[7] = 1.0;
    let room = Room::new([0.0; 3], [4.0; 3], 0.0, &Walls::all(absorption)).unwrap();
    let tail = Reverberation::new(&room, &air, 3).unwrap().tail(48_000.0, 1, 1).unwrap();
    let level = |band: usize| octave(&tail, 48_000.0, band).iter().sum::<f64>();
    assert!(level(6) > 1e3 * level(7) && tail.iter().all(|v| v.is_finite()));
    let reverberation = Reverberation::new(&cube(0.3), &air, 3).unwrap();
    for rate_hz in [f64::NAN, 0.0, 1e9] {
        assert!(reverberation.tail(rate_hz, 1, 1).is_err());
    }
    // A room of extremes: a duct.
    let duct = Room::new([0.0; 3], [0.02, 0.02, 10_000.0], 0.0, &Walls::all([0.5; 8])).unwrap();
    let tail = Reverberation::new(&duct, &Air::new(0.0, 0.0, ATMOSPHERE_KPA).unwrap().medium(), 19).unwrap();
    assert!(tail.tail(8000.0, 1, 1).unwrap().iter().all(|v| v.is_finite()));
}
