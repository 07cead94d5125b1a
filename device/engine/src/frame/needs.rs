//! What a frame needs: stages whose result no pixel depends on are left out.

use super::FrameDescription;
use vg500_regs::BlendMode;
use vg500_regs::table::report_omitted as omitted;

/// The stages that a frame's pixels depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needs {
    /// Gradients.
    pub gradient: bool,
    /// Gradient magnitude and its table.
    pub magnitude: bool,
    /// The magnitude for opacity.
    pub opacity_modulation: bool,
    /// The reflectance maps.
    pub light: bool,
    /// The specular one.
    pub specular: bool,
    /// Block range or sub-volume.
    pub bounds: bool,
    /// Cropping.
    pub crop: bool,
    /// The cut plane.
    pub cut: bool,
    /// The cursor.
    pub cursor: bool,
}

impl FrameDescription {
    /// What this frame needs. MIP and MinIP keep a sample's opacity as it stands in the table.
    #[must_use]
    pub fn needs(&self) -> Needs {
        let illumination = &self.illumination;
        let diffuse = illumination.diffuse != 0;
        let specular = illumination.specular != 0 && illumination.specular_color != [0; 3];
        let [modulate_opacity, modulate_diffuse, modulate_specular] = illumination.modulate;
        let opacity_modulation =
            modulate_opacity && matches!(self.output.blend, BlendMode::Alpha | BlendMode::Sum);
        let magnitude =
            opacity_modulation || (diffuse && modulate_diffuse) || (specular && modulate_specular);
        Needs {
            gradient: diffuse || specular || magnitude,
            magnitude,
            opacity_modulation,
            light: diffuse || specular,
            specular,
            bounds: !self.visibility.bounds_contain_all(self.volume.size),
            crop: self.visibility.crop.is_some(),
            cut: self.visibility.cut.is_some(),
            cursor: self.visibility.cursor.is_some(),
        }
    }
}

impl Needs {
    /// Whether it matters where in the volume a sample lies.
    #[must_use]
    pub const fn position(&self) -> bool {
        self.bounds || self.crop || self.cut || self.cursor
    }

    /// The stages left out, as bits of the register `REPORT_OMITTED`.
    #[must_use]
    pub fn omitted(&self) -> u32 {
        let stages = [
            (self.gradient, omitted::GRADIENT),
            (self.light, omitted::ILLUMINATION),
            (self.specular, omitted::SPECULAR),
            (self.magnitude, omitted::MODULATION),
            (self.bounds, omitted::SUBVOLUME),
            (self.crop, omitted::CROP),
            (self.cut, omitted::CUT),
            (self.cursor, omitted::CURSOR),
        ];
        stages.iter().filter(|(needed, _)| !needed).fold(0, |bits, (_, field)| bits | field.mask())
    }
}
