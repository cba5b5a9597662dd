//! The example scenes sound as their READMEs say.

mod studio;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use froufrou::corpus::paper::PaperSound;
use froufrou::motion::event::Event;
use froufrou::motion::rub::Rubbing;
use froufrou::render::production::Production;
use froufrou::scene::Scene;
use froufrou::score::{Action, Arrival, ChannelLine, ObjectLine, Start, Verb};
use studio::{Sound, Take};

fn open(name: &str) -> Production {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name).join("scene.toml");
    Production::open(Scene::open(path, false).unwrap()).unwrap()
}

/// Every start of a scene's score: when, what and how loud at 1 m.
fn starts(production: &Production) -> Vec<(f64, Start, f64)> {
    let lines: Vec<ObjectLine> = production.object_lines().unwrap().map(|line| line.unwrap()).collect();
    let mut last_s = 0.0;
    let mut found = Vec::new();
    for line in lines {
        if let ObjectLine::Thread(line) = line {
            assert!(line.time_s >= last_s, "in time order");
            last_s = line.time_s;
            if let Verb::Start(start) = line.verb {
                found.push((line.time_s, start, line.value.gain));
            }
        }
    }
    found
}

fn count_by_object(production: &Production) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for (_, start, _) in starts(production) {
        *counts.entry(start.object).or_default() += 1;
    }
    counts
}

#[test]
fn the_ball_bounces_as_it_was_keyed() {
    let production = open("bounce");
    let all = starts(&production);
    let hits: Vec<_> = all.iter().filter(|(_, start, _)| start.object == "ball").collect();
    let knocks: Vec<f64> = all.iter().filter(|(_, s, _)| s.object == "knuckles").map(|h| h.0).collect();
    assert_eq!(hits.len(), 10);
    assert_eq!(knocks, [3.80, 4.02, 4.24]);
    assert!(hits.windows(2).all(|w| w[0].1.sound != w[1].1.sound), "never the same twice running");
    for pair in hits.windows(2) {
        let fall_db = 20.0 * (pair[0].2 / pair[1].2).log10();
        assert!((fall_db - 2.5).abs() < 0.11, "{fall_db} dB");
    }
    // Each flight lasts three quarters of the one before.
    for triple in hits.windows(3) {
        let ratio = (triple[2].0 - triple[1].0) / (triple[1].0 - triple[0].0);
        assert!((ratio - 0.75).abs() < 0.01, "{ratio}");
    }
}

#[test]
fn the_ambulance_comes_from_five_times_as_far() {
    let production = open("ambulance");
    let lines = production.channel_lines().unwrap().map(|line| line.unwrap());
    let delays: Vec<f64> =
        lines.filter(|l| l.thread() == 1).filter_map(|l| Some(l.statement()?.value[0].delay_s)).collect();
    let (least, most) = (delays.iter().copied().fold(f64::MAX, f64::min), delays[0]);
    assert!((most / least - 5.0).abs() < 0.02, "{least} {most}");
    assert_eq!(count_by_object(&production), BTreeMap::from([("engine".into(), 1), ("siren".into(), 1)]));
}

#[test]
fn the_log_of_the_physics_engine_holds_what_the_readme_says() {
    let production = open("collisions");
    let events: Vec<_> = production.events().unwrap().map(|event| event.unwrap()).collect();
    let at = |a: &str, b: &str| -> Vec<f64> {
        let impacts = events.iter().filter_map(Event::impact);
        impacts.filter(|i| i.a.starts_with(a) && i.b.starts_with(b)).map(|i| i.time_s).collect()
    };
    let near = |times: &[f64], time: f64| times.iter().any(|t| (t - time).abs() < 0.01);
    assert!(near(&at("ball", "ramp"), 0.14) && near(&at("ball", "ramp"), 0.18));
    assert!(near(&at("block", "ramp"), 0.14) && near(&at("coin", "ground"), 0.24));
    assert!(near(&at("ball", "ground"), 1.52) && near(&at("block", "ground"), 1.52));
    assert!(near(&at("ball", "brick0"), 1.91));
    assert!(at("brick", "brick").iter().all(|&t| t < 0.035) && at("", "").len() < 40);
    // The ball rolls and the block slides; what rests, does neither.
    let share = |a: &str, b: &str, rolls: bool| {
        let rubs = events.iter().filter_map(Event::rub);
        let of_pair = rubs.filter(|(_, rub)| rub.a == a && rub.b == b && rub.time_s > 0.2);
        let all: Vec<Rubbing> = of_pair.map(|(how, _)| how).collect();
        let alike = all.iter().filter(|how| (**how == Rubbing::Roll) == rolls).count();
        alike as f64 / all.len() as f64
    };
    assert!(share("ball", "ramp", true) > 0.95 && share("block_slide", "ramp", false) > 0.99);
    let counts = count_by_object(&production);
    let names = ["ball", "block", "brick", "coin", "ramp"];
    assert!(names.iter().all(|name| counts.keys().any(|object| object.starts_with(name))), "{counts:?}");
}

#[test]
fn the_tower_is_told_by_its_motion_alone() {
    let production = open("tower");
    let counts = count_by_object(&production);
    let boxes: usize = counts.iter().filter(|(name, _)| name.starts_with("Box/Box")).map(|(_, n)| n).sum();
    assert!(boxes >= 6 && counts["Ball"] >= 5 && counts["Ground"] >= 1 && counts["Ramp"] >= 1, "{counts:?}");
    let starts = starts(&production);
    let times = |cause: &str| -> Vec<f64> {
        let of_cause = starts.iter().filter(|(_, start, _)| start.cause.starts_with(cause));
        of_cause.map(|(time_s, ..)| *time_s).collect()
    };
    let near = |times: &[f64], time_s: f64| times.first().is_some_and(|first| (first - time_s).abs() < 0.005);
    assert!(near(&times("Ball struck by Ramp"), 0.085) && near(&times("Ball struck by Ground"), 1.109));
    assert!(near(&times("Box/Box0 struck by Ball"), 1.389) && near(&times("Box/Box1 struck by Ball"), 1.389));
    assert!(near(&times("Ball rolls along Ramp"), 0.09), "{:?}", times("Ball rolls along Ramp"));
    // The tower stands in silence until it is struck.
    assert!(starts.iter().all(|(time_s, start, _)| *time_s > 1.38 || !start.cause.contains("Box")));
}

#[test]
fn the_demo_shows_all_it_promises() {
    let counts = count_by_object(&open("demo"));
    assert_eq!((counts["ambulance"], counts["ball"]), (1, 7));
    assert!(counts["box"] >= 6 && counts["coin"] >= 10, "{counts:?}");
}

const RATE_HZ: f64 = 48_000.0;

fn render(name: &str) -> Sound {
    let production = open(name);
    let lines = production.channel_lines().unwrap();
    let folder = &production.scene.folder;
    let take = Take::at(48_000);
    studio::render(&production.channel_header(), folder, production.prototypes.clone(), lines, take).unwrap()
}

/// The amplitude of the sine waves in a part of an object's stem, left, hertz by hertz.
fn spectrum(sound: &Sound, object: &str, from_s: f64, length_s: f64) -> Spectrum {
    let part = sound.stem(object).iter().step_by(sound.channels).skip((from_s * RATE_HZ) as usize);
    let mut samples: Vec<f64> = part.take((length_s * RATE_HZ) as usize).map(|&s| f64::from(s)).collect();
    let length = samples.len();
    for (n, sample) in samples.iter_mut().enumerate() {
        // Blackman and Harris: what leaks beyond four bins is 92 dB down.
        let turn = std::f64::consts::TAU * n as f64 / length as f64;
        *sample *=
            0.35875 - 0.48829 * turn.cos() + 0.14128 * (2.0 * turn).cos() - 0.01168 * (3.0 * turn).cos();
    }
    let forward = realfft::RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let mut out = forward.make_output_vec();
    forward.process(&mut samples, &mut out).unwrap();
    Spectrum { bins: out.iter().map(|bin| bin.norm()).collect(), bin_hz: RATE_HZ / length as f64 }
}

struct Spectrum {
    bins: Vec<f64>,
    bin_hz: f64,
}

impl Spectrum {
    /// Frequency and level in decibels of the strongest line within a part of a frequency.
    fn line(&self, near_hz: f64, part: f64) -> (f64, f64) {
        let bin = |hz: f64| (hz / self.bin_hz).round() as usize;
        let within = bin(near_hz * (1.0 - part))..=bin(near_hz * (1.0 + part));
        let top = within.max_by(|&a, &b| self.bins[a].total_cmp(&self.bins[b])).unwrap();
        // The top of a parabola through the logarithms of three bins.
        let [a, b, c] = [top - 1, top, top + 1].map(|bin| self.bins[bin].ln());
        ((top as f64 + 0.5 * (a - c) / (a - 2.0 * b + c)) * self.bin_hz, 20.0 * self.bins[top].log10())
    }

    /// The frequency below which a part of its energy lies.
    fn edge_hz(&self, part: f64) -> f64 {
        let all: f64 = self.bins.iter().map(|bin| bin * bin).sum();
        let mut below = 0.0;
        let edge = self.bins.iter().position(|bin| {
            below += bin * bin;
            below >= part * all
        });
        edge.unwrap() as f64 * self.bin_hz
    }
}

#[test]
fn the_wall_throws_the_cars_sound_and_the_truck_hides_it() {
    let production = open("car");
    let mut ways: [Vec<(f64, Vec<Arrival>)>; 2] = Default::default();
    for line in production.channel_lines().unwrap() {
        if let ChannelLine::Thread(key) = line.unwrap() {
            ways[usize::from(key.path > 0)].push((key.time_s, key.value.to_vec()));
        }
    }
    let [direct, echo] = &ways;
    // The car's image behind the wall, which at 1, 3, 5 and 7 s halves the angle at its axis in the ground plan.
    let (car, axis) = ([0.0, 0.6, -10.0], [12.0, -12.0]);
    let unit = |x: f64, z: f64| [x / x.hypot(z), z / x.hypot(z)];
    let (a, b) = (unit(car[0] - axis[0], car[2] - axis[1]), unit(-axis[0], -axis[1]));
    let normal = unit(a[0] + b[0], a[1] + b[1]);
    let behind = (car[0] - axis[0]) * normal[0] + (car[2] - axis[1]) * normal[1];
    let image = [car[0] - 2.0 * behind * normal[0], car[2] - 2.0 * behind * normal[1]];
    for (ear, x) in [-0.09, 0.09].into_iter().enumerate() {
        let image_s = ((image[0] - x).powi(2) + (car[1] - 1.6_f64).powi(2) + image[1].powi(2)).sqrt() / 343.0;
        for mirror_s in [1.0, 3.0, 5.0, 7.0] {
            let nearest = |a: &&(f64, Vec<Arrival>)| (a.0 - mirror_s).abs();
            let at = echo.iter().min_by(|a, b| nearest(a).total_cmp(&nearest(b))).unwrap();
            let off = (at.1[ear].delay_s - image_s) * RATE_HZ;
            assert!(off.abs() < 1.0, "{off} samples at {} s", at.0);
        }
        // It is loudest where the wall is a mirror, heard from the right.
        let loudest = |from_s: f64| {
            let near = echo.iter().filter(|key| (key.0 - from_s).abs() < 0.9);
            near.max_by(|a, b| a.1[ear].gain.total_cmp(&b.1[ear].gain)).unwrap()
        };
        for mirror_s in [1.0, 5.0] {
            let (time_s, heard) = loudest(mirror_s);
            assert!((time_s - mirror_s).abs() < 0.07, "{time_s}");
            assert!(ear == 0 || (0.4..0.5).contains(&heard[ear].gain), "{}", heard[ear].gain);
        }
        // Behind the truck there is a tenth left and little more: half of −2.1 dB, then 18 dB less, and back.
        let db = |key: &(f64, Vec<Arrival>)| 20.0 * key.1[ear].gain.log10();
        let (first, least) = (db(&direct[0]), direct.iter().map(db).fold(f64::MAX, f64::min));
        assert!((17.0..20.0).contains(&(first - least)), "{first} {least}");
        assert_eq!(db(direct.last().unwrap()), first);
        let hidden = |key: &&(f64, Vec<Arrival>)| db(key) < first - 12.0;
        let dark: Vec<f64> = direct.iter().filter(hidden).map(|key| key.0).collect();
        assert!((dark[0] - 2.65).abs() < 0.05 && (dark[dark.len() - 1] - 3.35).abs() < 0.05, "{dark:?}");
        for pair in direct.windows(2).filter(|pair| pair[1].0 > pair[0].0) {
            let slope = (db(&pair[1]) - db(&pair[0])).abs() / ((pair[1].0 - pair[0].0) * 1000.0);
            assert!(slope < 0.5, "{slope} dB/ms at {}", pair[0].0);
        }
    }
}

#[test]
fn every_bee_is_told_how_fast_it_flies() {
    let production = open("bees");
    let mut speeds: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
    for line in production.object_lines().unwrap() {
        if let ObjectLine::Cue(cue) = line.unwrap()
            && let Action::Set(values) = cue.action
        {
            assert_eq!(values[0].0, "speed");
            speeds.entry(cue.thread).or_default().push(values[0].1);
        }
    }
    assert_eq!(speeds.len(), 12);
    // The swarm itself comes and goes at 1 to 5 m/s; 3 m/s more or less each.
    for told in speeds.values() {
        let mean = told.iter().sum::<f64>() / told.len() as f64;
        assert!((3.0..7.0).contains(&mean), "{mean} m/s");
    }
    // All twelve are close by in the middle: at least ten times as loud as at the beginning.
    let sound = render("bees");
    let level = |from_s: usize| {
        let part = &sound.mix[from_s * 96_000..(from_s + 1) * 96_000];
        10.0 * (part.iter().map(|&s| f64::from(s).powi(2)).sum::<f64>() / part.len() as f64).log10()
    };
    assert!(
        level(4) - level(0) > 14.0 && level(4) - level(8) > 14.0,
        "{} {} {}",
        level(0),
        level(4),
        level(8)
    );
    assert!(sound.mix.iter().all(|s| s.abs() < 0.9));
}

#[test]
fn a_string_and_a_bar_have_the_partials_of_the_readme() {
    let sound = render("struck");
    let fundamental = 147.0;
    let level = |plucked: &Spectrum, n: f64| plucked.line(n * fundamental, 0.01).1;
    let middle = spectrum(&sound, "string", 0.05, 1.5);
    for n in [2.0, 4.0, 6.0, 8.0] {
        let missing = level(&middle, n - 1.0) - level(&middle, n);
        assert!(missing > 60.0, "partial {n} is {missing} dB down");
    }
    // Plucked at a fifth, after the first pluck has died away: the fifth partial is missing, the second there.
    let fifth = spectrum(&sound, "string", 2.05, 1.4);
    let missing = level(&fifth, 4.0) - level(&fifth, 5.0);
    assert!(missing > 20.0, "partial 5 is {missing} dB down");
    assert!(level(&fifth, 1.0) - level(&fifth, 2.0) < 20.0);

    let bar = spectrum(&sound, "bar", 5.02, 0.5);
    let hard: Vec<(f64, f64)> = [1.0, 2.756, 5.404].map(|ratio| bar.line(523.25 * ratio, 0.02)).to_vec();
    for (line, ratio) in hard.iter().zip([1.0, 2.756, 5.404]) {
        assert!((line.0 / hard[0].0 / ratio - 1.0).abs() < 0.002, "{} Hz for {ratio}", line.0);
    }
    // A soft mallet leaves the third partial out.
    let soft = spectrum(&sound, "bar", 6.52, 0.5);
    let third = |bar: &Spectrum| bar.line(523.25, 0.02).1 - bar.line(523.25 * 5.404, 0.02).1;
    assert!(third(&soft) - third(&bar) > 15.0, "{} {}", third(&soft), third(&bar));

    // The bell's nominal is strong on the bow and weak at the waist, where the hum is.
    let at = |from_s: f64| spectrum(&sound, "bell", from_s, 0.8);
    let (bow, waist) = (at(9.52), at(11.52));
    let nominal = |bell: &Spectrum| bell.line(2.0 * 587.33, 0.01).1 - bell.line(0.5 * 587.33, 0.01).1;
    assert!(nominal(&bow) - nominal(&waist) > 12.0, "{} {}", nominal(&bow), nominal(&waist));
}

#[test]
fn what_slides_faster_is_brighter() {
    let sound = render("sandpaper");
    // The middles of a slow and a fast stroke: 0.393 and 1.047 m/s.
    let slow = spectrum(&sound, "block", 0.65, 0.1).edge_hz(0.99);
    let fast = spectrum(&sound, "block", 3.32, 0.06).edge_hz(0.99);
    assert!((fast / slow / (1.047 / 0.393) - 1.0).abs() < 0.1, "{slow} Hz, {fast} Hz");
    // The finger slips every 0.3 mm: at 0.393 m/s that is 1309 Hz.
    let squeak = spectrum(&sound, "finger", 5.785, 0.03).line(1309.0, 0.1).0;
    assert!((squeak / 1309.0 - 1.0).abs() < 0.03, "{squeak} Hz");
    // The cane is silent where it rests, though its sound goes on.
    let loudest = |from_s: f64, to_s: f64| {
        let [from, to] = [from_s, to_s].map(|time_s| (time_s * RATE_HZ) as usize * 2);
        sound.stem("cane")[from..to].iter().fold(0.0_f32, |most, s| most.max(s.abs()))
    };
    assert_eq!(loudest(0.1, 6.9), 0.0);
    assert!(loudest(7.2, 7.4) > 0.05 && loudest(7.6, 7.7) < 0.001 && loudest(8.3, 8.6) == 0.0);
}

#[test]
fn a_wire_sings_as_the_wind_blows() {
    let production = open("wind");
    let sound = render("wind");
    let told: Vec<(f64, f64)> = production
        .object_lines()
        .unwrap()
        .filter_map(|line| match line.unwrap() {
            ObjectLine::Cue(cue) if cue.thread == 2 => match cue.action {
                Action::Set(values) => Some((cue.time_s, values[0].1)),
                Action::Strike(_) | Action::Grain(_) => None,
            },
            _ => None,
        })
        .collect();
    let speed = |time_s: f64| told.iter().find(|(t, _)| (t - time_s).abs() < 0.06).unwrap().1;
    for time_s in [0.5, 1.6, 4.5, 6.5] {
        let sings = 0.2 * speed(time_s) / 0.002;
        let found = spectrum(&sound, "wire", time_s - 0.1, 0.2).edge_hz(0.5);
        assert!((found / sings - 1.0).abs() < 0.15, "{found} Hz for {sings} Hz at {time_s} s");
    }
    assert_eq!(count_by_object(&production).len(), 3);
}

#[test]
fn the_hall_answers_and_its_pillar_hides_the_bell() {
    let production = open("hall");
    let bell: Vec<(f64, u32, Verb, Arrival)> = production
        .channel_lines()
        .unwrap()
        .filter_map(|line| line.unwrap().statement().cloned())
        .filter(|line| line.thread == 2)
        .map(|line| (line.time_s, line.path, line.verb, line.value[0]))
        .collect();
    // The source itself and 24 images.
    assert_eq!(bell.iter().map(|line| line.1).max(), Some(24));
    let level = |time_s: f64| {
        let direct = bell.iter().filter(|(at_s, path, ..)| *path == 0 && (at_s - time_s).abs() < 0.05);
        let length = |m: [f64; 3]| m.iter().map(|c| c * c).sum::<f64>().sqrt();
        let levels: Vec<f64> = direct.map(|(.., to)| to.gain.abs() * length(to.from_m.unwrap())).collect();
        20.0 * (levels.iter().sum::<f64>() / levels.len() as f64).log10()
    };
    let (open, hidden) = (level(7.0), level(9.5));
    assert!((hidden - open + 18.0).abs() < 2.0, "{open} {hidden}");
    assert!((level(12.5) - open).abs() < 0.5, "{}", level(12.5));
    let sound = render("hall");
    let ears = [sound.channel(0), sound.channel(1)];
    let energy = |from_s: f64, to_s: f64| -> f64 {
        let part = (from_s * RATE_HZ) as usize..(to_s * RATE_HZ) as usize;
        ears.iter().flat_map(|ear| &ear[part.clone()]).map(|s| s * s).sum()
    };
    // What the hall says to the blocks dies away by 60 dB in about two seconds.
    let fall_db = 10.0 * (energy(0.6, 0.8) / energy(1.6, 1.8)).log10();
    assert!((20.0..45.0).contains(&fall_db), "{fall_db} dB in a second");
}

#[test]
fn the_sheet_and_the_table_make_a_comb_that_moves() {
    const LENGTH: usize = 1024;
    let sound = render("sheet");
    let samples = sound.channel(0);
    let bins = 20..400;
    // The noise in decibels over a tenth of a second.
    let measured = |time_s: f64| -> Vec<f64> {
        let fft = realfft::RealFftPlanner::<f64>::new().plan_fft_forward(LENGTH);
        let (mut spectrum, mut sums) = (fft.make_output_vec(), vec![0.0; LENGTH / 2 + 1]);
        let begin = ((time_s - 0.05) * RATE_HZ) as usize;
        for at in (begin..begin + 4800 - LENGTH).step_by(LENGTH / 4) {
            let window = |n: usize| 0.5 - 0.5 * (std::f64::consts::TAU * n as f64 / LENGTH as f64).cos();
            let mut part: Vec<f64> = (0..LENGTH).map(|n| window(n) * samples[at + n]).collect();
            fft.process(&mut part, &mut spectrum).unwrap();
            sums.iter_mut().zip(&spectrum).for_each(|(sum, value)| *sum += value.norm_sqr());
        }
        sums[bins.clone()].iter().map(|sum| 10.0 * sum.log10()).collect()
    };
    // And what the sheet and its image at a height make of white noise.
    let theory = |height_m: f64, axis: [f64; 3]| -> Vec<f64> {
        let ways = [(1.0, 1.0), (-1.0, 0.95f64.sqrt())].map(|(side, gain)| {
            let way = [0.9, 0.5 - side * height_m, 0.5];
            let length_m = way.iter().map(|c| c * c).sum::<f64>().sqrt();
            let along = axis[0] * way[0] + side * axis[1] * way[1] + axis[2] * way[2];
            (gain * along / length_m / length_m, length_m)
        });
        let power = |bin: usize| {
            let omega = std::f64::consts::TAU * bin as f64 * RATE_HZ / LENGTH as f64 / 343.0;
            let sum = |part: fn(f64) -> f64| -> f64 {
                ways.iter().map(|(gain, length_m)| gain * part(omega * length_m)).sum()
            };
            sum(f64::cos).powi(2) + sum(f64::sin).powi(2)
        };
        bins.clone().map(|bin| 10.0 * (power(bin) + 1e-9).log10()).collect()
    };
    let alike = |a: &[f64], b: &[f64]| {
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
        let (a_mean, b_mean) = (mean(a), mean(b));
        let product = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            a.iter().zip(b).map(|(a, b)| of(a - a_mean, b - b_mean)).sum()
        };
        product(&|a, b| a * b) / (product(&|a, _| a * a) * product(&|_, b| b * b)).sqrt()
    };
    for (time_s, axis) in [
        (1.0, [0.0, 1.0, 0.0]),
        (1.5, [0.0, 1.0, 0.0]),
        (5.0, [0.0, 1.0, 0.0]),
        (7.0, [0.9, 0.0, 0.5]),
        (8.0, [0.9, 0.0, 0.5]),
        (11.0, [0.9, 0.0, 0.5]),
    ] {
        let within_s: f64 = if time_s < 6.0 { time_s } else { time_s - 6.0 };
        let height_m = 0.5 - 0.48 * (within_s.min(6.0 - within_s) / 2.5).min(1.0);
        let found = measured(time_s);
        let there = alike(&found, &theory(height_m, axis));
        assert!(there > 0.55, "at {time_s} s: {there}");
        for off_m in [-0.03, 0.03] {
            let elsewhere = alike(&found, &theory(height_m + off_m, axis));
            assert!(elsewhere < there - 0.2, "at {time_s} s, {off_m} m off: {elsewhere}, {there}");
        }
    }
    // On the table, lying, low sounds cancel; standing, they add.
    let low = |time_s: f64| measured(time_s)[..20].iter().sum::<f64>() / 20.0;
    assert!(low(8.75) > low(2.75) + 12.0, "{} {}", low(8.75), low(2.75));
}

#[test]
fn each_punch_is_heard_in_its_own_ear() {
    let sound = render("sleeves");
    let ears = [sound.channel(0), sound.channel(1)];
    let level_db = |ear: usize, from_s: f64| {
        let part = &ears[ear][(from_s * RATE_HZ) as usize..((from_s + 0.3) * RATE_HZ) as usize];
        10.0 * part.iter().map(|s| s * s).sum::<f64>().log10()
    };
    for second in 0..4 {
        // The left arm goes out on the second, the right one half a second later.
        for (near, from_s) in [(0, f64::from(second)), (1, f64::from(second) + 0.5)] {
            let (loud, soft) = (level_db(near, from_s), level_db(1 - near, from_s));
            assert!(loud > soft + 6.0, "at {from_s} s: {loud} dB near, {soft} dB far");
        }
    }
}

#[test]
fn the_skirt_swishes_along_the_dancer_and_pops() {
    let production = open("dress");
    let cues = production.object_lines().unwrap().filter_map(|line| match line.unwrap() {
        ObjectLine::Cue(cue) => Some(cue.action),
        _ => None,
    });
    let pops = cues.filter(|action| matches!(action, Action::Grain(_))).count();
    assert!((50..2000).contains(&pops), "{pops}");
    let sound = render("dress");
    let samples = sound.channel(0);
    // The root mean square over tenths of a second: swishes, and near silence between them.
    let mut levels: Vec<f64> = samples
        .chunks_exact(RATE_HZ as usize / 10)
        .map(|part| 10.0 * (part.iter().map(|s| s * s).sum::<f64>() / part.len() as f64).log10())
        .collect();
    levels.sort_by(f64::total_cmp);
    let (quiet, loud) = (levels[levels.len() / 5], levels[levels.len() * 9 / 10]);
    assert!(loud > quiet + 12.0, "{quiet} {loud}");
}

#[test]
fn paper_that_flips_five_times_flaps_five_times() {
    let starts = starts(&open("paper-flip"));
    let loudest = starts.iter().map(|(.., gain)| *gain).fold(0.0, f64::max);
    let loud: Vec<&(f64, Start, f64)> = starts.iter().filter(|(.., gain)| *gain > 0.5 * loudest).collect();
    assert_eq!(loud.len(), 5, "{loud:?}");
    for ((time_s, start, _), flip_s) in loud.into_iter().zip([1.48, 2.27, 3.08, 3.77, 4.72]) {
        // Clips begin some milliseconds before.
        assert!((time_s + 0.01 - flip_s).abs() < 0.03, "{time_s}");
        assert!(start.cause.contains("sheet crumples") && start.object == "sheet", "{start:?}");
    }
}

#[test]
fn paper_rubs_as_it_is_held_and_then_as_it_is_free() {
    let production = open("paper-slide");
    let paper = PaperSound::named("synthetic/printer", Path::new("")).unwrap();
    // How much of what sounds is unconstrained, by tenths of a second.
    let mut free: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
    for line in production.object_lines().unwrap() {
        let ObjectLine::Cue(cue) = line.unwrap() else { continue };
        let Action::Set(values) = cue.action else { continue };
        for (name, value) in values {
            let number: usize = name.trim_start_matches("friction-").parse().unwrap();
            let is_free = paper.spectra()[number].border_m > 0.0;
            free.entry((10.0 * cue.time_s) as usize).or_default()[usize::from(is_free)] += value;
        }
    }
    let share = |from: usize, to: usize| {
        let [held, loose] =
            free.range(from..to).fold([0.0; 2], |sum, (_, of)| [sum[0] + of[0], sum[1] + of[1]]);
        loose / (held + loose)
    };
    assert!(share(0, 15) < 0.05 && share(31, 44) > 0.8, "{} {}", share(0, 15), share(31, 44));
    let sound = render("paper-slide");
    let still = &sound.channel(0)[(4.75 * RATE_HZ) as usize..];
    assert!(still.iter().all(|s| s.abs() < 1e-6), "silent when still");
}

#[test]
fn the_wall_mirrors_the_paper() {
    let production = open("paper-wall");
    let paths: BTreeSet<u32> = production
        .channel_lines()
        .unwrap()
        .filter_map(|line| line.unwrap().statement().map(|line| line.path))
        .collect();
    assert_eq!(paths, BTreeSet::from([0, 1]));
}
