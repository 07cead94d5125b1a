//! The samples of a phantom.

use crate::file::Geometry;
use glam::DVec3;
use std::sync::Mutex;
use std::thread;

/// A grid of samples over the cube [-1, 1]^3, whatever its size along each axis.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    size: [usize; 3],
}

impl Grid {
    /// So many samples along x, y and z.
    pub const fn new(size: [usize; 3]) -> Self {
        Self { size }
    }

    fn longest(&self) -> usize {
        self.size.into_iter().max().unwrap_or(1)
    }

    /// Distance of neighbours along the longest axis, in units of the cube.
    pub fn step(&self) -> f64 {
        2.0 / self.longest().saturating_sub(1).max(1) as f64
    }

    /// Samples 1 mm apart along the longest axis, and as wide as this along the others.
    pub fn geometry(&self) -> Geometry {
        let width = self.longest().saturating_sub(1) as f64;
        Geometry::from_spacing(self.size.map(|size| if size > 1 { width / (size - 1) as f64 } else { 1.0 }))
    }

    /// Place of a sample along an axis: -1..=1, exactly symmetrical; 0 for a single one.
    fn place(&self, axis: usize, index: usize) -> f64 {
        let last = self.size[axis] as f64 - 1.0;
        if last > 0.0 { (2.0 * index as f64 - last) / last } else { 0.0 }
    }

    /// The value of `function` at each sample, of its place and its index, x fastest.
    pub fn fill<T: Copy + Default + Send>(&self, function: impl Fn(DVec3, usize) -> T + Sync) -> Vec<T> {
        self.fill_rows(|row, values| {
            for (i, value) in values.iter_mut().enumerate() {
                *value = function(row.place(i), row.first + i);
            }
        })
    }

    /// Values that `function` writes row by row. All processors compute.
    pub fn fill_rows<T: Copy + Default + Send>(&self, function: impl Fn(&Row, &mut [T]) + Sync) -> Vec<T> {
        let [width, height, depth] = self.size;
        let mut values = vec![T::default(); width * height * depth];
        let slices = Mutex::new(values.chunks_mut(width * height).enumerate());
        let work = || {
            while let Some((k, slice)) = slices.lock().ok().and_then(|mut slices| slices.next()) {
                for (j, values) in slice.chunks_mut(width).enumerate() {
                    let [y, z] = [self.place(1, j), self.place(2, k)];
                    function(&Row { grid: *self, y, z, first: (k * height + j) * width }, values);
                }
            }
        };
        thread::scope(|scope| {
            for _ in 1..thread::available_parallelism().map_or(1, usize::from) {
                scope.spawn(work);
            }
            work();
        });
        values
    }
}

/// Samples that differ in x only.
pub struct Row {
    grid: Grid,
    y: f64,
    z: f64,
    /// Index of the first one.
    pub first: usize,
}

impl Row {
    /// Place of the sample with index `i` along x.
    pub fn place(&self, i: usize) -> DVec3 {
        DVec3::new(self.grid.place(0, i), self.y, self.z)
    }

    /// Coverage of the row's samples, one after the other, by a body whose edge is `width` wide.
    pub fn coverage(&self, width: f64) -> RowCoverage {
        let last = self.grid.size[0].saturating_sub(1).max(1);
        RowCoverage { width, step: 2.0 / last as f64, coverage: 0.0, sure: 0 }
    }
}

/// Coverage along a row. A signed distance changes by no more than the way along the row, so that it is evaluated
/// near the surface only.
pub struct RowCoverage {
    width: f64,
    step: f64,
    coverage: f64,
    /// Samples whose coverage is that of the one before.
    sure: usize,
}

impl RowCoverage {
    /// Coverage of the next sample, which has this distance.
    pub fn next(&mut self, distance: impl FnOnce() -> f64) -> f64 {
        if self.sure > 0 {
            self.sure -= 1;
        } else {
            let distance = distance();
            self.coverage = coverage(distance, self.width);
            self.sure = ((distance.abs() - 0.5 * self.width) / self.step) as usize;
        }
        self.coverage
    }
}

/// How much (0..=1) of a sample lies inside of a body at a signed distance, negative inside, with an edge of this
/// width.
fn coverage(distance: f64, width: f64) -> f64 {
    (0.5 - distance / width).clamp(0.0, 1.0)
}

/// A part (0..=1) of the largest 12-bit value.
pub fn twelve_bits(part: f64) -> u16 {
    (part.clamp(0.0, 1.0) * 4095.0 + 0.5) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_symmetrical_and_geometry_follows() {
        let grid = Grid::new([5, 3, 1]);
        let values = grid.fill(|place, index| (place, index));
        assert_eq!(values[0], (DVec3::new(-1.0, -1.0, 0.0), 0));
        assert_eq!(values[7], (DVec3::ZERO, 7));
        assert_eq!(values[14], (DVec3::new(1.0, 1.0, 0.0), 14));
        assert_eq!(grid.geometry().spacing(), [1.0, 2.0, 1.0]);
        assert_eq!(grid.step(), 0.5);
        assert_eq!(Grid::new([1; 3]).fill(|place, _| place), [DVec3::ZERO]);
        let grid = Grid::new([7, 6, 10]);
        for index in 0..7 {
            assert_eq!(grid.place(0, index), -grid.place(0, 6 - index));
        }
    }

    #[test]
    fn coverage_along_rows_leaves_nothing_out() {
        let grid = Grid::new([101, 9, 5]);
        let distance = |place: DVec3| (place.x.abs() - 0.5).abs().max(place.y) - 0.25;
        let rows: Vec<f64> = grid.fill_rows(|row, values| {
            let mut along = row.coverage(0.07);
            for (i, value) in values.iter_mut().enumerate() {
                *value = along.next(|| distance(row.place(i)));
            }
        });
        assert_eq!(rows, grid.fill(|place, _| coverage(distance(place), 0.07)));
    }

    #[test]
    fn coverage_is_that_of_a_box() {
        assert_eq!(
            [-1.0, -0.5, 0.0, 0.25, 2.0].map(|distance| coverage(distance, 1.0)),
            [1.0, 1.0, 0.5, 0.25, 0.0]
        );
        assert_eq!([-1.0, 0.0, 0.5, 1.0].map(twelve_bits), [0, 0, 2048, 4095]);
    }
}
