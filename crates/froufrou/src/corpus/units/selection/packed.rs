//! Vectors of nodes as bytes.
//!
//! What a search waits for is memory, so that all that is asked of a node lies in one place and its numbers are bytes:
//! steps from the lowest of the node, which are as large for all numbers of a vector. Numbers of children, or of units,
//! lie side by side, so that vector units compare many at once.

use rayon::prelude::*;

use super::paged::Paged;

/// Vectors of so many numbers, of several kinds, for each node as many bytes.
pub(super) struct Packed {
    dimensions: usize,
    kinds: usize,
    /// Bytes of one kind in a node: the lowest of each number and the step, then what is packed.
    room: usize,
    bytes: Paged<u8>,
}

/// What the bytes of a kind in a node mean.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a> {
    lowest: &'a [[u8; 4]],
    step: [u8; 4],
}

impl Packed {
    /// Packs so many nodes, each of so many bytes of each kind. `bounds` gives the box around all that is packed of a node
    /// and kind, the lowest of each number and then the highest, and `pack` fills its bytes by them and by the step.
    pub fn new(
        (nodes, kinds): (usize, usize),
        dimensions: usize,
        bytes: usize,
        bounds: impl Fn(usize, usize, &mut [f32]) + Sync,
        pack: impl Fn(usize, usize, (&[f32], f32), &mut [u8]) + Sync,
    ) -> Self {
        let frame = 4 * (dimensions + 1);
        let room = frame + bytes;
        let mut all = vec![0u8; nodes * kinds * room];
        all.par_chunks_mut(room).enumerate().for_each_init(
            || vec![0.0f32; 2 * dimensions],
            |own, (place, bytes)| {
                let (node, kind) = (place / kinds, place % kinds);
                bounds(node, kind, own);
                let (lowest, highest) = own.split_at(dimensions);
                let widest = highest.iter().zip(lowest).map(|(high, low)| high - low).fold(0.0, f32::max);
                // A little more, so that rounding does not go beyond the last.
                let step =
                    if widest > 0.0 { (widest / 255.0 * 1.000_01).max(f32::MIN_POSITIVE) } else { 1.0 };
                let (frame, bytes) = bytes.split_at_mut(frame);
                for (to, value) in frame.as_chunks_mut().0.iter_mut().zip(lowest.iter().chain([&step])) {
                    *to = value.to_le_bytes();
                }
                pack(node, kind, (lowest, step), bytes);
            },
        );
        Self { dimensions, kinds, room, bytes: Paged::new(all) }
    }

    /// The bytes of a kind in a node, and what they mean.
    #[inline(always)]
    pub fn get(&self, node: usize, kind: usize) -> (Frame<'_>, &[u8]) {
        let place = node * self.kinds + kind;
        let (frame, bytes) = self.bytes[place * self.room..][..self.room].split_at(4 * (self.dimensions + 1));
        let (lowest, step) = frame.split_at(4 * self.dimensions);
        (Frame { lowest: lowest.as_chunks().0, step: [step[0], step[1], step[2], step[3]] }, bytes)
    }
}

// No closures here: what is not inlined knows nothing of vector units.
impl Frame<'_> {
    /// How far a vector lies from boxes that are side by side: for each number the lowest of all, then the highest.
    #[inline(always)]
    pub fn outside<const N: usize>(&self, bytes: &[u8], vector: &[f32]) -> [f32; N] {
        let (sides, _) = bytes.as_chunks::<N>();
        let (step, steps) = (self.step(), 1.0 / self.step());
        let mut distances = [0.0f32; N];
        for ((number, value), sides) in vector.iter().enumerate().zip(sides.chunks_exact(2)) {
            let wanted = self.wanted(number, *value, steps);
            for i in 0..N {
                let (below, above) = (f32::from(sides[0][i]) - wanted, wanted - f32::from(sides[1][i]));
                let outside = if below > above { below } else { above };
                let outside = if outside > 0.0 { outside } else { 0.0 };
                distances[i] += outside * outside;
            }
        }
        for distance in &mut distances {
            *distance = distance.sqrt() * step;
        }
        distances
    }

    /// How far a vector is at least from vectors that are side by side, number by number.
    #[inline(always)]
    pub fn beside<const N: usize>(&self, bytes: &[u8], vector: &[f32]) -> [f32; N] {
        let rounding = Self::rounding(vector.len());
        let mut distances = self.squares(bytes, vector);
        for distance in &mut distances {
            let least = distance.sqrt() - rounding;
            *distance = if least > 0.0 { least * self.step() } else { 0.0 };
        }
        distances
    }

    /// How far a vector is from vectors as they were rounded, in steps and squared.
    #[inline(always)]
    pub fn squares<const N: usize>(&self, bytes: &[u8], vector: &[f32]) -> [f32; N] {
        let (numbers, _) = bytes.as_chunks::<N>();
        let steps = 1.0 / self.step();
        let mut squares = [0.0f32; N];
        for ((number, value), bytes) in vector.iter().enumerate().zip(numbers) {
            let wanted = self.wanted(number, *value, steps);
            for i in 0..N {
                let difference = f32::from(bytes[i]) - wanted;
                squares[i] += difference * difference;
            }
        }
        squares
    }

    /// The largest of these squares of what may be within a distance, of vectors of so many numbers.
    #[inline(always)]
    pub fn square(&self, distance: f32, numbers: usize) -> f32 {
        let most = distance / self.step() + Self::rounding(numbers);
        most * most * 1.000_01
    }

    /// Each number was rounded by half a step at most.
    #[inline(always)]
    fn rounding(numbers: usize) -> f32 {
        0.5001 * (numbers as f32).sqrt()
    }

    /// A number in steps from the lowest.
    #[inline(always)]
    fn wanted(&self, number: usize, value: f32, steps: f32) -> f32 {
        (value - f32::from_le_bytes(self.lowest[number])) * steps
    }

    #[inline(always)]
    fn step(&self) -> f32 {
        f32::from_le_bytes(self.step)
    }
}
