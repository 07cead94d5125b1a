//! The stages of the pipeline on vectors of samples. Names, order and number formats are those of
//! [`crate::stage`], which says why they are as they are; here stands only how 16-bit lanes come to the same.

pub mod composite;
pub mod gradient;
pub mod illuminate;
pub mod interpolate;
pub mod light;
pub mod shade;
