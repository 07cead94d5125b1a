use vg500_regs::limit;

use super::GeometryError;
use super::error::AXIS_NAMES;

/// How the passes of x and y supersampling become one base plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Accumulation {
    /// Their rays are interleaved: a larger base plane (`kGrowBasePlane`).
    #[default]
    Grow,
    /// They are averaged: a base plane of the normal size (`kBlendBasePlane`).
    Blend,
}

/// Sub-samples per voxel. z is the card's own; x and y take several passes whose rays start at fractions of
/// a voxel (paper, section 4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Supersampling {
    factors: [u32; 3],
    accumulation: Accumulation,
}

impl Supersampling {
    /// One sample per voxel.
    pub const NONE: Self = Self { factors: [1; 3], accumulation: Accumulation::Grow };

    /// `factors` sub-samples per voxel along permuted x, y and z.
    ///
    /// # Errors
    /// A factor is not in 1..=8.
    pub fn new(factors: [u32; 3], accumulation: Accumulation) -> Result<Self, GeometryError> {
        for (axis, factor) in AXIS_NAMES.into_iter().zip(factors) {
            if !(1..=limit::SUPERSAMPLING).contains(&factor) {
                return Err(GeometryError::Supersampling { axis, factor });
            }
        }
        Ok(Self { factors, accumulation })
    }

    /// Sub-samples per voxel of a sample distance in voxels, as the VLI gives it: the smallest number that
    /// samples at least so densely, 1..=8. `None` unless the distance is in (0, 1].
    #[must_use]
    pub fn from_distance(distance: f64) -> Option<u32> {
        let usable = distance > 0.0 && distance <= 1.0;
        // The tolerance takes a distance like 0.333 for a third.
        usable.then(|| (1.0 / distance - 0.01).ceil().min(f64::from(limit::SUPERSAMPLING)) as u32)
    }

    /// Sub-samples per voxel along permuted x, y and z, each 1..=8.
    #[must_use]
    pub const fn factors(self) -> [u32; 3] {
        self.factors
    }

    /// How passes are combined.
    #[must_use]
    pub const fn accumulation(self) -> Accumulation {
        self.accumulation
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_the_card_does_not_have_are_refused() {
        for (factors, axis, factor) in
            [([0, 1, 1], 'x', 0), ([1, 9, 1], 'y', 9), ([1, 1, u32::MAX], 'z', u32::MAX)]
        {
            let expected = Err(GeometryError::Supersampling { axis, factor });
            assert_eq!(Supersampling::new(factors, Accumulation::Grow), expected);
        }
    }

    #[test]
    fn distances_become_factors() {
        for distance in [0.0, -0.5, 1.000_001, f64::NAN, f64::INFINITY] {
            assert_eq!(Supersampling::from_distance(distance), None, "{distance}");
        }
        let pairs =
            [(1.0, 1), (0.99, 2), (0.995, 1), (0.5, 2), (0.34, 3), (0.33, 4), (0.3333, 3), (0.125, 8)];
        for (distance, factor) in pairs {
            assert_eq!(Supersampling::from_distance(distance), Some(factor), "{distance}");
        }
        assert_eq!(Supersampling::from_distance(1e-300), Some(8));
    }
}
