//! The Volume Library Interface (VLI): volumes, lookup tables, lights, cameras and contexts, rendered by a VolumePro 500.
//!
//! A [`Context`] holds everything a frame needs but the [`Volume`]; a [`Board`] renders both into a [`BasePlane`],
//! and [`warp`](warp::warp) makes a picture of it.

mod board;
pub mod command;
mod context;
mod crop;
mod cursor;
mod cut_plane;
#[cfg(feature = "embedded")]
mod embedded;
pub mod file;
pub mod geometry;
#[cfg(feature = "embedded")]
pub mod ideal;
pub mod illumination;
mod lookup_table;
mod passes;
pub mod phantom;
mod text;
pub mod transfer;
pub mod values;
mod volume;
pub mod warp;

pub use board::{BasePlane, Board, FrameReport, RenderError, Rendering};
pub use context::{Context, Modulation, Reflection};
pub use crop::Crop;
pub use cursor::{Cursor, CursorType};
pub use cut_plane::CutPlane;
pub use lookup_table::LookupTable;
pub use volume::{Volume, VolumeError, VoxelIdentity, Voxels};
