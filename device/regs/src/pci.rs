//! PCI identity and base address registers.

/// Mitsubishi Electric, as in the public PCI ID lists.
pub const VENDOR_ID: u16 = 0x1067;
/// The second Mitsubishi vendor ID under which the lists know the same device.
pub const ALTERNATE_VENDOR_ID: u16 = 0x10ba;
/// VG500 [VolumePro Volume Rendering Accelerator].
pub const DEVICE_ID: u16 = 0x1002;
/// First revision; the real card's is not known.
pub const REVISION_ID: u8 = 1;
/// Class code (base class, sub-class, interface): multimedia controller, other. The card makes pictures but
/// displays none: a guest that took it for a display controller would try to drive it as one.
pub const CLASS_CODE: u32 = 0x04_80_00;

/// A base address register of the card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bar {
    /// Index of the (first) base address register, which is the vfio region index too.
    pub index: u32,
    /// Name in traces and messages.
    pub name: &'static str,
    /// Size in bytes, a power of two.
    pub size: u64,
    /// Whether the client maps it. A region that is not mapped is trapped: each access is a message.
    pub mapped: bool,
    /// Whether it is a 64-bit prefetchable pair.
    pub wide: bool,
}

/// Registers, with the MSI-X table and pending bits.
pub const REGISTERS: Bar = Bar { index: 0, name: "registers", size: 64 << 10, mapped: false, wide: false };
/// Lookup tables, reflectance maps and gradient-magnitude table, each double-buffered.
pub const TABLE_MEMORY: Bar =
    Bar { index: 1, name: "table memory", size: 64 << 10, mapped: true, wide: false };
/// Voxels; 256 MiB can be selected (see [`VOXEL_MEMORY_SIZES`]).
pub const VOXEL_MEMORY: Bar =
    Bar { index: 2, name: "voxel memory", size: 128 << 20, mapped: true, wide: true };
/// Base planes.
pub const PIXEL_MEMORY: Bar =
    Bar { index: 4, name: "pixel memory", size: 16 << 20, mapped: true, wide: false };
/// Values that travel between sections.
pub const SECTION_MEMORY: Bar =
    Bar { index: 5, name: "section memory", size: 16 << 20, mapped: true, wide: false };

/// All base address registers, by index.
pub const BARS: [Bar; 5] = [REGISTERS, TABLE_MEMORY, VOXEL_MEMORY, PIXEL_MEMORY, SECTION_MEMORY];

/// Sizes of voxel memory that can be selected, in bytes; the first is the card's.
pub const VOXEL_MEMORY_SIZES: [u64; 2] = [128 << 20, 256 << 20];

/// Where the MSI-X table lies in the register BAR.
pub const MSIX_TABLE_OFFSET: u32 = 0x8000;
/// Where the MSI-X pending bits lie in the register BAR.
pub const MSIX_PENDING_OFFSET: u32 = 0xc000;

/// Interrupt vectors. With fewer vectors granted (MSI, INTx) all causes share vector 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Vector {
    /// A frame ended.
    Frame = 0,
    /// A transfer ended.
    Transfer = 1,
    /// A command was refused or failed.
    Fault = 2,
}

/// Number of interrupt vectors.
pub const VECTORS: u16 = 3;
