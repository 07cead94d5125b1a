//! Connections one after another, resets, and the end.

use std::os::fd::AsFd;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use rustix::io::Errno;

use volumepro_device::dma::DmaError;
use volumepro_device::protocol::ResetReason;

use crate::common::*;

/// Waits until the server has dealt with the end of a connection.
fn eventually(mut condition: impl FnMut() -> bool) {
    let deadline = Instant::now() + Duration::from_secs(10);
    while !condition() {
        assert!(Instant::now() < deadline, "it never happened");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn every_client_finds_power_on_state() {
    let rig = Rig::new();
    let failed = event();
    for _ in 0..3 {
        let mut client = rig.client();
        assert_eq!((client.read(BAR0, 0, 4), client.read(BAR2, 0, 4)), (vec![0; 4], vec![0; 4]));
        assert_eq!(client.read(CONFIG, 4, 2), [0, 0]);
        assert_eq!(rig.dma.write(0, &[1]), Err(DmaError::BusMasterDisabled));
        rig.interrupts.fail();
        assert_eq!(events(&failed), 0);
        client.enable();
        assert_eq!(rig.dma.write(0, &[1]), Err(DmaError::NotMapped { iova: 0 }));
        client.write(BAR0, 0, &[1; 4]);
        client.write(BAR2, 0, &[1; 4]);
        client.map(0, 4096, &memory(4096));
        let failed = [failed.as_fd()];
        client.succeed_with(SET_IRQS, &set_irqs(0x24, 3, 0, 1), &failed);
        drop(client);
        eventually(|| {
            rig.resets.lock().unwrap().last() == Some(&ResetReason::LostConnection) && rig.dma.is_empty()
        });
    }
    let pairs = [ResetReason::Connection, ResetReason::LostConnection].repeat(3);
    assert_eq!(*rig.resets.lock().unwrap(), pairs);
}

#[test]
fn reset_is_idempotent_and_keeps_memory_and_descriptors() {
    let rig = Rig::new();
    let mut client = rig.client();
    let (error, file) = (event(), memory(4096));
    client.map(0, 4096, &file);
    client.succeed_with(SET_IRQS, &set_irqs(0x24, 3, 0, 1), &[error.as_fd()]);
    for _ in 0..2 {
        client.enable();
        client.write(BAR0, 0, &[1]);
        assert!(client.succeed(RESET, &[]).is_empty());
        assert_eq!((client.read(BAR0, 0, 1), client.read(CONFIG, 4, 1)), (vec![0], vec![0]));
    }
    rig.interrupts.fail();
    assert_eq!((events(&error), rig.dma.len()), (1, 1));
}

#[test]
fn function_level_reset_comes_through_configuration_space() {
    let rig = Rig::new();
    let mut client = rig.client();
    let mut at = client.read(CONFIG, 0x34, 1)[0];
    while client.read(CONFIG, u64::from(at), 1)[0] != 0x10 {
        at = client.read(CONFIG, u64::from(at) + 1, 1)[0];
    }
    client.enable();
    let control = u64::from(at) + 8;
    client.write(CONFIG, control, &[0, 0x80]);
    assert_eq!(rig.resets.lock().unwrap().last(), Some(&ResetReason::FunctionLevel));
    assert_eq!((client.read(CONFIG, control + 1, 1)[0] & 0x80, client.read(CONFIG, 4, 1)[0]), (0, 0));
}

#[test]
fn a_second_client_is_told_at_once_that_the_device_is_busy() {
    let rig = Rig::new();
    let mut first = rig.client();
    for turn in 0..5 {
        let began = Instant::now();
        let mut second = rig.connect();
        let reply = second.ask(VERSION, &[&[0; 4], &b"{}\0"[..]].concat());
        assert_eq!((reply.flags, reply.error), (ERROR_REPLY, Errno::BUSY.raw_os_error() as u32));
        assert!(second.is_closed());
        assert!(began.elapsed() < Duration::from_secs(1), "{turn}");
        first.works();
    }
    assert_eq!(rig.counters.turned_away.load(Ordering::Relaxed), 5);
}

#[test]
fn clients_that_are_turned_away_cannot_hold_the_door() {
    let rig = Rig::new();
    let mut first = rig.client();
    let (ours, mut theirs) = std::io::pipe().unwrap();
    // One says nothing, one says half a header, one lies, one wants no reply, and one brings descriptors.
    let silent = rig.connect();
    let mut half = rig.connect();
    half.send(&[1; 7], &[]);
    let mut liar = rig.connect();
    liar.send(&raw(1, VERSION, u32::MAX, 0, &[]), &[]);
    let mut shy = rig.connect();
    shy.send(&message(1, VERSION, NO_REPLY, &[0; 4]), &[]);
    let mut bearer = rig.connect();
    bearer.send(&message(1, VERSION, 0, &[0; 4]), &[ours.as_fd()]);
    assert_eq!(bearer.receive().error, Errno::BUSY.raw_os_error() as u32);
    for mut client in [silent, half, liar, shy, bearer] {
        assert!(client.is_closed());
    }
    drop(ours);
    let broken = std::io::Write::write(&mut theirs, &[0]).unwrap_err();
    assert_eq!(broken.kind(), std::io::ErrorKind::BrokenPipe, "descriptors are closed");
    first.works();
}

#[test]
fn a_client_that_comes_as_the_last_one_goes_is_served() {
    let rig = Rig::new();
    let mut client = rig.client();
    for turn in 0..200 {
        match turn % 3 {
            0 => {}
            1 => _ = client.command(GET_INFO, 0, &[0; 16], &[]),
            _ => client.send(&[0; 3], &[]),
        }
        drop(client);
        client = rig.client();
    }
    client.works();
    assert_eq!(rig.counters.turned_away.load(Ordering::Relaxed), 0);
}

#[test]
fn a_client_whose_end_is_closed_a_moment_later_does_not_keep_others_out() {
    let rig = Rig::new();
    let client = rig.client();
    // As in a child between fork and exec.
    let inherited = client.stream.try_clone().unwrap();
    drop(client);
    let closing = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(50));
        drop(inherited);
    });
    rig.client().works();
    closing.join().unwrap();
}

#[test]
fn a_client_that_the_server_gave_up_does_not_keep_others_out() {
    let rig = Rig::new();
    let mut broken = rig.client();
    broken.send(&raw(5, REGION_WRITE, 3, 0, &[]), &[]);
    broken.receive();
    assert!(broken.is_closed());
    // It keeps its end open.
    rig.client().works();
}

#[test]
fn a_client_that_hangs_up_without_taking_its_replies_is_let_go() {
    let rig = Rig::new();
    let mut deaf = rig.client();
    let read = message(1, REGION_READ, 0, &access(BAR2, 0, 1 << 20));
    (0..4).for_each(|_| deaf.send(&read, &[]));
    deaf.stream.shutdown(std::net::Shutdown::Write).unwrap();
    rig.client().works();
}

#[test]
fn a_thousand_clients_come_and_go() {
    let rig = Rig::new();
    for turn in 0..1000 {
        let mut client = rig.connect();
        match turn % 4 {
            0 => {}
            1 => client.send(&[1, 0, 1], &[]),
            2 => _ = client.version(),
            // Gone while replies are due.
            _ => (0..20).for_each(|_| _ = client.try_send(&message(0, GET_INFO, 0, &[0; 16]), &[])),
        }
    }
    rig.client().works();
}

#[test]
fn stopping_ends_every_wait_and_takes_the_path_away() {
    let began = Instant::now();
    // Waiting for a client, for a version, for the rest of a message.
    for stage in 0..3 {
        let mut rig = Rig::new();
        let mut client = (stage > 0).then(|| rig.client());
        if let Some(client) = client.as_mut().filter(|_| stage == 2) {
            client.send(&message(1, GET_INFO, 0, &[0; 16])[..20], &[]);
        }
        rig.end().unwrap();
        assert!(!rig.path().exists());
        assert!(client.is_none_or(|mut client| client.is_closed()));
    }
    assert!(began.elapsed() < Duration::from_secs(5));
}
