//! Voxels in permuted order.

use crate::frame::FrameDescription;
use vg500_regs::shared::OutOfRange;
use vg500_regs::{SharedView, VoxelFormat};

/// The volume of a frame with its axes in permuted order and direction.
#[derive(Clone, Copy, Debug)]
pub struct PermutedVolume<'a> {
    memory: SharedView<'a>,
    format: VoxelFormat,
    /// Voxels along permuted x, y and z.
    pub size: [usize; 3],
    /// Byte offset of permuted voxel (0, 0, 0).
    origin: isize,
    /// Bytes from one voxel to the next along each permuted axis.
    strides: [isize; 3],
}

impl<'a> PermutedVolume<'a> {
    /// The volume of `frame` in voxel memory.
    #[must_use]
    pub fn new(frame: &FrameDescription, memory: SharedView<'a>) -> Self {
        let volume = &frame.volume;
        let bytes = volume.format.bytes() as isize;
        let row = volume.row_pitch as isize * bytes;
        let object_strides = [bytes, row, row * volume.slice_rows as isize];
        let mut origin = volume.base as isize;
        let strides = frame.permutation.axes().map(|permuted| {
            let stride = object_strides[permuted.axis];
            if !permuted.flipped {
                return stride;
            }
            origin += stride * (volume.size[permuted.axis] as isize - 1);
            -stride
        });
        let size = frame.permuted_size().map(|size| size as usize);
        Self { memory, format: volume.format, size, origin, strides }
    }

    /// Reads voxel slice `z` as 12-bit values, rows of `size[0]`. Slices outside of the volume replicate its
    /// outermost ones.
    pub fn read_slice(&self, z: i64, values: &mut Vec<u16>) -> Result<(), OutOfRange> {
        let [width, height, depth] = self.size;
        let z = z.clamp(0, depth as i64 - 1) as isize;
        values.clear();
        for y in 0..height as isize {
            let row = self.origin + z * self.strides[2] + y * self.strides[1];
            for x in 0..width as isize {
                values.push(self.read(row + x * self.strides[0])?);
            }
        }
        Ok(())
    }

    fn read(&self, offset: isize) -> Result<u16, OutOfRange> {
        let mut stored = [0; 2];
        self.memory.read(offset as usize, &mut stored[..self.format.bytes()])?;
        Ok(self.format.value(u16::from_le_bytes(stored)))
    }
}

/// The voxel slices around a sample slice; each is read once while the frame passes it.
#[derive(Debug)]
pub struct VoxelSlices<'a> {
    volume: PermutedVolume<'a>,
    /// Slice `z` is kept in place `z mod 4`.
    held: [Option<i64>; 4],
    slices: [Vec<u16>; 4],
}

impl<'a> VoxelSlices<'a> {
    /// No slices yet.
    #[must_use]
    pub const fn new(volume: PermutedVolume<'a>) -> Self {
        Self { volume, held: [None; 4], slices: [const { Vec::new() }; 4] }
    }

    /// Brings in up to four slices in a row.
    pub fn load(&mut self, slices: core::ops::RangeInclusive<i64>) -> Result<(), OutOfRange> {
        for z in slices {
            let place = Self::place(z);
            if self.held[place] != Some(z) {
                self.volume.read_slice(z, &mut self.slices[place])?;
                self.held[place] = Some(z);
            }
        }
        Ok(())
    }

    const fn place(z: i64) -> usize {
        z.rem_euclid(4) as usize
    }

    /// The voxels at the corners `[z][y][x]` of the cell whose lowest voxel is `first`; reads past the volume
    /// replicate its faces.
    #[must_use]
    pub fn corners(&self, first: [i64; 3]) -> [[[u16; 2]; 2]; 2] {
        let [x, y, z] = first;
        let [width, height, _] = self.volume.size;
        let columns = [x, x + 1].map(|x| x.clamp(0, width as i64 - 1) as usize);
        let rows = [y, y + 1].map(|y| y.clamp(0, height as i64 - 1) as usize * width);
        [z, z + 1].map(|z| {
            let slice = &self.slices[Self::place(z)];
            rows.map(|row| columns.map(|column| slice[row + column]))
        })
    }
}
