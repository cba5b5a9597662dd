//! The picture of a cloth: above, the spectrum of its friction at each measured speed; below, its pops by length and
//! energy.

use froufrou::Result;
use froufrou::corpus::cloth::spectra::FrictionSpectra;
use froufrou::corpus::cloth::{ClothSound, PopEntry};

use super::axis::{Scale, frequency_ticks, linear_ticks, log_ticks};
use super::canvas::{Anchor, Canvas, Rectangle};
use super::colour::{Colour, GREY, INK, MARK, of_level};
use super::panel::{PictureSize, Sheet};

/// What is so far below the loudest is not shown.
const RANGE_DB: f64 = 70.0;

/// The lowest frequency that is shown.
const LOWEST_HZ: f64 = 40.0;

/// The most speeds in the legend.
const MOST_SPEEDS: usize = 14;

/// Draws a cloth.
pub fn draw(sound: &ClothSound, size: PictureSize) -> Result<Canvas> {
    let mut sheet = Sheet::new(size)?;
    let whole = sheet.inside(124.0, 72.0, 230.0, 88.0);
    let facts = match (sound.friction(), sound.pops().len()) {
        (Some(friction), 0) => format!("{} speeds", friction.spectra.measured().len()),
        (Some(friction), pops) => format!("{} speeds, {pops} pops", friction.spectra.measured().len()),
        (None, pops) => format!("{pops} pops"),
    };
    let right = sheet.canvas.width() as f64 - 40.0 * sheet.unit_px;
    sheet.title(sound.name(), &facts, whole.left, right);
    let gap = 110.0 * sheet.unit_px;
    let middle = (whole.top + 0.6 * (whole.height() - gap)).round();
    match (sound.friction(), sound.pops()) {
        (Some(friction), []) => spectra(&mut sheet, whole, &friction.spectra),
        (None, pops) => scatter(&mut sheet, whole, pops),
        (Some(friction), pops) => {
            spectra(&mut sheet, Rectangle { bottom: middle, ..whole }, &friction.spectra);
            scatter(&mut sheet, Rectangle { top: middle + gap, ..whole }, pops);
        }
    }
    Ok(sheet.canvas)
}

/// The colour of a speed by its place among others, from slow to fast; the brightest would not be seen on white.
fn colour(index: usize, count: usize) -> Colour {
    of_level(0.15 + 0.65 * index as f64 / (count.max(2) - 1) as f64)
}

fn spectra(sheet: &mut Sheet, area: Rectangle, spectra: &FrictionSpectra) {
    let spacing_hz = spectra.spacing_hz();
    let top_hz = (spectra.values() as f64 * spacing_hz).max(2.0 * LOWEST_HZ);
    let decibels = |a: f64| 20.0 * a.max(1e-15).log10();
    let smoothed: Vec<Vec<f64>> = spectra.measured().iter().map(|s| smooth(&s.density)).collect();
    let loudest = smoothed.iter().flatten().fold(1e-14, |a: f64, b| a.max(*b));
    let top_db = (decibels(loudest) / 5.0).ceil() * 5.0;
    let frequency = Scale::Logarithmic { from: LOWEST_HZ, to: top_hz };
    let level = Scale::Linear { from: top_db - RANGE_DB, to: top_db };
    let across = frequency_ticks(LOWEST_HZ, top_hz, sheet.most_across(area));
    let down = linear_ticks(top_db - RANGE_DB, top_db, sheet.most_down(area));
    sheet.upright_grid(area, frequency, &across);
    sheet.level_grid(area, level, &down);
    let count = smoothed.len();
    for (index, density) in smoothed.iter().enumerate() {
        let point = |k: usize| {
            let x = area.left + frequency.place((k + 1) as f64 * spacing_hz) * area.width();
            let y = area.bottom - level.place(decibels(density[k])).clamp(0.0, 1.0) * area.height();
            [x, y]
        };
        let first = (LOWEST_HZ / spacing_hz).ceil() as usize;
        let mut last = None;
        for k in first.saturating_sub(1)..density.len() {
            let at = point(k);
            if let Some(from) = last {
                sheet.canvas.line(from, at, 2.0 * sheet.unit_px, colour(index, count), 0.9);
            }
            last = Some(at);
        }
    }
    sheet.frame(area);
    sheet.lower_axis(area, frequency, &across, "frequency (Hz)");
    sheet.side_axis(area, level, &down, false);
    sheet.side_name(area, "density (dB full scale per √Hz)", area.left - 100.0 * sheet.unit_px);
    legend(sheet, area, spectra);
}

/// A spectrum by the mean power over a twelfth of an octave, as wide lines of noise hide what they show.
fn smooth(density: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0];
    for a in density {
        sums.push(sums[sums.len() - 1] + a * a);
    }
    let mean = |k: usize| {
        let half = (((k + 1) as f64) * 0.03) as usize;
        let (from, to) = (k.saturating_sub(half), (k + half + 1).min(density.len()));
        ((sums[to] - sums[from]).max(0.0) / (to - from) as f64).sqrt()
    };
    (0..density.len()).map(mean).collect()
}

fn legend(sheet: &mut Sheet, area: Rectangle, spectra: &FrictionSpectra) {
    let unit = sheet.unit_px;
    let count = spectra.measured().len();
    let step = count.div_ceil(MOST_SPEEDS).max(1);
    let mut y = area.top + 16.0 * unit;
    for (index, spectrum) in spectra.measured().iter().enumerate().step_by(step) {
        if y > area.bottom {
            break;
        }
        let x = area.right + 28.0 * unit;
        sheet.canvas.disc([x, y], 7.0 * unit, colour(index, count), 0.9);
        let baseline = y + 0.345 * sheet.letters_px();
        sheet.text(&format!("{:.3} m/s", spectrum.speed_mps), x + 18.0 * unit, baseline, Anchor::Start, INK);
        y += 32.0 * unit;
    }
}

/// Pops by their length and energy.
fn scatter(sheet: &mut Sheet, area: Rectangle, pops: &[PopEntry]) {
    let heard = || pops.iter().filter(|pop| pop.energy > 0.0);
    let least = heard().map(|pop| pop.energy).fold(f64::INFINITY, f64::min);
    let greatest = heard().map(|pop| pop.energy).fold(0.0, f64::max);
    let longest_ms = heard().map(|pop| pop.length_s * 1e3).fold(1.0, f64::max) * 1.05;
    let (least, greatest) = if greatest > 0.0 { (least, greatest) } else { (0.1, 1.0) };
    let length = Scale::Linear { from: 0.0, to: longest_ms };
    let energy = Scale::Logarithmic { from: least / 2.0, to: greatest * 2.0 };
    let across = linear_ticks(0.0, longest_ms, sheet.most_across(area));
    let down = log_ticks(energy.value(0.0), energy.value(1.0), sheet.most_down(area));
    sheet.upright_grid(area, length, &across);
    sheet.level_grid(area, energy, &down);
    let crowd = (pops.len() as f64 / 100.0).max(1.0).powf(0.25);
    let radius = (6.0 * sheet.unit_px / crowd).max(1.2);
    for pop in heard() {
        let x = area.left + length.place(pop.length_s * 1e3) * area.width();
        let y = area.bottom - energy.place(pop.energy) * area.height();
        sheet.canvas.disc([x, y], radius, MARK, 0.6);
    }
    sheet.frame(area);
    sheet.lower_axis(area, length, &across, "length of a pop (ms)");
    sheet.side_axis(area, energy, &down, false);
    sheet.side_name(area, "energy (s)", area.left - 100.0 * sheet.unit_px);
    if pops.is_empty() {
        let middle = [(area.left + area.right) / 2.0, (area.top + area.bottom) / 2.0];
        sheet.text("no pops", middle[0], middle[1], Anchor::Middle, GREY);
    }
}
