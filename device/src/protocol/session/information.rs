//! What the device is: `DEVICE_GET_INFO`, `DEVICE_GET_REGION_INFO`, `DEVICE_GET_IRQ_INFO`.

use rustix::io::Errno;

use super::{Reply, Session};
use crate::interrupt::Kind;
use crate::protocol::wire::{Append, Fields};
use crate::protocol::{Device, Region, region};

/// `VFIO_DEVICE_FLAGS_RESET | VFIO_DEVICE_FLAGS_PCI`.
const DEVICE_FLAGS: u32 = 0b11;
const DEVICE_INFO_SIZE: u32 = 16;

const REGION_READ: u32 = 1;
const REGION_WRITE: u32 = 1 << 1;
const REGION_MMAP: u32 = 1 << 2;
const REGION_CAPABILITIES: u32 = 1 << 3;
const REGION_INFO_SIZE: u32 = 32;
/// `VFIO_REGION_INFO_CAP_SPARSE_MMAP`, version 1, with one area.
const SPARSE_MMAP: u16 = 1;
const SPARSE_MMAP_SIZE: u32 = 32;

const IRQ_EVENTFD: u32 = 1;
const IRQ_MASKABLE: u32 = 1 << 1;
const IRQ_AUTOMASKED: u32 = 1 << 2;
const IRQ_INFO_SIZE: u32 = 16;

impl<D: Device> Session<'_, D> {
    pub(super) fn device_info(&self, mut fields: Fields<'_>, reply: &mut Vec<u8>) -> Result<(), Errno> {
        room(&mut fields, DEVICE_INFO_SIZE)?;
        fields.bytes(12)?;
        reply.u32(DEVICE_INFO_SIZE);
        reply.u32(DEVICE_FLAGS);
        for number in [self.device.regions().len().max(region::COUNT), Kind::ALL.len()] {
            reply.u32(u32::try_from(number).map_err(|_| Errno::OVERFLOW)?);
        }
        Ok(())
    }

    /// The client asks twice: first with room for the fixed part, whose `argsz` tells how much the whole takes,
    /// then with that room. The descriptor comes with the whole.
    pub(super) fn region_info(
        &self,
        mut fields: Fields<'_>,
        descriptors: bool,
        reply: &mut Reply,
    ) -> Result<(), Errno> {
        let room = room(&mut fields, REGION_INFO_SIZE)?;
        let (_flags, index) = (fields.u32()?, fields.u32()?);
        fields.bytes(20)?;
        let number = usize::try_from(index).map_err(|_| Errno::INVAL)?;
        if number >= self.device.regions().len().max(region::COUNT) {
            return Err(Errno::INVAL);
        }
        let Region { size, read, write, memory } = self.region(number);
        let memory = memory.filter(|_| descriptors);
        let mut flags = if read { REGION_READ } else { 0 } | if write { REGION_WRITE } else { 0 };
        let (mut needed, mut capabilities) = (REGION_INFO_SIZE, 0);
        if memory.is_some() {
            flags |= REGION_MMAP | REGION_CAPABILITIES;
            (needed, capabilities) = (REGION_INFO_SIZE + SPARSE_MMAP_SIZE, REGION_INFO_SIZE);
        }
        let bytes = &mut reply.bytes;
        [needed, flags, index, capabilities].into_iter().for_each(|word| bytes.u32(word));
        bytes.u64(size);
        bytes.u64(0);
        if memory.is_some() && room >= needed {
            sparse_mmap(size, bytes);
            reply.descriptor = memory;
        }
        Ok(())
    }

    pub(super) fn irq_info(&self, mut fields: Fields<'_>, reply: &mut Vec<u8>) -> Result<(), Errno> {
        room(&mut fields, IRQ_INFO_SIZE)?;
        let (_flags, index, _count) = (fields.u32()?, fields.u32()?, fields.u32()?);
        let kind = kind(index)?;
        let flags = match kind {
            Kind::Intx => IRQ_EVENTFD | IRQ_MASKABLE | IRQ_AUTOMASKED,
            Kind::Msi | Kind::Msix => IRQ_EVENTFD | IRQ_MASKABLE,
            Kind::Error | Kind::Request => IRQ_EVENTFD,
        };
        let count = u32::try_from(self.interrupts.count(kind)).map_err(|_| Errno::OVERFLOW)?;
        [IRQ_INFO_SIZE, flags, index, count].into_iter().for_each(|word| reply.u32(word));
        Ok(())
    }
}

/// The kind of interrupt of a VFIO index.
pub(super) fn kind(index: u32) -> Result<Kind, Errno> {
    let index = usize::try_from(index).map_err(|_| Errno::INVAL)?;
    Kind::ALL.get(index).copied().ok_or(Errno::INVAL)
}

/// The room the client has for the payload of the reply, `argsz`, which must take the fixed part.
fn room(fields: &mut Fields<'_>, fixed: u32) -> Result<u32, Errno> {
    let room = fields.u32()?;
    if room >= fixed { Ok(room) } else { Err(Errno::INVAL) }
}

/// The capability that lets clients map the whole region. Without it they map nothing.
fn sparse_mmap(size: u64, reply: &mut Vec<u8>) {
    reply.u16(SPARSE_MMAP);
    reply.u16(1);
    let (next, areas, reserved) = (0, 1, 0);
    [next, areas, reserved].into_iter().for_each(|word| reply.u32(word));
    reply.u64(0);
    reply.u64(size);
}
