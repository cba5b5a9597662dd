//! What all pictures have in common: their size, their title, and axes around a panel.

use froufrou::Result;

use super::axis::{Scale, Tick};
use super::canvas::{Anchor, Canvas, Lettering, Rectangle};
use super::colour::{Colour, GREY, GRID, INK, RULE};

/// How big a picture is, in pixels; the options of commands that draw one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::Args)]
pub struct PictureSize {
    /// Width of the picture in pixels
    #[arg(long = "width", value_name = "PX", default_value_t = PictureSize::default().width_px,
        value_parser = clap::value_parser!(u32).range(240..=16384))]
    pub width_px: u32,

    /// Height of the picture in pixels
    #[arg(long = "height", value_name = "PX", default_value_t = PictureSize::default().height_px,
        value_parser = clap::value_parser!(u32).range(240..=16384))]
    pub height_px: u32,
}

impl Default for PictureSize {
    fn default() -> Self {
        Self { width_px: 1600, height_px: 1000 }
    }
}

/// A picture with a title, and how big everything on it is.
pub struct Sheet {
    /// The picture.
    pub canvas: Canvas,
    /// How much larger than on a picture of the usual size everything is.
    pub unit_px: f64,
}

impl Sheet {
    /// An empty picture.
    ///
    /// # Errors
    /// As [`Canvas::new`].
    pub fn new(size: PictureSize) -> Result<Self> {
        let (width, height) = (size.width_px as usize, size.height_px as usize);
        let usual = PictureSize::default();
        let ratio = (f64::from(size.width_px) / f64::from(usual.width_px))
            .min(f64::from(size.height_px) / f64::from(usual.height_px));
        Ok(Self { canvas: Canvas::new(width, height)?, unit_px: ratio.clamp(0.55, 8.0) })
    }

    /// The usual size of letters in pixels.
    pub fn letters_px(&self) -> f64 {
        20.0 * self.unit_px
    }

    /// What is left of the picture for panels: margins in the units of a picture of the usual size.
    pub fn inside(&self, left: f64, top: f64, right: f64, bottom: f64) -> Rectangle {
        let unit = self.unit_px;
        // Whole pixels keep frames sharp.
        Rectangle {
            left: (left * unit).round(),
            top: (top * unit).round(),
            right: (self.canvas.width() as f64 - right * unit).round(),
            bottom: (self.canvas.height() as f64 - bottom * unit).round(),
        }
    }

    /// Writes a text.
    pub fn text(&mut self, text: &str, x: f64, baseline: f64, anchor: Anchor, colour: Colour) {
        let lettering = Lettering { size_px: self.letters_px(), colour, anchor, upwards: false };
        self.canvas.text(text, x, baseline, &lettering);
    }

    /// Writes the title to the left and what there is to know about it to the right.
    pub fn title(&mut self, title: &str, facts: &str, left: f64, right: f64) {
        let (size_px, baseline) = (26.0 * self.unit_px, 46.0 * self.unit_px);
        let facts_px = self.canvas.text_width_px(facts, self.letters_px());
        let title = self.canvas.fitted(title, size_px, right - left - facts_px - 30.0 * self.unit_px);
        let lettering = Lettering { size_px, colour: INK, anchor: Anchor::Start, upwards: false };
        self.canvas.text(&title, left, baseline, &lettering);
        self.text(facts, right, baseline, Anchor::End, GREY);
    }

    /// Draws the frame of a panel.
    pub fn frame(&mut self, area: Rectangle) {
        let width = self.unit_px.round().max(1.0);
        let around = Rectangle {
            left: area.left - width,
            top: area.top - width,
            right: area.right + width,
            bottom: area.bottom + width,
        };
        self.canvas.frame(around, width, RULE);
    }

    /// Draws grid lines in a panel, at values of its lower axis.
    pub fn upright_grid(&mut self, area: Rectangle, scale: Scale, ticks: &[Tick]) {
        let half = self.unit_px.max(1.0) / 2.0;
        for tick in ticks {
            let x = (area.left + scale.place(tick.value) * area.width()).round();
            self.canvas.fill(Rectangle { left: x - half, right: x + half, ..area }, GRID, 1.0);
        }
    }

    /// Draws grid lines in a panel, at values of its left axis.
    pub fn level_grid(&mut self, area: Rectangle, scale: Scale, ticks: &[Tick]) {
        let half = self.unit_px.max(1.0) / 2.0;
        for tick in ticks {
            let y = (area.bottom - scale.place(tick.value) * area.height()).round();
            self.canvas.fill(Rectangle { top: y - half, bottom: y + half, ..area }, GRID, 1.0);
        }
    }

    /// Labels the lower axis of a panel.
    pub fn lower_axis(&mut self, area: Rectangle, scale: Scale, ticks: &[Tick], name: &str) {
        let unit = self.unit_px;
        let baseline = area.bottom + 30.0 * unit;
        for tick in ticks {
            let x = (area.left + scale.place(tick.value) * area.width()).round();
            let half = unit.max(1.0) / 2.0;
            let stroke = Rectangle {
                left: x - half,
                right: x + half,
                top: area.bottom + unit,
                bottom: area.bottom + 7.0 * unit,
            };
            self.canvas.fill(stroke, RULE, 1.0);
            self.text(&tick.label, x, baseline, Anchor::Middle, INK);
        }
        let middle = (area.left + area.right) / 2.0;
        self.text(name, middle, baseline + 30.0 * unit, Anchor::Middle, GREY);
    }

    /// Labels an axis at a side of a panel, the left one or the right one.
    pub fn side_axis(&mut self, area: Rectangle, scale: Scale, ticks: &[Tick], right: bool) {
        let unit = self.unit_px;
        for tick in ticks {
            let y = (area.bottom - scale.place(tick.value) * area.height()).round();
            let half = unit.max(1.0) / 2.0;
            let (left, far) = match right {
                true => (area.right + unit, area.right + 7.0 * unit),
                false => (area.left - 7.0 * unit, area.left - unit),
            };
            self.canvas.fill(Rectangle { left, right: far, top: y - half, bottom: y + half }, RULE, 1.0);
            let (x, anchor) = match right {
                true => (far + 5.0 * unit, Anchor::Start),
                false => (left - 5.0 * unit, Anchor::End),
            };
            let lettering = Lettering { size_px: self.letters_px(), colour: INK, anchor, upwards: false };
            self.canvas.text(&tick.label, x, lettering.baseline_px(y), &lettering);
        }
    }

    /// Writes the name of a side axis along it; `x` is the middle of its letters.
    pub fn side_name(&mut self, area: Rectangle, name: &str, x: f64) {
        let lettering =
            Lettering { size_px: self.letters_px(), colour: GREY, anchor: Anchor::Middle, upwards: true };
        let baseline = lettering.baseline_px(x);
        self.canvas.text(name, baseline, (area.top + area.bottom) / 2.0, &lettering);
    }

    /// How many labels of a lower axis have room.
    pub fn most_across(&self, area: Rectangle) -> usize {
        (area.width() / (110.0 * self.unit_px)).max(1.0) as usize
    }

    /// How many labels of a side axis have room.
    pub fn most_down(&self, area: Rectangle) -> usize {
        (area.height() / (36.0 * self.unit_px)).max(1.0) as usize
    }
}
