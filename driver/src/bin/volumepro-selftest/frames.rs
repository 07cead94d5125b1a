//! Frames, their pixels by bus mastering, and their interrupts.

use std::thread;
use std::time::{Duration, Instant};

use vg500_regs::pci::{VECTORS, Vector};
use vg500_regs::table::{base_plane_size, eye_xy, eye_z, start_x, start_y, step_x, step_y, trapped_reads};
use vg500_regs::{FaultCode, FrameRegisters, PixelFormat, SharedView};
use volumepro_driver::{Error, HostMemory, Rectangle, TableContent};

use crate::rig::{Failure, Rig, ensure};
use crate::scene::{SIZE, SOON, compare, picture, rectangle};

/// Most trapped accesses of a frame of which only the view has changed.
const STEADY: u64 = 20;
/// How long an interrupt may take.
const LATE: Duration = Duration::from_secs(2);
/// A bus address that nothing is mapped at.
const NOWHERE: u64 = 1 << 37;

const FORMATS: [PixelFormat; 12] = [
    PixelFormat::Rgba8,
    PixelFormat::Bgra8,
    PixelFormat::Argb8,
    PixelFormat::Abgr8,
    PixelFormat::Rgba4,
    PixelFormat::Bgra4,
    PixelFormat::Argb4,
    PixelFormat::Abgr4,
    PixelFormat::Rgba12,
    PixelFormat::Bgra12,
    PixelFormat::Argb12,
    PixelFormat::Abgr12,
];

/// The picture in every pixel format, by bus mastering; nothing is written between its rows.
pub fn transfers(rig: &Rig) -> Result<String, Failure> {
    rig.scene.render(&rig.card)?;
    let pitch = SIZE[0] as usize * 8 + 24;
    let offset = 40;
    let target = rig.card.host_memory(offset + pitch * SIZE[1] as usize)?;
    let mut found = vec![0; offset + pitch * SIZE[1] as usize];
    for format in FORMATS {
        let mut expected = vec![0xa5; found.len()];
        target.view().write(0, &expected)?;
        fill(&mut expected, offset, pitch, format);
        rig.card.transfer(&rig.scene.plane, rectangle(), format, &*target, offset, pitch as u32)?;
        target.view().read(0, &mut found)?;
        compare(&found, &expected).map_err(|error| format!("{format:?}: {error}"))?;
    }
    Ok(format!("{} pixel formats arrive in host memory as expected", FORMATS.len()))
}

/// Writes the picture into `bytes` as a transfer must.
fn fill(bytes: &mut [u8], offset: usize, pitch: usize, format: PixelFormat) {
    let rows = bytes[offset..].chunks_mut(pitch);
    for (row, pixels) in rows.zip(picture().chunks_exact(SIZE[0] as usize * 4)) {
        let pixels = pixels.as_chunks().0.iter().flat_map(|pixel| converted(format, *pixel));
        row.iter_mut().zip(pixels).for_each(|(byte, converted)| *byte = converted);
    }
}

/// A pixel of bytes R, G, B, A in another format, by the programming manual: components in the order of the
/// format's name; 8 bits become 12 by replication, 4 by rounding to nearest.
fn converted(format: PixelFormat, [r, g, b, a]: [u8; 4]) -> Vec<u8> {
    let code = format as usize;
    let ordered = [[r, g, b, a], [b, g, r, a], [a, r, g, b], [a, b, g, r]][code % 4];
    match code / 4 {
        0 => ordered.to_vec(),
        1 => {
            let nibbles = ordered.map(|component| (f64::from(component) * 15.0 / 255.0).round() as u16);
            let word = nibbles.iter().rev().fold(0, |word, nibble| word << 4 | nibble);
            word.to_le_bytes().to_vec()
        }
        _ => {
            let wide = ordered.map(|component| u16::from(component) << 4 | u16::from(component) >> 4);
            wide.into_iter().flat_map(u16::to_le_bytes).collect()
        }
    }
}

/// Accesses to registers of a frame of which the whole view has changed, its report and its pixels; counted here
/// and by the card.
pub fn steady(rig: &Rig) -> Result<String, Failure> {
    let frame = |number| -> Result<(), Failure> {
        rig.card.load_table(&TableContent::diffuse(&[number as u8; 384]))?;
        let ticket = rig.card.submit(&rig.scene.plane, &view(rig, number))?;
        rig.card.wait(ticket, SOON)?;
        rig.card.report(ticket)?;
        rig.card.fetch_pixels(&rig.scene.plane, Rectangle::of_size(SIZE[0] - number, SIZE[1]))?;
        Ok(())
    };
    frame(1)?;
    let (counted, before) = (rig.card.trapped_accesses()?, rig.meter.read().0);
    frame(2)?;
    let (now, accesses) = (rig.card.trapped_accesses()?, rig.meter.read().0 - before);
    // Reading the counters takes this many accesses itself.
    let own = 2 * u64::from(trapped_reads::REGISTER.count);
    let accesses = accesses - own;
    let seen = now.reads[0].wrapping_sub(counted.reads[0]) + now.writes[0].wrapping_sub(counted.writes[0]);
    ensure(u64::from(seen) == accesses + own, || {
        format!("{accesses} accesses were made, the card counts {}", i64::from(seen) - own as i64)
    })?;
    ensure(accesses <= STEADY, || format!("{accesses} trapped accesses, more than {STEADY}"))?;
    Ok(format!("{accesses} trapped accesses with report and pixels, at most {STEADY} allowed"))
}

/// A view in which everything differs from any other.
fn view(rig: &Rig, number: u32) -> FrameRegisters {
    let mut registers = rig.scene.registers.clone();
    for field in [start_x::POSITION, start_y::POSITION, step_x::STEP, step_y::STEP, eye_xy::X, eye_z::Z] {
        registers.set(field, 1000 * number);
    }
    registers.set(base_plane_size::WIDTH, SIZE[0] - number);
    registers
}

/// Every frame interrupts once, on its own vector; so do transfers.
pub fn interrupts(rig: &Rig, frames: u32) -> Result<String, Failure> {
    let target = rig.card.host_memory(4096)?;
    settle();
    let mut expected = counts(rig)?;
    let mut latencies = Vec::new();
    for frame in 1..=frames {
        let begun = Instant::now();
        rig.scene.render(&rig.card)?;
        expected[Vector::Frame as usize] += 1;
        arrive(rig, expected).map_err(|error| format!("after frame {frame}: {error}"))?;
        latencies.push(begun.elapsed());
        if frame.is_multiple_of(100) {
            rig.card.transfer(&rig.scene.plane, one_row(), PixelFormat::Rgba8, &*target, 0, 4096)?;
            expected[Vector::Transfer as usize] += 1;
            arrive(rig, expected).map_err(|error| format!("after a transfer: {error}"))?;
        }
    }
    settle();
    let end = counts(rig)?;
    ensure(end == expected, || format!("vectors counted {end:?} instead of {expected:?}"))?;
    latencies.sort_unstable();
    let median = latencies[latencies.len() / 2].as_micros();
    Ok(format!(
        "{frames} frames, {frames} interrupts, none lost; frame and interrupt take {median} us (median)"
    ))
}

fn one_row() -> Rectangle {
    Rectangle::of_size(SIZE[0], 1)
}

/// Interrupts of each cause so far; with fewer vectors they could not be told apart.
fn counts(rig: &Rig) -> Result<[u64; VECTORS as usize], Failure> {
    let counts = rig.card.interrupt_counts();
    counts
        .try_into()
        .map_err(|counts: Vec<_>| format!("{} interrupt vectors instead of {VECTORS}", counts.len()).into())
}

/// Waits until the vectors have counted what they should.
fn arrive(rig: &Rig, expected: [u64; VECTORS as usize]) -> Result<(), Failure> {
    let end = Instant::now() + LATE;
    loop {
        let found = counts(rig)?;
        if found == expected {
            return Ok(());
        }
        let surplus = found.iter().zip(expected).any(|(found, expected)| *found > expected);
        ensure(!surplus && Instant::now() < end, || {
            format!("vectors counted {found:?} instead of {expected:?}")
        })?;
        thread::yield_now();
    }
}

/// Lets interrupts arrive that are under way.
fn settle() {
    thread::sleep(Duration::from_millis(50));
}

/// A frame that the card refuses names the field and interrupts on the vector of faults.
pub fn refusal(rig: &Rig) -> Result<String, Failure> {
    settle();
    let before = counts(rig)?[Vector::Fault as usize];
    let mut registers = rig.scene.registers.clone();
    registers.set(base_plane_size::WIDTH, 0);
    let ticket = rig.card.submit(&rig.scene.plane, &registers)?;
    let error = match rig.card.wait(ticket, SOON) {
        Err(error @ Error::Refused { .. }) => error.to_string(),
        other => return Err(format!("a frame without pixels ends with {other:?}").into()),
    };
    ensure(error.contains("BASE_PLANE_SIZE.WIDTH"), || error.clone())?;
    settle();
    let after = counts(rig)?[Vector::Fault as usize];
    ensure(after == before + 1, || format!("{} interrupts of faults instead of 1", after - before))?;
    Ok(error)
}

/// Memory whose bus address belongs to nothing.
struct Elsewhere(Box<dyn HostMemory>);

impl HostMemory for Elsewhere {
    fn bus_address(&self) -> u64 {
        NOWHERE
    }

    fn view(&self) -> SharedView<'_> {
        self.0.view()
    }
}

/// A transfer to a bus address that nothing is mapped at fails, and the card works on.
pub fn unmapped(rig: &Rig) -> Result<String, Failure> {
    let elsewhere = Elsewhere(rig.card.host_memory(4096)?);
    match rig.card.transfer(&rig.scene.plane, one_row(), PixelFormat::Rgba8, &elsewhere, 0, 4096) {
        Err(Error::Refused { fault, .. }) if fault.code == FaultCode::HostMemory => {}
        other => return Err(format!("a transfer to address {NOWHERE:#x} ends with {other:?}").into()),
    }
    rig.scene.check(&rig.card)?;
    Ok(format!("a transfer to {NOWHERE:#x} is refused"))
}
