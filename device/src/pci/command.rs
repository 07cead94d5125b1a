//! The command register, which the rest of the device obeys.

use std::sync::atomic::{AtomicU16, Ordering};

/// The PCI command register: written through the configuration space, read wherever it has an effect.
#[derive(Debug, Default)]
pub struct CommandRegister(AtomicU16);

impl CommandRegister {
    /// Memory Space Enable: base address registers answer.
    pub const MEMORY_SPACE: u16 = 1 << 1;
    /// Bus Master Enable: DMA, MSI and MSI-X leave the device.
    pub const BUS_MASTER: u16 = 1 << 2;
    /// Parity Error Response; storage only.
    pub const PARITY_ERROR_RESPONSE: u16 = 1 << 6;
    /// SERR# Enable; storage only.
    pub const SERR: u16 = 1 << 8;
    /// Interrupt Disable: the interrupt line stays silent.
    pub const INTERRUPT_DISABLE: u16 = 1 << 10;
    /// Bits that can be written. There is no I/O space.
    pub const WRITABLE: u16 = Self::MEMORY_SPACE
        | Self::BUS_MASTER
        | Self::PARITY_ERROR_RESPONSE
        | Self::SERR
        | Self::INTERRUPT_DISABLE;

    /// Whether accesses to the base address registers are enabled.
    #[must_use]
    pub fn memory_space(&self) -> bool {
        self.has(Self::MEMORY_SPACE)
    }

    /// Whether the device may access memory and send message-signalled interrupts.
    #[must_use]
    pub fn bus_master(&self) -> bool {
        self.has(Self::BUS_MASTER)
    }

    /// Whether the interrupt line is switched off.
    #[must_use]
    pub fn interrupt_disable(&self) -> bool {
        self.has(Self::INTERRUPT_DISABLE)
    }

    /// Takes the writable bits of `value`.
    pub fn set(&self, value: u16) {
        self.0.store(value & Self::WRITABLE, Ordering::SeqCst);
    }

    fn has(&self, bit: u16) -> bool {
        self.0.load(Ordering::SeqCst) & bit != 0
    }
}
