//! The numbers of the tables of An, James & Marschner (2012), for those who start from them.

/// How an animation was made to sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnimationPreset {
    /// The cloth.
    pub cloth: &'static str,
    /// The animation.
    pub animation: &'static str,
    /// How near a vertex is to what it rubs on, in metres (r).
    pub contact_radius_m: f64,
    /// A vertex that is never faster than this is silent, in m/s (s_thresh).
    pub silent_below_mps: f64,
    /// Bucklings of less energy are left out (E_min); none where nothing buckles.
    pub least_buckling: Option<f64>,
}

/// The energy over 20 ms above which there is a pop (E_thresh), as [`pops`](super::pops) understand it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PopPreset {
    /// The cloth.
    pub cloth: &'static str,
    /// Its threshold.
    pub threshold: f64,
}

const fn animation(
    cloth: &'static str,
    animation: &'static str,
    contact_radius_m: f64,
    silent_below_mps: f64,
    least_buckling: Option<f64>,
) -> AnimationPreset {
    AnimationPreset { cloth, animation, contact_radius_m, silent_below_mps, least_buckling }
}

/// All animations of the paper.
pub const ANIMATIONS: [AnimationPreset; 11] = [
    animation("cotton", "sheet", 0.05, 0.02, Some(4878.0)),
    animation("cotton", "couch", 0.2, 0.02, Some(4878.0)),
    animation("polyester", "sheet", 0.05, 0.02, Some(528.0)),
    animation("polyester", "couch", 0.2, 0.02, Some(528.0)),
    animation("windbreaker", "exercises", 0.05, 0.0, Some(98_902.0)),
    animation("windbreaker", "boxing", 0.05, 1.0, Some(172_875.0)),
    animation("windbreaker", "jogging", 0.05, 0.0, Some(906_402.0)),
    animation("corduroy", "exercises", 0.05, 2.0, None),
    animation("corduroy", "boxing", 0.05, 1.0, None),
    animation("corduroy", "jogging", 0.05, 2.0, None),
    animation("windbreaker", "first-person boxing", 0.05, 1.0, Some(172_875.0)),
];

/// All thresholds of the paper.
pub const POPS: [PopPreset; 3] = [
    PopPreset { cloth: "polyester", threshold: 0.25 },
    PopPreset { cloth: "cotton", threshold: 0.5 },
    PopPreset { cloth: "windbreaker", threshold: 0.025 },
];

/// The threshold of a cloth of the paper.
pub fn pop_threshold(cloth: &str) -> Option<f64> {
    POPS.iter().find(|preset| preset.cloth == cloth).map(|preset| preset.threshold)
}

/// The animation of the paper that has this name and cloth.
pub fn of_animation(cloth: &str, animation: &str) -> Option<&'static AnimationPreset> {
    ANIMATIONS.iter().find(|preset| preset.cloth == cloth && preset.animation == animation)
}
