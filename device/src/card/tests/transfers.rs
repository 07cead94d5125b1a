//! Transfers through registers.

use vg500_engine::Renderer;
use vg500_regs::table::*;
use vg500_regs::{Fault, FaultCode, PixelFormat};

use super::rig::{Rig, frame};
use crate::card::fake::{Event, Gate, Gated};
use crate::config::Config;

fn set_up(rig: &mut Rig, address: u32) {
    rig.write(transfer_address_low::REGISTER, address);
    rig.write(transfer_pitch::REGISTER, 2048);
    rig.write(transfer_size::REGISTER, transfer_size::WIDTH.put(20) | transfer_size::HEIGHT.put(16));
}

fn start(rig: &mut Rig, tag: u32, plane: u32, format: PixelFormat) {
    let word = transfer::TAG.put(tag) | transfer::PLANE.put(plane);
    rig.write(transfer::REGISTER, word | transfer::PIXEL_FORMAT.put(format as u32));
}

fn state(rig: &mut Rig) -> (u32, u32) {
    let word = rig.read(transfer_state::REGISTER);
    (transfer_state::TAG.get(word), transfer_state::RESULT.get(word))
}

#[test]
fn an_invalid_transfer_is_refused_at_once() {
    let mut rig = Rig::new();
    start(&mut rig, 4, 0, PixelFormat::Rgba8);
    assert_eq!(state(&mut rig), (4, result::FAILED));
    let fault = Fault::new(FaultCode::Value, transfer_size::WIDTH);
    assert_eq!(Fault::from_word(rig.read(transfer_fault::REGISTER)), Some(fault));
    assert_eq!(Fault::from_word(rig.read(last_fault::REGISTER)), Some(fault));
    let status = rig.read(status::REGISTER);
    assert_eq!(status & 0x7f, status::TRANSFER_PENDING.mask() | status::FAULT_PENDING.mask());
}

#[test]
fn host_memory_that_is_not_there_is_a_fault() {
    let mut rig = Rig::new();
    set_up(&mut rig, (1 << 20) - 100);
    start(&mut rig, 5, 0, PixelFormat::Rgba8);
    rig.await_idle();
    assert_eq!(state(&mut rig), (5, result::FAILED));
    let fault = Fault::new(FaultCode::HostMemory, transfer_address_low::ADDRESS);
    assert_eq!(Fault::from_word(rig.read(transfer_fault::REGISTER)), Some(fault));
    // The next one is none the worse for it.
    set_up(&mut rig, 0);
    start(&mut rig, 6, 0, PixelFormat::Rgba8);
    rig.await_idle();
    assert_eq!(state(&mut rig), (6, result::DONE));
    assert_eq!(rig.read(transfer_fault::REGISTER), 0);
}

#[test]
fn a_transfer_waits_for_the_frame_before_it() {
    let gate = Gate::closed();
    let mut rig = Rig::with(Config::default(), Gated(gate.clone(), Renderer::Reference.start()));
    rig.fill();
    rig.start(&frame(1, 2));
    set_up(&mut rig, 0x4000);
    start(&mut rig, 2, 2, PixelFormat::Rgba8);
    // What comes later does not change it.
    rig.write(transfer_size::REGISTER, 0);
    gate.await_frame();
    assert!(rig.bus.events().is_empty());
    assert_eq!(state(&mut rig), (0, result::NONE));
    gate.open();
    rig.await_idle();
    assert_eq!((rig.plane_state(2), state(&mut rig)), ((1, result::DONE), (2, result::DONE)));
    let events = rig.bus.events();
    assert_eq!(events.len(), 16);
    let pixels = rig.card.memories.pixel.view();
    let mut checksum = crc32fast::Hasher::new();
    for (row, event) in events.iter().enumerate() {
        let mut stored = [0; 80];
        pixels.read((2 << 20) + row * 2048, &mut stored).unwrap();
        assert_eq!(*event, Event::Write(0x4000 + 2048 * row as u64, stored.to_vec()));
        checksum.update(&stored);
    }
    assert_eq!(checksum.finalize(), rig.read_at(report_checksum::REGISTER.at(2)));
}

#[test]
fn transfers_are_cancelled_apart_from_frames() {
    let gate = Gate::closed();
    let mut rig = Rig::with(Config::default(), Gated(gate.clone(), Renderer::Reference.start()));
    rig.start(&frame(1, 0));
    set_up(&mut rig, 0);
    start(&mut rig, 2, 0, PixelFormat::Rgba8);
    start(&mut rig, 3, 0, PixelFormat::Bgra4);
    rig.write(cancel::REGISTER, cancel::TRANSFERS.mask());
    assert_eq!(state(&mut rig), (3, result::FAILED));
    let fault = Fault::CANCELLED;
    assert_eq!(Fault::from_word(rig.read(transfer_fault::REGISTER)), Some(fault));
    gate.open();
    rig.await_idle();
    assert_eq!(rig.plane_state(0), (1, result::DONE));
    assert_eq!(rig.read(completed::REGISTER), 3);
    assert!(rig.bus.events().is_empty());
}
