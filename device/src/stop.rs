//! A way to end whatever waits for clients.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::Arc;

use rustix::event::{EventfdFlags, eventfd};

/// Ends the server: its clones wake every wait for a client, from any thread, once and for all.
#[derive(Clone, Debug)]
pub struct Stop(Arc<OwnedFd>);

impl Stop {
    /// A handle on which nothing has been requested.
    ///
    /// # Errors
    ///
    /// If the process has no descriptor left.
    pub fn new() -> io::Result<Self> {
        let event = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        Ok(Self(Arc::new(event)))
    }

    /// Asks the server to end. Asking again changes nothing.
    pub fn request(&self) {
        // It fails only where the counter is full, and then the descriptor is readable already.
        _ = rustix::io::write(&self.0, &1u64.to_ne_bytes());
    }
}

/// Readable once the end has been requested.
impl AsFd for Stop {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}
