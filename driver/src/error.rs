//! What can go wrong, and where.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use vg500_regs::Fault;
use vg500_regs::memory::Table;
use vg500_regs::pci::Bar;
use vg500_regs::shared::OutOfRange;

use crate::transport::PciAddress;

/// Everything that the driver reports. Messages are one line and name what and where.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The card does not answer, or what it answered cannot be understood. Every later call gives this at once.
    #[error("the card is dead: {reason}")]
    CardDead {
        /// What was asked of the card, and what happened.
        reason: String,
    },
    /// No card could be reached.
    #[error("cannot connect to the card at {}: {cause}", path.display())]
    Connect {
        /// The socket.
        path: PathBuf,
        /// What happened.
        cause: String,
    },
    /// What should be the address of a PCI function is none.
    #[error("PCI address '{text}' is none of 0000:00:05.0, 00:05.0, auto")]
    PciAddress {
        /// What it is.
        text: String,
    },
    /// There is no card among the PCI functions.
    #[error("no VolumePro 500 (1067:1002 or 10ba:1002) among the PCI devices in {}", folder.display())]
    NoCard {
        /// Where PCI functions are listed.
        folder: PathBuf,
    },
    /// Nothing is at a PCI address.
    #[error("no PCI device at {address} in {}", folder.display())]
    NoPciDevice {
        /// Where the card should be.
        address: PciAddress,
        /// Where PCI functions are listed.
        folder: PathBuf,
    },
    /// A driver of the kernel has the card.
    #[error("the card at {address} is bound to driver {driver}: unbind it, or bind it to vfio-pci")]
    OtherDriver {
        /// Where the card is.
        address: PciAddress,
        /// The driver's name.
        driver: String,
    },
    /// vfio-pci has the card, but nothing translates its addresses.
    #[error(
        "no IOMMU for the card at {address}: start the machine with one (intel_iommu=on), or unbind vfio-pci"
    )]
    NoIommu {
        /// Where the card is.
        address: PciAddress,
    },
    /// Other functions that the IOMMU cannot tell from the card are in use by the kernel.
    #[error("IOMMU group {group} of the card has other devices: bind them to vfio-pci, too, or unbind them")]
    SharedGroup {
        /// The group's number.
        group: String,
    },
    /// Another process has opened the card.
    #[error("the card at {address} is in use by another process")]
    InUse {
        /// Where the card is.
        address: PciAddress,
    },
    /// The card's status does not arrive in host memory.
    #[error(
        "the card does not reach host memory within {timeout:?}: in a virtual machine, guest memory must be \
         shared with the device (memory-backend-memfd with share=on)"
    )]
    HostMemoryUnreached {
        /// How long the driver waited.
        timeout: Duration,
    },
    /// A file could not be used.
    #[error("{what} {}: {cause}", path.display())]
    File {
        /// What the driver was doing.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's answer.
        cause: io::Error,
    },
    /// The operating system refused something.
    #[error("{what}: {cause}")]
    System {
        /// What the driver was doing.
        what: &'static str,
        /// The system's answer.
        cause: io::Error,
    },
    /// The transport has no such thing.
    #[error("this way to the card has no {what}")]
    NotSupported {
        /// What is missing.
        what: &'static str,
    },

    /// The PCI device is something else.
    #[error("PCI device {vendor:04x}:{device:04x} is no VolumePro 500 (1067:1002 or 10ba:1002)")]
    Identity {
        /// PCI vendor ID.
        vendor: u16,
        /// PCI device ID.
        device: u16,
    },
    /// The card has another programming interface.
    #[error("the card has programming interface {major}.{minor}, this driver knows {known}.x")]
    Version {
        /// The card's major version.
        major: u16,
        /// The card's minor version.
        minor: u16,
        /// The driver's major version.
        known: u16,
    },
    /// A base address register has another size than the card's.
    #[error("BAR {} ({}) has {size:#x} bytes, not {expected:#x}", bar.index, bar.name)]
    BarSize {
        /// Which one.
        bar: Bar,
        /// Its size in bytes.
        size: u64,
        /// What it should be.
        expected: u64,
    },
    /// A memory of the card cannot be mapped into this process.
    #[error("BAR {} ({}) is not mapped into this process", bar.index, bar.name)]
    BarNotMapped {
        /// Which one.
        bar: Bar,
    },
    /// The card did not take a value in its configuration space.
    #[error("the PCI command register holds {found:#06x} instead of {expected:#06x} after {after}")]
    Command {
        /// What it should hold, as far as the driver cares.
        expected: u16,
        /// What it holds.
        found: u16,
        /// What the driver had done.
        after: &'static str,
    },

    /// Voxel memory has no free piece that is large enough.
    #[error("out of board memory: {wanted} bytes wanted, the largest free piece has {largest}")]
    OutOfBoardMemory {
        /// Bytes wanted, padding included.
        wanted: u64,
        /// Bytes of the largest free piece.
        largest: u64,
    },
    /// There are no bus addresses left for that much host memory.
    #[error("out of bus addresses: {wanted} bytes of host memory wanted, {largest} free in one piece")]
    OutOfBusAddresses {
        /// Bytes wanted.
        wanted: u64,
        /// Bytes of the largest free piece.
        largest: u64,
    },
    /// A volume that voxel memory cannot store, whatever is free.
    #[error("a volume of {}x{}x{} voxels cannot be stored (1..={} per axis)", dimensions[0], dimensions[1],
            dimensions[2], vg500_regs::limit::VOXEL_PITCH)]
    Dimensions {
        /// Voxels along x, y, z.
        dimensions: [u32; 3],
    },
    /// A slab that does not lie inside its volume.
    #[error("slab {origin}..{origin}+{size} along {} lies outside of a volume of {dimension} voxels",
            ["x", "y", "z"][*axis % 3])]
    SlabOutside {
        /// Axis, 0..=2.
        axis: usize,
        /// First voxel.
        origin: u32,
        /// Number of voxels.
        size: u32,
        /// Voxels of the volume.
        dimension: u32,
    },
    /// A block that is too large for one frame.
    #[error("a frame renders at most {} voxels per axis, not {}x{}x{}", vg500_regs::limit::VOLUME_SIZE,
            size[0], size[1], size[2])]
    BlockSize {
        /// Voxels along x, y, z.
        size: [u32; 3],
    },
    /// The number of voxels is not that of the slab.
    #[error("the slab has {expected} voxels, the buffer {found}")]
    VoxelCount {
        /// Voxels of the slab.
        expected: u64,
        /// Voxels of the buffer.
        found: u64,
    },
    /// Voxels of the buffer have another size than those of the volume.
    #[error("the volume has {expected} bytes per voxel, the buffer {found}")]
    VoxelBytes {
        /// Bytes per voxel in voxel memory.
        expected: usize,
        /// Bytes per voxel in the buffer.
        found: usize,
    },

    /// A table entry with more bits than the table has.
    #[error("entry {entry} of the {} is {value}, at most {most} fits", table.name())]
    TableEntry {
        /// Which table.
        table: Table,
        /// Which entry.
        entry: usize,
        /// Its value.
        value: u32,
        /// The largest possible value.
        most: u32,
    },

    /// All base planes are in use.
    #[error("no base plane of {bytes} bytes per ray is free")]
    NoPlane {
        /// Bytes per ray.
        bytes: usize,
    },
    /// A frame or transfer on the base plane has not ended, so it cannot be used.
    #[error("base plane {plane} of {bytes} bytes per ray is in use by an earlier command")]
    PlaneBusy {
        /// Its number among those of its format.
        plane: u32,
        /// Bytes per ray.
        bytes: usize,
    },
    /// A volume or base plane of another card.
    #[error("the {what} belongs to another card")]
    OtherCard {
        /// Volume or base plane.
        what: &'static str,
    },
    /// A rectangle that does not lie inside a base plane.
    #[error(
        "rectangle {width}x{height} at ({column}, {row}) lies outside of a base plane of {0}x{0} rays",
        vg500_regs::limit::BASE_PLANE_SIZE
    )]
    RectangleOutside {
        /// First column.
        column: u32,
        /// First row.
        row: u32,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A transfer that does not fit into its buffer in host memory.
    #[error(
        "{rows} rows of {bytes} bytes, {pitch} apart, at byte {offset} do not fit into {size} bytes of host \
             memory"
    )]
    TransferOutside {
        /// Bytes per row.
        bytes: usize,
        /// Number of rows.
        rows: u32,
        /// Bytes from one row to the next.
        pitch: u32,
        /// First byte.
        offset: usize,
        /// Bytes of the buffer.
        size: usize,
    },

    /// A frame description with bits outside of all fields.
    #[error("reserved bits {bits:#x} of {register} are set")]
    ReservedBits {
        /// Name of the register.
        register: &'static str,
        /// The bits.
        bits: u32,
    },
    /// A frame description with a word where the card has no register.
    #[error("there is no frame register at {offset:#x}")]
    NoRegister {
        /// Byte offset in the register BAR.
        offset: u32,
    },
    /// The card refused, failed or cancelled a command.
    #[error("{what}: {fault}")]
    Refused {
        /// Which command.
        what: String,
        /// Why, and which field of which register is to blame.
        fault: Fault,
    },
    /// Something did not end in time. The frame or transfer whose end was waited for has been cancelled.
    #[error("{what} has not ended within {timeout:?}")]
    Timeout {
        /// What did not end.
        what: String,
        /// How long the driver waited.
        timeout: Duration,
    },
    /// A frame still runs.
    #[error("{what} has not ended yet")]
    NotEnded {
        /// Which frame.
        what: String,
    },
    /// A command ignored its cancellation. Only [`Card::reset`](crate::Card::reset) may help.
    #[error("{what} does not end although it was cancelled")]
    Stuck {
        /// Which command.
        what: String,
    },
    /// The frame ended, and a later one has been submitted on its base plane since.
    #[error(
        "what became of a frame is no longer known: base plane {place} has been rendered again, or the card \
             reset, since"
    )]
    StaleTicket {
        /// The first 32-bit base plane that the frame covers.
        place: u32,
    },
    /// An access outside of a memory; a defect of the driver.
    #[error(transparent)]
    Outside(#[from] OutOfRange),
}

impl Error {
    /// A file could not be used.
    pub(crate) fn file(what: &'static str, path: &Path, cause: io::Error) -> Self {
        Self::File { what, path: path.to_owned(), cause }
    }
}
