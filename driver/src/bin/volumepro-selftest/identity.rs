//! What the card says it is.

use vg500_regs::pci::{CLASS_CODE, VECTORS};
use volumepro_driver::Completion;

use crate::rig::{Failure, Rig, ensure};

/// Byte offsets in configuration space, and the capability of PCI Express.
const CLASS: u16 = 8;
const FIRST_CAPABILITY: u16 = 0x34;
pub const EXPRESS: u8 = 0x10;

/// Class and registers.
pub fn identity(rig: &Rig) -> Result<String, Failure> {
    let class = rig.card.transport().read_config(CLASS)? >> 8;
    ensure(class == CLASS_CODE, || format!("class {class:06x} instead of {CLASS_CODE:06x}"))?;
    let info = rig.card.info();
    Ok(format!(
        "{:04x}:{:04x} revision {}, interface {}.{}, {} {} {} with {} threads, {} MiB of voxels",
        info.vendor,
        info.device,
        info.revision,
        info.interface.0,
        info.interface.1,
        info.architecture,
        info.renderer,
        info.simd,
        info.threads,
        info.voxel_memory >> 20
    ))
}

/// Interrupts arrive, and the card's status in host memory.
pub fn completion(rig: &Rig) -> Result<String, Failure> {
    let (completion, vectors) = (rig.card.completion(), rig.card.interrupt_counts().len());
    let told = || format!("{completion:?} instead of Interrupt: does the card offer MSI-X or MSI?");
    ensure(completion == Completion::Interrupt, told)?;
    ensure(vectors == usize::from(VECTORS), || format!("{vectors} vectors instead of {VECTORS}"))?;
    Ok(format!("{vectors} vectors, status copied to host memory"))
}

/// Where a capability begins in configuration space.
pub fn capability(rig: &Rig, id: u8) -> Result<u16, Failure> {
    let transport = rig.card.transport();
    let mut at = transport.read_config(FIRST_CAPABILITY)? as u8;
    for _ in 0..48 {
        let [found, next, ..] = transport.read_config(u16::from(at & 0xfc))?.to_le_bytes();
        match at {
            0 => break,
            at if found == id => return Ok(u16::from(at & 0xfc)),
            _ => at = next,
        }
    }
    Err(format!("no PCI capability {id:#x}").into())
}
