//! What a client asks for, request by request. Framing and replies are the connection's affair.

mod access;
mod information;
mod interrupts;
mod memory;

use std::os::fd::OwnedFd;
use std::sync::Arc;

use rustix::io::Errno;

use super::messages::Messages;
use super::socket::{Descriptors, MAX_DESCRIPTORS};
use super::version::{self, Limits};
use super::wire::{Command, Fields};
use super::{Device, Region, ResetReason};
use crate::backing::Backing;
use crate::dma::DmaTable;
use crate::interrupt::Interrupts;

/// The reply to a request, header aside.
#[derive(Debug, Default)]
pub(super) struct Reply {
    /// The message; handlers append the payload.
    pub(super) bytes: Vec<u8>,
    /// Memory whose descriptor goes with it.
    pub(super) descriptor: Option<Arc<Backing>>,
}

/// The state of one client's requests.
pub(super) struct Session<'a, D> {
    pub(super) device: &'a mut D,
    pub(super) dma: &'a DmaTable,
    pub(super) interrupts: &'a Interrupts,
    pub(super) messages: Arc<Messages>,
    limits: Option<Limits>,
}

impl<'a, D: Device> Session<'a, D> {
    pub(super) fn new(
        device: &'a mut D,
        dma: &'a DmaTable,
        interrupts: &'a Interrupts,
        messages: Arc<Messages>,
    ) -> Self {
        Self { device, dma, interrupts, messages, limits: None }
    }

    /// Carries out one request and appends the payload of its reply.
    ///
    /// # Errors
    ///
    /// What the error reply says. Requests come after the negotiation, which succeeds once.
    pub(super) fn request(
        &mut self,
        code: u16,
        payload: &[u8],
        descriptors: Descriptors,
        reply: &mut Reply,
    ) -> Result<(), Errno> {
        let command = Command::request(code).ok_or(Errno::OPNOTSUPP)?;
        let allowed = match command {
            Command::DmaMap => 1,
            Command::SetIrqs => MAX_DESCRIPTORS,
            _ => 0,
        };
        if descriptors.surplus || descriptors.taken.len() > allowed {
            return Err(Errno::INVAL);
        }
        if command == Command::Version {
            return self.negotiate(payload, reply);
        }
        let limits = self.limits.ok_or(Errno::INVAL)?;
        self.dispatch(command, limits, Fields(payload), descriptors.taken, reply)
    }

    fn negotiate(&mut self, payload: &[u8], reply: &mut Reply) -> Result<(), Errno> {
        if self.limits.is_some() {
            return Err(Errno::INVAL);
        }
        let limits = version::negotiate(payload)?;
        self.messages.limit(limits.transfer);
        self.limits = Some(limits);
        version::answer(limits, &mut reply.bytes);
        Ok(())
    }

    fn dispatch(
        &mut self,
        command: Command,
        limits: Limits,
        fields: Fields<'_>,
        descriptors: Vec<OwnedFd>,
        reply: &mut Reply,
    ) -> Result<(), Errno> {
        match command {
            Command::DmaMap => self.dma_map(fields, descriptors),
            Command::DmaUnmap => self.dma_unmap(fields, &mut reply.bytes),
            Command::GetInfo => self.device_info(fields, &mut reply.bytes),
            Command::GetRegionInfo => self.region_info(fields, limits.descriptors, reply),
            Command::GetIrqInfo => self.irq_info(fields, &mut reply.bytes),
            Command::SetIrqs => self.set_irqs(fields, descriptors),
            Command::RegionRead => self.region_read(fields, &mut reply.bytes),
            Command::RegionWrite => self.region_write(fields, &mut reply.bytes),
            Command::RegionWriteMulti if limits.write_multiple => {
                self.region_write_multi(fields, &mut reply.bytes)
            }
            Command::Reset => {
                self.device.reset(ResetReason::Device);
                Ok(())
            }
            Command::Version | Command::DmaRead | Command::DmaWrite | Command::RegionWriteMulti => {
                Err(Errno::OPNOTSUPP)
            }
        }
    }

    /// A region of the device, of size 0 if it does not have it.
    fn region(&self, index: usize) -> Region {
        self.device.regions().get(index).cloned().unwrap_or_default()
    }
}
