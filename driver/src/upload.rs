//! Voxels between this process and voxel memory, through the mapping.

use vg500_regs::SharedView;
use vg500_regs::pci::VOXEL_MEMORY;
use vg500_regs::shared::OutOfRange;

use crate::promise::overlap;
use crate::{BoardVolume, Card, Error, Slab, lock};

/// A voxel in this process: 8 bits, or 16 bits as the volume's format stores them.
pub trait Voxel: Copy + sealed::Copied {}

impl Voxel for u8 {}
impl Voxel for u16 {}

mod sealed {
    use super::{OutOfRange, SharedView};

    pub trait Copied: Sized {
        fn store(memory: SharedView<'_>, offset: usize, voxels: &[Self]) -> Result<(), OutOfRange>;
        fn load(memory: SharedView<'_>, offset: usize, voxels: &mut [Self]) -> Result<(), OutOfRange>;
    }

    impl Copied for u8 {
        fn store(memory: SharedView<'_>, offset: usize, voxels: &[Self]) -> Result<(), OutOfRange> {
            memory.write(offset, voxels)
        }
        fn load(memory: SharedView<'_>, offset: usize, voxels: &mut [Self]) -> Result<(), OutOfRange> {
            memory.read(offset, voxels)
        }
    }

    impl Copied for u16 {
        fn store(memory: SharedView<'_>, offset: usize, voxels: &[Self]) -> Result<(), OutOfRange> {
            memory.write_u16(offset, voxels)
        }
        fn load(memory: SharedView<'_>, offset: usize, voxels: &mut [Self]) -> Result<(), OutOfRange> {
            memory.read_u16(offset, voxels)
        }
    }
}

impl Card {
    /// Copies dense voxels, x fastest, then y, then z, into a slab of a volume. Frames that read it are waited
    /// for first; the padding stays as it is.
    ///
    /// # Errors
    ///
    /// [`Error::SlabOutside`], [`Error::VoxelCount`], [`Error::VoxelBytes`], [`Error::OtherCard`];
    /// [`Error::Timeout`] if a frame that reads the slab does not end in the time of
    /// [`set_patience`](Self::set_patience); a dead card.
    pub fn upload<V: Voxel>(&self, volume: &BoardVolume, slab: &Slab, voxels: &[V]) -> Result<(), Error> {
        let runs = self.runs::<V>(volume, slab, voxels.len())?;
        let memory = self.memory(VOXEL_MEMORY)?;
        self.voxels_change(volume, slab)?;
        for (offset, run) in runs.offsets().zip(voxels.chunks_exact(runs.voxels)) {
            V::store(memory, offset, run)?;
        }
        // A frame that was submitted meanwhile has seen some old and some new voxels.
        lock(&self.state).promises.changed(&volume.bytes_of(slab));
        Ok(())
    }

    /// Copies a slab of a volume into dense voxels.
    ///
    /// # Errors
    ///
    /// [`Error::SlabOutside`], [`Error::VoxelCount`], [`Error::VoxelBytes`], or [`Error::OtherCard`].
    pub fn download<V: Voxel>(
        &self,
        volume: &BoardVolume,
        slab: &Slab,
        voxels: &mut [V],
    ) -> Result<(), Error> {
        let runs = self.runs::<V>(volume, slab, voxels.len())?;
        let memory = self.memory(VOXEL_MEMORY)?;
        for (offset, run) in runs.offsets().zip(voxels.chunks_exact_mut(runs.voxels)) {
            V::load(memory, offset, run)?;
        }
        Ok(())
    }

    /// All of voxel memory as it is mapped, for callers that work on voxels where they lie: see
    /// [`BoardVolume::offset`] and [`BoardVolume::pitch`]. Before and after they write, they call
    /// [`voxels_change`](Self::voxels_change).
    ///
    /// # Errors
    ///
    /// None for an open card.
    pub fn voxel_memory(&self) -> Result<SharedView<'_>, Error> {
        self.memory(VOXEL_MEMORY)
    }

    /// Waits for the frames that read a slab, and has the card look at its voxels anew in the next one.
    ///
    /// # Errors
    ///
    /// [`Error::SlabOutside`], [`Error::OtherCard`]; [`Error::Timeout`] if a frame that reads the slab does not
    /// end in the time of [`set_patience`](Self::set_patience); a dead card.
    pub fn voxels_change(&self, volume: &BoardVolume, slab: &Slab) -> Result<(), Error> {
        self.check_volume(volume, slab)?;
        let voxels = volume.bytes_of(slab);
        let unread = self.poll_until(self.patience, |source| {
            let mut guard = lock(&self.state);
            let state = &mut *guard;
            self.retire(&mut state.slots, &mut state.promises, source)?;
            if state.slots.flights().any(|flight| overlap(&flight.voxels, &voxels)) {
                return Ok(None);
            }
            state.promises.changed(&voxels);
            Ok(Some(()))
        })?;
        unread.ok_or_else(|| Error::Timeout {
            what: "a frame that reads the voxels".into(),
            timeout: self.patience,
        })
    }

    fn check_volume(&self, volume: &BoardVolume, slab: &Slab) -> Result<(), Error> {
        if !self.voxel_memory.owns(&volume.piece) {
            return Err(Error::OtherCard { what: "volume" });
        }
        volume.check(slab)
    }

    /// How `count` voxels in this process lie in a slab.
    fn runs<'a, V: Voxel>(
        &self,
        volume: &'a BoardVolume,
        slab: &'a Slab,
        count: usize,
    ) -> Result<Runs<'a>, Error> {
        self.check_volume(volume, slab)?;
        if volume.format().bytes() != size_of::<V>() {
            return Err(Error::VoxelBytes { expected: volume.format().bytes(), found: size_of::<V>() });
        }
        let expected = slab.size.iter().map(|&size| u64::from(size)).product();
        if count as u64 != expected {
            return Err(Error::VoxelCount { expected, found: count as u64 });
        }
        Ok(Runs::new(volume, slab))
    }
}

/// The runs of voxels of a slab that lie one after another: rows, or slices or all of it where no padding comes
/// in between.
struct Runs<'a> {
    volume: &'a BoardVolume,
    slab: &'a Slab,
    /// Voxels of a run.
    voxels: usize,
    /// Runs per slice, and slices that begin a run.
    counts: [u32; 2],
}

impl<'a> Runs<'a> {
    fn new(volume: &'a BoardVolume, slab: &'a Slab) -> Self {
        let [x, y, z] = slab.size;
        let [row, rows] = volume.pitch();
        let (lengths, counts) = match (x == row, y == rows) {
            (false, _) => ([x, 1, 1], [y, z]),
            (true, false) => ([x, y, 1], [1, z]),
            (true, true) => ([x, y, z], [1, 1]),
        };
        let voxels = lengths.into_iter().map(|length| length as usize).product();
        Self { volume, slab, voxels, counts }
    }

    /// Byte offsets of the runs in voxel memory.
    fn offsets(&self) -> impl Iterator<Item = usize> {
        let [x, y, z] = self.slab.origin;
        let [rows, slices] = self.counts;
        (z..z + slices)
            .flat_map(move |z| (y..y + rows).map(move |y| [x, y, z]))
            .map(|voxel| self.volume.byte_offset(voxel) as usize)
    }
}

#[cfg(test)]
mod tests;
