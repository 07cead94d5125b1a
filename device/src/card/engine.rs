//! The engine thread: it takes commands from the queue, one after another, and carries them out.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use crossbeam::channel::Receiver;
use vg500_engine::{Cancel, Engine as Renderer, Memories as Views, Report, Task};
use vg500_regs::table::start;
use vg500_regs::{Fault, FaultCode};

use super::board::{Board, is_mistake};
use super::memories::Memories;
use super::mistake::Mistake;
use super::pace::Pace;
use super::plane::Plane;
use super::transfer::{Stopped, Transfer};
use super::watch::{Checksums, Promises};

/// What renders frames.
pub(super) trait Render: Send {
    /// Renders a frame into pixel memory.
    fn render(&self, task: &Task, memories: Views<'_>, cancel: &Cancel) -> Result<Report, Fault>;
}

impl Render for Renderer {
    fn render(&self, task: &Task, memories: Views<'_>, cancel: &Cancel) -> Result<Report, Fault> {
        Self::render(self, task, memories, cancel)
    }
}

/// A command with all that it needs: nothing that the client does later changes it.
#[derive(Debug)]
pub(super) struct Command {
    pub(super) id: u64,
    pub(super) tag: u16,
    pub(super) cancel: Arc<Cancel>,
    pub(super) memories: Memories,
    pub(super) work: Work,
}

/// What a command is about.
#[derive(Debug)]
pub(super) enum Work {
    Frame(Box<Task>, Plane),
    Transfer(Transfer),
}

/// The engine.
pub(super) struct Engine {
    board: Arc<Board>,
    render: Box<dyn Render>,
    pace: Pace,
    promises: Promises,
}

impl Engine {
    /// An engine that renders by `render`.
    pub(super) fn new(board: Arc<Board>, render: Box<dyn Render>, pace: Pace) -> Self {
        Self { board, render, pace, promises: Promises::default() }
    }

    /// Carries out commands until the queue is closed.
    pub(super) fn run(mut self, queue: &Receiver<Command>) {
        for command in queue {
            if !self.board.change(|state| state.commands.begin(command.id)) {
                continue;
            }
            match &command.work {
                Work::Frame(task, plane) => self.frame(&command, task, *plane),
                Work::Transfer(transfer) => self.transfer(&command, transfer),
            }
        }
    }

    /// In this order: pixels, report block, the other words of the status block, `STATUS`; then the copy of
    /// them in host memory, and the interrupt.
    fn frame(&mut self, command: &Command, task: &Task, plane: Plane) {
        let tag = command.tag;
        self.board.trace.line(format_args!("frame {tag} begins"));
        let before = self.watch(command, task);
        let began = Instant::now();
        let result = self.render(command, task);
        let time = began.elapsed();
        let result = result.and_then(|report| {
            self.pace.await_cycles(began, report.cycles, &command.cancel)?;
            Ok(report)
        });
        let mistakes = self.mistakes(command, task, before);
        match &result {
            Ok(report) => self.board.trace.line(format_args!(
                "frame {tag} done: samples={} processed={} omitted={:#x} empty={} finished={} checksum={:#010x} \
                 cycles={} engine={time:?}",
                report.samples,
                report.processed,
                report.omitted,
                report.left_out.empty,
                report.left_out.finished,
                report.checksum,
                report.cycles,
            )),
            Err(fault) => self.board.trace.line(format_args!("frame {tag} failed: {fault}")),
        }
        self.board.conclude(|state| {
            (0..mistakes).for_each(|_| state.count_mistake());
            if state.commands.end(command.id) {
                state.end_frame(tag, Some(plane.place()), time, result);
            }
        });
    }

    /// A panic of the renderer costs the frame, not the card.
    fn render(&self, command: &Command, task: &Task) -> Result<Report, Fault> {
        let Memories { voxel, pixel, section, .. } = &command.memories;
        let views = Views { voxel: voxel.view(), pixel: pixel.view(), section: section.view() };
        let render = || self.render.render(task, views, &command.cancel);
        catch_unwind(AssertUnwindSafe(render)).unwrap_or_else(|_| {
            tracing::error!(frame = ?task.frame, "the renderer panicked");
            Err(Fault::new(FaultCode::Internal, start::PLANE))
        })
    }

    /// In strict mode, checksums of what the frame uses as it begins.
    fn watch(&self, command: &Command, task: &Task) -> Option<Checksums> {
        let checksums = self.board.strict.then(|| Checksums::of(&task.frame, &command.memories).ok())??;
        if !self.promises.kept(&task.frame, &command.memories, &checksums) {
            self.board.mistake(&Mistake::BrokenPromise(command.tag));
        }
        Some(checksums)
    }

    /// Names what has been written while the frame used it. Returns how many mistakes that were.
    fn mistakes(&mut self, command: &Command, task: &Task, before: Option<Checksums>) -> usize {
        let Some(before) = before else { return 0 };
        let Ok(after) = Checksums::of(&task.frame, &command.memories) else { return 0 };
        self.promises.remember(&task.frame, &command.memories, &after);
        let mistakes = before.differences(&after, &task.frame);
        mistakes.iter().filter(|mistake| self.board.name(mistake)).count()
    }

    fn transfer(&self, command: &Command, transfer: &Transfer) {
        let tag = command.tag;
        self.board.trace.line(format_args!("transfer {tag} begins"));
        let began = Instant::now();
        let pixels = command.memories.pixel.view();
        let result = transfer.run(&pixels, &*self.board.bus, &command.cancel).and_then(|()| {
            let paced = self.pace.await_bytes(began, transfer.bytes(), &command.cancel);
            paced.map_err(|_| Stopped::Cancelled)
        });
        let mut mistakes = 0;
        if let Err(Stopped::HostMemory(error)) = result
            && is_mistake(&error)
        {
            mistakes += u32::from(self.board.name(&Mistake::TransferTarget { tag, error }));
        }
        let result = result.map_err(|stopped| stopped.fault());
        match &result {
            Ok(()) => self.board.trace.line(format_args!("transfer {tag} done: bytes={}", transfer.bytes())),
            Err(fault) => self.board.trace.line(format_args!("transfer {tag} failed: {fault}")),
        }
        self.board.conclude(|state| {
            (0..mistakes).for_each(|_| state.count_mistake());
            if state.commands.end(command.id) {
                state.end_transfer(tag, result);
            }
        });
    }
}
