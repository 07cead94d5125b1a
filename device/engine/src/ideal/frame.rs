//! The ideal of a frame.

use super::{PiecewiseLinear, Rays, Scene, Transfer, Visibility, Voxels};
use crate::fixed::FULL;
use crate::memory::voxel::PermutedVolume;
use crate::render::Task;
use crate::tables::Tables;
use vg500_regs::number::RAY_POSITION;
use vg500_regs::table::*;
use vg500_regs::{Fault, FaultCode, Field, Permutation, SharedView};

/// The scene that a frame shows: its voxels are those in voxel memory now, as values 0..=4095, and its transfer
/// function is linear between the entries of the frame's tables. A fault names what has no ideal yet.
pub fn scene(
    task: &Task,
    memory: SharedView<'_>,
) -> Result<Scene<impl Voxels + use<>, impl Transfer + use<>>, Fault> {
    let frame = &task.frame;
    serves(task)?;
    let one = f64::from(1 << RAY_POSITION.fraction);
    let size = frame.volume.size.map(|size| size as usize);
    let voxels = voxels(task, memory).ok_or(Fault::new(FaultCode::Range, volume_base::OFFSET))?;
    let transfer = transfer(&task.tables, frame.illumination.emissive)
        .ok_or(Fault::new(FaultCode::Internal, table_select::COLOR))?;
    Ok(Scene {
        size,
        voxels: move |[x, y, z]: [usize; 3]| f64::from(voxels[(z * size[1] + y) * size[0] + x]),
        transfer: move |value| transfer.at(value),
        permutation: frame.permutation,
        rays: Rays {
            start: frame.rays.start.map(|start| f64::from(start) / one),
            step: frame.rays.step.map(|step| f64::from(step) / one),
            supersampling: frame.rays.supersampling,
            size: frame.rays.size,
        },
        visibility: Visibility {
            subvolume: frame.visibility.subvolume.map(|bounds| bounds.map(f64::from)),
            block: frame.visibility.block.map(|bounds| bounds.map(f64::from)),
        },
        blend: frame.output.blend,
    })
}

/// A fault if the frame asks for something that has no ideal.
fn serves(task: &Task) -> Result<(), Fault> {
    let needs = task.frame.needs();
    let asked: [(bool, Field); 5] = [
        (needs.light, material::DIFFUSE),
        (needs.opacity_modulation, modulation::OPACITY),
        (needs.crop, crop_flags::TERM_0),
        (needs.cut, cut_control::ENABLE),
        (needs.cursor, cursor_control::ENABLE_X),
    ];
    match asked.iter().find(|(asked, _)| *asked) {
        Some((_, field)) => Err(Fault::new(FaultCode::NotServed, *field)),
        None => Ok(()),
    }
}

/// The volume in object axes, x fastest.
fn voxels(task: &Task, memory: SharedView<'_>) -> Option<Vec<u16>> {
    let mut frame = task.frame;
    frame.permutation = Permutation::IDENTITY;
    let volume = PermutedVolume::new(&frame, memory);
    let mut voxels = Vec::with_capacity(volume.size.iter().product());
    let mut slice = Vec::new();
    for z in 0..volume.size[2] {
        volume.read_slice(z as i64, &mut slice).ok()?;
        voxels.append(&mut slice);
    }
    Some(voxels)
}

/// The tables' entries, dimmed by the emission coefficient, as points.
fn transfer(tables: &Tables, emissive: u8) -> Option<PiecewiseLinear> {
    let emission = f64::from(emissive) / f64::from(u8::MAX);
    let level = |entry: u16| f64::from(entry) / f64::from(FULL);
    let points = tables.color.iter().zip(&tables.opacity).enumerate();
    PiecewiseLinear::new(
        points
            .map(|(value, (color, alpha))| {
                let [r, g, b] = color.map(|channel| level(channel) * emission);
                (value as f64, [r, g, b, level(*alpha)])
            })
            .collect(),
    )
}
