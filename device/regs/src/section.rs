//! What lies where in section memory (paper, section 5.4).
//!
//! A frame that works in sections leaves a record for each beam of voxels and each sample slice at the right
//! boundary of a section, and takes it up again at the left boundary of the next one. Each section writes over the
//! records of the one before as it has read them: a FIFO in place. Along permuted x the section's voxels end at
//! `end`; a cell is named by its lower voxel.

use crate::format::BlendMode;
use crate::register::Field;

/// Bytes of a record. 256 beams x 2041 sample slices of them fit into 16 MiB.
pub const RECORD: usize = 32;

/// Byte offset of the record of voxel beam `beam` (0..`beams`) on sample slice `slice`.
#[must_use]
pub const fn record_offset(slice: usize, beam: usize, beams: usize) -> usize {
    (slice * beams + beam) * RECORD
}

/// Words of a record that a frame writes and reads; the others are left alone.
#[must_use]
pub const fn record_words(blend: BlendMode) -> usize {
    match blend {
        BlendMode::Alpha => 4,
        BlendMode::Maximum | BlendMode::Minimum => 5,
        BlendMode::Sum => 7,
    }
}

macro_rules! fields {
    ($($list:ident, $list_text:literal: {
        $($field:ident $word:literal, $low:literal +$bits:literal $format:ident $text:literal)*
    })*) => {
        $($(
            #[doc = $text]
            pub const $field: Field = Field {
                name: stringify!($field),
                register: 4 * $word,
                low: $low,
                bits: $bits,
                format: crate::number::$format,
                meaning: $text,
            };
        )*)*
        $(
            #[doc = $list_text]
            pub const $list: &[Field] = &[$($field),*];
        )*
    };
}

fields! {
    ALWAYS, "Fields of every record; [`Field::register`] is the byte offset of the word.": {
        VOXEL_VALUE 0, 0 +16 GUARDED "Voxel `end - 1` of the beam, interpolated along z."
        DIFFERENCE 0, 16 +16 GUARDED "Half the difference of its neighbours along z, interpolated along z; zero in frames without gradients."
        SAMPLE 1, 0 +12 VALUE "Sample in cell `end - 2`; its neighbour to the right is missing for the x gradient."
        BEFORE 1, 12 +12 VALUE "Sample in cell `end - 3`, its neighbour to the left."
        GRADIENT_Y 1, 24 +8 GRADIENT "Gradient of the sample in cell `end - 2` along permuted y, before un-permutation."
        GRADIENT_Z 2, 0 +8 GRADIENT "Likewise along permuted z."
    }
    BLENDED, "Fields of records in alpha blending, MIP and MinIP.": {
        RED 2, 8 +12 COLOR "Accumulators of the ray of cell `end - 3`, the last one that is finished: red."
        GREEN 2, 20 +12 COLOR "Green."
        BLUE 3, 0 +12 COLOR "Blue."
        ALPHA 3, 12 +12 COLOR "Opacity."
    }
    EXTREME, "Fields of records in MIP and MinIP.": {
        EXTREME_VALUE 4, 0 +12 VALUE "Extreme sample value of the ray."
        EXTREME_VALID 4, 12 +1 CODE "The ray has met a visible sample."
    }
    SUMMED, "Fields of records in the weighted sum.": {
        SAMPLES 2, 8 +16 INTEGER "Number of visible samples of the ray."
        SUM_RED 3, 0 +28 SUM "Sums of the ray of cell `end - 3`: red."
        SUM_GREEN 4, 0 +28 SUM "Green."
        SUM_BLUE 5, 0 +28 SUM "Blue."
        SUM_ALPHA 6, 0 +28 SUM "Opacity."
    }
}

/// The fields of a record in a blend mode.
pub fn record_fields(blend: BlendMode) -> impl Iterator<Item = &'static Field> {
    let parts: &[&'static [Field]] = match blend {
        BlendMode::Alpha => &[ALWAYS, BLENDED],
        BlendMode::Maximum | BlendMode::Minimum => &[ALWAYS, BLENDED, EXTREME],
        BlendMode::Sum => &[ALWAYS, SUMMED],
    };
    parts.iter().copied().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limit::{SUPERSAMPLING, VOLUME_SIZE};
    use crate::pci::SECTION_MEMORY;

    const MODES: [BlendMode; 4] = [BlendMode::Alpha, BlendMode::Maximum, BlendMode::Minimum, BlendMode::Sum];

    #[test]
    fn the_largest_frame_fits_into_section_memory() {
        let slices = (SUPERSAMPLING * (VOLUME_SIZE - 1) + 1) as usize;
        let beams = VOLUME_SIZE as usize;
        let end = record_offset(slices - 1, beams - 1, beams) + RECORD;
        assert_eq!(end, 256 * 2041 * 32);
        assert!(end as u64 <= SECTION_MEMORY.size);
    }

    #[test]
    fn fields_do_not_overlap_and_lie_in_the_words_that_move() {
        for blend in MODES {
            let mut words = [0_u32; RECORD / 4];
            for field in record_fields(blend) {
                let word = &mut words[field.register as usize / 4];
                assert_eq!(*word & field.mask(), 0, "{blend:?} {}", field.name);
                *word |= field.mask();
            }
            let used = words.iter().filter(|word| **word != 0).count();
            assert_eq!(used, record_words(blend), "{blend:?}");
            assert!(words[..used].iter().all(|word| *word != 0));
        }
    }

    #[test]
    fn fields_are_wide_enough_for_their_formats() {
        for field in MODES.into_iter().flat_map(record_fields) {
            let narrow = field.bits < field.format.bits;
            assert!(!narrow || matches!(field.format.name, "integer" | "code"), "{}", field.name);
        }
    }
}
