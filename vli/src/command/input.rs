//! The volume that the arguments name.

use super::arguments::{Endian, Input, Render};
use super::error::Error;
use super::lists::Numbers;
use super::progress::{Busy, Progress};
use super::statistics::print;
use crate::Volume;
use crate::file::{self, ByteOrder, ScalarVolume, nrrd, raw};
use crate::phantom::Phantom;
use crate::transfer::{Preset, TransferFunction};
use crate::values::{Histogram, ValueMapping};
use std::path::Path;

/// A volume that is ready for the card.
pub struct Loaded {
    /// The volume.
    pub volume: Volume,
    /// How its data values became voxels.
    pub mapping: ValueMapping,
    histogram: Histogram,
    phantom: Option<Phantom>,
}

impl Loaded {
    /// The volume that `render` is asked for.
    pub fn from_arguments(arguments: &Render) -> Result<Self, Error> {
        if let Some(path) = &arguments.volume {
            return Self::new(&mut read(path, &arguments.input)?, &arguments.input, None);
        }
        if arguments.input.raw_shape.is_some() {
            return Err(Error::input("--raw-shape: the file to read is missing"));
        }
        let phantom = arguments.phantom.unwrap_or(Phantom::ALL[0]);
        let mut volume = compute(phantom, arguments.phantom_size)?;
        Self::new(&mut volume, &arguments.input, Some(phantom))
    }

    fn new(data: &mut ScalarVolume, input: &Input, phantom: Option<Phantom>) -> Result<Self, Error> {
        if let Some(replacement) = input.nan {
            data.replace_not_finite(replacement);
        }
        let range = input.range.map(|Numbers(range)| range);
        let mapping = ValueMapping::new(data, range).map_err(Error::input)?;
        let voxels = mapping.voxels(data);
        let histogram = Histogram::new(&voxels);
        let size = data.dimensions().map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        let mut volume = Volume::new(size, voxels).map_err(Error::input)?;
        volume.set_model_matrix(&data.geometry().world_from_voxel()).map_err(Error::input)?;
        Ok(Self { volume, mapping, histogram, phantom })
    }

    /// The preset that suits the volume.
    pub fn natural_preset(&self) -> Preset {
        match self.phantom {
            Some(phantom) => phantom.preset(),
            None => Preset::automatic(&self.mapping, &self.histogram),
        }
    }

    /// The transfer function that a preset makes for the volume.
    pub fn preset_function(&self, preset: Preset) -> TransferFunction {
        preset.function(&self.mapping, &self.histogram)
    }
}

fn compute(phantom: Phantom, size: usize) -> Result<ScalarVolume, Error> {
    let _busy = Busy::new("computing the phantom");
    phantom.volume([size; 3]).map_err(Error::input)
}

/// Reads a volume file, with or without header.
fn read(path: &Path, input: &Input) -> Result<ScalarVolume, Error> {
    let mut progress = Progress::new("reading");
    let mut update = |done, total| progress.update(done, total);
    let volume = match (input.raw_shape, &input.raw_type) {
        (Some(shape), Some(scalar)) => {
            let description = raw_description(shape, scalar, input)?;
            raw::read(path, &description, &mut update)
        }
        _ => file::open(path, &mut update),
    };
    let volume = volume.map_err(Error::input)?;
    volume.remarks.iter().for_each(|remark| eprintln!("{}: {remark}", path.display()));
    Ok(volume)
}

fn raw_description(
    Numbers(shape): Numbers<3>,
    scalar: &str,
    input: &Input,
) -> Result<raw::RawDescription, Error> {
    if shape.iter().any(|size| size.fract() != 0.0 || *size < 1.0) {
        return Err(Error::input("--raw-shape: sizes are whole numbers from 1 on"));
    }
    Ok(raw::RawDescription {
        dimensions: shape.map(|size| size as usize),
        scalar: scalar.parse().map_err(|error| Error::input(format!("--raw-type {error}")))?,
        order: match input.raw_endian {
            Endian::Little => ByteOrder::Little,
            Endian::Big => ByteOrder::Big,
        },
        spacing: input.raw_spacing.0,
    })
}

/// `volumepro info`.
pub fn info(path: &Path, input: &Input) -> Result<(), Error> {
    let mut data = read(path, input)?;
    let loaded = Loaded::new(&mut data, input, None)?;
    let [x, y, z] = data.dimensions();
    let geometry = data.geometry();
    let directions = [geometry.directions.x_axis, geometry.directions.y_axis, geometry.directions.z_axis];
    let spacing = geometry.spacing();
    let bytes = vg500_regs::memory::volume_bytes(loaded.volume.size(), loaded.volume.voxels().format());
    let mut lines = vec![
        ("dimensions", format!("{x} x {y} x {z}")),
        ("type", data.samples().scalar_type().to_string()),
        ("spacing", format!("{} x {} x {} mm", spacing[0], spacing[1], spacing[2])),
        ("origin", geometry.origin.to_string()),
        ("x axis", directions[0].to_string()),
        ("y axis", directions[1].to_string()),
        ("z axis", directions[2].to_string()),
    ];
    lines.extend(data.space.clone().map(|space| ("space", space)));
    lines.extend(data.content.clone().map(|content| ("content", content)));
    lines.push(("voxels", loaded.mapping.to_string()));
    lines.push(("preset", loaded.natural_preset().to_string()));
    lines.push(("on board", format!("{bytes} bytes, padding included")));
    let text: String = lines.iter().map(|(name, value)| format!("{name:10}  {value}\n")).collect();
    print(&text)
}

/// `volumepro phantom`.
pub fn write_phantom(phantom: Phantom, size: usize, output: &Path) -> Result<(), Error> {
    let volume = compute(phantom, size)?;
    let _busy = Busy::new("writing");
    nrrd::write(output, &volume, nrrd::Compression::Gzip).map_err(Error::failure)
}
