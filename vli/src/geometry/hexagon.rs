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

#[cfg(test)]
mod tests {
    use glam::DMat4;
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::scenes::{supersampling, view, volume};
    use crate::geometry::{Supersampling, VolumeBox};

    #[test]
    fn hexagons_of_axis_views_have_vertices_in_pairs() {
        let volume = VolumeBox::new(&DMat4::IDENTITY, [9, 5, 3]).unwrap();
        let view = ShearWarp::new(&volume, &DMat4::IDENTITY, Supersampling::NONE).unwrap();
        let plane = view.base_plane_with_margin();
        assert_eq!(plane.size(), [9, 5]);
        let hexagon = Hexagon::new(&view, &plane);
        let flat = hexagon.vertices.map(|vertex| vertex.truncate());
        assert_eq!(flat[0], flat[5].with_y(0.0));
        assert_eq!([flat[1], flat[4]], [flat[2], flat[5]]);
        assert_eq!(hexagon.texture_size, [16, 8]);
        assert_eq!(hexagon.texture[0], DVec2::new(0.5 / 16.0, 0.5 / 8.0));
        assert_eq!(hexagon.texture[3], DVec2::new(8.5 / 16.0, 4.5 / 8.0));
    }

    proptest! {
        #[test]
        fn hexagons_are_the_outline_of_the_box(
            volume in volume(256), view in view(), supersampling in supersampling(),
        ) {
            let camera_from_world = view;
            let view = ShearWarp::new(&volume, &camera_from_world, supersampling).unwrap();
            let plane = view.base_plane_with_margin();
            let Hexagon { vertices, texture, texture_size } = Hexagon::new(&view, &plane);
            for (texture, plane) in texture_size.into_iter().zip(plane.size()) {
                prop_assert!(texture.is_power_of_two() && texture >= plane && texture < 2 * plane);
            }
            prop_assert!(texture.iter().all(|at| at.min_element() >= 0.0 && at.max_element() <= 1.0), "{:?}", texture);
            prop_assert_eq!(texture[0].x, texture[5].x);
            prop_assert_eq!(texture[0].y, texture[1].y);
            prop_assert_eq!(texture[3].x, texture[2].x);
            prop_assert_eq!(texture[3].y, texture[4].y);
            prop_assert!(texture.iter().all(|at| at.cmpge(texture[0]).all() && at.cmple(texture[3]).all()));

            // Vertices 0 and 3 are opposite, so that their middle is the centre of the volume.
            let centre = camera_from_world.transform_point3(volume.centre());
            prop_assert!(((vertices[0] + vertices[3]) / 2.0 - centre).length() < 1e-8);
            // The seventh corner is the nearest one, and lies in the texture as on the box.
            let nearest = vertices[2] + vertices[0] - vertices[1];
            prop_assert!((nearest - view.camera_from_permuted().w_axis.truncate()).length() < 1e-8);
            let drawn = DVec2::new(texture[4].x, texture[2].y);
            prop_assert!((texture[2] + texture[0] - texture[1] - drawn).length() < 1e-12);

            // The texture is drawn where the software warp puts it.
            let across = [view.camera_from_permuted().x_axis, view.camera_from_permuted().y_axis]
                .into_iter()
                .map(|axis| axis.truncate().truncate().length())
                .sum::<f64>();
            let half_step = 1.0 / f64::from(1 << 23);
            let sample_slices = f64::from((view.permuted_size()[2] - 1) * supersampling.factors()[2]);
            // Steps are rounded by up to 2^-23 voxels, over half of the sample slices.
            let bound = 0.5 * sample_slices * half_step * across + 1e-9;
            for (vertex, at) in vertices.into_iter().zip(texture) {
                let pixel = at * DVec2::from_array(texture_size.map(f64::from)) - 0.5;
                let warped = (view.camera_from_ray() * plane.pixel_from_ray().inverse()).transform_point2(pixel);
                prop_assert!((warped - vertex.truncate()).length() <= bound);
            }
        }
    }
}
