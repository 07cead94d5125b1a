//! The look-ups of the reflectance maps ([`crate::stage::reflectance`], [`crate::stage::reflect`]).

use super::gradient::square;
use crate::optimised::simd::{Simd, each};
use crate::stage::reflectance::HALF_FACE;

/// Directions in the form of [`crate::stage::reflectance::cube_vector`], absolute values and signs apart.
#[derive(Clone, Copy, Debug)]
pub struct Stretched<S: Simd> {
    /// Absolute values of the components, 0..=112.
    absolute: [S::Words; 3],
    /// Values of the same signs.
    signs: [S::Words; 3],
    face: Face<S>,
    /// The greatest absolute component of the gradient itself.
    major: S::Words,
}

/// On which face of the cube directions lie.
#[derive(Clone, Copy, Debug)]
struct Face<S: Simd> {
    is_x: S::Mask,
    not_z: S::Mask,
    number: S::Words,
}

impl<S: Simd> Face<S> {
    /// The face by the greatest absolute component, of equal ones the last.
    #[inline(always)]
    fn new(simd: S, vector: [S::Words; 3], absolute: [S::Words; 3]) -> Self {
        let [x, y, z] = absolute;
        let no_z = simd.greater(simd.max(x, y), z);
        let x_beats_y = simd.greater(x, y);
        let is_x = simd.both(no_z, x_beats_y);
        let x_or_y = simd.select(x_beats_y, vector[0], vector[1]);
        let component = simd.select(no_z, x_or_y, vector[2]);
        let axis = simd.select(x_beats_y, simd.splat(0), simd.splat(2));
        let axis = simd.select(no_z, axis, simd.splat(4));
        let number = simd.add(axis, simd.shift_right::<15>(component));
        Self { is_x, not_z: no_z, number }
    }

    /// The components along u and v: y and z on the faces of x, x and z on those of y, x and y on those of z.
    #[inline(always)]
    fn sides(&self, simd: S, vector: [S::Words; 3]) -> [S::Words; 2] {
        let u = simd.select(self.is_x, vector[1], vector[0]);
        let v = simd.select(self.not_z, vector[2], vector[1]);
        [u, v]
    }

    /// Looks a map up at the point of the face whose coordinates have these absolute values (0..=112) and signs.
    #[inline(always)]
    fn look_up(&self, simd: S, map: &S::Map, absolute: [S::Words; 2], signs: [S::Words; 2]) -> S::Words {
        let half = simd.splat(HALF_FACE as i16);
        let [u, v] = each!([0, 1], |side| simd.add(half, simd.with_sign(absolute[side], signs[side])));
        // SAFETY: faces are 0..=5; 112 and a value of up to 112 of either sign are 0..=224.
        unsafe { simd.reflectance(map, self.number, u, v) }
    }
}

impl<S: Simd> Stretched<S> {
    /// Gradients stretched to the cube; a zero gradient stays zero.
    #[inline(always)]
    pub fn new(simd: S, gradient: [S::Words; 3]) -> Self {
        let absolute = each!([0, 1, 2], |axis| simd.absolute(gradient[axis]));
        let [x, y, z] = absolute;
        let major = simd.max(simd.max(x, y), z);
        let reciprocal = simd.reciprocal_of_gradient(major);
        Self {
            absolute: each!([x, y, z], |it| simd.multiply_round(simd.shift_left::<8>(it), reciprocal)),
            signs: gradient,
            face: Face::new(simd, gradient, absolute),
            major,
        }
    }

    /// Values, but 0 where the gradient is zero.
    #[inline(always)]
    fn lit(&self, simd: S, intensity: S::Words) -> S::Words {
        let zero = simd.splat(0);
        simd.select(simd.greater(self.major, zero), intensity, zero)
    }

    /// Id: the diffuse map in the direction of the gradient.
    #[inline(always)]
    pub fn diffuse(&self, simd: S, map: &S::Map) -> S::Words {
        let absolute = self.face.sides(simd, self.absolute);
        let signs = self.face.sides(simd, self.signs);
        self.lit(simd, self.face.look_up(simd, map, absolute, signs))
    }

    /// Is: the specular map in the direction of the reflected eye vector, none of whose components is negative.
    #[inline(always)]
    pub fn specular(&self, simd: S, map: &S::Map, eye: [S::Words; 3]) -> S::Words {
        let reflected = self.reflect(simd, eye);
        let absolute = each!([0, 1, 2], |axis| simd.absolute(reflected[axis]));
        let [x, y, z] = absolute;
        let reciprocal = reciprocal(simd, simd.max(simd.max(x, y), z));
        let face = Face::new(simd, reflected, absolute);
        let limit = simd.splat(HALF_FACE as i16);
        let [u, v] = face.sides(simd, absolute);
        let coordinates = each!([u, v], |component| {
            let ratio = simd.multiply_high(component, reciprocal);
            // (7 ratio + 64) >> 7
            simd.min(simd.multiply_round(ratio, simd.splat(7 << 8)), limit)
        });
        self.lit(simd, face.look_up(simd, map, coordinates, face.sides(simd, reflected)))
    }

    /// Half the reflection vector ([`crate::stage::reflect::reflect`]).
    #[inline(always)]
    fn reflect(&self, simd: S, eye: [S::Words; 3]) -> [S::Words; 3] {
        let [x, y, z] = each!([0, 1, 2], |axis| {
            let product = simd.multiply_round(simd.shift_left::<7>(self.absolute[axis]), eye[axis]);
            simd.with_sign(product, self.signs[axis])
        });
        let cosine = simd.add(simd.add(x, y), z);
        let half_square = simd.shift_right::<1>(square(simd, self.absolute));
        let steep = simd.absolute(cosine);
        each!([0, 1, 2], |axis| {
            let along = simd.multiply_round(steep, simd.shift_left::<8>(self.absolute[axis]));
            let along = simd.with_sign(simd.with_sign(along, self.signs[axis]), cosine);
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
