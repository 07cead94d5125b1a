//! Voxel memory: where volumes lie, padding included.

use std::ops::Range;

use vg500_regs::limit::{VOLUME_SIZE, VOXEL_PITCH};
use vg500_regs::memory::{padded, volume_bytes};
use vg500_regs::table::{volume_base, volume_format, volume_pitch, volume_size_xy, volume_size_z};
use vg500_regs::{FrameRegisters, VoxelFormat};

use crate::pool::Piece;
use crate::{Card, Error};

/// Room in voxel memory, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Availability {
    /// Free in all.
    pub free: u64,
    /// The largest free piece.
    pub largest: u64,
}

/// A box of voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slab {
    /// First voxel along x, y, z.
    pub origin: [u32; 3],
    /// Voxels along x, y, z, at least one.
    pub size: [u32; 3],
}

/// A volume in voxel memory; its place is free again when it is dropped.
///
/// Dimensions are padded to multiples of 32. What lies in the padding does not matter: the card replicates the
/// outermost voxels by the real size.
#[derive(Debug)]
pub struct BoardVolume {
    pub(crate) piece: Piece,
    dimensions: [u32; 3],
    format: VoxelFormat,
}

impl BoardVolume {
    /// Voxels along x, y, z.
    #[must_use]
    pub fn dimensions(&self) -> [u32; 3] {
        self.dimensions
    }

    /// How voxels are stored.
    #[must_use]
    pub fn format(&self) -> VoxelFormat {
        self.format
    }

    /// Byte offset of the first voxel in voxel memory.
    #[must_use]
    pub fn offset(&self) -> u64 {
        self.piece.range().start
    }

    /// Voxels from one row to the next, and rows from one slice to the next.
    #[must_use]
    pub fn pitch(&self) -> [u32; 2] {
        [padded(self.dimensions[0]), padded(self.dimensions[1])]
    }

    /// All voxels.
    #[must_use]
    pub fn whole(&self) -> Slab {
        Slab { origin: [0; 3], size: self.dimensions }
    }

    /// Describes a box of at most 256 voxels per axis as the volume of a frame: the registers `VOLUME_BASE`,
    /// `VOLUME_FORMAT`, `VOLUME_SIZE` and `VOLUME_PITCH`.
    ///
    /// # Errors
    ///
    /// [`Error::SlabOutside`], or [`Error::BlockSize`] if the box is too large for one frame.
    pub fn bind(&self, slab: &Slab, registers: &mut FrameRegisters) -> Result<(), Error> {
        self.check(slab)?;
        if slab.size.iter().any(|&size| size > VOLUME_SIZE) {
            return Err(Error::BlockSize { size: slab.size });
        }
        let [row, rows] = self.pitch();
        // Voxel memory ends below 4 GiB.
        registers.set(volume_base::OFFSET, self.byte_offset(slab.origin) as u32);
        registers.set(volume_format::FORMAT, self.format as u32);
        registers.set(volume_size_xy::X, slab.size[0]);
        registers.set(volume_size_xy::Y, slab.size[1]);
        registers.set(volume_size_z::Z, slab.size[2]);
        registers.set(volume_pitch::ROW, row);
        registers.set(volume_pitch::ROWS, rows);
        Ok(())
    }

    /// Refuses a slab that does not lie inside the volume.
    pub(crate) fn check(&self, slab: &Slab) -> Result<(), Error> {
        for (axis, dimension) in self.dimensions.into_iter().enumerate() {
            let (origin, size) = (slab.origin[axis], slab.size[axis]);
            if size == 0 || origin.checked_add(size).is_none_or(|end| end > dimension) {
                return Err(Error::SlabOutside { axis, origin, size, dimension });
            }
        }
        Ok(())
    }

    /// Byte offset of a voxel in voxel memory.
    pub(crate) fn byte_offset(&self, voxel: [u32; 3]) -> u64 {
        let [row, rows] = self.pitch().map(u64::from);
        let [x, y, z] = voxel.map(u64::from);
        self.offset() + ((z * rows + y) * row + x) * self.format.bytes() as u64
    }

    /// Bytes of voxel memory from the first to the last voxel of a slab inside the volume.
    pub(crate) fn bytes_of(&self, slab: &Slab) -> Range<u64> {
        let last = [0, 1, 2].map(|axis| slab.origin[axis] + slab.size[axis] - 1);
        self.byte_offset(slab.origin)..self.byte_offset(last) + self.format.bytes() as u64
    }
}

impl Card {
    /// Room for a volume of 1..=65504 voxels per axis. Its voxels are whatever was there.
    ///
    /// # Errors
    ///
    /// [`Error::Dimensions`], or [`Error::OutOfBoardMemory`].
    pub fn allocate_volume(&self, dimensions: [u32; 3], format: VoxelFormat) -> Result<BoardVolume, Error> {
        if dimensions.iter().any(|size| !(1..=VOXEL_PITCH).contains(size)) {
            return Err(Error::Dimensions { dimensions });
        }
        let piece = self
            .voxel_memory
            .allocate(volume_bytes(dimensions, format))
            .map_err(|it| Error::OutOfBoardMemory { wanted: it.wanted, largest: it.largest })?;
        Ok(BoardVolume { piece, dimensions, format })
    }

    /// How much room voxel memory has.
    #[must_use]
    pub fn available_memory(&self) -> Availability {
        let (free, largest) = self.voxel_memory.free();
        Availability { free, largest }
    }
}
