//! `DEVICE_SET_IRQS`.

use std::os::fd::{AsFd, OwnedFd};

use rustix::io::Errno;
use volumepro_device::interrupt::InterruptMode;

use crate::common::*;

const NONE: u32 = 1;
const BOOL: u32 = 1 << 1;
const EVENTFD: u32 = 1 << 2;
const MASK: u32 = 1 << 3;
const UNMASK: u32 = 1 << 4;
const TRIGGER: u32 = 1 << 5;

const INTX: u32 = 0;
const MSI: u32 = 1;
const MSIX: u32 = 2;
const ERROR: u32 = 3;

fn attach(client: &mut Client, index: u32, start: u32, events: &[&OwnedFd]) {
    let descriptors: Vec<_> = events.iter().map(|event| event.as_fd()).collect();
    client.succeed_with(
        SET_IRQS,
        &set_irqs(EVENTFD | TRIGGER, index, start, events.len() as u32),
        &descriptors,
    );
}

#[test]
fn ranges_out_of_bounds_are_refused() {
    let rig = Rig::new();
    let mut client = rig.client();
    for (index, start, count) in [
        (MSIX, 0, 4),
        (MSIX, 3, 1),
        (MSIX, 2, 2),
        (MSIX, u32::MAX, u32::MAX),
        (MSIX, 0, u32::MAX),
        (MSIX, u32::MAX, 1),
        (MSIX, 1, u32::MAX),
        (INTX, 0, 1),
        (ERROR, 0, 2),
        (5, 0, 1),
        (u32::MAX, 0, 1),
    ] {
        for flags in [NONE | TRIGGER, NONE | MASK, NONE | UNMASK, BOOL | TRIGGER, EVENTFD | TRIGGER] {
            assert_eq!(client.fail(SET_IRQS, &set_irqs(flags, index, start, count)), Errno::INVAL);
        }
        let event = event();
        let payload = set_irqs(EVENTFD | TRIGGER, index, start, count);
        assert_eq!(client.fail_with(SET_IRQS, &payload, &[event.as_fd()]), Errno::INVAL);
    }
}

#[test]
fn flags_data_and_descriptors_must_agree() {
    let rig = Rig::new();
    let mut client = rig.client();
    for flags in [
        0,
        NONE,
        BOOL,
        EVENTFD,
        MASK,
        NONE | BOOL | TRIGGER,
        NONE | MASK | UNMASK,
        NONE | TRIGGER | 64,
        u32::MAX,
    ] {
        assert_eq!(client.fail(SET_IRQS, &set_irqs(flags, MSIX, 0, 1)), Errno::INVAL, "{flags:#x}");
    }
    for flags in [NONE | MASK, NONE | UNMASK, BOOL | TRIGGER, EVENTFD | TRIGGER] {
        assert_eq!(client.fail(SET_IRQS, &set_irqs(flags, MSIX, 0, 0)), Errno::INVAL, "nothing to act on");
    }
    for data in [0, 1, 3, 100] {
        let payload = [set_irqs(BOOL | TRIGGER, MSIX, 0, 2), vec![1; data]].concat();
        assert_eq!(client.fail(SET_IRQS, &payload), Errno::INVAL);
    }
    for length in 0..20 {
        assert_eq!(client.fail(SET_IRQS, &set_irqs(NONE | TRIGGER, MSIX, 0, 1)[..length]), Errno::INVAL);
    }
    assert_eq!(client.fail(SET_IRQS, &words(&[19, NONE | TRIGGER, MSIX, 0, 1])), Errno::INVAL);
    let event = event();
    let events = [event.as_fd(); 3];
    assert_eq!(client.fail_with(SET_IRQS, &set_irqs(NONE | TRIGGER, MSIX, 0, 1), &events[..1]), Errno::INVAL);
    assert_eq!(
        client.fail_with(SET_IRQS, &set_irqs(EVENTFD | TRIGGER, MSIX, 0, 2), &events[..1]),
        Errno::INVAL
    );
    assert_eq!(client.fail_with(SET_IRQS, &set_irqs(EVENTFD | TRIGGER, MSIX, 0, 2), &events), Errno::INVAL);
    // Signalled masks, and KVM's resampling: clients then unmask by message.
    for action in [MASK, UNMASK] {
        assert_eq!(
            client.fail_with(SET_IRQS, &set_irqs(EVENTFD | action, MSIX, 0, 1), &events[..1]),
            Errno::OPNOTSUPP
        );
    }
}

#[test]
fn descriptors_that_cannot_be_events_are_refused() {
    let rig = Rig::new();
    let mut client = rig.client();
    let (reader, writer) = std::io::pipe().unwrap();
    let (socket, _peer) = std::os::unix::net::UnixStream::pair().unwrap();
    let file = memory(4096);
    for descriptor in [reader.as_fd(), writer.as_fd(), socket.as_fd(), file.as_fd()] {
        let payload = set_irqs(EVENTFD | TRIGGER, MSIX, 0, 1);
        assert_eq!(client.fail_with(SET_IRQS, &payload, &[descriptor]), Errno::INVAL);
    }
}

#[test]
fn messages_merge_by_start() {
    let rig = Rig::new();
    let mut client = rig.client();
    client.enable();
    let all = [event(), event(), event()];
    // As QEMU does: nothing for one vector, disable, then one message per vector.
    client.succeed(SET_IRQS, &set_irqs(EVENTFD | TRIGGER, MSIX, 0, 1));
    client.succeed(SET_IRQS, &set_irqs(NONE | TRIGGER, MSIX, 0, 0));
    for (vector, event) in all.iter().enumerate() {
        attach(&mut client, MSIX, vector as u32, &[event]);
    }
    (0..3).for_each(|vector| rig.interrupts.raise(vector));
    assert_eq!(all.each_ref().map(events), [1, 1, 1]);
    // All at once, replacing one that stays silent from then on.
    let new = event();
    attach(&mut client, MSIX, 0, &[&new, &all[1], &all[2]]);
    rig.interrupts.raise(0);
    assert_eq!((events(&all[0]), events(&new)), (0, 1));
    client.succeed(SET_IRQS, &set_irqs(EVENTFD | TRIGGER, MSIX, 1, 1));
    rig.interrupts.raise(1);
    assert_eq!(
        (events(&all[1]), events(&new)),
        (0, 1),
        "without a descriptor of its own, it shares the first"
    );
    client.succeed(SET_IRQS, &set_irqs(NONE | TRIGGER, MSIX, 0, 0));
    rig.interrupts.raise(0);
    assert_eq!(events(&new), 0);
}

#[test]
fn clients_mask_unmask_and_trigger() {
    let rig = Rig::new();
    let mut client = rig.client();
    client.enable();
    let all = [event(), event(), event()];
    attach(&mut client, MSI, 0, &[&all[0], &all[1], &all[2]]);
    client.succeed(SET_IRQS, &[set_irqs(BOOL | MASK, MSI, 1, 2), vec![0, 1]].concat());
    (0..3).for_each(|vector| rig.interrupts.raise(vector));
    assert_eq!(all.each_ref().map(events), [1, 1, 0]);
    client.succeed(SET_IRQS, &set_irqs(NONE | UNMASK, MSI, 0, 3));
    assert_eq!(all.each_ref().map(events), [0, 0, 1], "what was held back");
    client.succeed(SET_IRQS, &[set_irqs(BOOL | TRIGGER, MSI, 0, 3), vec![1, 0, 255]].concat());
    client.succeed(SET_IRQS, &set_irqs(NONE | TRIGGER, MSI, 0, 1));
    assert_eq!(all.each_ref().map(events), [2, 0, 1]);
}

#[test]
fn the_line_is_level_triggered() {
    let rig = Rig::with(InterruptMode::Intx);
    let mut client = rig.client();
    let line = event();
    attach(&mut client, INTX, 0, &[&line]);
    rig.interrupts.raise(0);
    rig.interrupts.raise(0);
    assert_eq!((events(&line), client.read(CONFIG, 6, 1)[0] & 8), (1, 8));
    client.succeed(SET_IRQS, &set_irqs(NONE | UNMASK, INTX, 0, 1));
    assert_eq!(events(&line), 1, "still asserted");
    rig.interrupts.lower(0);
    client.succeed(SET_IRQS, &set_irqs(NONE | UNMASK, INTX, 0, 1));
    assert_eq!((events(&line), client.read(CONFIG, 6, 1)[0] & 8), (0, 0));
    client.write(CONFIG, 4, &[0, 4]);
    rig.interrupts.raise(0);
    assert_eq!(events(&line), 0);
    client.write(CONFIG, 4, &[0, 0]);
    assert_eq!(events(&line), 1);
}

#[test]
fn a_failing_device_notifies() {
    let rig = Rig::new();
    let mut client = rig.client();
    let failed = event();
    attach(&mut client, ERROR, 0, &[&failed]);
    rig.interrupts.fail();
    assert_eq!(events(&failed), 1);
}
