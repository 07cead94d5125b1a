//! The card as a PCI function of this machine, real or virtual.
//!
//! If the card is bound to vfio-pci, that is the way to it: interrupts by event descriptors, and bus mastering
//! to any memory of this process through the IOMMU. Without a driver, the files in sysfs are: memories are
//! mapped, the card is polled, and bus mastering reaches huge pages if no IOMMU is in the way.

mod address;
#[cfg(test)]
mod fake_tree;
mod find;
mod function;
mod physical;
mod sysfs;
mod vfio;

use std::os::fd::OwnedFd;
use std::path::Path;

use vg500_regs::SharedView;

pub use address::{PciAddress, PciSelector};
use find::Found;
use function::Function;
use sysfs::Sysfs;
use vfio::Vfio;

use super::{HostMemory, Transport};
use crate::Error;

/// The kernel driver that hands devices to processes.
const VFIO_DRIVER: &str = "vfio-pci";

/// A card on the PCI bus.
#[derive(Debug)]
pub struct PciCard {
    address: PciAddress,
    way: Way,
    function: Function,
}

#[derive(Debug)]
enum Way {
    Vfio(Vfio),
    Sysfs(Sysfs),
}

impl PciCard {
    /// Opens a card, through vfio-pci if it is bound to that, through sysfs if it has no driver.
    ///
    /// # Errors
    ///
    /// [`Error::NoCard`], [`Error::NoPciDevice`] or [`Error::Identity`] if it is not there;
    /// [`Error::OtherDriver`], [`Error::InUse`] or [`Error::SharedGroup`] if others use it; [`Error::NoIommu`];
    /// [`Error::File`] or [`Error::System`] if the system refuses, mostly for want of permission.
    pub fn open(selector: PciSelector) -> Result<Self, Error> {
        Self::open_below(Path::new("/"), selector)
    }

    /// As [`open`](Self::open), with `sys` and `dev` in another place than the root of the file system.
    ///
    /// # Errors
    ///
    /// As [`open`](Self::open).
    pub fn open_below(root: &Path, selector: PciSelector) -> Result<Self, Error> {
        let found: Found = find::find(root, selector)?;
        let address = found.address;
        let (way, function) = match &found.driver {
            None => Sysfs::open(&found).map(|(way, function)| (Way::Sysfs(way), function))?,
            Some(driver) if driver == VFIO_DRIVER => {
                Vfio::open(root, &found).map(|(way, function)| (Way::Vfio(way), function))?
            }
            Some(driver) => return Err(Error::OtherDriver { address, driver: driver.clone() }),
        };
        Ok(Self { address, way, function })
    }

    /// Where the card is.
    #[must_use]
    pub fn address(&self) -> PciAddress {
        self.address
    }

    /// Whether the card is reached through vfio-pci; else through sysfs.
    #[must_use]
    pub fn is_vfio(&self) -> bool {
        matches!(self.way, Way::Vfio(_))
    }
}

impl Transport for PciCard {
    fn read_config(&self, offset: u16) -> Result<u32, Error> {
        self.function.read_config(offset)
    }

    fn write_config(&self, offset: u16, word: u16) -> Result<(), Error> {
        self.function.write_config(offset, word)
    }

    fn bar_size(&self, index: u32) -> u64 {
        self.function.bar_size(index)
    }

    fn memory(&self, index: u32) -> Option<SharedView<'_>> {
        self.function.memory(index)
    }

    fn read_registers(&self, offset: u32, words: &mut [u32]) -> Result<(), Error> {
        self.function.read_registers(offset, words)
    }

    fn write_registers(&self, offset: u32, words: &[u32]) -> Result<(), Error> {
        self.function.write_registers(offset, words)
    }

    fn bursts(&self) -> bool {
        false
    }

    fn host_memory(&self, bytes: usize) -> Result<Box<dyn HostMemory>, Error> {
        match &self.way {
            Way::Vfio(vfio) => vfio.host_memory(bytes),
            Way::Sysfs(sysfs) => sysfs.host_memory(bytes),
        }
    }

    fn interrupts(&self) -> Result<Vec<OwnedFd>, Error> {
        match &self.way {
            Way::Vfio(vfio) => vfio.interrupts(),
            Way::Sysfs(_) => Ok(Vec::new()),
        }
    }

    fn reset(&self) -> Result<(), Error> {
        match &self.way {
            Way::Vfio(vfio) => vfio.reset(&self.function),
            Way::Sysfs(sysfs) => sysfs.reset(&self.function),
        }
    }

    fn description(&self) -> String {
        let way = if self.is_vfio() { "vfio-pci" } else { "sysfs" };
        format!("{way} {}", self.address)
    }

    fn memory_is_remote(&self) -> bool {
        true
    }

    fn needs_host_memory(&self) -> bool {
        self.is_vfio()
    }
}

impl Drop for PciCard {
    fn drop(&mut self) {
        // vfio-pci stops and resets a device that is closed.
        if let Way::Sysfs(sysfs) = &self.way {
            sysfs.close(&self.function);
        }
    }
}

#[cfg(test)]
mod tests;
