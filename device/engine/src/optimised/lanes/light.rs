//! The look-ups of the reflectance maps ([`crate::stage::reflectance`], [`crate::stage::reflect`]).

use super::gradient::square;
use crate::optimised::simd::{DARK, Simd, each};
use crate::stage::reflectance::HALF_FACE;

/// Gradients in the form of [`crate::stage::reflectance::cube_vector`], absolute values and signs apart.
#[derive(Clone, Copy, Debug)]
pub struct Stretched<S: Simd> {
    /// Absolute values of the components, 0..=112.
    absolute: [S::Words; 3],
    /// Values of the same signs.
    signs: [S::Words; 3],
    cube: Cube<S>,
}

/// Where directions meet the cube: absolute components of 0..=112 and values of the same signs.
#[derive(Clone, Copy, Debug)]
struct Cube<S: Simd> {
    absolute: [S::Small; 3],
    signs: [S::Small; 3],
    /// Where there is a direction.
    lit: S::SmallMask,
}

impl<S: Simd> Cube<S> {
    /// Looks a map up ([`crate::stage::reflectance::look_up`]).
    #[inline(always)]
    fn look_up(&self, simd: S, map: &S::Map) -> S::Words {
        // The face by the greatest component, of equal ones the last.
        let [x, y, z] = self.absolute;
        let not_z = simd.greater_small(simd.max_small(x, y), z);
        let x_beats_y = simd.greater_small(x, y);
        let is_x = simd.both_small(not_z, x_beats_y);
        let face = self.face(simd, [not_z, x_beats_y]);
        // The components along u and v: y and z on the faces of x, x and z on those of y, x and y on those of z.
        let [[u, v], [u_sign, v_sign]] = each!([self.absolute, self.signs], |components| [
            simd.select_small(is_x, components[1], components[0]),
            simd.select_small(not_z, components[2], components[1]),
        ]);
        let [u, v] = each!([(u, u_sign), (v, v_sign)], |it| simd.with_sign_small(it.0, it.1));
        // SAFETY: faces are 0..=5 or dark, absolute values at most 112.
        unsafe { simd.reflectance(map, face, u, v) }
    }

    /// The number of the face; where there is no direction the dark one.
    #[inline(always)]
    fn face(&self, simd: S, [not_z, x_beats_y]: [S::SmallMask; 2]) -> S::Small {
        let x_or_y = simd.select_small(x_beats_y, self.signs[0], self.signs[1]);
        let component = simd.select_small(not_z, x_or_y, self.signs[2]);
        let [zero, one, two, four] = each!([0, 1, 2, 4], |value| simd.splat_small(value));
        let axis = simd.select_small(not_z, simd.select_small(x_beats_y, zero, two), four);
        let negative = simd.greater_small(zero, component);
        let face = simd.select_small(negative, simd.add_small(axis, one), axis);
        simd.select_small(self.lit, face, simd.splat_small(DARK))
    }
}

impl<S: Simd> Stretched<S> {
    /// Gradients stretched to the cube; a zero gradient stays zero.
    #[inline(always)]
    pub fn new(simd: S, gradient: [S::Words; 3]) -> Self {
        let signs = each!([0, 1, 2], |axis| simd.narrow(gradient[axis]));
        let components = each!([0, 1, 2], |axis| simd.absolute_small(signs[axis]));
        let [x, y, z] = components;
        let major = simd.max_small(simd.max_small(x, y), z);
        let reciprocal = simd.reciprocal_of_gradient(major);
        let absolute = each!([x, y, z], |it| simd.multiply_round(simd.widen_high(it), reciprocal));
        let cube = Cube {
            absolute: each!([0, 1, 2], |axis| simd.narrow(absolute[axis])),
            signs,
            lit: simd.greater_small(major, simd.splat_small(0)),
        };
        Self { absolute, signs: gradient, cube }
    }

    /// Id: the diffuse map in the direction of the gradient.
    #[inline(always)]
    pub fn diffuse(&self, simd: S, map: &S::Map) -> S::Words {
        self.cube.look_up(simd, map)
    }

    /// Is: the specular map in the direction of the reflected eye vector, none of whose components is negative.
    #[inline(always)]
    pub fn specular(&self, simd: S, map: &S::Map, eye: [S::Constant; 3]) -> S::Words {
        let reflected = self.reflect(simd, eye);
        let components = each!([0, 1, 2], |axis| simd.absolute(reflected[axis]));
        let [x, y, z] = components;
        let reciprocal = reciprocal(simd, simd.max(simd.max(x, y), z));
        let limit = simd.splat_small(HALF_FACE as i8);
        let absolute = each!([x, y, z], |component| {
            let ratio = simd.multiply_high(component, reciprocal);
            // (7 ratio + 64) >> 7
            let stretched = simd.multiply_round(ratio, simd.splat(7 << 8));
            simd.min_small(simd.narrow(stretched), limit)
        });
        let signs = each!([0, 1, 2], |axis| simd.narrow(reflected[axis]));
        Cube { absolute, signs, lit: self.cube.lit }.look_up(simd, map)
    }

    /// Half the reflection vector ([`crate::stage::reflect::reflect`]).
    #[inline(always)]
    fn reflect(&self, simd: S, eye: [S::Constant; 3]) -> [S::Words; 3] {
        let eye = each!([0, 1, 2], |axis| simd.spread(eye[axis]));
        let [x, y, z] = each!([0, 1, 2], |axis| {
            let product = simd.multiply_round(simd.shift_left::<7>(self.absolute[axis]), eye[axis]);
            simd.with_sign(product, self.signs[axis])
        });
        let cosine = simd.add(simd.add(x, y), z);
        let half_square = simd.shift_right::<1>(square(simd, self.absolute));
        let steep = simd.absolute(cosine);
        each!([0, 1, 2], |axis| {
            let along = simd.multiply_round(steep, simd.shift_left::<8>(self.absolute[axis]));
            let along = simd.with_signs(along, [self.signs[axis], cosine]);
            simd.subtract(along, simd.multiply_round(half_square, eye[axis]))
        })
    }
}

/// The reciprocal of the major component of a reflection vector: a seed and one Newton step
/// ([`crate::stage::reflect::stretch`]).
#[inline(always)]
fn reciprocal<S: Simd>(simd: S, major: S::Words) -> S::Words {
    let seed = simd.reciprocal_seed(major);
    let found = simd.multiply_high(simd.shift_left::<1>(major), seed);
    let error = simd.shift_left::<4>(simd.subtract(simd.splat(4096), found));
    simd.add(seed, simd.multiply_round(simd.shift_right::<1>(seed), error))
}
