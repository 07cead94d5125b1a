//! Which samples can be seen (paper, sections 4.2 and 4.3), by their position in object voxel space.

use crate::fixed::ONE_VOXEL;
use crate::frame::Visibility;

impl Visibility {
    /// Whether a sample at `position` (object space, 1/256 voxel, relative to the store) lies in the block range
    /// and in the active sub-volume.
    #[must_use]
    pub fn bounds_contain(&self, position: [i64; 3]) -> bool {
        (0..3).all(|axis| {
            let [low, high] = self.block[axis].map(|bound| i64::from(bound) * ONE_VOXEL);
            let [min, max] = self.subvolume[axis].map(|bound| i64::from(bound) * ONE_VOXEL);
            (low..high).contains(&position[axis]) && (min..=max).contains(&position[axis])
        })
    }

    /// Whether block range and sub-volume contain every sample of a volume of `size` voxels.
    #[must_use]
    pub fn bounds_contain_all(&self, size: [u32; 3]) -> bool {
        let last = size.map(|size| i64::from(size - 1) * ONE_VOXEL);
        self.bounds_contain([0; 3]) && self.bounds_contain(last)
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
        for (y, in_subvolume, in_block) in [
            (511, false, false),
            (512, true, true),
            (767, true, true),
            (768, true, false),
            (769, false, false),
        ] {
            assert_eq!(subvolume.bounds_contain([0, y, 9]), in_subvolume, "{y}");
            assert_eq!(block.bounds_contain([0, y, 9]), in_block, "{y}");
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
}
