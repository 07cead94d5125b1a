//! The words of the register window: what the client has latched, and what the card shows.

use vg500_regs::frame_registers::{FRAME_END, FRAME_START};
use vg500_regs::table::{self, REGISTERS, STATUS_BLOCK};
use vg500_regs::{Field, FrameRegisters, Register};

/// Words up to the end of the last report block.
const WORDS: usize = 0x1800 / 4;

/// All words, by offset / 4.
#[derive(Clone, Debug)]
pub(super) struct RegisterFile(Box<[u32; WORDS]>);

impl RegisterFile {
    /// Power-on state as the table has it. What the card is made of is filled in by its maker.
    pub(super) fn new() -> Self {
        let mut file = Self(Box::new([0; WORDS]));
        for register in REGISTERS {
            (0..register.count).for_each(|index| file.set_word(register.at(index), register.reset));
        }
        file
    }

    /// The word at a byte offset; zero where there is none.
    pub(super) fn word(&self, offset: u32) -> u32 {
        place(offset).and_then(|place| self.0.get(place)).copied().unwrap_or(0)
    }

    /// Sets the word at a byte offset; ignored where there is none.
    pub(super) fn set_word(&mut self, offset: u32, word: u32) {
        if let Some(stored) = place(offset).and_then(|place| self.0.get_mut(place)) {
            *stored = word;
        }
    }

    /// Sets word `index` of a register's array.
    pub(super) fn set_at(&mut self, register: Register, index: usize, word: u32) {
        if let Some(index) = u32::try_from(index).ok().filter(|&index| index < register.count) {
            self.set_word(register.at(index), word);
        }
    }

    /// The value of a field of a plain register.
    pub(super) fn get(&self, field: Field) -> u32 {
        field.get(self.word(field.register))
    }

    /// Sets a field of a plain register.
    pub(super) fn set(&mut self, field: Field, value: u32) {
        let rest = self.word(field.register) & !field.mask();
        self.set_word(field.register, rest | field.put(value));
    }

    /// The 64-bit value of two registers.
    pub(super) fn wide(&self, low: Register, high: Register) -> u64 {
        u64::from(self.word(high.offset)) << 32 | u64::from(self.word(low.offset))
    }

    /// The frame registers.
    pub(super) fn frame(&self) -> FrameRegisters {
        let mut frame = FrameRegisters::default();
        for offset in (FRAME_START..FRAME_END).step_by(4) {
            frame.write(offset, self.word(offset));
        }
        frame
    }

    /// The status block as it goes to host memory.
    pub(super) fn status_block(&self) -> [u8; STATUS_BLOCK] {
        let mut block = [0; STATUS_BLOCK];
        for (place, word) in block.as_chunks_mut().0.iter_mut().zip(self.0.iter()) {
            *place = word.to_le_bytes();
        }
        block
    }
}

/// Whether a change of the word at `offset` changes the status block.
pub(super) fn in_status_block(offset: u32) -> bool {
    offset < STATUS_BLOCK as u32
}

fn place(offset: u32) -> Option<usize> {
    if offset.is_multiple_of(4) { usize::try_from(offset / 4).ok() } else { None }
}

const _: () = assert!(table::report_rays_finished::REGISTER.at(15) as usize + 4 <= 4 * WORDS);

#[cfg(test)]
mod tests {
    use super::*;
    use vg500_regs::table::*;

    #[test]
    fn words_that_do_not_exist_are_zero_and_stay_so() {
        let mut file = RegisterFile::new();
        for offset in [1, 0x1800, 0xfffc, u32::MAX, u32::MAX - 3] {
            file.set_word(offset, 5);
            assert_eq!(file.word(offset), 0);
        }
        file.set_at(plane_state::REGISTER, 16, 5);
        assert_eq!(file.word(plane_fault::REGISTER.offset), 0);
    }

    #[test]
    fn power_on_state_is_that_of_the_table_everywhere() {
        let file = RegisterFile::new();
        for register in REGISTERS {
            assert!((0..register.count).all(|index| file.word(register.at(index)) == register.reset));
        }
        assert_eq!(file.frame(), FrameRegisters::default());
    }

    #[test]
    fn the_status_block_is_the_first_words() {
        let mut file = RegisterFile::new();
        file.set(status::BUSY, 1);
        file.set_at(plane_fault::REGISTER, 15, 0x0403_0201);
        let block = file.status_block();
        assert_eq!(block[0], 1);
        assert_eq!(block[STATUS_BLOCK - 4..], [1, 2, 3, 4]);
    }
}
