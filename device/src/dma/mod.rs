//! The client's memory, as the device reaches it: a table from IOVA ranges to files and messages.

#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::cast_possible_truncation))]

mod file;
mod lease;
mod region;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::fmt;
use std::os::fd::OwnedFd;
use std::sync::atomic::{AtomicUsize, Ordering, fence};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::time::{Duration, Instant};

use rustix::io::Errno;

use crate::pci::CommandRegister;
use file::{FileId, FileMemory, OpenFile};
pub use lease::Lease;
use lease::transfer;
pub use region::ClientMemory;
use region::{Region, Source};

/// Mappings are multiples of this page size, which is the protocol's default.
pub const PAGE: u64 = 4096;
/// Regions in the table. The protocol's default, which VMMs only lower; 4 KiB pages of 256 MiB reach it.
pub const MAX_REGIONS: usize = 65_535;
/// Bytes of one region: more than a guest has, and the sum over all files stays in the address space.
pub const MAX_REGION_SIZE: u64 = 1 << 40;
/// Files behind the regions. A guest has one per memory backend; each costs a descriptor, of which a process has
/// about 1,024, or a mapping of at most [`MAX_REGION_SIZE`], so that together they leave room in the address space.
pub const MAX_FILES: usize = 64;
/// How long unmapping waits for a transfer to end before it takes the memory away under it. Clients wait five
/// seconds for the reply.
pub const PATIENCE: Duration = Duration::from_secs(1);

/// What the device may do with a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Access {
    /// The device may read it.
    pub read: bool,
    /// The device may write it.
    pub write: bool,
}

/// Which way a transfer goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// The device reads the client's memory.
    Read,
    /// The device writes the client's memory.
    Write,
}

/// What the client gave to reach a region by.
#[derive(Debug)]
pub enum Memory {
    /// A file that holds the region from `offset` on.
    File {
        /// Descriptor of the file.
        descriptor: OwnedFd,
        /// Offset of the region in the file, in bytes.
        offset: u64,
    },
    /// Nothing; the client answers messages.
    Messages(Arc<dyn ClientMemory>),
}

/// Why a transfer stopped. Bytes before `iova` have been transferred.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DmaError {
    /// Bus Master Enable is off.
    #[error("bus mastering is disabled")]
    BusMasterDisabled,
    /// The device is being reset.
    #[error("DMA is suspended by a reset")]
    Suspended,
    /// The range ends past the address space.
    #[error("DMA of {length} bytes at IOVA {iova:#x} ends past the address space")]
    Wraps {
        /// Start of the transfer.
        iova: u64,
        /// Bytes of the transfer.
        length: u64,
    },
    /// The client has mapped nothing there.
    #[error("no memory is mapped at IOVA {iova:#x}")]
    NotMapped {
        /// First byte without memory.
        iova: u64,
    },
    /// The client mapped the memory for the other direction only.
    #[error("{direction:?} access to IOVA {iova:#x} is not allowed")]
    NotAllowed {
        /// First byte that may not be accessed.
        iova: u64,
        /// The access that was tried.
        direction: Direction,
    },
    /// The client took the memory away during the transfer.
    #[error("memory at IOVA {iova:#x} was taken away")]
    Revoked {
        /// First byte not transferred.
        iova: u64,
    },
    /// The client's file or message failed.
    #[error("access to IOVA {iova:#x} failed: {errno}")]
    Failed {
        /// Start of the piece that failed.
        iova: u64,
        /// The system's or the client's reason.
        errno: Errno,
    },
}

#[derive(Debug, Default)]
struct Table {
    /// By first IOVA; no two overlap.
    regions: BTreeMap<u64, Arc<Region>>,
    /// Those that some region uses, a file that grew once for each of its sizes.
    files: Vec<(FileId, Weak<FileMemory>)>,
}

/// The memory that the client has mapped for DMA.
///
/// The protocol server maps and unmaps; any other thread of the device reads and writes. Every access checks
/// range, direction and Bus Master Enable. Memory goes only when nothing uses it: see [`unmap`](Self::unmap).
pub struct DmaTable {
    command: Arc<CommandRegister>,
    table: Mutex<Table>,
    /// How many [`Suspension`]s there are.
    suspended: AtomicUsize,
    cancel: OnceLock<Box<dyn Fn() + Send + Sync>>,
}

impl DmaTable {
    /// An empty table; `command` holds Bus Master Enable.
    #[must_use]
    pub fn new(command: Arc<CommandRegister>) -> Self {
        Self { command, table: Mutex::default(), suspended: AtomicUsize::new(0), cancel: OnceLock::new() }
    }

    /// Sets what is called when the client unmaps memory that is leased: it asks the transfer to end soon, and
    /// returns at once. Only the first call sets it.
    pub fn on_unmap(&self, cancel: impl Fn() + Send + Sync + 'static) {
        drop(self.cancel.set(Box::new(cancel)));
    }

    /// Maps `size` bytes at `base`.
    ///
    /// # Errors
    ///
    /// `EINVAL` for a range that is empty, not of whole pages, too large, past the address space or past the
    /// end of its file, for a descriptor that is not of a file, and without any access; `EEXIST` over a region
    /// that is there; `ENOSPC` if the table is full; `EACCES` if the file was opened for less.
    pub fn map(&self, base: u64, size: u64, access: Access, memory: Memory) -> Result<(), Errno> {
        let last = last_byte(base, size).ok_or(Errno::INVAL)?;
        let whole_pages = base.is_multiple_of(PAGE) && size.is_multiple_of(PAGE);
        if size > MAX_REGION_SIZE || !whole_pages || access == (Access { read: false, write: false }) {
            return Err(Errno::INVAL);
        }
        let mut table = self.lock();
        if table.regions.range(..=last).next_back().is_some_and(|(_, region)| region.last >= base) {
            return Err(Errno::EXIST);
        }
        if table.regions.len() >= MAX_REGIONS {
            return Err(Errno::NOSPC);
        }
        let source = match memory {
            Memory::Messages(client) => Source::Messages(client),
            Memory::File { descriptor, offset } => {
                let open = OpenFile::new(descriptor, access.write)?;
                let inside = offset.checked_add(size).is_some_and(|end| end <= open.size);
                if !inside || !offset.is_multiple_of(PAGE) {
                    return Err(Errno::INVAL);
                }
                Source::File { memory: table.file(open, offset + size)?, offset }
            }
        };
        table.regions.insert(base, Arc::new(Region::new(base, last, access, source)));
        Ok(())
    }

    /// Unmaps every region that lies inside `size` bytes at `base`; that there is none is fine, and the range
    /// may end with the address space.
    ///
    /// If a transfer has leased any of them, it is asked to end, and gets up to [`PATIENCE`]; then the memory is
    /// taken away under it. In any case nothing accesses the regions any more on return.
    ///
    /// # Errors
    ///
    /// `EINVAL` for a range that is empty or past the address space.
    pub fn unmap(&self, base: u64, size: u64) -> Result<(), Errno> {
        let last = last_byte(base, size).ok_or(Errno::INVAL)?;
        let mut table = self.lock();
        let inside: Vec<u64> = table
            .regions
            .range(base..=last)
            .filter(|(_, region)| region.last <= last)
            .map(|(&base, _)| base)
            .collect();
        let removed: Vec<_> = inside.iter().filter_map(|base| table.regions.remove(base)).collect();
        drop(table);
        self.release(&removed);
        Ok(())
    }

    /// Unmaps everything, as [`unmap`](Self::unmap) does.
    pub fn clear(&self) {
        let removed: Vec<_> = std::mem::take(&mut self.lock().regions).into_values().collect();
        self.release(&removed);
        self.lock().files.clear();
    }

    /// Ends all accesses, on any thread, until the result is dropped: those in progress have ended on return,
    /// leases stay but cannot be used. For resets, which must not wait for a client that waits for them.
    #[must_use]
    pub fn suspend(&self) -> Suspension<'_> {
        self.suspended.fetch_add(1, Ordering::SeqCst);
        let regions: Vec<_> = self.lock().regions.values().cloned().collect();
        regions.iter().for_each(|region| region.drain());
        Suspension(self)
    }

    /// Number of regions.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lock().regions.len()
    }

    /// Whether nothing is mapped.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Reads `data.len()` bytes at `iova`, across regions that follow each other.
    ///
    /// # Errors
    ///
    /// [`DmaError`]; `data` then holds what was read before.
    pub fn read(&self, iova: u64, data: &mut [u8]) -> Result<(), DmaError> {
        transfer(self, Direction::Read, iova, data.len(), |region, iova, piece| {
            region.read(iova, data.get_mut(piece).unwrap_or_default())
        })
    }

    /// Writes `data` at `iova`, across regions that follow each other. An aligned word of 4 or 8 bytes in a
    /// mapped file arrives whole, and after everything that this thread wrote before.
    ///
    /// # Errors
    ///
    /// [`DmaError`]; what came before has been written.
    pub fn write(&self, iova: u64, data: &[u8]) -> Result<(), DmaError> {
        fence(Ordering::Release);
        transfer(self, Direction::Write, iova, data.len(), |region, iova, piece| {
            region.write(iova, data.get(piece).unwrap_or_default())
        })
    }

    /// Takes a lease on `length` bytes at `iova` for a longer transfer: it finds all memory before the transfer
    /// begins, and makes unmapping wait for its end.
    ///
    /// # Errors
    ///
    /// [`DmaError`] if any byte is not there for this direction.
    pub fn lease(self: &Arc<Self>, iova: u64, length: u64, direction: Direction) -> Result<Lease, DmaError> {
        self.check_enabled()?;
        let mut lease = Lease { dma: Arc::clone(self), iova, length, direction, regions: Vec::new() };
        if length == 0 {
            return Ok(lease);
        }
        let last = last_byte(iova, length).ok_or(DmaError::Wraps { iova, length })?;
        // Held throughout, so that a region is either leased or already unmapped.
        let table = self.lock();
        let mut next = Some(iova);
        while let Some(iova) = next.filter(|&iova| iova <= last) {
            let region = table.find(iova).ok_or(DmaError::NotMapped { iova })?;
            if !region.allows(direction) {
                return Err(DmaError::NotAllowed { iova, direction });
            }
            region.lease();
            next = region.last.checked_add(1);
            lease.regions.push(region);
        }
        Ok(lease)
    }

    fn release(&self, removed: &[Arc<Region>]) {
        if removed.iter().any(|region| region.leased())
            && let Some(cancel) = self.cancel.get()
        {
            cancel();
        }
        let deadline = Instant::now() + PATIENCE;
        removed.iter().for_each(|region| region.wait_until_idle(deadline));
        removed.iter().for_each(|region| region.revoke());
    }

    fn check_enabled(&self) -> Result<(), DmaError> {
        match self.suspended.load(Ordering::SeqCst) {
            0 if self.command.bus_master() => Ok(()),
            0 => Err(DmaError::BusMasterDisabled),
            _ => Err(DmaError::Suspended),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for DmaTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DmaTable").field("regions", &self.len()).finish_non_exhaustive()
    }
}

impl Table {
    fn find(&self, iova: u64) -> Option<Arc<Region>> {
        let (_, region) = self.regions.range(..=iova).next_back()?;
        region.contains(iova).then(|| Arc::clone(region))
    }

    /// The memory of a file of which `needed` bytes must be reachable. Each region comes with a descriptor of
    /// its own, but all of one file share one mapping.
    fn file(&mut self, open: OpenFile, needed: u64) -> Result<Arc<FileMemory>, Errno> {
        let same = self.files.iter().filter(|(id, _)| *id == open.id);
        // A file that has grown since is mapped again.
        if let Some(memory) = same.filter_map(|(_, it)| it.upgrade()).find(|memory| memory.size >= needed) {
            return Ok(memory);
        }
        self.files.retain(|(_, memory)| memory.strong_count() > 0);
        if self.files.len() >= MAX_FILES {
            return Err(Errno::NOSPC);
        }
        let id = open.id;
        let memory = Arc::new(FileMemory::new(open));
        self.files.push((id, Arc::downgrade(&memory)));
        Ok(memory)
    }
}

/// While it lives, there is no access to client memory.
#[derive(Debug)]
pub struct Suspension<'a>(&'a DmaTable);

impl Drop for Suspension<'_> {
    fn drop(&mut self) {
        self.0.suspended.fetch_sub(1, Ordering::SeqCst);
    }
}

/// The last byte of a range that is not empty and does not leave the address space.
fn last_byte(base: u64, size: u64) -> Option<u64> {
    base.checked_add(size.checked_sub(1)?)
}
