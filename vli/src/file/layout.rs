//! What the header of a volume file says, in whatever format: which samples there are, where they are, and how they
//! are written.

use super::data_files::DataFiles;
use super::source::check_size;
use super::{ByteOrder, FileError, FileFault, Geometry, Progress, ScalarType, ScalarVolume, decode};
use std::path::{Path, PathBuf};

/// How samples are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// As in memory.
    Raw,
    /// As in memory, compressed.
    Gzip,
    /// As in memory, compressed, in the wrapping of zlib.
    Zlib,
    /// As in memory, two hexadecimal digits to a byte.
    Hex,
    /// As decimal numbers.
    Text,
}

impl Encoding {
    /// The name in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Gzip => "gzip",
            Self::Zlib => "zlib",
            Self::Hex => "hex",
            Self::Text => "text",
        }
    }

    /// Whether what is skipped before the samples is compressed too.
    pub const fn is_compressed(self) -> bool {
        matches!(self, Self::Gzip | Self::Zlib)
    }
}

/// What comes before the samples in a data file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteSkip {
    /// So many bytes; of decompressed data where it is compressed.
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
    /// In a file for each slice.
    Slices(Vec<Slice>),
}

/// A slice in a file of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Slice {
    /// The file.
    pub path: PathBuf,
    /// Where its samples begin.
    pub offset: u64,
    /// What they mean.
    pub meaning: Meaning,
}

/// What stored numbers mean: `slope * number + intercept`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meaning {
    /// How many of the low bits of an integer count; the others are something else's.
    pub bits: u32,
    /// What a step of the number means.
    pub slope: f64,
    /// What 0 means.
    pub intercept: f64,
}

impl Meaning {
    /// Numbers of a type mean themselves.
    pub const fn itself(stored: ScalarType) -> Self {
        Self { bits: 8 * stored.bytes() as u32, slope: 1.0, intercept: 0.0 }
    }

    /// What a stored number means.
    pub fn of(&self, number: f64) -> f64 {
        self.slope * number + self.intercept
    }
}

/// A part of the samples, in one file.
pub struct Piece {
    /// The file.
    pub path: PathBuf,
    /// The first byte that has to do with samples.
    pub offset: u64,
    /// How many there are.
    pub samples: usize,
    /// What they mean.
    pub meaning: Meaning,
}

/// What a header says, of a volume that can be read as far as the header tells.
#[derive(Debug)]
pub struct Layout {
    /// Samples along x, y and z.
    pub dimensions: [usize; 3],
    /// Type of the stored numbers.
    pub stored: ScalarType,
    /// Type of what they mean.
    pub scalar: ScalarType,
    /// What they mean, unless slices have meanings of their own.
    pub meaning: Meaning,
    /// Where the samples lie in space.
    pub geometry: Geometry,
    /// How they are written.
    pub encoding: Encoding,
    /// Order of the bytes of a number.
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

impl Layout {
    /// Plain samples behind the first `offset` bytes of the header's file. `field` is what the file calls dimensions.
    pub fn attached(
        dimensions: [usize; 3],
        stored: ScalarType,
        order: ByteOrder,
        offset: u64,
        field: &'static str,
    ) -> Result<Self, FileFault> {
        check_size(&dimensions, stored, field)?;
        Ok(Self {
            dimensions,
            stored,
            scalar: stored,
            meaning: Meaning::itself(stored),
            geometry: Geometry::from_spacing([1.0; 3]),
            encoding: Encoding::Raw,
            order,
            line_skip: 0,
            byte_skip: ByteSkip::Bytes(0),
            data: Data::Attached(offset),
            content: None,
            space: None,
            remarks: Vec::new(),
        })
    }

    /// The same samples, whose type holds all that stored numbers can mean. `field` is what the file calls dimensions.
    pub fn with_meanings(self, meanings: &[Meaning], field: &'static str) -> Result<Self, FileFault> {
        let scalar = type_of_meanings(self.stored, meanings);
        check_size(&self.dimensions, scalar, field)?;
        Ok(Self { scalar, ..self })
    }

    /// Samples of the volume; their number has been checked.
    pub fn count(&self) -> usize {
        self.dimensions.iter().product()
    }

    /// The files that hold samples of a volume whose header is at `path`. They are named one by one, because a header
    /// may claim any number of them.
    pub fn pieces<'a>(&'a self, path: &'a Path) -> Box<dyn Iterator<Item = Piece> + 'a> {
        let piece = |path, offset, samples| Piece { path, offset, samples, meaning: self.meaning };
        match &self.data {
            Data::Attached(offset) => {
                Box::new(std::iter::once(piece(path.to_owned(), *offset, self.count())))
            }
            Data::Detached(files, samples) => {
                let folder = path.parent().unwrap_or(Path::new(""));
                Box::new(files.names().map(move |name| piece(folder.join(name), 0, *samples)))
            }
            Data::Slices(slices) => {
                let [width, height, _] = self.dimensions;
                Box::new(slices.iter().map(move |slice| Piece {
                    path: slice.path.clone(),
                    offset: slice.offset,
                    samples: width * height,
                    meaning: slice.meaning,
                }))
            }
        }
    }

    /// Reads the samples.
    pub fn read(&self, path: &Path, progress: &mut Progress<'_>) -> Result<ScalarVolume, FileError> {
        decode::read_samples(path, self, progress)
    }
}

/// A type for all that numbers of a stored type can mean: theirs if they mean themselves, a short integer where slopes
/// and intercepts are whole, else floating point.
fn type_of_meanings(stored: ScalarType, meanings: &[Meaning]) -> ScalarType {
    let plain = |meaning: &Meaning| (meaning.slope, meaning.intercept) == (1.0, 0.0);
    if meanings.iter().all(plain) || matches!(stored, ScalarType::Float32 | ScalarType::Float64) {
        return stored;
    }
    let is_short = stored.bytes() <= 2;
    let is_whole = |meaning: &Meaning| meaning.slope.fract() == 0.0 && meaning.intercept.fract() == 0.0;
    let ends = meanings.iter().flat_map(|meaning| stored.ends(meaning.bits).map(|end| meaning.of(end)));
    let ends: Vec<f64> = ends.collect();
    let holds = |scalar: &ScalarType| {
        let [least, greatest] = scalar.ends(u32::MAX);
        ends.iter().all(|end| (least..=greatest).contains(end))
    };
    let integers = [ScalarType::Int16, ScalarType::Uint16, ScalarType::Int32];
    let integer = integers.into_iter().find(holds).filter(|_| is_short && meanings.iter().all(is_whole));
    integer.unwrap_or(if is_short { ScalarType::Float32 } else { ScalarType::Float64 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ScalarType::{Float32, Float64, Int16, Int32, Uint8, Uint16};

    #[test]
    fn types_hold_what_numbers_mean() {
        for (stored, bits, slope, intercept, scalar) in [
            (Uint16, 16, 1.0, 0.0, Uint16),
            (Uint16, 12, 1.0, 0.0, Uint16),
            (Uint16, 12, 1.0, -1024.0, Int16),
            (Uint16, 16, 1.0, -1024.0, Int32),
            (Int16, 16, 1.0, -1024.0, Int32),
            (Int16, 12, 2.0, 10000.0, Int16),
            (Uint8, 8, 256.0, 0.0, Uint16),
            (Uint8, 8, 0.5, 0.0, Float32),
            (Uint16, 16, 1e300, 0.0, Float32),
            (Int32, 32, 2.0, 0.0, Float64),
            (Float32, 32, 2.0, 1.0, Float32),
        ] {
            let meanings = [Meaning::itself(stored), Meaning { bits, slope, intercept }];
            assert_eq!(
                type_of_meanings(stored, &meanings[1..]),
                scalar,
                "{stored} {bits} {slope} {intercept}"
            );
            assert_eq!(type_of_meanings(stored, &meanings[..1]), stored);
        }
    }
}
