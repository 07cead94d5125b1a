//! The door: one client is let in at a time, others are turned away.

use std::io::{self, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crossbeam::channel::Sender;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::net::{SocketFlags, accept_with};

use super::Counters;
use super::socket::Socket;
use super::wire::{HEADER_SIZE, Header};
use crate::listener::Listener;
use crate::stop::Stop;

/// How long to wait before accepting again when the process has no descriptor or memory left.
const RECOVERY: Duration = Duration::from_millis(100);
/// How long the last client has to go before the next one is turned away. A process that has just closed its end may
/// have a child that is about to.
const GRACE: Duration = Duration::from_millis(200);
/// How long a client that is turned away may take for each part of its first message.
const PATIENCE: Duration = Duration::from_millis(100);
/// Bytes of that message that are looked at.
const FIRST_MESSAGE: usize = 16 << 10;

/// Accepts clients on a thread of its own, so that nobody waits for an answer while another client is served.
#[derive(Debug)]
pub(super) struct Door<'a> {
    listener: &'a Listener,
    stop: &'a Stop,
    counters: &'a Counters,
    /// The client that was let in last, until it has left.
    inside: Mutex<Option<Arc<Socket>>>,
}

impl<'a> Door<'a> {
    pub(super) fn new(listener: &'a Listener, stop: &'a Stop, counters: &'a Counters) -> Self {
        Self { listener, stop, counters, inside: Mutex::default() }
    }

    /// Lets clients in, until the stop is requested or the server takes no more.
    ///
    /// A client that comes when the last one has just gone waits until the server has cleaned up behind that.
    pub(super) fn keep(&self, server: &Sender<Arc<Socket>>) -> io::Result<()> {
        while let Some(client) = self.accept()? {
            if self.is_taken() {
                self.turn_away(client);
                continue;
            }
            let client = Arc::new(Socket::new(client, self.stop.clone()));
            *self.inside() = Some(Arc::clone(&client));
            if server.send(client).is_err() {
                break;
            }
        }
        Ok(())
    }

    /// Whether a client is inside who stays.
    fn is_taken(&self) -> bool {
        // The server is not kept from saying that the client has left.
        let inside = self.inside().clone();
        inside.is_some_and(|inside| inside.stays_connected(GRACE)) && self.inside().is_some()
    }

    /// The server has done with a client.
    pub(super) fn has_left(&self, client: &Arc<Socket>) {
        let mut inside = self.inside();
        if inside.as_ref().is_some_and(|inside| Arc::ptr_eq(inside, client)) {
            *inside = None;
        }
    }

    /// The next client, or none once the stop is requested.
    fn accept(&self) -> io::Result<Option<OwnedFd>> {
        loop {
            let mut polled =
                [PollFd::new(self.stop, PollFlags::IN), PollFd::new(self.listener, PollFlags::IN)];
            match poll(&mut polled, None) {
                Ok(_) | Err(Errno::INTR) => {}
                Err(errno) => return Err(errno.into()),
            }
            if polled.first().is_some_and(|stop| !stop.revents().is_empty()) {
                return Ok(None);
            }
            match accept_with(self.listener, SocketFlags::CLOEXEC) {
                Ok(client) => return Ok(Some(client)),
                Err(Errno::AGAIN | Errno::INTR | Errno::CONNABORTED) => {}
                Err(errno @ (Errno::MFILE | Errno::NFILE | Errno::NOBUFS | Errno::NOMEM)) => {
                    tracing::warn!("cannot accept a client now: {errno}");
                    std::thread::sleep(RECOVERY);
                }
                Err(errno) => return Err(errno.into()),
            }
        }
    }

    fn turn_away(&self, client: OwnedFd) {
        Counters::count(&self.counters.turned_away);
        tracing::info!("a client was turned away: another one is served");
        // It may have gone, or say nothing. Then it hears nothing.
        _ = refuse(client.into());
    }

    fn inside(&self) -> MutexGuard<'_, Option<Arc<Socket>>> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Answers the first message of a client, which proposes a version, with `EBUSY`.
fn refuse(mut client: UnixStream) -> io::Result<()> {
    client.set_read_timeout(Some(PATIENCE))?;
    let mut header = [0; HEADER_SIZE];
    client.read_exact(&mut header)?;
    let header = Header::decode(header);
    if header.payload_size().is_some_and(|size| size > 0) {
        _ = client.read(&mut [0; FIRST_MESSAGE])?;
    }
    if header.wants_reply() {
        client.write_all(&header.reply(Err(Errno::BUSY)).encode())?;
    }
    Ok(())
}
