//! A tile: some rows of the base plane, marched through all slices.

use super::accumulators::Accumulators;
use super::cursor;
use super::features::Specialisation;
use super::lanes::interpolate::{along_z_and_y, differences_along_z_and_y, samples};
use super::lanes::shade::{SampleRow, Shader, keep_values};
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
    factors: Line,
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            line: Line::ZERO,
            differences: [Line::ZERO; RING],
            samples: [Line::ZERO; RING],
            factors: Line::ZERO,
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
    scratch.staging.begin(&prepared.volume, tile.staged_rows());
    let shader = Shader::new(simd, specialisation, prepared);
    let extremes_only =
        !features.gradient() && matches!(features.blend, BlendMode::Maximum | BlendMode::Minimum);
    for slice in &prepared.slices {
        let rays = tile.rays(slice);
        if rays.is_empty() || slice.x.rays.is_empty() {
            continue;
        }
        cancel.check()?;
        tile.stage(simd, slice, &mut scratch.staging);
        let voxels = slice.x.voxels(&slice.x.rays);
        // Rays with a sample have a voxel below it.
        let span = voxels.start as usize..voxels.end as usize;
        let Scratch { staging, accumulators, rows } = &mut *scratch;
        let window = tile.window(slice, staging);
        let [width, ..] = prepared.volume.size;
        let weights = [slice.weight, slice.y.weight];
        for ray in rays.start - tile.margin..rays.end + tile.margin {
            let voxel_y = ray + slice.y.first;
            let corners = [window.rows(1, voxel_y), window.rows(2, voxel_y)];
            let line = along_z_and_y(simd, corners, weights, width, &mut rows.line);
            // With gradients a row waits for the one behind it.
            let ready = ray - tile.margin;
            if features.gradient() {
                samples(simd, line, slice.x.weight, width, &mut rows.samples[place(ray)]);
                if rays.contains(&ray) {
                    let before = [window.rows(0, voxel_y), corners[0]];
                    let behind = [corners[1], window.rows(3, voxel_y)];
                    let differences = &mut rows.differences[place(ray)];
                    differences_along_z_and_y(simd, before, behind, weights, width, differences);
                }
                if ready < rays.start {
                    continue;
                }
            }
            let voxel_y = ready + slice.y.first;
            let ray_row = (ready - tile.rows.start.cast_signed()) as usize;
            if features.blend == BlendMode::Alpha {
                tile.cursor(slice, voxel_y, &span, ray_row, accumulators);
            }
            let seen = match &prepared.visible {
                Some(visible) => visible.row(slice, voxel_y, &span, &mut rows.factors),
                None => Seen::All,
            };
            if seen == Seen::None {
                continue;
            }
            let row = SampleRow {
                line,
                samples: each!([-1, 0, 1], |next| &rows.samples[place(ready + next)]),
                differences: &rows.differences[place(ready)],
                x_weight: slice.x.weight,
                factors: (seen == Seen::Factors).then_some(&rows.factors),
            };
            let first = slice.x.first;
            if extremes_only {
                keep_values(simd, features.blend, &row, &span, &mut accumulators.row(ray_row, first));
            } else {
                shader.composite(&row, &span, accumulators, ray_row, first);
            }
        }
    }
    Ok(())
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

    /// Blends the cursor's samples of a row in front of the volume's.
    fn cursor(
        &self,
        slice: &Slice,
        voxel_y: i32,
        span: &Range<usize>,
        ray_row: usize,
        accumulators: &mut Accumulators,
    ) {
        let frame = self.prepared.frame;
        let Some(cursor) = &frame.visibility.cursor else { return };
        cursor::row(frame, cursor, slice, voxel_y, span, |voxel, sample| {
            let column = (voxel as i32 - slice.x.first) as usize;
            let mut ray = accumulators.ray(BlendMode::Alpha, ray_row, column);
            ray.blend(BlendMode::Alpha, 0, sample);
            accumulators.set(ray_row, column, &ray);
        });
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
