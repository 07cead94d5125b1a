//! Voxels in permuted order.

use crate::frame::FrameDescription;
use core::ops::Range;
use vg500_regs::limit::VOLUME_SIZE;
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

    /// The voxels in a range along permuted x, which lies in the volume.
    #[must_use]
    pub fn section(mut self, voxels: Range<i64>) -> Self {
        self.origin += voxels.start as isize * self.strides[0];
        self.size[0] = (voxels.end - voxels.start) as usize;
        self
    }

    /// Reads voxel slice `z` as 12-bit values, rows of `size[0]`. Slices outside of the volume replicate its
    /// outermost ones.
    pub fn read_slice(&self, z: i64, values: &mut Vec<u16>) -> Result<(), OutOfRange> {
        let [_, height, depth] = self.size;
        let z = z.clamp(0, depth as i64 - 1) as isize;
        values.clear();
        for y in 0..height as isize {
            self.read_row(self.origin + z * self.strides[2] + y * self.strides[1], values)?;
        }
        Ok(())
    }

    /// Appends the row whose first voxel lies at byte `first`.
    fn read_row(&self, first: isize, values: &mut Vec<u16>) -> Result<(), OutOfRange> {
        let stride = self.strides[0];
        if stride.unsigned_abs() != self.format.bytes() {
            for x in 0..self.size[0] as isize {
                let mut stored = [0; 2];
                self.memory.read((first + x * stride) as usize, &mut stored[..self.format.bytes()])?;
                values.push(self.format.value(u16::from_le_bytes(stored)));
            }
            return Ok(());
        }
        let begin = values.len();
        self.read_run(first + stride.min(0) * (self.size[0] as isize - 1), values)?;
        if stride < 0 {
            values[begin..].reverse();
        }
        Ok(())
    }

    /// Appends a row of voxels that follow each other in memory from byte `lowest` on.
    fn read_run(&self, lowest: isize, values: &mut Vec<u16>) -> Result<(), OutOfRange> {
        let mut stored = [0; 2 * VOLUME_SIZE as usize];
        let stored = &mut stored[..self.size[0] * self.format.bytes()];
        self.memory.read(lowest as usize, stored)?;
        match self.format {
            VoxelFormat::Uint8 => {
                values.extend(stored.iter().map(|byte| self.format.value(u16::from(*byte))));
            }
            VoxelFormat::Uint12Lower | VoxelFormat::Uint12Upper => {
                let pairs = stored.as_chunks::<2>().0;
                values.extend(pairs.iter().map(|pair| self.format.value(u16::from_le_bytes(*pair))));
            }
        }
        Ok(())
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

    /// Rows of a slice.
    #[must_use]
    pub const fn rows(&self) -> i64 {
        self.volume.size[1] as i64
    }

    /// The row at `y` of a slice that is loaded; rows past the volume replicate its outermost ones.
    #[must_use]
    pub fn row(&self, y: i64, z: i64) -> &[u16] {
        let [width, height, _] = self.volume.size;
        let first = y.clamp(0, height as i64 - 1) as usize * width;
        &self.slices[Self::place(z)][first..first + width]
    }
}
