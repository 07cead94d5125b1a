//! What the card reports about a frame.

use std::time::Duration;

use vg500_regs::table::{report_checksum, report_omitted, report_samples_low, report_tag};

use crate::status::Source;
use crate::{Card, Error, Ticket};

/// What the card reports about a frame that has ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Samples that exist on the frame's rays.
    pub samples: u64,
    /// Samples that were processed.
    pub samples_processed: u64,
    /// Time in the engine.
    pub engine_time: Duration,
    /// Clock cycles that the real chip would have taken.
    pub cycles: u64,
    /// What the frame did not need and the engine left out: bits of the register `REPORT_OMITTED`.
    pub omitted: u32,
    /// Samples left out because their block cannot be seen; ends at 2^32 - 1.
    pub empty: u32,
    /// Samples left out because their ray can no longer change; ends at 2^32 - 1.
    pub finished: u32,
    /// CRC-32 (IEEE) of the rendered rectangle's stored pixels, row by row.
    pub checksum: u32,
}

impl Report {
    /// What the engine left out, by the names of the fields of `REPORT_OMITTED`.
    pub fn left_out(&self) -> impl Iterator<Item = &'static str> {
        let omitted = self.omitted;
        let fields = report_omitted::REGISTER.fields.iter();
        fields.filter(move |field| field.get(omitted) != 0).map(|field| field.name)
    }
}

const WORDS: usize =
    (report_checksum::REGISTER.offset - report_samples_low::REGISTER.offset) as usize / 4 + 1;

impl Card {
    /// What the card reports about a frame that has ended, until the base plane is rendered again.
    ///
    /// # Errors
    ///
    /// [`Error::StaleTicket`], [`Error::NotEnded`], or a dead card.
    pub fn report(&self, ticket: Ticket) -> Result<Report, Error> {
        if self.outcome(ticket, Source::Copy)?.is_none() {
            return Err(Error::NotEnded { what: ticket.name() });
        }
        let mut words = [0; WORDS];
        self.transport.read_registers(report_samples_low::REGISTER.at(ticket.place), &mut words)?;
        let tag = self.transport.read_register(report_tag::REGISTER.at(ticket.place))?;
        if report_tag::TAG.get(tag) != u32::from(ticket.tag()) {
            return Err(Error::StaleTicket { place: ticket.place });
        }
        let [s0, s1, p0, p1, t0, t1, c0, c1, omitted, empty, finished, checksum] = words;
        let wide = |low: u32, high: u32| u64::from(high) << 32 | u64::from(low);
        Ok(Report {
            samples: wide(s0, s1),
            samples_processed: wide(p0, p1),
            engine_time: Duration::from_nanos(wide(t0, t1)),
            cycles: wide(c0, c1),
            omitted,
            empty,
            finished,
            checksum,
        })
    }
}
