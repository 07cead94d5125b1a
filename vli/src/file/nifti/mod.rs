//! NIfTI-1 files (.nii, .nii.gz). Space is right-anterior-superior.
//!
//! The crate `nifti` reads the header; samples are read like those of every other format, because the crate takes as
//! much memory as a header claims.

#[cfg(test)]
mod tests;

use super::layout::{ByteSkip, Encoding, Layout, Meaning};
use super::source::{fill, open_regular};
use super::{ByteOrder, FileError, FileFault, Geometry, ScalarType};
use crate::text::number;
use ::nifti::{Endianness, NiftiHeader};
use flate2::bufread::MultiGzDecoder;
use glam::{DMat3, DQuat, DVec3};
use std::ffi::OsStr;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

/// Bytes of a header.
const HEADER: usize = 348;

/// What a compressed file begins with.
const GZIP: &[u8] = &[0x1f, 0x8b];

/// Whether the first bytes of a file are those of a header that is not compressed.
pub(super) fn is_beginning(bytes: &[u8]) -> bool {
    let size = HEADER as u32;
    bytes.starts_with(&size.to_le_bytes()) || bytes.starts_with(&size.to_be_bytes())
}

/// Whether a file has the name of one.
pub(super) fn is_name(path: &Path) -> bool {
    let name = path.file_name().map(OsStr::to_string_lossy).unwrap_or_default().to_ascii_lowercase();
    name.ends_with(".nii") || name.ends_with(".nii.gz")
}

/// Reads a header, and where the samples are.
pub(super) fn layout(path: &Path) -> Result<Layout, FileError> {
    let (file, _) = open_regular(path)?;
    let mut file = BufReader::new(file);
    let mut read = || {
        let mut bytes = [0; HEADER];
        let compressed = file.fill_buf()?.starts_with(GZIP);
        let found = if compressed {
            let damaged = |error: io::Error| FileFault::Data { encoding: "gzip", what: error.to_string() };
            fill(&mut MultiGzDecoder::new(&mut file), &mut bytes).map_err(damaged)?
        } else {
            fill(&mut file, &mut bytes)?
        };
        if found < HEADER {
            return Err(FileFault::Short { wanted: HEADER as u64, found: found as u64 });
        }
        interpret(&bytes, if compressed { Encoding::Gzip } else { Encoding::Raw })
    };
    read().map_err(|fault: FileFault| fault.of(path))
}

fn interpret(bytes: &[u8; HEADER], encoding: Encoding) -> Result<Layout, FileFault> {
    let header = NiftiHeader::from_reader(bytes.as_slice())
        .map_err(|error| FileFault::field("header", error.to_string()))?;
    if header.sizeof_hdr != HEADER as i32 {
        return Err(FileFault::field("sizeof_hdr", format!("{} is not {HEADER}", header.sizeof_hdr)));
    }
    if &header.magic == b"ni1\0" {
        return Err(FileFault::field("magic", "samples in another file (.img) are not read"));
    }
    let stored = scalar_type(header.datatype)?;
    let order = match header.endianness {
        Endianness::Little => ByteOrder::Little,
        Endianness::Big => ByteOrder::Big,
    };
    let layout = Layout::attached(dimensions(&header)?, stored, order, 0, "dim")?;
    let geometry = geometry(&header)?;
    let description: Vec<u8> = header.descrip.iter().copied().take_while(|byte| *byte != 0).collect();
    let content =
        Some(String::from_utf8_lossy(&description).trim().to_owned()).filter(|text| !text.is_empty());
    let layout = Layout {
        geometry,
        encoding,
        byte_skip: ByteSkip::Bytes(sample_offset(header.vox_offset)?),
        content,
        space: Some("right-anterior-superior".into()),
        ..layout
    };
    let meaning = meaning(&header, stored)?;
    Layout { meaning, ..layout }.with_meanings(&[meaning], "dim")
}

fn scalar_type(code: i16) -> Result<ScalarType, FileFault> {
    match code {
        2 => Ok(ScalarType::Uint8),
        4 => Ok(ScalarType::Int16),
        8 => Ok(ScalarType::Int32),
        16 => Ok(ScalarType::Float32),
        64 => Ok(ScalarType::Float64),
        256 => Ok(ScalarType::Int8),
        512 => Ok(ScalarType::Uint16),
        768 => Ok(ScalarType::Uint32),
        1024 => Ok(ScalarType::Int64),
        1280 => Ok(ScalarType::Uint64),
        other => {
            Err(FileFault::field("datatype", format!("{other} is not a scalar type of at most 64 bits")))
        }
    }
}

/// Three sizes; further axes must have a single sample.
fn dimensions(header: &NiftiHeader) -> Result<[usize; 3], FileFault> {
    let sizes = header.dim().map_err(|error| FileFault::field("dim", error.to_string()))?;
    match *sizes {
        [x, y, z, ref more @ ..] if more.iter().all(|&size| size == 1) => {
            let negative = [x, y, z].into_iter().find(|&size| size > i16::MAX as u16);
            let wrong = |size: u16| FileFault::field("dim", format!("{} samples along an axis", size as i16));
            negative.map_or(Ok([x, y, z].map(usize::from)), |size| Err(wrong(size)))
        }
        [_, _, _, ..] => {
            Err(FileFault::field("dim", "more than three axes have samples, a volume has 3 axes"))
        }
        _ => Err(FileFault::field("dim", format!("{} axes, a volume has 3", sizes.len()))),
    }
}

/// Where samples begin: behind the header and the four bytes that say whether it is extended.
fn sample_offset(offset: f32) -> Result<u64, FileFault> {
    const LEAST: u64 = HEADER as u64 + 4;
    match offset {
        0.0 => Ok(LEAST),
        _ if offset >= LEAST as f32 && offset.fract() == 0.0 && offset < u64::MAX as f32 => Ok(offset as u64),
        _ => {
            Err(FileFault::field("vox_offset", format!("{} is no place for samples", number(offset.into()))))
        }
    }
}

/// A slope of zero, or one that is no number, means that numbers mean themselves.
fn meaning(header: &NiftiHeader, stored: ScalarType) -> Result<Meaning, FileFault> {
    let [slope, intercept] = [header.scl_slope, header.scl_inter].map(f64::from);
    if slope == 0.0 || !slope.is_finite() {
        return Ok(Meaning::itself(stored));
    }
    if !intercept.is_finite() {
        return Err(FileFault::field("scl_inter", format!("{intercept} is not finite")));
    }
    Ok(Meaning { slope, intercept, ..Meaning::itself(stored) })
}

/// The affine map of the header; without one, spacings alone.
fn geometry(header: &NiftiHeader) -> Result<Geometry, FileFault> {
    let millimetres = match header.xyzt_units & 7 {
        1 => 1e3,
        3 => 1e-3,
        _ => 1.0,
    };
    let [_, x, y, z, ..] = header.pixdim.map(|spacing| f64::from(spacing).abs());
    let spacing = DMat3::from_diagonal(DVec3::new(x, y, z));
    let (origin, directions, [directions_name, origin_name]) = if header.sform_code > 0 {
        let rows = [header.srow_x, header.srow_y, header.srow_z].map(|row| row.map(f64::from));
        let column = |column: usize| DVec3::from_array(rows.map(|row| row[column]));
        let directions = DMat3::from_cols(column(0), column(1), column(2));
        (column(3), directions, ["srow_x, srow_y, srow_z"; 2])
    } else if header.qform_code > 0 {
        // The sign of the first spacing says whether the third axis is mirrored.
        let side = if header.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
        let mirror = DMat3::from_diagonal(DVec3::new(1.0, 1.0, side));
        let origin = [header.quatern_x, header.quatern_y, header.quatern_z].map(f64::from);
        let directions = DMat3::from_quat(rotation(header)) * mirror * spacing;
        (origin.into(), directions, ["quatern and pixdim", "quatern_x, quatern_y, quatern_z"])
    } else {
        (DVec3::ZERO, spacing, ["pixdim"; 2])
    };
    let geometry = Geometry { origin: origin * millimetres, directions: directions * millimetres };
    geometry.check(directions_name, origin_name)?;
    Ok(geometry)
}

/// The rotation whose three imaginary parts the header gives. They may be a little too long after rounding.
fn rotation(header: &NiftiHeader) -> DQuat {
    let imaginary = DVec3::from_array([header.quatern_b, header.quatern_c, header.quatern_d].map(f64::from));
    let rest = (1.0 - imaginary.length_squared()).max(0.0).sqrt();
    let DVec3 { x, y, z } = imaginary;
    DQuat::from_xyzw(x, y, z, rest).normalize()
}
