//! One sound through several long responses: convolution by FFT, in parts.
//!
//! A response is cut into parts that grow with their distance from its start. Each part waits until as many samples
//! have come as it is long, so that what it adds is due only afterwards: a sample's output is there as soon as the
//! sample is (Gardner 1995, "Efficient convolution without input-output delay"). The first [`FINEST`] taps are
//! multiplied one by one; responses that begin later, such as the tail of a room, do without.
//!
//! The parts lie on a grid of absolute frames. So the output of a frame is the same to the last bit whatever the
//! lengths in which the input is fed, and wherever the feeding began, if it did so no later than
//! [`Convolver::fed_from`].
//!
//! | quantity | value |
//! | --- | --- |
//! | error | below −130 dB of the output's peak, in single precision |
//! | cost a sample | two FFTs a size of part for the first response, one for each further; 7 complex products a size of part below the longest, then one for every part of the longest |
//! | memory | 24 bytes a tap for the first response, 16 for each further; 8 bytes a tap for [another sound](Convolver::another) through the same |

use std::sync::Arc;

use pulp::Simd;
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};

use crate::{Error, Result};

/// The shortest part, and how many taps are multiplied one by one.
pub const FINEST: usize = 128;

/// Each size of part is this many times the one before.
const GROWTH: usize = 8;

/// The longest part. Longer ones would save little, and the input before a range is fed by whole parts.
const COARSEST: usize = 8192;

/// All responses together have no more taps than this: 2 GiB.
const MOST_TAPS: usize = 1 << 27;

/// A sound on its way through several responses.
#[derive(Clone)]
pub struct Convolver {
    responses: usize,
    /// The length of the longest response.
    taps: usize,
    /// The first taps of each response, latest first, [`FINEST`] a response; empty where all are 0.
    head: Arc<[f32]>,
    /// The last input before this frame's part and that part, twice [`FINEST`].
    recent: Vec<f32>,
    stages: Vec<Stage>,
    /// The next frame to be fed.
    frame: i64,
}

impl Convolver {
    /// Convolves with some responses, which may differ in length. Frame 0 is the first to be fed, until
    /// [`Convolver::start`] says otherwise.
    pub fn new(responses: &[&[f32]]) -> Result<Self> {
        let taps = responses.iter().map(|taps| taps.len()).max().unwrap_or(0);
        if taps.saturating_mul(responses.len()) > MOST_TAPS {
            return Err(Error::new(format!(
                "{} responses of up to {taps} taps; together they may have {MOST_TAPS}",
                responses.len()
            )));
        }
        if let Some((response, tap)) = responses
            .iter()
            .enumerate()
            .find_map(|(response, taps)| Some((response, taps.iter().position(|tap| !tap.is_finite())?)))
        {
            return Err(Error::new(format!("tap {tap} of response {response} is not a finite number")));
        }
        let first = |response: &[f32], index: usize| response.get(index).copied().unwrap_or(0.0);
        let mut head: Vec<f32> = responses
            .iter()
            .flat_map(|response| (0..FINEST).rev().map(|index| first(response, index)))
            .collect();
        if head.iter().all(|tap| *tap == 0.0) {
            head.clear();
        }
        let mut planner = RealFftPlanner::new();
        let (mut stages, mut size, mut from) = (Vec::new(), FINEST, FINEST);
        while from < taps {
            let to = if size < COARSEST { (GROWTH * size).min(taps) } else { taps };
            stages.extend(Stage::new(&mut planner, size, from..to, responses));
            (from, size) = (to, size * GROWTH);
        }
        let (responses, head, recent) = (responses.len(), head.into(), vec![0.0; 2 * FINEST]);
        Ok(Self { responses, taps, head, recent, stages, frame: 0 })
    }

    /// Another sound on its way through the same responses, which both share; nothing has been fed to it.
    pub fn another(&self) -> Self {
        let mut another = self.clone();
        another.start(0);
        another
    }

    /// The number of responses.
    pub fn responses(&self) -> usize {
        self.responses
    }

    /// The length of the longest response.
    pub fn taps(&self) -> usize {
        self.taps
    }

    /// True where nothing is under way: from silence nothing but silence will come.
    pub fn is_silent(&self) -> bool {
        self.recent.iter().all(|sample| *sample == 0.0) && self.stages.iter().all(Stage::is_silent)
    }

    /// From which frame on the input must be fed so that the output from a frame on is what it is when all is fed.
    pub fn fed_from(&self, frame: i64) -> i64 {
        let grid = self.stages.iter().map(|stage| stage.size).max().unwrap_or(FINEST) as i64;
        let needed = |stage: &Stage| {
            let size = stage.size as i64;
            (frame.div_euclid(size) - (stage.first + stage.parts) as i64) * size
        };
        let head = (frame.div_euclid(FINEST as i64) - 1) * FINEST as i64;
        let first = self.stages.iter().map(needed).fold(head, i64::min);
        first.div_euclid(grid) * grid
    }

    /// Forgets what was fed; the next input is that of `frame`.
    pub fn start(&mut self, frame: i64) {
        self.frame = frame;
        self.recent.fill(0.0);
        self.stages.iter_mut().for_each(Stage::clear);
    }

    /// The next frame to be fed.
    pub fn frame(&self) -> i64 {
        self.frame
    }

    /// Feeds the next frames, whose output nobody asks for: it costs less.
    pub fn skip(&mut self, input: &[f32]) -> Result<()> {
        self.advance(input, None)
    }

    /// Feeds the next frames and writes what comes out of each response at the same frames: as many of the first
    /// response, then as many of the second and so on. It allocates nothing.
    pub fn process(&mut self, input: &[f32], out: &mut [f32]) -> Result<()> {
        if out.len() != self.responses * input.len() {
            return Err(Error::new(format!(
                "{} frames come out of {} responses; there is room for {} numbers",
                input.len(),
                self.responses,
                out.len()
            )));
        }
        self.advance(input, Some(out))
    }

    fn advance(&mut self, input: &[f32], mut out: Option<&mut [f32]>) -> Result<()> {
        let count = input.len();
        let mut done = 0;
        while done < count {
            let within = self.frame.rem_euclid(FINEST as i64) as usize;
            let step = (FINEST - within).min(count - done);
            let range = done..done + step;
            self.recent[FINEST + within..FINEST + within + step].copy_from_slice(&input[range.clone()]);
            if let Some(out) = out.as_deref_mut() {
                for response in 0..self.responses {
                    let out = &mut out[response * count..(response + 1) * count][range.clone()];
                    match self.head.chunks_exact(FINEST).nth(response) {
                        Some(head) => direct(head, &self.recent[within + 1..], out),
                        None => out.fill(0.0),
                    }
                }
                for stage in &mut self.stages {
                    stage.add(self.frame, self.responses, out, count, range.clone())?;
                }
            }
            for stage in &mut self.stages {
                stage.feed(self.frame, &input[range.clone()])?;
            }
            if within + step == FINEST {
                self.recent.copy_within(FINEST.., 0);
            }
            (self.frame, done) = (self.frame + step as i64, done + step);
        }
        Ok(())
    }
}

/// Multiplies the taps one by one: `recent` begins [`FINEST`] − 1 frames before the first of `out`.
fn direct(head: &[f32], recent: &[f32], out: &mut [f32]) {
    for (recent, out) in recent.windows(FINEST).zip(out) {
        // Lanes, so that the sum has an order that is both fixed and fast.
        let mut lanes = [0.0f32; 16];
        for (taps, recent) in head.chunks_exact(16).zip(recent.chunks_exact(16)) {
            for ((lane, tap), recent) in lanes.iter_mut().zip(taps).zip(recent) {
                *lane += tap * recent;
            }
        }
        *out = lanes.iter().sum();
    }
}

/// The parts of one size.
#[derive(Clone)]
struct Stage {
    size: usize,
    /// How many parts after the start of the responses the first of these lies: 1 or more.
    first: usize,
    /// How many parts there are in each response.
    parts: usize,
    forward: Arc<dyn RealToComplex<f32>>,
    inverse: Arc<dyn ComplexToReal<f32>>,
    /// The spectrum of each part of each response.
    parts_of: Arc<[Vec<Spectrum>]>,
    /// Those of the input, each of one part and the one before; a ring.
    spectra: Vec<Spectrum>,
    /// The place of the latest in the ring.
    latest: usize,
    /// The last input before the part that is being fed, and that part.
    input: Vec<f32>,
    /// What this stage adds to the part that is being fed, one response after the other, once it is made.
    output: Vec<f32>,
    made: bool,
    sum: Spectrum,
    bins: Vec<Complex<f32>>,
    samples: Vec<f32>,
    scratch: Vec<Complex<f32>>,
}

/// Real and imaginary parts apart, as vector units like them.
#[derive(Clone)]
struct Spectrum {
    real: Vec<f32>,
    imaginary: Vec<f32>,
    /// All 0.
    silent: bool,
}

impl Spectrum {
    fn new(size: usize) -> Self {
        Self { real: vec![0.0; size + 1], imaginary: vec![0.0; size + 1], silent: true }
    }

    fn clear(&mut self) {
        self.real.fill(0.0);
        self.imaginary.fill(0.0);
        self.silent = true;
    }

    fn set(&mut self, bins: &[Complex<f32>]) {
        for ((real, imaginary), bin) in self.real.iter_mut().zip(&mut self.imaginary).zip(bins) {
            (*real, *imaginary) = (bin.re, bin.im);
        }
        self.silent = false;
    }
}

impl Stage {
    /// The parts of one size that make up a range of taps; none where all of these are 0.
    fn new(
        planner: &mut RealFftPlanner<f32>,
        size: usize,
        taps: std::ops::Range<usize>,
        responses: &[&[f32]],
    ) -> Option<Self> {
        let part = |response: &[f32], part: usize| -> Vec<f32> {
            let range =
                (part * size).min(response.len())..((part + 1) * size).min(taps.end).min(response.len());
            response.get(range).unwrap_or_default().to_vec()
        };
        let sounds =
            |index: &usize| responses.iter().any(|response| part(response, *index).iter().any(|t| *t != 0.0));
        let all = taps.start / size..taps.end.div_ceil(size);
        let (first, last) = (all.clone().find(sounds)?, all.rev().find(sounds)?);
        let (forward, inverse) = (planner.plan_fft_forward(2 * size), planner.plan_fft_inverse(2 * size));
        let scratch = forward.get_scratch_len().max(inverse.get_scratch_len());
        let mut stage = Self {
            size,
            first,
            parts: last + 1 - first,
            parts_of: Arc::default(),
            spectra: vec![Spectrum::new(size); last],
            latest: 0,
            input: vec![0.0; 2 * size],
            output: vec![0.0; responses.len() * size],
            made: true,
            sum: Spectrum::new(size),
            bins: forward.make_output_vec(),
            samples: forward.make_input_vec(),
            scratch: vec![Complex::default(); scratch],
            forward,
            inverse,
        };
        let scale = 1.0 / (2 * size) as f32;
        let mut parts_of = Vec::with_capacity(responses.len());
        for response in responses {
            let mut spectra = vec![Spectrum::new(size); stage.parts];
            for (index, spectrum) in spectra.iter_mut().enumerate() {
                let taps = part(response, first + index);
                if taps.iter().any(|tap| *tap != 0.0) {
                    stage.samples.fill(0.0);
                    stage.samples.iter_mut().zip(&taps).for_each(|(to, from)| *to = scale * from);
                    stage.transform().ok()?;
                    spectrum.set(&stage.bins);
                }
            }
            parts_of.push(spectra);
        }
        stage.parts_of = parts_of.into();
        Some(stage)
    }

    /// Transforms what is in `samples`, and leaves nonsense there.
    fn transform(&mut self) -> Result<()> {
        let scratch = &mut self.scratch[..self.forward.get_scratch_len()];
        self.forward
            .process_with_scratch(&mut self.samples, &mut self.bins, scratch)
            .map_err(|error| Error::new("a sound could not be transformed").because(error))
    }

    fn clear(&mut self) {
        self.spectra.iter_mut().for_each(Spectrum::clear);
        self.input.fill(0.0);
        self.output.fill(0.0);
        self.made = true;
    }

    fn is_silent(&self) -> bool {
        let is_zero = |samples: &[f32]| samples.iter().all(|sample| *sample == 0.0);
        self.spectra.iter().all(|spectrum| spectrum.silent) && is_zero(&self.input) && is_zero(&self.output)
    }

    /// Takes in frames that lie in one part of the finest size.
    fn feed(&mut self, frame: i64, input: &[f32]) -> Result<()> {
        let within = frame.rem_euclid(self.size as i64) as usize;
        self.input[self.size + within..self.size + within + input.len()].copy_from_slice(input);
        if within + input.len() < self.size {
            return Ok(());
        }
        self.latest = (self.latest + 1) % self.spectra.len();
        if self.input.iter().all(|sample| *sample == 0.0) {
            self.spectra[self.latest].clear();
        } else {
            self.samples.copy_from_slice(&self.input);
            self.transform()?;
            self.spectra[self.latest].set(&self.bins);
        }
        self.input.copy_within(self.size.., 0);
        self.made = false;
        Ok(())
    }

    /// Adds to the outputs of frames that lie in one part of the finest size.
    fn add(
        &mut self,
        frame: i64,
        responses: usize,
        out: &mut [f32],
        count: usize,
        range: std::ops::Range<usize>,
    ) -> Result<()> {
        if !self.made {
            for response in 0..responses {
                self.make(response)?;
            }
            self.made = true;
        }
        let within = frame.rem_euclid(self.size as i64) as usize;
        for (out, made) in out.chunks_exact_mut(count).zip(self.output.chunks_exact(self.size)) {
            out[range.clone()].iter_mut().zip(&made[within..]).for_each(|(out, made)| *out += made);
        }
        Ok(())
    }

    /// Makes what a response adds to the part that is fed next.
    fn make(&mut self, response: usize) -> Result<()> {
        let output = &mut self.output[response * self.size..(response + 1) * self.size];
        self.sum.clear();
        for (index, part) in self.parts_of[response].iter().enumerate() {
            // The part `first` is met by the input that lies as many parts before the output.
            let back = self.first + index - 1;
            let input = &self.spectra[(self.latest + self.spectra.len() - back) % self.spectra.len()];
            if !input.silent && !part.silent {
                pulp::Arch::new().dispatch(Product { input, part, sum: &mut self.sum });
                self.sum.silent = false;
            }
        }
        if self.sum.silent {
            output.fill(0.0);
            return Ok(());
        }
        for ((bin, real), imaginary) in self.bins.iter_mut().zip(&self.sum.real).zip(&self.sum.imaginary) {
            *bin = Complex::new(*real, *imaginary);
        }
        // Sums of products of real numbers, but what is not finite would leave something here.
        self.bins[0].im = 0.0;
        self.bins[self.size].im = 0.0;
        let scratch = &mut self.scratch[..self.inverse.get_scratch_len()];
        self.inverse
            .process_with_scratch(&mut self.bins, &mut self.samples, scratch)
            .map_err(|error| Error::new("a sound could not be transformed back").because(error))?;
        output.copy_from_slice(&self.samples[self.size..]);
        Ok(())
    }
}

/// Adds the product of two spectra to a third. No two operations are fused, so that every width gives the same.
struct Product<'a> {
    input: &'a Spectrum,
    part: &'a Spectrum,
    sum: &'a mut Spectrum,
}

impl pulp::WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (a, a_rest) = S::as_simd_f32s(&self.input.real);
        let (b, b_rest) = S::as_simd_f32s(&self.input.imaginary);
        let (c, c_rest) = S::as_simd_f32s(&self.part.real);
        let (d, d_rest) = S::as_simd_f32s(&self.part.imaginary);
        let (real, real_rest) = S::as_mut_simd_f32s(&mut self.sum.real);
        let (imaginary, imaginary_rest) = S::as_mut_simd_f32s(&mut self.sum.imaginary);
        for (((((real, imaginary), a), b), c), d) in
            real.iter_mut().zip(imaginary).zip(a).zip(b).zip(c).zip(d)
        {
            let product = simd.sub_f32s(simd.mul_f32s(*a, *c), simd.mul_f32s(*b, *d));
            *real = simd.add_f32s(*real, product);
            let product = simd.add_f32s(simd.mul_f32s(*a, *d), simd.mul_f32s(*b, *c));
            *imaginary = simd.add_f32s(*imaginary, product);
        }
        let rest = real_rest.iter_mut().zip(imaginary_rest).zip(a_rest).zip(b_rest).zip(c_rest).zip(d_rest);
        for (((((real, imaginary), a), b), c), d) in rest {
            *real += a * c - b * d;
            *imaginary += a * d + b * c;
        }
    }
}

#[cfg(test)]
mod tests;
