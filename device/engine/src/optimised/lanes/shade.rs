//! From sample rows to rays: classification, illumination and compositing of a row of samples, block by block.

use super::gradient::{Orientation, magnitude};
use super::illuminate::{Light, Material};
use super::interpolate::{along_x, unguard, weight};
use super::light::Stretched;
use super::{composite, composite::product};
use crate::optimised::accumulators::{Accumulators, RayRow, Row, SumRow, no_extreme};
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
        span: &Range<usize>,
        accumulators: &mut Accumulators,
        ray_row: usize,
        first: i32,
    ) {
        match self.features().blend {
            BlendMode::Alpha if self.features().premultiplied => {
                self.blend_premultiplied(row, span, &mut accumulators.ray_row(ray_row, first));
            }
            BlendMode::Alpha => self.blend_alpha(row, span, &mut accumulators.row(ray_row, first)),
            BlendMode::Sum => self.add_up(row, span, &mut accumulators.sum_row(ray_row, first)),
            BlendMode::Maximum | BlendMode::Minimum => {
                self.keep_extremes(row, span, &mut accumulators.row(ray_row, first));
            }
        }
    }

    #[inline(always)]
    fn features(&self) -> Features {
        self.specialisation.features(self.features)
    }

    /// Front-to-back blending of a row of samples that are looked up and blended as they are.
    #[inline(always)]
    fn blend_premultiplied(&self, row: &SampleRow<'_>, span: &Range<usize>, rays: &mut RayRow<'_>) {
        let simd = self.simd;
        let sampling = Sampling::new(simd, row, span, false);
        for block in simd.blocks(span.clone()) {
            let values = sampling.values(simd, block);
            let seen = sampling.seen(simd, block, values, Classification::TRANSPARENT as i16);
            // SAFETY: samples are within their voxels, of 12 bits, or TRANSPARENT.
            unsafe { rays.blend(simd, block, self.table, seen) };
        }
    }

    /// Front-to-back blending of a row.
    #[inline(always)]
    fn blend_alpha(&self, row: &SampleRow<'_>, span: &Range<usize>, rays: &mut Row<'_>) {
        let simd = self.simd;
        let features = self.features();
        let sampling = Sampling::new(simd, row, span, features.gradient());
        for block in simd.blocks(span.clone()) {
            let values = sampling.values(simd, block);
            let seen = sampling.seen(simd, block, values, Classification::TRANSPARENT as i16);
            // SAFETY: samples are within their voxels, of 12 bits, or TRANSPARENT.
            let [r, g, b, alpha] = unsafe { simd.classify(self.table, seen) };
            if !simd.any(simd.greater(alpha, simd.splat(0))) {
                continue;
            }
            let (color, mut alpha) = self.shade(features, row, block, sampling.x_weight, [r, g, b], alpha);
            if features.cut {
                // (alpha factor + 128) >> 8
                let factor = simd.shift_left::<4>(sampling.factors(simd, block));
                alpha = simd.multiply_round(simd.shift_left::<3>(alpha), factor);
            }
            let [r, g, b] = color;
            let color = each!([r, g, b], |channel| product(simd, channel, alpha));
            composite::alpha(simd, rays, block, color, alpha);
        }
    }

    /// Weighted sum of a row.
    #[inline(always)]
    fn add_up(&self, row: &SampleRow<'_>, span: &Range<usize>, rays: &mut SumRow<'_>) {
        let simd = self.simd;
        let features = self.features();
        let sampling = Sampling::new(simd, row, span, features.gradient());
        let transparent = simd.splat(Classification::TRANSPARENT as i16);
        for block in simd.blocks(span.clone()) {
            let values = sampling.values(simd, block);
            let seen = sampling.seen(simd, block, values, Classification::TRANSPARENT as i16);
            let visible = simd.greater(transparent, seen);
            // SAFETY: as in `blend_alpha`.
            let [r, g, b, alpha] = unsafe { simd.classify(self.table, seen) };
            if features.premultiplied {
                composite::sum(simd, rays, block, [r, g, b], alpha, visible);
                continue;
            }
            let (color, alpha) = self.shade(features, row, block, sampling.x_weight, [r, g, b], alpha);
            let [r, g, b] = color;
            let color = each!([r, g, b], |channel| product(simd, channel, alpha));
            composite::sum(simd, rays, block, color, alpha, visible);
        }
    }

    /// MIP and MinIP of shaded samples of a row: blocks without a new extreme need no colours.
    #[inline(always)]
    fn keep_extremes(&self, row: &SampleRow<'_>, span: &Range<usize>, rays: &mut Row<'_>) {
        let simd = self.simd;
        let features = self.features();
        let sampling = Sampling::new(simd, row, span, features.gradient());
        let nothing = no_extreme(features.blend);
        for block in simd.blocks(span.clone()) {
            let values = sampling.values(simd, block);
            let seen = sampling.seen(simd, block, values, nothing);
            let beats = composite::beats(simd, features.blend, rays, block, seen);
            if simd.any(beats) {
                // SAFETY: as in `blend_alpha`.
                let [r, g, b, alpha] = unsafe { simd.classify(self.table, values) };
                let (color, alpha) = self.shade(features, row, block, sampling.x_weight, [r, g, b], alpha);
                composite::replace(simd, rays, block, beats, color, alpha, values);
            }
        }
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
        let gradient = self.orientation.gradient(simd, row.samples, row.differences, x_weight, block);
        let nothing = simd.splat(0);
        let mut light = Light { diffuse: nothing, specular: nothing, modulation: nothing };
        if features.magnitude {
            // SAFETY: magnitudes are at most 220.
            light.modulation = unsafe { simd.factor(&self.factors, magnitude(simd, gradient)) };
        }
        let alpha = if features.magnitude { self.material.opacity(simd, alpha, &light) } else { alpha };
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

/// How the sample values of a row are had.
struct Sampling<'a, S: Simd> {
    row: &'a SampleRow<'a>,
    span: Range<usize>,
    gradient: bool,
    x_weight: S::Words,
}

impl<'a, S: Simd> Sampling<'a, S> {
    #[inline(always)]
    fn new(simd: S, row: &'a SampleRow<'a>, span: &Range<usize>, gradient: bool) -> Self {
        Self { row, span: span.clone(), gradient, x_weight: weight(simd, row.x_weight) }
    }

    /// The samples of a block.
    #[inline(always)]
    fn values(&self, simd: S, block: Block) -> S::Words {
        if self.gradient {
            self.row.samples[1].load(simd, block)
        } else if self.row.x_weight == 0 {
            unguard(simd, self.row.line.load(simd, block))
        } else {
            unguard(simd, along_x(simd, self.row.line, block, self.x_weight))
        }
    }

    /// The factors of a block's opacities; there are some.
    #[inline(always)]
    fn factors(&self, simd: S, block: Block) -> S::Words {
        match self.row.factors {
            Some(line) => line.load(simd, block),
            None => simd.splat(256),
        }
    }

    /// Values, but `hidden` where there is no sample, or one that cannot be seen.
    #[inline(always)]
    fn seen(&self, simd: S, block: Block, values: S::Words, hidden: i16) -> S::Words {
        let mut seen = values;
        if block.start() < self.span.start || block.start() + S::LANES > self.span.end {
            seen = simd.select(inside(simd, block, &self.span), seen, simd.splat(hidden));
        }
        if let Some(line) = self.row.factors {
            let visible = simd.greater(line.load(simd, block), simd.splat(0));
            seen = simd.select(visible, seen, simd.splat(hidden));
        }
        seen
    }
}

/// The lanes of a block that lie in a span.
#[inline(always)]
fn inside<S: Simd>(simd: S, block: Block, span: &Range<usize>) -> S::Mask {
    let place = simd.add(simd.count(), simd.splat(block.start() as i16));
    let [before, end] = [simd.splat(span.start as i16 - 1), simd.splat(span.end as i16)];
    simd.both(simd.greater(place, before), simd.greater(end, place))
}

/// MIP and MinIP of a row of samples that need no light: see [`composite::extreme`].
#[inline(always)]
pub fn keep_values<S: Simd>(
    simd: S,
    blend: BlendMode,
    row: &SampleRow<'_>,
    span: &Range<usize>,
    rays: &mut Row<'_>,
) {
    match (blend, row.x_weight) {
        (BlendMode::Minimum, 0) => keep_values_of::<S, true, false>(simd, row, span, rays),
        (BlendMode::Minimum, _) => keep_values_of::<S, true, true>(simd, row, span, rays),
        (_, 0) => keep_values_of::<S, false, false>(simd, row, span, rays),
        _ => keep_values_of::<S, false, true>(simd, row, span, rays),
    }
}

#[inline(always)]
fn keep_values_of<S: Simd, const LEAST: bool, const LERP: bool>(
    simd: S,
    row: &SampleRow<'_>,
    span: &Range<usize>,
    rays: &mut Row<'_>,
) {
    let blend = if LEAST { BlendMode::Minimum } else { BlendMode::Maximum };
    let x_weight = weight(simd, row.x_weight);
    let sampling = Sampling::new(simd, row, span, false);
    let whole = span.start.next_multiple_of(S::LANES)..span.end / S::LANES * S::LANES;
    let mut inner = simd.blocks(0..0);
    if row.factors.is_none() && !whole.is_empty() {
        inner = simd.blocks(whole.clone());
    }
    for block in inner.clone() {
        let line = row.line.load(simd, block);
        let value = if LERP { simd.lerp(line, row.line.load_behind(simd, block), x_weight) } else { line };
        composite::extreme(simd, blend, rays, block, unguard(simd, value));
    }
    // What is left: the ends, or all if factors say what is seen.
    let seen_whole = |block: Block| inner.len() > 0 && whole.contains(&block.start());
    for block in simd.blocks(span.clone()).filter(|block| !seen_whole(*block)) {
        let values = sampling.values(simd, block);
        let seen = sampling.seen(simd, block, values, no_extreme(blend));
        composite::extreme(simd, blend, rays, block, seen);
    }
}
