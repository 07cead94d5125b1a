//! Compositing ([`crate::stage::composite`]).

use crate::fixed::FULL;
use crate::optimised::accumulators::{ALPHA, COUNT, EXTREME, Row, SumRow};
use crate::optimised::line::Block;
use crate::optimised::simd::Simd;
use vg500_regs::BlendMode;

/// The product of two values of 12 bits ([`crate::fixed::product`]).
#[inline(always)]
pub fn product<S: Simd>(simd: S, a: S::Words, b: S::Words) -> S::Words {
    simd.multiply_round(a, simd.shift_left::<3>(b))
}

/// C += (1 - A) a c, A += (1 - A) a for the first `channels` of `color`, which is already multiplied by the opacity.
#[inline(always)]
pub fn alpha<S: Simd>(
    simd: S,
    rays: &mut Row<'_>,
    block: Block,
    (color, channels): ([S::Words; 3], usize),
    opacity: S::Words,
) {
    let accumulated = rays.load(simd, ALPHA, block);
    let transparency = simd.shift_left::<3>(simd.subtract(simd.splat(FULL as i16), accumulated));
    for (channel, color) in color.into_iter().enumerate().take(channels) {
        let more = simd.multiply_round(color, transparency);
        let sum = simd.add(rays.load(simd, channel, block), more);
        rays.store(simd, channel, block, sum);
    }
    let sum = simd.add(accumulated, simd.multiply_round(opacity, transparency));
    rays.store(simd, ALPHA, block, sum);
}

/// Where values beat the extremes.
#[inline(always)]
pub fn beats<S: Simd>(simd: S, blend: BlendMode, rays: &Row<'_>, block: Block, values: S::Words) -> S::Mask {
    let extreme = rays.load(simd, EXTREME, block);
    match blend {
        BlendMode::Minimum => simd.greater(extreme, values),
        _ => simd.greater(values, extreme),
    }
}

/// Replaces what rays have where their extremes are beaten.
#[inline(always)]
pub fn replace<S: Simd>(
    simd: S,
    rays: &mut Row<'_>,
    block: Block,
    beats: S::Mask,
    color: [S::Words; 3],
    opacity: S::Words,
    values: S::Words,
) {
    let [r, g, b] = color;
    for (channel, new) in [r, g, b, opacity, values].into_iter().enumerate() {
        let kept = simd.select(beats, new, rays.load(simd, channel, block));
        rays.store(simd, channel, block, kept);
    }
}

/// Keeps the extremes alone; what they look like is looked up when the rays are complete.
#[inline(always)]
pub fn extreme<S: Simd>(simd: S, blend: BlendMode, rays: &mut Row<'_>, block: Block, values: S::Words) {
    let extreme = rays.load(simd, EXTREME, block);
    let kept = match blend {
        BlendMode::Minimum => simd.min(extreme, values),
        _ => simd.max(extreme, values),
    };
    rays.store(simd, EXTREME, block, kept);
}

/// C += a c, A += a, and one more sample where `visible`.
#[inline(always)]
pub fn sum<S: Simd>(
    simd: S,
    rays: &mut SumRow<'_>,
    block: Block,
    color: [S::Words; 3],
    opacity: S::Words,
    visible: S::Mask,
) {
    let [r, g, b] = color;
    for (channel, more) in [r, g, b, opacity].into_iter().enumerate() {
        rays.add(simd, channel, block, more);
    }
    rays.add(simd, COUNT, block, simd.select(visible, simd.splat(1), simd.splat(0)));
}
