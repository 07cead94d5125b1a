//! The three-dimensional cursor (paper, section 4.3): samples that the compositing unit makes itself and blends
//! into the rays.
//!
//! Its parts lie in object voxel space. A part is half-open (from -w/2 up to, not including, w/2), so that with
//! unit sampling it is exactly its width in samples.

use super::classify::Classified;
use crate::fixed::{ONE_VOXEL, widen};
use crate::frame::Cursor;

impl Cursor {
    /// The cursor's sample at `position` (object space, 1/256 voxel), if it is drawn there. Where two parts meet
    /// the one of the first axis is drawn, or nothing if overlap is excluded.
    #[must_use]
    pub fn sample(&self, position: [i64; 3]) -> Option<Classified> {
        let mut parts = (0..3).filter(|&axis| self.enabled[axis] && self.part_contains(axis, position));
        let axis = parts.next()?;
        if self.exclude_overlap && parts.next().is_some() {
            return None;
        }
        let [r, g, b, a] = self.color[axis].map(widen);
        Some(Classified { color: [r, g, b], alpha: a })
    }

    /// Whether the bar along an axis, or the plane across it, contains a position.
    fn part_contains(&self, axis: usize, position: [i64; 3]) -> bool {
        let within = |place: usize, voxels: u32| {
            let distance = position[place] - i64::from(self.position[place]);
            let half = i64::from(voxels) * ONE_VOXEL / 2;
            (-half..half).contains(&distance)
        };
        if self.planes {
            return within(axis, self.width);
        }
        let long = self.length == 0 || within(axis, self.length);
        long && (0..3).filter(|&other| other != axis).all(|other| within(other, self.width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CROSS_HAIR: Cursor = Cursor {
        enabled: [true; 3],
        planes: false,
        exclude_overlap: false,
        disable_crop: false,
        width: 1,
        length: 4,
        position: [10 << 8, 20 << 8, 30 << 8],
        color: [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 128]],
    };

    fn at(cursor: &Cursor, x: i64, y: i64, z: i64) -> Option<[u16; 3]> {
        cursor.sample([x, y, z].map(|voxels| voxels << 8)).map(|sample| sample.color)
    }

    #[test]
    fn bars_have_their_length_and_width() {
        let red = Some([4095, 0, 0]);
        let along_x = [7, 8, 9, 10, 11, 12].map(|x| at(&CROSS_HAIR, x, 20, 30));
        assert_eq!(along_x, [None, red, red, red, red, None]);
        assert_eq!(at(&CROSS_HAIR, 9, 21, 30), None);
        let wide = Cursor { width: 3, length: 0, ..CROSS_HAIR };
        assert_eq!(
            [18, 19, 20, 21, 22].map(|y| at(&wide, 200, y, 30).is_some()),
            [false, true, true, true, false]
        );
    }

    #[test]
    fn overlap_shows_the_first_axis_or_nothing() {
        assert_eq!(at(&CROSS_HAIR, 10, 20, 30), Some([4095, 0, 0]));
        assert_eq!(
            at(&Cursor { enabled: [false, true, true], ..CROSS_HAIR }, 10, 20, 30),
            Some([0, 4095, 0])
        );
        assert_eq!(at(&Cursor { exclude_overlap: true, ..CROSS_HAIR }, 10, 20, 30), None);
    }

    #[test]
    fn planes_lie_across_their_axis() {
        let plane = Cursor { planes: true, enabled: [false, false, true], ..CROSS_HAIR };
        assert_eq!(at(&plane, -900, 900, 30), Some([0, 0, 4095]));
        assert_eq!(at(&plane, 10, 20, 31), None);
        assert_eq!(plane.sample([0, 0, 30 << 8]).unwrap().alpha, widen(128));
    }
}
