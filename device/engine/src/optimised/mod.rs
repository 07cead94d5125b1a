//! The optimised renderer: what the reference defines, many samples at a time.
//!
//! 1. [`prepared`]: what the tiles of a frame share: [`features`], [`slices`], [`tables`].
//! 2. [`pool`]: threads take tiles, each some rows of the base plane.
//! 3. [`tile`]: marches a tile through the volume, slice by slice and row by row. What [`omissions`] allow to leave
//!    out, [`decisions`] leave out by [`cells`]: by the [`ranges`] of voxels, [`finished`] rays, and what is
//!    [`visible`].
//! 4. [`staging`]: voxel rows stream from [`volume`] into the working format, in cache.
//! 5. [`lanes`]: the stages of the pipeline on vectors, written once for every [`simd`] level.
//! 6. [`accumulators`], then [`store`]: rays, and the pixels that they become.
//!
//! Every word of the base plane equals that of [`crate::reference`]. Results depend neither on the level nor on
//! the number of threads: a ray belongs to one tile, and its samples are composited in order.

pub mod accumulators;
mod cells;
mod cursor;
mod decisions;
pub mod features;
mod finished;
mod lanes;
mod line;
mod omissions;
mod pool;
mod prepared;
mod ranges;
mod reciprocal;
pub mod simd;
mod slices;
mod staging;
mod store;
mod tables;
mod tile;
mod visible;
mod volume;

use crate::plan::Plan;
use crate::reference::first_rays;
use crate::render::{Cancel, LeftOut, Memories, Task};
use core::ops::Range;
use core::sync::atomic::{AtomicUsize, Ordering};
use crc32fast::Hasher;
use features::{General, Lit, Specialisation, Unlit};
use pool::Pool;
use prepared::Prepared;
use simd::{Level, Simd, Work};
use std::sync::Mutex;
use tile::Scratch;
use vg500_regs::Fault;
use vg500_regs::table::report_omitted;

/// The optimised renderer with its threads.
#[derive(Debug)]
pub struct Optimised {
    level: Level,
    pool: Pool,
}

impl Optimised {
    /// A renderer with `threads` threads, the one that calls it among them.
    #[must_use]
    pub fn new(level: Level, threads: usize) -> Self {
        Self { level, pool: Pool::new(threads) }
    }

    /// Its instructions.
    #[must_use]
    pub const fn level(&self) -> Level {
        self.level
    }

    /// Its threads.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.pool.threads()
    }

    /// Renders a frame into pixel memory.
    pub fn render(
        &self,
        task: &Task,
        plan: &Plan,
        memories: Memories<'_>,
        cancel: &Cancel,
    ) -> Result<Drawn, Fault> {
        let first_rays = match task.frame.output.accumulators {
            Some(_) => Some(first_rays(&task.frame, plan, memories.pixel)?),
            None => None,
        };
        let prepared = Prepared::new(task, plan, memories, first_rays);
        let tiles = prepared.tiles(self.threads());
        let next = AtomicUsize::new(0);
        let results: Vec<Mutex<Option<<Tile<'_, '_> as Work>::Output>>> =
            tiles.iter().map(|_| Mutex::default()).collect();
        self.pool.run(&|scratch| {
            while let place = next.fetch_add(1, Ordering::Relaxed)
                && let (Some(rows), Some(result)) = (tiles.get(place), results.get(place))
            {
                let tile = Tile { prepared: &prepared, rows: rows.clone(), scratch, cancel };
                let done = self.level.run(tile);
                *result.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(done);
            }
        });
        let mut checksum = Hasher::new();
        let mut left_out = LeftOut::default();
        for result in results {
            let done = result.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
            if let Some(part) = done {
                let (part, by_tile) = part?;
                checksum.combine(&part);
                left_out += by_tile;
            }
        }
        let specialised = specialised(&prepared);
        let omitted = omissions::of_plan(&task.frame, prepared.features, specialised, &prepared.slices)
            | omissions::by_the_data(&prepared.omissions, &left_out);
        Ok(Drawn { checksum: checksum.finalize(), omitted, left_out })
    }
}

/// What came of a frame.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// Checksum of its pixels.
    pub checksum: u32,
    /// What was left out: bits of the register `REPORT_OMITTED`.
    pub omitted: u32,
    /// How much that was.
    pub left_out: LeftOut,
}

/// A tile to render.
struct Tile<'a, 'b> {
    prepared: &'a Prepared<'b>,
    rows: Range<u32>,
    scratch: &'a mut Scratch,
    cancel: &'a Cancel,
}

impl Work for Tile<'_, '_> {
    type Output = Result<(Hasher, LeftOut), Fault>;

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Self::Output {
        store::begin(self.prepared, &self.rows, &mut self.scratch.accumulators);
        self.scratch.decisions.left_out = LeftOut::default();
        let prepared = self.prepared;
        match () {
            () if prepared.frame.output.cursor_only => {}
            () if !specialised(prepared) => self.march(simd, General)?,
            () if is(prepared, Unlit) => self.march(simd, Unlit)?,
            () if prepared.features.grey => self.march_lit::<S, true>(simd)?,
            () => self.march_lit::<S, false>(simd)?,
        }
        let checksum = store::finish(prepared, &self.rows, &self.scratch.accumulators)?;
        Ok((checksum, self.scratch.decisions.left_out))
    }
}

/// Whether a specialisation was made for the features of a frame.
fn is<Z: Specialisation>(prepared: &Prepared<'_>, _: Z) -> bool {
    Z::FEATURES == Some(prepared.features)
}

/// Whether one of the specialisations draws a frame.
fn specialised(prepared: &Prepared<'_>) -> bool {
    let one = is(prepared, Unlit) || lit::<true>(prepared) || lit::<false>(prepared);
    one && omissions::allowed(prepared.frame, report_omitted::DECISIONS)
}

/// Whether one of those with light does.
fn lit<const GREY: bool>(prepared: &Prepared<'_>) -> bool {
    is(prepared, Lit::<false, false, GREY>)
        || is(prepared, Lit::<false, true, GREY>)
        || is(prepared, Lit::<true, false, GREY>)
        || is(prepared, Lit::<true, true, GREY>)
}

impl Tile<'_, '_> {
    #[inline(always)]
    fn march_lit<S: Simd, const GREY: bool>(&mut self, simd: S) -> Result<(), Fault> {
        let features = self.prepared.features;
        match (features.specular, features.magnitude) {
            (false, false) => self.march(simd, Lit::<false, false, GREY>),
            (false, true) => self.march(simd, Lit::<false, true, GREY>),
            (true, false) => self.march(simd, Lit::<true, false, GREY>),
            (true, true) => self.march(simd, Lit::<true, true, GREY>),
        }
    }

    #[inline(always)]
    fn march<S: Simd, Z: Specialisation>(&mut self, simd: S, specialisation: Z) -> Result<(), Fault> {
        simd.run(March { tile: self, specialisation })
    }
}

/// The way of a tile through the volume, as work of its own, so that each specialisation becomes a function of its
/// own. In one function of all of them a change to one made others faster or slower by a tenth.
struct March<'t, 'a, 'b, Z> {
    tile: &'t mut Tile<'a, 'b>,
    specialisation: Z,
}

impl<Z: Specialisation> Work for March<'_, '_, '_, Z> {
    type Output = Result<(), Fault>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let Tile { prepared, rows, scratch, cancel } = self.tile;
        tile::march(simd, self.specialisation, prepared, rows.clone(), scratch, cancel)
    }
}
