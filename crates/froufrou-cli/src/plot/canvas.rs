//! A picture in memory: smooth shapes, text, and the PNG file of it.

use std::io::BufWriter;
use std::path::Path;

use ab_glyph::{Font, FontRef, ScaleFont, point};
use froufrou::{Error, Result, WholeFile};

use super::colour::Colour;

/// Where along a text the point lies that it is placed by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// At its start.
    Start,
    /// In its middle.
    Middle,
    /// At its end.
    End,
}

/// How a text looks.
#[derive(Debug, Clone, Copy)]
pub struct Lettering {
    /// Size of the em square in pixels.
    pub size_px: f64,
    /// Its colour.
    pub colour: Colour,
    /// The point that it is placed by.
    pub anchor: Anchor,
    /// True for a text that runs upwards.
    pub upwards: bool,
}

/// The height of a digit, in em.
const DIGIT_EM: f64 = 0.69;

impl Lettering {
    /// The baseline of a text whose digits have their middle at `y`.
    pub fn baseline_px(&self, y: f64) -> f64 {
        y + self.size_px * DIGIT_EM / 2.0
    }
}

/// A rectangle in pixels; its sides may lie between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rectangle {
    /// Left side.
    pub left: f64,
    /// Upper side.
    pub top: f64,
    /// Right side.
    pub right: f64,
    /// Lower side.
    pub bottom: f64,
}

impl Rectangle {
    /// Its width in pixels.
    pub fn width(&self) -> f64 {
        self.right - self.left
    }

    /// Its height in pixels.
    pub fn height(&self) -> f64 {
        self.bottom - self.top
    }
}

/// A picture, white at first. What is drawn beyond its edges is cut off.
pub struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<Colour>,
    font: FontRef<'static>,
}

impl Canvas {
    /// A white picture.
    ///
    /// # Errors
    /// Where the font cannot be read, which is part of the program.
    pub fn new(width: usize, height: usize) -> Result<Self> {
        let font = FontRef::try_from_slice(epaint_default_fonts::UBUNTU_LIGHT)
            .map_err(|fault| Error::new(format!("cannot read the font: {fault}")).because(fault))?;
        Ok(Self { width, height, pixels: vec![[255; 3]; width * height], font })
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Covers part of a pixel, from 0, not at all, to 1, wholly.
    pub fn blend(&mut self, x: i64, y: i64, colour: Colour, cover: f64) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if x >= self.width || y >= self.height || cover <= 0.0 {
            return;
        }
        let cover = cover.min(1.0);
        let pixel = &mut self.pixels[y * self.width + x];
        for (below, above) in pixel.iter_mut().zip(colour) {
            let mixed = f64::from(*below) * (1.0 - cover) + f64::from(above) * cover;
            *below = mixed.round() as u8;
        }
    }

    /// Fills a rectangle; pixels that it covers in part are covered in part.
    pub fn fill(&mut self, area: Rectangle, colour: Colour, opacity: f64) {
        let overlap = |low: f64, high: f64, pixel: i64| {
            (high.min(pixel as f64 + 1.0) - low.max(pixel as f64)).clamp(0.0, 1.0)
        };
        let within = |low: f64, high: f64, end: usize| {
            let (low, high) = (low.clamp(0.0, end as f64), high.clamp(0.0, end as f64));
            (low.floor() as i64)..(high.ceil() as i64)
        };
        for y in within(area.top, area.bottom, self.height) {
            let row = overlap(area.top, area.bottom, y) * opacity;
            for x in within(area.left, area.right, self.width) {
                self.blend(x, y, colour, row * overlap(area.left, area.right, x));
            }
        }
    }

    /// Draws the frame of a rectangle, inside of it.
    pub fn frame(&mut self, area: Rectangle, width_px: f64, colour: Colour) {
        let Rectangle { left, top, right, bottom } = area;
        self.fill(Rectangle { bottom: top + width_px, ..area }, colour, 1.0);
        self.fill(Rectangle { top: bottom - width_px, ..area }, colour, 1.0);
        let sides = Rectangle { top: top + width_px, bottom: bottom - width_px, left, right };
        self.fill(Rectangle { right: left + width_px, ..sides }, colour, 1.0);
        self.fill(Rectangle { left: right - width_px, ..sides }, colour, 1.0);
    }

    /// Draws a smooth line with round ends.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], width_px: f64, colour: Colour, opacity: f64) {
        if !from.iter().chain(&to).all(|c| c.is_finite()) {
            return;
        }
        let reach = width_px / 2.0 + 1.0;
        let (step, length_2) = {
            let step = [to[0] - from[0], to[1] - from[1]];
            (step, step[0] * step[0] + step[1] * step[1])
        };
        // Walks along the longer of its two extents, so that the work goes with the length.
        let along = usize::from(step[1].abs() > step[0].abs());
        let across = 1 - along;
        let ends = [self.width as f64, self.height as f64];
        let low = (from[along].min(to[along]) - reach).clamp(0.0, ends[along]) as i64;
        let high = (from[along].max(to[along]) + reach).clamp(0.0, ends[along]) as i64;
        for a in low..=high {
            let u = if step[along] == 0.0 { 0.0 } else { (a as f64 + 0.5 - from[along]) / step[along] };
            let middle = from[across] + u.clamp(0.0, 1.0) * step[across];
            // A slanting line is up to √2 as wide along a row or column.
            let around = reach * std::f64::consts::SQRT_2;
            let first = (middle - around).clamp(0.0, ends[across]) as i64;
            let last = (middle + around).clamp(0.0, ends[across]) as i64;
            for b in first..=last {
                let mut point = [0.0; 2];
                point[along] = a as f64 + 0.5;
                point[across] = b as f64 + 0.5;
                let offset = [point[0] - from[0], point[1] - from[1]];
                let u = if length_2 > 0.0 {
                    ((offset[0] * step[0] + offset[1] * step[1]) / length_2).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let distance = (offset[0] - u * step[0]).hypot(offset[1] - u * step[1]);
                let (x, y) = if along == 0 { (a, b) } else { (b, a) };
                self.blend(x, y, colour, opacity * (width_px / 2.0 + 0.5 - distance).clamp(0.0, 1.0));
            }
        }
    }

    /// Draws a disc.
    pub fn disc(&mut self, centre: [f64; 2], radius_px: f64, colour: Colour, opacity: f64) {
        self.line(centre, centre, 2.0 * radius_px, colour, opacity);
    }

    /// Draws a text by its baseline; control characters become spaces.
    pub fn text(&mut self, text: &str, x: f64, baseline: f64, lettering: &Lettering) {
        if !(x.abs() < 1e6 && baseline.abs() < 1e6) {
            return;
        }
        let font = self.font.clone();
        let scaled = font.as_scaled(self.scale(lettering.size_px));
        let length = self.text_width_px(text, lettering.size_px);
        let mut pen = match lettering.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -length / 2.0,
            Anchor::End => -length,
        } as f32;
        let mut before = None;
        for character in text.chars() {
            let id = scaled.glyph_id(if character.is_control() { ' ' } else { character });
            pen += before.map_or(0.0, |before| scaled.kern(before, id));
            before = Some(id);
            let (along, fine_x, fine_y) = if lettering.upwards {
                // Turned after it is drawn: its start lies between pixels of the other axis.
                (baseline, pen + (-baseline).rem_euclid(1.0) as f32, x.rem_euclid(1.0) as f32)
            } else {
                (x, pen + x.rem_euclid(1.0) as f32, baseline.rem_euclid(1.0) as f32)
            };
            let glyph = id.with_scale_and_position(scaled.scale(), point(fine_x, fine_y));
            if let Some(outline) = font.outline_glyph(glyph) {
                let corner = outline.px_bounds().min;
                let (corner_x, corner_y) = (corner.x.floor() as i64, corner.y.floor() as i64);
                outline.draw(|glyph_x, glyph_y, cover| {
                    let (right, down) = (corner_x + i64::from(glyph_x), corner_y + i64::from(glyph_y));
                    let (px, py) = if lettering.upwards {
                        (x.floor() as i64 + down, along.ceil() as i64 - 1 - right)
                    } else {
                        (along.floor() as i64 + right, baseline.floor() as i64 + down)
                    };
                    self.blend(px, py, lettering.colour, f64::from(cover));
                });
            }
            pen += scaled.h_advance(id);
        }
    }

    /// The width of a text in pixels.
    pub fn text_width_px(&self, text: &str, size_px: f64) -> f64 {
        let scaled = self.font.as_scaled(self.scale(size_px));
        let mut before = None;
        let mut width = 0.0;
        for character in text.chars() {
            let id = scaled.glyph_id(if character.is_control() { ' ' } else { character });
            width += before.map_or(0.0, |before| scaled.kern(before, id)) + scaled.h_advance(id);
            before = Some(id);
        }
        f64::from(width)
    }

    /// The text, or as much of its beginning as fits with an ellipsis.
    pub fn fitted(&self, text: &str, size_px: f64, width_px: f64) -> String {
        // No font has letters so narrow that more of them fit.
        let most = (width_px.max(0.0) / size_px.max(1.0) * 8.0) as usize + 1;
        let mut short: String = text.chars().take(most).collect();
        if short.len() == text.len() && self.text_width_px(text, size_px) <= width_px {
            return short;
        }
        while short.pop().is_some() {
            let ended = format!("{}…", short.trim_end());
            if self.text_width_px(&ended, size_px) <= width_px {
                return ended;
            }
        }
        short
    }

    fn scale(&self, size_px: f64) -> f32 {
        let height_em = self.font.height_unscaled() / self.font.units_per_em().unwrap_or(1000.0);
        size_px as f32 * height_em
    }

    /// Writes a PNG file. It appears under its name when it is whole.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let file = WholeFile::create(path)?;
        let failed =
            |fault| Error::new(format!("cannot write the picture: {fault}")).in_file(path).because(fault);
        let (width, height) = (self.width as u32, self.height as u32);
        let mut encoder = png::Encoder::new(BufWriter::new(file.handle()?), width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().map_err(failed)?;
        writer.write_image_data(self.pixels.as_flattened()).map_err(failed)?;
        writer.finish().map_err(failed)?;
        file.finish()
    }
}

#[cfg(test)]
impl Canvas {
    /// The colour of a pixel.
    pub fn pixel(&self, x: usize, y: usize) -> Colour {
        self.pixels[y * self.width + x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_pixel_is_half_covered() -> Result<()> {
        let mut canvas = Canvas::new(4, 4)?;
        canvas.fill(Rectangle { left: 1.5, top: 1.0, right: 3.0, bottom: 2.0 }, [0; 3], 1.0);
        assert_eq!([0, 1, 2, 3].map(|x| canvas.pixel(x, 1)[0]), [255, 128, 0, 255]);
        assert_eq!(canvas.pixel(2, 2), [255; 3]);
        Ok(())
    }

    #[test]
    fn a_line_covers_as_much_as_it_is_long_and_wide() -> Result<()> {
        for to in [[80.0, 50.0], [50.0, 80.0], [20.0, 33.0], [35.0, 81.5], [50.0, 20.0]] {
            let mut canvas = Canvas::new(100, 100)?;
            canvas.line([50.0, 50.0], to, 3.0, [0; 3], 1.0);
            let ink: f64 = canvas.pixels.iter().map(|p| 1.0 - f64::from(p[0]) / 255.0).sum();
            let length = (to[0] - 50.0).hypot(to[1] - 50.0);
            let area = length * 3.0 + std::f64::consts::PI * 1.5 * 1.5;
            assert!((ink / area - 1.0).abs() < 0.05, "{to:?}: {ink} of {area}");
        }
        Ok(())
    }

    #[test]
    fn what_lies_outside_is_cut_off() -> Result<()> {
        let mut canvas = Canvas::new(10, 10)?;
        canvas.line([-1e9, -1e9], [1e9, 1e9], 2.0, [0; 3], 1.0);
        canvas.line([f64::NAN, 0.0], [1.0, 1.0], 2.0, [0; 3], 1.0);
        canvas.disc([500.0, -3.0], 4.0, [0; 3], 1.0);
        let letters = Lettering { size_px: 30.0, colour: [0; 3], anchor: Anchor::Middle, upwards: true };
        canvas.text("far out", 0.0, 200.0, &letters);
        canvas.text("nowhere", f64::NAN, f64::INFINITY, &letters);
        assert_eq!(canvas.pixel(5, 5), [0; 3]);
        assert_eq!(canvas.pixel(0, 9), [255; 3]);
        Ok(())
    }

    #[test]
    fn long_texts_end_in_an_ellipsis_that_fits() -> Result<()> {
        let canvas = Canvas::new(1, 1)?;
        assert_eq!(canvas.fitted("brick", 20.0, 500.0), "brick");
        let short = canvas.fitted(&"a very long name ".repeat(100), 20.0, 100.0);
        assert!(short.ends_with('…') && canvas.text_width_px(&short, 20.0) <= 100.0, "{short}");
        assert_eq!(canvas.fitted("brick", 20.0, 1.0), "");
        Ok(())
    }

    #[test]
    fn text_that_runs_upwards_is_the_same_text_turned() -> Result<()> {
        let letters = Lettering { size_px: 20.0, colour: [0; 3], anchor: Anchor::Start, upwards: false };
        let (mut flat, mut turned) = (Canvas::new(100, 100)?, Canvas::new(100, 100)?);
        flat.text("Froufrou 19 kHz", 4.0, 40.0, &letters);
        turned.text("Froufrou 19 kHz", 40.0, 96.0, &Lettering { upwards: true, ..letters });
        for y in 0..100 {
            for x in 0..100 {
                assert_eq!(flat.pixel(x, y), turned.pixel(y, 99 - x), "{x} {y}");
            }
        }
        assert!(flat.pixels.iter().any(|p| p[0] < 90));
        Ok(())
    }
}
