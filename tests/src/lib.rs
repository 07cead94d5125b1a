//! Integration tests of the VolumePro emulator: whole programs against each other and against independent judges.
//!
//! * [`guest`] runs virtual machines with the card,
//! * [`programs`] runs the command and the device process,
//! * [`data`] finds real volumes,
//! * [`independent_mip`] judges pictures without sharing anything with the library.

pub mod data;
pub mod guest;
pub mod independent_mip;
pub mod programs;
