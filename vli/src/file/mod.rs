//! Volume files: [`open`] reads any format that is understood; [`raw`] reads samples without header; [`nrrd`] also
//! writes.

mod error;
pub mod nrrd;
pub mod raw;
mod scalar;
mod source;
mod volume;

pub use error::{FileError, FileFault};
pub use scalar::{ByteOrder, Samples, ScalarType};
pub(crate) use scalar::{Scalar, with_samples};
pub use volume::{Geometry, ScalarVolume};

use std::path::Path;

/// Told, as a file is read, how many bytes of samples are there and how many there will be.
pub type Progress<'a> = dyn FnMut(u64, u64) + 'a;

/// Largest size of a volume's samples in bytes: 2048^3 voxels of 8 bits. A file may not make this process
/// allocate more, whatever its header says.
pub const MAXIMUM_BYTES: u64 = 1 << 33;

/// The formats that [`open`] understands, for messages.
pub const FORMATS: &str = "NRRD (.nrrd, .nhdr)";

/// Reads a volume file in whichever of [`FORMATS`] it is.
///
/// # Errors
/// The file is in none of these formats, or cannot be read, or is not a volume of scalars.
pub fn open(path: &Path, progress: &mut Progress<'_>) -> Result<ScalarVolume, FileError> {
    let mut beginning = [0; nrrd::MAGIC.len()];
    let length = source::read_beginning(path, &mut beginning)?;
    let has_extension = |names: [&str; 2]| {
        path.extension()
            .is_some_and(|extension| names.iter().any(|name| extension.eq_ignore_ascii_case(name)))
    };
    if beginning[..length] == *nrrd::MAGIC || has_extension(["nrrd", "nhdr"]) {
        nrrd::read(path, progress)
    } else {
        Err(FileFault::UnknownFormat.of(path))
    }
}
