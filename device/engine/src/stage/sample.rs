//! The sample slice FIFO of the paper's Figure 4: the interpolated samples of a slice, with those beside it that
//! gradients read.

use super::gradient::{from_difference, from_samples, voxel_difference};
use super::interpolate::{guard, lerp, unguard};
use super::section::Section;
use crate::memory::section::Record;
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
    /// Column whose gradients along y and z the section before has computed, and these, row by row.
    carried_column: Option<i64>,
    carried_gradients: Vec<[i32; 2]>,
    /// The row of voxels in work, interpolated along z and y.
    line: Vec<i32>,
}

impl SampleGrid {
    /// Interpolates the samples of a section's part of a slice for all rays that have one there. For gradients,
    /// those of the rays next to them, too, and the differences along z. `carried` are the records of the section
    /// before, one for each beam of voxels; none for the first.
    pub fn interpolate(
        &mut self,
        section: &Section,
        slice: &SampleSlice,
        voxels: &VoxelSlices<'_>,
        carried: &[Record],
        gradients: bool,
    ) {
        let margin = i64::from(gradients);
        let around = |rays: &Range<u32>| i64::from(rays.start) - margin..i64::from(rays.end) + margin;
        self.rows = around(&slice.y.rays);
        let own = within(&around(&slice.x.rays), &section.interpolated(&slice.x));
        let before = section.carried(&slice.x);
        let first = before.map_or(own.start, |[_, first]| first);
        self.columns = within(&around(&slice.x.rays), &(first..own.end));
        self.carried_column = before.map(|[last, _]| last);
        self.values.clear();
        self.differences.clear();
        self.carried_gradients.clear();
        for row in self.rows.clone() {
            self.take_up(slice, row, own.start, carried);
            let values = |y, z| voxels.row(y, z).iter().map(|voxel| guard(*voxel));
            let last = |y| beam(carried, y).map(|record| record.voxel);
            let samples = interpolate_row(section, slice, row, own.clone(), &mut self.line, values, last);
            self.values.extend(samples.map(unguard));
            if gradients {
                let differences = |y, z| {
                    let pairs = voxels.row(y, z - 1).iter().zip(voxels.row(y, z + 1));
                    pairs.map(|(before, behind)| voxel_difference(*before, *behind))
                };
                let last = |y| beam(carried, y).map(|record| record.difference);
                let row =
                    interpolate_row(section, slice, row, own.clone(), &mut self.line, differences, last);
                self.differences.extend(row);
            }
        }
    }

    /// Begins a row with the samples that the section before has kept: those before column `own`.
    fn take_up(&mut self, slice: &SampleSlice, row: i64, own: i64, carried: &[Record]) {
        // Rows beside those of rays are there for the gradients of their neighbours, which have been kept.
        let in_rays = u32::try_from(row).is_ok_and(|row| slice.y.rays.contains(&row));
        let record = beam(carried, slice.y.voxel(row)).filter(|_| in_rays).copied().unwrap_or_default();
        let kept = self.columns.start..own.min(self.columns.end);
        self.differences.extend(kept.clone().map(|_| 0));
        let values = kept.map(|column| match Some(column) == self.carried_column {
            true => record.sample,
            false => record.before,
        });
        self.values.extend(values);
        self.carried_gradients.push(record.gradient);
    }

    /// The sample of a ray, 12 bits.
    #[must_use]
    pub fn at(&self, column: i64, row: i64) -> u16 {
        self.values[self.place(column, row)]
    }

    /// The gradient at the sample of a ray, in permuted axes.
    #[must_use]
    pub fn gradient_at(&self, column: i64, row: i64) -> [i32; 3] {
        let x = from_samples(self.at(column - 1, row), self.at(column + 1, row));
        let [y, z] = self.gradient_across(column, row);
        [x, y, z]
    }

    /// Its components along permuted y and z, which need no sample to the right.
    #[must_use]
    pub fn gradient_across(&self, column: i64, row: i64) -> [i32; 2] {
        if Some(column) == self.carried_column {
            return self.carried_gradients[(row - self.rows.start) as usize];
        }
        let y = from_samples(self.at(column, row - 1), self.at(column, row + 1));
        [y, from_difference(self.differences[self.place(column, row)])]
    }

    /// Whether there are samples of a column of rays.
    #[must_use]
    pub fn contains(&self, column: i64) -> bool {
        self.columns.contains(&column)
    }

    const fn place(&self, column: i64, row: i64) -> usize {
        let width = self.columns.end - self.columns.start;
        ((row - self.rows.start) * width + column - self.columns.start) as usize
    }
}

/// The part of a range that lies in another one.
fn within(range: &Range<i64>, other: &Range<i64>) -> Range<i64> {
    let start = range.start.max(other.start);
    start..range.end.min(other.end).max(start)
}

/// The record of a beam of voxels; beams past the volume replicate its outermost ones.
fn beam(records: &[Record], y: i64) -> Option<&Record> {
    records.get(y.clamp(0, (records.len() as i64 - 1).max(0)) as usize)
}

/// Interpolates a row of rays between the rows that `at` gives for voxel coordinates y and z: each sample as
/// [`super::interpolate::trilinear`] does. Along z and y all of them share their weights, so these interpolations
/// are done once for each column of voxels. `last` gives what the section before has kept of a row: its last
/// voxel, interpolated along z.
fn interpolate_row<I: Iterator<Item = i32>>(
    section: &Section,
    slice: &SampleSlice,
    row: i64,
    columns: Range<i64>,
    line: &mut Vec<i32>,
    at: impl Fn(i64, i64) -> I,
    last: impl Fn(i64) -> Option<i32>,
) -> impl Iterator<Item = i32> {
    let [y, z] = [slice.y.voxel(row), slice.voxel_slice()];
    let along_z = |y| {
        let own = at(y, z).zip(at(y, z + 1)).map(|(a, b)| lerp(a, b, slice.weight_z()));
        last(y).into_iter().chain(own)
    };
    line.clear();
    line.extend(along_z(y).zip(along_z(y + 1)).map(|(a, b)| lerp(a, b, slice.y.weight())));
    let first = section.voxels.start - i64::from(section.continues);
    columns.map(move |column| {
        let x = slice.x.voxel(column) - first;
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
        let section = Section::of(SIZE[0], false).next().unwrap();
        let mut compared = 0;
        for slice in &Plan::new(&frame).slices {
            let z = slice.voxel_slice();
            voxels.load(z - 1..=z + 2).unwrap();
            grid.interpolate(&section, slice, &voxels, &[], true);
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
                let difference = grid.differences[grid.place(column, row)];
                assert_eq!(difference, trilinear(corners(&ends), weights));
                compared += 1;
            }
        }
        assert!(compared > 100, "{compared}");
    }
}
