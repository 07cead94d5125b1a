//! When commands end: at once, or when the real card would have ended them.

use std::time::{Duration, Instant};

use vg500_engine::Cancel;
use vg500_regs::Fault;
use vg500_regs::limit::CLOCK_HZ;

/// Peak rate of the card's PCI interface in bytes per second (paper, section 6).
pub const PCI_BYTES_PER_SECOND: u64 = 264_000_000;
/// How often a command that waits for its time looks whether it is cancelled.
const LOOK: Duration = Duration::from_millis(1);

/// What `--pace` selects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pace {
    /// Commands end as soon as they are done.
    #[default]
    Unpaced,
    /// Commands end no earlier than on the real card.
    Hardware,
}

impl Pace {
    /// Waits for the end of a frame of so many clock cycles.
    pub(super) fn await_cycles(self, began: Instant, cycles: u64, cancel: &Cancel) -> Result<(), Fault> {
        self.wait(began, cycles, CLOCK_HZ.into(), cancel)
    }

    /// Waits for the end of a transfer of so many bytes.
    pub(super) fn await_bytes(self, began: Instant, bytes: u64, cancel: &Cancel) -> Result<(), Fault> {
        self.wait(began, bytes, PCI_BYTES_PER_SECOND, cancel)
    }

    fn wait(self, began: Instant, amount: u64, per_second: u64, cancel: &Cancel) -> Result<(), Fault> {
        if self == Self::Unpaced {
            return Ok(());
        }
        let time = duration(amount, per_second);
        while let Some(left) = time.checked_sub(began.elapsed()).filter(|left| !left.is_zero()) {
            cancel.check()?;
            std::thread::sleep(left.min(LOOK));
        }
        Ok(())
    }
}

/// `amount / per_second` seconds.
fn duration(amount: u64, per_second: u64) -> Duration {
    let nanoseconds = u128::from(amount) * 1_000_000_000 / u128::from(per_second);
    Duration::from_nanos(u64::try_from(nanoseconds).unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_card_takes_a_thirtieth_of_a_second_for_256_cubed() {
        assert_eq!(duration(4_194_304, CLOCK_HZ.into()), Duration::from_nanos(33_554_432));
        assert_eq!(duration(PCI_BYTES_PER_SECOND, PCI_BYTES_PER_SECOND), Duration::from_secs(1));
        assert!(duration(u64::MAX, 1) > Duration::from_secs(1 << 30));
    }

    #[test]
    fn waiting_ends_when_cancelled() {
        let cancel = Cancel::default();
        cancel.cancel();
        assert!(Pace::Hardware.await_cycles(Instant::now(), u64::MAX, &cancel).is_err());
        assert!(Pace::Unpaced.await_cycles(Instant::now(), u64::MAX, &cancel).is_ok());
    }

    #[test]
    fn a_frame_ends_no_earlier_than_on_the_card() {
        let began = Instant::now();
        Pace::Hardware.await_cycles(began, 1_250_000, &Cancel::default()).unwrap();
        assert!(began.elapsed() >= Duration::from_millis(10));
    }
}
