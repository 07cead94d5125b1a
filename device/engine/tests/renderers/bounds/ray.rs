//! What a ray meets.
//!
//! **Cut plane.** Its factor is that of the rounded position. The distance is truncated to 2^-14 voxel, times a
//! reciprocal of at most 2, and the factor rounded to 1/256.

use super::Range;
use super::sample::SampleRange;
use super::truth::{Rounding, Truth};
use vg500_engine::Task;
use vg500_engine::ideal::visibility::CutPlane;
use vg500_engine::ideal::{self, Transfer, Visibility, Voxels};
use vg500_regs::BlendMode;

const CUT_ERROR: f64 = 1.0 / 512.0 + 2.0 / 16384.0;

/// A scene and what is true in it.
pub struct View<'a, V, T> {
    pub task: &'a Task,
    pub ideal: &'a ideal::Scene<V, T>,
    pub rounding: Rounding,
    pub truth: &'a dyn Fn([f64; 3]) -> Truth,
}

/// What a ray meets at one position.
pub struct Met {
    pub cursor: Option<SampleRange>,
    pub volume: Option<VolumeSample>,
}

/// A visible sample of the volume.
pub struct VolumeSample {
    /// Ideal value, and greatest error of the reference's.
    pub value: f64,
    pub value_error: f64,
    pub range: SampleRange,
}

impl<V: Voxels, T: Transfer> View<'_, V, T> {
    /// What a ray meets, front to back; `None` if that may differ between the renderers.
    pub fn along(&self, start: [f64; 2]) -> Option<Vec<Met>> {
        let positions: Vec<_> = self.ideal.positions(start).collect();
        for shift in [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]] {
            let [x, y, _] = self.ideal.permutation.permuted(self.rounding.0);
            let shifted = self.ideal.positions([start[0] + shift[0] * x, start[1] + shift[1] * y]);
            if !same(&positions, &shifted.collect::<Vec<_>>()) {
                return None;
            }
        }
        positions.into_iter().map(|position| self.met(position)).collect()
    }

    fn met(&self, position: [f64; 3]) -> Option<Met> {
        let ideal = self.ideal;
        let uncut = Visibility { cut: None, ..ideal.visibility };
        let kept = agreed(Rounding::around(position).map(|place| uncut.factor(place) > 0.0))?;
        let factor = if kept { self.factor(position) } else { [0.0; 2] };
        let cursor = match &ideal.cursor {
            Some(cursor) => agreed(Rounding::around(position).map(|place| cursor.sample(place, 1.0)))?
                .map(|color| (cursor.disable_crop, color)),
            None => None,
        };
        let uncertain = factor[0] <= 0.0 && factor[1] > 0.0;
        let cut_decides = ideal.blend != BlendMode::Alpha || cursor.is_some_and(|(always, _)| !always);
        if uncertain && cut_decides {
            return None;
        }
        let seen = cursor.filter(|(always, _)| *always || factor[1] > 0.0);
        let volume = (factor[1] > 0.0).then(|| {
            let truth = (self.truth)(position);
            let color = ideal.color(truth.value, || truth.gradient, ideal.visibility.factor(position));
            let cut = (ideal.blend == BlendMode::Alpha && factor != [1.0; 2]).then_some(factor);
            let range = SampleRange::of_volume(self.task, &truth, color, cut);
            VolumeSample { value: truth.value, value_error: truth.value_error, range }
        });
        Some(Met { cursor: seen.map(|(_, color)| SampleRange::of_cursor(color)), volume })
    }

    /// What the cut plane may leave of a sample.
    fn factor(&self, position: [f64; 3]) -> Range {
        let Some(cut) = self.ideal.visibility.cut else { return [1.0; 2] };
        let inside = CutPlane { outside: false, ..cut };
        let factors = Rounding::around(position).map(|place| inside.factor(place));
        let [mut least, mut most] =
            factors.fold([1.0, 0.0], |[least, most], it| [it.min(least), it.max(most)]);
        // What is full or nothing is so without rounding.
        least = if least < 1.0 { f64::max(least - CUT_ERROR, 0.0) } else { 1.0 };
        most = if most > 0.0 { f64::min(most + CUT_ERROR, 1.0) } else { 0.0 };
        if cut.outside { [1.0 - most, 1.0 - least] } else { [least, most] }
    }
}

/// Whether both lists hold the same samples but for a shift.
fn same(a: &[[f64; 3]], b: &[[f64; 3]]) -> bool {
    let near = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1.0 / 256.0);
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| near(a, b))
}

/// What all of them are, if they are all alike.
fn agreed<T: PartialEq>(mut all: impl Iterator<Item = T>) -> Option<T> {
    let first = all.next()?;
    all.all(|other| other == first).then_some(first)
}
