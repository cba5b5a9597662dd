//! The picture of a sound: the waveform of every channel above a spectrogram.

use std::ops::Range;

use froufrou::Result;

use super::axis::{Scale, Tick, frequency_ticks, linear_ticks, number, time_ticks};
use super::canvas::{Anchor, Canvas, Lettering, Rectangle};
use super::colour::{GREY, GRID, MARK, WAVE, WAVE_CORE, of_level};
use super::envelope;
use super::panel::{PictureSize, Sheet};
use super::spectrogram::{Mix, Spectrogram};

/// The lowest frequency shown, in hertz.
const LOWEST_HZ: f64 = 20.0;

/// The levels that the colours span, in dB.
const LEVELS_DB: f64 = 90.0;

/// A sound to be drawn.
pub struct Soundtrack<'a> {
    /// What stands above it.
    pub title: &'a str,
    /// Frames a second.
    pub rate_hz: u32,
    /// The samples of every channel, nominally within ±1.
    pub channels: &'a [Vec<f32>],
    /// The seconds shown; `None`: all of them.
    pub span_s: Option<(f64, f64)>,
    /// Times in seconds to be marked, such as events, and what they are.
    pub marks: &'a [(f64, String)],
}

impl Soundtrack<'_> {
    /// Draws the picture. Beside the sound it takes memory in proportion to its pixels.
    ///
    /// # Errors
    /// As [`Canvas::new`].
    pub fn draw(&self, size: PictureSize) -> Result<Canvas> {
        let mut sheet = Sheet::new(size)?;
        let range = self.range();
        let span_s =
            (range.start as f64 / f64::from(self.rate_hz), range.end as f64 / f64::from(self.rate_hz));
        let time = Scale::Linear { from: span_s.0, to: span_s.1 };
        let marks = !self.marks.is_empty();
        let whole = sheet.inside(104.0, if marks { 104.0 } else { 72.0 }, 128.0, 88.0);
        sheet.title(self.title, &self.facts(), whole.left, whole.right);

        let gap = (16.0 * sheet.unit_px).round();
        let spectrograms = if self.channels.len() <= 2 { self.channels.len() } else { 1 };
        // The more channels, the more of the picture is waveforms.
        let part = 0.26 + 0.06 * (self.channels.len().clamp(1, 5) - 1) as f64;
        let wave = Rectangle { bottom: (whole.top + part * whole.height()).round(), ..whole };
        let below = Rectangle { top: wave.bottom + gap, ..whole };

        let (ticks, unit) = time_ticks(span_s.0, span_s.1, sheet.most_across(whole));
        let peak = self.peak(&range);
        let rows = split(wave, self.channels.len(), 4.0 * sheet.unit_px);
        for (number, (channel, area)) in self.channels.iter().zip(&rows).enumerate() {
            sheet.upright_grid(*area, time, &ticks);
            waveform(&mut sheet.canvas, *area, channel, range.clone(), peak);
            self.label_wave(&mut sheet, *area, number, peak);
        }

        let frequencies = Scale::Logarithmic { from: LOWEST_HZ, to: f64::from(self.rate_hz) / 2.0 };
        let panels = split(below, spectrograms, gap / 2.0);
        let pictures: Vec<Spectrogram> = (0..spectrograms)
            .map(|index| {
                let sound = match self.channels.len() {
                    0..=2 => Mix::new(self.channels.get(index).map(Vec::as_slice)),
                    _ => Mix::new(self.channels.iter().map(Vec::as_slice)),
                };
                let (columns, rows) = (panels[index].width() as usize, panels[index].height() as usize);
                Spectrogram::new(&sound, self.rate_hz, range.clone(), columns, rows, frequencies)
            })
            .collect();
        let loudest = pictures.iter().map(|p| f64::from(p.loudest_db())).fold(f64::NEG_INFINITY, f64::max);
        // Silence gets the scale of a full-scale sound.
        let top_db = if loudest > -150.0 { (loudest / 5.0).ceil() * 5.0 } else { 0.0 };
        let levels = Scale::Linear { from: top_db - LEVELS_DB, to: top_db };
        for (index, (picture, area)) in pictures.iter().zip(&panels).enumerate() {
            paint(&mut sheet.canvas, *area, picture, levels);
            sheet.frame(*area);
            let ticks = frequency_ticks(LOWEST_HZ, f64::from(self.rate_hz) / 2.0, sheet.most_down(*area));
            sheet.side_axis(*area, frequencies, &ticks, false);
            if let ([_, _], Some(name)) = (self.channels, channel_name(index, self.channels.len())) {
                on_picture(&mut sheet, *area, &name);
            } else if self.channels.len() > 2 {
                on_picture(&mut sheet, *area, "average of all channels");
            }
        }
        if let (Some(last), Some(picture)) = (panels.last(), pictures.first()) {
            let name = format!("time ({unit})");
            sheet.lower_axis(*last, time, &ticks, &name);
            let window = format!(
                "waveforms to ±{} · Hann window {} ms",
                half_tick(peak, peak).label,
                number(picture.window_s * 1e3, 1.0)
            );
            let baseline = last.bottom + 60.0 * sheet.unit_px;
            // Beside the name of the axis, as far as there is room.
            let letters = sheet.letters_px();
            let name_px = sheet.canvas.text_width_px(&name, letters);
            let room_px = (last.width() - name_px) / 2.0 - 12.0 * sheet.unit_px;
            let window = sheet.canvas.fitted(&window, letters, room_px);
            sheet.text(&window, last.left, baseline, Anchor::Start, GREY);
        }
        colour_bar(&mut sheet, below, levels);
        if marks {
            self.draw_marks(&mut sheet, wave, below, time);
        }
        Ok(sheet.canvas)
    }

    /// The frames shown: at least one.
    fn range(&self) -> Range<usize> {
        let frames = self.channels.first().map_or(0, Vec::len);
        let (from_s, to_s) = self.span_s.unwrap_or((0.0, f64::INFINITY));
        let frame =
            |time_s: f64| (time_s * f64::from(self.rate_hz)).round().clamp(0.0, frames as f64) as usize;
        let from = frame(from_s).min(frames.saturating_sub(1));
        from..frame(to_s).max(from + 1)
    }

    fn facts(&self) -> String {
        let frames = self.channels.first().map_or(0, Vec::len);
        let length_s = frames as f64 / f64::from(self.rate_hz);
        let channels = match self.channels.len() {
            1 => "mono".to_owned(),
            2 => "stereo".to_owned(),
            count => format!("{count} channels"),
        };
        format!("{} · {} kHz · {channels}", crate::plot::length(length_s), f64::from(self.rate_hz) / 1e3)
    }

    /// The value at the edge of the waveforms: round, and no less than the peak.
    fn peak(&self, range: &Range<usize>) -> f64 {
        let shown = self.channels.iter().filter_map(|channel| channel.get(range.clone()));
        let peak = shown.flatten().fold(0.0f32, |peak, sample| peak.max(sample.abs()));
        let peak = f64::from(peak);
        if peak < 1e-6 {
            return 1.0;
        }
        let power = 10f64.powf(peak.log10().floor());
        [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|edge| *edge >= peak).unwrap_or(peak)
    }

    fn label_wave(&self, sheet: &mut Sheet, area: Rectangle, index: usize, peak: f64) {
        sheet.frame(area);
        let scale = Scale::Linear { from: -peak, to: peak };
        let letters = sheet.letters_px();
        if area.height() > 2.5 * letters {
            let ticks = match self.channels.len() {
                1 => linear_ticks(-peak, peak, 4),
                // The labels at the edges of two neighbours would touch.
                _ => [-0.5, 0.0, 0.5].map(|part| half_tick(part * peak, peak)).into(),
            };
            sheet.side_axis(area, scale, &ticks, false);
        }
        if area.height() >= letters
            && let Some(name) = channel_name(index, self.channels.len())
        {
            let lettering =
                Lettering { size_px: letters, colour: GREY, anchor: Anchor::Start, upwards: false };
            let middle = (area.top + area.bottom) / 2.0;
            let x = area.right + 12.0 * sheet.unit_px;
            sheet.canvas.text(&name, x, lettering.baseline_px(middle), &lettering);
        }
    }

    /// Marks above the waveforms, with as many labels as have room, and lines through them.
    fn draw_marks(&self, sheet: &mut Sheet, wave: Rectangle, below: Rectangle, time: Scale) {
        let unit = sheet.unit_px;
        let letters = Lettering { size_px: 17.0 * unit, colour: MARK, anchor: Anchor::Start, upwards: false };
        let mut shown: Vec<(f64, &str)> = self
            .marks
            .iter()
            .map(|(time_s, label)| (time.place(*time_s), label.as_str()))
            .filter(|(place, _)| (0.0..=1.0).contains(place))
            .collect();
        shown.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Crowded marks are thinner, so that the sound is still seen.
        let opacity = (wave.width() / (14.0 * shown.len().max(1) as f64)).clamp(0.12, 0.75);
        let mut free_from = f64::NEG_INFINITY;
        let mut last_x = f64::NEG_INFINITY;
        for (index, (place, label)) in shown.iter().enumerate() {
            let x = wave.left + place * wave.width();
            if x - last_x < 0.5 {
                continue;
            }
            last_x = x;
            // In whole pixels, so that it is sharp.
            let left = (x - 0.6 * unit).round();
            let right = left + (1.2 * unit).round().max(1.0);
            let tick = Rectangle { left, right, top: wave.top - 9.0 * unit, bottom: wave.top };
            sheet.canvas.fill(tick, MARK, 1.0);
            sheet.canvas.fill(Rectangle { top: wave.top, bottom: wave.bottom, ..tick }, MARK, opacity);
            let foot = Rectangle { top: below.top - 6.0 * unit, bottom: below.top - 1.0 * unit, ..tick };
            sheet.canvas.fill(foot, MARK, 1.0);
            // A label stands where it is clear of those before it and ends before the next mark.
            let next = shown
                .get(index + 1)
                .map_or(wave.right + 100.0 * unit, |(place, _)| wave.left + place * wave.width());
            let width = sheet.canvas.text_width_px(label, letters.size_px);
            if x >= free_from && x + width + 6.0 * unit <= next.max(x + 60.0 * unit) {
                sheet.canvas.text(label, left, wave.top - 15.0 * unit, &letters);
                free_from = x + width + 14.0 * unit;
            }
        }
    }
}

/// A tick at half of a round number or at 0.
fn half_tick(value: f64, peak: f64) -> Tick {
    let label = number(value, peak / 100.0);
    let label = label.trim_end_matches('0').trim_end_matches('.');
    Tick { value, label: if label.is_empty() { "0" } else { label }.to_owned() }
}

/// Rows of equal height in whole pixels, with gaps between them.
fn split(area: Rectangle, count: usize, gap: f64) -> Vec<Rectangle> {
    let count = count.max(1);
    let gap = gap.min(area.height() / (4 * count) as f64).round();
    let height = (area.height() + gap) / count as f64;
    (0..count)
        .map(|row| Rectangle {
            top: (area.top + row as f64 * height).round(),
            bottom: ((area.top + (row + 1) as f64 * height).round() - gap).max(area.top + 1.0),
            ..area
        })
        .collect()
}

fn channel_name(index: usize, count: usize) -> Option<String> {
    match count {
        1 => None,
        2 => Some(["left", "right"][index.min(1)].to_owned()),
        _ => Some((index + 1).to_string()),
    }
}

fn waveform(canvas: &mut Canvas, area: Rectangle, samples: &[f32], range: Range<usize>, peak: f64) {
    let middle = (area.top + area.bottom) / 2.0;
    let reach = area.height() / 2.0 / peak;
    canvas.fill(Rectangle { top: middle - 0.5, bottom: middle + 0.5, ..area }, GRID, 1.0);
    for (x, column) in envelope::columns(samples, range, area.width() as usize).iter().enumerate() {
        let y = |value: f32| middle - f64::from(value) * reach;
        // However flat, a line of one pixel is left of it.
        let (top, bottom) = (y(column.greatest), y(column.least));
        let thin = ((1.4 - (bottom - top)) / 2.0).max(0.0);
        let left = area.left + x as f64;
        let stroke = Rectangle {
            left,
            right: left + 1.0,
            top: (top - thin).max(area.top),
            bottom: (bottom + thin).min(area.bottom),
        };
        let Some(rms) = column.rms else {
            canvas.fill(stroke, WAVE_CORE, 1.0);
            continue;
        };
        canvas.fill(stroke, WAVE, 1.0);
        // The effective value of an offset wave may lie outside of what it spans.
        let core = Rectangle { top: y(rms).max(stroke.top), bottom: y(-rms).min(stroke.bottom), ..stroke };
        if core.bottom > core.top {
            canvas.fill(core, WAVE_CORE, 1.0);
        }
    }
}

fn paint(canvas: &mut Canvas, area: Rectangle, picture: &Spectrogram, levels: Scale) {
    for column in 0..area.width() as usize {
        for (row, level) in picture.column_db(column).iter().enumerate() {
            let (x, y) = (area.left as i64 + column as i64, area.bottom as i64 - 1 - row as i64);
            canvas.blend(x, y, of_level(levels.place(f64::from(*level))), 1.0);
        }
    }
}

fn on_picture(sheet: &mut Sheet, area: Rectangle, text: &str) {
    let unit = sheet.unit_px;
    if area.height() > 60.0 * unit {
        sheet.text(text, area.right - 12.0 * unit, area.top + 28.0 * unit, Anchor::End, [0xff; 3]);
    }
}

fn colour_bar(sheet: &mut Sheet, beside: Rectangle, levels: Scale) {
    let unit = sheet.unit_px;
    let left = (beside.right + 22.0 * unit).round();
    let bar = Rectangle { left, right: (left + 16.0 * unit).round(), ..beside };
    let rows = bar.height().max(1.0);
    for row in 0..rows as usize {
        let top = bar.bottom - row as f64 - 1.0;
        let colour = of_level((row as f64 + 0.5) / rows);
        sheet.canvas.fill(Rectangle { top, bottom: top + 1.0, ..bar }, colour, 1.0);
    }
    sheet.frame(bar);
    let Scale::Linear { from, to } = levels else { return };
    let mut ticks = linear_ticks(from, to, (bar.height() / (40.0 * unit)).clamp(1.0, 9.0) as usize);
    for tick in &mut ticks {
        tick.value = tick.value.clamp(from, to);
    }
    sheet.side_axis(bar, levels, &ticks, true);
    let name = "dB of a full-scale sine";
    let room = bar.height() > sheet.canvas.text_width_px(name, sheet.letters_px());
    sheet.side_name(bar, if room { name } else { "dB" }, bar.right + 70.0 * unit);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(rate_hz: u32, channels: &[Vec<f32>], marks: &[(f64, String)]) -> Result<Canvas> {
        let sound = Soundtrack { title: "test", rate_hz, channels, span_s: None, marks };
        sound.draw(PictureSize { width_px: 400, height_px: 300 })
    }

    #[test]
    fn the_smallest_and_the_widest_sounds_are_drawn() -> Result<()> {
        for (rate_hz, channels) in [(1000, 1), (8000, 2), (192_000, 8), (768_000, 64)] {
            for frames in [1, 2, 3000] {
                for value in [0.0, 0.5, -3.0e38] {
                    draw(rate_hz, &vec![vec![value; frames]; channels], &[])?;
                }
            }
        }
        Ok(())
    }

    #[test]
    fn marks_stand_at_their_times() -> Result<()> {
        let sound = vec![vec![0.0; 8000]];
        let with = draw(8000, &sound, &[(0.5, "hit".into()), (7.0, "outside".into())])?;
        // The line through the waveform is the only red there is below the labels.
        let red = |x: usize| {
            let [r, g, b] = with.pixel(x, 90);
            i32::from(r) - i32::from(g).max(i32::from(b))
        };
        let reddest = (0..400).max_by_key(|&x| red(x)).unwrap_or(0);
        let sheet = Sheet::new(PictureSize { width_px: 400, height_px: 300 })?;
        let area = sheet.inside(104.0, 104.0, 128.0, 88.0);
        let expected = area.left + 0.5 * area.width();
        assert!((reddest as f64 + 0.5 - expected).abs() <= 1.0 && red(reddest) > 30, "{reddest}, {expected}");
        assert_eq!((0..400).filter(|&x| red(x) > 30).count(), 1);
        Ok(())
    }
}
