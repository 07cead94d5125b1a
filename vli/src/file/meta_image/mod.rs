//! MetaImage files (.mha, .mhd), as the documentation of MetaIO describes them.
//!
//! Read are volumes of scalars: samples behind the header or in files of their own, one or many; as they are in
//! memory, compressed by zlib, or as text; every scalar type; both byte orders. Space is left-posterior-superior.

mod fields;
#[cfg(test)]
mod tests;

use super::data_files::{DataFiles, numbered, samples_per_file};
use super::layout::{ByteSkip, Data, Encoding, Layout};
use super::source::open_regular;
use super::{ByteOrder, FileError, FileFault, Geometry, ScalarType};
use fields::Fields;
use glam::{DMat3, DVec3};
use std::io::BufReader;
use std::path::Path;

/// What a file often begins with.
pub(super) const MAGIC: &[u8] = b"ObjectTy";

const DIMENSIONS: &str = "DimSize";
const TYPE: &str = "ElementType";
const FILE: &str = "ElementDataFile";
const SKIP: &str = "HeaderSize";
const COMPRESSED: &str = "CompressedData";
/// Fields with several names, the usual one first.
const MATRIX: [&str; 3] = ["TransformMatrix", "Rotation", "Orientation"];
const OFFSET: [&str; 3] = ["Offset", "Position", "Origin"];
const SPACING: [&str; 2] = ["ElementSpacing", "ElementSize"];
const ORDER: [&str; 2] = ["BinaryDataByteOrderMSB", "ElementByteOrderMSB"];

/// Reads the header of a MetaImage file, and where its samples are.
pub(super) fn layout(path: &Path) -> Result<Layout, FileError> {
    let (file, _) = open_regular(path)?;
    let layout = || interpret(&Fields::read(&mut BufReader::new(file), FILE)?);
    layout().map_err(|fault| fault.of(path))
}

fn interpret(fields: &Fields) -> Result<Layout, FileFault> {
    if let Some(other) = fields.get("ObjectType").filter(|name| !name.eq_ignore_ascii_case("image")) {
        return Err(FileFault::field("ObjectType", format!("'{other}' is not Image")));
    }
    if let Some(channels) = fields.get("ElementNumberOfChannels").filter(|channels| *channels != "1") {
        let what = format!("{channels} values per voxel; only scalars can be rendered");
        return Err(FileFault::field("ElementNumberOfChannels", what));
    }
    let stored = scalar_type(fields.require(TYPE)?).map_err(|what| FileFault::field(TYPE, what))?;
    let order = if flag(fields, &ORDER)? { ByteOrder::Big } else { ByteOrder::Little };
    let dimensions = dimensions(fields)?;
    let layout = Layout::attached(dimensions, stored, order, fields.length, DIMENSIONS)?;
    let encoding = encoding(fields)?;
    Ok(Layout {
        geometry: geometry(fields)?,
        encoding,
        byte_skip: byte_skip(fields, encoding)?,
        data: data(fields, dimensions)?,
        content: fields.get("Comment").filter(|text| !text.is_empty()).map(str::to_owned),
        space: Some("left-posterior-superior".into()),
        ..layout
    })
}

/// The type that MetaIO names; its long integers have 32 bits on every machine.
fn scalar_type(name: &str) -> Result<ScalarType, String> {
    match name {
        "MET_CHAR" => Ok(ScalarType::Int8),
        "MET_UCHAR" => Ok(ScalarType::Uint8),
        "MET_SHORT" => Ok(ScalarType::Int16),
        "MET_USHORT" => Ok(ScalarType::Uint16),
        "MET_INT" | "MET_LONG" => Ok(ScalarType::Int32),
        "MET_UINT" | "MET_ULONG" => Ok(ScalarType::Uint32),
        "MET_LONG_LONG" => Ok(ScalarType::Int64),
        "MET_ULONG_LONG" => Ok(ScalarType::Uint64),
        "MET_FLOAT" => Ok(ScalarType::Float32),
        "MET_DOUBLE" => Ok(ScalarType::Float64),
        other => Err(format!("'{other}' is not a scalar type")),
    }
}

/// Whether one of the fields says `True`.
fn flag(fields: &Fields, names: &[&'static str]) -> Result<bool, FileFault> {
    match fields.first(names) {
        None => Ok(false),
        Some((name, text)) => match text.to_ascii_lowercase().as_str() {
            "true" | "1" => Ok(true),
            "false" | "0" => Ok(false),
            _ => Err(FileFault::field(name, format!("'{text}' is neither True nor False"))),
        },
    }
}

/// Three sizes; a fourth axis must have a single sample.
fn dimensions(fields: &Fields) -> Result<[usize; 3], FileFault> {
    let text = fields.require("NDims")?;
    let axes: usize = match text {
        "3" => 3,
        "4" => 4,
        _ => return Err(FileFault::field("NDims", format!("'{text}' axes, a volume has 3"))),
    };
    let sizes: Vec<usize> = fields.numbers(DIMENSIONS, axes)?.ok_or_else(|| fields::missing(DIMENSIONS))?;
    match sizes[..] {
        [x, y, z] | [x, y, z, 1] => Ok([x, y, z]),
        _ => Err(FileFault::field("NDims", "the fourth axis has more than one sample, a volume has 3 axes")),
    }
}

fn encoding(fields: &Fields) -> Result<Encoding, FileFault> {
    let binary = fields.get("BinaryData").is_none() || flag(fields, &["BinaryData"])?;
    match (binary, flag(fields, &[COMPRESSED])?) {
        (true, false) => Ok(Encoding::Raw),
        (true, true) => Ok(Encoding::Zlib),
        (false, false) => Ok(Encoding::Text),
        (false, true) => Err(FileFault::field(COMPRESSED, "is True, but BinaryData is not")),
    }
}

fn byte_skip(fields: &Fields, encoding: Encoding) -> Result<ByteSkip, FileFault> {
    let text = fields.get(SKIP).unwrap_or("0");
    match (text, text.parse()) {
        ("0", _) => Ok(ByteSkip::Bytes(0)),
        (_, _) if encoding != Encoding::Raw => {
            Err(FileFault::field(SKIP, format!("'{text}' with samples that are compressed or text")))
        }
        ("-1", _) => Ok(ByteSkip::ToSamplesAtEnd),
        (_, Ok(bytes)) => Ok(ByteSkip::Bytes(bytes)),
        _ => Err(FileFault::field(SKIP, format!("'{text}' is neither a number of bytes nor -1"))),
    }
}

fn geometry(fields: &Fields) -> Result<Geometry, FileFault> {
    let three = |names: &[&'static str], default: [f64; 3]| -> Result<DVec3, FileFault> {
        let Some((name, _)) = fields.first(names) else { return Ok(default.into()) };
        let numbers: Option<Vec<f64>> = fields.numbers_of_space(name)?;
        Ok(numbers.map_or(default.into(), |numbers| DVec3::from_slice(&numbers)))
    };
    let spacing = three(&SPACING, [1.0; 3])?;
    let directions = match fields.first(&MATRIX) {
        None => DMat3::IDENTITY,
        Some((name, _)) => fields.matrix(name)?,
    };
    let geometry = Geometry {
        origin: three(&OFFSET, [0.0; 3])?,
        directions: directions * DMat3::from_diagonal(spacing),
    };
    geometry.check("TransformMatrix x ElementSpacing", OFFSET[0])?;
    Ok(geometry)
}

fn data(fields: &Fields, dimensions: [usize; 3]) -> Result<Data, FileFault> {
    let text = fields.require(FILE)?;
    let words: Vec<&str> = text.split_whitespace().collect();
    let numbers: Option<Vec<i64>> = words.iter().skip(1).map(|word| word.parse().ok()).collect();
    let (files, dimension) = match (words.first(), numbers.as_deref()) {
        (None, _) => return Err(FileFault::field(FILE, "is empty")),
        (Some(&"LOCAL" | &"Local" | &"local"), _) => return Ok(Data::Attached(fields.length)),
        (Some(&"LIST"), Some([])) => (DataFiles::List(fields.list.clone()), 2),
        (Some(&"LIST"), Some(&[dimension])) => {
            (DataFiles::List(fields.list.clone()), usize::try_from(dimension).unwrap_or(0))
        }
        (Some(pattern), Some(&[first, last, ref step @ ..])) if pattern.contains('%') && step.len() < 2 => {
            let step = step.first().copied().unwrap_or(1);
            (numbered(pattern, first, last, step).map_err(|what| FileFault::field(FILE, what))?, 2)
        }
        _ => return Ok(Data::Detached(DataFiles::One(text.to_owned()), dimensions.iter().product())),
    };
    let samples = samples_per_file(files.count(), dimension, &dimensions);
    let wrong = || FileFault::field(FILE, format!("{} files do not make up all samples", files.count()));
    let samples = samples.ok_or_else(wrong)?;
    Ok(Data::Detached(files, samples))
}
