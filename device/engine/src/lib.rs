//! The vg500's render engine: a pure function of (frame description, tables, voxel memory) to (pixel memory,
//! counters). It knows no bus, no socket and no clock.
//!
//! Data flow, and the order of the modules:
//!
//! 1. [`frame`]: registers become a [`frame::FrameDescription`], validated once, then normalised.
//! 2. [`tables`]: lookup tables and maps, copied at the command.
//! 3. [`plan`]: which samples exist on which sample slice, with which weights.
//! 4. [`stage`]: the pipeline of the paper's Figure 4, a file for each stage.
//! 5. [`memory`]: how voxels and pixels lie in memory.
//! 6. [`reference`]: the renderer that defines the card, stage by stage.
//! 7. [`optimised`]: the renderer that the device runs; it draws the same, sooner.
//! 8. [`ideal`]: the same without quantisation, to measure errors.
//! 9. [`cycles`]: how long the real chip would have taken.
//!
//! [`fixed`] holds the number formats and roundings of all of it.

pub mod cycles;
pub mod fixed;
pub mod frame;
pub mod ideal;
pub mod memory;
pub mod optimised;
pub mod plan;
pub mod reference;
pub mod render;
pub mod stage;
pub mod tables;

pub use frame::FrameDescription;
pub use optimised::simd::{Level, LevelError};
pub use render::{Cancel, Engine, LeftOut, Memories, Renderer, Report, Task};
pub use tables::Tables;
