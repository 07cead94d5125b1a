//! Strict mode, in which the card counts programming mistakes.

use vg500_regs::table::{self, mistakes};

use crate::rig::{Failure, Rig, ensure};

/// Whether the card is in strict mode: a deliberate mistake is counted. Reading a write-only register gives all
/// ones in either mode.
pub fn deliberate_mistake(rig: &Rig) -> Result<bool, Failure> {
    let before = rig.card.mistakes()?;
    let word = rig.card.transport().read_register(table::start::REGISTER.offset)?;
    ensure(word == u32::MAX, || format!("the write-only register START reads as {word:#x}"))?;
    let counted = rig.card.transport().read_register(mistakes::REGISTER.offset)?.wrapping_sub(before);
    ensure(counted <= 1, || format!("one mistake was counted as {counted}"))?;
    Ok(counted == 1)
}
