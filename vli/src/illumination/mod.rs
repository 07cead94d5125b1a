//! What the library computes so that the card can illuminate: reflectance maps from lights, the eye vector, and
//! the gradient-magnitude table.
//!
//! The card takes gradients along the voxel axes as if voxels were cubes. Here this is corrected for anisotropic
//! and sheared volumes: with L the linear part of the model matrix, the gradient g that indexes a map stands for
//! the world gradient L^-T g.

pub(crate) mod gradient_table;
mod light;
mod reflectance;

pub use gradient_table::{GRADIENT_TABLE_LENGTH, gradient_magnitude_table};
pub use light::Light;
pub use reflectance::{ReflectanceMap, diffuse_map, eye_vector, specular_map};
