//! What is true at a position, and how far the reference's sample value and gradient may be from it.

use crate::scene::Scene;
use vg500_engine::ideal::{self, Transfer, Voxels};

/// Components of gradients per difference of two samples: of the ideal, and of the card.
pub const IDEAL_UNIT: f64 = 127.0 / 4095.0;
const CARD_UNIT: f64 = 1015.0 / 32768.0;
/// A sample is interpolated three times with 1/8 as the last bit, and rounded to 1.
const INTERPOLATION: f64 = 3.0 / 16.0;
const SAMPLE: f64 = INTERPOLATION + 0.5;

/// A sample's ideal value and gradient (object axes, the card's unit), and greatest errors of the reference's.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    pub value: f64,
    pub value_error: f64,
    pub gradient: [f64; 3],
    pub gradient_error: [f64; 3],
}

impl Truth {
    /// Adds what the reference rounds. So far the errors are those of the sample value and of the differences
    /// between the voxels on both sides; `z` is the object axis of permuted z.
    pub fn rounded(
        value: f64,
        value_error: f64,
        gradient: [f64; 3],
        difference_error: [f64; 3],
        z: usize,
    ) -> Self {
        let gradient_error = [0, 1, 2].map(|axis| {
            let rounding = if axis == z { 2.0 * INTERPOLATION } else { 2.0 * SAMPLE };
            let difference = gradient[axis].abs() / IDEAL_UNIT;
            let scale = difference * (IDEAL_UNIT - CARD_UNIT).abs();
            (difference_error[axis] + rounding) * CARD_UNIT + scale + 0.5
        });
        Self { value, value_error: value_error + SAMPLE, gradient, gradient_error }
    }
}

/// How far positions of a scene may be rounded along each object axis.
#[derive(Clone, Copy, Debug)]
pub struct Rounding(pub [f64; 3]);

impl Rounding {
    pub fn of(scene: &Scene) -> Self {
        let inexact = |accumulated: i32| accumulated % (1 << 14) != 0;
        let [x, y] = [0, 1].map(|axis| inexact(scene.start[axis]) || inexact(scene.step[axis]));
        let rounded = [x, y, !256_u32.is_multiple_of(scene.supersampling)];
        let mut shift = [0.0; 3];
        for (place, rounded) in scene.permutation.axes().into_iter().zip(rounded) {
            shift[place.axis] = if rounded { 1.0 / 512.0 } else { 0.0 };
        }
        Self(shift)
    }

    /// A position, and what it may be rounded to: the nearest multiple of 1/256, or two of them, along each axis.
    pub fn around(position: [f64; 3]) -> impl Iterator<Item = [f64; 3]> {
        let nearest = position.map(|place| [(place * 256.0 - 0.5).ceil(), (place * 256.0 + 0.5).floor()]);
        let rounded = move |corner: usize| [0, 1, 2].map(|axis| nearest[axis][corner >> axis & 1] / 256.0);
        std::iter::once(position).chain((0..8).map(rounded))
    }
}

/// The truth of an ideal scene, whose voxels are those of the reference's.
pub fn of_voxels<'a, V: Voxels, T: Transfer>(
    scene: &Scene,
    ideal: &'a ideal::Scene<V, T>,
) -> impl Fn([f64; 3]) -> Truth + 'a {
    let Rounding(shift) = Rounding::of(scene);
    let value = |at: [usize; 3]| (ideal.voxels)(at);
    let value_error = shifted(ideal.size, shift, &value);
    let z = scene.permutation.axes()[2].axis;
    let gradients = ideal.shading.needs_gradient();
    let difference_error = [0, 1, 2].map(|axis| {
        let difference = |at: [usize; 3]| value(next(ideal.size, at, axis)) - value(before(at, axis));
        if gradients { shifted(ideal.size, shift, &difference) } else { 0.0 }
    });
    move |position| {
        let gradient = if gradients { ideal.gradient(position) } else { [0.0; 3] };
        Truth::rounded(ideal.sample(position), value_error, gradient, difference_error, z)
    }
}

/// By how much a shift of the position moves an interpolated field at most.
fn shifted(size: [usize; 3], shift: [f64; 3], field: &dyn Fn([usize; 3]) -> f64) -> f64 {
    let mut slopes = [0.0_f64; 3];
    for place in 0..size.iter().product() {
        let at = [place % size[0], place / size[0] % size[1], place / size[0] / size[1]];
        let value = field(at);
        for (axis, slope) in slopes.iter_mut().enumerate() {
            *slope = slope.max((field(next(size, at, axis)) - value).abs());
        }
    }
    slopes.iter().zip(shift).map(|(slope, shift)| slope * shift).sum()
}

/// The voxel behind along an axis, and the one before; the outermost ones go on past the volume.
fn next(size: [usize; 3], mut at: [usize; 3], axis: usize) -> [usize; 3] {
    at[axis] = (at[axis] + 1).min(size[axis] - 1);
    at
}

fn before(mut at: [usize; 3], axis: usize) -> [usize; 3] {
    at[axis] = at[axis].saturating_sub(1);
    at
}
