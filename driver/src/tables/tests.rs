use std::thread;
use std::time::Duration;

use vg500_regs::table::table_select;
use vg500_regs::{FrameRegisters, PlaneFormat};

use super::*;
use crate::fake::{FakeCard, open};

fn content(value: u8) -> TableContent {
    TableContent::color(&[[value; 3]; LOOKUP_ENTRIES])
}

fn copies(fake: &FakeCard) -> [u8; 2] {
    [0, 1].map(|copy| {
        let mut byte = [0];
        fake.view(TABLE_MEMORY.index).read(Table::Color.offset(copy), &mut byte).unwrap();
        byte[0]
    })
}

#[test]
fn opacities_of_more_than_twelve_bits_are_refused_by_entry() {
    let mut entries = [4095; LOOKUP_ENTRIES];
    TableContent::opacity(&entries).unwrap();
    entries[7] = 4096;
    let error = TableContent::opacity(&entries).unwrap_err();
    assert_eq!(error.to_string(), "entry 7 of the opacity table is 4096, at most 4095 fits");
}

#[test]
fn contents_are_packed_as_the_card_reads_them() {
    let color = TableContent::color(&std::array::from_fn(|at| [at as u8, 2, 3]));
    assert_eq!(color.bytes[4 * 5..][..4], [5, 2, 3, 0]);
    let opacity = TableContent::opacity(&std::array::from_fn(|at| at as u16)).unwrap();
    assert_eq!(opacity.bytes[2 * 0x123..][..2], [0x23, 0x01]);
    let diffuse = TableContent::diffuse(&std::array::from_fn(|at| at as u8));
    assert_eq!(diffuse.bytes[4 * 9..][..4], [9, 0, 0, 0]);
    for content in [
        color,
        opacity,
        diffuse,
        TableContent::specular(&[0; REFLECTANCE_ENTRIES]),
        TableContent::gradient_magnitude(&[0; GRADIENT_MAGNITUDE_ENTRIES]),
    ] {
        assert_eq!(content.bytes.len(), content.table.bytes());
    }
}

#[test]
fn known_content_is_not_written_again() {
    let (card, fake) = open();
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let selected = || {
        card.submit(&plane, &FrameRegisters::default()).unwrap();
        fake.frames().last().unwrap().get(table_select::COLOR)
    };
    card.load_table(&content(1)).unwrap();
    assert_eq!((copies(&fake), selected()), ([0, 1], 1));
    card.load_table(&content(2)).unwrap();
    assert_eq!((copies(&fake), selected()), ([2, 1], 0));
    // What the driver has written is still there; were it written again, this would be lost.
    for copy in 0..2 {
        fake.view(TABLE_MEMORY.index).write(Table::Color.offset(copy), &[9]).unwrap();
    }
    card.load_table(&content(2)).unwrap();
    assert_eq!(selected(), 0, "no flip without need");
    card.load_table(&content(1)).unwrap();
    assert_eq!((copies(&fake), selected()), ([9, 9], 1));
    card.reset().unwrap();
    card.load_table(&content(1)).unwrap();
    assert_eq!((copies(&fake), selected()), ([9, 1], 1), "after a reset nothing is known");
}

#[test]
fn copies_that_frames_use_are_left_alone() {
    let (mut card, fake) = open();
    card.set_patience(Duration::from_millis(30));
    let planes = [(); 2].map(|()| card.allocate_plane(PlaneFormat::Rgba8).unwrap());
    fake.hold(true);
    card.load_table(&content(1)).unwrap();
    card.submit(&planes[0], &FrameRegisters::default()).unwrap();
    card.load_table(&content(2)).unwrap();
    card.load_table(&content(3)).unwrap();
    assert_eq!(copies(&fake), [3, 1], "no frame uses the copy that holds 2");
    card.submit(&planes[1], &FrameRegisters::default()).unwrap();
    let error = card.load_table(&content(4)).unwrap_err();
    assert_eq!(error.to_string(), "a frame that uses the color table has not ended within 30ms");
    assert_eq!(copies(&fake), [3, 1]);
    card.load_table(&TableContent::diffuse(&[7; REFLECTANCE_ENTRIES])).unwrap();
    card.set_patience(Duration::from_secs(20));
    thread::scope(|scope| {
        let loader = scope.spawn(|| card.load_table(&content(4)));
        thread::sleep(Duration::from_millis(20));
        fake.finish();
        loader.join().unwrap().unwrap();
    });
    assert_eq!(copies(&fake), [3, 4]);
}
