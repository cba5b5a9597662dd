//! Writes every transform and every vertex of every frame of an Alembic archive, as this crate reads
//! it, for `oracles/alembic_compare.py` to hold against the C++ library:
//!
//! ```text
//! cargo run --release --example alembic_dump -- dance.abc dance
//! ```
//!
//! makes `dance.json`, the index, and `dance.bin`: per object and key time the world matrix (16
//! numbers of 64 bits, row by row), then the vertices (3 numbers of 32 bits each).

use std::io::Write;
use std::path::PathBuf;

use froufrou::scene::alembic::Alembic;
use froufrou::scene::animation::{Animation, Mesh, ObjectKind};
use serde_json::json;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [archive, output] = arguments.as_slice() else {
        return Err("usage: alembic_dump ARCHIVE.abc OUTPUT".into());
    };
    let animation = Alembic::open(archive)?;
    let mut binary = std::io::BufWriter::new(std::fs::File::create(output.with_extension("bin"))?);
    let mut mesh = Mesh::default();
    let mut objects = Vec::new();
    for (index, object) in animation.objects().iter().enumerate() {
        let mut times_s: Vec<f64> =
            (0..object.key_times.len()).filter_map(|i| object.key_times.get(i)).collect();
        let key_times_s = times_s.clone();
        if times_s.is_empty() {
            times_s.push(0.0);
        }
        let mut vertices = Vec::new();
        for time_s in times_s {
            for value in animation.transform(index, time_s)?.as_flattened() {
                binary.write_all(&value.to_le_bytes())?;
            }
            mesh.positions.clear();
            if object.kind == ObjectKind::Mesh {
                animation.mesh(index, time_s, &mut mesh)?;
            }
            for value in mesh.positions.as_flattened() {
                binary.write_all(&value.to_le_bytes())?;
            }
            vertices.push(mesh.positions.len());
        }
        objects.push(json!({
            "path": object.path,
            "kind": format!("{:?}", object.kind),
            "topology": format!("{:?}", object.topology),
            "key_times_s": key_times_s,
            "vertices": vertices,
        }));
    }
    binary.flush()?;
    std::fs::write(output.with_extension("json"), serde_json::to_string(&objects)?)?;
    Ok(())
}
