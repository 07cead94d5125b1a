//! The NRRD format ("nearly raw raster data"), versions 1 to 5, as its definition at
//! <https://teem.sourceforge.net/nrrd/format.html> says.
//!
//! Read are volumes of scalars: header and samples in one file or apart, in one data file or many; encodings raw,
//! gzip, hex and text; every scalar type; both byte orders. Axes beyond three are tolerated where they have a single
//! sample. Written are attached headers with raw or gzip samples.

mod axes;
mod data_files;
mod fields;
mod header;
#[cfg(test)]
mod tests;
mod write;

pub use write::{Compression, write};

use super::FileError;
use super::layout::Layout;
use super::source::open_regular;
use std::io::BufReader;
use std::path::Path;

/// What every file begins with, before the digits of the version.
pub(super) const MAGIC: &[u8] = b"NRRD00";

/// Reads the header of an NRRD file, or a detached header.
pub(super) fn layout(path: &Path) -> Result<Layout, FileError> {
    let (file, _) = open_regular(path)?;
    header::read(&mut BufReader::new(file)).map_err(|fault| fault.of(path))
}
