//! The card: what is behind the protocol server.
//!
//! An access goes through these modules in this order, and nothing goes back:
//!
//! 1. `access` cuts it into words, `window` finds them in the register table and latches what is written;
//! 2. a command is taken from the registers, validated and queued by `submit`, or refused;
//! 3. `engine`, a thread of its own, carries out one command after another: frames by the render engine,
//!    transfers by `transfer` and `pixel`;
//! 4. `state` shows the end of a command in the registers, and `board` tells the host: the copy of the
//!    status block first, then the interrupt.
//!
//! No handler of an access waits for step 3 or 4. `watch` and `mistake` are strict mode.

#![cfg_attr(not(test), deny(clippy::indexing_slicing))]

mod access;
mod board;
mod bus;
mod commands;
mod engine;
#[cfg(test)]
mod fake;
mod memories;
mod mistake;
mod pace;
mod pixel;
mod plane;
mod registers;
mod state;
mod submit;
#[cfg(test)]
mod tests;
mod traffic;
mod transfer;
mod watch;
mod window;

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};

use crossbeam::channel::{Sender, bounded};
use rustix::io::Errno;
use vg500_engine::Renderer;
use vg500_regs::limit::{BASE_PLANES, QUEUE};
use vg500_regs::pci::{BARS, REGISTERS};

pub use pace::{PCI_BYTES_PER_SECOND, Pace};

use crate::config::Config;
use crate::dma::DmaTable;
use crate::interrupt::Interrupts;
use crate::pci::{CONFIG_SIZE, CommandRegister, ConfigSpace, Effect, Layout, MsixTable};
use crate::protocol::{Device, Region, ResetReason, region};
use crate::trace::{Bytes, Trace};
use board::Board;
use bus::{Bus, ClientBus};
use engine::{Command, Engine, Render};
use memories::Memories;
use mistake::Mistake;
use state::Identity;
use traffic::Traffic;

/// What the card shares with the protocol server.
#[derive(Clone, Debug)]
pub struct Host {
    /// The client's memory.
    pub dma: Arc<DmaTable>,
    /// The client's interrupts.
    pub interrupts: Arc<Interrupts>,
    /// The PCI command register.
    pub command: Arc<CommandRegister>,
}

/// The card. Its engine and its publisher run on threads that live as long as it does.
pub struct Card {
    board: Arc<Board>,
    renderer: Renderer,
    queue: Option<Sender<Command>>,
    stopped: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
    config: ConfigSpace,
    dma: Arc<DmaTable>,
    command: Arc<CommandRegister>,
    interrupts: Arc<Interrupts>,
    msix: MsixTable,
    memories: Memories,
    regions: [Region; region::COUNT],
    traffic: Traffic,
    /// Tag of the last start command of each base plane.
    tags: [Option<u16>; BASE_PLANES as usize],
    connections: u64,
}

impl Card {
    /// A card in power-on state.
    ///
    /// # Errors
    ///
    /// If the system has no memory, threads or descriptors left for it.
    pub fn new(config: &Config, trace: Trace, host: &Host) -> io::Result<Self> {
        let bus = Arc::new(ClientBus::new(Arc::clone(&host.dma), Arc::clone(&host.interrupts)));
        let card = Self::assemble(config, trace, host, bus, Box::new(config.renderer.start()))?;
        let board = Arc::downgrade(&card.board);
        host.dma.on_unmap(move || {
            if let Some(board) = board.upgrade() {
                board.look(|state| state.commands.cancel_running_transfer());
            }
        });
        Ok(card)
    }

    fn assemble(
        config: &Config,
        trace: Trace,
        host: &Host,
        bus: Arc<dyn Bus>,
        render: Box<dyn Render>,
    ) -> io::Result<Self> {
        let voxel_memory = u32::try_from(config.voxel_memory).map_err(|_| io::ErrorKind::InvalidInput)?;
        let identity = Identity { renderer: config.renderer, voxel_memory };
        let memories = Memories::new(config.voxel_memory)?;
        let layout = Layout::vg500(config.vendor, config.interrupts, config.voxel_memory);
        let mut card = Self {
            board: Arc::new(Board::new(identity, bus, trace, config.strict)),
            renderer: config.renderer,
            queue: None,
            stopped: Arc::default(),
            threads: Vec::new(),
            config: ConfigSpace::new(&layout, Arc::clone(&host.command), Arc::clone(&host.interrupts)),
            dma: Arc::clone(&host.dma),
            command: Arc::clone(&host.command),
            interrupts: Arc::clone(&host.interrupts),
            msix: MsixTable::new(layout.vectors),
            regions: regions(&memories),
            memories,
            traffic: Traffic::default(),
            tags: Default::default(),
            connections: 0,
        };
        card.start_threads(render, config.pace)?;
        Ok(card)
    }

    fn start_threads(&mut self, render: Box<dyn Render>, pace: Pace) -> io::Result<()> {
        let (queue, commands) = bounded(QUEUE);
        self.queue = Some(queue);
        let engine = Engine::new(Arc::clone(&self.board), render, pace);
        self.threads.push(Builder::new().name("engine".into()).spawn(move || engine.run(&commands))?);
        let (board, stopped) = (Arc::clone(&self.board), Arc::clone(&self.stopped));
        let publish = move || board.publish_until_stopped(|| stopped.load(Ordering::Relaxed));
        self.threads.push(Builder::new().name("publisher".into()).spawn(publish)?);
        Ok(())
    }

    /// Registers as after power-on; commands are cancelled.
    fn power_on(&mut self) {
        self.board.fall_silent();
        // The engine may be waiting for the client, which is waiting for this.
        let _suspended = self.dma.suspend();
        self.board.power_on();
        self.tags = Default::default();
    }

    /// Whether base address registers answer. If not, reads give all ones and writes vanish, as on the bus.
    fn answers(&self, bar: u32) -> bool {
        let enabled = self.command.memory_space();
        if !enabled {
            self.board.mistake(&Mistake::MemoryDisabled(bar));
        }
        enabled
    }

    fn begin_connection(&mut self) {
        self.traffic = Traffic::default();
        self.board.take_mistakes();
        self.connections += 1;
        self.board.trace.line(format_args!("connection {} begins", self.connections));
    }

    fn end_connection(&mut self) {
        let (number, traffic) = (self.connections, self.traffic);
        let mistakes = self.board.take_mistakes();
        self.board
            .trace
            .line(format_args!("connection {number} ends: mistakes={mistakes} trapped {traffic}"));
        tracing::info!(mistakes, %traffic, "connection {number} ended");
        self.memories.renew();
        self.regions = regions(&self.memories);
    }
}

impl Device for Card {
    fn regions(&self) -> &[Region] {
        &self.regions
    }

    fn read(&mut self, region: usize, offset: u64, data: &mut [u8]) -> Result<(), Errno> {
        if region == region::CONFIG {
            let result = self.config.read(offset, data);
            self.board.trace.line(format_args!("read config {offset:#05x} {}", Bytes(data)));
            return result;
        }
        let bar = u32::try_from(region).map_err(|_| Errno::INVAL)?;
        self.traffic.count_read(bar);
        if !self.answers(bar) {
            data.fill(0xff);
            return Ok(());
        }
        if bar == REGISTERS.index {
            self.read_window(u32::try_from(offset).map_err(|_| Errno::INVAL)?, data);
            return Ok(());
        }
        self.board.trace.line(format_args!("read BAR{bar}+{offset:#x} {} bytes", data.len()));
        let memory = self.memories.behind(bar).ok_or(Errno::INVAL)?;
        let offset = usize::try_from(offset).map_err(|_| Errno::INVAL)?;
        memory.view().read(offset, data).map_err(|_| Errno::INVAL)
    }

    fn write(&mut self, region: usize, offset: u64, data: &[u8]) -> Result<(), Errno> {
        if region == region::CONFIG {
            self.board.trace.line(format_args!("write config {offset:#05x} {}", Bytes(data)));
            if self.config.write(offset, data)? == Effect::Reset {
                self.reset(ResetReason::FunctionLevel);
            }
            return Ok(());
        }
        let bar = u32::try_from(region).map_err(|_| Errno::INVAL)?;
        self.traffic.count_write(bar);
        if !self.answers(bar) {
            return Ok(());
        }
        if bar == REGISTERS.index {
            self.write_window(u32::try_from(offset).map_err(|_| Errno::INVAL)?, data);
            return Ok(());
        }
        self.board.trace.line(format_args!("write BAR{bar}+{offset:#x} {} bytes", data.len()));
        let memory = self.memories.behind(bar).ok_or(Errno::INVAL)?;
        let offset = usize::try_from(offset).map_err(|_| Errno::INVAL)?;
        memory.view().write(offset, data).map_err(|_| Errno::INVAL)
    }

    fn reset(&mut self, reason: ResetReason) {
        self.power_on();
        self.config.reset();
        self.msix.reset();
        match reason {
            ResetReason::Connection => self.begin_connection(),
            ResetReason::LostConnection => self.end_connection(),
            ResetReason::Device => self.board.trace.line(format_args!("reset of the device")),
            ResetReason::FunctionLevel => self.board.trace.line(format_args!("function-level reset")),
        }
    }
}

impl Drop for Card {
    fn drop(&mut self) {
        self.power_on();
        self.queue = None;
        self.board.stop_publishing(|| self.stopped.store(true, Ordering::Relaxed));
        for thread in self.threads.drain(..) {
            if thread.join().is_err() {
                tracing::error!("a thread of the card panicked");
            }
        }
    }
}

impl std::fmt::Debug for Card {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Card").field("board", &self.board).finish_non_exhaustive()
    }
}

/// The regions as clients find them.
fn regions(memories: &Memories) -> [Region; region::COUNT] {
    std::array::from_fn(|index| {
        let bar = BARS.iter().find(|bar| bar.index as usize == index);
        match (bar, memories.behind(index as u32)) {
            (Some(_), Some(memory)) => Region::mapped(Arc::clone(memory)),
            (Some(bar), None) => Region::trapped(bar.size),
            (None, _) if index == region::CONFIG => Region::trapped(CONFIG_SIZE as u64),
            (None, _) => Region::default(),
        }
    })
}
