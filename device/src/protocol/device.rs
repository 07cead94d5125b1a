//! What a device offers to the protocol server, and what the server asks of it.

use std::sync::Arc;

use rustix::io::Errno;

use crate::backing::Backing;

/// Region indices, as VFIO numbers them for PCI devices.
pub mod region {
    /// First base address register; the others follow.
    pub const BAR0: usize = 0;
    /// Expansion ROM.
    pub const ROM: usize = 6;
    /// PCI configuration space.
    pub const CONFIG: usize = 7;
    /// Legacy VGA ranges.
    pub const VGA: usize = 8;
    /// Number of regions of a PCI device.
    pub const COUNT: usize = 9;
}

/// One region of a device: a base address register or the configuration space.
#[derive(Clone, Debug, Default)]
pub struct Region {
    /// Size in bytes; 0 for a region that does not exist.
    pub size: u64,
    /// Whether the client may read it by message.
    pub read: bool,
    /// Whether the client may write it by message.
    pub write: bool,
    /// Memory that the client maps, exactly `size` bytes. Without it every access is a message.
    pub memory: Option<Arc<Backing>>,
}

impl Region {
    /// A region whose every access is a message to [`Device::read`] or [`Device::write`].
    #[must_use]
    pub const fn trapped(size: u64) -> Self {
        Self { size, read: true, write: true, memory: None }
    }

    /// A region that the client maps. Clients may still use messages, which reach the device as for a
    /// trapped region.
    #[must_use]
    pub fn mapped(memory: Arc<Backing>) -> Self {
        Self { size: memory.size(), read: true, write: true, memory: Some(memory) }
    }
}

/// Why a device goes back to its power-on state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetReason {
    /// A client has connected. The device is reset before its first request.
    Connection,
    /// The client sent `DEVICE_RESET` (a VMM starts or reboots its guest).
    Device,
    /// The client set Initiate Function Level Reset in the PCI Express capability. The device itself sees
    /// this, in its configuration space; the server never passes it.
    FunctionLevel,
    /// The client has gone, in the midst of anything. Its memory and interrupts are taken away as soon as
    /// the device returns from this reset.
    LostConnection,
}

/// A PCI device behind the protocol server.
///
/// The server owns the device and calls it from one thread, one request at a time, in the order in which
/// the client sent them. The client waits for each call, and gives up after five seconds: no call may render,
/// wait for the engine, or use the client's memory (the client may be unable to answer meanwhile). The device's
/// other threads use [`DmaTable`](crate::dma::DmaTable) and [`Interrupts`](crate::interrupt::Interrupts),
/// which it shares with the server.
///
/// A panic in a call ends the connection, not the process; the next client finds the device reset.
pub trait Device {
    /// The regions, by index (see [`region`]); missing ones have size 0. Sizes and descriptors stay the same
    /// while a client is connected.
    fn regions(&self) -> &[Region];

    /// Reads `data.len()` bytes at `offset` of a region.
    ///
    /// The server has checked that the region is readable and that the whole access lies inside of it; any
    /// width and alignment within that can come, up to [`MAX_TRANSFER`](super::MAX_TRANSFER). `data` is zero
    /// on entry. An error goes to the client as error reply; VMMs then give the guest all ones.
    fn read(&mut self, region: usize, offset: u64, data: &mut [u8]) -> Result<(), Errno>;

    /// Writes `data` at `offset` of a region, checked as in [`read`](Self::read).
    fn write(&mut self, region: usize, offset: u64, data: &[u8]) -> Result<(), Errno>;

    /// Takes the device back to its power-on state: registers, configuration space, pending interrupts.
    ///
    /// A running frame or transfer is cancelled; the call returns once nothing of it uses the client's memory,
    /// within a second. It takes a [`suspend`](crate::dma::DmaTable::suspend) of the client's memory first:
    /// the engine may be waiting for the client, which is waiting for this call. Resets may follow one another,
    /// and come in any state.
    fn reset(&mut self, reason: ResetReason);
}
