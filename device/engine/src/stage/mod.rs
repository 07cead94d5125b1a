//! The stages of the pipeline, in the order of the paper's Figure 4.

pub mod classify;
pub mod composite;
pub mod cursor;
pub mod gradient;
pub mod illuminate;
pub mod interpolate;
pub mod magnitude;
pub mod reflect;
pub mod reflectance;
pub mod sample;
pub mod section;
pub mod visibility;
