//! USD files against Alembic files of the same Blender scene (`oracles/usd_fixtures.py` makes both),
//! and small files by hand against what they must mean.

#![cfg(feature = "usd")]

use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::path::{Path, PathBuf};

use froufrou::scene::alembic::Alembic;
use froufrou::scene::animation::{Animation, KeyTimes, Mesh, ObjectKind, Topology, Transform};
use froufrou::scene::usd::Usd;
use froufrou::scene::world::open_animation;
use glam::{DMat4, DVec3};

/// Metres, or parts of a matrix.
const TOLERANCE: f64 = 1e-5;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/usd").join(name)
}

fn mesh(animation: &dyn Animation, object: usize, time_s: f64) -> Mesh {
    let mut mesh = Mesh::default();
    animation.mesh(object, time_s, &mut mesh).expect("a sound sample");
    mesh
}

fn matrix(transform: Transform) -> DMat4 {
    DMat4::from_cols_array_2d(&transform).transpose()
}

fn difference(a: DMat4, b: DMat4) -> f64 {
    let (a, b) = (a.to_cols_array(), b.to_cols_array());
    // A NaN is a difference.
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |most, d| if d <= most { most } else { d })
}

fn farthest(a: &Mesh, b: &Mesh) -> f64 {
    assert_eq!(a.positions.len(), b.positions.len());
    let pairs = a.positions.iter().flatten().zip(b.positions.iter().flatten());
    pairs.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, |most, d| if d <= most { most } else { d })
}

/// The faces, each from its lowest vertex on, so that only their way round counts.
fn faces(mesh: &Mesh) -> Vec<Vec<u32>> {
    let mut rest = mesh.face_vertices.as_slice();
    let mut faces = Vec::new();
    for size in &mesh.face_sizes {
        let (face, others) = rest.split_at(*size as usize);
        let mut face = face.to_vec();
        let least = (0..face.len()).min_by_key(|&i| face[i]).unwrap_or(0);
        face.rotate_left(least);
        faces.push(face);
        rest = others;
    }
    faces
}

fn find(animation: &dyn Animation, path: &str) -> usize {
    animation.objects().iter().position(|object| object.path == path).unwrap_or_else(|| panic!("{path}"))
}

/// The objects of both files: in the USD file all is below `/root`.
fn pairs(usd: &dyn Animation, abc: &dyn Animation) -> Vec<(usize, usize, String)> {
    let objects = abc.objects().iter().enumerate();
    let pair = |(index, object): (usize, &froufrou::scene::animation::ObjectInfo)| {
        let path = format!("/root{}", object.path);
        let found = usd.objects().iter().position(|other| other.path == path);
        found.map(|found| (found, index, object.path.clone()))
    };
    objects.filter_map(pair).collect()
}

fn times() -> impl Iterator<Item = (f64, bool)> {
    // Frames 0 to 26, and three moments within each.
    (0..108).map(|quarter| (f64::from(quarter) / 4.0 / 24.0, quarter % 4 == 0))
}

/// From the Y-up local space of Blender's Alembic files to the Z-up one of its USD files.
fn z_up() -> DMat4 {
    DMat4::from_rotation_x(-PI / 2.0)
}

#[test]
fn usd_equals_alembic_of_the_same_scene() {
    let abc = Alembic::open(fixture("scene.abc")).expect("the Alembic fixture");
    for (name, local) in [
        ("baked.usda", DMat4::IDENTITY),
        ("baked.usdc", DMat4::IDENTITY),
        // Only the root was turned by Blender; what is below kept its own axes.
        ("y_up.usdc", z_up()),
    ] {
        let usd = Usd::open(fixture(name)).expect("a sound fixture");
        let pairs = pairs(&usd, &abc);
        assert_eq!(pairs.len(), abc.objects().len(), "{name}: {:?}", usd.objects());
        let (mut most, mut most_in_mesh, mut meshes) = (0.0_f64, 0.0_f64, 0);
        for (u, a, path) in pairs {
            let (info, expected) = (&usd.objects()[u], &abc.objects()[a]);
            assert_eq!(info.kind, expected.kind, "{name} {path}");
            assert_eq!(info.topology, expected.topology, "{name} {path}");
            assert_eq!(usd.mesh_size(u).expect("a size"), abc.mesh_size(a).expect("a size"));
            if let (KeyTimes::Uniform { count, .. }, KeyTimes::Uniform { count: other, .. }) =
                (&info.key_times, &expected.key_times)
            {
                assert_eq!(count, other, "{name} {path}");
            }
            for (time_s, _) in times() {
                let found = matrix(usd.transform(u, time_s).expect("a transform"));
                let mut wanted = matrix(abc.transform(a, time_s).expect("a transform"));
                if info.kind != ObjectKind::Camera && !path.contains("Eye") {
                    wanted *= local;
                }
                if !path.contains("Eye") || info.kind == ObjectKind::Camera {
                    let apart = difference(found, wanted);
                    assert!(apart < TOLERANCE, "{name} {path} at {time_s}: {found} for {wanted}");
                    most = most.max(apart);
                }
                if info.kind == ObjectKind::Mesh {
                    let (found, wanted) = (mesh(&usd, u, time_s), mesh(&abc, a, time_s));
                    let apart = farthest(&found, &wanted);
                    assert!(apart < TOLERANCE, "{name} {path} at {time_s}: {apart}");
                    assert_eq!(faces(&found), faces(&wanted), "{name} {path}");
                    most_in_mesh = most_in_mesh.max(apart);
                    meshes += 1;
                }
            }
        }
        println!("{name}: transforms within {most:e}, {meshes} meshes within {most_in_mesh:e}");
        assert_eq!(meshes, 5 * 108);
    }
}

#[test]
fn skeletons_and_blend_shapes_equal_what_blender_baked() {
    let abc = Alembic::open(fixture("scene.abc")).expect("the Alembic fixture");
    for name in ["skeleton.usda", "skeleton.usdc", "skeleton.usdz"] {
        let usd = open_animation(fixture(name)).expect("a sound fixture");
        let mut moved = 0.0_f64;
        for (path, bends) in [("/Armature/Skinned/SkinnedMesh", true), ("/Shaped/ShapedMesh", false)] {
            let a = find(&abc, path);
            let u = find(usd.as_ref(), &format!("/root{path}"));
            assert_eq!(usd.objects()[u].topology, Topology::Homogeneous);
            let first = mesh(usd.as_ref(), u, 1.0 / 24.0);
            for (time_s, at_frame) in times() {
                let (found, wanted) = (mesh(usd.as_ref(), u, time_s), mesh(&abc, a, time_s));
                let apart = farthest(&found, &wanted);
                // Between frames joints turn, while baked points go straight: at up to 0.16 rad a
                // frame and 1.6 m from the joint they are 1.6 · (1 − cos 0.08) apart at most.
                let allowed = if bends && !at_frame { 5.2e-3 } else { TOLERANCE };
                assert!(apart < allowed, "{name} {path} at {time_s}: {apart}");
                moved = moved.max(farthest(&found, &first));
            }
        }
        assert!(moved > 0.3, "{name}: nothing moved");
    }
}

fn by_hand(text: &str) -> Usd {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("hand.usda");
    std::fs::write(&path, format!("#usda 1.0\n{text}")).expect("a file");
    Usd::open(path).unwrap_or_else(|error| panic!("{error}"))
}

fn at(usd: &Usd, path: &str, time_s: f64) -> DMat4 {
    matrix(usd.transform(find(usd, path), time_s).expect("a transform"))
}

const METRES: &str = "(\n metersPerUnit = 1\n upAxis = \"Y\"\n timeCodesPerSecond = 10\n)\n";

#[test]
fn every_operation_is_what_its_name_says() {
    let (x, y, z) = (DMat4::from_rotation_x(0.3), DMat4::from_rotation_y(-0.5), DMat4::from_rotation_z(1.1));
    let degrees = format!("({}, {}, {})", 0.3_f64.to_degrees(), -0.5_f64.to_degrees(), 1.1_f64.to_degrees());
    let half = 0.4_f64;
    let cases = [
        ("double3", "translate", "(1, 2, 3)".to_owned(), DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0))),
        ("half3", "translate", "(1, 2, 3)".to_owned(), DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0))),
        ("float3", "scale", "(1, 2, -3)".to_owned(), DMat4::from_scale(DVec3::new(1.0, 2.0, -3.0))),
        ("double", "rotateX", 0.3_f64.to_degrees().to_string(), x),
        ("double", "rotateY", (-0.5_f64).to_degrees().to_string(), y),
        ("double", "rotateZ", 1.1_f64.to_degrees().to_string(), z),
        // The first letter is done first: with column vectors it stands last.
        ("double3", "rotateXYZ", degrees.clone(), z * y * x),
        ("double3", "rotateXZY", degrees.clone(), y * z * x),
        ("double3", "rotateYXZ", degrees.clone(), z * x * y),
        ("double3", "rotateYZX", degrees.clone(), x * z * y),
        ("double3", "rotateZXY", degrees.clone(), y * x * z),
        ("double3", "rotateZYX", degrees, x * y * z),
        ("quatd", "orient", format!("({}, 0, {}, 0)", half.cos(), half.sin()), DMat4::from_rotation_y(0.8)),
        (
            "matrix4d",
            "transform",
            "((0, 1, 0, 0), (-1, 0, 0, 0), (0, 0, 1, 0), (5, 6, 7, 1))".to_owned(),
            DMat4::from_translation(DVec3::new(5.0, 6.0, 7.0)) * DMat4::from_rotation_z(PI / 2.0),
        ),
    ];
    for (kind, name, value, expected) in cases {
        let usd = by_hand(&format!(
            "{METRES}def Xform \"A\" {{\n {kind} xformOp:{name} = {value}\n uniform token[] xformOpOrder = [\"xformOp:{name}\"]\n}}\n\
             def Xform \"B\" {{\n {kind} xformOp:{name}:tail = {value}\n uniform token[] xformOpOrder = [\"!invert!xformOp:{name}:tail\"]\n}}\n"
        ));
        assert!(difference(at(&usd, "/A", 0.0), expected) < 1e-9, "{kind} {name}");
        assert!(difference(at(&usd, "/B", 0.0), expected.inverse()) < 1e-9, "!invert! {kind} {name}");
    }
}

#[test]
fn operations_are_done_from_the_last_to_the_first_and_a_reset_cuts() {
    let usd = by_hand(&format!(
        "{METRES}def Xform \"A\" {{
            double3 xformOp:translate = (1, 0, 0)
            double3 xformOp:translate:pivot = (0, 2, 0)
            double xformOp:rotateZ = 90
            float3 xformOp:scale = (2, 2, 2)
            uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:translate:pivot\", \"xformOp:rotateZ\", \"xformOp:scale\", \"!invert!xformOp:translate:pivot\"]
            def Scope \"Between\" {{
                def Xform \"Child\" {{
                    double3 xformOp:translate = (0, 0, 4)
                    uniform token[] xformOpOrder = [\"xformOp:translate\"]
                }}
                def Xform \"Free\" {{
                    double3 xformOp:translate = (0, 0, 4)
                    double3 xformOp:translate:never = (9, 9, 9)
                    uniform token[] xformOpOrder = [\"xformOp:translate:never\", \"!resetXformStack!\", \"xformOp:translate\"]
                }}
            }}
        }}\n"
    ));
    let paths: Vec<&str> = usd.objects().iter().map(|object| object.path.as_str()).collect();
    assert_eq!(paths, ["/A", "/A/Between/Child", "/A/Between/Free"]);
    // (x, y, z) − (0, 2, 0), twice as large, a quarter turn, + (0, 2, 0), + (1, 0, 0).
    let moved = at(&usd, "/A", 0.0).transform_point3(DVec3::new(1.0, 0.0, 0.0));
    assert!(moved.distance(DVec3::new(5.0, 4.0, 0.0)) < 1e-12, "{moved}");
    let child = at(&usd, "/A/Between/Child", 0.0).transform_point3(DVec3::ZERO);
    assert!(child.distance(DVec3::new(5.0, 2.0, 8.0)) < 1e-12, "{child}");
    assert_eq!(at(&usd, "/A/Between/Free", 0.0), DMat4::from_translation(DVec3::new(0.0, 0.0, 4.0)));
}

const TRIANGLE: &str = "int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, 2]\n \
                        point3f[] points = [(0, 0, 0), (100, 0, 0), (0, 0, 100)]\n";

#[test]
fn units_and_up_are_turned_into_metres_and_y() {
    let usd = by_hand(&format!(
        "(\n metersPerUnit = 0.01\n upAxis = \"Z\"\n)\n\
         def Mesh \"M\" {{\n {TRIANGLE} double3 xformOp:translate = (0, 300, 50)\n uniform token[] xformOpOrder = [\"xformOp:translate\"]\n}}\n\
         def Camera \"C\" {{\n double3 xformOp:translate = (0, 300, 50)\n uniform token[] xformOpOrder = [\"xformOp:translate\"]\n}}\n"
    ));
    let found = mesh(&usd, find(&usd, "/M"), 0.0);
    assert_eq!(found.positions, [[0.0, 0.5, -3.0], [1.0, 0.5, -3.0], [0.0, 1.5, -3.0]]);
    // The object's own space is in metres, Y up, too.
    assert!(difference(at(&usd, "/M", 0.0), DMat4::from_translation(DVec3::new(0.0, 0.5, -3.0))) < 1e-12);
    // A camera that is not turned looks along the file's −Z, which is down.
    let camera = at(&usd, "/C", 0.0);
    assert!(camera.transform_vector3(DVec3::NEG_Z).distance(DVec3::NEG_Y) < 1e-12, "{camera}");
    assert!(camera.transform_point3(DVec3::ZERO).distance(DVec3::new(0.0, 0.5, -3.0)) < 1e-12);
    // What says nothing is in centimetres, Y up.
    let silent = by_hand(&format!("def Mesh \"M\" {{\n {TRIANGLE}}}\n"));
    assert_eq!(mesh(&silent, 0, 0.0).positions[1], [1.0, 0.0, 0.0]);
    assert!(!silent.facts().unit_is_written);
}

#[test]
fn faces_are_counter_clockwise_whatever_the_hand_and_the_mirror() {
    for (orientation, scale, turned) in [
        ("rightHanded", 1, false),
        ("leftHanded", 1, true),
        ("rightHanded", -1, true),
        ("leftHanded", -1, false),
    ] {
        let usd = by_hand(&format!(
            "{METRES}def Mesh \"M\" {{\n {TRIANGLE} uniform token orientation = \"{orientation}\"\n\
             float3 xformOp:scale = ({scale}, 1, 1)\n uniform token[] xformOpOrder = [\"xformOp:scale\"]\n}}\n"
        ));
        let expected = if turned { [2, 1, 0] } else { [0, 1, 2] };
        assert_eq!(mesh(&usd, 0, 0.0).face_vertices, expected, "{orientation} {scale}");
    }
}

#[test]
fn time_codes_become_seconds_and_the_ends_hold() {
    let usd = by_hand(&format!(
        "{METRES}def Mesh \"M\" {{
            int[] faceVertexCounts.timeSamples = {{ 0: [3], 20: [4] }}
            int[] faceVertexIndices.timeSamples = {{ 0: [0, 1, 2], 20: [0, 1, 2, 3] }}
            point3f[] points.timeSamples = {{
                0: [(0, 0, 0), (1, 0, 0), (0, 0, 1)],
                10: [(0, 1, 0), (1, 1, 0), (0, 1, 1)],
                20: [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)]
            }}
            double xformOp:rotateY.timeSamples = {{ 0: 0, 20: 90 }}
            uniform token[] xformOpOrder = [\"xformOp:rotateY\"]
        }}
        def Xform \"Wheel\" {{
            double xformOp:rotateZ.timeSamples = {{ 0: 0, 10: 3600 }}
            uniform token[] xformOpOrder = [\"xformOp:rotateZ\"]
        }}\n"
    ));
    assert_eq!(usd.objects()[0].topology, Topology::Heterogeneous);
    assert_eq!(usd.objects()[0].key_times, KeyTimes::Uniform { start_s: 0.0, step_s: 1.0, count: 3 });
    // A third of the way the mesh has risen by that much and turned by 15°.
    let found = mesh(&usd, 0, 1.0 / 3.0);
    let expected = DVec3::new(15_f64.to_radians().cos(), 1.0 / 3.0, -15_f64.to_radians().sin());
    assert!(DVec3::from(found.positions[1].map(f64::from)).distance(expected) < 1e-6, "{found:?}");
    // Where the faces change the sample before holds, and turns on.
    let found = mesh(&usd, 0, 1.5);
    assert_eq!((found.face_sizes.as_slice(), found.positions.len()), (&[3][..], 3));
    assert!((f64::from(found.positions[0][1]) - 1.0).abs() < 1e-6);
    assert_eq!(mesh(&usd, 0, -5.0), mesh(&usd, 0, 0.0));
    assert_eq!(mesh(&usd, 0, 99.0), mesh(&usd, 0, 2.0));
    // Ten turns in a second: after a fortieth a quarter.
    let wheel = at(&usd, "/Wheel", 0.025).transform_vector3(DVec3::X);
    assert!(wheel.distance(DVec3::Y) < 1e-12, "{wheel}");
}

#[test]
fn a_joint_turns_between_its_samples_and_shapes_in_between_are_met() {
    let usd = by_hand(&format!(
        "{METRES}def SkelRoot \"R\" {{
            rel skel:skeleton = </R/S>
            def Skeleton \"S\" {{
                uniform token[] joints = [\"a\", \"a/b\"]
                uniform matrix4d[] bindTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1)), ((1,0,0,0),(0,1,0,0),(0,0,1,0),(1,0,0,1))]
                uniform matrix4d[] restTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1)), ((1,0,0,0),(0,1,0,0),(0,0,1,0),(1,0,0,1))]
                rel skel:animationSource = </R/S/Anim>
                def SkelAnimation \"Anim\" {{
                    uniform token[] joints = [\"a/b\"]
                    float3[] translations = [(1, 0, 0)]
                    half3[] scales = [(1, 1, 1)]
                    quatf[] rotations.timeSamples = {{ 0: [(1, 0, 0, 0)], 10: [({FRAC_1_SQRT_2}, 0, 0, {FRAC_1_SQRT_2})] }}
                    uniform token[] blendShapes = [\"bulge\"]
                    float[] blendShapeWeights.timeSamples = {{ 0: [0], 10: [1] }}
                }}
            }}
            def Mesh \"M\" {{
                int[] faceVertexCounts = [3]
                int[] faceVertexIndices = [0, 1, 2]
                point3f[] points = [(0, 0, 0), (2, 0, 0), (0, 0, 1)]
                uniform token[] skel:joints = [\"a/b\", \"a\"]
                int[] primvars:skel:jointIndices = [1, 0, 1] ( elementSize = 1\n interpolation = \"vertex\" )
                float[] primvars:skel:jointWeights = [1, 1, 1] ( elementSize = 1\n interpolation = \"vertex\" )
                uniform token[] skel:blendShapes = [\"bulge\"]
                rel skel:blendShapeTargets = [</R/M/Bulge>]
                def BlendShape \"Bulge\" {{
                    uniform vector3f[] offsets = [(0, 0, 3)]
                    uniform int[] pointIndices = [2]
                    uniform vector3f[] inbetweens:early = [(0, 0, 2)] ( weight = 0.5 )
                }}
            }}
        }}\n"
    ));
    let index = find(&usd, "/R/M");
    assert_eq!(usd.objects()[index].topology, Topology::Homogeneous);
    for (time_s, angle, bulge) in [
        (0.0, 0.0, 0.0),
        (0.25, PI / 8.0, 1.0),
        (0.5, PI / 4.0, 2.0),
        (0.75, PI * 0.375, 2.5),
        (1.0, PI / 2.0, 3.0),
    ] {
        let found = mesh(&usd, index, time_s)
            .positions
            .iter()
            .map(|p| DVec3::from(p.map(f64::from)))
            .collect::<Vec<_>>();
        let expected =
            [DVec3::ZERO, DVec3::new(1.0 + angle.cos(), angle.sin(), 0.0), DVec3::new(0.0, 0.0, 1.0 + bulge)];
        for (found, expected) in found.iter().zip(expected) {
            assert!(found.distance(expected) < 1e-6, "{time_s}: {found} for {expected}");
        }
    }
}

/// Writes files into a folder of their own and opens the first, which lies in a folder within.
fn stage(files: &[(&str, &str)]) -> froufrou::Result<Usd> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        let path = folder.path().join("stage").join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, format!("#usda 1.0\n{text}")).expect("a file");
    }
    Usd::open(folder.path().join("stage").join(files[0].0))
}

#[test]
fn layers_beside_the_file_are_composed() {
    let part = "(\n defaultPrim = \"P\"\n)\ndef Xform \"P\" {\n def Mesh \"M\" {\n int[] faceVertexCounts = [3]\n \
                int[] faceVertexIndices = [0, 1, 2]\n point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 0, 1)]\n }\n}\n";
    let place =
        "double3 xformOp:translate = (0, 0, 7)\n uniform token[] xformOpOrder = [\"xformOp:translate\"]";
    let root = format!(
        "(\n metersPerUnit = 1\n subLayers = [@./sub/strong.usda@]\n)\n\
         def \"A\" (\n prepend references = @./parts/part.usda@\n) {{\n {place}\n}}\n\
         def \"B\" (\n instanceable = true\n prepend payload = @parts/part.usda@\n) {{\n {place}\n}}\n"
    );
    let strong = "def Xform \"C\" {\n}\n";
    let usd = stage(&[("root.usda", &root), ("parts/part.usda", part), ("sub/strong.usda", strong)])
        .unwrap_or_else(|error| panic!("{error}"));
    let mut paths: Vec<&str> = usd.objects().iter().map(|object| object.path.as_str()).collect();
    paths.sort_unstable();
    assert_eq!(paths, ["/A", "/A/M", "/B", "/B/M", "/C"]);
    for path in ["/A/M", "/B/M"] {
        assert_eq!(mesh(&usd, find(&usd, path), 0.0).positions[1], [1.0, 0.0, 7.0], "{path}");
    }
}

#[test]
fn layers_from_elsewhere_are_refused() {
    let outside = ("../outside.usda", "def Xform \"P\" {\n}\n");
    for (reference, says) in [
        ("@../outside.usda@</P>", "outside of the file's folder"),
        ("@/etc/passwd@</P>", "outside of the file's folder"),
        ("@http://example.com/a.usda@</P>", "on the network"),
        ("@./none.usda@</P>", "cannot be opened"),
        ("@./box.usdz@</P>", "is a package"),
    ] {
        for arc in ["references", "payload"] {
            let root = format!("def \"A\" (\n prepend {arc} = {reference}\n) {{\n}}\n");
            let error =
                stage(&[("root.usda", &root), outside, ("box.usdz", "")]).expect_err(reference).to_string();
            assert!(error.contains(says) && error.contains("root.usda"), "{error}");
        }
    }
    let root = "(\n subLayers = [@../outside.usda@]\n)\n";
    let error = stage(&[("root.usda", root), outside]).expect_err("outside").to_string();
    assert!(error.contains("outside of the file's folder"), "{error}");
}
