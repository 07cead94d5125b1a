use std::time::{Duration, Instant};

use vg500_regs::pci::VOXEL_MEMORY;
use vg500_regs::table::{
    base_plane_size, eye_xy, eye_z, interface_version, interrupt_enable, mistakes, start_x, start_y, step_x,
    step_y, trapped_reads, trapped_writes,
};
use vg500_regs::{FaultCode, FrameRegisters, PlaneFormat};

use super::*;
use crate::fake::{FakeCard, Setup, open, open_with};
use crate::{Architecture, Rectangle, Renderer, SimdLevel, TableContent};

fn refused(setup: Setup) -> String {
    Card::open(Box::new(FakeCard::new(setup))).unwrap_err().to_string()
}

#[test]
fn other_devices_are_refused_before_they_are_touched() {
    let setup = Setup { device: 0x1003, ..Setup::default() };
    assert_eq!(refused(setup), "PCI device 1067:1003 is no VolumePro 500 (1067:1002 or 10ba:1002)");
    let setup = Setup { vendor: 0x10bb, ..Setup::default() };
    assert!(refused(setup).starts_with("PCI device 10bb:1002"));
    open_with(Setup { vendor: 0x10ba, ..Setup::default() });
}

#[test]
fn another_interface_is_refused() {
    let setup = Setup { interface: interface_version::MAJOR.put(2) | 3, ..Setup::default() };
    assert_eq!(refused(setup), "the card has programming interface 2.3, this driver knows 1.x");
    open_with(Setup { interface: interface_version::MAJOR.put(1) | 9, ..Setup::default() });
}

#[test]
fn memories_of_wrong_size_or_without_mapping_are_refused_by_name() {
    let mut setup = Setup::default();
    setup.bar_sizes[4] = 8 << 20;
    assert_eq!(refused(setup), "BAR 4 (pixel memory) has 0x800000 bytes, not 0x1000000");
    let setup = Setup { unmapped: Some(2), ..Setup::default() };
    assert_eq!(refused(setup), "BAR 2 (voxel memory) is not mapped into this process");
    let mut setup = Setup::default();
    setup.bar_sizes[VOXEL_MEMORY.index as usize] = 256 << 20;
    assert_eq!(open_with(setup).0.info().voxel_memory, 256 << 20);
}

#[test]
fn a_card_that_cannot_be_enabled_is_refused() {
    let setup = Setup { takes_command: false, ..Setup::default() };
    assert!(refused(setup).contains("command register"));
}

#[test]
fn a_dead_card_says_so_at_once() {
    let fake = FakeCard::new(Setup::default());
    fake.die();
    assert!(matches!(Card::open(Box::new(fake)), Err(Error::CardDead { .. })));
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    fake.hold(true);
    let ticket = card.submit(&plane, &FrameRegisters::default()).unwrap();
    fake.die();
    let start = Instant::now();
    assert!(matches!(card.wait(ticket, Duration::from_secs(60)), Err(Error::CardDead { .. })));
    assert!(start.elapsed() < Duration::from_secs(20), "the wait notices it before its end");
    assert!(matches!(card.mistakes(), Err(Error::CardDead { .. })));
}

#[test]
fn an_open_card_says_what_it_is() {
    let (card, fake) = open();
    let info = card.info();
    assert_eq!((info.vendor, info.device, info.revision), (0x1067, 0x1002, 1));
    assert_eq!((info.renderer, info.architecture), (Renderer::Reference, Architecture::Vg500));
    assert_eq!((info.simd, info.threads, info.voxel_memory), (SimdLevel::Avx512, 3, 128 << 20));
    assert_eq!(format!("{} {} {}", info.renderer, info.architecture, info.simd), "reference vg500 avx512");
    assert_eq!(Renderer::from_code(9).to_string(), "unknown (9)");
    fake.set(trapped_reads::REGISTER.at(5), 11);
    fake.set(trapped_writes::REGISTER.at(0), 12);
    fake.set(mistakes::REGISTER.offset, 13);
    let accesses = card.trapped_accesses().unwrap();
    assert_eq!((accesses.reads[5], accesses.writes[0], card.mistakes().unwrap()), (11, 12, 13));
}

#[test]
fn every_way_of_completion_works() {
    for (interrupts, host_memory, reaches_host_memory, completion) in [
        (true, true, true, Completion::Interrupt),
        (true, true, false, Completion::InterruptAndRegisters),
        (false, true, true, Completion::PollCopy),
        (false, false, false, Completion::PollRegisters),
    ] {
        let setup = Setup { interrupts, host_memory, reaches_host_memory, ..Setup::default() };
        let (card, fake) = open_with(setup);
        assert_eq!(card.completion(), completion);
        let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
        fake.hold(true);
        let ticket = card.submit(&plane, &FrameRegisters::default()).unwrap();
        assert!(!card.has_ended(ticket).unwrap());
        std::thread::scope(|scope| {
            let waiter = scope.spawn(|| card.wait(ticket, Duration::from_secs(20)));
            std::thread::sleep(Duration::from_millis(20));
            fake.finish();
            waiter.join().unwrap().unwrap();
        });
    }
}

#[test]
fn a_card_that_must_reach_host_memory_is_refused_if_it_does_not() {
    let setup = Setup { needs_host_memory: true, reaches_host_memory: false, ..Setup::default() };
    assert!(refused(setup).contains("share=on"));
    let setup = Setup { needs_host_memory: true, host_memory: false, ..Setup::default() };
    assert_eq!(refused(setup), "this way to the card has no host memory");
    let (card, _fake) = open_with(Setup { reaches_host_memory: false, ..Setup::default() });
    assert!(matches!(card.host_memory(1), Err(Error::NotSupported { .. })));
}

#[test]
fn interrupts_that_nobody_receives_are_not_enabled() {
    for interrupts in [false, true] {
        let (card, fake) = open_with(Setup { interrupts, ..Setup::default() });
        assert_eq!(fake.word(interrupt_enable::REGISTER.offset) != 0, interrupts);
        card.reset().unwrap();
        assert_eq!(fake.word(interrupt_enable::REGISTER.offset) != 0, interrupts);
    }
}

#[test]
fn a_steady_frame_in_a_guest_takes_twenty_accesses() {
    let (card, fake) = open_with(Setup { bursts: false, memory_is_remote: true, ..Setup::default() });
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let mut accesses = 0;
    for frame in 1..=3 {
        let mut view = FrameRegisters::default();
        for field in [start_x::POSITION, start_y::POSITION, step_x::STEP, step_y::STEP, eye_xy::X, eye_z::Z] {
            view.set(field, frame);
        }
        view.set(base_plane_size::WIDTH, 9 + frame);
        view.set(base_plane_size::HEIGHT, 9);
        card.load_table(&TableContent::diffuse(&[frame as u8; 384])).unwrap();
        fake.take_writes();
        let reads = fake.reads();
        let ticket = card.submit(&plane, &view).unwrap();
        card.wait(ticket, Duration::from_secs(20)).unwrap();
        card.report(ticket).unwrap();
        card.fetch_pixels(&plane, Rectangle::of_size(9 + frame, 9)).unwrap();
        let writes: usize = fake.take_writes().into_iter().map(|(_, words)| words).sum();
        accesses = writes + fake.reads() - reads;
    }
    assert_eq!(accesses, 20);
}

#[test]
fn a_reset_cancels_frames_and_starts_anew() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    fake.hold(true);
    let mut wanted = FrameRegisters::default();
    wanted.set(start_x::POSITION, 5);
    let ended = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    fake.hold(false);
    let done = card.submit(&ended, &wanted).unwrap();
    card.wait(done, Duration::from_secs(1)).unwrap();
    fake.hold(true);
    let ticket = card.submit(&plane, &wanted).unwrap();
    card.reset().unwrap();
    assert!(card.has_ended(done).unwrap());
    assert!(matches!(card.report(done), Err(Error::StaleTicket { .. })), "the reset has wiped it");
    let error = card.wait(ticket, Duration::from_secs(1)).unwrap_err();
    assert!(matches!(error, Error::Refused { fault, .. } if fault.code == FaultCode::Cancelled), "{error}");
    fake.hold(false);
    let ticket = card.submit(&plane, &wanted).unwrap();
    card.wait(ticket, Duration::from_secs(1)).unwrap();
    assert_eq!(fake.frames()[2].get(start_x::POSITION), 5, "the shadow is that of a reset card");
    assert_eq!(card.completion(), Completion::Interrupt);
}
