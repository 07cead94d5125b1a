//! `DMA_MAP`, `DMA_UNMAP`.

use std::os::fd::AsFd;
use std::time::Instant;

use rustix::io::{Errno, pread};
use volumepro_device::dma::{Direction, DmaError, PATIENCE};

use crate::common::*;

const PAGE: u64 = 4096;

#[test]
fn bad_maps_are_refused() {
    let rig = Rig::new();
    let mut client = rig.client();
    let file = memory(4 * PAGE);
    for payload in [
        dma_map(3, 0, u64::MAX, u64::MAX),
        dma_map(3, 0, 0, u64::MAX),
        dma_map(3, 0, u64::MAX - PAGE + 1, 2 * PAGE),
        dma_map(3, 0, 0, 0),
        dma_map(3, 0, 7, PAGE),
        dma_map(3, 0, 0, 7),
        dma_map(0, 0, 0, PAGE),
        dma_map(7, 0, 0, PAGE),
        dma_map(u32::MAX, 0, 0, PAGE),
    ] {
        assert_eq!(client.fail(DMA_MAP, &payload), Errno::INVAL);
        assert_eq!(client.fail_with(DMA_MAP, &payload, &[file.as_fd()]), Errno::INVAL);
    }
    for payload in
        [dma_map(3, 4 * PAGE, 0, PAGE), dma_map(3, u64::MAX - PAGE + 1, 0, PAGE), dma_map(3, 0, 0, 5 * PAGE)]
    {
        assert_eq!(
            client.fail_with(DMA_MAP, &payload, &[file.as_fd()]),
            Errno::INVAL,
            "past the end of the file"
        );
    }
    for length in 0..32 {
        assert_eq!(client.fail(DMA_MAP, &dma_map(3, 0, 0, PAGE)[..length]), Errno::INVAL);
    }
    assert_eq!(
        client.fail_with(DMA_MAP, &dma_map(3, 0, 0, PAGE), &[file.as_fd(), file.as_fd()]),
        Errno::INVAL
    );
    assert_eq!(client.fail_with(DMA_MAP, &dma_map(3, 0, 0, PAGE), &[event().as_fd()]), Errno::INVAL);
    assert!(rig.dma.is_empty());
}

#[test]
fn maps_over_maps_fail_with_eexist() {
    let rig = Rig::new();
    let mut client = rig.client();
    let file = memory(4 * PAGE);
    client.map(0, 2 * PAGE, &file);
    assert_eq!(client.fail_with(DMA_MAP, &dma_map(3, 0, PAGE, PAGE), &[file.as_fd()]), Errno::EXIST);
    assert_eq!(client.fail(DMA_MAP, &dma_map(3, 0, PAGE, PAGE)), Errno::EXIST);
    client.map(2 * PAGE, 2 * PAGE, &file);
}

#[test]
fn bad_unmaps_are_refused_and_empty_ones_are_not() {
    let rig = Rig::new();
    let mut client = rig.client();
    let file = memory(PAGE);
    client.map(0, PAGE, &file);
    for payload in [
        dma_unmap(0, 0, 0),
        dma_unmap(0, 2, u64::MAX),
        dma_unmap(1, 0, PAGE),
        dma_unmap(4, 0, PAGE),
        dma_unmap(2, 0, PAGE),
        dma_unmap(2, PAGE, 0),
        words(&[23, 0, 0, 0, 4096, 0]),
    ] {
        assert_eq!(client.fail(DMA_UNMAP, &payload), Errno::INVAL, "{payload:?}");
    }
    for length in 0..24 {
        assert_eq!(client.fail(DMA_UNMAP, &dma_unmap(0, 0, PAGE)[..length]), Errno::INVAL);
    }
    for (address, size) in [(PAGE, 0x8000_0000), (0xfef0_0000, 0xffff_ffff_0110_0000), (1, u64::MAX)] {
        let payload = dma_unmap(0, address, size);
        assert_eq!(client.succeed(DMA_UNMAP, &payload), payload);
    }
    assert_eq!(rig.dma.len(), 1);
    let all = dma_unmap(2, 0, 0);
    assert_eq!(client.succeed(DMA_UNMAP, &all), all);
    assert!(rig.dma.is_empty());
}

#[test]
fn the_device_reaches_what_the_client_maps() {
    let rig = Rig::new();
    let mut client = rig.client();
    let file = memory(4 * PAGE);
    client.succeed_with(DMA_MAP, &dma_map(3, PAGE, 0x10_0000, 2 * PAGE), &[file.as_fd()]);
    assert_eq!(rig.dma.write(0x10_0000, &[1]), Err(DmaError::BusMasterDisabled));
    client.enable();
    rig.dma.write(0x10_0ffe, b"across").unwrap();
    let mut seen = [0; 6];
    pread(&file, &mut seen, 2 * PAGE - 2).unwrap();
    assert_eq!(&seen, b"across");
    client.succeed(DMA_UNMAP, &dma_unmap(0, 0x10_0000, 2 * PAGE));
    assert_eq!(rig.dma.write(0x10_0000, &[1]), Err(DmaError::NotMapped { iova: 0x10_0000 }));
}

#[test]
fn unmapping_in_a_transfer_answers_before_the_client_gives_up() {
    let rig = Rig::new();
    let mut client = rig.client();
    client.enable();
    client.map(0, PAGE, &memory(PAGE));
    let lease = rig.dma.lease(0, PAGE, Direction::Write).unwrap();
    let began = Instant::now();
    client.succeed(DMA_UNMAP, &dma_unmap(0, 0, PAGE));
    assert!((PATIENCE..2 * PATIENCE).contains(&began.elapsed()));
    assert_eq!(lease.write(0, &[1]), Err(DmaError::Revoked { iova: 0 }));
}

#[test]
fn thousands_of_pages_go_in_and_out() {
    const PAGES: u64 = 4096;
    let rig = Rig::new();
    let mut client = rig.client();
    client.enable();
    let file = memory(PAGES * PAGE);
    for page in 0..PAGES {
        client.succeed_with(DMA_MAP, &dma_map(3, page * PAGE, page * PAGE, PAGE), &[file.as_fd()]);
    }
    let lease = rig.dma.lease(0, PAGES * PAGE, Direction::Write).unwrap();
    lease.write(PAGE / 2, &vec![9; ((PAGES - 1) * PAGE) as usize]).unwrap();
    drop(lease);
    for page in 0..PAGES {
        client.succeed(DMA_UNMAP, &dma_unmap(0, page * PAGE, PAGE));
    }
    let mut seen = vec![0; (PAGES * PAGE) as usize];
    assert_eq!(pread(&file, &mut seen[..], 0).unwrap(), seen.len());
    assert_eq!(seen.iter().filter(|&&byte| byte == 9).count() as u64, (PAGES - 1) * PAGE);
    assert!(rig.dma.is_empty());
}
