//! A tile: some rows of the base plane, marched through all slices.

use super::accumulators::{Accumulators, Layout};
use super::cursor;
use super::decisions::Decisions;
use super::features::{Features, Specialisation};
use super::finished::Finished;
use super::lanes::interpolate::{Weights, along_z_and_y, differences_along_z_and_y, samples};
use super::lanes::shade::{SampleRow, Shader};
use super::line::Line;
use super::prepared::Prepared;
use super::simd::{Simd, each};
use super::slices::Slice;
use super::staging::{Staging, Window};
use super::visible::Seen;
use crate::render::Cancel;
use crate::stage::classify::Classified;
use crate::stage::composite::Ray;
use core::ops::Range;
use vg500_regs::{BlendMode, Fault};

/// Sample rows that gradients look at: the one before, this one, the one behind; a power of two.
const RING: usize = 4;

/// Place of a row of rays, from -1 on, in the rings.
#[inline(always)]
const fn place(ray: i32) -> usize {
    (ray + RING as i32) as usize % RING
}

/// Working memory of a thread, kept between frames.
#[derive(Debug, Default)]
pub struct Scratch {
    staging: Staging,
    /// The rays of the tile.
    pub accumulators: Accumulators,
    /// What is worth computing.
    pub decisions: Decisions,
    finished: Finished,
    rows: Box<Rows>,
}

/// Rows on their way through interpolation.
#[derive(Debug)]
struct Rows {
    /// Interpolated along z and y.
    line: Line,
    /// Differences along z, by row modulo the ring.
    differences: [Line; RING],
    samples: [Line; RING],
    /// What can be seen of each row of the tile.
    factors: Vec<Factors>,
}

/// What can be seen of a row.
#[derive(Clone, Debug)]
struct Factors {
    seen: Seen,
    line: Line,
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            line: Line::ZERO,
            differences: [Line::ZERO; RING],
            samples: [Line::ZERO; RING],
            factors: Vec::new(),
        }
    }
}

/// Marches a tile through the volume; its rays are in the accumulators afterwards.
#[inline(always)]
pub fn march<S: Simd, Z: Specialisation>(
    simd: S,
    specialisation: Z,
    prepared: &Prepared<'_>,
    rows: Range<u32>,
    scratch: &mut Scratch,
    cancel: &Cancel,
) -> Result<(), Fault> {
    let features = specialisation.features(prepared.features);
    let tile = Tile { prepared, rows, margin: i32::from(features.gradient()) };
    let Scratch { staging, accumulators, decisions, finished, rows } = scratch;
    staging.begin(&prepared.volume, tile.staged_rows(), 2 + 2 * tile.margin as usize);
    tile.begin_decisions(features, decisions, finished);
    let shader = Shader::new(simd, specialisation, prepared);
    for slice in &prepared.slices {
        let rays = tile.rays(slice);
        if rays.is_empty() || slice.x.rays.is_empty() {
            continue;
        }
        cancel.check()?;
        let voxels = slice.x.voxels(&slice.x.rays);
        // Rays with a sample have a voxel below it.
        let span = voxels.start as usize..voxels.end as usize;
        if features.blend == BlendMode::Alpha {
            tile.cursor(slice, &rays, &span, accumulators);
        }
        decisions.begin(tile.places(&rays), &span);
        tile.hide(slice, &rays, &span, decisions, rows);
        if prepared.omissions.finished.is_some() {
            finished.look(simd, accumulators);
            decisions.finish(finished, slice.x.first);
        }
        if decisions.nothing() {
            continue;
        }
        staging.measure(decisions.wants_ranges(&prepared.omissions));
        tile.stage(simd, slice, staging);
        tile.empty(simd, slice, staging, decisions, accumulators);
        if !decisions.nothing() {
            let sampled = Sampled { tile: &tile, slice, rays, span, window: tile.window(slice, staging) };
            sampled.composite(simd, features, &shader, (decisions, rows, accumulators));
        }
    }
    decisions.left_out.rays_finished =
        if prepared.omissions.finished.is_some() { finished.count() } else { 0 };
    Ok(())
}

/// A slice of samples of a tile whose voxels are there.
struct Sampled<'a> {
    tile: &'a Tile<'a>,
    slice: &'a Slice,
    /// The rows that have samples.
    rays: Range<i32>,
    /// The voxels below samples.
    span: Range<usize>,
    window: Window<'a>,
}

impl Sampled<'_> {
    /// Composites what of the slice is worth it, row by row.
    #[inline(always)]
    fn composite<S: Simd, Z: Specialisation>(
        &self,
        simd: S,
        features: Features,
        shader: &Shader<'_, S, Z>,
        (decisions, rows, accumulators): (&mut Decisions, &mut Rows, &mut Accumulators),
    ) {
        let Self { tile, slice, .. } = self;
        let prepared = tile.prepared;
        let [width, ..] = prepared.volume.size;
        let [x_leave_out, y_leave_out, z_leave_out] = prepared.omissions.interpolation;
        let weights =
            Weights { z_and_y: [slice.weight, slice.y.weight], leave_out: [z_leave_out, y_leave_out] };
        let along_x = (slice.x.weight, x_leave_out);
        for ray in self.rays.start - tile.margin..self.rays.end + tile.margin {
            let voxel_y = ray + slice.y.first;
            // Asked for all at once the rows of a slice would wait for each other.
            prepared.volume.prefetch_row(simd, voxel_y + 1, slice.below + 2 + tile.margin);
            let corners = [self.window.rows(1, voxel_y), self.window.rows(2, voxel_y)];
            let own = decisions.row(tile.place(ray));
            let mut line = corners[0][0];
            // With gradients a row waits for the one behind it.
            let ready = ray - tile.margin;
            let cells = decisions.row(tile.place(ready));
            if features.gradient() {
                let before = decisions.row(tile.place(ray - 1));
                let behind = decisions.row(tile.place(ray + 1));
                let wanted = own.or(before).or(behind).with_neighbours();
                if !wanted.is_empty() {
                    line = along_z_and_y(simd, corners, weights, wanted.with_next(), width, &mut rows.line);
                    samples(simd, line, along_x, wanted, width, &mut rows.samples[place(ray)]);
                }
                if !own.is_empty() {
                    let before = [self.window.rows(0, voxel_y), corners[0]];
                    let behind = [corners[1], self.window.rows(3, voxel_y)];
                    let differences = &mut rows.differences[place(ray)];
                    differences_along_z_and_y(simd, before, behind, weights, own.with_next(), differences);
                }
            } else if !own.is_empty() {
                line = along_z_and_y(simd, corners, weights, own.with_next(), width, &mut rows.line);
            }
            if cells.is_empty() {
                continue;
            }
            let ray_row = tile.place(ready) as usize;
            let factors = prepared.visible.is_some().then(|| &rows.factors[ray_row]);
            let row = SampleRow {
                line,
                samples: each!([-1, 0, 1], |next| &rows.samples[place(ready + next)]),
                differences: &rows.differences[place(ready)],
                x_weight: along_x,
                factors: factors.filter(|row| row.seen == Seen::Factors).map(|row| &row.line),
                cells,
                span: &self.span,
            };
            let transparent = shader.composite(&row, accumulators, ray_row, slice.x.first);
            decisions.left_out.transparent += transparent;
        }
    }
}

/// A tile of a frame.
struct Tile<'a> {
    prepared: &'a Prepared<'a>,
    /// Rows of rays.
    rows: Range<u32>,
    /// Rows and slices that gradients need on each side.
    margin: i32,
}

impl Tile<'_> {
    /// Rows of rays that have samples on a slice.
    fn rays(&self, slice: &Slice) -> Range<i32> {
        let start = slice.y.rays.start.max(self.rows.start);
        let end = slice.y.rays.end.min(self.rows.end);
        start.cast_signed()..end.cast_signed()
    }

    /// Rows of a voxel slice that are in use at a time at most.
    fn staged_rows(&self) -> usize {
        let [_, height, _] = self.prepared.volume.size;
        let slices = self.prepared.volume.slices_at_once() + 4;
        let shift = slices * self.prepared.frame.rays.supersampling as usize;
        (self.rows.len() + 4 + shift).min(height)
    }

    /// Brings the voxel slices around a sample slice in.
    #[inline(always)]
    fn stage<S: Simd>(&self, simd: S, slice: &Slice, staging: &mut Staging) {
        let volume = &self.prepared.volume;
        for z in slice.below - self.margin..=slice.below + 1 + self.margin {
            staging.require(simd, volume, self.inside(z), |z| self.rows_of(z));
        }
    }

    /// A slice of the volume; beyond its ends the outermost.
    #[inline(always)]
    fn inside(&self, z: i32) -> usize {
        let [.., depth] = self.prepared.volume.size;
        (z.max(0) as usize).min(depth - 1)
    }

    /// The rows of a voxel slice that the tile needs: from those of the first sample slice that reads it to those
    /// of the last. Rays run towards higher rows or straight.
    fn rows_of(&self, z: usize) -> Range<usize> {
        let [_, height, depth] = self.prepared.volume.size;
        let factor = self.prepared.frame.rays.supersampling as usize;
        let margin = self.margin as usize;
        let last = self.prepared.slices.len() - 1;
        let first_user = if z <= 1 + margin { 0 } else { (z - 1 - margin) * factor };
        let last_user =
            if z + margin + 1 >= depth { last } else { ((z + margin) * factor + factor - 1).min(last) };
        let users = &self.prepared.slices[first_user.min(last)..=last_user];
        let rows = users.iter().map(|slice| (self.rays(slice), slice)).filter(|(rays, _)| !rays.is_empty());
        let rows = rows.map(|(rays, slice)| {
            let start = rays.start + slice.y.first - self.margin;
            let end = rays.end + slice.y.first + self.margin + 1;
            start..end
        });
        let Some(rows) = rows.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end)) else { return 0..0 };
        rows.start.max(0) as usize..(rows.end.max(0) as usize).min(height)
    }

    /// The voxel slices around a sample slice.
    #[inline(always)]
    fn window<'s>(&self, slice: &Slice, staging: &'s Staging) -> Window<'s> {
        let margin = self.margin;
        // Without gradients those in the middle are all.
        staging.window(each!([-margin, 0, 1, 1 + margin], |z| self.inside(slice.below + z)))
    }

    /// Place of a row of rays in the tile; outside of 0..rows for its neighbours.
    #[inline(always)]
    const fn place(&self, ray: i32) -> i32 {
        ray - self.rows.start.cast_signed()
    }

    /// Places of rows of rays of the tile.
    fn places(&self, rays: &Range<i32>) -> Range<usize> {
        self.place(rays.start) as usize..self.place(rays.end) as usize
    }

    /// Nothing is decided yet.
    fn begin_decisions(&self, features: Features, decisions: &mut Decisions, finished: &mut Finished) {
        decisions.begin_tile(self.rows.len());
        if let Some(opacity) = self.prepared.omissions.finished {
            // To look at rays that lie next to each other channel by channel takes as long as some unlit samples.
            let interval = if features.layout() == Layout::Rays { 8 } else { 2 };
            finished.begin(self.rows.len(), self.prepared.frame.rays.size[0] as usize, opacity, interval);
        }
    }

    /// Decides what of each row can be seen.
    fn hide(
        &self,
        slice: &Slice,
        rays: &Range<i32>,
        span: &Range<usize>,
        decisions: &mut Decisions,
        rows: &mut Rows,
    ) {
        let Some(visible) = &self.prepared.visible else { return };
        rows.factors.resize(self.rows.len(), Factors { seen: Seen::All, line: Line::ZERO });
        for ray in rays.clone() {
            let row = self.place(ray) as usize;
            let Factors { seen, line } = &mut rows.factors[row];
            *seen = visible.row(slice, ray + slice.y.first, span, line);
            if self.prepared.omissions.hidden {
                decisions.hide(row, seen, line);
            } else if *seen == Seen::None {
                line.words_mut().fill(0);
                *seen = Seen::Factors;
            }
        }
    }

    /// Leaves out what its voxels show to be in vain.
    #[inline(always)]
    fn empty<S: Simd>(
        &self,
        simd: S,
        slice: &Slice,
        staging: &Staging,
        decisions: &mut Decisions,
        accumulators: &mut Accumulators,
    ) {
        let omissions = &self.prepared.omissions;
        if omissions.empty.is_none() && !omissions.beaten {
            return;
        }
        let below = self.inside(slice.below);
        let above = if slice.weight == 0 { below } else { self.inside(slice.below + 1) };
        let first_row = self.rows.start.cast_signed() + slice.y.first;
        let blend = self.prepared.frame.output.blend;
        decisions.empty(
            simd,
            omissions,
            [below, above],
            staging,
            (slice.x.first, first_row),
            (blend, accumulators),
        );
    }

    /// Blends the cursor's samples on a slice in front of the volume's.
    fn cursor(&self, slice: &Slice, rays: &Range<i32>, span: &Range<usize>, accumulators: &mut Accumulators) {
        let frame = self.prepared.frame;
        let Some(cursor) = &frame.visibility.cursor else { return };
        for ray in rays.clone() {
            let ray_row = self.place(ray) as usize;
            cursor::row(frame, cursor, slice, ray + slice.y.first, span, |voxel, sample| {
                let column = (voxel as i32 - slice.x.first) as usize;
                let mut ray = accumulators.ray(BlendMode::Alpha, ray_row, column);
                ray.blend(BlendMode::Alpha, 0, sample);
                accumulators.set(ray_row, column, &ray);
            });
        }
    }
}

/// Blends the cursor over the finished rays of a row of the tile, back to front.
pub fn cover(prepared: &Prepared<'_>, row: u32, rays: &mut [Ray]) {
    let frame = prepared.frame;
    let Some(cursor) = &frame.visibility.cursor else { return };
    for slice in prepared.slices.iter().rev().filter(|slice| slice.y.rays.contains(&row)) {
        let voxels = slice.x.voxels(&slice.x.rays);
        let span = voxels.start.max(0) as usize..voxels.end.max(0) as usize;
        if span.is_empty() {
            continue;
        }
        let voxel_y = row.cast_signed() + slice.y.first;
        cursor::row(frame, cursor, slice, voxel_y, &span, |voxel, sample: Classified| {
            rays[(voxel as i32 - slice.x.first) as usize].cover(frame.output.blend, sample);
        });
    }
}
