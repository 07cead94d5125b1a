//! What the reflectance maps may give for an 8-bit gradient.
//!
//! **Cube vector.** Stretching to the cube multiplies by round(14336 / major) / 128, off by at most
//! 127 / 256, and rounds: 1/2. So components are off by less than 1 of 112; the major one is exact. On an edge of
//! the cube both faces have the same entries.
//!
//! **Reflection.** With n off by e (|e| <= 1 along the minor axes), (n . x) n - n^2 x / 2 of the eye register x is
//! off by (e . x) n + (n . x) e - (n . e) x + (e . x) e - e^2 x / 2. The cosine is a sum of three products rounded
//! to 1/128, n^2 / 2 loses 1/2, and both products are rounded. Stretching it is off by less than 1 of 112, as the
//! tests of that stage show for every major component.
//!
//! **Look-up.** In a rectangle inside of a cell, a bilinear function is greatest and least at corners. In units of
//! u = 2^-15 the card's result is at most 4 below the exact one and never above it: two truncations to 1/128 of an
//! entry, one in the step from 32640 to 32767, and 32767 for 1.

use super::Range;
use vg500_regs::reflectance::{FACE, VERTICES, face_axes};

/// Half a face, and a cell, in map coordinates.
const HALF_FACE: f64 = 112.0;
const CELL: f64 = 32.0;
/// Step of the card's factors.
pub const UNIT: f64 = 1.0 / 32768.0;

/// The diffuse intensity, 0..=1, of a gradient that is not zero.
pub fn diffuse(map: &[u8], gradient: [i32; 3]) -> Range {
    let (axis, vector) = cube_vector(gradient);
    let minor = face_axes(axis).map(|minor| [vector[minor] - 1.0, vector[minor] + 1.0]);
    look_up(map, axis, vector[axis] < 0.0, minor)
}

/// The specular intensity, 0..=1, of a gradient that is not zero, for an eye register.
pub fn specular(map: &[u8], gradient: [i32; 3], eye: [i16; 3]) -> Range {
    let (major, n) = cube_vector(gradient);
    let x = eye.map(|component| f64::from(component) * UNIT);
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|axis| a[axis] * b[axis]).sum::<f64>();
    let (cosine, half_square) = (dot(n, x), dot(n, n) / 2.0);
    let reflected = [0, 1, 2].map(|axis| cosine * n[axis] - half_square * x[axis]);
    let [in_eye, in_n] =
        [x, n].map(|vector| face_axes(major).map(|minor| vector[minor].abs()).iter().sum::<f64>());
    let error = [0, 1, 2].map(|axis| {
        let e = if axis == major { 0.0 } else { 1.0 };
        let (n, x) = (n[axis].abs(), x[axis].abs());
        let stretching = in_eye * n + cosine.abs() * e + in_n * x + in_eye * e + x;
        stretching + 3.0 / 256.0 * (n + e) + 0.5 * x + 1.0
    });
    // Every axis that may be the major one of the card's vector.
    let least = |axis: usize| reflected[axis].abs() - error[axis];
    let longest = (0..3).map(least).fold(0.0, f64::max);
    let majors = (0..3).filter(|&axis| reflected[axis].abs() + error[axis] >= longest);
    majors.fold([1.0, 0.0], |range, axis| {
        assert!(least(axis) > 0.0, "reflections are long");
        let minor =
            face_axes(axis).map(|minor| ratio(reflected[minor], error[minor], reflected[axis], error[axis]));
        hull(range, look_up(map, axis, reflected[axis] < 0.0, minor))
    })
}

/// Major axis of a gradient, and where it meets the cube.
fn cube_vector(gradient: [i32; 3]) -> (usize, [f64; 3]) {
    let axis = (0..3).max_by_key(|&axis| gradient[axis].abs()).unwrap();
    let major = f64::from(gradient[axis].abs());
    (axis, gradient.map(|component| f64::from(component) * HALF_FACE / major))
}

/// Map coordinate of a minor component beside a major one, both not exactly known.
fn ratio(minor: f64, minor_error: f64, major: f64, major_error: f64) -> Range {
    let majors = [major.abs() - major_error, major.abs() + major_error];
    let quotients = |minor: f64| majors.map(|major| HALF_FACE * minor / major);
    let [low, high] = [quotients(minor - minor_error), quotients(minor + minor_error)];
    [low[0].min(low[1]) - 1.0, high[0].max(high[1]) + 1.0]
}

pub const fn hull(a: Range, b: Range) -> Range {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Intensities that a map gives in a rectangle of a face.
fn look_up(map: &[u8], axis: usize, negative: bool, rectangle: [Range; 2]) -> Range {
    let face = &map[(2 * axis + usize::from(negative)) * FACE..][..FACE];
    let [columns, rows] = rectangle.map(|[low, high]| {
        let ends = [low, high].map(|end| end.clamp(-HALF_FACE, HALF_FACE));
        let lines = (0..VERTICES).map(|line| CELL * line as f64 - HALF_FACE);
        let between: Vec<f64> = lines.filter(|line| (ends[0]..ends[1]).contains(line)).collect();
        [ends.to_vec(), between].concat()
    });
    let mut range = [1.0, 0.0];
    for &v in &rows {
        for &u in &columns {
            let intensity = interpolated(face, u, v);
            range = hull(range, [intensity; 2]);
        }
    }
    [(range[0] - 4.0 * UNIT).max(0.0), range[1]]
}

/// What the entries of a face give at map coordinates, without rounding.
pub fn interpolated(face: &[u8], u: f64, v: f64) -> f64 {
    let cell = |coordinate: f64| {
        let place = (coordinate + HALF_FACE) / CELL;
        let first = (place as usize).min(VERTICES - 2);
        (first, place - first as f64)
    };
    let ((column, across), (row, down)) = (cell(u), cell(v));
    let entry = |row: usize, column: usize| f64::from(face[row * VERTICES + column]) / 255.0;
    let along = |row| entry(row, column) * (1.0 - across) + entry(row, column + 1) * across;
    along(row) * (1.0 - down) + along(row + 1) * down
}
