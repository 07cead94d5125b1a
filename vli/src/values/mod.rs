//! From samples in their own type and units to the card's voxels, and back from the entries of the card's lookup
//! table to data values.

mod histogram;

pub use histogram::Histogram;

use crate::Voxels;
use crate::file::{Scalar, ScalarType, ScalarVolume, with_samples};
use crate::text::number;
use std::fmt;
use vg500_regs::VoxelFormat;

/// Greatest value of a 12-bit voxel.
const FULL: f64 = 4095.0;

/// Why samples cannot become voxels.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// A sample that is no number.
    #[error("voxel ({i}, {j}, {k}) is {value}; --nan VALUE would replace such values",
        i = place[0], j = place[1], k = place[2])]
    NotFinite {
        /// Which one: the first in memory.
        place: [usize; 3],
        /// NaN or infinite.
        value: f64,
    },
    /// A range that is none.
    #[error("range {},{}: two finite numbers are wanted, the lower one first", number(*.0), number(*.1))]
    Range(f64, f64),
}

/// How data values become the voxels of the card.
///
/// Samples of 8 bits are kept, and integers that are all within 0..=4095 too, as 12-bit voxels; all else is scaled
/// so that the range becomes 0..=4095.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueMapping {
    scalar: ScalarType,
    data_range: [f64; 2],
    range: [f64; 2],
    format: VoxelFormat,
    is_scaled: bool,
}

impl ValueMapping {
    /// The mapping of a volume's samples. `range` is which values become 0 and 4095, where they are scaled; it
    /// defaults to the least and the greatest.
    ///
    /// # Errors
    /// A sample is NaN or infinite, or the range is none.
    pub fn new(volume: &ScalarVolume, range: Option<[f64; 2]>) -> Result<Self, ValueError> {
        let samples = volume.samples();
        if let Some(index) = samples.first_not_finite() {
            let value = samples.value(index).unwrap_or(f64::NAN);
            return Err(ValueError::NotFinite { place: volume.place(index), value });
        }
        let data_range = with_samples!(samples, values => least_and_greatest(values));
        let [low, high] = range.unwrap_or(data_range);
        if !(low.is_finite() && high.is_finite() && low <= high) {
            return Err(ValueError::Range(low, high));
        }
        let scalar = samples.scalar_type();
        let integer = !matches!(scalar, ScalarType::Float32 | ScalarType::Float64);
        let kept = integer && data_range[0] >= 0.0 && data_range[1] <= FULL;
        let format = if scalar == ScalarType::Uint8 { VoxelFormat::Uint8 } else { VoxelFormat::Uint12Lower };
        Ok(Self { scalar, data_range, range: [low, high], format, is_scaled: !kept })
    }

    /// The least and the greatest data value.
    #[must_use]
    pub const fn data_range(&self) -> [f64; 2] {
        self.data_range
    }

    /// The data values between which grey and presets extend, and which become 0 and 4095 where values are scaled:
    /// those asked for, else the least and the greatest.
    #[must_use]
    pub const fn range(&self) -> [f64; 2] {
        self.range
    }

    /// Whether values are scaled to the range, not kept.
    #[must_use]
    pub const fn is_scaled(&self) -> bool {
        self.is_scaled
    }

    /// The card's voxels of a volume, which is the one that the mapping was made for.
    #[must_use]
    pub fn voxels(&self, volume: &ScalarVolume) -> Voxels {
        with_samples!(volume.samples(), values => match (self.is_scaled, self.format) {
            (false, VoxelFormat::Uint8) => {
                Voxels::Uint8(values.iter().map(|&value| Scalar::to_f64(value) as u8).collect())
            }
            (false, _) => Voxels::Uint12Lower(values.iter().map(|&value| Scalar::to_f64(value) as u16).collect()),
            (true, _) => {
                let voxel = |&value| scaled(Scalar::to_f64(value), self.range);
                Voxels::Uint12Lower(values.iter().map(voxel).collect())
            }
        })
    }

    /// The data value that an entry of the card's lookup table (0..=4095) stands for.
    #[must_use]
    pub fn value(&self, entry: u16) -> f64 {
        self.value_between(f64::from(entry))
    }

    /// As [`Self::value`], between entries as well.
    #[must_use]
    pub fn value_between(&self, entry: f64) -> f64 {
        let [low, high] = self.range;
        let width = high - low;
        match (self.is_scaled, self.format) {
            // The card shifts 8-bit voxels by four bits.
            (false, VoxelFormat::Uint8) => entry / 16.0,
            (false, _) => entry,
            (true, _) if (width * entry).is_finite() => low + width * entry / FULL,
            (true, _) => low * ((FULL - entry) / FULL) + high * (entry / FULL),
        }
    }
}

impl fmt::Display for ValueMapping {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [least, greatest] = self.data_range.map(number);
        let [low, high] = self.range.map(number);
        match self.data_range[0] == self.data_range[1] {
            true => write!(formatter, "all values are {least} ({}); they ", self.scalar)?,
            false => write!(formatter, "values {least} to {greatest} ({}) ", self.scalar)?,
        }
        match (self.is_scaled, self.format) {
            (false, VoxelFormat::Uint8) => write!(formatter, "are kept as 8-bit voxels"),
            (false, _) => write!(formatter, "are kept as 12-bit voxels"),
            (true, _) if low == high => {
                write!(formatter, "become 12-bit voxels of 0: the range is {low} alone")
            }
            (true, _) => write!(formatter, "become 12-bit voxels: {low} is 0, {high} is 4095"),
        }
    }
}

fn least_and_greatest<T: Scalar>(values: &[T]) -> [f64; 2] {
    let [mut least, mut greatest] = [values.first().copied(); 2];
    for &value in values {
        least = least.filter(|&least| least <= value).or(Some(value));
        greatest = greatest.filter(|&greatest| greatest >= value).or(Some(value));
    }
    [least, greatest].map(|value| value.map_or(0.0, Scalar::to_f64))
}

/// How far a value is on the way between the ends of a range, which differ: 0 at the lower one, 1 at the upper one.
pub(crate) fn part_of_range(value: f64, [low, high]: [f64; 2]) -> f64 {
    // Halves do not overflow, but tiny numbers have none.
    let factor = if (high - low).is_finite() { 1.0 } else { 0.5 };
    (value * factor - low * factor) / (high * factor - low * factor)
}

/// round((v - low) / (high - low) * 4095), clamped; 0 where low = high.
fn scaled(value: f64, range: [f64; 2]) -> u16 {
    if range[0] == range[1] {
        return 0;
    }
    let scaled = part_of_range(value, range).clamp(0.0, 1.0) * FULL;
    let whole = scaled as u16;
    // Exact, unlike adding a half, and faster than a function.
    whole + u16::from(scaled - f64::from(whole) >= 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::{Geometry, Samples};
    use proptest::prelude::*;

    fn volume(samples: impl Into<Samples>) -> ScalarVolume {
        let samples = samples.into();
        ScalarVolume::new([samples.len(), 1, 1], samples, Geometry::from_spacing([1.0; 3])).unwrap()
    }

    fn map(samples: impl Into<Samples>, range: Option<[f64; 2]>) -> (Voxels, ValueMapping) {
        let volume = volume(samples);
        let mapping = ValueMapping::new(&volume, range).unwrap();
        (mapping.voxels(&volume), mapping)
    }

    fn twelve_bits(samples: impl Into<Samples>, range: Option<[f64; 2]>) -> Vec<u16> {
        match map(samples, range).0 {
            Voxels::Uint12Lower(voxels) => voxels.to_vec(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn samples_that_are_no_numbers_name_the_first() {
        let samples = vec![0.0, 1.0, 2.0, 3.0, 4.0, f64::NEG_INFINITY, f64::NAN, 7.0];
        let mut volume =
            ScalarVolume::new([2, 2, 2], samples.into(), Geometry::from_spacing([1.0; 3])).unwrap();
        let error = ValueMapping::new(&volume, Some([0.0, 1.0])).unwrap_err().to_string();
        assert_eq!(error, "voxel (1, 0, 1) is -inf; --nan VALUE would replace such values");
        volume.replace_not_finite(-7.0);
        assert_eq!(ValueMapping::new(&volume, None).unwrap().range(), [-7.0, 7.0]);
    }

    #[test]
    fn ranges_that_are_none_are_refused() {
        let volume = volume(vec![1_u8]);
        for range in [[1.0, 0.0], [f64::NAN, 1.0], [0.0, f64::INFINITY]] {
            let error = ValueMapping::new(&volume, Some(range)).unwrap_err().to_string();
            assert!(error.starts_with("range "), "{error}");
        }
    }

    #[test]
    fn eight_bits_are_kept() {
        let (voxels, mapping) = map(vec![3_u8, 200, 255], Some([10.0, 20.0]));
        assert!(matches!(voxels, Voxels::Uint8(voxels) if *voxels == [3, 200, 255]));
        assert_eq!((mapping.data_range(), mapping.range()), ([3.0, 255.0], [10.0, 20.0]));
        assert_eq!(
            [0, 8, 16, 4080, 4095].map(|entry| mapping.value(entry)),
            [0.0, 0.5, 1.0, 255.0, 255.9375]
        );
        assert_eq!(mapping.to_string(), "values 3 to 255 (uint8) are kept as 8-bit voxels");
    }

    #[test]
    fn integers_of_twelve_bits_are_kept() {
        assert_eq!(twelve_bits(vec![0_i16, 4095], Some([0.0, 1.0])), [0, 4095]);
        assert_eq!(twelve_bits(vec![5_u64, 7], None), [5, 7]);
        assert_eq!(twelve_bits(vec![5_i8, 127], None), [5, 127]);
        let (_, mapping) = map(vec![2_i32, 3000], None);
        assert_eq!([0, 1, 4095].map(|entry| mapping.value(entry)), [0.0, 1.0, 4095.0]);
        assert_eq!(mapping.to_string(), "values 2 to 3000 (int32) are kept as 12-bit voxels");
    }

    #[test]
    fn all_else_is_scaled() {
        // One beyond either end is enough.
        assert_eq!(twelve_bits(vec![-1_i16, 0, 4094], None), [0, 1, 4095]);
        assert_eq!(twelve_bits(vec![0_u16, 2048, 4096], None), [0, 2048, 4095]);
        // 1/4095 * 0.5 rounds up, just below it does not.
        assert_eq!(twelve_bits(vec![0.0_f64, 0.5, 0.499_999, 1.5, 4095.0], None), [0, 1, 0, 2, 4095]);
        assert_eq!(twelve_bits(vec![-3.0_f32, 0.25, 9.0], Some([0.0, 1.0])), [0, 1024, 4095]);
        assert_eq!(twelve_bits(vec![i64::MIN, 0, i64::MAX], None), [0, 2048, 4095]);
        assert_eq!(twelve_bits(vec![-f64::MAX, 0.0, f64::MAX], None), [0, 2048, 4095]);
        assert_eq!(twelve_bits(vec![0.0, 5e-324], None), [0, 4095]);
        let (_, mapping) = map(vec![-1000_i16, 3095], None);
        assert_eq!([0, 1000, 4095].map(|entry| mapping.value(entry)), [-1000.0, 0.0, 3095.0]);
        assert_eq!(
            mapping.to_string(),
            "values -1000 to 3095 (int16) become 12-bit voxels: -1000 is 0, 3095 is 4095"
        );
        let (_, mapping) = map(vec![-f64::MAX, f64::MAX], None);
        assert_eq!([0, 4095].map(|entry| mapping.value(entry)), [-f64::MAX, f64::MAX]);
        assert!(mapping.to_string().len() < 150, "{mapping}");
    }

    #[test]
    fn a_single_value_becomes_zero() {
        assert_eq!(twelve_bits(vec![5.5_f32, 5.5], None), [0, 0]);
        assert_eq!(twelve_bits(vec![-2_i8, 7], Some([3.0, 3.0])), [0, 0]);
        let (_, mapping) = map(vec![5.5_f32], None);
        assert_eq!([mapping.value(0), mapping.value(4095)], [5.5, 5.5]);
        assert_eq!(
            mapping.to_string(),
            "all values are 5.5 (float); they become 12-bit voxels of 0: the range is 5.5 alone"
        );
    }

    proptest! {
        #[test]
        fn table_entries_stand_for_the_values_that_reach_them(
            values in prop::collection::vec(-1e6..1e6_f64, 2..50),
        ) {
            let [least, greatest] = least_and_greatest(&values);
            prop_assume!(greatest - least > 1e-3);
            let (voxels, mapping) = map(values.clone(), None);
            let Voxels::Uint12Lower(voxels) = voxels else { panic!("scaled") };
            let step = (greatest - least) / 4095.0;
            for (value, voxel) in values.iter().zip(voxels.iter()) {
                let away = (mapping.value(*voxel) - value).abs();
                prop_assert!(away <= 0.5 * step * (1.0 + 1e-9), "{away} of {step}");
            }
        }

        #[test]
        fn rounding_is_that_of_the_definition(
            low in -1e3..1e3_f64, width in 1e-3..1e3_f64, value in -3e3..3e3_f64,
        ) {
            let wanted = ((value - low) / (low + width - low)).clamp(0.0, 1.0) * 4095.0;
            prop_assert_eq!(f64::from(scaled(value, [low, low + width])), wanted.round());
        }
    }
}
