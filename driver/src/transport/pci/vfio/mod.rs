//! A card that is bound to vfio-pci.

mod capability;
mod ioctl;
mod memory;

use std::fs::File;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::event::{EventfdFlags, eventfd};
use vfio_bindings::bindings::vfio::{
    VFIO_API_VERSION, VFIO_DEVICE_FLAGS_RESET, VFIO_PCI_CONFIG_REGION_INDEX, VFIO_PCI_MSI_IRQ_INDEX,
    VFIO_PCI_MSIX_IRQ_INDEX,
};
use vg500_regs::pci::{REGISTERS, VECTORS};

use super::find::Found;
use super::function::{BARS, Function, Region, Window, open};
use crate::Error;
use crate::mapping::Mapping;
use crate::pool::Pool;
use crate::transport::HostMemory;
use ioctl::RegionInfo;
use memory::{ALIGNMENT, Container, MappedBuffer};

/// What belongs to this way alone.
#[derive(Debug)]
pub(super) struct Vfio {
    device: Arc<File>,
    /// Whether the system knows how to reset the card.
    resets: bool,
    container: Arc<Container>,
    addresses: Pool,
}

impl Vfio {
    /// Opens a card that is bound to vfio-pci; `root` is the root of the file system.
    pub(super) fn open(root: &Path, found: &Found) -> Result<(Self, Function), Error> {
        let no_iommu = || Error::NoIommu { address: found.address };
        let number = found.group.as_ref().ok_or_else(no_iommu)?;
        let folder = root.join("dev/vfio");
        let container = open(&folder.join("vfio"))?;
        if ioctl::api_version(&container).map_err(asking("VFIO_GET_API_VERSION"))? as u32 != VFIO_API_VERSION
            || !ioctl::has_type1(&container).map_err(asking("VFIO_CHECK_EXTENSION"))?
        {
            return Err(no_iommu());
        }
        let path = folder.join(number);
        let group = open(&path).map_err(|error| match error {
            Error::File { cause, .. } if cause.kind() == io::ErrorKind::ResourceBusy => {
                Error::InUse { address: found.address }
            }
            other => other,
        })?;
        if !ioctl::is_viable(&group).map_err(asking("VFIO_GROUP_GET_STATUS"))? {
            return Err(Error::SharedGroup { group: number.clone() });
        }
        ioctl::set_container(&group, &container).map_err(asking("VFIO_GROUP_SET_CONTAINER"))?;
        ioctl::set_type1(&container).map_err(asking(
            "VFIO_SET_IOMMU (does the IOMMU remap interrupts, as with intremap=on? If not, vfio_iommu_type1 wants \
             allow_unsafe_interrupts)",
        ))?;
        let info = ioctl::iommu_info(&container).map_err(asking("VFIO_IOMMU_GET_INFO"))?;
        let device =
            ioctl::device(&group, &found.address.to_string()).map_err(asking("VFIO_GROUP_GET_DEVICE_FD"))?;
        let mut function = function(&device, &path)?;
        function.reset_methods = Some(found.folder.join("reset_method"));
        let vfio = Self {
            resets: ioctl::device_flags(&device).map_err(asking("VFIO_DEVICE_GET_INFO"))?
                & VFIO_DEVICE_FLAGS_RESET
                != 0,
            device: function.config.file.clone(),
            container: Arc::new(Container::new(container, group)),
            addresses: Pool::new(capability::bus_addresses(&info), ALIGNMENT),
        };
        Ok((vfio, function))
    }

    pub(super) fn host_memory(&self, bytes: usize) -> Result<Box<dyn HostMemory>, Error> {
        Ok(Box::new(MappedBuffer::new(&self.container, &self.addresses, bytes)?))
    }

    /// MSI-X, else MSI, with as many vectors as there are.
    pub(super) fn interrupts(&self) -> Result<Vec<OwnedFd>, Error> {
        for index in [VFIO_PCI_MSIX_IRQ_INDEX, VFIO_PCI_MSI_IRQ_INDEX] {
            let offered =
                ioctl::irq_count(&self.device, index).map_err(asking("VFIO_DEVICE_GET_IRQ_INFO"))?;
            // The system may have fewer vectors than the card; all causes then share the first.
            let counts = [offered.min(VECTORS.into()), offered.min(1)];
            for count in counts.into_iter().filter(|count| *count > 0) {
                let events = events(count)?;
                let descriptors: Vec<_> = events.iter().map(AsFd::as_fd).collect();
                match ioctl::set_irqs(&self.device, index, &descriptors) {
                    Ok(true) => return Ok(events),
                    Ok(false) => tracing::warn!(index, count, "not so many interrupt vectors"),
                    Err(error) => tracing::warn!(index, count, %error, "interrupts cannot be enabled"),
                }
            }
        }
        tracing::warn!("no message-signalled interrupts, the card is polled");
        Ok(Vec::new())
    }

    /// By the system, which uses function-level reset; it keeps the settings in configuration space.
    pub(super) fn reset(&self, function: &Function) -> Result<(), Error> {
        if !self.resets {
            return function.reset_by_register();
        }
        ioctl::reset(&self.device).map_err(asking("VFIO_DEVICE_RESET"))
    }
}

/// The function behind a device descriptor; `path` names it in messages.
fn function(device: &Arc<File>, path: &Path) -> Result<Function, Error> {
    let window = |region: &RegionInfo| Window {
        file: Arc::clone(device),
        path: PathBuf::from(path),
        offset: region.offset,
    };
    let region_info =
        |index| ioctl::region_info(device, index).map_err(asking("VFIO_DEVICE_GET_REGION_INFO"));
    let config = window(&region_info(VFIO_PCI_CONFIG_REGION_INDEX)?);
    let registers = window(&region_info(REGISTERS.index)?);
    let mut bars: [Region; BARS] = Default::default();
    for (index, region) in (0..).zip(&mut bars) {
        let info = region_info(index)?;
        let memory = match info.mappable {
            true => Mapping::of_device(device, info.offset, info.size)
                .map(Some)
                .map_err(|cause| Error::file("mapping a memory of", path, cause))?,
            false => None,
        };
        *region = Region { size: info.size, memory };
    }
    Ok(Function::new(config, Some(registers), bars))
}

fn events(count: u32) -> Result<Vec<OwnedFd>, Error> {
    let event = |_| eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK);
    let events: Result<_, _> = (0..count).map(event).collect();
    events.map_err(|cause| Error::System { what: "making event descriptors", cause: cause.into() })
}

fn asking(what: &'static str) -> impl FnOnce(io::Error) -> Error {
    move |cause| Error::System { what, cause }
}
