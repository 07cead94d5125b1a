//! Which samples can be seen (paper, sections 4.2 and 4.3), by their position in object voxel space: block range,
//! active sub-volume, cropping, cut plane.

use crate::fixed::{CUT_FACTOR, ONE_VOXEL, round_shift};
use crate::frame::{Crop, CutPlane, Visibility};
use vg500_regs::number::{CUT_COEFFICIENT, CUT_RECIPROCAL};
use vg500_regs::table::crop_flags;

/// Full opacity as a factor of the cut plane.
pub const UNCUT: u32 = 1 << CUT_FACTOR.fraction;

impl Visibility {
    /// Whether a sample at `position` (object space, 1/256 voxel, relative to the store) belongs to the block.
    #[must_use]
    pub fn block_contains(&self, position: [i64; 3]) -> bool {
        self.block.iter().zip(position).all(|(range, position)| {
            let [low, high] = range.map(|bound| i64::from(bound) * ONE_VOXEL);
            (low..high).contains(&position)
        })
    }

    /// How much of a sample's opacity sub-volume, cropping and cut plane leave: 0..=256.
    #[must_use]
    pub fn factor(&self, position: [i64; 3]) -> u32 {
        let cropped = self.crop.as_ref().is_some_and(|crop| !crop.keeps(position));
        if cropped || !self.subvolume_contains(position) {
            return 0;
        }
        self.cut.as_ref().map_or(UNCUT, |cut| cut.factor(position))
    }

    fn subvolume_contains(&self, position: [i64; 3]) -> bool {
        self.subvolume.iter().zip(position).all(|(bounds, position)| {
            let [min, max] = bounds.map(|bound| i64::from(bound) * ONE_VOXEL);
            (min..=max).contains(&position)
        })
    }

    /// Whether block range and sub-volume contain every sample of a volume of `size` voxels.
    #[must_use]
    pub fn bounds_contain_all(&self, size: [u32; 3]) -> bool {
        let last = size.map(|size| i64::from(size - 1) * ONE_VOXEL);
        [[0; 3], last].iter().all(|&end| self.block_contains(end) && self.subvolume_contains(end))
    }
}

impl Crop {
    /// Whether cropping leaves a sample.
    #[must_use]
    pub fn keeps(&self, position: [i64; 3]) -> bool {
        let in_slab = |axis: usize| {
            let [min, max] = self.slabs[axis].map(i64::from);
            (min..=max).contains(&position[axis])
        };
        self.combines([0, 1, 2].map(in_slab))
    }

    /// Whether cropping leaves samples that lie inside of these slabs.
    #[must_use]
    pub fn combines(&self, inside: [bool; 3]) -> bool {
        let terms = [crop_flags::TERM_0, crop_flags::TERM_1, crop_flags::TERM_2].map(|term| {
            let flags = term.get(self.flags);
            let intersection = (0..3).all(|axis| flags >> axis & 1 == 0 || inside[axis]);
            intersection != (flags >> 3 & 1 != 0)
        });
        let or = crop_flags::OR.get(self.flags) != 0;
        let combined = if or { terms.contains(&true) } else { !terms.contains(&false) };
        combined != (crop_flags::INVERT.get(self.flags) != 0)
    }
}

impl CutPlane {
    /// Factor of a sample's opacity: full inside of the slab, none beyond the falloff, linear between; the
    /// complement of it if the outside is what can be seen.
    #[must_use]
    pub fn factor(&self, position: [i64; 3]) -> u32 {
        let value: i64 = self.normal.iter().zip(position).map(|(&a, position)| i64::from(a) * position).sum();
        let [min, max] = self.faces;
        let distance = min.saturating_sub(value).max(value.saturating_sub(max));
        let inside = UNCUT - self.lost(distance);
        if self.outside { UNCUT - inside } else { inside }
    }

    /// What the falloff takes at a distance from the slab (22 fraction bits; not positive inside).
    fn lost(&self, distance: i64) -> u32 {
        if distance <= 0 {
            return 0;
        }
        if self.falloff == 0 {
            return UNCUT;
        }
        // The distance with 14 fraction bits; beyond 2^17 voxels the widest falloff has long ended.
        let distance = (distance >> ONE_VOXEL.trailing_zeros()).min(1 << 31);
        let bits = CUT_COEFFICIENT.fraction + CUT_RECIPROCAL.fraction - ONE_VOXEL.trailing_zeros();
        round_shift(distance * i64::from(self.falloff), bits).min(i64::from(UNCUT)) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVERYTHING: Visibility = Visibility {
        subvolume: [[-32768, 32767]; 3],
        block: [[0, 65535]; 3],
        crop: None,
        cut: None,
        cursor: None,
    };

    #[test]
    fn sub_volumes_are_inclusive_and_blocks_half_open() {
        let mut subvolume = EVERYTHING;
        subvolume.subvolume[1] = [2, 3];
        let mut block = EVERYTHING;
        block.block[1] = [2, 3];
        for (y, in_subvolume, in_block) in
            [(511, 0, false), (512, 256, true), (767, 256, true), (768, 256, false), (769, 0, false)]
        {
            assert_eq!(subvolume.factor([0, y, 9]), in_subvolume, "{y}");
            assert_eq!(block.block_contains([0, y, 9]), in_block, "{y}");
        }
    }

    #[test]
    fn bounds_that_cover_the_volume_are_known() {
        assert!(EVERYTHING.bounds_contain_all([256; 3]));
        let mut last = EVERYTHING;
        last.block[2] = [0, 10];
        assert!(last.bounds_contain_all([256, 256, 10]));
        assert!(!last.bounds_contain_all([256, 256, 11]));
    }

    /// The 27 regions that three slabs 1..=2 divide space into: below, inside, above on each axis.
    fn kept(flags: u32) -> usize {
        let crop = Crop { flags, slabs: [[256, 512]; 3] };
        let places = [0, 300, 600];
        let regions =
            places.iter().flat_map(|&x| places.iter().flat_map(move |&y| places.map(|z| [x, y, z])));
        regions.filter(|&position| crop.keeps(position)).count()
    }

    #[test]
    fn the_named_flag_combinations_keep_their_regions() {
        assert_eq!(kept(0x0007), 1); // sub-volume
        assert_eq!(kept(0x1563), 7); // cross: inside at least two slabs
        assert_eq!(kept(0x3563), 20); // its inverse
        assert_eq!(kept(0x1421), 19); // fence: inside at least one slab
        assert_eq!(kept(0x3421), 8); // its inverse
        assert_eq!(kept(0x000f), 26); // everything but the sub-volume
        assert_eq!(kept(0x1000), 27); // empty terms are everything
        assert_eq!(kept(0x1888), 0); // and nothing when inverted
    }

    /// Every combination of flags, for every way to lie in the slabs, against the sum of products that it stands for.
    #[test]
    fn all_flags_combine_slabs_as_the_manual_says() {
        for flags in 0..1_u32 << 14 {
            let crop = Crop { flags, slabs: [[0; 2]; 3] };
            let bit = |number: u32| flags & 1 << number != 0;
            for place in 0..8_u32 {
                let inside = [0, 1, 2].map(|axis| place & 1 << axis != 0);
                let term = |first: u32| {
                    let outside_of_one = (0..3).any(|axis| bit(first + axis) && place & 1 << axis == 0);
                    outside_of_one == bit(first + 3)
                };
                let met = [0, 4, 8].into_iter().filter(|first| term(*first)).count();
                let combined = if bit(12) { met > 0 } else { met == 3 };
                assert_eq!(crop.combines(inside), combined != bit(13), "{flags:#x} {inside:?}");
            }
        }
    }

    #[test]
    fn crop_bounds_are_inclusive_and_may_lie_between_voxels() {
        let crop = Crop { flags: 1, slabs: [[100, 101]; 3] };
        assert_eq!([99, 100, 101, 102].map(|x| crop.keeps([x, -5, 9999])), [false, true, true, false]);
    }

    #[test]
    fn the_falloff_is_linear_outside_of_the_faces() {
        // 10 <= x <= 12, falloff over 4 voxels.
        let mut cut = CutPlane {
            outside: false,
            normal: [1 << 14, 0, 0],
            faces: [10 << 22, 12 << 22],
            falloff: 1 << 14,
        };
        let places = [1536, 1537, 2048, 2304, 2560, 2816, 3072, 3328, 4096];
        assert_eq!(places.map(|x| cut.factor([x, 7, 7])), [0, 0, 128, 192, 256, 256, 256, 192, 0]);
        cut.outside = true;
        assert_eq!(places.map(|x| cut.factor([x, 7, 7])), [256, 256, 128, 64, 0, 0, 0, 64, 256]);
        cut.falloff = 0;
        assert_eq!([2559, 2560, 3072, 3073].map(|x| cut.factor([x, 7, 7])), [256, 0, 0, 256]);
    }

    #[test]
    fn extreme_planes_do_not_overflow() {
        for faces in [[i64::MIN, i64::MIN], [i64::MAX, i64::MAX], [i64::MIN, i64::MAX], [i64::MAX, i64::MIN]]
        {
            for falloff in [0, 1, 1 << 16, (1 << 17) - 1] {
                let cut = CutPlane { outside: false, normal: [i16::MIN; 3], faces, falloff };
                assert!(cut.factor([255 << 8; 3]) <= UNCUT);
            }
        }
    }
}
