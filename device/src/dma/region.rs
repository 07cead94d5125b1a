//! A range of the client's memory, and its orderly end.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, TryLockError};
use std::time::{Duration, Instant};

use rustix::io::Errno;

use super::file::FileMemory;
use super::{Access, Direction, DmaError};

/// Memory that is reached by messages to the client, because it gave no descriptor for it.
pub trait ClientMemory: fmt::Debug + Send + Sync {
    /// Reads `data.len()` bytes at `iova`.
    ///
    /// # Errors
    ///
    /// The client's error, `ETIMEDOUT`, or `ECANCELED` after [`abort`](Self::abort).
    fn read(&self, iova: u64, data: &mut [u8]) -> Result<(), Errno>;

    /// Writes `data` at `iova`; errors as for [`read`](Self::read).
    fn write(&self, iova: u64, data: &[u8]) -> Result<(), Errno>;

    /// Makes the access that waits for the client fail at once.
    fn abort(&self);
}

/// Where a region's bytes are.
#[derive(Debug)]
pub(super) enum Source {
    File { memory: Arc<FileMemory>, offset: u64 },
    Messages(Arc<dyn ClientMemory>),
}

/// A range of IOVAs that the client has mapped.
#[derive(Debug)]
pub(super) struct Region {
    pub(super) base: u64,
    /// The last byte, because a region may end with the address space.
    pub(super) last: u64,
    pub(super) access: Access,
    pub(super) source: Source,
    leases: Mutex<usize>,
    idle: Condvar,
    revoked: AtomicBool,
    /// Held for reading by each access, so that whoever ends access can wait for it.
    gate: RwLock<()>,
}

impl Region {
    pub(super) fn new(base: u64, last: u64, access: Access, source: Source) -> Self {
        Self {
            base,
            last,
            access,
            source,
            leases: Mutex::new(0),
            idle: Condvar::new(),
            revoked: AtomicBool::new(false),
            gate: RwLock::new(()),
        }
    }

    pub(super) fn contains(&self, iova: u64) -> bool {
        (self.base..=self.last).contains(&iova)
    }

    pub(super) fn allows(&self, direction: Direction) -> bool {
        match direction {
            Direction::Read => self.access.read,
            Direction::Write => self.access.write,
        }
    }

    /// Reads bytes that lie inside the region, from inside its gate.
    pub(super) fn read(&self, iova: u64, data: &mut [u8]) -> Result<(), Errno> {
        match &self.source {
            Source::File { memory, offset } => memory.read(offset + (iova - self.base), data),
            Source::Messages(client) => client.read(iova, data),
        }
    }

    /// Writes bytes that lie inside the region, from inside its gate.
    pub(super) fn write(&self, iova: u64, data: &[u8]) -> Result<(), Errno> {
        match &self.source {
            Source::File { memory, offset } => memory.write(offset + (iova - self.base), data),
            Source::Messages(client) => client.write(iova, data),
        }
    }

    /// Goes through the gate for one short access.
    pub(super) fn enter(&self, iova: u64) -> Result<RwLockReadGuard<'_, ()>, DmaError> {
        let gate = self.gate.read().unwrap_or_else(PoisonError::into_inner);
        if self.revoked.load(Ordering::SeqCst) { Err(DmaError::Revoked { iova }) } else { Ok(gate) }
    }

    pub(super) fn lease(&self) {
        *self.leases() += 1;
    }

    pub(super) fn end_lease(&self) {
        *self.leases() -= 1;
        self.idle.notify_all();
    }

    pub(super) fn leased(&self) -> bool {
        *self.leases() > 0
    }

    /// Waits until nobody holds a lease.
    pub(super) fn wait_until_idle(&self, deadline: Instant) {
        // The thread that waits here is the one that receives replies: a transfer by message cannot go on.
        if matches!(self.source, Source::Messages(_)) {
            self.revoke();
        }
        let left = deadline.saturating_duration_since(Instant::now());
        drop(self.idle.wait_timeout_while(self.leases(), left, |leases| *leases > 0));
    }

    /// Ends all access. On return none is in progress, and none begins any more, whatever leases are held.
    pub(super) fn revoke(&self) {
        self.revoked.store(true, Ordering::SeqCst);
        self.drain();
    }

    /// Waits until those who are inside the gate have left it. Accesses are short, or wait for a message, which
    /// is aborted.
    pub(super) fn drain(&self) {
        while matches!(self.gate.try_write(), Err(TryLockError::WouldBlock)) {
            if let Source::Messages(client) = &self.source {
                client.abort();
            }
            std::thread::sleep(Duration::from_micros(100));
        }
    }

    fn leases(&self) -> MutexGuard<'_, usize> {
        self.leases.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
