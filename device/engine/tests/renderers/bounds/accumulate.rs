//! From the errors of samples to those of rays.
//!
//! **Compositing.** With `A' = A^ / 4095`, `e = A - A^` and `f = C - C^`, a sample adds
//!
//! * `a (4095 - A) / 4096` rounded: `e := e (1 - a / 4095) + (a - a^)(1 - A') + r - q`,
//! * `m (4095 - A) / 4096` rounded: `f := f + (m - m^)(1 - A') - (m / 4095) e + r - q`,
//!
//! where `|r|` is at most 1/2 and at most the product, and `q`, the product over 4095, comes from dividing by 4096
//! instead of 4095.
//!
//! **Extremes.** `|v - v^| <= E` holds for all samples of a ray, so it holds for their extremes. Each sample whose
//! ideal value lies within `2 E` of the extreme can have been the reference's.
//!
//! **Sums** are means of `a` and `m`, rounded: 1/2 more than the mean of their bounds.
//!
//! **The cursor** over a finished ray: `C := m + C (4095 - a) / 4096`, rounded, per sample of a sum, so that
//! `e := (m - m^) + e (4095 - a) / 4096 + C^ ((a^ - a) / 4095 - (4095 - a) / 4096 / 4095) + r`.

use super::FULL;
use super::ray::{Met, VolumeSample};
use super::sample::{SampleRange, farthest};
use vg500_regs::BlendMode;

/// Bounds of the four channels of a ray that meets `met`.
pub fn bounds(blend: BlendMode, met: &[Met]) -> [f64; 4] {
    let volume: Vec<_> = met.iter().filter_map(|met| met.volume.as_ref()).collect();
    match blend {
        BlendMode::Alpha => {
            let both = |met: &Met| [met.cursor, met.volume.as_ref().map(|volume| volume.range)];
            composited(met.iter().flat_map(both).flatten())
        }
        BlendMode::Sum => {
            let mean = |channels: &dyn Fn(&SampleRange) -> [f64; 4]| {
                let sum = volume.iter().fold([0.0; 4], |sum, sample| add(sum, channels(&sample.range)));
                sum.map(|sum| sum / volume.len().max(1) as f64)
            };
            let errors = mean(&|range| range.premultiplied_errors());
            covered(met, mean(&|range| range.premultiplied_ideal()), errors).map(|bound| bound + 0.5)
        }
        BlendMode::Maximum => {
            extreme(met, volume.iter().rev().max_by(|a, b| a.value.total_cmp(&b.value)).copied())
        }
        BlendMode::Minimum => extreme(met, volume.iter().min_by(|a, b| a.value.total_cmp(&b.value)).copied()),
    }
}

fn add(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [0, 1, 2, 3].map(|channel| a[channel] + b[channel])
}

/// The recurrences of compositing.
fn composited(samples: impl Iterator<Item = SampleRange>) -> [f64; 4] {
    let mut bounds = [0.0; 4];
    let mut ideal_alpha = 0.0;
    // What rounding a product to 12 bits, and dividing by 4096 instead of 4095, can make of it.
    let product = |factor: f64, transparency: f64| {
        let exact = factor * transparency / 4096.0;
        exact.min(0.5) + exact / FULL
    };
    for sample in samples {
        let through = 1.0 - ideal_alpha / FULL;
        let alpha = bounds[3];
        let transparency = (FULL - ideal_alpha + alpha).clamp(0.0, FULL);
        let errors = sample.premultiplied_errors();
        for channel in 0..3 {
            let [_, most] = sample.premultiplied[channel];
            bounds[channel] += errors[channel] * through + most / FULL * alpha + product(most, transparency);
        }
        let [least, most] = sample.alpha;
        bounds[3] = alpha * (1.0 - least / FULL) + errors[3] * through + product(most, transparency);
        ideal_alpha += sample.ideal[3] * through;
    }
    bounds
}

/// Bounds of the sample that the ideal shows, given that the reference may show others of nearly its value.
fn extreme(met: &[Met], shown: Option<&VolumeSample>) -> [f64; 4] {
    let Some(shown) = shown else { return covered(met, [0.0; 4], [0.0; 4]) };
    let near = met
        .iter()
        .filter_map(|met| met.volume.as_ref())
        .filter(|other| (other.value - shown.value).abs() <= other.value_error + shown.value_error);
    let bounds = near.fold([0.0; 4], |bounds: [f64; 4], other| {
        let [r, g, b] = other.range.color;
        let channels = [r, g, b, other.range.alpha];
        [0, 1, 2, 3]
            .map(|channel| bounds[channel].max(farthest(channels[channel], shown.range.ideal[channel])))
    });
    covered(met, shown.range.ideal, bounds)
}

/// The recurrence of the cursor, back to front, from a ray's ideal channels and their bounds.
fn covered(met: &[Met], mut ideal: [f64; 4], mut bounds: [f64; 4]) -> [f64; 4] {
    for cursor in met.iter().rev().filter_map(|met| met.cursor) {
        let errors = cursor.premultiplied_errors();
        let own = cursor.premultiplied_ideal();
        let through = (FULL - cursor.alpha[0]) / 4096.0;
        for channel in 0..4 {
            let lost = errors[3] / FULL + through / FULL;
            bounds[channel] = errors[channel] + bounds[channel] * through + ideal[channel] * lost + 0.5;
            ideal[channel] = own[channel] + ideal[channel] * (1.0 - cursor.ideal[3] / FULL);
        }
    }
    bounds
}
