//! A way to the card that measures the accesses to registers.

use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use vg500_regs::SharedView;
use volumepro_driver::{Error, HostMemory, PciCard, Transport};

/// A PCI card whose register accesses are counted and timed.
pub struct Metered {
    card: PciCard,
    meter: Arc<Meter>,
}

/// What was measured so far. Accesses that are made at the same time count each.
#[derive(Debug, Default)]
pub struct Meter {
    accesses: AtomicU64,
    nanoseconds: AtomicU64,
}

impl Meter {
    /// Number of accesses, and time in them.
    pub fn read(&self) -> (u64, Duration) {
        (self.accesses.load(Relaxed), Duration::from_nanos(self.nanoseconds.load(Relaxed)))
    }

    fn measure<T>(&self, accesses: usize, access: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = access();
        self.nanoseconds.fetch_add(start.elapsed().as_nanos() as u64, Relaxed);
        self.accesses.fetch_add(accesses as u64, Relaxed);
        result
    }
}

impl Metered {
    pub fn new(card: PciCard, meter: Arc<Meter>) -> Self {
        Self { card, meter }
    }
}

impl Transport for Metered {
    fn read_config(&self, offset: u16) -> Result<u32, Error> {
        self.card.read_config(offset)
    }

    fn write_config(&self, offset: u16, word: u16) -> Result<(), Error> {
        self.card.write_config(offset, word)
    }

    fn bar_size(&self, index: u32) -> u64 {
        self.card.bar_size(index)
    }

    fn memory(&self, index: u32) -> Option<SharedView<'_>> {
        self.card.memory(index)
    }

    fn read_registers(&self, offset: u32, words: &mut [u32]) -> Result<(), Error> {
        self.meter.measure(words.len(), || self.card.read_registers(offset, words))
    }

    fn write_registers(&self, offset: u32, words: &[u32]) -> Result<(), Error> {
        self.meter.measure(words.len(), || self.card.write_registers(offset, words))
    }

    fn bursts(&self) -> bool {
        self.card.bursts()
    }

    fn host_memory(&self, bytes: usize) -> Result<Box<dyn HostMemory>, Error> {
        self.card.host_memory(bytes)
    }

    fn interrupts(&self) -> Result<Vec<OwnedFd>, Error> {
        self.card.interrupts()
    }

    fn reset(&self) -> Result<(), Error> {
        self.card.reset()
    }

    fn description(&self) -> String {
        self.card.description()
    }

    fn memory_is_remote(&self) -> bool {
        self.card.memory_is_remote()
    }

    fn needs_host_memory(&self) -> bool {
        self.card.needs_host_memory()
    }
}
