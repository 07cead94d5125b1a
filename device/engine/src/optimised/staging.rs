//! The voxels around a sample slice, in the working format: they stream through a ring of slices in cache, each
//! read once from voxel memory for a tile.

use super::line::Line;
use super::ranges::Ranges;
use super::simd::{Simd, Square};
use super::volume::{Lines, Volume};
use core::ops::Range;

/// Slices around a sample slice: one before and two behind the voxel slice below.
const WINDOW: usize = 4;

/// A ring of voxel slices.
#[derive(Debug, Default)]
pub struct Staging {
    lines: Vec<Line>,
    /// Where columns of voxels become rows.
    squares: Vec<Square>,
    slots: Vec<Slot>,
    /// The ranges of the voxels of each slot.
    ranges: Vec<Ranges>,
    /// Whether ranges are measured.
    measuring: bool,
    /// Lines of a slot.
    capacity: usize,
}

#[derive(Clone, Debug, Default)]
struct Slot {
    /// The slice that it holds.
    slice: Option<usize>,
    /// The rows of it.
    rows: Range<usize>,
    /// Whether the ranges of its voxels are known.
    measured: bool,
}

impl Staging {
    /// An empty ring for a volume, of slots that hold up to `rows` rows; `around` slices are in use at a time, at most
    /// four: the fewer there are, the nearer to the processor they stay.
    pub fn begin(&mut self, volume: &Volume<'_>, rows: usize, around: usize) {
        let slots = volume.slices_at_once() + around.min(WINDOW) - 1;
        self.slots.clear();
        self.slots.resize(slots, Slot::default());
        self.ranges.resize_with(self.ranges.len().max(slots), Ranges::default);
        self.measuring = false;
        // Odd, so that the same row of all slots does not fall into the same few places of the cache.
        let rows = rows | 1;
        self.capacity = rows;
        if self.lines.len() < slots * rows {
            self.lines.resize(slots * rows, Line::ZERO);
        }
    }

    /// Whether to measure the ranges of the voxels that come in from now on.
    pub const fn measure(&mut self, measuring: bool) {
        self.measuring = measuring;
    }

    /// The ranges of the voxels of a slice that is there, if they were measured.
    #[inline(always)]
    #[must_use]
    pub fn ranges(&self, slice: usize) -> Option<&Ranges> {
        let place = slice % self.slots.len();
        self.slots[place].measured.then(|| &self.ranges[place])
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
            self.slots[place] = Slot { slice: Some(slice), rows: rows.clone(), measured: self.measuring };
        }
        let mut lines = Lines {
            lines: &mut self.lines,
            squares: &mut self.squares,
            capacity: self.capacity,
            slots: self.slots.len(),
            first_slice: slices.start,
            first_slot: slices.start % self.slots.len(),
            first_row: rows.start,
        };
        volume.load(simd, rows.clone(), slices.clone(), &mut lines);
        if self.measuring {
            for slice in slices {
                let place = slice % self.slots.len();
                let lines = &self.lines[place * self.capacity..][..rows.len()];
                self.ranges[place].measure(simd, lines, &rows, volume.size[0]);
            }
        }
    }

    /// The slices around a sample slice: `slices` are one before, below, above and one behind.
    #[inline(always)]
    #[must_use]
    pub fn window(&self, slices: [usize; WINDOW]) -> Window<'_> {
        let [a, b, c, d] = slices;
        Window([self.slice(a), self.slice(b), self.slice(c), self.slice(d)])
    }

    #[inline(always)]
    fn slice(&self, slice: usize) -> Slice<'_> {
        let place = slice % self.slots.len();
        let rows = &self.slots[place].rows;
        let lines = &self.lines[place * self.capacity..][..rows.len()];
        Slice { lines, first: rows.start as i32 }
    }
}

/// Slices around a sample slice.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a>([Slice<'a>; WINDOW]);

/// Rows of a slice.
#[derive(Clone, Copy, Debug)]
struct Slice<'a> {
    lines: &'a [Line],
    first: i32,
}

impl<'a> Window<'a> {
    /// The rows at y and y + 1 of one of the slices. Rows past those that are held are the outermost ones.
    #[inline(always)]
    #[must_use]
    pub fn rows(&self, slice: usize, y: i32) -> [&'a Line; 2] {
        let Slice { lines, first } = self.0[slice];
        let last = lines.len() - 1;
        let at = (y - first).max(0) as usize;
        let next = (y + 1 - first).max(0) as usize;
        [&lines[at.min(last)], &lines[next.min(last)]]
    }
}
