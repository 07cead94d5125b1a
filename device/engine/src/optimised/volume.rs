//! Where the voxels of a frame lie, and how a row of them is read.

use super::line::{Block, Line};
use super::simd::{HALF, LANES, Simd, Square};
use crate::frame::FrameDescription;
use core::ops::Range;
use vg500_regs::limit::VOLUME_SIZE;
use vg500_regs::{SharedView, VoxelFormat};

/// Voxels of a side of the squares that are transposed: as many as a cache line holds.
const SQUARE: usize = HALF;
/// How many columns before they are needed they are asked for. Measured: 16 take 1.2 times as long, 192 as long.
const AHEAD: isize = 96;

/// Bytes that are brought in together.
const CACHE_LINE: usize = 64;

/// Lines of some rows of slices.
#[derive(Debug)]
pub struct Lines<'a> {
    /// As many lines for each slot.
    pub lines: &'a mut [Line],
    /// Where columns of voxels become rows.
    pub squares: &'a mut Vec<Square>,
    /// Lines of a slot.
    pub capacity: usize,
    /// Slots; slice z is in slot z modulo their number.
    pub slots: usize,
    /// The first of the slices that are brought in.
    pub first_slice: usize,
    /// The slot of that slice.
    pub first_slot: usize,
    /// The row that the first line of each slot is.
    pub first_row: usize,
}

impl Lines<'_> {
    /// Which line the row at y of slice z is.
    #[inline(always)]
    fn place(&self, y: usize, z: usize) -> usize {
        // Not modulo: a division takes longer than the words that are written.
        let slot = self.first_slot + z - self.first_slice;
        let slot = if slot < self.slots { slot } else { slot - self.slots };
        slot * self.capacity + y - self.first_row
    }

    /// The line of the row at y of slice z.
    #[inline(always)]
    fn at(&mut self, y: usize, z: usize) -> &mut Line {
        &mut self.lines[self.place(y, z)]
    }
}

/// The volume of a frame: permuted, but mirrored so that object x always runs forward where it is permuted x.
#[derive(Clone, Copy, Debug)]
pub struct Volume<'a> {
    memory: SharedView<'a>,
    format: VoxelFormat,
    /// Voxels along permuted x, y and z.
    pub size: [usize; 3],
    /// Byte offset of permuted voxel (0, 0, 0).
    origin: isize,
    /// Bytes from one voxel to the next along each permuted axis.
    strides: [isize; 3],
    /// The permuted axis along which voxels follow each other in memory.
    contiguous: usize,
}

impl<'a> Volume<'a> {
    /// The volume of `frame` in voxel memory.
    #[must_use]
    pub fn new(frame: &FrameDescription, memory: SharedView<'a>) -> Self {
        let volume = &frame.volume;
        let bytes = volume.format.bytes() as isize;
        let row = volume.row_pitch as isize * bytes;
        let object_strides = [bytes, row, row * volume.slice_rows as isize];
        let axes = frame.permutation.axes();
        let mut origin = volume.base as isize;
        let mut strides = [0; 3];
        for (place, permuted) in axes.iter().enumerate() {
            let stride = object_strides[permuted.axis];
            if permuted.flipped && place > 0 {
                origin += stride * (volume.size[permuted.axis] as isize - 1);
                strides[place] = -stride;
            } else {
                strides[place] = stride;
            }
        }
        Self {
            memory,
            format: volume.format,
            size: frame.permuted_size().map(|size| size as usize),
            origin,
            strides,
            contiguous: axes.iter().position(|permuted| permuted.axis == 0).unwrap_or(0),
        }
    }

    /// Slices that are brought in together: those of a square of transposed voxels, or one.
    #[must_use]
    pub const fn slices_at_once(&self) -> usize {
        if self.contiguous == 2 { SQUARE } else { 1 }
    }

    /// The slices that are brought in together with slice `z`.
    #[must_use]
    pub fn slices_with(&self, z: usize) -> Range<usize> {
        if self.contiguous == 2 { self.group(2, z) } else { z..z + 1 }
    }

    /// Brings rows of some slices of [`Self::slices_with`] into their lines.
    #[inline(always)]
    pub fn load<S: Simd>(&self, simd: S, rows: Range<usize>, slices: Range<usize>, lines: &mut Lines<'_>) {
        match self.contiguous {
            0 => {
                for z in slices.clone() {
                    for y in rows.clone() {
                        self.load_row(simd, y, z, lines.at(y, z));
                    }
                }
            }
            1 => {
                for z in slices.clone() {
                    self.load_columns(simd, rows.clone(), z..z + 1, |y, z| [y, z], lines);
                }
            }
            _ => self.load_columns(simd, slices.clone(), rows.clone(), |z, y| [y, z], lines),
        }
        for z in slices {
            rows.clone().for_each(|y| lines.at(y, z).replicate_ends(self.size[0]));
        }
    }

    /// Reads the row at y of slice z where voxels follow each other along x.
    #[inline(always)]
    fn load_row<S: Simd>(&self, simd: S, y: usize, z: usize, line: &mut Line) {
        let bytes = self.format.bytes();
        let start = self.offset([0, y, z]);
        let length = self.size[0].next_multiple_of(LANES) * bytes;
        match self.place(start, length) {
            Some(place) => self.load_from(simd, place, line),
            None => self.load_last_row(simd, start, line),
        }
    }

    /// Asks for the row at y of slice z, which will be brought in soon. Only where voxels follow each other along x:
    /// columns are asked for while others are read.
    #[inline(always)]
    pub fn prefetch_row<S: Simd>(&self, simd: S, y: i32, z: i32) {
        let [width, height, depth] = self.size;
        let [Ok(y), Ok(z)] = [usize::try_from(y), usize::try_from(z)] else { return };
        if self.contiguous != 0 || y >= height || z >= depth {
            return;
        }
        let start = self.offset([0, y, z]);
        for offset in (0..width * self.format.bytes()).step_by(CACHE_LINE) {
            simd.prefetch(self.address(start.wrapping_add_unsigned(offset)));
        }
    }

    /// The address at a byte offset, which need not be one of voxel memory.
    #[inline(always)]
    const fn address(&self, offset: isize) -> *const u8 {
        self.memory.start().as_ptr().wrapping_offset(offset).cast_const()
    }

    /// Reads a row with padding whose end may lie past the end of the memory.
    #[cold]
    #[inline(never)]
    fn load_last_row<S: Simd>(&self, simd: S, start: isize, line: &mut Line) {
        let mut copy = [0; 2 * VOLUME_SIZE as usize];
        // The row itself lies inside of the memory.
        let _inside =
            self.memory.read(start.cast_unsigned(), &mut copy[..self.size[0] * self.format.bytes()]);
        self.load_from(simd, copy.as_ptr(), line);
    }

    /// Reads a row, rounded up to whole vectors.
    #[inline(always)]
    fn load_from<S: Simd>(&self, simd: S, from: *const u8, line: &mut Line) {
        let bytes = self.format.bytes();
        for block in Block::covering(self.size[0]) {
            // SAFETY: the caller has checked the row's length rounded up to the most lanes there are.
            let voxels = unsafe { simd.load_voxels(self.format, from.add(block.starts()[0] * bytes)) };
            line.store(simd, block, voxels);
        }
    }

    /// Reads the lines `along` the axis on which voxels follow each other, for each of the coordinates `across` on
    /// the other one, whose lines lie next to each other; `at` makes y and z of both.
    #[inline(always)]
    fn load_columns<S: Simd>(
        &self,
        simd: S,
        along: Range<usize>,
        across: Range<usize>,
        at: impl Fn(usize, usize) -> [usize; 2],
        lines: &mut Lines<'_>,
    ) {
        lines.squares.resize(lines.squares.len().max(across.len()), Square::ZERO);
        let mut next = along.start;
        while next < along.end {
            let group = self.group(self.contiguous, next);
            let here = next..group.end.min(along.end);
            // The voxel of the group with the lowest address.
            let lowest = if self.strides[self.contiguous] < 0 { group.end - 1 } else { group.start };
            let mut places = [0; SQUARE];
            for index in here.clone() {
                let [y, z] = at(index, across.start);
                places[index.abs_diff(lowest) % SQUARE] = lines.place(y, z);
            }
            let columns = [here.start, here.end - 1].map(|index| index.abs_diff(lowest) % SQUARE);
            let columns = columns[0].min(columns[1])..=columns[0].max(columns[1]);
            for x in (0..self.size[0]).step_by(SQUARE) {
                let [y, z] = at(lowest, across.start);
                let [y_behind, z_behind] = at(lowest, across.start + 1);
                let corner = self.offset([x, y, z]);
                let pitch = self.offset([x, y_behind, z_behind]) - corner;
                self.load_squares(simd, corner, pitch, &mut lines.squares[..across.len()]);
                for (line, square) in lines.squares[..across.len()].iter_mut().enumerate() {
                    simd.transpose(square);
                    for (place, words) in places[columns.clone()].iter().zip(&square.rows[columns.clone()]) {
                        lines.lines[place + line].store_half(x, words);
                    }
                }
            }
            next = here.end;
        }
    }

    /// The coordinates on an axis, on which voxels follow each other, that are read together with `index`: groups
    /// begin at multiples of 32 voxels of the object.
    fn group(&self, axis: usize, index: usize) -> Range<usize> {
        let size = self.size[axis];
        if self.strides[axis] < 0 {
            let object = size - 1 - index;
            let first = object / SQUARE * SQUARE;
            size - (first + SQUARE).min(size)..size - first
        } else {
            let first = index / SQUARE * SQUARE;
            first..(first + SQUARE).min(size)
        }
    }

    /// Reads squares of voxels. Row r of square s is what follows in memory at r steps along x and s times `pitch`
    /// from `corner`.
    ///
    /// The same row of all squares is read before the next one: steps along x are often of a length at which all
    /// voxels share one place of each cache, and push each other out. Columns that are asked for are of so few rows
    /// that they stay in the second cache.
    #[inline(always)]
    fn load_squares<S: Simd>(&self, simd: S, corner: isize, pitch: isize, squares: &mut [Square]) {
        let count = squares.len().cast_signed();
        let mut ahead = (0, AHEAD);
        for row in 0..SQUARE {
            for (number, square) in squares.iter_mut().enumerate() {
                while ahead.1 >= count {
                    ahead = (ahead.0 + 1, ahead.1 - count);
                }
                let next = corner + ahead.0 * self.strides[0] + ahead.1 * pitch;
                simd.prefetch_into_second(self.address(next));
                ahead.1 += 1;
                let start = corner + row.cast_signed() * self.strides[0] + number.cast_signed() * pitch;
                self.load_column(simd, start, &mut square.rows[row]);
            }
        }
    }

    /// Reads voxels that follow each other in memory.
    #[inline(always)]
    fn load_column<S: Simd>(&self, simd: S, start: isize, to: &mut [u16; SQUARE]) {
        let bytes = self.format.bytes();
        if let Some(place) = self.place(start, SQUARE * bytes) {
            // SAFETY: all of them lie inside of the memory.
            return unsafe { simd.load_half_of_voxels(self.format, place, to) };
        }
        let mut copy = [0; SQUARE * 2];
        for (voxel, stored) in copy.chunks_exact_mut(bytes).take(SQUARE).enumerate() {
            // Voxels past the end of the memory are not of the volume, and nothing uses them.
            let _inside = self.memory.read((start + (voxel * bytes).cast_signed()).cast_unsigned(), stored);
        }
        // SAFETY: the copy holds as many voxels of at most two bytes.
        unsafe { simd.load_half_of_voxels(self.format, copy.as_ptr(), to) };
    }

    /// Byte offset of a permuted voxel.
    fn offset(&self, at: [usize; 3]) -> isize {
        (0..3).fold(self.origin, |offset, axis| offset + at[axis].cast_signed() * self.strides[axis])
    }

    /// Where bytes of voxel memory lie, if all of them are inside of it.
    fn place(&self, offset: isize, length: usize) -> Option<*const u8> {
        let offset = usize::try_from(offset).ok()?;
        let end = offset.checked_add(length)?;
        // SAFETY: offset lies inside of the memory.
        (end <= self.memory.size()).then(|| unsafe { self.memory.start().as_ptr().add(offset).cast_const() })
    }
}
