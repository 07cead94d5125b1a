//! Interpolation of a row ([`crate::stage::interpolate`]): z, then y into a line, then x.

use crate::optimised::line::Line;
use crate::optimised::simd::{Simd, SimdExt};
use core::ops::Range;

/// A weight of 8 fraction bits as [`SimdExt::lerp`] takes it.
#[inline(always)]
pub fn weight<S: Simd>(simd: S, weight: i16) -> S::Words {
    simd.splat(weight << 7)
}

/// Interpolates the rows above and below a sample row between two slices, along z and y: `rows[z][y]`.
///
/// Weights that are zero leave their interpolation out.
#[inline(always)]
pub fn along_z_and_y<S: Simd>(
    simd: S,
    rows: [[&Line; 2]; 2],
    weights: [i16; 2],
    voxels: usize,
    line: &mut Line,
) {
    let [z, y] = weights;
    let [z_weight, y_weight] = weights.map(|it| weight(simd, it));
    let blocks = || simd.blocks(0..voxels);
    let at = |z: usize, y: usize, block| rows[z][y].load(simd, block);
    match (z != 0, y != 0) {
        (false, false) => blocks().for_each(|block| line.store(simd, block, at(0, 0, block))),
        (false, true) => {
            for block in blocks() {
                line.store(simd, block, simd.lerp(at(0, 0, block), at(0, 1, block), y_weight));
            }
        }
        (true, false) => {
            for block in blocks() {
                line.store(simd, block, simd.lerp(at(0, 0, block), at(1, 0, block), z_weight));
            }
        }
        (true, true) => {
            for block in blocks() {
                let along_z = |y| simd.lerp(at(0, y, block), at(1, y, block), z_weight);
                line.store(simd, block, simd.lerp(along_z(0), along_z(1), y_weight));
            }
        }
    }
    line.replicate_ends(voxels);
}

/// The differences along z of the slices around a sample slice, halved and interpolated along z and y
/// ([`crate::stage::gradient::voxel_difference`]): `rows[z][y]` from one slice before to two behind the slice below.
#[inline(always)]
pub fn differences_along_z_and_y<S: Simd>(
    simd: S,
    rows: [[&Line; 2]; 4],
    weights: [i16; 2],
    voxels: usize,
    line: &mut Line,
) {
    let [z, y] = weights;
    let [z_weight, y_weight] = weights.map(|it| weight(simd, it));
    let blocks = || simd.blocks(0..voxels);
    let at = |z: usize, y: usize, block| {
        let [before, behind] = [rows[z][y].load(simd, block), rows[z + 2][y].load(simd, block)];
        simd.shift_right_signed::<1>(simd.subtract(behind, before))
    };
    match (z != 0, y != 0) {
        (false, false) => blocks().for_each(|block| line.store(simd, block, at(0, 0, block))),
        (false, true) => {
            for block in blocks() {
                line.store(simd, block, simd.lerp(at(0, 0, block), at(0, 1, block), y_weight));
            }
        }
        _ => {
            for block in blocks() {
                let along_z = |y| simd.lerp(at(0, y, block), at(1, y, block), z_weight);
                line.store(simd, block, simd.lerp(along_z(0), along_z(1), y_weight));
            }
        }
    }
}

/// Interpolates a block of a line along x.
#[inline(always)]
pub fn along_x<S: Simd>(
    simd: S,
    line: &Line,
    block: crate::optimised::line::Block,
    x_weight: S::Words,
) -> S::Words {
    simd.lerp(line.load(simd, block), line.load_behind(simd, block), x_weight)
}

/// An interpolated value as a sample ([`crate::stage::interpolate::unguard`]).
#[inline(always)]
pub fn unguard<S: Simd>(simd: S, value: S::Words) -> S::Words {
    simd.shift_right::<3>(simd.add(value, simd.splat(4)))
}

/// Interpolates a whole line along x into samples, with one on each side for gradients.
#[inline(always)]
pub fn samples<S: Simd>(
    simd: S,
    line: &Line,
    x_weight: i16,
    voxels: Range<usize>,
    samples: &mut Line,
) {
    let x = weight(simd, x_weight);
    let size = voxels.end;
    if x_weight == 0 {
        for block in simd.blocks(voxels) {
            samples.store(simd, block, unguard(simd, line.load(simd, block)));
        }
    } else {
        for block in simd.blocks(voxels) {
            samples.store(simd, block, unguard(simd, along_x(simd, line, block, x)));
        }
    }
    // The neighbours of the outermost samples lie between replicated voxels.
    samples.set(-1, crate::stage::interpolate::unguard(i32::from(line.get(0))));
    let last = size.cast_signed();
    samples.set(last, crate::stage::interpolate::unguard(i32::from(line.get(last - 1))));
}
