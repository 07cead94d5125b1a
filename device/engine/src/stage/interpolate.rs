//! Interpolation (paper, section 3.1): eight voxels become a sample, along z, then y, then x.

use crate::fixed::{GUARDED, WEIGHT, round_shift};

/// `a + (b - a) w / 256`, rounded half up.
///
/// This form is exact under flips although it rounds half up: with the ends exchanged and the weight 256 - w it
/// rounds the same number, (256 - w) a + w b.
#[must_use]
pub const fn lerp(a: i32, b: i32, weight: i32) -> i32 {
    a + round_shift((b - a) as i64 * weight as i64, WEIGHT.fraction) as i32
}

/// Interpolates the values at the corners of a voxel cell.
///
/// `corners[z][y][x]` and the result have the format [`GUARDED`]; `weights` are those along x, y and z, in the
/// format [`WEIGHT`].
#[must_use]
pub fn trilinear(corners: [[[i32; 2]; 2]; 2], weights: [i32; 3]) -> i32 {
    let [x, y, z] = weights;
    let along_z = |row: usize, column: usize| lerp(corners[0][row][column], corners[1][row][column], z);
    let along_y = |column| lerp(along_z(0, column), along_z(1, column), y);
    lerp(along_y(0), along_y(1), x)
}

/// A voxel as it enters interpolation.
#[must_use]
pub const fn guard(voxel: u16) -> i32 {
    (voxel as i32) << GUARDED.fraction
}

/// An interpolated value as a sample, rounded to 12 bits.
#[must_use]
pub const fn unguard(value: i32) -> u16 {
    round_shift(value as i64, GUARDED.fraction) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn hand_worked() {
        assert_eq!(lerp(0, 8, 128), 4);
        assert_eq!(lerp(0, 1, 128), 1); // 0.5 goes up
        assert_eq!(lerp(1, 0, 128), 1); // and so does the same number from the other side
        assert_eq!(lerp(0, 32760, 255), 32632); // 32632.03
        assert_eq!(unguard(4), 1); // 0.5
        assert_eq!(unguard(3), 0);
        let corners = [[[0, 8], [16, 24]], [[32, 40], [48, 56]]]; // 8x + 16y + 32z
        assert_eq!(trilinear(corners, [128, 64, 192]), 4 + 4 + 24);
    }

    #[test]
    fn weight_zero_is_the_voxel_itself() {
        for voxel in 0..=4095 {
            let value = guard(voxel);
            assert_eq!(unguard(trilinear([[[value, 9], [9, 9]], [[9, 9], [9, 9]]], [0; 3])), voxel);
        }
    }

    proptest! {
        #[test]
        fn flips_are_exact(a in 0..=4095u16, b in 0..=4095u16, weight in 1..=255) {
            let (a, b) = (guard(a), guard(b));
            prop_assert_eq!(lerp(a, b, weight), lerp(b, a, 256 - weight));
        }

        #[test]
        fn samples_stay_within_their_voxels(voxels: [[[u16; 2]; 2]; 2], weights in [0..=255i32, 0..=255, 0..=255]) {
            let voxels = voxels.map(|slice| slice.map(|row| row.map(|voxel| voxel & 4095)));
            let flat = voxels.iter().flatten().flatten();
            let sample = unguard(trilinear(voxels.map(|slice| slice.map(|row| row.map(guard))), weights));
            prop_assert!(sample >= *flat.clone().min().unwrap() && sample <= *flat.max().unwrap());
        }
    }
}
