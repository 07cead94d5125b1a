//! The requests of `linux/vfio.h`, each as a safe function. Structures are those of the vfio-bindings crate.

use std::fs::File;
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, FromRawFd, OwnedFd, RawFd};
use std::sync::Arc;

use rustix::ioctl::{Ioctl, IoctlOutput, Opcode, ioctl, opcode};
use vfio_bindings::bindings::vfio::*;

use super::capability;

/// Offsets from `VFIO_BASE`, by the order of the requests in `linux/vfio.h`.
mod request {
    pub(super) const GET_API_VERSION: u32 = 0;
    pub(super) const CHECK_EXTENSION: u32 = 1;
    pub(super) const SET_IOMMU: u32 = 2;
    pub(super) const GROUP_GET_STATUS: u32 = 3;
    pub(super) const GROUP_SET_CONTAINER: u32 = 4;
    pub(super) const GROUP_GET_DEVICE_FD: u32 = 6;
    pub(super) const DEVICE_GET_INFO: u32 = 7;
    pub(super) const DEVICE_GET_REGION_INFO: u32 = 8;
    pub(super) const DEVICE_GET_IRQ_INFO: u32 = 9;
    pub(super) const DEVICE_SET_IRQS: u32 = 10;
    pub(super) const DEVICE_RESET: u32 = 11;
    pub(super) const IOMMU_GET_INFO: u32 = 12;
    pub(super) const IOMMU_MAP_DMA: u32 = 13;
    pub(super) const IOMMU_UNMAP_DMA: u32 = 14;
}

/// What a region is, as far as the driver cares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RegionInfo {
    pub(super) size: u64,
    /// Where it begins in the device's file.
    pub(super) offset: u64,
    /// Whether all of it can be mapped.
    pub(super) mappable: bool,
}

/// A request with its argument, a number or a pointer.
struct Request {
    number: u32,
    argument: *mut rustix::ffi::c_void,
}

// SAFETY: the opcode is that of the request's number, which `call`'s callers match with its argument; the result
// is the plain return value.
unsafe impl Ioctl for Request {
    type Output = IoctlOutput;

    const IS_MUTATING: bool = true;

    fn opcode(&self) -> Opcode {
        opcode::none(VFIO_TYPE, (VFIO_BASE + self.number) as u8)
    }

    fn as_ptr(&mut self) -> *mut rustix::ffi::c_void {
        self.argument
    }

    unsafe fn output_from_ptr(
        out: IoctlOutput,
        _: *mut rustix::ffi::c_void,
    ) -> rustix::io::Result<IoctlOutput> {
        Ok(out)
    }
}

/// Makes a request whose argument is a number.
///
/// # Safety
///
/// The request takes a number, not an address.
unsafe fn with_number(file: &File, number: u32, argument: usize) -> io::Result<i32> {
    let request = Request { number, argument: std::ptr::without_provenance_mut(argument) };
    // SAFETY: the kernel does not dereference a number, which it takes the argument for, as the caller promises.
    Ok(unsafe { ioctl(file, request)? })
}

/// Makes a request about a structure.
///
/// # Safety
///
/// The request takes a `T`, and what a variable part of it says about its size is true.
unsafe fn with<T: ?Sized>(file: &File, number: u32, argument: &mut T) -> io::Result<i32> {
    let request = Request { number, argument: std::ptr::from_mut(argument).cast() };
    // SAFETY: the argument lives until the call ends, and is what the request takes, as the caller promises.
    Ok(unsafe { ioctl(file, request)? })
}

const fn size<T>() -> u32 {
    size_of::<T>() as u32
}

pub(super) fn api_version(container: &File) -> io::Result<i32> {
    // SAFETY: the request takes no argument.
    unsafe { with_number(container, request::GET_API_VERSION, 0) }
}

/// Whether there is an IOMMU of type 1.
pub(super) fn has_type1(container: &File) -> io::Result<bool> {
    // SAFETY: the request takes a number.
    Ok(unsafe { with_number(container, request::CHECK_EXTENSION, VFIO_TYPE1v2_IOMMU as usize)? } > 0)
}

pub(super) fn set_type1(container: &File) -> io::Result<()> {
    // SAFETY: the request takes a number.
    unsafe { with_number(container, request::SET_IOMMU, VFIO_TYPE1v2_IOMMU as usize) }.map(drop)
}

/// Whether all devices of a group are in the hands of vfio-pci, or of no driver.
pub(super) fn is_viable(group: &File) -> io::Result<bool> {
    let mut status = vfio_group_status { argsz: size::<vfio_group_status>(), flags: 0 };
    // SAFETY: the request takes this structure.
    unsafe { with(group, request::GROUP_GET_STATUS, &mut status)? };
    Ok(status.flags & VFIO_GROUP_FLAGS_VIABLE != 0)
}

pub(super) fn set_container(group: &File, container: &File) -> io::Result<()> {
    let mut descriptor: RawFd = container.as_raw_fd();
    // SAFETY: the request takes an integer.
    unsafe { with(group, request::GROUP_SET_CONTAINER, &mut descriptor) }.map(drop)
}

/// The device of a group by its name, which is its PCI address.
pub(super) fn device(group: &File, name: &str) -> io::Result<Arc<File>> {
    let mut name: Vec<u8> = name.bytes().chain([0]).collect();
    // SAFETY: the request takes a string that ends with zero.
    let descriptor = unsafe { with(group, request::GROUP_GET_DEVICE_FD, name.as_mut_slice())? };
    // SAFETY: the request returned a new descriptor that nobody else has.
    let device = unsafe { OwnedFd::from_raw_fd(descriptor) };
    Ok(Arc::new(File::from(device)))
}

pub(super) fn device_flags(device: &File) -> io::Result<u32> {
    let mut info = vfio_device_info { argsz: size::<vfio_device_info>(), ..Default::default() };
    // SAFETY: the request takes this structure.
    unsafe { with(device, request::DEVICE_GET_INFO, &mut info)? };
    Ok(info.flags)
}

/// What a region is.
pub(super) fn region_info(device: &File, index: u32) -> io::Result<RegionInfo> {
    // First for the size of the answer with its capabilities, then for the answer.
    let mut info = vfio_region_info { argsz: size::<vfio_region_info>(), index, ..Default::default() };
    // SAFETY: the request takes this structure.
    unsafe { with(device, request::DEVICE_GET_REGION_INFO, &mut info)? };
    let mut words = words_for(info.argsz);
    words[1] = u64::from(index);
    // SAFETY: the request takes a `vfio_region_info` with capabilities behind it; the words are as long as its
    // first member says, and aligned for it.
    unsafe { with(device, request::DEVICE_GET_REGION_INFO, words.as_mut_slice())? };
    let bytes = bytes_of(&words);
    // Parts of the BAR apart from the others, because the rest may not be mapped.
    let chain = capability::u32_at(&bytes, std::mem::offset_of!(vfio_region_info, cap_offset));
    let sparse = info.flags & VFIO_REGION_INFO_FLAG_CAPS != 0
        && chain
            .and_then(|first| capability::find(&bytes, first, VFIO_REGION_INFO_CAP_SPARSE_MMAP as u16))
            .is_some();
    let mappable = info.flags & VFIO_REGION_INFO_FLAG_MMAP != 0 && info.size > 0 && !sparse;
    Ok(RegionInfo { size: info.size, offset: info.offset, mappable })
}

/// Number of vectors of a kind of interrupt.
pub(super) fn irq_count(device: &File, index: u32) -> io::Result<u32> {
    let mut info = vfio_irq_info { argsz: size::<vfio_irq_info>(), index, ..Default::default() };
    // SAFETY: the request takes this structure.
    unsafe { with(device, request::DEVICE_GET_IRQ_INFO, &mut info)? };
    Ok(info.count)
}

/// Has the vectors of a kind of interrupt, from the first on, signal event descriptors. Returns false if there are
/// not so many.
pub(super) fn set_irqs(device: &File, index: u32, events: &[BorrowedFd<'_>]) -> io::Result<bool> {
    let flags = VFIO_IRQ_SET_DATA_EVENTFD | VFIO_IRQ_SET_ACTION_TRIGGER;
    let header = [0, flags, index, 0, events.len() as u32];
    let mut words: Vec<u32> =
        header.into_iter().chain(events.iter().map(|event| event.as_fd().as_raw_fd() as u32)).collect();
    words[0] = 4 * words.len() as u32;
    // SAFETY: the request takes a `vfio_irq_set`, five words, and as many descriptors as its count says.
    let left = unsafe { with(device, request::DEVICE_SET_IRQS, words.as_mut_slice())? };
    Ok(left == 0)
}

pub(super) fn reset(device: &File) -> io::Result<()> {
    // SAFETY: the request takes no argument.
    unsafe { with_number(device, request::DEVICE_RESET, 0) }.map(drop)
}

/// A `vfio_iommu_type1_info` with its capabilities, as bytes.
pub(super) fn iommu_info(container: &File) -> io::Result<Vec<u8>> {
    let mut info = vfio_iommu_type1_info { argsz: size::<vfio_iommu_type1_info>(), ..Default::default() };
    // SAFETY: the request takes this structure.
    unsafe { with(container, request::IOMMU_GET_INFO, &mut info)? };
    let mut words = words_for(info.argsz);
    // SAFETY: the request takes a `vfio_iommu_type1_info` with capabilities behind it; the words are as long as its
    // first member says, and aligned for it.
    unsafe { with(container, request::IOMMU_GET_INFO, words.as_mut_slice())? };
    Ok(bytes_of(&words))
}

/// Lets devices reach `size` bytes at `start` of this process by bus address `address`. The kernel keeps the
/// pages until they are unmapped, whatever becomes of `start`.
pub(super) fn map_dma(container: &File, start: u64, address: u64, size: u64) -> io::Result<()> {
    let mut map = vfio_iommu_type1_dma_map {
        argsz: self::size::<vfio_iommu_type1_dma_map>(),
        flags: VFIO_DMA_MAP_FLAG_READ | VFIO_DMA_MAP_FLAG_WRITE,
        vaddr: start,
        iova: address,
        size,
    };
    // SAFETY: the request takes this structure.
    unsafe { with(container, request::IOMMU_MAP_DMA, &mut map) }.map(drop)
}

pub(super) fn unmap_dma(container: &File, address: u64, size: u64) -> io::Result<()> {
    let mut unmap = vfio_iommu_type1_dma_unmap {
        argsz: self::size::<vfio_iommu_type1_dma_unmap>(),
        iova: address,
        size,
        ..Default::default()
    };
    // SAFETY: the request takes this structure.
    unsafe { with(container, request::IOMMU_UNMAP_DMA, &mut unmap) }.map(drop)
}

/// Words for an answer of `bytes` bytes, at least four of them and at most 64 KiB; zero but for the first, whose
/// lower half is their length, `argsz`.
fn words_for(bytes: u32) -> Vec<u64> {
    let mut words = vec![0; (bytes as usize).clamp(32, 1 << 16).div_ceil(8)];
    words[0] = 8 * words.len() as u64;
    words
}

fn bytes_of(words: &[u64]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_ne_bytes()).collect()
}
