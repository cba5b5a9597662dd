//! The picture of a score: the threads of every object as bars over time and, in object space, their
//! paths from above.

use std::path::Path;

use froufrou::Result;

use super::Span;
use super::axis::{Scale, linear_ticks, time_ticks};
use super::canvas::{Anchor, Canvas, Lettering, Rectangle};
use super::colour::{Colour, DISTINCT, GREY, INK};
use super::panel::{PictureSize, Sheet};
use super::threads::{MicrophoneStep, Piece, Place, Seen, walk};

/// The gain in dB below the loudest at which a bar is as pale as it gets.
const PALEST_DB: f64 = 48.0;

/// What is known of a score before it is drawn.
#[derive(Default)]
struct Survey {
    /// The most threads at a time and the name of every object, in the order of their first thread.
    bands: Vec<Band>,
    end_s: f64,
    loudest: f64,
    /// Least and greatest x and z of what is shown.
    ground: Option<[(f64, f64); 2]>,
}

struct Band {
    name: String,
    lanes: usize,
}

/// Draws a score. It is read twice, in the memory of its header, its objects and the threads that
/// sound at a time; a score that is not in order of time is sorted in memory first.
pub fn draw(file: &Path, title: &str, asked: Span, size: PictureSize) -> Result<Canvas> {
    let mut survey = Survey::default();
    let facts = walk(file, &mut |seen| survey.see(seen, asked))?;
    let end_s = facts.duration_s.unwrap_or(survey.end_s).max(survey.end_s);
    let end_s = if end_s > 0.0 { end_s } else { 1.0 };
    let span_s = asked.within(0.0, end_s).map_err(|fault| fault.in_file(file))?;

    let mut sheet = Sheet::new(size)?;
    let whole = sheet.inside(250.0, 72.0, 48.0, 88.0);
    let margin = 48.0 * sheet.unit_px;
    let plural = |count: u64, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    let told = [
        format!("{} space", if facts.object_space { "object" } else { "channel" }),
        super::length(end_s),
        plural(facts.threads, "thread"),
        plural(facts.receivers.len() as u64, if facts.object_space { "microphone" } else { "channel" }),
    ];
    sheet.title(title, &told.join(" · "), margin, whole.right);

    let split = (whole.left + 0.60 * whole.width()).round();
    let bars = if facts.object_space { Rectangle { right: split, ..whole } } else { whole };
    let time = Scale::Linear { from: span_s.0, to: span_s.1 };
    let (ticks, unit) = time_ticks(span_s.0, span_s.1, sheet.most_across(bars));
    sheet.upright_grid(bars, time, &ticks);
    let rows = Rows::new(&survey.bands, bars, sheet.unit_px);
    label_bands(&mut sheet, bars, &survey.bands, &rows, margin);
    let view = facts.object_space.then(|| {
        let area = Rectangle { left: split + (120.0 * sheet.unit_px).round(), ..whole };
        TopView::new(area, survey.ground)
    });
    if let Some(view) = &view {
        view.grid(&mut sheet);
    }

    let mut marked = vec![false; survey.bands.len()];
    let mut microphones: Vec<([f64; 2], String)> = Vec::new();
    let mut heard: Vec<bool> = vec![false; facts.receivers.len()];
    walk(file, &mut |seen| match seen {
        Seen::Piece(piece) => {
            let colour = colour_of(piece.object);
            rows.bar(&mut sheet.canvas, bars, time, &piece, survey.loudest, colour);
            let Some(view) = &view else { return };
            let Some([from, to]) = piece.within(span_s).and_then(|piece| piece.ends()) else { return };
            view.path(&mut sheet, from, to, colour, 2.0);
            // Only the first thread of an object gets a dot: a hundred blows would hide the paths.
            if let Some(marked) = marked.get_mut(piece.object)
                && !*marked
            {
                *marked = true;
                let place = view.place(from);
                sheet.canvas.disc(place, 6.0 * sheet.unit_px, colour, 1.0);
            }
        }
        Seen::Microphone(step) => {
            let Some(view) = &view else { return };
            if let Some(from) = step.from.filter(|_| step.time_s >= span_s.0 && step.from_s <= span_s.1) {
                view.path(&mut sheet, from.position_m, step.to.position_m, GREY, 1.5);
            }
            if let Some(heard) = heard.get_mut(step.index)
                && !*heard
            {
                *heard = true;
                view.microphone(&mut sheet, &step);
                microphones.push((view.place(step.to.position_m), facts.receivers[step.index].clone()));
            }
        }
        Seen::Thread { .. } => {}
    })?;
    sheet.frame(bars);
    sheet.lower_axis(bars, time, &ticks, &format!("time ({unit})"));
    if let Some(view) = &view {
        view.finish(&mut sheet, microphones);
    }
    let middle = (bars.left + bars.right) / 2.0;
    if survey.bands.is_empty() {
        sheet.text("no threads", middle, (bars.top + bars.bottom) / 2.0, Anchor::Middle, GREY);
    }
    if facts.unended > 0 {
        let note =
            format!("{}: recording not found, drawn to the last line", plural(facts.unended, "thread"));
        let width = bars.width() / 2.0 - 80.0 * sheet.unit_px + bars.left - margin;
        let note = sheet.canvas.fitted(&note, sheet.letters_px(), width);
        sheet.text(&note, margin, bars.bottom + 60.0 * sheet.unit_px, Anchor::Start, GREY);
    }
    Ok(sheet.canvas)
}

fn colour_of(object: usize) -> Colour {
    DISTINCT[object % DISTINCT.len()]
}

impl Survey {
    fn see(&mut self, seen: Seen<'_>, asked: Span) {
        let shown = (asked.from_s.unwrap_or(f64::NEG_INFINITY), asked.to_s.unwrap_or(f64::INFINITY));
        match seen {
            Seen::Thread { object, name, lane } => {
                if object == self.bands.len() {
                    self.bands.push(Band { name: name.to_owned(), lanes: 0 });
                }
                if let Some(band) = self.bands.get_mut(object) {
                    band.lanes = band.lanes.max(lane + 1);
                }
            }
            Seen::Piece(piece) => {
                self.end_s = self.end_s.max(piece.to.time_s);
                self.loudest = self.loudest.max(piece.from.gain).max(piece.to.gain);
                if let Some(ends) = piece.within(shown).and_then(|piece| piece.ends()) {
                    ends.into_iter().for_each(|position| self.widen(position));
                }
            }
            Seen::Microphone(step) => self.widen(step.to.position_m),
        }
    }

    fn widen(&mut self, [x, _, z]: [f64; 3]) {
        let [xs, zs] = self.ground.get_or_insert([(x, x), (z, z)]);
        *xs = (xs.0.min(x), xs.1.max(x));
        *zs = (zs.0.min(z), zs.1.max(z));
    }
}

/// Where the bars of every object stand.
struct Rows {
    /// The upper edge of the first lane of every object.
    tops: Vec<f64>,
    lane_px: f64,
}

impl Rows {
    fn new(bands: &[Band], area: Rectangle, unit_px: f64) -> Self {
        let lanes: usize = bands.iter().map(|band| band.lanes).sum();
        // Half a lane is left between objects.
        let count = lanes as f64 + 0.5 * (bands.len() + 1) as f64;
        let lane_px = (area.height() / count.max(1.0)).min(44.0 * unit_px);
        let mut top = area.top + 0.5 * lane_px;
        let tops = bands.iter().map(|band| {
            let here = top;
            top += (band.lanes as f64 + 0.5) * lane_px;
            here
        });
        Self { tops: tops.collect(), lane_px }
    }

    /// Draws a piece of a thread: the louder, the darker.
    fn bar(
        &self,
        canvas: &mut Canvas,
        area: Rectangle,
        time: Scale,
        piece: &Piece,
        loudest: f64,
        colour: Colour,
    ) {
        let Some(top) = self.tops.get(piece.object) else { return };
        let top = top + piece.lane as f64 * self.lane_px;
        let gap = if self.lane_px > 4.0 { 0.12 * self.lane_px } else { 0.0 };
        let x = |time_s: f64| area.left + time.place(time_s) * area.width();
        let (from, mut to) = (x(piece.from.time_s), x(piece.to.time_s));
        if piece.first {
            // However short, its beginning is seen.
            to = to.max(from + 2.5);
        }
        let (left, right) = (from.max(area.left), to.min(area.right));
        if right <= left {
            return;
        }
        for pixel in left.floor() as i64..right.ceil() as i64 {
            let (a, b) = ((pixel as f64).max(left), (pixel as f64 + 1.0).min(right));
            let u = if to > from { (((a + b) / 2.0 - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
            let gain = piece.from.gain * (1.0 - u) + piece.to.gain * u;
            let below_db =
                if gain > 0.0 && loudest > 0.0 { -20.0 * (gain / loudest).log10() } else { PALEST_DB };
            let opacity = 0.95 - 0.8 * (below_db / PALEST_DB).clamp(0.0, 1.0);
            let stroke = Rectangle { left: a, right: b, top: top + gap, bottom: top + self.lane_px - gap };
            canvas.fill(stroke, colour, opacity);
        }
        if piece.first && from >= area.left && self.lane_px > 4.0 {
            let width = (0.08 * self.lane_px).clamp(1.0, 3.0);
            let edge = Rectangle {
                left: from,
                right: (from + width).min(area.right),
                top: top + gap,
                bottom: top + self.lane_px - gap,
            };
            canvas.fill(edge, colour, 1.0);
        }
    }
}

fn label_bands(sheet: &mut Sheet, area: Rectangle, bands: &[Band], rows: &Rows, margin: f64) {
    let letters = sheet.letters_px();
    let gap = 14.0 * sheet.unit_px;
    let mut free_from = f64::NEG_INFINITY;
    for (object, (band, top)) in bands.iter().zip(&rows.tops).enumerate() {
        let middle = top + band.lanes as f64 * rows.lane_px / 2.0;
        if middle - letters / 2.0 < free_from {
            continue;
        }
        free_from = middle + letters / 2.0 + 0.1 * letters;
        let name = sheet.canvas.fitted(&band.name, letters, area.left - margin - 2.0 * gap);
        let lettering = Lettering { size_px: letters, colour: INK, anchor: Anchor::End, upwards: false };
        sheet.canvas.text(
            &name,
            area.left - gap - 12.0 * sheet.unit_px,
            lettering.baseline_px(middle),
            &lettering,
        );
        sheet.canvas.disc([area.left - gap, middle], 5.0 * sheet.unit_px, colour_of(object), 1.0);
    }
}

/// The world from above: x to the right, z towards the reader.
struct TopView {
    area: Rectangle,
    x: Scale,
    z: Scale,
}

impl TopView {
    /// A view in which metres are as long in both directions.
    fn new(area: Rectangle, ground: Option<[(f64, f64); 2]>) -> Self {
        let [xs, zs] = ground.unwrap_or([(-1.0, 1.0), (-1.0, 1.0)]);
        // A world that is wider than deep gets a panel like it, if not a mere slit.
        let depth = ((zs.1 - zs.0) / (xs.1 - xs.0).max(f64::MIN_POSITIVE)).max(0.7);
        let area = Rectangle { bottom: (area.top + depth * area.width()).round().min(area.bottom), ..area };
        let metres_per_px = ((xs.1 - xs.0) / area.width()).max((zs.1 - zs.0) / area.height());
        // At least two metres are shown, and an eighth more than is needed.
        let metres_per_px = (1.25 * metres_per_px).max(2.0 / area.width().min(area.height()));
        let around = |(low, high): (f64, f64), length_px: f64| {
            let (middle, reach) = (low / 2.0 + high / 2.0, metres_per_px * length_px / 2.0);
            (middle - reach, middle + reach)
        };
        let (x, z) = (around(xs, area.width()), around(zs, area.height()));
        // The frame of a panel counts upwards, z downwards.
        Self { area, x: Scale::Linear { from: x.0, to: x.1 }, z: Scale::Linear { from: z.1, to: z.0 } }
    }

    fn place(&self, [x, _, z]: [f64; 3]) -> [f64; 2] {
        let (across, up) = (self.x.place(x).clamp(0.0, 1.0), self.z.place(z).clamp(0.0, 1.0));
        [self.area.left + across * self.area.width(), self.area.bottom - up * self.area.height()]
    }

    fn ticks(&self, sheet: &Sheet) -> [Vec<super::axis::Tick>; 2] {
        let most = sheet.most_across(self.area).max(2);
        let x = linear_ticks(self.x.value(0.0), self.x.value(1.0), most);
        let step = match x.as_slice() {
            [a, b, ..] => b.value - a.value,
            _ => self.x.value(1.0) - self.x.value(0.0),
        };
        let count =
            ((self.z.value(0.0) - self.z.value(1.0)) / step).clamp(1.0, sheet.most_down(self.area) as f64);
        let z = linear_ticks(self.z.value(1.0), self.z.value(0.0), (count * 1.01).ceil() as usize);
        [x, z]
    }

    fn grid(&self, sheet: &mut Sheet) {
        let [x, z] = self.ticks(sheet);
        sheet.upright_grid(self.area, self.x, &x);
        sheet.level_grid(self.area, self.z, &z);
    }

    fn path(&self, sheet: &mut Sheet, from: [f64; 3], to: [f64; 3], colour: Colour, width: f64) {
        let (a, b) = (self.place(from), self.place(to));
        // What does not move by a pixel is no path.
        if (a[0] - b[0]).hypot(a[1] - b[1]) < 0.05 {
            sheet.canvas.disc(a, 2.5 * sheet.unit_px, colour, 0.8);
        } else {
            sheet.canvas.line(a, b, width * sheet.unit_px, colour, 1.0);
        }
    }

    /// A microphone: a disc and the direction in which it faces.
    fn microphone(&self, sheet: &mut Sheet, step: &MicrophoneStep) {
        let unit = sheet.unit_px;
        let place = self.place(step.to.position_m);
        let [x, y, z] = step.to.facing;
        let length = x.hypot(y).hypot(z);
        if length > 0.0 {
            let reach = 26.0 * unit / length;
            let tip = [place[0] + x * reach, place[1] + z * reach];
            sheet.canvas.line(place, tip, 2.5 * unit, INK, 1.0);
        }
        sheet.canvas.disc(place, 6.0 * unit, INK, 1.0);
    }

    fn finish(&self, sheet: &mut Sheet, microphones: Vec<([f64; 2], String)>) {
        let [x, z] = self.ticks(sheet);
        let unit = sheet.unit_px;
        sheet.frame(self.area);
        sheet.lower_axis(self.area, self.x, &x, "x (m), from above");
        sheet.side_axis(self.area, self.z, &z, false);
        sheet.side_name(self.area, "z (m)", self.area.left - 92.0 * unit);
        // Microphones at one place share a label.
        let mut labels: Vec<([f64; 2], String)> = Vec::new();
        for (place, name) in microphones {
            let near = |(other, _): &&mut ([f64; 2], String)| {
                (other[0] - place[0]).hypot(other[1] - place[1]) < 24.0 * unit
            };
            match labels.iter_mut().find(near) {
                Some((_, names)) if names.len() < 200 => *names = format!("{names}, {name}"),
                Some(_) => {}
                None => labels.push((place, name)),
            }
        }
        for (place, names) in labels {
            let letters = sheet.letters_px();
            let names = sheet.canvas.fitted(&names, letters, 0.6 * self.area.width());
            let width = sheet.canvas.text_width_px(&names, letters);
            let half = width / 2.0 + 6.0 * unit;
            let middle = place[0].max(self.area.left + half).min(self.area.right - half);
            let below = place[1] + 52.0 * unit;
            let baseline = if below < self.area.bottom { below } else { place[1] - 36.0 * unit };
            sheet.text(&names, middle, baseline, Anchor::Middle, INK);
        }
    }
}

impl Piece {
    /// What of it lies within a time.
    fn within(&self, (from_s, to_s): (f64, f64)) -> Option<Piece> {
        if self.to.time_s < from_s || self.from.time_s > to_s {
            return None;
        }
        let length_s = self.to.time_s - self.from.time_s;
        let at = |time_s: f64| {
            let u = if length_s > 0.0 { (time_s - self.from.time_s) / length_s } else { 0.0 };
            let mix = |a: f64, b: f64| a * (1.0 - u) + b * u;
            let position_m = self.from.position_m.zip(self.to.position_m);
            Place {
                time_s,
                gain: mix(self.from.gain, self.to.gain),
                position_m: position_m.map(|(a, b)| std::array::from_fn(|i| mix(a[i], b[i]))),
            }
        };
        let (from, to) = (at(self.from.time_s.max(from_s)), at(self.to.time_s.min(to_s)));
        Some(Piece { from, to, ..*self })
    }

    /// Where it begins and ends, in object space.
    fn ends(&self) -> Option<[[f64; 3]; 2]> {
        Some([self.from.position_m?, self.to.position_m?])
    }
}
