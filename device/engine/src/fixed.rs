//! Number formats of the pipeline, and the roundings between them.
//!
//! Everything is an integer. Where a value is rounded, half goes up (`(x + half) >> bits`); the places where that
//! matters for the exactness of flipped volumes say why it does not.

use vg500_regs::number::NumberFormat;

/// Voxel and sample value.
pub const VALUE: NumberFormat = NumberFormat {
    name: "U12.0",
    signed: false,
    bits: 12,
    fraction: 0,
    note: "voxels and interpolated samples (paper, section 3.1: all voxel datapaths are 12 bits wide, samples are \
           rounded to 12 bits); cannot overflow, interpolation never leaves the range of its voxels",
};

/// Voxel value inside of interpolation.
pub const GUARDED: NumberFormat = NumberFormat {
    name: "S12.3",
    signed: true,
    bits: 16,
    fraction: 3,
    note: "values and differences between the three interpolations; our choice: three guard bits are the most that \
           leave differences in 16 bits",
};

/// Position of a sample.
pub const POSITION: NumberFormat = NumberFormat {
    name: "S10.8",
    signed: true,
    bits: 19,
    fraction: 8,
    note: "voxels; rounded to nearest from 22 fraction bits for each sample slice, never accumulated",
};

/// Interpolation weight.
pub const WEIGHT: NumberFormat = NumberFormat {
    name: "U0.8",
    signed: false,
    bits: 8,
    fraction: 8,
    note: "fraction of a position; always below 1",
};

/// Gradient component.
pub const GRADIENT: NumberFormat = NumberFormat {
    name: "S7.0",
    signed: true,
    bits: 8,
    fraction: 0,
    note: "-127..=127 (paper, section 3.2); a difference of 4095 over two voxels gives 127; the odd multiplier 1015 \
           leaves no ties, so rounding is symmetric",
};

/// Gradient magnitude.
pub const MAGNITUDE: NumberFormat = NumberFormat {
    name: "U8.0",
    signed: false,
    bits: 8,
    fraction: 0,
    note: "0..=220 (paper, section 3.3), the rounded square root",
};

/// Colour and opacity from classification on.
pub const COLOR: NumberFormat = NumberFormat {
    name: "U0.12",
    signed: false,
    bits: 12,
    fraction: 12,
    note: "0..=4095 stands for 0..=1 (paper, section 3.6: 12 bits for opacity, accumulators and all intermediate \
           compositing values); 8-bit colours are widened by replication",
};

/// A factor widened so that its greatest value is an exact one.
pub const UNITY: NumberFormat = NumberFormat {
    name: "U0.15",
    signed: false,
    bits: 15,
    fraction: 15,
    note: "(v << 7) | (v >> 1) of an 8-bit factor: 255 becomes 32767, which is the identity on 12 bits after \
           rounding; our choice, v << 7 would darken by 1/256",
};

/// Sum of a weighted-sum ray.
pub const SUM: NumberFormat = NumberFormat {
    name: "U15.12",
    signed: false,
    bits: 27,
    fraction: 12,
    note: "sum of at most 32768 values of 12 bits; an extension for the weighted sum of the course slides",
};

/// Formats of the pipeline, in its order.
pub const FORMATS: [(&str, NumberFormat); 9] = [
    ("voxel, sample", VALUE),
    ("interpolation", GUARDED),
    ("sample position", POSITION),
    ("weight", WEIGHT),
    ("gradient component", GRADIENT),
    ("gradient magnitude", MAGNITUDE),
    ("color, opacity, accumulators", COLOR),
    ("factor", UNITY),
    ("weighted sum", SUM),
];

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
    fn positions_round_to_nearest() {
        assert_eq!(used_position(1 << 22), 256);
        assert_eq!(used_position(-(1 << 22)), -256);
        assert_eq!(used_position((1 << 13) - 1), 0);
        assert_eq!(used_position(1 << 13), 1);
        assert_eq!(used_position(-(1 << 13)), 0);
        assert_eq!(used_position(-(1 << 13) - 1), -1);
    }
}
