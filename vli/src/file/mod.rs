//! Volume files: [`open`] reads any format that is understood; [`VolumeFile`] tells what a file holds before its samples
//! are read, and reads samples without header; [`nrrd`] also writes.

mod data_files;
mod decode;
mod dicom;
mod error;
mod layout;
mod meta_image;
mod nifti;
pub mod nrrd;
pub mod output;
pub mod raw;
mod scalar;
mod source;
mod volume;
mod vox;

pub use error::{FileError, FileFault};
pub use scalar::{ByteOrder, Samples, ScalarType};
pub(crate) use scalar::{Scalar, with_samples};
pub(crate) use source::open_regular;
pub use volume::{Geometry, ScalarVolume};

use layout::Layout;
use std::path::{Path, PathBuf};

/// Told, as a file is read, how many bytes of samples are there and how many there will be.
pub type Progress<'a> = dyn FnMut(u64, u64) + 'a;

/// Largest size of a volume's samples in bytes: 2048^3 voxels of 8 bits. A file may not make this process
/// allocate more, whatever its header says.
pub const MAXIMUM_BYTES: u64 = 1 << 33;

/// The formats that [`open`] understands, for messages.
pub const FORMATS: &str = "NRRD (.nrrd, .nhdr), NIfTI-1 (.nii, .nii.gz), MetaImage (.mha, .mhd), Vox1999a (.vox), \
    folders of a DICOM series";

/// A volume file whose header has been read and found right.
#[derive(Debug)]
pub struct VolumeFile {
    path: PathBuf,
    layout: Layout,
}

impl VolumeFile {
    /// Reads the header of a volume file in whichever of [`FORMATS`] it is.
    ///
    /// # Errors
    /// The file is in none of these formats, cannot be read, or describes something else than a volume of scalars.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        Ok(Self { path: path.to_owned(), layout: layout(path)? })
    }

    /// A file of nothing but samples, x fastest.
    ///
    /// # Errors
    /// The length of the file is not that of the samples described; the description makes no volume.
    pub fn raw(path: &Path, description: &raw::RawDescription) -> Result<Self, FileError> {
        Ok(Self { path: path.to_owned(), layout: raw::layout(path, description)? })
    }

    /// Samples along x, y and z.
    #[must_use]
    pub const fn dimensions(&self) -> [usize; 3] {
        self.layout.dimensions
    }

    /// Type of the samples.
    #[must_use]
    pub const fn scalar_type(&self) -> ScalarType {
        self.layout.scalar
    }

    /// Reads the samples.
    ///
    /// # Errors
    /// A file of samples cannot be read, or does not hold what the header says.
    pub fn read(&self, progress: &mut Progress<'_>) -> Result<ScalarVolume, FileError> {
        self.layout.read(&self.path, progress)
    }
}

/// Reads a volume file in whichever of [`FORMATS`] it is.
///
/// # Errors
/// Those of [`VolumeFile::open`] and [`VolumeFile::read`].
pub fn open(path: &Path, progress: &mut Progress<'_>) -> Result<ScalarVolume, FileError> {
    VolumeFile::open(path)?.read(progress)
}

/// Reads a header in whichever format it is.
fn layout(path: &Path) -> Result<Layout, FileError> {
    if path.is_dir() {
        return dicom::layout(path);
    }
    let mut beginning = [0; 8];
    let length = source::read_beginning(path, &mut beginning)?;
    let beginning = &beginning[..length];
    let has_extension = |names: &[&str]| {
        path.extension()
            .is_some_and(|extension| names.iter().any(|name| extension.eq_ignore_ascii_case(name)))
    };
    if beginning.starts_with(nrrd::MAGIC) || has_extension(&["nrrd", "nhdr"]) {
        nrrd::layout(path)
    } else if beginning.starts_with(meta_image::MAGIC) || has_extension(&["mha", "mhd"]) {
        meta_image::layout(path)
    } else if beginning.starts_with(vox::MAGIC) || has_extension(&["vox"]) {
        vox::layout(path)
    } else if nifti::is_beginning(beginning) || nifti::is_name(path) {
        nifti::layout(path)
    } else {
        Err(FileFault::UnknownFormat.of(path))
    }
}
