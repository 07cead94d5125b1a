//! How the volume looks: the context that the arguments describe.

use super::arguments::{Blend, Look, Modulated, Switch};
use super::error::Error;
use super::input::Loaded;
use super::lists::{CutPlaneList, LightList, Numbers};
use crate::geometry::{Accumulation, Camera, Supersampling};
use crate::illumination::Light;
use crate::transfer::{Preset, TransferFunction};
use crate::{Context, Crop, Cursor, CutPlane, LookupTable, Modulation, Reflection};
use glam::DVec3;
use vg500_regs::BlendMode;

/// The light where none is asked for: from the viewer.
const LIGHT: LightList = LightList { direction: [0.0, 0.0, -1.0], intensity: 1.0 };

/// Emissive, diffuse and specular coefficients and exponent where no others are asked for.
const MATERIAL: Numbers<4> = Numbers([0.2, 0.9, 0.3, 24.0]);

/// Whether the volume is illuminated.
pub fn is_shaded(look: &Look) -> bool {
    look.shading.map_or(look.blend == Blend::Alpha, |switch| switch == Switch::On)
}

/// The material of an illuminated volume.
pub fn material(look: &Look) -> Numbers<4> {
    look.material.unwrap_or(MATERIAL)
}

/// A transfer function: colour and opacity (0..=1) of data values, per smallest voxel spacing.
pub struct Transfer {
    /// The function.
    pub function: TransferFunction,
    /// The preset that it comes from.
    pub preset: Option<Preset>,
}

/// The transfer function that the arguments ask for. In MIP and MinIP it is opaque: a ray shows its extreme sample.
pub fn transfer(look: &Look, loaded: &Loaded) -> Result<Transfer, Error> {
    let (function, preset) = match (&look.transfer, &look.preset) {
        (Some(path), _) => (TransferFunction::read_csv(path).map_err(Error::input)?, None),
        (None, None) if look.blend != Blend::Alpha => (TransferFunction::grey(loaded.mapping.range()), None),
        (None, preset) => {
            let preset = match preset {
                Some(preset) => *preset,
                None => loaded.natural_preset(),
            };
            (loaded.preset_function(preset), Some(preset))
        }
    };
    let extreme = matches!(look.blend, Blend::Mip | Blend::Minip);
    Ok(Transfer { function: if extreme { function.opaque() } else { function }, preset })
}

/// The context of a frame.
pub fn context(look: &Look, loaded: &Loaded, camera: &Camera, transfer: &Transfer) -> Result<Context, Error> {
    let mut context = Context::new(lookup_table(loaded, transfer)?);
    context.camera = *camera.camera_from_world();
    context.blend = match look.blend {
        Blend::Alpha => BlendMode::Alpha,
        Blend::Mip => BlendMode::Maximum,
        Blend::Minip => BlendMode::Minimum,
        Blend::Sum => BlendMode::Sum,
    };
    context.supersampling = supersampling(look.supersample)?;
    if is_shaded(look) {
        context.reflection = reflection(material(look))?;
        context.lights = lights(&look.light, camera)?;
    }
    let modulates = |what| look.modulate.contains(&what);
    context.modulation = Modulation {
        opacity: modulates(Modulated::Opacity),
        diffuse: modulates(Modulated::Diffuse),
        specular: modulates(Modulated::Specular),
    };
    if let Some(Numbers(table)) = look.gradient_table {
        if !table.iter().all(|value| (0.0..=1.0).contains(value)) {
            return Err(Error::input("--gradient-table: values are 0..1"));
        }
        context.gradient_table = table;
    }
    if let Some(crop) = look.crop {
        context.crop = Crop { slabs: crop.slabs, flags: crop.flags };
    }
    context.cut_plane = look.cut_plane.map(cut_plane).transpose()?;
    if let Some(Numbers(position)) = look.cursor {
        context.cursor = Cursor { enabled: [true; 3], position, ..Cursor::default() };
    }
    Ok(context)
}

fn lookup_table(loaded: &Loaded, transfer: &Transfer) -> Result<LookupTable, Error> {
    let (color, opacity) = transfer.function.entries(&loaded.mapping);
    LookupTable::new(color, opacity).ok_or_else(|| Error::failure("the transfer function leaves 0..1"))
}

fn supersampling(Numbers(factors): Numbers<3>) -> Result<Supersampling, Error> {
    if factors.iter().any(|factor| factor.fract() != 0.0) {
        return Err(Error::input("--supersample: factors are whole numbers"));
    }
    Ok(Supersampling::new(factors.map(|factor| factor as u32), Accumulation::Grow)?)
}

fn reflection(Numbers([emissive, diffuse, specular, exponent]): Numbers<4>) -> Result<Reflection, Error> {
    let coefficients = [emissive, diffuse, specular].iter().all(|value| (0.0..=1.0).contains(value));
    if !coefficients || exponent < 0.0 {
        return Err(Error::input("--material: coefficients are 0..1, the exponent is not negative"));
    }
    Ok(Reflection { diffuse, specular, emissive, exponent, color: [1.0; 3] })
}

/// Lights travel in camera space on the command line, in world space in the library.
fn lights(list: &[LightList], camera: &Camera) -> Result<Vec<Light>, Error> {
    let world_from_camera = camera.camera_from_world().inverse();
    let list = if list.is_empty() { &[LIGHT] } else { list };
    let light = |light: &LightList| {
        let direction = world_from_camera.transform_vector3(DVec3::from_array(light.direction));
        Light::new(direction, light.intensity).ok_or_else(|| Error::input("--light: no usable direction"))
    };
    list.iter().map(light).collect()
}

fn cut_plane(list: CutPlaneList) -> Result<CutPlane, Error> {
    let [a, b, c, d, thickness, falloff] = list.numbers;
    CutPlane::new([a, b, c, d], thickness, falloff, list.outside).ok_or_else(|| {
        Error::input("--cut-plane: the normal is not zero, thickness and falloff are not negative")
    })
}
