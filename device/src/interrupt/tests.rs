//! Interrupts against real event descriptors.

use rustix::event::{EventfdFlags, eventfd};
use rustix::io::{Errno, dup, read};

use super::*;

/// The client's end of an event descriptor.
struct Event(OwnedFd);

impl Event {
    fn new() -> Self {
        Self(eventfd(0, EventfdFlags::NONBLOCK).unwrap())
    }

    fn give(&self) -> OwnedFd {
        dup(&self.0).unwrap()
    }

    /// Events since the last call.
    fn taken(&self) -> u64 {
        let mut count = [0; 8];
        match read(&self.0, &mut count) {
            Ok(8) => u64::from_ne_bytes(count),
            Err(Errno::AGAIN) => 0,
            other => panic!("{other:?}"),
        }
    }
}

const BUS_MASTER: u16 = CommandRegister::BUS_MASTER;

fn card(mode: InterruptMode, command: u16) -> (Interrupts, Arc<CommandRegister>) {
    let register = Arc::new(CommandRegister::default());
    register.set(command);
    (Interrupts::new(mode, 3, Arc::clone(&register)), register)
}

fn attach(interrupts: &Interrupts, kind: Kind, start: usize, events: &[&Event]) {
    let given = events.iter().map(|event| event.give()).collect();
    interrupts.apply(kind, start..start + events.len(), Action::Attach(given));
}

fn unmask(interrupts: &Interrupts, kind: Kind, vector: usize) {
    interrupts.apply(kind, vector..vector + 1, Action::Unmask(Selection::All));
}

#[test]
fn ranges_that_do_not_exist_change_nothing() {
    let (interrupts, _) = card(InterruptMode::Msix, BUS_MASTER);
    let event = Event::new();
    interrupts.apply(Kind::Msix, 3..4, Action::Attach(vec![event.give()]));
    interrupts.apply(Kind::Intx, 0..1, Action::Trigger(Selection::All));
    interrupts.apply(Kind::Msix, 2..usize::MAX, Action::Mask(Selection::All));
    interrupts.raise(u16::MAX);
    interrupts.lower(u16::MAX);
    assert_eq!((event.taken(), interrupts.pending(), interrupts.lost()), (0, 0, 0));
}

#[test]
fn each_mode_offers_its_kinds() {
    let counts = |mode| Kind::ALL.map(|kind| card(mode, 0).0.count(kind));
    assert_eq!(counts(InterruptMode::Msix), [0, 4, 3, 1, 1]);
    assert_eq!(counts(InterruptMode::Msi), [0, 4, 0, 1, 1]);
    assert_eq!(counts(InterruptMode::Intx), [1, 0, 0, 1, 1]);
}

#[test]
fn a_full_or_foreign_descriptor_never_blocks_the_device() {
    let (interrupts, _) = card(InterruptMode::Msix, BUS_MASTER);
    // A blocking descriptor whose counter is full, a pipe that nobody empties, and one that nobody reads.
    let full = eventfd(0, EventfdFlags::empty()).unwrap();
    rustix::io::write(&full, &(u64::MAX - 1).to_ne_bytes()).unwrap();
    let (_reader, pipe) = std::io::pipe().unwrap();
    let null = std::fs::File::open("/dev/null").unwrap().into();
    interrupts.apply(Kind::Msix, 0..3, Action::Attach(vec![full, pipe.into(), null]));
    for _ in 0..20_000 {
        interrupts.raise(0);
        interrupts.raise(1);
    }
    interrupts.raise(2);
    assert_eq!(interrupts.lost(), 20_001, "the pipe's and the file's");
}

#[test]
fn messages_go_to_their_own_vector_or_share_vector_0() {
    let (interrupts, _) = card(InterruptMode::Msix, BUS_MASTER);
    let events = [Event::new(), Event::new(), Event::new()];
    attach(&interrupts, Kind::Msix, 0, &[&events[0]]);
    interrupts.raise(2);
    assert_eq!([0, 1, 2].map(|index: usize| events[index].taken()), [1, 0, 0]);
    // One message per vector, as a client does that may send one descriptor at a time.
    attach(&interrupts, Kind::Msix, 2, &[&events[2]]);
    attach(&interrupts, Kind::Msix, 1, &[&events[1]]);
    (0..3).for_each(|vector| interrupts.raise(vector));
    assert_eq!([0, 1, 2].map(|index: usize| events[index].taken()), [1, 1, 1]);
}

#[test]
fn msix_comes_before_msi() {
    let (interrupts, _) = card(InterruptMode::Msix, BUS_MASTER);
    let (msi, msix) = (Event::new(), Event::new());
    attach(&interrupts, Kind::Msi, 0, &[&msi]);
    interrupts.raise(0);
    attach(&interrupts, Kind::Msix, 0, &[&msix]);
    interrupts.raise(0);
    interrupts.disable(Kind::Msix);
    interrupts.raise(1);
    assert_eq!((msi.taken(), msix.taken()), (2, 1));
}

#[test]
fn a_masked_message_stays_pending_until_unmasked() {
    let (interrupts, _) = card(InterruptMode::Msix, BUS_MASTER);
    let events = [Event::new(), Event::new()];
    attach(&interrupts, Kind::Msix, 0, &[&events[0], &events[1]]);
    interrupts.apply(Kind::Msix, 0..2, Action::Mask(Selection::Bytes(vec![0, 1])));
    interrupts.raise(0);
    interrupts.raise(1);
    interrupts.raise(1);
    assert_eq!((events[0].taken(), events[1].taken(), interrupts.pending()), (1, 0, 0b10));
    unmask(&interrupts, Kind::Msix, 1);
    assert_eq!((events[1].taken(), interrupts.pending()), (1, 0));
}

#[test]
fn messages_wait_for_bus_master_enable() {
    let (interrupts, command) = card(InterruptMode::Msi, 0);
    let event = Event::new();
    attach(&interrupts, Kind::Msi, 0, &[&event]);
    interrupts.raise(0);
    assert_eq!(event.taken(), 0);
    command.set(BUS_MASTER);
    interrupts.command_written();
    assert_eq!(event.taken(), 1);
}

#[test]
fn replaced_and_detached_descriptors_fall_silent() {
    let (interrupts, _) = card(InterruptMode::Msix, BUS_MASTER);
    let (old, new) = (Event::new(), Event::new());
    attach(&interrupts, Kind::Msix, 0, &[&old]);
    attach(&interrupts, Kind::Msix, 0, &[&new]);
    interrupts.raise(0);
    interrupts.apply(Kind::Msix, 0..1, Action::Detach);
    interrupts.raise(0);
    assert_eq!((old.taken(), new.taken()), (0, 1));
}

#[test]
fn descriptors_can_be_replaced_while_another_thread_raises() {
    const RAISED: u64 = 20_000;
    let (interrupts, _) = card(InterruptMode::Msix, BUS_MASTER);
    let events = [Event::new(), Event::new()];
    attach(&interrupts, Kind::Msix, 0, &[&events[0]]);
    std::thread::scope(|scope| {
        scope.spawn(|| (0..RAISED).for_each(|_| interrupts.raise(0)));
        (0..2_000).for_each(|turn| attach(&interrupts, Kind::Msix, 0, &[&events[turn % 2]]));
    });
    assert_eq!(events[0].taken() + events[1].taken(), RAISED);
}

#[test]
fn the_line_masks_itself_and_fires_again_when_unmasked_while_asserted() {
    let (interrupts, _) = card(InterruptMode::Intx, 0);
    let event = Event::new();
    attach(&interrupts, Kind::Intx, 0, &[&event]);
    interrupts.raise(0);
    interrupts.raise(1);
    assert!(interrupts.line_asserted());
    assert_eq!(event.taken(), 1);
    unmask(&interrupts, Kind::Intx, 0);
    assert_eq!(event.taken(), 1);
    interrupts.lower(0);
    unmask(&interrupts, Kind::Intx, 0);
    assert_eq!(event.taken(), 1, "cause 1 still holds the line");
    interrupts.lower(1);
    unmask(&interrupts, Kind::Intx, 0);
    assert_eq!((event.taken(), interrupts.line_asserted()), (0, false));
}

#[test]
fn interrupt_disable_silences_the_line_but_not_its_status() {
    let (interrupts, command) = card(InterruptMode::Intx, CommandRegister::INTERRUPT_DISABLE);
    let event = Event::new();
    attach(&interrupts, Kind::Intx, 0, &[&event]);
    interrupts.raise(0);
    assert_eq!((event.taken(), interrupts.line_asserted()), (0, true));
    command.set(0);
    interrupts.command_written();
    assert_eq!(event.taken(), 1);
}

#[test]
fn a_line_asserted_before_its_descriptor_came_fires_at_once() {
    let (interrupts, _) = card(InterruptMode::Intx, 0);
    let event = Event::new();
    interrupts.raise(2);
    attach(&interrupts, Kind::Intx, 0, &[&event]);
    assert_eq!(event.taken(), 1);
}

#[test]
fn clients_trigger_interrupts_of_every_kind() {
    for (mode, kind) in [(InterruptMode::Msix, Kind::Msix), (InterruptMode::Intx, Kind::Intx)] {
        let (interrupts, _) = card(mode, 0);
        let (event, error) = (Event::new(), Event::new());
        attach(&interrupts, kind, 0, &[&event]);
        attach(&interrupts, Kind::Error, 0, &[&error]);
        interrupts.apply(kind, 0..1, Action::Trigger(Selection::All));
        interrupts.apply(Kind::Error, 0..1, Action::Trigger(Selection::Bytes(vec![0])));
        assert_eq!((event.taken(), error.taken()), (1, 0));
        interrupts.fail();
        assert_eq!(error.taken(), 1);
    }
}

#[test]
fn reset_keeps_descriptors_and_clear_does_not() {
    let (interrupts, _) = card(InterruptMode::Intx, 0);
    let event = Event::new();
    attach(&interrupts, Kind::Intx, 0, &[&event]);
    interrupts.raise(0);
    interrupts.reset();
    assert!(!interrupts.line_asserted());
    interrupts.raise(0);
    assert_eq!(event.taken(), 2, "once before, once after the reset, which ends the mask");
    interrupts.clear();
    interrupts.raise(0);
    assert_eq!(event.taken(), 0);
}
