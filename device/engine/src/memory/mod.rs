//! How voxels and pixels lie in memory.

pub mod miniblock;
pub mod pixel;
pub mod voxel;
