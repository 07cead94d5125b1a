//! The register trace: a line for each trapped access and each event of a command.
//!
//! It says what a client did in the register table's own words, and nothing that changes from run to run
//! except times, so that two traces can be compared line by line.

use std::fmt;
use std::fs::File;
use std::io::{self, LineWriter, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use vg500_regs::number::{CODE, FACTOR, INTEGER};
use vg500_regs::{Field, Register};

/// Integers of more bits than this are addresses, keys and checksums, and printed as hexadecimal.
const DECIMAL_BITS: u32 = 16;

/// Where the lines go, or nowhere.
#[derive(Debug, Default)]
pub struct Trace {
    file: Option<Mutex<Option<LineWriter<File>>>>,
}

impl Trace {
    /// No trace: a line costs one comparison.
    #[must_use]
    pub const fn off() -> Self {
        Self { file: None }
    }

    /// A trace to a file, whose earlier contents are lost.
    ///
    /// # Errors
    ///
    /// If the file cannot be made.
    pub fn to(path: &Path) -> io::Result<Self> {
        Ok(Self { file: Some(Mutex::new(Some(LineWriter::new(File::create(path)?)))) })
    }

    /// Adds a line. After an error the trace ends; the card goes on.
    pub fn line(&self, line: fmt::Arguments<'_>) {
        let Some(file) = &self.file else { return };
        let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(open) = file.as_mut()
            && let Err(error) = writeln!(open, "{line}")
        {
            tracing::error!("the trace ends here: {error}");
            *file = None;
        }
    }
}

/// A word of a register with its fields decoded: `VOLUME_SIZE_XY X=256 Y=256`.
#[derive(Clone, Copy, Debug)]
pub struct Decoded {
    /// The register.
    pub register: &'static Register,
    /// Place of the word in the register's array.
    pub index: u32,
    /// The word.
    pub word: u32,
}

impl fmt::Display for Decoded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.register.name)?;
        if self.register.count > 1 {
            write!(f, "[{}]", self.index)?;
        }
        for field in self.register.fields {
            write!(f, " {}=", field.name)?;
            write_value(f, field, self.word)?;
        }
        if self.register.fields.is_empty() { write!(f, " {:#x}", self.word) } else { Ok(()) }
    }
}

/// A few bytes as they are, of more only their number.
#[derive(Clone, Copy, Debug)]
pub struct Bytes<'a>(pub &'a [u8]);

impl fmt::Display for Bytes<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            few if few.len() <= 8 => write!(f, "{few:02x?}"),
            many => write!(f, "{} bytes", many.len()),
        }
    }
}

/// A number as its format means it; a half of a longer number as it stands.
fn write_value(f: &mut fmt::Formatter<'_>, field: &Field, word: u32) -> fmt::Result {
    let format = field.format;
    let value = field.get(word);
    if format == INTEGER || format == CODE {
        return if field.bits > DECIMAL_BITS { write!(f, "{value:#x}") } else { write!(f, "{value}") };
    }
    if format == FACTOR {
        return write!(f, "{value}");
    }
    if format.bits > 32 {
        return write!(f, "{value:#010x}");
    }
    let number = if format.signed { f64::from(field.get_signed(word)) } else { f64::from(value) };
    write!(f, "{}", number / f64::from(1u32 << format.fraction))
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg500_regs::table::{self, *};

    fn decoded(offset: u32, word: u32) -> String {
        let (register, index) = table::find(offset).unwrap();
        Decoded { register, index, word }.to_string()
    }

    #[test]
    fn a_trace_that_cannot_be_made_is_an_error() {
        assert!(Trace::to(Path::new("/nowhere/trace")).is_err());
    }

    #[test]
    fn a_full_disk_ends_the_trace_and_nothing_else() {
        let trace = Trace::to(Path::new("/dev/full")).unwrap();
        (0..3).for_each(|line| trace.line(format_args!("{line}")));
        assert!(trace.file.unwrap().lock().unwrap().is_none());
    }

    #[test]
    fn no_argument_is_formatted_while_the_trace_is_off() {
        struct Never;
        impl fmt::Display for Never {
            fn fmt(&self, _: &mut fmt::Formatter<'_>) -> fmt::Result {
                panic!("formatted");
            }
        }
        Trace::off().line(format_args!("{Never}"));
    }

    #[test]
    fn lines_are_in_the_file_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace");
        let trace = Trace::to(&path).unwrap();
        trace.line(format_args!("write {}", decoded(0x208, 0x0100_0100)));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "write VOLUME_SIZE_XY X=256 Y=256\n");
    }

    #[test]
    fn fields_are_printed_as_their_format_means_them() {
        let cases = [
            (start::REGISTER.offset, 0x0007_0103, "START PLANE=3 VOXELS_UNCHANGED=1 TAG=7"),
            (start_x::REGISTER.offset, 0xffe0_0000, "START_X POSITION=-0.5"),
            (step_y::REGISTER.offset, 1 << 22, "STEP_Y STEP=1"),
            (eye_xy::REGISTER.offset, 0x7fff_8000, "EYE_XY X=-1 Y=0.999969482421875"),
            (material::REGISTER.offset, 0x00ff_0180, "MATERIAL EMISSIVE=128 DIFFUSE=1 SPECULAR=255"),
            (subvolume_x::REGISTER.offset, 0x7fff_8000, "SUBVOLUME_X MIN=-32768 MAX=32767"),
            (crop_min_x::REGISTER.offset, 0x0000_0180, "CROP_MIN_X BOUND=1.5"),
            (cut_min_high::REGISTER.offset, u32::MAX, "CUT_MIN_HIGH WORD=0xffffffff"),
            (reset::REGISTER.offset, 0x5245_5345, "RESET KEY=0x52455345"),
            (plane_state::REGISTER.at(3), 0x0001_0005, "PLANE_STATE[3] TAG=5 RESULT=1"),
            (keep::REGISTER.offset, 5, "KEEP OMISSIONS=0x5"),
        ];
        for (offset, word, expected) in cases {
            assert_eq!(decoded(offset, word), expected);
        }
    }

    #[test]
    fn every_register_can_be_printed_whatever_it_holds() {
        for register in REGISTERS {
            for word in [0, 1, 0x8000_0000, u32::MAX] {
                let line = Decoded { register, index: 0, word }.to_string();
                assert_eq!(line.matches('=').count(), register.fields.len(), "{line}");
            }
        }
    }
}
