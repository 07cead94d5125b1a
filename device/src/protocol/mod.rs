//! The server side of the vfio-user protocol.
//!
//! A client (a VMM such as QEMU, or the driver) connects to a Unix stream socket and drives the [`Device`]
//! behind it by messages: a header of 16 bytes, a payload, and descriptors beside them. The names here are
//! those of the protocol specification. A connection runs through
//!
//! 1. negotiation of version and limits,
//! 2. requests, each answered before the next is read: device, region and interrupt information, accesses
//!    to regions, the client's memory for DMA, event descriptors for interrupts, reset,
//! 3. its end, at any byte: the device is reset, memory and descriptors of the client are given back.
//!
//! Everything a client sends is checked before it is used. What it can get wrong costs it an error reply; the
//! connection closes only where the next message could no longer be found in the stream.

#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::cast_possible_truncation))]

mod connection;
mod device;
mod door;
mod messages;
mod server;
mod session;
mod socket;
mod version;
mod wire;

use std::sync::atomic::{AtomicU64, Ordering};

use rustix::io::Errno;

pub use device::{Device, Region, ResetReason, region};
pub use server::Server;

/// Bytes that one message may read or write. The protocol's default; large enough that a whole base plane goes
/// in one message, small enough to hold in memory for every message.
pub const MAX_TRANSFER: usize = 1 << 20;

/// Why a connection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Ended {
    /// The client closed it, perhaps in the midst of a message.
    #[error("the client disconnected")]
    Disconnected,
    /// [`Stop`](crate::stop::Stop) was requested.
    #[error("the server was stopped")]
    Stopped,
    /// A message of impossible size: the next one cannot be found.
    #[error("the client sent a message of impossible size")]
    Framing,
    /// The client speaks another major version.
    #[error("the client speaks another major version of the protocol")]
    Version,
    /// The device panicked.
    #[error("the device panicked")]
    Panicked,
    /// The socket failed.
    #[error("the socket failed: {0}")]
    Failed(Errno),
}

impl From<Errno> for Ended {
    fn from(errno: Errno) -> Self {
        match errno {
            Errno::PIPE | Errno::CONNRESET => Self::Disconnected,
            errno => Self::Failed(errno),
        }
    }
}

/// What has happened since the server began.
#[derive(Debug, Default)]
pub struct Counters {
    /// Clients that connected.
    pub connections: AtomicU64,
    /// Clients that came while another one was served.
    pub turned_away: AtomicU64,
    /// Requests, refused ones included.
    pub requests: AtomicU64,
    /// Messages refused, most of them by an error reply.
    pub refused: AtomicU64,
    /// Replies that nobody waited for.
    pub stray_replies: AtomicU64,
    /// Panics of the device.
    pub panics: AtomicU64,
}

impl Counters {
    fn count(counter: &AtomicU64) {
        counter.fetch_add(1, Ordering::Relaxed);
    }
}
