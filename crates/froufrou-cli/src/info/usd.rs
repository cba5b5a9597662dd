//! What a USD file says about all of its stage.

use froufrou::scene::usd::Usd;

use super::animation::Facts;
use super::sheet::number;

/// The facts that a file has of itself.
pub fn facts(file: &Usd) -> Facts {
    let facts = file.facts();
    let by_rule = if facts.unit_is_written { "" } else { " (not written; USD's rule)" };
    let told = [
        ("comment", facts.comment.clone()),
        ("up", Some(if facts.z_up { "+Z" } else { "+Y" }.to_owned())),
        ("unit", Some(format!("{} m{by_rule}", number(facts.metres_per_unit)))),
        ("time codes a second", Some(number(facts.codes_per_second))),
        ("frames a second", facts.frames_per_second.map(number)),
    ];
    told.into_iter().filter_map(|(label, value)| Some((label, value?))).collect()
}
