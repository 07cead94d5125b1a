//! Userspace driver of the VolumePro 500.
//!
//! [`Card::open`] takes a [`Transport`], the way to the card, and everything above is the same for all of them:
//!
//! * voxels: [`Card::allocate_volume`], [`Card::upload`], [`Card::download`],
//! * tables: [`Card::load_table`],
//! * frames: [`Card::allocate_plane`], [`Card::submit`], [`Card::wait`], [`Card::report`],
//! * pixels: [`Card::fetch_pixels`], or through the mapping [`Card::read_pixels`], or by bus mastering and
//!   converted [`Card::transfer`].
//!
//! A frame is described by [`FrameRegisters`](vg500_regs::FrameRegisters); the driver compares them with its
//! shadow of the card's registers and writes only what changed. It never reads a write-only register, never
//! writes a reserved bit, and every wait has an end: a card that does not answer is reported as dead.
//!
//! A [`Card`] may be used from any number of threads.

mod board_memory;
mod burst;
mod card;
mod error;
#[cfg(test)]
mod fake;
mod flight;
mod frame;
mod info;
mod interrupt;
mod mapping;
mod plane;
mod pool;
mod promise;
mod report;
mod status;
mod tables;
mod transfer;
pub mod transport;
mod upload;
mod wait;

use std::sync::{Mutex, MutexGuard, PoisonError};

pub use board_memory::{Availability, BoardVolume, Slab};
pub use card::{Card, TrappedAccesses};
pub use error::Error;
pub use frame::Ticket;
pub use info::{Architecture, CardInfo, Completion, Renderer, SimdLevel};
pub use plane::{BasePlane, Rectangle};
pub use report::{LeftOut, Report};
pub use tables::TableContent;
pub use transport::vfio_user::{MESSAGE_TIMEOUT, PrivateSocket, VfioUser};
pub use transport::{HostMemory, PciAddress, PciCard, PciSelector, Transport};
pub use upload::Voxel;

/// The value in a lock, also after a panic elsewhere: every holder leaves it consistent.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
