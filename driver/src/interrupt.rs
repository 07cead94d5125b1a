//! Waiting for the card's interrupts, by any number of threads.

use std::os::fd::OwnedFd;
use std::sync::{Condvar, Mutex};
use std::thread;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::lock;

/// An interrupt that got lost delays a waiter by this much, no more.
const LONGEST_SLEEP: Duration = Duration::from_millis(20);
/// Bounds of the pause between two looks at a card without interrupts.
const POLL_PAUSE: (Duration, Duration) = (Duration::from_micros(50), Duration::from_millis(5));

/// The card's event descriptors. One waiting thread watches them, and tells the others.
#[derive(Debug)]
pub(crate) struct Interrupts {
    events: Vec<OwnedFd>,
    watch: Mutex<Watch>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Watch {
    /// Interrupts seen, of each vector.
    seen: Vec<u64>,
    /// Whether a thread watches the descriptors.
    manned: bool,
}

impl Interrupts {
    /// Interrupts that arrive at `events`; with none of them waiting is polling.
    pub(crate) fn new(events: Vec<OwnedFd>) -> Self {
        let watch = Watch { seen: vec![0; events.len()], manned: false };
        Self { events, watch: Mutex::new(watch), changed: Condvar::new() }
    }

    /// Whether there are interrupts.
    pub(crate) fn exist(&self) -> bool {
        !self.events.is_empty()
    }

    /// Number of interrupts so far. Whoever takes it before looking at the card, and hands it to
    /// [`wait`](Self::wait) afterwards, misses none.
    pub(crate) fn seen(&self) -> u64 {
        lock(&self.watch).total()
    }

    /// Number of interrupts of each vector so far.
    pub(crate) fn counts(&self) -> Vec<u64> {
        let mut watch = lock(&self.watch);
        watch.take(&self.events);
        watch.seen.clone()
    }

    /// Waits until there was an interrupt after the first `seen`, a while at most; `left` is the longest that
    /// the caller wants to wait, `waited` how long it has already.
    pub(crate) fn wait(&self, seen: u64, left: Duration, waited: Duration) {
        if !self.exist() {
            // A pause in proportion delays the end of a long frame by a small part of it.
            return thread::sleep((waited / 8).clamp(POLL_PAUSE.0, POLL_PAUSE.1).min(left));
        }
        let mut watch = lock(&self.watch);
        if watch.total() != seen {
            return;
        }
        let sleep = left.min(LONGEST_SLEEP);
        if watch.manned {
            drop(self.changed.wait_timeout(watch, sleep));
            return;
        }
        watch.manned = true;
        drop(watch);
        wait_for_any(&self.events, sleep);
        let mut watch = lock(&self.watch);
        watch.manned = false;
        watch.take(&self.events);
        drop(watch);
        // Another waiter takes over the watch.
        self.changed.notify_all();
    }
}

impl Watch {
    fn total(&self) -> u64 {
        self.seen.iter().sum()
    }

    /// Adds what the descriptors have counted.
    fn take(&mut self, events: &[OwnedFd]) {
        self.seen.iter_mut().zip(events).for_each(|(seen, event)| *seen += take(event));
    }
}

/// What a non-blocking event descriptor has counted since it was asked last.
pub(crate) fn take(event: &OwnedFd) -> u64 {
    let mut counter = [0; 8];
    // A descriptor without a signal has nothing to read, and says so at once.
    rustix::io::read(event, &mut counter).map_or(0, |_| u64::from_ne_bytes(counter))
}

/// Waits until one of the event descriptors is signalled. Returns whether one was.
pub(crate) fn wait_for_any(events: &[OwnedFd], longest: Duration) -> bool {
    let mut polled: Vec<_> = events.iter().map(|event| PollFd::new(event, PollFlags::IN)).collect();
    let longest = Timespec {
        tv_sec: i64::try_from(longest.as_secs()).unwrap_or(i64::MAX),
        tv_nsec: longest.subsec_nanos().into(),
    };
    matches!(poll(&mut polled, Some(&longest)), Ok(1..))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::event::{EventfdFlags, eventfd};
    use std::sync::Arc;
    use std::time::Instant;

    fn events(count: usize) -> Vec<OwnedFd> {
        (0..count).map(|_| eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK).unwrap()).collect()
    }

    fn signal(event: &OwnedFd) {
        rustix::io::write(event, &1u64.to_ne_bytes()).unwrap();
    }

    #[test]
    fn silence_ends_in_time() {
        let start = Instant::now();
        assert!(!wait_for_any(&events(3), Duration::from_millis(30)));
        assert!(start.elapsed() >= Duration::from_millis(30));
        assert!(start.elapsed() < Duration::from_secs(5));
    }

    #[test]
    fn an_interrupt_before_the_wait_is_not_missed() {
        let interrupts = Interrupts::new(events(2));
        let seen = interrupts.seen();
        signal(&interrupts.events[1]);
        interrupts.wait(seen, Duration::from_secs(9), Duration::ZERO);
        assert_eq!(interrupts.seen(), seen + 1);
        signal(&interrupts.events[0]);
        signal(&interrupts.events[1]);
        signal(&interrupts.events[1]);
        assert_eq!(interrupts.counts(), [1, 3]);
        let start = Instant::now();
        (0..1000).for_each(|_| interrupts.wait(seen, Duration::from_secs(9), Duration::ZERO));
        assert!(start.elapsed() < 500 * LONGEST_SLEEP, "the interrupt was seen by another thread meanwhile");
    }

    #[test]
    fn every_waiting_thread_hears_of_an_interrupt() {
        let interrupts = Arc::new(Interrupts::new(events(1)));
        let threads: Vec<_> = (0..4)
            .map(|_| {
                let interrupts = Arc::clone(&interrupts);
                thread::spawn(move || {
                    let end = Instant::now() + Duration::from_secs(20);
                    while interrupts.seen() == 0 && Instant::now() < end {
                        interrupts.wait(0, Duration::from_secs(20), Duration::ZERO);
                    }
                    interrupts.seen()
                })
            })
            .collect();
        thread::sleep(Duration::from_millis(30));
        signal(&interrupts.events[0]);
        for thread in threads {
            assert_eq!(thread.join().unwrap(), 1);
        }
    }
}
