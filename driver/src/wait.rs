//! Waiting with an end.

use std::time::{Duration, Instant};

use crate::status::Source;
use crate::{Card, Error};

/// How often a waiting thread asks the card itself: a card that died sends no interrupt.
const HEARTBEAT: Duration = Duration::from_secs(1);

impl Card {
    /// Repeats `check` until it gives a value or `timeout` is over, which gives `None`. In between the thread
    /// waits for interrupts, or a little if there are none.
    ///
    /// `check` looks at the status where it is told to: mostly at the copy, which costs no message.
    pub(crate) fn poll_until<T>(
        &self,
        timeout: Duration,
        mut check: impl FnMut(Source) -> Result<Option<T>, Error>,
    ) -> Result<Option<T>, Error> {
        let start = Instant::now();
        let mut asked = start;
        loop {
            let seen = self.interrupts.seen();
            let source = if asked.elapsed() < HEARTBEAT { Source::Copy } else { Source::Registers };
            if source == Source::Registers {
                asked = Instant::now();
            }
            if let Some(value) = check(source)? {
                return Ok(Some(value));
            }
            let waited = start.elapsed();
            if waited >= timeout {
                return Ok(None);
            }
            self.interrupts.wait(seen, timeout - waited, waited);
        }
    }
}
