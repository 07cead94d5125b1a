//! What a register and a field of a register are.

use crate::number::NumberFormat;

/// Who may do what with a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// The client writes it; the card latches it. A read gives all ones and counts as a mistake.
    WriteOnly,
    /// The card writes it; a write is ignored and counts as a mistake.
    ReadOnly,
}

/// A register, or an array of equal ones.
#[derive(Clone, Copy, Debug)]
pub struct Register {
    /// Name in traces and the manual.
    pub name: &'static str,
    /// Byte offset of the first word in the register BAR.
    pub offset: u32,
    /// Number of words in the array; 1 for a plain register.
    pub count: u32,
    /// Bytes from one word of the array to the next.
    pub stride: u32,
    /// Who may do what with it.
    pub access: Access,
    /// Value after power-on and reset.
    pub reset: u32,
    /// Its fields from the lowest bit on; bits outside of all fields are reserved and zero.
    pub fields: &'static [Field],
    /// What it is for.
    pub meaning: &'static str,
}

impl Register {
    /// Byte offset of word `index` of the array.
    #[must_use]
    pub const fn at(&self, index: u32) -> u32 {
        self.offset + index * self.stride
    }

    /// Bits that belong to a field.
    #[must_use]
    pub fn mask(&self) -> u32 {
        self.fields.iter().fold(0, |mask, field| mask | field.mask())
    }
}

/// A range of bits in a register.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Name in traces and the manual.
    pub name: &'static str,
    /// Byte offset of its register.
    pub register: u32,
    /// Lowest bit.
    pub low: u32,
    /// Number of bits.
    pub bits: u32,
    /// Number format.
    pub format: NumberFormat,
    /// What it is for.
    pub meaning: &'static str,
}

impl Field {
    /// The field's bits in its word.
    #[must_use]
    pub const fn mask(&self) -> u32 {
        (u32::MAX >> (32 - self.bits)) << self.low
    }

    /// The field's value in `word`, unsigned.
    #[must_use]
    pub const fn get(&self, word: u32) -> u32 {
        (word & self.mask()) >> self.low
    }

    /// The field's value in `word`, two's complement.
    #[must_use]
    pub const fn get_signed(&self, word: u32) -> i32 {
        ((self.get(word) << (32 - self.bits)) as i32) >> (32 - self.bits)
    }

    /// `value` at the field's place; bits that do not fit are dropped.
    #[must_use]
    pub const fn put(&self, value: u32) -> u32 {
        (value << self.low) & self.mask()
    }

    /// A two's complement `value` at the field's place; bits that do not fit are dropped.
    #[must_use]
    pub const fn put_signed(&self, value: i32) -> u32 {
        self.put(value as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::VOXEL;

    const LOWER: Field = Field { name: "", register: 0, low: 0, bits: 16, format: VOXEL, meaning: "" };
    const UPPER: Field = Field { low: 16, ..LOWER };
    const WHOLE: Field = Field { bits: 32, ..LOWER };

    #[test]
    fn fields_come_back_with_their_sign() {
        for value in [-32768, -1, 0, 1, 32767] {
            let word = LOWER.put_signed(value) | UPPER.put_signed(!value);
            assert_eq!(LOWER.get_signed(word), value);
            assert_eq!(UPPER.get_signed(word), !value);
        }
        assert_eq!(WHOLE.get_signed(WHOLE.put_signed(i32::MIN)), i32::MIN);
        assert_eq!(WHOLE.mask(), u32::MAX);
    }
}
