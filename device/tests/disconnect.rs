//! A client that disappears at any byte leaves nothing behind: no descriptor, no mapping.
//!
//! The counts are those of the process, so this is the only test in it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[expect(dead_code, reason = "most of it is for the tests of the protocol")]
mod common;

use std::os::fd::{AsFd, BorrowedFd};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use common::*;
use volumepro_device::protocol::ResetReason;

/// Descriptors of the process, and its mappings of files that came over a socket.
fn count() -> (usize, usize) {
    let descriptors = std::fs::read_dir("/proc/self/fd").unwrap().count();
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    (descriptors, maps.matches("guest memory").count())
}

/// A session in which every kind of thing is given to the server.
fn session<'a>(file: BorrowedFd<'a>, event: BorrowedFd<'a>) -> Vec<(Vec<u8>, Vec<BorrowedFd<'a>>)> {
    let messages = [
        (VERSION, [&[0; 4][..], b"{}\0"].concat(), vec![]),
        (DMA_MAP, dma_map(3, 0, 0, 4096), vec![file]),
        (DMA_MAP, dma_map(1, 4096, 4096, 4096), vec![file]),
        (DMA_MAP, dma_map(3, 0, 1 << 20, 4096), vec![]),
        (GET_REGION_INFO, words(&[64, 0, BAR2, 0, 0, 0, 0, 0]), vec![]),
        (SET_IRQS, set_irqs(0x24, 2, 0, 3), vec![event; 3]),
        (SET_IRQS, set_irqs(0x24, 3, 0, 1), vec![event]),
        (REGION_WRITE, [access(CONFIG, 4, 2), vec![6, 0]].concat(), vec![]),
        (DMA_UNMAP, dma_unmap(0, 4096, 4096), vec![]),
        // Descriptors that are refused go, too.
        (GET_INFO, words(&[16, 0, 0, 0]), vec![file, event]),
        (RESET, vec![], vec![]),
        (REGION_READ, access(BAR2, 0, 64), vec![]),
    ];
    messages.into_iter().map(|(command, payload, with)| (message(1, command, 0, &payload), with)).collect()
}

/// Plays the first `length` bytes and disappears.
fn disappear_after(rig: &Rig, session: &[(Vec<u8>, Vec<BorrowedFd<'_>>)], length: usize) {
    let mut client = rig.connect();
    let mut left = length;
    for (message, descriptors) in session {
        let part = &message[..left.min(message.len())];
        if !part.is_empty() {
            client.send(part, descriptors);
        }
        left -= part.len();
    }
}

#[test]
fn nothing_stays_behind_wherever_the_client_disappears() {
    let rig = Rig::new();
    let (file, event) = (memory(8192), event());
    let session = session(file.as_fd(), event.as_fd());
    let total: usize = session.iter().map(|(message, _)| message.len()).sum();
    // Lazily made descriptors exist from here on.
    rig.client().works();
    let settled = |before: Option<(usize, usize)>, connections: u64| {
        let deadline = Instant::now() + Duration::from_secs(10);
        loop {
            let lost = |resets: &[ResetReason]| {
                resets.iter().filter(|&&reason| reason == ResetReason::LostConnection).count()
            };
            let over = lost(&rig.resets.lock().unwrap()) as u64 == connections;
            if over && before.is_none_or(|before| before == count()) {
                return count();
            }
            assert!(Instant::now() < deadline, "{:?} has become {:?}", before, count());
            std::thread::sleep(Duration::from_micros(200));
        }
    };
    let before = settled(None, 1);
    for length in 0..=total {
        disappear_after(&rig, &session, length);
        settled(Some(before), 2 + length as u64);
    }
    // The whole session was served, and gave what is counted here.
    let mut client = rig.connect();
    for (message, descriptors) in &session {
        client.send(message, descriptors);
        client.receive();
    }
    let (descriptors, mappings) = count();
    assert!(descriptors > before.0 + 4 && mappings == before.1 + 1);
    drop(client);
    settled(Some(before), 3 + total as u64);
    assert_eq!(rig.counters.panics.load(Ordering::Relaxed), 0);
}
