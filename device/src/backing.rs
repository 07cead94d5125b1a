//! Memory of the card that the client maps: a sealed memfd and the device's own mapping of it.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::ptr::NonNull;

use memmap2::{MmapOptions, MmapRaw};
use rustix::fs::{
    FallocateFlags, MemfdFlags, SealFlags, fallocate, fcntl_add_seals, ftruncate, memfd_create,
};
use rustix::io::Errno;
use vg500_regs::SharedView;

/// Memory shared between the device and its client.
///
/// The file is sealed against changes of its size: a client that has the descriptor cannot shorten it under
/// the device's mapping, which would end the process with `SIGBUS`.
#[derive(Debug)]
pub struct Backing {
    file: OwnedFd,
    memory: MmapRaw,
}

impl Backing {
    /// Zeroed memory of `size` bytes; `name` appears in `/proc/PID/maps`.
    ///
    /// # Errors
    ///
    /// If the system has no memory, address space or descriptors left, or `size` is 0.
    pub fn new(name: &str, size: u64) -> io::Result<Self> {
        if size == 0 {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, format!("{name}: memory of no bytes")));
        }
        let file = memory_file(name)?;
        ftruncate(&file, size)?;
        fcntl_add_seals(&file, SealFlags::SHRINK | SealFlags::GROW | SealFlags::SEAL)?;
        let length = usize::try_from(size).map_err(|_| io::ErrorKind::OutOfMemory)?;
        let memory = MmapOptions::new().len(length).map_raw(&file)?;
        Ok(Self { file, memory })
    }

    /// Size in bytes.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.memory.len() as u64
    }

    /// Access to the bytes, which the client may change at any time.
    #[must_use]
    pub fn view(&self) -> SharedView<'_> {
        let start = NonNull::new(self.memory.as_mut_ptr()).unwrap_or(NonNull::dangling());
        // SAFETY: the mapping is readable and writable, lives as long as `self`, and its file cannot shrink;
        // nothing in this process makes references to it. A mapping never starts at null.
        unsafe { SharedView::new(start, self.memory.len()) }
    }

    /// Sets all bytes to zero, and gives the pages back to the system.
    ///
    /// # Errors
    ///
    /// If the system refuses to punch the hole.
    pub fn clear(&self) -> io::Result<()> {
        let flags = FallocateFlags::PUNCH_HOLE | FallocateFlags::KEEP_SIZE;
        Ok(fallocate(&self.file, flags, 0, self.size())?)
    }
}

/// A file that is never a program: hardened systems give no other. Kernels before 6.3 do not know of it.
fn memory_file(name: &str) -> io::Result<OwnedFd> {
    let flags = MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING;
    match memfd_create(name, flags | MemfdFlags::NOEXEC_SEAL) {
        Err(Errno::INVAL) => Ok(memfd_create(name, flags)?),
        result => Ok(result?),
    }
}

impl AsFd for Backing {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_memory_of_no_bytes() {
        assert!(Backing::new("empty", 0).is_err());
    }

    #[test]
    fn its_size_cannot_be_changed_by_who_has_the_descriptor() {
        let backing = Backing::new("sealed", 8192).unwrap();
        let client = backing.as_fd().try_clone_to_owned().unwrap();
        assert!(ftruncate(&client, 4096).is_err());
        assert!(ftruncate(&client, 16384).is_err());
    }

    #[test]
    fn it_is_no_program() {
        use std::os::unix::fs::PermissionsExt;
        let backing = Backing::new("data", 4096).unwrap();
        let file = std::fs::File::from(backing.as_fd().try_clone_to_owned().unwrap());
        let execute = std::fs::Permissions::from_mode(0o777);
        // Older kernels do not know the flag, and let every file be marked as one.
        let offered = memfd_create("probe", MemfdFlags::NOEXEC_SEAL).is_ok();
        assert_eq!(file.set_permissions(execute).is_err(), offered);
    }

    #[test]
    fn both_sides_see_the_same_bytes_and_clearing_zeroes_them() {
        let backing = Backing::new("shared", 8192).unwrap();
        assert_eq!(backing.size(), 8192);
        backing.view().write(4095, &[1, 2]).unwrap();
        let mut seen = [0; 2];
        rustix::io::pread(&backing, &mut seen, 4095).unwrap();
        assert_eq!(seen, [1, 2]);
        backing.clear().unwrap();
        backing.view().read(4095, &mut seen).unwrap();
        assert_eq!(seen, [0, 0]);
    }
}
