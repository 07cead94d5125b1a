//! The mathematics of a frame: permutation, shear and warp of an orthographic view.
//!
//! Spaces, from the volume to the picture:
//!
//! * **voxel**: indices (i, j, k) of the volume as it is stored; the volume's box is [0, n - 1] per axis,
//! * **world**: millimetres, by the model matrix,
//! * **camera**: right-handed, looking along -z, by the view matrix (OpenGL's convention),
//! * **permuted**: voxel indices reordered and flipped so that z is the principal axis of the view and no ray
//!   goes backwards along an axis: the origin is the vertex of the box nearest to the image plane, where a
//!   volume that is sheared or anisotropic counts as the cube it is in voxel space (paper, section 3.2),
//! * **ray**: where a ray passes the first slice, in permuted x and y,
//! * **base plane**: pixels of the base plane; a pixel's centre has whole coordinates,
//! * **image**: pixels of the picture; a pixel's centre has whole coordinates, row 0 on top.
//!
//! Matrices are named `to_from`, so that `camera_from_world * world_from_voxel` reads in one line. They are
//! 64-bit floating point without fused multiply-add; sines and cosines come from `libm`: every machine
//! computes the same bits.

mod base_plane;
mod camera;
mod error;
mod hexagon;
mod picture;
#[cfg(test)]
mod scenes;
mod shear_warp;
mod supersampling;
#[cfg(test)]
mod tests;
mod volume_box;

pub use base_plane::{BasePlane, Pass};
pub use camera::{Camera, Viewpoint, look_at, sin_cos_degrees};
pub use error::GeometryError;
pub use hexagon::Hexagon;
pub use picture::ImageSize;
pub use shear_warp::ShearWarp;
pub use supersampling::{Accumulation, Supersampling};
pub use volume_box::VolumeBox;
