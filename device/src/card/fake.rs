//! A bus that writes down what happens on it, and a renderer that can be held.

use std::ops::Range;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};

use vg500_engine::{Cancel, Memories, Report, Task};
use vg500_regs::Fault;
use vg500_regs::pci::Vector;

use super::bus::{Bus, Held};
use super::engine::Render;
use crate::dma::DmaError;

/// Something that happened on the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Event {
    Write(u64, Vec<u8>),
    Raise(Vector),
    Lower(Vector),
}

/// What is asked before each write and interrupt.
type Question = Box<dyn Fn() + Send>;

/// A bus with host memory in one range, nothing elsewhere.
pub(super) struct FakeBus {
    memory: Mutex<Range<u64>>,
    events: Arc<Mutex<Vec<Event>>>,
    before: Mutex<Option<Question>>,
    failure: Mutex<Option<DmaError>>,
}

impl FakeBus {
    pub(super) fn with_memory(memory: Range<u64>) -> Arc<Self> {
        Arc::new(Self {
            memory: Mutex::new(memory),
            events: Arc::default(),
            before: Mutex::default(),
            failure: Mutex::default(),
        })
    }

    pub(super) fn set_memory(&self, memory: Range<u64>) {
        *self.memory.lock().unwrap() = memory;
    }

    /// From now on memory is not there for this reason.
    pub(super) fn fail(&self, failure: DmaError) {
        *self.failure.lock().unwrap() = Some(failure);
    }

    /// What happened since the last call.
    pub(super) fn events(&self) -> Vec<Event> {
        std::mem::take(&mut self.events.lock().unwrap())
    }

    /// Does something before each write and each raised interrupt.
    pub(super) fn before(&self, question: impl Fn() + Send + 'static) {
        *self.before.lock().unwrap() = Some(Box::new(question));
    }

    fn check(&self, address: u64, length: u64) -> Result<(), DmaError> {
        if let Some(failure) = *self.failure.lock().unwrap() {
            return Err(failure);
        }
        let memory = self.memory.lock().unwrap();
        let end = address.checked_add(length).ok_or(DmaError::Wraps { iova: address, length })?;
        let inside = memory.contains(&address) && end <= memory.end;
        inside.then_some(()).ok_or(DmaError::NotMapped { iova: address })
    }

    fn note(&self, event: Event) {
        if let Some(before) = &*self.before.lock().unwrap() {
            before();
        }
        self.events.lock().unwrap().push(event);
    }
}

impl Bus for FakeBus {
    fn write(&self, address: u64, bytes: &[u8]) -> Result<(), DmaError> {
        self.check(address, bytes.len() as u64)?;
        self.note(Event::Write(address, bytes.to_vec()));
        Ok(())
    }

    fn hold(&self, address: u64, length: u64) -> Result<Box<dyn Held>, DmaError> {
        self.check(address, length)?;
        Ok(Box::new(FakeHeld { address, events: Arc::clone(&self.events) }))
    }

    fn raise(&self, vector: Vector) {
        self.note(Event::Raise(vector));
    }

    fn lower(&self, vector: Vector) {
        self.events.lock().unwrap().push(Event::Lower(vector));
    }
}

struct FakeHeld {
    address: u64,
    events: Arc<Mutex<Vec<Event>>>,
}

impl Held for FakeHeld {
    fn write(&self, offset: u64, bytes: &[u8]) -> Result<(), DmaError> {
        self.events.lock().unwrap().push(Event::Write(self.address + offset, bytes.to_vec()));
        Ok(())
    }
}

/// Holds frames until they are let go or cancelled.
#[derive(Default)]
pub(super) struct Gate {
    state: Mutex<GateState>,
    changed: Condvar,
}

#[derive(Default)]
struct GateState {
    closed: bool,
    /// Whether a held frame stays even when it is cancelled.
    deaf: bool,
    inside: usize,
    /// Frames that have passed, by tag.
    passed: Vec<u16>,
}

impl Gate {
    pub(super) fn closed() -> Arc<Self> {
        Arc::new(Self {
            state: Mutex::new(GateState { closed: true, ..GateState::default() }),
            ..Self::default()
        })
    }

    pub(super) fn open(&self) {
        self.lock().closed = false;
        self.changed.notify_all();
    }

    pub(super) fn be_deaf(&self) {
        self.lock().deaf = true;
    }

    /// Waits until the engine holds a frame here.
    pub(super) fn await_frame(&self) {
        drop(self.changed.wait_while(self.lock(), |state| state.inside == 0).unwrap());
    }

    pub(super) fn passed(&self) -> Vec<u16> {
        self.lock().passed.clone()
    }

    fn pass(&self, tag: u16, cancel: &Cancel) -> Result<(), Fault> {
        let mut state = self.lock();
        state.inside += 1;
        self.changed.notify_all();
        while state.closed && (state.deaf || cancel.check().is_ok()) {
            let tick = std::time::Duration::from_millis(1);
            state = self.changed.wait_timeout(state, tick).unwrap().0;
        }
        state.inside -= 1;
        state.passed.push(tag);
        drop(state);
        cancel.check()
    }

    fn lock(&self) -> MutexGuard<'_, GateState> {
        self.state.lock().unwrap()
    }
}

/// A renderer behind a gate.
pub(super) struct Gated<R>(pub(super) Arc<Gate>, pub(super) R);

impl<R: Render> Render for Gated<R> {
    fn render(&self, task: &Task, memories: Memories<'_>, cancel: &Cancel) -> Result<Report, Fault> {
        self.0.pass(task.frame.tag, cancel)?;
        self.1.render(task, memories, cancel)
    }
}

/// A renderer with a defect.
pub(super) struct Panicking;

impl Render for Panicking {
    fn render(&self, _: &Task, _: Memories<'_>, _: &Cancel) -> Result<Report, Fault> {
        panic!("on purpose");
    }
}
