//! The PCI function: configuration space, capabilities, command register, the MSI-X table's place.

#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::cast_possible_truncation))]

mod capability;
mod command;
mod config;
mod msix;
#[cfg(test)]
mod tests;

pub use capability::id;
pub use command::CommandRegister;
pub use config::{CONFIG_SIZE, ConfigSpace, Effect};
pub use msix::MsixTable;

use vg500_regs::pci as card;

use crate::interrupt::InterruptMode;

/// A base address register of 32 bits, or of 64 bits and prefetchable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bar {
    /// Number of the register, 0 to 5; a wide one takes the next, too.
    pub index: usize,
    /// Size in bytes, a power of two.
    pub size: u64,
    /// Whether it has 64 bits and is prefetchable.
    pub wide: bool,
}

/// What the configuration space tells of the card.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Vendor, also of the subsystem.
    pub vendor: u16,
    /// Device, also of the subsystem.
    pub device: u16,
    /// Revision.
    pub revision: u8,
    /// Class code: base class, sub-class, interface, from bit 23 on.
    pub class: u32,
    /// Base address registers.
    pub bars: Vec<Bar>,
    /// Kinds of interrupt.
    pub mode: InterruptMode,
    /// Interrupt causes.
    pub vectors: u16,
    /// Offset of the MSI-X table, a multiple of 8, with the number of its base address register in bits 2..0.
    pub msix_table: u32,
    /// The same for the MSI-X pending bits.
    pub msix_pending: u32,
}

impl Layout {
    /// The VolumePro 500. `vendor` is one of the two that the lists know it by, and `voxel_memory` one of the
    /// sizes that can be selected.
    #[must_use]
    pub fn vg500(vendor: u16, mode: InterruptMode, voxel_memory: u64) -> Self {
        let bars = card::BARS.iter().filter_map(|bar| {
            let size = if *bar == card::VOXEL_MEMORY { voxel_memory } else { bar.size };
            Some(Bar { index: usize::try_from(bar.index).ok()?, size, wide: bar.wide })
        });
        Self {
            vendor,
            device: card::DEVICE_ID,
            revision: card::REVISION_ID,
            class: card::CLASS_CODE,
            bars: bars.collect(),
            mode,
            vectors: card::VECTORS,
            msix_table: card::MSIX_TABLE_OFFSET | card::REGISTERS.index,
            msix_pending: card::MSIX_PENDING_OFFSET | card::REGISTERS.index,
        }
    }
}
