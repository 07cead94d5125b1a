//! `DMA_READ` and `DMA_WRITE`, which the server sends for memory without a descriptor.

use std::thread::scope;
use std::time::{Duration, Instant};

use rustix::io::Errno;
use volumepro_device::dma::DmaError;

use crate::common::*;

const PAGE: u64 = 4096;

/// A client that has mapped two pages without a descriptor.
fn client(rig: &Rig, capabilities: &str) -> Client {
    let mut client = rig.connect();
    let data = format!("{{\"capabilities\":{{{capabilities}}}}}\0");
    client.succeed(VERSION, &[&[0; 4], data.as_bytes()].concat());
    client.enable();
    client.succeed(DMA_MAP, &dma_map(3, 0, PAGE, 2 * PAGE));
    client
}

/// Takes a request of the server for `count` bytes at `address`, and returns its id and data.
fn request(client: &mut Client, command: u16, address: u64, count: u64) -> (u16, Vec<u8>) {
    let request = client.receive();
    assert_eq!((request.command, request.flags), (command, 0));
    assert_eq!(request.payload[..16], longs(&[address, count]));
    (request.id, request.payload[16..].to_vec())
}

#[test]
fn reads_and_writes_go_to_the_client() {
    let rig = Rig::new();
    let mut client = client(&rig, "");
    scope(|scope| {
        let engine = scope.spawn(|| {
            let mut data = [0; 5];
            rig.dma.read(PAGE + 1, &mut data)?;
            data.reverse();
            rig.dma.write(3 * PAGE - 5, &data)
        });
        let (id, _) = request(&mut client, DMA_READ, PAGE + 1, 5);
        client.send(&message(id, DMA_READ, REPLY, &[&longs(&[PAGE + 1, 5])[..], b"hello"].concat()), &[]);
        let (id, data) = request(&mut client, DMA_WRITE, 3 * PAGE - 5, 5);
        assert_eq!(data, b"olleh");
        // QEMU's answer is a header alone.
        client.send(&message(id, DMA_WRITE, REPLY, &[]), &[]);
        engine.join().unwrap().unwrap();
    });
}

#[test]
fn requests_of_both_sides_share_the_socket() {
    let rig = Rig::new();
    let mut client = client(&rig, "");
    scope(|scope| {
        let engine = scope.spawn(|| (0..200).try_for_each(|turn| rig.dma.write(PAGE + turn, &[turn as u8])));
        let (mut served, mut answered) = (0, 0);
        for id in 0..200 {
            client.send(&message(id, REGION_READ, 0, &access(BAR0, 0, 4)), &[]);
        }
        while served < 200 || answered < 200 {
            let message_in = client.receive();
            if message_in.command == DMA_WRITE {
                served += 1;
                client.send(&message(message_in.id, DMA_WRITE, REPLY, &longs(&[0, 1])), &[]);
            } else {
                assert_eq!((message_in.id, message_in.error), (answered, 0));
                answered += 1;
            }
        }
        engine.join().unwrap().unwrap();
    });
}

#[test]
fn transfers_keep_to_the_clients_limit() {
    let rig = Rig::new();
    let mut client = client(&rig, "\"max_data_xfer_size\":1000");
    scope(|scope| {
        let engine = scope.spawn(|| rig.dma.write(PAGE, &[3; 2500]));
        for (offset, count) in [(0, 1000), (1000, 1000), (2000, 500)] {
            let (id, data) = request(&mut client, DMA_WRITE, PAGE + offset, count);
            assert_eq!(data.len() as u64, count);
            client.send(&message(id, DMA_WRITE, REPLY, &longs(&[PAGE + offset, count])), &[]);
        }
        engine.join().unwrap().unwrap();
    });
}

#[test]
fn a_client_that_takes_no_data_is_not_asked() {
    let rig = Rig::new();
    let mut client = client(&rig, "\"max_data_xfer_size\":0");
    assert_eq!(rig.dma.write(PAGE, &[1]), Err(DmaError::Failed { iova: PAGE, errno: Errno::OPNOTSUPP }));
    client.works();
}

#[test]
fn wrong_replies_fail_the_transfer_only() {
    let rig = Rig::new();
    let mut client = client(&rig, "");
    let replies: [(u32, u32, Vec<u8>, Errno); 8] = [
        (ERROR_REPLY, 14, vec![], Errno::FAULT),
        (ERROR_REPLY, 0, vec![], Errno::IO),
        (ERROR_REPLY, 4096, vec![], Errno::IO),
        (ERROR_REPLY, u32::MAX, vec![], Errno::IO),
        (REPLY, 0, vec![], Errno::INVAL),
        (REPLY, 0, longs(&[PAGE, 4]), Errno::PROTO),
        (REPLY, 0, [longs(&[PAGE, 4]), vec![1; 3]].concat(), Errno::PROTO),
        (REPLY, 0, [longs(&[PAGE, 4]), vec![1; 1 << 20]].concat(), Errno::PROTO),
    ];
    for (flags, error, payload, errno) in replies {
        scope(|scope| {
            let engine = scope.spawn(|| rig.dma.read(PAGE, &mut [0; 4]));
            let (id, _) = request(&mut client, DMA_READ, PAGE, 4);
            // Replies to something else change nothing.
            client.send(&message(id ^ 1, DMA_READ, REPLY, &[7; 20]), &[]);
            client.send(&message(id, DMA_WRITE, REPLY, &[7; 20]), &[]);
            let mut reply = message(id, DMA_READ, flags, &payload);
            reply[12..16].copy_from_slice(&error.to_le_bytes());
            client.send(&reply, &[]);
            assert_eq!(engine.join().unwrap(), Err(DmaError::Failed { iova: PAGE, errno }));
        });
        client.works();
    }
}

/// Makes the engine wait for an answer, lets `act` end that, and returns what the engine got.
fn end_waiting(
    rig: &Rig,
    mut client: Client,
    act: impl FnOnce(Client) -> Option<Client>,
) -> Result<(), DmaError> {
    scope(|scope| {
        let engine = scope.spawn(|| rig.dma.read(PAGE, &mut [0; 4]));
        request(&mut client, DMA_READ, PAGE, 4);
        let began = Instant::now();
        let client = act(client);
        let result = engine.join().unwrap();
        assert!(began.elapsed() < Duration::from_millis(900));
        client.into_iter().for_each(|mut client| client.works());
        result
    })
}

#[test]
fn a_transfer_that_waits_ends_with_the_connection() {
    let rig = Rig::new();
    let result = end_waiting(&rig, client(&rig, ""), |_| None);
    assert_eq!(result, Err(DmaError::Failed { iova: PAGE, errno: Errno::PIPE }));
    rig.client().works();
}

#[test]
fn a_transfer_that_waits_ends_with_its_memory_and_with_a_reset() {
    let rig = Rig::new();
    for (command, payload) in [(DMA_UNMAP, dma_unmap(0, PAGE, 2 * PAGE)), (RESET, vec![])] {
        let result = end_waiting(&rig, client(&rig, ""), |mut client| {
            client.succeed(command, &payload);
            Some(client)
        });
        assert_eq!(result, Err(DmaError::Failed { iova: PAGE, errno: Errno::CANCELED }));
    }
}
