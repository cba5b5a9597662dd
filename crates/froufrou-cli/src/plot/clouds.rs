//! The picture of a space of features: units before and after a warp.

use std::path::Path;

use froufrou::Result;

use super::axis::{Scale, linear_ticks};
use super::canvas::{Anchor, Rectangle};
use super::colour::{Colour, DISTINCT, GREY, INK, RULE};
use super::panel::{PictureSize, Sheet};

/// The units of a clip, as points of two coefficients.
pub struct Cloud {
    /// Where the target has them.
    pub before: Vec<[f64; 2]>,
    /// Where the warp carries them.
    pub after: Vec<[f64; 2]>,
    /// Where the recording has what they are paired with.
    pub wanted: Vec<[f64; 2]>,
}

/// Draws clips among the units of recordings, before and after a warp, side by side in one scale.
///
/// # Errors
/// Where the picture cannot be written.
pub fn clouds(
    png: &Path,
    title: &str,
    coefficients: [usize; 2],
    ground: &[[f64; 2]],
    clips: &[Cloud],
    size: PictureSize,
) -> Result<()> {
    let mut sheet = Sheet::new(size)?;
    let whole = sheet.inside(124.0, 110.0, 40.0, 104.0);
    let facts = format!("{} units of the recordings, {} clips", ground.len(), clips.len());
    sheet.title(title, &facts, whole.left, whole.right);
    let points = || {
        let clips = clips.iter().flat_map(|clip| clip.before.iter().chain(&clip.after).chain(&clip.wanted));
        ground.iter().chain(clips).filter(|point| point.iter().all(|c| c.is_finite()))
    };
    let scale = |axis: usize| {
        let low = points().map(|point| point[axis]).fold(f64::INFINITY, f64::min);
        let high = points().map(|point| point[axis]).fold(f64::NEG_INFINITY, f64::max);
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let room = (0.04 * (high - low)).max(0.5e-3);
        Scale::Linear { from: low - room, to: high + room }
    };
    let scales = [scale(0), scale(1)];
    let gap = 60.0 * sheet.unit_px;
    let middle = ((whole.left + whole.right) / 2.0).round();
    let panels = [
        (Rectangle { right: middle - gap / 2.0, ..whole }, "before the warp"),
        (Rectangle { left: middle + gap / 2.0, ..whole }, "after the warp"),
    ];
    for (number, (area, name)) in panels.into_iter().enumerate() {
        let ticks = [ticks(scales[0], sheet.most_across(area)), ticks(scales[1], sheet.most_down(area))];
        sheet.upright_grid(area, scales[0], &ticks[0]);
        sheet.level_grid(area, scales[1], &ticks[1]);
        let unit = sheet.unit_px;
        let place = |point: &[f64; 2]| {
            let x = area.left + scales[0].place(point[0]) * area.width();
            [x, area.bottom - scales[1].place(point[1]) * area.height()]
        };
        for point in ground {
            sheet.canvas.disc(place(point), 1.6 * unit, RULE, 0.35);
        }
        for (clip, colour) in clips.iter().zip(DISTINCT.into_iter().cycle()) {
            let ours = if number == 0 { &clip.before } else { &clip.after };
            for (points, is_filled) in [(&clip.wanted, false), (ours, true)] {
                for point in points {
                    mark(&mut sheet, place(point), 3.5, is_filled, colour);
                }
            }
            for (points, is_filled) in [(&clip.wanted, false), (ours, true)] {
                if let Some(mean) = mean(points) {
                    mark(&mut sheet, place(&mean), 10.0, is_filled, colour);
                }
            }
        }
        sheet.frame(area);
        sheet.text(name, (area.left + area.right) / 2.0, area.top - 14.0 * unit, Anchor::Middle, INK);
        sheet.lower_axis(area, scales[0], &ticks[0], &format!("coefficient {}", coefficients[0]));
        if number == 0 {
            sheet.side_axis(area, scales[1], &ticks[1], false);
            sheet.side_name(area, &format!("coefficient {}", coefficients[1]), area.left - 96.0 * unit);
        }
    }
    let below = sheet.canvas.height() as f64 - 12.0 * sheet.unit_px;
    sheet.text(
        "dots: target, rings: recordings, grey: all recorded units",
        whole.left,
        below,
        Anchor::Start,
        GREY,
    );
    sheet.canvas.save(png)
}

fn ticks(scale: Scale, most: usize) -> Vec<super::axis::Tick> {
    linear_ticks(scale.value(0.0), scale.value(1.0), most)
}

fn mean(points: &[[f64; 2]]) -> Option<[f64; 2]> {
    let n = points.len() as f64;
    let sum = |axis: usize| points.iter().map(|point| point[axis]).sum::<f64>();
    (n > 0.0).then(|| [sum(0) / n, sum(1) / n])
}

/// A dot with a white rim, or a ring.
fn mark(sheet: &mut Sheet, at: [f64; 2], radius: f64, is_filled: bool, colour: Colour) {
    let unit = sheet.unit_px;
    let inner = if is_filled { colour } else { [255; 3] };
    let rim = if is_filled { [255; 3] } else { colour };
    sheet.canvas.disc(at, radius * unit, rim, 0.9);
    sheet.canvas.disc(at, (radius - if radius > 5.0 { 2.5 } else { 1.2 }) * unit, inner, 1.0);
}
