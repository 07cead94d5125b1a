use std::thread;
use std::time::Instant;

use vg500_regs::frame_registers::VIEW_START;
use vg500_regs::table::*;
use vg500_regs::{Fault, PlaneFormat, VoxelFormat};

use super::*;
use crate::Slab;
use crate::fake::{Setup, open, open_with};

const SOON: Duration = Duration::from_secs(20);

/// The registers of a view, different for each `number`.
fn view(number: u32) -> FrameRegisters {
    let mut wanted = FrameRegisters::default();
    for field in [start_x::POSITION, start_y::POSITION, step_x::STEP, step_y::STEP] {
        wanted.set(field, number + 1);
    }
    wanted.set(eye_xy::X, number);
    wanted.set(eye_z::Z, number);
    wanted.set(permutation::X_FLIP, number);
    wanted.set(base_plane_size::WIDTH, 100 + number);
    wanted
}

#[test]
fn a_refusal_names_the_field() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    fake.refuse(Fault::new(FaultCode::Value, volume_size_xy::Y));
    let ticket = card.submit(&plane, &view(0)).unwrap();
    let error = card.wait(ticket, SOON).unwrap_err();
    assert_eq!(error.to_string(), "frame 1 at base plane 0: VOLUME_SIZE_XY.Y: value out of range");
    let ticket = card.submit(&plane, &view(0)).unwrap();
    card.wait(ticket, SOON).unwrap();
}

#[test]
fn reserved_bits_never_reach_the_card_and_change_nothing() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    fake.take_writes();
    let mut wanted = view(0);
    wanted.write(material::REGISTER.offset, 1 << 24);
    assert!(matches!(card.submit(&plane, &wanted), Err(Error::ReservedBits { register: "MATERIAL", .. })));
    assert!(fake.take_writes().is_empty());
    card.submit(&plane, &view(0)).unwrap();
}

#[test]
fn a_frame_that_does_not_end_is_cancelled_and_the_plane_is_free_again() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Accumulator64).unwrap();
    assert_eq!(plane.index(), 7);
    fake.hold(true);
    let ticket = card.submit(&plane, &view(0)).unwrap();
    let start = Instant::now();
    let error = card.wait(ticket, Duration::from_millis(50)).unwrap_err();
    assert_eq!(error.to_string(), "frame 1 at base plane 14 has not ended within 50ms");
    assert!(start.elapsed() < SOON);
    assert!(card.has_ended(ticket).unwrap());
    fake.hold(false);
    let ticket = card.submit(&plane, &view(1)).unwrap();
    card.wait(ticket, SOON).unwrap();
}

#[test]
fn a_frame_that_ignores_its_cancellation_is_reported() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    fake.hold(true);
    fake.ignore_cancel();
    let ticket = card.submit(&plane, &view(0)).unwrap();
    assert!(matches!(card.wait(ticket, Duration::from_millis(1)), Err(Error::Stuck { .. })));
    assert!(matches!(card.submit(&plane, &view(0)), Err(Error::PlaneBusy { plane: 0, bytes: 4 })));
}

#[test]
fn base_planes_in_use_are_not_started() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Accumulator64).unwrap();
    let other = card.allocate_plane(PlaneFormat::Accumulator64).unwrap();
    fake.hold(true);
    let ticket = card.submit(&plane, &view(0)).unwrap();
    assert!(matches!(card.submit(&plane, &view(0)), Err(Error::PlaneBusy { plane: 7, bytes: 8 })));
    assert!(matches!(card.report(ticket), Err(Error::NotEnded { .. })));
    let mut wanted = view(0);
    wanted.set(accumulators::ENABLE, 1);
    wanted.set(accumulators::SOURCE, plane.index());
    assert!(matches!(card.submit(&other, &wanted), Err(Error::PlaneBusy { plane: 7, bytes: 8 })));
    fake.finish();
    card.submit(&other, &wanted).unwrap();
    let (stranger, _) = open();
    assert!(matches!(stranger.submit(&plane, &view(0)), Err(Error::OtherCard { .. })));
    fake.finish();
}

#[test]
fn a_cancelled_frame_says_so_and_others_go_on() {
    let (card, fake) = open();
    let planes = [(); 2].map(|()| card.allocate_plane(PlaneFormat::Rgba8).unwrap());
    fake.hold(true);
    let tickets = planes.each_ref().map(|plane| card.submit(plane, &view(0)).unwrap());
    card.cancel(tickets[0]).unwrap();
    let error = card.wait(tickets[0], SOON).unwrap_err();
    assert!(matches!(error, Error::Refused { fault, .. } if fault.code == FaultCode::Cancelled), "{error}");
    assert!(!card.has_ended(tickets[1]).unwrap());
    fake.finish();
    card.wait(tickets[1], SOON).unwrap();
    card.cancel(tickets[1]).unwrap();
}

#[test]
fn a_ticket_goes_stale_when_its_plane_is_rendered_again() {
    let (card, _fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let old = card.submit(&plane, &view(0)).unwrap();
    let new = card.submit(&plane, &view(1)).unwrap();
    for result in [card.wait(old, SOON), card.cancel(old), card.report(old).map(|_| ())] {
        assert!(matches!(result, Err(Error::StaleTicket { place: 0 })));
    }
    card.wait(new, SOON).unwrap();
}

#[test]
fn tags_wrap_around() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let mut tags = Vec::new();
    for number in 0..0x1_0003 {
        let ticket = card.submit(&plane, &view(number & 1)).unwrap();
        card.wait(ticket, SOON).unwrap();
        tags.push(ticket.tag());
    }
    assert_eq!(tags[..2], [1, 2]);
    assert_eq!(tags[0xfffd..], [0xfffe, 0xffff, 0, 1, 2, 3]);
    assert_eq!(fake.frames().len(), tags.len());
}

#[test]
fn a_reset_card_does_not_pass_for_the_end_of_a_frame_with_tag_zero() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    for _ in 0..0xffff {
        card.submit(&plane, &view(0)).unwrap();
    }
    card.reset().unwrap();
    fake.hold(true);
    let ticket = card.submit(&plane, &view(0)).unwrap();
    assert_eq!(ticket.tag(), 0);
    assert!(!card.has_ended(ticket).unwrap());
    fake.finish();
    card.wait(ticket, SOON).unwrap();
}

#[test]
fn a_steady_frame_is_one_message_of_at_most_twenty_words() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    for number in 0..20 {
        let reads = fake.reads();
        fake.take_writes();
        let ticket = card.submit(&plane, &view(number)).unwrap();
        card.wait(ticket, SOON).unwrap();
        let writes = fake.take_writes();
        let words: usize = writes.iter().map(|(_, words)| words).sum();
        assert!(writes.len() == 1 && words <= 20, "{writes:x?}");
        assert_eq!(fake.reads(), reads, "the end of a frame needs no message");
        let frame = fake.frames().pop().unwrap();
        let changed = view(number);
        let others = changed.changes(&frame).filter(|(offset, _)| *offset != start::REGISTER.offset);
        assert_eq!(others.count(), 0, "the card rendered what was wanted");
    }
}

#[test]
fn without_bursts_only_changed_words_are_written() {
    let (card, fake) = open_with(Setup { bursts: false, ..Setup::default() });
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let mut wanted = view(0);
    card.submit(&plane, &wanted).unwrap();
    fake.take_writes();
    wanted.set(start_x::POSITION, 77);
    wanted.set(cursor_x::POSITION, 78);
    card.submit(&plane, &wanted).unwrap();
    let offsets = [cursor_x::REGISTER, start_x::REGISTER, start::REGISTER].map(|it| (it.offset, 1));
    assert_eq!(fake.take_writes(), offsets);
    assert!(offsets[1].0 >= VIEW_START);
}

#[test]
fn the_promise_about_voxels_is_kept() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let volumes = [(); 2].map(|()| card.allocate_volume([40, 20, 10], VoxelFormat::Uint8).unwrap());
    let promised = |volume: &crate::BoardVolume| {
        let mut wanted = view(0);
        volume.bind(&volume.whole(), &mut wanted).unwrap();
        let ticket = card.submit(&plane, &wanted).unwrap();
        card.wait(ticket, SOON).ok();
        fake.frames().last().unwrap().get(start::VOXELS_UNCHANGED) != 0
    };
    let voxel = Slab { origin: [39, 19, 9], size: [1; 3] };
    assert!(!promised(&volumes[0]) && !promised(&volumes[1]), "never rendered before");
    assert!(promised(&volumes[0]) && promised(&volumes[1]));
    card.upload(&volumes[0], &voxel, &[1u8]).unwrap();
    assert!(!promised(&volumes[0]) && promised(&volumes[1]) && promised(&volumes[0]));
    fake.refuse(Fault::new(FaultCode::Internal, start::PLANE));
    assert!(promised(&volumes[0]));
    assert!(!promised(&volumes[0]), "a frame that failed may not have seen the voxels");

    // A description that the driver itself refuses is no frame.
    card.upload(&volumes[1], &voxel, &[1u8]).unwrap();
    let mut wanted = view(0);
    volumes[1].bind(&volumes[1].whole(), &mut wanted).unwrap();
    wanted.write(material::REGISTER.offset, 1 << 24);
    card.submit(&plane, &wanted).unwrap_err();
    assert!(!promised(&volumes[1]));
}

#[test]
fn many_threads_render_into_planes_of_their_own() {
    let (card, fake) = open();
    thread::scope(|scope| {
        for number in 0..8 {
            let card = &card;
            scope.spawn(move || {
                let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
                for _ in 0..50 {
                    let ticket = card.submit(&plane, &view(number)).unwrap();
                    card.wait(ticket, SOON).unwrap();
                }
            });
        }
    });
    let frames = fake.frames();
    assert_eq!(frames.len(), 400);
    for frame in frames {
        let number = frame.get(start_x::POSITION) - 1;
        let wanted = view(number);
        assert!(wanted.changes(&frame).all(|(offset, _)| offset == start::REGISTER.offset), "torn frame");
    }
}

#[test]
fn the_report_is_that_of_the_frame() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Sum128).unwrap();
    let ticket = card.submit(&plane, &view(0)).unwrap();
    card.wait(ticket, SOON).unwrap();
    let at = |register: vg500_regs::Register| register.at(12);
    for (offset, word) in [
        (at(report_samples_low::REGISTER), 1),
        (at(report_samples_high::REGISTER), 2),
        (at(report_processed_low::REGISTER), 3),
        (at(report_time_high::REGISTER), 4),
        (at(report_cycles_low::REGISTER), 5),
        (at(report_omitted::REGISTER), report_omitted::CUT.put(1) | report_omitted::FINISHED_RAYS.put(1)),
        (at(report_empty::REGISTER), 6),
        (at(report_finished::REGISTER), 7),
        (at(report_checksum::REGISTER), 8),
    ] {
        fake.set(offset, word);
    }
    let report = card.report(ticket).unwrap();
    assert_eq!((report.samples, report.samples_processed, report.cycles), (1 | 2 << 32, 3, 5));
    assert_eq!(report.engine_time, Duration::from_nanos(4 << 32));
    assert_eq!((report.empty, report.finished, report.checksum), (6, 7, 8));
    assert_eq!(report.left_out().collect::<Vec<_>>(), ["CUT", "FINISHED_RAYS"]);
}
