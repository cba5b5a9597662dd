//! What sounds: contacts that slide, a cloth and a sheet of paper, from the beginning to the end.

use std::f64::consts::TAU;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use froufrou::render::live::{BodyId, Handle, Refused};
use froufrou::scene::contact_log::{ContactRow, Push};
use froufrou::{Error, Result};

const FRAMES_A_SECOND: f64 = 24.0;

/// Writes a scene into a folder, with all that it needs for so long.
pub fn write(folder: &Path, seconds: f64, contacts: usize) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|fault| Error::io("create", folder, fault))?;
    let frames = ((seconds + 2.0) * FRAMES_A_SECOND) as usize;
    // A cloth of 71 × 71 vertices that is shaken: waves run through it, to and fro over the floor.
    sheet(folder, "cloth", [71, 71], frames, |time_s, [u, v]| {
        let wave =
            0.05 * (TAU * (1.3 * u + 0.7 * time_s)).sin() + 0.03 * (TAU * (2.1 * v - 1.1 * time_s)).sin();
        let to_and_fro = 0.3 * (TAU * 0.4 * time_s).sin();
        [u + to_and_fro, 0.09 + wave, v - 1.5]
    })?;
    // A sheet of A5 that is bent to one side and the other.
    sheet(folder, "paper", [11, 15], frames, |time_s, [u, v]| {
        let bend = 1.5 * (TAU * 0.6 * time_s).sin();
        let (x, z) = (0.148 * u, 0.21 * v);
        [x + 1.0, 1.0 + bend * (x * x - 0.0055) + 0.004 * (TAU * 2.0 * time_s + 9.0 * v).sin(), z - 1.0]
    })?;
    let scene = "seed = 3\n[listener]\nposition = [0, 1.2, 1]\nlayout = 'stereo'\n\
        [instrument]\nsqueak = { kind = 'stick-slip', with = { spacing = 0.002 } }\n\
        [material.stone]\nslide = { instrument = 'squeak', gain_db = -45 }\n\
        [material.cotton]\ncloth = { corpus = 'synthetic/cotton', radius = 0.1, gain_db = -6 }\n\
        [material.printer]\npaper = { corpus = 'synthetic/printer', radius = 0.02, gain_db = -6 }\n\
        [[object]]\nname = 'stones'\nbody = 'stone*'\nmaterial = 'stone'\n\
        [[object]]\nname = 'cloth'\nsource = 'cloth.pc2#/*'\nframe_rate = 24\nmaterial = 'cotton'\n\
        [[object]]\nname = 'paper'\nsource = 'paper.pc2#/*'\nframe_rate = 24\nmaterial = 'printer'\n";
    let path = folder.join("scene.toml");
    std::fs::write(&path, format!("# {contacts} contacts are told.\n{scene}"))
        .map_err(|fault| Error::io("write", &path, fault))
}

/// Writes the point cache and the faces of a sheet of so many vertices along both sides: where each of them is at a time,
/// by its place from −0.5 to 0.5 on both sides.
fn sheet(
    folder: &Path,
    name: &str,
    [columns, rows]: [usize; 2],
    frames: usize,
    place: impl Fn(f64, [f64; 2]) -> [f64; 3],
) -> Result<()> {
    let create = |ending: &str| {
        let path = folder.join(format!("{name}.{ending}"));
        File::create(&path).map(BufWriter::new).map_err(|fault| Error::io("create", &path, fault))
    };
    let failed = |fault: std::io::Error| Error::new(format!("cannot write {name}: {fault}"));
    let part = |i: usize, count: usize| i as f64 / (count - 1) as f64 - 0.5;
    let corner = |i: usize| [part(i % columns, columns), part(i / columns, rows)];
    let mut cache = create("pc2")?;
    let count = columns * rows;
    let write = |cache: &mut BufWriter<File>| -> std::io::Result<()> {
        cache.write_all(b"POINTCACHE2\0")?;
        cache.write_all(&1i32.to_le_bytes())?;
        cache.write_all(&(count as i32).to_le_bytes())?;
        cache.write_all(&0f32.to_le_bytes())?;
        cache.write_all(&1f32.to_le_bytes())?;
        cache.write_all(&(frames as i32).to_le_bytes())?;
        for frame in 0..frames {
            for i in 0..count {
                for c in place(frame as f64 / FRAMES_A_SECOND, corner(i)) {
                    cache.write_all(&(c as f32).to_le_bytes())?;
                }
            }
        }
        cache.flush()
    };
    write(&mut cache).map_err(failed)?;
    let mut faces = create("obj")?;
    for i in 0..count {
        let [x, y, z] = place(0.0, corner(i));
        writeln!(faces, "v {x} {y} {z}").map_err(failed)?;
    }
    for row in 0..rows - 1 {
        for column in 0..columns - 1 {
            let first = row * columns + column + 1;
            let below = first + columns;
            writeln!(faces, "f {first} {below} {} {}", below + 1, first + 1).map_err(failed)?;
        }
    }
    faces.flush().map_err(failed)
}

/// Stones that slide on the floor, each in a circle of its own, and now and then hit it.
pub struct Pairs {
    floor: BodyId,
    stones: Vec<BodyId>,
}

impl Pairs {
    pub fn new(handle: &mut Handle, count: usize) -> Result<Self> {
        let mut body = |name: &str| handle.body(name).map_err(Refused::fault);
        let floor = body("floor")?;
        let stones = (0..count).map(|n| body(&format!("stone {n}"))).collect::<Result<_>>()?;
        Ok(Self { floor, stones })
    }

    /// Tells of the step that ends at a time. What there is no room for is counted by the handle.
    pub fn tell(&self, handle: &mut Handle, time_s: f64) {
        for (n, stone) in self.stones.iter().enumerate() {
            // What touches moves with the stone, as it does where one slides and does not roll.
            let speed_mps = 0.3 + 0.5 * (n as f64 * 0.618).fract();
            let radius_m = 2.0 + 0.02 * n as f64;
            let turn = TAU * n as f64 / self.stones.len() as f64 + speed_mps / radius_m * time_s;
            let row = ContactRow {
                time_s,
                a: 0,
                b: 0,
                position_m: [radius_m * turn.cos(), 0.0, radius_m * turn.sin()],
                push: Push::Force(5.0 + (n % 7) as f64),
                normal: Some([0.0, 1.0, 0.0]),
                normal_velocity_mps: None,
                sliding_mps: Some(speed_mps),
                line: 0,
            };
            let _ = handle.contact([*stone, self.floor], &row);
        }
    }
}
