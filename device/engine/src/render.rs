//! What a renderer is given, what it does, and what it reports.

use crate::cycles::cycles;
use crate::frame::FrameDescription;
use crate::optimised::simd::Level;
use crate::optimised::{Drawn, Optimised};
use crate::plan::Plan;
use crate::reference;
use crate::tables::Tables;
use core::sync::atomic::{AtomicBool, Ordering};
use vg500_regs::table::table_select;
use vg500_regs::{Fault, FaultCode, FrameRegisters, SharedView};

/// The mapped memories that a frame reads and writes.
#[derive(Clone, Copy, Debug)]
pub struct Memories<'a> {
    /// Voxel memory.
    pub voxel: SharedView<'a>,
    /// Pixel memory.
    pub pixel: SharedView<'a>,
    /// Section memory, which frames in sections use.
    pub section: SharedView<'a>,
}

/// A frame to render: what the start command took.
#[derive(Clone, Debug)]
pub struct Task {
    /// The frame.
    pub frame: FrameDescription,
    /// Its tables.
    pub tables: Tables,
}

/// Lets another thread stop a frame.
#[derive(Debug, Default)]
pub struct Cancel(AtomicBool);

impl Cancel {
    /// Asks the frame to stop; it does so within a sample slice.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// A fault once the frame is to stop.
    pub fn check(&self) -> Result<(), Fault> {
        if self.0.load(Ordering::Relaxed) { Err(Fault::CANCELLED) } else { Ok(()) }
    }
}

/// What a finished frame was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Samples that exist on the frame's rays.
    pub samples: u64,
    /// Samples that were processed.
    pub processed: u64,
    /// Clock cycles that the real chip would have taken.
    pub cycles: u64,
    /// What was left out: bits of the register `REPORT_OMITTED`.
    pub omitted: u32,
    /// CRC-32 (IEEE) of the stored pixels, row by row.
    pub checksum: u32,
    /// How much was left out.
    pub left_out: LeftOut,
}

/// How much of a frame was left out because of its data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Samples left out because no value between their block's voxels can be seen or be a new extreme.
    pub empty: u64,
    /// Samples left out because no ray of their block can change.
    pub finished: u64,
    /// Samples left out because cropping, cut plane, sub-volume or block range hide their block.
    pub hidden: u64,
    /// Samples classified but not shaded, because all of their block turned out transparent.
    pub transparent: u64,
    /// Blocks of samples.
    pub blocks: u64,
    /// Blocks of samples that were left out.
    pub blocks_left_out: u64,
    /// Rays that were found unable to change before their end.
    pub rays_finished: u64,
}

impl LeftOut {
    /// Samples that were not processed.
    #[must_use]
    pub const fn samples(&self) -> u64 {
        self.empty + self.finished + self.hidden
    }
}

impl core::ops::AddAssign for LeftOut {
    fn add_assign(&mut self, other: Self) {
        self.empty += other.empty;
        self.finished += other.finished;
        self.hidden += other.hidden;
        self.transparent += other.transparent;
        self.blocks += other.blocks;
        self.blocks_left_out += other.blocks_left_out;
        self.rays_finished += other.rays_finished;
    }
}

/// A renderer of the card: which one, and how it is set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Renderer {
    /// The renderer that defines the card.
    Reference,
    /// The one that draws the same, sooner.
    Optimised {
        /// Its instructions.
        level: Level,
        /// Its threads, at least 1.
        threads: usize,
    },
}

impl Default for Renderer {
    /// The optimised one, with the best instructions of the processor and all of its cores.
    fn default() -> Self {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        Self::Optimised { level: Level::detect(), threads }
    }
}

impl Renderer {
    /// The code of the register `RENDERER`.
    #[must_use]
    pub const fn code(self) -> u32 {
        match self {
            Self::Reference => 1,
            Self::Optimised { .. } => 2,
        }
    }

    /// The code of the register `SIMD_LEVEL`.
    #[must_use]
    pub const fn simd_code(self) -> u32 {
        match self {
            Self::Reference => 0,
            Self::Optimised { level, .. } => level.code(),
        }
    }

    /// How many threads render.
    #[must_use]
    pub fn threads(self) -> usize {
        match self {
            Self::Reference => 1,
            Self::Optimised { threads, .. } => threads.max(1),
        }
    }

    /// Takes a frame from the registers (the start command included) and table memory.
    pub fn take(
        self,
        registers: &FrameRegisters,
        tables: &SharedView<'_>,
        voxel_memory: usize,
    ) -> Result<Task, Fault> {
        let frame = FrameDescription::decode(registers, voxel_memory)?;
        let tables = Tables::copy_from(tables, frame.copies)
            .map_err(|_| Fault::new(FaultCode::Range, table_select::COLOR))?;
        Ok(Task { frame, tables })
    }

    /// Starts it: its threads live until the engine is dropped.
    #[must_use]
    pub fn start(self) -> Engine {
        match self {
            Self::Reference => Engine::Reference,
            Self::Optimised { level, threads } => {
                Engine::Optimised(Box::new(Optimised::new(level, threads.max(1))))
            }
        }
    }

    /// Starts it for a single frame.
    pub fn render(self, task: &Task, memories: Memories<'_>, cancel: &Cancel) -> Result<Report, Fault> {
        self.start().render(task, memories, cancel)
    }
}

/// A renderer at work.
#[derive(Debug)]
pub enum Engine {
    /// See [`Renderer::Reference`].
    Reference,
    /// See [`Renderer::Optimised`].
    Optimised(Box<Optimised>),
}

impl Engine {
    /// Renders a frame into pixel memory.
    pub fn render(&self, task: &Task, memories: Memories<'_>, cancel: &Cancel) -> Result<Report, Fault> {
        let plan = Plan::new(&task.frame);
        let drawn = match self {
            // Sections are a way to work, not a picture: the reference knows it.
            Self::Optimised(optimised) if !task.frame.output.sections => {
                optimised.render(task, &plan, memories, cancel)?
            }
            _ => Drawn {
                checksum: reference::render(task, &plan, memories, cancel)?,
                omitted: task.frame.needs().omitted(),
                left_out: LeftOut::default(),
            },
        };
        let samples = plan.samples();
        Ok(Report {
            samples,
            processed: samples - drawn.left_out.samples(),
            cycles: cycles(&task.frame),
            omitted: drawn.omitted,
            checksum: drawn.checksum,
            left_out: drawn.left_out,
        })
    }
}
