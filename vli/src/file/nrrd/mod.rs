//! The NRRD format ("nearly raw raster data"), versions 1 to 5, as its definition at
//! <https://teem.sourceforge.net/nrrd/format.html> says.
//!
//! Read are volumes of scalars: header and samples in one file or apart, in one data file or many; encodings raw,
//! gzip, hex and text; every scalar type; both byte orders. Axes beyond three are tolerated where they have a single
//! sample. Written are attached headers with raw or gzip samples.

mod axes;
mod data_files;
mod decode;
mod fields;
mod header;
#[cfg(test)]
mod tests;
mod write;

pub use write::{Compression, write};

use super::source::open_regular;
use super::{FileError, Progress, ScalarVolume};
use header::Header;
use std::io::BufReader;
use std::path::Path;

/// What every file begins with, before the digits of the version.
pub(super) const MAGIC: &[u8; 6] = b"NRRD00";

/// Reads a volume from an NRRD file, or from a detached header and its data files.
///
/// # Errors
/// A file cannot be read; the header is malformed, contradicts itself or the data, or describes something else than
/// a volume of scalars.
pub fn read(path: &Path, progress: &mut Progress<'_>) -> Result<ScalarVolume, FileError> {
    let (file, _) = open_regular(path)?;
    let header = Header::read(&mut BufReader::new(file)).map_err(|fault| fault.of(path))?;
    decode::read_samples(path, &header, progress)
}
