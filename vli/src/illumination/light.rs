use glam::DVec3;

/// A directional white light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Direction in which the light travels, world space, unit length.
    direction: DVec3,
    intensity: f64,
}

impl Light {
    /// A light that travels along `direction` (world space, any length but zero) with `intensity` 0..=1; `None` if
    /// either is not usable.
    #[must_use]
    pub fn new(direction: DVec3, intensity: f64) -> Option<Self> {
        let direction = direction.is_finite().then(|| direction.try_normalize()).flatten()?;
        (0.0..=1.0).contains(&intensity).then_some(Self { direction, intensity })
    }

    /// Direction in which the light travels, unit length.
    #[must_use]
    pub const fn direction(&self) -> DVec3 {
        self.direction
    }

    /// Intensity, 0..=1.
    #[must_use]
    pub const fn intensity(&self) -> f64 {
        self.intensity
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_without_direction_or_beyond_full_intensity_are_refused() {
        assert!(Light::new(DVec3::ZERO, 1.0).is_none());
        assert!(Light::new(DVec3::new(f64::NAN, 0.0, 1.0), 1.0).is_none());
        assert!(Light::new(DVec3::new(f64::INFINITY, 0.0, 1.0), 1.0).is_none());
        for intensity in [-0.1, 1.1, f64::NAN] {
            assert!(Light::new(DVec3::Z, intensity).is_none(), "{intensity}");
        }
        assert_eq!(Light::new(DVec3::new(0.0, 0.0, -7.0), 0.5).unwrap().direction(), DVec3::NEG_Z);
    }
}
