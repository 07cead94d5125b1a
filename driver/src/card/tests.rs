use std::time::{Duration, Instant};

use vg500_regs::pci::VOXEL_MEMORY;
use vg500_regs::table::{interface_version, mistakes, trapped_reads, trapped_writes};
use vg500_regs::{FaultCode, FrameRegisters, PlaneFormat};

use super::*;
use crate::fake::{FakeCard, Setup, open, open_with};
use crate::{Architecture, Renderer, SimdLevel};

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
fn a_reset_cancels_frames_and_starts_anew() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    fake.hold(true);
    let mut wanted = FrameRegisters::default();
    wanted.set(vg500_regs::table::start_x::POSITION, 5);
    let ticket = card.submit(&plane, &wanted).unwrap();
    card.reset().unwrap();
    let error = card.wait(ticket, Duration::from_secs(1)).unwrap_err();
    assert!(matches!(error, Error::Refused { fault, .. } if fault.code == FaultCode::Cancelled), "{error}");
    fake.hold(false);
    let ticket = card.submit(&plane, &wanted).unwrap();
    card.wait(ticket, Duration::from_secs(1)).unwrap();
    assert_eq!(
        fake.frames()[1].get(vg500_regs::table::start_x::POSITION),
        5,
        "the shadow is that of a reset card"
    );
    assert_eq!(card.completion(), Completion::Interrupt);
}
