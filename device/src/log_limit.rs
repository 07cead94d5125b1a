//! A limit on log lines that a guest can cause.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Lines that pass in each window of time.
const LINES: u32 = 20;
const WINDOW: Duration = Duration::from_secs(10);

/// Lets so many lines pass that somebody reads them.
#[derive(Debug)]
pub struct LogLimit(Mutex<Window>);

#[derive(Debug)]
struct Window {
    began: Instant,
    passed: u32,
    held_back: u64,
}

impl Default for LogLimit {
    fn default() -> Self {
        Self(Mutex::new(Window { began: Instant::now(), passed: 0, held_back: 0 }))
    }
}

impl LogLimit {
    /// Whether a line may pass now; if so, how many have been held back since the last.
    pub fn pass(&self) -> Option<u64> {
        self.pass_at(Instant::now())
    }

    fn pass_at(&self, now: Instant) -> Option<u64> {
        let mut window = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if now.saturating_duration_since(window.began) >= WINDOW {
            (window.began, window.passed) = (now, 0);
        }
        if window.passed >= LINES {
            window.held_back += 1;
            return None;
        }
        window.passed += 1;
        Some(std::mem::take(&mut window.held_back))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_passes_as_a_few_lines_and_a_count() {
        let limit = LogLimit::default();
        let start = Instant::now();
        let passed = (0..1000).filter(|_| limit.pass_at(start).is_some()).count();
        assert_eq!(passed, LINES as usize);
        assert_eq!(limit.pass_at(start + WINDOW), Some(1000 - u64::from(LINES)));
        assert_eq!(limit.pass_at(start + WINDOW), Some(0));
    }
}
