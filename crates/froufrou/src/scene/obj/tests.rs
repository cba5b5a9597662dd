use super::*;
use crate::Place;
use proptest::prelude::*;

fn room() -> tempfile::TempDir {
    tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"))
}

fn write(room: &tempfile::TempDir, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
    let path = room.path().join(name);
    std::fs::write(&path, text).unwrap_or_else(|e| panic!("{e}"));
    path
}

/// The objects of a text, with their meshes.
fn objects(text: impl AsRef<[u8]>) -> Result<Vec<(String, Mesh)>> {
    let room = room();
    let obj = Obj::open(write(&room, "a.obj", text))?;
    let mesh = |index| {
        let mut mesh = Mesh::default();
        obj.mesh(index, 0.0, &mut mesh).map(|()| mesh)
    };
    obj.objects().iter().enumerate().map(|(i, info)| Ok((info.path.clone(), mesh(i)?))).collect()
}

fn one(text: impl AsRef<[u8]>) -> Result<Mesh> {
    let mut all = objects(text)?;
    assert_eq!(all.len(), 1, "{all:?}");
    Ok(all.remove(0).1)
}

/// The line and the words of a text's error.
fn fault(text: impl AsRef<[u8]>) -> (usize, String) {
    let error = objects(text).err().unwrap_or_else(|| panic!("it was read"));
    let Some(Place::Line { line, .. }) = error.place() else { panic!("no line: {error}") };
    (*line, error.to_string())
}

#[test]
fn every_spelling_of_a_face_is_the_same_face() -> Result<()> {
    let plain = one("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")?;
    assert_eq!(plain.positions, [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!((plain.face_vertices.as_slice(), plain.face_sizes.as_slice()), (&[0, 1, 2, 3][..], &[4][..]));
    for text in [
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1",
        "v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nvn 0 0 1\r\nvt 0 0\r\nf 1/1/1 2/1/1 3/1/1 4/1/1\r\n",
        "\u{feff}# by hand\nv\t0 0 0 0.5 0.5 0.5\n v 1 0 0 1\nv 1e0 +1 -0 # the third\nv 0 1 0\nf 1//1 2//1 3//1 4//1 # all\n",
        "v 0 \\\n0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n# C:\\sim\\\nf 1 2 \\\r\n 3 \\ \n4\n",
        "f 1/ 2/ 3/ 4/\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\ns off\nl 1 2\np 1",
    ] {
        assert_eq!(one(text)?, plain, "{text}");
    }
    Ok(())
}

#[test]
fn what_is_no_number_is_given_as_it_is() -> Result<()> {
    let mesh = one("v nan -nan -nan(ind)\nv inf 1 -1e999\n")?;
    assert!(mesh.positions[0].iter().all(|c| c.is_nan()));
    assert_eq!(mesh.positions[1], [f32::INFINITY, 1.0, f32::NEG_INFINITY]);
    Ok(())
}

#[test]
fn objects_are_those_of_o_or_else_of_g() -> Result<()> {
    let names = |text: &str| -> Result<Vec<(String, usize, usize)>> {
        let sizes = |(name, mesh): (String, Mesh)| (name, mesh.positions.len(), mesh.face_sizes.len());
        Ok(objects(text)?.into_iter().map(sizes).collect())
    };
    let told = |all: &[(&str, usize, usize)]| -> Vec<(String, usize, usize)> {
        all.iter().map(|(name, vertices, faces)| ((*name).to_owned(), *vertices, *faces)).collect()
    };
    let four = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    // Vertices first and groups of faces after, as Houdini and Maya write.
    assert_eq!(
        names(&format!("g default\n{four}g left\nf 1 2 3\ng right side\nf 1 3 4\ng left\nf 2 3 4\n"))?,
        told(&[("/left", 4, 2), ("/right side", 3, 1)])
    );
    // Groups within objects are parts of them; loose vertices stay with their object.
    assert_eq!(
        names(&format!(
            "mtllib x.mtl\no A\n{four}g p\nf 1 2 3\ng q\nf 2 3 1\no B\n{four}f -4 -3 -2\nv 9 9 9\n"
        ))?,
        told(&[("/A", 4, 2), ("/B", 5, 1)])
    );
    assert_eq!(names(&format!("{four}f 1 2 3\n"))?, told(&[("/a", 4, 1)]));
    assert_eq!(names(&format!("{four}o A\nf 1 2 3\n"))?, told(&[("/a", 1, 0), ("/A", 3, 1)]));
    assert_eq!(names("o A\n")?, told(&[("/A", 0, 0)]));
    for empty in ["", "# nothing\n", "g x\n"] {
        assert_eq!(names(empty)?.iter().map(|(_, v, f)| (*v, *f)).collect::<Vec<_>>(), [(0, 0)], "{empty}");
    }
    Ok(())
}

#[test]
fn faults_name_their_line() {
    for (text, line, what) in [
        ("v 0 0\n", 1, "a vertex has 3 coordinates, found 2"),
        ("v 0 0 0\nv 0 x 0\n", 2, "found \"x\""),
        ("v 0 0 0\n\nf 1 1\n", 3, "at least 3 corners, found 2"),
        ("v 0 0 0\nf 1 1 2\nf 1 1 1\nv 0 0 0\nf 1 3 2\n", 5, "a face names vertex 3, but there are 2"),
        ("v 0 0 0\nf 1 1 0\n", 2, "vertex 0, but they are counted from 1"),
        ("v 0 0 0\nf -1 -2 -1\nv 0 0 0\n", 2, "vertex -2, counted back from here, but there are 1"),
        ("v 0 0 0\nf \\\n 1 \\\n x 1\n", 2, "found \"x\""),
        ("v 0 0 0\nf 1 99999999999 1\n", 2, "beyond all"),
        ("v 0 0 0\nf 1 99999999999999999999999 1\n", 2, "a corner of a face is a number"),
        ("# notes\nDear all,\nhello\n", 2, "no statement of an OBJ file"),
        ("v 0 0 0\n\0\0\0\n", 2, "binary data"),
    ] {
        let (found, error) = fault(text);
        assert!(found == line && error.contains(what) && error.contains("a.obj"), "{text}: {error}");
    }
    assert!(fault(format!("v 0 0 0\nf{}\n", " 1".repeat(3 << 20))).1.contains("a line longer than"));
}

#[test]
fn a_sequence_is_in_the_order_of_its_numbers_and_lies_between_them() -> Result<()> {
    let room = room();
    let frame = |x: f64, last: u32| format!("v {x} 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 {last}\n");
    // Not in the order of the names; 9 and 10 have other faces; 11 is missing.
    for (name, x, last) in [("s8", 8.0, 3), ("s9", 9.0, 4), ("s10", 10.0, 4), ("s012", 12.0, 4)] {
        write(&room, &format!("{name}.obj"), frame(x, last));
    }
    write(&room, "s_notes.txt", "");
    let conventions = Conventions { frame_rate_hz: Some(2.0), ..Conventions::default() };
    let obj = Obj::open_sequence(room.path().join("s*.obj"), &conventions)?;
    assert_eq!(obj.objects()[0].path, "/s");
    assert_eq!(obj.objects()[0].key_times, KeyTimes::Listed([4.0, 4.5, 5.0, 6.0].into()));
    let mut mesh = Mesh::default();
    for (time_s, x, last) in [
        (0.0, 8.0, 2),
        (4.25, 8.0, 2), // the faces change: the earlier holds
        (4.5, 9.0, 3),
        (4.75, 9.5, 3),
        (5.0, 10.0, 3),
        (5.25, 10.5, 3),
        (5.5, 11.0, 3),
        (9.0, 12.0, 3),
    ] {
        obj.mesh(0, time_s, &mut mesh)?;
        assert_eq!((mesh.positions[0][0], mesh.face_vertices[2]), (x, last), "{time_s}");
    }
    assert_eq!(obj.mesh_size(0)?.map(|size| size.vertices), Some(4));
    assert!(obj.mesh(0, f64::NAN, &mut mesh).is_err() && obj.transform(1, 0.0).is_err());
    Ok(())
}

#[test]
fn objects_of_a_sequence_may_come_and_go() -> Result<()> {
    let room = room();
    let face = |x: u32| format!("v {x} 0 0\nv 0 0 0\nv 0 1 0\nf -3 -2 -1\n");
    write(&room, "f1.obj", format!("o a\n{}o b\n{}o late\n", face(1), face(2)));
    write(&room, "f2.obj", format!("o late\n{}o b\n{}", face(5), face(4)));
    let conventions = Conventions { frame_rate_hz: Some(1.0), ..Conventions::default() };
    let obj = Obj::open_sequence(room.path().join("f?.obj"), &conventions)?;
    let first = |object, time_s| -> Result<Option<f32>> {
        let mut mesh = Mesh::default();
        obj.mesh(object, time_s, &mut mesh)?;
        Ok(mesh.positions.first().map(|p| p[0]))
    };
    assert_eq!((first(0, 1.0)?, first(0, 1.5)?, first(0, 2.0)?), (Some(1.0), Some(1.0), None));
    assert_eq!((first(1, 1.5)?, first(2, 1.0)?, first(2, 2.0)?), (Some(3.0), None, Some(5.0)));
    // A name that has the number of the frame.
    write(&room, "n1.obj", format!("o n_1\n{}", face(1)));
    write(&room, "n2.obj", format!("o n_2\n{}", face(3)));
    let obj = Obj::open_sequence(room.path().join("n?.obj"), &conventions)?;
    let mut mesh = Mesh::default();
    obj.mesh(0, 1.5, &mut mesh)?;
    assert_eq!((obj.objects()[0].path.as_str(), mesh.positions[0][0]), ("/n_1", 2.0));
    Ok(())
}

#[test]
fn a_sequence_that_cannot_be_ordered_is_refused() {
    let room = room();
    for name in
        ["a1.obj", "a01.obj", "b.obj", "b1.obj", "c1.obj", "c2.mtl", "d1.obj", "d18446744073709551616.obj"]
    {
        write(&room, name, "v 0 0 0\n");
    }
    for (pattern, what) in [
        ("a*.obj", "a01.obj and a1.obj are both frame 1"),
        ("b*.obj", "\"b.obj\" has no frame number"),
        ("c*", "\"c2.mtl\" matches and is no OBJ file"),
        ("d*.obj", "has no frame number"),
        ("e*.obj", "no file matches"),
        ("[e.obj", "not a valid pattern"),
    ] {
        let error = Obj::open_sequence(room.path().join(pattern), &Conventions::default());
        let error = error.err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains(what) && error.contains(pattern), "{pattern}: {error}");
    }
}

#[test]
fn a_sequence_of_one_stands_still() -> Result<()> {
    let room = room();
    write(&room, "one_7.obj", "v 7 0 0\n");
    let obj = Obj::open_sequence(room.path().join("one_*.obj"), &Conventions::default())?;
    let info = &obj.objects()[0];
    assert_eq!(
        (info.path.as_str(), &info.key_times, info.topology),
        ("/one", &KeyTimes::Static, Topology::Constant)
    );
    Ok(())
}

proptest! {
    /// Any polygons, written in any of the spellings, over any blocks of the reader.
    #[test]
    fn what_is_written_is_read(
        positions in prop::collection::vec([-1e6_f32..1e6, -1.0..1.0, -1e-30_f32..1e-30], 3..40),
        faces in prop::collection::vec(prop::collection::vec((any::<prop::sample::Index>(), 0..4), 3..9), 0..40),
        padding in 0_usize..3,
    ) {
        let mut text = format!("# {}\n", "x".repeat([0, 65_500, 131_000][padding]));
        for [x, y, z] in &positions {
            text += &format!("v {x} {y:e} {z}\n");
        }
        let mut expected = Mesh { positions, ..Mesh::default() };
        for face in &faces {
            text += "f";
            for (index, spelling) in face {
                let (count, index) = (expected.positions.len(), index.index(expected.positions.len()));
                text += &match spelling {
                    0 => format!(" {}", index + 1),
                    1 => format!(" {}//3", index + 1),
                    2 => format!(" \\\n {}/1/2", index + 1),
                    _ => format!(" -{}", count - index),
                };
                expected.face_vertices.push(index as u32);
            }
            expected.face_sizes.push(face.len() as u32);
            text += "\r\n";
        }
        prop_assert_eq!(one(text).map_err(|e| TestCaseError::fail(e.to_string()))?, expected);
    }
}
