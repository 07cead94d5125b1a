//! Frames through registers are the engine's frames.

use std::time::{Duration, Instant};

use vg500_engine::{Cancel, Memories, Renderer};
use vg500_regs::memory::plane_offset;
use vg500_regs::table::*;
use vg500_regs::{BlendMode, FaultCode, FrameRegisters, PlaneFormat, SharedView};

use super::rig::{Rig, frame};
use crate::card::Pace;
use crate::card::fake::Panicking;
use crate::config::Config;

/// What the engine makes of a frame with the card's tables and voxels: pixel memory and report.
fn directly(rig: &Rig, frame: &FrameRegisters) -> (Vec<u8>, vg500_engine::Report) {
    let memories = &rig.card.memories;
    let size = memories.voxel.view().size();
    let task = Renderer::Reference.take(frame, &memories.table.view(), size).unwrap();
    let mut pixels = vec![0; memories.pixel.view().size()];
    let section = memories.section.view();
    let views = Memories { voxel: memories.voxel.view(), pixel: SharedView::of(&mut pixels), section };
    let report = Renderer::Reference.render(&task, views, &Cancel::default()).unwrap();
    (pixels, report)
}

#[test]
fn a_renderer_that_panics_costs_the_frame_and_nothing_else() {
    let mut rig = Rig::with(Config::default(), Panicking);
    for tag in 1..=2 {
        rig.start(&frame(tag, 0));
        rig.await_idle();
        assert_eq!(rig.plane_state(0), (tag, result::FAILED));
        assert_eq!(rig.plane_fault(0).unwrap().code, FaultCode::Internal);
    }
}

#[test]
fn pixels_and_report_are_those_of_the_engine() {
    let formats = [
        (BlendMode::Alpha, PlaneFormat::Rgba8),
        (BlendMode::Maximum, PlaneFormat::Accumulator64),
        (BlendMode::Sum, PlaneFormat::Sum128),
    ];
    for (blend, format) in formats {
        let mut rig = Rig::new();
        rig.fill();
        let mut registers = frame(5, 3);
        registers.set(output::BLEND, blend as u32);
        registers.set(output::PLANE_FORMAT, format as u32);
        registers.set(step_x::STEP, 1 << 21);
        registers.set(supersampling::Z, 2);
        let (expected, report) = directly(&rig, &registers);
        rig.start(&registers);
        rig.await_idle();
        let mut pixels = vec![1; expected.len()];
        rig.card.memories.pixel.view().read(0, &mut pixels).unwrap();
        assert!(pixels == expected, "{blend:?}");
        let plane = plane_offset(format, 3, 0, 0);
        assert!(pixels[plane..plane + 64].iter().any(|&byte| byte != 0), "a picture");
        let place = (plane / (512 * 512 * 4)) as u32;
        assert_eq!(rig.plane_state(place), (5, result::DONE));
        let words = [
            report_tag::REGISTER,
            report_samples_low::REGISTER,
            report_processed_low::REGISTER,
            report_cycles_low::REGISTER,
            report_omitted::REGISTER,
            report_checksum::REGISTER,
        ]
        .map(|register| rig.read_at(register.at(place)));
        let counts = [report.samples, report.processed, report.cycles].map(|count| count as u32);
        assert_eq!(words[1..4], counts);
        assert_eq!([words[0], words[4], words[5]], [5, report.omitted, report.checksum]);
        assert_ne!(rig.read_at(report_time_low::REGISTER.at(place)), 0);
    }
}

#[test]
fn voxels_written_through_the_mapping_are_in_the_next_frame() {
    let mut rig = Rig::new();
    rig.fill();
    let mut checksums = Vec::new();
    for tag in 1..=3 {
        rig.start(&frame(tag, 0));
        rig.await_idle();
        checksums.push(rig.read(report_checksum::REGISTER));
        if tag == 2 {
            rig.card.memories.voxel.view().write(super::rig::BASE as usize, &[255; 2000]).unwrap();
        }
    }
    assert_eq!(checksums[0], checksums[1]);
    assert_ne!(checksums[1], checksums[2]);
}

#[test]
fn hardware_pace_ends_frames_when_the_card_would_have() {
    let mut rig =
        Rig::with(Config { pace: Pace::Hardware, ..Config::default() }, Renderer::Reference.start());
    let mut slow = frame(1, 0);
    // 256 x 32 x 32 voxels, eight times: 524 288 cycles, 4.2 ms.
    slow.set(volume_size_z::Z, 256);
    slow.set(supersampling::Z, 8);
    let began = Instant::now();
    rig.start(&slow);
    rig.await_idle();
    assert!(began.elapsed() >= Duration::from_nanos(524_288 * 8));
    assert_eq!(rig.read(report_cycles_low::REGISTER), 524_288);
    assert_eq!(rig.plane_state(0), (1, result::DONE));
}
