//! The worked example of the programming manual, line by line on a card.

use vg500_regs::pci::REGISTERS as REGISTER_BAR;
use vg500_regs::table::{REGISTERS, plane_state};
use volumepro_device::Config;

use crate::peer::{Peer, Server, await_that};

const MANUAL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/PROGRAMMING.md");

/// Lines of the worked example: a base address register, an offset, and the rest.
fn example(manual: &str) -> Vec<(u32, u64, &str)> {
    let (_, chapter) = manual.split_once("## Worked example").unwrap();
    let (chapter, _) = chapter.split_once("\n## ").unwrap();
    let lines = chapter.lines().filter_map(|line| line.strip_prefix("    BAR"));
    lines
        .map(|line| {
            let (place, rest) = line.split_once("  ").unwrap();
            let (bar, offset) = place.split_once(" + 0x").unwrap();
            (bar.parse().unwrap(), u64::from_str_radix(offset, 16).unwrap(), rest.trim())
        })
        .collect()
}

/// The bytes at the beginning of a text.
fn bytes(text: &str) -> Vec<u8> {
    let numbers = text.split("  ").next().unwrap().split(' ');
    numbers.map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

/// The word at the beginning of a text.
fn word(text: &str) -> u32 {
    u32::from_str_radix(&text[2..10], 16).unwrap()
}

#[test]
fn the_worked_example_works() {
    let manual = std::fs::read_to_string(MANUAL).unwrap();
    let (_, state) = manual.split_once("until its tag is 1; it is then ").unwrap();
    let server = Server::new(Config { strict: true, ..Config::default() });
    let mut peer = Peer::new(&server.socket());
    let mut compared = 0;
    for (bar, offset, rest) in example(&manual) {
        match bar {
            0 => {
                let register = REGISTERS.iter().find(|it| u64::from(it.offset) == offset).unwrap();
                assert!(rest.contains(register.name), "{rest}: {}", register.name);
                peer.client.region_write(REGISTER_BAR.index, offset, &word(rest).to_le_bytes()).unwrap();
            }
            1 | 2 => peer.client.region_write(bar, offset, &bytes(rest)).unwrap(),
            _ => {
                await_that(|| peer.plane_state(0).0 == 1);
                assert_eq!(peer.read(plane_state::REGISTER), word(state));
                let mut pixel = [0; 4];
                peer.client.region_read(bar, offset, &mut pixel).unwrap();
                assert_eq!(pixel.to_vec(), bytes(rest), "{rest}");
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 2);
    drop(peer);
    server.await_trace("ends: mistakes=0");
}
