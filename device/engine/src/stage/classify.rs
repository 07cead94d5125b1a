//! Classification (paper, section 3.4): a sample's value looks up its colour and opacity.

use crate::tables::Tables;

/// Colour and opacity of a sample, 12 bits each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Classified {
    /// R, G, B.
    pub color: [u16; 3],
    /// Opacity.
    pub alpha: u16,
}

/// Looks a sample value (12 bits) up.
#[must_use]
pub fn classify(tables: &Tables, value: u16) -> Classified {
    let entry = usize::from(value);
    Classified { color: tables.color[entry], alpha: tables.opacity[entry] }
}
