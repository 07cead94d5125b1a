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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::widen;

    #[test]
    fn every_value_has_an_entry_of_its_own() {
        let mut tables = Tables::empty();
        let opacity = |value: u16| value.wrapping_mul(2731) & 4095;
        tables.color = (0..4096).map(|value: u16| [value as u8, (value >> 4) as u8, 7].map(widen)).collect();
        tables.opacity = (0..4096).map(opacity).collect();
        for value in 0..=4095 {
            let Classified { color, alpha } = classify(&tables, value);
            assert_eq!((color, alpha), ([value as u8, (value >> 4) as u8, 7].map(widen), opacity(value)));
        }
    }
}
