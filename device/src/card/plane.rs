//! Base planes of several formats, which overlap in pixel memory.

use std::fmt;
use std::ops::Range;

use vg500_regs::memory::{covered_planes, planes};
use vg500_regs::table::{output, start};
use vg500_regs::{FrameRegisters, PlaneFormat};

/// A base plane that exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Plane {
    format: PlaneFormat,
    number: u32,
}

impl Plane {
    /// Base plane `number` of a format, if pixel memory holds that many.
    pub(super) fn new(format: PlaneFormat, number: u32) -> Option<Self> {
        (number < planes(format)).then_some(Self { format, number })
    }

    /// The base plane of a start command, if it exists.
    pub(super) fn of_frame(registers: &FrameRegisters) -> Option<Self> {
        let format = PlaneFormat::from_code(registers.get(output::PLANE_FORMAT))?;
        Self::new(format, registers.get(start::PLANE))
    }

    /// Its format.
    pub(super) const fn format(self) -> PlaneFormat {
        self.format
    }

    /// Its number, counted in the size of its format.
    pub(super) const fn number(self) -> u32 {
        self.number
    }

    /// Its place in `PLANE_STATE`, `PLANE_FAULT`, `CANCEL` and the report block.
    pub(super) const fn place(self) -> usize {
        self.covered().start as usize
    }

    /// Whether the two share bytes of pixel memory.
    pub(super) const fn overlaps(self, other: Self) -> bool {
        let (own, others) = (self.covered(), other.covered());
        own.start < others.end && others.start < own.end
    }

    const fn covered(self) -> Range<u32> {
        covered_planes(self.format, self.number)
    }
}

impl fmt::Display for Plane {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let format = match self.format {
            PlaneFormat::Rgba8 => "RGBA8",
            PlaneFormat::Accumulator64 => "64-bit",
            PlaneFormat::Sum128 => "128-bit",
        };
        write!(f, "{format} base plane {}", self.number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_past_pixel_memory_do_not_exist() {
        for (format, count) in
            [(PlaneFormat::Rgba8, 16), (PlaneFormat::Accumulator64, 8), (PlaneFormat::Sum128, 4)]
        {
            assert!(Plane::new(format, count).is_none());
            assert!(Plane::new(format, count - 1).is_some());
        }
    }

    #[test]
    fn planes_of_all_formats_overlap_where_their_bytes_do() {
        let all = |format| (0..16).filter_map(move |number| Plane::new(format, number));
        let every: Vec<_> = [PlaneFormat::Rgba8, PlaneFormat::Accumulator64, PlaneFormat::Sum128]
            .into_iter()
            .flat_map(all)
            .collect();
        for a in &every {
            for b in &every {
                let bytes = |plane: &Plane| {
                    let size = 512 * 512 * plane.format().bytes() as u32;
                    plane.number() * size..(plane.number() + 1) * size
                };
                let (x, y) = (bytes(a), bytes(b));
                assert_eq!(a.overlaps(*b), x.start < y.end && y.start < x.end, "{a}, {b}");
            }
        }
    }
}
