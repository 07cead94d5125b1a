//! The promise that voxel memory has not changed since the last frame of a volume.

use std::ops::Range;

use vg500_regs::table::{volume_base, volume_format, volume_pitch, volume_size_xy, volume_size_z};
use vg500_regs::{FrameRegisters, VoxelFormat};

/// Volumes that are remembered at most; of the others no promise is made.
const REMEMBERED: usize = 64;

/// A volume as a frame is told of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct BoundVolume {
    words: [u32; 5],
    /// Bytes of voxel memory that it covers.
    pub(crate) voxels: Range<u64>,
}

impl BoundVolume {
    /// The volume of a frame, as it is: the card refuses what is wrong.
    pub(crate) fn of(registers: &FrameRegisters) -> Self {
        let words = [
            volume_base::REGISTER,
            volume_format::REGISTER,
            volume_size_xy::REGISTER,
            volume_size_z::REGISTER,
            volume_pitch::REGISTER,
        ]
        .map(|register| registers.word(register));
        let get = |field| u64::from(registers.get(field));
        let bytes =
            VoxelFormat::from_code(registers.get(volume_format::FORMAT)).map_or(2, VoxelFormat::bytes);
        let slices = (get(volume_size_z::Z) * get(volume_pitch::ROWS)).max(get(volume_size_xy::Y));
        let size = (slices * get(volume_pitch::ROW)).max(get(volume_size_xy::X)) * bytes as u64;
        let base = get(volume_base::OFFSET);
        Self { words, voxels: base..base + size }
    }
}

/// Volumes whose voxels have not changed since they were last rendered.
#[derive(Debug, Default)]
pub(crate) struct Promises(Vec<BoundVolume>);

impl Promises {
    /// Whether the promise holds for a volume.
    pub(crate) fn hold_for(&self, volume: &BoundVolume) -> bool {
        self.0.contains(volume)
    }

    /// The volume is being rendered.
    pub(crate) fn rendered(&mut self, volume: BoundVolume) {
        if !self.hold_for(&volume) {
            if self.0.len() == REMEMBERED {
                self.0.remove(0);
            }
            self.0.push(volume);
        }
    }

    /// Bytes of voxel memory change.
    pub(crate) fn changed(&mut self, voxels: &Range<u64>) {
        self.0.retain(|volume| !overlap(&volume.voxels, voxels));
    }
}

/// Whether two ranges have anything in common.
pub(crate) fn overlap(a: &Range<u64>, b: &Range<u64>) -> bool {
    a.start < b.end && b.start < a.end
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(base: u32) -> BoundVolume {
        let mut registers = FrameRegisters::default();
        registers.set(volume_base::OFFSET, base);
        registers.set(volume_format::FORMAT, VoxelFormat::Uint8 as u32);
        registers.set(volume_size_xy::X, 30);
        registers.set(volume_size_xy::Y, 20);
        registers.set(volume_size_z::Z, 10);
        registers.set(volume_pitch::ROW, 32);
        registers.set(volume_pitch::ROWS, 64);
        BoundVolume::of(&registers)
    }

    #[test]
    fn a_change_of_any_byte_breaks_the_promise_of_that_volume_alone() {
        let (first, second) = (volume(0), volume(1 << 20));
        assert_eq!(first.voxels, 0..32 * 64 * 10);
        for byte in [1 << 20, (1 << 20) + 32 * 64 * 10 - 1] {
            let mut promises = Promises::default();
            assert!(!promises.hold_for(&first));
            promises.rendered(first.clone());
            promises.rendered(second.clone());
            promises.changed(&(byte..byte + 1));
            assert!(promises.hold_for(&first) && !promises.hold_for(&second));
            promises.changed(&(first.voxels.end..1 << 20));
            assert!(promises.hold_for(&first));
        }
    }

    #[test]
    fn memory_is_bounded() {
        let mut promises = Promises::default();
        (0..200).for_each(|base| promises.rendered(volume(base)));
        assert_eq!(promises.0.len(), REMEMBERED);
        assert!(promises.hold_for(&volume(199)) && !promises.hold_for(&volume(0)));
    }
}
