//! Scenes with cloth, all the way from meshes to samples.

mod data;
mod studio;

use data::data;
use froufrou::corpus::cloth::{ClothSound, spectra};
use froufrou::motion::Event;
use froufrou::score::{ObjectLine, Statement, Verb};
use studio::{Studio, Take};

const RATE_HZ: u32 = 48_000;
const FRAMES: usize = 120;
const FPS: f64 = 60.0;
const CELLS: usize = 16;

/// A sheet of a square metre, whose vertices are somewhere at a time.
fn sheet(studio: &Studio, name: &str, place: impl Fn(f64, [f64; 2]) -> [f64; 3]) {
    studio.sheet(name, CELLS, (FRAMES, FPS), place);
}

/// A scene of a sheet above a floor, heard from high above.
fn scene(studio: &Studio, cloth: &str) -> String {
    studio.file("floor.obj", "v -4 0 -4\nv -4 0 4\nv 4 0 4\nv 4 0 -4\nf 1 2 3 4\n");
    format!(
        "seed = 2\nduration = 2.2\nspeed_of_sound = 343\n[[microphone]]\nname = 'm'\nposition = [0, 20, 0]\n\
         [material.linen]\ncloth = {cloth}\n\
         [[object]]\nname = 'sheet'\nsource = 'sheet.pc2#/*'\nframe_rate = 60\nmaterial = 'linen'\n\
         [[object]]\nname = 'floor'\nsource = 'floor.obj#/*'\nmaterial = 'stone'\n[material.stone]\n"
    )
}

const SPEED_MPS: f64 = 0.5;

/// It is dragged for a second, and then it rests.
fn dragged(time_s: f64, [x, z]: [f64; 2]) -> [f64; 3] {
    [x - 0.25 + SPEED_MPS * time_s.min(1.0), 0.01, z]
}

fn power(sound: &[f64], from_s: f64, to_s: f64) -> f64 {
    let at = |time_s: f64| (time_s * f64::from(RATE_HZ)) as usize;
    let piece = &sound[at(from_s)..at(to_s)];
    piece.iter().map(|v| v * v).sum::<f64>() / piece.len() as f64
}

#[test]
fn a_dragged_sheet_is_as_loud_as_its_area_and_speed_say() {
    let studio = Studio::new();
    sheet(&studio, "sheet", dragged);
    for model in ["cotton", "windbreaker"] {
        let scene = scene(&studio, &format!("{{ corpus = 'synthetic/{model}', floor_speed = 0.1 }}"));
        let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap().channel(0);
        let cloth = ClothSound::named(&format!("synthetic/{model}"), &studio.path("")).unwrap();
        let friction = cloth.friction().unwrap();
        let density = friction.spectra.at(SPEED_MPS);
        // One square metre at 20 m; the densities are amplitudes in a hertz.
        let wanted = spectra::power(&density, friction.spectra.spacing_hz()) / friction.area_m2 / 400.0;
        let off_db = 10.0 * (power(&sound, 0.2, 0.95) / wanted).log10();
        println!("{model}: {off_db:.2} dB off");
        assert!(off_db.abs() < 0.7, "{model}: {off_db} dB");
        // The last frame that slides, the way to the microphone, a frame of noise, and the gap.
        assert_eq!(power(&sound, 1.25, 2.2), 0.0, "{model}: what rests is silent");
    }
}

#[test]
fn other_materials_may_sound_different_along_it() {
    let studio = Studio::new();
    sheet(&studio, "sheet", dragged);
    let render = |cloth: &str| studio.scene(&scene(&studio, cloth), Take::at(RATE_HZ)).unwrap().channel(0);
    let along = render("{ corpus = 'synthetic/cotton', against = { stone = 'synthetic/corduroy' } }");
    let [along, corduroy, cotton] = [
        along,
        render("'synthetic/corduroy'"),
        render("{ corpus = 'synthetic/cotton', against = { wood = 'synthetic/corduroy' } }"),
    ]
    .map(|sound| 10.0 * power(&sound, 0.2, 0.95).log10());
    assert!((along - corduroy).abs() < 0.3 && (along - cotton).abs() > 1.0, "{along} {corduroy} {cotton} dB");
}

/// A dome that snaps through at 1.2 s.
fn snaps(time_s: f64, [x, z]: [f64; 2]) -> [f64; 3] {
    let height = ((1.2 - time_s) / 0.05).clamp(-1.0, 1.0) * 0.1;
    [x, 1.0 + height * (1.0 - 2.0 * (x * x + z * z)), z]
}

#[test]
fn a_dome_that_snaps_through_pops_then() {
    let studio = Studio::new();
    sheet(&studio, "sheet", snaps);
    let scene = scene(&studio, "'synthetic/cotton'");
    let production = studio.production(&scene).unwrap();
    let events: Vec<_> = production.events().unwrap().map(|event| event.unwrap()).collect();
    assert!(
        !events.is_empty() && events.iter().all(|event| (event.time_s() - 1.2).abs() < 0.02),
        "{events:?}"
    );
    let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap().channel(0);
    let way_s = 19.0 / 343.0;
    assert_eq!(power(&sound, 0.0, 1.1 + way_s), 0.0);
    assert!(power(&sound, 1.17 + way_s, 1.27 + way_s) > 0.0);
    assert_eq!(power(&sound, 1.6 + way_s, 2.2), 0.0);
}

/// Dragged and waving.
fn waving(time_s: f64, [x, z]: [f64; 2]) -> [f64; 3] {
    let [x, y, z] = dragged(time_s, [x, z]);
    [x, y + 0.03 * (1.0 + (9.0 * x + 14.0 * time_s).sin()), z]
}

#[test]
fn ranges_threads_and_the_score_in_between_change_nothing() {
    let studio = Studio::new();
    sheet(&studio, "sheet", waving);
    let scene =
        scene(&studio, "{ corpus = 'synthetic/cotton', patches = 5, jitter = 0.02, least_energy = 0 }");
    let whole = studio.scene(&scene, Take::at(RATE_HZ)).unwrap();
    assert!(whole.mix.iter().any(|v| *v != 0.0));
    let part = Take { from_s: 0.613, to_s: Some(1.3), cores: 1, ..Take::at(RATE_HZ) };
    let part = studio.scene(&scene, part).unwrap();
    let first = (0.613 * f64::from(RATE_HZ)).round() as usize;
    assert!(part.mix[..] == whole.mix[first..first + part.mix.len()]);
    let production = studio.production(&scene).unwrap();
    let starts = production
        .object_lines()
        .unwrap()
        .filter(|line| matches!(line, Ok(ObjectLine::Thread(Statement { verb: Verb::Start(_), .. }))));
    // Pops have threads of patches.
    let threads = starts.count();
    assert!(threads < 100, "{threads}");
    let again = studio.staged(&scene, Take::at(RATE_HZ)).unwrap();
    assert!(again.mix == whole.mix);
}

#[test]
fn cloth_without_a_mesh_and_models_that_are_none_are_told() {
    let studio = Studio::new();
    sheet(&studio, "sheet", dragged);
    let fault = |scene: &str| studio.scene(scene, Take::at(RATE_HZ)).map(|_| ()).unwrap_err().to_string();
    let told = fault(&scene(&studio, "'synthetic/steel'"));
    assert!(told.contains("scene.toml:8") && told.contains("synthetic/cotton"), "{told}");
    let told = fault(&scene(&studio, "{ corpus = 'synthetic/cotton', preset = 'cotton/rug' }"));
    assert!(told.contains("cotton/sheet"), "{told}");
    let flat = scene(&studio, "'synthetic/cotton'")
        .replace("source = 'sheet.pc2#/*'\nframe_rate = 60", "position = [0, 0, 0]");
    let told = fault(&flat);
    assert!(told.contains("sheet: it is of cloth and has no mesh"), "{told}");
}

/// It touches nothing: there is no friction to hear, and as a membrane it is heard in the wind.
#[test]
fn a_flag_is_silent_in_friction_and_heard_as_a_membrane() {
    let Some(path) = data("anim/flag.abc") else { return };
    let studio = Studio::new();
    std::fs::copy(path, studio.path("flag.abc")).unwrap();
    let render = |cloth: &str, wind: &str| {
        let scene = format!(
            "seed = 2\nduration = 6\n{wind}[[microphone]]\nname = 'm'\nposition = [0, 1, 2]\n\
             [material.linen]\ncloth = {{ corpus = 'synthetic/cotton', pops_db = -200{cloth} }}\n\
             [[object]]\nname = 'flag'\nsource = 'flag.abc#/Flag/*'\nmaterial = 'linen'\n"
        );
        let events: Vec<Event> =
            studio.production(&scene).unwrap().events().unwrap().map(|event| event.unwrap()).collect();
        let sound = studio.scene(&scene, Take::at(RATE_HZ)).unwrap().channel(0);
        (events, 10.0 * power(&sound, 1.0, 6.0).max(1e-30).log10())
    };
    let wind = "[wind]\nvelocity = [6, 0, 0]\ngusts = 0.4\n";
    let (events, friction) = render("", wind);
    let area = |event: &Event| event.friction().map_or(0.0, |f| f.area_m2 * f.speed_mps * f.lasts_s);
    assert!(events.iter().map(area).sum::<f64>() < 0.02 * 1.2 * 0.8 * 6.0);
    let (_, still) = render(", membrane = true", "");
    let (events, blown) = render(", membrane = true", wind);
    println!("friction {friction:.1} dB, membrane in still air {still:.1} dB, in the wind {blown:.1} dB");
    assert!(events.iter().any(|event| matches!(event, Event::Flap(flap) if flap.tension_n_per_m > 0.0)));
    assert!(blown > friction + 20.0 && blown > still + 20.0 && blown > -70.0);
}

#[test]
fn a_simulations_forces_are_heard() {
    let studio = Studio::new();
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/alembic/beside.abc");
    std::fs::copy(fixture, studio.path("beside.abc")).unwrap();
    let with = |more: &str| {
        scene(&studio, &format!("{{ corpus = 'synthetic/cotton', floor_speed = 0.05{more} }}"))
            .replace("sheet.pc2#/*", "beside.abc#/sheet")
            .replace("frame_rate = 60\n", "")
    };
    let render = |scene: &str| studio.scene(scene, Take::at(RATE_HZ));
    let sound = render(&with(", force = 'force'")).unwrap().channel(0);
    // The way from there takes 58 ms. It presses four times as hard in the second half: 6 dB.
    let (soft, hard) = (power(&sound, 0.15, 0.5), power(&sound, 0.62, 0.95));
    let louder_db = 10.0 * (hard / soft).log10();
    assert!((louder_db - 6.0).abs() < 1.0, "{louder_db} dB");
    // What was pressed four times as hard in the recordings is as much weaker now.
    let quarter = render(&with(", force = 'force', pressure = 400")).unwrap().channel(0);
    let weaker_db = 10.0 * (power(&sound, 0.1, 0.95) / power(&quarter, 0.1, 0.95)).log10();
    assert!((weaker_db - 6.0).abs() < 0.1, "{weaker_db} dB");
    let refused = |scene: &str| render(scene).err().expect("it cannot be rendered").to_string();
    let fault = refused(&with(", force = 'weight'"));
    assert!(fault.contains("weight") && fault.contains("force, push, shared"), "{fault}");
    sheet(&studio, "sheet", dragged);
    let fault = refused(&scene(&studio, "{ corpus = 'synthetic/cotton', force = 'force' }"));
    assert!(fault.contains("Alembic alone"), "{fault}");
}
