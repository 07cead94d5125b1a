//! A board in use: volumes in its memory, frames in flight, base planes fetched.

use crate::context::Context;
use crate::geometry::{self, Accumulation, GeometryError, Pass, ShearWarp};
use crate::passes::Collector;
use crate::volume::{Volume, VoxelIdentity, Voxels};
use std::any::Any;
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use vg500_regs::table::{base_plane_size, keep, start_x, start_y};
use vg500_regs::{BlendMode, FrameRegisters, PlaneFormat};
use volumepro_driver::{self as driver, BoardVolume, Card, Rectangle, TableContent, Ticket};

/// How long a frame may take. The largest one that the reference renderer knows (256^3 voxels, supersampled 8
/// times, illuminated) takes well under a minute.
const FRAME_TIMEOUT: Duration = Duration::from_secs(600);

/// Why a frame could not be rendered.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The view or the volume is not one the card can render.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The driver or the card.
    #[error(transparent)]
    Driver(#[from] driver::Error),
}

/// A board.
pub struct Board {
    card: Card,
    /// Volumes in board memory, the most recently used last.
    resident: Vec<(VoxelIdentity, BoardVolume)>,
    /// What the card is not to leave out: bits of the register `KEEP`.
    keep: u32,
    /// Whether reports tell how much was left out.
    detailed: bool,
    /// What serves the card, if it lives in this process; dropped last.
    server: Option<Box<dyn Any + Send>>,
}

/// A frame in flight: what [`Board::start`] began and [`Board::fetch`] ends.
pub struct Rendering {
    view: ShearWarp,
    plane: geometry::BasePlane,
    collector: Collector,
    registers: FrameRegisters,
    tables: Vec<TableContent>,
    format: PlaneFormat,
    waiting: VecDeque<Pass>,
    running: VecDeque<(Pass, driver::BasePlane, Ticket)>,
    report: FrameReport,
    started: Instant,
}

/// What a frame was and what it took; all passes together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameReport {
    /// Samples that exist on the frame's rays.
    pub samples: u64,
    /// Samples that were processed.
    pub samples_processed: u64,
    /// Time in the card's engine.
    pub engine_time: Duration,
    /// From the first submission until the pixels were readable.
    pub frame_time: Duration,
    /// Clock cycles that the real chip would have taken.
    pub cycles: u64,
    /// What every pass left out: bits of the register `REPORT_OMITTED`.
    pub omitted: u32,
    /// Samples left out because no value between their block's voxels can be seen or be a new extreme.
    pub empty: u64,
    /// Samples left out because no ray of their block can change.
    pub finished: u64,
    /// More about what was left out, if [`Board::detail`] asked for it; else zeros.
    pub left_out: driver::LeftOut,
    /// Passes of the card.
    pub passes: u32,
}

/// A fetched base plane.
#[derive(Clone, Debug)]
pub struct BasePlane {
    /// Rows of bytes R, G, B, A; colours are premultiplied in alpha blending.
    pub pixels: Vec<u8>,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Where the pixels lie.
    pub plane: geometry::BasePlane,
    /// How the card saw the volume.
    pub view: ShearWarp,
    /// What the frame was.
    pub report: FrameReport,
}

impl Board {
    /// A board with an open card.
    #[must_use]
    pub const fn new(card: Card) -> Self {
        Self { card, resident: Vec::new(), keep: 0, detailed: false, server: None }
    }

    /// The board, with what serves its card; that is dropped after the card.
    #[must_use]
    pub fn served_by(mut self, server: Box<dyn Any + Send>) -> Self {
        self.server = Some(server);
        self
    }

    /// Tells the card what it is not to leave out from now on: bits of the register `KEEP`. No pixel depends on it.
    pub const fn keep(&mut self, omissions: u32) {
        self.keep = omissions;
    }

    /// Whether [`FrameReport::left_out`] is to be filled from now on; without the card's mapped memory that takes
    /// some register reads for each frame.
    pub const fn detail(&mut self, detailed: bool) {
        self.detailed = detailed;
    }

    /// The card.
    #[must_use]
    pub const fn card(&self) -> &Card {
        &self.card
    }

    /// Brings a volume into board memory unless it is there; volumes not used for the longest time make room.
    ///
    /// # Errors
    /// The volume does not fit into an empty board, or the card is dead.
    pub fn load(&mut self, volume: &Volume) -> Result<(), RenderError> {
        if let Some(place) = self.resident.iter().position(|(identity, _)| *identity == volume.identity()) {
            let entry = self.resident.remove(place);
            self.resident.push(entry);
            return Ok(());
        }
        let board_volume = self.allocate(volume)?;
        let whole = board_volume.whole();
        match volume.voxels() {
            Voxels::Uint8(voxels) => self.card.upload(&board_volume, &whole, voxels)?,
            Voxels::Uint12Lower(voxels) | Voxels::Uint12Upper(voxels) => {
                self.card.upload(&board_volume, &whole, voxels)?;
            }
        }
        self.resident.push((volume.identity(), board_volume));
        Ok(())
    }

    fn allocate(&mut self, volume: &Volume) -> Result<BoardVolume, RenderError> {
        loop {
            match self.card.allocate_volume(volume.size(), volume.voxels().format()) {
                Err(driver::Error::OutOfBoardMemory { .. }) if !self.resident.is_empty() => {
                    self.resident.remove(0);
                }
                result => return Ok(result?),
            }
        }
    }

    /// Starts to render a volume. Everything is captured: context and volume may change at once.
    ///
    /// # Errors
    /// A view or volume that the card cannot render, or the driver's.
    pub fn start(&mut self, context: &Context, volume: &Volume) -> Result<Rendering, RenderError> {
        let view = context.shear_warp(volume)?;
        self.load(volume)?;
        let started = Instant::now();
        let plane = view.base_plane_with_margin();
        let passes = view.passes(&plane);
        let blended = context.supersampling.accumulation() == Accumulation::Blend && passes.len() > 1;
        let format = match context.blend {
            _ if !blended => PlaneFormat::Rgba8,
            BlendMode::Sum => PlaneFormat::Sum128,
            _ => PlaneFormat::Accumulator64,
        };
        let mut registers = context.program(volume, &view, format);
        registers.set(keep::OMISSIONS, self.keep);
        if let Some((_, board_volume)) = self.resident.last() {
            board_volume.bind(&board_volume.whole(), &mut registers)?;
        }
        let mut rendering = Rendering {
            collector: Collector::new(plane.size(), format, passes.len()),
            tables: context.tables(volume, &view)?,
            report: FrameReport { omitted: u32::MAX, passes: passes.len() as u32, ..FrameReport::default() },
            waiting: passes.into(),
            running: VecDeque::new(),
            view,
            plane,
            registers,
            format,
            started,
        };
        self.submit(&mut rendering)?;
        Ok(rendering)
    }

    /// Submits passes as long as there are base planes for them.
    fn submit(&self, rendering: &mut Rendering) -> Result<(), RenderError> {
        while let Some(pass) = rendering.waiting.front().copied() {
            let plane = match self.card.allocate_plane(rendering.format) {
                Err(driver::Error::NoPlane { .. }) if !rendering.running.is_empty() => return Ok(()),
                plane => plane?,
            };
            for table in &rendering.tables {
                self.card.load_table(table)?;
            }
            let registers = &mut rendering.registers;
            registers.set_signed(start_x::POSITION, pass.start[0]);
            registers.set_signed(start_y::POSITION, pass.start[1]);
            registers.set(base_plane_size::WIDTH, pass.size[0]);
            registers.set(base_plane_size::HEIGHT, pass.size[1]);
            let ticket = self.card.submit(&plane, registers)?;
            rendering.waiting.pop_front();
            rendering.running.push_back((pass, plane, ticket));
        }
        Ok(())
    }

    /// Waits for a frame and fetches its base plane.
    ///
    /// # Errors
    /// What the card refused, or the driver's.
    pub fn fetch(&mut self, mut rendering: Rendering) -> Result<BasePlane, RenderError> {
        while let Some((pass, plane, ticket)) = rendering.running.pop_front() {
            self.card.wait(ticket, FRAME_TIMEOUT)?;
            let pixels = self.card.fetch_pixels(&plane, Rectangle::of_size(pass.size[0], pass.size[1]))?;
            rendering.collector.add(&pass, pixels);
            rendering.report.add(&self.card.report(ticket)?);
            if self.detailed {
                rendering.report.left_out += self.card.left_out(ticket)?;
            }
            drop(plane);
            self.submit(&mut rendering)?;
        }
        rendering.report.frame_time = rendering.started.elapsed();
        Ok(BasePlane {
            pixels: rendering.collector.finish(),
            size: rendering.plane.size(),
            plane: rendering.plane,
            view: rendering.view,
            report: rendering.report,
        })
    }

    /// Renders a volume and fetches its base plane.
    ///
    /// # Errors
    /// As [`start`](Self::start) and [`fetch`](Self::fetch).
    pub fn render(&mut self, context: &Context, volume: &Volume) -> Result<BasePlane, RenderError> {
        let rendering = self.start(context, volume)?;
        self.fetch(rendering)
    }
}

impl FrameReport {
    fn add(&mut self, pass: &driver::Report) {
        self.samples += pass.samples;
        self.samples_processed += pass.samples_processed;
        self.engine_time += pass.engine_time;
        self.cycles += pass.cycles;
        self.omitted &= pass.omitted;
        self.empty += u64::from(pass.empty);
        self.finished += u64::from(pass.finished);
    }
}
