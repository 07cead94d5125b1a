//! A row of the volume in the working format of the kernels.

use super::simd::{MOST_LANES, Simd};
use core::ops::Range;
use vg500_regs::limit::VOLUME_SIZE;

/// Words before the first and behind the last voxel: a whole vector, so that edges need no case of their own.
const MARGIN: usize = MOST_LANES;
/// Words between the margins.
pub const VOXELS: usize = VOLUME_SIZE as usize;

/// A row of up to 256 words with a margin on both sides. Word 0 lies at the beginning of a cache line.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct Line([u16; MARGIN + VOXELS + MARGIN]);

/// Where a vector lies in a line: a multiple of its lanes, and wholly inside of the 256 words.
#[derive(Clone, Copy, Debug)]
pub struct Block(usize);

impl Block {
    /// First word of the vector.
    #[inline(always)]
    #[must_use]
    pub const fn start(self) -> usize {
        self.0
    }
}

impl Line {
    /// A line of zeros.
    pub const ZERO: Self = Self([0; MARGIN + VOXELS + MARGIN]);

    /// The blocks of `lanes` words that cover the words `range`.
    #[inline(always)]
    pub fn blocks(range: Range<usize>, lanes: usize) -> impl ExactSizeIterator<Item = Block> + Clone {
        let first = range.start / lanes;
        let end = if range.is_empty() { first } else { range.end.min(VOXELS).div_ceil(lanes) };
        (first..end).map(move |block| Block(block * lanes))
    }

    /// The words of a block.
    #[inline(always)]
    pub fn load<S: Simd>(&self, simd: S, block: Block) -> S::Words {
        // SAFETY: a block lies inside of the line.
        unsafe { simd.load(self.0.as_ptr().add(MARGIN + block.0)) }
    }

    /// The words one before those of a block.
    #[inline(always)]
    pub fn load_before<S: Simd>(&self, simd: S, block: Block) -> S::Words {
        // SAFETY: a block lies inside of the line, and there is a margin before it.
        unsafe { simd.load(self.0.as_ptr().add(MARGIN + block.0 - 1)) }
    }

    /// The words one behind those of a block.
    #[inline(always)]
    pub fn load_behind<S: Simd>(&self, simd: S, block: Block) -> S::Words {
        // SAFETY: a block lies inside of the line, and there is a margin behind it.
        unsafe { simd.load(self.0.as_ptr().add(MARGIN + block.0 + 1)) }
    }

    /// Writes the words of a block.
    #[inline(always)]
    pub fn store<S: Simd>(&mut self, simd: S, block: Block, words: S::Words) {
        // SAFETY: a block lies inside of the line, which is borrowed for writing.
        unsafe { simd.store(self.0.as_mut_ptr().add(MARGIN + block.0), words) }
    }

    /// Writes 16 words at a multiple of 16.
    #[inline(always)]
    pub fn store_16(&mut self, start: usize, words: &[u16; 16]) {
        if let Some(place) = self.0[MARGIN..].as_chunks_mut::<16>().0.get_mut(start / 16) {
            *place = *words;
        }
    }

    /// A word at -1..=256; 0 beyond the margins.
    #[inline(always)]
    #[must_use]
    pub fn get(&self, place: isize) -> u16 {
        self.0.get(place.wrapping_add_unsigned(MARGIN).cast_unsigned()).copied().unwrap_or(0)
    }

    /// Writes a word at -1..=257.
    #[inline(always)]
    pub fn set(&mut self, place: isize, word: u16) {
        if let Some(at) = self.0.get_mut(place.wrapping_add_unsigned(MARGIN).cast_unsigned()) {
            *at = word;
        }
    }

    /// Replicates the outermost of `voxels` words, one before and two behind.
    #[inline(always)]
    pub fn replicate_ends(&mut self, voxels: usize) {
        self.set(-1, self.get(0));
        let end = voxels.cast_signed();
        let last = self.get(end - 1);
        self.set(end, last);
        self.set(end + 1, last);
    }

    /// The words from 0 on.
    #[inline(always)]
    #[must_use]
    pub fn words(&self) -> &[u16] {
        &self.0[MARGIN..MARGIN + VOXELS]
    }

    /// The words from 0 on, to be filled.
    #[inline(always)]
    pub fn words_mut(&mut self) -> &mut [u16] {
        &mut self.0[MARGIN..MARGIN + VOXELS]
    }
}
