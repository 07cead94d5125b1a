//! The card's limits. Past them the card answers with a status error that names the field.

/// Voxels per axis that one pass can render (paper, section 4.2).
pub const VOLUME_SIZE: u32 = 256;
/// Rays per base-plane row, and rows per base plane (paper, section 6).
pub const BASE_PLANE_SIZE: u32 = 512;
/// Base planes in the 32-bit format that pixel memory holds (paper, section 6).
pub const BASE_PLANES: u32 = 16;
/// Sample slices per voxel slice (paper, section 4.1).
pub const SUPERSAMPLING: u32 = 8;
/// Stored dimensions of a volume are multiples of this many voxels (paper, section 5.2).
pub const VOXEL_PADDING: u32 = 32;
/// Largest row length, and row count per slice, of a stored volume. Larger than [`VOLUME_SIZE`], so
/// that a block of a larger volume can be rendered where it lies; 16-bit register fields.
pub const VOXEL_PITCH: u32 = 65_504;
/// Samples per ray of a weighted sum that the 128-bit accumulators can hold without overflow:
/// 4095 * 32768 < 2^27.
pub const SUM_SAMPLES: u32 = 32_768;
/// Entries of the classification table (paper, section 3.4).
pub const LOOKUP_ENTRIES: usize = 4096;
/// Entries of one reflectance map: six faces of 8 x 8 vertices (paper, section 3.5).
pub const REFLECTANCE_ENTRIES: usize = 384;
/// Entries of the gradient-magnitude table; 0..=220 are reached (paper, section 3.3).
pub const GRADIENT_MAGNITUDE_ENTRIES: usize = 256;
/// Frames and transfers that may wait for the engine. Our choice: one frame for each base plane and
/// one transfer for each, so that a client that owns every plane never meets a full queue.
pub const QUEUE: usize = 32;
/// Width of one section in voxels (paper, section 5.4).
pub const SECTION_WIDTH: u32 = 32;
/// Chip clock in Hz (paper, section 5).
pub const CLOCK_HZ: u32 = 125_000_000;
/// Parallel pipelines, each taking one voxel per clock (paper, section 5.1).
pub const PIPELINES: u32 = 4;
