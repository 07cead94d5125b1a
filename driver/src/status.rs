//! The card's status block, and its copy in host memory.

use std::sync::atomic::{AtomicBool, Ordering, fence};
use std::thread;
use std::time::{Duration, Instant};

use vg500_regs::table::{
    STATUS_BLOCK, acknowledge, interrupt_enable, last_fault, plane_state, result, status, status_address_low,
    status_control, transfer_state,
};
use vg500_regs::{Fault, FaultCode, Register};

use crate::Error;
use crate::transport::{HostMemory, Transport};

/// How long the card may take for the first copy of its status.
const FIRST_COPY: Duration = Duration::from_secs(3);

/// How a command ended.
pub(crate) type Outcome = Result<(), Fault>;

/// Where to look at the status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// In host memory, if there is a copy. Costs no message.
    Copy,
    /// In the card's registers.
    Registers,
}

/// The status block.
pub(crate) struct Status {
    copy: Option<Box<dyn HostMemory>>,
    /// Whether the card writes the copy.
    alive: AtomicBool,
}

impl Status {
    /// Status in host memory, or in registers alone if the transport has no host memory.
    pub(crate) fn new(transport: &dyn Transport) -> Result<Self, Error> {
        match transport.host_memory(STATUS_BLOCK) {
            Ok(copy) => Ok(Self { copy: Some(copy), alive: AtomicBool::new(false) }),
            Err(error @ Error::NotSupported { .. }) if !transport.needs_host_memory() => {
                tracing::info!(%error, "the card's status is read from registers");
                Ok(Self { copy: None, alive: AtomicBool::new(false) })
            }
            Err(error) => Err(error),
        }
    }

    /// Whether there is a copy that the card writes.
    pub(crate) fn copied(&self) -> bool {
        self.alive.load(Ordering::Relaxed)
    }

    /// Enables the copy, and all interrupts if the driver receives them: one that nobody expects is trouble to
    /// the system. A copy that does not arrive is given up.
    pub(crate) fn start(&self, transport: &dyn Transport, interrupts: bool) -> Result<(), Error> {
        let causes = if interrupts { interrupt_enable::REGISTER.mask() } else { 0 };
        let address = self.copy.as_ref().map_or(0, |copy| copy.bus_address());
        if let Some(copy) = &self.copy {
            // No status is all ones: its reserved bits are zero.
            copy.view().write(0, &[0xff; STATUS_BLOCK])?;
        }
        transport.write_registers(
            interrupt_enable::REGISTER.offset,
            &[
                causes,
                acknowledge::REGISTER.mask(),
                address as u32,
                (address >> 32) as u32,
                status_control::ENABLE.put(self.copy.is_some().into()),
            ],
        )?;
        let arrives = self.arrives()?;
        self.alive.store(arrives, Ordering::Relaxed);
        if self.copy.is_some() && !arrives && transport.needs_host_memory() {
            return Err(Error::HostMemoryUnreached { timeout: FIRST_COPY });
        }
        if self.copy.is_some() && !arrives {
            tracing::warn!(
                "the card does not reach host memory (in a virtual machine: memory-backend with share=on), its \
                 status is read from registers"
            );
            transport.write_registers(status_control::REGISTER.offset, &[0])?;
        }
        Ok(())
    }

    fn arrives(&self) -> Result<bool, Error> {
        let Some(copy) = &self.copy else { return Ok(false) };
        let end = Instant::now() + FIRST_COPY;
        while copy.view().read_u32(status::REGISTER.offset as usize)? == u32::MAX {
            if Instant::now() >= end {
                return Ok(false);
            }
            thread::sleep(Duration::from_micros(50));
        }
        Ok(true)
    }

    fn word(&self, transport: &dyn Transport, source: Source, offset: u32) -> Result<u32, Error> {
        match &self.copy {
            Some(copy) if source == Source::Copy && self.copied() => {
                let word = copy.view().read_u32(offset as usize)?;
                // What the card stored before the word, pixels above all, is read after it.
                fence(Ordering::Acquire);
                Ok(word)
            }
            _ => transport.read_register(offset),
        }
    }

    /// How the command with `tag` ended, or `None` if it has not. `state` and `fault` are the registers that
    /// tell, and `place` the one of their arrays.
    pub(crate) fn outcome(
        &self,
        transport: &dyn Transport,
        source: Source,
        (state, fault): (Register, Register),
        place: u32,
        tag: u16,
    ) -> Result<Option<Outcome>, Error> {
        let word = self.word(transport, source, state.at(place))?;
        if plane_state::TAG.get(word) != u32::from(tag) {
            return Ok(None);
        }
        match plane_state::RESULT.get(word) {
            result::NONE => Ok(None),
            result::DONE => Ok(Some(Ok(()))),
            // The fault's word may not have been copied yet, so it comes from the register.
            _ => transport.read_register(fault.at(place)).map(|word| Some(Err(decode(word)))),
        }
    }
}

/// The fault of a word; a code that this driver does not know is taken for a defect of the card.
fn decode(word: u32) -> Fault {
    Fault::from_word(word).unwrap_or(Fault {
        code: FaultCode::Internal,
        register: last_fault::OFFSET.get(word) as u16,
        bit: last_fault::BIT.get(word) as u8,
    })
}

// One function looks at frames and transfers.
const _: () = assert!(
    plane_state::TAG.mask() == transfer_state::TAG.mask()
        && plane_state::RESULT.mask() == transfer_state::RESULT.mask()
        && status_control::REGISTER.offset == interrupt_enable::REGISTER.offset + 16
        && status_address_low::REGISTER.offset == interrupt_enable::REGISTER.offset + 8
);
