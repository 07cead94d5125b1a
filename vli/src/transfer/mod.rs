//! Transfer functions: colour and opacity of data values, written by hand ([`TransferFunction::read_csv`]) or by
//! rule ([`Preset`]).

mod csv;
mod preset;

pub use csv::{CsvError, CsvFault};
pub use preset::Preset;

use crate::text::number;
use crate::values::{ValueMapping, part_of_range};
use vg500_regs::limit::LOOKUP_ENTRIES;

/// Colour and opacity at a data value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPoint {
    /// Data value, in the data's units.
    pub value: f64,
    /// R, G, B, each 0..=1, not premultiplied.
    pub color: [f64; 3],
    /// Opacity 0..=1 of a distance of one smallest voxel spacing.
    pub opacity: f64,
}

/// A piecewise-linear function from data values to colour and opacity: linear between points, constant beyond the
/// ends; where points have the same value there is a step, at which the last of them holds.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    points: Vec<ControlPoint>,
}

impl TransferFunction {
    /// The function through `points`.
    ///
    /// # Errors
    /// There are none; a value is not finite or less than the one before; a channel is not in 0..=1. Names the
    /// point, counted from 0.
    pub fn new(points: Vec<ControlPoint>) -> Result<Self, (usize, String)> {
        if points.is_empty() {
            return Err((0, "there are no points".into()));
        }
        let mut before = f64::NEG_INFINITY;
        for (index, point) in points.iter().enumerate() {
            check(point, before).map_err(|what| (index, what))?;
            before = point.value;
        }
        Ok(Self { points })
    }

    /// The function through points that a rule computed: put in order of their values, channels clamped.
    fn computed(mut points: Vec<ControlPoint>) -> Self {
        for point in &mut points {
            point.color = point.color.map(|channel| channel.clamp(0.0, 1.0));
            point.opacity = point.opacity.clamp(0.0, 1.0);
        }
        points.sort_by(|a, b| a.value.total_cmp(&b.value));
        Self { points }
    }

    /// Grey from black at the lower end of a range to white at its upper end, opaque everywhere. Black where both
    /// ends are one.
    #[must_use]
    pub fn grey([low, high]: [f64; 2]) -> Self {
        let white = if low < high { 1.0 } else { 0.0 };
        let point = |value, grey| ControlPoint { value, color: [grey; 3], opacity: 1.0 };
        Self::computed(vec![point(low, 0.0), point(high, white)])
    }

    /// The same colours, all opaque.
    #[must_use]
    pub fn opaque(&self) -> Self {
        Self { points: self.points.iter().map(|&point| ControlPoint { opacity: 1.0, ..point }).collect() }
    }

    /// The points.
    #[must_use]
    pub fn points(&self) -> &[ControlPoint] {
        &self.points
    }

    /// R, G, B and opacity of a data value.
    #[must_use]
    pub fn at(&self, value: f64) -> [f64; 4] {
        let above = self.points.partition_point(|point| point.value <= value);
        let channels = |point: &ControlPoint| {
            let [r, g, b] = point.color;
            [r, g, b, point.opacity]
        };
        let before = above.checked_sub(1).and_then(|below| self.points.get(below));
        match (before, self.points.get(above)) {
            (Some(before), Some(after)) => {
                let weight = part_of_range(value, [before.value, after.value]);
                let [before, after] = [channels(before), channels(after)];
                [0, 1, 2, 3].map(|it| before[it] + (after[it] - before[it]) * weight)
            }
            (Some(end), None) | (None, Some(end)) => channels(end),
            (None, None) => [0.0; 4],
        }
    }

    /// Entries of the card's lookup table: R, G, B of 8 bits, and opacities 0..=1 of one smallest voxel spacing,
    /// not yet corrected for the distance of samples. Entry i is that of the data value that the on-board value i
    /// stands for.
    #[must_use]
    pub fn entries(&self, mapping: &ValueMapping) -> (Vec<[u8; 3]>, Vec<f64>) {
        let entries = (0..LOOKUP_ENTRIES as u16).map(|entry| {
            let [r, g, b, opacity] = self.at(mapping.value(entry)).map(|channel| channel.clamp(0.0, 1.0));
            ([r, g, b].map(|channel| (channel * 255.0).round() as u8), opacity)
        });
        entries.unzip()
    }
}

fn check(point: &ControlPoint, before: f64) -> Result<(), String> {
    let ControlPoint { value, color: [red, green, blue], opacity } = *point;
    if !value.is_finite() {
        return Err(format!("value {value} is not finite"));
    }
    if value < before {
        return Err(format!("value {} is less than {} before it", number(value), number(before)));
    }
    for (name, channel) in [("red", red), ("green", green), ("blue", blue), ("opacity", opacity)] {
        if !(0.0..=1.0).contains(&channel) {
            return Err(format!("{name} {} is not in 0..1", number(channel)));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LookupTable;
    use crate::file::{Geometry, Samples, ScalarVolume};

    fn points(rows: &[(f64, f64)]) -> Vec<ControlPoint> {
        rows.iter().map(|&(value, level)| ControlPoint { value, color: [level; 3], opacity: level }).collect()
    }

    fn mapping(samples: impl Into<Samples>) -> ValueMapping {
        let samples = samples.into();
        let volume = ScalarVolume::new([samples.len(), 1, 1], samples, Geometry::from_spacing([1.0; 3]));
        ValueMapping::new(&volume.unwrap(), None).unwrap()
    }

    #[test]
    fn wrong_points_are_named() {
        let refused = |rows: &[(f64, f64)]| TransferFunction::new(points(rows)).unwrap_err();
        assert_eq!(refused(&[]).1, "there are no points");
        assert_eq!(refused(&[(0.0, 0.0), (-1.0, 0.0)]), (1, "value -1 is less than 0 before it".into()));
        assert_eq!(refused(&[(f64::NAN, 0.0)]), (0, "value NaN is not finite".into()));
        assert_eq!(refused(&[(0.0, 0.0), (1.0, 0.5), (2.0, 1.5)]), (2, "red 1.5 is not in 0..1".into()));
    }

    #[test]
    fn it_is_linear_between_points_and_constant_beyond() {
        let function = TransferFunction::new(vec![
            ControlPoint { value: -10.0, color: [0.0, 1.0, 0.5], opacity: 0.0 },
            ControlPoint { value: 30.0, color: [1.0, 0.0, 0.5], opacity: 0.2 },
        ])
        .unwrap();
        assert_eq!(function.at(-1e9), [0.0, 1.0, 0.5, 0.0]);
        assert_eq!(function.at(0.0), [0.25, 0.75, 0.5, 0.05]);
        assert_eq!(function.at(30.0), [1.0, 0.0, 0.5, 0.2]);
        assert_eq!(function.at(1e300), [1.0, 0.0, 0.5, 0.2]);
    }

    #[test]
    fn at_a_step_the_later_point_holds() {
        let steps = [(0.0, 0.1), (1.0, 0.2), (1.0, 0.5), (1.0, 0.7), (2.0, 0.9), (2.0, 0.3)];
        let function = TransferFunction::new(points(&steps)).unwrap();
        let at = |value| function.at(value)[3];
        assert!(
            (at(1.0_f64.next_down()) - 0.2).abs() < 1e-12 && (at(2.0_f64.next_down()) - 0.9).abs() < 1e-12
        );
        assert_eq!([at(1.0), at(2.0), at(3.0)], [0.7, 0.3, 0.3]);
        assert!((at(1.5) - 0.8).abs() < 1e-12);
    }

    #[test]
    fn extreme_values_are_no_harm() {
        let wide = TransferFunction::new(points(&[(-f64::MAX, 0.0), (f64::MAX, 1.0)])).unwrap();
        assert_eq!([wide.at(0.0)[3], wide.at(f64::MAX)[3]], [0.5, 1.0]);
        let narrow = TransferFunction::new(points(&[(0.0, 0.0), (5e-324, 1.0)])).unwrap();
        assert_eq!([narrow.at(0.0)[3], narrow.at(5e-324)[3]], [0.0, 1.0]);
    }

    #[test]
    fn grey_extends_over_the_range() {
        let grey = TransferFunction::grey([-100.0, 300.0]);
        assert_eq!(grey.at(-200.0), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(grey.at(0.0), [0.25, 0.25, 0.25, 1.0]);
        assert_eq!(grey.at(300.0), [1.0; 4]);
        assert_eq!(TransferFunction::grey([7.0, 7.0]).at(7.0), [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn opaque_keeps_colours() {
        let function = TransferFunction::new(points(&[(0.0, 0.2), (1.0, 0.4)])).unwrap().opaque();
        assert_eq!(function.at(0.0), [0.2, 0.2, 0.2, 1.0]);
    }

    #[test]
    fn entries_are_those_of_the_data_values() {
        // A step at 100 and a ramp from 200 to 201.
        let rows = [(0.0, 0.0), (100.0, 0.0), (100.0, 1.0), (200.0, 1.0), (201.0, 0.0)];
        let function = TransferFunction::new(points(&rows)).unwrap();
        let (color, opacity) = function.entries(&mapping(vec![0_u8, 255]));
        assert_eq!(
            [1599, 1600, 3200, 3204, 3208, 4095].map(|entry| opacity[entry]),
            [0.0, 1.0, 1.0, 0.75, 0.5, 0.0]
        );
        assert_eq!(
            [1599, 1600, 3204, 3208].map(|entry| color[entry]),
            [[0; 3], [255; 3], [191; 3], [128; 3]]
        );
        assert!(LookupTable::new(color, opacity).is_some());
        let (_, opacity) = function.entries(&mapping(vec![0_u16, 4000]));
        assert_eq!([99, 100, 200, 201].map(|entry| opacity[entry]), [0.0, 1.0, 1.0, 0.0]);
        // Scaled: entry i stands for -1000 + i.
        let (_, opacity) = function.entries(&mapping(vec![-1000_i16, 3095]));
        assert_eq!([1099, 1100, 1200, 1201].map(|entry| opacity[entry]), [0.0, 1.0, 1.0, 0.0]);
    }
}
