//! The head of Shepp and Logan (1974) with the higher contrast of Toft (1996), in three dimensions (Schabel 2006).

use super::grid::{Grid, twelve_bits};
use crate::file::Samples;
use crate::geometry::sin_cos_degrees;
use glam::{DMat3, DVec3};

/// What an ellipsoid adds to the density, its half axes, its centre, and the degrees it is turned about z.
const TABLE: [(f64, [f64; 3], [f64; 3], f64); 10] = [
    (1.0, [0.69, 0.92, 0.81], [0.0, 0.0, 0.0], 0.0),
    (-0.8, [0.6624, 0.874, 0.78], [0.0, -0.0184, 0.0], 0.0),
    (-0.2, [0.11, 0.31, 0.22], [0.22, 0.0, 0.0], -18.0),
    (-0.2, [0.16, 0.41, 0.28], [-0.22, 0.0, 0.0], 18.0),
    (0.1, [0.21, 0.25, 0.41], [0.0, 0.35, -0.15], 0.0),
    (0.1, [0.046, 0.046, 0.05], [0.0, 0.1, 0.25], 0.0),
    (0.1, [0.046, 0.046, 0.05], [0.0, -0.1, 0.25], 0.0),
    (0.1, [0.046, 0.023, 0.05], [-0.08, -0.605, 0.0], 0.0),
    (0.1, [0.023, 0.023, 0.02], [0.0, -0.606, 0.0], 0.0),
    (0.1, [0.023, 0.046, 0.02], [0.06, -0.605, 0.0], 0.0),
];

struct Ellipsoid {
    density: f64,
    centre: DVec3,
    /// Takes the ellipsoid to the unit sphere.
    unit_from_space: DMat3,
    shortest: f64,
}

impl Ellipsoid {
    fn new((density, half_axes, centre, angle): (f64, [f64; 3], [f64; 3], f64)) -> Self {
        let half_axes = DVec3::from_array(half_axes);
        let (sin, cos) = sin_cos_degrees(angle);
        let unturn = DMat3::from_cols(DVec3::new(cos, -sin, 0.0), DVec3::new(sin, cos, 0.0), DVec3::Z);
        Self {
            density,
            centre: DVec3::from_array(centre),
            unit_from_space: DMat3::from_diagonal(half_axes.recip()) * unturn,
            shortest: half_axes.min_element(),
        }
    }

    /// Signed distance of a place, or less.
    fn distance(&self, place: DVec3) -> f64 {
        ((self.unit_from_space * (place - self.centre)).length() - 1.0) * self.shortest
    }
}

/// The head, density 0..=1 as 12 bits; edges are about two samples wide.
pub fn samples(grid: &Grid) -> Samples {
    let ellipsoids = TABLE.map(Ellipsoid::new);
    let edge = 2.0 * grid.step();
    grid.fill_rows(|row, values| {
        let mut coverages = TABLE.map(|_| row.coverage(edge));
        for (i, value) in values.iter_mut().enumerate() {
            let place = row.place(i);
            let parts = ellipsoids.iter().zip(&mut coverages);
            let density = parts.map(|(it, coverage)| it.density * coverage.next(|| it.distance(place)));
            *value = twelve_bits(density.sum());
        }
    })
    .into()
}
