//! Integration tests of the VolumePro emulator: whole programs against each other and against independent judges.
//!
//! * [`guest`] runs virtual machines with the card,
//! * [`programs`] runs the command and the device process,
//! * [`data`] finds real volumes,
//! * [`independent_mip`] judges pictures without sharing anything with the library,
//! * [`contact_sheet`] puts pictures side by side, with labels in a [`font`] of its own.

pub mod contact_sheet;
pub mod data;
pub mod font;
pub mod guest;
pub mod independent_mip;
pub mod programs;
