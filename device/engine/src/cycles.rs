//! How long the real chip would have taken for a frame.
//!
//! Four pipelines take a voxel each per clock (paper, section 5.1); dimensions are those of the store, padded to
//! multiples of 32 (section 5.2); supersampling by k takes k times as long (section 4.1). 256^3 voxels take
//! 4 194 304 clocks, 33.55 ms at 125 MHz.
//!
//! In sections the same voxels take as long, unless section memory is too slow (our choice; the paper gives no
//! figure). Its two 16-bit SDRAMs (section 6) move a word of 32 bits per clock. A beam of a section takes 8 clocks;
//! meanwhile an inner section reads a record and writes one, an outermost one does only one of both. In alpha
//! blending a record has four words, which is just what 8 clocks move: so the chip, which always worked in sections,
//! renders at the speed of reading voxels. Records of other blend modes are longer, and inner sections wait for them.

use crate::frame::FrameDescription;
use vg500_regs::limit::{PIPELINES, SECTION_WIDTH};
use vg500_regs::memory::padded;
use vg500_regs::section::record_words;

/// Clock cycles of a frame.
#[must_use]
pub fn cycles(frame: &FrameDescription) -> u64 {
    let size = frame.permuted_size().map(|size| u64::from(padded(size)));
    let supersampling = u64::from(frame.rays.supersampling);
    let pipelines = size.iter().product::<u64>() * supersampling / u64::from(PIPELINES);
    let beams = size[1] * size[2] * supersampling;
    pipelines + if frame.output.sections { beams * waiting(frame, size[0]) } else { 0 }
}

/// Clock cycles that all sections together wait for section memory, for each beam across a volume `width` wide.
fn waiting(frame: &FrameDescription, width: u64) -> u64 {
    let beam = u64::from(SECTION_WIDTH / PIPELINES);
    let words = record_words(frame.output.blend) as u64;
    let inner = (width / u64::from(SECTION_WIDTH)).saturating_sub(2);
    inner * (2 * words).saturating_sub(beam)
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg500_regs::table::*;
    use vg500_regs::{BlendMode, FrameRegisters};

    fn frame(size: [u32; 3], blend: BlendMode, sections: u32) -> FrameDescription {
        let mut registers = FrameRegisters::default();
        for (field, value) in [
            (volume_format::FORMAT, 1),
            (volume_size_xy::X, size[0]),
            (volume_size_xy::Y, size[1]),
            (volume_size_z::Z, size[2]),
            (volume_pitch::ROW, 256),
            (volume_pitch::ROWS, 256),
            (base_plane_size::WIDTH, 1),
            (base_plane_size::HEIGHT, 1),
            (output::BLEND, blend as u32),
            (output::SECTIONS, sections),
        ] {
            registers.set(field, value);
        }
        FrameDescription::decode(&registers, 16 << 20).unwrap()
    }

    #[test]
    fn the_largest_volume_takes_a_thirtieth_of_a_second() {
        let whole = frame([256; 3], BlendMode::Alpha, 0);
        assert_eq!(cycles(&whole), 4_194_304);
        let mut sampled = whole;
        sampled.rays.supersampling = 8;
        assert_eq!(cycles(&sampled), 8 * 4_194_304);
        assert_eq!(cycles(&frame([1, 33, 65], BlendMode::Sum, 0)), 32 * 64 * 96 / 4);
    }

    #[test]
    fn sections_wait_where_records_are_long() {
        let in_sections = |size, blend| cycles(&frame(size, blend, 1));
        assert_eq!(in_sections([256; 3], BlendMode::Alpha), 4_194_304);
        // Six inner sections of 65536 beams: 5 + 5 words in 8 clocks, 7 + 7 in 8.
        assert_eq!(in_sections([256; 3], BlendMode::Maximum), 4_194_304 + 6 * 65536 * 2);
        assert_eq!(in_sections([256; 3], BlendMode::Sum), 4_194_304 + 6 * 65536 * 6);
        // Two sections are both outermost ones.
        assert_eq!(in_sections([64, 256, 256], BlendMode::Sum), 4_194_304 / 4);
        assert_eq!(in_sections([65, 32, 32], BlendMode::Minimum), 96 * 256 + 32 * 32 * 2);
    }

    #[test]
    fn sections_lie_along_permuted_x() {
        let mut turned = frame([32, 32, 256], BlendMode::Sum, 1);
        assert_eq!(cycles(&turned), 256 * 256);
        turned.permutation = vg500_regs::Permutation::from_word(0x012).unwrap();
        assert_eq!(cycles(&turned), 256 * 256 + 32 * 32 * 6 * 6);
    }
}
