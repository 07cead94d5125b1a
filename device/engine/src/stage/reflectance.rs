//! Reflectance maps (paper, section 3.5): a cube of six faces, indexed by an unnormalised vector in object axes,
//! bilinear between 8 x 8 vertices per face.
//!
//! [`vg500_regs::reflectance`] says which direction an entry stands for. After un-permutation every rounding is on
//! absolute values, so that a mirrored vector meets a mirrored map exactly.

use crate::fixed::{MAP_WEIGHT, round_shift};
use vg500_regs::reflectance::{FACE, VERTICES, face_axes};

/// Half a face in map coordinates: cells are 32 wide, seven of them are 224.
pub const HALF_FACE: i32 = 112;
const CELL: i32 = 1 << MAP_WEIGHT.fraction;

/// A direction on the cube: the major component is +-112, the others lie between.
pub type CubeVector = [i32; 3];

/// Axis of the component of largest absolute value; of equal ones the last.
#[must_use]
pub fn major_axis(vector: [i32; 3]) -> usize {
    let [x, y, z] = vector.map(i32::abs);
    if z >= x && z >= y {
        2
    } else if y >= x {
        1
    } else {
        0
    }
}

/// A gradient (components in -127..=127, not all zero) stretched to the cube: each component times
/// round(14336 / major) / 128, rounded half away from zero.
#[must_use]
pub fn cube_vector(gradient: [i32; 3]) -> CubeVector {
    let major = gradient[major_axis(gradient)].abs();
    if major == 0 {
        return [0; 3];
    }
    let reciprocal = (2 * 128 * HALF_FACE + major) / (2 * major);
    gradient
        .map(|component| round_shift(i64::from(component.abs() * reciprocal), 7) as i32 * component.signum())
}

/// Looks a direction up. Returns an intensity in U0.15; a map entry of 255 becomes 32767, an exact one.
///
/// Both interpolations are exact in 16-bit lanes: rows are products of 8 and 5 bits, and each row times its
/// weight is truncated to 1/128 of an entry before the two are added.
#[must_use]
pub fn look_up(map: &[u8], vector: CubeVector) -> u16 {
    let axis = major_axis(vector);
    let face = 2 * axis + usize::from(vector[axis] < 0);
    let [u, v] = face_axes(axis).map(|axis| Cell::new(vector[axis]));
    let entry = |row: usize, column: usize| {
        i32::from(map[face * FACE + (v.first + row) * VERTICES + u.first + column])
    };
    let along_u = |row| entry(row, 0) * (CELL - u.weight) + entry(row, 1) * u.weight;
    let intensity = along_u(0) * (CELL - v.weight) / 8 + along_u(1) * v.weight / 8;
    (intensity + (intensity >> 8)) as u16
}

/// A cell of a face along one axis.
struct Cell {
    first: usize,
    weight: i32,
}

impl Cell {
    /// The cell of a coordinate in -112..=112.
    fn new(coordinate: i32) -> Self {
        let position = coordinate + HALF_FACE;
        let first = (position / CELL).min(VERTICES as i32 - 2);
        Self { first: first as usize, weight: position - first * CELL }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg500_regs::limit::REFLECTANCE_ENTRIES;

    /// Every gradient but the one that is zero.
    fn gradients() -> impl Iterator<Item = [i32; 3]> {
        let values = || -127..=127;
        let all = values().flat_map(move |x| values().flat_map(move |y| values().map(move |z| [x, y, z])));
        all.filter(|gradient| *gradient != [0; 3])
    }

    #[test]
    fn ties_go_to_the_last_axis() {
        assert_eq!(major_axis([5, -5, 5]), 2);
        assert_eq!(major_axis([5, -5, 4]), 1);
        assert_eq!(major_axis([5, 4, -4]), 0);
    }

    #[test]
    fn cube_vectors_reach_the_face_and_stay_on_it() {
        for gradient in gradients() {
            let vector = cube_vector(gradient);
            let axis = major_axis(gradient);
            assert_eq!(vector[axis].abs(), HALF_FACE, "{gradient:?}");
            for (component, part) in vector.iter().zip(gradient) {
                let exact = f64::from(part) * 112.0 / f64::from(gradient[axis].abs());
                assert!((f64::from(*component) - exact).abs() <= 1.0, "{gradient:?}");
                assert!(component.abs() <= HALF_FACE);
            }
        }
    }

    #[test]
    fn vertices_give_their_entry_and_full_is_one() {
        let map: Vec<u8> = (0..REFLECTANCE_ENTRIES).map(|entry| (entry * 7 % 256) as u8).collect();
        for v in 0..8 {
            for u in 0..8 {
                // +y face: u along x, v along z
                let entry = map[2 * 64 + 8 * v + u];
                let look = look_up(&map, [32 * u as i32 - 112, 112, 32 * v as i32 - 112]);
                let corner_belongs_to_z = v == 0 || v == 7;
                if !corner_belongs_to_z {
                    assert_eq!(look, crate::fixed::unity(entry), "{u} {v}");
                }
            }
        }
        assert_eq!(look_up(&[255; REFLECTANCE_ENTRIES], [13, -112, 57]), 32767);
    }

    /// Every place of every face, against interpolation without rounding.
    #[test]
    fn interpolation_is_within_its_stated_error() {
        let map: Vec<u8> = (0..REFLECTANCE_ENTRIES).map(|entry| (entry * 37 % 256) as u8).collect();
        let place = |c: i32| {
            let cell = ((c + 112) / 32).min(6);
            (cell as usize, f64::from(c + 112 - 32 * cell) / 32.0)
        };
        for (face, u, v) in
            (0..6).flat_map(|face| (-112..=112).flat_map(move |u| (-112..=112).map(move |v| (face, u, v))))
        {
            let mut vector = [0; 3];
            let [across, down] = face_axes(face / 2);
            (vector[across], vector[down]) = (u, v);
            vector[face / 2] = if face % 2 == 0 { 112 } else { -112 };
            if major_axis(vector) != face / 2 {
                continue; // An edge that belongs to another face.
            }
            let ((column, wu), (row, wv)) = (place(u), place(v));
            let entry = |r: usize, c: usize| f64::from(map[face * FACE + (row + r) * VERTICES + column + c]);
            let along = |r| entry(r, 0) * (1.0 - wu) + entry(r, 1) * wu;
            let exact = (along(0) * (1.0 - wv) + along(1) * wv) / 255.0;
            let found = f64::from(look_up(&map, vector)) / 32767.0;
            // Two truncations of 1/128 of an entry of 255, and the step of U0.15.
            let bound = 2.0 / 128.0 / 255.0 + 2.0 / 32768.0;
            assert!((found - exact).abs() <= bound, "{vector:?}: {found} {exact}");
        }
    }

    /// Every gradient's way through magnitude, face and map: each finds the face of its longest component.
    #[test]
    fn all_gradients_find_their_place_in_the_maps() {
        let map: Vec<u8> = (0..REFLECTANCE_ENTRIES).map(|entry| 40 * (1 + entry / FACE) as u8).collect();
        for gradient in gradients() {
            let magnitude = crate::stage::magnitude::magnitude(gradient);
            assert!((1..=220).contains(&magnitude), "{gradient:?}");
            let axis = (0..3).rev().max_by_key(|&axis| (gradient[axis].abs(), axis)).unwrap_or(0);
            let face = 2 * axis + usize::from(gradient[axis] < 0);
            let vector = cube_vector(gradient);
            assert_eq!(vector[axis], HALF_FACE * gradient[axis].signum());
            if vector.iter().filter(|component| component.abs() == HALF_FACE).count() > 1 {
                continue; // On an edge of the cube, whose entries both faces share.
            }
            let found = look_up(&map, vector);
            assert_eq!(found, crate::fixed::unity(map[face * FACE]), "{gradient:?}");
        }
    }

    #[test]
    fn mirrored_vectors_meet_mirrored_maps_exactly() {
        let map: Vec<u8> = (0..REFLECTANCE_ENTRIES).map(|entry| (entry * 91 % 256) as u8).collect();
        let mut mirrored = map.clone(); // x is negated: faces +x and -x change places, u runs backwards on the rest
        mirrored[..128].rotate_left(64);
        mirrored[128..].chunks_mut(8).for_each(<[u8]>::reverse);
        for gradient in gradients() {
            let [x, y, z] = gradient;
            let flipped = cube_vector([-x, y, z]);
            assert_eq!(look_up(&map, cube_vector(gradient)), look_up(&mirrored, flipped), "{gradient:?}");
        }
    }
}
