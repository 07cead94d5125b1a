//! Frames: submit, wait, cancel.

use std::time::Duration;

use vg500_regs::memory::covered_planes;
use vg500_regs::table::{accumulators, cancel, output, plane_state, start, table_select};
use vg500_regs::{FaultCode, FrameRegisters};

use crate::burst::bursts;
use crate::card::State;
use crate::flight::Flight;
use crate::plane::{BasePlane, mask};
use crate::promise::BoundVolume;
use crate::status::{Outcome, Source};
use crate::{Card, Error, lock};

/// How long a cancelled frame may take to end; the card promises a second.
pub(crate) const GRACE: Duration = Duration::from_secs(2);

/// A frame that was submitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Ticket {
    /// The first 32-bit base plane that it covers.
    pub(crate) place: u32,
    number: u64,
}

impl Ticket {
    /// The tag of the frame's start command, by which the card names it in its trace.
    #[must_use]
    pub fn tag(&self) -> u16 {
        self.number as u16
    }

    pub(crate) fn name(&self) -> String {
        format!("frame {} at base plane {}", self.tag(), self.place)
    }
}

impl Card {
    /// Has the card render what `wanted` describes into a base plane, and returns at once.
    ///
    /// `TABLE_SELECT`, `OUTPUT.PLANE_FORMAT` and `START` are the driver's: it sets them by the tables loaded
    /// last, the base plane, and by whether voxel memory has changed since the last frame of the volume.
    /// Registers and tables are the caller's again at once; voxel memory is read while the frame runs.
    ///
    /// # Errors
    ///
    /// [`Error::PlaneBusy`] if a frame or transfer on the base plane, or on that whose accumulators the frame
    /// begins with, has not ended; reserved bits; a dead card. What the card itself refuses, [`wait`](Self::wait)
    /// reports.
    pub fn submit(&self, plane: &BasePlane, wanted: &FrameRegisters) -> Result<Ticket, Error> {
        self.check_owner(plane)?;
        let mut guard = lock(&self.state);
        let state = &mut *guard;
        self.retire(&mut state.slots, &mut state.promises, Source::Copy)?;
        check_idle(state, plane, wanted)?;

        let place = plane.covers().start;
        let volume = BoundVolume::of(wanted);
        let number = state.slots.at(place).number() + 1;
        let mut wanted = wanted.clone();
        wanted.write(table_select::REGISTER.offset, state.tables.selected());
        wanted.set(output::PLANE_FORMAT, plane.format() as u32);
        let command = start::PLANE.put(plane.index())
            | start::VOXELS_UNCHANGED.put(state.promises.hold_for(&volume).into())
            | start::TAG.put(u32::from(number as u16));
        wanted.write(start::REGISTER.offset, command);

        for burst in bursts(&state.shadow, &wanted, self.transport.bursts())? {
            self.transport.write_registers(burst.offset, &burst.words)?;
            let offsets = (burst.offset..).step_by(4);
            offsets.zip(burst.words).for_each(|(offset, word)| state.shadow.write(offset, word));
        }
        state.slots.at(place).start(Flight {
            planes: mask(plane.covers()),
            tables: state.tables.selected(),
            voxels: volume.voxels.clone(),
        });
        state.promises.rendered(volume);
        Ok(Ticket { place, number })
    }

    /// Waits until a frame has ended. Its pixels are then in pixel memory.
    ///
    /// A frame that does not end within `timeout` is cancelled, which takes two seconds at most.
    ///
    /// # Errors
    ///
    /// [`Error::Refused`] if the card refused the frame (it names the field), failed, or it was cancelled;
    /// [`Error::Timeout`], [`Error::Stuck`], or a dead card.
    pub fn wait(&self, ticket: Ticket, timeout: Duration) -> Result<(), Error> {
        let refused = |fault| Error::Refused { what: ticket.name(), fault };
        if let Some(outcome) = self.poll_until(timeout, |source| self.outcome(ticket, source))? {
            return outcome.map_err(refused);
        }
        self.cancel(ticket)?;
        match self.poll_until(GRACE, |source| self.outcome(ticket, source))? {
            None => Err(Error::Stuck { what: ticket.name() }),
            Some(Err(fault)) if fault.code == FaultCode::Cancelled => {
                Err(Error::Timeout { what: ticket.name(), timeout })
            }
            Some(outcome) => outcome.map_err(refused),
        }
    }

    /// Whether a frame has ended, well or not; does not wait.
    ///
    /// # Errors
    ///
    /// [`Error::StaleTicket`], or a dead card.
    pub fn has_ended(&self, ticket: Ticket) -> Result<bool, Error> {
        Ok(self.outcome(ticket, Source::Copy)?.is_some())
    }

    /// Cancels a frame unless it has ended; returns at once. [`wait`](Self::wait) then reports it as cancelled,
    /// unless it was faster.
    ///
    /// # Errors
    ///
    /// [`Error::StaleTicket`], or a dead card.
    pub fn cancel(&self, ticket: Ticket) -> Result<(), Error> {
        // The lock keeps the base plane from being rendered again meanwhile.
        let mut state = lock(&self.state);
        match state.outcome(ticket)? {
            Some(_) => Ok(()),
            None => {
                let planes = cancel::PLANES.put(1 << ticket.place);
                self.transport.write_registers(cancel::REGISTER.offset, &[planes])
            }
        }
    }

    /// How a frame ended, or `None` while it runs.
    pub(crate) fn outcome(&self, ticket: Ticket, source: Source) -> Result<Option<Outcome>, Error> {
        let mut guard = lock(&self.state);
        let state = &mut *guard;
        if let Some(outcome) = state.outcome(ticket)? {
            return Ok(Some(outcome));
        }
        self.retire(&mut state.slots, &mut state.promises, source)?;
        state.outcome(ticket)
    }
}

impl State {
    fn outcome(&mut self, ticket: Ticket) -> Result<Option<Outcome>, Error> {
        let slot = self.slots.at(ticket.place);
        if slot.number() != ticket.number {
            return Err(Error::StaleTicket { place: ticket.place });
        }
        Ok(slot.outcome())
    }
}

/// Refuses a frame whose base planes are in use. `START` or `ACCUMULATORS` would be, too, by the card; but the
/// frame in the way would no longer be told from it.
fn check_idle(state: &State, plane: &BasePlane, wanted: &FrameRegisters) -> Result<(), Error> {
    let busy = |index, planes| {
        let in_use = state.slots.busy_planes() | planes;
        (mask(covered_planes(plane.format(), index)) & in_use != 0)
            .then_some(Error::PlaneBusy { plane: index, bytes: plane.format().bytes() })
    };
    let source = (wanted.get(accumulators::ENABLE) != 0).then(|| wanted.get(accumulators::SOURCE));
    busy(plane.index(), state.transferred).or_else(|| busy(source?, 0)).map_or(Ok(()), Err)
}

#[cfg(test)]
mod tests;

// A tag of 16 bits is the end of a ticket's number.
const _: () = assert!(start::TAG.bits == 16 && plane_state::TAG.bits == 16);
