//! Tests of the renderers without any device: frames go from registers to pixel memory.
//!
//! [`card`] is what a card has of memory, [`grid`] volumes in readable form, [`scene`] frames in readable form.
//! All other modules are tests.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod card;
mod grid;
mod scene;

mod blocks;
mod error;
mod frames;
mod registers;
mod speed;
mod stability;
mod symmetry;
mod volumes;
