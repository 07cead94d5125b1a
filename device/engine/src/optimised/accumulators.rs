//! The accumulators of the rays of a tile.

use super::features::Features;
use super::line::{Block, VOXELS};
use super::simd::{HALF, LANES, Simd};
use super::tables::Classification;
use crate::stage::composite::Ray;
use vg500_regs::BlendMode;
use vg500_regs::limit::BASE_PLANE_SIZE;

/// Words before the first and behind the last ray: blocks may begin and end beside the base plane.
const MARGIN: usize = LANES;
const ROW: usize = MARGIN + BASE_PLANE_SIZE as usize + MARGIN;
/// R, G, B, opacity, and the extreme value or the number of samples.
const CHANNELS: usize = 5;

/// Channel of opacity.
pub const ALPHA: usize = 3;
/// Channel of the extreme sample value: -1 or 32767 as long as a ray has none.
pub const EXTREME: usize = 4;
/// Channel of the number of samples of a sum.
pub const COUNT: usize = 4;

/// A channel of a row; the first ray lies at the beginning of a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Channel<T>([T; ROW]);

/// How accumulators lie in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layout {
    /// 16 bits, channel by channel.
    #[default]
    Planes,
    /// 16 bits, R, G, B and opacity of a ray next to each other.
    Rays,
    /// 32 bits, channel by channel.
    Sums,
}

/// Accumulators of some rows of rays.
#[derive(Debug, Default)]
pub struct Accumulators {
    layout: Layout,
    /// Whether red stands for all colours: the other planes are not used.
    grey: bool,
    planes: Vec<[Channel<u16>; CHANNELS]>,
    rays: Vec<Channel<[u16; 4]>>,
    sums: Vec<[Channel<u32>; CHANNELS]>,
}

/// What a ray without a visible sample has as its extreme.
#[must_use]
pub const fn no_extreme(blend: BlendMode) -> i16 {
    if matches!(blend, BlendMode::Minimum) { i16::MAX } else { -1 }
}

impl Accumulators {
    /// Empties the accumulators of `rows` rows of `columns` rays.
    pub fn clear(&mut self, features: Features, rows: usize, columns: usize) {
        let Features { blend, .. } = features;
        let layout = features.layout();
        (self.layout, self.grey) = (layout, features.grey);
        let mut empty = [Channel([0; ROW]); CHANNELS];
        if matches!(blend, BlendMode::Maximum | BlendMode::Minimum) {
            // No sample beats what lies beside the base plane.
            let unbeaten = if blend == BlendMode::Minimum { -1 } else { i16::MAX };
            empty[EXTREME].0.fill(unbeaten.cast_unsigned());
            empty[EXTREME].0[MARGIN..MARGIN + columns].fill(no_extreme(blend).cast_unsigned());
        }
        self.planes.clear();
        self.rays.clear();
        self.sums.clear();
        match layout {
            Layout::Planes => self.planes.resize(rows, empty),
            Layout::Rays => self.rays.resize(rows, Channel([[0; 4]; ROW])),
            Layout::Sums => self.sums.resize(rows, [Channel([0; ROW]); CHANNELS]),
        }
    }

    /// Replaces the ray at a column of a row.
    pub fn set(&mut self, row: usize, column: usize, ray: &Ray) {
        let at = MARGIN + column;
        let [r, g, b] = ray.color;
        let color = [r, g, b, ray.alpha].map(|channel| channel as u16);
        match self.layout {
            Layout::Rays => self.rays[row].0[at] = color,
            Layout::Planes => {
                for (plane, channel) in self.planes[row].iter_mut().zip(color) {
                    plane.0[at] = channel;
                }
                if ray.valid {
                    self.planes[row][EXTREME].0[at] = ray.extreme;
                }
            }
            Layout::Sums => {
                for (plane, channel) in self.sums[row].iter_mut().zip([r, g, b, ray.alpha, ray.samples]) {
                    plane.0[at] = channel;
                }
            }
        }
    }

    /// The ray at a column of a row. In MIP and MinIP one without an extreme is not valid.
    #[must_use]
    pub fn ray(&self, blend: BlendMode, row: usize, column: usize) -> Ray {
        let at = MARGIN + column;
        let of = |[r, g, b, alpha]: [u16; 4]| Ray {
            color: [r, g, b].map(u32::from),
            alpha: alpha.into(),
            ..Ray::default()
        };
        match self.layout {
            Layout::Rays => of(self.rays[row].0[at]),
            Layout::Planes => {
                let [r, g, b, alpha, extreme] =
                    self.channels().map(|channel: usize| self.planes[row][channel].0[at]);
                let extremes = matches!(blend, BlendMode::Maximum | BlendMode::Minimum);
                let valid = extremes && extreme != no_extreme(blend).cast_unsigned();
                Ray { extreme: if valid { extreme } else { 0 }, valid, ..of([r, g, b, alpha]) }
            }
            Layout::Sums => {
                let [r, g, b, alpha, samples] =
                    [0, 1, 2, 3, 4].map(|channel: usize| self.sums[row][channel].0[at]);
                Ray { color: [r, g, b], alpha, samples, ..Ray::default() }
            }
        }
    }

    /// The rays from `column` on, a vector of them, whose opacity is less than `limit`: the first one as the lowest
    /// bit. Not for sums.
    #[inline(always)]
    pub fn less_opaque<S: Simd>(&self, simd: S, row: usize, column: usize, limit: u16) -> u64 {
        let at = MARGIN + column.min(BASE_PLANE_SIZE as usize);
        let mut copy = [0; LANES];
        let opacity = match self.layout {
            Layout::Rays => {
                let rays = &self.rays[row].0[at..at + LANES];
                copy.iter_mut().zip(rays).for_each(|(opacity, ray)| *opacity = ray[ALPHA]);
                copy.as_ptr()
            }
            _ => self.planes[row][ALPHA].0[at..at + LANES].as_ptr(),
        };
        // SAFETY: a vector of opacities lies there.
        let opacity = unsafe { simd.load([opacity, opacity.add(HALF)]) };
        simd.bits(simd.greater(simd.splat(limit.cast_signed()), opacity))
    }

    /// R, G, B and opacity of the rays of a row, 12 bits each.
    #[inline(always)]
    pub fn colors(&self, row: usize, rays: usize, mut each: impl FnMut(usize, [u16; 4])) {
        match self.layout {
            Layout::Rays => {
                let row = &self.rays[row].0[MARGIN..MARGIN + rays];
                row.iter().enumerate().for_each(|(column, ray)| each(column, *ray));
            }
            Layout::Planes => {
                let [r, g, b, a, _] = self.channels().map(|channel| &self.planes[row][channel]);
                for column in 0..rays {
                    let at = MARGIN + column;
                    each(column, [r.0[at], g.0[at], b.0[at], a.0[at]]);
                }
            }
            Layout::Sums => {}
        }
    }

    /// The plane that each channel is in.
    const fn channels(&self) -> [usize; CHANNELS] {
        if self.grey { [0, 0, 0, ALPHA, EXTREME] } else { [0, 1, 2, ALPHA, EXTREME] }
    }

    /// The extremes of a row, from the first column on.
    #[must_use]
    pub fn extremes(&self, row: usize) -> &[u16] {
        &self.planes[row][EXTREME].0[MARGIN..]
    }

    /// A row of rays of which the one at column 0 has its sample above voxel `first`.
    #[inline(always)]
    pub fn row(&mut self, row: usize, first: i32) -> Row<'_> {
        Row(&mut self.planes[row], Shift(first))
    }

    /// As [`Self::row`], in [`Layout::Rays`].
    #[inline(always)]
    pub fn ray_row(&mut self, row: usize, first: i32) -> RayRow<'_> {
        RayRow(&mut self.rays[row], Shift(first))
    }

    /// As [`Self::row`], in [`Layout::Sums`].
    #[inline(always)]
    pub fn sum_row(&mut self, row: usize, first: i32) -> SumRow<'_> {
        SumRow(&mut self.sums[row], Shift(first))
    }
}

/// Voxel of the ray at column 0.
#[derive(Clone, Copy, Debug)]
struct Shift(i32);

impl Shift {
    /// Where the rays of the halves of a block of voxels lie. A half that has no ray at all is none but one behind
    /// the voxels; its rays may be any behind those of the first half.
    #[inline(always)]
    fn places(self, block: Block) -> [usize; 2] {
        block.starts().map(|start| {
            let place = (MARGIN + start).wrapping_sub(self.0 as isize as usize);
            debug_assert!(place <= ROW - HALF || start == VOXELS, "{place}");
            place.min(ROW - HALF)
        })
    }
}

/// A row of accumulators.
#[derive(Debug)]
pub struct Row<'a>(&'a mut [Channel<u16>; CHANNELS], Shift);

impl Row<'_> {
    /// The accumulators of a channel under a block of voxels.
    #[inline(always)]
    pub fn load<S: Simd>(&self, simd: S, channel: usize, block: Block) -> S::Words {
        let row = self.0[channel].0.as_ptr();
        // SAFETY: the places are at least half a vector before the row's end.
        unsafe { simd.load(self.1.places(block).map(|place| row.add(place))) }
    }

    /// Replaces them.
    #[inline(always)]
    pub fn store<S: Simd>(&mut self, simd: S, channel: usize, block: Block, words: S::Words) {
        let row = self.0[channel].0.as_mut_ptr();
        // SAFETY: the places are at least half a vector before the row's end, which is borrowed for writing.
        unsafe { simd.store(self.1.places(block).map(|place| row.add(place)), words) }
    }
}

/// A row of sums.
#[derive(Debug)]
pub struct SumRow<'a>(&'a mut [Channel<u32>; CHANNELS], Shift);

impl SumRow<'_> {
    /// Adds to the sums of a channel.
    #[inline(always)]
    pub fn add<S: Simd>(&mut self, simd: S, channel: usize, block: Block, words: S::Words) {
        let row = self.0[channel].0.as_mut_ptr();
        // SAFETY: the places are at least half a vector before the row's end, which is borrowed for writing.
        unsafe { simd.add_to_sums(self.1.places(block).map(|place| row.add(place)), words) }
    }
}

/// A row of rays whose channels lie next to each other.
#[derive(Debug)]
pub struct RayRow<'a>(&'a mut Channel<[u16; 4]>, Shift);

impl RayRow<'_> {
    /// Blends premultiplied samples of a block of voxels.
    ///
    /// # Safety
    ///
    /// No value is greater than [`Classification::TRANSPARENT`].
    #[inline(always)]
    pub unsafe fn blend<S: Simd>(&mut self, simd: S, block: Block, table: &Classification, values: S::Words) {
        let row = self.0.0.as_mut_ptr();
        // SAFETY: the caller's promise; the places are at least half a vector before the row's end, which is
        // borrowed for writing.
        unsafe { simd.blend_entries(table, values, self.1.places(block).map(|place| row.add(place).cast())) };
    }
}
