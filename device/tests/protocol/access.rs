//! `REGION_READ`, `REGION_WRITE`, `REGION_WRITE_MULTI`.

use std::sync::atomic::Ordering;

use rustix::io::Errno;

use crate::common::*;

#[test]
fn accesses_outside_of_regions_are_refused() {
    let rig = Rig::new();
    let mut client = rig.client();
    for (region, offset, count) in [
        (BAR0, 4096, 1),
        (BAR0, 4095, 2),
        (BAR0, 0, 4097),
        (BAR0, u64::MAX, 1),
        (BAR0, u64::MAX - 3, 4),
        (BAR0, u64::MAX, u32::MAX),
        (BAR2, 0, 1 << 30),
        (BAR2, 0, (1 << 20) + 1),
        (1, 0, 1),
        (1, 0, 0),
        (9, 0, 4),
        (u32::MAX, 0, 4),
    ] {
        assert_eq!(client.fail(REGION_READ, &access(region, offset, count)), Errno::INVAL);
        let write = [access(region, offset, count), vec![1; 4]].concat();
        assert_eq!(client.fail(REGION_WRITE, &write), Errno::INVAL);
        let multi = [longs(&[1]), access(region, offset, count), vec![1; 8]].concat();
        assert_eq!(client.fail(WRITE_MULTI, &multi), Errno::INVAL);
    }
}

#[test]
fn counts_that_disagree_with_the_message_are_refused() {
    let rig = Rig::new();
    let mut client = rig.client();
    for (count, length) in [(4, 0), (4, 3), (4, 5), (0, 4), (4, 1 << 20), (1 << 20, 4)] {
        let write = [access(BAR0, 0, count), vec![1; length]].concat();
        assert_eq!(client.fail(REGION_WRITE, &write), Errno::INVAL);
    }
    for command in [REGION_READ, REGION_WRITE] {
        for length in 0..16 {
            assert_eq!(client.fail(command, &access(BAR0, 0, 0)[..length]), Errno::INVAL);
        }
    }
    let entry = |count| [access(BAR0, 0, count), vec![7; 8]].concat();
    for payload in [
        vec![],
        longs(&[1]),
        longs(&[u64::MAX]),
        [longs(&[2]), entry(4)].concat(),
        [longs(&[1]), entry(9)].concat(),
        [longs(&[1]), entry(4)[..23].to_vec()].concat(),
    ] {
        assert_eq!(client.fail(WRITE_MULTI, &payload), Errno::INVAL);
    }
}

#[test]
fn access_flags_are_obeyed() {
    let rig = Rig::new();
    let mut client = rig.client();
    assert_eq!(client.read(BAR4, 3, 2), [4, 4]);
    assert_eq!(client.fail(REGION_WRITE, &[access(BAR4, 0, 1), vec![0]].concat()), Errno::PERM);
}

#[test]
fn errors_of_the_device_reach_the_client() {
    let rig = Rig::new();
    let mut client = rig.client();
    assert_eq!(client.fail(REGION_READ, &access(BAR0, FAIL, 4)), Errno::BUSY);
    assert_eq!(client.fail(REGION_WRITE, &[access(BAR0, FAIL, 4), vec![0; 4]].concat()), Errno::BUSY);
}

#[test]
fn a_panic_of_the_device_ends_that_connection_only() {
    let rig = Rig::new();
    for (turn, command) in [REGION_READ, REGION_WRITE].into_iter().enumerate() {
        let mut client = rig.client();
        client.write(BAR0, 0, &[1]);
        let payload = [access(BAR0, PANIC, 4), vec![0; 4 * turn]].concat();
        client.command(command, 0, &payload, &[]);
        assert!(client.is_closed());
        assert_eq!(rig.counters.panics.load(Ordering::Relaxed), turn as u64 + 1);
        assert_eq!(rig.client().read(BAR0, 0, 1), [0], "the device has been reset");
    }
}

#[test]
fn any_width_and_alignment_goes_through() {
    let rig = Rig::new();
    let mut client = rig.client();
    for region in [BAR0, BAR2] {
        let mut expected = vec![0; 200];
        for (turn, (offset, length)) in
            [(0, 1), (1, 2), (3, 4), (5, 8), (7, 3), (100, 64), (199, 1)].into_iter().enumerate()
        {
            let data = vec![turn as u8 + 1; length];
            client.write(region, offset as u64, &data);
            expected[offset..offset + length].copy_from_slice(&data);
            assert_eq!(client.read(region, 0, 200), expected);
        }
        assert!(client.read(region, 5, 0).is_empty());
        client.write(region, 5, &[]);
    }
}

#[test]
fn the_largest_transfer_goes_through() {
    let rig = Rig::new();
    let mut client = rig.client();
    let data: Vec<u8> = (0..1usize << 20).map(|at| (at * 7 % 251) as u8).collect();
    // The server has read it all before it answers.
    client.write(BAR2, MEMORY - (1 << 20), &data);
    assert!(client.read(BAR2, MEMORY - (1 << 20), 1 << 20) == data);
}

#[test]
fn several_writes_come_in_one_message() {
    let rig = Rig::new();
    let mut client = rig.client();
    let entry = |offset, data: &[u8; 8], count| [access(BAR0, offset, count), data.to_vec()].concat();
    let writes = [entry(0, b"abcdefgh", 8), entry(2, b"XY______", 2), entry(6, b"Z_______", 1)].concat();
    assert_eq!(client.succeed(WRITE_MULTI, &[longs(&[3]), writes].concat()), longs(&[3]));
    assert_eq!(client.read(BAR0, 0, 8), b"abXYefZh");
    // Writes before one that fails have been carried out.
    let broken = [entry(0, b"1_______", 1), entry(FAIL, b"________", 4), entry(1, b"3_______", 1)].concat();
    assert_eq!(client.fail(WRITE_MULTI, &[longs(&[3]), broken].concat()), Errno::BUSY);
    assert_eq!(client.read(BAR0, 0, 3), b"1bX");
    assert_eq!(client.succeed(WRITE_MULTI, &longs(&[0])), longs(&[0]));
}
