//! The camera of the command line.

use super::arguments::View;
use super::error::Error;
use super::lists::{Numbers, Size};
use crate::geometry::{Camera, ImageSize, Viewpoint, VolumeBox};
use glam::DVec3;

/// The camera that the arguments describe for a volume and a picture.
pub fn camera(view: &View, size: Size, volume: &VolumeBox) -> Result<(Camera, ImageSize), Error> {
    let vector = |Numbers(numbers): Numbers<3>| DVec3::from_array(numbers);
    let viewpoint = match (view.position, view.focal) {
        (Some(position), Some(focal)) => {
            Viewpoint::Points { position: vector(position), focal: vector(focal) }
        }
        _ => Viewpoint::Angles {
            azimuth: view.azimuth.unwrap_or(0.0),
            elevation: view.elevation.unwrap_or(0.0),
        },
    };
    let size = ImageSize::new(size.width, size.height)?;
    let camera = Camera::new(viewpoint, view.up.map(vector), view.parallel_scale, volume, size)?;
    Ok((camera, size))
}
