//! One interrupt that a client can attach an event descriptor to.

use std::os::fd::OwnedFd;

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
    /// Back to unmasked and nothing pending; the descriptor stays.
    pub(super) fn reset(&mut self) {
        self.masked = false;
        self.pending = false;
    }
}
