//! The ideal renderer: what the card would show with unlimited precision. It serves to measure errors only.
//!
//! Geometry, interpolation, gradients, classification, illumination and compositing are those of the paper in
//! `f64`, without any quantisation: sample positions are exact, values are not rounded, the transfer function is a
//! function, not a table, and light is computed, not looked up. Colours and opacities are 0..=1; values are on the
//! card's scale, 0..=4095.
//!
//! [`Scene`] is what to render: [`visibility`] and [`cursor`] say where, [`shading`] in which light. [`ray`] is
//! what comes out, [`transfer`] a function made of points, and [`frame`] makes the scene of a frame, so that the
//! card's picture can be compared with its ideal.

pub mod cursor;
pub mod frame;
pub mod ray;
pub mod shading;
pub mod transfer;
pub mod visibility;

pub use cursor::Cursor;
pub use ray::Ray;
pub use shading::Shading;
pub use transfer::PiecewiseLinear;
pub use visibility::Visibility;

use std::sync::{Mutex, PoisonError};
use std::thread;
use vg500_regs::{BlendMode, Permutation};

/// What a gradient component counts for a difference of 1 between the samples on both sides: full range, 4095,
/// counts 127.
const PER_DIFFERENCE: f64 = 127.0 / 4095.0;

/// Gives the value, 0..=4095, of the voxel at an object coordinate.
pub trait Voxels: Fn([usize; 3]) -> f64 + Sync {}
impl<F: Fn([usize; 3]) -> f64 + Sync> Voxels for F {}

/// Gives the colour and opacity of a value: R, G, B (not multiplied by A) and A.
pub trait Transfer: Fn(f64) -> [f64; 4] + Sync {}
impl<F: Fn(f64) -> [f64; 4] + Sync> Transfer for F {}

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
    /// The cursor, unless it is off.
    pub cursor: Option<Cursor>,
    /// How samples are illuminated.
    pub shading: Shading,
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

impl<V: Voxels, T: Transfer> Scene<V, T> {
    /// All rays, row by row. Rows are shared among the processor's threads.
    #[must_use]
    pub fn render(&self) -> Vec<Ray> {
        let [width, height] = self.rays.size.map(|size| size as usize);
        let mut rays = vec![Ray::default(); width * height];
        self.render_onto(&mut rays);
        rays
    }

    /// As [`Self::render`], onto rays that have accumulated blocks of the volume in front of this one.
    pub fn render_onto(&self, rays: &mut [Ray]) {
        let rows = Mutex::new(rays.chunks_mut(self.rays.size[0].max(1) as usize).enumerate());
        let next_row = || rows.lock().unwrap_or_else(PoisonError::into_inner).next();
        let threads = thread::available_parallelism().map_or(1, usize::from);
        thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    while let Some((row, rays)) = next_row() {
                        self.trace_row(row, rays);
                    }
                });
            }
        });
    }

    fn trace_row(&self, row: usize, rays: &mut [Ray]) {
        let [x, y] = self.rays.start;
        for (column, ray) in rays.iter_mut().enumerate() {
            self.trace([x + column as f64, y + row as f64], ray);
        }
    }

    /// The pixels of all rays, row by row: R, G, B (premultiplied in alpha blending) and A.
    #[must_use]
    pub fn pixels(&self) -> Vec<[f64; 4]> {
        self.render().iter().map(|ray| ray.pixel(self.blend)).collect()
    }

    /// Sends one ray through the volume, front to back, from a position in the first slice.
    pub fn trace(&self, start: [f64; 2], ray: &mut Ray) {
        for position in self.positions(start) {
            let factor = self.visibility.factor(position);
            // In alpha blending the cursor's samples are blended with those of the volume, in front of them; else
            // they cover the finished ray.
            if self.blend == BlendMode::Alpha
                && let Some(cursor) = self.cursor_sample(position, factor)
            {
                ray.behind(|| cursor);
            }
            if factor > 0.0 {
                let value = self.sample(position);
                ray.blend(self.blend, value, || self.color(value, || self.gradient(position), factor));
            }
        }
        if self.cursor.is_some() && self.blend != BlendMode::Alpha {
            self.cover_with_cursor(start, ray);
        }
    }

    fn cover_with_cursor(&self, start: [f64; 2], ray: &mut Ray) {
        for position in self.positions(start).rev() {
            if let Some(cursor) = self.cursor_sample(position, self.visibility.factor(position)) {
                ray.cover(self.blend, cursor);
            }
        }
    }

    fn cursor_sample(&self, position: [f64; 3], factor: f64) -> Option<[f64; 4]> {
        self.cursor.as_ref().and_then(|cursor| cursor.sample(position, factor))
    }

    /// R, G, B (not premultiplied) and A of a visible sample, given its value, its gradient (asked for only if it
    /// matters) and what of its opacity can be seen. In MIP and MinIP it keeps the opacity of the transfer function.
    #[must_use]
    pub fn color(&self, value: f64, gradient: impl FnOnce() -> [f64; 3], factor: f64) -> [f64; 4] {
        let classified = (self.transfer)(value);
        let alpha = classified[3];
        let extreme = matches!(self.blend, BlendMode::Maximum | BlendMode::Minimum);
        if alpha == 0.0 && !extreme {
            return [0.0; 4];
        }
        let gradient = if self.shading.needs_gradient() { gradient() } else { [0.0; 3] };
        let [r, g, b, modulated] = self.shading.shade(classified, gradient);
        let alpha = match self.blend {
            BlendMode::Alpha => modulated * factor,
            BlendMode::Sum => modulated,
            BlendMode::Maximum | BlendMode::Minimum => alpha,
        };
        [r, g, b, alpha]
    }

    /// Values of the visible samples along a ray, front to back, from a position in the first slice.
    pub fn samples(&self, start: [f64; 2]) -> impl Iterator<Item = f64> {
        let visible = self.positions(start).filter(|position| self.visibility.factor(*position) > 0.0);
        visible.map(|position| self.sample(position))
    }

    /// Object positions of the samples along a ray that exist and belong to the block, front to back, from a
    /// position in the first slice.
    pub fn positions(&self, start: [f64; 2]) -> impl DoubleEndedIterator<Item = [f64; 3]> {
        let depth = self.permutation.permuted(self.size)[2];
        let slices = 0..=depth.saturating_sub(1) as u32 * self.rays.supersampling;
        let positions = slices.filter_map(move |slice| {
            let slice = f64::from(slice);
            let [x, y] = [0, 1].map(|axis| start[axis] + slice * self.rays.step[axis]);
            self.object_position([x, y, slice / f64::from(self.rays.supersampling)])
        });
        positions.filter(|position| self.visibility.block_contains(*position))
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
        let ends = [0, 1, 2].map(|axis| {
            let below = inside[axis] as usize;
            [below, (below + 1).min(self.size[axis] - 1)]
        });
        let [x, y, z] = [0, 1, 2].map(|axis| inside[axis] - ends[axis][0] as f64);
        let corner = |dx: usize, dy: usize, dz: usize| (self.voxels)([ends[0][dx], ends[1][dy], ends[2][dz]]);
        let along_x = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), x);
        let along_y = |dz| mix(along_x(0, dz), along_x(1, dz), y);
        mix(along_y(0), along_y(1), z)
    }

    /// The gradient at an object position along object axes: the difference of the values one voxel further and
    /// one voxel before, in the card's unit, where a difference of 4095 is 127.
    #[must_use]
    pub fn gradient(&self, position: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| {
            let beside = |step: f64| {
                let mut place = position;
                place[axis] += step;
                self.sample(place)
            };
            (beside(1.0) - beside(-1.0)) * PER_DIFFERENCE
        })
    }
}

/// `a (1 - weight) + b weight`.
fn mix(a: f64, b: f64, weight: f64) -> f64 {
    a + (b - a) * weight
}

#[cfg(test)]
mod tests;
