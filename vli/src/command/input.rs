//! The volume that the arguments name.

use super::arguments::{Endian, Input, Render};
use super::error::Error;
use super::lists::Numbers;
use super::messages::{print, remark};
use super::progress::{Busy, Progress};
use super::refusals;
use super::render::check_output;
use crate::Volume;
use crate::file::{ByteOrder, ScalarVolume, VolumeFile, nrrd, raw};
use crate::phantom::Phantom;
use crate::text::{number, one_line};
use crate::transfer::{Preset, TransferFunction};
use crate::values::{Histogram, ValueMapping};
use std::path::Path;
use vg500_regs::limit::VOLUME_SIZE;

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
    /// The volume that `render` is asked for. One that cannot be rendered is refused before it is read.
    pub fn from_arguments(arguments: &Render) -> Result<Self, Error> {
        if let Some(path) = &arguments.volume {
            let file = open(path, &arguments.input)?;
            check_size(&path.display().to_string(), file.dimensions(), "crop or resample the volume")?;
            return Self::new(&mut read(path, &file)?, &arguments.input, None);
        }
        let phantom = arguments.phantom.unwrap_or(Phantom::ALL[0]);
        check_size("--phantom-size", [arguments.phantom_size; 3], "take a smaller phantom")?;
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

/// Refuses what is larger than the card renders in one pass.
fn check_size(what: &str, dimensions: [usize; 3], advice: &str) -> Result<(), Error> {
    if !is_too_large(dimensions) {
        return Ok(());
    }
    let [x, y, z] = dimensions;
    Err(Error::input(format!(
        "{what}: {x} x {y} x {z} voxels; more than {VOLUME_SIZE} along an axis are not served yet: {advice}"
    )))
}

fn is_too_large(dimensions: [usize; 3]) -> bool {
    dimensions.iter().any(|&size| size > VOLUME_SIZE as usize)
}

/// Reads the header of a volume file, if it has one.
fn open(path: &Path, input: &Input) -> Result<VolumeFile, Error> {
    let file = match raw_description(input)? {
        Some(description) => VolumeFile::raw(path, &description),
        None => VolumeFile::open(path),
    };
    let file = file.map_err(Error::input)?;
    match input.nan.filter(|&replacement| !file.scalar_type().reaches(replacement)) {
        Some(replacement) => {
            let (replacement, scalar) = (number(replacement), file.scalar_type());
            Err(Error::input(format!(
                "--nan {replacement}: is infinite as {scalar}, which the samples of {} are",
                path.display()
            )))
        }
        None => Ok(file),
    }
}

/// Reads the samples of a volume file.
fn read(path: &Path, file: &VolumeFile) -> Result<ScalarVolume, Error> {
    let mut progress = Progress::new("reading");
    let volume = file.read(&mut |done, total| progress.update(done, total)).map_err(Error::input)?;
    drop(progress);
    remark(path, &volume.remarks);
    Ok(volume)
}

/// What the arguments say of a file without header, if it is one.
fn raw_description(input: &Input) -> Result<Option<raw::RawDescription>, Error> {
    let (Some(Numbers(shape)), Some(scalar)) = (input.raw_shape, input.raw_type) else { return Ok(None) };
    if shape.iter().any(|size| size.fract() != 0.0 || *size < 1.0) {
        return Err(Error::input("--raw-shape: sizes are whole numbers from 1 on"));
    }
    Ok(Some(raw::RawDescription {
        dimensions: shape.map(|size| size as usize),
        scalar,
        order: match input.raw_endian.unwrap_or(Endian::Little) {
            Endian::Little => ByteOrder::Little,
            Endian::Big => ByteOrder::Big,
        },
        spacing: input.raw_spacing.map_or([1.0; 3], |Numbers(spacing)| spacing),
    }))
}

/// `volumepro info`.
pub fn info(path: &Path, input: &Input) -> Result<(), Error> {
    refusals::input(input, true)?;
    let mut data = read(path, &open(path, input)?)?;
    let loaded = Loaded::new(&mut data, input, None)?;
    let [x, y, z] = data.dimensions();
    let geometry = data.geometry();
    let vector = |numbers: [f64; 3]| numbers.map(number).join(", ");
    let [x_axis, y_axis, z_axis] = geometry.directions.to_cols_array_2d().map(vector);
    let bytes = vg500_regs::memory::volume_bytes(loaded.volume.size(), loaded.volume.voxels().format());
    let mut lines = vec![
        ("dimensions", format!("{x} x {y} x {z}")),
        ("type", data.samples().scalar_type().to_string()),
        ("spacing", format!("{} mm", geometry.spacing().map(number).join(" x "))),
        ("origin", vector(geometry.origin.to_array())),
        ("x axis", x_axis),
        ("y axis", y_axis),
        ("z axis", z_axis),
    ];
    lines.extend(data.space.clone().map(|space| ("space", space)));
    lines.extend(data.content.clone().map(|content| ("content", content)));
    lines.push(("voxels", loaded.mapping.to_string()));
    lines.push(("preset", loaded.natural_preset().to_string()));
    lines.push(("on board", format!("{bytes} bytes, padding included")));
    if is_too_large(data.dimensions()) {
        lines.push(("render", format!("not yet: more than {VOLUME_SIZE} voxels along an axis")));
    }
    let text: String =
        lines.iter().map(|(name, value)| format!("{name:10}  {}\n", one_line(value))).collect();
    print(&text)
}

/// `volumepro phantom`.
pub fn write_phantom(phantom: Phantom, size: usize, output: &Path) -> Result<(), Error> {
    check_output(output)?;
    let volume = compute(phantom, size)?;
    let _busy = Busy::new("writing");
    nrrd::write(output, &volume, nrrd::Compression::Gzip).map_err(Error::failure)
}
