//! Tests of the renderers without any device: frames go from registers to pixel memory.
//!
//! [`card`] is what a card has of memory, [`grid`] volumes in readable form, [`scene`] frames in readable form,
//! [`lit`] lights;
//! [`bounds`] says how far the reference may be from the ideal.
//! All other modules are tests.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod bounds;
mod card;
mod grid;
mod lit;
mod scene;

mod blocks;
mod error;
mod frames;
mod guard_pages;
mod omissions;
mod optimised;
mod registers;
mod sections;
mod shading;
mod shading_sphere;
mod speed;
mod stability;
mod symmetry;
mod visibility;
mod volumes;
