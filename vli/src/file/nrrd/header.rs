//! What a header says, checked.

use super::super::source::check_size;
use super::super::{ByteOrder, FileFault, ScalarType};
use super::axes::Axes;
use super::data_files::DataFiles;
use super::fields::Fields;
use std::io::BufRead;

/// How samples are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// As in memory.
    Raw,
    /// As in memory, compressed.
    Gzip,
    /// As in memory, two hexadecimal digits to a byte.
    Hex,
    /// As decimal numbers.
    Text,
}

impl Encoding {
    fn new(text: &str) -> Result<Self, String> {
        match text.to_ascii_lowercase().as_str() {
            "raw" => Ok(Self::Raw),
            "gzip" | "gz" => Ok(Self::Gzip),
            "hex" => Ok(Self::Hex),
            "text" | "txt" | "ascii" => Ok(Self::Text),
            "bzip2" | "bz2" => Err("bzip2 is not supported; raw, gzip, hex and text are".into()),
            _ => Err(format!("'{text}' is not one of raw, gzip, hex and text")),
        }
    }

    /// The name in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Gzip => "gzip",
            Self::Hex => "hex",
            Self::Text => "text",
        }
    }
}

/// What comes before the samples in a data file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteSkip {
    /// So many bytes; of decompressed data with gzip.
    Bytes(u64),
    /// All but the samples, which are at the end of the file.
    ToSamplesAtEnd,
}

/// Where the samples are.
#[derive(Debug, PartialEq)]
pub enum Data {
    /// In the header's file, from this byte on.
    Attached(u64),
    /// In other files, so many samples in each.
    Detached(DataFiles, usize),
}

/// What a header says, of a volume that can be read as far as the header tells.
#[derive(Debug)]
pub struct Header {
    /// Type of the samples.
    pub scalar: ScalarType,
    /// Samples of the volume.
    pub count: usize,
    /// Axes and geometry.
    pub axes: Axes,
    /// How samples are written.
    pub encoding: Encoding,
    /// Order of the bytes of a sample.
    pub order: ByteOrder,
    /// Lines to skip at the beginning of each file of samples.
    pub line_skip: u64,
    /// Bytes to skip behind them.
    pub byte_skip: ByteSkip,
    /// Where the samples are.
    pub data: Data,
    /// What the volume shows.
    pub content: Option<String>,
    /// Name of the space.
    pub space: Option<String>,
    /// What the reader ignored.
    pub remarks: Vec<String>,
}

impl Header {
    /// Reads a header up to its end, which the samples may follow.
    pub fn read(reader: &mut dyn BufRead) -> Result<Self, FileFault> {
        let fields = Fields::read(reader)?;
        let axes = Axes::new(&fields)?;
        let scalar: ScalarType = parse(&fields, "type")?;
        let count = check_size(&axes.sizes, scalar, "sizes")?;
        let encoding =
            Encoding::new(fields.require("encoding")?).map_err(|what| FileFault::field("encoding", what))?;
        let ordered = scalar.bytes() == 1 || encoding == Encoding::Text;
        let order = if ordered { ByteOrder::Little } else { parse(&fields, "endian")? };
        Ok(Self {
            scalar,
            count,
            encoding,
            order,
            line_skip: line_skip(&fields)?,
            byte_skip: byte_skip(&fields, encoding)?,
            data: data(&fields, &axes)?,
            content: text(&fields, "content"),
            space: text(&fields, "space").map(space_name),
            axes,
            remarks: fields.remarks,
        })
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
    match DataFiles::new(fields, &axes.sizes)? {
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
