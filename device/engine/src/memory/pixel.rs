//! Rays as they are stored in a base plane.

use crate::fixed::{FULL, narrow};
use crate::stage::composite::Ray;
use vg500_regs::format::SUM_BITS;
use vg500_regs::{BlendMode, PlaneFormat};

const SUM_MASK: u128 = (1 << SUM_BITS) - 1;

/// Appends a ray to `bytes` in a base plane's format, little-endian.
pub fn store(ray: &Ray, blend: BlendMode, format: PlaneFormat, bytes: &mut Vec<u8>) {
    match format {
        PlaneFormat::Rgba8 => bytes.extend(ray.pixel(blend).map(narrow)),
        PlaneFormat::Accumulator64 => bytes.extend(accumulator(ray).to_le_bytes()),
        PlaneFormat::Sum128 => bytes.extend(sum(ray).to_le_bytes()),
    }
}

/// The ray that `bytes` hold in one of the wide formats; rays of RGBA8 planes begin empty.
#[must_use]
pub fn load(bytes: &[u8], format: PlaneFormat) -> Ray {
    let mut word = [0; 16];
    for (place, byte) in word.iter_mut().zip(bytes) {
        *place = *byte;
    }
    let word = u128::from_le_bytes(word);
    match format {
        PlaneFormat::Rgba8 => Ray::default(),
        PlaneFormat::Accumulator64 => Ray {
            color: [0, 12, 24].map(|shift| (word >> shift) as u32 & u32::from(FULL)),
            alpha: (word >> 36) as u32 & u32::from(FULL),
            extreme: (word >> 48) as u16 & FULL,
            valid: word >> 60 & 1 != 0,
            samples: 0,
        },
        PlaneFormat::Sum128 => Ray {
            color: [0, 1, 2].map(|channel| (word >> (SUM_BITS * channel) & SUM_MASK) as u32),
            alpha: (word >> (3 * SUM_BITS) & SUM_MASK) as u32,
            samples: (word >> (4 * SUM_BITS)) as u32,
            ..Ray::default()
        },
    }
}

// Only rays that began with accumulators of the host's own making can come to hold more than a format; they
// saturate.

fn accumulator(ray: &Ray) -> u64 {
    let [r, g, b] = ray.color.map(|color| u64::from(color).min(u64::from(FULL)));
    let extreme = u64::from(ray.extreme) << 48 | u64::from(ray.valid) << 60;
    r | g << 12 | b << 24 | u64::from(ray.alpha) << 36 | extreme
}

fn sum(ray: &Ray) -> u128 {
    let [r, g, b] = ray.color.map(|sum| u128::from(sum).min(SUM_MASK));
    let alpha = u128::from(ray.alpha).min(SUM_MASK);
    let samples = u128::from(ray.samples) << (4 * SUM_BITS);
    r | g << SUM_BITS | b << (2 * SUM_BITS) | alpha << (3 * SUM_BITS) | samples
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accumulators_come_back() {
        let ray = Ray { color: [1, 4095, 0x123], alpha: 0xabc, extreme: 0xfed, valid: true, samples: 0 };
        let mut bytes = Vec::new();
        store(&ray, BlendMode::Maximum, PlaneFormat::Accumulator64, &mut bytes);
        assert_eq!(bytes, 0x1fed_abc1_23ff_f001_u64.to_le_bytes());
        assert_eq!(load(&bytes, PlaneFormat::Accumulator64), ray);
    }

    #[test]
    fn the_greatest_sums_come_back() {
        let most = 4095 * 32768;
        let ray = Ray { color: [most, 0, most - 1], alpha: most, samples: 32768, ..Ray::default() };
        let mut bytes = Vec::new();
        store(&ray, BlendMode::Sum, PlaneFormat::Sum128, &mut bytes);
        assert_eq!(bytes.len(), 16);
        assert_eq!(load(&bytes, PlaneFormat::Sum128), ray);
    }

    #[test]
    fn a_channel_never_spills_into_the_next() {
        let over = Ray { color: [8189, 0, 4096], alpha: 7, ..Ray::default() };
        let mut bytes = Vec::new();
        store(&over, BlendMode::Alpha, PlaneFormat::Accumulator64, &mut bytes);
        let stored = load(&bytes, PlaneFormat::Accumulator64);
        assert_eq!((stored.color, stored.alpha), ([4095, 0, 4095], 7));
    }

    #[test]
    fn rgba8_is_rounded_and_in_byte_order() {
        let ray = Ray { color: [4095, 2048, 8], alpha: 4080, ..Ray::default() };
        let mut bytes = Vec::new();
        store(&ray, BlendMode::Alpha, PlaneFormat::Rgba8, &mut bytes);
        assert_eq!(bytes, [255, 128, 0, 254]);
    }
}
