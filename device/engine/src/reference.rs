//! The reference renderer: it defines what the card computes. Scalar, stage by stage, slice by slice.

use crate::fixed::{CUT_FACTOR, ONE_VOXEL, round_shift, scale, unity};
use crate::frame::{Cursor, FrameDescription, Needs};
use crate::memory::pixel;
use crate::memory::section::SectionMemory;
use crate::memory::voxel::{PermutedVolume, VoxelSlices};
use crate::plan::{Plan, SampleSlice};
use crate::render::{Cancel, Memories, Task};
use crate::stage::classify::{Classified, classify};
use crate::stage::composite::Ray;
use crate::stage::gradient::to_object;
use crate::stage::illuminate::{Light, illuminate, light};
use crate::stage::magnitude::magnitude;
use crate::stage::sample::SampleGrid;
use crate::stage::section::Section;
use crate::stage::visibility::UNCUT;
use vg500_regs::limit::SUM_SAMPLES;
use vg500_regs::memory::plane_offset;
use vg500_regs::table::*;
use vg500_regs::{BlendMode, Fault, FaultCode, SharedView};

/// Renders a frame into pixel memory; returns the checksum of its pixels.
pub fn render(task: &Task, plan: &Plan, memories: Memories<'_>, cancel: &Cancel) -> Result<u32, Fault> {
    let frame = &task.frame;
    let mut rays = first_rays(frame, plan, memories.pixel)?;
    if !frame.output.cursor_only {
        render_volume(task, plan, memories, &mut rays, cancel)?;
    }
    // In alpha blending the cursor's samples are blended with those of the volume.
    if let Some(cursor) = frame.visibility.cursor.filter(|_| frame.output.blend != BlendMode::Alpha) {
        for slice in plan.slices.iter().rev() {
            cancel.check()?;
            cover_with_cursor(frame, &cursor, slice, &mut rays);
        }
    }
    store(frame, &rays, memories.pixel)
}

/// Section by section, in each front to back, slice by slice.
fn render_volume(
    task: &Task,
    plan: &Plan,
    memories: Memories<'_>,
    rays: &mut [Ray],
    cancel: &Cancel,
) -> Result<(), Fault> {
    let frame = &task.frame;
    let sections = frame.output.sections;
    let memory = match sections {
        true => Some(SectionMemory::new(frame, plan.slices.len(), memories.section)?),
        false => None,
    };
    for section in Section::of(frame.permuted_size()[0], sections) {
        render_section(task, plan, &section, memories.voxel, memory.as_ref(), rays, cancel)?;
    }
    Ok(())
}

fn render_section(
    task: &Task,
    plan: &Plan,
    section: &Section,
    voxels: SharedView<'_>,
    memory: Option<&SectionMemory<'_>>,
    rays: &mut [Ray],
    cancel: &Cancel,
) -> Result<(), Fault> {
    let needs = task.frame.needs();
    let blend = task.frame.output.blend;
    let width = task.frame.rays.size[0];
    let place = |[column, row]: [u32; 2]| (row * width + column) as usize;
    let margin = i64::from(needs.gradient);
    let volume = PermutedVolume::new(&task.frame, voxels);
    let mut voxels = VoxelSlices::new(volume.section(section.voxels.clone()));
    let mut samples = SampleGrid::default();
    let mut carried = Vec::new();
    for (index, slice) in plan.slices.iter().enumerate() {
        cancel.check()?;
        let below = slice.voxel_slice();
        voxels
            .load(below - margin..=below + 1 + margin)
            .map_err(|_| Fault::new(FaultCode::Range, volume_base::OFFSET))?;
        if let Some(memory) = memory.filter(|_| section.continues) {
            memory.read(index, &mut carried)?;
            section.entering(slice).for_each(|(ray, beam)| rays[place(ray)].resume(blend, carried[beam].ray));
        }
        samples.interpolate(section, slice, &voxels, &carried, needs.gradient);
        for row in slice.y.rays.clone() {
            for column in section.finished(&slice.x) {
                let ray = [column, row];
                let sample = Sample { task, needs, slice, samples: &samples, ray };
                sample.composite(&mut rays[place(ray)]);
            }
        }
        if let Some(memory) = memory.filter(|_| section.continued) {
            let spilled = section.spill(slice, &voxels, &samples, needs.gradient, |ray| rays[place(ray)]);
            memory.write(index, &spilled)?;
        }
    }
    // From here on they are in section memory alone.
    for slice in &plan.slices {
        section.leaving(slice).for_each(|(ray, _)| rays[place(ray)].resume(blend, Ray::default()));
    }
    Ok(())
}

/// One sample on its way down the pipeline.
struct Sample<'a> {
    task: &'a Task,
    needs: Needs,
    slice: &'a SampleSlice,
    samples: &'a SampleGrid,
    ray: [u32; 2],
}

impl Sample<'_> {
    fn composite(&self, ray: &mut Ray) {
        let frame = &self.task.frame;
        let mut factor = UNCUT;
        if self.needs.position() {
            let position = object_position(frame, self.slice, self.ray);
            if !frame.visibility.block_contains(position) {
                return;
            }
            factor = frame.visibility.factor(position);
            if frame.output.blend == BlendMode::Alpha
                && let Some(cursor) = cursor_sample(frame, position, factor)
            {
                ray.blend(BlendMode::Alpha, 0, cursor);
            }
        }
        if factor > 0 {
            let [column, row] = self.ray.map(i64::from);
            let value = self.samples.at(column, row);
            ray.blend(frame.output.blend, value, self.shade(value, factor));
        }
    }

    /// Classification and illumination.
    fn shade(&self, value: u16, factor: u32) -> Classified {
        let illumination = &self.task.frame.illumination;
        let classified = classify(&self.task.tables, value);
        let shown = matches!(self.task.frame.output.blend, BlendMode::Maximum | BlendMode::Minimum);
        if classified.alpha == 0 && !shown {
            // Multiplied by its opacity its colour is nothing, lit or not.
            return classified;
        }
        let gradient = if self.needs.gradient { self.gradient() } else { [0; 3] };
        let modulation = match self.needs.magnitude {
            true => self.task.tables.gradient_magnitude[usize::from(magnitude(gradient))],
            false => u8::MAX,
        };
        let light = if self.needs.light {
            light(illumination, &self.task.tables, gradient)
        } else {
            Light::default()
        };
        let mut alpha = classified.alpha;
        if self.needs.opacity_modulation {
            alpha = scale(alpha, unity(modulation));
        }
        if self.task.frame.output.blend == BlendMode::Alpha {
            alpha = round_shift(i64::from(alpha) * i64::from(factor), CUT_FACTOR.fraction) as u16;
        }
        Classified { color: illuminate(illumination, classified.color, light, modulation), alpha }
    }

    /// The gradient in object axes.
    fn gradient(&self) -> [i32; 3] {
        let [column, row] = self.ray.map(i64::from);
        to_object(self.samples.gradient_at(column, row), &self.task.frame.permutation)
    }
}

/// Position of a ray's sample in object space, 1/256 voxel.
fn object_position(frame: &FrameDescription, slice: &SampleSlice, ray: [u32; 2]) -> [i64; 3] {
    let permuted = [slice.x.position(i64::from(ray[0])), slice.y.position(i64::from(ray[1])), slice.z];
    frame.permutation.to_object(permuted, frame.volume.size.map(|size| i64::from(size - 1) * ONE_VOXEL))
}

/// The cursor's sample at a position where `factor` of the volume's opacity is left.
fn cursor_sample(frame: &FrameDescription, position: [i64; 3], factor: u32) -> Option<Classified> {
    let cursor = frame.visibility.cursor.as_ref()?;
    if factor > 0 || cursor.disable_crop { cursor.sample(position) } else { None }
}

/// Blends the cursor's samples of a slice over finished rays.
fn cover_with_cursor(frame: &FrameDescription, cursor: &Cursor, slice: &SampleSlice, rays: &mut [Ray]) {
    for row in slice.y.rays.clone() {
        for column in slice.x.rays.clone() {
            let position = object_position(frame, slice, [column, row]);
            let seen = frame.visibility.block_contains(position)
                && (cursor.disable_crop || frame.visibility.factor(position) > 0);
            if let Some(sample) = cursor.sample(position).filter(|_| seen) {
                rays[(row * frame.rays.size[0] + column) as usize].cover(frame.output.blend, sample);
            }
        }
    }
}

/// Rays as they begin: empty, or with the accumulators of an earlier frame.
pub(crate) fn first_rays(
    frame: &FrameDescription,
    plan: &Plan,
    pixels: SharedView<'_>,
) -> Result<Vec<Ray>, Fault> {
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
