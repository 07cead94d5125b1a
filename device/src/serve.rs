//! A card on a thread of its own: the process, other programs that carry a card inside, and tests start here.

use std::fmt;
use std::io;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};

use vg500_regs::pci::{ALTERNATE_VENDOR_ID, VECTORS, VENDOR_ID, VOXEL_MEMORY_SIZES};

use crate::card::{Card, Host};
use crate::config::Config;
use crate::dma::DmaTable;
use crate::interrupt::Interrupts;
use crate::listener::Listener;
use crate::pci::CommandRegister;
use crate::protocol::{Counters, Ended, Server};
use crate::stop::Stop;
use crate::trace::Trace;

/// Where clients come from.
#[derive(Debug)]
pub enum Clients {
    /// One after another from a listening socket.
    Listener(Listener),
    /// One that is connected already; the card ends with it.
    Stream(UnixStream),
}

impl From<Listener> for Clients {
    fn from(listener: Listener) -> Self {
        Self::Listener(listener)
    }
}

impl From<UnixStream> for Clients {
    fn from(stream: UnixStream) -> Self {
        Self::Stream(stream)
    }
}

/// Why there is no card.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The card has another vendor ID.
    #[error("vendor ID {0:#06x}: the card is known by {VENDOR_ID:#06x} and {ALTERNATE_VENDOR_ID:#06x}")]
    Vendor(u16),
    /// Voxel memory does not come in this size.
    #[error("voxel memory of {0} bytes: it comes in sizes of {VOXEL_MEMORY_SIZES:?} bytes")]
    VoxelMemory(u64),
    /// The trace cannot be written.
    #[error("{}: {source}", path.display())]
    Trace {
        /// The trace file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The system has no memory, threads or descriptors left.
    #[error("the card cannot be set up: {0}")]
    System(#[from] io::Error),
}

/// A card that is served. Dropping it stops it.
pub struct Handle {
    stop: Stop,
    counters: Arc<Counters>,
    thread: Option<JoinHandle<io::Result<()>>>,
}

/// Serves a card until it is stopped; clients that connect at once are answered as soon as it is ready.
///
/// # Errors
///
/// [`ServeError`] if `config` asks for a card that does not exist, or the system cannot provide it.
pub fn serve(clients: impl Into<Clients>, config: &Config) -> Result<Handle, ServeError> {
    prepare(clients, config)?.start()
}

/// A card for which every file is open and no thread runs yet.
#[derive(Debug)]
pub struct Prepared {
    clients: Clients,
    config: Config,
    trace: Trace,
    stop: Stop,
}

/// The first half of [`serve`].
///
/// # Errors
///
/// As for [`serve`].
pub fn prepare(clients: impl Into<Clients>, config: &Config) -> Result<Prepared, ServeError> {
    check(config)?;
    let trace = match &config.trace {
        Some(path) => Trace::to(path).map_err(|source| ServeError::Trace { path: path.clone(), source })?,
        None => Trace::off(),
    };
    Ok(Prepared { clients: clients.into(), config: config.clone(), trace, stop: Stop::new()? })
}

impl Prepared {
    /// The second half of [`serve`].
    ///
    /// # Errors
    ///
    /// If the system has no memory, threads or descriptors left.
    pub fn start(self) -> Result<Handle, ServeError> {
        let Self { clients, config, trace, stop } = self;
        let server = server(&config, trace, stop.clone())?;
        let counters = server.counters();
        let thread = Builder::new().name("card".into()).spawn(move || run(server, clients))?;
        Ok(Handle { stop, counters, thread: Some(thread) })
    }
}

fn run(mut server: Server<Card>, clients: Clients) -> io::Result<()> {
    match clients {
        Clients::Listener(listener) => server.listen(&listener),
        Clients::Stream(stream) => match server.serve(stream.into()) {
            Ended::Failed(errno) => Err(errno.into()),
            _ => Ok(()),
        },
    }
}

impl Handle {
    /// What stops the card from any thread.
    #[must_use]
    pub fn stopper(&self) -> Stop {
        self.stop.clone()
    }

    /// Counts of what clients have done.
    #[must_use]
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Waits for the card's end, which comes when it is stopped or its only client goes.
    ///
    /// # Errors
    ///
    /// If it ended because clients could not be accepted any more, or by a defect.
    pub fn join(mut self) -> io::Result<()> {
        self.wait()
    }

    /// Stops the card, whatever its client does, and waits for its end.
    ///
    /// # Errors
    ///
    /// As for [`join`](Self::join).
    pub fn stop(mut self) -> io::Result<()> {
        self.stop.request();
        self.wait()
    }

    fn wait(&mut self) -> io::Result<()> {
        let Some(thread) = self.thread.take() else { return Ok(()) };
        thread.join().unwrap_or_else(|_| Err(io::Error::other("the card's thread panicked")))
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        self.stop.request();
        if let Err(error) = self.wait() {
            tracing::error!("the card ended: {error}");
        }
    }
}

impl fmt::Debug for Handle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Handle").field("counters", &self.counters).finish_non_exhaustive()
    }
}

fn check(config: &Config) -> Result<(), ServeError> {
    if ![VENDOR_ID, ALTERNATE_VENDOR_ID].contains(&config.vendor) {
        return Err(ServeError::Vendor(config.vendor));
    }
    if !VOXEL_MEMORY_SIZES.contains(&config.voxel_memory) {
        return Err(ServeError::VoxelMemory(config.voxel_memory));
    }
    Ok(())
}

fn server(config: &Config, trace: Trace, stop: Stop) -> Result<Server<Card>, ServeError> {
    let command = Arc::new(CommandRegister::default());
    let host = Host {
        dma: Arc::new(DmaTable::new(Arc::clone(&command))),
        interrupts: Arc::new(Interrupts::new(config.interrupts, VECTORS, Arc::clone(&command))),
        command,
    };
    let card = Card::new(config, trace, &host)?;
    Ok(Server::new(card, host.dma, host.interrupts, stop))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(config: Config) -> String {
        let (ours, _theirs) = UnixStream::pair().unwrap();
        serve(ours, &config).unwrap_err().to_string()
    }

    #[test]
    fn cards_that_do_not_exist_are_refused_in_one_line() {
        let size = refused(Config { voxel_memory: 64 << 20, ..Config::default() });
        assert!(size.starts_with("voxel memory of 67108864 bytes"), "{size}");
        let vendor = refused(Config { vendor: 0x8086, ..Config::default() });
        assert!(vendor.starts_with("vendor ID 0x8086"), "{vendor}");
        let trace = refused(Config { trace: Some("/nowhere/trace".into()), ..Config::default() });
        assert!(trace.starts_with("/nowhere/trace: "), "{trace}");
    }

    #[test]
    fn a_card_for_one_client_ends_with_it_or_when_stopped() {
        let (ours, theirs) = UnixStream::pair().unwrap();
        let handle = serve(ours, &Config::default()).unwrap();
        drop(theirs);
        handle.join().unwrap();
        let (ours, _theirs) = UnixStream::pair().unwrap();
        serve(ours, &Config::default()).unwrap().stop().unwrap();
    }

    #[test]
    fn dropping_the_handle_removes_the_socket() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("card.sock");
        let handle = serve(Listener::bind(&path).unwrap(), &Config::default()).unwrap();
        assert!(path.exists());
        drop(handle);
        assert!(!path.exists());
    }
}
