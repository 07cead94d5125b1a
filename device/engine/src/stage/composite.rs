//! Compositing (paper, section 3.6): samples accumulate along rays, front to back.

use super::classify::Classified;
use crate::fixed::{FULL, product};
use vg500_regs::BlendMode;

/// The accumulators of a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ray {
    /// R, G, B: 12 bits, or 27 bits as sums.
    pub color: [u32; 3],
    /// Opacity: 12 bits, or 27 bits as a sum.
    pub alpha: u32,
    /// Extreme sample value so far (MIP and MinIP).
    pub extreme: u16,
    /// Whether a sample has been seen (MIP and MinIP), so that rays of all zeros do not stay blank.
    pub valid: bool,
    /// Number of samples (weighted sum).
    pub samples: u32,
}

impl Ray {
    /// Blends a visible sample: its value and its illuminated colour and opacity.
    pub fn blend(&mut self, mode: BlendMode, value: u16, sample: Classified) {
        match mode {
            BlendMode::Alpha => self.blend_alpha(sample),
            BlendMode::Maximum => self.blend_extreme(value, sample, value > self.extreme),
            BlendMode::Minimum => self.blend_extreme(value, sample, value < self.extreme),
            BlendMode::Sum => self.blend_sum(sample),
        }
    }

    /// Goes on with what has been accumulated in another section. Alpha blending leaves the extreme value alone: it
    /// stays what the ray began with.
    pub const fn resume(&mut self, mode: BlendMode, accumulated: Self) {
        *self = match mode {
            BlendMode::Alpha => Self { extreme: self.extreme, valid: self.valid, ..accumulated },
            _ => accumulated,
        };
    }

    /// Blends a sample of the cursor over what the ray has accumulated: C = a c + (1 - a) C, A likewise. Sums
    /// become those of as many samples as before, at least one.
    pub fn cover(&mut self, mode: BlendMode, cursor: Classified) {
        if mode == BlendMode::Sum {
            self.samples = self.samples.max(1);
        }
        let weight = if mode == BlendMode::Sum { self.samples } else { 1 };
        let transparency = u64::from(FULL - cursor.alpha);
        let over = |front: u16, behind: u32| {
            let shining = (u64::from(behind) * transparency + 2048) >> 12;
            u32::from(front) * weight + shining as u32
        };
        for (accumulated, color) in self.color.iter_mut().zip(cursor.color) {
            *accumulated = over(product(color, cursor.alpha), *accumulated);
        }
        self.alpha = over(cursor.alpha, self.alpha);
    }

    /// C += (1 - A) a c, A += (1 - A) a.
    fn blend_alpha(&mut self, sample: Classified) {
        let transparency = FULL - self.alpha as u16;
        for (accumulated, color) in self.color.iter_mut().zip(sample.color) {
            *accumulated += u32::from(product(product(color, sample.alpha), transparency));
        }
        self.alpha += u32::from(product(sample.alpha, transparency));
    }

    /// Keeps colour and opacity of the sample of extreme value; equal values keep the nearer one.
    fn blend_extreme(&mut self, value: u16, sample: Classified, beats: bool) {
        if beats || !self.valid {
            self.color = sample.color.map(u32::from);
            self.alpha = u32::from(sample.alpha);
            self.extreme = value;
            self.valid = true;
        }
    }

    /// C += a c, A += a, count += 1.
    fn blend_sum(&mut self, sample: Classified) {
        for (sum, color) in self.color.iter_mut().zip(sample.color) {
            *sum += u32::from(product(color, sample.alpha));
        }
        self.alpha += u32::from(sample.alpha);
        self.samples += 1;
    }

    /// The pixel of the ray: R, G, B, A of 12 bits. Sums are divided by the number of samples, rounded half up.
    #[must_use]
    pub fn pixel(&self, mode: BlendMode) -> [u16; 4] {
        let [r, g, b] = self.color;
        let channels = [r, g, b, self.alpha];
        if mode != BlendMode::Sum {
            return channels.map(|channel| channel as u16);
        }
        channels.map(|sum| {
            let mean = (2 * sum + self.samples).checked_div(2 * self.samples);
            mean.unwrap_or(0).min(u32::from(FULL)) as u16
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const fn sample(color: u16, alpha: u16) -> Classified {
        Classified { color: [color, 0, 4095], alpha }
    }

    #[test]
    fn alpha_hand_worked() {
        let mut ray = Ray::default();
        // a c = 2000 * 1000 / 4096 = 488.3; times 4095 / 4096 = 487.9
        ray.blend(BlendMode::Alpha, 0, sample(2000, 1000));
        assert_eq!((ray.color, ray.alpha), ([488, 0, 1000], 1000));
        // 3095 of 4095 shine through: 488 * 3095 / 4096 = 368.7, 1000 * 3095 / 4096 = 755.6
        ray.blend(BlendMode::Alpha, 0, sample(2000, 1000));
        assert_eq!((ray.color, ray.alpha), ([488 + 369, 0, 1756], 1756));
    }

    #[test]
    fn opaque_white_is_white_and_hides_what_follows() {
        let mut ray = Ray::default();
        ray.blend(BlendMode::Alpha, 0, sample(4095, 4095));
        assert_eq!((ray.color[0], ray.alpha), (4093, 4094));
        ray.blend(BlendMode::Alpha, 0, sample(4095, 4095));
        assert_eq!((ray.color[0], ray.alpha), (4094, 4095));
        ray.blend(BlendMode::Alpha, 0, sample(4095, 4095));
        assert_eq!((ray.color[0], ray.alpha), (4094, 4095));
    }

    #[test]
    fn thin_fog_stalls_where_the_manual_says() {
        let fog = |alpha| {
            let mut ray = Ray::default();
            (0..2048).for_each(|_| ray.blend(BlendMode::Alpha, 0, sample(0, alpha)));
            ray.alpha
        };
        assert_eq!(fog(1), 2048);
        assert_eq!(fog(8), 3840);
    }

    #[test]
    fn extremes_start_with_the_first_sample_and_keep_the_nearer() {
        let mut least = Ray::default();
        least.blend(BlendMode::Minimum, 4095, sample(1, 1));
        assert_eq!((least.extreme, least.valid, least.color[0]), (4095, true, 1));
        least.blend(BlendMode::Minimum, 4095, sample(2, 2));
        assert_eq!(least.color[0], 1);
        least.blend(BlendMode::Minimum, 4094, sample(3, 3));
        assert_eq!((least.color[0], least.alpha), (3, 3));
        let mut most = Ray::default();
        most.blend(BlendMode::Maximum, 0, sample(7, 4095));
        assert_eq!((most.color[0], most.valid), (7, true));
        most.blend(BlendMode::Maximum, 0, sample(8, 4095));
        assert_eq!(most.color[0], 7);
    }

    #[test]
    fn the_cursor_covers_what_is_there() {
        let mut ray = Ray { color: [4000, 0, 100], alpha: 4095, extreme: 9, valid: true, samples: 0 };
        // 2048 * 2048 / 4096 = 1024, 4000 * 2047 / 4096 = 1999.0; 4095 * 2047 / 4096 = 2046.5 goes up
        ray.cover(BlendMode::Maximum, sample(2048, 2048));
        assert_eq!((ray.color[0], ray.alpha, ray.extreme), (1024 + 1999, 2048 + 2047, 9));
        let mut sums = Ray { color: [0, 0, 3000], alpha: 0, samples: 3, ..Ray::default() };
        sums.cover(BlendMode::Sum, sample(4095, 4095));
        assert_eq!(sums.pixel(BlendMode::Sum), [4094, 0, 4094, 4095]);
        let mut empty = Ray::default();
        empty.cover(BlendMode::Sum, sample(4095, 4095));
        assert_eq!(empty.pixel(BlendMode::Sum)[3], 4095);
    }

    #[test]
    fn sums_are_divided_by_the_number_of_samples() {
        let mut ray = Ray::default();
        assert_eq!(ray.pixel(BlendMode::Sum), [0; 4]);
        ray.blend(BlendMode::Sum, 0, sample(4095, 4095));
        ray.blend(BlendMode::Sum, 0, sample(4095, 2));
        assert_eq!(ray.samples, 2);
        // (4094 + 2) / 2, (4095 + 2) / 2 = 2048.5 goes up
        assert_eq!(ray.pixel(BlendMode::Sum), [2048, 0, 2048, 2049]);
    }

    proptest! {
        #[test]
        fn accumulators_never_leave_twelve_bits(samples in prop::collection::vec((0..=4095u16, 0..=4095u16), 0..300)) {
            let mut ray = Ray::default();
            for (color, alpha) in samples {
                ray.blend(BlendMode::Alpha, 0, Classified { color: [color; 3], alpha });
                prop_assert!(ray.alpha <= 4095 && ray.color[0] <= 4095);
            }
        }
    }
}
