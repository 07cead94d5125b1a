//! The reference renderer: it defines what the card computes. Scalar, stage by stage, slice by slice.

use crate::frame::FrameDescription;
use crate::memory::pixel;
use crate::memory::voxel::PermutedVolume;
use crate::plan::{Plan, SampleSlice};
use crate::render::{Cancel, Memories, Task};
use crate::stage::classify::{Classified, classify};
use crate::stage::composite::Ray;
use crate::stage::illuminate::{Light, illuminate};
use crate::stage::interpolate::{guard, trilinear, unguard};
use vg500_regs::limit::SUM_SAMPLES;
use vg500_regs::memory::plane_offset;
use vg500_regs::shared::OutOfRange;
use vg500_regs::table::*;
use vg500_regs::{BlendMode, Fault, FaultCode, SharedView};

/// A fault unless the renderer does what the frame asks for.
pub fn serves(frame: &FrameDescription) -> Result<(), Fault> {
    let illumination = &frame.illumination;
    let asked = [
        (illumination.diffuse != 0, material::DIFFUSE),
        (illumination.specular != 0, material::SPECULAR),
        (illumination.modulate[0], modulation::OPACITY),
        (frame.visibility.crop.is_some(), crop_flags::TERM_0),
        (frame.visibility.cut.is_some(), cut_control::ENABLE),
        (frame.visibility.cursor.is_some(), cursor_control::ENABLE_X),
        (frame.output.cursor_only, output::CURSOR_ONLY),
        (frame.output.sections, output::SECTIONS),
    ];
    match asked.iter().find(|(asked, _)| *asked) {
        Some((_, field)) => Err(Fault::new(FaultCode::NotServed, *field)),
        None => Ok(()),
    }
}

/// Renders a frame into pixel memory; returns the checksum of its pixels.
pub fn render(task: &Task, plan: &Plan, memories: Memories<'_>, cancel: &Cancel) -> Result<u32, Fault> {
    let volume = PermutedVolume::new(&task.frame, memories.voxel);
    let mut rays = first_rays(&task.frame, plan, memories.pixel)?;
    let mut voxels = VoxelSlices::new(volume);
    for slice in &plan.slices {
        cancel.check()?;
        let below = slice.voxel_slice();
        voxels.load(below).map_err(outside_voxel_memory)?;
        render_slice(task, slice, &voxels, &mut rays);
    }
    store(&task.frame, &rays, memories.pixel)
}

fn outside_voxel_memory(_: OutOfRange) -> Fault {
    Fault::new(FaultCode::Range, volume_base::OFFSET)
}

/// The voxel slices on both sides of a sample slice.
struct VoxelSlices<'a> {
    volume: PermutedVolume<'a>,
    below: Option<i64>,
    slices: [Vec<u16>; 2],
}

impl<'a> VoxelSlices<'a> {
    const fn new(volume: PermutedVolume<'a>) -> Self {
        Self { volume, below: None, slices: [Vec::new(), Vec::new()] }
    }

    /// Brings in the voxel slices `below` and `below + 1`; each is read once per frame.
    fn load(&mut self, below: i64) -> Result<(), OutOfRange> {
        if self.below == Some(below) {
            return Ok(());
        }
        self.slices.swap(0, 1);
        if self.below != Some(below - 1) {
            self.volume.read_slice(below, &mut self.slices[0])?;
        }
        self.below = Some(below);
        self.volume.read_slice(below + 1, &mut self.slices[1])
    }

    /// The corners of the cell whose lowest voxel is (x, y); reads past the volume replicate its faces.
    fn corners(&self, x: i64, y: i64) -> [[[i32; 2]; 2]; 2] {
        let [width, height, _] = self.volume.size;
        let columns = [x, x + 1].map(|x| x.clamp(0, width as i64 - 1) as usize);
        let rows = [y, y + 1].map(|y| y.clamp(0, height as i64 - 1) as usize);
        [0, 1].map(|slice| {
            rows.map(|row| columns.map(|column| guard(self.slices[slice][row * width + column])))
        })
    }
}

fn render_slice(task: &Task, slice: &SampleSlice, voxels: &VoxelSlices<'_>, rays: &mut [Ray]) {
    let weights = [slice.x.weight(), slice.y.weight(), slice.weight_z()];
    let width = task.frame.rays.size[0];
    for row in slice.y.rays.clone() {
        for column in slice.x.rays.clone() {
            let [i, j] = [i64::from(column), i64::from(row)];
            let position = [slice.x.position(i), slice.y.position(j), slice.z];
            if !is_visible(&task.frame, position) {
                continue;
            }
            let corners = voxels.corners(slice.x.voxel(i), slice.y.voxel(j));
            let value = unguard(trilinear(corners, weights));
            let Classified { color, alpha } = classify(&task.tables, value);
            let color = illuminate(&task.frame.illumination, color, Light::default(), 0);
            let ray = &mut rays[(row * width + column) as usize];
            ray.blend(task.frame.output.blend, value, Classified { color, alpha });
        }
    }
}

/// Whether the sample at a permuted position can be seen.
fn is_visible(frame: &FrameDescription, position: [i64; 3]) -> bool {
    let last = frame.volume.size.map(|size| i64::from(size - 1) << crate::fixed::POSITION_BITS);
    frame.visibility.bounds_contain(frame.permutation.to_object(position, last))
}

/// Rays as they begin: empty, or with the accumulators of an earlier frame.
fn first_rays(frame: &FrameDescription, plan: &Plan, pixels: SharedView<'_>) -> Result<Vec<Ray>, Fault> {
    let [width, height] = frame.rays.size;
    let Some(plane) = frame.output.accumulators else {
        return Ok(vec![Ray::default(); (width * height) as usize]);
    };
    let format = frame.output.format;
    let mut rays = Vec::with_capacity((width * height) as usize);
    let mut row_bytes = vec![0; width as usize * format.bytes()];
    for row in 0..height {
        let offset = plane_offset(format, plane, 0, row);
        pixels
            .read(offset, &mut row_bytes)
            .map_err(|_| Fault::new(FaultCode::Range, accumulators::SOURCE))?;
        rays.extend(row_bytes.chunks(format.bytes()).map(|bytes| pixel::load(bytes, format)));
    }
    let most = SUM_SAMPLES.saturating_sub(plan.slices.len() as u32);
    let full = rays.iter().any(|ray| ray.samples > most);
    if frame.output.blend == BlendMode::Sum && full {
        return Err(Fault::new(FaultCode::Value, accumulators::SOURCE));
    }
    Ok(rays)
}

/// Writes all rays to the base plane and returns the checksum of what was written.
fn store(frame: &FrameDescription, rays: &[Ray], pixels: SharedView<'_>) -> Result<u32, Fault> {
    let format = frame.output.format;
    let mut checksum = crc32fast::Hasher::new();
    let mut bytes = Vec::new();
    for (row, rays) in (0..).zip(rays.chunks(frame.rays.size[0] as usize)) {
        bytes.clear();
        rays.iter().for_each(|ray| pixel::store(ray, frame.output.blend, format, &mut bytes));
        checksum.update(&bytes);
        let offset = plane_offset(format, frame.output.plane, 0, row);
        pixels.write(offset, &bytes).map_err(|_| Fault::new(FaultCode::Range, start::PLANE))?;
    }
    Ok(checksum.finalize())
}
