//! The tower from Blender and the log of the physics engine, as real recordings of wood and stone sound where they are there,
//! and as the synthetic ones of the examples where they are not.

mod data;
mod studio;

use std::path::PathBuf;

use data::data;
use froufrou::corpus::dictionary::builder::{self, Options};
use froufrou::render::production::Production;
use froufrou::scene::Scene;
use froufrou::score::{ObjectLine, Verb};
use studio::{Studio, Take};

const RATE_HZ: u32 = 44_100;

fn examples() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

/// What bodies do, and recordings of it.
type Recordings<'a> = &'a [(&'a str, &'a [&'a str])];

/// Makes the scene of an example anew in a studio, with a corpus of recordings in the place of each of its own.
fn workshop(example: &str, corpora: &[(&str, Recordings<'_>)]) -> Studio {
    let studio = Studio::new();
    let folder = examples().join(example);
    for entry in std::fs::read_dir(&folder).unwrap() {
        let entry = entry.unwrap();
        if entry.path().is_file() {
            std::fs::copy(entry.path(), studio.path(&entry.file_name().to_string_lossy())).unwrap();
        }
    }
    for (corpus, actions) in corpora {
        let recordings = match data("audio") {
            Some(data) => {
                for (action, names) in *actions {
                    let to = studio.path(&format!("recordings/{corpus}/{action}"));
                    std::fs::create_dir_all(&to).unwrap();
                    for name in *names {
                        let file = name.rsplit('/').next().unwrap();
                        std::fs::copy(data.join(name), to.join(file)).unwrap();
                    }
                }
                studio.path(&format!("recordings/{corpus}"))
            }
            None => folder.join("recordings").join(corpus),
        };
        let built = studio.path(&format!("corpora/{corpus}"));
        builder::build(&recordings, &built, &Options::default(), &mut |_| {}).unwrap();
    }
    studio
}

const WOOD: Recordings<'_> = &[
    (
        "hit",
        &[
            "0ad/attack_impact_arrow_wood_01.ogg",
            "0ad/attack_impact_arrow_wood_04.ogg",
            "0ad/attack_impact_arrow_wood_07.ogg",
            "0ad/attack_impact_shield_wood_01.ogg",
            "0ad/attack_impact_shield_wood_05.ogg",
            "0ad/attack_impact_shield_wood_09.ogg",
            "0ad/attack_impact_shield_wood_13.ogg",
        ],
    ),
    ("roll", &["sonniss_gdc_bundle3/Rolling_Objects_Metallic_Ball_Rolling_On_Concrete_02.ogg"]),
    ("slide", &["extremetuxracer/rock_slide.wav"]),
];

const STONE: Recordings<'_> = &[(
    "hit",
    &[
        "0ad/attack_impact_sling_stone_01.ogg",
        "0ad/attack_impact_sling_stone_04.ogg",
        "0ad/attack_impact_sling_stone_07.ogg",
        "0ad/attack_impact_sling_stone_10.ogg",
    ],
)];

const METAL: Recordings<'_> = &[
    ("hit", &["sonniss_gdc_bundle3/Kitchen_Kitchenware_Drinks_Glasses_Touching_003.ogg"]),
    ("roll", &["sonniss_gdc_bundle3/Marbles_Handling_Marbles_02.ogg"]),
];

/// Renders a workshop's scene; gives when each sound begins and why, and the mix.
fn render(studio: &Studio) -> (Vec<(f64, String)>, Vec<f64>) {
    let scene = std::fs::read_to_string(studio.path("scene.toml")).unwrap();
    let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap();
    assert!(sound.mix.iter().all(|sample| sample.is_finite()));
    let production = Production::open(Scene::open(studio.path("scene.toml"), false).unwrap()).unwrap();
    let lines = production.object_lines().unwrap();
    let starts = lines.filter_map(|line| match line.unwrap() {
        ObjectLine::Thread(line) => match line.verb {
            Verb::Start(start) => Some((line.time_s, start.cause)),
            _ => None,
        },
        _ => None,
    });
    (starts.collect(), sound.channel(0))
}

/// The power between two times, in decibels.
fn level_db(sound: &[f64], from_s: f64, to_s: f64) -> f64 {
    let at = |time_s: f64| ((time_s * f64::from(RATE_HZ)) as usize).min(sound.len());
    let piece = &sound[at(from_s)..at(to_s)];
    10.0 * (piece.iter().map(|v| v * v).sum::<f64>() / piece.len() as f64 + 1e-20).log10()
}

#[test]
fn the_tower_sounds_of_wood() {
    let studio = workshop("tower", &[("wood", WOOD), ("floor", STONE)]);
    let (starts, sound) = render(&studio);
    let first = |cause: &str| starts.iter().find(|(_, c)| c.starts_with(cause)).map(|(time_s, _)| *time_s);
    assert!((first("Ball rolls along Ramp").unwrap() - 0.09).abs() < 0.03);
    // A recording may begin a little before its onset.
    let struck = first("Box/Box0 struck by Ball").unwrap();
    assert!((1.289..1.39).contains(&struck), "{struck}");
    // The blow is far louder than the ball before it, which rolls without a gap and falls in silence.
    let rolling: Vec<f64> =
        (0..16).map(|n| level_db(&sound, 0.2 + 0.05 * f64::from(n), 0.25 + 0.05 * f64::from(n))).collect();
    println!(
        "rolling {rolling:.1?} dB, falling {:.1}, blow {:.1}",
        level_db(&sound, 1.10, 1.115),
        level_db(&sound, 1.39, 1.45)
    );
    assert!(rolling.iter().all(|level| *level > -80.0), "{rolling:?}");
    assert!(level_db(&sound, 1.39, 1.45) > rolling[8] + 6.0);
    let chosen: Vec<&str> = starts.iter().filter_map(|(_, cause)| cause.split(", as ").nth(1)).collect();
    assert!(chosen.iter().collect::<std::collections::BTreeSet<_>>().len() >= 6, "{chosen:?}");
}

#[test]
fn the_log_of_the_physics_engine_sounds_of_wood_stone_and_metal() {
    let studio = workshop("collisions", &[("wood", WOOD), ("stone", STONE), ("coin", METAL)]);
    let (starts, sound) = render(&studio);
    let count = |word: &str| starts.iter().filter(|(_, cause)| cause.contains(word)).count();
    assert!(count("struck by") >= 20 && count("rolls along") >= 1 && count("slides along") >= 1);
    let all = |from_s: f64, to_s: f64| level_db(&sound, from_s, to_s);
    println!("block and ball on the ramp {:.1} dB, at the floor {:.1}", all(0.8, 1.4), all(1.52, 1.6));
    assert!(all(0.8, 1.4) > -80.0 && all(1.52, 1.6) > -60.0);
    for piece in 0..60 {
        let from_s = 0.8 + 0.01 * f64::from(piece);
        assert!(all(from_s, from_s + 0.01) > all(0.8, 1.4) - 20.0, "a gap at {from_s} s");
    }
}
