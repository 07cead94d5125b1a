//! Host memory for a vfio-user server: a memfd whose descriptor goes to the server.

use std::fs::File;
use std::io;
use std::os::fd::AsRawFd;
use std::sync::Arc;

use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, ftruncate, memfd_create};
use vg500_regs::SharedView;

use super::HostMemory;
use super::link::Link;
use crate::Error;
use crate::mapping::Mapping;
use crate::pool::{Piece, Pool};

/// Host memory that the server has mapped at a bus address.
pub(super) struct SharedBuffer {
    memory: Mapping,
    address: Piece,
    link: Arc<Link>,
}

impl SharedBuffer {
    /// At least `bytes` bytes, at an address of `addresses`.
    ///
    /// The client cannot tell whether the server took the mapping; a server that did not answers the first
    /// command that needs it with a fault.
    pub(super) fn new(link: &Arc<Link>, addresses: &Pool, bytes: usize) -> Result<Self, Error> {
        let address = addresses
            .allocate(bytes as u64)
            .map_err(|it| Error::OutOfBusAddresses { wanted: it.wanted, largest: it.largest })?;
        let range = address.range();
        let size = range.end - range.start;
        let (file, memory) =
            create(size).map_err(|cause| Error::System { what: "allocating host memory", cause })?;
        link.call("DMA_MAP", move |client| client.dma_map(0, range.start, size, file.as_raw_fd()))?;
        Ok(Self { memory, address, link: Arc::clone(link) })
    }
}

/// The file cannot be shortened by whoever has its descriptor, which would end this process.
fn create(size: u64) -> io::Result<(File, Mapping)> {
    let file = memfd_create("volumepro host memory", MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
    ftruncate(&file, size)?;
    fcntl_add_seals(&file, SealFlags::SHRINK | SealFlags::GROW | SealFlags::SEAL)?;
    let file = File::from(file);
    let memory = Mapping::new(&file, 0, size)?;
    Ok((file, memory))
}

impl HostMemory for SharedBuffer {
    fn bus_address(&self) -> u64 {
        self.address.range().start
    }

    fn view(&self) -> SharedView<'_> {
        self.memory.view()
    }
}

impl Drop for SharedBuffer {
    fn drop(&mut self) {
        let range = self.address.range();
        // A dead server has no use for the memory; a living one has its own mapping of the file.
        self.link
            .call("DMA_UNMAP", move |client| client.dma_unmap(range.start, range.end - range.start))
            .ok();
    }
}
