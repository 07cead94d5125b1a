//! A frame made ready: everything that its tiles share.

use super::features::Features;
use super::omissions::Omissions;
use super::slices::{Slice, slices};
use super::tables::{Classification, PixelsOfExtremes, ReflectanceMap};
use super::visible::Visible;
use super::volume::Volume;
use crate::frame::FrameDescription;
use crate::plan::Plan;
use crate::render::{Memories, Task};
use crate::stage::composite::Ray;
use crate::stage::illuminate::{Light, illuminate};
use core::ops::Range;
use vg500_regs::{BlendMode, PlaneFormat, SharedView};

/// Rows of rays of a tile at most: the voxels and accumulators of a tile are to stay in cache.
const MOST_ROWS: u32 = 24;

/// What the tiles of a frame share.
pub struct Prepared<'a> {
    /// The frame.
    pub frame: &'a FrameDescription,
    /// Its features.
    pub features: Features,
    /// What is left out of it while its samples stream through.
    pub omissions: Omissions,
    /// Its sample slices.
    pub slices: Vec<Slice>,
    /// Its voxels.
    pub volume: Volume<'a>,
    /// Which of its samples can be seen, unless all.
    pub visible: Option<Visible<'a>>,
    /// Its lookup table.
    pub classification: Box<Classification>,
    /// What its extremes are stored as, if that is all that its rays are, from their beginning to their end.
    pub pixels_of_extremes: Option<PixelsOfExtremes>,
    /// Its reflectance maps, seen along the mirrored axes.
    pub diffuse: ReflectanceMap,
    /// See [`Self::diffuse`].
    pub specular: ReflectanceMap,
    /// Its gradient-magnitude table.
    pub factors: [u8; 256],
    /// Object axes that are mirrored so that no component of the eye vector is negative: illumination is exact
    /// under flips.
    pub mirrored: [bool; 3],
    /// The eye vector along these axes.
    pub eye: [i16; 3],
    /// Pixel memory.
    pub pixels: SharedView<'a>,
    /// Rays at the beginning, row by row, unless all are empty.
    pub first_rays: Option<Vec<Ray>>,
}

impl<'a> Prepared<'a> {
    /// Prepares a frame.
    pub fn new(task: &'a Task, plan: &Plan, memories: Memories<'a>, first_rays: Option<Vec<Ray>>) -> Self {
        let frame = &task.frame;
        let features = Features::of(frame, &task.tables);
        // Reflection counts on an eye vector of unit length; a frame without highlights need not have one.
        let eye = if frame.needs().specular { frame.illumination.eye } else { [0, 0, i16::MAX] };
        let mirrored = eye.map(|component| features.specular && component < 0);
        let slices = slices(frame, plan);
        let classification = classification(task, features);
        Self {
            frame,
            features,
            omissions: Omissions::new(frame, &slices, &classification),
            slices,
            volume: Volume::new(frame, memories.voxel),
            visible: Visible::new(frame),
            pixels_of_extremes: only_extremes(frame, features)
                .then(|| PixelsOfExtremes::new(&classification)),
            classification,
            diffuse: ReflectanceMap::mirrored(&task.tables.diffuse, mirrored),
            specular: ReflectanceMap::mirrored(&task.tables.specular, mirrored),
            factors: core::array::from_fn(|entry| task.tables.gradient_magnitude[entry]),
            mirrored,
            eye: eye.map(i16::saturating_abs),
            pixels: memories.pixel,
            first_rays,
        }
    }

    /// Rays of the frame are columns of the plane from the other end on.
    #[must_use]
    pub fn mirrored_columns(&self) -> bool {
        self.frame.permutation.axes()[0].flipped
    }

    /// Divides the rows of the base plane into tiles of about equal work, as many as threads share evenly.
    #[must_use]
    pub fn tiles(&self, threads: usize) -> Vec<Range<u32>> {
        let [_, height] = self.frame.rays.size;
        let mut samples = vec![0u64; height as usize + 1];
        for slice in &self.slices {
            let row = slice.x.rays.len() as u64;
            samples[slice.y.rays.start as usize] += row;
            samples[slice.y.rays.end as usize] = samples[slice.y.rays.end as usize].wrapping_sub(row);
        }
        // From changes to the samples of each row, to those before each row.
        let mut in_row = 0u64;
        let mut before = 0;
        for entry in &mut samples {
            in_row = in_row.wrapping_add(*entry);
            *entry = before;
            before += in_row;
        }
        let threads = threads.max(1) as u32;
        let count = threads * height.div_ceil(threads * MOST_ROWS);
        let total = samples[height as usize];
        let mut tiles = Vec::with_capacity(count as usize);
        let mut start = 0;
        for tile in 1..=count {
            let share = u128::from(total) * u128::from(tile) / u128::from(count);
            let end = samples.partition_point(|&before| u128::from(before) < share) as u32;
            let end = if tile == count { height } else { end.min(height) };
            while start < end {
                let next = (start + MOST_ROWS + MOST_ROWS / 2).min(end);
                tiles.push(start..next);
                start = next;
            }
        }
        tiles
    }
}

/// Whether rays are stored as what a look-up of their extremes gives.
fn only_extremes(frame: &FrameDescription, features: Features) -> bool {
    features.extremes_only()
        && frame.output.format == PlaneFormat::Rgba8
        && !frame.output.cursor_only
        && frame.visibility.cursor.is_none()
}

/// The lookup table: without light, colours are those that emission leaves.
fn classification(task: &Task, features: Features) -> Box<Classification> {
    let illumination = &task.frame.illumination;
    let blend = task.frame.output.blend;
    let unlit = |color| illuminate(illumination, color, Light::default(), 0);
    let product = |color: [u16; 3], alpha| color.map(|channel| crate::fixed::product(channel, alpha));
    Classification::new(&task.tables, |color, alpha| match (features.light(), features.premultiplied) {
        (true, _) => color,
        (false, true) => product(unlit(color), alpha),
        (false, false) if alpha == 0 && matches!(blend, BlendMode::Alpha | BlendMode::Sum) => color,
        (false, false) => unlit(color),
    })
}
