//! Strict mode names every mistake, and nothing that is none.

use vg500_engine::Renderer;
use vg500_regs::PlaneFormat;
use vg500_regs::memory::Table;
use vg500_regs::table::*;

use super::rig::{BASE, Rig, continued, frame};
use crate::card::fake::{Gate, Gated};
use crate::config::Config;
use crate::dma::DmaError;
use crate::protocol::{Device, region};

/// The one mistake since the last call, and that it has been counted.
fn only_mistake(rig: &mut Rig, known: &mut usize) -> String {
    let mistakes = rig.mistakes();
    assert_eq!(mistakes.len(), *known + 1, "{mistakes:?}");
    *known += 1;
    assert_eq!(rig.read(mistakes::REGISTER) as usize, *known);
    assert_eq!(status::MISTAKE.get(rig.read(status::REGISTER)), 1);
    mistakes[*known - 1].clone()
}

#[test]
fn every_mistake_is_named() {
    let mut rig = Rig::strict();
    let mut known = 0;
    let mut after = |act: &dyn Fn(&mut Rig)| {
        act(&mut rig);
        only_mistake(&mut rig, &mut known)
    };
    assert_eq!(after(&|rig| _ = rig.read(start::REGISTER)), "read of write-only START");
    assert_eq!(after(&|rig| rig.write(status::REGISTER, 0)), "write to read-only STATUS");
    assert_eq!(
        after(&|rig| rig.write(table_select::REGISTER, 0x60)),
        "reserved bits 0x60 written to TABLE_SELECT"
    );
    assert_eq!(after(&|rig| _ = rig.read_at(0x18)), "read of undocumented offset 0x0018");
    assert_eq!(after(&|rig| rig.write_bytes(0x214, &[0; 4])), "write to undocumented offset 0x0214");
    assert!(after(&|rig| rig.write_bytes(0x202, &[0; 2])).starts_with("write of 2 bytes at 0x0202"));
    assert_eq!(after(&|rig| rig.write(reset::REGISTER, 1)), "wrong key 0x00000001 written to RESET");
    assert_eq!(
        after(&|rig| rig.write(start::REGISTER, start::TAG.put(5))),
        "frame 5 refused: VOLUME_FORMAT.FORMAT: value out of range"
    );
    assert_eq!(
        after(&|rig| rig.write(transfer::REGISTER, transfer::TAG.put(6))),
        "transfer 6 refused: TRANSFER_SIZE.WIDTH: value out of range"
    );
    let disabled = |rig: &mut Rig| {
        rig.card.write(region::CONFIG, 4, &[4, 0]).unwrap();
        rig.card.write(1, 0, &[0]).unwrap();
        rig.enable();
    };
    assert_eq!(after(&disabled), "access to base address register 1 while memory space is disabled");
    let unreachable = |rig: &mut Rig| {
        rig.write(transfer_address_high::REGISTER, 1);
        rig.write(transfer_pitch::REGISTER, 4);
        rig.write(transfer_size::REGISTER, 0x0001_0001);
        rig.write(transfer::REGISTER, transfer::TAG.put(7));
        rig.await_idle();
    };
    let text = after(&unreachable);
    assert_eq!(text, "transfer 7 cannot reach host memory: no memory is mapped at IOVA 0x100000000");
    let uncopied = |rig: &mut Rig| {
        rig.write(status_address_high::REGISTER, 1);
        rig.write(status_control::REGISTER, 1);
        rig.await_that(|rig| !rig.mistakes().last().unwrap().starts_with("transfer"));
        rig.await_that(|rig| rig.read(mistakes::REGISTER) as usize == rig.mistakes().len());
    };
    assert!(after(&uncopied).starts_with("the status copy cannot reach host memory"));
    rig.write(acknowledge::REGISTER, acknowledge::MISTAKE.mask());
    assert_eq!(status::MISTAKE.get(rig.read(status::REGISTER)), 0);
}

#[test]
fn memory_that_is_taken_away_is_not_the_drivers_mistake() {
    for (failure, faults) in [(DmaError::Suspended, 0), (DmaError::Revoked { iova: 0 }, 1)] {
        let mut rig = Rig::strict();
        rig.bus.fail(failure);
        rig.write(status_control::REGISTER, 1);
        std::thread::sleep(std::time::Duration::from_millis(20));
        rig.await_that(|rig| status::FAULT_PENDING.get(rig.read(status::REGISTER)) == faults);
        assert_eq!((rig.mistakes().len(), rig.read(mistakes::REGISTER)), (0, 0));
    }
}

#[test]
fn commands_that_get_in_each_others_way_are_named() {
    let gate = Gate::closed();
    let config = Config { strict: true, ..Config::default() };
    let mut rig = Rig::with(config, Gated(gate.clone(), Renderer::Reference.start()));
    let mut known = 0;
    let mut wide = frame(1, 0);
    wide.set(output::PLANE_FORMAT, PlaneFormat::Accumulator64 as u32);
    rig.start(&wide);
    gate.await_frame();
    rig.start(&frame(2, 1));
    assert_eq!(only_mistake(&mut rig, &mut known), "frame 2 refused: START.PLANE: base plane in use");
    rig.start(&continued(1, 0));
    let text = only_mistake(&mut rig, &mut known);
    assert_eq!(text, "frame 1 has the tag of the frame before it on 64-bit base plane 0");
    rig.write(transfer_pitch::REGISTER, 4);
    rig.write(transfer_size::REGISTER, 0x0001_0001);
    rig.write(transfer::REGISTER, transfer::TAG.put(3) | transfer::PLANE.put(1));
    let text = only_mistake(&mut rig, &mut known);
    assert_eq!(text, "transfer 3 reads RGBA8 base plane 1, where frame 1 is rendered in another format");
    rig.write(transfer::REGISTER, transfer::TAG.put(4) | transfer::PLANE_FORMAT.put(1));
    gate.open();
    rig.await_idle();
    assert_eq!(rig.mistakes().len(), known);
}

/// What changes while a frame is held.
fn while_held(change: impl Fn(&Rig)) -> Vec<String> {
    let gate = Gate::closed();
    let config = Config { strict: true, ..Config::default() };
    let mut rig = Rig::with(config, Gated(gate.clone(), Renderer::Reference.start()));
    rig.fill();
    let mut second_copy = frame(1, 0);
    second_copy.set(table_select::OPACITY, 1);
    rig.start(&second_copy);
    gate.await_frame();
    change(&rig);
    gate.open();
    rig.await_idle();
    assert_eq!(rig.plane_state(0), (1, result::DONE), "a mistake does not stop the frame");
    assert_eq!(rig.read(mistakes::REGISTER) as usize, rig.mistakes().len());
    rig.mistakes()
}

#[test]
fn memory_written_while_a_frame_uses_it_is_named() {
    let table = |table: Table, copy: usize| {
        while_held(move |rig| {
            let last = table.offset(copy) + table.bytes() - 1;
            rig.card.memories.table.view().write(last, &[0x77]).unwrap();
        })
    };
    assert_eq!(table(Table::Color, 0), ["the color table (copy 0) was written while frame 1 used it"]);
    assert_eq!(table(Table::Opacity, 1), ["the opacity table (copy 1) was written while frame 1 used it"]);
    assert!(table(Table::Color, 1).is_empty() && table(Table::Opacity, 0).is_empty());
    let voxel = |offset: usize| {
        while_held(move |rig| rig.card.memories.voxel.view().write(offset, &[0x77; 1]).unwrap())
    };
    let last = BASE as usize + (11 * 32 + 15) * 32 + 19;
    assert_eq!(voxel(last), ["the volume of frame 1 was written while it was rendered"]);
    assert!(voxel(last + 1).is_empty(), "padding is nobody's");
    assert!(voxel(BASE as usize - 1).is_empty());
}

#[test]
fn a_promise_about_voxels_is_checked() {
    let mut rig = Rig::strict();
    rig.fill();
    let promised = |tag| {
        let mut registers = frame(tag, 0);
        registers.set(start::VOXELS_UNCHANGED, 1);
        registers
    };
    let mut render = |tag, change: bool| {
        if change {
            rig.card.memories.voxel.view().write(BASE as usize, &[tag as u8; 5]).unwrap();
        }
        rig.start(&promised(tag));
        rig.await_idle();
        rig.mistakes().len()
    };
    assert_eq!([render(1, true), render(2, false), render(3, true), render(4, false)], [0, 0, 1, 1]);
    assert!(rig.mistakes()[0].starts_with("the volume of frame 3 is not what it was"));
}

#[test]
fn faultless_programs_are_not_blamed() {
    let mut rig = Rig::strict();
    rig.fill();
    rig.write(interrupt_enable::REGISTER, interrupt_enable::REGISTER.mask());
    rig.write(status_control::REGISTER, 1);
    for tag in 1..=6 {
        rig.start(&frame(tag, tag % 2));
        rig.await_idle();
        rig.write(acknowledge::REGISTER, acknowledge::REGISTER.mask());
    }
    rig.write(cancel::REGISTER, cancel::REGISTER.mask());
    rig.write(reset::REGISTER, RESET_KEY);
    rig.start(&frame(6, 0));
    rig.await_idle();
    assert_eq!(rig.mistakes(), [""; 0]);
    assert_eq!(rig.read(mistakes::REGISTER), 0);
}

#[test]
fn without_strict_mode_nothing_is_named_or_counted() {
    let mut rig = Rig::new();
    rig.read(start::REGISTER);
    rig.write(status::REGISTER, 1);
    assert_eq!((rig.read(mistakes::REGISTER), rig.mistakes().len()), (0, 0));
    rig.card.reset(crate::protocol::ResetReason::LostConnection);
    assert!(rig.trace().contains("connection 1 ends: mistakes=2 trapped BAR0 reads="));
}
