//! Bytes and messages at random: the server answers or closes, and serves the next client.

use std::cell::Cell;
use std::net::Shutdown;
use std::os::fd::AsFd;
use std::sync::atomic::Ordering;
use std::time::Duration;

use proptest::prelude::*;

use crate::common::*;

/// Numbers that are near a limit more often than not.
fn number() -> impl Strategy<Value = u32> {
    prop_oneof![0..40u32, prop::sample::select(vec![4095, 4096, 1 << 20, 1 << 31, u32::MAX]), any::<u32>()]
}

/// A command with a payload of its form, filled with numbers that may or may not fit.
fn plausible() -> impl Strategy<Value = (u16, Vec<u8>)> {
    // Not where the device of the tests panics by intention.
    let place = || (0..9u32, prop_oneof![0..64u32, 4090..5000u32, number()]);
    prop_oneof![
        (place(), 0..64u32)
            .prop_map(|((region, offset), count)| (REGION_READ, access(region, offset.into(), count))),
        (place(), prop::collection::vec(any::<u8>(), 0..64)).prop_map(|((region, offset), data)| {
            (REGION_WRITE, [access(region, offset.into(), data.len() as u32), data].concat())
        }),
        (0..5u32, 0..4u64, 0..8u64, 0..8u64).prop_map(|(flags, offset, address, size)| {
            (DMA_MAP, dma_map(flags, offset << 12, address << 12, size << 12))
        }),
        (0..8u64, 0..8u64).prop_map(|(address, size)| (DMA_UNMAP, dma_unmap(0, address << 12, size << 12))),
        (0..3u32, 3..6u32, 0..6u32, 0..4u32, 0..4u32).prop_map(|(data, action, index, start, count)| {
            (SET_IRQS, set_irqs(1 << data | 1 << action, index, start, count))
        }),
        (prop::sample::select(vec![GET_INFO, GET_REGION_INFO, GET_IRQ_INFO]), number(), 0..10u32)
            .prop_map(|(command, room, index)| (command, words(&[room, 0, index, 0, 0, 0, 0, 0]))),
        Just((RESET, vec![])),
    ]
}

/// A command with anything.
fn anything() -> impl Strategy<Value = (u16, Vec<u8>)> {
    let payload = prop_oneof![
        prop::collection::vec(number(), 0..12).prop_map(|it| words(&it)),
        prop::collection::vec(any::<u8>(), 0..80),
    ];
    (0..20u16, payload)
}

/// A message that is almost right, and how many descriptors come with it.
fn near_miss() -> impl Strategy<Value = (Vec<u8>, usize)> {
    let flags = prop_oneof![8 => Just(0), 1 => Just(NO_REPLY), 1 => any::<u32>()];
    let size = prop_oneof![40 => Just(None), 1 => number().prop_map(Some)];
    let content = prop_oneof![4 => plausible(), 1 => anything()];
    (content, flags, size, 0..4usize).prop_map(|((command, payload), flags, size, descriptors)| {
        let size = size.unwrap_or(16 + payload.len() as u32);
        (raw(1, command, size, flags, &payload), descriptors)
    })
}

/// Plays a client, shows that the next one is served and nothing panicked, and counts successes.
fn play(rig: &Rig, messages: &[(Vec<u8>, usize)], negotiated: bool) -> Result<usize, TestCaseError> {
    let mut client = if negotiated { rig.client() } else { rig.connect() };
    let (file, event) = (memory(1 << 16), event());
    let descriptors = [file.as_fd(), event.as_fd(), file.as_fd()];
    client.stream.set_write_timeout(Some(Duration::from_secs(5))).unwrap();
    for (bytes, count) in messages {
        if client.try_send(bytes, &descriptors[..*count]).is_err() {
            break;
        }
    }
    // The server deals with all of it before it sees the end.
    _ = client.stream.shutdown(Shutdown::Write);
    let replies: Vec<_> = std::iter::from_fn(|| client.try_receive()).collect();
    drop(client);
    rig.client().works();
    prop_assert_eq!(rig.counters.panics.load(Ordering::Relaxed), 0);
    let consistent = replies.iter().all(|reply| (reply.flags == REPLY) == (reply.error == 0));
    prop_assert!(consistent);
    Ok(replies.iter().filter(|reply| reply.flags == REPLY).count())
}

#[test]
fn random_bytes_never_panic_the_server() {
    let rig = Rig::new();
    let bytes = prop::collection::vec(prop::collection::vec(any::<u8>(), 1..200), 1..8);
    proptest!(ProptestConfig::default(), |(parts in bytes, negotiated in any::<bool>())| {
        let messages: Vec<_> = parts.into_iter().map(|part| (part, 0)).collect();
        play(&rig, &messages, negotiated)?;
    });
}

#[test]
fn random_messages_never_panic_the_server() {
    let rig = Rig::new();
    let (sent, succeeded) = (Cell::new(0), Cell::new(0));
    let messages = prop::collection::vec(near_miss(), 1..30);
    proptest!(ProptestConfig::default(), |(messages in messages)| {
        sent.set(sent.get() + messages.len());
        succeeded.set(succeeded.get() + play(&rig, &messages, true)?);
    });
    // Else only error paths were tried.
    assert!(succeeded.get() > sent.get() / 20, "{} of {}", succeeded.get(), sent.get());
}
