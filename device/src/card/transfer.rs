//! Transfers: a rectangle of a base plane goes to host memory, its pixels converted on the way.

use vg500_engine::Cancel;
use vg500_regs::limit::BASE_PLANE_SIZE;
use vg500_regs::memory::plane_offset;
use vg500_regs::table::*;
use vg500_regs::{Fault, FaultCode, Field, PixelFormat, PlaneFormat, SharedView};

use super::bus::{Bus, Held};
use super::pixel::Source;
use super::plane::Plane;
use super::registers::RegisterFile;
use crate::dma::DmaError;

/// What a transfer command took from the registers, validated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Transfer {
    pub(super) plane: Plane,
    source: Source,
    target: PixelFormat,
    /// Column and row of the first pixel.
    origin: [u32; 2],
    /// Columns and rows.
    size: [u32; 2],
    address: u64,
    /// Bytes from row to row in host memory.
    pitch: u64,
}

/// Why a transfer did not come to its end.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Stopped {
    /// It was cancelled.
    Cancelled,
    /// Host memory cannot be reached.
    HostMemory(DmaError),
    /// Pixel memory is smaller than it should be.
    PixelMemory,
}

impl Transfer {
    /// The transfer that the registers ask for.
    ///
    /// # Errors
    ///
    /// A fault that names the first field that is out of range.
    pub(super) fn take(registers: &RegisterFile) -> Result<Self, Fault> {
        let source = match registers.get(transfer::PLANE_FORMAT) {
            0 => Source::Rgba8,
            1 => Source::Accumulator64,
            _ => return Err(value_of(transfer::PLANE_FORMAT)),
        };
        let plane = Plane::new(source.plane_format(), registers.get(transfer::PLANE));
        let target = PixelFormat::from_code(registers.get(transfer::PIXEL_FORMAT));
        let target = target.ok_or(value_of(transfer::PIXEL_FORMAT))?;
        let columns = extent(registers, transfer_origin::COLUMN, transfer_size::WIDTH)?;
        let rows = extent(registers, transfer_origin::ROW, transfer_size::HEIGHT)?;
        let pitch = registers.get(transfer_pitch::BYTES);
        if pitch < columns[1] * target.bytes() as u32 {
            return Err(value_of(transfer_pitch::BYTES));
        }
        Ok(Self {
            plane: plane.ok_or(value_of(transfer::PLANE))?,
            source,
            target,
            origin: [columns[0], rows[0]],
            size: [columns[1], rows[1]],
            address: registers.wide(transfer_address_low::REGISTER, transfer_address_high::REGISTER),
            pitch: pitch.into(),
        })
    }

    /// Bytes that arrive in host memory.
    pub(super) const fn bytes(&self) -> u64 {
        self.row_bytes() * self.size[1] as u64
    }

    /// Carries it out. Host memory is found, all of it, before the first pixel is written.
    ///
    /// # Errors
    ///
    /// [`Stopped`]; rows above may have arrived.
    pub(super) fn run(&self, pixels: &SharedView<'_>, bus: &dyn Bus, cancel: &Cancel) -> Result<(), Stopped> {
        let rows = self.hold(bus).map_err(Stopped::HostMemory)?;
        let [column, first] = self.origin;
        let mut stored = vec![0; self.size[0] as usize * self.plane.format().bytes()];
        let mut converted = Vec::new();
        for (row, host) in (first..).zip(rows) {
            cancel.check().map_err(|_| Stopped::Cancelled)?;
            let offset = plane_offset(self.plane.format(), self.plane.number(), column, row);
            pixels.read(offset, &mut stored).map_err(|_| Stopped::PixelMemory)?;
            converted.clear();
            self.source.convert(&stored, self.target, &mut converted);
            // Memory that is taken away in the midst of a transfer cancels it as well.
            host.write(0, &converted).map_err(|error| match cancel.check() {
                Ok(()) => Stopped::HostMemory(error),
                Err(_) => Stopped::Cancelled,
            })?;
        }
        Ok(())
    }

    /// Holds the host memory of each row; what lies between rows may be anything.
    fn hold(&self, bus: &dyn Bus) -> Result<Vec<Box<dyn Held>>, DmaError> {
        let length = self.row_bytes();
        let hold = |row: u32| {
            let distance = u64::from(row) * self.pitch;
            let iova = self.address.checked_add(distance);
            let wraps = DmaError::Wraps { iova: self.address, length: distance + length };
            bus.hold(iova.ok_or(wraps)?, length)
        };
        (0..self.size[1]).map(hold).collect()
    }

    const fn row_bytes(&self) -> u64 {
        self.size[0] as u64 * self.target.bytes() as u64
    }
}

impl Source {
    const fn plane_format(self) -> PlaneFormat {
        match self {
            Self::Rgba8 => PlaneFormat::Rgba8,
            Self::Accumulator64 => PlaneFormat::Accumulator64,
        }
    }
}

impl Stopped {
    /// The fault that the registers show.
    pub(super) const fn fault(&self) -> Fault {
        match self {
            Self::Cancelled => Fault::CANCELLED,
            Self::HostMemory(_) => Fault::new(FaultCode::HostMemory, transfer_address_low::ADDRESS),
            Self::PixelMemory => Fault::new(FaultCode::Internal, transfer::PLANE),
        }
    }
}

const fn value_of(field: Field) -> Fault {
    Fault::new(FaultCode::Value, field)
}

/// First pixel and number of pixels along one axis of the base plane.
fn extent(registers: &RegisterFile, origin: Field, size: Field) -> Result<[u32; 2], Fault> {
    let [first, count] = [registers.get(origin), registers.get(size)];
    if first >= BASE_PLANE_SIZE {
        return Err(value_of(origin));
    }
    if !(1..=BASE_PLANE_SIZE).contains(&count) {
        return Err(value_of(size));
    }
    if first + count > BASE_PLANE_SIZE {
        return Err(Fault::new(FaultCode::Range, size));
    }
    Ok([first, count])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::card::fake::{Event, FakeBus};
    use std::sync::Arc;
    use vg500_regs::pci::PIXEL_MEMORY;

    fn registers() -> RegisterFile {
        let mut registers = RegisterFile::new();
        registers.set(transfer_address_low::ADDRESS, 0x1000);
        registers.set(transfer_pitch::BYTES, 100);
        registers.set(transfer_origin::COLUMN, 500);
        registers.set(transfer_origin::ROW, 2);
        registers.set(transfer_size::WIDTH, 12);
        registers.set(transfer_size::HEIGHT, 3);
        registers.set(transfer::PLANE, 5);
        registers
    }

    fn pixels() -> Vec<u8> {
        (0..PIXEL_MEMORY.size).map(|at| (at / 7) as u8).collect()
    }

    #[test]
    fn each_field_out_of_range_is_named() {
        let cases = [
            (transfer::PLANE_FORMAT, 2, FaultCode::Value),
            (transfer::PLANE_FORMAT, 3, FaultCode::Value),
            (transfer::PIXEL_FORMAT, 12, FaultCode::Value),
            (transfer_origin::COLUMN, 512, FaultCode::Value),
            (transfer_origin::ROW, 1023, FaultCode::Value),
            (transfer_size::WIDTH, 0, FaultCode::Value),
            (transfer_size::WIDTH, 513, FaultCode::Value),
            (transfer_size::WIDTH, 13, FaultCode::Range),
            (transfer_size::HEIGHT, 511, FaultCode::Range),
            (transfer_pitch::BYTES, 47, FaultCode::Value),
        ];
        for (field, value, code) in cases {
            let mut registers = registers();
            registers.set(field, value);
            assert_eq!(Transfer::take(&registers), Err(Fault::new(code, field)), "{value}");
        }
        let mut wide = registers();
        wide.set(transfer::PLANE_FORMAT, 1);
        wide.set(transfer::PLANE, 8);
        assert_eq!(Transfer::take(&wide), Err(value_of(transfer::PLANE)));
        wide.set(transfer::PLANE, 7);
        assert!(Transfer::take(&wide).is_ok());
    }

    #[test]
    fn nothing_is_written_unless_all_rows_are_there() {
        let bus = FakeBus::with_memory(0x1000..0x1000 + 200 + 47);
        let transfer = Transfer::take(&registers()).unwrap();
        let mut pixels = pixels();
        let result = transfer.run(&SharedView::of(&mut pixels), &*bus, &Cancel::default());
        assert!(matches!(result, Err(Stopped::HostMemory(DmaError::NotMapped { .. }))), "{result:?}");
        assert!(bus.events().is_empty());
    }

    #[test]
    fn rows_past_the_address_space_are_refused() {
        let mut registers = registers();
        registers.set(transfer_address_low::ADDRESS, u32::MAX);
        registers.set(transfer_address_high::ADDRESS, u32::MAX);
        let transfer = Transfer::take(&registers).unwrap();
        let bus = FakeBus::with_memory(0..u64::MAX);
        let result = transfer.run(&SharedView::of(&mut pixels()), &*bus, &Cancel::default());
        assert!(matches!(result, Err(Stopped::HostMemory(_))), "{result:?}");
    }

    #[test]
    fn a_cancelled_transfer_stops() {
        let bus = FakeBus::with_memory(0..0x10000);
        let cancel = Cancel::default();
        cancel.cancel();
        let transfer = Transfer::take(&registers()).unwrap();
        let result = transfer.run(&SharedView::of(&mut pixels()), &*bus, &cancel);
        assert_eq!(result, Err(Stopped::Cancelled));
        assert!(bus.events().is_empty());
    }

    #[test]
    fn the_rectangle_arrives_row_by_row() {
        for (source, format, bytes) in [(0, PlaneFormat::Rgba8, 4), (1, PlaneFormat::Accumulator64, 8)] {
            let mut registers = registers();
            registers.set(transfer::PLANE_FORMAT, source);
            registers.set(transfer::PIXEL_FORMAT, PixelFormat::Bgra8 as u32);
            let transfer = Transfer::take(&registers).unwrap();
            assert_eq!(transfer.bytes(), 12 * 4 * 3);
            let bus: Arc<FakeBus> = FakeBus::with_memory(0x1000..0x1000 + 200 + 48);
            let mut pixels = pixels();
            transfer.run(&SharedView::of(&mut pixels), &*bus, &Cancel::default()).unwrap();
            let expected: Vec<_> = (0..3)
                .map(|row| {
                    let start = (5 * 512 * 512 + (2 + row) * 512 + 500) * bytes;
                    let mut converted = Vec::new();
                    assert_eq!(plane_offset(format, 5, 500, 2 + row as u32), start);
                    transfer.source.convert(
                        &pixels[start..start + 12 * bytes],
                        PixelFormat::Bgra8,
                        &mut converted,
                    );
                    Event::Write(0x1000 + 100 * row as u64, converted)
                })
                .collect();
            assert_eq!(bus.events(), expected);
        }
    }
}
