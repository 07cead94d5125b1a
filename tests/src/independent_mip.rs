//! A maximum intensity projection in double precision that shares nothing with the library: neither its
//! geometry nor its arithmetic. It judges whole pictures.
//!
//! What it computes follows from the method alone: one ray per voxel of the two base axes, one sample plane
//! per voxel slice, trilinear interpolation, the maximum along the ray, and a bilinear warp to the picture,
//! zero outside.

/// An affine matrix as four columns of four, as OpenGL orders them; the last one is the translation.
pub type Columns = [[f64; 4]; 4];

/// What is shown, and from where.
pub struct Scene<Voxels> {
    /// Value of voxel (i, j, k).
    pub voxels: Voxels,
    /// Voxels along i, j and k.
    pub size: [usize; 3],
    /// Model matrix: voxel indices to world.
    pub world_from_voxel: Columns,
    /// View matrix: world to camera, which looks along -z with +y up.
    pub camera_from_world: Columns,
    /// Half the image height in world units.
    pub half_height: f64,
    /// Values shown as black and as white.
    pub range: [f64; 2],
}

/// Distance in voxels by which a sample may miss the volume: rounding errors only.
const TOLERANCE: f64 = 1e-6;

/// Renders a picture of `width` x `height` pixels: grey 0..255 row by row, row 0 on top.
pub fn maximum_intensity<Voxels>(scene: &Scene<Voxels>, [width, height]: [usize; 2]) -> Vec<f64>
where
    Voxels: Fn(usize, usize, usize) -> f64,
{
    let camera_from_voxel = product(&scene.camera_from_world, &scene.world_from_voxel);
    let rays = Rays::new(&camera_from_voxel, scene.size);
    let plane: Vec<f64> = (0..rays.count[1])
        .flat_map(|row| (0..rays.count[0]).map(move |column| [column, row]))
        .map(|ray| rays.maximum(ray, scene).map_or(0.0, |value| grey(value, scene.range)))
        .collect();

    let pixel = 2.0 * scene.half_height / height as f64;
    let mut picture = Vec::with_capacity(width * height);
    for row in 0..height {
        for column in 0..width {
            let x = (column as f64 + 0.5 - width as f64 / 2.0) * pixel;
            let y = (height as f64 / 2.0 - row as f64 - 0.5) * pixel;
            picture.push(bilinear(rays.at(&camera_from_voxel, [x, y]), rays.count, |column, row| {
                plane[row * rays.count[0] + column]
            }));
        }
    }
    picture
}

/// Root mean square difference of two pictures.
pub fn root_mean_square_error(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "pictures of different sizes");
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (sum / a.len() as f64).sqrt()
}

/// The rays of a view. Ray (0, 0) passes the nearest slice at voxel `first` of the base axes.
struct Rays {
    /// The two base axes and the principal axis, as voxel axes.
    axes: [usize; 3],
    /// Voxels along them that a ray advances per slice of increasing index.
    slope: [f64; 2],
    /// Index of the slice nearest to the camera.
    nearest: usize,
    first: [isize; 2],
    count: [usize; 2],
}

impl Rays {
    fn new(camera_from_voxel: &Columns, size: [usize; 3]) -> Self {
        let direction = solve(camera_from_voxel, [0.0, 0.0, -1.0]);
        let largest = direction.iter().fold(0.0_f64, |largest, component| largest.max(component.abs()));
        let is_principal = |axis: &usize| direction[*axis].abs() >= largest * (1.0 - 1e-9);
        let principal = (0..3).rfind(is_principal).unwrap_or(2);
        let axes = [(principal + 1) % 3, (principal + 2) % 3, principal];
        let slope = [0, 1].map(|base| direction[axes[base]] / direction[principal]);
        let nearest = if direction[principal] > 0.0 { 0 } else { size[principal] - 1 };
        let farthest = size[principal] - 1 - nearest;

        let mut first = [0; 2];
        let mut count = [0; 2];
        for base in 0..2 {
            let advance = slope[base] * (farthest as f64 - nearest as f64);
            let last = (size[axes[base]] - 1) as f64 - advance.min(0.0);
            first[base] = (-advance.max(0.0)).floor() as isize;
            count[base] = (last.ceil() as isize - first[base] + 1) as usize;
        }
        Self { axes, slope, nearest, first, count }
    }

    /// The largest sample of a ray, if it has any.
    fn maximum<Voxels>(&self, ray: [usize; 2], scene: &Scene<Voxels>) -> Option<f64>
    where
        Voxels: Fn(usize, usize, usize) -> f64,
    {
        let [a, b, principal] = self.axes;
        let samples = (0..scene.size[principal]).filter_map(|slice| {
            let advance = slice as f64 - self.nearest as f64;
            let mut position = [0.0; 2];
            for base in 0..2 {
                let last = (scene.size[self.axes[base]] - 1) as f64;
                let along = ray[base] as f64 + self.first[base] as f64 + self.slope[base] * advance;
                if along < -TOLERANCE || along > last + TOLERANCE {
                    return None;
                }
                position[base] = along.clamp(0.0, last);
            }
            // The sample lies in a slice of voxels: the third weight of the trilinear interpolation is 0.
            Some(bilinear(position, [scene.size[a], scene.size[b]], |i, j| {
                let mut voxel = [0; 3];
                voxel[a] = i;
                voxel[b] = j;
                voxel[principal] = slice;
                (scene.voxels)(voxel[0], voxel[1], voxel[2])
            }))
        });
        samples.fold(None, |largest, sample| Some(largest.map_or(sample, |largest: f64| largest.max(sample))))
    }

    /// Column and row of the ray that the camera sees at (x, y).
    fn at(&self, camera_from_voxel: &Columns, [x, y]: [f64; 2]) -> [f64; 2] {
        let [a, b, principal] = self.axes.map(|axis| camera_from_voxel[axis]);
        let depth = self.nearest as f64;
        let right = [0, 1].map(|row| [x, y][row] - camera_from_voxel[3][row] - depth * principal[row]);
        let determinant = a[0] * b[1] - b[0] * a[1];
        let i = (right[0] * b[1] - b[0] * right[1]) / determinant;
        let j = (a[0] * right[1] - right[0] * a[1]) / determinant;
        [i - self.first[0] as f64, j - self.first[1] as f64]
    }
}

fn grey(value: f64, [low, high]: [f64; 2]) -> f64 {
    if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) * 255.0 } else { 0.0 }
}

/// Bilinear interpolation on a grid of `count` points, zero outside.
fn bilinear([x, y]: [f64; 2], count: [usize; 2], point: impl Fn(usize, usize) -> f64) -> f64 {
    let mut sum = 0.0;
    for (column, weight_x) in [(x.floor(), 1.0 - (x - x.floor())), (x.floor() + 1.0, x - x.floor())] {
        for (row, weight_y) in [(y.floor(), 1.0 - (y - y.floor())), (y.floor() + 1.0, y - y.floor())] {
            let inside = column >= 0.0 && row >= 0.0 && column < count[0] as f64 && row < count[1] as f64;
            if inside && weight_x * weight_y > 0.0 {
                sum += weight_x * weight_y * point(column as usize, row as usize);
            }
        }
    }
    sum
}

fn product(a: &Columns, b: &Columns) -> Columns {
    b.map(|column| [0, 1, 2, 3].map(|row| (0..4).map(|inner| a[inner][row] * column[inner]).sum()))
}

/// The vector that the linear part of `matrix` maps to `image`, by Cramer's rule.
fn solve(matrix: &Columns, image: [f64; 3]) -> [f64; 3] {
    let columns = [matrix[0], matrix[1], matrix[2]].map(|column| [column[0], column[1], column[2]]);
    let determinant = |[a, b, c]: [[f64; 3]; 3]| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    [0, 1, 2].map(|axis| {
        let mut replaced = columns;
        replaced[axis] = image;
        determinant(replaced) / determinant(columns)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTITY: Columns =
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    /// 0.5 x 2 x 1 mm, slices lean, left-handed, somewhere else.
    const OBLIQUE: Columns =
        [[0.5, 0.0, 0.0, 0.0], [0.0, -2.0, 0.0, 0.0], [0.3, 0.2, 1.0, 0.0], [40.0, -7.0, 11.0, 1.0]];

    fn apply(matrix: &Columns, point: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|row| (0..3).map(|axis| matrix[axis][row] * point[axis]).sum::<f64>() + matrix[3][row])
    }

    /// View of the point `centre`, turned about its y axis and then about its x axis.
    fn view(centre: [f64; 3], about_y: f64, about_x: f64) -> Columns {
        let (sin_y, cos_y) = about_y.to_radians().sin_cos();
        let (sin_x, cos_x) = about_x.to_radians().sin_cos();
        let mut turned = product(
            &[
                [1.0, 0.0, 0.0, 0.0],
                [0.0, cos_x, sin_x, 0.0],
                [0.0, -sin_x, cos_x, 0.0],
                [0.0, 0.0, 0.0, 1.0],
            ],
            &[
                [cos_y, 0.0, -sin_y, 0.0],
                [0.0, 1.0, 0.0, 0.0],
                [sin_y, 0.0, cos_y, 0.0],
                [0.0, 0.0, 0.0, 1.0],
            ],
        );
        turned[3] = [0.0, 0.0, 0.0, 1.0];
        let moved = apply(&turned, centre);
        turned[3] = [-moved[0], -moved[1], -moved[2], 1.0];
        turned
    }

    fn scene<V: Fn(usize, usize, usize) -> f64>(
        voxels: V,
        size: [usize; 3],
        model: Columns,
        [about_y, about_x]: [f64; 2],
    ) -> Scene<V> {
        let centre = apply(&model, size.map(|voxels| (voxels - 1) as f64 / 2.0));
        let camera_from_world = view(centre, about_y, about_x);
        Scene {
            voxels,
            size,
            world_from_voxel: model,
            camera_from_world,
            half_height: 16.0,
            range: [0.0, 1.0],
        }
    }

    const VIEWS: [[f64; 2]; 10] = [
        [0.0, 0.0],
        [90.0, 0.0],
        [180.0, 0.0],
        [0.0, 90.0],
        [0.0, -90.0],
        [45.0, 0.0],
        [30.0, 20.0],
        [-110.0, 35.0],
        [200.0, -50.0],
        [77.0, 77.0],
    ];

    #[test]
    fn a_bright_voxel_is_seen_where_the_camera_says() {
        let size = [12, 7, 9];
        for model in [IDENTITY, OBLIQUE] {
            for angles in VIEWS {
                for bright in [[2, 1, 6], [9, 5, 1], [6, 3, 4]] {
                    let only = |i, j, k| f64::from(u8::from([i, j, k] == bright));
                    let scene = scene(only, size, model, angles);
                    let picture = maximum_intensity(&scene, [320, 240]);
                    let expected =
                        apply(&product(&scene.camera_from_world, &model), bright.map(|index| index as f64));
                    // 240 rows show 32 mm.
                    let expected = [159.5 + expected[0] * 7.5, 119.5 - expected[1] * 7.5];
                    let total: f64 = picture.iter().sum();
                    assert!(total > 0.0, "{angles:?}");
                    let mean = |coordinate: fn(usize) -> usize| {
                        let weighted =
                            picture.iter().enumerate().map(|(place, grey)| coordinate(place) as f64 * grey);
                        weighted.sum::<f64>() / total
                    };
                    // Interpolation keeps the centre; the grid of pixels moves it by a fraction of one.
                    let seen = [mean(|place| place % 320), mean(|place| place / 320)];
                    let error = (seen[0] - expected[0]).hypot(seen[1] - expected[1]);
                    assert!(error < 0.25, "{angles:?}: {seen:?} is not {expected:?}");
                }
            }
        }
    }

    #[test]
    fn a_slab_covers_its_columns_and_fades_within_a_voxel() {
        // Columns 3..=5 of 9 are bright; one voxel is one pixel, and the middle voxel the middle pixel.
        let slab = |i: usize, _, _| if (3..=5).contains(&i) { 0.5 } else { 0.0 };
        let mut scene = scene(slab, [9, 5, 4], IDENTITY, [0.0, 0.0]);
        scene.half_height = 5.5;
        let picture = maximum_intensity(&scene, [11, 11]);
        for (place, grey) in picture.iter().enumerate() {
            let [column, row] = [place % 11, place / 11];
            let bright = (4..=6).contains(&column) && (3..=7).contains(&row);
            assert_eq!(*grey, if bright { 127.5 } else { 0.0 }, "{column}, {row}");
        }
    }

    #[test]
    fn a_solid_volume_is_its_outline() {
        for angles in VIEWS {
            let scene = scene(|_, _, _| 1.0, [8, 8, 8], IDENTITY, angles);
            let picture = maximum_intensity(&scene, [256, 256]);
            let per_pixel = 32.0 / 256.0;
            let camera_from_voxel = scene.camera_from_world;
            let direction = solve(&camera_from_voxel, [0.0, 0.0, -1.0]);
            for (place, grey) in picture.iter().enumerate() {
                let x = ((place % 256) as f64 - 127.5) * per_pixel;
                let y = (127.5 - (place / 256) as f64) * per_pixel;
                let near = [-1.5, 1.5].map(|margin| {
                    let point = solve(&camera_from_voxel, [x, y, 0.0]).map(|along| along + 3.5);
                    hits_box(point, direction, -margin, 7.0 + margin)
                });
                // Within 1.5 voxels of the outline anything between is right.
                match near {
                    [true, _] => assert!((grey - 255.0).abs() < 1e-9, "{angles:?}: {grey} at {x}, {y}"),
                    [_, false] => assert_eq!(*grey, 0.0, "{angles:?} at {x}, {y}"),
                    _ => assert!((0.0..=255.0 + 1e-9).contains(grey)),
                }
            }
        }
    }

    /// Whether a line meets the cube from `low` to `high`.
    fn hits_box(point: [f64; 3], direction: [f64; 3], low: f64, high: f64) -> bool {
        let mut range = [f64::NEG_INFINITY, f64::INFINITY];
        for axis in 0..3 {
            if direction[axis].abs() < 1e-12 {
                if point[axis] < low || point[axis] > high {
                    return false;
                }
                continue;
            }
            let mut ends = [low, high].map(|plane| (plane - point[axis]) / direction[axis]);
            ends.sort_by(f64::total_cmp);
            range = [range[0].max(ends[0]), range[1].min(ends[1])];
        }
        range[0] <= range[1]
    }

    #[test]
    fn the_largest_sample_wins_and_the_range_is_clamped() {
        let ramp = |_, _, k: usize| k as f64;
        for (range, expected) in
            [([0.0, 10.0], 127.5), ([1.0, 5.0], 255.0), ([6.0, 8.0], 0.0), ([5.0, 5.0], 0.0)]
        {
            for angles in [[0.0, 0.0], [180.0, 0.0]] {
                let mut scene = scene(ramp, [7, 7, 6], IDENTITY, angles);
                scene.range = range;
                let picture = maximum_intensity(&scene, [33, 33]);
                assert_eq!(picture[16 * 33 + 16], expected, "{range:?}");
            }
        }
    }

    #[test]
    fn a_wrong_camera_is_far_off() {
        let ball = |centre: [f64; 3], radius: f64, [i, j, k]: [usize; 3]| {
            let distance = ((i as f64 - centre[0]).powi(2)
                + (j as f64 - centre[1]).powi(2)
                + (k as f64 - centre[2]).powi(2))
            .sqrt();
            (radius + 0.5 - distance).clamp(0.0, 1.0)
        };
        let voxels = |i, j, k| {
            let at = [i, j, k];
            ball([6.0, 8.0, 9.0], 4.0, at)
                .max(0.7 * ball([16.0, 14.0, 5.0], 5.0, at))
                .max(0.4 * ball([11.0, 4.0, 17.0], 3.0, at))
        };
        let picture =
            |model, angles| maximum_intensity(&scene(voxels, [24, 20, 22], model, angles), [96, 96]);
        let right = picture(IDENTITY, [30.0, 20.0]);
        assert_eq!(root_mean_square_error(&right, &right), 0.0);
        for angles in [[-30.0, 20.0], [30.0, -20.0], [210.0, 20.0], [20.0, 30.0]] {
            let error = root_mean_square_error(&right, &picture(IDENTITY, angles));
            assert!(error > 10.0, "{angles:?}: {error}");
        }
        let mut mirrored = IDENTITY;
        mirrored[0][0] = -1.0;
        assert!(root_mean_square_error(&right, &picture(mirrored, [30.0, 20.0])) > 10.0);
    }
}
