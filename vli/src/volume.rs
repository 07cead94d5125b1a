//! A volume (`VLIVolume`): voxels, format, model matrix, active sub-volume.

use crate::geometry::{GeometryError, VolumeBox};
use glam::DMat4;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use vg500_regs::VoxelFormat;

/// Voxels as the card stores them: x fastest, then y, then z, without padding.
#[derive(Clone, Debug)]
pub enum Voxels {
    /// 8-bit voxels.
    Uint8(Arc<[u8]>),
    /// 12-bit voxels in the low bits of 16.
    Uint12Lower(Arc<[u16]>),
    /// 12-bit voxels in the high bits of 16.
    Uint12Upper(Arc<[u16]>),
}

impl Voxels {
    /// The card's code of the format.
    #[must_use]
    pub const fn format(&self) -> VoxelFormat {
        match self {
            Self::Uint8(_) => VoxelFormat::Uint8,
            Self::Uint12Lower(_) => VoxelFormat::Uint12Lower,
            Self::Uint12Upper(_) => VoxelFormat::Uint12Upper,
        }
    }

    /// Number of voxels.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Uint8(voxels) => voxels.len(),
            Self::Uint12Lower(voxels) | Self::Uint12Upper(voxels) => voxels.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Why a volume cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VolumeError {
    /// The number of voxels is not the product of the dimensions.
    #[error("{x} x {y} x {z} voxels are wanted, {given} are given", x = size[0], y = size[1], z = size[2])]
    Count {
        /// Dimensions.
        size: [u32; 3],
        /// Voxels given.
        given: usize,
    },
    /// Size or model matrix cannot be shown.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
}

/// Which voxels a volume has: two volumes with the same identity have the same voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct VoxelIdentity(u64);

impl VoxelIdentity {
    fn next() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}

/// A volume.
#[derive(Clone, Debug)]
pub struct Volume {
    voxels: Voxels,
    identity: VoxelIdentity,
    place: VolumeBox,
    /// Lowest and highest voxel that is shown along x, y and z, inclusive.
    subvolume: [[u32; 2]; 3],
}

impl Volume {
    /// A volume of `size` voxels, shown with voxel (i, j, k) at (i, j, k).
    ///
    /// # Errors
    /// The number of voxels is not that of the dimensions, or one of these is zero.
    pub fn new(size: [u32; 3], voxels: Voxels) -> Result<Self, VolumeError> {
        let wanted = size.iter().try_fold(1_usize, |product, &size| product.checked_mul(size as usize));
        if wanted != Some(voxels.len()) {
            return Err(VolumeError::Count { size, given: voxels.len() });
        }
        let place = VolumeBox::new(&DMat4::IDENTITY, size)?;
        let subvolume = size.map(|size| [0, size - 1]);
        Ok(Self { voxels, identity: VoxelIdentity::next(), place, subvolume })
    }

    /// Sets the model matrix: voxel index to world millimetres.
    ///
    /// # Errors
    /// The matrix is not finite, not affine, or not invertible.
    pub fn set_model_matrix(&mut self, world_from_voxel: &DMat4) -> Result<(), VolumeError> {
        self.place = VolumeBox::new(world_from_voxel, self.size())?;
        Ok(())
    }

    /// Shows only `size` voxels from `origin` on; what lies outside of the volume is ignored.
    pub fn set_active_subvolume(&mut self, origin: [u32; 3], size: [u32; 3]) {
        self.subvolume = [0, 1, 2].map(|axis| {
            let last = origin[axis].saturating_add(size[axis].saturating_sub(1));
            [origin[axis], last.min(self.size()[axis] - 1)]
        });
    }

    /// Dimensions in voxels.
    #[must_use]
    pub const fn size(&self) -> [u32; 3] {
        self.place.size()
    }

    /// The voxels.
    #[must_use]
    pub const fn voxels(&self) -> &Voxels {
        &self.voxels
    }

    /// Which voxels these are.
    #[must_use]
    pub const fn identity(&self) -> VoxelIdentity {
        self.identity
    }

    /// Size and place in the world.
    #[must_use]
    pub const fn place(&self) -> &VolumeBox {
        &self.place
    }

    /// Lowest and highest voxel that is shown along x, y and z, inclusive.
    #[must_use]
    pub const fn subvolume(&self) -> [[u32; 2]; 3] {
        self.subvolume
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_voxels_must_be_that_of_the_dimensions() {
        let voxels = || Voxels::Uint8(vec![0; 24].into());
        assert!(Volume::new([2, 3, 4], voxels()).is_ok());
        let error = Volume::new([2, 3, 5], voxels()).unwrap_err();
        assert_eq!(error.to_string(), "2 x 3 x 5 voxels are wanted, 24 are given");
        assert!(Volume::new([u32::MAX; 3], voxels()).is_err());
        assert!(Volume::new([0, 3, 5], Voxels::Uint8(Arc::new([]))).is_err());
    }

    #[test]
    fn sub_volumes_end_with_the_volume() {
        let mut volume = Volume::new([2, 3, 4], Voxels::Uint8(vec![0; 24].into())).unwrap();
        volume.set_active_subvolume([1, 1, 1], [9, 2, 1]);
        assert_eq!(volume.subvolume(), [[1, 1], [1, 2], [1, 1]]);
    }
}
