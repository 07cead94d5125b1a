//! The mapped memories of the card.

use std::io;
use std::sync::Arc;

use vg500_regs::pci::{PIXEL_MEMORY, SECTION_MEMORY, TABLE_MEMORY, VOXEL_MEMORY};

use crate::backing::Backing;

/// Table, voxel, pixel and section memory. A clone is of the same memory.
#[derive(Clone, Debug)]
pub(super) struct Memories {
    pub(super) table: Arc<Backing>,
    pub(super) voxel: Arc<Backing>,
    pub(super) pixel: Arc<Backing>,
    pub(super) section: Arc<Backing>,
}

impl Memories {
    /// Zeroed memories; pages are taken from the system when they are touched.
    ///
    /// # Errors
    ///
    /// If the system has no address space or descriptors left.
    pub(super) fn new(voxel_memory: u64) -> io::Result<Self> {
        let backing = |name, size| Backing::new(name, size).map(Arc::new);
        Ok(Self {
            table: backing("vg500-table", TABLE_MEMORY.size)?,
            voxel: backing("vg500-voxel", voxel_memory)?,
            pixel: backing("vg500-pixel", PIXEL_MEMORY.size)?,
            section: backing("vg500-section", SECTION_MEMORY.size)?,
        })
    }

    /// The memory behind a base address register.
    pub(super) fn behind(&self, bar: u32) -> Option<&Arc<Backing>> {
        [
            (TABLE_MEMORY, &self.table),
            (VOXEL_MEMORY, &self.voxel),
            (PIXEL_MEMORY, &self.pixel),
            (SECTION_MEMORY, &self.section),
        ]
        .into_iter()
        .find_map(|(it, memory)| (it.index == bar).then_some(memory))
    }

    /// Memories for the next client. They are new ones, because the last client may have kept its mappings of
    /// these. If the system has none to give these are cleared, so that at least nothing leaks.
    pub(super) fn renew(&mut self) {
        match Self::new(self.voxel.size()) {
            Ok(fresh) => *self = fresh,
            Err(error) => {
                tracing::warn!("the card's memories are cleared, not replaced: {error}");
                self.clear();
            }
        }
    }

    fn clear(&self) {
        for memory in [&self.table, &self.voxel, &self.pixel, &self.section] {
            if memory.clear().is_err() {
                // Every byte is inside, so this cannot fail.
                _ = memory.view().clear(0, memory.view().size());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_client_gets_zeros_that_the_last_one_cannot_reach() {
        let mut memories = Memories::new(VOXEL_MEMORY.size).unwrap();
        let kept = memories.clone();
        kept.voxel.view().write(12345, &[1]).unwrap();
        memories.renew();
        kept.pixel.view().write(0, &[2]).unwrap();
        let mut byte = [9];
        memories.voxel.view().read(12345, &mut byte).unwrap();
        assert_eq!(byte, [0]);
        memories.pixel.view().read(0, &mut byte).unwrap();
        assert_eq!(byte, [0]);
        kept.clear();
        kept.pixel.view().read(0, &mut byte).unwrap();
        assert_eq!(byte, [0]);
    }

    #[test]
    fn registers_and_second_halves_have_no_memory() {
        let memories = Memories::new(VOXEL_MEMORY.size).unwrap();
        let found: Vec<_> = (0..9).filter(|&bar| memories.behind(bar).is_some()).collect();
        assert_eq!(found, [1, 2, 4, 5]);
    }
}
