//! Lookup tables and maps of a frame, copied from table memory at the start command.

use crate::fixed::{FULL, widen};
use vg500_regs::SharedView;
use vg500_regs::limit::{GRADIENT_MAGNITUDE_ENTRIES, LOOKUP_ENTRIES, REFLECTANCE_ENTRIES};
use vg500_regs::memory::Table;
use vg500_regs::shared::OutOfRange;

/// The tables of one frame. Reserved bits are dropped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tables {
    /// R, G and B of each sample value, widened to 12 bits.
    pub color: Vec<[u16; 3]>,
    /// Opacity of each sample value, 12 bits.
    pub opacity: Vec<u16>,
    /// Diffuse reflectance map: six faces of 8 x 8 vertices.
    pub diffuse: Vec<u8>,
    /// Specular reflectance map: six faces of 8 x 8 vertices.
    pub specular: Vec<u8>,
    /// What a gradient magnitude multiplies with.
    pub gradient_magnitude: Vec<u8>,
}

impl Tables {
    /// Copies the selected copy of each table (in the order of [`Table::ALL`]) out of table memory.
    pub fn copy_from(memory: &SharedView<'_>, copies: [usize; Table::ALL.len()]) -> Result<Self, OutOfRange> {
        let bytes = |table: Table| {
            let mut bytes = vec![0; table.bytes()];
            memory.read(table.offset(copies[table as usize]), &mut bytes).map(|()| bytes)
        };
        let words = |table| bytes(table).map(|bytes| bytes.as_chunks::<4>().0.to_vec());
        Ok(Self {
            color: words(Table::Color)?.iter().map(|&[r, g, b, _]| [r, g, b].map(widen)).collect(),
            opacity: bytes(Table::Opacity)?
                .as_chunks::<2>()
                .0
                .iter()
                .map(|&pair| u16::from_le_bytes(pair) & FULL)
                .collect(),
            diffuse: words(Table::Diffuse)?.iter().map(|word| word[0]).collect(),
            specular: words(Table::Specular)?.iter().map(|word| word[0]).collect(),
            gradient_magnitude: bytes(Table::GradientMagnitude)?,
        })
    }

    /// Tables of zeros.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            color: vec![[0; 3]; LOOKUP_ENTRIES],
            opacity: vec![0; LOOKUP_ENTRIES],
            diffuse: vec![0; REFLECTANCE_ENTRIES],
            specular: vec![0; REFLECTANCE_ENTRIES],
            gradient_magnitude: vec![0; GRADIENT_MAGNITUDE_ENTRIES],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg500_regs::pci::TABLE_MEMORY;

    #[test]
    fn selected_copies_are_read_and_reserved_bits_dropped() {
        let mut memory = vec![0u8; TABLE_MEMORY.size as usize];
        let view = SharedView::of(&mut memory);
        view.write_u32(Table::Color.offset(1) + 4 * 7, 0xff30_2010).unwrap();
        view.write_u32(Table::Opacity.offset(0) + 4 * 3, 0xffff_f123).unwrap();
        view.write_u32(Table::Diffuse.offset(1) + 4 * 383, 0xffff_ff42).unwrap();
        view.write_u32(Table::GradientMagnitude.offset(0), 0x0403_0201).unwrap();
        let tables = Tables::copy_from(&view, [1, 0, 1, 1, 0]).unwrap();
        assert_eq!(tables.color[7], [0x101, 0x202, 0x303]);
        assert_eq!((tables.opacity[6], tables.opacity[7]), (0x123, 0xfff));
        assert_eq!(tables.diffuse[383], 0x42);
        assert_eq!(tables.gradient_magnitude[..4], [1, 2, 3, 4]);
        assert_eq!(Tables::copy_from(&view, [0; 5]).unwrap().color[7], [0; 3]);
    }

    #[test]
    fn a_memory_that_is_too_small_is_an_error() {
        assert!(Tables::copy_from(&SharedView::of(&mut [0; 100]), [0; 5]).is_err());
    }
}
