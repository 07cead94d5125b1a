//! Accesses to regions: `REGION_READ`, `REGION_WRITE`, `REGION_WRITE_MULTI`.

use rustix::io::Errno;

use super::Session;
use crate::protocol::wire::{Append, Fields};
use crate::protocol::{Device, MAX_TRANSFER, Region};

/// An access as its message describes it, and as the reply repeats it.
struct Access {
    offset: u64,
    region: u32,
    count: u32,
}

/// A checked place in a region.
struct Place {
    region: usize,
    offset: u64,
    length: usize,
}

impl Access {
    fn parse(fields: &mut Fields<'_>) -> Result<Self, Errno> {
        Ok(Self { offset: fields.u64()?, region: fields.u32()?, count: fields.u32()? })
    }

    /// Checks that the access is not too large and lies inside its region.
    fn place(
        &self,
        find: impl FnOnce(usize) -> Region,
        allowed: fn(&Region) -> bool,
    ) -> Result<Place, Errno> {
        let index = usize::try_from(self.region).map_err(|_| Errno::INVAL)?;
        let length = usize::try_from(self.count).map_err(|_| Errno::INVAL)?;
        let region = find(index);
        let end = self.offset.checked_add(u64::from(self.count));
        let inside = end.is_some_and(|end| end <= region.size);
        if length > MAX_TRANSFER || region.size == 0 || !inside {
            return Err(Errno::INVAL);
        }
        if !allowed(&region) {
            return Err(Errno::PERM);
        }
        Ok(Place { region: index, offset: self.offset, length })
    }

    fn append(&self, reply: &mut Vec<u8>) {
        reply.u64(self.offset);
        reply.u32(self.region);
        reply.u32(self.count);
    }
}

impl<D: Device> Session<'_, D> {
    pub(super) fn region_read(&mut self, mut fields: Fields<'_>, reply: &mut Vec<u8>) -> Result<(), Errno> {
        let access = Access::parse(&mut fields)?;
        let place = access.place(|index| self.region(index), |region| region.read)?;
        access.append(reply);
        let data = reply.len();
        reply.resize(data + place.length, 0);
        self.device.read(place.region, place.offset, reply.get_mut(data..).unwrap_or_default())
    }

    pub(super) fn region_write(&mut self, mut fields: Fields<'_>, reply: &mut Vec<u8>) -> Result<(), Errno> {
        let access = Access::parse(&mut fields)?;
        let place = access.place(|index| self.region(index), |region| region.write)?;
        // What follows is the data, all of it.
        if fields.0.len() != place.length {
            return Err(Errno::INVAL);
        }
        self.device.write(place.region, place.offset, fields.0)?;
        access.append(reply);
        Ok(())
    }

    /// Several writes of at most eight bytes. The first that fails ends them.
    pub(super) fn region_write_multi(
        &mut self,
        mut fields: Fields<'_>,
        reply: &mut Vec<u8>,
    ) -> Result<(), Errno> {
        let writes = fields.u64()?;
        for _ in 0..writes {
            let access = Access::parse(&mut fields)?;
            let data = fields.bytes(8)?;
            let place = access.place(|index| self.region(index), |region| region.write)?;
            let data = data.get(..place.length).ok_or(Errno::INVAL)?;
            self.device.write(place.region, place.offset, data)?;
        }
        reply.u64(writes);
        Ok(())
    }
}
