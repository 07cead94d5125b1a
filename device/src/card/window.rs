//! The register window: what reading and writing its words does.

use vg500_regs::pci::{MSIX_PENDING_OFFSET, MSIX_TABLE_OFFSET};
use vg500_regs::table::{self, *};
use vg500_regs::{Access, Register};

use super::Card;
use super::access::{Part, parts};
use super::commands::Kind;
use super::mistake::Mistake;
use crate::trace::Decoded;

const RESET: u32 = reset::REGISTER.offset;
const CANCEL: u32 = cancel::REGISTER.offset;
const INTERRUPT_ENABLE: u32 = interrupt_enable::REGISTER.offset;
const ACKNOWLEDGE: u32 = acknowledge::REGISTER.offset;
const STATUS_CONTROL: u32 = status_control::REGISTER.offset;
const TRANSFER: u32 = transfer::REGISTER.offset;
const START: u32 = start::REGISTER.offset;
const TRAPPED_READS: u32 = trapped_reads::REGISTER.offset;
const TRAPPED_WRITES: u32 = trapped_writes::REGISTER.offset;

impl Card {
    /// Reads the register window, word by word from the lowest on.
    pub(super) fn read_window(&mut self, offset: u32, data: &mut [u8]) {
        for part in parts(offset, data.len()) {
            let word = match part.word {
                ..MSIX_TABLE_OFFSET => self.read_register(part.word),
                _ => self.read_message_area(part.word),
            };
            let bytes = word.to_le_bytes();
            let target = data.get_mut(part.data).unwrap_or_default();
            target.iter_mut().zip(bytes.iter().skip(part.bytes.start)).for_each(|(to, from)| *to = *from);
        }
    }

    /// Writes the register window, word by word from the lowest on, so that one message can carry a whole
    /// frame with its start command.
    pub(super) fn write_window(&mut self, offset: u32, data: &[u8]) {
        for part in parts(offset, data.len()) {
            let bytes = data.get(part.data.clone()).unwrap_or_default();
            match part.word {
                ..MSIX_TABLE_OFFSET => self.write_part(&part, bytes),
                _ => self.write_message_area(&part, bytes),
            }
        }
    }

    fn read_register(&mut self, offset: u32) -> u32 {
        let Some((register, index)) = table::find(offset) else {
            self.board.trace.line(format_args!("read {offset:#06x}"));
            self.board.mistake(&Mistake::UndocumentedRead(offset));
            return 0;
        };
        if register.access == Access::WriteOnly {
            self.board.trace.line(format_args!("read {}", register.name));
            self.board.mistake(&Mistake::ReadOfWriteOnly(register));
            return u32::MAX;
        }
        let word = match register.offset {
            TRAPPED_READS => self.traffic.reads(index),
            TRAPPED_WRITES => self.traffic.writes(index),
            _ => self.board.look(|state| state.registers().word(offset)),
        };
        self.board.trace.line(format_args!("read {}", Decoded { register, index, word }));
        word
    }

    fn write_part(&mut self, part: &Part, bytes: &[u8]) {
        match bytes.first_chunk() {
            Some(word) if part.is_whole() => self.write_register(part.word, u32::from_le_bytes(*word)),
            _ => {
                let offset = part.word + part.bytes.start as u32;
                self.board.trace.line(format_args!("write {} bytes at {offset:#06x}", bytes.len()));
                self.board.mistake(&Mistake::PartOfWord { offset, bytes: bytes.len() });
            }
        }
    }

    fn write_register(&mut self, offset: u32, word: u32) {
        let Some((register, index)) = table::find(offset) else {
            self.board.trace.line(format_args!("write {offset:#06x} {word:#x}"));
            return self.board.mistake(&Mistake::UndocumentedWrite(offset));
        };
        self.board.trace.line(format_args!("write {}", Decoded { register, index, word }));
        if register.access == Access::ReadOnly {
            return self.board.mistake(&Mistake::WriteToReadOnly(register));
        }
        self.check_reserved(register, word);
        let word = word & register.mask();
        self.board.change(|state| state.latch(offset, word));
        self.carry_out(offset, word);
    }

    fn check_reserved(&self, register: &'static Register, word: u32) {
        let bits = word & !register.mask();
        if bits != 0 {
            self.board.mistake(&Mistake::ReservedBits { register, bits });
        }
    }

    /// What writing a register does, besides that it is latched.
    fn carry_out(&mut self, offset: u32, word: u32) {
        let board = &self.board;
        match offset {
            RESET if word == RESET_KEY => {
                self.power_on();
                self.board.trace.line(format_args!("reset by register"));
            }
            RESET => board.mistake(&Mistake::ResetKey(word)),
            CANCEL => board.cancel(|command| match command.kind {
                Kind::Frame(plane) => cancel::PLANES.get(word) >> plane.place() & 1 != 0,
                Kind::Transfer => cancel::TRANSFERS.get(word) != 0,
            }),
            INTERRUPT_ENABLE => board.change(|state| state.enable_interrupts(&*board.bus)),
            ACKNOWLEDGE => board.change(|state| state.acknowledge(word, &*board.bus)),
            STATUS_CONTROL => board.change(|state| state.control_copy()),
            TRANSFER => self.queue_transfer(transfer::TAG.get(word) as u16),
            START => self.queue_frame(start::TAG.get(word) as u16),
            _ => {}
        }
    }

    /// The MSI-X table and its pending bits, which are memory as PCI describes it.
    fn read_message_area(&self, offset: u32) -> u32 {
        let mut bytes = [0; 4];
        match offset {
            ..MSIX_PENDING_OFFSET => self.msix.read((offset - MSIX_TABLE_OFFSET) as usize, &mut bytes),
            _ => {
                let pending = self.interrupts.pending().to_le_bytes();
                let from = pending.iter().skip((offset - MSIX_PENDING_OFFSET) as usize);
                bytes.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
            }
        }
        self.board.trace.line(format_args!("read {offset:#06x} (MSI-X)"));
        u32::from_le_bytes(bytes)
    }

    /// Pending bits cannot be written.
    fn write_message_area(&mut self, part: &Part, bytes: &[u8]) {
        let offset = part.word + part.bytes.start as u32;
        self.board.trace.line(format_args!("write {} bytes at {offset:#06x} (MSI-X)", bytes.len()));
        if offset < MSIX_PENDING_OFFSET {
            self.msix.write((offset - MSIX_TABLE_OFFSET) as usize, bytes);
        }
    }
}
