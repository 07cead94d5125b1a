//! The protocol server against a hand-made client, one module per kind of message, wrong messages first.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;

mod access;
mod dma;
mod dma_messages;
mod framing;
mod information;
mod interrupts;
mod life;
mod peer;
mod random;
mod version;
