//! A card: how it is opened, and what all its parts share.

use core::fmt;
use std::sync::Mutex;
use std::time::Duration;

use vg500_regs::pci::{BARS, Bar, VOXEL_MEMORY, VOXEL_MEMORY_SIZES};
use vg500_regs::table::{cancel, mistakes, status_control, trapped_reads, trapped_writes};
use vg500_regs::{FrameRegisters, SharedView};

use crate::flight::Slots;
use crate::info::{CardInfo, Completion, Identity};
use crate::interrupt::Interrupts;
use crate::plane::PlaneMap;
use crate::pool::Pool;
use crate::promise::Promises;
use crate::status::Status;
use crate::tables::Tables;
use crate::transfer::TRANSFER_WORDS;
use crate::transport::{HostMemory, Transport};
use crate::{Error, lock};

/// The PCI command register.
pub(crate) mod command {
    /// Byte offset in the configuration space.
    pub(crate) const OFFSET: u16 = 4;
    /// The card may reach host memory.
    pub(crate) const BUS_MASTER: u16 = 1 << 2;
    /// Memory space and bus master.
    pub(crate) const ENABLED: u16 = 1 << 1 | BUS_MASTER;
}

/// How long calls wait for frames in their way, unless told otherwise.
const PATIENCE: Duration = Duration::from_secs(60);
/// Volumes begin at multiples of a page.
const VOLUME_ALIGNMENT: u64 = 4096;

/// Accesses that came to the card as messages since the connection began, modulo 2^32, by index of the base
/// address register.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TrappedAccesses {
    /// Reads.
    pub reads: [u32; 6],
    /// Writes.
    pub writes: [u32; 6],
}

/// What changes from frame to frame. Its lock is held while a command is written, so that commands reach the
/// card in the order in which they are noted here.
#[derive(Default)]
pub(crate) struct State {
    /// What the card's frame registers hold.
    pub(crate) shadow: FrameRegisters,
    pub(crate) slots: Slots,
    pub(crate) tables: Tables,
    pub(crate) promises: Promises,
    /// 32-bit base planes that a transfer reads, one bit each.
    pub(crate) transferred: u32,
    /// How often the card was reset, which cancels transfers without a word.
    pub(crate) resets: u32,
    /// What the registers from `TRANSFER_ADDRESS_LOW` on hold, unless that is not known.
    pub(crate) transfer_words: Option<[u32; TRANSFER_WORDS]>,
}

/// An open card. All methods may be called from several threads at once.
///
/// Dropping it cancels what runs. Volumes and base planes keep their places until they are dropped as well.
pub struct Card {
    pub(crate) state: Mutex<State>,
    /// Held during a transfer; the tag of the last one.
    pub(crate) transfers: Mutex<u16>,
    pub(crate) voxel_memory: Pool,
    pub(crate) planes: PlaneMap,
    pub(crate) patience: Duration,
    pub(crate) interrupts: Interrupts,
    pub(crate) status: Status,
    /// Where pixels arrive that are fetched by bus mastering.
    pub(crate) arrivals: Mutex<Option<Box<dyn HostMemory>>>,
    pub(crate) transport: Box<dyn Transport>,
    info: CardInfo,
}

impl Card {
    /// Takes possession of the card: checks what it is, resets it, enables memory and bus mastering, and sets
    /// up interrupts and the copy of its status in host memory.
    ///
    /// Where interrupts or the copy do not work the driver polls, see [`CardInfo::completion`].
    ///
    /// # Errors
    ///
    /// If the device is no VolumePro 500, has another interface, a memory of the wrong size or one that cannot
    /// be mapped, or does not answer.
    pub fn open(transport: Box<dyn Transport>) -> Result<Self, Error> {
        let identity = Identity::read(&*transport)?;
        BARS.into_iter().try_for_each(|bar| check_bar(&*transport, bar))?;
        transport.reset()?;
        enable(&*transport)?;
        let info = CardInfo::read(&*transport, identity)?;
        let size = transport.bar_size(VOXEL_MEMORY.index);
        if info.voxel_memory != size {
            return Err(Error::BarSize { bar: VOXEL_MEMORY, size, expected: info.voxel_memory });
        }
        let interrupts = Interrupts::new(transport.interrupts()?);
        let status = Status::new(&*transport)?;
        status.start(&*transport, interrupts.exist())?;
        Ok(Self {
            state: Mutex::default(),
            transfers: Mutex::default(),
            voxel_memory: Pool::new(0..info.voxel_memory, VOLUME_ALIGNMENT),
            planes: PlaneMap::default(),
            patience: PATIENCE,
            interrupts,
            status,
            arrivals: Mutex::default(),
            transport,
            info,
        })
    }

    /// Sets how long calls wait for frames that are in their way: uploads into a volume that is rendered, tables
    /// whose copies are both in use, transfers. One minute unless set.
    pub fn set_patience(&mut self, patience: Duration) {
        self.patience = patience;
    }

    /// What the card is.
    #[must_use]
    pub fn info(&self) -> &CardInfo {
        &self.info
    }

    /// Which way leads to which card; for people.
    #[must_use]
    pub fn description(&self) -> String {
        self.transport.description()
    }

    /// The way to the card, for programs that test it. What they do there the driver does not know of.
    #[must_use]
    pub fn transport(&self) -> &dyn Transport {
        &*self.transport
    }

    /// Interrupts so far, of each vector; several of a vector that come together may count as one.
    #[must_use]
    pub fn interrupt_counts(&self) -> Vec<u64> {
        self.interrupts.counts()
    }

    /// How the driver learns that a command has ended.
    #[must_use]
    pub fn completion(&self) -> Completion {
        match (self.interrupts.exist(), self.status.copied()) {
            (true, true) => Completion::Interrupt,
            (true, false) => Completion::InterruptAndRegisters,
            (false, true) => Completion::PollCopy,
            (false, false) => Completion::PollRegisters,
        }
    }

    /// Resets the card. Frames and transfers that wait or run are cancelled; mapped memories keep their contents,
    /// volumes and base planes their places.
    ///
    /// # Errors
    ///
    /// If the card does not answer, or does not take its settings.
    pub fn reset(&self) -> Result<(), Error> {
        let mut state = lock(&self.state);
        self.transport.reset()?;
        enable(&*self.transport)?;
        self.status.start(&*self.transport, self.interrupts.exist())?;
        state.shadow = FrameRegisters::default();
        state.tables = Tables::default();
        state.promises = Promises::default();
        state.transfer_words = None;
        state.slots.cancel_all();
        state.resets = state.resets.wrapping_add(1);
        Ok(())
    }

    /// Counts of accesses that came to the card as messages.
    ///
    /// # Errors
    ///
    /// If the card does not answer.
    pub fn trapped_accesses(&self) -> Result<TrappedAccesses, Error> {
        let mut counts = TrappedAccesses::default();
        self.transport.read_registers(trapped_reads::REGISTER.offset, &mut counts.reads)?;
        self.transport.read_registers(trapped_writes::REGISTER.offset, &mut counts.writes)?;
        Ok(counts)
    }

    /// Programming mistakes since the last reset; counted by a card in strict mode only.
    ///
    /// # Errors
    ///
    /// If the card does not answer.
    pub fn mistakes(&self) -> Result<u32, Error> {
        self.transport.read_register(mistakes::REGISTER.offset)
    }

    /// Host memory for [`transfer`](Self::transfer); at least `bytes` bytes.
    ///
    /// # Errors
    ///
    /// If there is not that much, or no way for the card to reach it.
    pub fn host_memory(&self, bytes: usize) -> Result<Box<dyn HostMemory>, Error> {
        if !self.status.copied() {
            return Err(Error::NotSupported { what: "host memory that the card reaches" });
        }
        self.transport.host_memory(bytes)
    }

    /// One of the mapped memories.
    pub(crate) fn memory(&self, bar: Bar) -> Result<SharedView<'_>, Error> {
        self.transport.memory(bar.index).ok_or(Error::BarNotMapped { bar })
    }
}

impl fmt::Debug for Card {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Card").field("info", &self.info).finish_non_exhaustive()
    }
}

impl Drop for Card {
    fn drop(&mut self) {
        // What the card still copies to host memory would meet memory that is gone; a dead card copies nothing.
        self.transport.write_registers(cancel::REGISTER.offset, &[cancel::REGISTER.mask()]).ok();
        self.transport.write_registers(status_control::REGISTER.offset, &[0]).ok();
    }
}

fn check_bar(transport: &dyn Transport, bar: Bar) -> Result<(), Error> {
    let size = transport.bar_size(bar.index);
    let fits = size == bar.size || bar == VOXEL_MEMORY && VOXEL_MEMORY_SIZES.contains(&size);
    if !fits {
        return Err(Error::BarSize { bar, size, expected: bar.size });
    }
    match transport.memory(bar.index) {
        None if bar.mapped => Err(Error::BarNotMapped { bar }),
        _ => Ok(()),
    }
}

/// Lets the card answer accesses and reach host memory.
fn enable(transport: &dyn Transport) -> Result<(), Error> {
    let word = transport.read_config(command::OFFSET)? as u16;
    transport.write_config(command::OFFSET, word | command::ENABLED)?;
    let found = transport.read_config(command::OFFSET)? as u16;
    if found & command::ENABLED != command::ENABLED {
        return Err(Error::Command { expected: command::ENABLED, found, after: "enabling the card" });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
