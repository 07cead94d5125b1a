//! Messages that are wrong as such.

use std::os::fd::AsFd;
use std::sync::atomic::Ordering;
use std::time::Duration;

use rustix::io::Errno;

use crate::common::*;

#[test]
fn impossible_sizes_close_the_connection_and_the_next_works() {
    let rig = Rig::new();
    for size in [0, 1, 15, 16 + 16 + (1 << 20) + 1, 1 << 30, u32::MAX] {
        let mut client = rig.client();
        client.send(&raw(5, REGION_WRITE, size, 0, &[]), &[]);
        let reply = client.receive();
        assert_eq!(
            (reply.id, reply.flags, reply.error),
            (5, ERROR_REPLY, Errno::MSGSIZE.raw_os_error() as u32)
        );
        assert!(client.is_closed());
        rig.client().works();
    }
}

#[test]
fn impossible_sizes_without_reply_wanted_close_in_silence() {
    let rig = Rig::new();
    let mut client = rig.client();
    client.send(&raw(5, REGION_WRITE, 3, NO_REPLY, &[]), &[]);
    assert!(client.is_closed());
    rig.client().works();
}

#[test]
fn unknown_commands_lose_their_payload_not_the_stream() {
    let rig = Rig::new();
    let mut client = rig.client();
    for command in [0, 6, DMA_READ, DMA_WRITE, 14, 16, 17, 18, 19, 0xffff] {
        for length in [0, 1, 15, 16, 17, 4096, 1 << 20] {
            assert_eq!(client.fail(command, &vec![0x55; length]), Errno::OPNOTSUPP);
        }
    }
}

#[test]
fn replies_nobody_asked_for_are_dropped() {
    let rig = Rig::new();
    let mut client = rig.client();
    for command in [0, VERSION, REGION_WRITE, DMA_READ, 0xffff] {
        for flags in [REPLY, REPLY | NO_REPLY, ERROR_REPLY] {
            client.command(command, flags, &[1; 40], &[]);
        }
    }
    client.works();
    assert_eq!(rig.counters.stray_replies.load(Ordering::Relaxed), 15);
}

#[test]
fn unknown_types_are_refused() {
    let rig = Rig::new();
    let mut client = rig.client();
    for kind in 2..16 {
        let id = client.command(GET_INFO, kind, &words(&[16, 0, 0, 0]), &[]);
        let reply = client.receive();
        assert_eq!((reply.id, reply.flags, reply.error), (id, ERROR_REPLY, 22));
        client.command(GET_INFO, kind | NO_REPLY, &words(&[16, 0, 0, 0]), &[]);
        client.works();
    }
}

#[test]
fn no_reply_means_no_reply() {
    let rig = Rig::new();
    let mut client = rig.client();
    let place = access(BAR0, 8, 4);
    client.command(REGION_WRITE, NO_REPLY, &[&place[..], &[1, 2, 3, 4]].concat(), &[]);
    // Errors neither, and information is not wanted, then.
    client.command(REGION_WRITE, NO_REPLY, &access(9, 0, 4), &[]);
    client.command(REGION_READ, NO_REPLY, &place, &[]);
    client.command(GET_INFO, NO_REPLY, &words(&[16, 0, 0, 0]), &[]);
    client.command(GET_REGION_INFO, NO_REPLY, &words(&[64, 0, BAR2, 0, 0, 0, 0, 0]), &[]);
    client.command(VERSION, NO_REPLY, &[], &[]);
    client.command(77, NO_REPLY, &[9; 99], &[]);
    client.works();
    assert_eq!(client.read(BAR0, 8, 4), [1, 2, 3, 4]);
}

#[test]
fn messages_may_come_byte_by_byte() {
    let rig = Rig::new();
    let file = memory(4096);
    let map = message(1, DMA_MAP, 0, &dma_map(3, 0, 0, 4096));
    for at in 0..map.len() {
        // The descriptor may come with any byte of its message.
        let mut client = rig.client();
        for (position, byte) in map.iter().enumerate() {
            let descriptor = [file.as_fd()];
            client.send(&[*byte], if position == at { &descriptor } else { &[] });
        }
        assert_eq!(client.receive().error, 0, "{at}");
        assert_eq!(rig.dma.len(), 1);
    }
    let mut client = rig.client();
    for part in message(2, GET_INFO, 0, &words(&[16, 0, 0, 0])).chunks(3) {
        client.send(part, &[]);
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(client.receive().payload, words(&[16, 3, 9, 5]));
}

#[test]
fn many_messages_may_come_at_once() {
    let rig = Rig::new();
    let mut client = rig.client();
    let file = memory(4096);
    let mut batch = Vec::new();
    for id in 0..100 {
        batch.extend(message(
            id,
            REGION_WRITE,
            0,
            &[&access(BAR0, u64::from(id), 1)[..], &[id as u8]].concat(),
        ));
    }
    client.send(&batch, &[]);
    // Descriptors belong to the message they come with, whatever lies before it in the stream.
    client.command(DMA_MAP, 0, &dma_map(3, 0, 0, 4096), &[file.as_fd()]);
    for id in 0..100 {
        let reply = client.receive();
        assert_eq!((reply.id, reply.error), (id, 0));
    }
    assert_eq!(client.receive().error, 0);
    assert_eq!(client.read(BAR0, 0, 100), (0..100).collect::<Vec<u8>>());
}

#[test]
fn descriptors_where_none_belong_are_refused_and_closed() {
    let rig = Rig::new();
    let mut client = rig.client();
    let (ours, mut theirs) = std::io::pipe().unwrap();
    let payloads = [
        (GET_INFO, words(&[16, 0, 0, 0])),
        (REGION_READ, access(BAR0, 0, 4)),
        (RESET, Vec::new()),
        (DMA_UNMAP, dma_unmap(0, 0, 4096)),
        (77, Vec::new()),
    ];
    for (command, payload) in payloads {
        client.fail_with(command, &payload, &[ours.as_fd()]);
    }
    // More than a message may carry; the system cuts some of them off.
    client.fail_with(SET_IRQS, &set_irqs(0x24, 2, 0, 3), &[ours.as_fd(); 17]);
    client.fail_with(SET_IRQS, &set_irqs(0x24, 2, 0, 3), &[ours.as_fd(); 40]);
    drop(ours);
    // All copies are gone, else there would still be a reader.
    let broken = std::io::Write::write(&mut theirs, &[0]).unwrap_err();
    assert_eq!(broken.kind(), std::io::ErrorKind::BrokenPipe);
}

#[test]
fn a_client_that_does_not_take_its_replies_can_be_stopped() {
    let mut rig = Rig::new();
    let mut client = rig.client();
    let read = access(BAR2, 0, 1 << 20);
    for _ in 0..8 {
        client.command(REGION_READ, 0, &read, &[]);
    }
    std::thread::sleep(Duration::from_millis(50));
    rig.end().unwrap();
}
