//! The accumulators of the rays of a tile.

use super::line::Block;
use super::simd::{MOST_LANES, Simd};
use crate::stage::composite::Ray;
use vg500_regs::BlendMode;
use vg500_regs::limit::BASE_PLANE_SIZE;

/// Words before the first and behind the last ray: blocks may begin and end beside the base plane.
const MARGIN: usize = MOST_LANES;
const ROW: usize = MARGIN + BASE_PLANE_SIZE as usize + MARGIN;
/// R, G, B, opacity, and the extreme value or the number of samples.
const CHANNELS: usize = 5;

/// Channel of opacity.
pub const ALPHA: usize = 3;
/// Channel of the extreme sample value: -1 or 32767 as long as a ray has none.
pub const EXTREME: usize = 4;
/// Channel of the number of samples of a sum.
pub const COUNT: usize = 4;

/// Accumulators of some rows of rays: 16 bits for each channel, or 32 in sums.
#[derive(Debug, Default)]
pub struct Accumulators {
    words: Vec<[[u16; ROW]; CHANNELS]>,
    sums: Vec<[[u32; ROW]; CHANNELS]>,
}

/// What a ray without a visible sample has as its extreme.
#[must_use]
pub const fn no_extreme(blend: BlendMode) -> i16 {
    if matches!(blend, BlendMode::Minimum) { i16::MAX } else { -1 }
}

impl Accumulators {
    /// Empties the accumulators of `rows` rows.
    pub fn clear(&mut self, blend: BlendMode, rows: usize) {
        if blend == BlendMode::Sum {
            self.sums.clear();
            self.sums.resize(rows, [[0; ROW]; CHANNELS]);
            return;
        }
        self.words.resize(rows, [[0; ROW]; CHANNELS]);
        let extremes = matches!(blend, BlendMode::Maximum | BlendMode::Minimum);
        for row in &mut self.words {
            row[..CHANNELS - 1].iter_mut().for_each(|channel| channel.fill(0));
            if extremes {
                row[EXTREME].fill(no_extreme(blend).cast_unsigned());
            }
        }
    }

    /// The rays of a row, from the first column on.
    pub fn load(&mut self, blend: BlendMode, row: usize, rays: &[Ray]) {
        for (column, ray) in rays.iter().enumerate() {
            let at = MARGIN + column;
            let [r, g, b] = ray.color;
            if blend == BlendMode::Sum {
                let channels = [r, g, b, ray.alpha, ray.samples];
                (0..CHANNELS).for_each(|channel| self.sums[row][channel][at] = channels[channel]);
                continue;
            }
            let channels = [r, g, b, ray.alpha].map(|channel| channel as u16);
            (0..EXTREME).for_each(|channel| self.words[row][channel][at] = channels[channel]);
            if ray.valid {
                self.words[row][EXTREME][at] = ray.extreme;
            }
        }
    }

    /// A ray as it stands. The extreme of one that has none is 0.
    #[must_use]
    pub fn ray(&self, blend: BlendMode, row: usize, column: usize) -> Ray {
        let at = MARGIN + column;
        if blend == BlendMode::Sum {
            let [r, g, b, alpha, samples] = [0, 1, 2, 3, 4].map(|channel| self.sums[row][channel][at]);
            return Ray { color: [r, g, b], alpha, samples, ..Ray::default() };
        }
        let channels = &self.words[row];
        let [r, g, b, alpha] = [0, 1, 2, 3].map(|channel: usize| u32::from(channels[channel][at]));
        let extremes = matches!(blend, BlendMode::Maximum | BlendMode::Minimum);
        let extreme = channels[EXTREME][at];
        let valid = extremes && extreme != no_extreme(blend).cast_unsigned();
        Ray { color: [r, g, b], alpha, extreme: if valid { extreme } else { 0 }, valid, samples: 0 }
    }

    /// Replaces colour and opacity of a ray in front-to-back blending.
    pub fn set_alpha_ray(&mut self, row: usize, column: usize, ray: &Ray) {
        let [r, g, b] = ray.color;
        for (channel, value) in [r, g, b, ray.alpha].into_iter().enumerate() {
            self.words[row][channel][MARGIN + column] = value as u16;
        }
    }

    /// A channel of a row, from the first column on.
    #[must_use]
    pub fn channel(&self, row: usize, channel: usize) -> &[u16] {
        &self.words[row][channel][MARGIN..]
    }

    /// A row of rays of which the one at column 0 has its sample above voxel `first`.
    #[inline(always)]
    pub fn row(&mut self, row: usize, first: i32) -> Row<'_> {
        Row(&mut self.words[row], Shift(first))
    }

    /// As [`Self::row`], for sums.
    #[inline(always)]
    pub fn sum_row(&mut self, row: usize, first: i32) -> SumRow<'_> {
        SumRow(&mut self.sums[row], Shift(first))
    }
}

/// Voxel of the ray at column 0.
#[derive(Clone, Copy, Debug)]
struct Shift(i32);

impl Shift {
    /// Where the rays of a block of voxels lie. A block that has no ray at all is not asked for.
    #[inline(always)]
    fn place(self, block: Block) -> usize {
        let place = (MARGIN + block.start()).wrapping_sub(self.0 as isize as usize);
        debug_assert!(place <= ROW - MOST_LANES, "{place}");
        place.min(ROW - MOST_LANES)
    }
}

/// A row of accumulators.
#[derive(Debug)]
pub struct Row<'a>(&'a mut [[u16; ROW]; CHANNELS], Shift);

impl Row<'_> {
    /// The accumulators of a channel under a block of voxels.
    #[inline(always)]
    pub fn load<S: Simd>(&self, simd: S, channel: usize, block: Block) -> S::Words {
        // SAFETY: the place is at least a vector before the row's end.
        unsafe { simd.load(self.0[channel].as_ptr().add(self.1.place(block))) }
    }

    /// Replaces them.
    #[inline(always)]
    pub fn store<S: Simd>(&mut self, simd: S, channel: usize, block: Block, words: S::Words) {
        // SAFETY: the place is at least a vector before the row's end, which is borrowed for writing.
        unsafe { simd.store(self.0[channel].as_mut_ptr().add(self.1.place(block)), words) }
    }
}

/// A row of sums.
#[derive(Debug)]
pub struct SumRow<'a>(&'a mut [[u32; ROW]; CHANNELS], Shift);

impl SumRow<'_> {
    /// Adds to the sums of a channel.
    #[inline(always)]
    pub fn add<S: Simd>(&mut self, simd: S, channel: usize, block: Block, words: S::Words) {
        // SAFETY: the place is at least a vector before the row's end, which is borrowed for writing.
        unsafe { simd.add_to_sums(self.0[channel].as_mut_ptr().add(self.1.place(block)), words) }
    }
}
