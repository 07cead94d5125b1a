//! One file of a series: what it says of its image, and where the pixels are.

use super::super::source::open_regular;
use super::super::{ByteOrder, FileError, FileFault, ScalarType};
use crate::text::shorten;
use dicom_core::Tag;
use dicom_core::header::Header;
use dicom_parser::dataset::LazyDataToken;
use dicom_parser::dataset::lazy_read::LazyDataSetReader;
use dicom_parser::{DynStatefulDecoder, StatefulDecode};
use dicom_transfer_syntax_registry::{TransferSyntax, TransferSyntaxIndex, TransferSyntaxRegistry, entries};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Most bytes of an attribute that is read.
const MAXIMUM_VALUE: u32 = 1024;

/// What stands in front of all attributes.
const PREAMBLE: u64 = 128;
const MAGIC: &[u8] = b"DICM";

/// An attribute: its tag, and its name in messages.
type Attribute = (Tag, &'static str);

const TRANSFER_SYNTAX: Attribute = (Tag(0x0002, 0x0010), "TransferSyntaxUID");
const DESCRIPTION: Attribute = (Tag(0x0008, 0x103e), "SeriesDescription");
const THICKNESS: Attribute = (Tag(0x0018, 0x0050), "SliceThickness");
const SERIES: Attribute = (Tag(0x0020, 0x000e), "SeriesInstanceUID");
const POSITION: Attribute = (Tag(0x0020, 0x0032), "ImagePositionPatient");
const ORIENTATION: Attribute = (Tag(0x0020, 0x0037), "ImageOrientationPatient");
const CHANNELS: Attribute = (Tag(0x0028, 0x0002), "SamplesPerPixel");
const FRAMES: Attribute = (Tag(0x0028, 0x0008), "NumberOfFrames");
const ROWS: Attribute = (Tag(0x0028, 0x0010), "Rows");
const COLUMNS: Attribute = (Tag(0x0028, 0x0011), "Columns");
const SPACING: Attribute = (Tag(0x0028, 0x0030), "PixelSpacing");
const ALLOCATED: Attribute = (Tag(0x0028, 0x0100), "BitsAllocated");
const STORED: Attribute = (Tag(0x0028, 0x0101), "BitsStored");
const HIGH: Attribute = (Tag(0x0028, 0x0102), "HighBit");
const SIGNED: Attribute = (Tag(0x0028, 0x0103), "PixelRepresentation");
const INTERCEPT: Attribute = (Tag(0x0028, 0x1052), "RescaleIntercept");
const SLOPE: Attribute = (Tag(0x0028, 0x1053), "RescaleSlope");
const PIXELS: Attribute = (Tag(0x7fe0, 0x0010), "PixelData");

/// The attributes that are read; all others are skipped.
const READ: [Attribute; 17] = [
    TRANSFER_SYNTAX,
    DESCRIPTION,
    THICKNESS,
    SERIES,
    POSITION,
    ORIENTATION,
    CHANNELS,
    FRAMES,
    ROWS,
    COLUMNS,
    SPACING,
    ALLOCATED,
    STORED,
    HIGH,
    SIGNED,
    INTERCEPT,
    SLOPE,
];

/// What the slices of a volume have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Common {
    /// Which series the image belongs to.
    pub series: String,
    /// Columns and rows.
    pub size: [usize; 2],
    /// Type of the stored numbers.
    pub stored: ScalarType,
    /// How many of their low bits count.
    pub bits: u32,
    /// Order of their bytes.
    pub order: ByteOrder,
    /// Directions in which columns and rows follow each other.
    pub orientation: [f64; 6],
    /// Millimetres between columns, and between rows.
    pub spacing: [f64; 2],
}

/// An image.
#[derive(Clone, Debug)]
pub struct Image {
    /// Its file.
    pub path: PathBuf,
    /// What all slices have in common.
    pub common: Common,
    /// Place of the first pixel, millimetres.
    pub position: [f64; 3],
    /// Thickness of the slice, if it is given, millimetres.
    pub thickness: Option<f64>,
    /// What a stored number means: slope and intercept.
    pub rescale: [f64; 2],
    /// Where in the file the pixels begin.
    pub offset: u64,
    /// What the series shows.
    pub description: Option<String>,
}

/// Reads all but the pixels of a file; `None` if it is not a DICOM image.
pub fn read(path: &Path) -> Result<Option<Image>, FileError> {
    let (file, length) = open_regular(path)?;
    let mut file = BufReader::new(file);
    let mut read = || match Attributes::read(&mut file, length)? {
        Some(attributes) => attributes.image(path).map(Some),
        None => Ok(None),
    };
    read().map_err(|fault| fault.of(path))
}

/// The attributes that were read, still as bytes, and where the pixels are.
struct Attributes {
    values: BTreeMap<Tag, Vec<u8>>,
    order: ByteOrder,
    /// Offset and length of the pixels.
    pixels: [u64; 2],
}

impl Attributes {
    fn read(file: &mut BufReader<File>, length: u64) -> Result<Option<Self>, FileFault> {
        let mut magic = [0; MAGIC.len()];
        if length < PREAMBLE + magic.len() as u64 {
            return Ok(None);
        }
        file.seek(SeekFrom::Start(PREAMBLE))?;
        file.read_exact(&mut magic)?;
        if magic != MAGIC {
            return Ok(None);
        }
        let mut values = BTreeMap::new();
        let start = meta(file, &mut values)?;
        let syntax = syntax(&values)?;
        let order = if syntax.uid() == entries::EXPLICIT_VR_BIG_ENDIAN.uid() {
            ByteOrder::Big
        } else {
            ByteOrder::Little
        };
        file.seek(SeekFrom::Start(start))?;
        let pixels = data_set(file, length, syntax, &mut values)?;
        Ok(pixels.map(|pixels| Self { values, order, pixels }))
    }

    fn image(&self, path: &Path) -> Result<Image, FileFault> {
        for (attribute, wanted) in [(CHANNELS, 1.0), (FRAMES, 1.0)] {
            if let Some(number) = self.number(attribute)?.filter(|number| *number != wanted) {
                return Err(FileFault::field(
                    attribute.1,
                    format!("{number}, but slices of scalars are read"),
                ));
            }
        }
        let side = |attribute: Attribute| self.require(attribute).map(|side| side as usize);
        let [row_spacing, column_spacing] = self.numbers(SPACING)?;
        let (stored, bits) = self.pixel_type()?;
        let size = [side(COLUMNS)?, side(ROWS)?];
        let [offset, length] = self.pixels;
        let wanted = size[0] as u64 * size[1] as u64 * stored.bytes() as u64;
        if length < wanted {
            return Err(FileFault::Short { wanted, found: length });
        }
        Ok(Image {
            path: path.to_owned(),
            common: Common {
                series: self.text(SERIES).unwrap_or_default(),
                size,
                stored,
                bits,
                order: self.order,
                orientation: self.numbers(ORIENTATION)?,
                spacing: [column_spacing, row_spacing],
            },
            position: self.numbers(POSITION)?,
            thickness: self.number(THICKNESS)?,
            rescale: [self.number(SLOPE)?.unwrap_or(1.0), self.number(INTERCEPT)?.unwrap_or(0.0)],
            offset,
            description: self.text(DESCRIPTION).filter(|text| !text.is_empty()),
        })
    }

    /// Type of the stored numbers, and how many of their bits count.
    fn pixel_type(&self) -> Result<(ScalarType, u32), FileFault> {
        let allocated = self.require(ALLOCATED)?;
        let stored = match (allocated as u32, self.require(SIGNED)? as u32) {
            (8, 0) => ScalarType::Uint8,
            (8, 1) => ScalarType::Int8,
            (16, 0) => ScalarType::Uint16,
            (16, 1) => ScalarType::Int16,
            (32, 0) => ScalarType::Uint32,
            (32, 1) => ScalarType::Int32,
            _ => return Err(FileFault::field(ALLOCATED.1, format!("{allocated} bits are not read"))),
        };
        let bits = self.number(STORED)?.unwrap_or(allocated);
        let high = self.number(HIGH)?.unwrap_or(bits - 1.0);
        if !(1.0..=allocated).contains(&bits) || high != bits - 1.0 {
            let what = format!("{bits} of {allocated} bits, the highest of them {high}");
            return Err(FileFault::field(STORED.1, what));
        }
        Ok((stored, bits as u32))
    }

    fn text(&self, (tag, _): Attribute) -> Option<String> {
        self.values.get(&tag).map(|value| trim(value))
    }

    /// The number of an attribute, if it has one: a short integer, or text.
    fn number(&self, attribute: Attribute) -> Result<Option<f64>, FileFault> {
        let (Tag(group, element), name) = attribute;
        let Some(value) = self.values.get(&attribute.0) else { return Ok(None) };
        let is_short = group == 0x0028 && element < 0x0200 && attribute != SPACING && attribute != FRAMES;
        match (is_short, value.as_slice()) {
            (true, &[first, second]) => Ok(Some(f64::from(match self.order {
                ByteOrder::Little => u16::from_le_bytes([first, second]),
                ByteOrder::Big => u16::from_be_bytes([first, second]),
            }))),
            (true, _) => Err(FileFault::field(name, format!("{} bytes instead of 2", value.len()))),
            (false, []) => Ok(None),
            (false, _) => self.numbers(attribute).map(|[number]| Some(number)),
        }
    }

    fn require(&self, attribute: Attribute) -> Result<f64, FileFault> {
        self.number(attribute)?.ok_or_else(|| FileFault::field(attribute.1, "is missing"))
    }

    /// Numbers as text between backslashes.
    fn numbers<const N: usize>(&self, attribute: Attribute) -> Result<[f64; N], FileFault> {
        let name = attribute.1;
        let text = self.text(attribute).ok_or_else(|| FileFault::field(name, "is missing"))?;
        let number = |word: &str| word.trim().parse().ok().filter(|number: &f64| number.is_finite());
        let numbers: Option<Vec<f64>> = text.split('\\').map(number).collect();
        let numbers = numbers.and_then(|numbers| numbers.try_into().ok());
        let one = if N == 1 { "a number".to_owned() } else { format!("{N} numbers") };
        numbers.ok_or_else(|| FileFault::field(name, format!("'{}' is not {one}", shorten(&text, 40))))
    }
}

/// Text without the padding that makes its length even.
fn trim(value: &[u8]) -> String {
    String::from_utf8_lossy(value).trim_matches(|character| character == '\0' || character == ' ').to_owned()
}

/// The syntax of the attributes behind the meta group.
fn syntax(values: &BTreeMap<Tag, Vec<u8>>) -> Result<&'static TransferSyntax, FileFault> {
    let (tag, name) = TRANSFER_SYNTAX;
    let uid = trim(values.get(&tag).ok_or_else(|| FileFault::field(name, "is missing"))?);
    let known = TransferSyntaxRegistry.get(&uid);
    let plain = [
        entries::IMPLICIT_VR_LITTLE_ENDIAN.uid(),
        entries::EXPLICIT_VR_LITTLE_ENDIAN.uid(),
        entries::EXPLICIT_VR_BIG_ENDIAN.uid(),
    ];
    known.filter(|syntax| plain.contains(&syntax.uid())).ok_or_else(|| {
        let uid = shorten(&uid, 64);
        let what = known.map_or(String::new(), |syntax| format!(" ({})", syntax.name()));
        FileFault::field(name, format!("{uid}{what}: only images that are not compressed are read"))
    })
}

/// A parser that tells the length of an attribute before it takes memory for it.
type Parser<'a> = LazyDataSetReader<DynStatefulDecoder<&'a mut BufReader<File>>>;

fn parser<'a>(file: &'a mut BufReader<File>, syntax: &TransferSyntax) -> Result<Parser<'a>, FileFault> {
    LazyDataSetReader::new_with_ts(file, syntax).map_err(damaged)
}

fn damaged(error: impl std::error::Error) -> FileFault {
    // What went wrong is at the end of the chain.
    let mut cause: &dyn std::error::Error = &error;
    while let Some(next) = cause.source() {
        cause = next;
    }
    FileFault::field("attributes", cause.to_string())
}

/// Reads the meta group; tells where it ends.
fn meta(file: &mut BufReader<File>, values: &mut BTreeMap<Tag, Vec<u8>>) -> Result<u64, FileFault> {
    let mut end = PREAMBLE + MAGIC.len() as u64;
    let mut parser = parser(file, &entries::EXPLICIT_VR_LITTLE_ENDIAN.erased())?;
    while let Some(token) = parser.advance() {
        // What cannot be read as part of the meta group belongs to the data set, in another syntax.
        let Ok(LazyDataToken::LazyValue { header, decoder }) = token else {
            match token {
                Ok(LazyDataToken::ElementHeader(header)) if header.tag().group() == 2 => continue,
                _ => break,
            }
        };
        take(header.tag(), header.len.0, decoder, values)?;
        end = decoder.position();
    }
    Ok(end)
}

/// Reads the data set up to the pixels; tells where these are and how many bytes they have.
fn data_set(
    file: &mut BufReader<File>,
    length: u64,
    syntax: &TransferSyntax,
    values: &mut BTreeMap<Tag, Vec<u8>>,
) -> Result<Option<[u64; 2]>, FileFault> {
    let mut parser = parser(file, syntax)?;
    let mut depth = 0_u32;
    while let Some(token) = parser.advance() {
        match token.map_err(damaged)? {
            LazyDataToken::PixelSequenceStart if depth == 0 => {
                return Err(FileFault::field(PIXELS.1, "is compressed; only images that are not are read"));
            }
            LazyDataToken::SequenceStart { .. } | LazyDataToken::PixelSequenceStart => depth += 1,
            LazyDataToken::SequenceEnd => depth = depth.saturating_sub(1),
            LazyDataToken::LazyValue { header, decoder } if depth > 0 => skip(header.len.0, decoder)?,
            LazyDataToken::LazyValue { header, decoder } if header.tag() == PIXELS.0 => {
                return Ok(Some([decoder.position(), header.len.0.into()]));
            }
            LazyDataToken::LazyValue { header, decoder } => {
                take(header.tag(), header.len.0, decoder, values)?;
            }
            LazyDataToken::LazyItemValue { len, decoder } => skip(len, decoder)?,
            _ => {}
        }
    }
    // What is passed may have ended before its length says.
    match parser.into_decoder().position() {
        wanted if wanted > length => Err(FileFault::Short { wanted, found: length }),
        _ => Ok(None),
    }
}

/// Keeps the value of an attribute that is read, and passes that of any other.
fn take<R: Read + Seek>(
    tag: Tag,
    length: u32,
    decoder: &mut DynStatefulDecoder<R>,
    values: &mut BTreeMap<Tag, Vec<u8>>,
) -> Result<(), FileFault> {
    match READ.iter().find(|attribute| attribute.0 == tag) {
        None => skip(length, decoder),
        Some((_, name)) if length > MAXIMUM_VALUE => {
            Err(FileFault::field(name, format!("{length} bytes long")))
        }
        Some(_) => {
            let mut value = Vec::new();
            decoder.read_to_vec(length, &mut value).map_err(damaged)?;
            values.insert(tag, value);
            Ok(())
        }
    }
}

fn skip<R: Read + Seek>(length: u32, decoder: &mut DynStatefulDecoder<R>) -> Result<(), FileFault> {
    decoder.skip_bytes(length).map_err(damaged)
}
