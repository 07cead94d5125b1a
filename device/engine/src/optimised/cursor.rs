//! The cursor ([`crate::stage::cursor`]): it covers few samples, which are blended one by one.

use super::slices::Slice;
use super::visible::object_position;
use crate::fixed::ONE_VOXEL;
use crate::frame::{Cursor, FrameDescription};
use crate::stage::classify::Classified;
use core::ops::Range;

/// The cursor's samples above the voxels `span` of the row at permuted y `voxel_y`: calls `blend` with the voxel
/// and the sample of each that is drawn.
pub fn row(
    frame: &FrameDescription,
    cursor: &Cursor,
    slice: &Slice,
    voxel_y: i32,
    span: &Range<usize>,
    mut blend: impl FnMut(usize, Classified),
) {
    let along = frame.permutation.axes()[0].axis;
    let start = object_position(frame, slice, span.start, voxel_y);
    let Some(reach) = reach(cursor, start, along, span) else { return };
    for voxel in reach {
        let position = object_position(frame, slice, voxel, voxel_y);
        let seen = frame.visibility.block_contains(position)
            && (cursor.disable_crop || frame.visibility.factor(position) > 0);
        if let Some(sample) = cursor.sample(position).filter(|_| seen) {
            blend(voxel, sample);
        }
    }
}

/// The part of a row of positions from `start` on that parts of the cursor may reach.
fn reach(cursor: &Cursor, start: [i64; 3], along: usize, span: &Range<usize>) -> Option<Range<usize>> {
    let whole = span.clone();
    let mut reach: Option<Range<usize>> = None;
    for part in (0..3).filter(|&part| cursor.enabled[part]) {
        // How far the part extends along each axis, or without end.
        let extent = |axis: usize| match (cursor.planes, axis == part) {
            (true, true) | (false, false) => Some(cursor.width),
            (false, true) => (cursor.length > 0).then_some(cursor.length),
            (true, false) => None,
        };
        let bounds = |axis: usize| {
            extent(axis).map(|voxels| {
                let half = i64::from(voxels) * ONE_VOXEL / 2;
                let centre = i64::from(cursor.position[axis]);
                centre - half..centre + half
            })
        };
        let hit = (0..3)
            .filter(|&axis| axis != along)
            .all(|axis| bounds(axis).is_none_or(|bounds| bounds.contains(&start[axis])));
        if !hit {
            continue;
        }
        let part = bounds(along).map_or(whole.clone(), |bounds| {
            let voxel = |position: i64| {
                let voxels = (position - start[along] + ONE_VOXEL - 1).div_euclid(ONE_VOXEL);
                (voxels + whole.start as i64).clamp(whole.start as i64, whole.end as i64) as usize
            };
            voxel(bounds.start)..voxel(bounds.end)
        });
        reach = Some(match reach {
            Some(reach) => reach.start.min(part.start)..reach.end.max(part.end),
            None => part,
        });
    }
    reach
}
