//! How the host learns of the end of a command: status, its copy, interrupts.

use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use vg500_engine::Renderer;
use vg500_regs::pci::Vector;
use vg500_regs::table::*;
use vg500_regs::{Fault, FaultCode};

use super::rig::{Rig, frame};
use crate::card::fake::{Event, FakeBus, Gate, Gated};
use crate::config::Config;

const COPY: u32 = 0x1000;

/// Interrupts for everything, and the copy of the status.
fn tell_all(rig: &mut Rig) {
    rig.write(interrupt_enable::REGISTER, interrupt_enable::REGISTER.mask());
    rig.write(status_address_low::REGISTER, COPY);
    rig.write(status_control::REGISTER, 1);
    // The first copy.
    collect(&rig.bus, |events| !writes(events).is_empty() && ends_with_status(events));
}

/// Events until there are enough.
fn collect(bus: &Arc<FakeBus>, enough: impl Fn(&[Event]) -> bool) -> Vec<Event> {
    let mut events = Vec::new();
    for _ in 0..20_000 {
        events.extend(bus.events());
        if enough(&events) {
            return events;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("only {events:?}");
}

fn writes(events: &[Event]) -> Vec<(u64, Vec<u8>)> {
    let write = |event: &Event| match event {
        Event::Write(address, bytes) => Some((*address, bytes.clone())),
        _ => None,
    };
    events.iter().filter_map(write).collect()
}

fn ends_with_status(events: &[Event]) -> bool {
    writes(events).last().is_some_and(|(address, bytes)| *address == u64::from(COPY) && bytes.len() == 4)
}

/// Host memory after these writes.
fn memory(events: &[Event]) -> [u8; STATUS_BLOCK] {
    let mut memory = [0; STATUS_BLOCK];
    for (address, bytes) in writes(events) {
        let at = (address - u64::from(COPY)) as usize;
        memory[at..at + bytes.len()].copy_from_slice(&bytes);
    }
    memory
}

fn word(memory: &[u8], offset: u32) -> u32 {
    u32::from_le_bytes(memory[offset as usize..][..4].try_into().unwrap())
}

#[test]
fn a_copy_that_cannot_be_written_stops_with_a_fault() {
    let mut rig = Rig::new();
    rig.bus.set_memory(0..0);
    rig.write(interrupt_enable::REGISTER, interrupt_enable::FAULT.mask());
    rig.write(status_control::REGISTER, 1);
    collect(&rig.bus, |events| events.contains(&Event::Raise(Vector::Fault)));
    let fault = Fault::new(FaultCode::HostMemory, status_address_low::ADDRESS);
    assert_eq!(Fault::from_word(rig.read(last_fault::REGISTER)), Some(fault));
    rig.bus.set_memory(0..1 << 20);
    rig.write(acknowledge::REGISTER, acknowledge::REGISTER.mask());
    std::thread::sleep(Duration::from_millis(20));
    assert!(writes(&rig.bus.events()).is_empty(), "it stays off");
    assert_eq!(rig.read(completed::REGISTER), 0, "it was no command");
}

#[test]
fn pixels_report_status_copy_and_interrupt_come_in_this_order() {
    let mut rig = Rig::new();
    rig.fill();
    tell_all(&mut rig);
    let pixels = Arc::clone(&rig.card.memories.pixel);
    let board = Arc::downgrade(&rig.card.board);
    let seen = Arc::new(Mutex::new(Vec::new()));
    let log = Arc::clone(&seen);
    rig.bus.before(move || {
        let mut pixel = [0; 64];
        pixels.view().read(0, &mut pixel).unwrap();
        let rendered = pixel.iter().any(|&byte| byte != 0);
        // The lock may be held by who raises an interrupt; then the words have been copied before.
        log.lock().unwrap().push(rendered);
        drop(board.upgrade());
    });
    rig.start(&frame(7, 0));
    let events = collect(&rig.bus, |events| events.contains(&Event::Raise(Vector::Frame)));
    let raise = events.iter().position(|event| *event == Event::Raise(Vector::Frame)).unwrap();
    let copied = memory(&events[..raise]);
    assert_eq!(word(&copied, plane_state::REGISTER.offset), 7 | result::DONE << 16);
    assert_eq!(word(&copied, completed::REGISTER.offset), 1);
    assert!(ends_with_status(&events[..raise]));
    let status = word(&copied, status::REGISTER.offset);
    assert_eq!(status & 0xffff, status::FRAME_PENDING.mask());
    assert_eq!(status, rig.read(status::REGISTER), "the copy is that of the last change");
    assert_eq!(rig.read(report_tag::REGISTER), 7);
    // Pixels were there before the first word of the last copy.
    let last_copy = events[..raise].len() - 3;
    assert!(seen.lock().unwrap()[last_copy..].iter().all(|&rendered| rendered));
    assert_eq!(rig.trace().matches("frame 7 done").count(), 1);
}

#[test]
fn each_change_raises_the_sequence_once_and_the_copy_follows() {
    let mut rig = Rig::new();
    tell_all(&mut rig);
    let before = status::SEQUENCE.get(rig.read(status::REGISTER));
    rig.write(start::REGISTER, start::TAG.put(1));
    let after = status::SEQUENCE.get(rig.read(status::REGISTER));
    assert_eq!(after, before + 1, "state, fault and counters belong together");
    let events = collect(&rig.bus, |events| {
        ends_with_status(events) && status::SEQUENCE.get(word(&memory(events), 0)) == after
    });
    assert_eq!(word(&memory(&events), completed::REGISTER.offset), 1);
    rig.write(acknowledge::REGISTER, acknowledge::REGISTER.mask());
    collect(&rig.bus, |events| status::SEQUENCE.get(word(&memory(events), 0)) == after + 1);
    rig.write(status_control::REGISTER, 0);
    rig.write(start::REGISTER, start::TAG.put(2));
    std::thread::sleep(Duration::from_millis(20));
    assert!(writes(&rig.bus.events()).is_empty());
}

#[test]
fn the_sequence_wraps() {
    let mut rig = Rig::new();
    for tag in 0..0x1_0000 {
        rig.write(start::REGISTER, start::TAG.put(tag & 1));
    }
    assert_eq!(status::SEQUENCE.get(rig.read(status::REGISTER)), 0);
    assert_eq!(rig.read(completed::REGISTER), 0x1_0000);
}

#[test]
fn interrupts_come_only_from_enabled_causes() {
    let mut rig = Rig::new();
    rig.write(start::REGISTER, start::TAG.put(1));
    std::thread::sleep(Duration::from_millis(10));
    assert!(!rig.bus.events().iter().any(|event| matches!(event, Event::Raise(_))));
    // What is pending already interrupts when it is enabled.
    rig.write(interrupt_enable::REGISTER, interrupt_enable::FAULT.mask());
    let events = collect(&rig.bus, |events| events.contains(&Event::Raise(Vector::Fault)));
    assert!(!events.contains(&Event::Raise(Vector::Frame)));
    rig.write(acknowledge::REGISTER, acknowledge::FAULT.mask());
    assert!(rig.bus.events().contains(&Event::Lower(Vector::Fault)));
    rig.write(interrupt_enable::REGISTER, 0);
    let lowered = rig.bus.events();
    let vectors = [Vector::Frame, Vector::Transfer, Vector::Fault];
    assert!(vectors.iter().all(|vector| lowered.contains(&Event::Lower(*vector))));
    let status = rig.read(status::REGISTER);
    assert_eq!(status & 0xff, status::FRAME_PENDING.mask(), "acknowledging clears those bits only");
}

#[test]
fn handlers_return_while_the_host_is_being_told() {
    let gate = Gate::closed();
    let mut rig = Rig::with(Config::default(), Gated(gate.clone(), Renderer::Reference.start()));
    tell_all(&mut rig);
    let (entered, inside) = channel();
    let (release, held) = channel::<()>();
    let held = Mutex::new(held);
    rig.bus.before(move || {
        _ = entered.send(());
        _ = held.lock().unwrap().recv();
    });
    rig.start(&frame(1, 0));
    inside.recv_timeout(Duration::from_secs(10)).unwrap();
    // The publisher is held in the midst of a copy; neither client nor engine waits for it.
    gate.open();
    rig.await_that(|rig| rig.plane_state(0) == (1, result::DONE));
    rig.start(&frame(2, 1));
    rig.await_that(|rig| rig.plane_state(1) == (2, result::DONE));
    rig.write(acknowledge::REGISTER, acknowledge::REGISTER.mask());
    drop(release);
    let events = collect(&rig.bus, |events| {
        let status = word(&memory(events), 0);
        status & 0x7f == 0 && status::SEQUENCE.get(status) != 0
    });
    assert!(!events.contains(&Event::Raise(Vector::Frame)), "it was acknowledged before");
}

#[test]
fn a_reset_ends_telling() {
    let mut rig = Rig::new();
    tell_all(&mut rig);
    rig.write(reset::REGISTER, RESET_KEY);
    rig.bus.events();
    rig.write(start::REGISTER, start::TAG.put(1));
    std::thread::sleep(Duration::from_millis(20));
    assert!(rig.bus.events().is_empty());
}
