//! Measures what cloth is bent and what it touches, for `oracles/cloth_speed.py`.
//!
//! ```text
//! cloth_speed FOLDER RADIUS
//! ```
//!
//! The folder has two meshes, `cloth` and `other`: `.sizes` and `.corners` of their faces as 32-bit numbers, and
//! `.positions` of all frames, one after another, as 32-bit floats. Into it go, of the last frame, `curvature.f64` (mean
//! curvature and area of each vertex of the cloth) and `contacts.f64` (triangle of the other, or −1, and distance).
//! What it took is printed: seconds for all frames of curvature, of buckles, of contacts with the other within the
//! radius and at any distance, and of all that the analyser does; of processors, and by the clock. (A machine that does
//! other things too lets the clock run on; where the system does not tell how long processors worked both are the same.)

use std::path::Path;
use std::time::Instant;

use froufrou::motion::cloth::buckles::{BuckleSettings, Buckles};
use froufrou::motion::cloth::curvature::Curvature;
use froufrou::motion::cloth::proximity::{Proximity, Touchable};
use froufrou::motion::cloth::{Analyser, ClothSettings, Participant};
use froufrou::scene::animation::Mesh;

/// The clock, and how long processors have worked.
struct Watch {
    started: Instant,
    processor_s: f64,
}

impl Watch {
    fn start() -> Self {
        Self { started: Instant::now(), processor_s: processor_s().unwrap_or_default() }
    }

    /// Processor time and clock since it was started, in seconds.
    fn read(&self) -> [f64; 2] {
        let clock_s = self.started.elapsed().as_secs_f64();
        [processor_s().map_or(clock_s, |now_s| now_s - self.processor_s), clock_s]
    }
}

/// How long the threads of this process have run, in seconds; Linux tells.
fn processor_s() -> Option<f64> {
    let mut total_ns = 0;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        total_ns += text.split_whitespace().next()?.parse::<u64>().ok()?;
    }
    Some(total_ns as f64 * 1e-9)
}

fn say(what: &str, [processor_s, clock_s]: [f64; 2]) {
    println!("{what} {processor_s:.6} {clock_s:.6}");
}

type Fallible<T> = Result<T, Box<dyn std::error::Error>>;

fn words(path: &Path) -> Fallible<Vec<[u8; 4]>> {
    Ok(std::fs::read(path)?.as_chunks::<4>().0.to_vec())
}

/// A mesh in each of its frames.
fn frames(folder: &Path, name: &str) -> Fallible<Vec<Mesh>> {
    let numbers = |kind: &str| -> Fallible<Vec<u32>> {
        let all = words(&folder.join(format!("{name}.{kind}")))?;
        Ok(all.into_iter().map(u32::from_le_bytes).collect())
    };
    let (face_sizes, face_vertices, vertices) = (numbers("sizes")?, numbers("corners")?, numbers("count")?);
    let coordinates = words(&folder.join(format!("{name}.positions")))?;
    let coordinates: Vec<f32> = coordinates.into_iter().map(f32::from_le_bytes).collect();
    let points = coordinates.as_chunks::<3>().0;
    let count = vertices.first().copied().unwrap_or_default().max(1) as usize;
    let mesh = |positions: &[[f32; 3]]| Mesh {
        positions: positions.to_vec(),
        face_vertices: face_vertices.clone(),
        face_sizes: face_sizes.clone(),
    };
    Ok(points.chunks_exact(count).map(mesh).collect())
}

fn write(path: &Path, numbers: impl Iterator<Item = f64>) -> std::io::Result<()> {
    std::fs::write(path, numbers.flat_map(f64::to_le_bytes).collect::<Vec<u8>>())
}

fn main() -> Fallible<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, radius] = arguments.as_slice() else { return Err("expected FOLDER RADIUS".into()) };
    let (folder, radius_m): (_, f64) = (Path::new(folder), radius.parse()?);
    let (cloth, other) = (frames(folder, "cloth")?, frames(folder, "other")?);
    let (Some(first), Some(first_other)) = (cloth.first(), other.first()) else {
        return Err("there are no frames".into());
    };
    let mut objects = [Touchable::new(first)?, Touchable::new(first_other)?];

    let mut curvature = Curvature::default();
    let watch = Watch::start();
    for mesh in &cloth {
        curvature.measure(objects[0].surface(), &mesh.positions);
    }
    say("curvature", watch.read());
    let numbers = curvature.mean_per_m().iter().zip(curvature.area_m2()).flat_map(|(h, a)| [*h, *a]);
    write(&folder.join("curvature.f64"), numbers)?;

    let mut buckles = Buckles::new(BuckleSettings::default());
    let watch = Watch::start();
    for (frame, mesh) in cloth.iter().enumerate() {
        curvature.measure(objects[0].surface(), &mesh.positions);
        buckles.feed(frame as f64 / 60.0, objects[0].surface(), &curvature, &mesh.positions);
    }
    say("both", watch.read());

    for (name, radius_m) in [("near", radius_m), ("any", 1e6)] {
        let mut proximity = Proximity::new(0, &objects[0], radius_m, f64::INFINITY);
        let mut taken_s = [0.0; 2];
        for (mesh, other) in cloth.iter().zip(&other) {
            // The cloth itself is not asked: its tree is no part of the work.
            objects[0].follow(&mesh.positions)?;
            let watch = Watch::start();
            objects[1].follow(&other.positions)?;
            proximity.contacts(&objects);
            let [processor_s, clock_s] = watch.read();
            taken_s = [taken_s[0] + processor_s, taken_s[1] + clock_s];
        }
        say(name, taken_s);
        if name == "any" {
            let mut found = vec![[-1.0; 2]; first.positions.len()];
            let vertices = proximity.vertices().to_vec();
            for (vertex, contact) in vertices.iter().zip(proximity.contacts(&objects)) {
                if let Some(contact) = contact {
                    found[*vertex as usize] = [f64::from(contact.triangle), contact.distance_m];
                }
            }
            write(&folder.join("contacts.f64"), found.into_iter().flatten())?;
        }
    }
    let watch = Watch::start();
    for (mesh, other) in cloth.iter().zip(&other) {
        objects[0].follow(&mesh.positions)?;
        objects[1].follow(&other.positions)?;
    }
    say("follow", watch.read());

    let settings = ClothSettings::default();
    let participants = [("cloth", Some(settings)), ("other", None)]
        .map(|(name, cloth)| Participant { name: name.to_owned(), cloth });
    let mut analyser = Analyser::new(participants.to_vec());
    let frames: Vec<[Mesh; 2]> = cloth.into_iter().zip(other).map(|(cloth, other)| [cloth, other]).collect();
    let watch = Watch::start();
    let mut events = 0;
    for (frame, meshes) in frames.iter().enumerate() {
        analyser.feed(frame as f64 / 25.0, meshes)?;
        if frame == 0 {
            say("begin", watch.read());
        }
        events += std::iter::from_fn(|| analyser.next_event()).count();
        while analyser.next_sliding().is_some() {}
    }
    analyser.finish();
    events += std::iter::from_fn(|| analyser.next_event()).count();
    say("all", watch.read());
    println!("events {events} {events}");
    Ok(())
}
