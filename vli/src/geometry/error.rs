use crate::text::number;
use glam::{DMat4, DVec3};

/// Largest magnitude, in millimetres or voxels, that a coordinate or the length of an axis may have; its
/// reciprocal is the smallest length. Products of three stay far inside the range of 64-bit numbers.
pub(super) const MAXIMUM_COORDINATE: f64 = 1e12;

/// Smallest volume of the parallelepiped of a matrix's normalised axes: below, they lie in one plane.
const MINIMUM_VOLUME: f64 = 1e-9;

/// Why a view cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeometryError {
    /// A coordinate is NaN, infinite, or absurdly large.
    #[error("{0}: a coordinate is not a number between -1e12 and 1e12")]
    Coordinate(&'static str),
    /// A matrix whose last row is not (0, 0, 0, 1).
    #[error("{0}: the last row is not 0 0 0 1; only parallel projection exists")]
    NotAffine(&'static str),
    /// A matrix that flattens space, or with an axis absurdly short or long.
    #[error("{0}: an axis is shorter than 1e-12 or longer than 1e12, or the axes lie in one plane")]
    Singular(&'static str),
    /// The camera stands where it looks.
    #[error("camera: position and focal point coincide")]
    PositionAtFocal,
    /// The view-up vector does not say which way is up.
    #[error("camera: the view-up vector is zero or parallel to the view direction")]
    UpAlongView,
    /// Half the image height is not positive, or absurd.
    #[error("camera: parallel scale {} is not between 1e-12 and 1e12", number(*.0))]
    ParallelScale(f64),
    /// A picture without pixels, or too many.
    #[error("picture: {0} x {1} pixels, each must be 1..={max}", max = super::ImageSize::MAXIMUM)]
    ImageSize(u32, u32),
    /// A volume without voxels.
    #[error("volume: no voxels along {axis}")]
    Empty {
        /// Voxel axis: x, y or z.
        axis: char,
    },
    /// A volume that one pass of the card cannot render.
    #[error("volume: {size} voxels along {axis}, one pass renders at most {max}", max = vg500_regs::limit::VOLUME_SIZE)]
    TooLarge {
        /// Voxel axis: x, y or z.
        axis: char,
        /// Voxels along it.
        size: u32,
    },
    /// A number of sub-samples that the card does not have.
    #[error("supersampling: {factor} along {axis}, must be 1..={max}", max = vg500_regs::limit::SUPERSAMPLING)]
    Supersampling {
        /// Permuted axis: x, y or z.
        axis: char,
        /// Sub-samples per voxel along it.
        factor: u32,
    },
}

/// Names of the axes in messages.
pub(super) const AXIS_NAMES: [char; 3] = ['x', 'y', 'z'];

/// Checks that a vector has coordinates one can compute with.
pub(super) fn check_coordinates(what: &'static str, vector: DVec3) -> Result<DVec3, GeometryError> {
    // Not written as `>`, which NaN would pass.
    if vector.to_array().iter().all(|value| value.abs() <= MAXIMUM_COORDINATE) {
        Ok(vector)
    } else {
        Err(GeometryError::Coordinate(what))
    }
}

/// Checks that a matrix is finite, affine and invertible.
pub(super) fn check_matrix(what: &'static str, matrix: &DMat4) -> Result<DMat4, GeometryError> {
    for column in matrix.to_cols_array_2d() {
        check_coordinates(what, DVec3::new(column[0], column[1], column[2]))?;
    }
    if matrix.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
        return Err(GeometryError::NotAffine(what));
    }
    let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| axis.truncate());
    let lengths = axes.map(DVec3::length);
    if !lengths.iter().all(|length| (1.0 / MAXIMUM_COORDINATE..=MAXIMUM_COORDINATE).contains(length)) {
        return Err(GeometryError::Singular(what));
    }
    let [x, y, z] = [0, 1, 2].map(|axis| axes[axis] / lengths[axis]);
    if x.dot(y.cross(z)).abs() < MINIMUM_VOLUME {
        return Err(GeometryError::Singular(what));
    }
    Ok(*matrix)
}
