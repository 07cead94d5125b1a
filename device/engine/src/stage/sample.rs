//! The sample slice FIFO of the paper's Figure 4: the interpolated samples of a slice, with those beside it that
//! gradients read.

use super::gradient::voxel_difference;
use super::interpolate::{guard, lerp, unguard};
use crate::memory::voxel::VoxelSlices;
use crate::plan::SampleSlice;
use core::ops::Range;

/// Samples of one slice for a rectangle of rays.
#[derive(Clone, Debug, Default)]
pub struct SampleGrid {
    columns: Range<i64>,
    rows: Range<i64>,
    values: Vec<u16>,
    differences: Vec<i32>,
    /// The row of voxels in work, interpolated along z and y.
    line: Vec<i32>,
}

impl SampleGrid {
    /// Interpolates the samples of a slice for all rays that have one there. For gradients, those of the rays next
    /// to them, too, and the differences along z.
    pub fn interpolate(&mut self, slice: &SampleSlice, voxels: &VoxelSlices<'_>, gradients: bool) {
        let margin = i64::from(gradients);
        let around = |rays: &Range<u32>| i64::from(rays.start) - margin..i64::from(rays.end) + margin;
        self.columns = around(&slice.x.rays);
        self.rows = around(&slice.y.rays);
        self.values.clear();
        self.differences.clear();
        for row in self.rows.clone() {
            let values = |y, z| voxels.row(y, z).iter().map(|voxel| guard(*voxel));
            let samples = interpolate_row(slice, row, self.columns.clone(), &mut self.line, values);
            self.values.extend(samples.map(unguard));
            if gradients {
                let differences = |y, z| {
                    let pairs = voxels.row(y, z - 1).iter().zip(voxels.row(y, z + 1));
                    pairs.map(|(before, behind)| voxel_difference(*before, *behind))
                };
                let row = interpolate_row(slice, row, self.columns.clone(), &mut self.line, differences);
                self.differences.extend(row);
            }
        }
    }

    /// The sample of a ray, 12 bits.
    #[must_use]
    pub fn at(&self, column: i64, row: i64) -> u16 {
        self.values[self.place(column, row)]
    }

    /// The interpolated [`voxel_difference`] along z at the sample of a ray.
    #[must_use]
    pub fn difference_at(&self, column: i64, row: i64) -> i32 {
        self.differences[self.place(column, row)]
    }

    const fn place(&self, column: i64, row: i64) -> usize {
        let width = self.columns.end - self.columns.start;
        ((row - self.rows.start) * width + column - self.columns.start) as usize
    }
}

/// Interpolates a row of rays between the rows that `at` gives for voxel coordinates y and z: each sample as
/// [`super::interpolate::trilinear`] does. Along z and y all of them share their weights, so these interpolations
/// are done once for each column of voxels.
fn interpolate_row<I: Iterator<Item = i32>>(
    slice: &SampleSlice,
    row: i64,
    columns: Range<i64>,
    line: &mut Vec<i32>,
    at: impl Fn(i64, i64) -> I,
) -> impl Iterator<Item = i32> {
    let [y, z] = [slice.y.voxel(row), slice.voxel_slice()];
    let along_z = |y| at(y, z).zip(at(y, z + 1)).map(|(a, b)| lerp(a, b, slice.weight_z()));
    line.clear();
    line.extend(along_z(y).zip(along_z(y + 1)).map(|(a, b)| lerp(a, b, slice.y.weight())));
    columns.map(|column| {
        let x = slice.x.voxel(column);
        let [a, b] = [x, x + 1].map(|x| line[x.clamp(0, line.len() as i64 - 1) as usize]);
        lerp(a, b, slice.x.weight())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::voxel::PermutedVolume;
    use crate::plan::Plan;
    use crate::stage::interpolate::trilinear;
    use vg500_regs::table::*;
    use vg500_regs::{FrameRegisters, SharedView, VoxelFormat};

    const SIZE: [u32; 3] = [5, 4, 3];

    /// An oblique frame of a volume of 8-bit voxels.
    fn frame() -> crate::FrameDescription {
        let mut registers = FrameRegisters::default();
        for (field, value) in [
            (volume_format::FORMAT, VoxelFormat::Uint8 as u32),
            (volume_size_xy::X, SIZE[0]),
            (volume_size_xy::Y, SIZE[1]),
            (volume_size_z::Z, SIZE[2]),
            (volume_pitch::ROW, 32),
            (volume_pitch::ROWS, 32),
            (supersampling::Z, 3),
            (start_x::POSITION, (-5_000_000_i32) as u32),
            (start_y::POSITION, 1_234_567),
            (step_x::STEP, 2_000_000),
            (step_y::STEP, 300_000),
            (base_plane_size::WIDTH, 9),
            (base_plane_size::HEIGHT, 9),
        ] {
            registers.set(field, value);
        }
        crate::FrameDescription::decode(&registers, 32 * 32 * 3).unwrap()
    }

    #[test]
    fn every_sample_is_that_of_its_eight_voxels() {
        let mut memory: Vec<u8> = (0..32 * 32 * 3_u32).map(|at| (at * at % 251) as u8).collect();
        let bytes = memory.clone();
        let voxel = |at: [i64; 3]| {
            let [x, y, z] = [0, 1, 2].map(|axis| at[axis].clamp(0, i64::from(SIZE[axis]) - 1) as usize);
            u16::from(bytes[(z * 32 + y) * 32 + x]) << 4
        };
        let frame = frame();
        let mut voxels = VoxelSlices::new(PermutedVolume::new(&frame, SharedView::of(&mut memory)));
        let mut grid = SampleGrid::default();
        let mut compared = 0;
        for slice in &Plan::new(&frame).slices {
            let z = slice.voxel_slice();
            voxels.load(z - 1..=z + 2).unwrap();
            grid.interpolate(slice, &voxels, true);
            let weights = [slice.x.weight(), slice.y.weight(), slice.weight_z()];
            for (row, column) in grid.rows.clone().flat_map(|row| grid.columns.clone().map(move |x| (row, x)))
            {
                let cell = [slice.x.voxel(column), slice.y.voxel(row), z];
                let corners = |corner: &dyn Fn([i64; 3]) -> i32| {
                    [0, 1].map(|dz| {
                        [0, 1].map(|dy| [0, 1].map(|dx| corner([cell[0] + dx, cell[1] + dy, cell[2] + dz])))
                    })
                };
                let value = trilinear(corners(&|at| guard(voxel(at))), weights);
                assert_eq!(grid.at(column, row), unguard(value), "{row} {column} {slice:?}");
                let ends = |[x, y, z]: [i64; 3]| voxel_difference(voxel([x, y, z - 1]), voxel([x, y, z + 1]));
                assert_eq!(grid.difference_at(column, row), trilinear(corners(&ends), weights));
                compared += 1;
            }
        }
        assert!(compared > 100, "{compared}");
    }
}
