//! Words, sums and voxels in memory.

use super::{at_every_level, lanes, random, work};
use crate::optimised::simd::{MOST_LANES, Simd, Work};
use crate::stage::interpolate;
use core::array::from_fn;
use vg500_regs::VoxelFormat;

work!(loads_and_stores_anywhere_and_nothing_else, |simd| {
    let words: Vec<_> = random(3).take(3 * MOST_LANES).collect();
    for start in 0..=2 * MOST_LANES - S::LANES {
        let mut copy = vec![0x5555; 3 * MOST_LANES];
        // SAFETY: both have as many words from there on.
        unsafe { simd.store(copy.as_mut_ptr().add(start), simd.load(words.as_ptr().add(start))) };
        let end = start + S::LANES;
        assert_eq!(copy[start..end], words[start..end]);
        assert!(copy[..start].iter().chain(&copy[end..]).all(|word| *word == 0x5555), "{start}");
    }
});

work!(sums, |simd| {
    for seed in 0..100 {
        let words: Vec<_> = random(4 + seed).take(S::LANES).collect();
        let high = random(200 + seed).map(|word| u32::from(word) << 15);
        let before: Vec<u32> = high.take(S::LANES + 2).collect();
        let mut sums = before.clone();
        // SAFETY: there is one for each lane behind the first.
        unsafe { simd.add_to_sums(sums.as_mut_ptr().add(1), simd.load(words.as_ptr())) };
        for (place, sum) in sums.into_iter().enumerate() {
            let lane = place.checked_sub(1).and_then(|lane| words.get(lane));
            assert_eq!(sum, before[place] + lane.map_or(0, |word| u32::from(*word)), "{place}");
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
        for start in (1..memory.len()).step_by(S::LANES * format.bytes()) {
            // SAFETY: 2^16 is a multiple of all vectors.
            let found = lanes(simd, unsafe { simd.load_voxels(format, memory.as_ptr().add(start)) });
            for (lane, found) in found.into_iter().enumerate() {
                let place = start + lane * format.bytes();
                assert_eq!(found, voxel(format, &memory, place), "{format:?} {place}");
            }
        }
    }
});

work!(transposed_voxels, |simd| {
    let memory: Vec<_> = random(5).map(|word| word as u8).take(4096).collect();
    for format in FORMATS {
        for pitch in [32, 33, 200, 0, -31, -200_isize] {
            let start = if pitch < 0 { 3500 } else { 11 };
            // SAFETY: 15 steps and a row from there remain within the memory.
            let found = unsafe { simd.load_transposed(format, memory.as_ptr().add(start), pitch) };
            let from = |row: usize| start.strict_add_signed(row.cast_signed() * pitch);
            let expected: [[u16; 16]; 16] =
                from_fn(|word| from_fn(|row| voxel(format, &memory, from(row) + word * format.bytes())));
            assert_eq!(found, expected, "{format:?} {pitch}");
        }
    }
});
