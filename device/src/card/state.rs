//! The state that the register window shows and the engine changes.

use std::time::Duration;

use vg500_engine::{Renderer, Report};
use vg500_regs::pci::Vector;
use vg500_regs::table::*;
use vg500_regs::{Fault, FaultCode, Field, Register};

use super::bus::Bus;
use super::commands::Commands;
use super::registers::{RegisterFile, in_status_block};

/// The causes of interrupts: the same bits in `STATUS`, `ACKNOWLEDGE` and `INTERRUPT_ENABLE`.
const CAUSES: [(Field, Vector); 3] = [
    (status::FRAME_PENDING, Vector::Frame),
    (status::TRANSFER_PENDING, Vector::Transfer),
    (status::FAULT_PENDING, Vector::Fault),
];

/// What the card is made of; it stands in registers from the beginning.
#[derive(Clone, Copy, Debug)]
pub(super) struct Identity {
    /// Its renderer.
    pub(super) renderer: Renderer,
    /// Bytes of voxel memory.
    pub(super) voxel_memory: u32,
}

/// What the host has not been told yet.
#[derive(Debug)]
pub(super) struct News {
    /// The status block, and where its copy goes.
    pub(super) copy: Option<(u64, [u8; STATUS_BLOCK])>,
    /// Causes of interrupts.
    causes: u32,
}

/// Registers and commands.
///
/// Each change ends with [`commit`](Self::commit), so that what belongs together raises `SEQUENCE` once.
#[derive(Debug)]
pub(super) struct State {
    identity: Identity,
    registers: RegisterFile,
    /// Commands that wait or run.
    pub(super) commands: Commands,
    /// Whether somebody is telling the host.
    pub(super) publishing: bool,
    changed: bool,
    copy_to: Option<u64>,
    copy_due: bool,
    causes: u32,
}

impl State {
    /// Power-on state.
    pub(super) fn new(identity: Identity) -> Self {
        let mut state = Self {
            identity,
            registers: RegisterFile::new(),
            commands: Commands::default(),
            publishing: false,
            changed: false,
            copy_to: None,
            copy_due: false,
            causes: 0,
        };
        state.power_on();
        state
    }

    /// Registers as after power-on, and nothing to tell the host. Commands stay.
    pub(super) fn power_on(&mut self) {
        self.registers = RegisterFile::new();
        self.registers.set(renderer::KIND, self.identity.renderer.code());
        self.registers.set(architecture::KIND, 1);
        self.registers.set(simd_level::LEVEL, self.identity.renderer.simd_code());
        self.registers.set(threads::COUNT, self.identity.renderer.threads() as u32);
        self.registers.set(voxel_memory_size::BYTES, self.identity.voxel_memory);
        self.be_silent();
        self.changed = false;
    }

    /// Tells the host nothing more.
    pub(super) fn be_silent(&mut self) {
        (self.copy_to, self.copy_due, self.causes) = (None, false, 0);
    }

    /// The registers, to read.
    pub(super) const fn registers(&self) -> &RegisterFile {
        &self.registers
    }

    /// The client latches a word.
    pub(super) fn latch(&mut self, offset: u32, word: u32) {
        self.registers.set_word(offset, word);
    }

    /// Ends a change. Returns whether there is news for the host.
    pub(super) fn commit(&mut self) -> bool {
        self.show(status::BUSY, u32::from(!self.commands.is_empty()));
        if std::mem::take(&mut self.changed) {
            let sequence = self.registers.get(status::SEQUENCE).wrapping_add(1);
            self.registers.set(status::SEQUENCE, sequence);
            self.copy_due = self.copy_to.is_some();
        }
        self.has_news()
    }

    /// Whether the host has something to be told.
    pub(super) const fn has_news(&self) -> bool {
        self.copy_due || self.causes != 0
    }

    /// Takes what the host is to be told.
    pub(super) fn take_news(&mut self) -> Option<News> {
        if !self.has_news() {
            return None;
        }
        let copy_due = std::mem::take(&mut self.copy_due);
        let copy = self.copy_to.filter(|_| copy_due).map(|to| (to, self.registers.status_block()));
        Some(News { copy, causes: std::mem::take(&mut self.causes) })
    }

    /// Raises the interrupts of causes that are enabled and have not been acknowledged meanwhile.
    pub(super) fn interrupt(&self, news: &News, bus: &dyn Bus) {
        let due = news.causes & self.registers.word(status::REGISTER.offset);
        self.enabled(due).for_each(|vector| bus.raise(vector));
    }

    /// `INTERRUPT_ENABLE` has been latched: causes that are pending already interrupt at once.
    pub(super) fn enable_interrupts(&mut self, bus: &dyn Bus) {
        let enabled = self.registers.word(interrupt_enable::REGISTER.offset);
        for (cause, vector) in CAUSES {
            let bit = cause.mask();
            if enabled & bit == 0 {
                bus.lower(vector);
            } else {
                self.causes |= self.registers.word(status::REGISTER.offset) & bit;
            }
        }
    }

    /// Clears bits of `STATUS`, and the interrupts that they cause.
    pub(super) fn acknowledge(&mut self, bits: u32, bus: &dyn Bus) {
        self.show_word(status::REGISTER, 0, self.registers.word(status::REGISTER.offset) & !bits);
        let gone = CAUSES.iter().filter(|(cause, _)| bits & cause.mask() != 0);
        gone.for_each(|(_, vector)| bus.lower(*vector));
    }

    /// `STATUS_CONTROL` has been latched: starts copying to the latched address, at once, or stops it.
    pub(super) fn control_copy(&mut self) {
        let address = self.registers.wide(status_address_low::REGISTER, status_address_high::REGISTER);
        self.copy_to = (self.registers.get(status_control::ENABLE) != 0).then_some(address);
        self.copy_due = self.copy_to.is_some();
    }

    /// The status copy cannot be written; it stops.
    pub(super) fn fail_copy(&mut self) {
        self.copy_to = None;
        self.fail(Fault::new(FaultCode::HostMemory, status_address_low::ADDRESS));
    }

    /// A mistake in strict mode.
    pub(super) fn count_mistake(&mut self) {
        self.show(status::MISTAKE, 1);
        self.show(mistakes::COUNT, self.registers.get(mistakes::COUNT).wrapping_add(1));
    }

    /// A frame has ended; `place` is that of its base plane, if it has one.
    pub(super) fn end_frame(
        &mut self,
        tag: u16,
        place: Option<usize>,
        time: Duration,
        result: Result<Report, Fault>,
    ) {
        if let Some(place) = place {
            let tag = plane_state::TAG.put(tag.into());
            self.report(place, tag, time, result.unwrap_or_default());
            self.show_word(plane_fault::REGISTER, place, fault_word(result.err()));
            self.show_word(plane_state::REGISTER, place, tag | plane_state::RESULT.put(code(&result)));
        }
        if let Err(Fault { code: FaultCode::QueueFull, .. }) = result {
            self.show(status::QUEUE_FULL, 1);
        }
        self.end(status::FRAME_PENDING, result.err());
    }

    /// A transfer has ended.
    pub(super) fn end_transfer(&mut self, tag: u16, result: Result<(), Fault>) {
        if let Err(Fault { code: FaultCode::QueueFull, .. }) = result {
            self.show(status::QUEUE_FULL, 1);
        }
        self.show_word(transfer_fault::REGISTER, 0, fault_word(result.err()));
        let state = transfer_state::TAG.put(tag.into()) | transfer_state::RESULT.put(code(&result));
        self.show_word(transfer_state::REGISTER, 0, state);
        self.end(status::TRANSFER_PENDING, result.err());
    }

    fn end(&mut self, cause: Field, fault: Option<Fault>) {
        self.show(completed::COUNT, self.registers.get(completed::COUNT).wrapping_add(1));
        if let Some(fault) = fault {
            self.fail(fault);
        }
        self.show(cause, 1);
        self.causes |= cause.mask();
    }

    fn fail(&mut self, fault: Fault) {
        self.show_word(last_fault::REGISTER, 0, fault.to_word());
        self.show(status::FAULT_PENDING, 1);
        self.causes |= status::FAULT_PENDING.mask();
    }

    fn report(&mut self, place: usize, tag: u32, time: Duration, report: Report) {
        let nanoseconds = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        let [low, high] = [|wide: u64| wide as u32, |wide: u64| (wide >> 32) as u32];
        let count = |count: u64| u32::try_from(count).unwrap_or(u32::MAX);
        let words = [
            (report_tag::REGISTER, tag),
            (report_samples_low::REGISTER, low(report.samples)),
            (report_samples_high::REGISTER, high(report.samples)),
            (report_processed_low::REGISTER, low(report.processed)),
            (report_processed_high::REGISTER, high(report.processed)),
            (report_time_low::REGISTER, low(nanoseconds)),
            (report_time_high::REGISTER, high(nanoseconds)),
            (report_cycles_low::REGISTER, low(report.cycles)),
            (report_cycles_high::REGISTER, high(report.cycles)),
            (report_omitted::REGISTER, report.omitted),
            (report_empty::REGISTER, count(report.left_out.empty)),
            (report_finished::REGISTER, count(report.left_out.finished)),
            (report_checksum::REGISTER, report.checksum),
            (report_hidden::REGISTER, count(report.left_out.hidden)),
            (report_transparent::REGISTER, count(report.left_out.transparent)),
            (report_blocks::REGISTER, count(report.left_out.blocks)),
            (report_blocks_left_out::REGISTER, count(report.left_out.blocks_left_out)),
            (report_rays_finished::REGISTER, count(report.left_out.rays_finished)),
        ];
        words.into_iter().for_each(|(register, word)| self.registers.set_at(register, place, word));
    }

    /// Sets a field of the status block.
    fn show(&mut self, field: Field, value: u32) {
        let rest = self.registers.word(field.register) & !field.mask();
        self.show_at(field.register, rest | field.put(value));
    }

    /// Sets a word of the status block.
    fn show_word(&mut self, register: Register, index: usize, word: u32) {
        if let Ok(index) = u32::try_from(index) {
            self.show_at(register.at(index), word);
        }
    }

    fn show_at(&mut self, offset: u32, word: u32) {
        debug_assert!(in_status_block(offset));
        self.changed |= self.registers.word(offset) != word;
        self.registers.set_word(offset, word);
    }

    fn enabled(&self, causes: u32) -> impl Iterator<Item = Vector> {
        let due = causes & self.registers.word(interrupt_enable::REGISTER.offset);
        CAUSES.into_iter().filter(move |(cause, _)| due & cause.mask() != 0).map(|(_, vector)| vector)
    }
}

fn fault_word(fault: Option<Fault>) -> u32 {
    fault.map_or(0, |fault| fault.to_word())
}

const fn code<T>(result: &Result<T, Fault>) -> u32 {
    match result {
        Ok(_) => result::DONE,
        Err(_) => result::FAILED,
    }
}
