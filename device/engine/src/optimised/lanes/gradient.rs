//! Gradient estimation ([`crate::stage::gradient`]).

use crate::frame::FrameDescription;
use crate::optimised::line::{Block, Line};
use crate::optimised::simd::{Simd, each};

/// How differences along permuted axes become a gradient in object axes.
#[derive(Clone, Copy, Debug)]
pub struct Orientation<S: Simd> {
    /// 1015, negative on axes that run against the object's.
    factors: [S::Constant; 3],
    /// The permuted axis that each object axis is.
    permuted: [usize; 3],
}

impl<S: Simd> Orientation<S> {
    /// For a frame; axes that are `mirrored` change their sign.
    #[inline(always)]
    pub fn new(simd: S, frame: &FrameDescription, mirrored: [bool; 3]) -> Self {
        let axes = frame.permutation.axes();
        let mut permuted = [0; 3];
        let mut factors = [simd.constant(0); 3];
        for (place, axis) in axes.iter().enumerate() {
            permuted[axis.axis] = place;
            // Rows always run forward along x.
            let against = axis.flipped && place != 0;
            let factor = crate::stage::gradient::PER_DIFFERENCE as i16;
            factors[place] = simd.constant(if against != mirrored[axis.axis] { -factor } else { factor });
        }
        Self { factors, permuted }
    }

    /// The gradient at a block: `rows` are the sample rows before, at and behind it, `differences` the line of
    /// differences along z, interpolated along z and y.
    ///
    /// The odd factor leaves no ties, so a negative factor gives the negative result.
    #[inline(always)]
    pub fn gradient(
        &self,
        simd: S,
        rows: [&Line; 3],
        differences: &Line,
        x_weight: S::Words,
        block: Block,
    ) -> [S::Words; 3] {
        let x = simd.subtract(rows[1].load_behind(simd, block), rows[1].load_before(simd, block));
        let y = simd.subtract(rows[2].load(simd, block), rows[0].load(simd, block));
        let z = simd.lerp(differences.load(simd, block), differences.load_behind(simd, block), x_weight);
        // (z f + 2^16) >> 17 is (high half of z f + 1) >> 1.
        let factors = each!([0, 1, 2], |axis| simd.spread(self.factors[axis]));
        let z = simd.add(simd.multiply_high_signed(z, factors[2]), simd.splat(1));
        let components = [
            simd.multiply_round(x, factors[0]),
            simd.multiply_round(y, factors[1]),
            simd.shift_right_signed::<1>(z),
        ];
        let [x, y, z] = self.permuted;
        [components[x], components[y], components[z]]
    }
}

/// Magnitude of a gradient ([`crate::stage::magnitude`]).
#[inline(always)]
pub fn magnitude<S: Simd>(simd: S, gradient: [S::Words; 3]) -> S::Words {
    simd.square_root(square(simd, gradient))
}

/// The sum of the squares of three components; up to 2^16 - 1.
#[inline(always)]
pub fn square<S: Simd>(simd: S, vector: [S::Words; 3]) -> S::Words {
    let [x, y, z] = each!([vector[0], vector[1], vector[2]], |it| simd.multiply_low(it, it));
    simd.add(simd.add(x, y), z)
}
