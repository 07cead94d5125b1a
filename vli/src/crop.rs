//! Cropping by three slabs (`VLICrop`).

use vg500_regs::FrameRegisters;
use vg500_regs::number::BOUND;
use vg500_regs::table::*;

/// Cropping. Slabs are in voxels of the volume, bounds inclusive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Crop {
    /// Lower and upper bound along x, y and z.
    pub slabs: [[f64; 2]; 3],
    /// Which slabs make up which term and how terms combine; 0 disables cropping. The bits are those of
    /// `VLICrop::Flags`.
    pub flags: u32,
}

impl Crop {
    /// Flags: the intersection of the three slabs.
    pub const SUB_VOLUME: u32 = 0x0007;
    /// Flags: what lies in at least two slabs.
    pub const CROSS: u32 = 0x1563;
    /// Flags: what lies in at most one slab.
    pub const CROSS_INVERTED: u32 = 0x3563;
    /// Flags: what lies in at least one slab.
    pub const FENCE: u32 = 0x1421;
    /// Flags: what lies in no slab.
    pub const FENCE_INVERTED: u32 = 0x3421;
    /// All flags there are.
    pub const ALL_FLAGS: u32 = 0x3fff;

    /// Writes the crop registers.
    pub(crate) fn program(&self, registers: &mut FrameRegisters) {
        registers.write(crop_flags::REGISTER.offset, self.flags & Self::ALL_FLAGS);
        let fields = [
            [crop_min_x::BOUND, crop_max_x::BOUND],
            [crop_min_y::BOUND, crop_max_y::BOUND],
            [crop_min_z::BOUND, crop_max_z::BOUND],
        ];
        for (fields, bounds) in fields.iter().zip(self.slabs) {
            for (field, bound) in fields.iter().zip(bounds) {
                registers.set_signed(*field, bound_word(bound));
            }
        }
    }
}

/// A coordinate in voxels as a bound; what lies beyond the register's range saturates.
pub(crate) fn bound_word(coordinate: f64) -> i32 {
    (coordinate * f64::from(1_u32 << BOUND.fraction)).round() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_have_eight_fraction_bits_and_saturate() {
        let mut registers = FrameRegisters::default();
        let crop = Crop { slabs: [[-1.5, 10.0], [0.25, 1e12], [f64::NEG_INFINITY, 3.0]], flags: Crop::FENCE };
        crop.program(&mut registers);
        assert_eq!(registers.get_signed(crop_min_x::BOUND), -384);
        assert_eq!(registers.get_signed(crop_min_y::BOUND), 64);
        assert_eq!(registers.get_signed(crop_max_y::BOUND), i32::MAX);
        assert_eq!(registers.get_signed(crop_min_z::BOUND), i32::MIN);
        assert_eq!(registers.word(crop_flags::REGISTER), 0x1421);
    }
}
