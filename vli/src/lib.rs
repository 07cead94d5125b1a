//! The Volume Library Interface.

pub mod geometry;
pub mod warp;
