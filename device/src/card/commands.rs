//! The commands that wait or run.

use std::fmt;
use std::sync::Arc;

use vg500_engine::Cancel;

use super::plane::Plane;

/// What kind of command it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A frame that is rendered into a base plane.
    Frame(Plane),
    /// A transfer of a base plane to host memory.
    Transfer,
}

/// A command that has been accepted and has not ended.
#[derive(Clone, Debug)]
pub(super) struct Accepted {
    pub(super) id: u64,
    pub(super) tag: u16,
    pub(super) kind: Kind,
    /// Asks it to end soon.
    pub(super) cancel: Arc<Cancel>,
}

impl fmt::Display for Accepted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind {
            Kind::Frame(_) => write!(f, "frame {}", self.tag),
            Kind::Transfer => write!(f, "transfer {}", self.tag),
        }
    }
}

/// All commands that wait or run, the oldest first.
#[derive(Debug, Default)]
pub(super) struct Commands {
    accepted: Vec<Accepted>,
    running: Option<u64>,
    last_id: u64,
}

impl Commands {
    /// Whether nothing waits or runs.
    pub(super) const fn is_empty(&self) -> bool {
        self.accepted.is_empty()
    }

    /// Whether one of them runs.
    pub(super) const fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// A command that may be [added](Self::add).
    pub(super) fn candidate(&mut self, tag: u16, kind: Kind) -> Accepted {
        self.last_id += 1;
        Accepted { id: self.last_id, tag, kind, cancel: Arc::default() }
    }

    /// Accepts a command.
    pub(super) fn add(&mut self, command: Accepted) {
        self.accepted.push(command);
    }

    /// The frames whose base plane shares bytes with this one.
    pub(super) fn frames_on(&self, plane: Plane) -> impl Iterator<Item = (u16, Plane)> {
        self.accepted.iter().filter_map(move |command| match command.kind {
            Kind::Frame(other) if other.overlaps(plane) => Some((command.tag, other)),
            _ => None,
        })
    }

    /// The engine takes a command. Returns whether it is still wanted.
    pub(super) fn begin(&mut self, id: u64) -> bool {
        let wanted = self.accepted.iter().any(|command| command.id == id);
        if wanted {
            self.running = Some(id);
        }
        wanted
    }

    /// The engine has done with a command. Returns whether anybody still wants to know.
    pub(super) fn end(&mut self, id: u64) -> bool {
        self.running = self.running.filter(|&running| running != id);
        let before = self.accepted.len();
        self.accepted.retain(|command| command.id != id);
        self.accepted.len() < before
    }

    /// Asks the one that runs to end soon if it is among those, and returns those that have waited, which are
    /// commands no more.
    pub(super) fn cancel(&mut self, which: impl Fn(&Accepted) -> bool) -> Vec<Accepted> {
        let running = self.running;
        let (cancelled, kept) = std::mem::take(&mut self.accepted)
            .into_iter()
            .partition(|command| which(command) && Some(command.id) != running);
        self.accepted = kept;
        let stopped = self.accepted.iter().filter(|command| which(command));
        stopped.for_each(|command| command.cancel.cancel());
        cancelled
    }

    /// Asks the transfer that runs, if one does, to end soon.
    pub(super) fn cancel_running_transfer(&self) {
        let transfers = self.accepted.iter().filter(|command| command.kind == Kind::Transfer);
        transfers.filter(|command| Some(command.id) == self.running).for_each(|it| it.cancel.cancel());
    }

    /// Asks the one that runs to end soon, and drops all: nobody wants to know about their end.
    pub(super) fn abandon(&mut self) {
        self.accepted.drain(..).for_each(|command| command.cancel.cancel());
    }

    /// Does not count on the one that runs any more.
    pub(super) fn forget_running(&mut self) {
        self.running = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg500_regs::PlaneFormat;

    fn add(commands: &mut Commands, kind: Kind) -> u64 {
        let command = commands.candidate(0, kind);
        let id = command.id;
        commands.add(command);
        id
    }

    fn frame(format: PlaneFormat, number: u32) -> Kind {
        Kind::Frame(Plane::new(format, number).unwrap())
    }

    #[test]
    fn what_was_cancelled_before_it_began_never_begins() {
        let mut commands = Commands::default();
        let [first, second] = [0, 1].map(|number| add(&mut commands, frame(PlaneFormat::Rgba8, number)));
        assert!(commands.begin(first));
        let cancelled = commands.cancel(|_| true);
        assert_eq!(cancelled.iter().map(|it| it.id).collect::<Vec<_>>(), [second]);
        assert!(!commands.begin(second));
        assert!(commands.is_running() && !commands.is_empty());
        assert!(commands.end(first));
        assert!(commands.is_empty() && !commands.is_running());
        assert!(!commands.end(first));
    }

    #[test]
    fn only_the_chosen_ones_are_asked_to_end() {
        let mut commands = Commands::default();
        let running = commands.candidate(0, Kind::Transfer);
        let (id, cancel) = (running.id, Arc::clone(&running.cancel));
        commands.add(running);
        assert!(commands.begin(id));
        let waiting = add(&mut commands, Kind::Transfer);
        assert!(commands.cancel(|it| it.kind != Kind::Transfer).is_empty());
        assert!(cancel.check().is_ok());
        assert_eq!(commands.cancel(|it| it.kind == Kind::Transfer).len(), 1);
        assert!(cancel.check().is_err());
        assert!(!commands.begin(waiting));
    }

    #[test]
    fn abandoned_commands_are_asked_to_end_and_not_heard_of_again() {
        let mut commands = Commands::default();
        let command = commands.candidate(0, Kind::Transfer);
        let (id, cancel) = (command.id, Arc::clone(&command.cancel));
        commands.add(command);
        assert!(commands.begin(id));
        commands.abandon();
        assert!(commands.is_empty() && commands.is_running() && cancel.check().is_err());
        assert!(!commands.end(id));
        assert!(!commands.is_running());
    }

    #[test]
    fn frames_are_found_by_the_bytes_of_their_planes() {
        let mut commands = Commands::default();
        add(&mut commands, frame(PlaneFormat::Accumulator64, 1));
        add(&mut commands, Kind::Transfer);
        let found = |number| {
            let plane = Plane::new(PlaneFormat::Rgba8, number).unwrap();
            commands.frames_on(plane).count()
        };
        assert_eq!([1, 2, 3, 4].map(found), [0, 1, 1, 0]);
    }
}
