use std::time::Duration;

use vg500_regs::PlaneFormat;
use vg500_regs::pci::PIXEL_MEMORY;

use super::*;
use crate::fake::{Setup, open, open_with};

const RECTANGLE: Rectangle = Rectangle { column: 3, row: 5, width: 7, height: 2 };

#[test]
fn rectangles_that_do_not_fit_are_refused() {
    let (card, _fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let target = card.host_memory(4096).unwrap();
    let transfer = |rectangle, offset, pitch| {
        card.transfer(&plane, rectangle, PixelFormat::Rgba8, &*target, offset, pitch)
    };
    let outside = Rectangle { column: 510, ..RECTANGLE };
    assert!(matches!(transfer(outside, 0, 64), Err(Error::RectangleOutside { column: 510, .. })));
    for (offset, pitch) in [(4096 - 28 - 63, 64), (0, 4096), (usize::MAX, 28), (0, u32::MAX), (0, 1 << 24)] {
        assert!(matches!(transfer(RECTANGLE, offset, pitch), Err(Error::TransferOutside { .. })));
    }
}

#[test]
fn a_transport_without_host_memory_says_so() {
    let (card, _fake) = open_with(Setup { host_memory: false, ..Setup::default() });
    assert!(matches!(card.host_memory(1), Err(Error::NotSupported { .. })));
}

#[test]
fn faults_and_silence_are_reported() {
    let (mut card, fake) = open();
    card.set_patience(Duration::from_millis(20));
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let target = card.host_memory(4096).unwrap();
    let transfer = || card.transfer(&plane, RECTANGLE, PixelFormat::Argb4, &*target, 0, 64);
    fake.refuse(Fault::new(FaultCode::HostMemory, vg500_regs::table::transfer_address_low::ADDRESS));
    let error = transfer().unwrap_err();
    assert_eq!(error.to_string(), "transfer 1: TRANSFER_ADDRESS_LOW.ADDRESS: host memory not reachable");
    fake.hold(true);
    let error = transfer().unwrap_err();
    assert_eq!(error.to_string(), "transfer 2 has not ended within 20ms");
    fake.ignore_cancel();
    assert!(matches!(transfer(), Err(Error::Stuck { .. })));
}

#[test]
fn a_reset_ends_a_transfer() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let target = card.host_memory(4096).unwrap();
    fake.hold(true);
    std::thread::scope(|scope| {
        let waiter = scope.spawn(|| card.transfer(&plane, RECTANGLE, PixelFormat::Rgba8, &*target, 0, 64));
        while fake.take_writes().iter().all(|(offset, _)| *offset != transfer_address_low::REGISTER.offset) {
            std::thread::yield_now();
        }
        assert!(matches!(
            card.submit(&plane, &vg500_regs::FrameRegisters::default()),
            Err(Error::PlaneBusy { .. })
        ));
        card.reset().unwrap();
        let error = waiter.join().unwrap().unwrap_err();
        assert!(matches!(error, Error::Refused { fault, .. } if fault.code == FaultCode::Cancelled));
    });
}

#[test]
fn pixels_arrive_in_host_memory() {
    let (card, fake) = open();
    let _other = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let pixels: Vec<u8> = (0..28).collect();
    for row in 0..2 {
        let offset = (512 * 512 + (5 + row) * 512 + 3) * 4;
        fake.view(PIXEL_MEMORY.index).write(offset, &pixels).unwrap();
    }
    let target = card.host_memory(4096).unwrap();
    fake.take_writes();
    card.transfer(&plane, RECTANGLE, PixelFormat::Rgba8, &*target, 0, 64).unwrap();
    assert_eq!(fake.take_writes().len(), 1, "one message");
    let mut seen = [0; 64 + 28];
    target.view().read(0, &mut seen).unwrap();
    assert_eq!((&seen[..28], &seen[64..]), (&pixels[..], &pixels[..]));
    assert_eq!(seen[28..64], [0; 36]);
}
