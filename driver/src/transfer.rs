//! Transfers of pixels to host memory by bus mastering.

use vg500_regs::table::{
    cancel, reset, transfer, transfer_address_low, transfer_fault, transfer_origin, transfer_pitch,
    transfer_size, transfer_state,
};
use vg500_regs::{Fault, FaultCode, PixelFormat};

use crate::frame::GRACE;
use crate::plane::mask;
use crate::status::{Outcome, Source};
use crate::transport::HostMemory;
use crate::{BasePlane, Card, Error, Rectangle, lock};

/// Registers of a transfer, its command the last.
pub(crate) const TRANSFER_WORDS: usize =
    (transfer::REGISTER.offset - transfer_address_low::REGISTER.offset) as usize / 4 + 1;

impl Card {
    /// Has the card convert a rectangle of a base plane to a pixel format and write it to host memory, at byte
    /// `offset` of `target` with `pitch` bytes from one row to the next; waits until that is done.
    ///
    /// The card begins once frames on the base plane that were submitted before have ended, so there is no need
    /// to wait for them. One transfer runs at a time.
    ///
    /// # Errors
    ///
    /// [`Error::RectangleOutside`], [`Error::TransferOutside`], [`Error::Refused`] (it names the field), or
    /// [`Error::Timeout`] after the time of [`set_patience`](Self::set_patience).
    pub fn transfer(
        &self,
        plane: &BasePlane,
        rectangle: Rectangle,
        format: PixelFormat,
        target: &dyn HostMemory,
        offset: usize,
        pitch: u32,
    ) -> Result<(), Error> {
        self.check_owner(plane)?;
        rectangle.check()?;
        check_target(rectangle, format, target.view().size(), offset, pitch)?;

        let mut last_tag = lock(&self.transfers);
        *last_tag = last_tag.wrapping_add(1);
        let tag = *last_tag;
        let address = target.bus_address() + offset as u64;
        let words = [
            address as u32,
            (address >> 32) as u32,
            pitch,
            transfer_origin::COLUMN.put(rectangle.column) | transfer_origin::ROW.put(rectangle.row),
            transfer_size::WIDTH.put(rectangle.width) | transfer_size::HEIGHT.put(rectangle.height),
            transfer::PLANE.put(plane.index())
                | transfer::PLANE_FORMAT.put(plane.format() as u32)
                | transfer::PIXEL_FORMAT.put(format as u32)
                | transfer::TAG.put(tag.into()),
        ];
        let resets = {
            let mut state = lock(&self.state);
            self.write_transfer(&mut state.transfer_words, words)?;
            state.transferred = mask(plane.covers());
            state.resets
        };
        let result = self.finish_transfer(tag, resets);
        lock(&self.state).transferred = 0;
        result
    }

    /// Starts a transfer; writes what changed alone if that saves anything.
    fn write_transfer(
        &self,
        shadow: &mut Option<[u32; TRANSFER_WORDS]>,
        words: [u32; TRANSFER_WORDS],
    ) -> Result<(), Error> {
        let first = transfer_address_low::REGISTER.offset;
        match shadow.take() {
            Some(old) if !self.transport.bursts() => {
                for (offset, (word, old)) in (first..).step_by(4).zip(words.iter().zip(old)) {
                    if *word != old || offset == transfer::REGISTER.offset {
                        self.transport.write_registers(offset, &[*word])?;
                    }
                }
            }
            _ => self.transport.write_registers(first, &words)?,
        }
        *shadow = Some(words);
        Ok(())
    }

    fn finish_transfer(&self, tag: u16, resets: u32) -> Result<(), Error> {
        let what = || format!("transfer {tag}");
        let refused = |fault| Error::Refused { what: what(), fault };
        let outcome = |source| self.transfer_outcome(tag, resets, source);
        if let Some(outcome) = self.poll_until(self.patience, outcome)? {
            return outcome.map_err(refused);
        }
        let transfers = cancel::TRANSFERS.put(1);
        self.transport.write_registers(cancel::REGISTER.offset, &[transfers])?;
        match self.poll_until(GRACE, outcome)? {
            None => Err(Error::Stuck { what: what() }),
            Some(Err(fault)) if fault.code == FaultCode::Cancelled => {
                Err(Error::Timeout { what: what(), timeout: self.patience })
            }
            Some(outcome) => outcome.map_err(refused),
        }
    }

    fn transfer_outcome(&self, tag: u16, resets: u32, source: Source) -> Result<Option<Outcome>, Error> {
        if lock(&self.state).resets != resets {
            return Ok(Some(Err(Fault::new(FaultCode::Cancelled, reset::KEY))));
        }
        let registers = (transfer_state::REGISTER, transfer_fault::REGISTER);
        self.status.outcome(&*self.transport, source, registers, 0, tag)
    }
}

/// Refuses a rectangle that does not fit into its buffer: the card knows the host memory that it may reach, but
/// not where one buffer ends.
fn check_target(
    rectangle: Rectangle,
    format: PixelFormat,
    size: usize,
    offset: usize,
    pitch: u32,
) -> Result<(), Error> {
    let bytes = rectangle.width as usize * format.bytes();
    let end = (u64::from(rectangle.height) - 1)
        .checked_mul(pitch.into())
        .and_then(|last_row| last_row.checked_add(offset as u64))
        .and_then(|last_row| last_row.checked_add(bytes as u64));
    let fits = pitch & !transfer_pitch::BYTES.mask() == 0 && end.is_some_and(|end| end <= size as u64);
    if fits {
        Ok(())
    } else {
        Err(Error::TransferOutside { bytes, rows: rectangle.height, pitch, offset, size })
    }
}

#[cfg(test)]
mod tests;

// The registers from the address on are written at once.
const _: () = assert!(
    TRANSFER_WORDS == 6 && transfer_pitch::REGISTER.offset == transfer_address_low::REGISTER.offset + 8
);
