//! Interrupts: `DEVICE_SET_IRQS`.

use std::os::fd::OwnedFd;

use rustix::fs::{FileType, fstat};
use rustix::io::Errno;

use super::Session;
use super::information::kind;
use crate::interrupt::{Action, Selection};
use crate::protocol::Device;
use crate::protocol::wire::Fields;

const DATA_NONE: u32 = 1;
const DATA_BOOL: u32 = 1 << 1;
const DATA_EVENTFD: u32 = 1 << 2;
const ACTION_MASK: u32 = 1 << 3;
const ACTION_UNMASK: u32 = 1 << 4;
const ACTION_TRIGGER: u32 = 1 << 5;
const DATA: u32 = DATA_NONE | DATA_BOOL | DATA_EVENTFD;
const ACTION: u32 = ACTION_MASK | ACTION_UNMASK | ACTION_TRIGGER;
const SET_SIZE: u32 = 20;

impl<D: Device> Session<'_, D> {
    /// Sets event descriptors, or masks, unmasks or triggers. Ranges merge: what they do not name stays.
    pub(super) fn set_irqs(&mut self, mut fields: Fields<'_>, events: Vec<OwnedFd>) -> Result<(), Errno> {
        let (argsz, flags, kind) = (fields.u32()?, fields.u32()?, kind(fields.u32()?)?);
        let (start, count) = (fields.index()?, fields.index()?);
        let end = start.checked_add(count).filter(|&end| end <= self.interrupts.count(kind));
        if argsz < SET_SIZE || flags & !(DATA | ACTION) != 0 {
            return Err(Errno::INVAL);
        }
        let range = start..end.ok_or(Errno::INVAL)?;
        if flags == DATA_NONE | ACTION_TRIGGER && range == (0..0) {
            self.interrupts.disable(kind);
            return Ok(());
        }
        if range.is_empty() {
            return Err(Errno::INVAL);
        }
        let action = action(flags, count, fields.0, events)?;
        self.interrupts.apply(kind, range, action);
        Ok(())
    }
}

fn action(flags: u32, count: usize, data: &[u8], events: Vec<OwnedFd>) -> Result<Action, Errno> {
    let selection = match flags & DATA {
        DATA_EVENTFD => return attach(flags & ACTION, count, events),
        _ if !events.is_empty() => return Err(Errno::INVAL),
        DATA_NONE => Selection::All,
        DATA_BOOL if data.len() == count => Selection::Bytes(data.to_vec()),
        _ => return Err(Errno::INVAL),
    };
    match flags & ACTION {
        ACTION_MASK => Ok(Action::Mask(selection)),
        ACTION_UNMASK => Ok(Action::Unmask(selection)),
        ACTION_TRIGGER => Ok(Action::Trigger(selection)),
        _ => Err(Errno::INVAL),
    }
}

/// No descriptor means to take those of the range away.
fn attach(action: u32, count: usize, events: Vec<OwnedFd>) -> Result<Action, Errno> {
    match action {
        ACTION_TRIGGER if events.is_empty() => Ok(Action::Detach),
        ACTION_TRIGGER if events.len() == count && events.iter().all(is_anonymous) => {
            Ok(Action::Attach(events))
        }
        // Events about masks, and KVM's unmasking without the VMM. VMMs then do it by message.
        ACTION_MASK | ACTION_UNMASK => Err(Errno::OPNOTSUPP),
        _ => Err(Errno::INVAL),
    }
}

/// Whether a descriptor is of no file, socket, pipe or device, as those of events are.
fn is_anonymous(descriptor: &OwnedFd) -> bool {
    fstat(descriptor).is_ok_and(|status| FileType::from_raw_mode(status.st_mode) == FileType::Unknown)
}
