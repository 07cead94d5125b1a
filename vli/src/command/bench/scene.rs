//! What is measured: scenes, views and the volume.

use crate::geometry::{Accumulation, Supersampling, look_at};
use crate::illumination::Light;
use crate::{Context, Crop, LookupTable, Modulation, Reflection, Volume, Voxels};
use clap::ValueEnum;
use glam::DVec3;
use vg500_regs::BlendMode;

/// Scenes: which stages work, and what there is to leave out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Scene {
    /// Interpolation, classification, blending; every sample is visible.
    None,
    /// Gradients and diffuse light beside that.
    Diffuse,
    /// Diffuse and specular light, gradient magnitude that modulates opacity and both.
    Full,
    /// Diffuse and specular light alone.
    FullUnmodulated,
    /// Maximum intensity projection.
    Mip,
    /// Minimum intensity projection.
    Minip,
    /// Weighted sum.
    Sum,
    /// As full, with two sample slices for each voxel slice.
    Supersampled,
    /// As full, of which cropping leaves an eighth in the middle.
    Cropped,
    /// Bones under diffuse and specular light: most is transparent, the rest ends its rays.
    Opaque,
    /// Soft tissue of low opacity, as full: air is transparent, and rays go on to their end.
    Thin,
}

/// Views: along which axis rays run, towards its high or its low end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Axis {
    /// Object x.
    #[value(name = "+x")]
    PlusX,
    /// Against object x.
    #[value(name = "-x")]
    MinusX,
    /// Object y.
    #[value(name = "+y")]
    PlusY,
    /// Against object y.
    #[value(name = "-y")]
    MinusY,
    /// Object z.
    #[value(name = "+z")]
    PlusZ,
    /// Against object z.
    #[value(name = "-z")]
    MinusZ,
    /// From corner to corner: 45 degrees off z in x and in y, where rays shear most.
    Corner,
}

impl Axis {
    /// Where rays run. Off the axis by a little, so that no weight is zero.
    fn direction(self) -> DVec3 {
        match self {
            Self::PlusX => DVec3::new(1.0, 0.3, -0.2),
            Self::MinusX => DVec3::new(-1.0, 0.3, -0.2),
            Self::PlusY => DVec3::new(0.3, 1.0, -0.2),
            Self::MinusY => DVec3::new(0.3, -1.0, -0.2),
            Self::PlusZ => DVec3::new(0.3, -0.2, 1.0),
            Self::MinusZ => DVec3::new(0.3, -0.2, -1.0),
            Self::Corner => DVec3::new(0.999, 0.999, 1.0),
        }
    }
}

impl Scene {
    /// The opacity of a value in 0..4096.
    fn opacity(self, value: f64) -> f64 {
        match self {
            Self::Opaque => ((value - 1500.0) * 20.0).clamp(0.0, 4095.0) / 4095.0,
            Self::Thin if value < 200.0 => 0.0,
            Self::Thin => ((value - 1500.0).max(0.0) * 2.0 + 40.0).min(3500.0) / 4095.0,
            _ => (1.0 + (value / 64.0).floor()) / 4095.0,
        }
    }

    /// Diffuse and specular coefficients, and whether the gradient magnitude modulates all it can.
    const fn light(self) -> ([f64; 2], bool) {
        match self {
            Self::Diffuse => ([0.9, 0.0], false),
            Self::FullUnmodulated | Self::Opaque => ([0.9, 0.5], false),
            Self::Full | Self::Supersampled | Self::Cropped | Self::Thin => ([0.9, 0.5], true),
            Self::None | Self::Mip | Self::Minip | Self::Sum => ([0.0, 0.0], false),
        }
    }

    const fn blend(self) -> BlendMode {
        match self {
            Self::Mip => BlendMode::Maximum,
            Self::Minip => BlendMode::Minimum,
            Self::Sum => BlendMode::Sum,
            _ => BlendMode::Alpha,
        }
    }

    /// Whether a sample needs no look-up in the table of 8-byte entries.
    pub const fn is_projection(self) -> bool {
        matches!(self, Self::Mip | Self::Minip)
    }

    /// The scene as it is seen along an axis; `None` if the library refuses a part of it.
    pub fn context(self, axis: Axis, size: u32) -> Option<Context> {
        let entries = (0..4096).map(f64::from);
        let opacity = entries.map(|value| self.opacity(value)).collect();
        let color =
            (0..4096).map(|value: u32| [255, (value >> 4) as u8, (200 - (value >> 5)) as u8]).collect();
        let mut context = Context::new(LookupTable::new(color, opacity)?);
        context.correct_opacity = false;
        let middle = DVec3::splat(f64::from(size - 1) / 2.0);
        let direction = axis.direction();
        let up = if direction.y.abs() > 0.9 { DVec3::X } else { DVec3::Y };
        context.camera = look_at(middle - direction * 1000.0, middle, up).ok()?;
        let ([diffuse, specular], modulates) = self.light();
        if diffuse > 0.0 {
            context.reflection =
                Reflection { diffuse, specular, emissive: 0.2, exponent: 24.0, color: [1.0, 0.9, 0.8] };
            context.lights = vec![Light::new(direction + DVec3::new(0.3, 0.4, 0.0), 1.0)?];
        }
        context.modulation = Modulation { opacity: modulates, diffuse: modulates, specular: modulates };
        context.blend = self.blend();
        if self == Self::Supersampled {
            context.supersampling = Supersampling::new([1, 1, 2], Accumulation::Grow).ok()?;
        }
        if self == Self::Cropped {
            let [low, high] = [0.25, 0.75].map(|part| (f64::from(size - 1) * part).round());
            context.crop = Crop { slabs: [[low, high]; 3], flags: Crop::SUB_VOLUME };
        }
        Some(context)
    }
}

/// A volume like a CT scan: air, two ellipsoids and a rod of soft tissue and bone, and noise.
pub fn volume(size: u32, bits: u8) -> Option<Volume> {
    let half = f64::from(size - 1) / 2.0;
    let mut noise = 0x0123_4567_u32;
    let voxels = (0..size.pow(3)).map(|index| {
        let place = [index % size, index / size % size, index / size / size];
        // From -127.5 to 127.5 whatever the size is.
        let [x, y, z] = place.map(|at| if size > 1 { (f64::from(at) - half) / half * 127.5 } else { 0.0 });
        noise ^= noise << 13;
        noise ^= noise >> 17;
        noise ^= noise << 5;
        (tissue(x, y, z) + f64::from(noise >> 8 & 63) - 8.0).clamp(0.0, 4095.0) as u16
    });
    let voxels = match bits {
        8 => Voxels::Uint8(voxels.map(|voxel| (voxel >> 4) as u8).collect()),
        _ => Voxels::Uint12Lower(voxels.collect()),
    };
    Volume::new([size; 3], voxels).ok()
}

fn tissue(x: f64, y: f64, z: f64) -> f64 {
    let radius = |[a, b, c]: [f64; 3]| ((x / a).powi(2) + (y / b).powi(2) + (z / c).powi(2)).sqrt();
    let [skin, skull] = [radius([100.0, 112.0, 116.0]), radius([80.0, 92.0, 96.0])];
    let mut value = if skin < 1.0 { 1000.0 * ((1.0 - skin) * 25.0).min(1.0) } else { 0.0 };
    if skin < 0.97 && skull > 0.95 {
        value = 2600.0 + 300.0 * (x * 0.1).sin();
    }
    let rod = (x - 20.0).hypot(y + 10.0);
    if rod < 14.0 {
        let bone = ((14.0 - rod) / 3.0).min(1.0);
        value = 3000.0 * bone + 1000.0 * (1.0 - bone);
    }
    value
}
