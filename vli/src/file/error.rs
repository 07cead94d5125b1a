//! Why a volume file cannot be read or written.

use crate::geometry::GeometryError;
use crate::text::{one_line, shorten};
use std::io;
use std::path::{Path, PathBuf};

/// Most characters that are said about a file. Headers may hold megabytes that are wrong.
const LONGEST: usize = 400;

/// A file and what is wrong with it, in one line.
#[derive(Debug, thiserror::Error)]
#[error("{}: {}", one_line(&path.display().to_string()), shorten(&fault.to_string(), LONGEST))]
pub struct FileError {
    /// The file; for a header with data files of its own, the one that is at fault.
    pub path: PathBuf,
    /// What is wrong.
    pub fault: FileFault,
}

/// What can be wrong with a file.
#[derive(Debug, thiserror::Error)]
pub enum FileFault {
    /// The operating system refuses to open, read or write it.
    #[error("{0}")]
    System(#[from] io::Error),
    /// A folder.
    #[error("is a folder, not a file")]
    Folder,
    /// A folder without images.
    #[error("is a folder without DICOM images")]
    NoImages,
    /// A device, pipe or socket, whose length cannot be known.
    #[error("is not a regular file")]
    NotRegular,
    /// Neither content nor name tell a format.
    #[error(
        "is in no known format; understood are {}, and raw samples with shape and type given",
        super::FORMATS
    )]
    UnknownFormat,
    /// A field of a header, or of the description of a raw file, is missing, wrong or not supported.
    #[error("{field}: {what}")]
    Field {
        /// Name of the field.
        field: &'static str,
        /// What is wrong with it.
        what: String,
    },
    /// The geometry cannot be used.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// A line of a header cannot be understood.
    #[error("line {line}: {what}")]
    Line {
        /// Line of the file, counted from 1.
        line: usize,
        /// What is wrong with it.
        what: String,
    },
    /// The file is too short for the samples that it should hold.
    #[error("holds {found} bytes where sizes, type and encoding want at least {wanted}")]
    Short {
        /// Bytes that are wanted.
        wanted: u64,
        /// Bytes that there are.
        found: u64,
    },
    /// Compressed or text data ends or breaks off before the last sample.
    #[error("{encoding} data: {what}")]
    Data {
        /// Name of the encoding.
        encoding: &'static str,
        /// What is wrong with it.
        what: String,
    },
    /// The machine lacks memory.
    #[error("there is no memory for {0} bytes of samples")]
    Memory(u64),
}

impl FileFault {
    /// A wrong field.
    pub(super) fn field(field: &'static str, what: impl Into<String>) -> Self {
        Self::Field { field, what: what.into() }
    }

    /// This fault of the file at `path`.
    pub(super) fn of(self, path: &Path) -> FileError {
        FileError { path: path.to_owned(), fault: self }
    }
}
