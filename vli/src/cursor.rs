//! The three-dimensional cursor (`VLICursor`).

use crate::crop::bound_word;
use vg500_regs::FrameRegisters;
use vg500_regs::table::*;

/// What the cursor draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CursorType {
    /// A bar along each enabled axis.
    #[default]
    CrossHair,
    /// A plane across each enabled axis.
    Planes,
}

/// The cursor. Positions and lengths are in voxels of the volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cursor {
    /// What is drawn.
    pub kind: CursorType,
    /// Which axes' parts are drawn: x, y, z. None switches the cursor off.
    pub enabled: [bool; 3],
    /// Nothing is drawn where two parts meet.
    pub exclude_overlap: bool,
    /// It is drawn where the volume is cropped or cut away, too.
    pub disable_crop: bool,
    /// Width: 1, 3, 5 or 7 voxels.
    pub width: u32,
    /// Length of the bars, 0 without end.
    pub length: u32,
    /// Centre.
    pub position: [f64; 3],
    /// R, G, B and opacity of each axis' part.
    pub color: [[u8; 4]; 3],
}

impl Default for Cursor {
    /// Off; when switched on, an opaque cross hair in red, green and blue without end.
    fn default() -> Self {
        Self {
            kind: CursorType::CrossHair,
            enabled: [false; 3],
            exclude_overlap: false,
            disable_crop: false,
            width: 1,
            length: 0,
            position: [0.0; 3],
            color: [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]],
        }
    }
}

impl Cursor {
    /// Writes the cursor registers.
    pub(crate) fn program(&self, registers: &mut FrameRegisters) {
        let flags = [
            (cursor_control::ENABLE_X, self.enabled[0]),
            (cursor_control::ENABLE_Y, self.enabled[1]),
            (cursor_control::ENABLE_Z, self.enabled[2]),
            (cursor_control::PLANES, self.kind == CursorType::Planes),
            (cursor_control::EXCLUDE_OVERLAP, self.exclude_overlap),
            (cursor_control::DISABLE_CROP, self.disable_crop),
        ];
        for (field, on) in flags {
            registers.set(field, u32::from(on));
        }
        registers.set(cursor_control::WIDTH, self.width);
        registers.set(cursor_length::LENGTH, self.length.min(u32::from(u16::MAX)));
        let positions = [cursor_x::POSITION, cursor_y::POSITION, cursor_z::POSITION];
        for (field, position) in positions.into_iter().zip(self.position) {
            registers.set_signed(field, bound_word(position));
        }
        let colors = [cursor_color_x::REGISTER, cursor_color_y::REGISTER, cursor_color_z::REGISTER];
        for (register, color) in colors.into_iter().zip(self.color) {
            registers.write(register.offset, u32::from_le_bytes(color));
        }
    }
}
