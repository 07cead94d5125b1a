//! `DEVICE_GET_INFO`, `DEVICE_GET_REGION_INFO`, `DEVICE_GET_IRQ_INFO`.

use rustix::io::{Errno, pread};
use volumepro_device::interrupt::InterruptMode;

use crate::common::*;

#[test]
fn short_payloads_and_too_little_room_are_refused() {
    let rig = Rig::new();
    let mut client = rig.client();
    for (command, size) in [(GET_INFO, 16u32), (GET_REGION_INFO, 32), (GET_IRQ_INFO, 16)] {
        let mut payload = vec![0; size as usize];
        payload[..4].copy_from_slice(&size.to_le_bytes());
        for length in 0..payload.len() {
            assert_eq!(client.fail(command, &payload[..length]), Errno::INVAL, "{command} {length}");
        }
        client.succeed(command, &payload);
        for room in [0, 1, size - 1] {
            payload[..4].copy_from_slice(&room.to_le_bytes());
            assert_eq!(client.fail(command, &payload), Errno::INVAL);
        }
    }
}

#[test]
fn indices_out_of_range_are_refused() {
    let rig = Rig::new();
    let mut client = rig.client();
    for index in [9, 10, 1 << 31, u32::MAX] {
        assert_eq!(client.fail(GET_REGION_INFO, &words(&[32, 0, index, 0, 0, 0, 0, 0])), Errno::INVAL);
    }
    for index in [5, u32::MAX] {
        assert_eq!(client.fail(GET_IRQ_INFO, &words(&[16, 0, index, 0])), Errno::INVAL);
    }
}

#[test]
fn regions_tell_size_and_access() {
    let rig = Rig::new();
    let mut client = rig.client();
    for (index, flags, size) in
        [(BAR0, 3, 4096), (1, 0, 0), (BAR4, 1, 16), (6, 0, 0), (CONFIG, 3, 4096), (8, 0, 0)]
    {
        let reply = client.ask(GET_REGION_INFO, &words(&[1 << 20, 0, index, 0, 0, 0, 0, 0]));
        assert_eq!(reply.payload, words(&[32, flags, index, 0, size, 0, 0, 0]));
        assert_eq!(reply.descriptors.len(), 0);
    }
}

#[test]
fn a_mapped_region_is_asked_for_twice_and_comes_with_its_descriptor() {
    let rig = Rig::new();
    let mut client = rig.client();
    let size = MEMORY as u32;
    let fixed = words(&[64, 0xf, BAR2, 32, size, 0, 0, 0]);
    for room in [32, 63] {
        let first = client.ask(GET_REGION_INFO, &words(&[room, 0, BAR2, 0, 0, 0, 0, 0]));
        assert_eq!((first.payload, first.descriptors.len()), (fixed.clone(), 0));
    }
    let whole = client.ask(GET_REGION_INFO, &words(&[64, 0, BAR2, 0, 0, 0, 0, 0]));
    let sparse = words(&[1 << 16 | 1, 0, 1, 0, 0, 0, size, 0]);
    assert_eq!(whole.payload, [fixed, sparse].concat());
    let [file] = &whole.descriptors[..] else { panic!("one descriptor") };
    client.write(BAR2, 4000, b"seen by both");
    let mut seen = [0; 12];
    pread(file, &mut seen, 4000).unwrap();
    assert_eq!(&seen, b"seen by both");
    assert!(rustix::fs::ftruncate(file, 0).is_err());
}

#[test]
fn interrupts_tell_number_and_abilities() {
    for (mode, counts) in [
        (InterruptMode::Msix, [0, 4, 3, 1, 1]),
        (InterruptMode::Msi, [0, 4, 0, 1, 1]),
        (InterruptMode::Intx, [1, 0, 0, 1, 1]),
    ] {
        let rig = Rig::with(mode);
        let mut client = rig.client();
        for (index, (count, flags)) in counts.into_iter().zip([7, 3, 3, 1, 1]).enumerate() {
            let reply = client.succeed(GET_IRQ_INFO, &words(&[16, 0, index as u32, 0]));
            assert_eq!(reply, words(&[16, flags, index as u32, count]));
        }
    }
}
