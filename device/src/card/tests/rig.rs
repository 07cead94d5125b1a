//! A card to write to, and small frames for it.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tempfile::TempDir;
use vg500_engine::Renderer;
use vg500_regs::frame_registers::{FRAME_END, VIEW_START};
use vg500_regs::memory::Table;
use vg500_regs::pci::{REGISTERS, VECTORS};
use vg500_regs::table::*;
use vg500_regs::{BlendMode, Fault, FrameRegisters, PlaneFormat, Register, VoxelFormat};

use crate::card::engine::Render;
use crate::card::fake::FakeBus;
use crate::card::{Card, Host};
use crate::config::Config;
use crate::dma::DmaTable;
use crate::interrupt::Interrupts;
use crate::pci::CommandRegister;
use crate::protocol::{Device, ResetReason, region};
use crate::trace::Trace;

/// How long anything may take.
const PATIENCE: Duration = Duration::from_secs(20);

/// A card on a fake bus, traced.
pub(super) struct Rig {
    pub(super) card: Card,
    pub(super) bus: Arc<FakeBus>,
    trace: PathBuf,
    _folder: TempDir,
}

impl Rig {
    /// A card of the default set-up with the reference renderer.
    pub(super) fn new() -> Self {
        Self::with(Config::default(), Renderer::Reference.start())
    }

    /// A card in strict mode.
    pub(super) fn strict() -> Self {
        Self::with(Config { strict: true, ..Config::default() }, Renderer::Reference.start())
    }

    pub(super) fn with(config: Config, render: impl Render + 'static) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let trace = folder.path().join("trace");
        let command = Arc::new(CommandRegister::default());
        let host = Host {
            dma: Arc::new(DmaTable::new(Arc::clone(&command))),
            interrupts: Arc::new(Interrupts::new(config.interrupts, VECTORS, Arc::clone(&command))),
            command,
        };
        let bus = FakeBus::with_memory(0..1 << 20);
        let writer = Trace::to(&trace).unwrap();
        let mut card = Card::assemble(&config, writer, &host, bus.clone(), Box::new(render)).unwrap();
        card.reset(ResetReason::Connection);
        let mut rig = Self { card, bus, trace, _folder: folder };
        rig.enable();
        rig.bus.events();
        rig
    }

    /// Enables memory space and bus mastering.
    pub(super) fn enable(&mut self) {
        self.card.write(region::CONFIG, 4, &[6, 0]).unwrap();
    }

    pub(super) fn read_bytes(&mut self, offset: u32, length: usize) -> Vec<u8> {
        let mut data = vec![0; length];
        self.card.read(REGISTERS.index as usize, offset.into(), &mut data).unwrap();
        data
    }

    pub(super) fn write_bytes(&mut self, offset: u32, data: &[u8]) {
        self.card.write(REGISTERS.index as usize, offset.into(), data).unwrap();
    }

    pub(super) fn read_at(&mut self, offset: u32) -> u32 {
        u32::from_le_bytes(self.read_bytes(offset, 4).try_into().unwrap())
    }

    pub(super) fn read(&mut self, register: Register) -> u32 {
        self.read_at(register.offset)
    }

    pub(super) fn write(&mut self, register: Register, word: u32) {
        self.write_bytes(register.offset, &word.to_le_bytes());
    }

    /// Writes all frame registers but those of the view, then those and the start command in one message.
    pub(super) fn start(&mut self, frame: &FrameRegisters) {
        let held = vg500_regs::table::REGISTERS.iter().filter(|it| FrameRegisters::holds(it.offset));
        for register in held.filter(|register| register.offset < VIEW_START) {
            self.write(*register, frame.word(*register));
        }
        let view = (VIEW_START..FRAME_END).step_by(4);
        let burst: Vec<u8> = view.flat_map(|offset| frame.read(offset).to_le_bytes()).collect();
        self.write_bytes(VIEW_START, &burst);
    }

    /// Tag and result of the last frame on a base plane.
    pub(super) fn plane_state(&mut self, place: u32) -> (u32, u32) {
        let word = self.read_at(plane_state::REGISTER.at(place));
        (plane_state::TAG.get(word), plane_state::RESULT.get(word))
    }

    /// Why the last frame on a base plane failed.
    pub(super) fn plane_fault(&mut self, place: u32) -> Option<Fault> {
        Fault::from_word(self.read_at(plane_fault::REGISTER.at(place)))
    }

    /// Waits until the status word says that nothing waits or runs.
    pub(super) fn await_idle(&mut self) {
        self.await_that(|rig| status::BUSY.get(rig.read(status::REGISTER)) == 0);
    }

    /// Waits for something.
    pub(super) fn await_that(&mut self, mut happened: impl FnMut(&mut Self) -> bool) {
        let began = Instant::now();
        while !happened(self) {
            assert!(began.elapsed() < PATIENCE, "it has not happened");
            std::thread::sleep(Duration::from_micros(200));
        }
    }

    /// Fills the volume and the tables of [`frame`].
    pub(super) fn fill(&self) {
        let voxels = self.card.memories.voxel.view();
        let bytes: Vec<u8> =
            (0..BYTES as u32).map(|at| (at.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        voxels.write(BASE as usize, &bytes).unwrap();
        let tables = self.card.memories.table.view();
        for entry in 0..4096u32 {
            let color = [entry as u8, (entry >> 4) as u8, (entry >> 2) as u8, 0];
            tables.write(Table::Color.offset(0) + 4 * entry as usize, &color).unwrap();
            let alpha = (entry / 8) as u16;
            tables.write(Table::Opacity.offset(0) + 2 * entry as usize, &alpha.to_le_bytes()).unwrap();
        }
    }

    /// The trace so far.
    pub(super) fn trace(&self) -> String {
        std::fs::read_to_string(&self.trace).unwrap()
    }

    /// What the trace calls mistakes.
    pub(super) fn mistakes(&self) -> Vec<String> {
        self.trace().lines().filter_map(|line| line.strip_prefix("mistake: ")).map(Into::into).collect()
    }
}

/// Where the volume lies.
pub(super) const BASE: u32 = 4096;
/// Its size in voxels.
const SIZE: [u32; 3] = [20, 16, 12];
/// Bytes that it covers, padding included.
const BYTES: usize = 32 * 32 * 12;

/// A frame of the small volume into a base plane.
pub(super) fn frame(tag: u32, plane: u32) -> FrameRegisters {
    let mut registers = FrameRegisters::default();
    registers.set(volume_base::OFFSET, BASE);
    registers.set(volume_format::FORMAT, VoxelFormat::Uint8 as u32);
    registers.set(volume_size_xy::X, SIZE[0]);
    registers.set(volume_size_xy::Y, SIZE[1]);
    registers.set(volume_size_z::Z, SIZE[2]);
    registers.set(volume_pitch::ROW, 32);
    registers.set(volume_pitch::ROWS, 32);
    registers.set(base_plane_size::WIDTH, SIZE[0]);
    registers.set(base_plane_size::HEIGHT, SIZE[1]);
    registers.set(start::PLANE, plane);
    registers.set(start::TAG, tag);
    registers
}

/// The same into a plane of 64-bit accumulators, beginning with those that are there.
pub(super) fn continued(tag: u32, plane: u32) -> FrameRegisters {
    let mut registers = frame(tag, plane);
    registers.set(output::BLEND, BlendMode::Alpha as u32);
    registers.set(output::PLANE_FORMAT, PlaneFormat::Accumulator64 as u32);
    registers.set(accumulators::ENABLE, 1);
    registers.set(accumulators::SOURCE, plane);
    registers
}
