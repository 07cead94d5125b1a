//! Reflection vector (paper, section 3.5): R = 2 (g . e) g - (g . g) e, from gradient and eye vector in object
//! axes.
//!
//! It is computed from the gradient as stretched to the cube, n, with a major component of 112; so |R| = |n|^2
//! lies within a factor of three, and 16-bit lanes hold every step. Roundings are half away from zero.

use super::reflectance::{CubeVector, HALF_FACE, major_axis};
use crate::fixed::COSINE;
use vg500_regs::number::EYE;

/// Half the reflection vector, |n|^2 / 2 long, for a cube vector and the eye vector in S0.15.
#[must_use]
pub fn reflect(vector: CubeVector, eye: [i16; 3]) -> [i32; 3] {
    let eye = eye.map(i32::from);
    // n . e with seven fraction bits: at most 112 sqrt(3) 128 = 24831.
    let cosine: i32 =
        (0..3).map(|axis| rounded(vector[axis] * eye[axis], EYE.fraction - COSINE.fraction)).sum();
    let half_square = vector.iter().map(|component| component * component).sum::<i32>() / 2;
    [0, 1, 2].map(|axis| {
        rounded(cosine * vector[axis], COSINE.fraction) - rounded(half_square * eye[axis], EYE.fraction)
    })
}

/// `value / 2^bits`, rounded half away from zero.
const fn rounded(value: i32, bits: u32) -> i32 {
    ((value.abs() + (1 << (bits - 1))) >> bits) * value.signum()
}

/// A vector from [`reflect`] stretched to the cube.
///
/// The reciprocal of the major component (3600..=18820) is a seed for each 256 values and one Newton step, all
/// in 16 bits: seed = round(2^27 / middle), q = seed + seed (4096 - 2 major seed / 2^16) / 4096.
#[must_use]
pub fn stretch(reflected: [i32; 3]) -> CubeVector {
    let axis = major_axis(reflected);
    let major = reflected[axis].abs();
    let middle = (major >> 8 << 8) + 128;
    let seed = ((1 << 28) + middle) / (2 * middle);
    let error = 4096 - ((i64::from(2 * major) * i64::from(seed)) >> 16) as i32;
    let reciprocal = seed + rounded_up((seed >> 1) * (error << 4), 15);
    let mut vector = reflected.map(|component| {
        let ratio = ((i64::from(component.abs()) * i64::from(reciprocal)) >> 16) as i32;
        ((ratio * 7 + 64) >> 7).min(HALF_FACE) * component.signum()
    });
    vector[axis] = HALF_FACE * reflected[axis].signum();
    vector
}

/// `value / 2^bits`, rounded half up.
const fn rounded_up(value: i32, bits: u32) -> i32 {
    (value + (1 << (bits - 1))) >> bits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::reflectance::cube_vector;
    use proptest::prelude::*;

    fn direction() -> impl Strategy<Value = [f64; 3]> {
        [-1.0..1.0f64, -1.0..1.0, -1.0..1.0].prop_filter_map("not too short", |vector| {
            let length = vector.iter().map(|c| c * c).sum::<f64>().sqrt();
            (length > 0.1).then(|| vector.map(|c| c / length))
        })
    }

    #[test]
    fn hand_worked() {
        // Head-on: the reflection of the eye in a surface that faces it is the eye.
        let reflected = reflect([0, 0, 112], [0, 0, 32767]);
        assert_eq!(reflected, [0, 0, 6272]); // 112^2 / 2
        assert_eq!(stretch(reflected), [0, 0, 112]);
        // A surface at 45 degrees sends it aside.
        let reflected = reflect([112, 0, 112], [0, 0, 32767]);
        assert_eq!(reflected, [12544, 0, 0]);
        assert_eq!(stretch(reflected), [112, 0, 0]);
    }

    #[test]
    fn every_major_component_gives_a_good_ratio() {
        for major in 3600..=18820 {
            for part in [0, major / 7, major / 3, major / 2, major * 5 / 7, major - 1, major] {
                let [component, _, face] = stretch([part, 0, -major]);
                assert_eq!(face, -112);
                let exact = 112.0 * f64::from(part) / f64::from(major);
                assert!((f64::from(component) - exact).abs() <= 1.0, "{part} / {major}: {component} {exact}");
            }
        }
    }

    proptest! {
        #[test]
        fn reflections_are_those_of_geometry(gradient in [-127..=127i32, -127..=127, -127..=127], eye in direction()) {
            prop_assume!(gradient != [0; 3]);
            let word = eye.map(|c| (c * 32768.0).round().clamp(-32767.0, 32767.0) as i16);
            let n = cube_vector(gradient);
            let reflected = reflect(n, word);
            let [n, e] = [n.map(f64::from), word.map(|c| f64::from(c) / 32768.0)];
            let dot: f64 = (0..3).map(|axis| n[axis] * e[axis]).sum();
            let square: f64 = n.iter().map(|c| c * c).sum();
            for axis in 0..3 {
                let exact = dot * n[axis] - square / 2.0 * e[axis];
                // Three roundings of n . e to 1/128 times 112, two of the products, half of an odd square.
                prop_assert!((f64::from(reflected[axis]) - exact).abs() <= 3.0 / 256.0 * 112.0 + 1.0 + 0.5);
            }
            let major = reflected[major_axis(reflected)].abs();
            prop_assert!((3600..=18820).contains(&major), "{major}");
        }

        #[test]
        fn mirrored_scenes_have_mirrored_reflections(gradient in [-127..=127i32, -127..=127, -127..=127], eye: [i16; 3]) {
            prop_assume!(gradient != [0; 3]);
            let eye = eye.map(|c| c / 2);
            let [x, y, z] = reflect(cube_vector(gradient), eye);
            let mirrored = reflect(cube_vector([-gradient[0], gradient[1], gradient[2]]), [-eye[0], eye[1], eye[2]]);
            prop_assert_eq!(mirrored, [-x, y, z]);
        }
    }
}
