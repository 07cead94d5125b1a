//! A card without driver, by its files in sysfs: memories are mapped, interrupts do not arrive.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{FlockOperation, flock};

use super::find::Found;
use super::function::{BARS, Function, Region, Window, open};
use super::physical::HugePages;
use crate::Error;
use crate::card::command;
use crate::mapping::Mapping;
use crate::transport::HostMemory;

/// What belongs to this way alone.
#[derive(Debug)]
pub(super) struct Sysfs {
    folder: PathBuf,
    /// Whether an IOMMU keeps the card from physical addresses.
    translated: bool,
    pages: Arc<HugePages>,
}

impl Sysfs {
    /// Opens a card that no driver has.
    pub(super) fn open(found: &Found) -> Result<(Self, Function), Error> {
        let folder = &found.folder;
        let enable = folder.join("enable");
        fs::write(&enable, "1").map_err(|cause| Error::file("writing", &enable, cause))?;
        let path = folder.join("config");
        let config = Window { file: Arc::new(open(&path)?), path, offset: 0 };
        flock(&config.file, FlockOperation::NonBlockingLockExclusive)
            .map_err(|_| Error::InUse { address: found.address })?;
        let mut bars: [Region; BARS] = Default::default();
        for (index, region) in bars.iter_mut().enumerate() {
            *region = self::region(folder, index)?;
        }
        let sysfs = Self {
            folder: folder.clone(),
            translated: is_translated(folder),
            pages: Arc::new(HugePages::default()),
        };
        Ok((sysfs, Function::new(config, None, bars)))
    }

    pub(super) fn host_memory(&self, bytes: usize) -> Result<Box<dyn HostMemory>, Error> {
        if self.translated {
            let what = "host memory: the IOMMU lets the card reach what vfio-pci maps alone";
            return Err(Error::NotSupported { what });
        }
        self.pages.allocate(bytes)
    }

    /// By the system, which uses function-level reset; it keeps the settings in configuration space.
    pub(super) fn reset(&self, function: &Function) -> Result<(), Error> {
        let path = self.folder.join("reset");
        match fs::metadata(&path) {
            Ok(_) => fs::write(&path, "1").map_err(|cause| Error::file("writing", &path, cause)),
            Err(_) => function.reset_by_register(),
        }
    }

    /// Keeps the card from memory that will belong to somebody else.
    pub(super) fn close(&self, function: &Function) {
        if let Ok(word) = function.read_config(command::OFFSET) {
            function.write_config(command::OFFSET, word as u16 & !command::BUS_MASTER).ok();
        }
    }
}

/// A base address register; one that the function does not have is empty.
fn region(folder: &Path, index: usize) -> Result<Region, Error> {
    let plain = folder.join(format!("resource{index}"));
    let combining = folder.join(format!("resource{index}_wc"));
    let path = if combining.exists() { combining } else { plain };
    let size = match fs::metadata(&path) {
        Ok(metadata) => metadata.len(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Region::default()),
        Err(cause) => return Err(Error::file("looking at", &path, cause)),
    };
    let memory =
        Mapping::new(&open(&path)?, 0, size).map_err(|cause| Error::file("mapping", &path, cause))?;
    Ok(Region { size, memory: Some(memory) })
}

/// Whether the card's addresses go through an IOMMU that the kernel has not told to leave them as they are.
fn is_translated(folder: &Path) -> bool {
    let group = folder.join("iommu_group");
    group.exists() && fs::read_to_string(group.join("type")).map_or(true, |kind| kind.trim() != "identity")
}
