//! Sectioning (paper, section 5.4): the volume is traversed in sections along permuted x, each of them slice by
//! slice from front to back.
//!
//! A cell is named by its lower voxel. Its sample is interpolated as its upper voxel arrives, and finished (shaded
//! and composited) as the sample after it arrives, which its x gradient needs. So a section that ends before voxel
//! `end` interpolates up to cell `end - 2` and finishes up to cell `end - 3`; the next one goes on with what section
//! memory has kept.

use super::composite::Ray;
use super::gradient::voxel_difference;
use super::interpolate::{guard, lerp};
use super::sample::SampleGrid;
use crate::memory::section::Record;
use crate::memory::voxel::VoxelSlices;
use crate::plan::{SampleSlice, SliceAxis};
use core::ops::Range;
use vg500_regs::limit::SECTION_WIDTH;

/// One traversal of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// Voxels along permuted x that it reads.
    pub voxels: Range<i64>,
    /// Whether it goes on with the records of a section before it.
    pub continues: bool,
    /// Whether it leaves records to another one.
    pub continued: bool,
}

impl Section {
    /// The traversals of a volume of `width` voxels along permuted x, from left to right: sections, or a single one.
    pub fn of(width: u32, sections: bool) -> impl Iterator<Item = Self> {
        let step = if sections { SECTION_WIDTH } else { width };
        (0..width).step_by(step as usize).map(move |start| {
            let end = width.min(start + step);
            Self { voxels: start.into()..end.into(), continues: start > 0, continued: end < width }
        })
    }

    /// Columns of rays whose samples it interpolates; what lies beside the volume belongs to the outermost sections.
    #[must_use]
    pub fn interpolated(&self, axis: &SliceAxis) -> Range<i64> {
        self.columns(axis, 1)
    }

    /// Columns of rays whose samples it finishes.
    #[must_use]
    pub fn finished(&self, axis: &SliceAxis) -> Range<u32> {
        let own = self.columns(axis, 2);
        let [first, last] = [axis.rays.start, axis.rays.end].map(i64::from);
        own.start.clamp(first, last) as u32..own.end.clamp(first, last) as u32
    }

    /// Columns of the last sample that the section before has interpolated, and of the last that it has finished.
    #[must_use]
    pub fn carried(&self, axis: &SliceAxis) -> Option<[i64; 2]> {
        self.continues.then(|| last_columns(self.voxels.start, axis))
    }

    /// Columns whose cells end up to `behind` cells behind the section's voxels.
    fn columns(&self, axis: &SliceAxis, behind: i64) -> Range<i64> {
        let start = if self.continues { self.voxels.start - behind - axis.voxel(0) } else { i64::MIN };
        let end = if self.continued { self.voxels.end - behind - axis.voxel(0) } else { i64::MAX };
        start..end
    }

    /// Rays that come over from the section before: those of the last samples that it has finished on a slice,
    /// each with its beam of voxels.
    pub fn entering(&self, slice: &SampleSlice) -> impl Iterator<Item = ([u32; 2], usize)> {
        self.continues.then(|| finished_last(self.voxels.start, slice)).into_iter().flatten()
    }

    /// Rays that go over to the next section, likewise.
    pub fn leaving(&self, slice: &SampleSlice) -> impl Iterator<Item = ([u32; 2], usize)> {
        self.continued.then(|| finished_last(self.voxels.end, slice)).into_iter().flatten()
    }

    /// What the section leaves of a sample slice, for each beam of voxels. `ray` gives the accumulators of a ray.
    pub fn spill(
        &self,
        slice: &SampleSlice,
        voxels: &VoxelSlices<'_>,
        samples: &SampleGrid,
        gradients: bool,
        ray: impl Fn([u32; 2]) -> Ray,
    ) -> Vec<Record> {
        let mut records: Vec<Record> =
            (0..voxels.rows()).map(|y| self.last_voxel(slice, voxels, y, gradients)).collect();
        let [last, before] = last_columns(self.voxels.end, &slice.x);
        for (row, beam) in beams(slice) {
            let sample = |column| if samples.contains(column) { samples.at(column, row.into()) } else { 0 };
            records[beam].sample = sample(last);
            records[beam].before = sample(before);
            if gradients && samples.contains(last) {
                records[beam].gradient = samples.gradient_across(last, row.into());
            }
        }
        for (place, beam) in self.leaving(slice) {
            records[beam].ray = ray(place);
        }
        records
    }

    /// A beam's last voxel and its difference, interpolated along z.
    fn last_voxel(&self, slice: &SampleSlice, voxels: &VoxelSlices<'_>, y: i64, gradients: bool) -> Record {
        let last = (self.voxels.end - self.voxels.start - 1) as usize;
        let voxel = |z| voxels.row(y, z)[last];
        let z = slice.voxel_slice();
        let along_z = |at: &dyn Fn(i64) -> i32| lerp(at(z), at(z + 1), slice.weight_z());
        let difference = || along_z(&|z| voxel_difference(voxel(z - 1), voxel(z + 1)));
        Record {
            voxel: along_z(&|z| guard(voxel(z))),
            difference: if gradients { difference() } else { 0 },
            ..Record::default()
        }
    }
}

/// Rows of rays that have samples on a slice, each with its beam of voxels: that below the samples, which lies in
/// the volume because they do.
fn beams(slice: &SampleSlice) -> impl Iterator<Item = (u32, usize)> {
    slice.y.rays.clone().map(|row| (row, slice.y.voxel(row.into()) as usize))
}

/// Columns of the last two samples before a boundary: of the one interpolated last, and of the one finished last.
const fn last_columns(end: i64, axis: &SliceAxis) -> [i64; 2] {
    [end - 2 - axis.voxel(0), end - 3 - axis.voxel(0)]
}

/// Rays of the samples that are finished last before a boundary, with their beams.
fn finished_last(end: i64, slice: &SampleSlice) -> impl Iterator<Item = ([u32; 2], usize)> {
    let [_, before] = last_columns(end, &slice.x);
    let column = u32::try_from(before).ok().filter(|column| slice.x.rays.contains(column));
    column.into_iter().flat_map(|column| beams(slice).map(move |(row, beam)| ([column, row], beam)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_cover_the_volume_once() {
        let of = |width| -> Vec<_> {
            Section::of(width, true).map(|it| (it.voxels, it.continues, it.continued)).collect()
        };
        assert_eq!(of(1), [(0..1, false, false)]);
        assert_eq!(of(32), [(0..32, false, false)]);
        assert_eq!(of(33), [(0..32, false, true), (32..33, true, false)]);
        assert_eq!(of(256).len(), 8);
        let whole: Vec<_> = Section::of(256, false).collect();
        assert_eq!(whole, [Section { voxels: 0..256, continues: false, continued: false }]);
    }

    /// Every ray with a sample is finished by one section, and the sections before and after it agree on who waits.
    #[test]
    fn columns_are_finished_once_and_in_order() {
        for offset in [-40_000, -8192, -257, -256, -1, 0, 1, 255, 256, 700, 20_000] {
            let axis = SliceAxis { offset, rays: 3..200 };
            let sections: Vec<_> = Section::of(100, true).collect();
            let finished: Vec<u32> = sections.iter().flat_map(|section| section.finished(&axis)).collect();
            assert_eq!(finished, (3..200).collect::<Vec<_>>(), "{offset}");
            for pair in sections.windows(2) {
                let [last, before] = pair[1].carried(&axis).unwrap();
                assert_eq!((pair[0].interpolated(&axis).end - 1, before), (last, last - 1), "{offset}");
                assert_eq!(pair[1].interpolated(&axis).start, last + 1);
                if let Some(column) = pair[0].finished(&axis).last().filter(|_| (4..199).contains(&before)) {
                    assert_eq!(i64::from(column), before, "{offset}");
                }
            }
        }
    }
}
