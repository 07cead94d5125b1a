//! Writing NRRD files.

use super::super::output::write_whole;
use super::super::{FileError, FileFault, Geometry, ScalarVolume};
use flate2::write::GzEncoder;
use glam::{DMat3, DVec3};
use std::path::Path;

/// Whether samples are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compression {
    /// Written as in memory.
    None,
    /// Compressed by gzip.
    Gzip,
}

/// Writes a volume with an attached header.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, volume: &ScalarVolume, compression: Compression) -> Result<(), FileError> {
    let written = write_whole(path, |file| {
        file.write_all(header(volume, compression).as_bytes())?;
        match compression {
            Compression::None => volume.samples().write_to(file),
            Compression::Gzip => {
                let mut encoder = GzEncoder::new(file, flate2::Compression::default());
                volume.samples().write_to(&mut encoder)?;
                encoder.finish().map(drop)
            }
        }
    });
    written.map_err(|error| FileFault::from(error).of(path))
}

fn header(volume: &ScalarVolume, compression: Compression) -> String {
    let [x, y, z] = volume.dimensions();
    let encoding = match compression {
        Compression::None => "raw",
        Compression::Gzip => "gzip",
    };
    let mut header = String::from("NRRD0004\n");
    if let Some(content) = &volume.content {
        header += &format!("content: {}\n", one_line(content));
    }
    header += &format!("type: {}\ndimension: 3\n", volume.samples().scalar_type());
    if let Some(space) = &volume.space {
        header += &format!("space: {}\n", one_line(space));
    }
    header += &format!("sizes: {x} {y} {z}\n");
    header += &geometry(volume.geometry(), volume.space.is_some());
    header += &format!("kinds: domain domain domain\nendian: little\nencoding: {encoding}\n\n");
    header
}

/// The fields that place the samples: spacings where these say everything.
fn geometry(geometry: &Geometry, has_space: bool) -> String {
    let vector = |vector: DVec3| format!("({},{},{})", vector.x, vector.y, vector.z);
    let DMat3 { x_axis, y_axis, z_axis } = geometry.directions;
    let diagonal = DVec3::new(x_axis.x, y_axis.y, z_axis.z);
    if !has_space && geometry.origin == DVec3::ZERO && geometry.directions == DMat3::from_diagonal(diagonal) {
        return format!("spacings: {} {} {}\n", diagonal.x, diagonal.y, diagonal.z);
    }
    format!(
        "{}space directions: {} {} {}\nspace origin: {}\n",
        if has_space { "" } else { "space dimension: 3\n" },
        vector(x_axis),
        vector(y_axis),
        vector(z_axis),
        vector(geometry.origin),
    )
}

/// Text fit for a field, which ends with its line.
fn one_line(text: &str) -> String {
    text.replace(char::is_control, " ")
}
