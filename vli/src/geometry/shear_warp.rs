use glam::{DAffine2, DMat2, DMat4, DVec3, DVec4};
use vg500_regs::permutation::PermutedAxis;
use vg500_regs::{Permutation, limit, number};

use super::base_plane::RayExtent;
use super::error::{AXIS_NAMES, check_matrix};
use super::{BasePlane, Camera, GeometryError, ImageSize, Pass, Supersampling, VolumeBox};

/// Object axes of permuted x, y and z for principal axis x, y and z.
const BASE_ORDERS: [[usize; 3]; 3] = [[2, 1, 0], [0, 2, 1], [0, 1, 2]];

/// Components of the view direction count as equal when the shear between them is 1 to half a step of its
/// register, so that rounding errors do not decide.
const TIE: f64 = 1.0 - 1.0 / (1_u64 << (number::RAY_STEP.fraction + 1)) as f64;

/// A shear of one voxel per slice, as the step registers hold it.
const ONE: f64 = (1_u64 << number::RAY_STEP.fraction) as f64;

/// The shear-warp factorisation of a view of a volume, as the card renders it (paper, section 2).
///
/// The shear is the one the registers hold, rounded to 22 fraction bits, in everything that follows from it:
/// the samples, the base plane, and the warp to the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct ShearWarp {
    permutation: Permutation,
    size: [u32; 3],
    supersampling: Supersampling,
    step: [u32; 2],
    camera_from_permuted: DMat4,
    sample_distance: f64,
    rays: RayExtent,
}

impl ShearWarp {
    /// Factorises the view of `volume` by the view matrix `camera_from_world`, which may scale.
    ///
    /// The principal axis is that of the largest component of the view direction in voxel space, the last
    /// one among equals.
    ///
    /// # Errors
    /// More than 256 voxels along an axis; a view matrix that is not finite, not affine or not invertible.
    pub fn new(
        volume: &VolumeBox,
        camera_from_world: &DMat4,
        supersampling: Supersampling,
    ) -> Result<Self, GeometryError> {
        for (axis, size) in AXIS_NAMES.into_iter().zip(volume.size()) {
            if size > limit::VOLUME_SIZE {
                return Err(GeometryError::TooLarge { axis, size });
            }
        }
        let camera_from_voxel = check_matrix("view matrix", camera_from_world)? * *volume.world_from_voxel();
        // Two matrices that are invertible can make one that is not, to 64 bits.
        let camera_from_voxel = check_matrix("view matrix times model matrix", &camera_from_voxel)?;
        let direction = view_direction(&camera_from_voxel).to_array();
        let order = BASE_ORDERS[principal_axis(direction)];
        let along = direction[order[2]];
        let shear = [0, 1].map(|axis| (direction[order[axis]] / along).abs().min(1.0));
        let slices = f64::from(supersampling.factors()[2]);
        let step = shear.map(|shear| (shear * ONE / slices).round() as u32);

        // An axis that the rays do not advance along keeps its direction, whatever the sign of the rounding
        // errors in the view direction.
        let advances = [step[0] != 0, step[1] != 0, true];
        let permutation = permutation([0, 1, 2].map(|axis| PermutedAxis {
            axis: order[axis],
            flipped: advances[axis] && direction[order[axis]] < 0.0,
        }));
        let size = permutation.permuted(volume.size());
        let voxel_from_permuted = voxel_from_permuted(permutation, volume);
        let along_ray = step.map(|step| f64::from(step) / ONE);
        let sample_step = DVec3::new(along_ray[0], along_ray[1], 1.0 / slices);
        let world_from_permuted = *volume.world_from_voxel() * voxel_from_permuted;
        Ok(Self {
            permutation,
            size,
            supersampling,
            step,
            camera_from_permuted: camera_from_voxel * voxel_from_permuted,
            sample_distance: world_from_permuted.transform_vector3(sample_step).length(),
            rays: RayExtent::new(size, step, supersampling.factors()),
        })
    }

    /// Which object axis, in which direction, is permuted x, y and z. Library order: object (x, y, z),
    /// (x, z, y), (z, y, x) for principal axis z, y, x.
    #[must_use]
    pub const fn permutation(&self) -> Permutation {
        self.permutation
    }

    /// Voxels along permuted x, y and z.
    #[must_use]
    pub const fn permuted_size(&self) -> [u32; 3] {
        self.size
    }

    /// The sub-samples asked for.
    #[must_use]
    pub const fn supersampling(&self) -> Supersampling {
        self.supersampling
    }

    /// Registers `STEP_X` and `STEP_Y`: voxels that a ray advances per sample slice, 22 fraction bits.
    #[must_use]
    pub const fn step(&self) -> [u32; 2] {
        self.step
    }

    /// Voxels along permuted x and y that a ray advances per voxel slice, 0..=1 but for the rounding of the
    /// step registers.
    #[must_use]
    pub fn shear(&self) -> [f64; 2] {
        let slices = self.supersampling.factors()[2];
        self.step.map(|step| f64::from(step * slices) / ONE)
    }

    /// From permuted coordinates to camera space.
    #[must_use]
    pub const fn camera_from_permuted(&self) -> &DMat4 {
        &self.camera_from_permuted
    }

    /// Distance in millimetres between neighbouring samples of a ray.
    #[must_use]
    pub const fn sample_distance(&self) -> f64 {
        self.sample_distance
    }

    /// Existing samples of all passes, visible or not.
    #[must_use]
    pub const fn samples(&self) -> u64 {
        self.rays.samples()
    }

    /// The base plane: the smallest rectangle of the rays that have at least one existing sample.
    #[must_use]
    pub fn base_plane(&self) -> BasePlane {
        BasePlane::smallest(&self.rays, self.supersampling)
    }

    /// The base plane with a margin of rays without samples where the outline of the volume's box leaves the
    /// smallest rectangle, so that textures drawn into the outline never wrap. A pass has at most 512
    /// columns and rows even then.
    #[must_use]
    pub fn base_plane_with_margin(&self) -> BasePlane {
        let [shear_x, shear_y] = self.shear();
        let depth = f64::from(self.size[2] - 1);
        self.base_plane().extended_to([-shear_x * depth, -shear_y * depth])
    }

    /// The passes that render `plane`: one, unless x or y is supersampled.
    #[must_use]
    pub fn passes(&self, plane: &BasePlane) -> Vec<Pass> {
        plane.passes(self.supersampling)
    }

    /// From rays, given by permuted x and y in the first slice, to camera x and y.
    ///
    /// Rays follow the rounded shear, so that the true projection of a ray is a point only nearly: half a
    /// step of the last bit per slice. That of the middle slice stands for it, which halves the error and
    /// shows the centre of the volume exactly where it is.
    #[must_use]
    pub fn camera_from_ray(&self) -> DAffine2 {
        let matrix = &self.camera_from_permuted;
        let [shear_x, shear_y] = self.shear();
        let middle = f64::from(self.size[2] - 1) * 0.5;
        let origin = DVec3::new(shear_x * middle, shear_y * middle, middle);
        DAffine2 {
            matrix2: DMat2::from_cols(
                matrix.x_axis.truncate().truncate(),
                matrix.y_axis.truncate().truncate(),
            ),
            translation: matrix.transform_point3(origin).truncate(),
        }
    }

    /// The warp: from base-plane pixels to image pixels. Its inverse always exists, because the principal
    /// axis is never seen edge-on.
    #[must_use]
    pub fn image_from_base_plane(&self, plane: &BasePlane, camera: &Camera, size: ImageSize) -> DAffine2 {
        size.image_from_camera(camera.parallel_scale())
            * self.camera_from_ray()
            * plane.pixel_from_ray().inverse()
    }
}

/// Direction in voxel space of what the camera sees along -z; of any length.
///
/// It is orthogonal to the rows of camera x and y; the sign is that of the determinant, since
/// `camera_from_voxel * (x cross y)` is (0, 0, determinant).
fn view_direction(camera_from_voxel: &DMat4) -> DVec3 {
    let [x, y, z] = [0, 1, 2].map(|row| camera_from_voxel.row(row).truncate());
    let towards_viewer = x.cross(y);
    if z.dot(towards_viewer) > 0.0 { -towards_viewer } else { towards_viewer }
}

/// Axis of the largest component, the last among equals.
fn principal_axis(direction: [f64; 3]) -> usize {
    let magnitudes = direction.map(f64::abs);
    let largest = magnitudes.into_iter().fold(0.0, f64::max);
    (0..3).rev().find(|axis| magnitudes[*axis] >= largest * TIE).unwrap_or(2)
}

fn permutation(axes: [PermutedAxis; 3]) -> Permutation {
    let Some(permutation) = Permutation::new(axes) else {
        unreachable!("each base order names each axis once")
    };
    permutation
}

fn voxel_from_permuted(permutation: Permutation, volume: &VolumeBox) -> DMat4 {
    let last = volume.last().to_array();
    let mut origin = DVec3::ZERO.to_array();
    let columns = permutation.axes().map(|place| {
        let mut column = [0.0; 4];
        column[place.axis] = if place.flipped { -1.0 } else { 1.0 };
        if place.flipped {
            origin[place.axis] = last[place.axis];
        }
        DVec4::from_array(column)
    });
    DMat4::from_cols(columns[0], columns[1], columns[2], DVec3::from_array(origin).extend(1.0))
}
