//! Whatever a client does in the midst of a frame, the card is free again within a second and keeps nothing.

use std::fs::{read_dir, read_to_string};
use std::io::Write;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::process::Signal;
use vg500_regs::memory::Table;
use vg500_regs::pci::{TABLE_MEMORY, Vector};
use vg500_regs::table::*;
use vg500_regs::{FrameRegisters, PixelFormat};
use volumepro_device::Config;

use crate::frames::start_transfer;
use crate::peer::{HOST, HOST_SIZE, Peer, Server, await_that, frame};
use crate::process::{command, end, ready};

/// What a cancelled frame may take to end, and with it whatever waits for it.
const SECOND: Duration = Duration::from_secs(1);

/// Descriptors, mappings of the card's and the client's memory, and threads of a process.
fn holdings(process: u32) -> [usize; 3] {
    let count = |folder: &str| read_dir(format!("/proc/{process}/{folder}")).unwrap().count();
    let maps = read_to_string(format!("/proc/{process}/maps")).unwrap();
    [count("fd"), maps.matches("memfd:").count(), count("task")]
}

/// A frame of 256^3 voxels with eight samples per slice of voxels, illuminated and cut. Four of them take
/// seconds.
fn long_frame(tag: u32, plane: u32) -> FrameRegisters {
    let mut registers = frame(256, tag, plane);
    registers.set(supersampling::Z, 8);
    registers.set(material::DIFFUSE, 100);
    registers.set(material::SPECULAR, 100);
    registers.set(modulation::OPACITY, 1);
    registers.set(eye_z::Z, 0x7fff);
    registers.set(cut_control::ENABLE, 1);
    registers.set(cut_control::OUTSIDE, 1);
    registers.set(cut_normal_xy::A, 1 << 14);
    registers
}

/// A client in whose midst a long frame runs, others and a transfer behind it.
fn busy(socket: &Path) -> Peer {
    let mut peer = Peer::new(socket);
    // No voxel is invisible, and no ray ends early.
    peer.memory(TABLE_MEMORY).view().write_u16(Table::Opacity.offset(0), &[1]).unwrap();
    peer.write(interrupt_enable::REGISTER, interrupt_enable::REGISTER.mask());
    peer.write(status_address_low::REGISTER, HOST as u32);
    peer.write(status_control::REGISTER, 1);
    (0..4).for_each(|plane| peer.start(&long_frame(1, plane)));
    start_transfer(&mut peer, 2, HOST + 4096, PixelFormat::Rgba8);
    // None has ended, well or not.
    assert_eq!((status::BUSY.get(peer.read(status::REGISTER)), peer.read(completed::REGISTER)), (1, 0));
    peer
}

/// Shows that the card does what it should after whatever was done to it.
fn works(peer: &mut Peer) {
    peer.client.region_write(7, 4, &[6, 0]).unwrap();
    peer.fill(32);
    peer.write(interrupt_enable::REGISTER, interrupt_enable::FRAME.mask());
    peer.start(&frame(32, 77, 9));
    let began = Instant::now();
    await_that(|| peer.plane_state(9) == (77, result::DONE));
    assert!(began.elapsed() < SECOND, "the old frames have not ended");
}

/// Sets Initiate Function Level Reset.
fn function_level_reset(peer: &mut Peer) {
    let byte = |at: u64, peer: &mut Peer| {
        let mut byte = [0];
        peer.client.region_read(7, at, &mut byte).unwrap();
        byte[0]
    };
    let mut at = u64::from(byte(0x34, peer));
    while byte(at, peer) != 0x10 {
        at = u64::from(byte(at + 1, peer));
    }
    peer.client.region_write(7, at + 8, &[0, 0x80]).unwrap();
}

#[test]
fn resets_in_a_frame_answer_within_a_second_and_leave_a_card_that_works() {
    let server = Server::new(Config::default());
    let resets: [fn(&mut Peer); 4] = [
        |peer| peer.write(reset::REGISTER, RESET_KEY),
        |peer| peer.client.reset().unwrap(),
        function_level_reset,
        |peer| {
            peer.client.reset().unwrap();
            peer.write(reset::REGISTER, RESET_KEY);
            peer.client.reset().unwrap();
        },
    ];
    for (number, reset) in resets.into_iter().enumerate() {
        let mut peer = busy(&server.socket());
        let began = Instant::now();
        reset(&mut peer);
        assert!(began.elapsed() < SECOND, "reset {number}");
        peer.client.region_write(7, 4, &[6, 0]).unwrap();
        assert_eq!((peer.read(status::REGISTER), peer.read(completed::REGISTER)), (0, 0));
        works(&mut peer);
        drop(peer);
        server.await_trace(&format!("connection {} ends", number + 1));
    }
}

#[test]
fn cancelled_frames_say_so_within_a_second() {
    let server = Server::new(Config::default());
    let mut peer = busy(&server.socket());
    let began = Instant::now();
    peer.write(cancel::REGISTER, cancel::PLANES.mask() | cancel::TRANSFERS.mask());
    await_that(|| status::BUSY.get(peer.read(status::REGISTER)) == 0);
    assert!(began.elapsed() < SECOND);
    for plane in 0..4 {
        assert_eq!(peer.plane_state(plane), (1, result::FAILED));
        assert_eq!(peer.read_at(plane_fault::REGISTER.at(plane)), 6, "cancelled, and nothing to blame");
    }
    assert_eq!(peer.read(transfer_fault::REGISTER), 6);
    works(&mut peer);
    assert!(server.trace().contains("frame 1 failed: cancelled\n"));
}

#[test]
fn memory_goes_in_the_midst_of_a_frame_and_the_frame_goes_on() {
    let server = Server::new(Config::default());
    let mut peer = busy(&server.socket());
    let began = Instant::now();
    peer.client.dma_unmap(HOST, HOST_SIZE).unwrap();
    assert!(began.elapsed() < SECOND);
    assert_eq!(peer.plane_state(0), (0, 0));
    peer.write(cancel::REGISTER, cancel::PLANES.mask());
    // The transfer finds its memory gone, and so does the status copy.
    await_that(|| peer.read(transfer_state::REGISTER) == 2 | result::FAILED << 16);
    assert_eq!(peer.read(transfer_fault::REGISTER) & 0xff, 7);
    works(&mut peer);
}

#[test]
fn a_guest_reboots_in_the_midst_of_a_frame() {
    const MSIX: u32 = 2;
    const DISABLE: u32 = 1 | 1 << 5;
    const ATTACH: u32 = 1 << 2 | 1 << 5;
    let server = Server::new(Config { strict: true, ..Config::default() });
    let mut peer = busy(&server.socket());
    for _ in 0..3 {
        let began = Instant::now();
        // As QEMU does it: interrupts off, two resets, interrupts on; the guest enables the card again.
        peer.client.set_irqs(MSIX, DISABLE, 0, 0, &[]).unwrap();
        peer.client.reset().unwrap();
        peer.client.reset().unwrap();
        assert!(began.elapsed() < SECOND);
        peer.client.region_write(7, 4, &[6, 0]).unwrap();
        for (vector, event) in peer.events.iter().enumerate() {
            let event = [std::os::fd::AsRawFd::as_raw_fd(event)];
            peer.client.set_irqs(MSIX, ATTACH, vector as u32, 1, &event).unwrap();
            assert_eq!(rustix::io::read(&peer.events[vector], &mut [0u8; 8]), Err(rustix::io::Errno::AGAIN));
        }
        works(&mut peer);
        peer.await_interrupt(Vector::Frame as usize);
        peer.start(&long_frame(1, 0));
    }
}

/// The ways in which a client goes.
fn go(way: usize, socket: &Path) {
    match way {
        0 => drop(Peer::new(socket)),
        1 => drop(busy(socket)),
        // In the midst of a message, before and after the negotiation.
        2 => UnixStream::connect(socket).unwrap().write_all(&[1, 0, 1, 0, 40, 0, 0, 0, 0]).unwrap(),
        3 => {
            let mut stream = UnixStream::connect(socket).unwrap();
            stream.write_all(&[&[1, 0, 1, 0, 20, 0, 0, 0], &[0; 12][..]].concat()).unwrap();
            stream.write_all(&[&[2, 0, 10, 0, 255, 0, 0, 0], &[0; 30][..]].concat()).unwrap();
        }
        // Unplugged: interrupts and memory go first.
        4 => {
            let mut peer = busy(socket);
            peer.client.set_irqs(2, 1 | 1 << 5, 0, 0, &[]).unwrap();
            peer.client.dma_unmap(HOST, HOST_SIZE).unwrap();
        }
        5 => busy(socket).client.shutdown().unwrap(),
        _ => {
            let mut peer = Peer::new(socket);
            works(&mut peer);
            start_transfer(&mut peer, 3, HOST, PixelFormat::Rgba8);
        }
    }
}

#[test]
fn fifty_clients_leave_nothing_behind_in_whatever_way_they_go() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("card.sock");
    let (child, _) = ready(command(&["--socket", socket.to_str().unwrap(), "--strict"]));
    let at_rest = || {
        // A connection that is served shows that the last one is over.
        drop(Peer::new(&socket));
        std::thread::sleep(Duration::from_millis(5));
        holdings(child.id())
    };
    (0..7).for_each(|way| go(way, &socket));
    await_that(|| at_rest() == at_rest());
    let before = at_rest();
    for turn in 0..50 {
        let began = Instant::now();
        go(turn % 7, &socket);
        await_that(|| at_rest() == before);
        assert!(began.elapsed() < 3 * SECOND, "turn {turn}");
    }
    let (code, log) = end(child, Signal::TERM);
    assert_eq!(code, Some(0), "{log}");
    assert!(log.contains("panics: 0") && !log.contains("did not end within"), "{log}");
}
