//! One interrupt that a client can attach an event descriptor to.

use std::os::fd::OwnedFd;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::write;

/// An event descriptor with a mask.
#[derive(Debug, Default)]
pub(super) struct Line {
    /// The client's event descriptor.
    pub(super) event: Option<OwnedFd>,
    /// Whether signals are held back.
    pub(super) masked: bool,
    /// Whether a signal has been held back.
    pub(super) pending: bool,
}

impl Line {
    /// Adds one to the event counter, without waiting. A full counter means that the client has events to
    /// take already, so nothing is lost.
    ///
    /// The descriptor's mode is left alone: its owner shares it, and may wait on it. So the counter is polled
    /// first. Returns whether there was a descriptor and it took the event.
    pub(super) fn signal(&self) -> bool {
        let Some(event) = &self.event else { return false };
        let now = Timespec { tv_sec: 0, tv_nsec: 0 };
        let room = poll(&mut [PollFd::new(event, PollFlags::OUT)], Some(&now));
        room == Ok(1) && write(event, &1u64.to_ne_bytes()) == Ok(size_of::<u64>())
    }

    /// Back to unmasked and nothing pending; the descriptor stays.
    pub(super) fn reset(&mut self) {
        self.masked = false;
        self.pending = false;
    }
}
