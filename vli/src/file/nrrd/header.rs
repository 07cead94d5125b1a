//! What a header says, checked.

use super::super::layout::{ByteSkip, Data, Encoding, Layout};
use super::super::source::check_size;
use super::super::{ByteOrder, FileFault, ScalarType};
use super::axes::Axes;
use super::data_files;
use super::fields::Fields;
use std::io::BufRead;

/// Reads a header up to its end, which the samples may follow.
pub fn read(reader: &mut dyn BufRead) -> Result<Layout, FileFault> {
    let fields = Fields::read(reader)?;
    let axes = Axes::new(&fields)?;
    let scalar: ScalarType = parse(&fields, "type")?;
    check_size(&axes.sizes, scalar, "sizes")?;
    let encoding =
        encoding(fields.require("encoding")?).map_err(|what| FileFault::field("encoding", what))?;
    let ordered = scalar.bytes() == 1 || encoding == Encoding::Text;
    let order = if ordered { ByteOrder::Little } else { parse(&fields, "endian")? };
    let layout = Layout::attached(axes.dimensions, scalar, order, 0, "sizes")?;
    Ok(Layout {
        geometry: axes.geometry,
        encoding,
        line_skip: line_skip(&fields)?,
        byte_skip: byte_skip(&fields, encoding)?,
        data: data(&fields, &axes)?,
        content: text(&fields, "content"),
        space: text(&fields, "space").map(space_name),
        remarks: fields.remarks,
        ..layout
    })
}

fn encoding(text: &str) -> Result<Encoding, String> {
    match text.to_ascii_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "gzip" | "gz" => Ok(Encoding::Gzip),
        "hex" => Ok(Encoding::Hex),
        "text" | "txt" | "ascii" => Ok(Encoding::Text),
        "bzip2" | "bz2" => Err("bzip2 is not supported; raw, gzip, hex and text are".into()),
        _ => Err(format!("'{text}' is not one of raw, gzip, hex and text")),
    }
}

fn parse<T: std::str::FromStr<Err = String>>(fields: &Fields, name: &'static str) -> Result<T, FileFault> {
    fields.require(name)?.parse().map_err(|what: String| FileFault::field(name, what))
}

fn text(fields: &Fields, name: &'static str) -> Option<String> {
    fields.get(name).filter(|text| !text.is_empty()).map(str::to_owned)
}

fn line_skip(fields: &Fields) -> Result<u64, FileFault> {
    let text = fields.get("line skip").unwrap_or("0");
    text.parse().map_err(|_| FileFault::field("line skip", format!("'{text}' is not a number of lines")))
}

fn byte_skip(fields: &Fields, encoding: Encoding) -> Result<ByteSkip, FileFault> {
    let text = fields.get("byte skip").unwrap_or("0");
    let wrong = |what: &str| Err(FileFault::field("byte skip", format!("'{text}' {what}")));
    match (text, text.parse()) {
        ("-1", _) if encoding == Encoding::Raw => Ok(ByteSkip::ToSamplesAtEnd),
        ("-1", _) => wrong("needs encoding raw"),
        (_, Ok(bytes)) => Ok(ByteSkip::Bytes(bytes)),
        _ => wrong("is neither a number of bytes nor -1"),
    }
}

fn data(fields: &Fields, axes: &Axes) -> Result<Data, FileFault> {
    match data_files::of(fields, &axes.sizes)? {
        Some((files, samples)) => Ok(Data::Detached(files, samples)),
        None if fields.ended => Ok(Data::Attached(fields.length)),
        None => Err(FileFault::field("data file", "is missing, and no empty line ends the header")),
    }
}

/// The long name of a space that the format also lets one abbreviate.
fn space_name(name: String) -> String {
    match name.as_str() {
        "RAS" => "right-anterior-superior".into(),
        "LAS" => "left-anterior-superior".into(),
        "LPS" => "left-posterior-superior".into(),
        _ => name,
    }
}
