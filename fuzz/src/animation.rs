//! Reading everything in an animation, whatever format it came from.

use froufrou::scene::animation::{Animation, KeyTimes, Mesh, ObjectInfo, ObjectKind, Topology};

/// The most objects that are read, so that a file full of them is no hang.
const MOST_OBJECTS: usize = 32;

/// Asks an opened animation for every object at times before, on, between and after its samples, and
/// checks what the interface promises. Faults of single samples are fine.
pub fn walk_animation(animation: &dyn Animation) {
    let mut mesh = Mesh::default();
    for (index, object) in animation.objects().iter().enumerate().take(MOST_OBJECTS) {
        check_info(object);
        let size = animation.mesh_size(index);
        for time_s in times_s(&object.key_times) {
            let _ = animation.transform(index, time_s);
            let read = animation.mesh(index, time_s, &mut mesh);
            if read.is_ok() {
                assert_eq!(object.kind, ObjectKind::Mesh, "{} has a mesh", object.path);
                check_mesh(&mesh, &object.path);
            }
        }
        if object.kind != ObjectKind::Mesh {
            assert!(!matches!(size, Ok(Some(_))), "{} has a mesh's size", object.path);
        }
    }
    let beyond = animation.objects().len();
    assert!(animation.transform(beyond, 0.0).is_err() && animation.mesh(beyond, 0.0, &mut mesh).is_err());
}

fn times_s(key_times: &KeyTimes) -> Vec<f64> {
    let mut times = vec![f64::NEG_INFINITY, f64::MIN, -1.0, 0.0, 1e9, f64::MAX, f64::INFINITY, f64::NAN];
    if let Some((first_s, last_s)) = key_times.span_s() {
        times.extend([first_s, last_s, (first_s + last_s) / 2.0, first_s.next_down(), last_s.next_up()]);
    }
    times.extend((0..3).filter_map(|index| key_times.get(index)).map(|time_s| time_s + 1e-3));
    times
}

fn check_info(object: &ObjectInfo) {
    let times = &object.key_times;
    let checked = times.len().min(1000);
    assert!(times.get(times.len()).is_none());
    let listed: Vec<f64> = (0..checked).filter_map(|index| times.get(index)).collect();
    assert_eq!(listed.len(), checked);
    assert!(listed.iter().all(|time_s| time_s.is_finite()), "{}: {times:?}", object.path);
    assert!(listed.is_sorted(), "{}: {times:?}", object.path);
    if let KeyTimes::Uniform { step_s, count, .. } = times {
        assert!(*step_s > 0.0 && *count >= 2, "{}: {times:?}", object.path);
    }
    assert_eq!(object.kind == ObjectKind::Mesh, object.topology != Topology::None, "{}", object.path);
}

fn check_mesh(mesh: &Mesh, path: &str) {
    let corners: usize = mesh.face_sizes.iter().map(|&size| size as usize).sum();
    assert_eq!(corners, mesh.face_vertices.len(), "{path}: faces that do not add up");
    let vertices = mesh.positions.len();
    assert!(mesh.face_vertices.iter().all(|&vertex| (vertex as usize) < vertices), "{path}: no such vertex");
}
