//! Frames in readable form.

use crate::card::Store;
use std::ops::Range;
use vg500_engine::frame::{Crop, Cursor, CutPlane, Illumination};
use vg500_regs::table::*;
use vg500_regs::{BlendMode, FrameRegisters, Permutation, PlaneFormat};

/// One voxel as a ray position or step.
pub const VOXEL: i32 = 1 << 22;
/// The blend modes.
pub const MODES: [BlendMode; 4] = [BlendMode::Alpha, BlendMode::Maximum, BlendMode::Minimum, BlendMode::Sum];

/// What the registers of a frame say.
#[derive(Clone, Debug)]
pub struct Scene {
    pub store: Store,
    pub permutation: Permutation,
    /// 22 fraction bits.
    pub start: [i32; 2],
    /// 22 fraction bits.
    pub step: [i32; 2],
    pub supersampling: u32,
    /// Columns and rows of rays.
    pub rays: [u32; 2],
    /// Lowest and highest voxel, inclusive.
    pub subvolume: [[i32; 2]; 3],
    /// Object voxels of the store.
    pub block: [Range<usize>; 3],
    pub crop: Option<Crop>,
    pub cut: Option<CutPlane>,
    pub cursor: Option<Cursor>,
    pub illumination: Illumination,
    pub blend: BlendMode,
    pub format: PlaneFormat,
    pub plane: u32,
    pub accumulators: Option<u32>,
    pub cursor_only: bool,
    /// Whether it is rendered in sections.
    pub sections: bool,
    /// What is not to be left out: the register `KEEP`.
    pub keep: u32,
}

impl Scene {
    /// The whole of a store head-on in alpha blending, unshaded, into base plane 0 of the 32-bit format.
    pub fn new(store: Store) -> Self {
        Self {
            store,
            permutation: Permutation::IDENTITY,
            start: [0; 2],
            step: [0; 2],
            supersampling: 1,
            rays: [store.size[0] as u32, store.size[1] as u32],
            subvolume: store.size.map(|size| [0, size as i32 - 1]),
            block: store.size.map(|size| 0..size),
            crop: None,
            cut: None,
            cursor: None,
            illumination: UNLIT,
            blend: BlendMode::Alpha,
            format: PlaneFormat::Rgba8,
            plane: 0,
            accumulators: None,
            cursor_only: false,
            sections: false,
            keep: 0,
        }
    }

    /// The format that keeps all of a ray in the scene's blend mode.
    pub fn wide_format(&self) -> PlaneFormat {
        match self.blend {
            BlendMode::Sum => PlaneFormat::Sum128,
            _ => PlaneFormat::Accumulator64,
        }
    }

    /// Size of the store along permuted axes.
    pub fn permuted_size(&self) -> [usize; 3] {
        self.permutation.permuted(self.store.size)
    }

    /// The scene with as many rays as it takes to meet every sample.
    pub fn with_all_rays(mut self) -> Self {
        let size = self.permuted_size();
        let slices = self.supersampling as usize * (size[2] - 1);
        self.rays = [0, 1].map(|axis| {
            // The first slice needs the rays up to the far face; later slices need earlier rays only, so the
            // start moves by the whole shear.
            let shear = (slices as u64 * self.step[axis] as u64).div_ceil(VOXEL as u64);
            self.start[axis] -= shear as i32 * VOXEL;
            (size[axis] as u64 + shear) as u32
        });
        self
    }

    /// The registers.
    pub fn registers(&self) -> FrameRegisters {
        let mut registers = FrameRegisters::default();
        self.write_volume(&mut registers);
        self.write_visibility(&mut registers);
        self.write_illumination(&mut registers);
        self.write_view(&mut registers);
        registers
    }

    fn write_volume(&self, registers: &mut FrameRegisters) {
        let store = self.store;
        registers.set(volume_base::OFFSET, store.base as u32);
        registers.set(volume_format::FORMAT, store.format as u32);
        registers.set(volume_size_xy::X, store.size[0] as u32);
        registers.set(volume_size_xy::Y, store.size[1] as u32);
        registers.set(volume_size_z::Z, store.size[2] as u32);
        registers.set(volume_pitch::ROW, store.row_pitch as u32);
        registers.set(volume_pitch::ROWS, store.slice_rows as u32);
    }

    fn write_visibility(&self, registers: &mut FrameRegisters) {
        let [sub_x, sub_y, sub_z] = &self.subvolume;
        registers.set_signed(subvolume_x::MIN, sub_x[0]);
        registers.set_signed(subvolume_x::MAX, sub_x[1]);
        registers.set_signed(subvolume_y::MIN, sub_y[0]);
        registers.set_signed(subvolume_y::MAX, sub_y[1]);
        registers.set_signed(subvolume_z::MIN, sub_z[0]);
        registers.set_signed(subvolume_z::MAX, sub_z[1]);
        let [block_x, block_y, block_z] = &self.block;
        registers.set(block_x::LOW, block_x.start as u32);
        registers.set(block_x::HIGH, block_x.end as u32);
        registers.set(block_y::LOW, block_y.start as u32);
        registers.set(block_y::HIGH, block_y.end as u32);
        registers.set(block_z::LOW, block_z.start as u32);
        registers.set(block_z::HIGH, block_z.end as u32);
        if let Some(crop) = &self.crop {
            write_crop(crop, registers);
        }
        if let Some(cut) = &self.cut {
            write_cut(cut, registers);
        }
        if let Some(cursor) = &self.cursor {
            write_cursor(cursor, registers);
        }
    }

    fn write_illumination(&self, registers: &mut FrameRegisters) {
        let Illumination { emissive, diffuse, specular, specular_color, eye, modulate } = self.illumination;
        registers.write(material::REGISTER.offset, u32::from_le_bytes([emissive, diffuse, specular, 0]));
        let [r, g, b] = specular_color;
        registers.write(specular_color::REGISTER.offset, u32::from_le_bytes([r, g, b, 0]));
        registers.set(modulation::OPACITY, modulate[0].into());
        registers.set(modulation::DIFFUSE, modulate[1].into());
        registers.set(modulation::SPECULAR, modulate[2].into());
        registers.set_signed(eye_xy::X, eye[0].into());
        registers.set_signed(eye_xy::Y, eye[1].into());
        registers.set_signed(eye_z::Z, eye[2].into());
    }

    fn write_view(&self, registers: &mut FrameRegisters) {
        registers.write(permutation::REGISTER.offset, self.permutation.to_word());
        registers.set(supersampling::Z, self.supersampling);
        registers.set_signed(start_x::POSITION, self.start[0]);
        registers.set_signed(start_y::POSITION, self.start[1]);
        registers.set_signed(step_x::STEP, self.step[0]);
        registers.set_signed(step_y::STEP, self.step[1]);
        registers.set(base_plane_size::WIDTH, self.rays[0]);
        registers.set(base_plane_size::HEIGHT, self.rays[1]);
        if let Some(source) = self.accumulators {
            registers.set(accumulators::ENABLE, 1);
            registers.set(accumulators::SOURCE, source);
        }
        registers.set(output::BLEND, self.blend as u32);
        registers.set(output::PLANE_FORMAT, self.format as u32);
        registers.set(output::CURSOR_ONLY, self.cursor_only.into());
        registers.set(output::SECTIONS, self.sections.into());
        registers.set(keep::OMISSIONS, self.keep);
        registers.set(start::PLANE, self.plane);
    }
}

/// No light at all; the sample's own colour.
pub const UNLIT: Illumination = Illumination {
    emissive: 255,
    diffuse: 0,
    specular: 0,
    specular_color: [255; 3],
    eye: [0; 3],
    modulate: [false; 3],
};

/// Emission, diffuse and specular light, and every modulation.
pub const LIT: Illumination = Illumination {
    emissive: 90,
    diffuse: 230,
    specular: 140,
    specular_color: [200, 255, 90],
    eye: [9362, -28087, 14043],
    modulate: [true; 3],
};

fn write_crop(crop: &Crop, registers: &mut FrameRegisters) {
    registers.write(crop_flags::REGISTER.offset, crop.flags);
    let fields = [
        [crop_min_x::BOUND, crop_max_x::BOUND],
        [crop_min_y::BOUND, crop_max_y::BOUND],
        [crop_min_z::BOUND, crop_max_z::BOUND],
    ];
    for (field, bound) in fields.as_flattened().iter().zip(crop.slabs.as_flattened()) {
        registers.set_signed(*field, *bound);
    }
}

fn write_cut(cut: &CutPlane, registers: &mut FrameRegisters) {
    registers.set(cut_control::ENABLE, 1);
    registers.set(cut_control::OUTSIDE, cut.outside.into());
    registers.set_signed(cut_normal_xy::A, cut.normal[0].into());
    registers.set_signed(cut_normal_xy::B, cut.normal[1].into());
    registers.set_signed(cut_normal_z::C, cut.normal[2].into());
    let [min, max] = cut.faces;
    registers.set(cut_min_low::WORD, min as u32);
    registers.set(cut_min_high::WORD, (min >> 32) as u32);
    registers.set(cut_max_low::WORD, max as u32);
    registers.set(cut_max_high::WORD, (max >> 32) as u32);
    registers.set(cut_falloff::RECIPROCAL, cut.falloff);
}

fn write_cursor(cursor: &Cursor, registers: &mut FrameRegisters) {
    let [x, y, z] = cursor.enabled.map(u32::from);
    registers.set(cursor_control::ENABLE_X, x);
    registers.set(cursor_control::ENABLE_Y, y);
    registers.set(cursor_control::ENABLE_Z, z);
    registers.set(cursor_control::PLANES, cursor.planes.into());
    registers.set(cursor_control::EXCLUDE_OVERLAP, cursor.exclude_overlap.into());
    registers.set(cursor_control::DISABLE_CROP, cursor.disable_crop.into());
    registers.set(cursor_control::WIDTH, cursor.width);
    registers.set(cursor_length::LENGTH, cursor.length);
    let positions = [cursor_x::POSITION, cursor_y::POSITION, cursor_z::POSITION];
    let colors = [cursor_color_x::REGISTER, cursor_color_y::REGISTER, cursor_color_z::REGISTER];
    for axis in 0..3 {
        registers.set_signed(positions[axis], cursor.position[axis]);
        registers.write(colors[axis].offset, u32::from_le_bytes(cursor.color[axis]));
    }
}
