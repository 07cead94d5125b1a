//! Start and transfer commands: taken from the registers, checked, and put into the queue.

use std::time::Duration;

use vg500_engine::Task;
use vg500_regs::table::{start, transfer};
use vg500_regs::{Fault, FaultCode};

use super::Card;
use super::commands::{Accepted, Commands, Kind};
use super::engine::{Command, Work};
use super::mistake::Mistake;
use super::plane::Plane;
use super::transfer::Transfer;

impl Card {
    /// `START`: the frame that the registers describe. A frame that is refused ends at once.
    pub(super) fn queue_frame(&mut self, tag: u16) {
        let registers = self.board.look(|state| state.registers().frame());
        let plane = Plane::of_frame(&registers);
        self.check_tag(tag, plane);
        let tables = self.memories.table.view();
        let task = self.renderer.take(&registers, &tables, self.memories.voxel.view().size());
        let accepted = task.and_then(|task| {
            let plane = plane.ok_or(Fault::new(FaultCode::Value, start::PLANE))?;
            self.accept_frame(tag, plane, task)
        });
        let Err(fault) = accepted else { return };
        self.board.trace.line(format_args!("frame {tag} failed: {fault}"));
        if fault.code != FaultCode::QueueFull {
            self.board.mistake(&Mistake::FrameRefused { tag, fault });
        }
        let place = plane.map(Plane::place);
        self.board.change(|state| state.end_frame(tag, place, Duration::ZERO, Err(fault)));
    }

    fn accept_frame(&self, tag: u16, plane: Plane, task: Task) -> Result<(), Fault> {
        self.board.change(|state| {
            if is_in_use(&state.commands, plane, &task) {
                return Err(Fault::new(FaultCode::Busy, start::PLANE));
            }
            let command = state.commands.candidate(tag, Kind::Frame(plane));
            if !self.enqueue(&command, Work::Frame(Box::new(task), plane)) {
                return Err(Fault::new(FaultCode::QueueFull, start::PLANE));
            }
            state.commands.add(command);
            Ok(())
        })
    }

    /// Consecutive frames on a base plane are told apart by their tags.
    fn check_tag(&mut self, tag: u16, plane: Option<Plane>) {
        let Some(plane) = plane else { return };
        let last = self.tags.get_mut(plane.place()).and_then(|last| last.replace(tag));
        if last == Some(tag) {
            self.board.mistake(&Mistake::SameTag { tag, plane });
        }
    }

    /// `TRANSFER`: the rectangle that the registers describe.
    pub(super) fn queue_transfer(&mut self, tag: u16) {
        let taken = self.board.look(|state| Transfer::take(state.registers()));
        let Err(fault) = taken.and_then(|transfer| self.accept_transfer(tag, transfer)) else { return };
        self.board.trace.line(format_args!("transfer {tag} failed: {fault}"));
        if fault.code != FaultCode::QueueFull {
            self.board.mistake(&Mistake::TransferRefused { tag, fault });
        }
        self.board.change(|state| state.end_transfer(tag, Err(fault)));
    }

    fn accept_transfer(&self, tag: u16, transfer: Transfer) -> Result<(), Fault> {
        let plane = transfer.plane;
        let other_format = |state: &super::state::State| {
            state.commands.frames_on(plane).find(|(_, other)| other.format() != plane.format())
        };
        if let Some((frame, _)) = self.board.look(other_format) {
            self.board.mistake(&Mistake::TransferOfOtherFormat { tag, plane, frame });
        }
        self.board.change(|state| {
            let command = state.commands.candidate(tag, Kind::Transfer);
            if !self.enqueue(&command, Work::Transfer(transfer)) {
                return Err(Fault::new(FaultCode::QueueFull, transfer::PLANE));
            }
            state.commands.add(command);
            Ok(())
        })
    }

    /// Puts a command into the queue. Returns whether there was room. The engine does not look at it before the
    /// board's lock, under which this runs, is released.
    fn enqueue(&self, accepted: &Accepted, work: Work) -> bool {
        let command = Command {
            id: accepted.id,
            tag: accepted.tag,
            cancel: accepted.cancel.clone(),
            memories: self.memories.clone(),
            work,
        };
        self.queue.as_ref().is_some_and(|queue| queue.try_send(command).is_ok())
    }
}

/// Whether a frame would be rendered over one that waits or runs. A frame may follow one whose accumulators it
/// begins with, in place: it takes them when it begins, and that is after the other's end.
fn is_in_use(commands: &Commands, plane: Plane, task: &Task) -> bool {
    let continues = task.frame.output.accumulators == Some(plane.number());
    commands.frames_on(plane).any(|(_, other)| !(continues && other == plane))
}
