//! The ideal of a frame.

use super::shading::{Lighting, Modulation, Phong};
use super::visibility::{Crop, CutPlane};
use super::{Cursor, PiecewiseLinear, Rays, Scene, Shading, Transfer, Visibility, Voxels};
use crate::fixed::{FULL, ONE_VOXEL};
use crate::frame::{self, FrameDescription, Needs};
use crate::memory::voxel::PermutedVolume;
use crate::render::Task;
use crate::tables::Tables;
use vg500_regs::number::{CUT_COEFFICIENT, CUT_DISTANCE, CUT_RECIPROCAL, RAY_POSITION};
use vg500_regs::table::*;
use vg500_regs::{Fault, FaultCode, Permutation, SharedView};

/// The scene that a frame without light shows: its voxels are those in voxel memory now, as values 0..=4095, and
/// its functions are linear between the entries of the frame's tables. A fault names what has no ideal.
pub fn scene(
    task: &Task,
    memory: SharedView<'_>,
) -> Result<Scene<impl Voxels + use<>, impl Transfer + use<>>, Fault> {
    if task.frame.needs().light {
        return Err(Fault::new(FaultCode::NotServed, material::DIFFUSE));
    }
    of(task, memory, None)
}

/// As [`scene`], in the light that the frame's reflectance maps approximate.
pub fn scene_in_light(
    task: &Task,
    memory: SharedView<'_>,
    lighting: Lighting,
) -> Result<Scene<impl Voxels + use<>, impl Transfer + use<>>, Fault> {
    of(task, memory, Some(lighting))
}

fn of(
    task: &Task,
    memory: SharedView<'_>,
    lighting: Option<Lighting>,
) -> Result<Scene<impl Voxels + use<>, impl Transfer + use<>>, Fault> {
    let frame = &task.frame;
    if frame.output.cursor_only {
        return Err(Fault::new(FaultCode::NotServed, output::CURSOR_ONLY));
    }
    let size = frame.volume.size.map(|size| size as usize);
    let voxels = voxels(frame, memory).ok_or(Fault::new(FaultCode::Range, volume_base::OFFSET))?;
    let incomplete = Fault::new(FaultCode::Internal, table_select::COLOR);
    let transfer = transfer(&task.tables).ok_or(incomplete)?;
    Ok(Scene {
        size,
        voxels: move |[x, y, z]: [usize; 3]| f64::from(voxels[(z * size[1] + y) * size[0] + x]),
        transfer: move |value| transfer.at(value),
        permutation: frame.permutation,
        rays: rays(&frame.rays),
        visibility: visibility(&frame.visibility),
        cursor: frame.visibility.cursor.as_ref().map(cursor),
        shading: shading(task, lighting).ok_or(incomplete)?,
        blend: frame.output.blend,
    })
}

/// The volume in object axes, x fastest.
fn voxels(frame: &FrameDescription, memory: SharedView<'_>) -> Option<Vec<u16>> {
    let frame = FrameDescription { permutation: Permutation::IDENTITY, ..*frame };
    let volume = PermutedVolume::new(&frame, memory);
    let mut voxels = Vec::with_capacity(volume.size.iter().product());
    let mut slice = Vec::new();
    for z in 0..volume.size[2] {
        volume.read_slice(z as i64, &mut slice).ok()?;
        voxels.append(&mut slice);
    }
    Some(voxels)
}

/// The tables' entries as points.
fn transfer(tables: &Tables) -> Option<PiecewiseLinear<4>> {
    let level = |entry: u16| f64::from(entry) / f64::from(FULL);
    let points = tables.color.iter().zip(&tables.opacity).enumerate();
    let points = points.map(|(value, (color, alpha))| {
        let [r, g, b] = color.map(level);
        (value as f64, [r, g, b, level(*alpha)])
    });
    PiecewiseLinear::new(points.collect())
}

fn rays(rays: &frame::Rays) -> Rays {
    let one = f64::from(1 << RAY_POSITION.fraction);
    Rays {
        start: rays.start.map(|start| f64::from(start) / one),
        step: rays.step.map(|step| f64::from(step) / one),
        supersampling: rays.supersampling,
        size: rays.size,
    }
}

fn visibility(visibility: &frame::Visibility) -> Visibility {
    Visibility {
        subvolume: visibility.subvolume.map(|bounds| bounds.map(f64::from)),
        block: visibility.block.map(|bounds| bounds.map(f64::from)),
        crop: visibility
            .crop
            .as_ref()
            .map(|crop| Crop { flags: crop.flags, slabs: crop.slabs.map(|bounds| bounds.map(bound)) }),
        cut: visibility.cut.as_ref().map(|cut| CutPlane {
            outside: cut.outside,
            normal: cut.normal.map(|a| f64::from(a) / f64::from(1 << CUT_COEFFICIENT.fraction)),
            faces: cut.faces.map(|face| face as f64 / f64::from(1 << CUT_DISTANCE.fraction)),
            falloff: match cut.falloff {
                0 => 0.0,
                reciprocal => f64::from(1 << CUT_RECIPROCAL.fraction) / f64::from(reciprocal),
            },
        }),
    }
}

fn cursor(cursor: &frame::Cursor) -> Cursor {
    Cursor {
        enabled: cursor.enabled,
        planes: cursor.planes,
        exclude_overlap: cursor.exclude_overlap,
        disable_crop: cursor.disable_crop,
        width: f64::from(cursor.width),
        length: f64::from(cursor.length),
        position: cursor.position.map(bound),
        color: cursor.color.map(|channels| channels.map(factor)),
    }
}

/// A coordinate in voxels.
fn bound(bound: i32) -> f64 {
    f64::from(bound) / ONE_VOXEL as f64
}

/// What 8 bits stand for.
fn factor(factor: u8) -> f64 {
    f64::from(factor) / f64::from(u8::MAX)
}

/// What the frame needs of illumination.
fn shading(task: &Task, lighting: Option<Lighting>) -> Option<Shading> {
    let illumination = &task.frame.illumination;
    let needs: Needs = task.frame.needs();
    let [_, diffuse, specular] = illumination.modulate;
    let modulation = if needs.magnitude {
        let entries = task.tables.gradient_magnitude.iter().enumerate();
        let points = entries.map(|(magnitude, entry)| (magnitude as f64, [factor(*entry)]));
        let function = PiecewiseLinear::new(points.collect())?;
        Some(Modulation { function, opacity: needs.opacity_modulation, diffuse, specular })
    } else {
        None
    };
    let phong = lighting.filter(|_| needs.light).map(|lighting| Phong {
        diffuse: factor(illumination.diffuse),
        specular: factor(illumination.specular),
        specular_color: illumination.specular_color.map(factor),
        lighting,
    });
    Some(Shading { emissive: factor(illumination.emissive), phong, modulation })
}
