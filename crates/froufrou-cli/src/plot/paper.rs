//! The picture of a database of paper: the matrix of its sizes, l_r down and l_c across, with how many clips there are of each,
//! and its spectrum (Figure 9 of Schreck et al. 2016).

use froufrou::Result;
use froufrou::corpus::paper::{PaperSound, Place, SPACING_HZ};

use super::axis::{Scale, frequency_ticks};
use super::canvas::{Anchor, Canvas, Rectangle};
use super::colour::{GREY, GRID, INK, MARK, WAVE_CORE};
use super::panel::{PictureSize, Sheet};

/// What is so far below the loudest is not shown.
const RANGE_DB: f64 = 50.0;

/// The frequencies that are shown, in hertz.
const SHOWN_HZ: [f64; 2] = [100.0, 20_000.0];

/// Draws a paper.
pub fn draw(sound: &PaperSound, size: PictureSize) -> Result<Canvas> {
    let mut sheet = Sheet::new(size)?;
    let area = sheet.inside(150.0, 120.0, 40.0, 60.0);
    let facts = format!("{} clips, {} spectra", sound.clips().len(), sound.spectra().len());
    let right = sheet.canvas.width() as f64 - 40.0 * sheet.unit_px;
    sheet.title(sound.name(), &facts, area.left, right);
    let sorted = |length: fn(&Place) -> f64| {
        let mut lengths: Vec<f64> = sound.places().iter().map(length).collect();
        lengths.sort_by(f64::total_cmp);
        lengths.dedup();
        lengths
    };
    // What is constrained is the first row and column, at 0.
    let (rulings, borders) = (sorted(|place| place.ruling_m), sorted(|place| place.border_m));
    let loudest = sound.spectra().iter().flat_map(|s| &s.density).fold(1e-12f64, |a, b| a.max(*b));
    let top_db = 20.0 * loudest.log10() + 3.0;
    let (width, height) = (area.width() / borders.len() as f64, area.height() / rulings.len() as f64);
    let gap = 4.0 * sheet.unit_px;
    let label = |m: f64| if m > 0.0 { format!("{:.3}", m * 100.0) } else { "0".to_owned() };
    let short = |text: String| {
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        text.to_owned()
    };
    let middle = 0.345 * sheet.letters_px();
    for (column, border_m) in borders.iter().enumerate() {
        let x = area.left + (column as f64 + 0.5) * width;
        let y = area.top - 14.0 * sheet.unit_px;
        sheet.text(&short(label(*border_m)), x, y, Anchor::Middle, GREY);
    }
    for (row, ruling_m) in rulings.iter().enumerate() {
        let y = area.top + (row as f64 + 0.5) * height + middle;
        sheet.text(&short(label(*ruling_m)), area.left - 14.0 * sheet.unit_px, y, Anchor::End, GREY);
    }
    let name_y = area.top - 44.0 * sheet.unit_px;
    sheet.text("l_c, free border (cm)", (area.left + area.right) / 2.0, name_y, Anchor::Middle, INK);
    sheet.side_name(area, "l_r, rulings (cm)", area.left - 110.0 * sheet.unit_px);
    for (row, ruling_m) in rulings.iter().enumerate() {
        for (column, border_m) in borders.iter().enumerate() {
            let left = area.left + column as f64 * width;
            let top = area.top + row as f64 * height;
            let cell = Rectangle { left, top, right: left + width - gap, bottom: top + height - gap };
            let is_it = |place: &&Place| place.ruling_m == *ruling_m && place.border_m == *border_m;
            match sound.places().iter().find(is_it) {
                Some(place) => draw_cell(&mut sheet, cell, sound, place, top_db),
                None => sheet.canvas.fill(cell, GRID, 0.4),
            }
        }
    }
    let y = area.bottom + 32.0 * sheet.unit_px;
    let [from_hz, to_hz] = SHOWN_HZ;
    let told = format!(
        "numbers: clips of a size; lines: friction at 1 m/s, {from_hz:.0} Hz to {:.0} kHz, {RANGE_DB:.0} dB",
        to_hz / 1e3
    );
    sheet.text(&told, area.left, y, Anchor::Start, GREY);
    Ok(sheet.canvas)
}

fn draw_cell(sheet: &mut Sheet, cell: Rectangle, sound: &PaperSound, place: &Place, top_db: f64) {
    let unit = sheet.unit_px;
    let [from_hz, to_hz] = SHOWN_HZ;
    let frequency = Scale::Logarithmic { from: from_hz, to: to_hz };
    for tick in frequency_ticks(from_hz, to_hz, 3) {
        let x = cell.left + frequency.place(tick.value) * cell.width();
        sheet.canvas.line([x, cell.top], [x, cell.bottom], unit.max(0.5), GRID, 1.0);
    }
    sheet.canvas.frame(cell, unit.max(1.0), GRID);
    for &number in &place.spectra {
        let density = &sound.spectra()[number].density;
        let points = (cell.width() / (2.0 * unit)).max(8.0) as usize;
        let mut last: Option<[f64; 2]> = None;
        for n in 0..points {
            let edge = |n: f64| frequency.value(n / points as f64) / SPACING_HZ;
            let (low, high) = (edge(n as f64), edge(n as f64 + 1.0));
            let first = (low as usize).saturating_sub(1).min(density.len().saturating_sub(1));
            let end = (high as usize).max(first + 1).min(density.len());
            let inside = &density[first.min(end)..end];
            let mean = inside.iter().map(|a| a * a).sum::<f64>() / inside.len().max(1) as f64;
            let level = (10.0 * mean.max(1e-30).log10() - top_db + RANGE_DB) / RANGE_DB;
            let x = cell.left + (n as f64 + 0.5) / points as f64 * cell.width();
            let at = [x, cell.bottom - level.clamp(0.0, 1.0) * cell.height()];
            if let Some(from) = last {
                sheet.canvas.line(from, at, 1.6 * unit, WAVE_CORE, 0.9);
            }
            last = Some(at);
        }
    }
    if !place.clips.is_empty() {
        let (x, y) = (cell.right - 6.0 * unit, cell.top + 22.0 * unit);
        sheet.text(&place.clips.len().to_string(), x, y, Anchor::End, MARK);
    }
}
