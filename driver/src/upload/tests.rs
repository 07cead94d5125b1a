use std::thread;
use std::time::Duration;

use proptest::prelude::*;
use vg500_regs::limit::VOXEL_PITCH;
use vg500_regs::table::{volume_base, volume_pitch};
use vg500_regs::{FrameRegisters, PlaneFormat, VoxelFormat};

use super::*;
use crate::fake::open;

#[test]
fn impossible_volumes_are_refused() {
    let (card, _fake) = open();
    for dimensions in [[0, 1, 1], [1, 1, VOXEL_PITCH + 1], [u32::MAX; 3]] {
        assert!(matches!(
            card.allocate_volume(dimensions, VoxelFormat::Uint8),
            Err(Error::Dimensions { .. })
        ));
    }
    let error = card.allocate_volume([VOXEL_PITCH; 3], VoxelFormat::Uint12Lower).unwrap_err();
    assert!(matches!(error, Error::OutOfBoardMemory { largest: 0x800_0000, .. }), "{error}");
}

#[test]
fn board_memory_runs_out_and_comes_back() {
    let (card, _fake) = open();
    let volumes: Vec<_> =
        (0..4).map(|_| card.allocate_volume([256; 3], VoxelFormat::Uint12Lower).unwrap()).collect();
    let error = card.allocate_volume([33, 1, 1], VoxelFormat::Uint8).unwrap_err();
    assert_eq!(error.to_string(), "out of board memory: 65536 bytes wanted, the largest free piece has 0");
    drop(volumes);
    assert_eq!(card.available_memory(), crate::Availability { free: 128 << 20, largest: 128 << 20 });
}

#[test]
fn slabs_outside_and_wrong_buffers_are_refused() {
    let (card, _fake) = open();
    let volume = card.allocate_volume([40, 20, 10], VoxelFormat::Uint8).unwrap();
    for (origin, size, axis) in [
        ([0, 0, 0], [41, 20, 10], 0),
        ([0, 20, 0], [1, 1, 1], 1),
        ([0, 0, u32::MAX], [1, 1, 2], 2),
        ([0, 0, 0], [1, 0, 1], 1),
    ] {
        let error = card.upload::<u8>(&volume, &Slab { origin, size }, &[]).unwrap_err();
        assert!(matches!(error, Error::SlabOutside { axis: found, .. } if found == axis), "{error}");
    }
    let one = Slab { origin: [39, 19, 9], size: [1; 3] };
    let error = card.upload(&volume, &one, &[0u8; 2]).unwrap_err();
    assert_eq!(error.to_string(), "the slab has 1 voxels, the buffer 2");
    let error = card.download(&volume, &one, &mut [0u16]).unwrap_err();
    assert_eq!(error.to_string(), "the volume has 1 bytes per voxel, the buffer 2");
    let (stranger, _fake) = open();
    assert!(matches!(stranger.upload(&volume, &one, &[0u8]), Err(Error::OtherCard { .. })));
}

#[test]
fn uploads_wait_for_frames_that_read_the_voxels() {
    let (mut card, fake) = open();
    card.set_patience(Duration::from_millis(20));
    let plane = card.allocate_plane(PlaneFormat::Rgba8).unwrap();
    let [volume, other] = [(); 2].map(|()| card.allocate_volume([32; 3], VoxelFormat::Uint8).unwrap());
    let mut wanted = FrameRegisters::default();
    volume.bind(&volume.whole(), &mut wanted).unwrap();
    fake.hold(true);
    card.submit(&plane, &wanted).unwrap();
    let voxels = vec![1u8; 32 * 32 * 32];
    card.upload(&other, &other.whole(), &voxels).unwrap();
    let error = card.upload(&volume, &volume.whole(), &voxels).unwrap_err();
    assert_eq!(error.to_string(), "a frame that reads the voxels has not ended within 20ms");
    card.set_patience(Duration::from_secs(20));
    thread::scope(|scope| {
        let upload = scope.spawn(|| card.upload(&volume, &volume.whole(), &voxels));
        thread::sleep(Duration::from_millis(20));
        fake.finish();
        upload.join().unwrap().unwrap();
    });
}

#[test]
fn a_block_of_a_larger_volume_is_bound_where_it_lies() {
    let (card, _fake) = open();
    let _first = card.allocate_volume([1; 3], VoxelFormat::Uint8).unwrap();
    let volume = card.allocate_volume([300, 40, 20], VoxelFormat::Uint12Upper).unwrap();
    let mut registers = FrameRegisters::default();
    assert!(matches!(volume.bind(&volume.whole(), &mut registers), Err(Error::BlockSize { .. })));
    let block = Slab { origin: [50, 3, 2], size: [250, 37, 18] };
    volume.bind(&block, &mut registers).unwrap();
    assert_eq!(
        u64::from(registers.get(volume_base::OFFSET)),
        volume.offset() + ((2 * 64 + 3) * 320 + 50) * 2
    );
    assert_eq!([volume_pitch::ROW, volume_pitch::ROWS].map(|field| registers.get(field)), [320, 64]);
}

/// A dimension, and a slab along it.
fn axis() -> impl Strategy<Value = (u32, u32, u32)> {
    prop_oneof![1u32..70, Just(32), Just(64)].prop_flat_map(|dimension| {
        let slab = prop_oneof![
            Just((0, dimension)),
            (0..dimension).prop_flat_map(move |origin| (Just(origin), 1..=dimension - origin)),
        ];
        slab.prop_map(move |(origin, size)| (dimension, origin, size))
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Exactly the voxels of the slab are written, each to its place; and they come back.
    #[test]
    fn slabs_are_written_voxel_by_voxel(x in axis(), y in axis(), z in axis()) {
        let (card, fake) = open();
        let axes = [x, y, z];
        let [dimensions, origin, size] =
            [axes.map(|it| it.0), axes.map(|it| it.1), axes.map(|it| it.2)];
        let volume = card.allocate_volume(dimensions, VoxelFormat::Uint12Lower).unwrap();
        let slab = Slab { origin, size };
        let count: u32 = size.iter().product();
        let voxels: Vec<u16> = (0..count).map(|index| 1 + (index % 4095) as u16).collect();
        card.upload(&volume, &slab, &voxels).unwrap();

        let [row, rows] = volume.pitch();
        let mut stored = vec![0u16; (row * rows * dimensions[2]) as usize];
        fake.view(VOXEL_MEMORY.index).read_u16(volume.offset() as usize, &mut stored).unwrap();
        let mut expected = voxels.iter();
        for (index, stored) in (0u32..).zip(stored) {
            let voxel = [index % row, index / row % rows, index / row / rows];
            let inside = (0..3).all(|axis| voxel[axis].wrapping_sub(origin[axis]) < size[axis]);
            let expected = if inside { *expected.next().unwrap() } else { 0 };
            prop_assert_eq!(stored, expected, "at {:?}", voxel);
        }
        let mut back = vec![0u16; voxels.len()];
        card.download(&volume, &slab, &mut back).unwrap();
        prop_assert_eq!(back, voxels);
    }
}
