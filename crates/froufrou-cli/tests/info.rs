//! Runs `froufrou info` on files of every kind.

mod common;

use std::fs;
use std::path::{Path, PathBuf};

use common::{froufrou, good, impact, message, sine, wav};
use serde_json::Value;

/// A folder of the library's fixtures.
fn fixtures(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../froufrou/tests/fixtures").join(folder)
}

/// What the command says of a file, for programs; it must also say something to people.
fn told(file: &Path) -> Value {
    let text = froufrou([Path::new("info"), file]);
    good(&text);
    assert!(String::from_utf8_lossy(&text.stdout).starts_with("kind"), "{}", file.display());
    let output = froufrou([Path::new("info"), file, Path::new("--json")]);
    good(&output);
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn near(value: &Value, expected: f64, tolerance: f64) {
    let found = value.as_f64().unwrap_or(f64::NAN);
    assert!((found - expected).abs() <= tolerance, "{value}, expected {expected}");
}

#[test]
fn recordings_are_measured() {
    let folder = tempfile::tempdir().unwrap();
    // The kind is told by the content, not by the name.
    let file = folder.path().join("sound.flac");
    let tone = sine(48_000, 1000.0, 0.5, 96_000);
    let stereo: Vec<f32> = tone.iter().flat_map(|s| [*s, *s]).collect();
    wav(&file, 48_000, 2, &stereo);
    let told = told(&file);
    assert_eq!((&told["kind"], &told["format"]), (&"recording".into(), &"WAV".into()));
    assert_eq!(
        (&told["rate_hz"], &told["channels"], &told["frames"]),
        (&48_000.into(), &2.into(), &96_000.into())
    );
    near(&told["duration_s"], 2.0, 0.0);
    near(&told["peak_dbfs"], -6.02, 0.01);
    near(&told["true_peak_dbtp"], -6.02, 0.05);
    // EBU Tech 3341: a sine of 1 kHz in both channels has as many LUFS as its peak has dBFS.
    near(&told["loudness_lufs"], -6.02, 0.1);
}

#[test]
fn heads_tell_what_was_measured() {
    let told = told(&fixtures("head").join("sphere.sofa"));
    assert_eq!(told["kind"], "head");
    assert!(told["directions"].as_u64() > Some(10), "{told}");
    // A sphere of 8.75 cm: r / c (π / 2 + 1).
    near(&told["interaural_delay_s"], 656e-6, 30e-6);
    near(&told["elevations_deg"][1], 90.0, 30.0);
    let other = froufrou([Path::new("info"), &fixtures("head").join("other_convention.sofa")]);
    assert!(message(&other).contains("other_convention.sofa"));
}

#[test]
fn silence_has_no_level() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("silence.wav");
    wav(&file, 8000, 1, &[0.0]);
    let told = told(&file);
    assert!(told["peak_dbfs"].is_null() && told["loudness_lufs"].is_null());
    assert_eq!(told["frames"], 1);
}

#[test]
fn every_fixture_of_sound_is_read() {
    for entry in fs::read_dir(fixtures("audio")).unwrap() {
        let file = entry.unwrap().path();
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        let output = froufrou([Path::new("info"), &file]);
        let refused = name.contains("opus") || name.contains("adpcm");
        assert_eq!(output.status.code(), Some(i32::from(refused)), "{name}: {}", message(&output));
        assert_eq!(message(&output).contains(&name), refused);
    }
}

#[test]
fn archives_are_listed() {
    let told = told(&fixtures("alembic").join("topologies.abc"));
    assert_eq!((&told["kind"], &told["format"]), (&"animation".into(), &"Alembic archive".into()));
    let objects = told["objects"].as_array().unwrap();
    let meshes: Vec<&Value> = objects.iter().filter(|o| o["object"] == "mesh").collect();
    assert!(!meshes.is_empty());
    for mesh in &meshes {
        assert!(
            mesh["vertices"].is_u64() && mesh["faces"].is_u64() && mesh["topology"].is_string(),
            "{mesh}"
        );
    }
    for topology in ["constant", "homogeneous", "heterogeneous"] {
        assert!(meshes.iter().any(|mesh| mesh["topology"] == topology), "{topology}");
    }
    for axis in 0..3 {
        let corner = |name: &str| told["bounds_m"][name][axis].as_f64().unwrap();
        assert!(corner("least") <= corner("greatest"));
    }
}

/// The same cloth in four formats, as Blender writes it.
#[test]
fn point_caches_and_obj_are_listed() {
    let folder = fixtures("point_cache");
    let mut extents = Vec::new();
    for (name, format, samples, rate_hz) in [
        ("cloth.pc2", "PC2 point cache", 8, Some(24.0)),
        ("halves.pc2", "PC2 point cache", 15, Some(48.0)),
        ("cloth.mdd", "MDD point cache", 8, Some(25.0)),
        ("frame_*.obj", "OBJ sequence", 8, Some(24.0)),
        ("cloth.obj", "OBJ file", 1, None),
    ] {
        let told = told(&folder.join(name));
        assert_eq!((&told["kind"], &told["format"]), (&"animation".into(), &format.into()));
        let [object] = told["objects"].as_array().unwrap().as_slice() else { panic!("{told}") };
        assert_eq!((&object["samples"], &object["vertices"]), (&samples.into(), &35.into()), "{name}");
        assert_eq!(object["topology_changes"], 0);
        let faces = if name == "halves.pc2" { 0 } else { 24 };
        assert_eq!((&object["faces"], &object["most_faces"]), (&faces.into(), &faces.into()), "{name}");
        if let Some(rate_hz) = rate_hz {
            near(&object["rate_hz"], rate_hz, 1e-5);
            extents.push((0..3).map(|axis| told["bounds_m"]["greatest"][axis].as_f64().unwrap()).collect());
        }
    }
    let extents: Vec<Vec<f64>> = extents;
    for axis in 0..3 {
        // The cache of half frames may reach farther.
        for extent in [&extents[2], &extents[3]] {
            assert!((extent[axis] - extents[0][axis]).abs() < 1e-5, "{extents:?}");
        }
    }
    // A cloth that is torn, then whole again, once with a frame missing.
    let folder = tempfile::tempdir().unwrap();
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 0 2\nf 1 2 3\n";
    for (frame, more) in [(1, ""), (2, "v 5 0 0\n"), (4, "v 5 1 0\nf 2 3 4\n"), (5, "")] {
        fs::write(folder.path().join(format!("torn{frame}.obj")), format!("{triangle}{more}")).unwrap();
    }
    let told = told(&folder.path().join("torn*.obj"));
    let object = &told["objects"][0];
    assert_eq!((&object["path"], &object["topology_changes"]), (&"/torn".into(), &3.into()));
    assert_eq!((&object["vertices"], &object["most_vertices"]), (&3.into(), &4.into()));
    assert_eq!((&object["most_faces"], &told["facts"]["files"]), (&2.into(), &"4".into()));
    assert_eq!(told["bounds_m"]["greatest"], serde_json::json!([5.0, 1.0, 2.0]));
    near(&told["times_s"]["to"], 5.0 / 24.0, 1e-12);
}

#[test]
fn gltf_files_are_listed_with_their_clips() {
    let told = told(&fixtures("gltf").join("skin.glb"));
    assert_eq!((&told["kind"], &told["format"]), (&"animation".into(), &"glTF file".into()));
    assert_eq!(told["facts"]["clips"], "bend (0 to 1 s), stand (0 to 1 s), swell (0 to 1 s)");
    let body = told["objects"].as_array().unwrap().iter().find(|o| o["path"] == "/body").unwrap();
    assert_eq!((&body["object"], &body["topology"]), (&"mesh".into(), &"homogeneous".into()));
    assert_eq!((&body["vertices"], &body["faces"]), (&42.into(), &72.into()));
    for axis in 0..3 {
        let corner = |name: &str| told["bounds_m"][name][axis].as_f64().unwrap();
        assert!(corner("least") < corner("greatest"));
    }
    // In one place at all times: what moves reaches farther than its first mesh.
    let told = self::told(&fixtures("gltf").join("interpolation.gltf"));
    let reach = |name: &str| told["bounds_m"][name][0].as_f64().unwrap();
    assert!(reach("greatest") - reach("least") > 1.5);
}

#[test]
fn usd_files_are_listed_with_their_unit() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../froufrou/tests/usd");
    for (name, up) in [("baked.usda", "Z"), ("y_up.usdc", "Y"), ("skeleton.usdz", "Z")] {
        let told = told(&folder.join(name));
        let kind = (&told["format"], &told["facts"]["up"]);
        assert_eq!(kind, (&"USD file".into(), &format!("+{up}").into()), "{name}");
        let facts = (&told["facts"]["unit"], &told["facts"]["time codes a second"]);
        assert_eq!(facts, (&"1 m".into(), &"24".into()));
        let objects = told["objects"].as_array().unwrap();
        let of = |kind: &str| objects.iter().filter(|o| o["object"] == kind).count();
        assert_eq!((of("mesh"), of("camera")), (5, 1), "{name}");
        let bent = objects.iter().find(|o| o["path"] == "/root/Bent/BentMesh").unwrap();
        assert_eq!(
            (&bent["samples"], &bent["vertices"], &bent["faces"], &bent["topology"]),
            (&25.into(), &16.into(), &13.into(), &"homogeneous".into())
        );
        assert!((bent["rate_hz"].as_f64().unwrap() - 24.0).abs() < 1e-6);
    }
}

#[test]
fn events_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("happened");
    let text =
        [impact(0.5, "a", "b", 0.1), impact(1.5, "b", "c", 0.001), impact(2.0, "b", "c", 2.0)].concat();
    fs::write(&file, text).unwrap();
    let told = told(&file);
    assert_eq!(
        (&told["kind"], &told["events"], &told["kinds"]["impact"]),
        (&"events".into(), &3.into(), &3.into())
    );
    assert_eq!((&told["times_s"]["from"], &told["times_s"]["to"]), (&0.5.into(), &2.0.into()));
    assert_eq!((&told["impulses_ns"]["from"], &told["impulses_ns"]["to"]), (&0.001.into(), &2.0.into()));
    assert_eq!((&told["pairs"][0]["a"], &told["pairs"][0]["events"]), (&"b".into(), &2.into()));
}

#[test]
fn scores_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.toml");
    let text = "froufrou-score 1 object # by hand\nduration 4\nmicrophone main cardioid at 0 1 0\nmicrophone b\n\
        sound hum \"hum.wav\" loop\nhear b 0 at 0 1 2\nstart 1 0.5 hum at -5 0 -1 gain 0.25 object bee\n\
        end 1 4 gain 2\nstart 2 1 hum at 0 0 0\n";
    fs::write(&file, text).unwrap();
    let object = told(&file);
    assert_eq!((&object["space"], &object["order"]), (&"object".into(), &"free".into()));
    assert_eq!(
        (&object["threads"], &object["lines"], &object["microphone_lines"]),
        (&2.into(), &4.into(), &1.into())
    );
    assert_eq!((&object["times_s"]["from"], &object["times_s"]["to"]), (&0.0.into(), &4.0.into()));
    assert_eq!((&object["gains"]["from"], &object["gains"]["to"]), (&0.25.into(), &2.0.into()));
    assert_eq!(
        (&object["microphones"][0]["position_m"][1], &object["sounds"][0]["threads"]),
        (&1.0.into(), &2.into())
    );
    assert_eq!(
        (&object["objects"][0]["name"], &object["threads_without_object"]),
        (&"bee".into(), &1.into())
    );

    let text = "froufrou-score 1 channel\norder time\nchannels l r\nsound hit \"hit.wav\"\nstart 1 0 hit 1 0 0.5 0.1\n";
    fs::write(&file, text).unwrap();
    let channel = told(&file);
    assert_eq!((&channel["space"], &channel["channels"][1]), (&"channel".into(), &"r".into()));
    assert_eq!((&channel["gains"]["from"], &channel["gains"]["to"]), (&0.5.into(), &1.0.into()));
}

#[test]
fn contact_logs_are_counted_packed_or_not() {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let mut text = "time, bodyA, bodyB, Fn\n".to_owned();
    for step in 0..100 {
        text += &format!(
            "{}, ball, {}, 9.8\n",
            f64::from(step) / 240.0,
            if step < 50 { "ramp" } else { "floor" }
        );
    }
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packer.write_all(text.as_bytes()).unwrap();
    for (name, bytes, compressed) in
        [("log.csv", text.clone().into_bytes(), false), ("log", packer.finish().unwrap(), true)]
    {
        let file = folder.path().join(name);
        fs::write(&file, bytes).unwrap();
        let told = told(&file);
        assert_eq!((&told["kind"], &told["compressed"]), (&"contact_log".into(), &compressed.into()));
        assert_eq!((&told["rows"], &told["columns"][3]), (&100.into(), &"Fn".into()));
        near(&told["step_s"], 1.0 / 240.0, 1e-6);
        near(&told["times_s"]["to"], 99.0 / 240.0, 1e-12);
        assert_eq!(told["bodies"], serde_json::json!(["ball", "floor", "ramp"]));
    }
}

#[test]
fn scenes_are_checked_with_their_files() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.toml");
    fs::copy(fixtures("alembic").join("nesting.abc"), folder.path().join("a.abc")).unwrap();
    wav(&folder.path().join("hum.wav"), 8000, 1, &[0.5; 800]);
    fs::write(folder.path().join("log.csv"), "t,a,b,x,y,z,F\n").unwrap();
    let text = "rate = 96000\nseed = 5\n[listener]\nposition = [0, 1, 2]\n[[object]]\nname = \"bee\"\n\
        track = [{ t = 0, position = [0, 0, 0] }, { t = 2.5, position = [1, 0, 0] }]\n\
        sound = { recording = \"hum.wav\", loop = true }\n[[object]]\nname = \"all\"\nsource = \"a.abc#/**\"\n\
        [[contacts]]\nlog = \"log.csv\"\n\
        columns = { t = \"t\", a = \"a\", b = \"b\", position = [\"x\", \"y\", \"z\"], normal_force = \"F\" }\n";
    fs::write(&file, text).unwrap();
    let findings_of = told;
    let told = told(&file);
    assert_eq!(
        (&told["kind"], &told["rate_hz"], &told["seed"]),
        (&"scene".into(), &96_000.into(), &5.into())
    );
    assert_eq!(told["microphones"].as_array().map(Vec::len), Some(2));
    assert_eq!((&told["objects"][0]["name"], &told["sounds"][0]["object"]), (&"bee".into(), &"bee".into()));
    assert!(told["objects"][1]["bodies"].as_array().unwrap().len() > 1);
    assert!(told["motion_end_s"].as_f64().unwrap() >= 2.5);

    assert_eq!((&told["room"], &told["planes"]), (&serde_json::Value::Null, &0.into()));

    // A room of 5 by 3 by 4 m whose walls take 20 %: 24 ln 10 V / (c S (−ln 0.8)).
    let hall = folder.path().join("hall.toml");
    fs::write(&hall, "[room]\nsize = [5, 3, 4]\nabsorption = 0.2\norder = 3\n").unwrap();
    let room = &findings_of(&hall)["room"];
    assert_eq!((&room["images"], &room["order"]), (&62.into(), &3.into()));
    let eyring_s = 24.0 * 10f64.ln() * 60.0 / (343.0 * 94.0 * -(0.8f64.ln()));
    near(&room["reverberation_s"][4], eyring_s, 1e-9);
    let text_of_hall = String::from_utf8(froufrou([Path::new("info"), &hall]).stdout).unwrap();
    assert!(text_of_hall.contains("5 × 3 × 4 m, 62 images of a source"), "{text_of_hall}");
    assert!(text_of_hall.contains("0.46, 0.46"), "{text_of_hall}");

    let refused = |text: &str| {
        fs::write(&file, text).unwrap();
        let output = froufrou([Path::new("info"), &file]);
        assert_eq!(output.status.code(), Some(1));
        message(&output)
    };
    let fault = refused(&text.replace("hum.wav", "hmm.wav"));
    assert!(fault.contains("scene.toml:8:") && fault.contains("there is no file \"hmm.wav\""), "{fault}");
    let fault = refused(&text.replace("\"F\"", "\"Fn\""));
    assert!(fault.contains("log.csv:1: there is no column `Fn`"), "{fault}");
    let fault = refused(&text.replace("#/**", "#/Bee"));
    assert!(fault.contains("a.abc:/Bee: no object of the file has this path"), "{fault}");
    let outside = folder.path().join("inner");
    fs::create_dir(&outside).unwrap();
    let inner = outside.join("scene.toml");
    fs::write(
        &inner,
        text.replace("a.abc", "../a.abc").replace("hum.wav", "../hum.wav").replace("log.csv", "../log.csv"),
    )
    .unwrap();
    assert_eq!(froufrou([Path::new("info"), &inner]).status.code(), Some(1));
    good(&froufrou([Path::new("info"), &inner, Path::new("--allow-outside")]));
}

#[test]
fn what_is_not_read_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("noise.bin"), [0, 1, 2, 0xfe, 0xff]).unwrap();
    fs::write(at("empty"), "").unwrap();
    fs::write(at("rows.csv"), "t,a,b\n0,x,y\n1,x\n").unwrap();
    fs::write(at("late.csv"), "t,a,b\nsoon,x,y\n").unwrap();
    fs::write(at("cut.abc"), b"Ogawa\xff\0\x01").unwrap();
    fs::write(at("endless.csv"), format!("t,a,b\n0,\"{}", "x".repeat(3 << 20))).unwrap();
    let cases: [(PathBuf, &str); 8] = [
        (at("noise.bin"), "noise.bin: the file is of no known kind (read are scenes"),
        (at("empty"), "empty: the file is empty"),
        (at("missing.toml"), "missing.toml: cannot open the file"),
        (folder.path().to_owned(), "expected a file, found a folder"),
        (at("rows.csv"), "rows.csv:3: expected 3 fields, as in the header, found 2"),
        (at("late.csv"), "late.csv:2: column `t`: expected a time, found \"soon\""),
        (at("cut.abc"), "cut.abc:"),
        (at("endless.csv"), "a record longer than"),
    ];
    for (file, expected) in cases {
        let output = froufrou([Path::new("info"), &file]);
        assert_eq!(output.status.code(), Some(1), "{}", file.display());
        assert!(message(&output).contains(expected), "{}", message(&output));
        assert!(output.stdout.is_empty());
    }
    for arguments in [&["info"][..], &["info", "a.wav", "--colour"], &["infos", "a.wav"]] {
        assert_eq!(froufrou(arguments).status.code(), Some(2), "{arguments:?}");
    }
}

/// Real files, where they are: in the folder `FROUFROU_DATA`, else beside the workspace.
#[test]
fn real_files_are_read() {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("FROUFROU_DATA").map_or(beside, PathBuf::from);
    if !data.is_dir() {
        eprintln!("skipped: there is no folder {}; set FROUFROU_DATA", data.display());
        return;
    }
    let tower = told(&data.join("anim/tower.abc"));
    assert_eq!(tower["facts"]["written by"], "Blender");
    assert_eq!(tower["objects"].as_array().map(Vec::len), Some(26));
    let log = told(&data.join("contacts/pybullet_mixed_1kHz_contacts.csv.gz"));
    assert_eq!((&log["rows"], log["bodies"].as_array().map(Vec::len)), (&80_826.into(), Some(10)));
    near(&log["step_s"], 0.001, 1e-6);
}
