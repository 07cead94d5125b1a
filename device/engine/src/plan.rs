//! The plan of a frame: its sample slices, and on each the rays that have a sample and the weights that all of
//! them share (paper, section 3.1).

use crate::fixed::{ONE_VOXEL, POSITION_BITS, used_position};
use crate::frame::{FrameDescription, Rays};
use core::ops::Range;

/// One axis of a sample slice. Ray `i` has its sample at position `i * 256 + offset`, in 1/256 voxel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SliceAxis {
    /// Position of ray 0.
    pub offset: i64,
    /// Rays whose samples exist: 0 <= position <= 256 (n - 1).
    pub rays: Range<u32>,
}

impl SliceAxis {
    fn new(rays: &Rays, axis: usize, slice: u32, size: u32) -> Self {
        let accumulated = i64::from(rays.start[axis]) + i64::from(slice) * i64::from(rays.step[axis]);
        let offset = used_position(accumulated);
        let last = ONE_VOXEL * i64::from(size - 1);
        let count = i64::from(rays.size[axis]);
        // The first ray at or behind 0, and the first one behind the last voxel.
        let begin = (-offset).div_ceil_euclid(ONE_VOXEL).clamp(0, count);
        let end = ((last - offset).div_euclid(ONE_VOXEL) + 1).clamp(begin, count);
        Self { offset, rays: begin as u32..end as u32 }
    }

    /// Position of a ray's sample in 1/256 voxel; rays next to the base plane (-1, `width`) are allowed.
    #[must_use]
    pub const fn position(&self, ray: i64) -> i64 {
        ray * ONE_VOXEL + self.offset
    }

    /// Voxel below a ray's sample; it may lie outside of the volume.
    #[must_use]
    pub const fn voxel(&self, ray: i64) -> i64 {
        self.position(ray) >> POSITION_BITS
    }

    /// Weight of the voxel above, the same for all rays.
    #[must_use]
    pub const fn weight(&self) -> i32 {
        (self.offset & (ONE_VOXEL - 1)) as i32
    }
}

trait DivCeilEuclid {
    fn div_ceil_euclid(self, divisor: Self) -> Self;
}

impl DivCeilEuclid for i64 {
    /// Quotient rounded towards positive infinity, for a positive divisor.
    fn div_ceil_euclid(self, divisor: Self) -> Self {
        -(-self).div_euclid(divisor)
    }
}

/// A slice of samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SampleSlice {
    /// Position along permuted z in 1/256 voxel.
    pub z: i64,
    /// Along permuted x: columns of rays.
    pub x: SliceAxis,
    /// Along permuted y: rows of rays.
    pub y: SliceAxis,
}

impl SampleSlice {
    /// Voxel slice below.
    #[must_use]
    pub const fn voxel_slice(&self) -> i64 {
        self.z >> POSITION_BITS
    }

    /// Weight of the voxel slice above.
    #[must_use]
    pub const fn weight_z(&self) -> i32 {
        (self.z & (ONE_VOXEL - 1)) as i32
    }

    /// Samples that exist on the slice.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.x.rays.len() as u64 * self.y.rays.len() as u64
    }
}

/// All sample slices of a frame, front to back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// The slices: k (n - 1) + 1 of them.
    pub slices: Vec<SampleSlice>,
}

impl Plan {
    /// The plan of a frame.
    #[must_use]
    pub fn new(frame: &FrameDescription) -> Self {
        let [width, height, depth] = frame.permuted_size();
        let factor = frame.rays.supersampling;
        let slices = (0..=factor * (depth - 1)).map(|slice| SampleSlice {
            z: z_position(slice, factor),
            x: SliceAxis::new(&frame.rays, 0, slice, width),
            y: SliceAxis::new(&frame.rays, 1, slice, height),
        });
        Self { slices: slices.collect() }
    }

    /// Samples that exist on the frame's rays.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.slices.iter().map(SampleSlice::samples).sum()
    }
}

/// Position of a sample slice: round(256 slice / factor). No factor in 1..=8 has ties.
fn z_position(slice: u32, factor: u32) -> i64 {
    let [slice, factor] = [i64::from(slice), i64::from(factor)];
    (2 * ONE_VOXEL * slice + factor) / (2 * factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rays(start: i32, step: u32, width: u32) -> Rays {
        Rays { start: [start, 0], step: [step, 0], supersampling: 1, size: [width, 1] }
    }

    #[test]
    fn head_on_every_voxel_has_one_sample() {
        for slice in 0..256 {
            let axis = SliceAxis::new(&rays(0, 0, 256), 0, slice, 256);
            assert_eq!((axis.rays.clone(), axis.weight(), axis.voxel(17)), (0..256, 0, 17));
        }
    }

    #[test]
    fn existing_samples_are_those_of_the_rule() {
        for start in [-(511 << 22), -(300 << 22) + 12345, -8193, -8192, 0, 8191, 8192, 5 << 20, 300 << 22] {
            for step in [0, 1, 12_345, 1 << 21, (1 << 22) - 1, 1 << 22] {
                for (slice, size, width) in [(0, 1, 1), (1, 2, 512), (255, 256, 512), (100, 40, 77)] {
                    let axis = SliceAxis::new(&rays(start, step, width), 0, slice, size);
                    for ray in 0..width {
                        let accumulated =
                            (i64::from(ray) << 22) + i64::from(start) + i64::from(slice) * i64::from(step);
                        let position = (accumulated + (1 << 13)) >> 14;
                        let exists = (0..=256 * (i64::from(size) - 1)).contains(&position);
                        assert_eq!(axis.rays.contains(&ray), exists, "{start} {step} {slice} {size} {ray}");
                        assert_eq!(axis.position(i64::from(ray)), position);
                    }
                }
            }
        }
    }

    #[test]
    fn supersampled_slices_lie_at_rounded_fractions() {
        for factor in 1..=8 {
            for slice in 0..2048 {
                let exact = (256.0 * f64::from(slice) / f64::from(factor)).round();
                assert_eq!(z_position(slice, factor) as f64, exact, "{slice} / {factor}");
            }
        }
    }
}
