//! The test signal of Marschner and Lobb (1994).

use super::grid::{Grid, twelve_bits};
use crate::file::Samples;
use glam::DVec3;
use std::f64::consts::PI;

/// Frequency fM of the waves.
const FREQUENCY: f64 = 6.0;
/// Amplitude alpha of the waves.
const AMPLITUDE: f64 = 0.25;

/// The signal, 0..=1 as 12 bits.
pub fn samples(grid: &Grid) -> Samples {
    grid.fill(|place, _| twelve_bits(signal(place))).into()
}

/// (1 - sin(pi z / 2) + alpha (1 + rho(sqrt(x^2 + y^2)))) / (2 (1 + alpha)), where
/// rho(r) = cos(2 pi fM cos(pi r / 2)).
fn signal(place: DVec3) -> f64 {
    let radius = libm::sqrt(place.x * place.x + place.y * place.y);
    let wave = libm::cos(2.0 * PI * FREQUENCY * libm::cos(0.5 * PI * radius));
    (1.0 - libm::sin(0.5 * PI * place.z) + AMPLITUDE * (1.0 + wave)) / (2.0 * (1.0 + AMPLITUDE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signal_has_the_values_of_its_definition() {
        let close = |place: [f64; 3], value: f64| {
            assert!((signal(DVec3::from_array(place)) - value).abs() < 1e-12, "{place:?}");
        };
        // On the axis the wave is cos(12 pi) = 1, where x = 1 it is cos(0) = 1.
        close([0.0, 0.0, -1.0], 1.0);
        close([0.0, 0.0, 0.0], 0.6);
        close([0.0, 0.0, 1.0], 0.2);
        close([1.0, 0.0, 0.0], 0.6);
        // cos(pi r / 2) = 11/12: the wave is cos(11 pi) = -1.
        let radius = (11.0_f64 / 12.0).acos() * 2.0 / PI;
        close([0.0, radius, 1.0], 0.0);
    }
}
