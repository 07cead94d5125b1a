//! The registers of the card in memory, and what writing them does.

use std::os::fd::OwnedFd;
use std::sync::Arc;

use vg500_regs::memory::{covered_planes, plane_offset, plane_pitch};
use vg500_regs::pci::{PIXEL_MEMORY, REGISTERS};
use vg500_regs::register::Access;
use vg500_regs::table::*;
use vg500_regs::{Fault, FaultCode, FrameRegisters, PlaneFormat};

use super::{FakeCard, Setup};
use crate::mapping::Mapping;
use crate::status::Outcome;

/// What changes in the card.
#[derive(Default)]
pub(super) struct Inside {
    pub(super) words: Vec<u32>,
    /// Frame registers at each start command, the last frame last.
    pub(super) frames: Vec<FrameRegisters>,
    /// Place and tag of frames that have not ended.
    pub(super) running: Vec<(u32, u16)>,
    /// Tag of a transfer that has not ended.
    pub(super) transferring: Option<u16>,
    pub(super) command: u16,
    pub(super) hold: bool,
    pub(super) ignores_cancel: bool,
    pub(super) refusal: Option<Fault>,
    pub(super) dead: bool,
    /// Offset and number of words of each message that wrote registers.
    pub(super) writes: Vec<(u32, usize)>,
    pub(super) reads: usize,
    pub(super) mistakes: Vec<String>,
    pub(super) host: Vec<(u64, Arc<Mapping>)>,
    pub(super) events: Vec<OwnedFd>,
}

/// Registers after reset.
pub(super) fn reset_words(setup: &Setup) -> Vec<u32> {
    let mut words = vec![0; REGISTERS.size as usize / 4];
    for register in vg500_regs::table::REGISTERS {
        (0..register.count).for_each(|index| words[register.at(index) as usize / 4] = register.reset);
    }
    words[interface_version::REGISTER.offset as usize / 4] = setup.interface;
    words[renderer::REGISTER.offset as usize / 4] = 1;
    words[architecture::REGISTER.offset as usize / 4] = 1;
    words[simd_level::REGISTER.offset as usize / 4] = 2;
    words[threads::REGISTER.offset as usize / 4] = 3;
    words[voxel_memory_size::REGISTER.offset as usize / 4] = setup.bar_sizes[2] as u32;
    words
}

impl Inside {
    fn word(&self, register: vg500_regs::Register) -> u32 {
        self.words[register.offset as usize / 4]
    }

    /// The driver writes a register.
    pub(super) fn write(&mut self, fake: &FakeCard, offset: u32, word: u32) {
        match find(offset) {
            None => self.mistakes.push(format!("{offset:#x} is no register")),
            Some((register, _)) if register.access != Access::WriteOnly => {
                self.mistakes.push(format!("{} is written", register.name));
            }
            Some((register, _)) if word & !register.mask() != 0 => {
                self.mistakes.push(format!("reserved bits of {}: {word:#x}", register.name));
            }
            Some(_) => self.words[offset as usize / 4] = word,
        }
        match offset {
            it if it == start::REGISTER.offset => self.start(word),
            it if it == cancel::REGISTER.offset => self.cancel(word),
            it if it == status_control::REGISTER.offset => self.copy_status(fake.setup.reaches_host_memory),
            it if it == transfer::REGISTER.offset => self.transfer(fake, word),
            _ => {}
        }
    }

    fn start(&mut self, word: u32) {
        let mut frame = FrameRegisters::default();
        for offset in (0x200..0x400).step_by(4) {
            frame.write(offset, self.words[offset as usize / 4]);
        }
        let format = PlaneFormat::from_code(frame.get(output::PLANE_FORMAT)).unwrap();
        let covered = covered_planes(format, start::PLANE.get(word));
        let tag = start::TAG.get(word) as u16;
        if self.running.iter().any(|(place, _)| covered.contains(place)) {
            self.mistakes.push(format!("base plane {} is started while it is in use", covered.start));
        }
        self.frames.push(frame);
        self.running.push((covered.start, tag));
        if let Some(fault) = self.refusal.take() {
            self.running.pop();
            self.end_frame(covered.start, tag, Err(fault));
        } else if !self.hold {
            self.running.pop();
            self.end_frame(covered.start, tag, Ok(()));
        }
    }

    fn cancel(&mut self, word: u32) {
        if self.ignores_cancel {
            return;
        }
        let (cancelled, running) =
            self.running.drain(..).partition(|(place, _)| cancel::PLANES.get(word) >> place & 1 != 0);
        self.running = running;
        for (place, tag) in Vec::from_iter::<Vec<_>>(cancelled) {
            self.end_frame(place, tag, Err(Fault::new(FaultCode::Cancelled, cancel::PLANES)));
        }
        if let Some(tag) = self.transferring.take_if(|_| cancel::TRANSFERS.get(word) != 0) {
            self.end_transfer(tag, Err(Fault::new(FaultCode::Cancelled, cancel::TRANSFERS)));
        }
    }

    /// A frame has ended.
    pub(super) fn end_frame(&mut self, place: u32, tag: u16, outcome: Outcome) {
        self.words[report_tag::REGISTER.at(place) as usize / 4] = tag.into();
        self.end(plane_state::REGISTER.at(place), plane_fault::REGISTER.at(place), tag, outcome);
    }

    fn end_transfer(&mut self, tag: u16, outcome: Outcome) {
        self.end(transfer_state::REGISTER.offset, transfer_fault::REGISTER.offset, tag, outcome);
    }

    fn end(&mut self, state: u32, fault: u32, tag: u16, outcome: Outcome) {
        let result = if outcome.is_ok() { result::DONE } else { result::FAILED };
        self.words[state as usize / 4] = plane_state::TAG.put(tag.into()) | plane_state::RESULT.put(result);
        if let Err(it) = outcome {
            self.words[fault as usize / 4] = it.to_word();
        }
        let sequence = status::SEQUENCE.get(self.words[0]).wrapping_add(1);
        self.words[0] = status::SEQUENCE.put(sequence);
        self.copy_status(true);
        if let Some(event) = self.events.first() {
            rustix::io::write(event, &1u64.to_ne_bytes()).unwrap();
        }
    }

    fn copy_status(&self, reaches: bool) {
        if !reaches || status_control::ENABLE.get(self.word(status_control::REGISTER)) == 0 {
            return;
        }
        let address = (self.word(status_address_low::REGISTER), self.word(status_address_high::REGISTER));
        let Some(copy) = self.host_at(address) else { return };
        for offset in (0..STATUS_BLOCK).rev().filter(|offset| offset % 4 == 0) {
            copy.view().write_u32(offset, self.words[offset / 4]).unwrap();
        }
    }

    fn host_at(&self, (low, high): (u32, u32)) -> Option<&Mapping> {
        let address = u64::from(high) << 32 | u64::from(low);
        Some(&self.host.iter().find(|(start, _)| *start == address)?.1)
    }

    /// Copies RGBA8 as it is; rectangles of buffers that begin at their first byte.
    fn transfer(&mut self, fake: &FakeCard, word: u32) {
        let tag = transfer::TAG.get(word) as u16;
        if let Some(refusal) = self.refusal.take() {
            return self.end_transfer(tag, Err(refusal));
        }
        if self.hold {
            self.transferring = Some(tag);
            return;
        }
        let (origin, size) = (self.word(transfer_origin::REGISTER), self.word(transfer_size::REGISTER));
        let pitch = self.word(transfer_pitch::REGISTER) as usize;
        let address = (self.word(transfer_address_low::REGISTER), self.word(transfer_address_high::REGISTER));
        let Some(target) = self.host_at(address) else {
            let refusal = Fault::new(FaultCode::HostMemory, transfer_address_low::ADDRESS);
            return self.end_transfer(tag, Err(refusal));
        };
        let mut row = vec![0; transfer_size::WIDTH.get(size) as usize * 4];
        let first = plane_offset(
            PlaneFormat::Rgba8,
            transfer::PLANE.get(word),
            transfer_origin::COLUMN.get(origin),
            transfer_origin::ROW.get(origin),
        );
        for index in 0..transfer_size::HEIGHT.get(size) as usize {
            let source = first + index * plane_pitch(PlaneFormat::Rgba8);
            fake.view(PIXEL_MEMORY.index).read(source, &mut row).unwrap();
            target.view().write(index * pitch, &row).unwrap();
        }
        self.end_transfer(tag, Ok(()));
    }
}
