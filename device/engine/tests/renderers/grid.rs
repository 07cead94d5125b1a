//! Volumes in readable form, and a source of chance.

use std::ops::Range;
use vg500_regs::{Permutation, VoxelFormat};

/// A volume of stored voxels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grid {
    pub format: VoxelFormat,
    pub size: [usize; 3],
    /// Stored words, x fastest.
    pub voxels: Vec<u16>,
}

impl Grid {
    /// A volume of what `voxel` gives for each object coordinate.
    pub fn new(format: VoxelFormat, size: [usize; 3], mut voxel: impl FnMut([usize; 3]) -> u16) -> Self {
        let mut voxels = Vec::with_capacity(size.iter().product());
        for z in 0..size[2] {
            for y in 0..size[1] {
                voxels.extend((0..size[0]).map(|x| voxel([x, y, z])));
            }
        }
        Self { format, size, voxels }
    }

    /// A volume of 12-bit voxels, each of them random.
    pub fn noise(size: [usize; 3], chance: &mut Chance) -> Self {
        Self::new(VoxelFormat::Uint12Lower, size, |_| chance.below(4096) as u16)
    }

    /// A volume of 12-bit voxels of both kinds that matter: smooth slopes, and flat regions with edges.
    pub fn blobs(size: [usize; 3]) -> Self {
        Self::new(VoxelFormat::Uint12Lower, size, |at| {
            let [x, y, z] = at.map(|place| place as f64);
            let wave = (0.7 * x + 0.3).sin() + (0.5 * y + 0.2 * z).sin() + (0.9 * z - 0.4 * x).cos();
            (2047.0 + 1100.0 * wave).clamp(0.0, 4095.0) as u16
        })
    }

    /// The stored voxel at an object coordinate.
    pub fn at(&self, [x, y, z]: [usize; 3]) -> u16 {
        self.voxels[(z * self.size[1] + y) * self.size[0] + x]
    }

    /// The part of the volume in a box.
    pub fn window(&self, window: [Range<usize>; 3]) -> Self {
        let low = window.clone().map(|range| range.start);
        Self::new(self.format, window.map(|range| range.len()), |at| {
            self.at([0, 1, 2].map(|axis| low[axis] + at[axis]))
        })
    }

    /// The volume with another voxel for each one.
    pub fn map(&self, format: VoxelFormat, voxel: impl Fn(u16) -> u16) -> Self {
        Self::new(format, self.size, |at| voxel(self.at(at)))
    }

    /// The volume that looks under `permutation` as this one looks unpermuted.
    pub fn unpermuted(&self, permutation: &Permutation) -> Self {
        let mut size = [0; 3];
        for (permuted, place) in permutation.axes().iter().enumerate() {
            size[place.axis] = self.size[permuted];
        }
        Self::new(self.format, size, |object| {
            self.at(permutation.axes().map(|place| match place.flipped {
                true => size[place.axis] - 1 - object[place.axis],
                false => object[place.axis],
            }))
        })
    }
}

/// A repeatable source of random numbers (`SplitMix64`).
pub struct Chance(u64);

impl Chance {
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// A random word.
    pub const fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// A random number in `0..bound`.
    pub const fn below(&mut self, bound: u64) -> u64 {
        self.word() % bound
    }

    /// One of `choices`.
    pub fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len() as u64) as usize]
    }
}
