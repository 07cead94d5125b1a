//! Why a command was refused or failed, as the card reports it.

use crate::register::Field;
use crate::table;

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum FaultCode {
    /// The field's value is outside its range or is not one of its codes.
    Value = 1,
    /// The value is valid, but this renderer does not do what it asks for.
    NotServed = 2,
    /// The address range that the field selects does not lie inside its memory.
    Range = 3,
    /// The base plane is in use by an earlier command.
    Busy = 4,
    /// The command queue is full.
    QueueFull = 5,
    /// The command was cancelled: by the cancel register, a reset or a lost connection.
    Cancelled = 6,
    /// Host memory at the given address is not mapped for the card, or bus mastering is off.
    HostMemory = 7,
    /// The render engine failed; a defect of the emulator.
    Internal = 8,
}

impl FaultCode {
    /// All codes.
    pub const ALL: [Self; 8] = [
        Self::Value,
        Self::NotServed,
        Self::Range,
        Self::Busy,
        Self::QueueFull,
        Self::Cancelled,
        Self::HostMemory,
        Self::Internal,
    ];

    /// The code of a status word.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|it| *it as u32 == code)
    }

    /// What a message says about it.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Value => "value out of range",
            Self::NotServed => "valid, but not served by this renderer",
            Self::Range => "address range outside of its memory",
            Self::Busy => "base plane in use",
            Self::QueueFull => "command queue full",
            Self::Cancelled => "cancelled",
            Self::HostMemory => "host memory not reachable",
            Self::Internal => "render engine failed",
        }
    }
}

/// A refused or failed command: what, and which field of which register is to blame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// What went wrong.
    pub code: FaultCode,
    /// Offset of the register to blame in the register BAR.
    pub register: u16,
    /// Lowest bit of the field to blame.
    pub bit: u8,
}

impl Fault {
    /// The end of a cancelled command: no field is to blame.
    pub const CANCELLED: Self = Self { code: FaultCode::Cancelled, register: 0, bit: 0 };

    /// A fault of `field`.
    #[must_use]
    pub const fn new(code: FaultCode, field: Field) -> Self {
        Self { code, register: field.register as u16, bit: field.low as u8 }
    }

    /// The fault of a status word: code in bits 7..0, bit number in 12..8, register offset in 31..16; a word of
    /// zero is no fault.
    #[must_use]
    pub fn from_word(word: u32) -> Option<Self> {
        let code = FaultCode::from_code(word & 0xff)?;
        Some(Self { code, register: (word >> 16) as u16, bit: (word >> 8) as u8 & 31 })
    }

    /// The status word of the fault.
    #[must_use]
    pub const fn to_word(&self) -> u32 {
        self.code as u32 | ((self.bit as u32 & 31) << 8) | ((self.register as u32) << 16)
    }
}

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.code == FaultCode::Cancelled {
            return f.write_str(self.code.text());
        }
        match table::find(u32::from(self.register)) {
            Some((register, index)) => {
                write!(f, "{}", register.name)?;
                if register.count > 1 {
                    write!(f, "[{index}]")?;
                }
                if let Some(field) = register.fields.iter().find(|field| field.low == u32::from(self.bit)) {
                    write!(f, ".{}", field.name)?;
                }
            }
            None => write!(f, "register {:#06x}", self.register)?,
        }
        write!(f, ": {}", self.code.text())
    }
}

impl core::error::Error for Fault {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::volume_size_xy;

    #[test]
    fn a_fault_names_its_field() {
        let fault = Fault::new(FaultCode::Value, volume_size_xy::Y);
        assert_eq!(fault.to_string(), "VOLUME_SIZE_XY.Y: value out of range");
        assert_eq!(Fault::from_word(fault.to_word()), Some(fault));
    }

    #[test]
    fn a_cancelled_command_blames_nothing() {
        assert_eq!(Fault::CANCELLED.to_string(), "cancelled");
        assert_eq!(Fault::from_word(6), Some(Fault::CANCELLED));
    }

    #[test]
    fn words_without_a_known_code_are_no_fault() {
        assert_eq!(Fault::from_word(0), None);
        assert_eq!(Fault::from_word(0x1234_0063), None);
    }
}
