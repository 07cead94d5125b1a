use glam::{DAffine2, DMat2, DVec2};

use super::GeometryError;

/// Size of the picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSize {
    width: u32,
    height: u32,
}

impl ImageSize {
    /// Most pixels per row or column. Our choice: larger pictures would take gigabytes.
    pub const MAXIMUM: u32 = 16_384;

    /// A picture of `width` columns and `height` rows.
    ///
    /// # Errors
    /// Either is 0 or above [`Self::MAXIMUM`].
    pub fn new(width: u32, height: u32) -> Result<Self, GeometryError> {
        let allowed = 1..=Self::MAXIMUM;
        if allowed.contains(&width) && allowed.contains(&height) {
            Ok(Self { width, height })
        } else {
            Err(GeometryError::ImageSize(width, height))
        }
    }

    /// Columns.
    #[must_use]
    pub const fn width(self) -> u32 {
        self.width
    }

    /// Rows.
    #[must_use]
    pub const fn height(self) -> u32 {
        self.height
    }

    /// From camera x and y in millimetres to image pixels: `parallel_scale` is half the image height in
    /// millimetres, the camera looks at the middle of the picture, row 0 is on top, and a pixel's centre has
    /// whole coordinates.
    #[must_use]
    pub fn image_from_camera(self, parallel_scale: f64) -> DAffine2 {
        let (width, height) = (f64::from(self.width), f64::from(self.height));
        let pixels_per_mm = height / (2.0 * parallel_scale);
        DAffine2 {
            matrix2: DMat2::from_diagonal(DVec2::new(pixels_per_mm, -pixels_per_mm)),
            translation: DVec2::new((width - 1.0) * 0.5, (height - 1.0) * 0.5),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_without_pixels_or_beyond_memory_are_refused() {
        for (width, height) in [(0, 1), (1, 0), (16_385, 1), (1, u32::MAX)] {
            assert_eq!(ImageSize::new(width, height), Err(GeometryError::ImageSize(width, height)));
        }
    }

    #[test]
    fn camera_centre_is_the_middle_and_up_is_row_0() {
        let map = ImageSize::new(8, 4).unwrap().image_from_camera(10.0);
        assert_eq!(map.transform_point2(DVec2::ZERO), DVec2::new(3.5, 1.5));
        // The upper edge of the picture is half a pixel above the centres of row 0.
        assert_eq!(map.transform_point2(DVec2::new(20.0, 10.0)), DVec2::new(7.5, -0.5));
    }
}
