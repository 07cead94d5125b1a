//! Colour and opacity of sample values (`VLILookupTable`).

use vg500_regs::limit::LOOKUP_ENTRIES;

/// A lookup table of 256, 512, 1024, 2048 or 4096 entries; entry i stands for the 12-bit values whose upper bits
/// are i.
#[derive(Clone, Debug, PartialEq)]
pub struct LookupTable {
    color: Vec<[u8; 3]>,
    opacity: Vec<f64>,
}

impl LookupTable {
    /// Sizes that a table can have.
    pub const SIZES: [usize; 5] = [256, 512, 1024, 2048, 4096];

    /// A table with a ramp of grey and of opacity; `None` unless `size` is one of [`Self::SIZES`].
    #[must_use]
    pub fn ramp(size: usize) -> Option<Self> {
        let last = size.checked_sub(1)? as f64;
        let part = |entry: usize| entry as f64 / last;
        Self::new(
            (0..size).map(|entry| [(part(entry) * 255.0).round() as u8; 3]).collect(),
            (0..size).map(part).collect(),
        )
    }

    /// A table of R, G, B and of opacities 0..=1 (per smallest voxel spacing, where the context corrects
    /// opacity). `None` unless both have the same size, which is one of [`Self::SIZES`], and opacities are in
    /// range.
    #[must_use]
    pub fn new(color: Vec<[u8; 3]>, opacity: Vec<f64>) -> Option<Self> {
        let fits = color.len() == opacity.len() && Self::SIZES.contains(&color.len());
        let in_range = opacity.iter().all(|opacity| (0.0..=1.0).contains(opacity));
        (fits && in_range).then_some(Self { color, opacity })
    }

    /// Number of entries.
    #[must_use]
    pub fn size(&self) -> usize {
        self.color.len()
    }

    /// R, G, B of each entry.
    #[must_use]
    pub fn color(&self) -> &[[u8; 3]] {
        &self.color
    }

    /// Opacity of each entry, 0..=1.
    #[must_use]
    pub fn opacity(&self) -> &[f64] {
        &self.opacity
    }

    /// Sets R, G, B of entries from `first` on; `false`, and nothing changes, unless all of them exist.
    #[must_use]
    pub fn set_color(&mut self, first: usize, color: &[[u8; 3]]) -> bool {
        let place = first.checked_add(color.len()).and_then(|end| self.color.get_mut(first..end));
        place.map(|place| place.copy_from_slice(color)).is_some()
    }

    /// Sets opacities (0..=1) of entries from `first` on; `false`, and nothing changes, unless all of them exist
    /// and are in range.
    #[must_use]
    pub fn set_opacity(&mut self, first: usize, opacity: &[f64]) -> bool {
        let in_range = opacity.iter().all(|opacity| (0.0..=1.0).contains(opacity));
        let place = first.checked_add(opacity.len()).and_then(|end| self.opacity.get_mut(first..end));
        place.filter(|_| in_range).map(|place| place.copy_from_slice(opacity)).is_some()
    }

    /// The card's colours: one for each of 4096 values.
    pub(crate) fn card_colors(&self) -> Box<[[u8; 3]; LOOKUP_ENTRIES]> {
        let entry = |value: usize| self.color[value * self.size() / LOOKUP_ENTRIES];
        Box::new(core::array::from_fn(entry))
    }

    /// The card's opacities, 0..=4095, one for each of 4096 values. Each is corrected for samples `distance` times
    /// the smallest voxel spacing apart: a' = 1 - (1 - a)^distance.
    pub(crate) fn card_opacities(&self, distance: f64) -> Box<[u16; LOOKUP_ENTRIES]> {
        let corrected = |opacity: f64| match distance {
            1.0 => opacity,
            _ => 1.0 - libm::pow(1.0 - opacity, distance),
        };
        let words: Vec<u16> =
            self.opacity.iter().map(|&opacity| (corrected(opacity) * 4095.0).round() as u16).collect();
        Box::new(core::array::from_fn(|value| words[value * self.size() / LOOKUP_ENTRIES]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_sizes_and_opacities_beyond_one_are_refused() {
        assert!(LookupTable::ramp(0).is_none() && LookupTable::ramp(257).is_none());
        assert!(LookupTable::new(vec![[0; 3]; 256], vec![0.0; 512]).is_none());
        assert!(LookupTable::new(vec![[0; 3]; 256], vec![1.5; 256]).is_none());
        let mut table = LookupTable::ramp(256).unwrap();
        assert!(!table.set_opacity(255, &[0.0, 0.0]) && !table.set_opacity(usize::MAX, &[0.0]));
        assert!(!table.set_opacity(0, &[f64::NAN]) && !table.set_color(256, &[[0; 3]]));
        assert_eq!(table, LookupTable::ramp(256).unwrap());
    }

    #[test]
    fn small_tables_are_repeated() {
        let table = LookupTable::ramp(256).unwrap();
        let color = table.card_colors();
        assert_eq!((color[15], color[16], color[31], color[4095]), ([0; 3], [1; 3], [1; 3], [255; 3]));
        let opacity = table.card_opacities(1.0);
        assert_eq!((opacity[15], opacity[16], opacity[4095]), (0, 16, 4095));
    }

    #[test]
    fn opacity_is_corrected_for_the_sample_distance() {
        let table = |opacity| LookupTable::new(vec![[0; 3]; 256], vec![opacity; 256]).unwrap();
        assert_eq!(table(0.5).card_opacities(2.0)[0], (0.75_f64 * 4095.0).round() as u16);
        assert_eq!(table(0.5).card_opacities(0.5)[0], ((1.0 - 0.5_f64.sqrt()) * 4095.0).round() as u16);
        assert_eq!(table(1.0).card_opacities(0.1)[0], 4095);
        assert_eq!(table(0.0).card_opacities(9.0)[0], 0);
    }
}
