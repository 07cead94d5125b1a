//! Interrupts: MSI-X, MSI, the interrupt line INTx, and the two notifications that VFIO adds.
//!
//! The client chooses the kind by attaching event descriptors to it: MSI-X before MSI before INTx. Message
//! tables and their masks are the client's own affair, as for every VFIO device; the device writes to event
//! descriptors.

#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::cast_possible_truncation))]

mod bell;
mod line;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::os::fd::OwnedFd;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bell::Bell;
use line::Line;

use crate::pci::CommandRegister;

/// Kinds of interrupt, in the order of their VFIO index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The interrupt line, level-triggered.
    Intx,
    /// Message-signalled interrupts.
    Msi,
    /// Message-signalled interrupts with a table.
    Msix,
    /// The device has failed; a VMM stops the guest.
    Error,
    /// The device wishes to be unplugged.
    Request,
}

impl Kind {
    /// All kinds; the position is the VFIO index.
    pub const ALL: [Self; 5] = [Self::Intx, Self::Msi, Self::Msix, Self::Error, Self::Request];
}

/// What `--interrupt` selects: the kinds of interrupt that the card offers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InterruptMode {
    /// MSI-X and MSI, no interrupt pin.
    #[default]
    Msix,
    /// MSI only, no interrupt pin.
    Msi,
    /// The interrupt pin INTA# only, as on the card of 1999.
    Intx,
}

/// An action on a range of interrupts of one kind.
#[derive(Debug)]
pub enum Action {
    /// Attaches one event descriptor to each interrupt of the range, replacing what was there.
    Attach(Vec<OwnedFd>),
    /// Takes the event descriptors away.
    Detach,
    /// Signals at once, as the device would.
    Trigger(Selection),
    /// Holds signals back until unmasked.
    Mask(Selection),
    /// Lets signals through again, and those held back at once.
    Unmask(Selection),
}

/// Which interrupts of a range an action is for.
#[derive(Debug)]
pub enum Selection {
    /// All of them.
    All,
    /// Those whose byte, counted from the start of the range, is not zero.
    Bytes(Vec<u8>),
}

impl Selection {
    fn has(&self, position: usize) -> bool {
        match self {
            Self::All => true,
            Self::Bytes(bytes) => bytes.get(position).is_some_and(|&byte| byte != 0),
        }
    }
}

#[derive(Debug)]
struct State {
    /// By VFIO index.
    lines: [Vec<Line>; 5],
    /// Causes that hold the interrupt line asserted, one bit per vector.
    causes: u64,
}

/// The interrupts of one device. Any thread may raise them.
#[derive(Debug)]
pub struct Interrupts {
    command: Arc<CommandRegister>,
    state: Mutex<State>,
    bell: Bell,
    lost: AtomicU64,
}

impl Interrupts {
    /// Interrupts with `vectors` causes, at most 32. MSI comes in powers of two, so a few of its messages may
    /// be unused.
    #[must_use]
    pub fn new(mode: InterruptMode, vectors: u16, command: Arc<CommandRegister>) -> Self {
        let vectors = usize::from(vectors.clamp(1, 32));
        let counts = match mode {
            InterruptMode::Msix => [0, vectors.next_power_of_two(), vectors, 1, 1],
            InterruptMode::Msi => [0, vectors.next_power_of_two(), 0, 1, 1],
            InterruptMode::Intx => [1, 0, 0, 1, 1],
        };
        let lines = counts.map(|count| std::iter::repeat_with(Line::default).take(count).collect());
        Self {
            command,
            state: Mutex::new(State { lines, causes: 0 }),
            bell: Bell::new(),
            lost: AtomicU64::new(0),
        }
    }

    /// How many interrupts of a kind there are.
    #[must_use]
    pub fn count(&self, kind: Kind) -> usize {
        self.lock().of(kind).len()
    }

    /// Reports cause `vector`: as a message if the client has enabled any, else by the interrupt line, which
    /// stays asserted until [`lower`](Self::lower). Where fewer messages are enabled than there are causes,
    /// all others share message 0. Messages wait for Bus Master Enable.
    pub fn raise(&self, vector: u16) {
        let mut state = self.lock();
        match state.messages() {
            Some(kind) => {
                let lines = state.of(kind);
                let own = usize::from(vector);
                let chosen = if lines.get(own).is_some_and(|line| line.event.is_some()) { own } else { 0 };
                if let Some(line) = lines.get_mut(chosen) {
                    line.pending = true;
                }
            }
            None => state.causes |= cause(vector),
        }
        self.deliver(&mut state);
    }

    /// Cause `vector` has been acknowledged: without another cause the interrupt line is released.
    pub fn lower(&self, vector: u16) {
        self.lock().causes &= !cause(vector);
    }

    /// Whether the device asks for its interrupt line: the Interrupt Status bit. Masks do not matter to it.
    #[must_use]
    pub fn line_asserted(&self) -> bool {
        let mut state = self.lock();
        state.causes != 0 && !state.of(Kind::Intx).is_empty()
    }

    /// The MSI-X pending bits, one per vector.
    #[must_use]
    pub fn pending(&self) -> u64 {
        self.lock().of(Kind::Msix).iter().rev().fold(0, |bits, line| bits << 1 | u64::from(line.pending))
    }

    /// Tells the client that the device has failed for good. A VMM stops its guest.
    pub fn fail(&self) {
        self.lock().of(Kind::Error).iter().for_each(|line| self.signal(line));
    }

    /// Asks the client to give the device back. A VMM asks its guest to let it be unplugged.
    pub fn request_release(&self) {
        self.lock().of(Kind::Request).iter().for_each(|line| self.signal(line));
    }

    /// Interrupts that could not be signalled because the client's descriptor does not count events.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }

    /// Carries out what the client asked for, on interrupts `range` of a kind.
    ///
    /// The caller has checked that the range exists and that as many descriptors came as it is long.
    pub fn apply(&self, kind: Kind, range: Range<usize>, action: Action) {
        let mut state = self.lock();
        let Some(lines) = state.of(kind).get_mut(range) else { return };
        match action {
            Action::Attach(events) => {
                lines.iter_mut().zip(events).for_each(|(line, event)| line.event = Some(event));
            }
            Action::Detach => lines.iter_mut().for_each(|line| line.event = None),
            Action::Trigger(selection) => selected(lines, &selection).for_each(|line| {
                self.signal(line);
                // The interrupt line masks itself, whoever triggers it.
                line.masked |= kind == Kind::Intx;
            }),
            Action::Mask(selection) => selected(lines, &selection).for_each(|line| line.masked = true),
            Action::Unmask(selection) => selected(lines, &selection).for_each(|line| line.masked = false),
        }
        self.deliver(&mut state);
    }

    /// Takes all descriptors of a kind away and forgets its masks and pending signals.
    pub fn disable(&self, kind: Kind) {
        self.lock().of(kind).iter_mut().for_each(|line| *line = Line::default());
    }

    /// The command register has been written: sends what waited for Bus Master Enable or for the end of
    /// Interrupt Disable.
    pub fn command_written(&self) {
        self.deliver(&mut self.lock());
    }

    /// Device reset: nothing is pending, asserted or masked. Descriptors stay attached.
    pub fn reset(&self) {
        let mut state = self.lock();
        state.causes = 0;
        state.lines.iter_mut().flatten().for_each(Line::reset);
    }

    /// The client has gone: as after a reset, and without descriptors.
    pub fn clear(&self) {
        let mut state = self.lock();
        state.causes = 0;
        state.lines.iter_mut().flatten().for_each(|line| *line = Line::default());
    }

    /// Sends what is pending and not held back.
    fn deliver(&self, state: &mut State) {
        let messages = state.messages();
        let asserted = state.causes != 0 && messages.is_none() && !self.command.interrupt_disable();
        for line in state.of(messages.unwrap_or(Kind::Intx)).iter_mut() {
            let due = if messages.is_some() { line.pending && self.command.bus_master() } else { asserted };
            if due && !line.masked && line.event.is_some() {
                self.signal(line);
                line.pending = false;
                line.masked = messages.is_none();
            }
        }
    }

    fn signal(&self, line: &Line) {
        if line.event.as_ref().is_some_and(|event| !self.bell.ring(event)) {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn of(&mut self, kind: Kind) -> &mut Vec<Line> {
        let [intx, msi, msix, error, request] = &mut self.lines;
        match kind {
            Kind::Intx => intx,
            Kind::Msi => msi,
            Kind::Msix => msix,
            Kind::Error => error,
            Kind::Request => request,
        }
    }

    /// The kind of message that the client has enabled.
    fn messages(&mut self) -> Option<Kind> {
        [Kind::Msix, Kind::Msi]
            .into_iter()
            .find(|&kind| self.of(kind).iter().any(|line| line.event.is_some()))
    }
}

/// The lines of a range that an action is for.
fn selected<'a>(lines: &'a mut [Line], selection: &'a Selection) -> impl Iterator<Item = &'a mut Line> {
    lines.iter_mut().enumerate().filter(|(position, _)| selection.has(*position)).map(|(_, line)| line)
}

/// The bit of a cause.
fn cause(vector: u16) -> u64 {
    1u64.checked_shl(u32::from(vector)).unwrap_or(0)
}
