//! Lookup tables, reflectance maps and the gradient-magnitude table, each of which the card has twice.
//!
//! New content goes into a copy that no running frame was started with, and the next frame selects that copy.
//! The card takes its tables with the start command, so this is stricter than it must be; but a card in strict
//! mode watches the copies of a running frame, as the card of 1999 would have read them. If frames use both
//! copies, loading waits for one of them to end.

use vg500_regs::limit::{GRADIENT_MAGNITUDE_ENTRIES, LOOKUP_ENTRIES, REFLECTANCE_ENTRIES};
use vg500_regs::memory::Table;
use vg500_regs::pci::TABLE_MEMORY;

use crate::{Card, Error, lock};

/// Largest opacity.
const OPACITY: u16 = 0xfff;

/// What one table is to hold, packed as the card reads it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TableContent {
    table: Table,
    bytes: Vec<u8>,
}

impl TableContent {
    /// Red, green and blue for each 12-bit sample value.
    #[must_use]
    pub fn color(entries: &[[u8; 3]; LOOKUP_ENTRIES]) -> Self {
        let bytes = entries.iter().flat_map(|&[red, green, blue]| [red, green, blue, 0]).collect();
        Self { table: Table::Color, bytes }
    }

    /// Opacity, 0..=4095, for each 12-bit sample value.
    ///
    /// # Errors
    ///
    /// [`Error::TableEntry`] for the first entry that is larger.
    pub fn opacity(entries: &[u16; LOOKUP_ENTRIES]) -> Result<Self, Error> {
        let table = Table::Opacity;
        if let Some(entry) = entries.iter().position(|&value| value > OPACITY) {
            let value = u32::from(entries[entry]);
            return Err(Error::TableEntry { table, entry, value, most: OPACITY.into() });
        }
        // Two entries to a word, the even one in its lower half: sixteen bits after sixteen bits.
        Ok(Self { table, bytes: entries.iter().flat_map(|value| value.to_le_bytes()).collect() })
    }

    /// Diffuse intensity at the vertices of six faces of 8 x 8.
    #[must_use]
    pub fn diffuse(entries: &[u8; REFLECTANCE_ENTRIES]) -> Self {
        Self { table: Table::Diffuse, bytes: words(entries) }
    }

    /// Specular intensity at the vertices of six faces of 8 x 8.
    #[must_use]
    pub fn specular(entries: &[u8; REFLECTANCE_ENTRIES]) -> Self {
        Self { table: Table::Specular, bytes: words(entries) }
    }

    /// What each gradient magnitude is mapped to.
    #[must_use]
    pub fn gradient_magnitude(entries: &[u8; GRADIENT_MAGNITUDE_ENTRIES]) -> Self {
        Self { table: Table::GradientMagnitude, bytes: entries.to_vec() }
    }

    /// Which table.
    #[must_use]
    pub fn table(&self) -> Table {
        self.table
    }
}

fn words(entries: &[u8]) -> Vec<u8> {
    entries.iter().flat_map(|&value| u32::from(value).to_le_bytes()).collect()
}

/// What the driver knows of the card's tables.
#[derive(Debug, Default)]
pub(crate) struct Tables {
    /// Both copies of each table; `None` while unknown.
    copies: [[Option<Vec<u8>>; 2]; Table::ALL.len()],
    selected: u32,
}

/// What has to be done for a table to hold something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// The copy holds it; select it.
    Select(usize),
    /// Write it into the copy and select that.
    Write(usize),
    /// Frames use both copies.
    Wait,
}

impl Tables {
    /// The word for `TABLE_SELECT`.
    pub(crate) fn selected(&self) -> u32 {
        self.selected
    }

    /// `used` says which copies running frames were started with.
    fn next(&self, content: &TableContent, used: [bool; 2]) -> Step {
        let active = (self.selected >> content.table as u32 & 1) as usize;
        let copies = &self.copies[content.table as usize];
        let order = [active, 1 - active];
        let holds = |copy: &usize| copies[*copy].as_ref() == Some(&content.bytes);
        match (order.into_iter().find(holds), order.into_iter().rev().find(|copy| !used[*copy])) {
            (Some(copy), _) => Step::Select(copy),
            (None, Some(copy)) => Step::Write(copy),
            (None, None) => Step::Wait,
        }
    }

    fn select(&mut self, table: Table, copy: usize) {
        self.selected = self.selected & !(1 << table as u32) | (copy as u32) << table as u32;
    }
}

impl Card {
    /// Loads a table for frames that are submitted from now on. What a copy on the card already holds is not
    /// written again.
    ///
    /// # Errors
    ///
    /// [`Error::Timeout`] if frames use both copies and none ends in the time of
    /// [`set_patience`](Self::set_patience); a dead card.
    pub fn load_table(&self, content: &TableContent) -> Result<(), Error> {
        let memory = self.memory(TABLE_MEMORY)?;
        let table = content.table;
        let loaded = self.poll_until(self.patience, |source| {
            let mut guard = lock(&self.state);
            let state = &mut *guard;
            self.retire(&mut state.slots, &mut state.promises, source)?;
            match state.tables.next(content, state.slots.used_copies(table as u32)) {
                Step::Wait => return Ok(None),
                Step::Select(copy) => state.tables.select(table, copy),
                Step::Write(copy) => {
                    memory.write(table.offset(copy), &content.bytes)?;
                    state.tables.copies[table as usize][copy] = Some(content.bytes.clone());
                    state.tables.select(table, copy);
                }
            }
            Ok(Some(()))
        })?;
        loaded.ok_or_else(|| Error::Timeout {
            what: format!("a frame that uses the {}", table.name()),
            timeout: self.patience,
        })
    }
}

#[cfg(test)]
mod tests;
