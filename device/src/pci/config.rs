//! Configuration space: bytes, the bits of them that can be written, and what writing has for effect.

use std::ops::Range;
use std::sync::Arc;

use rustix::io::Errno;

use super::capability::{self, Capability, Word, id};
use super::{CommandRegister, Layout};
use crate::interrupt::{InterruptMode, Interrupts};

/// Bytes of the space of a PCI Express function.
pub const CONFIG_SIZE: usize = 4096;

const COMMAND: usize = 0x04;
const STATUS: usize = 0x06;
const CACHE_LINE: usize = 0x0c;
const LATENCY_TIMER: usize = 0x0d;
const BAR: usize = 0x10;
const SUBSYSTEM: usize = 0x2c;
const CAPABILITIES: usize = 0x34;
const INTERRUPT_LINE: usize = 0x3c;
const INTERRUPT_PIN: usize = 0x3d;
const FIRST_CAPABILITY: usize = 0x40;

const STATUS_INTERRUPT: u8 = 1 << 3;
const STATUS_CAPABILITIES: u32 = 1 << 4;
const BAR_64_BIT: u32 = 0b100;
const BAR_PREFETCHABLE: u32 = 1 << 3;

/// What writing configuration space asks of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Effect {
    /// Nothing.
    None,
    /// Function-level reset: the device resets itself, this space included, before it answers.
    Reset,
}

/// The configuration space of the card.
#[derive(Debug)]
pub struct ConfigSpace {
    power_on: Box<[u8; CONFIG_SIZE]>,
    writable: Box<[u8; CONFIG_SIZE]>,
    bytes: Box<[u8; CONFIG_SIZE]>,
    power: usize,
    express: usize,
    command: Arc<CommandRegister>,
    interrupts: Arc<Interrupts>,
}

impl ConfigSpace {
    /// The space of a card in power-on state. Writes to the command register go on to `command` and
    /// `interrupts`.
    #[must_use]
    pub fn new(layout: &Layout, command: Arc<CommandRegister>, interrupts: Arc<Interrupts>) -> Self {
        let zeros = || Box::new([0; CONFIG_SIZE]);
        let (power_on, writable, bytes) = (zeros(), zeros(), zeros());
        let mut space = Self { power_on, writable, bytes, power: 0, express: 0, command, interrupts };
        space.header(layout);
        space.bars(layout);
        space.capabilities(capability::table(layout));
        space.reset();
        space
    }

    /// Power-on state, that of interrupts included; event descriptors stay attached.
    pub fn reset(&mut self) {
        self.bytes.clone_from(&self.power_on);
        self.command.set(0);
        self.interrupts.reset();
    }

    /// Reads bytes at `offset`.
    ///
    /// # Errors
    ///
    /// `EINVAL` outside of the space.
    pub fn read(&self, offset: u64, data: &mut [u8]) -> Result<(), Errno> {
        let range = range(offset, data.len())?;
        data.copy_from_slice(self.bytes.get(range.clone()).ok_or(Errno::INVAL)?);
        if let Some(status) = STATUS.checked_sub(range.start).and_then(|at| data.get_mut(at))
            && self.interrupts.line_asserted()
        {
            *status |= STATUS_INTERRUPT;
        }
        Ok(())
    }

    /// Writes the writable bits at `offset`, in any width and alignment.
    ///
    /// # Errors
    ///
    /// `EINVAL` outside of the space.
    pub fn write(&mut self, offset: u64, data: &[u8]) -> Result<Effect, Errno> {
        let range = range(offset, data.len())?;
        let power_state = self.word(self.power + capability::PM_CONTROL) & 0b11;
        let bytes = self.bytes.get_mut(range.clone()).ok_or(Errno::INVAL)?;
        let masks = self.writable.get(range.clone()).ok_or(Errno::INVAL)?;
        for ((byte, mask), new) in bytes.iter_mut().zip(masks).zip(data) {
            *byte = *byte & !mask | new & mask;
        }
        self.keep_power_state(power_state);
        if range.start < STATUS && range.end > COMMAND {
            self.command.set(self.word(COMMAND));
            self.interrupts.command_written();
        }
        Ok(self.take_reset())
    }

    /// D1 and D2 do not exist; writing them changes nothing.
    fn keep_power_state(&mut self, before: u16) {
        let at = self.power + capability::PM_CONTROL;
        let control = self.word(at);
        if matches!(control & 0b11, 1 | 2) {
            self.set_word(at, control & !0b11 | before);
        }
    }

    /// Takes the reset bit out of device control.
    fn take_reset(&mut self) -> Effect {
        let at = self.express + capability::DEVICE_CONTROL;
        let control = self.word(at);
        self.set_word(at, control & !capability::INITIATE_RESET);
        if control & capability::INITIATE_RESET == 0 { Effect::None } else { Effect::Reset }
    }

    fn word(&self, at: usize) -> u16 {
        let bytes = self.bytes.get(at..).and_then(<[u8]>::first_chunk);
        bytes.map_or(0, |bytes| u16::from_le_bytes(*bytes))
    }

    fn set_word(&mut self, at: usize, value: u16) {
        if let Some(bytes) = self.bytes.get_mut(at..).and_then(<[u8]>::first_chunk_mut) {
            *bytes = value.to_le_bytes();
        }
    }

    fn header(&mut self, layout: &Layout) {
        let identity = |vendor, device| u32::from(device) << 16 | u32::from(vendor);
        self.define(0, 4, identity(layout.vendor, layout.device), 0);
        self.define(COMMAND, 2, 0, u32::from(CommandRegister::WRITABLE));
        self.define(STATUS, 2, STATUS_CAPABILITIES, 0);
        self.define(0x08, 4, layout.class << 8 | u32::from(layout.revision), 0);
        self.define(CACHE_LINE, 1, 0, 0xff);
        self.define(LATENCY_TIMER, 1, 0, 0xff);
        self.define(SUBSYSTEM, 4, identity(layout.vendor, layout.device), 0);
        self.define(INTERRUPT_LINE, 1, 0, 0xff);
        self.define(INTERRUPT_PIN, 1, u32::from(layout.mode == InterruptMode::Intx), 0);
    }

    /// The low bits tell the kind; a write mask of the size's complement answers the sizing protocol.
    fn bars(&mut self, layout: &Layout) {
        for bar in &layout.bars {
            let at = BAR + 4 * bar.index;
            let [low, high] = halves(!(bar.size.next_power_of_two().max(16) - 1));
            let kind = if bar.wide { BAR_64_BIT | BAR_PREFETCHABLE } else { 0 };
            self.define(at, 4, kind, low & !0xf);
            if bar.wide {
                self.define(at + 4, 4, 0, high);
            }
        }
    }

    fn capabilities(&mut self, table: Vec<Capability>) {
        let (mut link, mut at) = (CAPABILITIES, FIRST_CAPABILITY);
        for Capability { id, size, words } in table {
            self.define(link, 1, offset32(at), 0);
            self.define(at, 1, u32::from(id), 0);
            for Word { offset, width, value, writable } in words {
                self.define(at + offset, width, value, writable);
            }
            match id {
                id::POWER_MANAGEMENT => self.power = at,
                id::EXPRESS => self.express = at,
                _ => {}
            }
            link = at + 1;
            at += size.next_multiple_of(4);
        }
    }

    fn define(&mut self, at: usize, width: usize, value: u32, writable: u32) {
        let targets = [(&mut self.power_on, value), (&mut self.writable, writable)];
        for (bytes, value) in targets {
            let bytes = bytes.iter_mut().skip(at).take(width);
            bytes.zip(value.to_le_bytes()).for_each(|(byte, new)| *byte = new);
        }
    }
}

fn range(offset: u64, length: usize) -> Result<Range<usize>, Errno> {
    let start = usize::try_from(offset).map_err(|_| Errno::INVAL)?;
    let end = start.checked_add(length).filter(|&end| end <= CONFIG_SIZE).ok_or(Errno::INVAL)?;
    Ok(start..end)
}

fn halves(value: u64) -> [u32; 2] {
    let [a, b, c, d, e, f, g, h] = value.to_le_bytes();
    [u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h])]
}

/// Offsets of capabilities fit into a byte.
fn offset32(at: usize) -> u32 {
    u32::try_from(at).unwrap_or(0)
}
