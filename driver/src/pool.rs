//! A range of addresses, given out in pieces: voxel memory, bus addresses.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use crate::lock;

/// Addresses that are free: first fit, neighbours joined.
#[derive(Debug)]
struct FreeList {
    /// Free pieces in increasing order; no two touch.
    pieces: Vec<Range<u64>>,
    alignment: u64,
}

/// What was wanted, and what there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Exhausted {
    /// Addresses wanted, rounded up to the alignment.
    pub(crate) wanted: u64,
    /// Addresses of the largest free piece.
    pub(crate) largest: u64,
}

/// A pool of addresses that its pieces return to when they are dropped.
#[derive(Clone, Debug)]
pub(crate) struct Pool(Arc<Mutex<FreeList>>);

/// A piece of a pool.
#[derive(Debug)]
pub(crate) struct Piece {
    pool: Pool,
    range: Range<u64>,
}

impl Pool {
    /// A pool of `range`; all pieces begin and end at multiples of `alignment`, as the range does.
    pub(crate) fn new(range: Range<u64>, alignment: u64) -> Self {
        Self(Arc::new(Mutex::new(FreeList { pieces: vec![range], alignment })))
    }

    /// The first free piece of at least `size` addresses.
    pub(crate) fn allocate(&self, size: u64) -> Result<Piece, Exhausted> {
        let range = lock(&self.0).allocate(size)?;
        Ok(Piece { pool: self.clone(), range })
    }

    /// Free addresses in all, and in the largest piece.
    pub(crate) fn free(&self) -> (u64, u64) {
        let list = lock(&self.0);
        (list.pieces.iter().map(size).sum(), list.largest())
    }

    /// Whether a piece is of this pool.
    pub(crate) fn owns(&self, piece: &Piece) -> bool {
        Arc::ptr_eq(&self.0, &piece.pool.0)
    }
}

impl Piece {
    /// The addresses.
    pub(crate) fn range(&self) -> Range<u64> {
        self.range.clone()
    }
}

impl Drop for Piece {
    fn drop(&mut self) {
        lock(&self.pool.0).give_back(self.range.clone());
    }
}

fn size(piece: &Range<u64>) -> u64 {
    piece.end - piece.start
}

impl FreeList {
    fn largest(&self) -> u64 {
        self.pieces.iter().map(size).max().unwrap_or(0)
    }

    fn allocate(&mut self, wanted: u64) -> Result<Range<u64>, Exhausted> {
        let wanted = wanted.max(1).checked_next_multiple_of(self.alignment).unwrap_or(u64::MAX);
        let Some(index) = self.pieces.iter().position(|piece| size(piece) >= wanted) else {
            return Err(Exhausted { wanted, largest: self.largest() });
        };
        let piece = &mut self.pieces[index];
        let range = piece.start..piece.start + wanted;
        piece.start = range.end;
        if piece.is_empty() {
            self.pieces.remove(index);
        }
        Ok(range)
    }

    fn give_back(&mut self, mut range: Range<u64>) {
        let index = self.pieces.partition_point(|piece| piece.end < range.start);
        // At most the piece before and the piece behind touch.
        while let Some(piece) = self.pieces.get(index).filter(|piece| piece.start <= range.end) {
            range = range.start.min(piece.start)..range.end.max(piece.end);
            self.pieces.remove(index);
        }
        self.pieces.insert(index, range);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_exhausted_pool_says_what_is_left() {
        let pool = Pool::new(0..0x8000, 0x1000);
        let pieces: Vec<_> = (0..8).map(|_| pool.allocate(0x1000).unwrap()).collect();
        assert_eq!(pool.allocate(1).unwrap_err(), Exhausted { wanted: 0x1000, largest: 0 });
        let (even, _odd): (Vec<_>, Vec<_>) = pieces.into_iter().partition(|it| it.range.start & 0x1000 == 0);
        drop(even);
        assert_eq!(pool.free(), (0x4000, 0x1000));
        assert_eq!(pool.allocate(0x1001).unwrap_err(), Exhausted { wanted: 0x2000, largest: 0x1000 });
        assert_eq!(pool.allocate(u64::MAX).unwrap_err().wanted, u64::MAX);
    }

    proptest! {
        /// Each step allocates a piece, or drops one of those that are held.
        #[test]
        fn pieces_never_overlap_and_everything_comes_back(
            steps in prop::collection::vec((any::<bool>(), 0u64..0x9000, any::<prop::sample::Index>()), 1..200),
        ) {
            let whole = 0x7000..0x7000 + 0x40000;
            let pool = Pool::new(whole.clone(), 0x1000);
            let mut held: Vec<Piece> = Vec::new();
            for (allocate, wanted, index) in steps {
                if allocate {
                    let (_, largest) = pool.free();
                    match pool.allocate(wanted) {
                        Ok(piece) => held.push(piece),
                        Err(exhausted) => {
                            prop_assert_eq!(exhausted.largest, largest);
                            prop_assert!(exhausted.wanted > largest);
                        }
                    }
                } else if !held.is_empty() {
                    held.swap_remove(index.index(held.len()));
                }
                let mut ranges: Vec<_> = held.iter().map(Piece::range).collect();
                ranges.sort_unstable_by_key(|range| range.start);
                prop_assert!(ranges.windows(2).all(|pair| pair[0].end <= pair[1].start));
                prop_assert!(ranges.iter().all(|it| whole.start <= it.start && it.end <= whole.end));
                prop_assert!(ranges.iter().all(|it| it.start % 0x1000 == 0 && it.end % 0x1000 == 0));
                let used: u64 = ranges.iter().map(size).sum();
                prop_assert_eq!(pool.free().0 + used, size(&whole));
            }
            held.clear();
            prop_assert_eq!(pool.free(), (size(&whole), size(&whole)));
        }
    }
}
