//! Interpolation of a row ([`crate::stage::interpolate`]): z, then y into a line, then x.

use crate::optimised::cells::Cells;
use crate::optimised::line::{Block, Line};
use crate::optimised::simd::{Simd, each};

/// A weight of 8 fraction bits as [`Simd::lerp`] takes it.
#[inline(always)]
pub fn weight<S: Simd>(simd: S, weight: i16) -> S::Words {
    simd.splat(weight << 7)
}

/// Rows above and below a sample row in two slices: `rows[z][y]`.
pub type Corners<'a> = [[&'a Line; 2]; 2];

/// How the rows around a sample row become one.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// Weights of the slice and of the row behind, 8 fraction bits.
    pub z_and_y: [i16; 2],
    /// Along which of these axes a weight of zero leaves the interpolation out.
    pub leave_out: [bool; 2],
}

impl Weights {
    /// Along which axes there is something to interpolate. Along z alone it is not worth a case of its own.
    #[inline(always)]
    const fn needed(self) -> [bool; 2] {
        let [z, y] = self.z_and_y;
        let z = z != 0 || !self.leave_out[0];
        [z, z || y != 0 || !self.leave_out[1]]
    }
}

/// Interpolates cells of the rows around a sample row along z and y, into `line` unless it is one of them.
#[inline(always)]
pub fn along_z_and_y<'a, S: Simd>(
    simd: S,
    rows: Corners<'a>,
    weights: Weights,
    cells: Cells,
    voxels: usize,
    line: &'a mut Line,
) -> &'a Line {
    let needed = weights.needed();
    if needed == [false; 2] {
        return rows[0][0];
    }
    let [z, y] = each!([0, 1], |axis| weight(simd, weights.z_and_y[axis]));
    if needed[0] {
        for block in cells.blocks() {
            let [above, below] = each!([0, 1], |row| {
                simd.lerp(rows[0][row].load(simd, block), rows[1][row].load(simd, block), z)
            });
            line.store(simd, block, simd.lerp(above, below, y));
        }
    } else {
        for block in cells.blocks() {
            let [above, below] = [rows[0][0].load(simd, block), rows[0][1].load(simd, block)];
            line.store(simd, block, simd.lerp(above, below, y));
        }
    }
    line.replicate_ends(voxels);
    line
}

/// The differences along z, halved ([`crate::stage::gradient::voxel_difference`]), interpolated along z and y:
/// those of the slices `before` and `behind` that lie around the slices of a sample row.
#[inline(always)]
pub fn differences_along_z_and_y<S: Simd>(
    simd: S,
    before: Corners<'_>,
    behind: Corners<'_>,
    weights: Weights,
    cells: Cells,
    line: &mut Line,
) {
    let needed = weights.needed();
    let [z, y] = each!([0, 1], |axis| weight(simd, weights.z_and_y[axis]));
    if needed[0] {
        for block in cells.blocks() {
            let [above, below] = each!([0, 1], |row| {
                let here = difference(simd, before[0][row], behind[0][row], block);
                simd.lerp(here, difference(simd, before[1][row], behind[1][row], block), z)
            });
            line.store(simd, block, simd.lerp(above, below, y));
        }
    } else if needed[1] {
        for block in cells.blocks() {
            let [above, below] = each!([0, 1], |row| difference(simd, before[0][row], behind[0][row], block));
            line.store(simd, block, simd.lerp(above, below, y));
        }
    } else {
        for block in cells.blocks() {
            line.store(simd, block, difference(simd, before[0][0], behind[0][0], block));
        }
    }
}

/// Half the difference of two rows.
#[inline(always)]
fn difference<S: Simd>(simd: S, before: &Line, behind: &Line, block: Block) -> S::Words {
    simd.shift_right_signed::<1>(simd.subtract(behind.load(simd, block), before.load(simd, block)))
}

/// Interpolates a block of a line along x.
#[inline(always)]
pub fn along_x<S: Simd>(simd: S, line: &Line, block: Block, x_weight: S::Words) -> S::Words {
    simd.lerp(line.load(simd, block), line.load_behind(simd, block), x_weight)
}

/// An interpolated value as a sample ([`crate::stage::interpolate::unguard`]).
#[inline(always)]
pub fn unguard<S: Simd>(simd: S, value: S::Words) -> S::Words {
    simd.shift_right::<3>(simd.add(value, simd.splat(4)))
}

/// Interpolates cells of a line along x into samples, with one on each side for gradients. A weight of zero leaves
/// the interpolation out, if that is allowed.
#[inline(always)]
pub fn samples<S: Simd>(
    simd: S,
    line: &Line,
    (x_weight, leave_out): (i16, bool),
    cells: Cells,
    voxels: usize,
    samples: &mut Line,
) {
    let x = weight(simd, x_weight);
    if x_weight == 0 && leave_out {
        for block in cells.blocks() {
            samples.store(simd, block, unguard(simd, line.load(simd, block)));
        }
    } else {
        for block in cells.blocks() {
            samples.store(simd, block, unguard(simd, along_x(simd, line, block, x)));
        }
    }
    // The neighbours of the outermost samples lie between replicated voxels.
    samples.set(-1, crate::stage::interpolate::unguard(i32::from(line.get(0))));
    let last = voxels.cast_signed();
    samples.set(last, crate::stage::interpolate::unguard(i32::from(line.get(last - 1))));
}
