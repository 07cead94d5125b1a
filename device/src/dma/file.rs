//! A client's file, which holds memory that the device may reach.

use std::fs::File;
use std::os::fd::OwnedFd;
use std::ptr::NonNull;
use std::sync::Once;

use memmap2::{MmapOptions, MmapRaw};
use rustix::fs::{FileType, OFlags, SealFlags, fcntl_get_seals, fcntl_getfl, fstat};
use rustix::io::{Errno, pread, pwrite};
use vg500_regs::SharedView;

use super::MAX_REGION_SIZE;

/// What tells one file from another, and a writable mapping of it from a read-only one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct FileId {
    device: u64,
    inode: u64,
    write: bool,
}

/// A descriptor that has been looked at.
#[derive(Debug)]
pub(super) struct OpenFile {
    pub(super) id: FileId,
    pub(super) size: u64,
    file: OwnedFd,
}

impl OpenFile {
    /// Looks at a descriptor; `write` says whether it will be written.
    ///
    /// # Errors
    ///
    /// `EINVAL` if it is not a regular file (a memfd is one), `EACCES` if its mode forbids the accesses.
    pub(super) fn new(file: OwnedFd, write: bool) -> Result<Self, Errno> {
        let status = fstat(&file)?;
        if FileType::from_raw_mode(status.st_mode) != FileType::RegularFile {
            return Err(Errno::INVAL);
        }
        let mode = fcntl_getfl(&file)? & OFlags::RWMODE;
        if mode == OFlags::WRONLY || (write && mode == OFlags::RDONLY) {
            return Err(Errno::ACCESS);
        }
        let size = u64::try_from(status.st_size).map_err(|_| Errno::INVAL)?;
        Ok(Self { id: FileId { device: status.st_dev, inode: status.st_ino, write }, size, file })
    }
}

/// A client's file, whole, as the device reads and writes it.
#[derive(Debug)]
pub(super) struct FileMemory {
    pub(super) size: u64,
    means: Means,
}

#[derive(Debug)]
enum Means {
    /// The file is sealed against shrinking.
    Mapping(MmapRaw),
    /// The client could shorten the file at any time, and touching a mapping past its end would end the
    /// process with `SIGBUS`; system calls only fail. They serve files that cannot be mapped, too.
    Calls(File),
}

impl FileMemory {
    pub(super) fn new(open: OpenFile) -> Self {
        let sealed = fcntl_get_seals(&open.file).is_ok_and(|seals| seals.contains(SealFlags::SHRINK));
        let mapping = sealed.then(|| map(&open)).flatten();
        let means = mapping.map_or_else(|| Means::Calls(File::from(open.file)), Means::Mapping);
        if let Means::Calls(_) = means {
            // Once: clients decide how often it happens.
            static TOLD: Once = Once::new();
            TOLD.call_once(|| {
                tracing::warn!("client memory is not a sealed memfd: accesses are system calls")
            });
        }
        Self { size: open.size, means }
    }

    /// Copies bytes at `offset` of the file.
    pub(super) fn read(&self, offset: u64, data: &mut [u8]) -> Result<(), Errno> {
        match &self.means {
            Means::Mapping(mapping) => {
                let offset = usize::try_from(offset).map_err(|_| Errno::FAULT)?;
                view(mapping).read(offset, data).map_err(|_| Errno::FAULT)
            }
            Means::Calls(file) => whole(data.len(), |done| {
                let rest = data.get_mut(done..).unwrap_or_default();
                pread(file, rest, offset.saturating_add(done as u64))
            }),
        }
    }

    /// Copies bytes to `offset` of the file. An aligned word of 4 or 8 bytes is written in one access.
    pub(super) fn write(&self, offset: u64, data: &[u8]) -> Result<(), Errno> {
        match &self.means {
            Means::Mapping(mapping) => {
                let offset = usize::try_from(offset).map_err(|_| Errno::FAULT)?;
                let view = view(mapping);
                match *data {
                    [a, b, c, d] => view.write_u32(offset, u32::from_le_bytes([a, b, c, d])),
                    _ => view.write(offset, data),
                }
                .map_err(|_| Errno::FAULT)
            }
            Means::Calls(file) => whole(data.len(), |done| {
                let rest = data.get(done..).unwrap_or_default();
                pwrite(file, rest, offset.saturating_add(done as u64))
            }),
        }
    }
}

/// Repeats a system call until it has moved `length` bytes.
fn whole(length: usize, mut call: impl FnMut(usize) -> Result<usize, Errno>) -> Result<(), Errno> {
    let mut done = 0;
    while done < length {
        match call(done) {
            Ok(0) => return Err(Errno::FAULT),
            Ok(moved) => done += moved,
            Err(Errno::INTR) => {}
            Err(errno) => return Err(errno),
        }
    }
    Ok(())
}

/// Maps the whole file, if the system can, and if it is not so large that a few of them fill the address space.
fn map(open: &OpenFile) -> Option<MmapRaw> {
    if open.size > MAX_REGION_SIZE {
        return None;
    }
    let mut options = MmapOptions::new();
    options.len(usize::try_from(open.size).ok()?);
    if open.id.write { options.map_raw(&open.file) } else { options.map_raw_read_only(&open.file) }.ok()
}

/// The mapped bytes. The caller writes only where it asked for a writable mapping.
fn view(mapping: &MmapRaw) -> SharedView<'_> {
    let start = NonNull::new(mapping.as_mut_ptr()).unwrap_or(NonNull::dangling());
    // SAFETY: the mapping stays for its borrow, cannot shrink, and no reference to its bytes exists. A
    // read-only one is never written: `DmaTable` checks each region's access, which chose the mapping.
    unsafe { SharedView::new(start, mapping.len()) }
}
