//! The sample slice FIFO of the paper's Figure 4: the interpolated samples of a slice, with those beside it that
//! gradients read.

use super::interpolate::{guard, trilinear, unguard};
use crate::memory::voxel::VoxelSlices;
use crate::plan::SampleSlice;
use core::ops::Range;

/// Samples of one slice for a rectangle of rays.
#[derive(Clone, Debug, Default)]
pub struct SampleGrid {
    columns: Range<i64>,
    rows: Range<i64>,
    values: Vec<u16>,
}

impl SampleGrid {
    /// Interpolates the samples of a slice for all rays that have one there, and for `margin` rays around them.
    pub fn interpolate(&mut self, slice: &SampleSlice, voxels: &VoxelSlices<'_>, margin: i64) {
        let around = |rays: &Range<u32>| i64::from(rays.start) - margin..i64::from(rays.end) + margin;
        self.columns = around(&slice.x.rays);
        self.rows = around(&slice.y.rays);
        self.values.clear();
        let weights = [slice.x.weight(), slice.y.weight(), slice.weight_z()];
        let z = slice.voxel_slice();
        for row in self.rows.clone() {
            for column in self.columns.clone() {
                let corners = voxels.corners([slice.x.voxel(column), slice.y.voxel(row), z]);
                let guarded = corners.map(|slice| slice.map(|row| row.map(guard)));
                self.values.push(unguard(trilinear(guarded, weights)));
            }
        }
    }

    /// The sample of a ray, 12 bits.
    #[must_use]
    pub fn at(&self, column: i64, row: i64) -> u16 {
        let width = self.columns.end - self.columns.start;
        self.values[((row - self.rows.start) * width + column - self.columns.start) as usize]
    }
}
