//! The warp of a base plane to the picture: what the companion graphics card of the paper (section 2) does
//! by texture mapping, in integers, so that every machine shows the same picture.

use glam::DAffine2;

use crate::geometry::ImageSize;

/// Fraction bits of a position in the base plane, and of the bilinear weights.
const FRACTION: u32 = 16;
/// One pixel in that format.
const ONE: f64 = (1_u32 << FRACTION) as f64;
/// Pixels whose places in the base plane are computed together.
const BLOCK: usize = 16;
/// The weights of four neighbours sum to this.
const UNITY: u64 = 1 << (2 * FRACTION);

/// Why a base plane cannot be warped.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WarpError {
    /// The pixels do not hold the rows they are said to hold.
    #[error("base plane: {length} bytes are not {height} rows of {width} pixels, {pitch} bytes apart")]
    Pixels {
        /// Bytes given.
        length: usize,
        /// Pixels per row.
        width: u32,
        /// Rows.
        height: u32,
        /// Bytes from row to row.
        pitch: usize,
    },
}

/// A rendered base plane: premultiplied colour and opacity, bytes R, G, B, A per pixel.
#[derive(Clone, Copy, Debug)]
pub struct BasePlanePixels<'a> {
    pixels: &'a [u8],
    size: [u32; 2],
    pitch: usize,
}

impl<'a> BasePlanePixels<'a> {
    /// `size` columns and rows of pixels, `pitch` bytes from one row to the next. An empty plane is legal.
    ///
    /// # Errors
    /// The rows overlap, or reach beyond `pixels`.
    pub fn new(pixels: &'a [u8], size: [u32; 2], pitch: usize) -> Result<Self, WarpError> {
        let [width, height] = size;
        let row = width as usize * 4;
        let needed = match height {
            0 => Some(0),
            _ => pitch.checked_mul(height as usize - 1).and_then(|rows| rows.checked_add(row)),
        };
        if pitch >= row && needed.is_some_and(|needed| needed <= pixels.len()) {
            Ok(Self { pixels, size, pitch })
        } else {
            Err(WarpError::Pixels { length: pixels.len(), width, height, pitch })
        }
    }

    /// Pixel at (`column`, `row`); transparent outside of the plane.
    fn at(&self, column: i64, row: i64) -> [u8; 4] {
        let inside =
            (0..i64::from(self.size[0])).contains(&column) && (0..i64::from(self.size[1])).contains(&row);
        let place = if inside { row as usize * self.pitch + column as usize * 4 } else { usize::MAX };
        self.pixels.get(place..).and_then(<[u8]>::first_chunk).copied().unwrap_or_default()
    }

    /// Pixels at (`column`, `row`) and to the right of it, as the bytes of a word.
    fn pair(&self, column: i64, row: i64) -> u64 {
        let [left, right] = [column, column + 1].map(|column| u32::from_le_bytes(self.at(column, row)));
        u64::from(left) | u64::from(right) << 32
    }

    /// Two pixels that are in the plane and lie side by side, as the bytes of a word.
    #[inline(always)]
    fn word(&self, place: usize) -> u64 {
        self.pixels.get(place..).and_then(<[u8]>::first_chunk).map_or(0, |pair| u64::from_le_bytes(*pair))
    }

    /// The four neighbours of a position as [`fixed`] gives it; `None` where there are none, or all are zero.
    #[inline(always)]
    fn neighbours(&self, x: i64, y: i64) -> Option<Neighbours> {
        let [column, row] = [(x >> FRACTION) - 1, (y >> FRACTION) - 1];
        let [width, height] = self.size.map(i64::from);
        let (upper, lower) = if (0..width - 1).contains(&column) && (0..height - 1).contains(&row) {
            let place = row as usize * self.pitch + column as usize * 4;
            (self.word(place), self.word(place + self.pitch))
        } else if (-1..width).contains(&column) && (-1..height).contains(&row) {
            (self.pair(column, row), self.pair(column, row + 1))
        } else {
            return None;
        };
        let [right, below] = [x, y].map(|value| value as u32 & ((1 << FRACTION) - 1));
        (upper | lower != 0).then_some(Neighbours { upper, lower, right, below })
    }
}

/// Positions `start + step * (first + i)` along an axis of `size` pixels, in fractions and shifted by one pixel. What
/// is outside is -1 or lies behind one pixel more than there are.
#[inline(always)]
fn fixed(start: f64, step: f64, first: f64, size: u32) -> [i64; BLOCK] {
    // A sum of this order has whole numbers in its last bits.
    const BIAS: f64 = 1.5 * (1_u64 << 52) as f64;
    // One pixel beyond the plane is interpolated with zero.
    let end = (f64::from(size) + 1.0) * ONE;
    let mut positions = [0; BLOCK];
    for (place, position) in positions.iter_mut().enumerate() {
        // Every position is computed for itself: errors do not add up along a row.
        let shifted = (step * (first + place as f64) + start + 1.0) * ONE + 0.5;
        // No number becomes -1, too.
        let whole = shifted.floor().max(-1.0).min(end);
        *position = (whole + BIAS).to_bits().wrapping_sub(BIAS.to_bits()).cast_signed();
    }
    positions
}

/// Pixels of the upper and of the lower row, left and right in a word, and the weights of the right and lower ones.
#[derive(Clone, Copy)]
struct Neighbours {
    upper: u64,
    lower: u64,
    right: u32,
    below: u32,
}

impl Neighbours {
    /// Bilinear interpolation, with weights that sum to [`UNITY`].
    fn bilinear(self) -> [u64; 4] {
        let [left, above] = [self.right, self.below].map(|weight| (1 << FRACTION) - weight);
        core::array::from_fn(|channel| {
            let across = |pair: u64| {
                let pair = pair.to_le_bytes();
                u32::from(pair[channel]) * left + u32::from(pair[channel + 4]) * self.right
            };
            u64::from(across(self.upper)) * u64::from(above)
                + u64::from(across(self.lower)) * u64::from(self.below)
        })
    }

    /// [`bilinear`](Self::bilinear), where a pixel's channels are one vector of 64-bit integers.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    #[inline]
    fn bilinear_avx2(self) -> [u64; 4] {
        use core::arch::x86_64::*;
        let [left, above] = [self.right, self.below].map(|weight| (1 << FRACTION) - weight);
        let weights = |weight: u32| _mm256_set1_epi64x(weight.into());
        let weighted = |a, weight_a, b, weight_b| {
            _mm256_add_epi64(_mm256_mul_epu32(a, weights(weight_a)), _mm256_mul_epu32(b, weights(weight_b)))
        };
        let channels = |pixel: u64| _mm256_cvtepu8_epi64(_mm_cvtsi64_si128(pixel.cast_signed()));
        let across = |pair| weighted(channels(pair), left, channels(pair >> 32), self.right);
        let sum = weighted(across(self.upper), above, across(self.lower), self.below);
        let [low, high] = [_mm256_castsi256_si128(sum), _mm256_extracti128_si256::<1>(sum)];
        [
            _mm_cvtsi128_si64(low),
            _mm_extract_epi64::<1>(low),
            _mm_cvtsi128_si64(high),
            _mm_extract_epi64::<1>(high),
        ]
        .map(i64::cast_unsigned)
    }
}

/// What lies behind the volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Background {
    /// A colour: pixels are R, G, B = C + (1 - A) * background.
    Color([u8; 3]),
    /// Nothing: pixels are R, G, B, A with R, G, B = round(255 * C / A), 0 where A is 0.
    Transparent,
}

impl Background {
    /// Bytes per pixel of a picture: 3 or 4.
    #[must_use]
    pub const fn channels(self) -> usize {
        match self {
            Self::Color(_) => 3,
            Self::Transparent => 4,
        }
    }
}

/// Warps a base plane to a picture: row 0 on top, no gaps, [`Background::channels`] bytes per pixel.
///
/// Interpolation is bilinear on premultiplied colour, zero outside of the base plane.
/// `image_from_base_plane` is that of [`ShearWarp`](crate::geometry::ShearWarp). A map without inverse, which
/// shows the plane edge-on, or one that is not finite, shows the background alone.
#[must_use]
pub fn warp(
    plane: &BasePlanePixels<'_>,
    image_from_base_plane: &DAffine2,
    size: ImageSize,
    background: Background,
) -> Vec<u8> {
    #[cfg(target_arch = "x86_64")]
    if std::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has what the function is compiled for.
        return unsafe { warp_avx2(plane, image_from_base_plane, size, background) };
    }
    warp_with(plane, image_from_base_plane, size, background, Neighbours::bilinear)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn warp_avx2(
    plane: &BasePlanePixels<'_>,
    image_from_base_plane: &DAffine2,
    size: ImageSize,
    background: Background,
) -> Vec<u8> {
    warp_with(plane, image_from_base_plane, size, background, |neighbours| neighbours.bilinear_avx2())
}

/// The warp, with one of two ways to do the same arithmetic.
#[inline(always)]
fn warp_with(
    plane: &BasePlanePixels<'_>,
    image_from_base_plane: &DAffine2,
    size: ImageSize,
    background: Background,
    bilinear: impl Fn(Neighbours) -> [u64; 4],
) -> Vec<u8> {
    let base_plane_from_image = image_from_base_plane.inverse();
    let pixels = size.width() as usize * size.height() as usize;
    match background {
        Background::Color(color) => {
            let mut picture = color.repeat(pixels);
            if color == [0; 3] {
                rows(plane, &base_plane_from_image, size, &mut picture, |it| over_black(bilinear(it)));
            } else {
                rows(plane, &base_plane_from_image, size, &mut picture, |it| over(bilinear(it), color));
            }
            picture
        }
        Background::Transparent => {
            let mut picture = vec![0; 4 * pixels];
            rows(plane, &base_plane_from_image, size, &mut picture, |it| unpremultiplied(bilinear(it)));
            picture
        }
    }
}

/// Draws what is not background, row by row.
#[inline(always)]
fn rows<const CHANNELS: usize>(
    plane: &BasePlanePixels<'_>,
    base_plane_from_image: &DAffine2,
    size: ImageSize,
    picture: &mut [u8],
    draw: impl Fn(Neighbours) -> [u8; CHANNELS],
) {
    let DAffine2 { matrix2, translation } = *base_plane_from_image;
    for (row, pixels) in picture.chunks_exact_mut(size.width() as usize * CHANNELS).enumerate() {
        let start = matrix2.y_axis * row as f64 + translation;
        let step = matrix2.x_axis;
        for (block, pixels) in pixels.as_chunks_mut().0.chunks_mut(BLOCK).enumerate() {
            let first = (block * BLOCK) as f64;
            let x = fixed(start.x, step.x, first, plane.size[0]);
            let y = fixed(start.y, step.y, first, plane.size[1]);
            for (pixel, (x, y)) in pixels.iter_mut().zip(x.iter().zip(&y)) {
                if let Some(neighbours) = plane.neighbours(*x, *y) {
                    *pixel = draw(neighbours);
                }
            }
        }
    }
}

/// Colour over black: as [`over`], where 255 is a factor of everything and cancels out.
#[inline(always)]
fn over_black([red, green, blue, _]: [u64; 4]) -> [u8; 3] {
    [red, green, blue].map(|color| ((color + UNITY / 2) / UNITY) as u8)
}

/// Colour over a background, rounded once. More colour than opacity, which sums can have, saturates.
fn over([red, green, blue, alpha]: [u64; 4], background: [u8; 3]) -> [u8; 3] {
    let behind = 255 * UNITY - alpha;
    let composite = |color: u64, background: u8| {
        let sum = (color * 255 + behind * u64::from(background) + 255 * UNITY / 2) / (255 * UNITY);
        sum.min(255) as u8
    };
    [composite(red, background[0]), composite(green, background[1]), composite(blue, background[2])]
}

/// Colour without its opacity, and the opacity.
fn unpremultiplied([red, green, blue, alpha]: [u64; 4]) -> [u8; 4] {
    let opacity = (alpha + UNITY / 2) / UNITY;
    if opacity == 0 {
        return [0; 4];
    }
    let color = |color: u64| ((color * 255 + alpha / 2) / alpha).min(255) as u8;
    [color(red), color(green), color(blue), opacity as u8]
}

#[cfg(test)]
mod tests {
    use glam::{DMat2, DVec2};
    use proptest::prelude::*;

    use super::*;

    fn size(width: u32, height: u32) -> ImageSize {
        ImageSize::new(width, height).unwrap()
    }

    fn shift(x: f64, y: f64) -> DAffine2 {
        DAffine2::from_translation(DVec2::new(x, y))
    }

    /// Two rows of two pixels with a gap behind each row.
    const PLANE: [u8; 22] = [
        200, 100, 0, 200, 40, 50, 60, 100, 9, 9, 9, // row 0
        255, 255, 255, 255, 0, 0, 0, 0, 9, 9, 9, // row 1
    ];

    fn plane() -> BasePlanePixels<'static> {
        BasePlanePixels::new(&PLANE, [2, 2], 11).unwrap()
    }

    #[test]
    fn planes_that_are_not_there_are_refused() {
        for (size, pitch) in
            [([2, 3], 11), ([3, 2], 11), ([2, 2], 15), ([2, 2], usize::MAX), ([u32::MAX; 2], 11)]
        {
            assert!(BasePlanePixels::new(&PLANE, size, pitch).is_err(), "{size:?}, {pitch}");
        }
        let error = BasePlanePixels::new(&PLANE, [4, 2], 12).unwrap_err();
        assert_eq!(error.to_string(), "base plane: 22 bytes are not 2 rows of 4 pixels, 12 bytes apart");
        // The last row needs no gap behind it.
        assert!(BasePlanePixels::new(&PLANE[..19], [2, 2], 11).is_ok());
    }

    #[test]
    fn nothing_to_see_is_background() {
        let empty = BasePlanePixels::new(&[], [0, 0], 0).unwrap();
        let edge_on = DAffine2 { matrix2: DMat2::from_diagonal(DVec2::X), translation: DVec2::ZERO };
        let shows = |plane, map| warp(&plane, &map, size(3, 2), Background::Color([1, 2, 3]));
        assert_eq!(shows(empty, DAffine2::IDENTITY), [1, 2, 3].repeat(6));
        for map in [edge_on, DAffine2::ZERO, DAffine2::NAN, shift(1e300, 0.0), shift(f64::INFINITY, 0.0)] {
            assert_eq!(shows(plane(), map), [1, 2, 3].repeat(6), "{map}");
        }
        assert_eq!(warp(&plane(), &edge_on, size(3, 2), Background::Transparent), [0; 24]);
    }

    #[test]
    fn whole_positions_show_pixels_themselves() {
        let black = warp(&plane(), &DAffine2::IDENTITY, size(3, 2), Background::Color([0; 3]));
        assert_eq!(black, [200, 100, 0, 40, 50, 60, 0, 0, 0, 255, 255, 255, 0, 0, 0, 0, 0, 0]);
        // 40 + (1 - 100/255) * 10 = 46.08; 60 + (1 - 100/255) * 200 = 181.57.
        let color = warp(&plane(), &shift(-1.0, 0.0), size(1, 2), Background::Color([10, 0, 200]));
        assert_eq!(color, [46, 50, 182, 10, 0, 200]);
        // 255 * 40 / 100 = 102; 255 * 50 / 100 = 127.5; 255 * 60 / 100 = 153.
        let transparent = warp(&plane(), &DAffine2::IDENTITY, size(2, 2), Background::Transparent);
        assert_eq!(transparent, [255, 128, 0, 200, 102, 128, 153, 100, 255, 255, 255, 255, 0, 0, 0, 0]);
    }

    #[test]
    fn borders_fade_to_zero_within_a_pixel() {
        let white = [255; 4];
        let plane = BasePlanePixels::new(&white, [1, 1], 4).unwrap();
        let stretched =
            DAffine2 { matrix2: DMat2::from_diagonal(DVec2::splat(4.0)), translation: DVec2::splat(4.0) };
        let picture = warp(&plane, &stretched, size(9, 9), Background::Color([0; 3]));
        let middle_row: Vec<u8> = picture[4 * 27..5 * 27].iter().copied().step_by(3).collect();
        assert_eq!(middle_row, [0, 64, 128, 191, 255, 191, 128, 64, 0]);
        // A colour keeps its hue where it fades.
        let faded = warp(&plane, &stretched, size(9, 9), Background::Transparent);
        assert_eq!(&faded[(4 * 9 + 2) * 4..][..4], [255, 255, 255, 128]);
    }

    #[test]
    fn more_colour_than_opacity_saturates() {
        let pixel = [255, 200, 10, 20];
        let plane = BasePlanePixels::new(&pixel, [1, 1], 4).unwrap();
        let show = |background| warp(&plane, &DAffine2::IDENTITY, size(1, 1), background);
        assert_eq!(show(Background::Color([255; 3])), [255, 255, 245]);
        assert_eq!(show(Background::Transparent), [255, 255, 128, 20]);
    }

    /// Bilinear interpolation by the book.
    fn expected(pixels: &[u8], [width, height]: [u32; 2], at: DVec2, channel: usize) -> f64 {
        let mut sum = 0.0;
        for row in 0..height {
            for column in 0..width {
                let tent = |distance: f64| (1.0 - distance.abs()).max(0.0);
                let weight = tent(at.x - f64::from(column)) * tent(at.y - f64::from(row));
                sum += weight * f64::from(pixels[((row * width + column) * 4) as usize + channel]);
            }
        }
        sum
    }

    proptest! {
        #[cfg(target_arch = "x86_64")]
        #[test]
        fn vectors_interpolate_as_numbers_do(
            upper in any::<u64>(), lower in any::<u64>(), right in 0..1_u32 << FRACTION, below in 0..1_u32 << FRACTION,
        ) {
            prop_assume!(std::is_x86_feature_detected!("avx2"));
            for (right, below) in [(right, below), (0, below), (right, 0), (right, 0xffff), (0xffff, below)] {
                let neighbours = Neighbours { upper, lower, right, below };
                // SAFETY: the processor has what the function is compiled for.
                prop_assert_eq!(unsafe { neighbours.bilinear_avx2() }, neighbours.bilinear());
            }
        }

        #[test]
        fn black_is_a_background_like_others(sums in prop::array::uniform4(0..=255 * UNITY)) {
            prop_assert_eq!(over_black(sums), over(sums, [0; 3]));
        }

        #[test]
        fn interpolation_is_bilinear(
            plane_size in [1..6_u32, 1..6_u32],
            pixels in prop::collection::vec(any::<u8>(), 5 * 5 * 4),
            axes in prop::array::uniform4(-4.0..4.0_f64), translation in [-5.0..20.0_f64, -5.0..20.0_f64],
            background in any::<[u8; 3]>(),
        ) {
            let map = DAffine2 { matrix2: DMat2::from_cols_array(&axes), translation: DVec2::from_array(translation) };
            prop_assume!(map.matrix2.determinant().abs() > 1e-3);
            let plane = BasePlanePixels::new(&pixels, plane_size, plane_size[0] as usize * 4).unwrap();
            let colors = warp(&plane, &map, size(16, 12), Background::Color(background));
            let clear = warp(&plane, &map, size(16, 12), Background::Transparent);
            for pixel in 0..16 * 12 {
                let at = map.inverse().transform_point2(DVec2::new(f64::from(pixel % 16), f64::from(pixel / 16)));
                let value = |channel| expected(&pixels, plane_size, at, channel);
                // Positions are rounded by half a step on both axes, colours by half; a value changes by at
                // most 255 per pixel along an axis.
                let bound = 0.5 + 255.0 / ONE + 1e-6;
                for channel in 0..3 {
                    let behind = (1.0 - value(3) / 255.0) * f64::from(background[channel]);
                    let color = (value(channel) + behind).min(255.0);
                    let error = f64::from(colors[pixel as usize * 3 + channel]) - color;
                    prop_assert!(error.abs() <= 2.0 * bound - 0.5, "{error}");
                }
                let error = f64::from(clear[pixel as usize * 4 + 3]) - value(3);
                prop_assert!(error.abs() <= bound, "{error}");
            }
        }
    }
}
