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
    /// Blends the next visible sample: its value, and its R, G, B (not premultiplied) and A, which are asked for
    /// only if they matter.
    pub fn blend(&mut self, mode: BlendMode, value: f64, color: impl FnOnce() -> [f64; 4]) {
        self.samples += 1;
        match mode {
            BlendMode::Alpha => self.behind(color),
            BlendMode::Sum => self.add(color(), 1.0),
            BlendMode::Maximum if self.extreme.is_some_and(|extreme| value <= extreme) => {}
            BlendMode::Minimum if self.extreme.is_some_and(|extreme| value >= extreme) => {}
            BlendMode::Maximum | BlendMode::Minimum => {
                let [r, g, b, a] = color();
                self.color = [r, g, b];
                self.alpha = a;
                self.extreme = Some(value);
            }
        }
    }

    /// Blends R, G, B (not premultiplied) and A behind what has accumulated.
    pub(super) fn behind(&mut self, color: impl FnOnce() -> [f64; 4]) {
        let transparency = 1.0 - self.alpha;
        if transparency > 0.0 {
            self.add(color(), transparency);
        }
    }

    fn add(&mut self, [r, g, b, a]: [f64; 4], weight: f64) {
        for (accumulated, color) in self.color.iter_mut().zip([r, g, b]) {
            *accumulated += weight * a * color;
        }
        self.alpha += weight * a;
    }

    /// Blends a sample of the cursor over a finished ray. A sum becomes that of as many samples as before, at
    /// least one.
    pub fn cover(&mut self, mode: BlendMode, [r, g, b, a]: [f64; 4]) {
        if mode == BlendMode::Sum {
            self.samples = self.samples.max(1);
        }
        let weight = if mode == BlendMode::Sum { f64::from(self.samples) } else { 1.0 };
        self.color = self.color.map(|behind| behind * (1.0 - a));
        self.alpha *= 1.0 - a;
        self.add([r, g, b, a], weight);
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
        samples.iter().for_each(|&(value, color)| ray.blend(mode, value, || color));
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

    #[test]
    fn colors_that_cannot_matter_are_not_asked_for() {
        let never = || panic!("nobody sees it");
        let mut opaque = blended(BlendMode::Alpha, &[(0.0, [0.5, 0.5, 0.5, 1.0])]);
        opaque.blend(BlendMode::Alpha, 0.0, never);
        let mut most = blended(BlendMode::Maximum, &[(5.0, [0.5; 4])]);
        most.blend(BlendMode::Maximum, 5.0, never);
        let mut least = blended(BlendMode::Minimum, &[(5.0, [0.5; 4])]);
        least.blend(BlendMode::Minimum, 5.0, never);
        assert_eq!([opaque.samples, most.samples, least.samples], [2; 3]);
    }

    #[test]
    fn the_cursor_covers_what_is_there() {
        let cursor = [1.0, 0.5, 0.0, 0.25];
        let mut most = blended(BlendMode::Maximum, &[(5.0, [0.4, 0.0, 0.8, 1.0])]);
        most.cover(BlendMode::Maximum, cursor);
        assert_eq!(most.pixel(BlendMode::Maximum), [0.3 + 0.25, 0.125, 0.8 * 0.75, 1.0]);
        let mut sum = blended(BlendMode::Sum, &[(0.0, [1.0, 0.0, 0.0, 0.5]), (0.0, [0.0, 0.0, 0.0, 0.5])]);
        sum.cover(BlendMode::Sum, cursor);
        assert_eq!(sum.pixel(BlendMode::Sum), [0.25 * 0.75 + 0.25, 0.125, 0.0, 0.5 * 0.75 + 0.25]);
        let mut empty = Ray::default();
        empty.cover(BlendMode::Sum, cursor);
        assert_eq!(empty.pixel(BlendMode::Sum), [0.25, 0.125, 0.0, 0.25]);
    }
}
