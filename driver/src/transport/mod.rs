//! Ways to the card. Everything above is the same for all of them.

mod link;
mod pci;
mod private_socket;
mod shared_buffer;
pub mod vfio_user;

use std::os::fd::OwnedFd;

use vg500_regs::SharedView;

use crate::Error;
pub use pci::{PciAddress, PciCard, PciSelector};

/// A way to the card.
///
/// Every method comes back in bounded time. Once one has failed with [`Error::CardDead`], all do so at once.
pub trait Transport: Send + Sync {
    /// The 32-bit word at byte `offset`, a multiple of 4, of the PCI configuration space.
    fn read_config(&self, offset: u16) -> Result<u32, Error>;

    /// Writes the 16-bit word at byte `offset`, a multiple of 2, of the PCI configuration space.
    fn write_config(&self, offset: u16, word: u16) -> Result<(), Error>;

    /// Bytes of the memory behind base address register `index`; 0 if there is none.
    fn bar_size(&self, index: u32) -> u64;

    /// The memory behind base address register `index`, unless it could not be mapped.
    fn memory(&self, index: u32) -> Option<SharedView<'_>>;

    /// Reads consecutive registers from byte `offset` on.
    fn read_registers(&self, offset: u32, words: &mut [u32]) -> Result<(), Error>;

    /// Writes consecutive registers from byte `offset` on, in increasing order.
    fn write_registers(&self, offset: u32, words: &[u32]) -> Result<(), Error>;

    /// Whether consecutive registers go as one message, so that a few words more cost nothing. If not, each
    /// word is trapped by itself.
    fn bursts(&self) -> bool;

    /// At least `bytes` zeroed bytes of host memory that the card reaches by bus mastering;
    /// [`Error::NotSupported`] if there is no way.
    fn host_memory(&self, bytes: usize) -> Result<Box<dyn HostMemory>, Error>;

    /// Enables the card's interrupts, and returns one non-blocking event descriptor for each vector; none if
    /// the card has to be polled. They outlive resets.
    fn interrupts(&self) -> Result<Vec<OwnedFd>, Error>;

    /// Resets the card to its power-on state, the configuration space included.
    fn reset(&self) -> Result<(), Error>;

    /// Which way this is, and to which card; for people.
    fn description(&self) -> String {
        "unknown".into()
    }

    /// Whether the card's memories lie behind a bus, where writing is fast and reading is slow: pixels are then
    /// better fetched by bus mastering.
    fn memory_is_remote(&self) -> bool {
        false
    }

    /// Whether a card that does not reach host memory is an error. If not, the driver does without.
    fn needs_host_memory(&self) -> bool {
        false
    }

    /// The register at byte `offset`.
    fn read_register(&self, offset: u32) -> Result<u32, Error> {
        let mut words = [0];
        self.read_registers(offset, &mut words)?;
        Ok(words[0])
    }
}

/// Host memory that the card reaches by bus mastering, until it is dropped.
pub trait HostMemory: Send + Sync {
    /// Address of the first byte on the bus, a multiple of 4096.
    fn bus_address(&self) -> u64;

    /// Access to the bytes.
    fn view(&self) -> SharedView<'_>;
}
