//! What the card reports about a frame.

use std::time::Duration;

use vg500_regs::Register;
use vg500_regs::limit::{BASE_PLANE_SIZE, SUPERSAMPLING, VOLUME_SIZE};
use vg500_regs::table::{
    report_blocks, report_blocks_left_out, report_checksum, report_cycles_high, report_hidden,
    report_omitted, report_processed_high, report_rays_finished, report_samples_high, report_samples_low,
    report_transparent,
};

use crate::status::Source;
use crate::{Card, Error, Ticket, lock};

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

/// How much of a frame was left out, beyond what [`Report`] tells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Samples left out because cropping, cut plane, sub-volume or block range hide their block.
    pub hidden: u64,
    /// Samples classified but not shaded, because all of their block turned out transparent.
    pub transparent: u64,
    /// Blocks of samples.
    pub blocks: u64,
    /// Blocks of samples that were left out.
    pub blocks_left_out: u64,
    /// Rays that were found unable to change before their end.
    pub rays_finished: u64,
}

impl core::ops::AddAssign for LeftOut {
    fn add_assign(&mut self, other: Self) {
        self.hidden += other.hidden;
        self.transparent += other.transparent;
        self.blocks += other.blocks;
        self.blocks_left_out += other.blocks_left_out;
        self.rays_finished += other.rays_finished;
    }
}

impl Report {
    /// What the engine left out, by the names of the fields of `REPORT_OMITTED`.
    pub fn left_out(&self) -> impl Iterator<Item = &'static str> {
        let omitted = self.omitted;
        let fields = report_omitted::REGISTER.fields.iter();
        fields.filter(move |field| field.get(omitted) != 0).map(|field| field.name)
    }
}

/// Words from the first on that no frame fills: fewer than 2^32 samples and cycles are possible.
const ALWAYS_ZERO: [u32; 3] = {
    let first = report_samples_low::REGISTER.offset;
    [
        report_samples_high::REGISTER.offset - first,
        report_processed_high::REGISTER.offset - first,
        report_cycles_high::REGISTER.offset - first,
    ]
};
const _: () = {
    let rays = (BASE_PLANE_SIZE as u64).pow(2);
    let voxels = (VOLUME_SIZE as u64).pow(3);
    let samples = VOLUME_SIZE as u64 * SUPERSAMPLING as u64;
    assert!(rays * samples <= u32::MAX as u64 && voxels * SUPERSAMPLING as u64 <= u32::MAX as u64);
};

/// What [`Card::left_out`] reads; each follows the one before.
const LEFT_OUT: [Register; 5] = [
    report_hidden::REGISTER,
    report_transparent::REGISTER,
    report_blocks::REGISTER,
    report_blocks_left_out::REGISTER,
    report_rays_finished::REGISTER,
];
const _: () = assert!(LEFT_OUT[4].offset - LEFT_OUT[0].offset == 4 * 4);

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
        let words = self.report_words(report_samples_low::REGISTER.at(ticket.place))?;
        self.own(ticket)?;
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

    /// How much was left out of a frame that has ended, until the base plane is rendered again.
    ///
    /// # Errors
    ///
    /// As [`Card::report`].
    pub fn left_out(&self, ticket: Ticket) -> Result<LeftOut, Error> {
        if self.outcome(ticket, Source::Copy)?.is_none() {
            return Err(Error::NotEnded { what: ticket.name() });
        }
        let mut words = [0; LEFT_OUT.len()];
        if self.transport.bursts() {
            self.transport.read_registers(LEFT_OUT[0].at(ticket.place), &mut words)?;
        } else {
            for (register, word) in LEFT_OUT.iter().zip(&mut words) {
                *word = self.transport.read_register(register.at(ticket.place))?;
            }
        }
        self.own(ticket)?;
        let [hidden, transparent, blocks, blocks_left_out, rays_finished] = words.map(u64::from);
        Ok(LeftOut { hidden, transparent, blocks, blocks_left_out, rays_finished })
    }

    /// That what was read of a frame's report is its own: meanwhile no other has been submitted and the card has not
    /// been reset.
    fn own(&self, ticket: Ticket) -> Result<(), Error> {
        self.outcome(ticket, Source::Copy)?;
        if lock(&self.state).slots.at(ticket.place).wiped() {
            return Err(Error::StaleTicket { place: ticket.place });
        }
        Ok(())
    }

    /// The words of a report from its first on; those that are always zero are not read if that saves anything.
    fn report_words(&self, first: u32) -> Result<[u32; WORDS], Error> {
        let mut words = [0; WORDS];
        if self.transport.bursts() {
            self.transport.read_registers(first, &mut words)?;
            return Ok(words);
        }
        for (offset, word) in (first..).step_by(4).zip(&mut words) {
            if !ALWAYS_ZERO.contains(&(offset - first)) {
                *word = self.transport.read_register(offset)?;
            }
        }
        Ok(words)
    }
}
