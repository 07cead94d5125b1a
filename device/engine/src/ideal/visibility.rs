//! Which samples can be seen, by their position in object voxel space.

use vg500_regs::table::crop_flags;

/// Which of the existing samples can be seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visibility {
    /// Lowest and highest position in the active sub-volume for each axis, inclusive.
    pub subvolume: [[f64; 2]; 3],
    /// Lowest position, inclusive, and highest, exclusive, in the block for each axis.
    pub block: [[f64; 2]; 3],
    /// Cropping, unless it is off.
    pub crop: Option<Crop>,
    /// The cut plane, unless it is off.
    pub cut: Option<CutPlane>,
}

/// Cropping by three slabs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crop {
    /// Which slabs make up which term and how terms combine: the bits of `VLICrop::Flags`.
    pub flags: u32,
    /// Lower and upper face of each slab, inclusive.
    pub slabs: [[f64; 2]; 3],
}

/// The cut plane: a slab with soft edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutPlane {
    /// Whether the samples outside of the slab are the visible ones.
    pub outside: bool,
    /// Normal; of unit length if falloff is to be in voxels.
    pub normal: [f64; 3],
    /// Distances of the two faces along the normal.
    pub faces: [f64; 2],
    /// Width of the transition outside of each face; 0 is a hard edge.
    pub falloff: f64,
}

impl Visibility {
    /// Every sample can be seen.
    pub const EVERYTHING: Self = Self {
        subvolume: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
        block: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
        crop: None,
        cut: None,
    };

    /// Whether a sample at `position` belongs to the block.
    #[must_use]
    pub fn block_contains(&self, position: [f64; 3]) -> bool {
        self.block.iter().zip(position).all(|(&[low, high], place)| (low..high).contains(&place))
    }

    /// How much of a sample's opacity sub-volume, cropping and cut plane leave: 0..=1.
    #[must_use]
    pub fn factor(&self, position: [f64; 3]) -> f64 {
        let kept = within(&self.subvolume, position) == [true; 3]
            && self.crop.is_none_or(|crop| crop.keeps(position));
        match self.cut {
            _ if !kept => 0.0,
            Some(cut) => cut.factor(position),
            None => 1.0,
        }
    }
}

/// On which axes a position lies between bounds, ends included.
fn within(bounds: &[[f64; 2]; 3], position: [f64; 3]) -> [bool; 3] {
    [0, 1, 2].map(|axis| (bounds[axis][0]..=bounds[axis][1]).contains(&position[axis]))
}

impl Crop {
    /// Whether cropping leaves a sample. A term is the intersection of its slabs, perhaps inverted; the terms are
    /// joined by "or" or by "and", and the result perhaps inverted.
    #[must_use]
    pub fn keeps(&self, position: [f64; 3]) -> bool {
        let inside = within(&self.slabs, position);
        let term = |term: u32| {
            let intersection = (0..3).all(|axis| term >> axis & 1 == 0 || inside[axis]);
            intersection != (term >> 3 & 1 == 1)
        };
        let mut terms = [crop_flags::TERM_0, crop_flags::TERM_1, crop_flags::TERM_2]
            .map(|field| field.get(self.flags))
            .into_iter();
        let joined = if crop_flags::OR.get(self.flags) == 1 { terms.any(term) } else { terms.all(term) };
        joined != (crop_flags::INVERT.get(self.flags) == 1)
    }
}

impl CutPlane {
    /// Factor of a sample's opacity: 1 inside of the slab, 0 beyond the falloff, linear between; the complement of
    /// it if the outside is what can be seen.
    #[must_use]
    pub fn factor(&self, position: [f64; 3]) -> f64 {
        let value: f64 = self.normal.iter().zip(position).map(|(a, place)| a * place).sum();
        let [low, high] = self.faces;
        let distance = (low - value).max(value - high);
        let inside = if distance <= 0.0 { 1.0 } else { (1.0 - distance / self.falloff).max(0.0) };
        if self.outside { 1.0 - inside } else { inside }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sub_volumes_are_inclusive_and_blocks_half_open() {
        let mut visibility = Visibility::EVERYTHING;
        visibility.subvolume[1] = [2.0, 3.0];
        visibility.block[2] = [2.0, 3.0];
        let factors = [1.999, 2.0, 3.0, 3.001].map(|y| visibility.factor([0.0, y, 99.0]));
        assert_eq!(factors, [0.0, 1.0, 1.0, 0.0]);
        let contained = [1.999, 2.0, 2.999, 3.0].map(|z| visibility.block_contains([99.0, 0.0, z]));
        assert_eq!(contained, [false, true, true, false]);
    }

    /// Of the 27 regions around three slabs 1..=2, those that flags keep.
    fn kept(flags: u32) -> usize {
        let crop = Crop { flags, slabs: [[1.0, 2.0]; 3] };
        let place = |region: usize| [0.5, 1.5, 2.5][region % 3];
        (0..27).filter(|&region| crop.keeps([place(region), place(region / 3), place(region / 9)])).count()
    }

    #[test]
    fn the_named_flag_combinations_keep_their_regions() {
        let regions = [0x0007, 0x000f, 0x1563, 0x3563, 0x1421, 0x3421, 0x0021, 0x0029, 0x1888].map(kept);
        // Sub-volume and its complement, cross and its inverse, fence and its inverse, a bar, a hollow slab,
        // nothing.
        assert_eq!(regions, [1, 26, 7, 20, 19, 8, 3, 6, 0]);
    }

    #[test]
    fn crop_bounds_are_inclusive_and_exact() {
        let crop = Crop { flags: 1, slabs: [[0.1, 0.3]; 3] };
        let kept = [0.1 - 1e-12, 0.1, 0.3, 0.3 + 1e-12].map(|x| crop.keeps([x, -9.0, 1e9]));
        assert_eq!(kept, [false, true, true, false]);
    }

    #[test]
    fn the_falloff_is_linear_outside_of_the_faces() {
        // 10 <= 0.6 x + 0.8 y <= 12, falloff over 4 voxels; along the normal from the origin.
        let mut cut = CutPlane { outside: false, normal: [0.6, 0.8, 0.0], faces: [10.0, 12.0], falloff: 4.0 };
        let at = |cut: &CutPlane, distance: f64| cut.factor([0.6 * distance, 0.8 * distance, 77.0]);
        for (distance, expected) in [
            (5.0, 0.0),
            (6.0, 0.0),
            (7.0, 0.25),
            (9.0, 0.75),
            (10.5, 1.0),
            (11.5, 1.0),
            (13.0, 0.75),
            (17.0, 0.0),
        ] {
            assert!((at(&cut, distance) - expected).abs() < 1e-12, "{distance}");
            cut.outside = true;
            assert!((at(&cut, distance) - (1.0 - expected)).abs() < 1e-12, "{distance}");
            cut.outside = false;
        }
        let hard = CutPlane { falloff: 0.0, ..cut };
        assert_eq!([9.999, 10.001, 11.999, 12.001].map(|distance| at(&hard, distance)), [0.0, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn bounds_and_cut_plane_work_together() {
        let mut visibility = Visibility::EVERYTHING;
        visibility.cut =
            Some(CutPlane { outside: false, normal: [1.0, 0.0, 0.0], faces: [0.0, 1.0], falloff: 2.0 });
        visibility.crop = Some(Crop { flags: 2, slabs: [[4.0, 5.0]; 3] });
        assert_eq!(visibility.factor([2.0, 4.5, 0.0]), 0.5);
        assert_eq!(visibility.factor([2.0, 3.5, 0.0]), 0.0);
    }
}
