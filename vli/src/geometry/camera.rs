use glam::{DMat4, DVec3};

use super::error::{MAXIMUM_COORDINATE, check_coordinates};
use super::{GeometryError, ImageSize, VolumeBox};

/// Smallest sine of the angle between the view-up vector and the view direction.
const MINIMUM_SINE: f64 = 1e-9;

/// Where the camera stands and looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Viewpoint {
    /// Around the centre of the volume's box, as `vtkCamera` moves: from the view along -z with +y up, the
    /// camera goes `azimuth` degrees around the up vector (towards +x), then `elevation` degrees over the
    /// top (towards +y), and its up vector turns with it.
    Angles {
        /// Degrees.
        azimuth: f64,
        /// Degrees.
        elevation: f64,
    },
    /// From one point in the world to another, in millimetres; up is +y.
    Points {
        /// Where the camera stands.
        position: DVec3,
        /// What it looks at.
        focal: DVec3,
    },
}

/// An orthographic camera: it has no near and far plane, and nothing is behind it.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    camera_from_world: DMat4,
    parallel_scale: f64,
}

impl Camera {
    /// A camera for a picture of `volume`.
    ///
    /// `up` replaces the up vector of the viewpoint, after the camera has been placed; it need not be
    /// orthogonal to the view. `parallel_scale` is half the image height in millimetres, by default
    /// [`VolumeBox::parallel_scale`].
    ///
    /// # Errors
    /// Position and focal point coincide; up is zero or parallel to the view; a number is not finite or
    /// absurd; the scale is not positive.
    pub fn new(
        viewpoint: Viewpoint,
        up: Option<DVec3>,
        parallel_scale: Option<f64>,
        volume: &VolumeBox,
        size: ImageSize,
    ) -> Result<Self, GeometryError> {
        let (position, focal, own_up) = match viewpoint {
            Viewpoint::Points { position, focal } => (position, focal, DVec3::Y),
            Viewpoint::Angles { azimuth, elevation } => {
                check_coordinates("azimuth and elevation", DVec3::new(azimuth, elevation, 0.0))?;
                let (backward, up) = orbit(azimuth, elevation);
                (volume.centre() + backward * volume.diagonal(), volume.centre(), up)
            }
        };
        let parallel_scale = parallel_scale.unwrap_or_else(|| volume.parallel_scale(size));
        if !(1.0 / MAXIMUM_COORDINATE..=MAXIMUM_COORDINATE).contains(&parallel_scale) {
            return Err(GeometryError::ParallelScale(parallel_scale));
        }
        Ok(Self { camera_from_world: look_at(position, focal, up.unwrap_or(own_up))?, parallel_scale })
    }

    /// The view matrix.
    #[must_use]
    pub const fn camera_from_world(&self) -> &DMat4 {
        &self.camera_from_world
    }

    /// Half the image height in millimetres.
    #[must_use]
    pub const fn parallel_scale(&self) -> f64 {
        self.parallel_scale
    }
}

/// Direction from the focal point to a camera at these angles, and its up vector, both of unit length.
fn orbit(azimuth: f64, elevation: f64) -> (DVec3, DVec3) {
    let (sin_a, cos_a) = sin_cos_degrees(azimuth);
    let (sin_e, cos_e) = sin_cos_degrees(elevation);
    let backward = DVec3::new(cos_e * sin_a, sin_e, cos_e * cos_a);
    let up = DVec3::new(-sin_e * sin_a, cos_e, -sin_e * cos_a);
    (backward, up)
}

/// The view matrix of a camera at `position` that looks at `focal`: rows are the camera's right, up and
/// backward vectors (OpenGL's convention).
///
/// # Errors
/// The two points coincide; `up` is zero or parallel to the view; a coordinate is not finite or absurd.
pub fn look_at(position: DVec3, focal: DVec3, up: DVec3) -> Result<DMat4, GeometryError> {
    check_coordinates("camera position", position)?;
    check_coordinates("camera focal point", focal)?;
    check_coordinates("camera view-up vector", up)?;
    let backward = normalized(position - focal, 0.0).ok_or(GeometryError::PositionAtFocal)?;
    let up = normalized(up, 0.0).ok_or(GeometryError::UpAlongView)?;
    let right = normalized(up.cross(backward), MINIMUM_SINE).ok_or(GeometryError::UpAlongView)?;
    let up = backward.cross(right);
    let rotation = [right, up, backward];
    let column = |axis: DVec3| DVec3::from_array(rotation.map(|row| row.dot(axis)));
    Ok(DMat4::from_cols(
        column(DVec3::X).extend(0.0),
        column(DVec3::Y).extend(0.0),
        column(DVec3::Z).extend(0.0),
        (-column(position)).extend(1.0),
    ))
}

/// The unit vector of one longer than `shortest`. Divided by its length and not multiplied by the reciprocal,
/// so that vectors along an axis become exactly that axis.
fn normalized(vector: DVec3, shortest: f64) -> Option<DVec3> {
    let length = vector.length();
    (length > shortest).then(|| vector / length)
}

/// Sine and cosine of an angle in degrees, the same bits on every machine, exact for multiples of 90: a
/// quarter turn shows the volume exactly from its side.
#[must_use]
pub fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let degrees = degrees % 360.0;
    let quarters = (degrees / 90.0).round();
    let (sin, cos) = libm::sincos((degrees - 90.0 * quarters).to_radians());
    match (quarters as i32).rem_euclid(4) {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CENTRE: DVec3 = DVec3::new(9.5, 20.0, 31.5);

    fn camera(azimuth: f64, elevation: f64) -> Camera {
        let viewpoint = Viewpoint::Angles { azimuth, elevation };
        create(viewpoint, None, None).unwrap()
    }

    fn create(viewpoint: Viewpoint, up: Option<DVec3>, scale: Option<f64>) -> Result<Camera, GeometryError> {
        let model = DMat4::from_translation(DVec3::new(8.0, 18.0, 28.0));
        let volume = VolumeBox::new(&model, [4, 5, 8]).unwrap();
        Camera::new(viewpoint, up, scale, &volume, ImageSize::new(512, 512).unwrap())
    }

    fn close(a: DVec3, b: DVec3) {
        assert!((a - b).length() < 1e-12, "{a} is not {b}");
    }

    #[test]
    fn degenerate_cameras_are_refused() {
        let front = Viewpoint::Points { position: CENTRE + DVec3::Z, focal: CENTRE };
        let at_focal = Viewpoint::Points { position: CENTRE, focal: CENTRE };
        assert_eq!(create(at_focal, None, None), Err(GeometryError::PositionAtFocal));
        for up in [DVec3::ZERO, DVec3::Z, DVec3::NEG_Z * 1e6, DVec3::splat(1e-300)] {
            assert_eq!(create(front, Some(up), None), Err(GeometryError::UpAlongView), "{up}");
        }
        for wrong in [f64::NAN, f64::INFINITY, -1e13] {
            let error = |result: Result<Camera, GeometryError>| match result.unwrap_err() {
                GeometryError::Coordinate(what) => what,
                other => panic!("{other}"),
            };
            let point = DVec3::new(0.0, wrong, 0.0);
            let from = Viewpoint::Points { position: point, focal: CENTRE };
            let to = Viewpoint::Points { position: CENTRE, focal: point };
            let angles = Viewpoint::Angles { azimuth: 0.0, elevation: wrong };
            assert_eq!(error(create(from, None, None)), "camera position");
            assert_eq!(error(create(to, None, None)), "camera focal point");
            assert_eq!(error(create(front, Some(point), None)), "camera view-up vector");
            assert_eq!(error(create(angles, None, None)), "azimuth and elevation");
        }
        for scale in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e13, 1e-13] {
            let error = create(front, None, Some(scale)).unwrap_err();
            assert!(matches!(error, GeometryError::ParallelScale(_)), "{error}");
        }
    }

    #[test]
    fn angles_are_those_of_vtk() {
        // Rows of the view matrix: right, up, backward.
        let quarter_turns = [
            (0.0, 0.0, DVec3::X, DVec3::Y, DVec3::Z),
            (90.0, 0.0, DVec3::NEG_Z, DVec3::Y, DVec3::X),
            (180.0, 0.0, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Z),
            (-90.0, 0.0, DVec3::Z, DVec3::Y, DVec3::NEG_X),
            (0.0, 90.0, DVec3::X, DVec3::NEG_Z, DVec3::Y),
            (0.0, -90.0, DVec3::X, DVec3::Z, DVec3::NEG_Y),
            (90.0, 90.0, DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y),
            (720.0, -450.0, DVec3::X, DVec3::Z, DVec3::NEG_Y),
        ];
        for (azimuth, elevation, right, up, backward) in quarter_turns {
            let view = *camera(azimuth, elevation).camera_from_world();
            let rows = [0, 1, 2].map(|row| view.row(row).truncate());
            assert_eq!(rows, [right, up, backward], "azimuth {azimuth}, elevation {elevation}");
        }
        let view = *camera(30.0, 60.0).camera_from_world();
        let root = 3.0_f64.sqrt() / 2.0;
        close(view.row(2).truncate(), DVec3::new(0.25, root, 0.5 * root));
        close(view.row(0).truncate(), DVec3::new(root, 0.0, -0.5));
    }

    #[test]
    fn the_box_centre_is_straight_ahead() {
        for (azimuth, elevation) in [(0.0, 0.0), (33.0, -71.0), (200.0, 100.0)] {
            let seen = camera(azimuth, elevation).camera_from_world().transform_point3(CENTRE);
            assert!(seen.truncate().length() < 1e-12 && seen.z < 0.0, "{seen}");
        }
    }

    #[test]
    fn view_matrices_are_rotations() {
        for (azimuth, elevation) in [(12.3, 45.6), (123.0, -89.9), (301.0, 170.0)] {
            let view = *camera(azimuth, elevation).camera_from_world();
            let [right, up, backward] = [0, 1, 2].map(|row| view.row(row).truncate());
            close(right.cross(up), backward);
            assert!((right.length() - 1.0).abs() < 1e-12 && right.dot(up).abs() < 1e-12);
        }
    }

    #[test]
    fn up_turns_the_picture_of_any_camera() {
        let angles = Viewpoint::Angles { azimuth: 90.0, elevation: 0.0 };
        let view = *create(angles, Some(DVec3::new(5.0, 0.0, 2.0)), None).unwrap().camera_from_world();
        assert_eq!(view.row(1).truncate(), DVec3::Z);
        assert_eq!(view.row(2).truncate(), DVec3::X);
    }

    #[test]
    fn scale_is_the_box_or_as_asked() {
        assert_eq!(camera(10.0, 20.0).parallel_scale(), 0.5 * 74.0_f64.sqrt());
        let front = Viewpoint::Points { position: DVec3::Z, focal: DVec3::ZERO };
        assert_eq!(create(front, None, Some(3.0)).unwrap().parallel_scale(), 3.0);
    }

    #[test]
    fn sines_are_exact_at_quarter_turns_and_good_between() {
        assert_eq!(sin_cos_degrees(90.0), (1.0, 0.0));
        assert_eq!(sin_cos_degrees(-180.0), (0.0, -1.0));
        assert_eq!(sin_cos_degrees(270.0), (-1.0, 0.0));
        for tenth in -7300..7300 {
            let degrees = f64::from(tenth) * 0.1;
            let (sin, cos) = sin_cos_degrees(degrees);
            let (expected_sin, expected_cos) = degrees.to_radians().sin_cos();
            assert!((sin - expected_sin).abs() < 1e-14 && (cos - expected_cos).abs() < 1e-14, "{degrees}");
        }
    }
}
