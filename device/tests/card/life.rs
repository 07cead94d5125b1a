//! What clients leave behind when they go, in whatever way.

use std::time::{Duration, Instant};

use vg500_regs::pci::{PIXEL_MEMORY, VOXEL_MEMORY};
use vg500_regs::table::*;
use volumepro_device::Config;

use crate::peer::{HOST, Peer, Server, await_that, frame};

/// Open descriptors and mappings of this process.
fn resources() -> (usize, usize) {
    let descriptors = std::fs::read_dir("/proc/self/fd").unwrap().count();
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    (descriptors, maps.lines().filter(|line| line.contains("vg500-")).count())
}

#[test]
fn a_client_that_goes_in_the_midst_of_a_frame_leaves_nothing_behind() {
    let server = Server::new(Config::default());
    for connection in 1..=5 {
        let mut peer = Peer::new(&server.socket());
        assert_eq!(peer.read(status::REGISTER), 0);
        assert_eq!(peer.memory(VOXEL_MEMORY).bytes(0, 64), [0; 64]);
        assert_eq!(peer.memory(PIXEL_MEMORY).bytes(0, 64), [0; 64]);
        peer.fill(32);
        peer.memory(PIXEL_MEMORY).view().write(0, &[9; 64]).unwrap();
        peer.write(status_address_low::REGISTER, HOST as u32);
        peer.write(status_control::REGISTER, 1);
        // Frames of whatever length the machine makes of them.
        (0..16).for_each(|plane| peer.start(&frame(32, 1, plane)));
        let began = Instant::now();
        drop(peer);
        server.await_trace(&format!("connection {connection} ends"));
        assert!(began.elapsed() < Duration::from_secs(2));
    }
}

#[test]
fn the_last_clients_mapping_does_not_reach_the_next_client() {
    let server = Server::new(Config::default());
    let old = Peer::new(&server.socket());
    old.client.shutdown().unwrap();
    server.await_trace("connection 1 ends");
    let new = Peer::new(&server.socket());
    old.memory(VOXEL_MEMORY).view().write(100, &[1; 8]).unwrap();
    new.memory(VOXEL_MEMORY).view().write(200, &[2; 8]).unwrap();
    assert_eq!(new.memory(VOXEL_MEMORY).bytes(100, 8), [0; 8]);
    assert_eq!(old.memory(VOXEL_MEMORY).bytes(200, 8), [0; 8]);
}

#[test]
fn many_connections_cost_nothing_that_stays() {
    let server = Server::new(Config::default());
    let visit = |number: usize| {
        drop(Peer::new(&server.socket()));
        server.await_trace(&format!("connection {number} ends"));
    };
    (1..=3).for_each(visit);
    // Other tests of this program open and close as well, so the least of several looks is compared.
    let least = || (0..20).map(|_| resources()).min().unwrap();
    let before = least();
    (4..=103).for_each(visit);
    await_that(|| {
        let (descriptors, mappings) = resources();
        descriptors <= before.0 + 60 && mappings <= before.1 + 60
    });
}

#[test]
fn a_card_that_is_stopped_drops_its_client() {
    let server = Server::new(Config::default());
    let mut peer = Peer::new(&server.socket());
    peer.fill(32);
    peer.start(&frame(32, 1, 0));
    let began = Instant::now();
    let Server { folder, handle } = server;
    handle.stop().unwrap();
    assert!(began.elapsed() < Duration::from_secs(2));
    assert!(peer.client.region_read(0, 0, &mut [0; 4]).is_err());
    assert!(!folder.path().join("card.sock").exists());
}

#[test]
fn nothing_reaches_host_memory_after_a_reset() {
    let server = Server::new(Config { strict: true, ..Config::default() });
    let mut peer = Peer::new(&server.socket());
    peer.fill(32);
    for round in 0..200 {
        peer.write(interrupt_enable::REGISTER, interrupt_enable::REGISTER.mask());
        peer.write(status_address_low::REGISTER, HOST as u32);
        peer.write(status_control::REGISTER, 1);
        peer.start(&frame(32, round, round % 16));
        // The publisher is busy with this one when the reset comes.
        peer.write(acknowledge::REGISTER, acknowledge::REGISTER.mask());
        if round % 2 == 0 {
            peer.write(reset::REGISTER, RESET_KEY);
        } else {
            peer.client.reset().unwrap();
            peer.client.region_write(7, 4, &[6, 0]).unwrap();
        }
        peer.host.view().write(0, &[0xa5; STATUS_BLOCK]).unwrap();
        std::thread::sleep(Duration::from_micros(300));
        assert_eq!(peer.host.bytes(0, STATUS_BLOCK), [0xa5; STATUS_BLOCK]);
        assert_eq!(peer.read(completed::REGISTER), 0);
    }
    assert!(!server.trace().contains("mistake:"), "{}", server.trace());
}
