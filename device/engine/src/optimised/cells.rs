//! Cells of a row: what is left out, is left out by cells.

use super::line::{Block, VOXELS};
use super::simd::HALF;
use core::ops::Range;

/// Voxels of a cell.
pub const CELL: usize = HALF;
/// Cells of a row.
pub const CELLS: usize = VOXELS / CELL;

/// Some cells of a row of voxels, or of the samples above them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cells(u8);

impl Cells {
    /// None.
    pub const NONE: Self = Self(0);

    /// Those that `holds` says something of.
    #[inline(always)]
    pub fn of(mut holds: impl FnMut(usize) -> bool) -> Self {
        Self((0..CELLS).fold(0, |cells, cell| cells | u8::from(holds(cell)) << cell))
    }

    /// Those whose bits are set; the first one is the lowest.
    #[inline(always)]
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        Self(bits)
    }

    /// Those that words of a range lie in.
    #[inline(always)]
    #[must_use]
    pub fn covering(range: &Range<usize>) -> Self {
        let end = range.end.div_ceil(CELL).min(CELLS);
        let start = (range.start / CELL).min(end);
        Self(((1u16 << end) - (1 << start)) as u8)
    }

    /// Whether there are none.
    #[inline(always)]
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether a cell is one of them.
    #[inline(always)]
    const fn contains(self, cell: usize) -> bool {
        cell < CELLS && self.0 >> cell & 1 != 0
    }

    /// Those of both.
    #[inline(always)]
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Those of either.
    #[inline(always)]
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Those that `other` lacks.
    #[inline(always)]
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// How many there are.
    #[inline(always)]
    #[must_use]
    pub const fn count(self) -> u32 {
        self.0.count_ones()
    }

    /// With the cells next to them on both sides.
    #[inline(always)]
    #[must_use]
    pub const fn with_neighbours(self) -> Self {
        Self(self.0 | self.0 << 1 | self.0 >> 1)
    }

    /// With the cells behind them.
    #[inline(always)]
    #[must_use]
    pub const fn with_next(self) -> Self {
        Self(self.0 | self.0 << 1)
    }

    /// Blocks of two of these cells each; if their number is odd, the last one has but one.
    #[inline(always)]
    pub const fn blocks(self) -> Blocks {
        Blocks(self)
    }

    /// The first one, taken away.
    #[inline(always)]
    const fn take_first(&mut self) -> Option<usize> {
        if self.is_empty() {
            return None;
        }
        let first = self.0.trailing_zeros();
        self.0 &= self.0 - 1;
        Some(first as usize)
    }

    /// Words of these cells that lie in a range.
    #[inline(always)]
    #[must_use]
    pub fn words_in(self, range: &Range<usize>) -> usize {
        let cells = self.and(Self::covering(range));
        // Cells at both ends may lie in it only in part.
        let before = if cells.contains(range.start / CELL) { range.start % CELL } else { 0 };
        let behind = if cells.contains(range.end / CELL) { CELL - range.end % CELL } else { 0 };
        cells.count() as usize * CELL - before - behind
    }
}

const _: () = assert!(CELLS == 8, "as many bits");

/// Blocks of cells: [`Cells::blocks`].
#[derive(Clone, Debug)]
pub struct Blocks(Cells);

impl Iterator for Blocks {
    type Item = Block;

    #[inline(always)]
    fn next(&mut self) -> Option<Block> {
        let first = self.0.take_first()?;
        Some(Block::of_halves(first, self.0.take_first()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(cells: Cells) -> Vec<usize> {
        (0..CELLS).filter(|&cell| cells.contains(cell)).collect()
    }

    #[test]
    fn ranges_lie_in_cells() {
        for (range, expected) in [
            (0..0, vec![]),
            (0..1, vec![0]),
            (31..33, vec![0, 1]),
            (32..64, vec![1]),
            (40..40, vec![1]),
            (200..300, vec![6, 7]),
            (300..301, vec![]),
        ] {
            let cells = Cells::covering(&range);
            if !range.is_empty() {
                assert_eq!(numbers(cells), expected, "{range:?}");
            }
            assert_eq!(cells.words_in(&range), range.end.min(256).saturating_sub(range.start));
        }
    }

    #[test]
    fn every_set_of_cells() {
        for bits in 0..=u8::MAX {
            let cells = Cells(bits);
            let starts = cells.blocks().flat_map(Block::starts).filter(|start| *start < VOXELS);
            let words: Vec<_> = starts.flat_map(|start| start..start + CELL).collect();
            let expected: Vec<_> = (0..VOXELS).filter(|word| cells.contains(word / CELL)).collect();
            assert_eq!(words, expected);
            assert_eq!(cells.blocks().count(), expected.len().div_ceil(2 * CELL));
            assert_eq!(cells.words_in(&(0..VOXELS)), words.len());
            assert_eq!(
                cells.words_in(&(5..200)),
                words.iter().filter(|word| (5..200).contains(*word)).count()
            );
            for cell in 0..CELLS {
                let near = |distance: i32| {
                    let other = cell as i32 + distance;
                    (0..8).contains(&other) && cells.contains(other as usize)
                };
                assert_eq!(cells.with_neighbours().contains(cell), near(-1) || near(0) || near(1));
                assert_eq!(cells.with_next().contains(cell), near(-1) || near(0));
            }
        }
    }
}
