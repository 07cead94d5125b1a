//! Frames, transfers and completion over the socket.

use vg500_engine::{Cancel, Memories, Renderer};
use vg500_regs::memory::plane_pitch;
use vg500_regs::pci::{BARS, PIXEL_MEMORY, SECTION_MEMORY, TABLE_MEMORY, VOXEL_MEMORY, Vector};
use vg500_regs::table::*;
use vg500_regs::{Fault, FaultCode, PixelFormat, PlaneFormat, SharedView};
use volumepro_device::Config;

use crate::peer::{HOST, HOST_SIZE, Peer, Server, await_that, frame};

fn strict() -> Server {
    Server::new(Config { strict: true, ..Config::default() })
}

pub fn start_transfer(peer: &mut Peer, tag: u32, address: u64, format: PixelFormat) {
    peer.write(transfer_address_low::REGISTER, address as u32);
    peer.write(transfer_address_high::REGISTER, (address >> 32) as u32);
    peer.write(transfer_pitch::REGISTER, 4096);
    peer.write(transfer_size::REGISTER, transfer_size::WIDTH.put(32) | transfer_size::HEIGHT.put(32));
    let word = transfer::TAG.put(tag) | transfer::PIXEL_FORMAT.put(format as u32);
    peer.write(transfer::REGISTER, word);
}

/// The pixels are the same; what passed between the sections stands in the mapped section memory.
#[test]
fn a_frame_in_sections_goes_through_section_memory() {
    let server = strict();
    let mut peer = Peer::new(&server.socket());
    peer.fill(64);
    let mut registers = frame(64, 1, 0);
    let mut pixels = Vec::new();
    for (tag, sections) in [(1, 0), (2, 1)] {
        let spilled = || peer.memory(SECTION_MEMORY).bytes(0, SECTION_MEMORY.size as usize);
        assert!(spilled().iter().all(|byte| *byte == 0), "nothing has used it yet");
        registers.set(start::TAG, tag);
        registers.set(output::SECTIONS, sections);
        peer.start(&registers);
        await_that(|| peer.plane_state(0) == (tag, result::DONE));
        pixels.push((peer.read(report_checksum::REGISTER), peer.memory(PIXEL_MEMORY).bytes(0, 512 * 4 * 64)));
    }
    assert!(pixels[0] == pixels[1] && pixels[0].1.iter().any(|byte| *byte != 0));
    // Records of 64 beams on 64 slices; the first voxel that is spilled stands in the first word.
    let spilled = peer.memory(SECTION_MEMORY).bytes(0, SECTION_MEMORY.size as usize);
    let (records, rest) = spilled.split_at(64 * 64 * 32);
    assert!(records.chunks(32).all(|record| record[..16].iter().any(|byte| *byte != 0)));
    assert!(rest.iter().all(|byte| *byte == 0));
    let [mut voxel, first] = [[0; 2], [records[0], records[1]]];
    peer.memory(VOXEL_MEMORY).view().read(2 * 31, &mut voxel).unwrap();
    assert_eq!(u16::from_le_bytes(first), (u16::from_le_bytes(voxel) & 4095) << 3);
}

#[test]
fn a_frame_is_the_engines_and_nothing_of_it_is_trapped() {
    let server = strict();
    let mut peer = Peer::new(&server.socket());
    peer.fill(32);
    peer.write(interrupt_enable::REGISTER, interrupt_enable::FRAME.mask());
    let registers = frame(32, 7, 0);
    peer.start(&registers);
    peer.await_interrupt(Vector::Frame as usize);
    assert_eq!(peer.plane_state(0), (7, result::DONE));

    let tables = peer.memory(TABLE_MEMORY).view();
    let voxel = peer.memory(VOXEL_MEMORY).view();
    let task = Renderer::Reference.take(&registers, &tables, voxel.size()).unwrap();
    let mut expected = vec![0; PIXEL_MEMORY.size as usize];
    let section = peer.memory(SECTION_MEMORY).view();
    let views = Memories { voxel, pixel: SharedView::of(&mut expected), section };
    let report = Renderer::Reference.render(&task, views, &Cancel::default()).unwrap();
    assert!(peer.memory(PIXEL_MEMORY).bytes(0, expected.len()) == expected);
    assert!(expected[..128].iter().any(|&byte| byte != 0));
    assert_eq!(peer.read(report_checksum::REGISTER), report.checksum);
    assert_eq!(peer.read(report_samples_low::REGISTER), 32 * 32 * 32);

    for bar in BARS.iter().filter(|bar| bar.mapped) {
        assert_eq!(peer.read_at(trapped_reads::REGISTER.at(bar.index)), 0, "{}", bar.name);
        assert_eq!(peer.read_at(trapped_writes::REGISTER.at(bar.index)), 0, "{}", bar.name);
    }
    // A steady frame is one message.
    let before = peer.read(trapped_writes::REGISTER);
    peer.burst(&frame(32, 8, 0), vg500_regs::frame_registers::VIEW_START);
    peer.await_interrupt(Vector::Frame as usize);
    assert_eq!(peer.plane_state(0), (8, result::DONE));
    assert_eq!(peer.read(trapped_writes::REGISTER), before + 1);
    drop(peer);
    server.await_trace("connection 1 ends: mistakes=0");
    let trace = server.trace();
    assert!(trace.contains("write VOLUME_SIZE_XY X=32 Y=32\n") && !trace.contains("mistake:"), "{trace}");
    assert!(trace.contains("BAR2 reads=0 writes=0"));
}

#[test]
fn the_status_copy_arrives_before_the_interrupt() {
    let server = strict();
    let mut peer = Peer::new(&server.socket());
    peer.fill(32);
    peer.write(interrupt_enable::REGISTER, interrupt_enable::REGISTER.mask());
    peer.write(status_address_low::REGISTER, HOST as u32 + 256);
    peer.write(status_control::REGISTER, 1);
    for tag in 1..=50 {
        peer.start(&frame(32, tag, tag % 16));
        peer.await_interrupt(Vector::Frame as usize);
        let word = |register: u32| peer.host.view().read_u32(256 + register as usize).unwrap();
        assert_eq!(word(plane_state::REGISTER.at(tag % 16)), tag | result::DONE << 16);
        assert_eq!(word(completed::REGISTER.offset), tag);
        peer.write(acknowledge::REGISTER, acknowledge::REGISTER.mask());
    }
}

#[test]
fn a_transfer_arrives_in_host_memory() {
    let server = strict();
    let mut peer = Peer::new(&server.socket());
    peer.fill(32);
    peer.write(interrupt_enable::REGISTER, interrupt_enable::TRANSFER.mask());
    peer.start(&frame(32, 1, 0));
    start_transfer(&mut peer, 2, HOST + 4, PixelFormat::Abgr8);
    peer.await_interrupt(Vector::Transfer as usize);
    assert_eq!(peer.read(transfer_state::REGISTER), 2 | result::DONE << 16);
    for row in 0..32 {
        let stored = peer.memory(PIXEL_MEMORY).bytes(row * plane_pitch(PlaneFormat::Rgba8), 128);
        let expected: Vec<u8> =
            stored.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, a]| [a, b, g, r]).collect();
        assert_eq!(peer.host.bytes(4 + 4096 * row, 128), expected);
        assert_eq!(peer.host.bytes(4 + 4096 * row + 128, 8), [0; 8]);
    }
}

#[test]
fn transfers_need_mapped_memory_and_bus_mastering() {
    let server = Server::new(Config::default());
    let mut peer = Peer::new(&server.socket());
    let unreachable = Fault::new(FaultCode::HostMemory, transfer_address_low::ADDRESS).to_word();
    let fails = |peer: &mut Peer, tag: u32, address: u64| {
        start_transfer(peer, tag, address, PixelFormat::Rgba8);
        while peer.read(transfer_state::REGISTER) & 0xffff != tag {}
        (peer.read(transfer_state::REGISTER) >> 16, peer.read(transfer_fault::REGISTER))
    };
    let failed = (result::FAILED, unreachable);
    assert_eq!(fails(&mut peer, 1, HOST + HOST_SIZE - 4096), failed);
    assert_eq!(fails(&mut peer, 2, u64::MAX - 10), failed);
    peer.client.region_write(7, 4, &[2, 0]).unwrap();
    assert_eq!(fails(&mut peer, 3, HOST), failed);
    peer.client.region_write(7, 4, &[6, 0]).unwrap();
    assert_eq!(fails(&mut peer, 4, HOST), (result::DONE, 0));
    peer.client.dma_unmap(HOST, HOST_SIZE).unwrap();
    assert_eq!(fails(&mut peer, 5, HOST), failed);
}
