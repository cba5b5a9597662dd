//! The picture of events: the impulse of every impact over time, a colour for each pair of bodies.

use std::collections::HashMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use froufrou::motion::event::{Event, Reader};
use froufrou::{Error, Result};

use super::Span;
use super::axis::{Scale, log_ticks, time_ticks};
use super::canvas::{Anchor, Canvas, Rectangle};
use super::colour::{Colour, DISTINCT, GREY, INK};
use super::panel::{PictureSize, Sheet};

/// More events than this have no stems.
const MOST_STEMS: u64 = 300;

/// What is known of the events before they are drawn.
struct Survey {
    /// First and last time of all events, in seconds.
    times_s: Option<(f64, f64)>,
    /// Least and greatest impulse above 0 of those that are shown, in newton seconds.
    impulses_ns: Option<(f64, f64)>,
    /// How many are shown.
    shown: u64,
    /// How many of these have no impulse above 0.
    without_impulse: u64,
    /// How many are shown of each pair of bodies.
    pairs: HashMap<(String, String), u64>,
}

/// Draws the events of a file. It is read twice, in the memory of its pairs of bodies.
pub fn draw(file: &Path, title: &str, asked: Span, size: PictureSize) -> Result<Canvas> {
    let survey = survey(file, asked)?;
    let span_s = match survey.times_s {
        None => (asked.from_s.unwrap_or(0.0), asked.to_s.unwrap_or(asked.from_s.unwrap_or(0.0) + 1.0)),
        Some((first_s, last_s)) => {
            asked.within(first_s, last_s).map_err(|fault| fault.in_file(file))?;
            let from_s = asked.from_s.unwrap_or(first_s.min(0.0));
            let room_s = if last_s > from_s { 0.02 * (last_s - from_s) } else { 1.0 };
            (from_s, asked.to_s.unwrap_or(last_s + room_s))
        }
    };
    let mut by_count: Vec<(&(String, String), u64)> =
        survey.pairs.iter().map(|(pair, n)| (pair, *n)).collect();
    by_count.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(b.0)));
    let colours: HashMap<&(String, String), Colour> =
        by_count.iter().zip(DISTINCT).map(|((pair, _), colour)| (*pair, colour)).collect();

    let mut sheet = Sheet::new(size)?;
    let area = sheet.inside(124.0, 72.0, 300.0, 88.0);
    let facts = match survey.shown {
        1 => "1 impact".to_owned(),
        count => format!("{count} impacts"),
    };
    let right = sheet.canvas.width() as f64 - 40.0 * sheet.unit_px;
    sheet.title(title, &facts, area.left, right);

    let time = Scale::Linear { from: span_s.0, to: span_s.1 };
    let (least, greatest) = survey.impulses_ns.unwrap_or((0.1, 1.0));
    // A third of a decade below and a fifth above keep dots off the frame.
    let impulse = Scale::Logarithmic {
        from: (least / 2.0).max(f64::MIN_POSITIVE),
        to: (greatest * 1.6).min(f64::MAX / 2.0),
    };
    let (times, unit) = time_ticks(span_s.0, span_s.1, sheet.most_across(area));
    let levels = log_ticks(impulse.value(0.0), impulse.value(1.0), sheet.most_down(area));
    sheet.upright_grid(area, time, &times);
    sheet.level_grid(area, impulse, &levels);

    let stems = survey.shown <= MOST_STEMS;
    // Crowded dots are smaller, down to a pixel or two.
    let crowd = (survey.shown as f64 / 200.0).max(1.0).powf(0.25);
    let radius = (7.0 * sheet.unit_px / crowd).max(1.2);
    read(file, |impact| {
        if !asked.holds(impact.time_s) {
            return;
        }
        let colour = colours.get(&impact.pair).copied().unwrap_or(GREY);
        let x = area.left + time.place(impact.time_s) * area.width();
        let height =
            if impact.impulse_ns > 0.0 { impulse.place(impact.impulse_ns).clamp(0.0, 1.0) } else { 0.0 };
        let y = area.bottom - height * area.height();
        if impact.rubs {
            sheet.canvas.disc([x, y], (2.0 * sheet.unit_px).max(1.2), colour, 0.5);
            return;
        }
        if stems {
            sheet.canvas.line([x, y], [x, area.bottom], 1.5 * sheet.unit_px, colour, 0.35);
        }
        sheet.canvas.disc([x, y], radius, colour, 0.8);
    })?;
    sheet.frame(area);
    sheet.lower_axis(area, time, &times, &format!("time ({unit})"));
    sheet.side_axis(area, impulse, &levels, false);
    sheet.side_name(area, "impulse (N s)", area.left - 100.0 * sheet.unit_px);
    legend(&mut sheet, area, &by_count);
    let middle = [(area.left + area.right) / 2.0, (area.top + area.bottom) / 2.0];
    if survey.shown == 0 {
        sheet.text("no events", middle[0], middle[1], Anchor::Middle, GREY);
    }
    if survey.without_impulse > 0 {
        let note = format!("{} without an impulse above 0, at the lower edge", survey.without_impulse);
        let baseline = area.top + 26.0 * sheet.unit_px;
        sheet.text(&note, area.right - 12.0 * sheet.unit_px, baseline, Anchor::End, GREY);
    }
    Ok(sheet.canvas)
}

/// An event as it is drawn.
struct Mark {
    time_s: f64,
    pair: (String, String),
    impulse_ns: f64,
    /// It is a moment of sliding or rolling, of which there are many.
    rubs: bool,
}

fn read(file: &Path, mut each: impl FnMut(Mark)) -> Result<()> {
    let open = File::open(file).map_err(|fault| Error::io("open", file, fault))?;
    for event in Reader::new(BufReader::new(open), file) {
        each(match event? {
            Event::Quiet(_) | Event::Change(_) => continue,
            Event::Impact(impact) => Mark {
                time_s: impact.time_s,
                pair: (impact.a, impact.b),
                impulse_ns: impact.impulse_ns,
                rubs: false,
            },
            // A moment of sliding or rolling has the impulse of its force.
            Event::Slide(rub) | Event::Roll(rub) => Mark {
                time_s: rub.time_s,
                pair: (rub.a, rub.b),
                impulse_ns: rub.force_n * rub.lasts_s,
                rubs: true,
            },
            Event::Flap(flap) => Mark {
                time_s: flap.time_s,
                pair: (flap.cloth.clone(), flap.cloth),
                impulse_ns: flap.impulse_ns.unwrap_or_default(),
                rubs: flap.impulse_ns.is_none(),
            },
            // What else sheets do has no impulse.
            Event::Tear(tear) => Mark {
                time_s: tear.time_s,
                pair: (tear.sheet.clone(), tear.sheet),
                impulse_ns: 0.0,
                rubs: false,
            },
            Event::Buckle(buckle) => Mark {
                time_s: buckle.time_s,
                pair: (buckle.cloth.clone(), buckle.cloth),
                impulse_ns: 0.0,
                rubs: false,
            },
            Event::Friction(friction) => Mark {
                time_s: friction.time_s,
                pair: (friction.cloth, friction.other),
                impulse_ns: 0.0,
                rubs: true,
            },
        });
    }
    Ok(())
}

fn survey(file: &Path, asked: Span) -> Result<Survey> {
    let mut survey =
        Survey { times_s: None, impulses_ns: None, shown: 0, without_impulse: 0, pairs: HashMap::new() };
    let widen = |range: &mut Option<(f64, f64)>, value: f64| {
        let (low, high) = range.unwrap_or((value, value));
        *range = Some((low.min(value), high.max(value)));
    };
    read(file, |impact| {
        widen(&mut survey.times_s, impact.time_s);
        if !asked.holds(impact.time_s) {
            return;
        }
        survey.shown += 1;
        *survey.pairs.entry(impact.pair).or_default() += 1;
        if impact.impulse_ns > 0.0 {
            widen(&mut survey.impulses_ns, impact.impulse_ns);
        } else {
            survey.without_impulse += 1;
        }
    })?;
    Ok(survey)
}

fn legend(sheet: &mut Sheet, area: Rectangle, by_count: &[(&(String, String), u64)]) {
    let unit = sheet.unit_px;
    let (x, right) = (area.right + 28.0 * unit, sheet.canvas.width() as f64 - 24.0 * unit);
    let mut y = area.top + 16.0 * unit;
    let mut entry = |name: &str, count: u64, colour: Colour| {
        let letters = sheet.letters_px();
        let count = count.to_string();
        let count_px = sheet.canvas.text_width_px(&count, letters);
        let name = sheet.canvas.fitted(name, letters, right - x - 36.0 * unit - count_px);
        sheet.canvas.disc([x, y], 7.0 * unit, colour, 0.9);
        let baseline = y + 0.345 * letters;
        sheet.text(&name, x + 18.0 * unit, baseline, Anchor::Start, INK);
        sheet.text(&count, right, baseline, Anchor::End, GREY);
        y += 32.0 * unit;
    };
    for (((a, b), count), colour) in by_count.iter().zip(DISTINCT) {
        entry(&format!("{a} – {b}"), *count, colour);
    }
    let others = by_count.get(DISTINCT.len()..).unwrap_or_default();
    if !others.is_empty() {
        let name = format!("{} other pair{}", others.len(), if others.len() == 1 { "" } else { "s" });
        entry(&name, others.iter().map(|(_, count)| count).sum(), GREY);
    }
}
