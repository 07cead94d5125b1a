//! A row of the volume in the working format of the kernels.

use super::simd::{HALF, LANES, Simd};
use vg500_regs::limit::VOLUME_SIZE;

/// Words before the first and behind the last voxel: a whole vector, so that edges need no case of their own.
const MARGIN: usize = LANES;
/// Words between the margins.
pub const VOXELS: usize = VOLUME_SIZE as usize;

/// A row of up to 256 words with a margin on both sides. Word 0 lies at the beginning of a cache line.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct Line([u16; MARGIN + VOXELS + MARGIN]);

/// Where the halves of a vector lie in a line: at multiples of their length, and inside of the 256 words or at their
/// end.
#[derive(Clone, Copy, Debug)]
pub struct Block([usize; 2]);

impl Block {
    /// The halves of these numbers. Where there is no second one, or no such half in a line, it lies behind the words.
    #[inline(always)]
    #[must_use]
    pub fn of_halves(first: usize, second: Option<usize>) -> Self {
        const BEHIND: usize = VOXELS / HALF;
        Self([first, second.unwrap_or(BEHIND)].map(|half| half.min(BEHIND) * HALF))
    }

    /// Those next to each other that cover the first `words` of a line.
    #[inline(always)]
    pub fn covering(words: usize) -> impl Iterator<Item = Self> {
        (0..words.min(VOXELS).div_ceil(LANES)).map(|block| Self([block * LANES, block * LANES + HALF]))
    }

    /// How many of the words are a line's.
    #[inline(always)]
    #[must_use]
    pub fn words(self) -> usize {
        self.0.into_iter().filter(|start| *start < VOXELS).count() * HALF
    }

    /// First words of the halves.
    #[inline(always)]
    #[must_use]
    pub const fn starts(self) -> [usize; 2] {
        self.0
    }
}

impl Line {
    /// A line of zeros.
    pub const ZERO: Self = Self([0; MARGIN + VOXELS + MARGIN]);

    /// The words of a block.
    #[inline(always)]
    pub fn load<S: Simd>(&self, simd: S, block: Block) -> S::Words {
        // SAFETY: there is a margin of two halves behind the words.
        unsafe { simd.load(block.0.map(|start| self.0.as_ptr().add(MARGIN + start))) }
    }

    /// The words one before those of a block.
    #[inline(always)]
    pub fn load_before<S: Simd>(&self, simd: S, block: Block) -> S::Words {
        // SAFETY: as above, and there is a margin before the words.
        unsafe { simd.load(block.0.map(|start| self.0.as_ptr().add(MARGIN + start - 1))) }
    }

    /// The words one behind those of a block.
    #[inline(always)]
    pub fn load_behind<S: Simd>(&self, simd: S, block: Block) -> S::Words {
        // SAFETY: there is a margin of two halves behind the words.
        unsafe { simd.load(block.0.map(|start| self.0.as_ptr().add(MARGIN + start + 1))) }
    }

    /// Writes the words of a block.
    #[inline(always)]
    pub fn store<S: Simd>(&mut self, simd: S, block: Block, words: S::Words) {
        // SAFETY: as above; the line is borrowed for writing.
        unsafe { simd.store(block.0.map(|start| self.0.as_mut_ptr().add(MARGIN + start)), words) }
    }

    /// Writes the words of half a vector at a multiple of as many.
    #[inline(always)]
    pub fn store_half(&mut self, start: usize, words: &[u16; HALF]) {
        if let Some(place) = self.0[MARGIN..].as_chunks_mut::<HALF>().0.get_mut(start / HALF) {
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
