//! The three-dimensional cursor.

/// The cursor. Its parts are half-open, from -w/2 up to, not including, w/2, as those of the card are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cursor {
    /// Which parts are drawn.
    pub enabled: [bool; 3],
    /// Whether planes are drawn instead of a cross hair.
    pub planes: bool,
    /// Whether nothing is drawn where two parts meet; else the one of the first axis is.
    pub exclude_overlap: bool,
    /// Whether it is drawn where the volume is cropped or cut away, too.
    pub disable_crop: bool,
    /// Width of a part in voxels.
    pub width: f64,
    /// Length of the cross hair's parts in voxels, 0 without end.
    pub length: f64,
    /// Centre in object voxel space.
    pub position: [f64; 3],
    /// R, G, B (not multiplied by A) and A of each part.
    pub color: [[f64; 4]; 3],
}

impl Cursor {
    /// Colour and opacity at an object position, if the cursor is drawn there; `factor` is what sub-volume,
    /// cropping and cut plane leave of the volume.
    #[must_use]
    pub fn sample(&self, position: [f64; 3], factor: f64) -> Option<[f64; 4]> {
        if factor <= 0.0 && !self.disable_crop {
            return None;
        }
        let mut parts = (0..3).filter(|&axis| self.enabled[axis] && self.part_contains(axis, position));
        let first = parts.next()?;
        let overlap = parts.next().is_some();
        (!overlap || !self.exclude_overlap).then(|| self.color[first])
    }

    /// Whether the bar along an axis, or the plane across it, contains a position.
    fn part_contains(&self, axis: usize, position: [f64; 3]) -> bool {
        (0..3).all(|place| {
            let extent = match (self.planes, place == axis) {
                (true, true) | (false, false) => self.width,
                (false, true) if self.length > 0.0 => self.length,
                _ => f64::INFINITY,
            };
            (-extent / 2.0..extent / 2.0).contains(&(position[place] - self.position[place]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Option<[f64; 4]> = Some([1.0, 0.0, 0.0, 1.0]);
    const GREEN: Option<[f64; 4]> = Some([0.0, 1.0, 0.0, 0.5]);
    const CROSS_HAIR: Cursor = Cursor {
        enabled: [true, true, false],
        planes: false,
        exclude_overlap: false,
        disable_crop: false,
        width: 1.0,
        length: 4.0,
        position: [10.0, 20.0, 30.0],
        color: [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.5], [0.0; 4]],
    };

    #[test]
    fn bars_have_their_length_and_width_and_are_half_open() {
        let along = [7.9, 8.0, 11.9, 12.0].map(|x| CROSS_HAIR.sample([x, 20.0, 30.0], 1.0));
        assert_eq!(along, [None, RED, RED, None]);
        let across = [29.4, 29.5, 30.4, 30.5].map(|z| CROSS_HAIR.sample([9.0, 20.0, z], 1.0));
        assert_eq!(across, [None, RED, RED, None]);
        let endless = Cursor { length: 0.0, ..CROSS_HAIR };
        assert_eq!(endless.sample([10.0, -1e6, 30.0], 1.0), GREEN);
    }

    #[test]
    fn planes_lie_across_their_axis() {
        let planes = Cursor { planes: true, ..CROSS_HAIR };
        assert_eq!(planes.sample([10.0, 999.0, -999.0], 1.0), RED);
        assert_eq!(planes.sample([999.0, 20.0, -999.0], 1.0), GREEN);
        assert_eq!(planes.sample([9.0, 9.0, 30.0], 1.0), None);
    }

    #[test]
    fn overlap_shows_the_first_axis_or_nothing() {
        let centre = CROSS_HAIR.position;
        assert_eq!(CROSS_HAIR.sample(centre, 1.0), RED);
        assert_eq!(Cursor { enabled: [false, true, true], ..CROSS_HAIR }.sample(centre, 1.0), GREEN);
        let exclusive = Cursor { exclude_overlap: true, ..CROSS_HAIR };
        assert_eq!(exclusive.sample(centre, 1.0), None);
        assert_eq!(exclusive.sample([9.0, 20.0, 30.0], 1.0), RED);
    }

    #[test]
    fn it_goes_with_the_volume_unless_told_otherwise() {
        let centre = CROSS_HAIR.position;
        assert_eq!(CROSS_HAIR.sample(centre, 0.0), None);
        assert_eq!(CROSS_HAIR.sample(centre, 0.01), RED, "all of it, however little is left of the volume");
        assert_eq!(Cursor { disable_crop: true, ..CROSS_HAIR }.sample(centre, 0.0), RED);
    }
}
