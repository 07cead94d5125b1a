//! What a client asks for, request by request. Framing and replies are the connection's affair.

mod access;
mod information;
mod interrupts;
mod memory;

use std::os::fd::OwnedFd;
use std::sync::Arc;

use rustix::io::Errno;

use super::messages::Messages;
use super::socket::{Descriptors, MAX_DESCRIPTORS};
use super::version::{self, Limits};
use super::wire::{Command, Fields};
use super::{Device, Region, ResetReason};
use crate::backing::Backing;
use crate::dma::DmaTable;
use crate::interrupt::Interrupts;

/// The reply to a request, header aside.
#[derive(Debug, Default)]
pub(super) struct Reply {
    /// The message; handlers append the payload.
    pub(super) bytes: Vec<u8>,
    /// Memory whose descriptor goes with it.
    pub(super) descriptor: Option<Arc<Backing>>,
}

/// The state of one client's requests.
pub(super) struct Session<'a, D> {
    pub(super) device: &'a mut D,
    pub(super) dma: &'a DmaTable,
    pub(super) interrupts: &'a Interrupts,
    pub(super) messages: Arc<Messages>,
    limits: Option<Limits>,
}

impl<'a, D: Device> Session<'a, D> {
    pub(super) fn new(
        device: &'a mut D,
        dma: &'a DmaTable,
        interrupts: &'a Interrupts,
        messages: Arc<Messages>,
    ) -> Self {
        Self { device, dma, interrupts, messages, limits: None }
    }

    /// Carries out one request and appends the payload of its reply.
    ///
    /// # Errors
    ///
    /// What the error reply says. Requests come after the negotiation, which succeeds once.
    pub(super) fn request(
        &mut self,
        code: u16,
        payload: &[u8],
        descriptors: Descriptors,
        reply: &mut Reply,
    ) -> Result<(), Errno> {
        let command = Command::request(code).ok_or(Errno::OPNOTSUPP)?;
        let allowed = match command {
            Command::DmaMap => 1,
            Command::SetIrqs => MAX_DESCRIPTORS,
            _ => 0,
        };
        if descriptors.surplus || descriptors.taken.len() > allowed {
            return Err(Errno::INVAL);
        }
        if command == Command::Version {
            return self.negotiate(payload, reply);
        }
        let limits = self.limits.ok_or(Errno::INVAL)?;
        self.dispatch(command, limits, Fields(payload), descriptors.taken, reply)
    }

    fn negotiate(&mut self, payload: &[u8], reply: &mut Reply) -> Result<(), Errno> {
        if self.limits.is_some() {
            return Err(Errno::INVAL);
        }
        let limits = version::negotiate(payload)?;
        self.messages.limit(limits.transfer);
        self.limits = Some(limits);
        version::answer(limits, &mut reply.bytes);
        Ok(())
    }

    fn dispatch(
        &mut self,
        command: Command,
        limits: Limits,
        fields: Fields<'_>,
        descriptors: Vec<OwnedFd>,
        reply: &mut Reply,
    ) -> Result<(), Errno> {
        match command {
            Command::DmaMap => self.dma_map(fields, descriptors),
            Command::DmaUnmap => self.dma_unmap(fields, &mut reply.bytes),
            Command::GetInfo => self.device_info(fields, &mut reply.bytes),
            Command::GetRegionInfo => self.region_info(fields, limits.descriptors, reply),
            Command::GetIrqInfo => self.irq_info(fields, &mut reply.bytes),
            Command::SetIrqs => self.set_irqs(fields, descriptors),
            Command::RegionRead => self.region_read(fields, &mut reply.bytes),
            Command::RegionWrite => self.region_write(fields, &mut reply.bytes),
            Command::RegionWriteMulti if limits.write_multiple => {
                self.region_write_multi(fields, &mut reply.bytes)
            }
            Command::Reset => {
                self.device.reset(ResetReason::Device);
                Ok(())
            }
            Command::Version | Command::DmaRead | Command::DmaWrite | Command::RegionWriteMulti => {
                Err(Errno::OPNOTSUPP)
            }
        }
    }

    /// A region of the device, of size 0 if it does not have it.
    fn region(&self, index: usize) -> Region {
        self.device.regions().get(index).cloned().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixStream;

    use super::*;
    use crate::interrupt::InterruptMode;
    use crate::pci::CommandRegister;
    use crate::protocol::socket::Socket;
    use crate::protocol::wire::Append;
    use crate::stop::Stop;

    struct Nothing;

    impl Device for Nothing {
        fn regions(&self) -> &[Region] {
            &[]
        }

        fn read(&mut self, _: usize, _: u64, _: &mut [u8]) -> Result<(), Errno> {
            Ok(())
        }

        fn write(&mut self, _: usize, _: u64, _: &[u8]) -> Result<(), Errno> {
            Ok(())
        }

        fn reset(&mut self, _: ResetReason) {}
    }

    /// What a new session that has negotiated says to a request.
    fn ask(command: Command, payload: &[u8], count: usize, surplus: bool) -> Result<(), Errno> {
        let command_register = Arc::new(CommandRegister::default());
        let dma = DmaTable::new(Arc::clone(&command_register));
        let interrupts = Interrupts::new(InterruptMode::Msix, 32, command_register);
        let socket = Socket::new(UnixStream::pair().unwrap().0.into(), Stop::new().unwrap());
        let mut device = Nothing;
        let mut session =
            Session::new(&mut device, &dma, &interrupts, Arc::new(Messages::new(Arc::new(socket))));
        let mut reply = Reply::default();
        if command != Command::Version {
            let version = [[0; 4].as_slice(), b"{\"capabilities\":{\"write_multiple\":true}}\0"].concat();
            session.request(Command::Version as u16, &version, Descriptors::default(), &mut reply)?;
        }
        let taken = (0..count)
            .map(|_| Stop::new().unwrap())
            .map(|event| std::os::fd::AsFd::as_fd(&event).try_clone_to_owned().unwrap());
        session.request(command as u16, payload, Descriptors { taken: taken.collect(), surplus }, &mut reply)
    }

    fn words(words: &[u32]) -> Vec<u8> {
        let mut payload = Vec::new();
        words.iter().for_each(|word| payload.u32(*word));
        payload
    }

    /// Requests that are in order without descriptors.
    fn requests() -> Vec<(Command, Vec<u8>)> {
        vec![
            (Command::Version, vec![0; 4]),
            (Command::DmaUnmap, words(&[24, 0, 0, 0, 4096, 0])),
            (Command::GetInfo, words(&[16, 0, 0, 0])),
            (Command::GetRegionInfo, words(&[32, 0, 0, 0, 0, 0, 0, 0])),
            (Command::GetIrqInfo, words(&[16, 0, 2, 0])),
            (Command::RegionWriteMulti, words(&[0, 0])),
            (Command::Reset, vec![]),
        ]
    }

    #[test]
    fn requests_that_take_no_descriptor_are_refused_with_one() {
        for (command, payload) in requests() {
            assert_eq!(ask(command, &payload, 0, false), Ok(()), "{command:?}");
            assert_eq!(ask(command, &payload, 1, false), Err(Errno::INVAL), "{command:?}");
            assert_eq!(ask(command, &payload, 0, true), Err(Errno::INVAL), "{command:?}");
        }
    }

    #[test]
    fn surplus_descriptors_are_refused_where_descriptors_belong() {
        let (attach, map) = (words(&[20, 1 << 2 | 1 << 5, 2, 0, 16]), words(&[32, 3, 0, 0, 0, 0, 4096, 0]));
        assert_eq!(ask(Command::SetIrqs, &attach, 16, false), Ok(()));
        assert_eq!(ask(Command::SetIrqs, &attach, 16, true), Err(Errno::INVAL));
        assert_eq!(ask(Command::DmaMap, &map, 0, false), Ok(()));
        assert_eq!(ask(Command::DmaMap, &map, 0, true), Err(Errno::INVAL));
    }
}
