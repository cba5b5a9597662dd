//! The files of a sequence: found by a pattern, in the order of their frames.

use std::path::{Path, PathBuf};

use crate::scene::animation::KeyTimes;
use crate::scene::asset::Folder;
use crate::{Error, Place, Result};

/// True for a path that is no file, but whose last part has what makes a pattern.
pub(crate) fn is_pattern(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.contains(['*', '?', '[', '{']) && !path.is_file()
}

/// True where the part of a pattern that names folders is plain, so that all files are in one.
pub(crate) fn is_in_one_folder(pattern: &str) -> bool {
    let (folders, _) = pattern.rsplit_once('/').unwrap_or_default();
    !folders.contains(['*', '?', '[', '{'])
}

/// The files that match, in the order of their frames, and their times.
///
/// # Errors
/// No files that match; one that is no OBJ file; one without a number in its name, or with the number
/// of another.
pub(super) fn find(pattern: &Path, frame_rate_hz: f64) -> Result<(Vec<PathBuf>, KeyTimes)> {
    let at_pattern = |fault: Error| fault.in_file(pattern);
    let name = pattern.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    // What may be reached was checked by who named the pattern; its folder is taken as it is written.
    let folder = Folder::new(pattern.parent().unwrap_or(Path::new("")), true).map_err(at_pattern)?;
    let mut files = Vec::new();
    for asset in folder.files(name).map_err(at_pattern)? {
        if !asset.name.to_lowercase().ends_with(".obj") {
            return Err(Error::new(format!("{:?} matches and is no OBJ file", asset.name))
                .in_file(pattern)
                .at(Place::Part("sequence".to_owned()))
                .help("only OBJ files make a sequence: write a narrower pattern, such as `cloth_*.obj`"));
        }
        let stem = asset.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let frame = last_number(&stem).and_then(|(at, length)| stem[at..at + length].parse::<u64>().ok());
        let Some(frame) = frame else {
            return Err(Error::new(format!("the name of {:?} has no frame number", asset.name))
                .in_file(pattern)
                .at(Place::Part("sequence".to_owned()))
                .help("the last number in a name is its frame, as in cloth_0012.obj"));
        };
        files.push((frame, asset.path));
    }
    files.sort();
    if let Some([(frame, a), (_, b)]) = files.array_windows().find(|[(a, _), (b, _)]| a == b) {
        let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        return Err(Error::new(format!("{} and {} are both frame {frame}", name(a), name(b)))
            .in_file(pattern)
            .at(Place::Part("sequence".to_owned()))
            .help("write a pattern that matches one sequence alone"));
    }
    let times_s: Vec<f64> = files.iter().map(|(frame, _)| *frame as f64 / frame_rate_hz).collect();
    if !times_s.last().is_some_and(|last| last.is_finite()) || times_s.array_windows().any(|[a, b]| a >= b) {
        return Err(Error::new(format!("frame numbers too large to tell apart at {frame_rate_hz} Hz"))
            .in_file(pattern)
            .at(Place::Part("sequence".to_owned()))
            .help("number the files from 1"));
    }
    let largest_s = times_s.last().copied().unwrap_or_default();
    // Quotients differ from sums of steps in their last digits.
    let key_times = KeyTimes::from_times(times_s, largest_s * 4.0 * f64::EPSILON);
    Ok((files.into_iter().map(|(_, path)| path).collect(), key_times))
}

/// Where the last number in a name begins, and how many digits it has.
fn last_number(stem: &str) -> Option<(usize, usize)> {
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let begin = stem[..end].rfind(|c: char| !c.is_ascii_digit());
    let begin = begin.map_or(0, |at| at + stem[at..].chars().next().map_or(0, char::len_utf8));
    Some((begin, end - begin))
}

/// The name without its last number and what joins it on: `cloth_0012` is of `cloth`. A name that is
/// nothing else stays as it is.
pub(super) fn without_number(stem: &str) -> &str {
    let Some((at, _)) = last_number(stem) else { return stem };
    let name = stem[..at].trim_end_matches(['_', '-', '.', ' ']);
    if name.is_empty() { stem } else { name }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_number_is_the_frame() {
        for (stem, number, name) in [
            ("cloth_0012", "0012", "cloth"),
            ("v2.cloth-7", "7", "v2.cloth"),
            ("012", "012", "012"),
            ("tür 3 b", "3", "tür"),
            ("é9", "9", "é"),
        ] {
            let found = last_number(stem).map(|(at, length)| &stem[at..at + length]);
            assert_eq!((found, without_number(stem)), (Some(number), name), "{stem}");
        }
        assert_eq!((last_number("cloth"), without_number("cloth")), (None, "cloth"));
    }
}
