//! Counts of accesses that came as messages: mapped memory causes none.

use std::fmt;

use vg500_regs::pci::BARS;

/// Base address registers of a PCI function.
const COUNT: usize = 6;

/// Reads and writes of each base address register since the connection began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Traffic {
    reads: [u32; COUNT],
    writes: [u32; COUNT],
}

impl Traffic {
    /// Counts a read.
    pub(super) fn count_read(&mut self, bar: u32) {
        count(&mut self.reads, bar);
    }

    /// Counts a write.
    pub(super) fn count_write(&mut self, bar: u32) {
        count(&mut self.writes, bar);
    }

    /// Reads of a base address register.
    pub(super) fn reads(&self, bar: u32) -> u32 {
        of(&self.reads, bar)
    }

    /// Writes of a base address register.
    pub(super) fn writes(&self, bar: u32) -> u32 {
        of(&self.writes, bar)
    }
}

impl fmt::Display for Traffic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, bar) in BARS.iter().enumerate() {
            let separator = if place == 0 { "" } else { ", " };
            let (reads, writes) = (self.reads(bar.index), self.writes(bar.index));
            write!(f, "{separator}BAR{} reads={reads} writes={writes}", bar.index)?;
        }
        Ok(())
    }
}

fn count(counts: &mut [u32; COUNT], bar: u32) {
    if let Some(count) = counts.get_mut(bar as usize) {
        *count = count.wrapping_add(1);
    }
}

fn of(counts: &[u32; COUNT], bar: u32) -> u32 {
    counts.get(bar as usize).copied().unwrap_or(0)
}
