//! The card over its socket, driven by the client of the `vfio_user` crate, and the process around it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod confined;
mod cycles;
mod example;
mod frames;
mod life;
mod peer;
mod process;
