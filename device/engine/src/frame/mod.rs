//! A frame, as the engine sees it: an immutable snapshot of the registers at the start command.

mod decode;
mod needs;

pub use needs::Needs;

use vg500_regs::memory::Table;
use vg500_regs::{BlendMode, Permutation, PlaneFormat, VoxelFormat};

/// The volume of a frame: where its voxels lie and how many there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Volume {
    /// Byte offset of voxel (0, 0, 0) in voxel memory.
    pub base: usize,
    /// How voxels are stored.
    pub format: VoxelFormat,
    /// Real size along object x, y and z in voxels, 1..=256.
    pub size: [u32; 3],
    /// Voxels from one row to the next.
    pub row_pitch: u32,
    /// Rows from one slice to the next.
    pub slice_rows: u32,
}

/// Where rays run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rays {
    /// Position of ray (0, 0) in the first slice along permuted x and y, 22 fraction bits.
    pub start: [i32; 2],
    /// Advance per sample slice along permuted x and y, 22 fraction bits, 0..=1.
    pub step: [u32; 2],
    /// Sample slices per voxel slice, 1..=8.
    pub supersampling: u32,
    /// Columns and rows of rays, 1..=512.
    pub size: [u32; 2],
}

/// Which samples can be seen, apart from those that do not exist; all in object voxel space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Visibility {
    /// Lowest and highest voxel of the active sub-volume for each axis, inclusive.
    pub subvolume: [[i32; 2]; 3],
    /// Lowest voxel, inclusive, and highest, exclusive, of the block for each axis.
    pub block: [[i32; 2]; 3],
    /// Cropping, unless it is off.
    pub crop: Option<Crop>,
    /// The cut plane, unless it is off.
    pub cut: Option<CutPlane>,
    /// The cursor, unless it is off.
    pub cursor: Option<Cursor>,
}

/// Cropping by three slabs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// The 14 bits of `CROP_FLAGS`, which are those of the VLI.
    pub flags: u32,
    /// Lower and upper face of each slab, inclusive, 8 fraction bits.
    pub slabs: [[i32; 2]; 3],
}

/// The cut plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CutPlane {
    /// Whether the samples outside of the slab are the visible ones.
    pub outside: bool,
    /// Normal, 14 fraction bits.
    pub normal: [i16; 3],
    /// Distances of the two faces, 22 fraction bits.
    pub faces: [i64; 2],
    /// Reciprocal of the falloff, 16 fraction bits; 0 is a hard edge.
    pub falloff: u32,
}

/// The cursor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cursor {
    /// Which parts are drawn.
    pub enabled: [bool; 3],
    /// Whether planes are drawn instead of a cross hair.
    pub planes: bool,
    /// Whether nothing is drawn where two parts meet.
    pub exclude_overlap: bool,
    /// Whether it is drawn where the volume is cropped or cut away, too.
    pub disable_crop: bool,
    /// Width in voxels: 1, 3, 5 or 7.
    pub width: u32,
    /// Length of the cross hair's parts in voxels, 0 without end.
    pub length: u32,
    /// Centre, 8 fraction bits.
    pub position: [i32; 3],
    /// R, G, B, A of each part.
    pub color: [[u8; 4]; 3],
}

/// How samples are illuminated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Illumination {
    /// ke, kd and ks.
    pub emissive: u8,
    /// kd.
    pub diffuse: u8,
    /// ks.
    pub specular: u8,
    /// Colour of highlights.
    pub specular_color: [u8; 3],
    /// Unit vector towards the eye in object axes, 15 fraction bits.
    pub eye: [i16; 3],
    /// Whether opacity, diffuse and specular illumination are modulated by the gradient magnitude.
    pub modulate: [bool; 3],
}

/// Where the pixels of a frame go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Output {
    /// How rays are blended.
    pub blend: BlendMode,
    /// How they are stored.
    pub format: PlaneFormat,
    /// Base plane, counted in the size of the format.
    pub plane: u32,
    /// Base plane whose accumulators the rays begin with.
    pub accumulators: Option<u32>,
    /// Whether only the cursor is blended over the accumulators.
    pub cursor_only: bool,
    /// Whether the frame goes section by section through section memory.
    pub sections: bool,
}

/// Everything that decides a frame, but for tables and voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameDescription {
    /// The volume.
    pub volume: Volume,
    /// Which object axis each permuted axis follows.
    pub permutation: Permutation,
    /// Where rays run.
    pub rays: Rays,
    /// Which samples can be seen.
    pub visibility: Visibility,
    /// How samples are illuminated.
    pub illumination: Illumination,
    /// Where the pixels go.
    pub output: Output,
    /// Which copy of each table the frame uses, in the order of [`Table::ALL`].
    pub copies: [usize; Table::ALL.len()],
    /// What is not to be left out: bits as in `REPORT_OMITTED`.
    pub keep: u32,
    /// The client's promise that voxel memory has not changed since the last frame of this volume.
    pub voxels_unchanged: bool,
    /// Tag of the start command.
    pub tag: u16,
}

impl FrameDescription {
    /// Size of the volume along permuted x, y and z.
    #[must_use]
    pub fn permuted_size(&self) -> [u32; 3] {
        self.permutation.permuted(self.volume.size)
    }
}
