//! Files of samples without any header.

use super::layout::Layout;
use super::source::open_regular;
use super::{ByteOrder, FileError, FileFault, Geometry, ScalarType};
use std::path::Path;

/// What a file without header does not say itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawDescription {
    /// Samples along x, y and z.
    pub dimensions: [usize; 3],
    /// Type of the samples.
    pub scalar: ScalarType,
    /// Order of their bytes.
    pub order: ByteOrder,
    /// Millimetres between neighbours along x, y and z.
    pub spacing: [f64; 3],
}

/// The layout of a file that holds nothing but samples, x fastest; its length must be theirs.
pub(super) fn layout(path: &Path, description: &RawDescription) -> Result<Layout, FileError> {
    let (_, length) = open_regular(path)?;
    let RawDescription { dimensions, scalar, order, spacing } = *description;
    let layout = || {
        let geometry = Geometry::from_spacing(spacing);
        geometry.check("raw spacing", "raw origin")?;
        let layout = Layout::attached(dimensions, scalar, order, 0, "raw shape")?;
        let wanted = layout.count() as u64 * scalar.bytes() as u64;
        if length != wanted {
            let what = format!("samples of {scalar} make {wanted} bytes, the file has {length}");
            return Err(FileFault::field("raw shape", what));
        }
        Ok(Layout { geometry, ..layout })
    };
    layout().map_err(|fault: FileFault| fault.of(path))
}

#[cfg(test)]
mod tests {
    use super::super::{Samples, ScalarVolume, VolumeFile};
    use super::*;
    use glam::DVec3;

    const DESCRIPTION: RawDescription = RawDescription {
        dimensions: [3, 2, 1],
        scalar: ScalarType::Uint16,
        order: ByteOrder::Big,
        spacing: [0.5, 1.0, 2.0],
    };

    fn read_bytes(bytes: &[u8], description: RawDescription) -> Result<ScalarVolume, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("volume.raw");
        std::fs::write(&path, bytes).unwrap();
        let file = VolumeFile::raw(&path, &description).map_err(|error| error.to_string())?;
        file.read(&mut |_, _| {}).map_err(|error| error.to_string())
    }

    fn refused(change: fn(&mut RawDescription)) -> String {
        let mut description = DESCRIPTION;
        change(&mut description);
        read_bytes(&[0; 12], description).unwrap_err()
    }

    #[test]
    fn descriptions_that_do_not_fit_the_file_are_refused() {
        assert!(refused(|it| it.dimensions = [3, 2, 2]).ends_with("uint16 make 24 bytes, the file has 12"));
        assert!(refused(|it| it.scalar = ScalarType::Uint8).ends_with("uint8 make 6 bytes, the file has 12"));
        assert!(refused(|it| it.dimensions = [3, 0, 2]).ends_with("raw shape: 3 x 0 x 2 holds no samples"));
        assert!(refused(|it| it.dimensions = [usize::MAX; 3]).contains("more than 8 GiB"));
        assert!(refused(|it| it.dimensions = [1 << 20, 1 << 13, 1]).contains("more than 8 GiB"));
        for spacing in [f64::NAN, 0.0, f64::INFINITY, 1e300] {
            let error = read_bytes(&[0; 12], RawDescription { spacing: [1.0, spacing, 1.0], ..DESCRIPTION });
            assert!(error.unwrap_err().contains("raw spacing: "), "{spacing}");
        }
    }

    #[test]
    fn folders_and_missing_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let error = layout(folder.path(), &DESCRIPTION).unwrap_err();
        assert!(matches!(error.fault, FileFault::Folder), "{error}");
        let error = layout(&folder.path().join("none.raw"), &DESCRIPTION).unwrap_err();
        assert!(error.to_string().contains("none.raw: No such file"), "{error}");
    }

    #[test]
    fn samples_are_read() {
        let volume = read_bytes(&[0, 1, 0, 2, 0, 3, 1, 0, 2, 0, 3, 0], DESCRIPTION).unwrap();
        assert_eq!(*volume.samples(), Samples::Uint16(vec![1, 2, 3, 256, 512, 768]));
        assert_eq!(volume.geometry().origin, DVec3::ZERO);
        assert_eq!(volume.geometry().spacing(), [0.5, 1.0, 2.0]);
    }
}
