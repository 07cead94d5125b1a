//! What the register window, the engine and the publisher share.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use vg500_regs::Fault;
use vg500_regs::pci::Vector;
use vg500_regs::table::{STATUS_BLOCK, last_fault, status};

use super::bus::Bus;
use super::commands::{Accepted, Kind};
use super::mistake::Mistake;
use super::state::{Identity, State};
use crate::dma::DmaError;
use crate::log_limit::LogLimit;
use crate::trace::Trace;

/// How long a reset waits for the command that runs. Commands look for their cancellation far more often.
const PATIENCE: Duration = Duration::from_secs(1);
const VECTORS: [Vector; 3] = [Vector::Frame, Vector::Transfer, Vector::Fault];

/// State behind a lock that nobody holds for long: not while rendering, and not while writing host memory.
pub(super) struct Board {
    state: Mutex<State>,
    /// A command or a publication has ended.
    ended: Condvar,
    /// There is news for the host, or the publisher is to end.
    news: Condvar,
    pub(super) bus: Arc<dyn Bus>,
    pub(super) trace: Trace,
    /// Whether mistakes are named.
    pub(super) strict: bool,
    mistakes: AtomicU64,
    log: LogLimit,
}

impl Board {
    /// A board in power-on state.
    pub(super) fn new(identity: Identity, bus: Arc<dyn Bus>, trace: Trace, strict: bool) -> Self {
        Self {
            state: Mutex::new(State::new(identity)),
            ended: Condvar::new(),
            news: Condvar::new(),
            bus,
            trace,
            strict,
            mistakes: AtomicU64::new(0),
            log: LogLimit::default(),
        }
    }

    /// Looks at the state.
    pub(super) fn look<R>(&self, look: impl FnOnce(&State) -> R) -> R {
        look(&self.lock())
    }

    /// Changes the state, and leaves it to the publisher to tell the host.
    pub(super) fn change<R>(&self, change: impl FnOnce(&mut State) -> R) -> R {
        let mut state = self.lock();
        let result = change(&mut state);
        if state.commit() {
            self.news.notify_one();
        }
        result
    }

    /// Changes the state at the end of a command, and tells the host before it returns, unless the publisher is
    /// about to do so. Not for the thread that serves the client: host memory may need its answer.
    pub(super) fn conclude(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.lock();
        change(&mut state);
        state.commit();
        self.ended.notify_all();
        self.publish(state);
    }

    /// Tells the host what there is to tell, until asked to end.
    pub(super) fn publish_until_stopped(&self, stopped: impl Fn() -> bool) {
        let mut state = self.lock();
        while !stopped() {
            if state.has_news() && !state.publishing {
                self.publish(state);
                state = self.lock();
            } else {
                state = self.news.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
        }
    }

    /// Makes the publisher look whether it is to end; `stop` is carried out in its sight.
    pub(super) fn stop_publishing(&self, stop: impl FnOnce()) {
        let state = self.lock();
        stop();
        drop(state);
        self.news.notify_all();
    }

    /// The copy of the status block first, its word `STATUS` last of all, then interrupts. One thread at a time
    /// does it; what comes up meanwhile it takes along.
    fn publish<'a>(&'a self, mut state: MutexGuard<'a, State>) {
        if state.publishing {
            return;
        }
        state.publishing = true;
        while let Some(news) = state.take_news() {
            if let Some((address, block)) = &news.copy {
                drop(state);
                let copied = copy_status(&*self.bus, *address, block);
                state = match copied {
                    Ok(()) => self.lock(),
                    Err(error) => self.fail_copy(error),
                };
            }
            state.interrupt(&news, &*self.bus);
        }
        state.publishing = false;
        drop(state);
        self.ended.notify_all();
    }

    fn fail_copy(&self, error: DmaError) -> MutexGuard<'_, State> {
        if error == DmaError::Suspended {
            // A reset, which has switched the copy off already.
            return self.lock();
        }
        let counts = is_mistake(&error) && self.name(&Mistake::StatusTarget(error));
        self.trace.line(format_args!("the status copy has stopped: {error}"));
        let mut state = self.lock();
        state.fail_copy();
        if counts {
            state.count_mistake();
        }
        state.commit();
        state
    }

    /// Takes note of a mistake.
    pub(super) fn mistake(&self, mistake: &Mistake) {
        if self.name(mistake) {
            self.change(State::count_mistake);
        }
    }

    /// Names a mistake in trace and log. Returns whether it is to be counted in the registers as well.
    pub(super) fn name(&self, mistake: &Mistake) -> bool {
        self.mistakes.fetch_add(1, Ordering::Relaxed);
        if self.strict {
            self.trace.line(format_args!("mistake: {mistake}"));
            self.log(format_args!("mistake: {mistake}"));
        }
        self.strict
    }

    /// Mistakes since the last call, strict mode or not.
    pub(super) fn take_mistakes(&self) -> u64 {
        self.mistakes.swap(0, Ordering::Relaxed)
    }

    /// A line in the log that a guest can cause.
    pub(super) fn log(&self, line: fmt::Arguments<'_>) {
        match self.log.pass() {
            None => {}
            Some(0) => tracing::warn!("{line}"),
            Some(held_back) => tracing::warn!("{line} (after {held_back} more lines that are not shown)"),
        }
    }

    /// Cancels commands. Those that wait end at once; the one that runs is asked to.
    pub(super) fn cancel(&self, which: impl Fn(&Accepted) -> bool) {
        let cancelled = self.change(|state| {
            let cancelled = state.commands.cancel(which);
            for command in &cancelled {
                let (tag, fault) = (command.tag, Fault::CANCELLED);
                match command.kind {
                    Kind::Frame(plane) => {
                        state.end_frame(tag, Some(plane.place()), Duration::ZERO, Err(fault));
                    }
                    Kind::Transfer => state.end_transfer(tag, Err(fault)),
                }
            }
            cancelled
        });
        for command in cancelled {
            self.trace.line(format_args!("{command} failed: {}", Fault::CANCELLED));
        }
    }

    /// Cancels all commands, of which nobody hears any more, and tells the host nothing from here on.
    pub(super) fn fall_silent(&self) {
        let mut state = self.lock();
        state.be_silent();
        state.commands.abandon();
    }

    /// Power-on state, after [`fall_silent`](Self::fall_silent). On return no command runs and nothing is written
    /// to host memory, unless that has not come to an end within a second.
    pub(super) fn power_on(&self) {
        let busy = |state: &mut State| state.commands.is_running() || state.publishing;
        let waited = self.ended.wait_timeout_while(self.lock(), PATIENCE, busy);
        let (mut state, timeout) = waited.unwrap_or_else(PoisonError::into_inner);
        if timeout.timed_out() {
            tracing::error!("a cancelled command did not end within {PATIENCE:?}");
        }
        state.commands.forget_running();
        state.power_on();
        VECTORS.into_iter().for_each(|vector| self.bus.lower(vector));
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Whether an error is the client's doing: memory that it takes away in the midst, or that fails, is not.
pub(super) const fn is_mistake(error: &DmaError) -> bool {
    !matches!(error, DmaError::Suspended | DmaError::Revoked { .. } | DmaError::Failed { .. })
}

/// Writes the status block to host memory: the word `STATUS`, whose `SEQUENCE` says that the copy is complete,
/// last. Words are written whole.
fn copy_status(bus: &dyn Bus, address: u64, block: &[u8; STATUS_BLOCK]) -> Result<(), DmaError> {
    let word = |offset: u32| {
        let offset = offset as usize;
        (address.wrapping_add(offset as u64), block.get(offset..offset + 4).unwrap_or_default())
    };
    let (rest, bytes) = (address.wrapping_add(8), block.get(8..).unwrap_or_default());
    bus.write(rest, bytes)?;
    for (address, bytes) in [word(last_fault::REGISTER.offset), word(status::REGISTER.offset)] {
        bus.write(address, bytes)?;
    }
    Ok(())
}

impl fmt::Debug for Board {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Board").field("state", &self.state).finish_non_exhaustive()
    }
}
