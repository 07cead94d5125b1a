//! The MSI-X table as a client finds it in the register window.

/// Bytes of one entry: address, data, vector control.
const ENTRY: usize = 16;
/// Where the vector control word of an entry lies.
const CONTROL: usize = 12;

/// The MSI-X table.
///
/// It is storage. A VMM keeps the guest's table itself and never shows it to the device; what the device
/// signals, and whether, is decided by event descriptors and `SET_IRQS`. A client that reads back what it wrote
/// finds it here.
#[derive(Debug)]
pub struct MsixTable(Vec<u8>);

impl MsixTable {
    /// A table of `vectors` entries, as after reset: all masked.
    #[must_use]
    pub fn new(vectors: u16) -> Self {
        let mut table = Self(vec![0; usize::from(vectors) * ENTRY]);
        table.reset();
        table
    }

    /// Size in bytes.
    #[must_use]
    pub fn size(&self) -> usize {
        self.0.len()
    }

    /// Back to all entries zero and masked.
    pub fn reset(&mut self) {
        for (at, byte) in self.0.iter_mut().enumerate() {
            *byte = u8::from(at % ENTRY == CONTROL);
        }
    }

    /// Reads bytes at `offset` of the table; past its end they are zero.
    pub fn read(&self, offset: usize, data: &mut [u8]) {
        let stored = self.0.get(offset..).unwrap_or_default();
        data.fill(0);
        data.iter_mut().zip(stored).for_each(|(byte, stored)| *byte = *stored);
    }

    /// Writes bytes at `offset` of the table. Of vector control only the mask bit can be written; past the end
    /// of the table nothing.
    pub fn write(&mut self, offset: usize, data: &[u8]) {
        for ((at, stored), new) in self.0.iter_mut().enumerate().skip(offset).zip(data) {
            let mask = match at % ENTRY {
                // Messages go to aligned addresses.
                0 => 0xfc,
                CONTROL => 1,
                13.. => 0,
                _ => 0xff,
            };
            *stored = new & mask;
        }
    }
}
