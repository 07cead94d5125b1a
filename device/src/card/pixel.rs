//! Pixels on their way from a base plane to host memory: conversion between formats.
//!
//! Every pixel passes as four components of 12 bits. Components of 8 bits are widened by replication, which
//! narrowing undoes exactly; those of 4 bits are rounded to nearest.

use vg500_engine::fixed::{FULL, narrow, widen};
use vg500_regs::PixelFormat;

/// R, G, B and A, 12 bits each.
type Components = [u16; 4];

/// The formats of base planes that a transfer can read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// Bytes R, G, B, A.
    Rgba8,
    /// The accumulators of alpha blending, MIP and MinIP.
    Accumulator64,
}

impl Source {
    /// Appends the pixels of `stored`, which are of this format, to `converted` in the format `target`.
    pub(super) fn convert(self, stored: &[u8], target: PixelFormat, converted: &mut Vec<u8>) {
        match self {
            Self::Rgba8 => {
                for pixel in stored.as_chunks().0 {
                    append(target, components_of_bytes(*pixel), converted);
                }
            }
            Self::Accumulator64 => {
                for pixel in stored.as_chunks().0 {
                    append(target, components_of_accumulators(*pixel), converted);
                }
            }
        }
    }
}

fn components_of_bytes(pixel: [u8; 4]) -> Components {
    pixel.map(widen)
}

fn components_of_accumulators(pixel: [u8; 8]) -> Components {
    let word = u64::from_le_bytes(pixel);
    [0, 12, 24, 36].map(|shift| (word >> shift) as u16 & FULL)
}

fn append(format: PixelFormat, components: Components, bytes: &mut Vec<u8>) {
    let ordered = order(format, components);
    match format.bytes() {
        2 => {
            let nibbles = ordered.map(nibble).into_iter().rev();
            let word = nibbles.fold(0, |word, nibble| word << 4 | nibble);
            bytes.extend(word.to_le_bytes());
        }
        4 => bytes.extend(ordered.map(narrow)),
        _ => bytes.extend(ordered.map(u16::to_le_bytes).as_flattened()),
    }
}

/// Components from the lowest address or bit on.
const fn order(format: PixelFormat, [r, g, b, a]: Components) -> Components {
    match format {
        PixelFormat::Rgba8 | PixelFormat::Rgba4 | PixelFormat::Rgba12 => [r, g, b, a],
        PixelFormat::Bgra8 | PixelFormat::Bgra4 | PixelFormat::Bgra12 => [b, g, r, a],
        PixelFormat::Argb8 | PixelFormat::Argb4 | PixelFormat::Argb12 => [a, r, g, b],
        PixelFormat::Abgr8 | PixelFormat::Abgr4 | PixelFormat::Abgr12 => [a, b, g, r],
    }
}

/// round(15 x / 4095).
const fn nibble(component: u16) -> u16 {
    (component + 136) / 273
}

#[cfg(test)]
mod tests {
    use super::*;

    fn converted(source: Source, stored: &[u8], target: PixelFormat) -> Vec<u8> {
        let mut bytes = Vec::new();
        source.convert(stored, target, &mut bytes);
        bytes
    }

    fn formats() -> impl Iterator<Item = PixelFormat> {
        (0..12).map(|code| PixelFormat::from_code(code).unwrap())
    }

    fn accumulators([r, g, b, a]: [u64; 4]) -> [u8; 8] {
        // The extreme value and the flag stand above the components and do not matter.
        (r | g << 12 | b << 24 | a << 36 | 0x1abc << 48).to_le_bytes()
    }

    #[test]
    fn a_pixel_cut_short_is_no_pixel() {
        for format in formats() {
            assert!(converted(Source::Rgba8, &[1, 2, 3], format).is_empty());
            assert_eq!(converted(Source::Accumulator64, &[0; 15], format).len(), format.bytes());
        }
    }

    #[test]
    fn components_go_where_the_names_say() {
        let eight = |code| converted(Source::Rgba8, &[10, 20, 30, 40], PixelFormat::from_code(code).unwrap());
        assert_eq!(eight(0), [10, 20, 30, 40]);
        assert_eq!(eight(1), [30, 20, 10, 40]);
        assert_eq!(eight(2), [40, 10, 20, 30]);
        assert_eq!(eight(3), [40, 30, 20, 10]);
        let stored = [0x11, 0x22, 0x33, 0x44];
        let four = |code| converted(Source::Rgba8, &stored, PixelFormat::from_code(code).unwrap());
        assert_eq!([4, 5, 6, 7].map(four), [[0x21, 0x43], [0x23, 0x41], [0x14, 0x32], [0x34, 0x12]]);
        let stored = accumulators([0x123, 0x456, 0x789, 0xabc]);
        let twelve = |code| {
            let bytes = converted(Source::Accumulator64, &stored, PixelFormat::from_code(code).unwrap());
            bytes.as_chunks().0.iter().map(|pair| u16::from_le_bytes(*pair)).collect::<Vec<_>>()
        };
        assert_eq!(twelve(8), [0x123, 0x456, 0x789, 0xabc]);
        assert_eq!(twelve(9), [0x789, 0x456, 0x123, 0xabc]);
        assert_eq!(twelve(10), [0xabc, 0x123, 0x456, 0x789]);
        assert_eq!(twelve(11), [0xabc, 0x789, 0x456, 0x123]);
    }

    /// Every value of a component, in every format, is the nearest one to what it stands for; but replication,
    /// which widens 8 bits to 12, may be off by almost one.
    #[test]
    fn every_value_becomes_the_nearest_one() {
        let check = |value: f64, bytes: &[u8], format: PixelFormat, bound: f64| {
            let (found, full) = match format.bytes() {
                2 => (u32::from(bytes[0] & 15), 15.0),
                4 => (u32::from(bytes[0]), 255.0),
                _ => (u32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 4095.0),
            };
            let error = (f64::from(found) - value * full).abs();
            assert!(error <= bound, "{format:?}: {value} became {found}, off by {error}");
        };
        for format in formats() {
            for value in 0..=255u8 {
                let value_of = f64::from(value) / 255.0;
                let bound = if format.bytes() == 8 { 15.0 / 16.0 } else { 0.5 };
                check(value_of, &converted(Source::Rgba8, &[value; 4], format), format, bound);
            }
            for value in 0..=4095u64 {
                let stored = accumulators([value; 4]);
                check(value as f64 / 4095.0, &converted(Source::Accumulator64, &stored, format), format, 0.5);
            }
        }
    }

    #[test]
    fn components_do_not_mix() {
        for format in formats() {
            let base = converted(Source::Accumulator64, &accumulators([0; 4]), format);
            assert!(base.iter().all(|&byte| byte == 0));
            let mut seen = vec![0; format.bytes()];
            for component in 0..4 {
                let mut components = [0; 4];
                components[component] = 4095;
                let bytes = converted(Source::Accumulator64, &accumulators(components), format);
                for (seen, byte) in seen.iter_mut().zip(bytes) {
                    assert_eq!(*seen & byte, 0, "{format:?}");
                    *seen |= byte;
                }
            }
            let full = converted(Source::Accumulator64, &accumulators([4095; 4]), format);
            assert_eq!(seen, full);
        }
    }

    #[test]
    fn rows_keep_their_order() {
        let stored: Vec<u8> = (0..=255).cycle().take(512 * 4).collect();
        assert_eq!(converted(Source::Rgba8, &stored, PixelFormat::Rgba8), stored);
        let twice = converted(Source::Rgba8, &stored, PixelFormat::Abgr8);
        assert_eq!(converted(Source::Rgba8, &twice, PixelFormat::Abgr8), stored);
    }
}
