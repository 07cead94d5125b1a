//! The vg500's programming interface, written once.
//!
//! Device, engine, driver and the programming manual all take it from here:
//!
//! * [`pci`]: identity and base address registers,
//! * [`register`] and [`table`]: the one register table and the fields of each word,
//! * [`frame_registers`]: the words a frame is described by,
//! * [`format`]: voxel formats, pixel formats, blend modes,
//! * [`permutation`]: object axes as seen along the view,
//! * [`memory`]: what lies where in table, voxel and pixel memory,
//! * [`section`]: what lies where in section memory,
//! * [`fault`]: why the card refused or gave up a command,
//! * [`limit`]: the card's limits,
//! * [`number`]: number formats,
//! * [`reflectance`]: what the entries of a reflectance map stand for,
//! * [`shared`]: access to memory that another process may change at any time,
//! * [`manual`]: the register chapter of the programming manual.

pub mod fault;
pub mod format;
pub mod frame_registers;
pub mod limit;
pub mod manual;
pub mod memory;
pub mod number;
pub mod pci;
pub mod permutation;
pub mod reflectance;
pub mod register;
pub mod section;
pub mod shared;
pub mod table;

pub use fault::{Fault, FaultCode};
pub use format::{BlendMode, PixelFormat, PlaneFormat, VoxelFormat};
pub use frame_registers::FrameRegisters;
pub use permutation::Permutation;
pub use register::{Access, Field, Register};
pub use shared::SharedView;
