//! The capabilities of the card: one table, from which list, contents and write masks follow.

use super::Layout;
use crate::interrupt::InterruptMode;

/// Identifiers of capabilities.
pub mod id {
    /// Power management.
    pub const POWER_MANAGEMENT: u8 = 0x01;
    /// Message-signalled interrupts.
    pub const MSI: u8 = 0x05;
    /// PCI Express.
    pub const EXPRESS: u8 = 0x10;
    /// Message-signalled interrupts with a table.
    pub const MSIX: u8 = 0x11;
}

/// Power management: offset of the control and status register.
pub(super) const PM_CONTROL: usize = 4;
/// PCI Express: offset of the device control register.
pub(super) const DEVICE_CONTROL: usize = 8;
/// Device control: Initiate Function Level Reset. Reads as zero.
pub(super) const INITIATE_RESET: u16 = 1 << 15;

/// A register of a capability. All others are zero.
#[derive(Clone, Copy, Debug)]
pub(super) struct Word {
    /// Offset in the capability, in bytes.
    pub(super) offset: usize,
    /// Width in bytes, 1, 2 or 4.
    pub(super) width: usize,
    /// Value after reset.
    pub(super) value: u32,
    /// Bits that can be written.
    pub(super) writable: u32,
}

/// One capability: an identifier, and the registers after it.
#[derive(Clone, Debug)]
pub(super) struct Capability {
    pub(super) id: u8,
    pub(super) size: usize,
    pub(super) words: Vec<Word>,
}

const fn word16(offset: usize, value: u32, writable: u32) -> Word {
    Word { offset, width: 2, value, writable }
}

const fn word32(offset: usize, value: u32, writable: u32) -> Word {
    Word { offset, width: 4, value, writable }
}

/// The capabilities of an interrupt mode, in the order of the list.
pub(super) fn table(layout: &Layout) -> Vec<Capability> {
    let power = Some(power_management());
    let msix = (layout.mode == InterruptMode::Msix).then(|| msix(layout));
    let msi = (layout.mode != InterruptMode::Intx).then(|| msi(layout));
    [power, msix, msi, Some(express())].into_iter().flatten().collect()
}

/// Version 3. The card keeps its state in D3hot (No_Soft_Reset); D1 and D2 do not exist.
fn power_management() -> Capability {
    let words = vec![word16(2, 0x0003, 0), word16(PM_CONTROL, 1 << 3, 0b11)];
    Capability { id: id::POWER_MANAGEMENT, size: 8, words }
}

/// Enable and Function Mask are storage: the client's event descriptors decide.
fn msix(layout: &Layout) -> Capability {
    let words = vec![
        word16(2, u32::from(layout.vectors.saturating_sub(1)), 0xc000),
        word32(4, layout.msix_table, 0),
        word32(8, layout.msix_pending, 0),
    ];
    Capability { id: id::MSIX, size: 12, words }
}

/// 64-bit addresses, as many messages as there are causes (a power of two). Storage, as for MSI-X.
fn msi(layout: &Layout) -> Capability {
    let messages = layout.vectors.max(1).next_power_of_two().ilog2();
    let words = vec![
        word16(2, 1 << 7 | messages << 1, 0b111 << 4 | 1),
        word32(4, 0, 0xffff_fffc),
        word32(8, 0, 0xffff_ffff),
        word16(12, 0, 0xffff),
    ];
    Capability { id: id::MSI, size: 16, words }
}

/// Version 2, endpoint. A card of 1999 has no link; 2.5 GT/s by one lane is the least there is.
fn express() -> Capability {
    const ROLE_BASED_ERRORS: u32 = 1 << 15;
    const FUNCTION_LEVEL_RESET: u32 = 1 << 28;
    const RELAXED_ORDERING: u32 = 1 << 4;
    const NO_SNOOP: u32 = 1 << 11;
    const READ_REQUEST_512: u32 = 2 << 12;
    const LINK: u32 = 1 << 4 | 1;
    let words = vec![
        word16(2, 2, 0),
        word32(4, ROLE_BASED_ERRORS | FUNCTION_LEVEL_RESET, 0),
        // The reset bit is taken out of what is written before it is stored.
        word16(DEVICE_CONTROL, RELAXED_ORDERING | NO_SNOOP | READ_REQUEST_512, 0xffff),
        word32(12, LINK, 0),
        word16(16, 0, 0x00c3),
        word16(18, LINK, 0),
        word16(44, 1, 0),
    ];
    Capability { id: id::EXPRESS, size: 60, words }
}
