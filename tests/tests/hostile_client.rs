//! Malformed messages cost their own connection at most: the device process lives on, holds no more than before, and
//! serves the next client from power-on state.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;
use volumepro_tests::programs::{Device, volumepro};

const VOLUMEPRO: &str = env!("CARGO_BIN_EXE_test-volumepro");
const DEVICE: &str = env!("CARGO_BIN_EXE_test-volumepro-device");

/// Commands of the protocol.
const VERSION: u16 = 1;
const DMA_MAP: u16 = 2;
const DMA_UNMAP: u16 = 3;
const GET_REGION_INFO: u16 = 5;
const SET_IRQS: u16 = 8;
const REGION_READ: u16 = 9;
const REGION_WRITE: u16 = 10;

/// A message with a header that claims `size` bytes, whatever follows.
fn claiming(size: u32, command: u16, flags: u32, payload: &[u8]) -> Vec<u8> {
    let header = [7_u16.to_le_bytes(), command.to_le_bytes()].concat();
    [header, size.to_le_bytes().to_vec(), flags.to_le_bytes().to_vec(), vec![0; 4], payload.to_vec()].concat()
}

fn message(command: u16, payload: &[u8]) -> Vec<u8> {
    claiming(16 + payload.len() as u32, command, 0, payload)
}

fn words(words: &[u64]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Region access: offset, region, count.
fn access(offset: u64, region: u32, count: u32) -> Vec<u8> {
    [words(&[offset]), region.to_le_bytes().to_vec(), count.to_le_bytes().to_vec()].concat()
}

fn negotiation() -> Vec<u8> {
    message(VERSION, b"\0\0\0\0{}\0")
}

/// What a hostile client sends after a good negotiation, or instead of it.
fn attacks() -> Vec<(&'static str, Vec<u8>)> {
    let dma = |flags: u32, offset: u64, address: u64, size: u64| {
        [32_u32.to_le_bytes().to_vec(), flags.to_le_bytes().to_vec(), words(&[offset, address, size])]
            .concat()
    };
    let irqs = |index: u32, start: u32, count: u32| {
        [20_u32, 4 | 32, index, start, count].iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>()
    };
    let after = |attack: Vec<u8>| [negotiation(), attack].concat();
    vec![
        ("nothing", vec![]),
        ("one byte", vec![1]),
        ("a version without data", message(VERSION, &[0; 4])),
        ("a version without terminator", message(VERSION, b"\0\0\0\0{\"capabilities\":{")),
        ("a version of 17 bytes", claiming(17, VERSION, 0, &[0])),
        ("a size below the header", claiming(3, VERSION, 0, &[])),
        ("a size of 4 GiB", claiming(u32::MAX, VERSION, 0, &[0; 64])),
        ("no version first", message(GET_REGION_INFO, &[0; 32])),
        ("two versions", after(negotiation())),
        ("an unknown command with a payload", after(message(99, &[1; 40]))),
        ("a reply", after(claiming(20, REGION_READ, 1, &[0; 4]))),
        ("a read near 2^64", after(message(REGION_READ, &access(u64::MAX - 1, 0, 4)))),
        ("a read of 1 GiB", after(message(REGION_READ, &access(0, 2, 1 << 30)))),
        ("a write that claims 1 GiB", after(claiming(1 << 30, REGION_WRITE, 0, &access(0, 2, 1 << 30)))),
        ("a write whose count lies", after(message(REGION_WRITE, &[access(0, 0, 64), vec![0; 4]].concat()))),
        (
            "a region that does not exist",
            after(message(REGION_WRITE, &[access(0, 77, 4), vec![0; 4]].concat())),
        ),
        ("a region index of 2^32-1", after(message(REGION_READ, &access(0, u32::MAX, 4)))),
        ("a map of 2^64-1 bytes", after(message(DMA_MAP, &dma(3, 0, u64::MAX, u64::MAX)))),
        ("a map that wraps", after(message(DMA_MAP, &dma(3, 0, u64::MAX - 4095, 8192)))),
        (
            "an unmap of everything",
            after(message(
                DMA_UNMAP,
                &[24_u32.to_le_bytes().to_vec(), vec![0; 4], words(&[0, u64::MAX])].concat(),
            )),
        ),
        ("interrupts without end", after(message(SET_IRQS, &irqs(2, u32::MAX, u32::MAX)))),
        ("an interrupt index that does not exist", after(message(SET_IRQS, &irqs(9, 0, 1)))),
        ("a message cut off", after(claiming(4096, REGION_WRITE, 0, &[0; 99]))),
        ("noise", (0..5000_u32).map(|at| (at.wrapping_mul(2_654_435_761) >> 13) as u8).collect()),
    ]
}

fn picture(device: &Device, output: &Path) -> Vec<u8> {
    let selection = device.selection();
    let output = output.to_str().unwrap();
    let arguments = [
        "render",
        "--phantom",
        "opaque-sphere",
        "--phantom-size",
        "24",
        "-o",
        output,
        "--device",
        &selection,
    ];
    let result = volumepro(VOLUMEPRO, &arguments).unwrap();
    assert!(result.status.success(), "{}", String::from_utf8_lossy(&result.stderr));
    std::fs::read(output).unwrap()
}

#[test]
fn malformed_messages_leave_the_device_serving() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.png");
    let mut device = Device::start(DEVICE, &[]).unwrap();
    let expected = picture(&device, &output);
    device.wait_for_end().unwrap();
    let before = device.holdings_at_rest().unwrap();
    for (name, bytes) in attacks() {
        let mut stream = UnixStream::connect(device.socket()).unwrap();
        stream.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
        // The device may hang up before it has read everything, and it owes no answer to nonsense.
        stream.write_all(&bytes).ok();
        let answered = stream.read(&mut [0; 4096]).unwrap_or(0);
        println!("{name}: {answered} bytes of answer");
        drop(stream);
        assert_eq!(device.settled_holdings(before).unwrap(), before, "after {name}");
        assert!(device.is_alive().unwrap(), "after {name}");
    }
    assert!(picture(&device, &output) == expected, "the next client finds power-on state");
}
