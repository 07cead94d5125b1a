//! The frame that the programming manual shows is what the library has the driver write.
//!
//! `UPDATE_MANUAL=1 cargo test -p volumepro-tests --test manual` writes it anew.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, dead_code, reason = "tests")]

#[path = "../../device/tests/common/parts.rs"]
mod parts;

use vg500_regs::table::REGISTERS;
use volumepro_tests::programs::{Device, volumepro};

/// What the frame shows; a picture in which every stage has something to do.
const FRAME: [&str; 3] = [
    "--phantom ellipsoids --phantom-size 32 --azimuth 30 --elevation 20 --supersample 1,1,2",
    "--light -0.45,-0.55,-1 --modulate opacity,specular",
    "--cut-plane 0,0,1,-20,16,2 --cursor 16,16,16",
];

/// A line of the trace as the manual shows it: writes after the place of their register, and no times.
fn shown(line: &str) -> String {
    let line = line.split(" engine=").next().unwrap();
    match line.strip_prefix("write ") {
        Some(write) => {
            let name = write.split(' ').next().unwrap();
            let register = REGISTERS.iter().find(|register| register.name == name).expect("a register");
            format!("    {:#06x}  {write}\n", register.offset)
        }
        None => format!("            {line}\n"),
    }
}

#[test]
fn the_frame_of_the_manual_is_what_the_library_writes() {
    // What the optimised renderer leaves out depends on the processor.
    let device =
        Device::start(env!("CARGO_BIN_EXE_test-volumepro-device"), &["--strict", "--renderer", "reference"])
            .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("out.png");
    let selection = device.selection();
    let mut arguments = vec!["render", "-o", picture.to_str().unwrap(), "--device", &selection];
    arguments.extend(FRAME.iter().flat_map(|line| line.split(' ')));
    let result = volumepro(env!("CARGO_BIN_EXE_test-volumepro"), &arguments).unwrap();
    assert!(result.status.success(), "{}", String::from_utf8_lossy(&result.stderr));
    device.wait_for_end().unwrap();
    let trace = device.trace().unwrap();
    assert!(trace.contains("ends: mistakes=0"), "{trace}");
    let begin = trace.find("write INTERRUPT_ENABLE").expect("the first write");
    let (frame, rest) = trace[begin..].split_once("frame 1 done").expect("the frame's end");
    let end = rest.lines().next().unwrap();
    let lines: String = frame.lines().map(shown).collect();
    let last = shown(&format!("frame 1 done{end}"));
    let command = FRAME.join(" \\\n        ");
    let text = format!(
        "    volumepro render {command} \\\n        --device socket:card.sock -o out.png\n\n{lines}{last}"
    );
    parts::check(&[("frame", text)]);
}
