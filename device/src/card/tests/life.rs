//! Connections and resets: what a client finds, and what it leaves behind.

use std::sync::Arc;
use std::time::{Duration, Instant};

use vg500_engine::Renderer;
use vg500_regs::pci::MSIX_TABLE_OFFSET;
use vg500_regs::table::*;

use super::rig::{Rig, frame};
use crate::card::fake::{Gate, Gated};
use crate::config::Config;
use crate::protocol::{Device, ResetReason, region};

fn held() -> (Rig, Arc<Gate>) {
    let gate = Gate::closed();
    (Rig::with(Config::default(), Gated(gate.clone(), Renderer::Reference.start())), gate)
}

/// Nothing of what was done before can be seen.
fn is_fresh(rig: &mut Rig) -> bool {
    let reads = rig.read(trapped_reads::REGISTER);
    let words = (0..STATUS_BLOCK as u32).step_by(4).all(|offset| rig.read_at(offset) == 0);
    let pixel = {
        let mut byte = [1];
        rig.card.memories.pixel.view().read(0, &mut byte).unwrap();
        byte == [0]
    };
    words && pixel && reads == 1 && rig.read_at(MSIX_TABLE_OFFSET) == 0
}

#[test]
fn every_connection_starts_from_power_on_state() {
    let (mut rig, gate) = held();
    rig.fill();
    rig.start(&frame(1, 0));
    rig.start(&frame(2, 1));
    rig.write_bytes(MSIX_TABLE_OFFSET, &[0xf0; 16]);
    rig.card.memories.pixel.view().write(0, &[1]).unwrap();
    gate.await_frame();
    let kept = Arc::clone(&rig.card.memories.voxel);
    let began = Instant::now();
    rig.card.reset(ResetReason::LostConnection);
    assert!(began.elapsed() < Duration::from_millis(500));
    rig.card.reset(ResetReason::Connection);
    rig.enable();
    assert!(is_fresh(&mut rig));
    // The last client's mapping is not of the memory that the next one has.
    let shown = rig.card.regions()[2].memory.clone().unwrap();
    assert!(Arc::ptr_eq(&shown, &rig.card.memories.voxel) && !Arc::ptr_eq(&shown, &kept));
    gate.open();
    rig.start(&frame(1, 0));
    rig.await_idle();
    assert_eq!(rig.plane_state(0), (1, result::DONE));
    let trace = rig.trace();
    assert!(trace.contains("connection 1 ends:") && trace.contains("connection 2 begins"), "{trace}");
}

#[test]
fn resets_keep_mapped_memories_and_may_follow_one_another() {
    let (mut rig, gate) = held();
    rig.card.memories.voxel.view().write(77, &[5]).unwrap();
    rig.start(&frame(1, 0));
    gate.await_frame();
    for reason in [ResetReason::Device, ResetReason::Device, ResetReason::FunctionLevel] {
        rig.card.reset(reason);
        let mut byte = [0];
        rig.card.memories.voxel.view().read(77, &mut byte).unwrap();
        assert_eq!(byte, [5]);
        let mut command = [1; 2];
        rig.card.read(region::CONFIG, 4, &mut command).unwrap();
        assert_eq!(command, [0, 0], "configuration space is reset as well");
    }
    rig.enable();
    assert_eq!(rig.read(status::REGISTER), 0);
}

#[test]
fn function_level_reset_comes_through_configuration_space() {
    let (mut rig, _gate) = held();
    rig.write(start::REGISTER, start::TAG.put(1));
    let mut config = vec![0; 256];
    rig.card.read(region::CONFIG, 0, &mut config).unwrap();
    let mut at = usize::from(config[0x34]);
    while config[at] != crate::pci::id::EXPRESS {
        at = usize::from(config[at + 1]);
    }
    rig.card.write(region::CONFIG, at as u64 + 9, &[0x80]).unwrap();
    rig.enable();
    assert_eq!(rig.read(completed::REGISTER), 0);
    assert!(rig.trace().contains("function-level reset"));
}

#[test]
fn trapped_accesses_are_counted_over_resets_until_the_connection_ends() {
    let (mut rig, _gate) = held();
    rig.write(reset::REGISTER, RESET_KEY);
    rig.card.reset(ResetReason::Device);
    rig.enable();
    assert_eq!(rig.read(trapped_writes::REGISTER), 1);
    rig.card.reset(ResetReason::LostConnection);
    rig.card.reset(ResetReason::Connection);
    rig.enable();
    assert_eq!(rig.read(trapped_writes::REGISTER), 0);
}

#[test]
fn a_card_ends_while_a_frame_runs() {
    let (mut rig, gate) = held();
    (0..3).for_each(|plane| rig.start(&frame(1, plane)));
    gate.await_frame();
    let began = Instant::now();
    drop(rig);
    assert!(began.elapsed() < Duration::from_millis(500));
    assert_eq!(gate.passed(), [1]);
}
