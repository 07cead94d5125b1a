//! A two-cylinder engine block as a CT scan shows it.
//!
//! The part is constructive solid geometry by signed distances: unions are minima, intersections maxima. Lengths are
//! those of the cube [-1, 1]^3; the crankshaft lies along x, the cylinders stand along y.

use super::grid::Grid;
use super::noise::gaussian;
use crate::file::Samples;
use glam::{DVec2, DVec3};

/// Value of aluminium, which makes up most of the block.
const ALUMINIUM: f64 = 120.0;
/// Value of cast iron: the liners of the cylinders.
const IRON: f64 = 165.0;
/// Value of steel: pistons, rods, crankshaft, bolts.
const STEEL: f64 = 215.0;
/// Standard deviation of the noise.
const NOISE: f64 = 3.0;
/// Width of an edge in samples: a scanner blurs.
const BLUR: f64 = 1.6;

/// Where the two cylinders stand.
const CYLINDERS: [f64; 2] = [-0.38, 0.38];
/// Height of the crankshaft's axis.
const CRANK: f64 = -0.5;
/// How far the crank pins are from that axis.
const THROW: f64 = 0.14;
/// Height of the deck, on which the cylinder head would sit.
const DECK: f64 = 0.62;
/// Radius of the bores.
const BORE: f64 = 0.25;
/// Outer radius of the liners.
const LINER: f64 = 0.29;

/// The scan, 8 bits.
pub fn samples(grid: &Grid) -> Samples {
    let edge = BLUR * grid.step();
    grid.fill_rows(|row, values| {
        let [mut aluminium, mut iron, mut steel] = [(); 3].map(|()| row.coverage(edge));
        for (i, value) in values.iter_mut().enumerate() {
            let place = row.place(i);
            let mut density = ALUMINIUM * aluminium.next(|| casting(place));
            for (material, part) in [
                (IRON, iron.next(|| liners(place))),
                (STEEL, steel.next(|| bolts(place).min(moving_parts(place)))),
            ] {
                density += (material - density) * part;
            }
            *value = (density + NOISE * gaussian(row.first + i) + 0.5).clamp(0.0, 255.0) as u8;
        }
    })
    .into()
}

/// Distance to a box around the origin with half its sides and rounded edges.
fn rounded_box(place: DVec3, half: DVec3, radius: f64) -> f64 {
    let beyond = place.abs() - half + DVec3::splat(radius);
    beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0) - radius
}

/// Distance to a cylinder: `across` in the plane of its circle, `along` its axis from its middle.
fn cylinder(across: DVec2, along: f64, radius: f64, half_length: f64) -> f64 {
    (across.length() - radius).max(along.abs() - half_length)
}

/// Distance to the aluminium casting.
fn casting(place: DVec3) -> f64 {
    let DVec3 { x, y, z } = place;
    let block = rounded_box(place, DVec3::new(0.8, 0.6, 0.42), 0.08);
    let deck = rounded_box(place - DVec3::new(0.0, DECK - 0.06, 0.0), DVec3::new(0.88, 0.07, 0.56), 0.03);
    let skirt = rounded_box(place - DVec3::new(0.0, -0.66, 0.0), DVec3::new(0.84, 0.05, 0.62), 0.02);
    let housing = cylinder(DVec2::new(y - CRANK, z), x, 0.46, 0.8);
    let flange = cylinder(DVec2::new(y - CRANK + 0.02, z), x - 0.86, 0.42, 0.06);
    let ribs = (x.abs() - 0.36).abs() - 0.025;
    let ribs = rounded_box(place, DVec3::new(0.8, 0.5, 0.52), 0.02).max(ribs);
    let solid = block.min(deck).min(skirt).min(housing).min(flange).min(ribs);

    solid.max(-0.71 - y).max(-cavities(place))
}

/// Distance to what is cast or bored out of the block.
fn cavities(place: DVec3) -> f64 {
    let DVec3 { x, y, z } = place;
    let crankcase = cylinder(DVec2::new(y - CRANK, z), x, 0.37, 0.7);
    let webs = x.abs().min((x.abs() - 0.74).abs()) - 0.05;
    let bearing = DVec2::new(y - CRANK, z).length() - 0.12;
    let crankcase = crankcase.max(-webs).min(bearing);
    let mut cavities = crankcase;
    for middle in CYLINDERS {
        let across = DVec2::new(x - middle, z);
        let bore = cylinder(across, y - 0.4, LINER, 0.6);
        let jacket = ((across.length() - 0.35).abs() - 0.03).max((y - 0.2).abs() - 0.26);
        cavities = cavities.min(bore).min(jacket);
    }
    cavities.min(beside_cylinders(place, DECK, 0.045, 0.5))
}

/// Distance to six upright cylinders, where the bolts of the cylinder head are.
fn beside_cylinders(place: DVec3, height: f64, radius: f64, half_length: f64) -> f64 {
    let to_column = place.x.abs().min((place.x.abs() - 0.7).abs());
    cylinder(DVec2::new(to_column, place.z.abs() - 0.34), place.y - height, radius, half_length)
}

/// Distance to the bolts, a little thinner than their holes.
fn bolts(place: DVec3) -> f64 {
    beside_cylinders(place, 0.3, 0.035, 0.2)
}

/// Distance to the liners of the cylinders.
fn liners(place: DVec3) -> f64 {
    let across = |middle| DVec2::new(place.x - middle, place.z).length();
    let liner = |middle| (across(middle) - 0.5 * (BORE + LINER)).abs() - 0.5 * (LINER - BORE);
    CYLINDERS.map(liner).into_iter().fold(f64::INFINITY, f64::min).max((place.y - 0.26).abs() - 0.36)
}

/// Distance to crankshaft, rods and pistons; the two throws are opposite.
fn moving_parts(place: DVec3) -> f64 {
    let DVec3 { x, y, z } = place;
    let mut steel = cylinder(DVec2::new(y - CRANK, z), x, 0.08, 0.98);
    for (middle, throw) in CYLINDERS.into_iter().zip([THROW, -THROW]) {
        let pin = CRANK + throw;
        let along = x - middle;
        let crank_pin = cylinder(DVec2::new(y - pin, z), along, 0.07, 0.14);
        let web = rounded_box(
            DVec3::new(along.abs() - 0.14, y - CRANK - 0.35 * throw, z),
            DVec3::new(0.03, 0.17, 0.12),
            0.02,
        );
        let piston_height = pin + 0.62;
        let rod = rounded_box(
            DVec3::new(along, y - 0.5 * (pin + piston_height), z),
            DVec3::new(0.035, 0.3, 0.06),
            0.02,
        );
        let across = DVec2::new(along, z);
        let piston = cylinder(across, y - piston_height, BORE - 0.015, 0.13);
        let hollow = cylinder(across, y - piston_height + 0.06, BORE - 0.06, 0.13);
        let gudgeon = cylinder(DVec2::new(y - piston_height, z), along, 0.05, 0.2);
        steel = steel.min(crank_pin).min(web).min(rod).min(piston.max(-hollow)).min(gudgeon);
    }
    steel
}
