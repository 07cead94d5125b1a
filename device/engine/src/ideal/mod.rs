//! The ideal renderer: what the card would show with unlimited precision. It serves to measure errors only.
//!
//! Geometry, interpolation, classification and compositing are those of the paper in `f64`, without any
//! quantisation: sample positions are exact, values are not rounded, the transfer function is a function, not a
//! table. Colours and opacities are 0..=1; values are in whatever units voxels and transfer function share.
//!
//! [`Scene`] is what to render, [`ray`] what comes out, [`transfer`] a transfer function made of points, and
//! [`frame`] makes the scene of a frame, so that the card's picture can be compared with its ideal.

pub mod frame;
pub mod ray;
pub mod transfer;

pub use ray::Ray;
pub use transfer::PiecewiseLinear;

use vg500_regs::{BlendMode, Permutation};

/// Gives the value of the voxel at an object coordinate.
pub trait Voxels: Fn([usize; 3]) -> f64 {}
impl<F: Fn([usize; 3]) -> f64> Voxels for F {}

/// Gives the colour and opacity of a value: R, G, B (not multiplied by A) and A.
pub trait Transfer: Fn(f64) -> [f64; 4] {}
impl<F: Fn(f64) -> [f64; 4]> Transfer for F {}

/// What to render.
#[derive(Clone, Debug)]
pub struct Scene<V, T> {
    /// Voxels along object x, y and z; at least 1 each.
    pub size: [usize; 3],
    /// Values of the voxels; it is asked for coordinates below `size` only.
    pub voxels: V,
    /// Transfer function.
    pub transfer: T,
    /// Which object axis each permuted axis follows; permuted z runs away from the viewer.
    pub permutation: Permutation,
    /// Where rays run.
    pub rays: Rays,
    /// Which samples can be seen.
    pub visibility: Visibility,
    /// How samples are blended.
    pub blend: BlendMode,
}

/// Where rays run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rays {
    /// Position of ray (0, 0) in the first slice along permuted x and y, in voxels; ray (i, j) is i and j further.
    pub start: [f64; 2],
    /// Advance per sample slice along permuted x and y, in voxels.
    pub step: [f64; 2],
    /// Sample slices per voxel slice, at least 1: slice j lies at permuted z = j / supersampling.
    pub supersampling: u32,
    /// Columns and rows of rays.
    pub size: [u32; 2],
}

/// Which of the existing samples can be seen, by their position in object voxel space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visibility {
    /// Lowest and highest position in the active sub-volume for each axis, inclusive.
    pub subvolume: [[f64; 2]; 3],
    /// Lowest position, inclusive, and highest, exclusive, in the block for each axis.
    pub block: [[f64; 2]; 3],
}

impl Visibility {
    /// Every sample can be seen.
    pub const EVERYTHING: Self = Self {
        subvolume: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
        block: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
    };

    /// Whether a sample at `position` can be seen.
    #[must_use]
    pub fn contains(&self, position: [f64; 3]) -> bool {
        (0..3).all(|axis| {
            let [lowest, highest] = self.subvolume[axis];
            let [low, high] = self.block[axis];
            (lowest..=highest).contains(&position[axis]) && (low..high).contains(&position[axis])
        })
    }
}

impl<V: Voxels, T: Transfer> Scene<V, T> {
    /// All rays, row by row.
    #[must_use]
    pub fn render(&self) -> Vec<Ray> {
        let [width, height] = self.rays.size.map(|size| size as usize);
        let mut rays = vec![Ray::default(); width * height];
        self.render_onto(&mut rays);
        rays
    }

    /// As [`Self::render`], onto rays that have accumulated blocks of the volume in front of this one.
    pub fn render_onto(&self, rays: &mut [Ray]) {
        let [x, y] = self.rays.start;
        for (row, rays) in rays.chunks_mut(self.rays.size[0].max(1) as usize).enumerate() {
            for (column, ray) in rays.iter_mut().enumerate() {
                self.trace([x + column as f64, y + row as f64], ray);
            }
        }
    }

    /// The pixels of all rays, row by row: R, G, B (premultiplied in alpha blending) and A.
    #[must_use]
    pub fn pixels(&self) -> Vec<[f64; 4]> {
        self.render().iter().map(|ray| ray.pixel(self.blend)).collect()
    }

    /// Sends one ray through the volume, front to back, from a position in the first slice.
    pub fn trace(&self, start: [f64; 2], ray: &mut Ray) {
        for value in self.samples(start) {
            ray.blend(self.blend, value, (self.transfer)(value));
        }
    }

    /// Values of the visible samples along a ray, front to back, from a position in the first slice.
    pub fn samples(&self, start: [f64; 2]) -> impl Iterator<Item = f64> {
        let depth = self.permutation.permuted(self.size)[2];
        let slices = 0..=depth.saturating_sub(1) * self.rays.supersampling as usize;
        let positions = slices.filter_map(move |slice| {
            let slice = slice as f64;
            let [x, y] = [0, 1].map(|axis| start[axis] + slice * self.rays.step[axis]);
            self.object_position([x, y, slice / f64::from(self.rays.supersampling)])
        });
        positions.filter(|position| self.visibility.contains(*position)).map(|position| self.sample(position))
    }

    /// The object position of a permuted one, if a sample exists there: not outside of the outermost voxels.
    fn object_position(&self, permuted: [f64; 3]) -> Option<[f64; 3]> {
        let last = self.size.map(|size| size as f64 - 1.0);
        let permuted_last = self.permutation.permuted(last);
        let exists = permuted.iter().zip(permuted_last).all(|(place, last)| (0.0..=last).contains(place));
        exists.then(|| self.permutation.to_object(permuted, last))
    }

    /// The value at an object position, trilinear between voxels; past the volume its outermost voxels go on.
    #[must_use]
    pub fn sample(&self, position: [f64; 3]) -> f64 {
        let inside = [0, 1, 2].map(|axis| position[axis].clamp(0.0, self.size[axis] as f64 - 1.0));
        let cell = inside.map(|place| place as usize);
        let [x, y, z] = [0, 1, 2].map(|axis| inside[axis] - cell[axis] as f64);
        let corner = |dx, dy, dz| {
            let offset: [usize; 3] = [dx, dy, dz];
            (self.voxels)([0, 1, 2].map(|axis: usize| (cell[axis] + offset[axis]).min(self.size[axis] - 1)))
        };
        let along_x = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), x);
        let along_y = |dz| mix(along_x(0, dz), along_x(1, dz), y);
        mix(along_y(0), along_y(1), z)
    }
}

/// `a (1 - weight) + b weight`.
fn mix(a: f64, b: f64, weight: f64) -> f64 {
    a + (b - a) * weight
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Value 100 x + 10 y + z, shown as colour and opacity.
    fn ramp(size: [usize; 3]) -> Scene<impl Voxels, impl Transfer> {
        Scene {
            size,
            voxels: |[x, y, z]: [usize; 3]| (100 * x + 10 * y + z) as f64,
            transfer: |value: f64| [value, -value, 2.0 * value, 1.0],
            permutation: Permutation::IDENTITY,
            rays: Rays { start: [0.0; 2], step: [0.0; 2], supersampling: 1, size: [1, 1] },
            visibility: Visibility::EVERYTHING,
            blend: BlendMode::Sum,
        }
    }

    #[test]
    fn a_linear_volume_is_sampled_exactly() {
        let scene = ramp([4, 5, 6]);
        for position in [[0.0; 3], [3.0, 4.0, 5.0], [0.5, 3.25, 4.75], [2.999, 0.001, 1.0 / 3.0]] {
            let [x, y, z] = position;
            assert!((scene.sample(position) - (100.0 * x + 10.0 * y + z)).abs() < 1e-9);
        }
        assert_eq!(scene.sample([-7.0, 99.0, 2.0]), 42.0);
    }

    #[test]
    fn samples_exist_from_the_first_voxel_to_the_last() {
        let mut scene = ramp([4, 5, 6]);
        scene.rays = Rays { start: [-1.0, 0.0], step: [0.5, 0.25], supersampling: 2, size: [6, 1] };
        let samples: Vec<u32> = scene.render().iter().map(|ray| ray.samples).collect();
        // Eleven slices; x = -1 + i + j / 2 lies in 0..=3, y = j / 4 in 0..=4.
        assert_eq!(samples, [7, 7, 5, 3, 1, 0]);
    }

    #[test]
    fn supersampled_slices_lie_at_exact_fractions() {
        let mut scene = ramp([1, 1, 4]);
        scene.rays.supersampling = 3;
        let [ray] = scene.render()[..] else { panic!("one ray") };
        // 0 + 1/3 + 2/3 + ... + 3
        assert_eq!(ray.samples, 10);
        assert!((ray.color[0] - 15.0).abs() < 1e-12);
    }

    #[test]
    fn permuted_axes_run_where_the_permutation_says() {
        let mut scene = ramp([3, 4, 5]);
        scene.permutation = Permutation::from_word(0x016).unwrap(); // x = -z, y = y, z = x
        scene.rays.start = [1.0, 2.0];
        scene.blend = BlendMode::Minimum;
        // The first slice is object x = 0; permuted x = 1 is z = 3.
        assert_eq!(scene.pixels(), [[23.0, -23.0, 46.0, 1.0]]);
    }

    #[test]
    fn sub_volumes_are_inclusive_and_blocks_half_open() {
        let mut scene = ramp([1, 1, 10]);
        scene.visibility.subvolume[2] = [2.0, 5.0];
        assert_eq!(scene.render()[0].samples, 4);
        scene.visibility = Visibility::EVERYTHING;
        scene.visibility.block[2] = [2.0, 5.0];
        assert_eq!(scene.render()[0].samples, 3);
        scene.visibility.block[2] = [5.0, 10.0];
        let mut rays = vec![Ray { samples: 3, ..Ray::default() }];
        scene.render_onto(&mut rays);
        assert_eq!(rays[0].samples, 8);
    }
}
