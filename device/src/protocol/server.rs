//! Clients, one after another.

use std::io;
use std::os::fd::OwnedFd;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::{self, Builder};

use crossbeam::channel::bounded;

use super::connection::Connection;
use super::door::Door;
use super::messages::Messages;
use super::session::Session;
use super::socket::Socket;
use super::{Counters, Device, Ended, ResetReason};
use crate::dma::DmaTable;
use crate::interrupt::Interrupts;
use crate::listener::Listener;
use crate::stop::Stop;

/// Serves a device to clients, one after another, on the calling thread.
///
/// Every client finds the device in power-on state, without memory or interrupts of the one before.
#[derive(Debug)]
pub struct Server<D> {
    device: D,
    dma: Arc<DmaTable>,
    interrupts: Arc<Interrupts>,
    stop: Stop,
    counters: Arc<Counters>,
}

impl<D: Device> Server<D> {
    /// A server of `device`, which shares `dma` and `interrupts` with it.
    #[must_use]
    pub fn new(device: D, dma: Arc<DmaTable>, interrupts: Arc<Interrupts>, stop: Stop) -> Self {
        Self { device, dma, interrupts, stop, counters: Arc::default() }
    }

    /// Counts of what has happened, to look at from anywhere.
    #[must_use]
    pub fn counters(&self) -> Arc<Counters> {
        Arc::clone(&self.counters)
    }

    /// The device, between clients.
    pub fn device(&mut self) -> &mut D {
        &mut self.device
    }

    /// Serves clients that come to `listener`, one after another, until the stop is requested. A client that comes
    /// while another one is connected is told that the device is busy.
    ///
    /// # Errors
    ///
    /// If accepting fails for a reason that does not pass.
    pub fn listen(&mut self, listener: &Listener) -> io::Result<()> {
        let (stop, counters) = (self.stop.clone(), self.counters());
        let door = &Door::new(listener, &stop, &counters);
        let (enter, clients) = bounded(0);
        thread::scope(|scope| {
            let keeper = Builder::new().name("door".into());
            // The door takes its end along, so that the loop ends when the door does.
            let keeper = keeper.spawn_scoped(scope, move || door.keep(&enter))?;
            for client in &clients {
                if self.serve_until(&client, || door.has_left(&client)) == Ended::Stopped {
                    break;
                }
            }
            // Whoever is about to enter is not let in any more.
            drop(clients);
            keeper.join().unwrap_or_else(|_| Err(io::Error::other("the door panicked")))
        })
    }

    /// Serves one client that is connected already, until it goes, breaks the protocol, or the stop is requested.
    pub fn serve(&mut self, socket: OwnedFd) -> Ended {
        let socket = Arc::new(Socket::new(socket, self.stop.clone()));
        self.serve_until(&socket, || ())
    }

    /// Serves a client; `left` is told as soon as nothing more is done for it.
    fn serve_until(&mut self, socket: &Arc<Socket>, left: impl FnOnce()) -> Ended {
        Counters::count(&self.counters.connections);
        let messages = Arc::new(Messages::new(Arc::clone(socket)));
        let mut ended = Ended::Panicked;
        if self.reset(ResetReason::Connection) {
            let session = Session::new(&mut self.device, &self.dma, &self.interrupts, Arc::clone(&messages));
            let socket = Arc::clone(socket);
            ended = Connection::new(socket, Arc::clone(&messages), session, &self.counters).run();
        }
        left();
        tracing::info!(counters = ?self.counters, "connection ended: {ended}");
        // The engine may be waiting for this client, and the reset for the engine.
        messages.close();
        self.reset(ResetReason::LostConnection);
        self.dma.clear();
        self.interrupts.clear();
        ended
    }

    /// Returns whether the device came through it.
    fn reset(&mut self, reason: ResetReason) -> bool {
        let reset = catch_unwind(AssertUnwindSafe(|| self.device.reset(reason)));
        if reset.is_err() {
            Counters::count(&self.counters.panics);
        }
        reset.is_ok()
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixStream;
    use std::sync::atomic::Ordering;

    use rustix::io::Errno;

    use super::*;
    use crate::interrupt::InterruptMode;
    use crate::pci::CommandRegister;
    use crate::protocol::Region;

    /// A device that panics in a reset that comes for `bad`.
    struct Fragile {
        bad: ResetReason,
    }

    impl Device for Fragile {
        fn regions(&self) -> &[Region] {
            &[]
        }

        fn read(&mut self, _: usize, _: u64, _: &mut [u8]) -> Result<(), Errno> {
            Ok(())
        }

        fn write(&mut self, _: usize, _: u64, _: &[u8]) -> Result<(), Errno> {
            Ok(())
        }

        fn reset(&mut self, reason: ResetReason) {
            assert_ne!(reason, self.bad);
        }
    }

    #[test]
    fn a_device_that_panics_in_its_reset_costs_that_connection() {
        let command = Arc::new(CommandRegister::default());
        let dma = Arc::new(DmaTable::new(Arc::clone(&command)));
        let interrupts = Arc::new(Interrupts::new(InterruptMode::Msix, 1, command));
        let device = Fragile { bad: ResetReason::Connection };
        let mut server = Server::new(device, dma, interrupts, Stop::new().unwrap());
        let mut serve = |bad| {
            server.device().bad = bad;
            let (ours, theirs) = UnixStream::pair().unwrap();
            drop(theirs);
            (server.serve(ours.into()), server.counters().panics.load(Ordering::Relaxed))
        };
        assert_eq!(serve(ResetReason::Connection), (Ended::Panicked, 1));
        assert_eq!(serve(ResetReason::LostConnection), (Ended::Disconnected, 2));
        assert_eq!(serve(ResetReason::Device), (Ended::Disconnected, 2));
    }
}
