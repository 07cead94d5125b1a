//! From accumulators to the base plane.

use super::accumulators::{Accumulators, no_extreme};
use super::prepared::Prepared;
use super::tables::PixelsOfExtremes;
use super::tile::cover;
use crate::fixed::narrow;
use crate::memory::pixel;
use crate::stage::composite::Ray;
use core::ops::Range;
use crc32fast::Hasher;
use vg500_regs::memory::plane_offset;
use vg500_regs::{BlendMode, Fault, FaultCode, PlaneFormat, table};

/// Loads what the rays of a tile begin with.
pub fn begin(prepared: &Prepared<'_>, rows: &Range<u32>, accumulators: &mut Accumulators) {
    let columns = prepared.frame.rays.size[0] as usize;
    accumulators.clear(prepared.features, rows.len(), columns);
    for (place, row) in rows.clone().enumerate() {
        for (column, ray) in first_rays(prepared, row).iter().flatten().enumerate() {
            accumulators.set(place, column, ray);
        }
    }
}

/// Writes the rays of a tile to the base plane; returns the checksum of what was written.
pub fn finish(
    prepared: &Prepared<'_>,
    rows: &Range<u32>,
    accumulators: &Accumulators,
) -> Result<Hasher, Fault> {
    let output = &prepared.frame.output;
    let mut checksum = Hasher::new();
    let mut bytes = Vec::new();
    for (place, row) in rows.clone().enumerate() {
        bytes.clear();
        if output.format == PlaneFormat::Rgba8 && output.blend == BlendMode::Alpha {
            narrowed(prepared, accumulators, place, &mut bytes);
        } else if let Some(pixels) = &prepared.pixels_of_extremes {
            looked_up(prepared, accumulators, place, (pixels, &mut bytes));
        } else {
            let mut rays = rays(prepared, accumulators, place, row);
            if output.blend != BlendMode::Alpha {
                cover(prepared, row, &mut rays);
            }
            if prepared.mirrored_columns() {
                rays.reverse();
            }
            rays.iter().for_each(|ray| pixel::store(ray, output.blend, output.format, &mut bytes));
        }
        checksum.update(&bytes);
        let offset = plane_offset(output.format, output.plane, 0, row);
        prepared
            .pixels
            .write(offset, &bytes)
            .map_err(|_| Fault::new(FaultCode::Range, table::start::PLANE))?;
    }
    Ok(checksum)
}

/// What a row of rays begins with, in the order of the accumulators.
fn first_rays(prepared: &Prepared<'_>, row: u32) -> Option<Vec<Ray>> {
    let width = prepared.frame.rays.size[0] as usize;
    let start = row as usize * width;
    let mut rays = prepared.first_rays.as_ref()?.get(start..start + width)?.to_vec();
    if prepared.mirrored_columns() {
        rays.reverse();
    }
    Some(rays)
}

/// A row of front-to-back rays as bytes R, G, B, A.
#[inline(always)]
fn narrowed(prepared: &Prepared<'_>, accumulators: &Accumulators, place: usize, bytes: &mut Vec<u8>) {
    let width = prepared.frame.rays.size[0] as usize;
    bytes.resize(4 * width, 0);
    let pixels = bytes.as_chunks_mut::<4>().0;
    accumulators.colors(place, width, |column, color| {
        if let Some(pixel) = pixels.get_mut(column) {
            *pixel = color.map(narrow);
        }
    });
    if prepared.mirrored_columns() {
        pixels.reverse();
    }
}

/// A row of rays of which only extremes are known as bytes R, G, B, A.
#[inline(always)]
fn looked_up(
    prepared: &Prepared<'_>,
    accumulators: &Accumulators,
    place: usize,
    (table, bytes): (&PixelsOfExtremes, &mut Vec<u8>),
) {
    bytes.resize(4 * prepared.frame.rays.size[0] as usize, 0);
    let pixels = bytes.as_chunks_mut::<4>().0;
    for (pixel, extreme) in pixels.iter_mut().zip(accumulators.extremes(place)) {
        *pixel = table.pixel(*extreme);
    }
    if prepared.mirrored_columns() {
        pixels.reverse();
    }
}

/// The rays of a row as they are at the end of the volume.
fn rays(prepared: &Prepared<'_>, accumulators: &Accumulators, place: usize, row: u32) -> Vec<Ray> {
    let blend = prepared.frame.output.blend;
    let width = prepared.frame.rays.size[0] as usize;
    let first = first_rays(prepared, row).unwrap_or_else(|| vec![Ray::default(); width]);
    if prepared.frame.output.cursor_only {
        return first;
    }
    let extremes = accumulators_of_extremes(blend);
    let first = first.into_iter().enumerate();
    let rays = first.map(|(column, first)| {
        if !extremes {
            let ray = accumulators.ray(blend, place, column);
            return Ray { extreme: first.extreme, valid: first.valid, ..ray };
        }
        let extreme = accumulators.extremes(place)[column];
        let unchanged = if first.valid { first.extreme } else { no_extreme(blend).cast_unsigned() };
        match extreme == unchanged {
            true => first,
            false if !prepared.features.extremes_only() => accumulators.ray(blend, place, column),
            false => prepared.classification.ray(extreme),
        }
    });
    rays.collect()
}

const fn accumulators_of_extremes(blend: BlendMode) -> bool {
    matches!(blend, BlendMode::Maximum | BlendMode::Minimum)
}
