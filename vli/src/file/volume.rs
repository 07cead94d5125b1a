//! A volume of scalar samples with its place in space.

use super::Samples;
use crate::geometry::{GeometryError, VolumeBox};
use glam::{DMat3, DMat4, DVec3};

/// Where samples lie: sample (i, j, k) at `origin + directions * (i, j, k)`, in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Place of the first sample.
    pub origin: DVec3,
    /// Step to the next sample along each axis, one axis to a column.
    pub directions: DMat3,
}

impl Geometry {
    /// First sample at the origin, axes along those of space. Spacing in millimetres; a negative one goes
    /// backwards.
    #[must_use]
    pub fn from_spacing(spacing: [f64; 3]) -> Self {
        Self { origin: DVec3::ZERO, directions: DMat3::from_diagonal(DVec3::from_array(spacing)) }
    }

    /// The model matrix: voxel index to millimetres.
    #[must_use]
    pub fn world_from_voxel(&self) -> DMat4 {
        DMat4::from_translation(self.origin) * DMat4::from_mat3(self.directions)
    }

    /// Millimetres between neighbours along each axis.
    #[must_use]
    pub fn spacing(&self) -> [f64; 3] {
        [self.directions.x_axis, self.directions.y_axis, self.directions.z_axis].map(DVec3::length)
    }

    /// Refuses numbers that one cannot compute with, and axes that lie in one plane. `directions` and `origin` are
    /// what the file calls them.
    pub(super) fn check(&self, directions: &'static str, origin: &'static str) -> Result<(), GeometryError> {
        let rename = |name| {
            move |error| match error {
                GeometryError::Singular(_) => GeometryError::Singular(name),
                GeometryError::Coordinate(_) => GeometryError::Coordinate(name),
                other => other,
            }
        };
        VolumeBox::new(&DMat4::from_mat3(self.directions), [1; 3]).map_err(rename(directions))?;
        VolumeBox::new(&self.world_from_voxel(), [1; 3]).map_err(rename(origin))?;
        Ok(())
    }
}

/// A volume of samples in their own type and units.
#[derive(Clone, Debug)]
pub struct ScalarVolume {
    dimensions: [usize; 3],
    samples: Samples,
    geometry: Geometry,
    /// What the volume shows, in the words of its file.
    pub content: Option<String>,
    /// Name of the space that the geometry refers to, as `left-posterior-superior`.
    pub space: Option<String>,
    /// What the reader of the file wants its user to know, one line each.
    pub remarks: Vec<String>,
}

impl ScalarVolume {
    /// A volume of `dimensions` samples along x, y and z, x fastest. `None` unless there are as many samples as the
    /// dimensions say, and at least one.
    #[must_use]
    pub fn new(dimensions: [usize; 3], samples: Samples, geometry: Geometry) -> Option<Self> {
        let count = dimensions.iter().try_fold(1_usize, |count, &size| count.checked_mul(size))?;
        let fits = count == samples.len() && count > 0;
        fits.then_some(Self {
            dimensions,
            samples,
            geometry,
            content: None,
            space: None,
            remarks: Vec::new(),
        })
    }

    /// Samples along x, y and z.
    #[must_use]
    pub const fn dimensions(&self) -> [usize; 3] {
        self.dimensions
    }

    /// The samples, x fastest, then y, then z.
    #[must_use]
    pub const fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Where the samples lie.
    #[must_use]
    pub const fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Place (i, j, k) of the sample at `index`.
    #[must_use]
    pub fn place(&self, index: usize) -> [usize; 3] {
        let [width, height, _] = self.dimensions;
        [index % width, index / width % height, index / width / height]
    }

    /// Value of the sample at (i, j, k), if there is one.
    #[must_use]
    pub fn value(&self, [i, j, k]: [usize; 3]) -> Option<f64> {
        let [width, height, _] = self.dimensions;
        let inside = i < width && j < height;
        let index = k.checked_mul(height)?.checked_add(j)?.checked_mul(width)?.checked_add(i)?;
        self.samples.value(index).filter(|_| inside)
    }

    /// Replaces every sample that is NaN or infinite.
    pub fn replace_not_finite(&mut self, number: f64) {
        self.samples.replace_not_finite(number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_must_be_as_many_as_the_dimensions_say() {
        let volume = |dimensions| {
            ScalarVolume::new(dimensions, vec![0_u8; 24].into(), Geometry::from_spacing([1.0; 3]))
        };
        assert!(volume([2, 3, 4]).is_some());
        assert!(
            volume([2, 3, 5]).is_none() && volume([0, 3, 4]).is_none() && volume([usize::MAX; 3]).is_none()
        );
        let empty = ScalarVolume::new([0; 3], Samples::Int8(vec![]), Geometry::from_spacing([1.0; 3]));
        assert!(empty.is_none());
    }

    #[test]
    fn places_and_values_agree() {
        let samples: Vec<u16> = (0..24).collect();
        let volume = ScalarVolume::new([2, 3, 4], samples.into(), Geometry::from_spacing([1.0; 3])).unwrap();
        for index in 0..24 {
            assert_eq!(volume.value(volume.place(index)), Some(index as f64));
        }
        assert_eq!(volume.place(23), [1, 2, 3]);
        for beyond in [[2, 0, 0], [0, 3, 0], [0, 0, 4], [usize::MAX; 3]] {
            assert_eq!(volume.value(beyond), None);
        }
    }

    #[test]
    fn unusable_geometry_names_the_field() {
        let message = |change: fn(&mut Geometry)| {
            let mut geometry = Geometry::from_spacing([1.0; 3]);
            change(&mut geometry);
            geometry.check("space directions", "space origin").unwrap_err().to_string()
        };
        assert!(message(|it| it.directions.x_axis.y = f64::NAN).starts_with("space directions: "));
        assert!(
            message(|it| it.directions.x_axis = it.directions.y_axis)
                .starts_with("space directions: an axis")
        );
        assert!(message(|it| it.origin.z = f64::INFINITY).starts_with("space origin: "));
        assert!(Geometry::from_spacing([1.0, -2.0, 3.0]).check("", "").is_ok());
    }

    #[test]
    fn geometry_places_samples() {
        let geometry = Geometry {
            origin: DVec3::new(10.0, 20.0, 30.0),
            directions: DMat3::from_cols(
                DVec3::new(0.0, 2.0, 0.0),
                DVec3::new(-1.0, 0.0, 0.0),
                DVec3::Z * 3.0,
            ),
        };
        let place = geometry.world_from_voxel().transform_point3(DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(place, DVec3::new(8.0, 22.0, 39.0));
        assert_eq!(geometry.spacing(), [2.0, 1.0, 3.0]);
    }
}
