use vg500_regs::pci::PIXEL_MEMORY;

use super::*;
use crate::fake::{Setup, open, open_with};

#[test]
fn planes_of_all_formats_share_pixel_memory() {
    let (card, fake) = open();
    let wide = card.allocate_plane(PlaneFormat::Sum128).unwrap();
    assert_eq!((wide.index(), wide.covers()), (3, 12..16));
    let narrow: Vec<_> = (0..12).map(|_| card.allocate_plane(PlaneFormat::Rgba8).unwrap()).collect();
    assert_eq!(narrow.iter().map(BasePlane::index).collect::<Vec<_>>(), (0..12).collect::<Vec<_>>());
    for format in [PlaneFormat::Rgba8, PlaneFormat::Accumulator64, PlaneFormat::Sum128] {
        assert!(matches!(card.allocate_plane(format), Err(Error::NoPlane { .. })));
    }
    drop(wide);
    let middle = card.allocate_plane(PlaneFormat::Accumulator64).unwrap();
    assert_eq!(middle.covers(), 14..16);
    fake.hold(true);
    card.submit(&middle, &vg500_regs::FrameRegisters::default()).unwrap();
    drop(middle);
    let next = card.allocate_plane(PlaneFormat::Accumulator64).unwrap();
    assert_eq!(next.covers(), 12..14, "a frame still renders into the other");
    assert!(card.allocate_plane(PlaneFormat::Rgba8).is_err());
    fake.finish();
    assert_eq!(card.allocate_plane(PlaneFormat::Rgba8).unwrap().index(), 14);
}

#[test]
fn rectangles_outside_are_refused() {
    let (card, _fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    for (column, row, width, height) in
        [(0, 0, 0, 1), (0, 0, 1, 0), (512, 0, 1, 1), (0, 1, 1, 512), (1, 0, u32::MAX, 1)]
    {
        let rectangle = Rectangle { column, row, width, height };
        assert!(matches!(card.read_pixels(&plane, rectangle), Err(Error::RectangleOutside { .. })));
    }
    assert_eq!(card.read_pixels(&plane, Rectangle::of_size(512, 512)).unwrap().len(), 1 << 20);
}

#[test]
fn rows_of_a_rectangle_follow_one_another() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Accumulator64).unwrap();
    let pixels: Vec<u8> = (0..48).collect();
    for row in 0..2 {
        let offset = plane.index() as usize * 512 * 512 * 8 + ((9 + row) * 512 + 500) * 8;
        fake.view(PIXEL_MEMORY.index).write(offset, &pixels[row * 24..][..24]).unwrap();
    }
    let rectangle = Rectangle { column: 500, row: 9, width: 3, height: 2 };
    assert_eq!(card.read_pixels(&plane, rectangle).unwrap(), pixels);
}

#[test]
fn pixels_of_a_remote_card_come_by_transfer_where_one_can_bring_them() {
    for (memory_is_remote, reaches_host_memory, format, transferred) in [
        (true, true, PlaneFormat::Rgba8, true),
        (true, true, PlaneFormat::Accumulator64, false),
        (false, true, PlaneFormat::Rgba8, false),
        (true, false, PlaneFormat::Rgba8, false),
    ] {
        let (card, fake) = open_with(Setup { memory_is_remote, reaches_host_memory, ..Setup::default() });
        let plane = card.allocate_plane(format).unwrap();
        let start = plane_offset(format, plane.index(), 0, 0);
        let stored: Vec<u8> = (0..plane_bytes(format)).map(|byte| (byte % 251) as u8).collect();
        fake.view(PIXEL_MEMORY.index).write(start, &stored).unwrap();
        fake.take_writes();
        for rectangle in [
            Rectangle { column: 3, row: 5, width: 7, height: 2 },
            Rectangle::of_size(512, 512),
            Rectangle { column: 511, row: 511, width: 1, height: 1 },
        ] {
            let expected = card.read_pixels(&plane, rectangle).unwrap();
            assert_eq!(card.fetch_pixels(&plane, rectangle).unwrap(), expected);
            assert_eq!(!fake.take_writes().is_empty(), transferred);
        }
        let outside = Rectangle { column: 512, row: 0, width: 1, height: 1 };
        assert!(matches!(card.fetch_pixels(&plane, outside), Err(Error::RectangleOutside { .. })));
    }
}
