//! What the card would show with unlimited precision: the base plane of a context and a volume in 64-bit floating
//! point, with light that is computed and a transfer function that is a function. It serves to measure errors.
//!
//! Rays are those of the card, whose steps have 22 fraction bits; everything along them is exact.

#[cfg(test)]
mod tests;

use crate::board::{BasePlane, FrameReport, RenderError};
use crate::context::{Context, linear};
use crate::cursor::CursorType;
use crate::geometry::{self, Accumulation, Pass, ShearWarp};
use crate::illumination::gradient_table::{GREATEST, anisotropy};
use crate::volume::{Volume, Voxels};
use std::time::{Duration, Instant};
use vg500_engine::ideal::shading::{Light, Lighting, Modulation, Phong};
use vg500_engine::ideal::visibility::{Crop, CutPlane};
use vg500_engine::ideal::{Cursor, PiecewiseLinear, Rays, Scene, Shading, Visibility};
use vg500_regs::number;

/// Colour and opacity of an on-board value: R, G, B (not multiplied by A) and A, 0..=1 each. Values are those of
/// 12-bit voxels, 0.0..=4095.0, with everything between; 8-bit voxels are times 16. Where the context corrects
/// opacity, A is that of one smallest voxel spacing.
pub type Transfer<'a> = &'a (dyn Fn(f64) -> [f64; 4] + Sync);

/// A base plane of ideal pixels.
#[derive(Clone, Debug)]
pub struct IdealPlane {
    /// Rows of R, G, B, A, 0..=1; colours are premultiplied in alpha blending.
    pub pixels: Vec<[f64; 4]>,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Where the pixels lie.
    pub plane: geometry::BasePlane,
    /// How the volume is seen.
    pub view: ShearWarp,
    /// Samples, passes and times; cycles and omissions are the card's, and zero.
    pub report: FrameReport,
}

/// The ideal base plane, each pixel rounded once, to 8 bits. The lookup table of the context is not used.
///
/// # Errors
/// A view or volume that the card cannot render.
pub fn render(context: &Context, volume: &Volume, transfer: Transfer<'_>) -> Result<BasePlane, RenderError> {
    let IdealPlane { pixels, size, plane, view, report } = pixels(context, volume, transfer)?;
    let byte = |level: f64| (level * 255.0).round() as u8;
    let pixels = pixels.into_iter().flat_map(|pixel| pixel.map(byte)).collect();
    Ok(BasePlane { pixels, size, plane, view, report })
}

/// The ideal base plane. The lookup table of the context is not used.
///
/// # Errors
/// A view or volume that the card cannot render.
pub fn pixels(context: &Context, volume: &Volume, transfer: Transfer<'_>) -> Result<IdealPlane, RenderError> {
    let started = Instant::now();
    let view = context.shear_warp(volume)?;
    let plane = view.base_plane_with_margin();
    let passes = view.passes(&plane);
    let size = plane.size();
    let distance = context.opacity_distance(volume, &view);
    let values = values(volume);
    let [width, height, depth] = volume.size().map(|side| side as usize);
    let mut scene = Scene {
        size: [width, height, depth],
        voxels: |[x, y, z]: [usize; 3]| f64::from(values[(z * height + y) * width + x]),
        transfer: |value| corrected(transfer(value), distance),
        permutation: view.permutation(),
        rays: Rays { start: [0.0; 2], step: [0.0; 2], supersampling: 1, size: [0; 2] },
        visibility: visibility(context, volume),
        cursor: cursor(context),
        shading: shading(context, volume),
        blend: context.blend,
    };
    // Interleaved passes meet a pixel once, averaged ones all of them.
    let share = match context.supersampling.accumulation() {
        Accumulation::Grow => 1.0,
        Accumulation::Blend => 1.0 / passes.len() as f64,
    };
    let mut pixels = vec![[0.0; 4]; size[0] as usize * size[1] as usize];
    let mut engine_time = Duration::ZERO;
    for pass in &passes {
        scene.rays = rays(&view, pass);
        let begun = Instant::now();
        let rendered = scene.pixels();
        engine_time += begun.elapsed();
        add(&mut pixels, size[0] as usize, pass, &rendered, share);
    }
    let report = FrameReport {
        samples: view.samples(),
        samples_processed: view.samples(),
        engine_time,
        frame_time: started.elapsed(),
        passes: passes.len() as u32,
        ..FrameReport::default()
    };
    Ok(IdealPlane { pixels, size, plane, view, report })
}

/// Adds the pixels of a pass to those of a plane `width` wide.
fn add(pixels: &mut [[f64; 4]], width: usize, pass: &Pass, rendered: &[[f64; 4]], share: f64) {
    let [columns, left, top, across, down] =
        [pass.size[0], pass.offset[0], pass.offset[1], pass.stride[0], pass.stride[1]].map(|it| it as usize);
    for (row, rendered) in rendered.chunks_exact(columns).enumerate() {
        let places = pixels.iter_mut().skip((top + row * down) * width + left).step_by(across);
        for (pixel, rendered) in places.zip(rendered) {
            *pixel = core::array::from_fn(|channel| pixel[channel] + rendered[channel] * share);
        }
    }
}

/// The voxels as on-board values.
fn values(volume: &Volume) -> Vec<u16> {
    let format = volume.voxels().format();
    match volume.voxels() {
        Voxels::Uint8(voxels) => voxels.iter().map(|&voxel| format.value(voxel.into())).collect(),
        Voxels::Uint12Lower(voxels) | Voxels::Uint12Upper(voxels) => {
            voxels.iter().map(|&voxel| format.value(voxel)).collect()
        }
    }
}

/// Corrects an opacity for samples `distance` times as far apart: a' = 1 - (1 - a)^distance.
fn corrected([r, g, b, opacity]: [f64; 4], distance: f64) -> [f64; 4] {
    let trivial = distance == 1.0 || opacity <= 0.0 || opacity >= 1.0;
    [r, g, b, if trivial { opacity } else { 1.0 - libm::pow(1.0 - opacity, distance) }]
}

fn rays(view: &ShearWarp, pass: &Pass) -> Rays {
    let one = f64::from(1_u32 << number::RAY_POSITION.fraction);
    Rays {
        start: pass.start.map(|start| f64::from(start) / one),
        step: view.step().map(|step| f64::from(step) / one),
        supersampling: view.supersampling().factors()[2],
        size: pass.size,
    }
}

fn visibility(context: &Context, volume: &Volume) -> Visibility {
    let flags = context.crop.flags & crate::Crop::ALL_FLAGS;
    let cut = context.cut_plane.map(|cut| {
        let (normal, faces) = cut.in_voxels(volume.place().world_from_voxel());
        CutPlane { outside: cut.outside(), normal: normal.to_array(), faces, falloff: cut.falloff() }
    });
    Visibility {
        subvolume: volume.subvolume().map(|bounds| bounds.map(f64::from)),
        crop: (flags != 0).then_some(Crop { flags, slabs: context.crop.slabs }),
        cut,
        ..Visibility::EVERYTHING
    }
}

fn cursor(context: &Context) -> Option<Cursor> {
    let cursor = context.cursor;
    (cursor.enabled != [false; 3]).then(|| Cursor {
        enabled: cursor.enabled,
        planes: cursor.kind == CursorType::Planes,
        exclude_overlap: cursor.exclude_overlap,
        disable_crop: cursor.disable_crop,
        width: f64::from(cursor.width),
        length: f64::from(cursor.length),
        position: cursor.position,
        color: cursor.color.map(|part| part.map(|channel| f64::from(channel) / 255.0)),
    })
}

fn shading(context: &Context, volume: &Volume) -> Shading {
    let reflection = &context.reflection;
    let [emissive, diffuse, specular] =
        [reflection.emissive, reflection.diffuse, reflection.specular].map(|factor| factor.clamp(0.0, 1.0));
    let phong = (diffuse > 0.0 || specular > 0.0).then(|| Phong {
        diffuse,
        specular,
        specular_color: reflection.color.map(|channel| channel.clamp(0.0, 1.0)),
        lighting: lighting(context, volume),
    });
    Shading { emissive, phong, modulation: modulation(context, volume) }
}

fn lighting(context: &Context, volume: &Volume) -> Lighting {
    let lights = context.lights.iter();
    let lights = lights.map(|it| Light { direction: it.direction().to_array(), intensity: it.intensity() });
    let axes = linear(volume).to_cols_array_2d();
    Lighting::new(lights.collect(), context.reflection.exponent, context.eye().to_array(), axes)
}

/// The application's gradient table between the magnitudes that its entries stand for.
fn modulation(context: &Context, volume: &Volume) -> Option<Modulation> {
    let wanted = context.modulation;
    if !(wanted.opacity || wanted.diffuse || wanted.specular) {
        return None;
    }
    let table = context.gradient_table;
    let apart = GREATEST / (table.len() - 1) as f64 / anisotropy(linear(volume));
    let points = table.iter().enumerate().map(|(entry, factor)| (entry as f64 * apart, [*factor]));
    let function = PiecewiseLinear::new(points.collect())?;
    Some(Modulation { function, opacity: wanted.opacity, diffuse: wanted.diffuse, specular: wanted.specular })
}
