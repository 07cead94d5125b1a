//! What the card does on the bus of its own accord: writing host memory, and interrupts.

use std::sync::Arc;

use vg500_regs::pci::Vector;

use crate::dma::{Direction, DmaError, DmaTable, Lease};
use crate::interrupt::Interrupts;

/// The bus, as the card masters it.
pub(super) trait Bus: Send + Sync {
    /// Writes host memory. An aligned word arrives whole, after everything written before.
    fn write(&self, address: u64, bytes: &[u8]) -> Result<(), DmaError>;

    /// Holds host memory for a longer transfer, so that it cannot be unmapped in its midst unnoticed.
    fn hold(&self, address: u64, length: u64) -> Result<Box<dyn Held>, DmaError>;

    /// Raises an interrupt; never waits.
    fn raise(&self, vector: Vector);

    /// The cause of an interrupt is gone; never waits.
    fn lower(&self, vector: Vector);
}

/// Host memory that is held until this is dropped.
pub(super) trait Held {
    /// Writes bytes at an offset in it.
    fn write(&self, offset: u64, bytes: &[u8]) -> Result<(), DmaError>;
}

/// The client's memory and interrupts.
#[derive(Debug)]
pub(super) struct ClientBus {
    dma: Arc<DmaTable>,
    interrupts: Arc<Interrupts>,
}

impl ClientBus {
    /// The bus of a card that shares these with the protocol server.
    pub(super) const fn new(dma: Arc<DmaTable>, interrupts: Arc<Interrupts>) -> Self {
        Self { dma, interrupts }
    }
}

impl Bus for ClientBus {
    fn write(&self, address: u64, bytes: &[u8]) -> Result<(), DmaError> {
        self.dma.write(address, bytes)
    }

    fn hold(&self, address: u64, length: u64) -> Result<Box<dyn Held>, DmaError> {
        Ok(Box::new(self.dma.lease(address, length, Direction::Write)?))
    }

    fn raise(&self, vector: Vector) {
        self.interrupts.raise(vector as u16);
    }

    fn lower(&self, vector: Vector) {
        self.interrupts.lower(vector as u16);
    }
}

impl Held for Lease {
    fn write(&self, offset: u64, bytes: &[u8]) -> Result<(), DmaError> {
        Self::write(self, offset, bytes)
    }
}
