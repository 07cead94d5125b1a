//! Memory that this process shares with others.

use std::fs::File;
use std::io;
use std::ptr::NonNull;

use memmap2::{MmapOptions, MmapRaw};
use vg500_regs::SharedView;

/// Bytes of a huge page.
pub(crate) const HUGE_PAGE: usize = 2 << 20;

/// A mapped range of a file or device, or anonymous memory.
#[derive(Debug)]
pub(crate) struct Mapping(MmapRaw);

impl Mapping {
    /// Maps `size` bytes at `offset` of a file. A file that ends before them is refused: touching what it lacks
    /// would end the process.
    pub(crate) fn new(file: &File, offset: u64, size: u64) -> io::Result<Self> {
        let end = offset.checked_add(size).ok_or(io::ErrorKind::InvalidInput)?;
        if size == 0 || file.metadata()?.len() < end {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let length = usize::try_from(size).map_err(|_| io::ErrorKind::OutOfMemory)?;
        MmapOptions::new().offset(offset).len(length).map_raw(file).map(Self)
    }

    /// Maps `size` bytes at `offset` of a device, which vouches for the range.
    pub(crate) fn of_device(device: &File, offset: u64, size: u64) -> io::Result<Self> {
        let length = usize::try_from(size).map_err(|_| io::ErrorKind::OutOfMemory)?;
        MmapOptions::new().offset(offset).len(length).map_raw(device).map(Self)
    }

    /// Memory of this process, zeroed and present; of huge pages if asked for, then a multiple of [`HUGE_PAGE`].
    pub(crate) fn anonymous(size: usize, huge: bool) -> io::Result<Self> {
        let mut options = MmapOptions::new();
        options.len(size).populate();
        if huge {
            options.huge(Some(HUGE_PAGE.trailing_zeros() as u8));
        }
        options.map_anon().map(|memory| Self(memory.into()))
    }

    /// Access to the bytes.
    pub(crate) fn view(&self) -> SharedView<'_> {
        let start = NonNull::new(self.0.as_mut_ptr()).unwrap_or(NonNull::dangling());
        // SAFETY: the range is mapped readable and writable as long as `self` lives, is backed, and
        // nothing makes references to it. A mapping never starts at null.
        unsafe { SharedView::new(start, self.0.len()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_outside_of_the_file_are_refused() {
        let file = tempfile::tempfile().unwrap();
        file.set_len(8192).unwrap();
        assert!(Mapping::new(&file, 0, 0).is_err());
        assert!(Mapping::new(&file, 4096, 8192).is_err());
        assert!(Mapping::new(&file, u64::MAX - 4095, 8192).is_err());
        assert_eq!(Mapping::new(&file, 4096, 4096).unwrap().view().size(), 4096);
    }
}
