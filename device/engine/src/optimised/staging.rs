//! The voxels around a sample slice, in the working format: they stream through a ring of slices in cache, each
//! read once from voxel memory for a tile.

use super::line::Line;
use super::simd::Simd;
use super::volume::{Lines, Volume};
use core::ops::Range;

/// Slices around a sample slice: one before and two behind the voxel slice below.
const WINDOW: usize = 4;

/// A ring of voxel slices.
#[derive(Debug, Default)]
pub struct Staging {
    lines: Vec<Line>,
    slots: Vec<Slot>,
    /// Lines of a slot.
    capacity: usize,
}

#[derive(Clone, Debug, Default)]
struct Slot {
    /// The slice that it holds.
    slice: Option<usize>,
    /// The rows of it.
    rows: Range<usize>,
}

impl Staging {
    /// An empty ring for a volume, of slots that hold up to `rows` rows.
    pub fn begin(&mut self, volume: &Volume<'_>, rows: usize) {
        let slots = volume.slices_at_once() + WINDOW - 1;
        self.slots.clear();
        self.slots.resize(slots, Slot::default());
        self.capacity = rows;
        if self.lines.len() < slots * rows {
            self.lines.resize(slots * rows, Line::ZERO);
        }
    }

    /// Brings a slice in, unless it is there, with those that come along with it. `rows` tells the rows that are
    /// needed of a slice as long as it is in use.
    #[inline(always)]
    pub fn require<S: Simd>(
        &mut self,
        simd: S,
        volume: &Volume<'_>,
        slice: usize,
        rows: impl Fn(usize) -> Range<usize>,
    ) {
        if self.slots[slice % self.slots.len()].slice != Some(slice) {
            self.bring(simd, volume, slice, rows);
        }
    }

    /// Brings a slice in.
    #[inline(always)]
    fn bring<S: Simd>(
        &mut self,
        simd: S,
        volume: &Volume<'_>,
        slice: usize,
        rows: impl Fn(usize) -> Range<usize>,
    ) {
        let slices = volume.slices_with(slice);
        let needed = slices.clone().map(rows).filter(|rows| !rows.is_empty());
        let Some(rows) = needed.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end)) else { return };
        let rows = rows.start..rows.end.min(rows.start + self.capacity);
        for slice in slices.clone() {
            let place = slice % self.slots.len();
            self.slots[place] = Slot { slice: Some(slice), rows: rows.clone() };
        }
        let mut lines = Lines {
            lines: &mut self.lines,
            capacity: self.capacity,
            slots: self.slots.len(),
            first_row: rows.start,
        };
        volume.load(simd, rows, slices, &mut lines);
    }

    /// The row at y of a slice. Rows past those that it holds are the outermost ones.
    #[inline(always)]
    #[must_use]
    pub fn row(&self, y: i32, slice: usize) -> &Line {
        let place = slice % self.slots.len();
        let Range { start, end } = self.slots[place].rows;
        let row = (y.max(0).cast_unsigned() as usize).clamp(start, end.max(start + 1) - 1) - start;
        &self.lines[place * self.capacity + row]
    }
}
