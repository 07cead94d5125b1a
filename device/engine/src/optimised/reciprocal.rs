//! The reciprocals of illumination as tables ([`crate::stage::reflectance::cube_vector`],
//! [`crate::stage::reflect::stretch`]).

use crate::stage::reflectance::HALF_FACE;

/// round(128 * 112 / major), half up, for the major component of a gradient; 0 for 0.
pub const GRADIENT: [u16; 128] = {
    let mut table = [0; 128];
    let mut major = 1;
    while major < 128 {
        table[major] = ((2 * 128 * HALF_FACE as usize + major) / (2 * major)) as u16;
        major += 1;
    }
    table
};

/// round(2^27 / middle) for the major component of a reflection vector, 3584..=18943, where middle is its high
/// byte and 128. Entries stand at the high byte modulo 64, of which each occurs once.
pub const SEED: [u16; 64] = {
    let mut table = [0; 64];
    let mut high = 14;
    while high < 14 + 60 {
        let middle = (high << 8) + 128;
        table[high % 64] = (((1 << 28) + middle) / (2 * middle)) as u16;
        high += 1;
    }
    table
};
