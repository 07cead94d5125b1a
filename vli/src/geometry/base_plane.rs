use std::ops::Range;

use glam::{DAffine2, DMat2, DVec2};
use vg500_regs::number;

use super::{Accumulation, Supersampling};

/// Fraction bits of ray positions in the registers.
const FRACTION: u32 = number::RAY_POSITION.fraction;
/// Half a step of a sample position, which has 8 fraction bits.
const HALF: i64 = 1 << (FRACTION - 8 - 1);

/// One pass of the card over the volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pass {
    /// Registers `START_X` and `START_Y`: position in voxels, in the first slice, of the ray of the pass's
    /// pixel (0, 0); 22 fraction bits. Negative where the plane extends beyond the first slice.
    pub start: [i32; 2],
    /// Columns and rows of rays, at least 1 each.
    pub size: [u32; 2],
    /// Pixel of the base plane that the pass's pixel (0, 0) belongs to.
    pub offset: [u32; 2],
    /// Base-plane columns and rows from one pixel of the pass to the next. In a blended plane all passes
    /// have offset 0 and stride 1, and a pixel is their sum divided by their number.
    pub stride: [u32; 2],
}

/// A rectangle of rays that becomes one picture of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BasePlane {
    first: [i32; 2],
    size: [u32; 2],
    pixels_per_voxel: [u32; 2],
    centre: [f64; 2],
}

impl BasePlane {
    pub(super) fn smallest(rays: &RayExtent, supersampling: Supersampling) -> Self {
        let [x, y, _] = supersampling.factors();
        let factors = [x, y];
        match supersampling.accumulation() {
            Accumulation::Grow => Self::of(rays.first, rays.end.map(|end| end - 1), factors, [0.0, 0.0]),
            // A pixel is the mean of its sub-rays and stands in their middle.
            Accumulation::Blend => Self::of(
                whole(rays.first, factors),
                whole(rays.end.map(|end| end - 1), factors),
                [1, 1],
                factors.map(|factor| f64::from(factor - 1) / f64::from(2 * factor)),
            ),
        }
    }

    fn of(first: [i32; 2], last: [i32; 2], pixels_per_voxel: [u32; 2], centre: [f64; 2]) -> Self {
        let size = [0, 1].map(|axis| (last[axis] - first[axis] + 1).unsigned_abs());
        Self { first, size, pixels_per_voxel, centre }
    }

    /// The plane with as many columns and rows in front that `ray` is not before pixel (0, 0).
    pub(super) fn extended_to(self, ray: [f64; 2]) -> Self {
        let pixel = self.pixel_from_ray().transform_point2(DVec2::from_array(ray));
        // The tolerance takes rounding errors of thirds, fifths and sevenths for nothing.
        let margin = pixel.to_array().map(|pixel| (-pixel - 1e-9).ceil().max(0.0) as u32);
        let axes = [0, 1];
        Self {
            first: axes.map(|axis| self.first[axis] - margin[axis].cast_signed()),
            size: axes.map(|axis| self.size[axis] + margin[axis]),
            ..self
        }
    }

    /// Columns and rows.
    #[must_use]
    pub const fn size(&self) -> [u32; 2] {
        self.size
    }

    /// From rays, given by permuted x and y in the first slice in voxels, to pixels.
    #[must_use]
    pub fn pixel_from_ray(&self) -> DAffine2 {
        let pixels_per_voxel = DVec2::from_array(self.pixels_per_voxel.map(f64::from));
        let first = DVec2::from_array(self.first.map(f64::from));
        DAffine2 {
            matrix2: DMat2::from_diagonal(pixels_per_voxel),
            translation: -(DVec2::from_array(self.centre) * pixels_per_voxel + first),
        }
    }

    pub(super) fn passes(&self, supersampling: Supersampling) -> Vec<Pass> {
        let [x, y, _] = supersampling.factors();
        let mut passes = Vec::with_capacity((x * y) as usize);
        for row in 0..y {
            for column in 0..x {
                passes.extend(self.pass([column, row], [x, y]));
            }
        }
        passes
    }

    /// The pass whose rays start at `part[axis] / factors[axis]` voxels behind whole positions, or `None` if
    /// the plane has no such ray.
    fn pass(&self, part: [u32; 2], factors: [u32; 2]) -> Option<Pass> {
        let mut pass = Pass { start: [0; 2], size: self.size, offset: [0; 2], stride: self.pixels_per_voxel };
        for axis in 0..2 {
            let stride = self.pixels_per_voxel[axis];
            let mut voxel = self.first[axis];
            if stride > 1 {
                let behind = (part[axis].cast_signed() - self.first[axis]).rem_euclid(stride.cast_signed());
                let offset = behind.unsigned_abs();
                pass.offset[axis] = offset;
                pass.size[axis] = self.size[axis].saturating_sub(offset).div_ceil(stride);
                voxel = (self.first[axis] + behind).div_euclid(stride.cast_signed());
            }
            pass.start[axis] = (voxel << FRACTION) + sub_start(part[axis], factors[axis]).cast_signed();
        }
        (pass.size[0] > 0 && pass.size[1] > 0).then_some(pass)
    }
}

/// The rays of all passes that have existing samples, numbered in sub-samples from voxel 0 of the first
/// slice, and the number of these samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RayExtent {
    first: [i32; 2],
    end: [i32; 2],
    samples: u64,
}

impl RayExtent {
    /// Adds up the sample slices: in each one, and for each sub-start, the rays with an existing sample are a
    /// range of columns times a range of rows.
    pub(super) fn new(size: [u32; 3], step: [u32; 2], factors: [u32; 3]) -> Self {
        let mut extent = Self { first: [i32::MAX; 2], end: [i32::MIN; 2], samples: 0 };
        for slice in 0..=i64::from(factors[2] * (size[2] - 1)) {
            let ranges = |axis: usize| {
                let offset = slice * i64::from(step[axis]);
                (0..factors[axis]).map(move |part| {
                    let rays = existing(size[axis], offset + i64::from(sub_start(part, factors[axis])));
                    (part, rays)
                })
            };
            for (row, rows) in ranges(1) {
                for (column, columns) in ranges(0) {
                    extent.add([column, row], [columns, rows.clone()], factors);
                }
            }
        }
        extent
    }

    fn add(&mut self, part: [u32; 2], rays: [Range<i32>; 2], factors: [u32; 3]) {
        if rays.iter().any(Range::is_empty) {
            return;
        }
        self.samples += rays.iter().map(|range| range.len() as u64).product::<u64>();
        for axis in 0..2 {
            let number = |ray: i32| ray * factors[axis].cast_signed() + part[axis].cast_signed();
            self.first[axis] = self.first[axis].min(number(rays[axis].start));
            self.end[axis] = self.end[axis].max(number(rays[axis].end - 1) + 1);
        }
    }

    pub(super) const fn samples(&self) -> u64 {
        self.samples
    }
}

/// Rays i whose position (i << 22) + `offset` has an existing sample on an axis of `size` voxels.
///
/// The card's rule is 0 <= p8 <= 256 (size - 1) with p8 = (position + 2^13) >> 14, which is
/// -2^13 <= position < ((size - 1) << 22) + 2^13.
fn existing(size: u32, offset: i64) -> Range<i32> {
    let ceil = |position: i64| -(-position >> FRACTION);
    let start = ceil(-HALF - offset);
    let end = ceil((i64::from(size - 1) << FRACTION) + HALF - offset);
    start as i32..end as i32
}

/// `part / factor` of a voxel with 22 fraction bits, rounded to nearest.
const fn sub_start(part: u32, factor: u32) -> u32 {
    ((part << FRACTION) + factor / 2) / factor
}

fn whole(rays: [i32; 2], factors: [u32; 2]) -> [i32; 2] {
    [0, 1].map(|axis| rays[axis].div_euclid(factors[axis].cast_signed()))
}
