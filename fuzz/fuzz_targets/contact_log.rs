//! Contact logs, plain and gzipped, and the impacts and slides found in them, which must be events that
//! can be written.
#![no_main]

use std::io::Cursor;

use froufrou::motion::contacts::LogEvents;
use froufrou::scene::asset::Asset;
use froufrou::scene::contact_log::{ContactColumns, ContactLog, Push, UpAxis};
use froufrou::scene::file::Contacts;
use froufrou::scene::world::RigidBodies;
use froufrou_fuzz::{target, walk_events, with_file};

/// The columns of the seeds: those that all must have, or all that there may be.
fn columns(all: bool) -> ContactColumns {
    let three = |names: [&str; 3]| names.map(String::from);
    ContactColumns {
        time: "t".into(),
        a: "a".into(),
        b: "b".into(),
        position: three(["x", "y", "z"]),
        push: if all { Push::Impulse("J".into()) } else { Push::Force("F".into()) },
        normal: all.then(|| three(["nx", "ny", "nz"])),
        normal_velocity: all.then(|| "v".into()),
        // These columns the seeds have.
        sliding_velocity: if all { vec!["v".into(), "nx".into()] } else { Vec::new() },
        up: if all { UpAxis::Z } else { UpAxis::Y },
        unit_m: if all { 0.01 } else { 1.0 },
        time_offset_s: if all { -0.5 } else { 0.0 },
    }
}

target!(|bytes| {
    for all in [false, true] {
        let columns = columns(all);
        let Ok(log) = ContactLog::new(Cursor::new(bytes.to_vec()), "log.csv", &columns) else { continue };
        let mut last_s = f64::NEG_INFINITY;
        for row in log {
            let Ok(row) = row else { break };
            assert!(
                row.time_s >= last_s && row.position_m.iter().all(|number| number.is_finite()),
                "{row:?}"
            );
            last_s = row.time_s;
        }
        with_file(bytes, "csv", |path| {
            let log = Asset { name: "log.csv".into(), path: path.into() };
            for step_s in [None, Some(0.001)] {
                let contacts = Contacts { log: log.clone(), columns: columns.clone(), step_s, gravity_mps2: [0.0, -9.81, 0.0] };
                let Ok(events) = LogEvents::open(&contacts, RigidBodies::default()) else { continue };
                walk_events(events);
            }
        });
    }
});
