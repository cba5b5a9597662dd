//! Regions of a sheet that an animator has: what is read and fits the mesh can be followed.
#![no_main]

use froufrou::motion::paper::ready_made::Reader;
use froufrou::motion::paper::{Analyser, PaperSettings, Participant};
use froufrou::scene::animation::Mesh;
use froufrou_fuzz::target;

/// A strip of four triangles, bent.
fn strip(height_m: f32) -> Mesh {
    Mesh {
        positions: (0..6u8)
            .map(|i| {
                [0.1 * f32::from(i / 2), if i / 2 == 1 { height_m } else { 0.0 }, 0.1 * f32::from(i % 2)]
            })
            .collect(),
        face_vertices: vec![0, 2, 1, 1, 2, 3, 2, 4, 3, 3, 4, 5],
        face_sizes: vec![3; 4],
    }
}

target!(|bytes| {
    let sheet = Participant { name: "sheet".to_owned(), paper: Some(PaperSettings::default()) };
    let mut analyser = Analyser::new(vec![sheet]);
    let mut last_s = f64::NEG_INFINITY;
    for (frame, partition) in Reader::new(bytes, "regions.jsonl").enumerate().take(64) {
        let Ok(partition) = partition else { break };
        assert!(partition.time_s > last_s);
        last_s = partition.time_s;
        let mesh = strip(if frame % 2 == 0 { 0.02 } else { -0.02 });
        let fits = partition.check(&mesh).is_ok();
        analyser.give(0, partition).expect("a sheet");
        assert_eq!(analyser.feed(frame as f64 / 60.0, &[mesh]).is_ok(), fits);
        while let Some(event) = analyser.next_event() {
            froufrou::motion::event::write(&mut std::io::sink(), &event)
                .expect("an event that can be written");
        }
        if !fits {
            break;
        }
    }
});
