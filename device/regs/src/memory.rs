//! What lies where in the mapped memories.

use crate::format::{PlaneFormat, VoxelFormat};
use crate::limit::{
    BASE_PLANE_SIZE, GRADIENT_MAGNITUDE_ENTRIES, LOOKUP_ENTRIES, REFLECTANCE_ENTRIES, VOXEL_PADDING,
};
use crate::pci::PIXEL_MEMORY;

/// A table in table memory. Each exists twice; the register `TABLE_SELECT` says which copy a frame uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Table {
    /// 4096 words: red in bits 7..0, green 15..8, blue 23..16 (paper, section 3.4).
    Color = 0,
    /// 2048 words of two 12-bit opacities: even entry in bits 11..0, odd entry in 27..16 (paper, section 3.4).
    Opacity = 1,
    /// 384 words, intensity in bits 7..0 (paper, section 3.5).
    Diffuse = 2,
    /// 384 words, intensity in bits 7..0 (paper, section 3.5).
    Specular = 3,
    /// 64 words of four 8-bit entries, the lowest entry in bits 7..0 (paper, section 3.3).
    GradientMagnitude = 4,
}

impl Table {
    /// All tables, in the order of their bits in `TABLE_SELECT`.
    pub const ALL: [Self; 5] =
        [Self::Color, Self::Opacity, Self::Diffuse, Self::Specular, Self::GradientMagnitude];

    /// Name in messages and the manual.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Color => "color table",
            Self::Opacity => "opacity table",
            Self::Diffuse => "diffuse reflectance map",
            Self::Specular => "specular reflectance map",
            Self::GradientMagnitude => "gradient-magnitude table",
        }
    }

    /// Bytes of one copy.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Color => LOOKUP_ENTRIES * 4,
            Self::Opacity => LOOKUP_ENTRIES * 2,
            Self::Diffuse | Self::Specular => REFLECTANCE_ENTRIES * 4,
            Self::GradientMagnitude => GRADIENT_MAGNITUDE_ENTRIES,
        }
    }

    /// Byte offset of copy 0 or 1 in table memory.
    #[must_use]
    pub const fn offset(self, copy: usize) -> usize {
        let inside = match self {
            Self::Color => 0x0000,
            Self::Opacity => 0x4000,
            Self::Diffuse => 0x6000,
            Self::Specular => 0x6800,
            Self::GradientMagnitude => 0x7000,
        };
        (copy & 1) * TABLE_COPY + inside
    }
}

/// Distance between the two copies of a table.
pub const TABLE_COPY: usize = 0x8000;

/// Bytes of one base plane: 512 rows of 512 rays.
#[must_use]
pub const fn plane_bytes(format: PlaneFormat) -> usize {
    (BASE_PLANE_SIZE * BASE_PLANE_SIZE) as usize * format.bytes()
}

/// Bytes from one base-plane row to the next; rows are always 512 rays apart.
#[must_use]
pub const fn plane_pitch(format: PlaneFormat) -> usize {
    BASE_PLANE_SIZE as usize * format.bytes()
}

/// Base planes of a format that pixel memory holds: 16, 8 or 4. Planes of different formats overlap.
#[must_use]
pub const fn planes(format: PlaneFormat) -> u32 {
    (PIXEL_MEMORY.size as usize / plane_bytes(format)) as u32
}

/// The 32-bit base planes that base plane `plane` of a format covers. The first of them is its place in
/// `PLANE_STATE`, `PLANE_FAULT`, `CANCEL` and the report block.
#[must_use]
pub const fn covered_planes(format: PlaneFormat, plane: u32) -> core::ops::Range<u32> {
    let width = (plane_bytes(format) / plane_bytes(PlaneFormat::Rgba8)) as u32;
    plane * width..(plane + 1) * width
}

/// Byte offset of ray (`column`, `row`) of base plane `plane` in pixel memory.
#[must_use]
pub const fn plane_offset(format: PlaneFormat, plane: u32, column: u32, row: u32) -> usize {
    plane as usize * plane_bytes(format)
        + row as usize * plane_pitch(format)
        + column as usize * format.bytes()
}

/// A dimension as it is stored: the next multiple of 32 (paper, section 5.2).
#[must_use]
pub const fn padded(dimension: u32) -> u32 {
    dimension.next_multiple_of(VOXEL_PADDING)
}

/// Bytes that a volume of these dimensions takes in voxel memory, padding included.
#[must_use]
pub const fn volume_bytes(dimensions: [u32; 3], format: VoxelFormat) -> u64 {
    padded(dimensions[0]) as u64
        * padded(dimensions[1]) as u64
        * padded(dimensions[2]) as u64
        * format.bytes() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pci::TABLE_MEMORY;

    #[test]
    fn tables_do_not_overlap_and_fit() {
        let mut ranges: Vec<_> = (0..2)
            .flat_map(|copy| Table::ALL.map(|table| (table.offset(copy), table.offset(copy) + table.bytes())))
            .collect();
        ranges.sort_unstable();
        assert!(ranges.windows(2).all(|pair| pair[0].1 <= pair[1].0), "{ranges:x?}");
        assert!(ranges.last().unwrap().1 as u64 <= TABLE_MEMORY.size);
    }

    #[test]
    fn pixel_memory_holds_sixteen_eight_and_four_planes() {
        assert_eq!(planes(PlaneFormat::Rgba8), 16);
        assert_eq!(planes(PlaneFormat::Accumulator64), 8);
        assert_eq!(planes(PlaneFormat::Sum128), 4);
        assert_eq!(plane_offset(PlaneFormat::Rgba8, 15, 511, 511) + 4, 16 << 20);
        assert_eq!(covered_planes(PlaneFormat::Rgba8, 15), 15..16);
        assert_eq!(covered_planes(PlaneFormat::Accumulator64, 3), 6..8);
        assert_eq!(covered_planes(PlaneFormat::Sum128, 3), 12..16);
    }

    #[test]
    fn four_volumes_of_256_cubed_fit_into_voxel_memory() {
        assert_eq!(volume_bytes([256; 3], VoxelFormat::Uint12Lower) * 4, 128 << 20);
        assert_eq!(volume_bytes([1, 33, 32], VoxelFormat::Uint8), 32 * 64 * 32);
    }
}
