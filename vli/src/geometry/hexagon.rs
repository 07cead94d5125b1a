use glam::{DVec2, DVec3};

use super::{BasePlane, ShearWarp};

/// The outline of a volume's box, to be drawn with the base plane as its texture.
///
/// Vertices go around the outline. Seen in the texture, the back face of the box is the rectangle of
/// vertices 0, 1, *, 5 and the front face that of *, 2, 3, 4, moved against each other by the shear: edges 0-1
/// and 3-4 are horizontal, 2-3 and 5-0 vertical. Vertices 0 and 3 are opposite corners of the box. Seen along
/// an axis, vertices coincide in pairs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hexagon {
    /// Corners of the box in camera space, millimetres.
    pub vertices: [DVec3; 6],
    /// Texture coordinates of the vertices: 0..1 over [`Self::texture_size`], row 0 at 0. A pixel's centre is
    /// half a pixel behind its edge, as in OpenGL.
    pub texture: [DVec2; 6],
    /// Columns and rows of the texture, powers of two; the base plane lies in it from column 0, row 0.
    pub texture_size: [u32; 2],
}

impl Hexagon {
    /// The outline of the box that `view` shows, for a texture that begins with `plane`. Texture coordinates
    /// are inside 0..1 if the plane is [`ShearWarp::base_plane_with_margin`].
    #[must_use]
    pub fn new(view: &ShearWarp, plane: &BasePlane) -> Self {
        let [x, y, z] = view.permuted_size().map(|voxels| f64::from(voxels - 1));
        let corners = [[0.0, 0.0, z], [x, 0.0, z], [x, 0.0, 0.0], [x, y, 0.0], [0.0, y, 0.0], [0.0, y, z]];
        let [shear_x, shear_y] = view.shear();
        let pixel_from_ray = plane.pixel_from_ray();
        let texture_size = plane.size().map(u32::next_power_of_two);
        let scale = DVec2::from_array(texture_size.map(f64::from));
        Self {
            vertices: corners
                .map(|corner| view.camera_from_permuted().transform_point3(DVec3::from_array(corner))),
            texture: corners.map(|[x, y, z]| {
                let ray = DVec2::new(x - shear_x * z, y - shear_y * z);
                (pixel_from_ray.transform_point2(ray) + 0.5) / scale
            }),
            texture_size,
        }
    }
}
