//! Host memory for a card whose addresses nothing translates: huge pages, whose physical addresses the kernel
//! tells.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use vg500_regs::SharedView;

use crate::mapping::{HUGE_PAGE, Mapping};
use crate::transport::HostMemory;
use crate::{Error, lock};

/// Bytes of a page, and of its entry in `pagemap`.
const PAGE: usize = 4096;
const ENTRY: usize = 8;
/// Bits of an entry: page frame number, and whether the page is in memory.
const FRAME: u64 = (1 << 55) - 1;
const PRESENT: u64 = 1 << 63;

/// Consecutive huge pages and the physical address of the first.
#[derive(Debug)]
struct Pages {
    memory: Mapping,
    address: u64,
}

/// Pages that no buffer uses. They are not given back to the system as long as the card may write: a copy or
/// transfer that is under way would meet somebody else's memory.
#[derive(Debug, Default)]
pub(super) struct HugePages {
    free: Mutex<Vec<Pages>>,
}

/// A buffer of huge pages.
struct Buffer {
    pages: Option<Pages>,
    pool: Arc<HugePages>,
}

impl HugePages {
    /// At least `bytes` bytes at consecutive physical addresses; [`Error::NotSupported`] if the system has none.
    pub(super) fn allocate(self: &Arc<Self>, bytes: usize) -> Result<Box<dyn HostMemory>, Error> {
        let size = bytes.max(1).checked_next_multiple_of(HUGE_PAGE);
        let size = size.ok_or(Error::NotSupported { what: "host memory of that size" })?;
        let mut free = lock(&self.free);
        let kept = free.iter().position(|pages| pages.memory.view().size() == size);
        let pages = match kept {
            Some(index) => free.swap_remove(index),
            None => Pages::new(size, Path::new("/proc/self/pagemap"))?,
        };
        pages.memory.view().clear(0, size)?;
        Ok(Box::new(Buffer { pages: Some(pages), pool: Arc::clone(self) }))
    }
}

impl Pages {
    fn new(size: usize, pagemap: &Path) -> Result<Self, Error> {
        let none = Error::NotSupported { what: "host memory: no huge pages (vm.nr_hugepages)" };
        let memory = Mapping::anonymous(size, true).map_err(|_| none)?;
        let start = memory.view().start().as_ptr().addr();
        let address = consecutive(pagemap, start, size)?;
        Ok(Self { memory, address })
    }
}

/// The physical address of `size` bytes at `start`, if their huge pages follow one another.
fn consecutive(pagemap: &Path, start: usize, size: usize) -> Result<u64, Error> {
    let file = File::open(pagemap).map_err(|cause| Error::file("opening", pagemap, cause))?;
    let addresses: Vec<u64> = (start..start + size)
        .step_by(HUGE_PAGE)
        .map(|place| physical(&file, place, pagemap.to_owned()))
        .collect::<Result<_, _>>()?;
    let follow = addresses.windows(2).all(|pair| pair[1] == pair[0] + HUGE_PAGE as u64);
    match addresses.first() {
        Some(first) if follow => Ok(*first),
        _ => Err(Error::NotSupported { what: "host memory: its huge pages do not follow one another" }),
    }
}

/// The physical address of the page at `place`.
fn physical(pagemap: &File, place: usize, path: PathBuf) -> Result<u64, Error> {
    let mut entry = [0; ENTRY];
    pagemap.read_exact_at(&mut entry, (place / PAGE * ENTRY) as u64).map_err(|cause| Error::File {
        what: "reading",
        path,
        cause,
    })?;
    let entry = u64::from_le_bytes(entry);
    // The kernel hides frame numbers, as zero, from processes without CAP_SYS_ADMIN.
    match entry & FRAME {
        frame if frame != 0 && entry & PRESENT != 0 => Ok(frame * PAGE as u64),
        _ => Err(Error::NotSupported { what: "host memory: physical addresses are hidden (CAP_SYS_ADMIN)" }),
    }
}

impl HostMemory for Buffer {
    fn bus_address(&self) -> u64 {
        self.pages.as_ref().map_or(0, |pages| pages.address)
    }

    fn view(&self) -> SharedView<'_> {
        self.pages.as_ref().map_or_else(|| SharedView::of(&mut []), |pages| pages.memory.view())
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        lock(&self.pool.free).extend(self.pages.take());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: usize = 4 * HUGE_PAGE;

    /// A `pagemap` with an entry for each huge page from `START` on.
    fn pagemap(entries: &[u64]) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        for (place, entry) in (START..).step_by(HUGE_PAGE).zip(entries) {
            file.as_file().write_all_at(&entry.to_le_bytes(), (place / PAGE * ENTRY) as u64).unwrap();
        }
        file
    }

    fn refused(entries: &[u64]) -> String {
        consecutive(pagemap(entries).path(), START, entries.len() * HUGE_PAGE).unwrap_err().to_string()
    }

    #[test]
    fn hidden_absent_and_scattered_pages_are_refused() {
        assert!(refused(&[PRESENT]).contains("physical addresses are hidden"));
        assert!(refused(&[0x200]).contains("hidden"), "a page that is not present has no address");
        assert!(refused(&[PRESENT | 0x400, PRESENT | 0x800]).contains("do not follow one another"));
        assert!(refused(&[PRESENT | 0x400, PRESENT | 0x200]).contains("do not follow one another"));
        let short = pagemap(&[]);
        assert!(matches!(consecutive(short.path(), START, 1), Err(Error::File { .. })));
        assert!(consecutive(Path::new("/nonexistent"), START, 1).is_err());
    }

    #[test]
    fn frames_become_addresses() {
        let soft_dirty = 1 << 55;
        let entries = [PRESENT | soft_dirty | 0x12_3400, PRESENT | 0x12_3600];
        assert_eq!(consecutive(pagemap(&entries).path(), START, 2 * HUGE_PAGE).unwrap(), 0x1_2340_0000);
    }

    #[test]
    fn pages_are_kept_for_the_next_buffer() {
        let pool = Arc::new(HugePages::default());
        let memory = Mapping::anonymous(HUGE_PAGE, false).unwrap();
        memory.view().write(5, b"old").unwrap();
        lock(&pool.free).push(Pages { memory, address: 0x20_0000 });
        let buffer = pool.allocate(1).unwrap();
        assert_eq!(buffer.bus_address(), 0x20_0000);
        assert_eq!(buffer.view().read_u32(4).unwrap(), 0, "a buffer begins as zeros");
        assert!(lock(&pool.free).is_empty());
        drop(buffer);
        assert_eq!(lock(&pool.free).len(), 1);
    }
}
