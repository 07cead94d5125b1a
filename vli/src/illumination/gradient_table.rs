use glam::DMat3;
use vg500_regs::limit::GRADIENT_MAGNITUDE_ENTRIES;

/// Entries of a gradient table as applications give it (`GetGradientTableLength`).
pub const GRADIENT_TABLE_LENGTH: usize = 8;

/// Greatest magnitude the card computes: round(sqrt(3) 127) (paper, section 3.3).
pub(crate) const GREATEST: f64 = 220.0;

/// The card's gradient-magnitude table for a piecewise-linear function, given by its values (0..=1) at magnitudes
/// 0, 1/7, ..., 1 of the greatest. Beyond the last it stays as it is.
///
/// The card measures magnitudes per voxel. `model` is the linear part of the model matrix: with unequal spacings a
/// magnitude is scaled by the root mean square of 1/spacing over directions, times the mean spacing, so that it
/// means on average what it would in a volume of that spacing.
#[must_use]
pub fn gradient_magnitude_table(
    function: &[f64; GRADIENT_TABLE_LENGTH],
    model: DMat3,
) -> [u8; GRADIENT_MAGNITUDE_ENTRIES] {
    let correction = anisotropy(model);
    core::array::from_fn(|magnitude| {
        let place = magnitude as f64 * correction / GREATEST * (GRADIENT_TABLE_LENGTH - 1) as f64;
        let before = (place as usize).min(GRADIENT_TABLE_LENGTH - 2);
        let part = (place - before as f64).min(1.0);
        let value = function[before] + (function[before + 1] - function[before]) * part;
        (value.clamp(0.0, 1.0) * 255.0).round() as u8
    })
}

/// Mean spacing times the root mean square of world gradients of unit voxel gradients; 1 in isotropic volumes.
pub(crate) fn anisotropy(model: DMat3) -> f64 {
    let squares: f64 = model.inverse().to_cols_array().iter().map(|entry| entry * entry).sum();
    let spacing = (model.x_axis.length() + model.y_axis.length() + model.z_axis.length()) / 3.0;
    spacing * (squares / 3.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const RAMP: [f64; 8] = [0.0, 1.0 / 7.0, 2.0 / 7.0, 3.0 / 7.0, 4.0 / 7.0, 5.0 / 7.0, 6.0 / 7.0, 1.0];

    #[test]
    fn the_linear_ramp_is_linear_and_stays_full() {
        let table = gradient_magnitude_table(&RAMP, DMat3::from_diagonal(DVec3::splat(0.3)));
        assert_eq!((table[0], table[110], table[220], table[255]), (0, 128, 255, 255));
        for magnitude in 0..=220u32 {
            let exact = f64::from(magnitude) / 220.0 * 255.0;
            assert!((f64::from(table[magnitude as usize]) - exact).abs() <= 0.5 + 1e-9);
        }
    }

    #[test]
    fn anisotropy_raises_magnitudes_and_rotation_does_not() {
        let model = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 2.0));
        let expected = 4.0 / 3.0 * (2.25_f64 / 3.0).sqrt();
        assert!((anisotropy(model) - expected).abs() < 1e-12);
        let turned = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X) * 5.0;
        assert!((anisotropy(turned) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn values_beyond_the_range_are_clamped() {
        let table = gradient_magnitude_table(&[-1.0, 2.0, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5], DMat3::IDENTITY);
        assert_eq!((table[0], table[31]), (0, 255));
    }
}
