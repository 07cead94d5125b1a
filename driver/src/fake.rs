//! A card in memory, for tests. It watches for what a driver must not do, and ends frames at once or on demand.

mod registers;

use std::fs::File;
use std::os::fd::OwnedFd;
use std::sync::{Arc, Mutex, MutexGuard};

use rustix::event::{EventfdFlags, eventfd};
use vg500_regs::pci::{BARS, DEVICE_ID, REGISTERS, VENDOR_ID};
use vg500_regs::register::Access;
use vg500_regs::table::{find, interface_version};
use vg500_regs::{Fault, FrameRegisters, SharedView};

use crate::mapping::Mapping;
use crate::transport::{HostMemory, Transport};
use crate::{Card, Error, lock};
use registers::{Inside, reset_words};

/// How the card behaves.
pub(crate) struct Setup {
    pub(crate) vendor: u16,
    pub(crate) device: u16,
    pub(crate) interface: u32,
    pub(crate) bar_sizes: [u64; 6],
    pub(crate) unmapped: Option<u32>,
    pub(crate) takes_command: bool,
    pub(crate) bursts: bool,
    pub(crate) host_memory: bool,
    pub(crate) reaches_host_memory: bool,
    pub(crate) needs_host_memory: bool,
    pub(crate) memory_is_remote: bool,
    pub(crate) interrupts: bool,
}

impl Default for Setup {
    fn default() -> Self {
        let mut bar_sizes = [0; 6];
        BARS.into_iter().for_each(|bar| bar_sizes[bar.index as usize] = bar.size);
        Self {
            vendor: VENDOR_ID,
            device: DEVICE_ID,
            interface: interface_version::REGISTER.reset,
            bar_sizes,
            unmapped: None,
            takes_command: true,
            bursts: true,
            host_memory: true,
            reaches_host_memory: true,
            needs_host_memory: false,
            memory_is_remote: false,
            interrupts: true,
        }
    }
}

/// The card as tests see it.
pub(crate) struct FakeCard {
    setup: Setup,
    memories: Vec<Option<(File, Mapping)>>,
    inside: Mutex<Inside>,
}

/// An open card and what is behind it.
pub(crate) fn open() -> (Card, Arc<FakeCard>) {
    open_with(Setup::default())
}

pub(crate) fn open_with(setup: Setup) -> (Card, Arc<FakeCard>) {
    let fake = FakeCard::new(setup);
    (Card::open(Box::new(Arc::clone(&fake))).unwrap(), fake)
}

fn memory(size: u64) -> (File, Mapping) {
    let file = tempfile::tempfile().unwrap();
    file.set_len(size).unwrap();
    let mapping = Mapping::new(&file, 0, size).unwrap();
    (file, mapping)
}

impl FakeCard {
    pub(crate) fn new(setup: Setup) -> Arc<Self> {
        let mapped = |index: u32| index != REGISTERS.index && Some(index) != setup.unmapped;
        let memories = (0..)
            .zip(setup.bar_sizes)
            .map(|(index, size)| (size > 0 && mapped(index)).then(|| memory(size)))
            .collect();
        let inside = Mutex::new(Inside { words: reset_words(&setup), ..Inside::default() });
        Arc::new(Self { setup, memories, inside })
    }

    /// From now on frames and transfers end by [`finish`](Self::finish) alone.
    pub(crate) fn hold(&self, hold: bool) {
        lock(&self.inside).hold = hold;
    }

    pub(crate) fn ignore_cancel(&self) {
        lock(&self.inside).ignores_cancel = true;
    }

    /// The next start command is refused.
    pub(crate) fn refuse(&self, fault: Fault) {
        lock(&self.inside).refusal = Some(fault);
    }

    pub(crate) fn die(&self) {
        lock(&self.inside).dead = true;
    }

    /// Ends the frame that has run longest.
    pub(crate) fn finish(&self) {
        let mut inside = lock(&self.inside);
        let (place, tag) = inside.running.remove(0);
        inside.end_frame(place, tag, Ok(()));
    }

    /// Frame registers at each start command so far.
    pub(crate) fn frames(&self) -> Vec<FrameRegisters> {
        lock(&self.inside).frames.clone()
    }

    /// Takes the offset and number of words of each message that wrote registers.
    pub(crate) fn take_writes(&self) -> Vec<(u32, usize)> {
        std::mem::take(&mut lock(&self.inside).writes)
    }

    /// Messages that read registers so far.
    pub(crate) fn reads(&self) -> usize {
        lock(&self.inside).reads
    }

    /// Sets a register that only the card writes.
    pub(crate) fn set(&self, offset: u32, word: u32) {
        lock(&self.inside).words[offset as usize / 4] = word;
    }

    /// What a register holds.
    pub(crate) fn word(&self, offset: u32) -> u32 {
        lock(&self.inside).words[offset as usize / 4]
    }

    /// The bytes of a mapped memory.
    pub(crate) fn view(&self, index: u32) -> SharedView<'_> {
        self.memories[index as usize].as_ref().unwrap().1.view()
    }

    /// The file behind a memory that is mapped.
    pub(crate) fn file(&self, index: u32) -> Option<&File> {
        self.memories[index as usize].as_ref().map(|(file, _)| file)
    }

    /// Host memory appears at a bus address.
    pub(crate) fn map(&self, address: u64, memory: Mapping) {
        lock(&self.inside).host.push((address, Arc::new(memory)));
    }

    /// Host memory at a bus address goes.
    pub(crate) fn unmap(&self, address: u64) {
        lock(&self.inside).host.retain(|(start, _)| *start != address);
    }

    /// Bus addresses of host memory.
    pub(crate) fn mapped(&self) -> Vec<u64> {
        lock(&self.inside).host.iter().map(|(address, _)| *address).collect()
    }

    /// Attaches an event descriptor to the next vector.
    pub(crate) fn attach(&self, event: OwnedFd) {
        lock(&self.inside).events.push(event);
    }

    /// Signals a vector.
    pub(crate) fn signal(&self, vector: u32) {
        rustix::io::write(&lock(&self.inside).events[vector as usize], &1u64.to_ne_bytes()).unwrap();
    }

    /// Fails if the driver did what it must not.
    pub(crate) fn check_driver(&self) {
        assert_eq!(lock(&self.inside).mistakes, Vec::<String>::new());
    }

    fn alive(&self) -> Result<MutexGuard<'_, Inside>, Error> {
        let inside = lock(&self.inside);
        if inside.dead { Err(Error::CardDead { reason: "killed".into() }) } else { Ok(inside) }
    }
}

impl Drop for FakeCard {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.check_driver();
        }
    }
}

struct FakeHostMemory(u64, Arc<Mapping>);

impl HostMemory for FakeHostMemory {
    fn bus_address(&self) -> u64 {
        self.0
    }

    fn view(&self) -> SharedView<'_> {
        self.1.view()
    }
}

impl Transport for Arc<FakeCard> {
    fn read_config(&self, offset: u16) -> Result<u32, Error> {
        let inside = self.alive()?;
        Ok(match offset {
            0 => u32::from(self.setup.device) << 16 | u32::from(self.setup.vendor),
            4 => inside.command.into(),
            8 => 0x0480_0001,
            _ => u32::MAX,
        })
    }

    fn write_config(&self, offset: u16, word: u16) -> Result<(), Error> {
        let mut inside = self.alive()?;
        if offset == 4 && self.setup.takes_command {
            inside.command = word;
        }
        Ok(())
    }

    fn bar_size(&self, index: u32) -> u64 {
        self.setup.bar_sizes[index as usize]
    }

    fn memory(&self, index: u32) -> Option<SharedView<'_>> {
        Some(self.memories[index as usize].as_ref()?.1.view())
    }

    fn read_registers(&self, offset: u32, words: &mut [u32]) -> Result<(), Error> {
        let mut inside = self.alive()?;
        inside.reads += 1;
        for (offset, word) in (offset..).step_by(4).zip(words) {
            match find(offset) {
                Some((register, _)) if register.access == Access::ReadOnly => {}
                _ => inside.mistakes.push(format!("{offset:#x} is read")),
            }
            *word = inside.words[offset as usize / 4];
        }
        Ok(())
    }

    fn write_registers(&self, offset: u32, words: &[u32]) -> Result<(), Error> {
        let mut inside = self.alive()?;
        inside.writes.push((offset, words.len()));
        for (offset, word) in (offset..).step_by(4).zip(words) {
            inside.write(self, offset, *word);
        }
        Ok(())
    }

    fn bursts(&self) -> bool {
        self.setup.bursts
    }

    fn host_memory(&self, bytes: usize) -> Result<Box<dyn HostMemory>, Error> {
        if !self.setup.host_memory {
            return Err(Error::NotSupported { what: "host memory" });
        }
        let mut inside = self.alive()?;
        let memory = Arc::new(memory(bytes.next_multiple_of(4096) as u64).1);
        let address = (inside.host.len() as u64 + 1) << 36;
        inside.host.push((address, Arc::clone(&memory)));
        Ok(Box::new(FakeHostMemory(address, memory)))
    }

    fn interrupts(&self) -> Result<Vec<OwnedFd>, Error> {
        if !self.setup.interrupts {
            return Ok(Vec::new());
        }
        let event = eventfd(0, EventfdFlags::NONBLOCK).unwrap();
        self.alive()?.events.push(event.try_clone().unwrap());
        Ok(vec![event])
    }

    fn memory_is_remote(&self) -> bool {
        self.setup.memory_is_remote
    }

    fn needs_host_memory(&self) -> bool {
        self.setup.needs_host_memory
    }

    fn reset(&self) -> Result<(), Error> {
        let mut inside = self.alive()?;
        inside.words = reset_words(&self.setup);
        inside.command = 0;
        inside.running.clear();
        inside.transferring = None;
        Ok(())
    }
}
