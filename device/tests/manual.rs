//! The programming manual's generated parts are those of the source.
//!
//! `UPDATE_MANUAL=1 cargo test -p volumepro-device --test manual` writes them anew; the frame of the library comes from
//! the test of the same name in `volumepro-tests`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "common/parts.rs"]
mod parts;

use std::fmt::Write;
use std::process::Command;

use parts::{MANUAL, with_part};
use vg500_engine::fixed::FORMATS;
use vg500_regs::fault::FaultCode;
use vg500_regs::manual::register_chapter;
use vg500_regs::memory::Table;
use vg500_regs::section::{ALWAYS, BLENDED, EXTREME, SUMMED, record_words};
use vg500_regs::{BlendMode, PixelFormat};
use volumepro_device::sandbox::{self, Treatment};

/// The options as the process tells them, but for those that every program has.
fn options() -> String {
    let help = Command::new(env!("CARGO_BIN_EXE_volumepro-device")).arg("-h").output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let (_, options) = help.split_once("Options:\n").expect("options");
    let lines = options.lines().filter_map(|line| line.strip_prefix("      "));
    lines.fold(String::new(), |text, line| text + "    " + line + "\n")
}

fn tables() -> String {
    let mut text =
        String::from("| Table | Copy 0 at | Copy 1 at | Bytes | Contents |\n|---|---|---|---|---|\n");
    for table in Table::ALL {
        let [first, second] = [0, 1].map(|copy| table.offset(copy));
        let contents = match table {
            Table::Color => "4096 words: red in bits 7..0, green 15..8, blue 23..16",
            Table::Opacity => {
                "2048 words of two 12-bit opacities: even entry in bits 11..0, odd entry in 27..16"
            }
            Table::Diffuse | Table::Specular => "384 words: intensity in bits 7..0",
            Table::GradientMagnitude => "256 bytes, by gradient magnitude (0..220 are reached)",
        };
        let (name, bytes) = (table.name(), table.bytes());
        writeln!(text, "| {name} | {first:#06x} | {second:#06x} | {bytes} | {contents} |").unwrap();
    }
    text
}

fn faults() -> String {
    let mut text = String::from("| Code | Name | Meaning |\n|---|---|---|\n");
    for code in FaultCode::ALL {
        writeln!(text, "| {} | {code:?} | {} |", code as u32, code.text()).unwrap();
    }
    text
}

fn formats() -> String {
    let mut text = String::from(
        "| Used for | Format | Bits | Fraction | Signed | How values come into it |\n|---|---|---|---|---|---|\n",
    );
    for (use_, format) in FORMATS {
        let signed = if format.signed { "yes" } else { "no" };
        let (name, bits, fraction, note) = (format.name, format.bits, format.fraction, format.note);
        writeln!(text, "| {use_} | {name} | {bits} | {fraction} | {signed} | {note} |").unwrap();
    }
    text
}

fn sections() -> String {
    let mut text =
        String::from("| Word | Bits | Field | Format | In | Meaning |\n|---|---|---|---|---|---|\n");
    for (fields, modes) in
        [(ALWAYS, "all"), (BLENDED, "alpha, MIP, MinIP"), (EXTREME, "MIP, MinIP"), (SUMMED, "weighted sum")]
    {
        for field in fields {
            let (word, high) = (field.register / 4, field.low + field.bits - 1);
            let bits = if field.bits == 1 { field.low.to_string() } else { format!("{high}..{}", field.low) };
            let (name, format, meaning) = (field.name, field.format.name, field.meaning);
            writeln!(text, "| {word} | {bits} | {name} | {format} | {modes} | {meaning} |").unwrap();
        }
    }
    let words = |blend| record_words(blend) - 1;
    let [alpha, extreme, sum] = [BlendMode::Alpha, BlendMode::Maximum, BlendMode::Sum].map(words);
    write!(text, "\nWords that move: alpha 0..={alpha}; MIP, MinIP 0..={extreme}; weighted sum 0..={sum}.")
        .unwrap();
    text
}

fn pixels() -> String {
    let codes = (0..).map_while(PixelFormat::from_code);
    let list: Vec<_> =
        codes.map(|format| format!("{} {}", format as u32, format!("{format:?}").to_uppercase())).collect();
    list.join(", ") + "."
}

fn system_calls() -> String {
    let mut text = String::from("| System calls | What for | |\n|---|---|---|\n");
    for group in sandbox::GROUPS {
        let names: Vec<_> = group.names().collect();
        let treatment = match group.treatment {
            Treatment::Allowed => "",
            Treatment::AllowedWithSocket => "with `--socket`",
            Treatment::Missing => "answered as if the system had no such call",
        };
        writeln!(text, "| {} | {} | {treatment} |", names.join(", "), group.purpose).unwrap();
    }
    text
}

#[test]
fn generated_parts_are_up_to_date() {
    parts::check(&[
        ("options", options()),
        ("sandbox", system_calls()),
        ("tables", tables()),
        ("sections", sections()),
        ("pixels", pixels()),
        ("faults", faults()),
        ("formats", formats()),
        ("registers", register_chapter()),
    ]);
}

#[test]
fn stale_parts_are_found() {
    let manual = "before\n<!-- faults: begin -->\n<!-- faults: end -->\nafter\n";
    let current = with_part(manual, "faults", &faults());
    assert!(current.starts_with("before\n") && current.ends_with("after\n") && current != manual);
    assert_eq!(with_part(&current, "faults", &faults()), current);
    let stale = with_part(&current, "faults", "| 1 | Other | other |");
    assert_ne!(stale, current);
    assert_eq!(with_part(&stale, "faults", &faults()), current);
}

#[test]
fn registers_that_the_text_names_exist() {
    let manual = std::fs::read_to_string(MANUAL).unwrap();
    let chapter = register_chapter();
    let code = manual.split('`').skip(1).step_by(2);
    let names = code.filter(|name| {
        name.len() > 4 && name.chars().all(|it| it.is_ascii_uppercase() || it == '_' || it == '.')
    });
    let outside = ["EBUSY", "LISTEN_FDS", "NOTIFY_SOCKET", "SIGSYS", "TAG"];
    for name in names.filter(|name| !outside.contains(name)) {
        for word in name.split('.') {
            assert!(chapter.contains(word), "{name}");
        }
    }
}
