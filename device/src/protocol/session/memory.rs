//! The client's memory: `DMA_MAP`, `DMA_UNMAP`.

use std::os::fd::OwnedFd;

use rustix::io::Errno;

use super::Session;
use crate::dma::{Access, Memory};
use crate::protocol::Device;
use crate::protocol::wire::{Append, Fields};

const MAP_READ: u32 = 1;
const MAP_WRITE: u32 = 1 << 1;
const UNMAP_ALL: u32 = 1 << 1;
const UNMAP_SIZE: u32 = 24;

impl<D: Device> Session<'_, D> {
    pub(super) fn dma_map(&mut self, mut fields: Fields<'_>, descriptors: Vec<OwnedFd>) -> Result<(), Errno> {
        let (_argsz, flags) = (fields.u32()?, fields.u32()?);
        let (offset, address, size) = (fields.u64()?, fields.u64()?, fields.u64()?);
        if flags & !(MAP_READ | MAP_WRITE) != 0 {
            return Err(Errno::INVAL);
        }
        let access = Access { read: flags & MAP_READ != 0, write: flags & MAP_WRITE != 0 };
        let memory = match descriptors.into_iter().next() {
            Some(descriptor) => Memory::File { descriptor, offset },
            // Memory that the client keeps to itself, and windows of other devices.
            None => Memory::Messages(self.messages.clone()),
        };
        self.dma.map(address, size, access, memory)
    }

    pub(super) fn dma_unmap(&mut self, mut fields: Fields<'_>, reply: &mut Vec<u8>) -> Result<(), Errno> {
        let (argsz, flags) = (fields.u32()?, fields.u32()?);
        let (address, size) = (fields.u64()?, fields.u64()?);
        match flags {
            _ if argsz < UNMAP_SIZE => return Err(Errno::INVAL),
            0 => self.dma.unmap(address, size)?,
            UNMAP_ALL if address == 0 && size == 0 => self.dma.clear(),
            // Among them the bitmap of dirty pages, which is not kept.
            _ => return Err(Errno::INVAL),
        }
        reply.u32(UNMAP_SIZE);
        reply.u32(flags);
        reply.u64(address);
        reply.u64(size);
        Ok(())
    }
}
