//! The Volume Library Interface.

pub mod geometry;
pub mod illumination;
pub mod warp;
