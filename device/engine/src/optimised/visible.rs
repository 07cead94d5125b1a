//! Which samples of a row can be seen ([`crate::stage::visibility`]), as intervals: along a row only one object
//! coordinate changes.

use super::line::Line;
use super::slices::{Axis, Slice};
use crate::fixed::ONE_VOXEL;
use crate::frame::{CutPlane, FrameDescription};
use crate::stage::visibility::UNCUT;
use core::ops::Range;

/// What of a row of samples can be seen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Seen {
    /// All of these.
    All,
    /// None.
    None,
    /// As the line of factors says.
    Factors,
}

/// Decides what of each row can be seen.
#[derive(Clone, Copy, Debug)]
pub struct Visible<'a> {
    frame: &'a FrameDescription,
    /// Whether cropping leaves a sample that lies inside the slabs of x, y and z of the object as the bits of the
    /// index tell.
    kept: [bool; 8],
}

impl<'a> Visible<'a> {
    /// For a frame, if any of its samples may be hidden.
    #[must_use]
    pub fn new(frame: &'a FrameDescription) -> Option<Self> {
        let needs = frame.needs();
        let kept = core::array::from_fn(|inside| {
            frame
                .visibility
                .crop
                .is_none_or(|crop| crop.combines([0, 1, 2].map(|axis| inside >> axis & 1 != 0)))
        });
        (needs.bounds || needs.crop || needs.cut).then_some(Self { frame, kept })
    }

    /// What can be seen of the samples of `slice` above the voxels `span` of the row at permuted y `voxel_y`.
    /// Factors of opacity go to `factors`, 0..=256, 0 outside of the span.
    pub fn row(&self, slice: &Slice, voxel_y: i32, span: &Range<usize>, factors: &mut Line) -> Seen {
        let axis = self.frame.permutation.axes()[0].axis;
        let at = |voxel: usize| object_position(self.frame, slice, voxel, voxel_y);
        let position = at(span.start);
        let Some(inside) = self.within_bounds(position, axis, &slice.x, span) else {
            return Seen::None;
        };
        let words = &mut factors.words_mut()[..];
        words.fill(0);
        self.fill(position, axis, &slice.x, inside.clone(), words);
        if let Some(cut) = &self.frame.visibility.cut {
            dim(cut, inside.clone(), at, words);
        }
        if words[inside.clone()].iter().all(|&factor| factor == 0) {
            Seen::None
        } else if inside == *span && words[inside].iter().all(|&factor| u32::from(factor) == UNCUT) {
            Seen::All
        } else {
            Seen::Factors
        }
    }

    /// The part of a span inside of block range and sub-volume.
    fn within_bounds(
        &self,
        position: [i64; 3],
        along: usize,
        x: &Axis,
        span: &Range<usize>,
    ) -> Option<Range<usize>> {
        let visibility = &self.frame.visibility;
        let mut inside = span.clone();
        for (axis, place) in position.into_iter().enumerate() {
            let [low, high] = visibility.block[axis].map(|bound| i64::from(bound) * ONE_VOXEL);
            let [min, max] = visibility.subvolume[axis].map(|bound| i64::from(bound) * ONE_VOXEL);
            let [first, last] = [low.max(min), (high - 1).min(max)];
            if axis == along {
                inside = intersection(&inside, &voxels_between(x, first, last));
            } else if !(first..=last).contains(&place) {
                return None;
            }
        }
        (!inside.is_empty()).then_some(inside)
    }

    /// Full factors where cropping leaves samples.
    fn fill(&self, position: [i64; 3], along: usize, x: &Axis, inside: Range<usize>, words: &mut [u16]) {
        let full = UNCUT as u16;
        let Some(crop) = &self.frame.visibility.crop else {
            words[inside].fill(full);
            return;
        };
        let slab = crop.slabs.map(|slab| slab.map(i64::from));
        let others = (0..3).filter(|&axis| axis != along);
        let region = others.fold(0, |region, axis| {
            let [min, max] = slab[axis];
            region | usize::from((min..=max).contains(&position[axis])) << axis
        });
        let [outside_kept, inside_kept] = [region, region | 1 << along].map(|at| self.kept[at]);
        let [min, max] = slab[along];
        let in_slab = intersection(&inside, &voxels_between(x, min, max));
        if outside_kept {
            words[inside].fill(full);
        }
        words[in_slab].fill(if inside_kept { full } else { 0 });
    }
}

/// Position in object space, 1/256 voxel, of the sample above permuted voxels x and y.
pub fn object_position(frame: &FrameDescription, slice: &Slice, voxel_x: usize, voxel_y: i32) -> [i64; 3] {
    let z = i64::from(slice.below) * ONE_VOXEL + i64::from(slice.weight);
    let permuted = [slice.x.position(voxel_x as i32), slice.y.position(voxel_y), z];
    let last = frame.volume.size.map(|size| i64::from(size - 1) * ONE_VOXEL);
    let mut position = frame.permutation.to_object(permuted, last);
    // Rows always run forward along x.
    position[frame.permutation.axes()[0].axis] = permuted[0];
    position
}

fn intersection(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    // Also where it is empty, it lies in `a`.
    let start = a.start.max(b.start).min(a.end);
    start..a.end.min(b.end).max(start)
}

/// The voxels above which samples have positions of `first..=last`.
fn voxels_between(x: &Axis, first: i64, last: i64) -> Range<usize> {
    // The voxels of positions at or behind one.
    let from = |position: i64| {
        let voxel = (position - i64::from(x.weight) + ONE_VOXEL - 1).div_euclid(ONE_VOXEL);
        voxel.clamp(0, 1 << 16) as usize
    };
    let start = from(first);
    start..from(last.saturating_add(1)).max(start)
}

/// Multiplies full factors by those of the cut plane.
fn dim(cut: &CutPlane, inside: Range<usize>, position: impl Fn(usize) -> [i64; 3], words: &mut [u16]) {
    let factor = |voxel: usize| cut.factor(position(voxel)) as u16;
    let mut start = inside.start;
    // Within a stretch on one side of both faces' middle the factor is monotone; equal ends are equal throughout.
    for end in turning_points(cut, &inside, &position).into_iter().chain([inside.end]) {
        if start < end {
            monotone(start, end - 1, factor(start), factor(end - 1), &factor, &mut |range, value| {
                for word in &mut words[range] {
                    *word = if *word == 0 { 0 } else { value };
                }
            });
            start = end;
        }
    }
}

/// Halves a stretch `first..=last` whose factor is monotone until it is constant.
fn monotone(
    first: usize,
    last: usize,
    at_first: u16,
    at_last: u16,
    factor: &impl Fn(usize) -> u16,
    constant: &mut impl FnMut(core::ops::RangeInclusive<usize>, u16),
) {
    if at_first == at_last {
        constant(first..=last, at_first);
    } else if last - first == 1 {
        constant(first..=first, at_first);
        constant(last..=last, at_last);
    } else {
        let middle = first.midpoint(last);
        let at_middle = factor(middle);
        monotone(first, middle, at_first, at_middle, factor, constant);
        monotone(middle, last, at_middle, at_last, factor, constant);
    }
}

/// Where along a row the plane's value passes the middle between its faces: before and behind it the factor is
/// monotone.
fn turning_points(
    cut: &CutPlane,
    inside: &Range<usize>,
    position: &impl Fn(usize) -> [i64; 3],
) -> Option<usize> {
    let value = |voxel: usize| -> i128 {
        let terms = cut.normal.iter().zip(position(voxel));
        terms.map(|(&normal, position)| i128::from(normal) * i128::from(position)).sum()
    };
    let middle = (i128::from(cut.faces[0]) + i128::from(cut.faces[1])).div_euclid(2);
    let rising = value(inside.start) <= value(inside.end - 1);
    let before = |voxel: usize| if rising { value(voxel) < middle } else { value(voxel) > middle };
    let [mut low, mut high] = [inside.start, inside.end];
    while low < high {
        let place = low.midpoint(high);
        if before(place) {
            low = place + 1;
        } else {
            high = place;
        }
    }
    Some(low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn cut_rows_are_those_of_each_sample(
            normal: [i16; 3],
            start in [0..65280i64, 0..65280, 0..65280],
            faces in [-(1i64 << 33)..1 << 33, -(1i64 << 33)..1 << 33],
            falloff in prop_oneof![Just(0u32), 1..1u32 << 17],
            outside: bool,
        ) {
            let cut = CutPlane { outside, normal, faces, falloff };
            let position = |voxel: usize| [start[0] + 256 * voxel as i64, start[1], start[2]];
            let mut words = [UNCUT as u16; 256];
            dim(&cut, 3..250, position, &mut words);
            for (voxel, word) in words.iter().enumerate().take(250).skip(3) {
                prop_assert_eq!(u32::from(*word), cut.factor(position(voxel)), "{}", voxel);
            }
            prop_assert_eq!(words[2], UNCUT as u16);
        }
    }
}
