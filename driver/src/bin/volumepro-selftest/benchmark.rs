//! What accesses and frames cost.

use std::hint::black_box;
use std::time::{Duration, Instant};

use serde::Serialize;
use vg500_regs::memory::volume_bytes;
use vg500_regs::pci::{PIXEL_MEMORY, VOXEL_MEMORY};
use vg500_regs::table::{base_plane_size, completed, interrupt_enable, material, start_x};
use vg500_regs::{FrameRegisters, PixelFormat, PlaneFormat, VoxelFormat};
use volumepro_driver::{BasePlane, Rectangle, TableContent};

use crate::rig::{Failure, Rig};
use crate::scene::SOON;

/// Accesses of each kind that are timed.
const ACCESSES: usize = 1000;
/// Bytes that are copied, and how often; the fastest counts.
const COPIED: usize = 16 << 20;
const COPIES: usize = 5;

/// Median and 99th percentile in microseconds.
#[derive(Debug, Serialize)]
pub struct Spread {
    pub median_us: f64,
    pub p99_us: f64,
}

/// The parts of a frame from the doorbell until its pixels are in host memory. Each is a median over frames, so
/// they add up to about the total.
#[derive(Debug, Serialize)]
pub struct FrameCost {
    /// Rays along each side, voxels along each axis.
    pub size: u32,
    pub frames: u32,
    pub total: Spread,
    /// Accesses to registers.
    pub trapped: Spread,
    pub trapped_accesses: f64,
    /// In the card's engine, as it reports.
    pub engine: Spread,
    /// From the transfer's command until its pixels are there, without accesses to registers.
    pub transfer: Spread,
    /// Interrupts, wake-ups, the card's queue.
    pub rest: Spread,
}

/// Everything that is measured.
#[derive(Debug, Serialize)]
pub struct Benchmark {
    pub register_write: Spread,
    pub register_read: Spread,
    /// Gigabytes per second.
    pub voxel_memory_write: f64,
    pub voxel_memory_read: f64,
    pub pixel_memory_read: f64,
    pub frame: FrameCost,
}

/// Measures everything, with frames of a volume of `size` voxels along each axis.
pub fn run(rig: &Rig, frames: u32, size: u32) -> Result<Benchmark, Failure> {
    let transport = rig.card.transport();
    // What the driver has written there already, so that nothing changes.
    let enabled = [interrupt_enable::REGISTER.mask()];
    let write = || transport.write_registers(interrupt_enable::REGISTER.offset, &enabled);
    let read = || transport.read_register(completed::REGISTER.offset).map(drop);
    let voxels = rig.memory(VOXEL_MEMORY)?;
    let pixels = rig.memory(PIXEL_MEMORY)?;
    let mut bytes = vec![1; COPIED];
    let benchmark = Benchmark {
        register_write: repeated(write)?,
        register_read: repeated(read)?,
        voxel_memory_write: bandwidth(|| Ok(voxels.write(0, black_box(&bytes))?))?,
        voxel_memory_read: bandwidth(|| Ok(voxels.read(0, black_box(&mut bytes))?))?,
        pixel_memory_read: bandwidth(|| Ok(pixels.read(0, black_box(&mut bytes))?))?,
        frame: {
            rig.scene.load(&rig.card)?;
            frame_cost(rig, frames, size)?
        },
    };
    Ok(benchmark)
}

fn repeated(access: impl Fn() -> Result<(), volumepro_driver::Error>) -> Result<Spread, Failure> {
    let mut times = Vec::with_capacity(ACCESSES);
    for _ in 0..ACCESSES {
        let start = Instant::now();
        access()?;
        times.push(start.elapsed());
    }
    Ok(Spread::of(times))
}

fn bandwidth(mut copy: impl FnMut() -> Result<(), Failure>) -> Result<f64, Failure> {
    let mut fastest = Duration::MAX;
    for _ in 0..COPIES {
        let start = Instant::now();
        copy()?;
        fastest = fastest.min(start.elapsed());
    }
    Ok(COPIED as f64 / fastest.as_secs_f64() / 1e9)
}

fn frame_cost(rig: &Rig, frames: u32, size: u32) -> Result<FrameCost, Failure> {
    let volume = rig.card.allocate_volume([size; 3], VoxelFormat::Uint8)?;
    let mut registers = FrameRegisters::default();
    volume.bind(&volume.whole(), &mut registers)?;
    registers.set(material::EMISSIVE, 255);
    registers.set(base_plane_size::WIDTH, size);
    registers.set(base_plane_size::HEIGHT, size);
    rig.card.load_table(&TableContent::opacity(&[16; 4096])?)?;
    let voxels: Vec<u8> = (0..volume_bytes([size; 3], VoxelFormat::Uint8) as u32)
        .take((size as usize).pow(3))
        .map(|at| (at.wrapping_mul(0x9e37_79b9) >> 24) as u8)
        .collect();
    rig.card.upload(&volume, &volume.whole(), &voxels)?;
    let plane = rig.card.allocate_plane(PlaneFormat::Rgba8)?;
    measure(rig, &plane, &mut registers, frames, size)
}

fn measure(
    rig: &Rig,
    plane: &BasePlane,
    registers: &mut FrameRegisters,
    frames: u32,
    size: u32,
) -> Result<FrameCost, Failure> {
    let pitch = size * 4;
    let target = rig.card.host_memory((pitch * size) as usize)?;
    let rectangle = Rectangle::of_size(size, size);
    let [mut total, mut trapped, mut engine, mut transfer, mut rest] = [const { Vec::new() }; 5];
    let mut accesses = 0;
    // The first frame writes all registers, and touches the memory.
    for frame in 0..=frames {
        registers.set(start_x::POSITION, frame);
        let (count, before) = rig.meter.read();
        let start = Instant::now();
        let ticket = rig.card.submit(plane, registers)?;
        rig.card.wait(ticket, SOON)?;
        let (_, at_end) = rig.meter.read();
        let ended = Instant::now();
        rig.card.transfer(plane, rectangle, PixelFormat::Rgba8, &*target, 0, pitch)?;
        let (took, moved) = (start.elapsed(), ended.elapsed());
        let (last_count, last) = rig.meter.read();
        let rendered = rig.card.report(ticket)?.engine_time;
        if frame == 0 {
            continue;
        }
        accesses += last_count - count;
        total.push(took);
        trapped.push(last - before);
        engine.push(rendered);
        let moved = moved.saturating_sub(last - at_end);
        transfer.push(moved);
        rest.push(took.saturating_sub(last - before).saturating_sub(rendered).saturating_sub(moved));
    }
    Ok(FrameCost {
        size,
        frames,
        total: Spread::of(total),
        trapped: Spread::of(trapped),
        trapped_accesses: accesses as f64 / f64::from(frames),
        engine: Spread::of(engine),
        transfer: Spread::of(transfer),
        rest: Spread::of(rest),
    })
}

impl Spread {
    fn of(mut times: Vec<Duration>) -> Self {
        times.sort_unstable();
        let at = |part: usize| {
            let index = times.len() * part / 100;
            times.get(index.min(times.len().saturating_sub(1))).map_or(0.0, |it| it.as_secs_f64() * 1e6)
        };
        Self { median_us: at(50), p99_us: at(99) }
    }
}

impl Benchmark {
    /// The lines for people.
    pub fn print(&self) {
        let line = |name: &str, spread: &Spread| {
            println!("{name:<22}{:>10.1} us median {:>10.1} us p99", spread.median_us, spread.p99_us);
        };
        line("register write", &self.register_write);
        line("register read", &self.register_read);
        for (name, rate) in [
            ("voxel memory write", self.voxel_memory_write),
            ("voxel memory read", self.voxel_memory_read),
            ("pixel memory read", self.pixel_memory_read),
        ] {
            println!("{name:<22}{rate:>10.2} GB/s");
        }
        let frame = &self.frame;
        println!(
            "{} frames of {1}^3 voxels, {1} x {1} pixels, doorbell to pixels:",
            frame.frames, frame.size
        );
        line("  total", &frame.total);
        line("  register accesses", &frame.trapped);
        println!("  {:<20}{:>10.1}", "number of them", frame.trapped_accesses);
        line("  engine", &frame.engine);
        line("  transfer", &frame.transfer);
        line("  rest", &frame.rest);
    }
}
