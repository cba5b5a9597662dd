//! Delay.

use super::{Around, Signal, settle};

/// Room behind the longest delay for the cubic that reads between samples.
const MARGIN: usize = 4;

/// Says again later what it is told, and again with feedback.
#[derive(Debug)]
pub(in crate::synth::procedure) struct Delay {
    longest: f64,
    line: Vec<f32>,
    next: usize,
}

impl Delay {
    pub(super) fn new(longest_samples: f64) -> Self {
        let longest = longest_samples.max(2.0);
        Self { longest, line: vec![0.0; longest.ceil() as usize + MARGIN], next: 0 }
    }

    pub(super) fn run(
        &mut self,
        [input, seconds, feedback]: [Signal<'_>; 3],
        around: Around<'_>,
        out: &mut [f64],
    ) {
        let [delays, feedbacks, _] = around.rooms;
        let (delays, feedbacks) = (&mut delays[..out.len()], &mut feedbacks[..out.len()]);
        let (rate_hz, longest, length) = (around.rate_hz, self.longest, self.line.len());
        input.fill(out);
        seconds.map(delays, |seconds| (seconds * rate_hz).clamp(2.0, longest));
        feedback.map(feedbacks, |feedback| feedback.clamp(-1.0, 1.0));
        for ((sample, &delay), &feedback) in out.iter_mut().zip(&*delays).zip(&*feedbacks) {
            let whole = delay as usize;
            let x = delay - whole as f64;
            let back = |samples: usize| {
                let index = if self.next >= samples { self.next } else { self.next + length } - samples;
                f64::from(self.line[index])
            };
            let [a, b, c, d] = [back(whole - 1), back(whole), back(whole + 1), back(whole + 2)];
            let (rise, bend) = (c - b, a - 2.0 * b + c);
            let late = b + x * (rise + (x - 1.0) * (0.5 * bend + (x + 1.0) / 6.0 * (d - a - 3.0 * rise)));
            let mut told = *sample + feedback * late;
            settle(&mut told);
            self.line[self.next] = told as f32;
            self.next = if self.next + 1 == length { 0 } else { self.next + 1 };
            *sample = late;
        }
    }
}
