//! One connection, from its first byte to its last: framing, replies, and what ends it.

use std::os::fd::AsFd;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use rustix::event::PollFlags;
use rustix::io::Errno;

use super::messages::Messages;
use super::session::{Reply, Session};
use super::socket::{Descriptors, Socket};
use super::wire::{HEADER_SIZE, Header, MessageType};
use super::{Counters, Device, Ended, MAX_TRANSFER};

/// The largest message: a write of as much data as one message may carry.
const MAX_MESSAGE: usize = HEADER_SIZE + 16 + MAX_TRANSFER;

/// A connection with a client.
pub(super) struct Connection<'a, D> {
    socket: Arc<Socket>,
    messages: Arc<Messages>,
    session: Session<'a, D>,
    counters: &'a Counters,
    /// Both keep their memory from message to message.
    payload: Vec<u8>,
    reply: Reply,
}

impl<'a, D: Device> Connection<'a, D> {
    pub(super) fn new(
        socket: Arc<Socket>,
        messages: Arc<Messages>,
        session: Session<'a, D>,
        counters: &'a Counters,
    ) -> Self {
        Self { socket, messages, session, counters, payload: Vec::new(), reply: Reply::default() }
    }

    /// Serves requests until the connection ends.
    pub(super) fn run(&mut self) -> Ended {
        loop {
            if let Err(ended) = self.serve_one() {
                return ended;
            }
        }
    }

    fn serve_one(&mut self) -> Result<(), Ended> {
        let mut descriptors = Descriptors::default();
        let mut header = [0; HEADER_SIZE];
        self.socket.wait(PollFlags::IN)?;
        self.socket.receive(&mut header, &mut descriptors)?;
        let header = Header::decode(header);
        let Some(length) = header.payload_size().filter(|length| HEADER_SIZE + length <= MAX_MESSAGE) else {
            // Nobody knows where the next message begins.
            self.refuse(&header, Errno::MSGSIZE)?;
            return Err(Ended::Framing);
        };
        self.payload.resize(length, 0);
        self.socket.receive(&mut self.payload, &mut descriptors)?;
        match header.message_type() {
            MessageType::Command => self.answer(&header, descriptors),
            MessageType::Reply => {
                if !self.messages.deliver(&header, &self.payload) {
                    Counters::count(&self.counters.stray_replies);
                }
                Ok(())
            }
            MessageType::Unknown => self.refuse(&header, Errno::INVAL),
        }
    }

    fn answer(&mut self, header: &Header, descriptors: Descriptors) -> Result<(), Ended> {
        Counters::count(&self.counters.requests);
        self.reply.descriptor = None;
        self.reply.bytes.clear();
        self.reply.bytes.resize(HEADER_SIZE, 0);
        let request = || self.session.request(header.command, &self.payload, descriptors, &mut self.reply);
        // The device is reset before anything else looks at it.
        let Ok(result) = catch_unwind(AssertUnwindSafe(request)) else {
            Counters::count(&self.counters.panics);
            return Err(Ended::Panicked);
        };
        match result {
            Ok(()) => self.reply(header),
            Err(errno) => {
                tracing::debug!(command = header.command, size = header.size, %errno, "request refused");
                self.refuse(header, errno)?;
                if errno == Errno::PROTONOSUPPORT { Err(Ended::Version) } else { Ok(()) }
            }
        }
    }

    fn reply(&mut self, header: &Header) -> Result<(), Ended> {
        if !header.wants_reply() {
            return Ok(());
        }
        let length = self.reply.bytes.len().saturating_sub(HEADER_SIZE);
        if let Some(place) = self.reply.bytes.first_chunk_mut() {
            *place = header.reply(Ok(length)).encode();
        }
        let descriptor = self.reply.descriptor.as_ref().map(|memory| memory.as_fd());
        self.socket.send(&self.reply.bytes, descriptor)
    }

    fn refuse(&self, header: &Header, errno: Errno) -> Result<(), Ended> {
        Counters::count(&self.counters.refused);
        if !header.wants_reply() {
            return Ok(());
        }
        self.socket.send(&header.reply(Err(errno)).encode(), None)
    }
}
