//! Presets of CT scans, in Hounsfield units: air -1000, fat -100, water 0, muscle 50, bone from 200 on.

use super::ControlPoint;
use crate::values::{Histogram, ValueMapping};

/// Hounsfield units, R, G, B, and opacity per smallest voxel spacing.
type Row = (f64, [f64; 3], f64);

/// Bones, darker where the scan sees them only in part.
pub const BONE: [Row; 6] = [
    (150.0, [0.36, 0.15, 0.09], 0.0),
    (300.0, [0.58, 0.32, 0.19], 0.03),
    (600.0, [0.85, 0.66, 0.46], 0.12),
    (1000.0, [0.97, 0.89, 0.75], 0.28),
    (1600.0, [1.0, 0.98, 0.92], 0.5),
    (3000.0, [1.0, 1.0, 1.0], 0.8),
];

/// Skin and fat faint, muscles and organs red, bones light.
pub const SOFT_TISSUE: [Row; 9] = [
    (-500.0, [0.60, 0.36, 0.26], 0.0),
    (-250.0, [0.72, 0.46, 0.33], 0.014),
    (-60.0, [0.85, 0.58, 0.38], 0.006),
    (20.0, [0.62, 0.16, 0.11], 0.014),
    (100.0, [0.70, 0.18, 0.12], 0.024),
    (200.0, [0.78, 0.40, 0.26], 0.04),
    (500.0, [0.95, 0.82, 0.62], 0.15),
    (1000.0, [1.0, 0.95, 0.86], 0.35),
    (2000.0, [1.0, 1.0, 1.0], 0.7),
];

/// Airways and lungs blue, their vessels orange, all else faint.
pub const LUNG: [Row; 8] = [
    (-970.0, [0.10, 0.18, 0.45], 0.0),
    (-870.0, [0.18, 0.34, 0.75], 0.006),
    (-700.0, [0.40, 0.55, 0.88], 0.006),
    (-500.0, [0.95, 0.62, 0.38], 0.04),
    (-200.0, [0.95, 0.40, 0.22], 0.03),
    (-120.0, [0.85, 0.35, 0.22], 0.002),
    (150.0, [0.85, 0.30, 0.20], 0.003),
    (700.0, [1.0, 0.93, 0.82], 0.08),
];

/// How a scan stores Hounsfield units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Data value of water.
    water: f64,
    /// Data values per unit.
    unit: f64,
}

impl Scale {
    /// Hounsfield units as they are, or with an offset that makes them positive, where the data's range is that of a
    /// CT scan.
    fn known(mapping: &ValueMapping) -> Option<Self> {
        /// Scanners write water as 1024 or 1000; the difference is smaller than between tissues.
        const OFFSET: f64 = 1024.0;
        let [least, greatest] = mapping.data_range();
        let range = least..=greatest;
        let ct = |water: f64| {
            // Air and bone, but no more than the 13 bits of scanners.
            range.contains(&(water - 800.0))
                && range.contains(&(water + 400.0))
                && least >= water - 4096.0
                && greatest <= water + 8192.0
        };
        [0.0, OFFSET].into_iter().find(|&water| ct(water)).map(|water| Self { water, unit: 1.0 })
    }

    /// The scale of a volume. Where its data's range is not that of a CT scan, the range counts as one from air to
    /// dense bone.
    pub fn new(mapping: &ValueMapping) -> Self {
        const AIR: f64 = -1000.0;
        const BONE: f64 = 2000.0;
        let [low, high] = mapping.range();
        let unit = high / (BONE - AIR) - low / (BONE - AIR);
        Self::known(mapping).unwrap_or(Self { water: low - AIR * unit, unit })
    }

    /// Whether a volume is a CT scan of a body: its range is, and densities near that of water are twice as frequent
    /// as those below and above.
    pub fn is_body(mapping: &ValueMapping, histogram: &Histogram) -> bool {
        let Some(scale) = Self::known(mapping) else { return false };
        let voxels = |from: f64, to: f64| -> u64 {
            let units = from..to;
            let counts = (0_u16..).zip(histogram.counts());
            let inside = counts.filter(|(entry, _)| units.contains(&(mapping.value(*entry) - scale.water)));
            inside.map(|(_, count)| count).sum()
        };
        let tissue = voxels(-150.0, 150.0);
        tissue > 2 * voxels(-450.0, -150.0) && tissue > 2 * voxels(150.0, 450.0)
    }

    /// Control points of a preset.
    pub fn points(self, rows: &[Row]) -> Vec<ControlPoint> {
        let point = |&(units, color, opacity): &Row| {
            let value = self.water + units * self.unit;
            ControlPoint { value, color, opacity }
        };
        rows.iter().map(point).collect()
    }
}
