//! Bytes and messages at random: the server answers or closes, and serves the next client.

use std::os::fd::AsFd;
use std::sync::atomic::Ordering;
use std::time::Duration;

use proptest::prelude::*;

use crate::common::*;

/// Numbers that are near a limit more often than not.
fn number() -> impl Strategy<Value = u32> {
    prop_oneof![0..40u32, prop::sample::select(vec![4095, 4096, 1 << 20, 1 << 31, u32::MAX]), any::<u32>()]
}

/// A message that is almost right.
fn near_miss() -> impl Strategy<Value = (Vec<u8>, usize)> {
    let payload = prop_oneof![
        prop::collection::vec(number(), 0..12).prop_map(|it| words(&it)),
        prop::collection::vec(any::<u8>(), 0..80),
        (0..9u32, number(), number()).prop_map(|(region, offset, count)| access(
            region,
            offset.into(),
            count
        )),
        (0..9u32, 0..64u32, prop::collection::vec(any::<u8>(), 0..64)).prop_map(|(region, offset, data)| {
            // Not where the device of the tests panics by intention.
            [access(region, offset.into(), data.len() as u32), data].concat()
        }),
        (0..4u32, 0..8u64, 0..8u64).prop_map(|(flags, address, size)| dma_map(
            flags,
            0,
            address << 12,
            size << 12
        )),
        (0..64u32, 0..6u32, number(), number())
            .prop_map(|(flags, index, start, count)| { set_irqs(flags, index, start, count) }),
    ];
    let flags = prop_oneof![8 => Just(0), 1 => Just(NO_REPLY), 1 => any::<u32>()];
    let size = prop_oneof![20 => Just(None), 1 => number().prop_map(Some)];
    (0..20u16, flags, payload, size, 0..4usize).prop_map(|(command, flags, payload, size, descriptors)| {
        let size = size.unwrap_or(16 + payload.len() as u32);
        (raw(1, command, size, flags, &payload), descriptors)
    })
}

/// Plays a client, and shows that the next one is served and nothing panicked.
fn play(rig: &Rig, messages: &[(Vec<u8>, usize)], negotiated: bool) -> Result<(), TestCaseError> {
    let mut client = if negotiated { rig.client() } else { rig.connect() };
    let (file, event) = (memory(1 << 16), event());
    let descriptors = [file.as_fd(), event.as_fd(), file.as_fd()];
    client.stream.set_write_timeout(Some(Duration::from_secs(5))).unwrap();
    for (bytes, count) in messages {
        if bytes.is_empty() || client.try_send(bytes, &descriptors[..*count]).is_err() {
            break;
        }
    }
    drop(client);
    rig.client().works();
    prop_assert_eq!(rig.counters.panics.load(Ordering::Relaxed), 0);
    Ok(())
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
    let messages = prop::collection::vec(near_miss(), 1..30);
    proptest!(ProptestConfig::default(), |(messages in messages)| play(&rig, &messages, true)?);
}
