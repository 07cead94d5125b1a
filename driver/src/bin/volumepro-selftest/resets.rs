//! Resets, also while frames are rendered.

use std::thread;
use std::time::{Duration, Instant};

use vg500_regs::table::{RESET_KEY, base_plane_size, completed, material, reset, supersampling};
use vg500_regs::{FaultCode, FrameRegisters, PlaneFormat, VoxelFormat};
use volumepro_driver::{Error, TableContent};

use crate::identity::{EXPRESS, capability};
use crate::rig::{Failure, Rig, ensure};
use crate::scene::SOON;

/// PCI Express: offset of Device Control in the capability, and its bit for function-level reset.
const DEVICE_CONTROL: u16 = 8;
const INITIATE_RESET: u16 = 1 << 15;
/// Frames that keep the card busy.
const QUEUE: usize = 6;

/// `VFIO_DEVICE_RESET`.
pub fn by_system(rig: &Rig) -> Result<String, Failure> {
    rig.scene.render(&rig.card)?;
    rig.expect_no_mistakes()?;
    let start = Instant::now();
    rig.card.transport().reset()?;
    recovered(rig, start.elapsed())
}

/// Function-level reset, by its bit in configuration space.
pub fn by_function(rig: &Rig) -> Result<String, Failure> {
    let control = capability(rig, EXPRESS)? + DEVICE_CONTROL;
    rig.scene.render(&rig.card)?;
    rig.expect_no_mistakes()?;
    let start = Instant::now();
    let word = rig.card.transport().read_config(control)? as u16;
    rig.card.transport().write_config(control, word | INITIATE_RESET)?;
    recovered(rig, start.elapsed())
}

/// The register `RESET`.
pub fn by_register(rig: &Rig) -> Result<String, Failure> {
    rig.scene.render(&rig.card)?;
    rig.expect_no_mistakes()?;
    let start = Instant::now();
    rig.card.transport().write_registers(reset::REGISTER.offset, &[RESET_KEY])?;
    recovered(rig, start.elapsed())
}

/// The card is in power-on state, and works.
fn recovered(rig: &Rig, took: Duration) -> Result<String, Failure> {
    rig.expect_power_on()?;
    rig.card.reset()?;
    rig.scene.load(&rig.card)?;
    rig.scene.check(&rig.card)?;
    Ok(format!("power-on state after {:.1} ms, and the card works on", took.as_secs_f64() * 1e3))
}

/// A reset while frames wait and one is rendered: they end as cancelled, nothing of them happens afterwards.
pub fn during_frames(rig: &Rig) -> Result<String, Failure> {
    rig.expect_no_mistakes()?;
    let volume = rig.card.allocate_volume([256; 3], VoxelFormat::Uint8)?;
    let mut registers = FrameRegisters::default();
    volume.bind(&volume.whole(), &mut registers)?;
    registers.set(material::EMISSIVE, 255);
    registers.set(supersampling::Z, 8);
    registers.set(base_plane_size::WIDTH, 256);
    registers.set(base_plane_size::HEIGHT, 256);
    // Something to do for every sample: rays never become opaque.
    rig.card.load_table(&TableContent::opacity(&[1; 4096])?)?;
    let planes: Vec<_> =
        (0..QUEUE).map(|_| rig.card.allocate_plane(PlaneFormat::Rgba8)).collect::<Result<_, _>>()?;
    let tickets: Vec<_> =
        planes.iter().map(|plane| rig.card.submit(plane, &registers)).collect::<Result<_, _>>()?;
    let last = tickets[QUEUE - 1];
    thread::sleep(Duration::from_millis(5));
    ensure(!rig.card.has_ended(last)?, || format!("{QUEUE} frames of 256^3 voxels ended within 5 ms"))?;
    let start = Instant::now();
    rig.card.reset()?;
    let took = start.elapsed();
    match rig.card.wait(last, SOON) {
        Err(Error::Refused { fault, .. }) if fault.code == FaultCode::Cancelled => {}
        other => return Err(format!("a frame that was reset ends with {other:?}").into()),
    }
    thread::sleep(Duration::from_millis(200));
    let ended = rig.card.transport().read_register(completed::REGISTER.offset)?;
    ensure(ended == 0, || format!("{ended} commands from before the reset ended after it"))?;
    rig.scene.load(&rig.card)?;
    rig.scene.check(&rig.card)?;
    Ok(format!(
        "{QUEUE} frames cancelled by a reset of {:.1} ms, and the card works on",
        took.as_secs_f64() * 1e3
    ))
}
