//! The card as a client sees it, over a bus and a renderer that can be looked at and held.

mod commands;
mod frames;
mod life;
mod random;
mod registers;
mod rig;
mod strict;
mod telling;
mod transfers;
