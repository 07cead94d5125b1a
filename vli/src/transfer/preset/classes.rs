//! Classes of values: background, a first material, and denser ones.

use crate::values::{Histogram, ValueMapping, part_of_range};

/// Bins into which the range is divided.
const BINS: usize = 256;

/// Three classes of the values in a range, found by Otsu's method (1979): the variance within them is least.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Classes {
    /// Ends of the range.
    pub range: [f64; 2],
    /// Means of background, first material and denser ones, data values. An empty class has the mean of the one below.
    pub mean: [f64; 3],
    /// Data values that separate them.
    pub threshold: [f64; 2],
    /// Whether values above the background pile up around some value, as those of a material do.
    pub has_peak: bool,
    /// Part (0..=1) of the voxels above the background that lie in the uppermost quarter of the range.
    pub dense: f64,
}

impl Classes {
    /// The classes of a volume's voxels.
    pub fn new(mapping: &ValueMapping, histogram: &Histogram) -> Self {
        let bins = bins(mapping, histogram);
        let sums = Sums::new(&bins);
        let thresholds = sums.best_thresholds();
        let [first, second] = thresholds;
        let background = sums.mean(0, first).unwrap_or(0.0);
        let material = sums.mean(first, second).unwrap_or(background);
        let dense = sums.mean(second, BINS).unwrap_or(material);
        let [low, high] = mapping.range();
        let value = |bin: f64| low * (1.0 - bin / BINS as f64) + high * (bin / BINS as f64);
        let foreground = sums.count(first, BINS);
        Self {
            range: [low, high],
            // A bin stands for the values in its middle.
            mean: [background, material, dense].map(|bin| value(bin + 0.5)),
            threshold: thresholds.map(|bin| value(bin as f64)),
            has_peak: has_peak(&bins, first),
            dense: if foreground > 0.0 {
                sums.count(first.max(BINS * 3 / 4), BINS) / foreground
            } else {
                0.0
            },
        }
    }
}

/// Voxels per bin of the range; those beyond its ends are in the first and last.
fn bins(mapping: &ValueMapping, histogram: &Histogram) -> [f64; BINS] {
    let mut bins = [0.0; BINS];
    for (entry, &count) in (0_u16..).zip(histogram.counts()) {
        // Where the range is a single value the part is no number, and the bin the first.
        let part = part_of_range(mapping.value(entry), mapping.range());
        let bin = ((part * BINS as f64) as usize).min(BINS - 1);
        bins[bin] += count as f64;
    }
    bins
}

/// Sums over the bins below each bin: of voxels, and of voxels times bin.
struct Sums([(f64, f64); BINS + 1]);

impl Sums {
    fn new(bins: &[f64; BINS]) -> Self {
        let mut sums = [(0.0, 0.0); BINS + 1];
        for (bin, count) in bins.iter().enumerate() {
            sums[bin + 1] = (sums[bin].0 + count, sums[bin].1 + count * bin as f64);
        }
        Self(sums)
    }

    fn count(&self, from: usize, to: usize) -> f64 {
        self.0[to].0 - self.0[from].0
    }

    fn mean(&self, from: usize, to: usize) -> Option<f64> {
        let count = self.count(from, to);
        (count > 0.0).then(|| (self.0[to].1 - self.0[from].1) / count)
    }

    /// The two bins at which the second and third class begin. The variance within classes is least where the sum
    /// over classes of count times mean squared is greatest.
    fn best_thresholds(&self) -> [usize; 2] {
        let between = |from, to| self.mean(from, to).map_or(0.0, |mean| mean * mean * self.count(from, to));
        let mut best = (f64::NEG_INFINITY, [1, 2]);
        for first in 1..BINS - 1 {
            for second in first + 1..BINS {
                let variance = between(0, first) + between(first, second) + between(second, BINS);
                if variance > best.0 {
                    best = (variance, [first, second]);
                }
            }
        }
        best.1
    }
}

/// Whether the histogram, from a bin upwards, falls and then rises again by half. Bins are joined by fours, and the
/// last are left out, in which cut off values pile up.
fn has_peak(bins: &[f64; BINS], first: usize) -> bool {
    let coarse = bins.chunks(4).map(|bins| bins.iter().sum::<f64>());
    let mut least = f64::INFINITY;
    for count in coarse.take(BINS / 4 - 1).skip(first.div_ceil(4)) {
        if count > 1.5 * least.max(1.0) {
            return true;
        }
        least = least.min(count);
    }
    false
}
