//! Programming mistakes, which strict mode names.

use vg500_regs::memory::Table;
use vg500_regs::{Fault, Register};

use super::plane::Plane;
use crate::dma::DmaError;

/// Something that a client should not have done.
#[derive(Clone, Debug, thiserror::Error)]
pub(super) enum Mistake {
    #[error("read of write-only {}", .0.name)]
    ReadOfWriteOnly(&'static Register),
    #[error("write to read-only {}", .0.name)]
    WriteToReadOnly(&'static Register),
    #[error("reserved bits {bits:#x} written to {}", register.name)]
    ReservedBits { register: &'static Register, bits: u32 },
    #[error("write of {bytes} bytes at {offset:#06x}: registers are written in whole aligned words")]
    PartOfWord { offset: u32, bytes: usize },
    #[error("read of undocumented offset {0:#06x}")]
    UndocumentedRead(u32),
    #[error("write to undocumented offset {0:#06x}")]
    UndocumentedWrite(u32),
    #[error("access to base address register {0} while memory space is disabled")]
    MemoryDisabled(u32),
    #[error("wrong key {0:#010x} written to RESET")]
    ResetKey(u32),
    #[error("frame {tag} refused: {fault}")]
    FrameRefused { tag: u16, fault: Fault },
    #[error("frame {tag} has the tag of the frame before it on {plane}")]
    SameTag { tag: u16, plane: Plane },
    #[error("transfer {tag} refused: {fault}")]
    TransferRefused { tag: u16, fault: Fault },
    #[error("transfer {tag} reads {plane}, where frame {frame} is rendered in another format")]
    TransferOfOtherFormat { tag: u16, plane: Plane, frame: u16 },
    #[error("transfer {tag} cannot reach host memory: {error}")]
    TransferTarget { tag: u16, error: DmaError },
    #[error("the status copy cannot reach host memory: {0}")]
    StatusTarget(DmaError),
    #[error("the {} (copy {copy}) was written while frame {tag} used it", table.name())]
    TableWritten { tag: u16, table: Table, copy: usize },
    #[error("the volume of frame {0} was written while it was rendered")]
    VolumeWritten(u16),
    #[error(
        "the volume of frame {0} is not what it was in the last frame of it, though the start command promised it"
    )]
    BrokenPromise(u16),
}
