//! The card as a vfio-user server behind a socket.

use std::os::fd::{AsRawFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use rustix::event::{EventfdFlags, eventfd};
use vfio_user::Client;
use vg500_regs::SharedView;
use vg500_regs::pci::{REGISTERS, VECTORS};

use super::link::Link;
pub use super::private_socket::PrivateSocket;
use super::shared_buffer::SharedBuffer;
use super::{HostMemory, Transport};
use crate::Error;
use crate::card::command;
use crate::interrupt;
use crate::mapping::Mapping;
use crate::pool::Pool;

/// How long to wait for an answer unless told otherwise, as long as QEMU waits.
pub const MESSAGE_TIMEOUT: Duration = Duration::from_secs(5);

/// Region of the PCI configuration space, as VFIO numbers them; those before are base address registers.
const CONFIG: u32 = 7;
const BARS: u32 = 6;

/// Indices and flags of interrupts, as VFIO numbers them.
const MSI: u32 = 1;
const MSIX: u32 = 2;
const DATA_NONE: u32 = 1 << 0;
const DATA_EVENTFD: u32 = 1 << 2;
const ACTION_TRIGGER: u32 = 1 << 5;

/// Where host memory appears on the bus: above 4 GiB, so that both halves of addresses count.
const BUS_ADDRESSES: std::ops::Range<u64> = 1 << 32..1 << 39;
const PAGE: u64 = 4096;

#[derive(Debug, Default)]
struct Region {
    size: u64,
    memory: Option<Mapping>,
}

/// A connection to a vfio-user server.
///
/// The protocol client does not tell whether the server refused a request. What the request was for is looked
/// at instead: interrupts by a loop-back, resets in the configuration space, and mappings of host memory by
/// [`Card::open`](crate::Card::open), which waits for the status block there.
#[derive(Debug)]
pub struct VfioUser {
    path: PathBuf,
    link: Arc<Link>,
    bars: Vec<Region>,
    addresses: Pool,
}

impl VfioUser {
    /// Connects to the server that listens at `path`, and maps what it offers. No call lasts longer than
    /// `timeout`, see [`MESSAGE_TIMEOUT`].
    ///
    /// # Errors
    ///
    /// [`Error::Connect`] if there is no server, it does not answer, or it does not speak the protocol.
    pub fn connect(path: &Path, timeout: Duration) -> Result<Self, Error> {
        let link = Link::connect(path, timeout)?;
        let bars = link.call("mapping the card's memories", |client| {
            Ok((0..BARS).map(|index| region(client, index)).collect())
        })?;
        Ok(Self {
            path: path.to_owned(),
            link: Arc::new(link),
            bars,
            addresses: Pool::new(BUS_ADDRESSES, PAGE),
        })
    }

    fn read(&self, what: &'static str, region: u32, offset: u64, bytes: usize) -> Result<Vec<u8>, Error> {
        self.link.call(what, move |client| {
            let mut data = vec![0; bytes];
            client.region_read(region, offset, &mut data)?;
            Ok(data)
        })
    }

    /// One event descriptor for each vector of a kind of interrupt.
    fn attach(&self, index: u32, vectors: u32) -> Result<Vec<OwnedFd>, Error> {
        let events: Vec<_> = (0..vectors).map(|vector| self.attach_vector(index, vector)).collect();
        events.into_iter().collect()
    }

    fn attach_vector(&self, index: u32, vector: u32) -> Result<OwnedFd, Error> {
        let system = |cause| Error::System { what: "making an event descriptor", cause };
        let event =
            eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK).map_err(|it| system(it.into()))?;
        let sent = event.try_clone().map_err(system)?;
        self.link.call("SET_IRQS", move |client| {
            client.set_irqs(index, DATA_EVENTFD | ACTION_TRIGGER, vector, 1, &[sent.as_raw_fd()])
        })?;
        Ok(event)
    }

    /// Whether the server signals a vector's descriptor when it is asked to.
    fn loops_back(&self, index: u32, vector: u32, event: &OwnedFd) -> Result<bool, Error> {
        self.link.call("SET_IRQS", move |client| {
            client.set_irqs(index, DATA_NONE | ACTION_TRIGGER, vector, 1, &[])
        })?;
        interrupt::wait_for_any(std::slice::from_ref(event), Duration::from_secs(1));
        Ok(interrupt::take(event) > 0)
    }
}

impl Transport for VfioUser {
    fn read_config(&self, offset: u16) -> Result<u32, Error> {
        let bytes = self.read("reading configuration space", CONFIG, u64::from(offset), 4)?;
        Ok(words(&bytes).next().unwrap_or(u32::MAX))
    }

    fn write_config(&self, offset: u16, word: u16) -> Result<(), Error> {
        self.link.call("writing configuration space", move |client| {
            client.region_write(CONFIG, u64::from(offset), &word.to_le_bytes())
        })
    }

    fn bar_size(&self, index: u32) -> u64 {
        self.bars.get(index as usize).map_or(0, |region| region.size)
    }

    fn memory(&self, index: u32) -> Option<SharedView<'_>> {
        Some(self.bars.get(index as usize)?.memory.as_ref()?.view())
    }

    fn read_registers(&self, offset: u32, registers: &mut [u32]) -> Result<(), Error> {
        let bytes =
            self.read("reading registers", REGISTERS.index, u64::from(offset), registers.len() * 4)?;
        registers.iter_mut().zip(words(&bytes)).for_each(|(register, word)| *register = word);
        Ok(())
    }

    fn write_registers(&self, offset: u32, registers: &[u32]) -> Result<(), Error> {
        let bytes: Vec<u8> = registers.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.link.call("writing registers", move |client| {
            client.region_write(REGISTERS.index, u64::from(offset), &bytes)
        })
    }

    fn bursts(&self) -> bool {
        true
    }

    fn host_memory(&self, bytes: usize) -> Result<Box<dyn HostMemory>, Error> {
        Ok(Box::new(SharedBuffer::new(&self.link, &self.addresses, bytes)?))
    }

    fn interrupts(&self) -> Result<Vec<OwnedFd>, Error> {
        for index in [MSIX, MSI] {
            let offered = self.link.call("GET_IRQ_INFO", move |client| client.get_irq_info(index))?.count;
            if offered == 0 {
                continue;
            }
            let events = self.attach(index, offered.min(u32::from(VECTORS)))?;
            for (vector, event) in (0..).zip(&events) {
                if !self.loops_back(index, vector, event)? {
                    tracing::warn!(index, vector, "interrupt does not arrive, the card is polled");
                    return Ok(Vec::new());
                }
            }
            return Ok(events);
        }
        Ok(Vec::new())
    }

    fn description(&self) -> String {
        format!("vfio-user {}", self.path.display())
    }

    fn reset(&self) -> Result<(), Error> {
        self.link.call("DEVICE_RESET", Client::reset)?;
        match self.read_config(command::OFFSET)? as u16 & command::ENABLED {
            0 => Ok(()),
            found => Err(Error::Command { expected: 0, found, after: "reset" }),
        }
    }
}

/// What the server says about a region. One that cannot be mapped is none to be mapped.
fn region(client: &Client, index: u32) -> Region {
    let Some(region) = client.region(index) else { return Region::default() };
    let whole = region.sparse_areas.is_empty()
        || region.sparse_areas.iter().any(|area| area.offset == 0 && area.size == region.size);
    let memory = region.file_offset.as_ref().filter(|_| whole).and_then(|file| {
        Mapping::new(file.file(), file.start(), region.size)
            .inspect_err(|error| tracing::warn!(index, %error, "region cannot be mapped"))
            .ok()
    });
    Region { size: region.size, memory }
}

fn words(bytes: &[u8]) -> impl Iterator<Item = u32> {
    bytes.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes))
}

#[cfg(test)]
mod tests;
