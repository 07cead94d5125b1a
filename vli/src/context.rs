//! The rendering context (`VLIContext`): everything a frame needs but the volume.

use crate::crop::Crop;
use crate::cursor::Cursor;
use crate::cut_plane::CutPlane;
use crate::geometry::{GeometryError, ShearWarp, Supersampling};
use crate::illumination::{
    GRADIENT_TABLE_LENGTH, Light, diffuse_map, eye_vector, gradient_magnitude_table, specular_map,
};
use crate::lookup_table::LookupTable;
use crate::volume::Volume;
use glam::{DMat3, DMat4, DVec3};
use vg500_regs::table::*;
use vg500_regs::{BlendMode, FrameRegisters, PlaneFormat};
use volumepro_driver::{Error, TableContent};

/// Phong reflection properties.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection {
    /// Diffuse coefficient kd, 0..=1.
    pub diffuse: f64,
    /// Specular coefficient ks, 0..=1.
    pub specular: f64,
    /// Emissive coefficient ke, 0..=1.
    pub emissive: f64,
    /// Exponent of highlights, not negative.
    pub exponent: f64,
    /// Colour of highlights, 0..=1 each.
    pub color: [f64; 3],
}

impl Default for Reflection {
    /// Unlit: emission only.
    fn default() -> Self {
        Self { diffuse: 0.0, specular: 0.0, emissive: 1.0, exponent: 1.0, color: [1.0; 3] }
    }
}

/// What the gradient magnitude modulates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Modulation {
    /// Opacity.
    pub opacity: bool,
    /// Diffuse illumination.
    pub diffuse: bool,
    /// Specular illumination.
    pub specular: bool,
}

/// All attributes of a frame but the volume.
#[derive(Clone, Debug)]
pub struct Context {
    /// View matrix: world to camera space, which looks along -z; it may scale.
    pub camera: DMat4,
    /// Colour and opacity of values.
    pub lookup_table: LookupTable,
    /// Whether opacities are corrected for the distance between samples.
    pub correct_opacity: bool,
    /// Directional lights, any number.
    pub lights: Vec<Light>,
    /// Reflection properties.
    pub reflection: Reflection,
    /// What the gradient magnitude modulates.
    pub modulation: Modulation,
    /// Modulation at magnitudes from none to the greatest, piecewise linear, 0..=1.
    pub gradient_table: [f64; GRADIENT_TABLE_LENGTH],
    /// Cropping.
    pub crop: Crop,
    /// The cut plane.
    pub cut_plane: Option<CutPlane>,
    /// The cursor.
    pub cursor: Cursor,
    /// Sub-samples per voxel.
    pub supersampling: Supersampling,
    /// How samples along a ray become a pixel.
    pub blend: BlendMode,
    /// Whether the card works section by section.
    pub sections: bool,
}

impl Context {
    /// A context with the library's defaults, which show a volume unlit.
    #[must_use]
    pub fn new(lookup_table: LookupTable) -> Self {
        let steps = (GRADIENT_TABLE_LENGTH - 1) as f64;
        Self {
            camera: DMat4::IDENTITY,
            lookup_table,
            correct_opacity: true,
            lights: Vec::new(),
            reflection: Reflection::default(),
            modulation: Modulation::default(),
            gradient_table: core::array::from_fn(|entry| entry as f64 / steps),
            crop: Crop::default(),
            cut_plane: None,
            cursor: Cursor::default(),
            supersampling: Supersampling::NONE,
            blend: BlendMode::Alpha,
            sections: false,
        }
    }

    /// How the card sees `volume` with this context's camera.
    ///
    /// # Errors
    /// The volume is larger than a pass can render, or the camera's matrix is not usable.
    pub fn shear_warp(&self, volume: &Volume) -> Result<ShearWarp, GeometryError> {
        ShearWarp::new(volume.place(), &self.camera, self.supersampling)
    }

    /// The frame registers of a view, but for what differs between its passes, for where the volume lies in voxel
    /// memory, and for the start command.
    pub(crate) fn program(&self, volume: &Volume, view: &ShearWarp, format: PlaneFormat) -> FrameRegisters {
        let mut registers = FrameRegisters::default();
        let registers = &mut registers;
        Self::program_subvolume(volume, registers);
        self.program_reflection(volume, registers);
        self.crop.program(registers);
        if let Some(cut_plane) = &self.cut_plane {
            cut_plane.program(volume.place().world_from_voxel(), registers);
        }
        self.cursor.program(registers);
        registers.write(permutation::REGISTER.offset, view.permutation().to_word());
        registers.set(supersampling::Z, view.supersampling().factors()[2]);
        registers.set(step_x::STEP, view.step()[0]);
        registers.set(step_y::STEP, view.step()[1]);
        registers.set(output::BLEND, self.blend as u32);
        registers.set(output::PLANE_FORMAT, format as u32);
        registers.set(output::SECTIONS, u32::from(self.sections));
        registers.clone()
    }

    fn program_subvolume(volume: &Volume, registers: &mut FrameRegisters) {
        let fields = [
            [subvolume_x::MIN, subvolume_x::MAX],
            [subvolume_y::MIN, subvolume_y::MAX],
            [subvolume_z::MIN, subvolume_z::MAX],
        ];
        for (fields, bounds) in fields.into_iter().zip(volume.subvolume()) {
            for (field, bound) in fields.into_iter().zip(bounds) {
                registers.set(field, bound.min(i16::MAX as u32));
            }
        }
    }

    fn program_reflection(&self, volume: &Volume, registers: &mut FrameRegisters) {
        let reflection = &self.reflection;
        let factors = [
            (material::EMISSIVE, reflection.emissive),
            (material::DIFFUSE, reflection.diffuse),
            (material::SPECULAR, reflection.specular),
            (specular_color::RED, reflection.color[0]),
            (specular_color::GREEN, reflection.color[1]),
            (specular_color::BLUE, reflection.color[2]),
        ];
        for (field, factor) in factors {
            registers.set(field, (factor.clamp(0.0, 1.0) * 255.0).round() as u32);
        }
        registers.set(modulation::OPACITY, u32::from(self.modulation.opacity));
        registers.set(modulation::DIFFUSE, u32::from(self.modulation.diffuse));
        registers.set(modulation::SPECULAR, u32::from(self.modulation.specular));
        let [x, y, z] = eye_vector(linear(volume), self.eye()).map(i32::from);
        registers.set_signed(eye_xy::X, x);
        registers.set_signed(eye_xy::Y, y);
        registers.set_signed(eye_z::Z, z);
    }

    /// Direction towards the eye in world space, unit length.
    pub(crate) fn eye(&self) -> DVec3 {
        self.camera.inverse().transform_vector3(DVec3::Z).normalize_or_zero()
    }

    /// Distance that opacities are to be corrected for, as a multiple of the smallest voxel spacing.
    pub(crate) fn opacity_distance(&self, volume: &Volume, view: &ShearWarp) -> f64 {
        let correct = self.correct_opacity && self.blend == BlendMode::Alpha;
        if correct { view.sample_distance() / volume.place().smallest_spacing() } else { 1.0 }
    }

    /// Each table that frames of this context read.
    pub(crate) fn tables(&self, volume: &Volume, view: &ShearWarp) -> Result<Vec<TableContent>, Error> {
        let distance = self.opacity_distance(volume, view);
        let mut tables = vec![
            TableContent::color(&self.lookup_table.card_colors()),
            TableContent::opacity(&self.lookup_table.card_opacities(distance))?,
        ];
        let model = linear(volume);
        if self.reflection.diffuse > 0.0 {
            tables.push(TableContent::diffuse(&diffuse_map(model, &self.lights)));
        }
        if self.reflection.specular > 0.0 {
            let map = specular_map(model, &self.lights, self.reflection.exponent, self.eye());
            tables.push(TableContent::specular(&map));
        }
        if self.modulation != Modulation::default() {
            let table = gradient_magnitude_table(&self.gradient_table, model);
            tables.push(TableContent::gradient_magnitude(&table));
        }
        Ok(tables)
    }
}

/// The linear part of a volume's model matrix.
pub(crate) fn linear(volume: &Volume) -> DMat3 {
    DMat3::from_mat4(*volume.place().world_from_voxel())
}
