//! Base planes and their pixels.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use vg500_regs::limit::BASE_PLANE_SIZE;
use vg500_regs::memory::{covered_planes, plane_bytes, plane_offset, plane_pitch, planes};
use vg500_regs::pci::PIXEL_MEMORY;
use vg500_regs::{PixelFormat, PlaneFormat};

use crate::status::Source;
use crate::{Card, Error, lock};

/// 32-bit base planes that are given out, one bit each. Wider planes cover several.
#[derive(Clone, Debug, Default)]
pub(crate) struct PlaneMap(Arc<Mutex<u32>>);

/// A base plane; free again when it is dropped.
#[derive(Debug)]
pub struct BasePlane {
    map: PlaneMap,
    format: PlaneFormat,
    index: u32,
}

impl BasePlane {
    /// How its rays are stored.
    #[must_use]
    pub fn format(&self) -> PlaneFormat {
        self.format
    }

    /// Its number among those of its format, as `ACCUMULATORS.SOURCE` takes it.
    #[must_use]
    pub fn index(&self) -> u32 {
        self.index
    }

    /// The 32-bit base planes that it covers.
    pub(crate) fn covers(&self) -> Range<u32> {
        covered_planes(self.format, self.index)
    }
}

impl Drop for BasePlane {
    fn drop(&mut self) {
        *lock(&self.map.0) &= !mask(self.covers());
    }
}

/// One bit for each 32-bit base plane of a range.
pub(crate) fn mask(planes: Range<u32>) -> u32 {
    planes.fold(0, |mask, plane| mask | 1u32.checked_shl(plane).unwrap_or(0))
}

/// A rectangle of a base plane, in rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rectangle {
    /// First column.
    pub column: u32,
    /// First row.
    pub row: u32,
    /// Columns, 1..=512.
    pub width: u32,
    /// Rows, 1..=512.
    pub height: u32,
}

impl Rectangle {
    /// The rectangle of a frame of this size.
    #[must_use]
    pub fn of_size(width: u32, height: u32) -> Self {
        Self { column: 0, row: 0, width, height }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let Self { column, row, width, height } = *self;
        let inside = |first: u32, count: u32| {
            count > 0 && first.checked_add(count).is_some_and(|end| end <= BASE_PLANE_SIZE)
        };
        if inside(column, width) && inside(row, height) {
            Ok(())
        } else {
            Err(Error::RectangleOutside { column, row, width, height })
        }
    }
}

impl Card {
    /// A base plane that no frame renders into.
    ///
    /// There are 16, 8 or 4, by format; planes of wider formats cover several of 32 bits.
    ///
    /// # Errors
    ///
    /// [`Error::NoPlane`] if there is none, or a dead card.
    pub fn allocate_plane(&self, format: PlaneFormat) -> Result<BasePlane, Error> {
        let mut guard = lock(&self.state);
        let state = &mut *guard;
        self.retire(&mut state.slots, &mut state.promises, Source::Copy)?;
        let busy = state.slots.busy_planes() | state.transferred;
        let mut taken = lock(&self.planes.0);
        let free = |index: &u32| mask(covered_planes(format, *index)) & (*taken | busy) == 0;
        let mut indices = 0..planes(format);
        // Narrow planes from below, wide ones from above, so that they leave room for one another.
        let index = match format {
            PlaneFormat::Rgba8 => indices.find(free),
            PlaneFormat::Accumulator64 | PlaneFormat::Sum128 => indices.rev().find(free),
        };
        let index = index.ok_or(Error::NoPlane { bytes: format.bytes() })?;
        *taken |= mask(covered_planes(format, index));
        Ok(BasePlane { map: self.planes.clone(), format, index })
    }

    /// Copies a rectangle of a base plane out of pixel memory: its rows one after another, each ray as the
    /// plane's format stores it. The caller has waited for the frame.
    ///
    /// # Errors
    ///
    /// [`Error::RectangleOutside`], or [`Error::OtherCard`].
    pub fn read_pixels(&self, plane: &BasePlane, rectangle: Rectangle) -> Result<Vec<u8>, Error> {
        self.check_owner(plane)?;
        rectangle.check()?;
        let memory = self.memory(PIXEL_MEMORY)?;
        let row_bytes = rectangle.width as usize * plane.format.bytes();
        let mut pixels = vec![0; row_bytes * rectangle.height as usize];
        for (row, bytes) in (rectangle.row..).zip(pixels.chunks_exact_mut(row_bytes)) {
            memory.read(plane_offset(plane.format, plane.index, rectangle.column, row), bytes)?;
        }
        Ok(pixels)
    }

    /// Copies a rectangle of a base plane into this process, as [`read_pixels`](Self::read_pixels) does, by the
    /// fastest way: by bus mastering if the card is behind a bus that it can master.
    ///
    /// # Errors
    ///
    /// As [`read_pixels`](Self::read_pixels) and [`transfer`](Self::transfer).
    pub fn fetch_pixels(&self, plane: &BasePlane, rectangle: Rectangle) -> Result<Vec<u8>, Error> {
        let converts = plane.format == PlaneFormat::Rgba8;
        if !(converts && self.transport.memory_is_remote() && self.status.copied()) {
            return self.read_pixels(plane, rectangle);
        }
        let mut arrivals = lock(&self.arrivals);
        let buffer = match arrivals.take() {
            Some(buffer) => buffer,
            None => match self.host_memory(plane_bytes(plane.format)) {
                Ok(buffer) => buffer,
                Err(Error::NotSupported { .. }) => return self.read_pixels(plane, rectangle),
                Err(error) => return Err(error),
            },
        };
        let buffer = arrivals.insert(buffer);
        rectangle.check()?;
        // Rows as far apart as in the base plane, so that the pitch never changes.
        let pitch = plane_pitch(plane.format);
        self.transfer(plane, rectangle, PixelFormat::Rgba8, &**buffer, 0, pitch as u32)?;
        let row_bytes = rectangle.width as usize * plane.format.bytes();
        let mut pixels = vec![0; row_bytes * rectangle.height as usize];
        for (row, bytes) in pixels.chunks_exact_mut(row_bytes).enumerate() {
            buffer.view().read(row * pitch, bytes)?;
        }
        Ok(pixels)
    }

    pub(crate) fn check_owner(&self, plane: &BasePlane) -> Result<(), Error> {
        if Arc::ptr_eq(&plane.map.0, &self.planes.0) {
            Ok(())
        } else {
            Err(Error::OtherCard { what: "base plane" })
        }
    }
}

#[cfg(test)]
mod tests;
