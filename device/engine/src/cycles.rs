//! How long the real chip would have taken for a frame.
//!
//! Four pipelines take a voxel each per clock (paper, section 5.1); dimensions are those of the store, padded to
//! multiples of 32 (section 5.2); supersampling by k takes k times as long (section 4.1). 256^3 voxels take
//! 4 194 304 clocks, 33.55 ms at 125 MHz.

use crate::frame::FrameDescription;
use vg500_regs::limit::PIPELINES;
use vg500_regs::memory::padded;

/// Clock cycles of a frame.
#[must_use]
pub fn cycles(frame: &FrameDescription) -> u64 {
    let voxels: u64 = frame.volume.size.iter().map(|&size| u64::from(padded(size))).product();
    voxels * u64::from(frame.rays.supersampling) / u64::from(PIPELINES)
}
