//! The stream socket: exact numbers of bytes in and out, descriptors beside them, and a way to stop waiting.

use std::io::{IoSlice, IoSliceMut};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use rustix::cmsg_space;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::net::{
    RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, ReturnFlags, SendAncillaryBuffer,
    SendAncillaryMessage, SendFlags, recvmsg, sendmsg,
};

use super::Ended;
use crate::stop::Stop;

/// Descriptors that one message may carry; what VMMs send at most. More are closed and reported.
pub(super) const MAX_DESCRIPTORS: usize = 16;

/// Descriptors that came with a message.
#[derive(Debug, Default)]
pub(super) struct Descriptors {
    pub(super) taken: Vec<OwnedFd>,
    /// Whether there were more than [`MAX_DESCRIPTORS`].
    pub(super) surplus: bool,
}

impl Descriptors {
    fn push(&mut self, descriptor: OwnedFd) {
        if self.taken.len() < MAX_DESCRIPTORS {
            self.taken.push(descriptor);
        } else {
            self.surplus = true;
        }
    }
}

/// A connected Unix stream socket. One thread receives; any thread sends whole messages.
#[derive(Debug)]
pub(super) struct Socket {
    socket: OwnedFd,
    stop: Stop,
    sending: Mutex<()>,
}

impl Socket {
    pub(super) fn new(socket: OwnedFd, stop: Stop) -> Self {
        Self { socket, stop, sending: Mutex::new(()) }
    }

    /// Fills `buffer`, however many pieces the bytes come in, and collects the descriptors that come with them.
    pub(super) fn receive(&self, buffer: &mut [u8], descriptors: &mut Descriptors) -> Result<(), Ended> {
        let mut rest = buffer;
        while !rest.is_empty() {
            match self.receive_some(rest, descriptors) {
                Ok(0) => return Err(Ended::Disconnected),
                Ok(received) => rest = rest.get_mut(received..).unwrap_or_default(),
                Err(Errno::AGAIN) => self.wait(PollFlags::IN)?,
                Err(Errno::INTR) => {}
                Err(errno) => return Err(errno.into()),
            }
        }
        Ok(())
    }

    fn receive_some(&self, buffer: &mut [u8], descriptors: &mut Descriptors) -> Result<usize, Errno> {
        let mut space = [MaybeUninit::uninit(); cmsg_space!(ScmRights(MAX_DESCRIPTORS))];
        let mut control = RecvAncillaryBuffer::new(&mut space);
        let flags = RecvFlags::DONTWAIT | RecvFlags::CMSG_CLOEXEC;
        let received = recvmsg(&self.socket, &mut [IoSliceMut::new(buffer)], &mut control, flags)?;
        descriptors.surplus |= received.flags.contains(ReturnFlags::CTRUNC);
        for message in control.drain() {
            if let RecvAncillaryMessage::ScmRights(rights) = message {
                rights.for_each(|descriptor| descriptors.push(descriptor));
            }
        }
        Ok(received.bytes)
    }

    /// Whether the other side is still there after this time; returns as soon as it is not.
    pub(super) fn stays_connected(&self, time: Duration) -> bool {
        let gone = PollFlags::RDHUP | PollFlags::HUP | PollFlags::ERR;
        let mut polled = [PollFd::new(&self.socket, PollFlags::RDHUP)];
        let time = Timespec::try_from(time).ok();
        let ready = poll(&mut polled, time.as_ref());
        let [socket] = &polled;
        ready == Ok(0) || !socket.revents().intersects(gone)
    }

    /// Sends a message whole, its descriptor with the first byte.
    pub(super) fn send(&self, message: &[u8], descriptor: Option<BorrowedFd<'_>>) -> Result<(), Ended> {
        let _whole = self.sending.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut rest, mut descriptor) = (message, descriptor);
        while !rest.is_empty() {
            match self.send_some(rest, descriptor) {
                Ok(sent) => {
                    rest = rest.get(sent..).unwrap_or_default();
                    descriptor = None;
                }
                Err(Errno::AGAIN) => self.wait(PollFlags::OUT)?,
                Err(Errno::INTR) => {}
                Err(errno) => return Err(errno.into()),
            }
        }
        Ok(())
    }

    fn send_some(&self, bytes: &[u8], descriptor: Option<BorrowedFd<'_>>) -> Result<usize, Errno> {
        let mut space = [MaybeUninit::uninit(); cmsg_space!(ScmRights(1))];
        let mut control = SendAncillaryBuffer::new(&mut space);
        let descriptors = descriptor.as_slice();
        if !descriptors.is_empty() {
            control.push(SendAncillaryMessage::ScmRights(descriptors));
        }
        sendmsg(&self.socket, &[IoSlice::new(bytes)], &mut control, SendFlags::DONTWAIT | SendFlags::NOSIGNAL)
    }

    /// Waits until the socket can move bytes, or has failed, which the next call then tells. Nobody waits for room
    /// with a client that has hung up, even if it keeps its end for reading.
    pub(super) fn wait(&self, flags: PollFlags) -> Result<(), Ended> {
        let flags = if flags == PollFlags::OUT { PollFlags::OUT | PollFlags::RDHUP } else { flags };
        let mut polled =
            [PollFd::new(&self.stop, PollFlags::IN), PollFd::from_borrowed_fd(self.socket.as_fd(), flags)];
        match poll(&mut polled, None) {
            Ok(_) | Err(Errno::INTR) => {}
            Err(errno) => return Err(errno.into()),
        }
        let [stop, socket] = &polled;
        match stop.revents().is_empty() {
            true if socket.revents().contains(PollFlags::RDHUP) => Err(Ended::Disconnected),
            true => Ok(()),
            false => Err(Ended::Stopped),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixStream;

    use super::*;

    fn pair() -> (Socket, Socket, Stop) {
        let (ours, theirs) = UnixStream::pair().unwrap();
        let stop = Stop::new().unwrap();
        (Socket::new(ours.into(), stop.clone()), Socket::new(theirs.into(), stop.clone()), stop)
    }

    #[test]
    fn descriptors_past_the_limit_are_closed_and_reported() {
        let (ours, theirs, _stop) = pair();
        let (reader, writer) = std::io::pipe().unwrap();
        let mut descriptors = Descriptors::default();
        for sent in 1..=MAX_DESCRIPTORS + 2 {
            theirs.send(&[0], Some(reader.as_fd())).unwrap();
            ours.receive(&mut [9], &mut descriptors).unwrap();
            assert_eq!(descriptors.taken.len(), sent.min(MAX_DESCRIPTORS));
            assert_eq!(descriptors.surplus, sent > MAX_DESCRIPTORS);
        }
        drop((reader, descriptors));
        let broken = std::io::Write::write(&mut &writer, &[0]).unwrap_err();
        assert_eq!(broken.kind(), std::io::ErrorKind::BrokenPipe);
    }

    #[test]
    fn stopping_wakes_who_waits_on_either_side() {
        let (ours, theirs, stop) = pair();
        std::thread::scope(|scope| {
            let receiver = scope.spawn(|| ours.receive(&mut [0], &mut Descriptors::default()));
            // Nobody takes so much.
            let sender = scope.spawn(|| ours.send(&vec![0; 64 << 20], None));
            std::thread::sleep(Duration::from_millis(20));
            stop.request();
            assert_eq!(
                (receiver.join().unwrap(), sender.join().unwrap()),
                (Err(Ended::Stopped), Err(Ended::Stopped))
            );
        });
        drop(theirs);
    }
}
