//! Start, cancel, reset: what is refused, what waits, and that nobody else does.

use std::sync::Arc;
use std::time::{Duration, Instant};

use vg500_engine::Renderer;
use vg500_regs::limit::QUEUE;
use vg500_regs::table::*;
use vg500_regs::{Fault, FaultCode, PlaneFormat};

use super::rig::{Rig, continued, frame};
use crate::card::fake::{Gate, Gated};
use crate::config::Config;

/// A card whose frames are held.
fn held() -> (Rig, Arc<Gate>) {
    let gate = Gate::closed();
    let rig = Rig::with(Config::default(), Gated(gate.clone(), Renderer::Reference.start()));
    rig.fill();
    (rig, gate)
}

const BUSY: Fault = Fault::new(FaultCode::Busy, start::PLANE);

#[test]
fn a_start_command_after_power_on_is_refused_at_once() {
    let mut rig = Rig::new();
    rig.write(start::REGISTER, start::TAG.put(7) | start::PLANE.put(3));
    let fault = Fault::new(FaultCode::Value, volume_format::FORMAT);
    assert_eq!(rig.plane_state(3), (7, result::FAILED));
    assert_eq!(rig.plane_fault(3), Some(fault));
    assert_eq!(Fault::from_word(rig.read(last_fault::REGISTER)), Some(fault));
    assert_eq!(rig.read(completed::REGISTER), 1);
    let status = rig.read(status::REGISTER);
    assert_eq!(status & 0xffff, status::FRAME_PENDING.mask() | status::FAULT_PENDING.mask());
    assert_eq!(rig.read(report_tag::REGISTER), 0);
    assert_eq!(rig.read_at(report_tag::REGISTER.at(3)), 7);
}

#[test]
fn a_base_plane_that_does_not_exist_shows_up_in_the_last_fault_alone() {
    let mut rig = Rig::new();
    let mut wide = frame(1, 8);
    wide.set(output::PLANE_FORMAT, PlaneFormat::Accumulator64 as u32);
    rig.start(&wide);
    wide.set(output::PLANE_FORMAT, 3);
    wide.set(start::PLANE, 0);
    rig.start(&wide);
    for place in 0..16 {
        assert_eq!((rig.plane_state(place), rig.plane_fault(place)), ((0, result::NONE), None));
    }
    let fault = Fault::new(FaultCode::Value, output::PLANE_FORMAT);
    assert_eq!(Fault::from_word(rig.read(last_fault::REGISTER)), Some(fault));
    assert_eq!(rig.read(completed::REGISTER), 2);
}

#[test]
fn writes_return_while_a_frame_runs_and_tear_nothing() {
    let (mut rig, gate) = held();
    let began = Instant::now();
    rig.start(&frame(1, 0));
    gate.await_frame();
    assert_eq!(rig.plane_state(0), (0, result::NONE));
    assert_eq!(status::BUSY.get(rig.read(status::REGISTER)), 1);
    // The frame has its own copy of registers and tables.
    rig.start(&frame(2, 1));
    rig.write(volume_format::REGISTER, 0);
    rig.card.memories.table.clear().unwrap();
    assert!(began.elapsed() < Duration::from_secs(5));
    gate.open();
    rig.await_idle();
    assert_eq!((rig.plane_state(0), rig.plane_state(1)), ((1, result::DONE), (2, result::DONE)));
    let checksums = [0, 1].map(|place| rig.read_at(report_checksum::REGISTER.at(place)));
    assert_eq!(checksums[0], checksums[1]);
    assert_ne!(checksums[0], 0);
}

#[test]
fn a_base_plane_in_use_is_not_rendered_into() {
    let (mut rig, gate) = held();
    let mut wide = frame(1, 1);
    wide.set(output::PLANE_FORMAT, PlaneFormat::Accumulator64 as u32);
    rig.start(&wide);
    for (tag, place) in [(2, 2), (3, 3)] {
        rig.start(&frame(tag, place));
        assert_eq!(rig.plane_state(place), (tag, result::FAILED));
        assert_eq!(rig.plane_fault(place), Some(BUSY));
    }
    for (tag, place) in [(4, 1), (5, 4)] {
        rig.start(&frame(tag, place));
        assert_eq!(rig.plane_fault(place), None);
    }
    // Not its own accumulators, or not of its format.
    let mut other = continued(6, 1);
    other.set(accumulators::SOURCE, 0);
    rig.start(&other);
    assert_eq!(rig.plane_fault(2), Some(BUSY));
    gate.open();
    rig.await_idle();
    assert_eq!([1, 2, 4].map(|place| rig.plane_state(place)), [(4, 1), (1, 1), (5, 1)]);
    rig.start(&frame(9, 2));
    rig.await_idle();
    assert_eq!(rig.plane_state(2), (9, result::DONE));
}

#[test]
fn a_frame_of_another_format_is_not_continued() {
    let (mut rig, gate) = held();
    rig.start(&frame(1, 0));
    rig.start(&frame(2, 5));
    for plane in [0, 2] {
        rig.start(&continued(3, plane));
        assert_eq!(rig.plane_fault(2 * plane), Some(BUSY));
    }
    gate.open();
    rig.await_idle();
}

#[test]
fn accumulators_are_taken_after_the_frame_before() {
    let (mut rig, gate) = held();
    let mut first = continued(1, 2);
    first.set(accumulators::ENABLE, 0);
    rig.start(&first);
    rig.start(&continued(2, 2));
    rig.start(&continued(3, 2));
    assert_eq!(rig.plane_fault(4), None);
    gate.open();
    rig.await_idle();
    assert_eq!((rig.plane_state(4), gate.passed()), ((3, result::DONE), vec![1, 2, 3]));
    let chained = rig.read_at(report_checksum::REGISTER.at(4));
    for tag in 4..=6 {
        let mut next = continued(tag, 2);
        next.set(accumulators::ENABLE, u32::from(tag > 4));
        rig.start(&next);
        rig.await_idle();
    }
    assert_eq!(rig.read_at(report_checksum::REGISTER.at(4)), chained);
    let once = {
        rig.start(&first);
        rig.await_idle();
        rig.read_at(report_checksum::REGISTER.at(4))
    };
    assert_ne!(once, chained);
}

#[test]
fn a_full_queue_drops_the_command_and_says_so() {
    let (mut rig, gate) = held();
    let mut first = continued(0, 7);
    first.set(accumulators::ENABLE, 0);
    rig.start(&first);
    gate.await_frame();
    for tag in 1..=QUEUE as u32 {
        rig.start(&continued(tag, 7));
        assert_eq!(rig.plane_fault(14), None, "{tag}");
    }
    assert_eq!(status::QUEUE_FULL.get(rig.read(status::REGISTER)), 0);
    rig.start(&continued(99, 7));
    assert_eq!(rig.plane_state(14), (99, result::FAILED));
    assert_eq!(rig.plane_fault(14).unwrap().code, FaultCode::QueueFull);
    assert_eq!(status::QUEUE_FULL.get(rig.read(status::REGISTER)), 1);
    rig.write(acknowledge::REGISTER, acknowledge::QUEUE_FULL.mask());
    rig.write(transfer_size::REGISTER, 0x0001_0001);
    rig.write(transfer_pitch::REGISTER, 4);
    rig.write(transfer::REGISTER, transfer::TAG.put(5));
    assert_eq!(Fault::from_word(rig.read(transfer_fault::REGISTER)).unwrap().code, FaultCode::QueueFull);
    assert_eq!(status::QUEUE_FULL.get(rig.read(status::REGISTER)), 1);
    rig.write(acknowledge::REGISTER, acknowledge::QUEUE_FULL.mask());
    assert_eq!(status::QUEUE_FULL.get(rig.read(status::REGISTER)), 0);
    gate.open();
    rig.await_idle();
    assert_eq!(rig.read(completed::REGISTER), QUEUE as u32 + 3);
    assert_eq!(gate.passed().len(), QUEUE + 1);
}

#[test]
fn cancel_ends_the_chosen_commands_only() {
    let (mut rig, gate) = held();
    (0..4).for_each(|plane| rig.start(&frame(plane + 1, plane)));
    gate.await_frame();
    rig.write(cancel::REGISTER, 0b1010);
    // Those that wait end at once, whatever runs.
    assert_eq!((rig.plane_state(1), rig.plane_fault(1)), ((2, result::FAILED), Some(Fault::CANCELLED)));
    assert_eq!((rig.plane_state(3), rig.plane_fault(3)), ((4, result::FAILED), Some(Fault::CANCELLED)));
    assert_eq!(rig.plane_state(0), (0, result::NONE));
    let began = Instant::now();
    rig.write(cancel::REGISTER, 0b0001);
    rig.await_that(|rig| rig.plane_state(0) == (1, result::FAILED));
    assert!(began.elapsed() < Duration::from_millis(500));
    assert_eq!(rig.plane_fault(0), Some(Fault::CANCELLED));
    gate.open();
    rig.await_idle();
    assert_eq!(rig.plane_state(2), (3, result::DONE));
    assert_eq!(gate.passed(), [1, 3]);
    assert_eq!(rig.read(completed::REGISTER), 4);
}

#[test]
fn a_reset_in_the_midst_of_a_frame_leaves_power_on_state() {
    let (mut rig, gate) = held();
    (0..3).for_each(|plane| rig.start(&frame(plane + 1, plane)));
    gate.await_frame();
    let began = Instant::now();
    rig.write(reset::REGISTER, RESET_KEY);
    assert!(began.elapsed() < Duration::from_millis(500));
    assert_eq!(rig.read(status::REGISTER), 0);
    assert!((0..3).all(|place| rig.plane_state(place) == (0, result::NONE)));
    rig.write(reset::REGISTER, RESET_KEY);
    gate.open();
    rig.start(&frame(9, 0));
    rig.await_idle();
    assert_eq!(rig.plane_state(0), (9, result::DONE), "base planes are free again");
    assert_eq!(gate.passed(), [1, 9], "what waited was dropped");
    assert_eq!(rig.read(completed::REGISTER), 1);
}

#[test]
fn a_wrong_key_resets_nothing() {
    let mut rig = Rig::new();
    rig.write(start::REGISTER, start::TAG.put(7));
    rig.write(reset::REGISTER, RESET_KEY + 1);
    assert_eq!(rig.plane_state(0), (7, result::FAILED));
}

#[test]
fn a_frame_that_does_not_end_holds_a_reset_for_a_second_at_most() {
    let (mut rig, gate) = held();
    gate.be_deaf();
    rig.start(&frame(1, 0));
    gate.await_frame();
    let began = Instant::now();
    rig.write(reset::REGISTER, RESET_KEY);
    let waited = began.elapsed();
    assert!((Duration::from_millis(900)..Duration::from_millis(2500)).contains(&waited), "{waited:?}");
    gate.open();
    rig.start(&frame(2, 0));
    rig.await_idle();
    assert_eq!(rig.plane_state(0), (2, result::DONE));
    assert_eq!(rig.read(completed::REGISTER), 1, "nobody hears of the frame before");
}
