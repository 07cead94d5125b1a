//! The cut plane (`VLICutPlane`).

use glam::{DMat4, DVec3, DVec4};
use vg500_regs::FrameRegisters;
use vg500_regs::number::{CUT_COEFFICIENT, CUT_DISTANCE, CUT_RECIPROCAL};
use vg500_regs::table::*;

/// A slab of the world: what lies in it can be seen, or what lies outside of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutPlane {
    /// A, B, C, D of the plane, of any length but zero; the slab is `-thickness <= Ax + By + Cz + D <= 0` with the
    /// normal at unit length.
    plane: DVec4,
    thickness: f64,
    falloff: f64,
    outside: bool,
}

impl CutPlane {
    /// A cut plane in world space (millimetres); `falloff` is the width of the transition outside of each face in
    /// voxels. `None` for a normal of zero, a negative thickness or falloff, or anything not finite.
    #[must_use]
    pub fn new(plane: [f64; 4], thickness: f64, falloff: f64, outside: bool) -> Option<Self> {
        let plane = DVec4::from_array(plane);
        let length = plane.truncate().length();
        let valid = plane.is_finite() && length > 0.0 && length.is_finite();
        let plane = plane / length;
        let positive = |value: f64| value.is_finite() && value >= 0.0;
        (valid && plane.is_finite() && positive(thickness) && positive(falloff)).then_some(Self {
            plane,
            thickness,
            falloff,
            outside,
        })
    }

    /// Whether what lies outside of the slab can be seen.
    #[must_use]
    pub const fn outside(&self) -> bool {
        self.outside
    }

    /// Width of the transition outside of each face, in voxels.
    #[must_use]
    pub const fn falloff(&self) -> f64 {
        self.falloff
    }

    /// The slab in the voxel space of a volume with this model matrix: the unit normal, and the distances of the two
    /// faces along it.
    pub(crate) fn in_voxels(&self, world_from_voxel: &DMat4) -> (DVec3, [f64; 2]) {
        // A plane is a row vector: its value at a voxel is plane . (model voxel).
        let plane = world_from_voxel.transpose() * self.plane;
        let millimetres_per_voxel = plane.truncate().length();
        let plane = plane / millimetres_per_voxel;
        let thickness = self.thickness / millimetres_per_voxel;
        (plane.truncate(), [-plane.w - thickness, -plane.w])
    }

    /// Writes the cut-plane registers for a volume with this model matrix.
    pub(crate) fn program(&self, world_from_voxel: &DMat4, registers: &mut FrameRegisters) {
        let (normal, [min, max]) = self.in_voxels(world_from_voxel);
        registers.set(cut_control::ENABLE, 1);
        registers.set(cut_control::OUTSIDE, u32::from(self.outside));
        let [a, b, c] = coefficients(normal);
        registers.set_signed(cut_normal_xy::A, a);
        registers.set_signed(cut_normal_xy::B, b);
        registers.set_signed(cut_normal_z::C, c);
        let faces =
            [(min, cut_min_low::WORD, cut_min_high::WORD), (max, cut_max_low::WORD, cut_max_high::WORD)];
        for (distance, low, high) in faces {
            let word = (distance * (1_u64 << CUT_DISTANCE.fraction) as f64).round() as i64;
            registers.set(low, word as u32);
            registers.set(high, (word >> 32) as u32);
        }
        registers.set(cut_falloff::RECIPROCAL, self.reciprocal());
    }

    /// 1 / falloff; falloffs too narrow for the register become the narrowest, none is a hard edge.
    fn reciprocal(&self) -> u32 {
        let one = f64::from(1_u32 << CUT_RECIPROCAL.fraction);
        let most = (1_u32 << CUT_RECIPROCAL.bits) - 1;
        if self.falloff == 0.0 { 0 } else { ((one / self.falloff).round() as u32).clamp(1, most) }
    }
}

fn coefficients(normal: DVec3) -> [i32; 3] {
    let one = f64::from(1_u32 << CUT_COEFFICIENT.fraction);
    normal.to_array().map(|component| (component * one).round() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_without_normal_and_negative_widths_are_refused() {
        assert!(CutPlane::new([0.0, 0.0, 0.0, 1.0], 1.0, 0.0, false).is_none());
        assert!(CutPlane::new([0.0, f64::NAN, 0.0, 1.0], 1.0, 0.0, false).is_none());
        assert!(CutPlane::new([0.0, 1.0, 0.0, f64::INFINITY], 1.0, 0.0, false).is_none());
        assert!(CutPlane::new([0.0, 1.0, 0.0, 1.0], -1.0, 0.0, false).is_none());
        assert!(CutPlane::new([0.0, 1.0, 0.0, 1.0], 1.0, f64::NAN, false).is_none());
        assert!(CutPlane::new([0.0, 1e300, 0.0, 1.0], 1.0, 0.0, false).is_none());
    }

    #[test]
    fn world_planes_become_voxel_planes() {
        // Voxels of 2 mm along z, the first at z = 10 mm; the slab 14 <= z <= 20 mm is voxels 2..=5.
        let model = DMat4::from_translation(DVec3::new(0.0, 0.0, 10.0))
            * DMat4::from_scale(DVec3::new(1.0, 1.0, 2.0));
        let cut = CutPlane::new([0.0, 0.0, 5.0, -100.0], 6.0, 4.0, true).unwrap();
        let mut registers = FrameRegisters::default();
        cut.program(&model, &mut registers);
        assert_eq!(registers.get_signed(cut_normal_z::C), 1 << 14);
        assert_eq!(registers.get(cut_min_low::WORD), 2 << 22);
        assert_eq!(registers.get(cut_max_low::WORD), 5 << 22);
        assert_eq!(registers.get(cut_falloff::RECIPROCAL), 1 << 14);
        assert_eq!(registers.get(cut_control::OUTSIDE), 1);
    }

    #[test]
    fn falloffs_stay_in_their_register() {
        for (falloff, word) in [(0.0, 0), (1e-9, (1 << 17) - 1), (1.0, 1 << 16), (16.0, 1 << 12), (1e9, 1)] {
            let cut = CutPlane::new([1.0, 0.0, 0.0, 0.0], 1.0, falloff, false).unwrap();
            assert_eq!(cut.reciprocal(), word, "{falloff}");
        }
    }
}
