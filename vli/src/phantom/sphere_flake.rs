//! Spheres on spheres, after the sphereflake of Haines (1987).

use super::grid::{Grid, twelve_bits};
use crate::file::Samples;
use crate::geometry::sin_cos_degrees;
use glam::{DMat3, DVec3};

/// Generations behind the first sphere: 1 + 9 + 81 + 729 spheres.
const GENERATIONS: u32 = 3;
/// Radius of the first sphere; with all that grows on it, it just fits the cube.
const RADIUS: f64 = 0.5;
/// Radius of a sphere to that of the one it grows on.
const SHRINKAGE: f64 = 1.0 / 3.0;
/// Latitude and longitudes, in degrees, of the six children around a sphere and of the three on its top.
const RINGS: [Ring; 2] =
    [(0.0, &[0.0, 60.0, 120.0, 180.0, 240.0, 300.0]), (54.735_610_317_245_35, &[30.0, 150.0, 270.0])];
type Ring = (f64, &'static [f64]);

/// Radius of the ball that holds a sphere and all that grows on it, to that of the sphere: 1 + 2/3 + 2/9 + 2/27 + ...
const REACH: f64 = 2.0;

struct Sphere {
    centre: DVec3,
    radius: f64,
    /// Index behind the spheres that grow on this one, which follow it.
    end: usize,
}

/// The flake: in each sphere the density grows from 0 at the surface to 1 at the centre, as 12 bits.
pub fn samples(grid: &Grid) -> Samples {
    let mut spheres = Vec::new();
    let upright = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
    grow(&mut spheres, DVec3::ZERO, RADIUS, upright, GENERATIONS);
    grid.fill(|place, _| twelve_bits(density(&spheres, place))).into()
}

/// Adds a sphere and those that grow on it. The columns of `axes` are two directions around it, and that to its top.
fn grow(spheres: &mut Vec<Sphere>, centre: DVec3, radius: f64, axes: DMat3, generations: u32) {
    let index = spheres.len();
    spheres.push(Sphere { centre, radius, end: index + 1 });
    let rings: &[Ring] = if generations > 0 { &RINGS } else { &[] };
    for &(latitude, longitudes) in rings {
        for longitude in longitudes {
            let [(up, out), (sin, cos)] = [latitude, *longitude].map(sin_cos_degrees);
            let top = axes * DVec3::new(out * cos, out * sin, up);
            let around = axes * DVec3::new(-sin, cos, 0.0);
            let child = radius * SHRINKAGE;
            let centre = centre + top * (radius + child);
            grow(spheres, centre, child, DMat3::from_cols(around, top.cross(around), top), generations - 1);
        }
    }
    spheres[index].end = spheres.len();
}

fn density(spheres: &[Sphere], place: DVec3) -> f64 {
    let mut densest = 0.0_f64;
    let mut index = 0;
    while let Some(sphere) = spheres.get(index) {
        let distance = place.distance(sphere.centre);
        densest = densest.max(1.0 - distance / sphere.radius);
        index = if distance < REACH * sphere.radius { index + 1 } else { sphere.end };
    }
    densest
}
