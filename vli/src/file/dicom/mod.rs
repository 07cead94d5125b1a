//! A folder with the images of a DICOM series, one slice in each file. Space is left-posterior-superior.
//!
//! The crate `dicom-parser` reads attributes one by one; how much memory one may take is decided here. Pixels are read
//! like the samples of every other format.

mod image;
#[cfg(test)]
mod tests;

use super::layout::{Data, Layout, Meaning, Slice};
use super::{FileError, FileFault, Geometry};
use crate::text::number;
use glam::{DMat3, DVec3};
use image::Image;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Most files of a folder.
const MAXIMUM_FILES: usize = 1 << 16;

/// How far a slice may lie from where equal spacing puts it, in parts of the spacing and in millimetres: positions are
/// written as rounded decimal numbers.
const TOLERANCE: f64 = 0.01;

/// Reads the attributes of all images in a folder.
pub(super) fn layout(folder: &Path) -> Result<Layout, FileError> {
    let mut images = Vec::new();
    let mut others = 0_usize;
    for path in files(folder).map_err(|error| FileFault::from(error).of(folder))? {
        match image::read(&path)? {
            Some(image) => images.push(image),
            None => others += 1,
        }
    }
    let (first, rest) = images.split_first().ok_or_else(|| FileFault::NoImages.of(folder))?;
    for image in rest {
        agree(first, image).map_err(|fault| fault.of(&image.path))?;
    }
    let mut layout = stack(images).map_err(|(path, fault)| fault.of(&path))?;
    if others > 0 {
        layout.remarks.push(format!("{others} files are no DICOM images; ignored"));
    }
    Ok(layout)
}

/// The files of a folder, by name, so that every run reads the same.
fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_file() {
            files.push(path);
        }
        if files.len() > MAXIMUM_FILES {
            return Err(io::Error::other(format!("there are more than {MAXIMUM_FILES} files")));
        }
    }
    files.sort();
    Ok(files)
}

/// Refuses an image that belongs to another volume than the first one.
fn agree(first: &Image, image: &Image) -> Result<(), FileFault> {
    let (one, other) = (&first.common, &image.common);
    let differ =
        |field| Err(FileFault::field(field, format!("differs from that of {}", first.path.display())));
    match () {
        () if one.series != other.series => Err(FileFault::field(
            "SeriesInstanceUID",
            format!("differs from that of {}; a folder holds one series", first.path.display()),
        )),
        () if one.size != other.size => differ("Rows or Columns"),
        () if (one.stored, one.bits) != (other.stored, other.bits) => {
            differ("BitsAllocated, BitsStored or sign")
        }
        () if one.order != other.order => differ("TransferSyntaxUID"),
        () if one.spacing != other.spacing => differ("PixelSpacing"),
        () if !near(&one.orientation, &other.orientation) => differ("ImageOrientationPatient"),
        () => Ok(()),
    }
}

fn near(one: &[f64; 6], other: &[f64; 6]) -> bool {
    one.iter().zip(other).all(|(one, other)| (one - other).abs() < 1e-4)
}

/// Puts images that agree in order, first along the axis that columns and rows make right-handed.
fn stack(mut images: Vec<Image>) -> Result<Layout, (PathBuf, FileFault)> {
    let Some(first) = images.first().cloned() else { return Err((PathBuf::new(), FileFault::NoImages)) };
    let of_first = |fault| (first.path.clone(), fault);
    let [xx, xy, xz, yx, yy, yz] = first.common.orientation;
    let (along_columns, along_rows) = (DVec3::new(xx, xy, xz), DVec3::new(yx, yy, yz));
    let normal = along_columns.cross(along_rows);
    let height = |image: &Image| normal.dot(image.position.into());
    images.sort_by(|one, other| height(one).total_cmp(&height(other)));
    let step = step(&images, normal)?;
    let [column_spacing, row_spacing] = first.common.spacing;
    let origin = images.first().map_or(DVec3::ZERO, |image| image.position.into());
    let directions = DMat3::from_cols(along_columns * column_spacing, along_rows * row_spacing, step);
    let geometry = Geometry { origin, directions };
    geometry
        .check("PixelSpacing and ImageOrientationPatient", "ImagePositionPatient")
        .map_err(|error| of_first(error.into()))?;
    let common = &first.common;
    let slice = |image: Image| {
        let [slope, intercept] = image.rescale;
        Slice {
            path: image.path,
            offset: image.offset,
            meaning: Meaning { bits: common.bits, slope, intercept },
        }
    };
    let description = first.description.clone();
    let slices: Vec<Slice> = images.into_iter().map(slice).collect();
    let meanings: Vec<Meaning> = slices.iter().map(|slice| slice.meaning).collect();
    let [columns, rows] = common.size;
    let dimensions = [columns, rows, slices.len()];
    Layout::attached(dimensions, common.stored, common.order, 0, "Rows and Columns")
        .and_then(|layout| layout.with_meanings(&meanings, "Rows and Columns"))
        .map(|layout| Layout {
            geometry,
            data: Data::Slices(slices),
            content: description,
            space: Some("left-posterior-superior".into()),
            ..layout
        })
        .map_err(of_first)
}

/// The step from slice to slice, which must be the same everywhere. Slices may be sheared against each other, as by a
/// tilted gantry.
fn step(images: &[Image], normal: DVec3) -> Result<DVec3, (PathBuf, FileFault)> {
    let position = |image: &Image| DVec3::from_array(image.position);
    let (Some(first), Some(last)) = (images.first(), images.last()) else { return Ok(normal) };
    if images.len() == 1 {
        return Ok(normal.normalize_or_zero() * first.thickness.filter(|it| *it > 0.0).unwrap_or(1.0));
    }
    let step = (position(last) - position(first)) / (images.len() - 1) as f64;
    let spacing = step.length();
    let fault = |image: &Image, what: String| {
        Err((image.path.clone(), FileFault::field("ImagePositionPatient", what)))
    };
    for (index, image) in images.iter().enumerate() {
        let away = (position(first) + step * index as f64 - position(image)).length();
        if !away.is_finite() || away > TOLERANCE.max(TOLERANCE * spacing) {
            let [away, spacing] = [away, spacing].map(|distance| number((distance * 1e3).round() / 1e3));
            let what = format!(
                "slice {} of {} lies {away} mm from where spacing {spacing} mm puts it: one is missing, or slices \
                 are not equally spaced",
                index + 1,
                images.len()
            );
            return fault(image, what);
        }
    }
    if spacing < TOLERANCE {
        return fault(last, format!("is that of {} too", first.path.display()));
    }
    Ok(step)
}
