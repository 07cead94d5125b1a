//! Frames between their start command and their end.

use std::ops::Range;

use vg500_regs::table::{plane_fault, plane_state, reset, table_select};
use vg500_regs::{Fault, FaultCode};

use crate::promise::Promises;
use crate::status::{Outcome, Source};
use crate::{Card, Error};

/// What a frame that runs uses.
#[derive(Clone, Debug)]
pub(crate) struct Flight {
    /// 32-bit base planes, one bit each.
    pub(crate) planes: u32,
    /// The word `TABLE_SELECT` at its start command.
    pub(crate) tables: u32,
    /// Bytes of voxel memory.
    pub(crate) voxels: Range<u64>,
}

/// The last frame that was submitted at a place of `PLANE_STATE`.
#[derive(Clone, Debug)]
pub(crate) struct Slot {
    /// Number of frames that were submitted here. The last 16 bits are the frame's tag.
    number: u64,
    progress: Progress,
    /// Whether the card was reset since, which wipes the report.
    wiped: bool,
}

#[derive(Clone, Debug)]
enum Progress {
    Running(Flight),
    Ended(Outcome),
}

impl Slot {
    const EMPTY: Self = Self { number: 0, progress: Progress::Ended(Ok(())), wiped: true };

    /// Number of the frame.
    pub(crate) fn number(&self) -> u64 {
        self.number
    }

    /// What the frame uses, if it runs.
    pub(crate) fn flight(&self) -> Option<&Flight> {
        match &self.progress {
            Progress::Running(flight) => Some(flight),
            Progress::Ended(_) => None,
        }
    }

    /// How the frame ended, unless it runs.
    pub(crate) fn outcome(&self) -> Option<Outcome> {
        match &self.progress {
            Progress::Running(_) => None,
            Progress::Ended(outcome) => Some(*outcome),
        }
    }

    /// Whether a reset has wiped the frame's report.
    pub(crate) fn wiped(&self) -> bool {
        self.wiped
    }

    /// A frame with the next number has been started.
    pub(crate) fn start(&mut self, flight: Flight) {
        *self = Self { number: self.number + 1, progress: Progress::Running(flight), wiped: false };
    }
}

/// One slot for each 32-bit base plane.
#[derive(Debug)]
pub(crate) struct Slots([Slot; plane_state::REGISTER.count as usize]);

impl Default for Slots {
    fn default() -> Self {
        Self([const { Slot::EMPTY }; _])
    }
}

impl Slots {
    /// The slot of a base plane, by the first 32-bit base plane that it covers.
    pub(crate) fn at(&mut self, place: u32) -> &mut Slot {
        let last = self.0.len() - 1;
        &mut self.0[last.min(place as usize)]
    }

    /// What the frames that run use.
    pub(crate) fn flights(&self) -> impl Iterator<Item = &Flight> {
        self.0.iter().filter_map(Slot::flight)
    }

    /// 32-bit base planes that frames render into, one bit each.
    pub(crate) fn busy_planes(&self) -> u32 {
        self.flights().fold(0, |planes, flight| planes | flight.planes)
    }

    /// Copies of table `bit` of `TABLE_SELECT` that frames were started with.
    pub(crate) fn used_copies(&self, bit: u32) -> [bool; 2] {
        [0, 1].map(|copy| self.flights().any(|flight| flight.tables >> bit & 1 == copy))
    }

    /// The card was reset.
    pub(crate) fn cancel_all(&mut self) {
        let cancelled = Fault::new(FaultCode::Cancelled, reset::KEY);
        for slot in &mut self.0 {
            slot.wiped = true;
            if slot.flight().is_some() {
                slot.progress = Progress::Ended(Err(cancelled));
            }
        }
    }
}

impl Card {
    /// Notes which frames have ended.
    pub(crate) fn retire(
        &self,
        slots: &mut Slots,
        promises: &mut Promises,
        source: Source,
    ) -> Result<(), Error> {
        for (place, slot) in (0..).zip(&mut slots.0).filter(|(_, slot)| slot.flight().is_some()) {
            let registers = (plane_state::REGISTER, plane_fault::REGISTER);
            let tag = slot.number as u16;
            let outcome = self.status.outcome(&*self.transport, source, registers, place, tag)?;
            let Some(outcome) = outcome else { continue };
            if outcome.is_err() {
                // It may have ended before it looked at its voxels.
                *promises = Promises::default();
            }
            slot.progress = Progress::Ended(outcome);
        }
        Ok(())
    }
}

// `used_copies` counts tables by their bit.
const _: () = assert!(table_select::COLOR.low == 0 && table_select::GRADIENT_MAGNITUDE.low == 4);
