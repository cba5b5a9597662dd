//! Which loudspeaker each channel of a file is for.
//!
//! WAV files say it with a bit for each of eighteen places (`dwChannelMask`); their channels stand in
//! the order of those bits. FLAC has the same mask as a tag. Channels that are for no known
//! loudspeaker, or stand in another order, have a mask of 0: they are what they are.

/// The places in the order of their bits, each with the names by which a channel may be called.
const PLACES: [&[&str]; 18] = [
    &["left", "front left"],
    &["right", "front right"],
    &["center", "front center", "mono"],
    &["lfe", "low frequency"],
    &["back left"],
    &["back right"],
    &["left of center", "front left of center"],
    &["right of center", "front right of center"],
    &["back center"],
    &["side left"],
    &["side right"],
    &["top center", "top"],
    &["top front left"],
    &["top front center"],
    &["top front right"],
    &["top back left"],
    &["top back center"],
    &["top back right"],
];

/// The mask of a single channel.
const MONO: u32 = 0x4;

/// The mask of a left and a right channel.
const STEREO: u32 = 0x3;

/// The mask of channels by their names; 0 where they do not all name a place, each another, in the
/// order of WAV files. A single channel of any other name is mono.
///
/// Capitals, hyphens and underscores do not matter, and `centre` is `center`.
///
/// ```
/// use froufrou::render::speakers::mask;
/// assert_eq!(mask(&["left", "right"]), 0x3);
/// assert_eq!(mask(&["left", "right", "centre", "LFE", "back_left", "back_right"]), 0x3f);
/// assert_eq!(mask(&["right", "left"]), 0);
/// assert_eq!(mask(&["beside the camera"]), 0x4);
/// ```
pub fn mask<S: AsRef<str>>(names: &[S]) -> u32 {
    let mut mask = 0;
    for name in names {
        match bit(name.as_ref()) {
            // A later place has a higher bit.
            Some(bit) if bit > mask => mask |= bit,
            _ if names.len() == 1 => return MONO,
            _ => return 0,
        }
    }
    mask
}

/// The mask of channels that have no names: mono, stereo, or unknown.
pub fn usual_mask(channels: usize) -> u32 {
    match channels {
        1 => MONO,
        2 => STEREO,
        _ => 0,
    }
}

/// The mask that the channels of a FLAC file have by their number (RFC 9639, section 9.1.3).
pub fn flac_mask(channels: usize) -> u32 {
    [0, MONO, STEREO, 0x7, 0x33, 0x37, 0x3f, 0x70f, 0x63f].get(channels).copied().unwrap_or(0)
}

/// The places of a mask, in the order of the channels.
pub fn names(mask: u32) -> Vec<&'static str> {
    let named = PLACES.iter().enumerate().filter(|(bit, _)| mask >> bit & 1 != 0);
    named.map(|(_, names)| names[0]).collect()
}

fn bit(name: &str) -> Option<u32> {
    let name = name.to_lowercase().replace(['-', '_'], " ").replace("centre", "center");
    PLACES.iter().position(|names| names.contains(&name.as_str())).map(|bit| 1 << bit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_has_a_bit_of_its_own_and_a_name_that_leads_back() {
        let all = names(0x3ffff);
        assert_eq!(all.len(), 18);
        assert_eq!(mask(&all), 0x3ffff);
        for (bit, name) in all.iter().enumerate() {
            assert_eq!(names(mask(&[name])), [all[bit]]);
        }
    }

    #[test]
    fn layouts_have_the_masks_of_their_kind() {
        let five_one =
            ["front left", "front right", "front centre", "low-frequency", "side left", "side right"];
        assert_eq!(mask(&five_one), 0x60f);
        assert_eq!(mask(&["left", "right", "back left", "back right"]), 0x33);
        assert_eq!(mask(&["mono"]), 0x4);
        assert_eq!(mask(&["right"]), 0x2);
        for other in [&["left", "left"][..], &["left", "tree"], &["w", "x", "y", "z"], &[]] {
            assert_eq!(mask(other), 0, "{other:?}");
        }
    }

    #[test]
    fn flac_assigns_as_many_places_as_there_are_channels() {
        for channels in 1..=8 {
            assert_eq!(flac_mask(channels).count_ones() as usize, channels);
        }
    }
}
