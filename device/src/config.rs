//! How a card is set up.

use std::path::PathBuf;

use vg500_engine::Renderer;
use vg500_regs::pci::{VENDOR_ID, VOXEL_MEMORY_SIZES};

pub use crate::card::Pace;
pub use crate::interrupt::InterruptMode;

/// The set-up of a card. The default is the card of the papers, with messages for interrupts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Config {
    /// PCI vendor ID: one of the two under which the public ID lists know the card.
    pub vendor: u16,
    /// Whether programming mistakes are named and counted.
    pub strict: bool,
    /// File for the register trace.
    pub trace: Option<PathBuf>,
    /// When commands end.
    pub pace: Pace,
    /// Kinds of interrupt on offer.
    pub interrupts: InterruptMode,
    /// Bytes of voxel memory, one of [`VOXEL_MEMORY_SIZES`].
    pub voxel_memory: u64,
    /// Which renderer runs.
    pub renderer: Renderer,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            vendor: VENDOR_ID,
            strict: false,
            trace: None,
            pace: Pace::default(),
            interrupts: InterruptMode::default(),
            voxel_memory: VOXEL_MEMORY_SIZES[0],
            renderer: Renderer::Reference,
        }
    }
}
