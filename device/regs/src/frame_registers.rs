//! The words a frame is described by: all write-only registers from [`FRAME_START`] up to and including the
//! start command.

use crate::register::{Field, Register};
use crate::table;

/// Byte offset of the first frame register.
pub const FRAME_START: u32 = 0x200;
/// Byte offset behind the last frame register, the start command.
pub const FRAME_END: u32 = 0x400;
/// Byte offset of the first of the registers that change with the view. They end with the start command, so
/// that one message of consecutive words can carry a whole steady frame.
pub const VIEW_START: u32 = 0x3c8;

const WORDS: usize = ((FRAME_END - FRAME_START) / 4) as usize;

/// The latched frame registers, on the card or as the driver's shadow of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameRegisters {
    words: [u32; WORDS],
}

impl Default for FrameRegisters {
    /// Power-on state.
    fn default() -> Self {
        let mut registers = Self { words: [0; WORDS] };
        for register in table::REGISTERS.iter().filter(|register| Self::holds(register.offset)) {
            registers.write(register.offset, register.reset);
        }
        registers
    }
}

impl FrameRegisters {
    /// Whether the word at byte `offset` of the register BAR is a frame register.
    #[must_use]
    pub const fn holds(offset: u32) -> bool {
        offset >= FRAME_START && offset < FRAME_END
    }

    fn place(offset: u32) -> Option<usize> {
        (Self::holds(offset) && offset.is_multiple_of(4)).then(|| ((offset - FRAME_START) / 4) as usize)
    }

    /// The word at byte `offset` of the register BAR; zero where there is no frame register.
    #[must_use]
    pub fn read(&self, offset: u32) -> u32 {
        Self::place(offset).map_or(0, |place| self.words[place])
    }

    /// Latches the word at byte `offset` of the register BAR; ignored where there is no frame register.
    pub fn write(&mut self, offset: u32, word: u32) {
        if let Some(place) = Self::place(offset) {
            self.words[place] = word;
        }
    }

    /// The word of a register.
    #[must_use]
    pub fn word(&self, register: Register) -> u32 {
        self.read(register.offset)
    }

    /// The unsigned value of a field.
    #[must_use]
    pub fn get(&self, field: Field) -> u32 {
        field.get(self.read(field.register))
    }

    /// The two's complement value of a field.
    #[must_use]
    pub fn get_signed(&self, field: Field) -> i32 {
        field.get_signed(self.read(field.register))
    }

    /// Sets a field, leaving the rest of its word; bits of `value` that do not fit are dropped.
    pub fn set(&mut self, field: Field, value: u32) {
        let rest = self.read(field.register) & !field.mask();
        self.write(field.register, rest | field.put(value));
    }

    /// Sets a field to a two's complement value; see [`Self::set`].
    pub fn set_signed(&mut self, field: Field, value: i32) {
        self.set(field, value as u32);
    }

    /// Byte offsets and values of all words that differ from `older`, in increasing order.
    pub fn changes<'a>(&'a self, older: &'a Self) -> impl Iterator<Item = (u32, u32)> + 'a {
        let pairs = self.words.iter().zip(&older.words).enumerate();
        pairs
            .filter(|(_, (new, old))| new != old)
            .map(|(place, (new, _))| (FRAME_START + 4 * place as u32, *new))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{start_x, subvolume_x, volume_size_xy};

    #[test]
    fn power_on_state_is_that_of_the_table() {
        let registers = FrameRegisters::default();
        assert_eq!(registers.get_signed(subvolume_x::MIN), -32768);
        assert_eq!(registers.get_signed(subvolume_x::MAX), 32767);
    }

    #[test]
    fn fields_are_set_alone_and_changes_are_listed() {
        let older = FrameRegisters::default();
        let mut newer = older.clone();
        newer.set(volume_size_xy::Y, 77);
        newer.set_signed(start_x::POSITION, -5);
        assert_eq!(newer.get(volume_size_xy::X), older.get(volume_size_xy::X));
        assert_eq!(newer.get_signed(start_x::POSITION), -5);
        let offsets: Vec<_> = newer.changes(&older).map(|(offset, _)| offset).collect();
        assert_eq!(offsets, [volume_size_xy::REGISTER.offset, start_x::REGISTER.offset]);
    }

    #[test]
    fn words_elsewhere_are_ignored() {
        let mut registers = FrameRegisters::default();
        for offset in [0, FRAME_START - 4, FRAME_START + 1, FRAME_END, u32::MAX] {
            registers.write(offset, 5);
            assert_eq!(registers.read(offset), 0);
        }
        assert_eq!(registers, FrameRegisters::default());
    }
}
