//! Words, sums and voxels in memory.

use super::{at_every_level, lanes, load, random, work};
use crate::optimised::simd::{HALF, LANES, Simd, Square, Work};
use crate::stage::interpolate;
use core::array::from_fn;
use vg500_regs::VoxelFormat;

work!(loads_and_stores_anywhere_and_nothing_else, |simd| {
    let words: Vec<_> = random(3).take(4 * LANES).collect();
    for first in 0..=LANES {
        for second in [first + HALF, 3 * LANES, 4 * LANES - HALF - first % 3] {
            let mut copy = vec![0x5555; 4 * LANES];
            let to = copy.as_mut_ptr();
            // SAFETY: both have as many words from these places on.
            unsafe {
                let from = [first, second].map(|start| words.as_ptr().add(start));
                simd.store([to.add(first), to.add(second)], simd.load(from));
            }
            for (place, (word, original)) in copy.into_iter().zip(&words).enumerate() {
                let stored = [first, second].into_iter().any(|start| (start..start + HALF).contains(&place));
                assert_eq!(word, if stored { *original } else { 0x5555 }, "{first} {second} {place}");
            }
        }
    }
});

work!(sums, |simd| {
    for seed in 0..100 {
        let words = from_fn(|lane| random(4 + seed).nth(lane).unwrap());
        let high = random(200 + seed).map(|word| u32::from(word) << 15);
        let before: Vec<u32> = high.take(LANES + 10).collect();
        let mut sums = before.clone();
        let start = sums.as_mut_ptr();
        // SAFETY: there is one for each lane of a half behind the first, and behind as many more.
        unsafe { simd.add_to_sums([start.add(1), start.add(1 + HALF + 8)], load(simd, &words)) };
        for (place, sum) in sums.into_iter().enumerate() {
            let lane = match place {
                1..=HALF => Some(place - 1),
                _ => place.checked_sub(1 + 8).filter(|lane| (HALF..LANES).contains(lane)),
            };
            assert_eq!(sum, before[place] + lane.map_or(0, |lane| u32::from(words[lane])), "{place}");
        }
    }
});

const FORMATS: [VoxelFormat; 3] = [VoxelFormat::Uint8, VoxelFormat::Uint12Lower, VoxelFormat::Uint12Upper];

/// The voxel at a place of memory, as it enters interpolation.
fn voxel(format: VoxelFormat, memory: &[u8], place: usize) -> u16 {
    let stored = match format.bytes() {
        1 => u16::from(memory[place]),
        _ => u16::from_le_bytes([memory[place], memory[place + 1]]),
    };
    interpolate::guard(format.value(stored)) as u16
}

work!(voxels_of_all_formats_and_values, |simd| {
    // Behind an odd byte, so that no vector is aligned.
    let words = (0..=u16::MAX).flat_map(u16::to_le_bytes);
    let memory: Vec<u8> = [0].into_iter().chain(words).collect();
    for format in FORMATS {
        for start in (1..memory.len()).step_by(LANES * format.bytes()) {
            // SAFETY: 2^16 is a multiple of all vectors.
            let found = lanes(simd, unsafe { simd.load_voxels(format, memory.as_ptr().add(start)) });
            for (lane, found) in found.into_iter().enumerate() {
                let place = start + lane * format.bytes();
                assert_eq!(found, voxel(format, &memory, place), "{format:?} {place}");
            }
        }
    }
});

work!(halves_of_voxels, |simd| {
    let memory: Vec<_> = random(5).map(|word| word as u8).take(200).collect();
    for format in FORMATS {
        for start in 0..=200 - HALF * format.bytes() {
            let mut found = [0x5555; HALF];
            // SAFETY: as many voxels lie there.
            unsafe { simd.load_half_of_voxels(format, memory.as_ptr().add(start), &mut found) };
            let expected = from_fn(|word| voxel(format, &memory, start + word * format.bytes()));
            assert_eq!(found, expected, "{format:?} {start}");
        }
    }
});

work!(transposition, |simd| {
    let mut square = Square::ZERO;
    square.rows = from_fn(|row| from_fn(|column| (HALF * row + column) as u16));
    simd.transpose(&mut square);
    for (row, words) in square.rows.into_iter().enumerate() {
        assert_eq!(words, from_fn(|column| (HALF * column + row) as u16), "{row}");
    }
});
