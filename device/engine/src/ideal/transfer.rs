//! Functions made of points.

/// A piecewise-linear function of a value: between two points it is linear, beyond the ends it stays constant,
/// and two points of the same value make a step, at which the later one holds. As a transfer function it has four
/// channels, R, G, B (not premultiplied) and A.
#[derive(Clone, Debug, PartialEq)]
pub struct PiecewiseLinear<const CHANNELS: usize> {
    points: Vec<(f64, [f64; CHANNELS])>,
}

impl<const CHANNELS: usize> PiecewiseLinear<CHANNELS> {
    /// The function through `points`: values with their channels. `None` if there are none, or if values decrease
    /// or are not numbers.
    #[must_use]
    pub fn new(points: Vec<(f64, [f64; CHANNELS])>) -> Option<Self> {
        let ordered = points.iter().all(|point| !point.0.is_nan()) && points.is_sorted_by(|a, b| a.0 <= b.0);
        (ordered && !points.is_empty()).then_some(Self { points })
    }

    /// The channels at a value.
    #[must_use]
    pub fn at(&self, value: f64) -> [f64; CHANNELS] {
        let above = self.points.partition_point(|point| point.0 <= value);
        let after = self.points[above.min(self.points.len() - 1)];
        let before = self.points[above.saturating_sub(1)];
        let distance = after.0 - before.0;
        if distance <= 0.0 {
            return before.1;
        }
        let weight = (value - before.0) / distance;
        core::array::from_fn(|channel| before.1[channel] + (after.1[channel] - before.1[channel]) * weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_must_be_some_and_in_order() {
        assert_eq!(PiecewiseLinear::<4>::new(vec![]), None);
        assert_eq!(PiecewiseLinear::new(vec![(1.0, [0.0; 4]), (0.5, [0.0; 4])]), None);
        assert_eq!(PiecewiseLinear::new(vec![(0.0, [0.0; 4]), (f64::NAN, [0.0; 4])]), None);
        assert_eq!(PiecewiseLinear::new(vec![(f64::NAN, [0.0; 4])]), None);
        assert!(PiecewiseLinear::new(vec![(1.0, [0.0; 4])]).is_some());
    }

    #[test]
    fn it_is_linear_between_points_and_constant_beyond() {
        let function =
            PiecewiseLinear::new(vec![(-10.0, [0.0, 1.0, 0.5, 0.0]), (30.0, [1.0, 0.0, 0.5, 0.2])]).unwrap();
        assert_eq!(function.at(-1e9), [0.0, 1.0, 0.5, 0.0]);
        assert_eq!(function.at(-10.0), [0.0, 1.0, 0.5, 0.0]);
        assert_eq!(function.at(0.0), [0.25, 0.75, 0.5, 0.05]);
        assert_eq!(function.at(30.0), [1.0, 0.0, 0.5, 0.2]);
        assert_eq!(function.at(f64::INFINITY), [1.0, 0.0, 0.5, 0.2]);
    }

    #[test]
    fn at_a_step_the_later_point_holds() {
        let steps = [(0.0, 0.1), (1.0, 0.2), (1.0, 0.5), (1.0, 0.7), (2.0, 0.9), (2.0, 0.3)];
        let function =
            PiecewiseLinear::new(steps.map(|(value, level)| (value, [level; 4])).to_vec()).unwrap();
        let at = |value| function.at(value)[0];
        assert!((at(0.999_999_999) - 0.2).abs() < 1e-8);
        assert_eq!([at(1.0), at(2.0), at(3.0)], [0.7, 0.3, 0.3]);
        assert!((at(1.5) - 0.8).abs() < 1e-12);
    }
}
