//! A PCI function as this process reaches it: configuration space by a file, memories by mappings.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::sync::atomic::{Ordering, fence};
use std::sync::{Arc, OnceLock};

use vg500_regs::SharedView;
use vg500_regs::pci::REGISTERS;
use vg500_regs::table::{RESET_KEY, interface_version, reset};

use crate::Error;
use crate::card::command;
use crate::mapping::Mapping;

/// Base address registers of a function.
pub(super) const BARS: usize = 6;

/// What a card that has left the bus does.
pub(super) const NO_ANSWER: &str = "its configuration space reads as all ones";

/// A range of a file that ends where the function's range does.
#[derive(Clone, Debug)]
pub(super) struct Window {
    pub(super) file: Arc<File>,
    /// For messages.
    pub(super) path: PathBuf,
    pub(super) offset: u64,
}

/// The memory behind a base address register.
#[derive(Debug, Default)]
pub(super) struct Region {
    pub(super) size: u64,
    pub(super) memory: Option<Mapping>,
}

/// A PCI function.
#[derive(Debug)]
pub(super) struct Function {
    pub(super) config: Window,
    /// The registers by read and write calls, for when they are not mapped.
    pub(super) registers: Option<Window>,
    pub(super) bars: [Region; BARS],
    /// The file that names the ways in which the system resets it, if it does so when this process lets go of it.
    pub(super) reset_methods: Option<PathBuf>,
    /// Why nothing more is tried.
    death: OnceLock<String>,
}

impl Window {
    fn read(&self, offset: u32) -> Result<u32, Error> {
        let mut bytes = [0; 4];
        let read = self.file.read_exact_at(&mut bytes, self.offset + u64::from(offset));
        read.map_err(|cause| Error::file("reading", &self.path, cause))?;
        Ok(u32::from_le_bytes(bytes))
    }

    fn write(&self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        let written = self.file.write_all_at(bytes, self.offset + u64::from(offset));
        written.map_err(|cause| Error::file("writing", &self.path, cause))
    }
}

impl Function {
    pub(super) fn new(config: Window, registers: Option<Window>, bars: [Region; BARS]) -> Self {
        Self { config, registers, bars, reset_methods: None, death: OnceLock::new() }
    }

    pub(super) fn read_config(&self, offset: u16) -> Result<u32, Error> {
        self.alive()?;
        let word = self.config.read(offset.into())?;
        if offset == 0 && word == u32::MAX {
            return Err(self.dead(NO_ANSWER));
        }
        Ok(word)
    }

    pub(super) fn write_config(&self, offset: u16, word: u16) -> Result<(), Error> {
        self.alive()?;
        self.config.write(offset.into(), &word.to_le_bytes())
    }

    pub(super) fn bar_size(&self, index: u32) -> u64 {
        self.bars.get(index as usize).map_or(0, |region| region.size)
    }

    pub(super) fn memory(&self, index: u32) -> Option<SharedView<'_>> {
        Some(self.bars.get(index as usize)?.memory.as_ref()?.view())
    }

    /// Reads registers one after another; each is an access of 32 bits that is trapped.
    pub(super) fn read_registers(&self, offset: u32, words: &mut [u32]) -> Result<(), Error> {
        self.alive()?;
        for (offset, word) in (offset..).step_by(4).zip(words) {
            *word = self.read_register(offset)?;
            // A card that is gone reads as all ones, and so may a few registers. The version never does.
            if *word == u32::MAX && self.read_register(interface_version::REGISTER.offset)? == u32::MAX {
                return Err(self.dead("its registers read as all ones"));
            }
        }
        Ok(())
    }

    /// Writes registers one after another.
    pub(super) fn write_registers(&self, offset: u32, words: &[u32]) -> Result<(), Error> {
        self.alive()?;
        // What was written to the card's memories before, perhaps through write-combining buffers, is there
        // when a register says so.
        fence(Ordering::SeqCst);
        for (offset, word) in (offset..).step_by(4).zip(words) {
            match (self.memory(REGISTERS.index), &self.registers) {
                (Some(memory), _) => memory.write_u32(offset as usize, *word)?,
                (None, Some(window)) => window.write(offset, &word.to_le_bytes())?,
                (None, None) => return Err(Error::BarNotMapped { bar: REGISTERS }),
            }
        }
        Ok(())
    }

    /// Resets the card by its register, where the system knows no other way.
    pub(super) fn reset_by_register(&self) -> Result<(), Error> {
        let enabled = self.read_config(command::OFFSET)? as u16 | command::ENABLED;
        self.write_config(command::OFFSET, enabled)?;
        self.write_registers(reset::REGISTER.offset, &[RESET_KEY])
    }

    fn read_register(&self, offset: u32) -> Result<u32, Error> {
        match (self.memory(REGISTERS.index), &self.registers) {
            (Some(memory), _) => Ok(memory.read_u32(offset as usize)?),
            (None, Some(window)) => window.read(offset),
            (None, None) => Err(Error::BarNotMapped { bar: REGISTERS }),
        }
    }

    fn alive(&self) -> Result<(), Error> {
        match self.death.get() {
            None => Ok(()),
            Some(reason) => Err(Error::CardDead { reason: reason.clone() }),
        }
    }

    fn dead(&self, reason: &str) -> Error {
        let reason = self.death.get_or_init(|| {
            self.waive_reset();
            reason.into()
        });
        Error::CardDead { reason: reason.clone() }
    }

    /// Spares this process the minute and more that the system would wait for a dead card to come out of a reset. Only
    /// root may do so.
    fn waive_reset(&self) {
        if let Some(path) = &self.reset_methods {
            fs::write(path, "\n").ok();
        }
    }
}

/// A file opened for reading and writing; the error names it.
pub(super) fn open(path: &std::path::Path) -> Result<File, Error> {
    let file = File::options().read(true).write(true).open(path);
    file.map_err(|cause: io::Error| Error::file("opening", path, cause))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_system_is_kept_from_resetting_a_dead_card_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let [config, methods] = ["config", "reset_method"].map(|name| folder.path().join(name));
        for (word, left) in [(0x1002_1067_u32, "flr bus\n"), (u32::MAX, "\n")] {
            fs::write(&config, word.to_le_bytes()).unwrap();
            fs::write(&methods, "flr bus\n").unwrap();
            let window = Window { file: Arc::new(open(&config).unwrap()), path: config.clone(), offset: 0 };
            let mut function = Function::new(window, None, Default::default());
            function.reset_methods = Some(methods.clone());
            assert_eq!(function.read_config(0).is_ok(), word != u32::MAX);
            assert_eq!(fs::read_to_string(&methods).unwrap(), left);
        }
    }
}
