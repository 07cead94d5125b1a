//! The least and the greatest voxel of blocks of a staged slice, measured while the slice streams through.
//!
//! Interpolation stays between the voxels around a sample: weights are less than 1, and rounding a value between
//! two numbers of 12 bits does not leave them. So the samples of a block lie between its extremes.

use super::cells::{CELL, CELLS};
use super::line::{Block, Line};
use super::simd::Simd;
use core::ops::Range;

/// Rows of a block. Lower ones tell apart more and cost more.
pub const ROWS: usize = 8;

/// The least and the greatest voxel of a cell.
pub type Extremes = [u16; 2];

/// The extremes of the blocks of a slice: [`ROWS`] rows by a cell, and the voxels one behind them that samples in the
/// block are interpolated from.
#[derive(Clone, Debug, Default)]
pub struct Ranges {
    /// The first row of blocks.
    first: usize,
    rows: Vec<[Extremes; CELLS]>,
}

impl Ranges {
    /// Measures some rows of a slice; `lines` are these rows.
    #[inline(always)]
    pub fn measure<S: Simd>(&mut self, simd: S, lines: &[Line], rows: &Range<usize>, width: usize) {
        self.first = rows.start / ROWS;
        self.rows.clear();
        let mut start = 0;
        while start < lines.len() {
            let end = (rows.start + start) / ROWS * ROWS + ROWS - rows.start;
            let with_next = &lines[start..(end + 1).min(lines.len())];
            self.rows.push(extremes(simd, with_next, width));
            start = end;
        }
    }

    /// The extremes of the cells of the block that a row lies in, if it was measured.
    #[inline(always)]
    #[must_use]
    pub fn at(&self, row: usize) -> Option<&[Extremes; CELLS]> {
        self.rows.get((row / ROWS).checked_sub(self.first)?)
    }
}

/// The extremes of the cells of some lines.
#[inline(always)]
fn extremes<S: Simd>(simd: S, lines: &[Line], width: usize) -> [Extremes; CELLS] {
    let [mut least, mut greatest] = [Line::ZERO; 2];
    for block in Block::covering(width) {
        let mut low = lines[0].load(simd, block);
        let mut high = low;
        for line in &lines[1..] {
            let voxels = line.load(simd, block);
            low = simd.min(low, voxels);
            high = simd.max(high, voxels);
        }
        least.store(simd, block, low);
        greatest.store(simd, block, high);
    }
    let mut result = [[0; 2]; CELLS];
    for (cell, extremes) in result.iter_mut().enumerate().take(width.div_ceil(CELL)) {
        // The voxel behind the last one is the last one again.
        let voxels = cell * CELL..(cell * CELL + CELL + 1).min(width);
        let low = least.words()[voxels.clone()].iter().fold(u16::MAX, |low, &voxel| low.min(voxel));
        let high = greatest.words()[voxels].iter().fold(0, |high, &voxel| high.max(voxel));
        *extremes = [low >> 3, high >> 3];
    }
    result
}
