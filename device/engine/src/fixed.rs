//! The roundings between the number formats of the pipeline.
//!
//! Everything is an integer. Where a value is rounded, half goes up (`(x + half) >> bits`); the places where that
//! matters for the exactness of flipped volumes say why it does not.

pub use vg500_regs::number::{
    BODY, COLOR, COSINE, CUT_FACTOR, FORMATS, GRADIENT, GUARDED, MAGNITUDE, MAP_WEIGHT, POSITION, SUM, UNITY,
    VALUE, WEIGHT,
};

/// Fraction bits of [`POSITION`].
pub const POSITION_BITS: u32 = POSITION.fraction;
/// One voxel as a position.
pub const ONE_VOXEL: i64 = 1 << POSITION_BITS;
/// Full opacity, full colour.
pub const FULL: u16 = 4095;

/// `value / 2^bits`, rounded to nearest, half up.
#[must_use]
pub const fn round_shift(value: i64, bits: u32) -> i64 {
    (value + (1 << (bits - 1))) >> bits
}

/// The used position of an accumulated one: from 22 to 8 fraction bits.
#[must_use]
pub const fn used_position(accumulated: i64) -> i64 {
    round_shift(accumulated, vg500_regs::number::RAY_POSITION.fraction - POSITION_BITS)
}

/// An 8-bit factor as [`UNITY`].
#[must_use]
pub const fn unity(factor: u8) -> u16 {
    ((factor as u16) << 7) | ((factor as u16) >> 1)
}

/// A 12-bit value times a [`UNITY`] factor, rounded to 12 bits.
#[must_use]
pub const fn scale(value: u16, factor: u16) -> u16 {
    round_shift(value as i64 * factor as i64, UNITY.fraction) as u16
}

/// The product of two [`COLOR`] values.
#[must_use]
pub const fn product(a: u16, b: u16) -> u16 {
    round_shift(a as i64 * b as i64, COLOR.fraction) as u16
}

/// An 8-bit colour as [`COLOR`], by replication.
#[must_use]
pub const fn widen(color: u8) -> u16 {
    ((color as u16) << 4) | (color as u16 >> 4)
}

/// A [`COLOR`] value as 8 bits: round(255 x / 4095).
#[must_use]
pub const fn narrow(color: u16) -> u8 {
    ((color as u32 * 4081 + 32768) >> 16) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn narrowing_is_exact_rounding() {
        for color in 0..=4095u16 {
            let exact = (f64::from(color) * 255.0 / 4095.0).round();
            assert_eq!(f64::from(narrow(color)), exact, "{color}");
        }
    }

    #[test]
    fn eight_bit_colors_survive_widening() {
        for color in 0..=255u8 {
            assert_eq!(narrow(widen(color)), color);
        }
        assert_eq!(widen(255), FULL);
    }

    #[test]
    fn the_greatest_factor_is_one_and_the_least_is_zero() {
        for value in 0..=FULL {
            assert_eq!(scale(value, unity(255)), value);
            assert_eq!(scale(value, unity(0)), 0);
        }
    }

    #[test]
    fn factors_are_monotone_and_within_half_a_step_of_their_meaning() {
        for factor in 1..=255u8 {
            assert!(unity(factor) > unity(factor - 1));
        }
        for factor in 0..=255u8 {
            let meant = f64::from(factor) / 255.0;
            assert!((f64::from(unity(factor)) / 32768.0 - meant).abs() <= 1.0 / 512.0);
        }
    }

    #[test]
    fn all_products_of_twelve_bits_are_rounded_exactly() {
        for a in 0..=FULL {
            for b in a..=FULL {
                let exact = u32::from(a) * u32::from(b);
                let found = u32::from(product(a, b));
                // Twice the distance from the exact product, in 1/4096; a half goes up.
                let off = 2 * (i64::from(found) * 4096 - i64::from(exact));
                assert!(-4096 < off && off <= 4096, "{a} x {b}: {found}");
                assert_eq!(product(b, a), product(a, b));
            }
        }
        assert_eq!(product(64, 32), 1); // 0.5
        assert_eq!(product(2047, 1), 0); // 0.49976
        assert_eq!(product(FULL, FULL), 4094); // 4094.0002
    }

    #[test]
    fn all_products_with_factors_are_rounded_exactly() {
        for factor in 0..=255 {
            for value in 0..=FULL {
                let exact = f64::from(value) * f64::from(unity(factor)) / 32768.0;
                assert_eq!(f64::from(scale(value, unity(factor))), (exact + 0.5).floor(), "{value} {factor}");
            }
        }
    }

    #[test]
    fn positions_round_to_nearest() {
        assert_eq!(used_position(1 << 22), 256);
        assert_eq!(used_position(-(1 << 22)), -256);
        assert_eq!(used_position((1 << 13) - 1), 0);
        assert_eq!(used_position(1 << 13), 1);
        assert_eq!(used_position(-(1 << 13)), 0);
        assert_eq!(used_position(-(1 << 13) - 1), -1);
    }
}
