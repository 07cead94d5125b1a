//! Which samples of a slice are worth computing, cell by cell.

use super::accumulators::Accumulators;
use super::cells::{CELL, CELLS, Cells};
use super::finished::Finished;
use super::lanes::composite;
use super::line::Line;
use super::omissions::Omissions;
use super::ranges::{Extremes, ROWS};
use super::simd::Simd;
use super::staging::Staging;
use super::visible::Seen;
use crate::render::LeftOut;
use core::ops::Range;
use vg500_regs::BlendMode;

/// The decisions of a tile on a slice, and how much they left out so far.
#[derive(Debug, Default)]
pub struct Decisions {
    /// The cells of each row of rays of the tile that are worth computing.
    rows: Vec<Cells>,
    /// The rows that have samples on the slice.
    here: Range<usize>,
    /// The words of samples.
    span: Range<usize>,
    /// The cells that hold any.
    all: Cells,
    thrift: Thrift,
    /// How much was left out.
    pub left_out: LeftOut,
}

/// Stops a test that finds little for a while.
#[derive(Clone, Copy, Debug, Default)]
struct Thrift {
    /// Slices in a row with little to leave out.
    vain: u32,
    /// Slices to go without the test.
    pause: u32,
}

/// When a test is worth it.
struct Worth {
    /// If it leaves one cell in so many out.
    one_in: u32,
    /// Slices with less than that until it stops.
    patience: u32,
    /// Slices until it is tried again.
    pause: u32,
}

/// The test costs a few per cent of unlit samples.
const OF_EMPTY: Worth = Worth { one_in: 16, patience: 4, pause: 28 };
/// Samples of MIP and MinIP cost little more than the test.
const OF_BEATEN: Worth = Worth { one_in: 2, patience: 2, pause: 62 };

impl Thrift {
    /// Whether to test on this slice.
    const fn due(&mut self) -> bool {
        self.pause = self.pause.saturating_sub(1);
        self.pause == 0
    }

    /// A test left `left_out` of `tested` cells out.
    const fn note(&mut self, tested: u32, left_out: u32, worth: &Worth) {
        self.vain = if worth.one_in * left_out < tested { self.vain + 1 } else { 0 };
        if self.vain == worth.patience {
            (self.vain, self.pause) = (0, worth.pause);
        }
    }
}

impl Decisions {
    /// Begins a tile of `rows` rows.
    pub fn begin_tile(&mut self, rows: usize) {
        self.rows.clear();
        self.rows.resize(rows, Cells::NONE);
        self.here = 0..0;
        self.left_out = LeftOut::default();
        self.thrift = Thrift::default();
    }

    /// Begins a slice on which some rows have samples above the voxels `span`.
    pub fn begin(&mut self, here: Range<usize>, span: &Range<usize>) {
        self.rows[self.here.clone()].fill(Cells::NONE);
        self.all = Cells::covering(span);
        self.left_out.blocks += u64::from(self.all.count()) * here.len() as u64;
        self.rows[here.clone()].fill(self.all);
        (self.here, self.span) = (here, span.clone());
    }

    /// The cells of a row that are worth computing; none beyond the tile.
    #[inline(always)]
    #[must_use]
    pub fn row(&self, row: i32) -> Cells {
        usize::try_from(row).ok().and_then(|row| self.rows.get(row)).copied().unwrap_or(Cells::NONE)
    }

    /// Whether nothing on the slice is worth computing.
    #[must_use]
    pub fn nothing(&self) -> bool {
        self.rows[self.here.clone()].iter().all(|cells| cells.is_empty())
    }

    /// Keeps some cells of a row; returns the samples left out.
    #[inline(always)]
    fn keep(&mut self, row: usize, cells: Cells) -> u64 {
        let kept = self.rows[row].and(cells);
        let gone = self.rows[row].without(kept).and(self.all);
        self.rows[row] = kept;
        if gone.is_empty() {
            return 0;
        }
        self.left_out.blocks_left_out += u64::from(gone.count());
        gone.words_in(&self.span) as u64
    }

    /// Leaves out what of a row cannot be seen.
    pub fn hide(&mut self, row: usize, seen: &Seen, factors: &Line) {
        let cells = match seen {
            Seen::All => return,
            Seen::None => Cells::NONE,
            Seen::Factors => {
                let (words, _) = factors.words().as_chunks::<CELL>();
                Cells::of(|cell| words[cell].iter().any(|&factor| factor != 0))
            }
        };
        self.left_out.hidden += self.keep(row, cells);
    }

    /// Leaves out the cells of which all rays are finished; `first` is the voxel of the ray in column 0.
    #[inline(always)]
    pub fn finish(&mut self, finished: &Finished, first: i32) {
        for row in self.here.clone() {
            if finished.any(row) && !self.rows[row].is_empty() {
                let alive = self.rows[row].without(finished.cells(row, first));
                self.left_out.finished += self.keep(row, alive);
            }
        }
    }

    /// Whether the ranges of the voxels that come in are of use.
    pub fn wants_ranges(&mut self, omissions: &Omissions) -> bool {
        (omissions.empty.is_some() || omissions.beaten) && self.thrift.due()
    }

    /// Leaves out the cells between whose voxels no value can be seen, or is a new extreme. `voxels` are the slices
    /// below and above; the ray in column 0 of row 0 has its sample above the voxel of the first column and row.
    #[inline(always)]
    pub fn empty<S: Simd>(
        &mut self,
        simd: S,
        omissions: &Omissions,
        voxels: [usize; 2],
        staging: &Staging,
        (first_column, first_row): (i32, i32),
        (blend, accumulators): (BlendMode, &mut Accumulators),
    ) {
        let mut tested = 0;
        let before = self.left_out.blocks_left_out;
        let mut block = usize::MAX;
        let mut extremes = [[0; 2]; CELLS];
        let mut occupied = Cells::NONE;
        for row in self.here.clone() {
            if self.rows[row].is_empty() {
                continue;
            }
            let voxel_y = (row as i32 + first_row).max(0) as usize;
            if voxel_y / ROWS != block {
                block = voxel_y / ROWS;
                let Some(measured) = around(staging, voxels, voxel_y) else { return };
                extremes = measured;
                occupied = match &omissions.empty {
                    Some(opaque) => Cells::of(|cell| opaque.any(extremes[cell])),
                    None => Cells::covering(&self.span),
                };
            }
            let cells = match &omissions.empty {
                Some(_) => occupied,
                None => unbeaten(simd, blend, (accumulators, row, first_column), &extremes, self.rows[row]),
            };
            tested += self.rows[row].count();
            self.left_out.empty += self.keep(row, cells);
        }
        let worth = if omissions.beaten { &OF_BEATEN } else { &OF_EMPTY };
        self.thrift.note(tested, (self.left_out.blocks_left_out - before) as u32, worth);
    }
}

/// The extremes of the cells of the blocks that a row of samples lies in, if both slices were measured.
fn around(staging: &Staging, slices: [usize; 2], row: usize) -> Option<[Extremes; CELLS]> {
    let [below, above] = [staging.ranges(slices[0])?.at(row)?, staging.ranges(slices[1])?.at(row)?];
    Some(core::array::from_fn(|cell| {
        [below[cell][0].min(above[cell][0]), below[cell][1].max(above[cell][1])]
    }))
}

/// The cells whose extremes beat those of any of their rays.
#[inline(always)]
fn unbeaten<S: Simd>(
    simd: S,
    blend: BlendMode,
    (accumulators, row, first): (&mut Accumulators, usize, i32),
    extremes: &[Extremes; CELLS],
    cells: Cells,
) -> Cells {
    let rays = accumulators.row(row, first);
    let best = extremes.map(|[least, greatest]| if blend == BlendMode::Minimum { least } else { greatest });
    let mut kept = 0;
    for block in cells.blocks() {
        let both = block.starts().map(|start| start / CELL);
        let best = both.map(|cell| best.get(cell).map_or(0, |best| best.cast_signed()));
        let beaten = simd.bits(composite::beats(simd, blend, &rays, block, simd.halves(best)));
        for (cell, lanes) in both.into_iter().zip([beaten as u32, (beaten >> 32) as u32]) {
            kept |= u16::from(lanes != 0) << cell;
        }
    }
    // A half behind the last cell is none.
    Cells::from_bits(kept as u8)
}
