//! The VolumePro 500 card as a vfio-user device process.

pub mod backing;
pub mod dma;
pub mod interrupt;
pub mod listener;
pub mod pci;
pub mod protocol;
pub mod stop;
