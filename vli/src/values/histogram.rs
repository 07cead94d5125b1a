//! How often values occur in a volume.

use crate::Voxels;
use vg500_regs::limit::LOOKUP_ENTRIES;

/// How many voxels have each of the 4096 values that the card's lookup table distinguishes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Histogram {
    counts: Vec<u64>,
    total: u64,
}

impl Histogram {
    /// Counts the voxels of a volume.
    #[must_use]
    pub fn new(voxels: &Voxels) -> Self {
        let mut counts = vec![0; LOOKUP_ENTRIES];
        let format = voxels.format();
        let mut count = |voxel: u16| {
            if let Some(count) = counts.get_mut(usize::from(format.value(voxel))) {
                *count += 1;
            }
        };
        match voxels {
            Voxels::Uint8(voxels) => voxels.iter().for_each(|&voxel| count(voxel.into())),
            Voxels::Uint12Lower(voxels) | Voxels::Uint12Upper(voxels) => {
                voxels.iter().for_each(|&voxel| count(voxel));
            }
        }
        Self { counts, total: voxels.len() as u64 }
    }

    /// Voxels of each value, 4096 numbers.
    #[must_use]
    pub fn counts(&self) -> &[u64] {
        &self.counts
    }

    /// The least value (0..=4095) that at least `part` (0..=1) of the voxels do not exceed: 0.5 gives the median.
    #[must_use]
    pub fn quantile(&self, part: f64) -> u16 {
        let wanted = part * self.total as f64;
        let mut below = 0;
        for (value, count) in (0_u16..).zip(&self.counts) {
            below += count;
            if below as f64 >= wanted && below > 0 {
                return value;
            }
        }
        LOOKUP_ENTRIES as u16 - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxels_count_at_their_value_on_board() {
        let histogram = Histogram::new(&Voxels::Uint8(vec![0, 1, 1, 255].into()));
        assert_eq!([0, 16, 4080].map(|value| histogram.counts()[value]), [1, 2, 1]);
        assert_eq!(histogram.counts().iter().sum::<u64>(), 4);
        let histogram = Histogram::new(&Voxels::Uint12Lower(vec![0xf001, 4095].into()));
        assert_eq!([1, 4095].map(|value| histogram.counts()[value]), [1, 1]);
        let histogram = Histogram::new(&Voxels::Uint12Upper(vec![0x0010].into()));
        assert_eq!(histogram.counts()[1], 1);
    }

    #[test]
    fn quantiles_are_values_that_occur() {
        let histogram = Histogram::new(&Voxels::Uint12Lower(vec![7, 7, 9, 4000].into()));
        assert_eq!(
            [0.0, 0.5, 0.51, 0.75, 0.76, 1.0].map(|part| histogram.quantile(part)),
            [7, 7, 9, 9, 4000, 4000]
        );
    }
}
