//! Permuted coordinates: which object axis, in which direction, each axis of the traversal follows.

/// One permuted axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PermutedAxis {
    /// Object axis, 0..=2.
    pub axis: usize,
    /// Whether the traversal runs from the high end of the object axis to its low end.
    pub flipped: bool,
}

/// The permutation matrix P of the paper (section 2) with its signs: one of 48.
///
/// Permuted coordinate `a` of a point is the object coordinate `axes[a].axis`, measured from the high end of
/// the volume if `axes[a].flipped`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Permutation {
    axes: [PermutedAxis; 3],
}

impl Permutation {
    /// Object axes in their own order and direction.
    pub const IDENTITY: Self = Self {
        axes: [
            PermutedAxis { axis: 0, flipped: false },
            PermutedAxis { axis: 1, flipped: false },
            PermutedAxis { axis: 2, flipped: false },
        ],
    };

    /// The permutation with these axes, or `None` unless each object axis stands in it once.
    #[must_use]
    pub fn new(axes: [PermutedAxis; 3]) -> Option<Self> {
        let mut seen = [false; 3];
        for permuted in axes {
            let place = seen.get_mut(permuted.axis)?;
            if core::mem::replace(place, true) {
                return None;
            }
        }
        Some(Self { axes })
    }

    /// The three permuted axes: x, y and z.
    #[must_use]
    pub const fn axes(&self) -> [PermutedAxis; 3] {
        self.axes
    }

    /// All 48 permutations.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..0x1000).filter_map(Self::from_word)
    }

    /// The permutation of a register word: four bits per permuted axis (x lowest), of which bits 1..0 are the
    /// object axis, bit 2 the flip and bit 3 is reserved.
    #[must_use]
    pub fn from_word(word: u32) -> Option<Self> {
        if word & !0x777 != 0 {
            return None;
        }
        Self::new([0, 4, 8].map(|shift| {
            let nibble = word >> shift;
            PermutedAxis { axis: (nibble & 3) as usize, flipped: nibble & 4 != 0 }
        }))
    }

    /// The register word of the permutation.
    #[must_use]
    pub const fn to_word(&self) -> u32 {
        let mut word = 0;
        let mut place = 0;
        while place < 3 {
            let permuted = self.axes[place];
            word |= ((permuted.axis as u32) | ((permuted.flipped as u32) << 2)) << (4 * place);
            place += 1;
        }
        word
    }

    /// Object sizes in permuted order.
    #[must_use]
    pub fn permuted<T: Copy>(&self, object: [T; 3]) -> [T; 3] {
        self.axes.map(|permuted| object[permuted.axis])
    }

    /// Permuted coordinates as object coordinates; `last` are the object's highest coordinates.
    #[must_use]
    pub fn to_object<T: Copy + core::ops::Sub<Output = T>>(&self, permuted: [T; 3], last: [T; 3]) -> [T; 3] {
        let mut object = last;
        for (value, place) in permuted.into_iter().zip(self.axes) {
            object[place.axis] = if place.flipped { last[place.axis] - value } else { value };
        }
        object
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_48_and_each_word_comes_back() {
        let all: Vec<_> = Permutation::all().collect();
        assert_eq!(all.len(), 48);
        for permutation in all {
            assert_eq!(Permutation::from_word(permutation.to_word()), Some(permutation));
        }
    }

    #[test]
    fn repeated_axes_and_reserved_bits_are_refused() {
        for word in [0x000, 0x211, 0x213, 0x8210, 0x1210, 0x218] {
            assert_eq!(Permutation::from_word(word), None, "{word:#x}");
        }
        assert_eq!(Permutation::from_word(0x210), Some(Permutation::IDENTITY));
    }

    #[test]
    fn points_go_to_object_space_and_back() {
        let permutation = Permutation::from_word(0x016).unwrap(); // x = -z, y = y, z = x
        assert_eq!(permutation.to_object([1, 2, 3], [10, 20, 30]), [3, 2, 29]);
        assert_eq!(permutation.permuted([10, 20, 30]), [30, 20, 10]);
    }
}
