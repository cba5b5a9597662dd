//! Where loudspeakers stand about a listener.
//!
//! The named layouts have the places of ITU-R BS.2051-3, and of ITU-R BS.775-4 for stereo and 5.1, where both
//! say the same:
//!
//! | name | BS.2051 | places: azimuth, elevation |
//! | --- | --- | --- |
//! | `mono` | – | ahead |
//! | `stereo` | A, 0+2+0 | ±30° |
//! | `quad` | – | ±45°, ±135° |
//! | `5.1` | B, 0+5+0 | 0°, ±30°, ±110° |
//! | `7.1` | I, 0+7+0 | 0°, ±30°, ±90°, ±135° |
//! | `5.1.2` | C, 2+5+0 | 5.1, and ±30° at 30° up |
//! | `5.1.4` | D, 4+5+0 | 5.1, and ±30°, ±110° at 30° up |
//! | `7.1.4` | J, 4+7+0 | 7.1, and ±45°, ±135° at 30° up |
//!
//! Their channels have the names and the order of the channel mask of WAV files
//! ([`speakers::mask`](crate::render::speakers::mask)). The surrounds at ±110° are its `side` places, those at
//! ±135° its `back` places. The loudspeaker for low frequencies may stand anywhere.

use std::str::FromStr;

use super::direction::from_angles_deg;
use crate::scene::toml::{alternatives, nearest};
use crate::score::Loudspeaker;
use crate::{Error, Result};

/// A layout has no more loudspeakers than this.
pub const MOST_LOUDSPEAKERS: usize = 64;

impl Loudspeaker {
    /// A loudspeaker for all frequencies.
    pub fn new(name: impl Into<String>, azimuth_deg: f64, elevation_deg: f64) -> Self {
        Self { name: name.into(), azimuth_deg, elevation_deg, is_lfe: false }
    }

    /// The unit vector towards it in the listener's frame (ahead −Z, right +X, up +Y).
    pub fn direction(&self) -> [f64; 3] {
        from_angles_deg(self.azimuth_deg, self.elevation_deg)
    }
}

/// Loudspeakers in the order of their channels: at least one, no two of one name, one at least not for low
/// frequencies alone.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    speakers: Vec<Loudspeaker>,
}

/// Loudspeakers that stand together: names, azimuths and elevations.
type Places = &'static [(&'static str, f64, f64)];

/// The name of the channel for low frequencies.
const LFE: &str = "lfe";

const PAIR: Places = &[("left", 30.0, 0.0), ("right", -30.0, 0.0)];
const CENTER: Places = &[("center", 0.0, 0.0), (LFE, 0.0, 0.0)];
const SIDES: Places = &[("side left", 110.0, 0.0), ("side right", -110.0, 0.0)];
const BACKS_AND_SIDES: Places = &[
    ("back left", 135.0, 0.0),
    ("back right", -135.0, 0.0),
    ("side left", 90.0, 0.0),
    ("side right", -90.0, 0.0),
];
const TOP_FRONTS: Places = &[("top front left", 30.0, 30.0), ("top front right", -30.0, 30.0)];
const TOP_BACKS: Places = &[("top back left", 110.0, 30.0), ("top back right", -110.0, 30.0)];
const TOPS: Places = &[
    ("top front left", 45.0, 30.0),
    ("top front right", -45.0, 30.0),
    ("top back left", 135.0, 30.0),
    ("top back right", -135.0, 30.0),
];

/// What stands where in the named layouts, in the order of the channel mask.
const NAMED: [(&str, &[Places]); 8] = [
    ("mono", &[&[("mono", 0.0, 0.0)]]),
    ("stereo", &[PAIR]),
    (
        "quad",
        &[&[
            ("left", 45.0, 0.0),
            ("right", -45.0, 0.0),
            ("back left", 135.0, 0.0),
            ("back right", -135.0, 0.0),
        ]],
    ),
    ("5.1", &[PAIR, CENTER, SIDES]),
    ("7.1", &[PAIR, CENTER, BACKS_AND_SIDES]),
    ("5.1.2", &[PAIR, CENTER, SIDES, TOP_FRONTS]),
    ("5.1.4", &[PAIR, CENTER, SIDES, TOP_FRONTS, TOP_BACKS]),
    ("7.1.4", &[PAIR, CENTER, BACKS_AND_SIDES, TOPS]),
];

impl Layout {
    /// A layout of one's own.
    ///
    /// # Errors
    /// No loudspeaker or more than [`MOST_LOUDSPEAKERS`], none but for low frequencies, a name that is empty or
    /// given twice, an angle that is no number or an elevation beyond ±90°.
    pub fn new(speakers: Vec<Loudspeaker>) -> Result<Self> {
        check(&speakers)?;
        Ok(Self { speakers })
    }

    /// A layout by its name, `5.1` for one; all of them are [`Layout::names`].
    ///
    /// ```
    /// use froufrou::space::layout::Layout;
    /// let layout = Layout::named("5.1").unwrap();
    /// assert_eq!(layout.speakers()[4].name, "side left");
    /// assert_eq!(layout.speakers()[4].azimuth_deg, 110.0);
    /// assert!(layout.speakers()[3].is_lfe);
    /// ```
    ///
    /// # Errors
    /// A name that is none of them.
    pub fn named(name: &str) -> Result<Self> {
        let Some((_, places)) = NAMED.iter().find(|(known, _)| *known == name) else {
            let what = format!("unknown layout `{name}`, expected {}", alternatives(Self::names()));
            let error = Error::new(what);
            return Err(match nearest(name, Self::names()) {
                Some(near) => error.help(format!("did you mean `{near}`?")),
                None => error,
            });
        };
        let speaker = |&(name, azimuth_deg, elevation_deg): &(&str, f64, f64)| Loudspeaker {
            is_lfe: name == LFE,
            ..Loudspeaker::new(name, azimuth_deg, elevation_deg)
        };
        Ok(Self { speakers: places.iter().copied().flatten().map(speaker).collect() })
    }

    /// The names of the layouts that have one.
    pub fn names() -> impl Iterator<Item = &'static str> {
        NAMED.iter().map(|(name, _)| *name)
    }

    /// Its loudspeakers in the order of the channels.
    pub fn speakers(&self) -> &[Loudspeaker] {
        &self.speakers
    }

    /// The names of its channels.
    pub fn channel_names(&self) -> impl Iterator<Item = &str> {
        self.speakers.iter().map(|speaker| speaker.name.as_str())
    }
}

impl FromStr for Layout {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::named(name)
    }
}

/// Refuses what no layout can be.
pub(super) fn check(speakers: &[Loudspeaker]) -> Result<()> {
    if speakers.len() > MOST_LOUDSPEAKERS {
        let what =
            format!("{} loudspeakers, and no more than {MOST_LOUDSPEAKERS} are possible", speakers.len());
        return Err(Error::new(what));
    }
    for (i, Loudspeaker { name, azimuth_deg, elevation_deg, .. }) in speakers.iter().enumerate() {
        if name.is_empty() {
            return Err(Error::new(format!("loudspeaker {} has no name", i + 1)));
        }
        if speakers[..i].iter().any(|other| other.name == *name) {
            return Err(Error::new(format!("two loudspeakers are called `{name}`")));
        }
        if !azimuth_deg.is_finite() {
            return Err(Error::new(format!(
                "the azimuth of loudspeaker `{name}` is {azimuth_deg}, expected degrees"
            )));
        }
        if !(-90.0..=90.0).contains(elevation_deg) {
            return Err(Error::new(format!(
                "the elevation of loudspeaker `{name}` is {elevation_deg}, expected degrees from -90 to 90"
            )));
        }
    }
    if speakers.iter().all(|speaker| speaker.is_lfe) {
        let what = match speakers.len() {
            0 => "there is no loudspeaker".to_owned(),
            _ => "all loudspeakers are for low frequencies only".to_owned(),
        };
        return Err(Error::new(what).help("name at least one that plays all frequencies"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::speakers;

    #[test]
    fn channels_of_named_layouts_have_their_mask() {
        let masks = [0x4, 0x3, 0x33, 0x60f, 0x63f, 0x560f, 0x2d60f, 0x2d63f];
        assert_eq!(Layout::names().count(), masks.len());
        for (name, mask) in Layout::names().zip(masks) {
            let layout = Layout::named(name).unwrap();
            let names: Vec<&str> = layout.channel_names().collect();
            assert_eq!(speakers::mask(&names), mask, "{name}");
            assert_eq!(speakers::names(mask).len(), names.len());
            assert!(check(layout.speakers()).is_ok());
        }
    }

    #[test]
    fn layouts_are_alike_on_both_sides_and_count_what_their_name_says() {
        for name in Layout::names() {
            let layout = Layout::named(name).unwrap();
            let all: Vec<&Loudspeaker> = layout.speakers().iter().filter(|s| !s.is_lfe).collect();
            for speaker in &all {
                let is_mirrored = |other: &&&Loudspeaker| {
                    other.azimuth_deg == -speaker.azimuth_deg && other.elevation_deg == speaker.elevation_deg
                };
                assert!(all.iter().any(|other| is_mirrored(&other)), "{name} {speaker:?}");
            }
            let counts: Vec<usize> = name.split('.').filter_map(|n| n.parse().ok()).collect();
            if let [level, low, above @ ..] = &counts[..] {
                assert_eq!(all.iter().filter(|s| s.elevation_deg == 0.0).count(), *level);
                assert_eq!(layout.speakers().iter().filter(|s| s.is_lfe).count(), *low);
                assert_eq!(
                    all.iter().filter(|s| s.elevation_deg > 0.0).count(),
                    above.first().map_or(0, |n| *n)
                );
            }
        }
    }

    #[test]
    fn what_is_no_layout_is_refused() {
        let one = |azimuth, elevation| vec![Loudspeaker::new("a", azimuth, elevation)];
        let fault = |speakers| Layout::new(speakers).unwrap_err().to_string();
        assert!(fault(vec![]).contains("there is no loudspeaker"));
        assert!(fault(one(f64::NAN, 0.0)).contains("azimuth of loudspeaker `a` is NaN"));
        assert!(fault(one(0.0, 91.0)).contains("elevation of loudspeaker `a` is 91"));
        assert!(fault(one(0.0, f64::NAN)).contains("elevation"));
        assert!(fault(vec![Loudspeaker::new("", 0.0, 0.0)]).contains("loudspeaker 1 has no name"));
        let twice = vec![Loudspeaker::new("a", 0.0, 0.0), Loudspeaker::new("a", 30.0, 0.0)];
        assert!(fault(twice).contains("two loudspeakers are called `a`"));
        let low = vec![Loudspeaker { is_lfe: true, ..Loudspeaker::new("a", 0.0, 0.0) }];
        assert!(fault(low).contains("low frequencies only"));
        let many = (0..65).map(|i| Loudspeaker::new(format!("s{i}"), f64::from(i), 0.0)).collect();
        assert!(fault(many).contains("65 loudspeakers"));
        let fault = "5.1.3".parse::<Layout>().unwrap_err().to_string();
        assert!(fault.contains("unknown layout `5.1.3`, expected `mono`, `stereo`"), "{fault}");
        assert!(fault.contains("did you mean `5.1"), "{fault}");
        assert!(Layout::new(one(30.0, 0.0)).is_ok());
    }
}
