//! Host memory that the IOMMU shows to the card.

use std::fs::File;
use std::sync::Arc;

use vg500_regs::SharedView;

use super::ioctl;
use crate::Error;
use crate::mapping::{HUGE_PAGE, Mapping};
use crate::pool::{Piece, Pool};
use crate::transport::HostMemory;

/// Bus addresses of buffers are multiples of a huge page, so that the IOMMU maps huge pages as such.
pub(super) const ALIGNMENT: u64 = HUGE_PAGE as u64;

/// Buffers from this size on are worth a huge page.
const LARGE: usize = 64 << 10;
const PAGE: usize = 4096;

/// A set of bus addresses; the card is in its group.
#[derive(Debug)]
pub(super) struct Container {
    file: File,
    /// The container forgets its mappings when the last group is closed.
    _group: File,
}

impl Container {
    pub(super) fn new(file: File, group: File) -> Self {
        Self { file, _group: group }
    }
}

/// Memory of this process at a bus address.
pub(super) struct MappedBuffer {
    memory: Mapping,
    address: Piece,
    container: Arc<Container>,
}

impl MappedBuffer {
    /// At least `bytes` bytes, on huge pages if there are any, at an address of `addresses`.
    pub(super) fn new(container: &Arc<Container>, addresses: &Pool, bytes: usize) -> Result<Self, Error> {
        let memory = allocate(bytes)?;
        let size = memory.view().size() as u64;
        let address = addresses
            .allocate(size)
            .map_err(|it| Error::OutOfBusAddresses { wanted: it.wanted, largest: it.largest })?;
        let start = memory.view().start().as_ptr().addr() as u64;
        ioctl::map_dma(&container.file, start, address.range().start, size).map_err(|cause| {
            Error::System { what: "mapping host memory for the card (limit of locked memory?)", cause }
        })?;
        Ok(Self { memory, address, container: Arc::clone(container) })
    }
}

fn allocate(bytes: usize) -> Result<Mapping, Error> {
    let round = |unit| bytes.max(1).checked_next_multiple_of(unit).unwrap_or(usize::MAX);
    let huge = (bytes >= LARGE).then(|| Mapping::anonymous(round(HUGE_PAGE), true).ok()).flatten();
    let memory = huge.map_or_else(|| Mapping::anonymous(round(PAGE), false), Ok);
    memory.map_err(|cause| Error::System { what: "allocating host memory", cause })
}

impl HostMemory for MappedBuffer {
    fn bus_address(&self) -> u64 {
        self.address.range().start
    }

    fn view(&self) -> SharedView<'_> {
        self.memory.view()
    }
}

impl Drop for MappedBuffer {
    fn drop(&mut self) {
        let size = self.memory.view().size() as u64;
        if let Err(error) = ioctl::unmap_dma(&self.container.file, self.address.range().start, size) {
            tracing::warn!(%error, "host memory stays mapped for the card");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_much_memory_is_an_error() {
        let error = allocate(usize::MAX).unwrap_err().to_string();
        assert!(error.starts_with("allocating host memory: "), "{error}");
        assert_eq!(allocate(1).unwrap().view().size(), PAGE);
        assert!(allocate(LARGE + 1).unwrap().view().size() > LARGE);
    }
}
