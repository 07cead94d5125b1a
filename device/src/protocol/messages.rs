//! Client memory without a descriptor: `DMA_READ` and `DMA_WRITE`, sent by the server.
//!
//! They share the socket with the client's requests. The thread that receives passes replies on to the thread
//! that waits for one; so that thread must be another.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};
use std::time::Duration;

use rustix::io::Errno;

use super::socket::Socket;
use super::wire::{Append, Command, Fields, Header, message_size};
use crate::dma::ClientMemory;

/// How long the client may take for an answer. It answers at once, unless its main loop is busy.
const PATIENCE: Duration = Duration::from_secs(5);

#[derive(Debug, Default)]
enum Exchange {
    #[default]
    Idle,
    Waiting {
        id: u16,
        command: Command,
    },
    Done(Result<Vec<u8>, Errno>),
    /// The connection is over.
    Closed,
}

/// The client's memory by messages. One is under way at a time.
#[derive(Debug)]
pub(super) struct Messages {
    socket: Arc<Socket>,
    receiver: ThreadId,
    /// Bytes per message; known once limits have been negotiated.
    transfer: Mutex<usize>,
    /// The last message's id, held during an exchange.
    turn: Mutex<u16>,
    exchange: Mutex<Exchange>,
    done: Condvar,
}

impl Messages {
    /// Messages over `socket`, which the calling thread receives from.
    pub(super) fn new(socket: Arc<Socket>) -> Self {
        Self {
            socket,
            receiver: thread::current().id(),
            transfer: Mutex::new(0),
            turn: Mutex::new(0),
            exchange: Mutex::default(),
            done: Condvar::new(),
        }
    }

    /// Sets how many bytes a message may carry.
    pub(super) fn limit(&self, transfer: usize) {
        *lock(&self.transfer) = transfer;
    }

    /// Takes a reply that has come in. Returns whether it was waited for.
    pub(super) fn deliver(&self, header: &Header, payload: &[u8]) -> bool {
        let mut exchange = lock(&self.exchange);
        let Exchange::Waiting { id, command } = *exchange else { return false };
        if (id, command as u16) != (header.id, header.command) {
            return false;
        }
        *exchange = Exchange::Done(match header.flags & Header::ERROR {
            0 => Ok(payload.to_vec()),
            _ => Err(errno(header.error)),
        });
        self.done.notify_all();
        true
    }

    /// Ends every exchange, now and later: the client has gone.
    pub(super) fn close(&self) {
        *lock(&self.exchange) = Exchange::Closed;
        self.done.notify_all();
    }

    /// Bytes per message, of which there is at least one.
    fn piece(&self) -> Result<usize, Errno> {
        Some(*lock(&self.transfer)).filter(|&transfer| transfer > 0).ok_or(Errno::OPNOTSUPP)
    }

    /// Sends a command for `count` bytes at `iova`, and waits for the payload of its reply.
    fn exchange(&self, command: Command, iova: u64, count: usize, data: &[u8]) -> Result<Vec<u8>, Errno> {
        if thread::current().id() == self.receiver {
            return Err(Errno::DEADLK);
        }
        let mut turn = lock(&self.turn);
        *turn = turn.wrapping_add(1);
        self.begin(Exchange::Waiting { id: *turn, command })?;
        let size = message_size(16 + data.len());
        let header = Header { id: *turn, command: command as u16, size, ..Header::default() };
        let mut message = header.encode().to_vec();
        message.u64(iova);
        message.u64(count as u64);
        message.extend(data);
        if self.socket.send(&message, None).is_err() {
            self.abort();
        }
        self.wait()
    }

    fn begin(&self, next: Exchange) -> Result<(), Errno> {
        let mut exchange = lock(&self.exchange);
        if matches!(*exchange, Exchange::Closed) {
            return Err(Errno::PIPE);
        }
        *exchange = next;
        Ok(())
    }

    fn wait(&self) -> Result<Vec<u8>, Errno> {
        let waiting = |exchange: &mut Exchange| matches!(exchange, Exchange::Waiting { .. });
        let waited = self.done.wait_timeout_while(lock(&self.exchange), PATIENCE, waiting);
        let (mut exchange, _) = waited.unwrap_or_else(PoisonError::into_inner);
        match std::mem::take(&mut *exchange) {
            Exchange::Done(answer) => answer,
            Exchange::Waiting { .. } | Exchange::Idle => Err(Errno::TIMEDOUT),
            Exchange::Closed => {
                *exchange = Exchange::Closed;
                Err(Errno::PIPE)
            }
        }
    }
}

impl ClientMemory for Messages {
    fn read(&self, iova: u64, data: &mut [u8]) -> Result<(), Errno> {
        let mut at = iova;
        for piece in data.chunks_mut(self.piece()?) {
            let answer = self.exchange(Command::DmaRead, at, piece.len(), &[])?;
            let mut fields = Fields(&answer);
            let (_iova, _count) = (fields.u64()?, fields.u64()?);
            // Shorter data would leave bytes of this process in the place of the client's.
            if fields.0.len() != piece.len() {
                return Err(Errno::PROTO);
            }
            piece.copy_from_slice(fields.0);
            at = at.wrapping_add(piece.len() as u64);
        }
        Ok(())
    }

    fn write(&self, iova: u64, data: &[u8]) -> Result<(), Errno> {
        let mut at = iova;
        for piece in data.chunks(self.piece()?) {
            // QEMU's reply has no payload, the specification's has; the header says all.
            self.exchange(Command::DmaWrite, at, piece.len(), piece)?;
            at = at.wrapping_add(piece.len() as u64);
        }
        Ok(())
    }

    fn abort(&self) {
        let mut exchange = lock(&self.exchange);
        if matches!(*exchange, Exchange::Waiting { .. }) {
            *exchange = Exchange::Done(Err(Errno::CANCELED));
            self.done.notify_all();
        }
    }
}

/// The client's error, if the system knows such a number.
fn errno(error: u32) -> Errno {
    i32::try_from(error)
        .ok()
        .filter(|code| (1..4096).contains(code))
        .map_or(Errno::IO, Errno::from_raw_os_error)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
