//! The three theoretical volumes of the texture-hardware paper (Dachille et al. 1998, section 3.1): a value v stands
//! for the opacity v/255.

use super::grid::Grid;
use crate::file::Samples;

/// Opacity 1/255 everywhere.
pub fn solid(grid: &Grid) -> Samples {
    grid.fill(|_, _| 1_u8).into()
}

/// A sphere of opacity 4/255 in a transparent volume.
pub fn translucent_sphere(grid: &Grid) -> Samples {
    sphere(grid, 4)
}

/// A sphere of opacity 255/255 in a transparent volume.
pub fn opaque_sphere(grid: &Grid) -> Samples {
    sphere(grid, 255)
}

/// A sphere around the centre. The paper's has radius 32 in 64 voxels: a voxel is a cube, whose centre is the sample,
/// so that the outermost samples, half a voxel inside of the volume, are within the radius.
fn sphere(grid: &Grid, value: u8) -> Samples {
    let radius = 1.0 + 0.5 * grid.step();
    grid.fill(|place, _| if place.length_squared() <= radius * radius { value } else { 0 }).into()
}
