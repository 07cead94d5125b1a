//! To be described.

pub mod independent_mip;
