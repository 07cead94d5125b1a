//! How far a final picture may be from that of a continuous volume.
//!
//! The continuous volume f is what trilinear interpolation makes of the voxels; it is zero at the faces and beyond. A
//! pixel's exact ray meets sample slice k at x_k. What the pixel shows comes of the four rays of the base plane around
//! it: their samples lie beside x_k, off by o along permuted x and y, and the warp weighs them by w (bilinear). With g
//! the greatest differences of neighbouring voxels near x_k along the permuted axes,
//! |f(x_k + o) - f(x_k)| <= g . |o|. From slice to slice f changes by at most s_k = g . (shear, 1).
//!
//! **Maximum.** The pixel lies between max_k (f(x_k) - sum of w g |o|) and the sum of w max_k (f(x_k) + g |o|). The
//! maximum along the continuous ray is at most max_k (f(x_k) + s_k / 2).
//!
//! **Opacity** of a constant colour: A = 1 - e^-t, where t is the sum of d m(f) over the samples, d their distance, and
//! m(v) = -ln(1 - a(v)), whose slope is at most L. So t is off by at most d L (sum of w g |o| + s_k / 4) for each
//! sample: beside the ray, and by the midpoint rule along it. A is off by no more.
//!
//! **Arithmetic** of the card: a sample value is off by 3/16 + 1/2, and by g / 512 for each rounded position; a table
//! entry and each step of an accumulator by 1/2 of 4095; pixels of base plane and picture by 1/2 of 255 each.

use glam::{DAffine2, DVec2};
use vli::BasePlane;
use vli::geometry::{Camera, ImageSize};

/// What a pixel shows, in steps of 255: of the continuous volume along its exact ray it is off by `bound`.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    pub maximum: f64,
    pub opacity: f64,
}

/// A volume of 12-bit values with opacity `slope` times value per smallest voxel spacing.
pub struct Field {
    size: [usize; 3],
    values: Vec<f64>,
    /// Greatest differences of neighbours along each axis, not more than a voxel beside each cell; cells begin at -1.
    slopes: Vec<[f64; 3]>,
    /// Opacity per value.
    slope: f64,
    /// How far trilinear interpolation may be from what the voxels are samples of.
    interpolation: f64,
}

impl Field {
    /// `values`, x fastest, are zero at the faces.
    pub fn new(size: [usize; 3], values: Vec<f64>, slope: f64, interpolation: f64) -> Self {
        let mut field = Self { size, values, slopes: Vec::new(), slope, interpolation };
        let cells = |axis: usize| -1..size[axis] as i64;
        for z in cells(2) {
            for y in cells(1) {
                for x in cells(0) {
                    let slopes = field.greatest_differences([x, y, z]);
                    field.slopes.push(slopes);
                }
            }
        }
        field
    }

    fn at(&self, [x, y, z]: [i64; 3]) -> f64 {
        let inside = [x, y, z].iter().zip(self.size).all(|(place, size)| (0..size as i64).contains(place));
        let place = (z * self.size[1] as i64 + y) * self.size[0] as i64 + x;
        if inside { self.values[place as usize] } else { 0.0 }
    }

    fn sample(&self, position: [f64; 3]) -> f64 {
        let cell = position.map(|place| place.floor() as i64);
        let lerp = |a: f64, b: f64, axis: usize| a + (b - a) * (position[axis] - cell[axis] as f64);
        let corner = |x, y, z| self.at([cell[0] + x, cell[1] + y, cell[2] + z]);
        let along_x = |y, z| lerp(corner(0, y, z), corner(1, y, z), 0);
        let along_y = |z| lerp(along_x(0, z), along_x(1, z), 1);
        lerp(along_y(0), along_y(1), 2)
    }

    fn greatest_differences(&self, cell: [i64; 3]) -> [f64; 3] {
        let mut greatest = [0.0_f64; 3];
        let steps = || -1..=2;
        for offset in steps().flat_map(|z| steps().flat_map(move |y| steps().map(move |x| [x, y, z]))) {
            let at = [0, 1, 2].map(|axis| cell[axis] + offset[axis]);
            for axis in (0..3).filter(|axis| offset[*axis] < 2) {
                let mut next = at;
                next[axis] += 1;
                greatest[axis] = greatest[axis].max((self.at(next) - self.at(at)).abs());
            }
        }
        greatest
    }

    fn slopes(&self, position: [f64; 3]) -> [f64; 3] {
        let cell = position.map(|place| place.floor() as i64 + 1);
        let inside = cell.iter().zip(self.size).all(|(place, size)| (0..=size as i64).contains(place));
        let [width, height] = [self.size[0] as i64 + 1, self.size[1] as i64 + 1];
        let place = (cell[2] * height + cell[1]) * width + cell[0];
        if inside { self.slopes[place as usize] } else { [0.0; 3] }
    }
}

/// A picture's way back to the rays of its base plane.
pub struct Pixels<'a> {
    field: &'a Field,
    plane: &'a BasePlane,
    plane_from_image: DAffine2,
    /// Distance between samples in smallest voxel spacings.
    distance: f64,
    /// Voxels by which the ray may lie beside the one that it is compared with.
    shift: f64,
}

impl<'a> Pixels<'a> {
    pub fn new(
        field: &'a Field,
        plane: &'a BasePlane,
        camera: &Camera,
        size: ImageSize,
        smallest_spacing: f64,
        shift: f64,
    ) -> Self {
        let plane_from_image = plane.view.image_from_base_plane(&plane.plane, camera, size).inverse();
        Self {
            field,
            plane,
            plane_from_image,
            distance: plane.view.sample_distance() / smallest_spacing,
            shift,
        }
    }

    /// The bounds of a pixel; `None` where the base plane does not show the volume.
    pub fn bounds(&self, column: u32, row: u32) -> Option<Bounds> {
        let pixel = self.plane_from_image.transform_point2(DVec2::new(column.into(), row.into()));
        let inside = |place: f64, size: u32| (0.0..f64::from(size) - 1.0).contains(&place);
        if !inside(pixel.x, self.plane.size[0]) || !inside(pixel.y, self.plane.size[1]) {
            return None;
        }
        let start = self.plane.plane.pixel_from_ray().inverse().transform_point2(pixel);
        let part = pixel - pixel.floor();
        let corners =
            [[part.x, part.y], [1.0 - part.x, part.y], [part.x, 1.0 - part.y], [1.0 - part.x, 1.0 - part.y]];
        let offsets =
            corners.map(|offset| (offset.map(|it| it + self.shift), (1.0 - offset[0]) * (1.0 - offset[1])));
        Some(self.along(start, offsets))
    }

    /// `offsets` of the four rays, with their weights.
    fn along(&self, start: DVec2, offsets: [([f64; 2], f64); 4]) -> Bounds {
        let view = &self.plane.view;
        let shear = view.shear();
        let last = self.field.size.map(|size| size as f64 - 1.0);
        let steepest = self.field.slope / (1.0 - 4095.0 * self.field.slope);
        let mut highest = [f64::NEG_INFINITY; 4];
        let [mut lowest, mut maximum, mut beyond] = [f64::NEG_INFINITY; 3];
        let [mut opacity, mut arithmetic] = [0.0, 0.0];
        for slice in 0..view.permuted_size()[2] {
            let k = f64::from(slice);
            let permuted = [start.x + k * shear[0], start.y + k * shear[1], k];
            let position = view.permutation().to_object(permuted, last);
            let value = self.field.sample(position);
            let [gx, gy, gz] = view.permutation().permuted(self.field.slopes(position));
            let error = (gx + gy) / 512.0 + 3.0 / 16.0 + 0.5 + self.shift * gz + self.field.interpolation;
            let beside = offsets.map(|([x, y], weight)| (gx * x + gy * y + error, weight));
            let mean: f64 = beside.iter().map(|(beside, weight)| beside * weight).sum();
            let along = gx * shear[0] + gy * shear[1] + gz;
            for (highest, (beside, _)) in highest.iter_mut().zip(beside) {
                *highest = highest.max(value + beside);
            }
            lowest = lowest.max(value - mean);
            maximum = maximum.max(value);
            beyond = beyond.max(value + along / 2.0);
            if value > 0.0 || mean > error {
                opacity += self.distance * steepest * (mean + along / 4.0);
                arithmetic += 1.0 / 4095.0;
            }
        }
        let highest: f64 = highest.iter().zip(offsets).map(|(highest, (_, weight))| highest * weight).sum();
        let maximum = (highest - maximum).max(maximum - lowest) + (beyond - maximum);
        Bounds {
            // A grey is value / 16, rounded down, instead of value 255 / 4095.
            maximum: maximum * 255.0 / 4095.0 + 1.0 + 1.0,
            opacity: (opacity + arithmetic + 2.0 / 4095.0) * 255.0 + 1.0,
        }
    }
}
