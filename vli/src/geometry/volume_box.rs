use glam::{DMat4, DVec3};

use super::error::{AXIS_NAMES, check_matrix};
use super::{GeometryError, ImageSize};

/// A volume in the world: voxel (i, j, k) lies at `model * (i, j, k)`, and its box is [0, n - 1] per axis.
///
/// The model matrix may scale, shear and mirror; left-handed volumes are shown as they are.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeBox {
    world_from_voxel: DMat4,
    size: [u32; 3],
}

impl VolumeBox {
    /// A volume of `size` voxels per axis, of any size, with the model matrix that takes voxel indices to
    /// world millimetres.
    ///
    /// # Errors
    /// An axis without voxels; a matrix that is not finite, not affine or not invertible.
    pub fn new(world_from_voxel: &DMat4, size: [u32; 3]) -> Result<Self, GeometryError> {
        for (axis, voxels) in AXIS_NAMES.into_iter().zip(size) {
            if voxels == 0 {
                return Err(GeometryError::Empty { axis });
            }
        }
        Ok(Self { world_from_voxel: check_matrix("model matrix", world_from_voxel)?, size })
    }

    /// The model matrix.
    #[must_use]
    pub const fn world_from_voxel(&self) -> &DMat4 {
        &self.world_from_voxel
    }

    /// Voxels along each axis.
    #[must_use]
    pub const fn size(&self) -> [u32; 3] {
        self.size
    }

    /// Highest voxel index along each axis.
    #[must_use]
    pub fn last(&self) -> DVec3 {
        DVec3::from_array(self.size.map(|voxels| f64::from(voxels - 1)))
    }

    /// Centre of the box in world millimetres.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        self.world_from_voxel.transform_point3(self.last() * 0.5)
    }

    /// Length in millimetres of the longest diagonal of the box. For a single voxel, whose box is a point,
    /// that of the box of 2 x 2 x 2 voxels, so that a picture of it has a size.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        let last = if self.size == [1; 3] { DVec3::ONE } else { self.last() };
        let signs = [[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0]];
        signs
            .into_iter()
            .map(|signs| self.world_from_voxel.transform_vector3(last * DVec3::from_array(signs)).length())
            .fold(0.0, f64::max)
    }

    /// Shortest distance in millimetres between neighbouring voxels along an axis, to which opacities of
    /// transfer functions refer.
    #[must_use]
    pub fn smallest_spacing(&self) -> f64 {
        let model = &self.world_from_voxel;
        [model.x_axis, model.y_axis, model.z_axis]
            .into_iter()
            .map(|axis| axis.truncate().length())
            .fold(f64::INFINITY, f64::min)
    }

    /// Half the image height in millimetres at which a picture shows the whole box from every side.
    #[must_use]
    pub fn parallel_scale(&self, size: ImageSize) -> f64 {
        let half = 0.5 * self.diagonal();
        let aspect = f64::from(size.width()) / f64::from(size.height());
        if aspect < 1.0 { half / aspect } else { half }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unusable_boxes_are_refused() {
        let unit = DMat4::IDENTITY;
        assert_eq!(VolumeBox::new(&unit, [4, 0, 4]), Err(GeometryError::Empty { axis: 'y' }));
        let refused = |change: fn(&mut DMat4)| {
            let mut model = unit;
            change(&mut model);
            VolumeBox::new(&model, [4; 3]).unwrap_err().to_string()
        };
        assert!(refused(|model| model.x_axis.x = f64::NAN).contains("coordinate"));
        assert!(refused(|model| model.w_axis.y = f64::INFINITY).contains("coordinate"));
        assert!(refused(|model| model.w_axis.y = 1e300).contains("coordinate"));
        assert!(refused(|model| model.w_axis.w = f64::NAN).contains("last row"));
        assert!(refused(|model| model.x_axis.w = 0.5).contains("last row"));
        assert!(refused(|model| model.x_axis.x = 0.0).contains("axis"));
        assert!(refused(|model| model.x_axis.x = 1e-200).contains("axis"));
        assert!(refused(|model| model.y_axis = model.x_axis * -3.0).contains("plane"));
    }

    #[test]
    fn box_ends_at_voxel_centres() {
        let model = DMat4::from_translation(DVec3::new(10.0, 20.0, 30.0))
            * DMat4::from_scale(DVec3::new(-0.5, 2.0, 4.0));
        let volume = VolumeBox::new(&model, [3, 4, 1]).unwrap();
        assert_eq!(volume.centre(), DVec3::new(9.5, 23.0, 30.0));
        assert_eq!(volume.diagonal(), 37.0_f64.sqrt());
        assert_eq!(volume.smallest_spacing(), 0.5);
    }

    #[test]
    fn diagonal_is_the_longest_of_a_sheared_box() {
        let mut model = DMat4::IDENTITY;
        model.z_axis.y = -1.0;
        let volume = VolumeBox::new(&model, [1, 11, 11]).unwrap();
        assert_eq!(volume.diagonal(), 500.0_f64.sqrt());
    }

    #[test]
    fn narrow_pictures_see_the_whole_box_too() {
        let volume = VolumeBox::new(&DMat4::IDENTITY, [5, 1, 4]).unwrap();
        let scale = |width, height| volume.parallel_scale(ImageSize::new(width, height).unwrap());
        assert_eq!(scale(10, 10), 2.5);
        assert_eq!(scale(20, 10), 2.5);
        assert_eq!(scale(10, 20), 5.0);
        let voxel = VolumeBox::new(&DMat4::IDENTITY, [1; 3]).unwrap();
        assert!(voxel.parallel_scale(ImageSize::new(10, 20).unwrap()) > 0.0);
    }
}
