//! How voxels, pixels and what passes between sections lie in memory.

pub mod miniblock;
pub mod pixel;
pub mod section;
pub mod voxel;
