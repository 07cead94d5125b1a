//! Illumination ([`crate::stage::illuminate`]).

use crate::fixed::{FULL, unity, widen};
use crate::frame::FrameDescription;
use crate::optimised::features::Features;
use crate::optimised::simd::{Simd, each};

/// Material and light of a frame, spread over all lanes.
#[derive(Clone, Copy, Debug)]
pub struct Material<S: Simd> {
    emissive: S::Constant,
    diffuse: S::Constant,
    specular: S::Constant,
    specular_color: [S::Constant; 3],
    /// Whether opacity, diffuse and specular illumination are modulated.
    modulate: [bool; 3],
}

/// The intensities of the maps and what the gradient magnitude multiplies with, U0.15.
#[derive(Clone, Copy, Debug)]
pub struct Light<S: Simd> {
    /// Id.
    pub diffuse: S::Words,
    /// Is.
    pub specular: S::Words,
    /// From the gradient-magnitude table.
    pub modulation: S::Words,
}

impl<S: Simd> Material<S> {
    /// The material of a frame.
    #[inline(always)]
    pub fn new(simd: S, frame: &FrameDescription) -> Self {
        let illumination = &frame.illumination;
        let [_, diffuse, specular] = illumination.modulate;
        let factor = |factor| simd.constant(unity(factor) as i16);
        Self {
            emissive: factor(illumination.emissive),
            diffuse: factor(illumination.diffuse),
            specular: factor(illumination.specular),
            specular_color: illumination.specular_color.map(|channel| simd.constant(widen(channel) as i16)),
            modulate: [frame.needs().opacity_modulation, diffuse, specular],
        }
    }

    /// Modulates and illuminates classified samples.
    #[inline(always)]
    pub fn shade(
        &self,
        simd: S,
        features: Features,
        color: [S::Words; 3],
        alpha: S::Words,
        light: &Light<S>,
    ) -> ([S::Words; 3], S::Words) {
        let alpha = if features.magnitude { self.opacity(simd, alpha, light) } else { alpha };
        let color = if features.light() { self.illuminate(simd, features, color, light) } else { color };
        (color, alpha)
    }

    /// A classified opacity, modulated if it is to be.
    #[inline(always)]
    fn opacity(&self, simd: S, alpha: S::Words, light: &Light<S>) -> S::Words {
        if self.modulate[0] { simd.multiply_round(alpha, light.modulation) } else { alpha }
    }

    /// Classified colours in this light.
    #[inline(always)]
    fn illuminate(
        &self,
        simd: S,
        features: Features,
        color: [S::Words; 3],
        light: &Light<S>,
    ) -> [S::Words; 3] {
        let diffuse = if features.diffuse {
            let modulate = features.magnitude && self.modulate[1];
            coefficient(simd, light.diffuse, modulate.then_some(light.modulation), self.diffuse)
        } else {
            simd.splat(0)
        };
        let own = simd.average(simd.spread(self.emissive), diffuse);
        let most = simd.splat(FULL as i16);
        let [r, g, b] = color;
        let body = if features.grey {
            [simd.multiply_round(simd.shift_left::<1>(r), own); 3]
        } else {
            each!([r, g, b], |channel| simd.multiply_round(simd.shift_left::<1>(channel), own))
        };
        let [r, g, b] = body;
        if !features.specular {
            return if features.grey {
                [simd.min(r, most); 3]
            } else {
                each!([r, g, b], |channel| simd.min(channel, most))
            };
        }
        let modulate = features.magnitude && self.modulate[2];
        let specular = coefficient(simd, light.specular, modulate.then_some(light.modulation), self.specular);
        if features.grey {
            let highlight = simd.multiply_round(simd.spread(self.specular_color[0]), specular);
            return [simd.min(simd.add(r, highlight), most); 3];
        }
        each!([0, 1, 2], |channel| {
            let highlight = simd.multiply_round(simd.spread(self.specular_color[channel]), specular);
            simd.min(simd.add(body[channel], highlight), most)
        })
    }
}

/// An intensity times a factor, modulated before if it is to be.
#[inline(always)]
fn coefficient<S: Simd>(
    simd: S,
    intensity: S::Words,
    modulation: Option<S::Words>,
    factor: S::Constant,
) -> S::Words {
    let modulated = match modulation {
        Some(modulation) => simd.multiply_round(intensity, modulation),
        None => intensity,
    };
    simd.multiply_round(modulated, simd.spread(factor))
}
