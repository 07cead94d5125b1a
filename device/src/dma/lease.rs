//! Transfers: memory held for them, and how they are cut into pieces.

use std::ops::Range;
use std::sync::Arc;

use rustix::io::Errno;

use super::region::Region;
use super::{Direction, DmaError, DmaTable, last_byte};

/// Bytes copied between two looks at whether the memory is still there.
const PIECE: usize = 64 << 10;

/// Memory held for a transfer. Dropping it lets go.
#[derive(Debug)]
pub struct Lease {
    pub(super) dma: Arc<DmaTable>,
    pub(super) iova: u64,
    pub(super) length: u64,
    pub(super) direction: Direction,
    /// By IOVA, without gaps.
    pub(super) regions: Vec<Arc<Region>>,
}

impl Lease {
    /// Bytes leased.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Reads `data.len()` bytes at `offset` of the lease.
    ///
    /// # Errors
    ///
    /// [`DmaError`], among them that the memory has been taken away, or that the access leaves the lease.
    pub fn read(&self, offset: u64, data: &mut [u8]) -> Result<(), DmaError> {
        let iova = self.at(offset, data.len(), Direction::Read)?;
        transfer(self, Direction::Read, iova, data.len(), |region, iova, piece| {
            region.read(iova, data.get_mut(piece).unwrap_or_default())
        })
    }

    /// Writes `data` at `offset` of the lease.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read).
    pub fn write(&self, offset: u64, data: &[u8]) -> Result<(), DmaError> {
        let iova = self.at(offset, data.len(), Direction::Write)?;
        transfer(self, Direction::Write, iova, data.len(), |region, iova, piece| {
            region.write(iova, data.get(piece).unwrap_or_default())
        })
    }

    /// The IOVA of an access that lies inside the lease.
    fn at(&self, offset: u64, length: usize, direction: Direction) -> Result<u64, DmaError> {
        let iova = self.iova.saturating_add(offset);
        if direction != self.direction {
            return Err(DmaError::NotAllowed { iova, direction });
        }
        let inside = offset.checked_add(length as u64).is_some_and(|end| end <= self.length);
        inside.then_some(iova).ok_or(DmaError::NotMapped { iova: self.iova.saturating_add(self.length) })
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        self.regions.iter().for_each(|region| region.end_lease());
    }
}

/// Where a transfer finds its regions: in the table, or among those it has leased.
pub(super) trait Regions {
    fn table(&self) -> &DmaTable;
    fn region(&self, iova: u64) -> Option<Arc<Region>>;
}

impl Regions for DmaTable {
    fn table(&self) -> &DmaTable {
        self
    }

    fn region(&self, iova: u64) -> Option<Arc<Region>> {
        self.lock().find(iova)
    }
}

impl Regions for Lease {
    fn table(&self) -> &DmaTable {
        &self.dma
    }

    fn region(&self, iova: u64) -> Option<Arc<Region>> {
        let after = self.regions.partition_point(|region| region.base <= iova);
        self.regions.get(after.checked_sub(1)?).filter(|region| region.contains(iova)).cloned()
    }
}

/// Cuts `length` bytes at `iova` into pieces that lie inside one region, and copies each.
pub(super) fn transfer(
    regions: &impl Regions,
    direction: Direction,
    iova: u64,
    length: usize,
    mut copy: impl FnMut(&Region, u64, Range<usize>) -> Result<(), Errno>,
) -> Result<(), DmaError> {
    if length > 0 && last_byte(iova, length as u64).is_none() {
        return Err(DmaError::Wraps { iova, length: length as u64 });
    }
    let mut done = 0;
    while done < length {
        let iova = iova + done as u64;
        regions.table().check_enabled()?;
        let region = regions.region(iova).ok_or(DmaError::NotMapped { iova })?;
        if !region.allows(direction) {
            return Err(DmaError::NotAllowed { iova, direction });
        }
        let left_in_region = usize::try_from(region.last - iova).unwrap_or(usize::MAX).saturating_add(1);
        let piece = left_in_region.min(length - done).min(PIECE);
        let _gate = region.enter(iova)?;
        // Again, because whoever takes the memory away waits for those inside the gate only.
        regions.table().check_enabled()?;
        copy(&region, iova, done..done + piece).map_err(|errno| DmaError::Failed { iova, errno })?;
        done += piece;
    }
    Ok(())
}
