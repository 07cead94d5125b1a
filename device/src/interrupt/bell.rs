//! Adding to a client's event counters without ever waiting for the client.
//!
//! A write to an event descriptor waits while its counter is full, unless the descriptor's owner has chosen otherwise.
//! The mode is the owner's affair, who may wait on the descriptor; and looking first does not help, because the owner
//! can fill the counter a moment later. Only the kernel adds without waiting: VFIO's interrupts are made so, and the
//! word that asynchronous input and output is done. Therefore a read of nothing is submitted for each event.

use std::io;
use std::os::fd::{AsRawFd, OwnedFd};

use libc::{SYS_io_destroy, SYS_io_getevents, SYS_io_setup, SYS_io_submit, c_long, c_ulong, iocb, syscall};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{MemfdFlags, memfd_create};
use rustix::io::write;

/// `IOCB_CMD_PREAD` and `IOCB_FLAG_RESFD` of the kernel's `aio_abi.h`.
const READ: u16 = 0;
const TELL: u32 = 1;
/// Requests under way at a time.
const ONE: c_long = 1;

/// What adds to event counters.
#[derive(Debug)]
pub(super) struct Bell(Option<Context>);

impl Bell {
    /// Where the system has no asynchronous input and output, counters are looked at and then written: a client that
    /// means ill can then stop its card, until the process is restarted.
    pub(super) fn new() -> Self {
        let context = Context::new();
        Self(context.inspect_err(|error| tracing::warn!("interrupts: io_setup: {error}")).ok())
    }

    /// Adds one to a counter, without waiting. A full counter stays so: its client has events to take already. Returns
    /// whether the descriptor is one that counts.
    pub(super) fn ring(&self, event: &OwnedFd) -> bool {
        match &self.0 {
            Some(context) => context.tell(event).is_ok(),
            None => write_if_room(event),
        }
    }
}

/// A context of asynchronous input and output, and an empty file.
#[derive(Debug)]
struct Context {
    id: c_ulong,
    nothing: OwnedFd,
}

impl Context {
    fn new() -> io::Result<Self> {
        let nothing = memfd_create("nothing", MemfdFlags::CLOEXEC)?;
        let mut id: c_ulong = 0;
        // SAFETY: the kernel writes one word, which is `id`.
        done(unsafe { syscall(SYS_io_setup, ONE, &raw mut id) })?;
        Ok(Self { id, nothing })
    }

    /// Reads nothing from nowhere and has that told to `event`. The kernel does so at once.
    fn tell(&self, event: &OwnedFd) -> io::Result<()> {
        // SAFETY: the structure is made of integers, for which zero is a value.
        let mut request: iocb = unsafe { std::mem::zeroed() };
        request.aio_lio_opcode = READ;
        request.aio_fildes = self.nothing.as_raw_fd().cast_unsigned();
        request.aio_flags = TELL;
        request.aio_resfd = event.as_raw_fd().cast_unsigned();
        let mut requests = [&raw mut request];
        // SAFETY: the list has one element, a request that lives until it is done, with room for no byte.
        done(unsafe { syscall(SYS_io_submit, self.id, ONE, requests.as_mut_ptr()) })?;
        let mut outcome = [0u64; 4];
        let none: c_long = 0;
        // SAFETY: an `io_event` has four words, and there is room for one. No time limit is given, and none needed to
        // wait for no event.
        done(unsafe { syscall(SYS_io_getevents, self.id, none, ONE, &raw mut outcome, none) })
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        // SAFETY: nothing is under way, and nobody uses the context any more.
        unsafe { syscall(SYS_io_destroy, self.id) };
    }
}

fn done(result: c_long) -> io::Result<()> {
    if result < 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
}

fn write_if_room(event: &OwnedFd) -> bool {
    let now = Timespec { tv_sec: 0, tv_nsec: 0 };
    let room = poll(&mut [PollFd::new(event, PollFlags::OUT)], Some(&now));
    room == Ok(0) || room == Ok(1) && write(event, &1u64.to_ne_bytes()) == Ok(size_of::<u64>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::event::{EventfdFlags, eventfd};
    use rustix::io::read;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
    use std::thread;
    use std::time::{Duration, Instant};

    fn counter(count: u64) -> OwnedFd {
        let event = eventfd(0, EventfdFlags::empty()).unwrap();
        write(&event, &count.to_ne_bytes()).unwrap();
        event
    }

    fn taken(event: &OwnedFd) -> u64 {
        let mut count = [0; 8];
        read(event, &mut count).unwrap();
        u64::from_ne_bytes(count)
    }

    #[test]
    fn what_does_not_count_is_told() {
        let (reader, writer) = io::pipe().unwrap();
        let file = memfd_create("file", MemfdFlags::CLOEXEC).unwrap();
        let bell = Bell::new();
        for descriptor in [reader.into(), writer.into(), file] {
            assert!(!bell.ring(&descriptor));
        }
    }

    #[test]
    fn events_are_counted_and_a_full_counter_stays_full() {
        for bell in [Bell::new(), Bell(None)] {
            let event = counter(5);
            (0..1000).for_each(|_| assert!(bell.ring(&event)));
            assert_eq!(taken(&event), 1005);
            let full = counter(u64::MAX - 1);
            (0..1000).for_each(|_| assert!(bell.ring(&full)));
            assert!(taken(&full) >= u64::MAX - 1);
            assert!(bell.ring(&full));
            assert_eq!(taken(&full), 1);
        }
    }

    /// The client fills its counter whenever it is empty, in a moment that nobody else chooses, and now and then leaves
    /// it full.
    #[test]
    fn a_counter_that_is_filled_at_the_same_time_stops_nobody() {
        let event = Arc::new(counter(1));
        let [emptying, ended] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
        let rung = Arc::new(AtomicU64::new(0));
        let repeat = |act: Box<dyn Fn() + Send>| {
            let ended = Arc::clone(&ended);
            thread::spawn(move || {
                while !ended.load(Relaxed) {
                    act();
                }
            })
        };
        let shared = || (Arc::clone(&event), Arc::clone(&emptying), Arc::clone(&rung));
        let (own, ..) = shared();
        let filler = repeat(Box::new(move || _ = write(&own, &(u64::MAX - 1).to_ne_bytes())));
        let (own, emptying, _) = shared();
        let emptier = repeat(Box::new(move || {
            if emptying.load(Relaxed) {
                _ = taken(&own)
            }
        }));
        let (own, emptying, rung) = shared();
        let bell = Bell::new();
        let own_rung = Arc::clone(&rung);
        let ringer = repeat(Box::new(move || {
            bell.ring(&own);
            own_rung.fetch_add(1, Relaxed);
        }));
        for round in 0..200 {
            emptying.store(true, Relaxed);
            thread::sleep(Duration::from_millis(1));
            emptying.store(false, Relaxed);
            thread::sleep(Duration::from_micros(100));
            let (before, begun) = (rung.load(Relaxed), Instant::now());
            while rung.load(Relaxed) < before + 2 {
                assert!(begun.elapsed() < Duration::from_secs(20), "stuck in round {round}");
                thread::yield_now();
            }
        }
        ended.store(true, Relaxed);
        emptier.join().unwrap();
        ringer.join().unwrap();
        // The filler may wait for room.
        while !filler.is_finished() {
            _ = taken(&event);
        }
    }
}
