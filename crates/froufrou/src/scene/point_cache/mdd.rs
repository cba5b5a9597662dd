//! The header of MDD: number of frames, number of vertices, and the time of each frame in seconds,
//! each of four bytes, big-endian.

use std::path::Path;

use super::{CHUNK_BYTES, Layout, check_length, damage, read};
use crate::Result;
use crate::scene::animation::KeyTimes;
use crate::scene::positioned_file::PositionedFile;

/// The length of the header before the times.
const HEAD_BYTES: u64 = 8;

/// Reads the header with all times.
///
/// # Errors
/// Counts that are not the length of the file, or times that do not ascend.
pub(super) fn layout(path: &Path, file: &PositionedFile) -> Result<Layout> {
    let mut head = [0; HEAD_BYTES as usize];
    read(path, file, &mut head, 0)?;
    let [a, b, c, d, e, f, g, h] = head;
    let (frames, points) = (u32::from_be_bytes([a, b, c, d]), u32::from_be_bytes([e, f, g, h]));
    let data_at = HEAD_BYTES + 4 * u64::from(frames);
    check_length(path, file, "frames", frames, points, data_at)?;
    if frames == 0 {
        return Err(damage(path, 0, "there are no frames"));
    }
    let (times_s, kept) = times(path, file, frames)?;
    // Times are stored with 24 bits; what differs by the last of them is meant to be equally spaced.
    let largest = times_s.iter().fold(0.0_f64, |largest, time| largest.max(time.abs()));
    let key_times = KeyTimes::from_times(times_s, largest * f64::from(f32::EPSILON));
    let frames = (kept.len() < frames as usize).then_some(kept);
    Ok(Layout { points, key_times, frames, data_at, decode: f32::from_be_bytes })
}

/// The times at which there are samples, ascending, and the frame of each.
fn times(path: &Path, file: &PositionedFile, frames: u32) -> Result<(Vec<f64>, Vec<u32>)> {
    // Each takes four bytes of the file, whose length has been checked.
    let (mut times_s, mut kept) = (Vec::new(), Vec::new());
    let mut chunk = vec![0; CHUNK_BYTES.min(4 * frames as usize)];
    let mut frame = 0;
    while frame < frames {
        let at = HEAD_BYTES + 4 * u64::from(frame);
        let part_size = chunk.len().min(4 * (frames - frame) as usize);
        let part = &mut chunk[..part_size];
        read(path, file, part, at)?;
        for bytes in part.as_chunks::<4>().0 {
            let at = HEAD_BYTES + 4 * u64::from(frame);
            let time_s = f64::from(f32::from_be_bytes(*bytes));
            if !time_s.is_finite() {
                return Err(damage(path, at, format!("frame {frame} is at {time_s} s")));
            }
            match times_s.last() {
                Some(&last) if time_s < last => {
                    return Err(damage(
                        path,
                        at,
                        format!("frame {frame} is at {time_s} s, before the frame before it at {last} s"),
                    ));
                }
                // Of two frames at one time the later one is what is seen from then on.
                Some(&last) if time_s == last => {
                    kept.pop();
                }
                _ => times_s.push(time_s),
            }
            kept.push(frame);
            frame += 1;
        }
    }
    Ok((times_s, kept))
}
