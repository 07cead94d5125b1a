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

mod device;

pub use device::{Device, Region, ResetReason, region};

/// Bytes that one message may read or write. The protocol's default; large enough that a whole base plane goes
/// in one message, small enough to hold in memory for every message.
pub const MAX_TRANSFER: usize = 1 << 20;
