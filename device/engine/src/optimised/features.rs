//! What the pipeline of a frame consists of.

use super::accumulators::Layout;
use super::omissions::allowed;
use crate::frame::FrameDescription;
use crate::tables::Tables;
use vg500_regs::BlendMode;
use vg500_regs::table::report_omitted as omitted;

/// The stages between interpolation and compositing, and how the last one accumulates.
///
/// A kernel is written once for any features. Where they are constant the compiler leaves out what they leave out:
/// that is all that a specialisation is. See [`Specialisation`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Features {
    /// The diffuse reflectance map.
    pub diffuse: bool,
    /// The reflection vector and the specular reflectance map.
    pub specular: bool,
    /// The gradient magnitude and its table.
    pub magnitude: bool,
    /// Whether the table holds colours already multiplied by their opacity.
    pub premultiplied: bool,
    /// Whether samples have a factor of opacity of their own: the cut plane.
    pub cut: bool,
    /// Whether all colours are grey, so that one channel stands for three.
    pub grey: bool,
    /// Whether every sample is classified in MIP and MinIP, even if only the value of the extreme one counts.
    pub classified: bool,
    /// How samples accumulate.
    pub blend: BlendMode,
}

impl Features {
    /// The features of a frame: what it needs, and what it does not allow to leave out.
    #[must_use]
    pub fn of(frame: &FrameDescription, tables: &Tables) -> Self {
        let needs = frame.needs();
        let allowed = |omission| allowed(frame, omission);
        let accumulates = matches!(frame.output.blend, BlendMode::Alpha | BlendMode::Sum);
        let diffuse = frame.illumination.diffuse != 0 || !allowed(omitted::ILLUMINATION);
        let specular = needs.specular || !allowed(omitted::ILLUMINATION) || !allowed(omitted::SPECULAR);
        let magnitude = needs.magnitude || !allowed(omitted::GRADIENT) || !allowed(omitted::MODULATION);
        let cut = needs.cut && frame.output.blend == BlendMode::Alpha;
        let premultiplied =
            accumulates && !(diffuse || specular || magnitude || cut) && allowed(omitted::PREMULTIPLICATION);
        Self {
            diffuse,
            specular,
            magnitude,
            premultiplied,
            cut,
            grey: !premultiplied && allowed(omitted::COLORS) && is_grey(frame, tables),
            classified: !allowed(omitted::CLASSIFICATION),
            blend: frame.output.blend,
        }
    }

    /// Whether colours depend on gradients.
    #[inline(always)]
    #[must_use]
    pub const fn light(self) -> bool {
        self.diffuse || self.specular
    }

    /// How accumulators lie in memory: where a table's entry is blended as it is, its channels stay together.
    #[inline(always)]
    #[must_use]
    pub const fn layout(self) -> Layout {
        match self.blend {
            BlendMode::Sum => Layout::Sums,
            BlendMode::Alpha if self.premultiplied => Layout::Rays,
            _ => Layout::Planes,
        }
    }

    /// Whether of MIP and MinIP only extreme values are kept; what they look like is looked up for complete rays.
    #[inline(always)]
    #[must_use]
    pub const fn extremes_only(self) -> bool {
        matches!(self.blend, BlendMode::Maximum | BlendMode::Minimum) && !self.gradient() && !self.classified
    }

    /// Whether gradients are needed.
    #[inline(always)]
    #[must_use]
    pub const fn gradient(self) -> bool {
        self.light() || self.magnitude
    }
}

/// Features that are known when the program is built, or not.
pub trait Specialisation: Copy + Send + Sync + 'static {
    /// The features, if they are known.
    const FEATURES: Option<Features>;

    /// The features of a frame that this specialisation can draw.
    #[inline(always)]
    fn features(self, of_frame: Features) -> Features {
        match Self::FEATURES {
            Some(known) => known,
            None => of_frame,
        }
    }
}

/// Any frame: each stage asks whether it is needed.
#[derive(Clone, Copy, Debug)]
pub struct General;

impl Specialisation for General {
    const FEATURES: Option<Features> = None;
}

/// Alpha blending without light or modulation.
#[derive(Clone, Copy, Debug)]
pub struct Unlit;

impl Specialisation for Unlit {
    const FEATURES: Option<Features> = Some(Features { premultiplied: true, ..LIT });
}

/// Alpha blending of shaded samples, with both maps or the diffuse one, modulated or not, grey or not.
#[derive(Clone, Copy, Debug)]
pub struct Lit<const SPECULAR: bool, const MAGNITUDE: bool, const GREY: bool>;

impl<const SPECULAR: bool, const MAGNITUDE: bool, const GREY: bool> Specialisation
    for Lit<SPECULAR, MAGNITUDE, GREY>
{
    const FEATURES: Option<Features> =
        Some(Features { diffuse: true, specular: SPECULAR, magnitude: MAGNITUDE, grey: GREY, ..LIT });
}

/// Whether a frame that blends front to back, and begins with empty rays, has no other colours than grey.
fn is_grey(frame: &FrameDescription, tables: &Tables) -> bool {
    let begins_empty = frame.output.accumulators.is_none();
    let no_cursor = frame.visibility.cursor.is_none();
    let [red, green, blue] = frame.illumination.specular_color;
    let mut visible = tables.color.iter().zip(&tables.opacity).filter(|(_, opacity)| **opacity > 0);
    frame.output.blend == BlendMode::Alpha
        && begins_empty
        && no_cursor
        && [green, blue] == [red; 2]
        && visible.all(|([red, green, blue], _)| [green, blue] == [red; 2])
}

/// What all specialisations share.
const LIT: Features = Features {
    diffuse: false,
    specular: false,
    magnitude: false,
    premultiplied: false,
    cut: false,
    grey: false,
    classified: false,
    blend: BlendMode::Alpha,
};
