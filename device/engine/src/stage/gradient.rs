//! Gradient estimation (paper, section 3.2) by central differences, in permuted axes.
//!
//! Along x and y the differences are those of interpolated samples, along z voxel differences are interpolated.
//! A difference of 4095 over two voxels becomes 127. The multiplier is odd, so no product lies halfway between
//! two results, and rounding half up is exact under flips.

use crate::fixed::round_shift;
use vg500_regs::Permutation;

/// 127 * 2^15 / 4095 / 1.00122, odd; 4095 gives 127 without clamping.
pub const PER_DIFFERENCE: i64 = 1015;

/// Component along permuted x or y from the samples on both sides (12 bits each).
#[must_use]
pub const fn from_samples(before: u16, behind: u16) -> i32 {
    round_shift((behind as i64 - before as i64) * PER_DIFFERENCE, 15) as i32
}

/// Half the difference of the voxels on both sides along z, with three fraction bits; it is interpolated like a
/// voxel. Never beyond 16380, so it fits where voxels fit.
#[must_use]
pub const fn voxel_difference(before: u16, behind: u16) -> i32 {
    (behind as i32 - before as i32) * 4
}

/// Component along permuted z from an interpolated [`voxel_difference`].
#[must_use]
pub const fn from_difference(interpolated: i32) -> i32 {
    round_shift(interpolated as i64 * PER_DIFFERENCE, 17) as i32
}

/// A gradient in object axes.
#[must_use]
pub fn to_object(permuted: [i32; 3], permutation: &Permutation) -> [i32; 3] {
    permutation.to_object(permuted, [0; 3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_sample_differences_are_exact_rounding_and_symmetric() {
        for difference in 0..=4095u16 {
            let component = from_samples(0, difference);
            let exact = f64::from(difference) * 1015.0 / 32768.0;
            assert!((f64::from(component) - exact).abs() < 0.5, "{difference}: no ties");
            assert_eq!(from_samples(difference, 0), -component);
        }
        assert_eq!(from_samples(0, 4095), 127);
        assert_eq!(from_samples(0, 16), 0); // 0.4956
        assert_eq!(from_samples(0, 17), 1); // 0.5266
    }

    #[test]
    fn all_interpolated_differences_are_exact_rounding_and_symmetric() {
        for difference in 0..=16380 {
            let component = from_difference(difference);
            let exact = f64::from(difference) * 1015.0 / 131_072.0;
            assert!((f64::from(component) - exact).abs() < 0.5, "{difference}: no ties");
            assert_eq!(from_difference(-difference), -component);
        }
        assert_eq!(from_difference(voxel_difference(0, 4095)), 127);
        assert_eq!(from_difference(voxel_difference(4095, 0)), -127);
    }

    #[test]
    fn both_ways_agree_on_voxels() {
        for difference in 0..=4095 {
            assert_eq!(from_samples(0, difference), from_difference(voxel_difference(0, difference)));
        }
    }

    #[test]
    fn signs_follow_the_flips() {
        let permutation = Permutation::from_word(0x016).unwrap(); // x = -z, y = y, z = x
        assert_eq!(to_object([1, 2, 3], &permutation), [3, 2, -1]);
    }
}
