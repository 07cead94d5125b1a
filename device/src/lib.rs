//! The VolumePro 500 card as a vfio-user device process.

pub mod backing;
pub mod card;
pub mod config;
pub mod dma;
pub mod interrupt;
pub mod listener;
mod log_limit;
pub mod pci;
pub mod protocol;
mod readiness;
mod run;
pub mod sandbox;
pub mod serve;
pub mod stop;
pub mod trace;

pub use config::Config;
pub use run::run;
pub use serve::{Clients, Handle, ServeError, serve};
