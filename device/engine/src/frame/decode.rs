//! From registers to a frame description. What is out of range becomes a fault that names the field; nothing is
//! clamped.

use super::{Crop, Cursor, CutPlane, FrameDescription, Illumination, Output, Rays, Visibility, Volume};
use vg500_regs::limit::{BASE_PLANE_SIZE, SUPERSAMPLING, VOLUME_SIZE, VOXEL_PADDING};
use vg500_regs::memory::planes;
use vg500_regs::table::*;
use vg500_regs::{BlendMode, Fault, FaultCode, Field, FrameRegisters, Permutation, PlaneFormat, VoxelFormat};

impl FrameDescription {
    /// The frame that a start command asks for.
    ///
    /// `registers` hold the start command itself as well; `voxel_memory` is the size of voxel memory in bytes.
    pub fn decode(registers: &FrameRegisters, voxel_memory: usize) -> Result<Self, Fault> {
        Ok(Self {
            volume: volume(registers, voxel_memory)?,
            permutation: Permutation::from_word(registers.word(permutation::REGISTER))
                .ok_or(value_of(permutation::X_AXIS))?,
            rays: rays(registers)?,
            visibility: visibility(registers)?,
            illumination: illumination(registers)?,
            output: output(registers)?,
            copies: [
                table_select::COLOR,
                table_select::OPACITY,
                table_select::DIFFUSE,
                table_select::SPECULAR,
                table_select::GRADIENT_MAGNITUDE,
            ]
            .map(|field| registers.get(field) as usize),
            keep: registers.get(keep::OMISSIONS),
            voxels_unchanged: registers.get(start::VOXELS_UNCHANGED) != 0,
            tag: registers.get(start::TAG) as u16,
        })
    }
}

const fn value_of(field: Field) -> Fault {
    Fault::new(FaultCode::Value, field)
}

/// The value of `field` if it lies in `least..=most`.
fn between(registers: &FrameRegisters, field: Field, least: u32, most: u32) -> Result<u32, Fault> {
    let value = registers.get(field);
    if (least..=most).contains(&value) { Ok(value) } else { Err(value_of(field)) }
}

fn volume(registers: &FrameRegisters, voxel_memory: usize) -> Result<Volume, Fault> {
    let format = VoxelFormat::from_code(registers.get(volume_format::FORMAT));
    let format = format.ok_or(value_of(volume_format::FORMAT))?;
    let size = [
        between(registers, volume_size_xy::X, 1, VOLUME_SIZE)?,
        between(registers, volume_size_xy::Y, 1, VOLUME_SIZE)?,
        between(registers, volume_size_z::Z, 1, VOLUME_SIZE)?,
    ];
    let row_pitch = pitch(registers, volume_pitch::ROW, size[0])?;
    let slice_rows = pitch(registers, volume_pitch::ROWS, size[1])?;
    let base = registers.get(volume_base::OFFSET) as usize;
    if !base.is_multiple_of(format.bytes()) {
        return Err(value_of(volume_base::OFFSET));
    }
    let pitches = [1, row_pitch as usize, row_pitch as usize * slice_rows as usize];
    let last: usize = (0..3).map(|axis| (size[axis] as usize - 1) * pitches[axis]).sum();
    if base + (last + 1) * format.bytes() > voxel_memory {
        return Err(Fault::new(FaultCode::Range, volume_base::OFFSET));
    }
    Ok(Volume { base, format, size, row_pitch, slice_rows })
}

fn pitch(registers: &FrameRegisters, field: Field, size: u32) -> Result<u32, Fault> {
    let pitch = registers.get(field);
    if pitch >= size && pitch.is_multiple_of(VOXEL_PADDING) { Ok(pitch) } else { Err(value_of(field)) }
}

fn rays(registers: &FrameRegisters) -> Result<Rays, Fault> {
    let one = 1 << step_x::STEP.format.fraction;
    Ok(Rays {
        start: [registers.get_signed(start_x::POSITION), registers.get_signed(start_y::POSITION)],
        step: [between(registers, step_x::STEP, 0, one)?, between(registers, step_y::STEP, 0, one)?],
        supersampling: between(registers, supersampling::Z, 1, SUPERSAMPLING)?,
        size: [
            between(registers, base_plane_size::WIDTH, 1, BASE_PLANE_SIZE)?,
            between(registers, base_plane_size::HEIGHT, 1, BASE_PLANE_SIZE)?,
        ],
    })
}

fn visibility(registers: &FrameRegisters) -> Result<Visibility, Fault> {
    let signed = |low, high| [registers.get_signed(low), registers.get_signed(high)];
    let unsigned = |low, high| [registers.get(low) as i32, registers.get(high) as i32];
    Ok(Visibility {
        subvolume: [
            signed(subvolume_x::MIN, subvolume_x::MAX),
            signed(subvolume_y::MIN, subvolume_y::MAX),
            signed(subvolume_z::MIN, subvolume_z::MAX),
        ],
        block: [
            unsigned(block_x::LOW, block_x::HIGH),
            unsigned(block_y::LOW, block_y::HIGH),
            unsigned(block_z::LOW, block_z::HIGH),
        ],
        crop: crop(registers),
        cut: cut_plane(registers),
        cursor: cursor(registers)?,
    })
}

fn crop(registers: &FrameRegisters) -> Option<Crop> {
    let flags = registers.word(crop_flags::REGISTER) & crop_flags::REGISTER.mask();
    let bounds = |low, high| [registers.get_signed(low), registers.get_signed(high)];
    (flags != 0).then(|| Crop {
        flags,
        slabs: [
            bounds(crop_min_x::BOUND, crop_max_x::BOUND),
            bounds(crop_min_y::BOUND, crop_max_y::BOUND),
            bounds(crop_min_z::BOUND, crop_max_z::BOUND),
        ],
    })
}

fn cut_plane(registers: &FrameRegisters) -> Option<CutPlane> {
    let distance = |low, high| (i64::from(registers.get_signed(high)) << 32) | i64::from(registers.get(low));
    (registers.get(cut_control::ENABLE) != 0).then(|| CutPlane {
        outside: registers.get(cut_control::OUTSIDE) != 0,
        normal: [cut_normal_xy::A, cut_normal_xy::B, cut_normal_z::C]
            .map(|field| registers.get_signed(field) as i16),
        faces: [
            distance(cut_min_low::WORD, cut_min_high::WORD),
            distance(cut_max_low::WORD, cut_max_high::WORD),
        ],
        falloff: registers.get(cut_falloff::RECIPROCAL),
    })
}

fn cursor(registers: &FrameRegisters) -> Result<Option<Cursor>, Fault> {
    let flag = |field| registers.get(field) != 0;
    let enabled = [cursor_control::ENABLE_X, cursor_control::ENABLE_Y, cursor_control::ENABLE_Z].map(flag);
    if enabled == [false; 3] {
        return Ok(None);
    }
    let width = between(registers, cursor_control::WIDTH, 1, 7)?;
    if width.is_multiple_of(2) {
        return Err(value_of(cursor_control::WIDTH));
    }
    Ok(Some(Cursor {
        enabled,
        planes: flag(cursor_control::PLANES),
        exclude_overlap: flag(cursor_control::EXCLUDE_OVERLAP),
        disable_crop: flag(cursor_control::DISABLE_CROP),
        width,
        length: registers.get(cursor_length::LENGTH),
        position: [cursor_x::POSITION, cursor_y::POSITION, cursor_z::POSITION]
            .map(|it| registers.get_signed(it)),
        color: [cursor_color_x::REGISTER, cursor_color_y::REGISTER, cursor_color_z::REGISTER]
            .map(|register| registers.word(register).to_le_bytes()),
    }))
}

fn illumination(registers: &FrameRegisters) -> Result<Illumination, Fault> {
    let factor = |field| registers.get(field) as u8;
    let illumination = Illumination {
        emissive: factor(material::EMISSIVE),
        diffuse: factor(material::DIFFUSE),
        specular: factor(material::SPECULAR),
        specular_color: [specular_color::RED, specular_color::GREEN, specular_color::BLUE].map(factor),
        // The least value stands for -1, as the one above it does: every component has its opposite.
        eye: [eye_xy::X, eye_xy::Y, eye_z::Z].map(|field| registers.get_signed(field).max(-32767) as i16),
        modulate: [modulation::OPACITY, modulation::DIFFUSE, modulation::SPECULAR]
            .map(|field| registers.get(field) != 0),
    };
    if illumination.specular != 0 && !is_unit(illumination.eye) {
        return Err(value_of(eye_xy::X));
    }
    Ok(illumination)
}

/// Whether a vector in S0.15 has unit length within 1/2048, which is what reflection counts on.
fn is_unit(vector: [i16; 3]) -> bool {
    let square: i64 = vector.iter().map(|&component| i64::from(component) * i64::from(component)).sum();
    let one: i64 = 1 << 30;
    (square - one).abs() <= one >> 10
}

fn output(registers: &FrameRegisters) -> Result<Output, Fault> {
    let blend = BlendMode::from_code(registers.get(output::BLEND)).ok_or(value_of(output::BLEND))?;
    let format = PlaneFormat::from_code(registers.get(output::PLANE_FORMAT));
    let format = format.ok_or(value_of(output::PLANE_FORMAT))?;
    let fits = match format {
        PlaneFormat::Rgba8 => true,
        PlaneFormat::Accumulator64 => blend != BlendMode::Sum,
        PlaneFormat::Sum128 => blend == BlendMode::Sum,
    };
    if !fits {
        return Err(value_of(output::PLANE_FORMAT));
    }
    let last_plane = planes(format) - 1;
    let accumulators = match registers.get(accumulators::ENABLE) {
        0 => None,
        _ if format == PlaneFormat::Rgba8 => return Err(value_of(accumulators::ENABLE)),
        _ => Some(between(registers, accumulators::SOURCE, 0, last_plane)?),
    };
    let cursor_only = registers.get(output::CURSOR_ONLY) != 0;
    if cursor_only && (accumulators.is_none() || blend == BlendMode::Alpha) {
        return Err(value_of(output::CURSOR_ONLY));
    }
    Ok(Output {
        blend,
        format,
        plane: between(registers, start::PLANE, 0, last_plane)?,
        accumulators,
        cursor_only,
        sections: registers.get(output::SECTIONS) != 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEMORY: usize = 128 << 20;

    fn valid() -> FrameRegisters {
        let mut registers = FrameRegisters::default();
        registers.set(volume_format::FORMAT, VoxelFormat::Uint12Lower as u32);
        registers.set(volume_size_xy::X, 256);
        registers.set(volume_size_xy::Y, 100);
        registers.set(volume_size_z::Z, 1);
        registers.set(volume_pitch::ROW, 256);
        registers.set(volume_pitch::ROWS, 128);
        registers.set(base_plane_size::WIDTH, 256);
        registers.set(base_plane_size::HEIGHT, 100);
        registers
    }

    #[test]
    fn power_on_state_is_no_frame() {
        let fault = FrameDescription::decode(&FrameRegisters::default(), MEMORY).unwrap_err();
        assert_eq!(fault, value_of(volume_format::FORMAT));
    }

    #[test]
    fn each_field_out_of_range_is_named() {
        let cases = [
            (volume_size_xy::X, 0),
            (volume_size_xy::X, 257),
            (volume_size_xy::Y, 511),
            (volume_size_z::Z, 0),
            (volume_pitch::ROW, 255),
            (volume_pitch::ROW, 224),
            (volume_pitch::ROWS, 96),
            (volume_base::OFFSET, 1),
            (supersampling::Z, 0),
            (supersampling::Z, 9),
            (step_x::STEP, (1 << 22) + 1),
            (step_y::STEP, (1 << 23) - 1),
            (base_plane_size::WIDTH, 0),
            (base_plane_size::WIDTH, 513),
            (base_plane_size::HEIGHT, 0),
            (output::PLANE_FORMAT, 2),
            (output::PLANE_FORMAT, 3),
            (output::CURSOR_ONLY, 1),
            (accumulators::ENABLE, 1),
        ];
        for (field, value) in cases {
            let mut registers = valid();
            registers.set(field, value);
            let fault = FrameDescription::decode(&registers, MEMORY).unwrap_err();
            assert_eq!(fault, value_of(field), "{value}: {fault}");
        }
    }

    #[test]
    fn a_permutation_names_each_axis_once() {
        let mut registers = valid();
        registers.set(permutation::Y_AXIS, 0);
        let fault = FrameDescription::decode(&registers, MEMORY).unwrap_err();
        assert_eq!(fault, value_of(permutation::X_AXIS));
    }

    #[test]
    fn wide_planes_are_fewer() {
        let mut registers = valid();
        registers.set(start::PLANE, 15);
        assert!(FrameDescription::decode(&registers, MEMORY).is_ok());
        registers.set(output::PLANE_FORMAT, PlaneFormat::Accumulator64 as u32);
        assert_eq!(FrameDescription::decode(&registers, MEMORY), Err(value_of(start::PLANE)));
        registers.set(start::PLANE, 7);
        registers.set(accumulators::ENABLE, 1);
        registers.set(accumulators::SOURCE, 8);
        assert_eq!(FrameDescription::decode(&registers, MEMORY), Err(value_of(accumulators::SOURCE)));
        registers.set(output::PLANE_FORMAT, PlaneFormat::Sum128 as u32);
        assert_eq!(FrameDescription::decode(&registers, MEMORY), Err(value_of(output::PLANE_FORMAT)));
        registers.set(output::BLEND, BlendMode::Sum as u32);
        registers.set(start::PLANE, 3);
        registers.set(accumulators::SOURCE, 3);
        assert!(FrameDescription::decode(&registers, MEMORY).is_ok());
    }

    #[test]
    fn the_last_voxel_must_lie_in_voxel_memory() {
        let mut registers = valid();
        let bytes = (256 * 99 + 256) * 2;
        registers.set(volume_base::OFFSET, (MEMORY - bytes) as u32);
        assert!(FrameDescription::decode(&registers, MEMORY).is_ok());
        registers.set(volume_base::OFFSET, (MEMORY - bytes + 2) as u32);
        let range = Fault::new(FaultCode::Range, volume_base::OFFSET);
        assert_eq!(FrameDescription::decode(&registers, MEMORY), Err(range));
        registers.set(volume_base::OFFSET, u32::MAX - 1);
        assert_eq!(FrameDescription::decode(&registers, MEMORY), Err(range));
        let mut largest = valid();
        largest.set(volume_size_z::Z, 256);
        largest.set(volume_pitch::ROW, 0xffe0);
        largest.set(volume_pitch::ROWS, 0xffe0);
        assert_eq!(FrameDescription::decode(&largest, MEMORY), Err(range));
    }

    #[test]
    fn reflection_needs_a_unit_eye_vector() {
        let mut registers = valid();
        registers.set(material::SPECULAR, 1);
        for (eye, valid) in [([0, 0], false), ([32767, 0], true), ([-32768, 0], true), ([32767; 2], false)] {
            registers.set_signed(eye_xy::X, eye[0]);
            registers.set_signed(eye_z::Z, eye[1]);
            assert_eq!(FrameDescription::decode(&registers, MEMORY).is_ok(), valid, "{eye:?}");
        }
    }

    #[test]
    fn cursor_width_is_odd() {
        let mut registers = valid();
        registers.set(cursor_control::ENABLE_Y, 1);
        for width in 0..8 {
            registers.set(cursor_control::WIDTH, width);
            assert_eq!(FrameDescription::decode(&registers, MEMORY).is_ok(), width % 2 == 1, "{width}");
        }
    }

    #[test]
    fn cut_distances_are_signed_over_two_words() {
        let mut registers = valid();
        registers.set(cut_control::ENABLE, 1);
        registers.set(cut_min_low::WORD, 5);
        registers.set(cut_min_high::WORD, u32::MAX);
        let cut = FrameDescription::decode(&registers, MEMORY).unwrap().visibility.cut.unwrap();
        assert_eq!(cut.faces[0], -(1 << 32) + 5);
    }
}
