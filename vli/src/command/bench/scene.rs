//! What is drawn: scenes, and the views of them.

use crate::command::error::Error;
use crate::geometry::{Accumulation, Supersampling, look_at};
use crate::illumination::Light;
use crate::{Context, Crop, LookupTable, Modulation, Reflection};
use glam::DVec3;
use std::str::FromStr;
use vg500_regs::BlendMode;
use vg500_regs::limit::LOOKUP_ENTRIES;

/// A scene: everything about a frame but the volume and the direction of view.
#[derive(Clone, Copy, Debug)]
pub struct Scene {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it stresses.
    pub stresses: &'static str,
    /// How samples become a pixel.
    blend: BlendMode,
    /// Opacity of a 12-bit value, in 1/4095.
    opacity: fn(usize) -> usize,
    /// Whether there is diffuse light.
    diffuse: bool,
    /// Whether there are highlights.
    specular: bool,
    /// Whether the gradient magnitude modulates opacity and light.
    modulated: bool,
    /// Sample slices per voxel slice.
    slices: u32,
    /// Whether only the middle half along each axis is shown.
    cropped: bool,
}

const NONE: Scene = Scene {
    name: "none",
    stresses: "no light: interpolation, a look-up for each sample, blending",
    blend: BlendMode::Alpha,
    opacity: translucent,
    diffuse: false,
    specular: false,
    modulated: false,
    slices: 1,
    cropped: false,
};

const LIT: Scene = Scene {
    name: "full-unmodulated",
    stresses: "gradients, diffuse and specular light: the reflection vector, both maps",
    diffuse: true,
    specular: true,
    ..NONE
};

const FULL: Scene = Scene {
    name: "full",
    stresses: "the whole pipeline: opacity and both lights modulated by the gradient magnitude",
    modulated: true,
    ..LIT
};

impl Scene {
    /// All scenes. In all but the last two no sample is transparent and no ray finishes: all that can be skipped is
    /// what is cropped, and what is no new extreme.
    pub const ALL: [Self; 11] = [
        NONE,
        Self { name: "diffuse", stresses: "gradients and the diffuse map alone", specular: false, ..LIT },
        FULL,
        LIT,
        Self {
            name: "mip",
            stresses: "reading voxels: the greatest sample",
            blend: BlendMode::Maximum,
            ..NONE
        },
        Self { name: "minip", stresses: "as mip, the least sample", blend: BlendMode::Minimum, ..NONE },
        Self { name: "sum", stresses: "as none, added to 32-bit sums", blend: BlendMode::Sum, ..NONE },
        Self {
            name: "supersampled",
            stresses: "as full, two sample slices per voxel slice: interpolation along the rays, too",
            slices: 2,
            ..FULL
        },
        Self {
            name: "cropped",
            stresses: "as full, the middle half along each axis: an eighth of the samples is visible",
            cropped: true,
            ..FULL
        },
        Self {
            name: "opaque",
            stresses: "as full-unmodulated, opaque bones in nothing: empty space, and rays that finish early",
            opacity: bones,
            ..LIT
        },
        Self {
            name: "thin",
            stresses: "as full, thin tissue in air: empty space, but rays that go on to their end",
            opacity: tissue,
            ..FULL
        },
    ];

    /// Whether each sample is looked up in the colour and opacity tables.
    pub const fn is_classified(&self) -> bool {
        matches!(self.blend, BlendMode::Alpha | BlendMode::Sum)
    }

    /// The context of a frame of this scene in a volume of `size` voxels along each axis.
    pub fn context(&self, axis: &Axis, size: u32) -> Result<Context, Error> {
        let mut context = Context::new(self.table(0.0)?);
        // Opacities are those of samples, whatever their distance: what they let be skipped depends on no view.
        context.correct_opacity = false;
        context.camera = look_at(-axis.direction(), DVec3::ZERO, axis.up())?;
        context.blend = self.blend;
        context.supersampling = Supersampling::new([1, 1, self.slices], Accumulation::Grow)?;
        context.modulation =
            Modulation { opacity: self.modulated, diffuse: self.modulated, specular: self.modulated };
        if self.diffuse {
            let specular = if self.specular { 0.5 } else { 0.0 };
            context.reflection =
                Reflection { emissive: 0.2, diffuse: 0.9, specular, exponent: 24.0, color: [1.0, 0.9, 0.8] };
        }
        if self.cropped {
            let [low, high] = [0.25, 0.75].map(|part| (f64::from(size - 1) * part).round());
            context.crop = Crop { slabs: [[low, high]; 3], flags: Crop::SUB_VOLUME };
        }
        Ok(context)
    }

    /// Brings the context of the frame with this number up to date: tables and lights of three frames in a row differ.
    /// The card has room for two of each table, so that every frame loads all of its own.
    pub fn renew(&self, context: &mut Context, axis: &Axis, frame: u32) -> Result<(), Error> {
        let turn = f64::from(frame % 3);
        context.lookup_table = self.table(turn)?;
        let light = Light::new(axis.direction() + 0.2 * (1.0 + turn) * axis.up(), 1.0);
        context.lights = light.into_iter().collect();
        // No factor is zero: what it makes transparent could be skipped.
        context.gradient_table = core::array::from_fn(|entry| 0.3 + 0.1 * entry as f64 - 0.05 * turn);
        Ok(())
    }

    /// Colours and opacities; those of the greatest value differ by turns.
    fn table(&self, turn: f64) -> Result<LookupTable, Error> {
        let mut color: Vec<_> =
            (0..LOOKUP_ENTRIES).map(|value| [255, (value >> 4) as u8, 200 - (value >> 5) as u8]).collect();
        let mut opacity: Vec<_> =
            (0..LOOKUP_ENTRIES).map(|value| (self.opacity)(value) as f64 / 4095.0).collect();
        if let (Some(color), Some(opacity)) = (color.last_mut(), opacity.last_mut()) {
            color[0] -= turn as u8;
            *opacity *= 1.0 - 0.1 * turn;
        }
        LookupTable::new(color, opacity).ok_or_else(|| Error::failure("a table of the bench is wrong"))
    }
}

/// No value is transparent, and none so opaque that rays finish.
const fn translucent(value: usize) -> usize {
    1 + value / 64
}

/// Bones are opaque, all else is transparent.
fn bones(value: usize) -> usize {
    (value.saturating_sub(1500) * 20).min(4095)
}

/// Air is transparent, tissue almost, bones are not quite opaque.
fn tissue(value: usize) -> usize {
    if value < 200 { 0 } else { (value.saturating_sub(1500) * 2 + 40).min(3500) }
}

impl FromStr for Scene {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = Self::ALL.map(|scene| scene.name).join(", ");
        let found = Self::ALL.into_iter().find(|scene| scene.name == text);
        found.ok_or_else(|| format!("'{text}' is no scene; there are {names}"))
    }
}

/// A direction of view.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// Its name on the command line.
    pub name: &'static str,
    /// Along which rays run, in voxels.
    direction: [f64; 3],
}

impl Axis {
    /// All directions. Rays run a little off their axis, or off the diagonal: samples then lie between voxels.
    pub const ALL: [Self; 7] = [
        Self { name: "+x", direction: [1.0, 0.3, -0.2] },
        Self { name: "-x", direction: [-1.0, 0.3, -0.2] },
        Self { name: "+y", direction: [0.3, 1.0, -0.2] },
        Self { name: "-y", direction: [0.3, -1.0, -0.2] },
        Self { name: "+z", direction: [0.3, -0.2, 1.0] },
        Self { name: "-z", direction: [0.3, -0.2, -1.0] },
        Self { name: "corner", direction: [0.999, 0.999, 1.0] },
    ];
    /// Along z.
    pub const Z: Self = Self::ALL[4];
    /// Along z from voxel to voxel: no interpolation is needed.
    pub const HEAD_ON: Self = Self { name: "head-on", direction: [0.0, 0.0, 1.0] };

    fn direction(&self) -> DVec3 {
        DVec3::from_array(self.direction)
    }

    /// A direction that is far from that of the rays.
    fn up(&self) -> DVec3 {
        if self.direction[1].abs() == 1.0 { DVec3::X } else { DVec3::Y }
    }
}

impl FromStr for Axis {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = Self::ALL.map(|axis| axis.name).join(", ");
        let found = Self::ALL.into_iter().find(|axis| axis.name == text);
        found.ok_or_else(|| format!("'{text}' is no axis; there are {names}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Volume, Voxels};
    use vg500_regs::PlaneFormat;
    use vg500_regs::table::permutation;

    fn volume() -> Volume {
        Volume::new([16; 3], Voxels::Uint8(vec![0; 16 * 16 * 16].into())).unwrap()
    }

    #[test]
    fn axes_are_what_they_are_called() {
        for axis in Axis::ALL {
            let context = NONE.context(&axis, 16).unwrap();
            let view = context.shear_warp(&volume()).unwrap();
            let registers = context.program(&volume(), &view, PlaneFormat::Rgba8);
            let [along, flipped] =
                [permutation::Z_AXIS, permutation::Z_FLIP].map(|field| registers.get(field));
            let name = format!("{}{}", if flipped == 1 { "-" } else { "+" }, ["x", "y", "z"][along as usize]);
            assert_eq!(name, if axis.name == "corner" { "+z" } else { axis.name });
            assert!(view.step().iter().all(|step| step % (1 << 22) != 0), "{}: on voxels", axis.name);
        }
    }

    #[test]
    fn only_two_scenes_are_transparent_anywhere() {
        for scene in Scene::ALL {
            let transparent = (0..LOOKUP_ENTRIES).any(|value| (scene.opacity)(value) == 0);
            assert_eq!(transparent, ["opaque", "thin"].contains(&scene.name), "{}", scene.name);
        }
    }

    #[test]
    fn three_frames_in_a_row_share_no_table() {
        let volume = volume();
        let mut context = FULL.context(&Axis::Z, 16).unwrap();
        let tables = [0, 1, 2].map(|frame| {
            FULL.renew(&mut context, &Axis::Z, frame).unwrap();
            context.tables(&volume, &context.shear_warp(&volume).unwrap()).unwrap()
        });
        let [first, second, third] = &tables;
        assert_eq!(first.len(), 5);
        for ((a, b), c) in first.iter().zip(second).zip(third) {
            assert!(a != b && b != c && a != c, "{a:?}");
        }
    }
}
