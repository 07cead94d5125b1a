//! What an ideal ray accumulates.

use vg500_regs::BlendMode;

/// The accumulators of a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ray {
    /// R, G, B: premultiplied (alpha), of the extreme sample (MIP, MinIP), or sums of premultiplied ones.
    pub color: [f64; 3],
    /// Opacity, of all samples, of the extreme one, or their sum.
    pub alpha: f64,
    /// Extreme value among the visible samples, once there is one (MIP, MinIP).
    pub extreme: Option<f64>,
    /// Number of visible samples.
    pub samples: u32,
}

impl Ray {
    /// Blends the next visible sample: its value, and its R, G, B (not premultiplied) and A.
    pub fn blend(&mut self, mode: BlendMode, value: f64, [r, g, b, a]: [f64; 4]) {
        self.samples += 1;
        match mode {
            BlendMode::Alpha => self.add([r, g, b], (1.0 - self.alpha) * a),
            BlendMode::Sum => self.add([r, g, b], a),
            BlendMode::Maximum if self.extreme.is_some_and(|extreme| value <= extreme) => {}
            BlendMode::Minimum if self.extreme.is_some_and(|extreme| value >= extreme) => {}
            BlendMode::Maximum | BlendMode::Minimum => {
                self.color = [r, g, b];
                self.alpha = a;
                self.extreme = Some(value);
            }
        }
    }

    fn add(&mut self, color: [f64; 3], weight: f64) {
        for (accumulated, color) in self.color.iter_mut().zip(color) {
            *accumulated += weight * color;
        }
        self.alpha += weight;
    }

    /// The pixel of the ray: R, G, B, A. Sums are divided by the number of samples; without samples it is zero.
    #[must_use]
    pub fn pixel(&self, mode: BlendMode) -> [f64; 4] {
        let [r, g, b] = self.color;
        let divisor = if mode == BlendMode::Sum { f64::from(self.samples.max(1)) } else { 1.0 };
        [r, g, b, self.alpha].map(|channel| channel / divisor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blended(mode: BlendMode, samples: &[(f64, [f64; 4])]) -> Ray {
        let mut ray = Ray::default();
        samples.iter().for_each(|&(value, color)| ray.blend(mode, value, color));
        ray
    }

    #[test]
    fn rays_without_samples_are_zero() {
        for mode in [BlendMode::Alpha, BlendMode::Maximum, BlendMode::Minimum, BlendMode::Sum] {
            assert_eq!(Ray::default().pixel(mode), [0.0; 4]);
        }
    }

    #[test]
    fn fog_follows_the_power_law() {
        let ray = blended(BlendMode::Alpha, &[(0.0, [1.0, 0.5, 0.0, 0.01]); 200]);
        let opacity = 1.0 - 0.99f64.powi(200);
        assert!((ray.alpha - opacity).abs() < 1e-12);
        assert!((ray.color[1] - opacity / 2.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_opaque_hides_what_follows() {
        let ray = blended(BlendMode::Alpha, &[(0.0, [0.5; 4]), (0.0, [0.2, 0.2, 0.2, 1.0]), (0.0, [1.0; 4])]);
        assert_eq!((ray.alpha, ray.samples), (1.0, 3));
        assert!((ray.color[0] - (0.25 + 0.1)).abs() < 1e-15);
    }

    #[test]
    fn equal_extremes_keep_the_nearer_sample() {
        let samples = [(-2.0, [0.1; 4]), (5.0, [0.2; 4]), (5.0, [0.3; 4]), (-2.0, [0.4; 4])];
        let most = blended(BlendMode::Maximum, &samples);
        assert_eq!((most.pixel(BlendMode::Maximum), most.extreme), ([0.2; 4], Some(5.0)));
        let least = blended(BlendMode::Minimum, &samples);
        assert_eq!((least.pixel(BlendMode::Minimum), least.extreme), ([0.1; 4], Some(-2.0)));
    }

    #[test]
    fn sums_are_means_of_what_samples_shine() {
        let ray = blended(BlendMode::Sum, &[(0.0, [1.0, 0.0, 0.5, 0.5]), (0.0, [1.0, 1.0, 1.0, 0.25])]);
        assert_eq!(ray.pixel(BlendMode::Sum), [0.375, 0.125, 0.25, 0.375]);
    }
}
