//! Writes a WAV file beyond 4 GiB, and reads its sizes and its last frame back, in little memory.
//!
//! ```text
//! cargo run --release -p froufrou --example long_wav            needs 4.3 GB of disk
//! ```

use std::error::Error;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use froufrou::render::format::SampleFormat;
use froufrou::render::wav::{WavFormat, WavWriter};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("long.wav");
    let format =
        WavFormat { samples: SampleFormat::Float32, rate_hz: 48_000, channels: 2, seed: 0, first_frame: 0 };
    let mut writer = WavWriter::create(&path, format)?;
    let block = vec![0.25; 1 << 20];
    for _ in 0..1024 {
        writer.write(&block)?;
    }
    writer.write(&[0.5, -0.5])?;
    let frames = writer.finish()?.frames;
    let bytes = std::fs::metadata(&path)?.len();
    println!("{frames} frames in {bytes} bytes");

    let mut file = File::open(&path)?;
    let mut head = [0; 12];
    file.read_exact(&mut head)?;
    check(&head[..4] == b"RF64" && head[4..8] == [0xff; 4] && &head[8..] == b"WAVE", "it is no RF64 file")?;
    // The sizes that do not fit into 32 bits stand in the chunk ds64: of the file, of the samples, and the frames.
    let (mut sizes, mut at) = ([0u64; 3], 12);
    let data = loop {
        file.seek(SeekFrom::Start(at))?;
        let mut chunk = [0; 8];
        file.read_exact(&mut chunk)?;
        let length = u32::from_le_bytes([chunk[4], chunk[5], chunk[6], chunk[7]]);
        match &chunk[..4] {
            b"data" => break at + 8,
            b"ds64" => {
                for size in &mut sizes {
                    let mut number = [0; 8];
                    file.read_exact(&mut number)?;
                    *size = u64::from_le_bytes(number);
                }
            }
            _ => {}
        }
        at += 8 + u64::from(length).next_multiple_of(2);
    };
    println!("ds64: {} bytes, {} of samples, {} frames", sizes[0], sizes[1], sizes[2]);
    check(sizes == [bytes - 8, 8 * frames, frames], "the sizes are wrong")?;
    file.seek(SeekFrom::Start(data + sizes[1] - 8))?;
    let mut last = [0; 8];
    file.read_exact(&mut last)?;
    let sample =
        |from: usize| f32::from_le_bytes([last[from], last[from + 1], last[from + 2], last[from + 3]]);
    println!("last frame: {} {}", sample(0), sample(4));
    check([sample(0), sample(4)] == [0.5, -0.5], "the last frame is another")
}

fn check(holds: bool, what: &str) -> Result<(), Box<dyn Error>> {
    if holds { Ok(()) } else { Err(what.into()) }
}
