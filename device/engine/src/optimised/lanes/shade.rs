//! From sample rows to rays: classification, illumination and compositing of a row of samples, block by block.

use super::gradient::{Orientation, magnitude};
use super::illuminate::{Light, Material};
use super::interpolate::{along_x, unguard, weight};
use super::light::Stretched;
use super::{composite, composite::product};
use crate::optimised::accumulators::{Accumulators, no_extreme};
use crate::optimised::features::{Features, Specialisation};
use crate::optimised::line::{Block, Line};
use crate::optimised::prepared::Prepared;
use crate::optimised::simd::{Simd, SimdExt, each};
use crate::optimised::tables::Classification;
use core::ops::Range;
use vg500_regs::BlendMode;

/// The stages behind interpolation, set up for a frame.
pub struct Shader<'a, S: Simd, Z: Specialisation> {
    simd: S,
    specialisation: Z,
    features: Features,
    table: &'a Classification,
    material: Material<S>,
    orientation: Orientation<S>,
    eye: [S::Words; 3],
    diffuse: S::Map,
    specular: S::Map,
    factors: S::Factors,
}

/// A row of samples.
#[derive(Clone, Copy, Debug)]
pub struct SampleRow<'a> {
    /// Values interpolated along z and y, not yet along x.
    pub line: &'a Line,
    /// With gradients: the samples of the row before, this one and the one behind.
    pub samples: [&'a Line; 3],
    /// With gradients: differences along z, interpolated along z and y.
    pub differences: &'a Line,
    /// Weight along x.
    pub x_weight: i16,
    /// Factor of each sample's opacity, 0..=256, unless all are seen.
    pub factors: Option<&'a Line>,
}

impl<'a, S: Simd, Z: Specialisation> Shader<'a, S, Z> {
    /// The stages of a frame.
    #[inline(always)]
    pub fn new(simd: S, specialisation: Z, prepared: &'a Prepared<'_>) -> Self {
        let frame = prepared.frame;
        Self {
            simd,
            specialisation,
            features: prepared.features,
            table: &prepared.classification,
            material: Material::new(simd, frame),
            orientation: Orientation::new(simd, frame, prepared.mirrored),
            eye: prepared.eye.map(|component| simd.splat(component)),
            diffuse: simd.map(&prepared.diffuse),
            specular: simd.map(&prepared.specular),
            factors: simd.factors(&prepared.factors),
        }
    }

    /// Composites the samples above the voxels `span` into the row of rays `ray_row`, whose column 0 has its
    /// sample above voxel `first`.
    #[inline(always)]
    pub fn composite(
        &self,
        row: &SampleRow<'_>,
        span: Range<usize>,
        accumulators: &mut Accumulators,
        ray_row: usize,
        first: i32,
    ) {
        let simd = self.simd;
        let features = self.specialisation.features(self.features);
        let x_weight = weight(simd, row.x_weight);
        let transparent = simd.splat(Classification::TRANSPARENT as i16);
        for block in simd.blocks(span.clone()) {
            let values = if features.gradient() {
                row.samples[1].load(simd, block)
            } else if row.x_weight == 0 {
                unguard(simd, row.line.load(simd, block))
            } else {
                unguard(simd, along_x(simd, row.line, block, x_weight))
            };
            let mut seen = values;
            if block.start() < span.start || block.start() + S::LANES > span.end {
                seen = simd.select(self.inside(block, &span), seen, transparent);
            }
            let mut factors = simd.splat(256);
            if let Some(line) = row.factors {
                factors = line.load(simd, block);
                seen = simd.select(simd.greater(factors, simd.splat(0)), seen, transparent);
            }
            if features.blend == BlendMode::Alpha {
                // SAFETY: samples are within their voxels, of 12 bits, or TRANSPARENT.
                let [r, g, b, alpha] = unsafe { simd.classify(self.table, seen) };
                if !simd.any(simd.greater(alpha, simd.splat(0))) {
                    continue;
                }
                let mut rays = accumulators.row(ray_row, first);
                if features.premultiplied {
                    composite::alpha(simd, &mut rays, block, [r, g, b], alpha);
                    continue;
                }
                let (color, mut alpha) = self.shade(features, row, block, x_weight, [r, g, b], alpha);
                if features.cut {
                    // (alpha factor + 128) >> 8
                    alpha = simd
                        .multiply_round(simd.shift_left::<3>(alpha), simd.shift_left::<4>(factors));
                }
                let [r, g, b] = color;
                let color = each!([r, g, b], |channel| product(simd, channel, alpha));
                composite::alpha(simd, &mut rays, block, color, alpha);
                continue;
            }
            let visible = simd.greater(transparent, seen);
            if !simd.any(visible) {
                continue;
            }
            if features.blend == BlendMode::Sum {
                // SAFETY: as above.
                let [r, g, b, alpha] = unsafe { simd.classify(self.table, seen) };
                let mut rays = accumulators.sum_row(ray_row, first);
                if features.premultiplied {
                    composite::sum(simd, &mut rays, block, [r, g, b], alpha, visible);
                    continue;
                }
                let (color, alpha) = self.shade(features, row, block, x_weight, [r, g, b], alpha);
                let [r, g, b] = color;
                let color = each!([r, g, b], |channel| product(simd, channel, alpha));
                composite::sum(simd, &mut rays, block, color, alpha, visible);
                continue;
            }
            let mut rays = accumulators.row(ray_row, first);
            let beats = composite::beats(simd, features.blend, &rays, block, values, visible);
            if simd.any(beats) {
                // SAFETY: as above.
                let [r, g, b, alpha] = unsafe { simd.classify(self.table, seen) };
                let (color, alpha) = self.shade(features, row, block, x_weight, [r, g, b], alpha);
                composite::replace(simd, &mut rays, block, beats, color, alpha, values);
            }
        }
    }

    /// The lanes of a block that lie in a span.
    #[inline(always)]
    fn inside(&self, block: Block, span: &Range<usize>) -> S::Mask {
        let simd = self.simd;
        let place = simd.add(simd.count(), simd.splat(block.start() as i16));
        let [before, end] = [span.start as i16 - 1, span.end as i16].map(|it| simd.splat(it));
        simd.both(simd.greater(place, before), simd.greater(end, place))
    }

    /// Modulates and illuminates classified samples.
    #[inline(always)]
    fn shade(
        &self,
        features: Features,
        row: &SampleRow<'_>,
        block: Block,
        x_weight: S::Words,
        color: [S::Words; 3],
        alpha: S::Words,
    ) -> ([S::Words; 3], S::Words) {
        if !features.gradient() {
            return (color, alpha);
        }
        let simd = self.simd;
        let gradient =
            self.orientation.gradient(simd, row.samples, row.differences, x_weight, block);
        let nothing = simd.splat(0);
        let mut light = Light { diffuse: nothing, specular: nothing, modulation: nothing };
        if features.magnitude {
            // SAFETY: magnitudes are at most 220.
            light.modulation = unsafe { simd.factor(&self.factors, magnitude(simd, gradient)) };
        }
        let alpha =
            if features.magnitude { self.material.opacity(simd, alpha, &light) } else { alpha };
        if !features.light() {
            return (color, alpha);
        }
        let direction = Stretched::new(simd, gradient);
        if features.diffuse {
            light.diffuse = direction.diffuse(simd, &self.diffuse);
        }
        if features.specular {
            light.specular = direction.specular(simd, &self.specular, self.eye);
        }
        (self.material.illuminate(simd, features, color, &light), alpha)
    }
}

/// Keeps the extremes of a row of samples that need no light: see [`composite::extreme`].
#[inline(always)]
pub fn keep_extremes<S: Simd>(
    simd: S,
    blend: BlendMode,
    row: &SampleRow<'_>,
    span: Range<usize>,
    accumulators: &mut Accumulators,
    ray_row: usize,
    first: i32,
) {
    let mut rays = accumulators.row(ray_row, first);
    let x_weight = weight(simd, row.x_weight);
    let none = simd.splat(no_extreme(blend));
    let [before, end] = [span.start as i16 - 1, span.end as i16].map(|it| simd.splat(it));
    for block in simd.blocks(span.clone()) {
        let mut values = if row.x_weight == 0 {
            unguard(simd, row.line.load(simd, block))
        } else {
            unguard(simd, along_x(simd, row.line, block, x_weight))
        };
        if block.start() < span.start || block.start() + S::LANES > span.end {
            let place = simd.add(simd.count(), simd.splat(block.start() as i16));
            let inside = simd.both(simd.greater(place, before), simd.greater(end, place));
            values = simd.select(inside, values, none);
        }
        if let Some(line) = row.factors {
            let seen = simd.greater(line.load(simd, block), simd.splat(0));
            values = simd.select(seen, values, none);
        }
        composite::extreme(simd, blend, &mut rays, block, values);
    }
}
