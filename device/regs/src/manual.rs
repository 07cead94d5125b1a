//! The register chapter of the programming manual, made from the register table.

use crate::number::{CODE, INTEGER, NumberFormat};
use crate::register::{Access, Register};
use crate::table::REGISTERS;
use core::fmt::Write;

/// The chapter as Markdown.
#[must_use]
pub fn register_chapter() -> String {
    let mut text = String::from(
        "| Offset | Register | Access | Reset | Bits | Field | Format | Meaning |\n|---|---|---|---|---|---|---|---|\n",
    );
    for register in REGISTERS {
        write_register(&mut text, register);
    }
    text.push_str("\n### Number formats of registers\n\n| Format | Bits | Fraction | Signed | Meaning |\n|---|---|---|---|---|\n");
    for format in formats() {
        let signed = if format.signed { "yes" } else { "no" };
        writeln!(
            text,
            "| {} | {} | {} | {signed} | {} |",
            format.name, format.bits, format.fraction, format.note
        )
        .ok();
    }
    text
}

fn write_register(text: &mut String, register: &Register) {
    let access = match register.access {
        Access::WriteOnly => "write",
        Access::ReadOnly => "read",
    };
    let name = match register.count {
        1 => format!("`{}`", register.name),
        count => format!("`{}[{count}]`, every {:#x}", register.name, register.stride),
    };
    let meaning = register.meaning;
    writeln!(
        text,
        "| {:#06x} | {name} | {access} | {:#x} | | | | {meaning} |",
        register.offset, register.reset
    )
    .ok();
    for field in register.fields {
        let bits = match field.bits {
            1 => field.low.to_string(),
            bits => format!("{}..{}", field.low + bits - 1, field.low),
        };
        writeln!(text, "| | | | | {bits} | {} | {} | {} |", field.name, field.format.name, field.meaning)
            .ok();
    }
}

fn formats() -> Vec<NumberFormat> {
    let mut formats = vec![INTEGER, CODE];
    for field in REGISTERS.iter().flat_map(|register| register.fields) {
        if !formats.contains(&field.format) {
            formats.push(field.format);
        }
    }
    formats
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_register_and_field_is_in_the_chapter() {
        let chapter = register_chapter();
        for register in REGISTERS {
            assert!(chapter.contains(register.name) && chapter.contains(register.meaning));
            assert!(register.fields.iter().all(|field| chapter.contains(field.meaning)));
        }
    }
}
