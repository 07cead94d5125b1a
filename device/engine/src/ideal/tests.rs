//! Scenes of a few voxels, worked by hand.

use super::shading::{Light, Lighting, Modulation, Phong};
use super::visibility::CutPlane;
use super::*;

/// Value 100 x + 10 y + z, shown as a colour.
fn ramp(size: [usize; 3]) -> Scene<impl Voxels, impl Transfer> {
    Scene {
        size,
        voxels: |[x, y, z]: [usize; 3]| (100 * x + 10 * y + z) as f64,
        transfer: |value: f64| [value / 1024.0, 0.5, value / 512.0, 1.0],
        permutation: Permutation::IDENTITY,
        rays: Rays { start: [0.0; 2], step: [0.0; 2], supersampling: 1, size: [1, 1] },
        visibility: Visibility::EVERYTHING,
        cursor: None,
        shading: Shading::UNLIT,
        blend: BlendMode::Sum,
    }
}

#[test]
fn a_linear_volume_is_sampled_exactly() {
    let scene = ramp([4, 5, 6]);
    for position in [[0.0; 3], [3.0, 4.0, 5.0], [0.5, 3.25, 4.75], [2.999, 0.001, 1.0 / 3.0]] {
        let [x, y, z] = position;
        assert!((scene.sample(position) - (100.0 * x + 10.0 * y + z)).abs() < 1e-9);
    }
    assert_eq!(scene.sample([-7.0, 99.0, 2.0]), 42.0);
}

#[test]
fn samples_exist_from_the_first_voxel_to_the_last() {
    let mut scene = ramp([4, 5, 6]);
    scene.rays = Rays { start: [-1.0, 0.0], step: [0.5, 0.25], supersampling: 2, size: [6, 1] };
    let samples: Vec<u32> = scene.render().iter().map(|ray| ray.samples).collect();
    // Eleven slices; x = -1 + i + j / 2 lies in 0..=3, y = j / 4 in 0..=4.
    assert_eq!(samples, [7, 7, 5, 3, 1, 0]);
}

#[test]
fn supersampled_slices_lie_at_exact_fractions() {
    let mut scene = ramp([1, 1, 4]);
    scene.rays.supersampling = 3;
    let [ray] = scene.render()[..] else { panic!("one ray") };
    // 0 + 1/3 + 2/3 + ... + 3
    assert_eq!(ray.samples, 10);
    assert!((ray.color[0] - 15.0 / 1024.0).abs() < 1e-12);
}

#[test]
fn permuted_axes_run_where_the_permutation_says() {
    let mut scene = ramp([3, 4, 5]);
    scene.permutation = Permutation::from_word(0x016).unwrap(); // x = -z, y = y, z = x
    scene.rays.start = [1.0, 2.0];
    scene.blend = BlendMode::Minimum;
    // The first slice is object x = 0; permuted x = 1 is z = 3.
    assert_eq!(scene.pixels(), [[23.0 / 1024.0, 0.5, 23.0 / 512.0, 1.0]]);
}

#[test]
fn blocks_and_sub_volumes_hide_samples() {
    let mut scene = ramp([1, 1, 10]);
    scene.visibility.subvolume[2] = [2.0, 5.0];
    assert_eq!(scene.render()[0].samples, 4);
    scene.visibility = Visibility::EVERYTHING;
    scene.visibility.block[2] = [5.0, 10.0];
    let mut rays = vec![Ray { samples: 3, ..Ray::default() }];
    scene.render_onto(&mut rays);
    assert_eq!(rays[0].samples, 8);
}

#[test]
fn gradients_are_central_differences_and_replicate_at_faces() {
    let scene = ramp([4, 5, 6]);
    let close = |found: [f64; 3], differences: [f64; 3]| {
        let expected = differences.map(|difference| difference * 127.0 / 4095.0);
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
    };
    close(scene.gradient([1.0, 3.0, 2.5]), [200.0, 20.0, 2.0]);
    close(scene.gradient([0.0, 4.0, 2.0]), [100.0, 10.0, 2.0]);
    close(scene.gradient([0.25, 4.0, 4.5]), [125.0, 10.0, 1.5]);
    close(ramp([1, 1, 2]).gradient([0.0; 3]), [0.0, 0.0, 1.0]);
}

/// Values rise by 100 a slice, and the eye looks along: surfaces face it.
fn facing_wall<T: Transfer>(transfer: T) -> Scene<impl Voxels, T> {
    let light = Light { direction: [0.0, 0.0, 1.0], intensity: 0.5 };
    let phong = Phong {
        diffuse: 0.5,
        specular: 0.0,
        specular_color: [1.0; 3],
        lighting: Lighting::new(
            vec![light],
            1.0,
            [0.0, 0.0, -1.0],
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        ),
    };
    let ramp = ramp([1, 1, 5]);
    Scene {
        size: ramp.size,
        voxels: |[_, _, z]: [usize; 3]| 100.0 * z as f64,
        transfer,
        permutation: ramp.permutation,
        rays: ramp.rays,
        visibility: ramp.visibility,
        cursor: None,
        shading: Shading { emissive: 0.25, phong: Some(phong), modulation: None },
        blend: BlendMode::Alpha,
    }
}

fn fog(value: f64) -> [f64; 4] {
    [1.0, 0.5, 0.0, value / 1000.0]
}

#[test]
fn illuminated_samples_are_composited() {
    let scene = facing_wall(fog);
    // Everywhere 0.25 + 0.5 * 0.5 of the colour; opacities 0, 0.1, ..., 0.4.
    let opacity = 1.0 - 0.9 * 0.8 * 0.7 * 0.6;
    let [[r, g, b, a]] = scene.pixels()[..] else { panic!("one ray") };
    assert!((a - opacity).abs() < 1e-12 && (r - opacity / 2.0).abs() < 1e-12);
    assert!((g - opacity / 4.0).abs() < 1e-12 && b == 0.0);
}

#[test]
fn extremes_keep_the_opacity_of_the_transfer_function() {
    let mut scene = facing_wall(fog);
    let function = PiecewiseLinear::new(vec![(0.0, [0.5])]).unwrap();
    scene.shading.modulation = Some(Modulation { function, opacity: true, diffuse: true, specular: false });
    scene.visibility.cut =
        Some(CutPlane { outside: false, normal: [0.0, 0.0, 1.0], faces: [0.0, 2.0], falloff: 4.0 });
    for (blend, expected) in [
        // The last sample; half of its diffuse light.
        (BlendMode::Maximum, [0.375, 0.1875, 0.0, 0.4]),
        (BlendMode::Minimum, [0.375, 0.1875, 0.0, 0.0]),
        // Means of opacities halved by modulation, not by the cut plane.
        (BlendMode::Sum, [0.1 * 0.375, 0.1 * 0.1875, 0.0, 0.1]),
        // Opacities 0, 0.05, 0.1, and 0.15 and 0.2 times 3/4 and 1/2.
        (BlendMode::Alpha, {
            let opacity = 1.0 - 0.95 * 0.9 * (1.0 - 0.1125) * 0.9;
            [0.375 * opacity, 0.1875 * opacity, 0.0, opacity]
        }),
    ] {
        scene.blend = blend;
        let [pixel] = scene.pixels()[..] else { panic!("one ray") };
        assert!(pixel.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{blend:?} {pixel:?}");
    }
}

#[test]
fn the_cursor_is_in_the_volume_or_over_it() {
    let mut scene = facing_wall(|_| [1.0, 0.5, 0.0, 0.5]);
    scene.shading = Shading::UNLIT;
    scene.visibility.subvolume[2] = [0.0, 1.0];
    scene.cursor = Some(Cursor {
        enabled: [false, false, true],
        planes: true,
        exclude_overlap: false,
        disable_crop: true,
        width: 3.0,
        length: 0.0,
        position: [0.0, 0.0, 2.0],
        color: [[0.0, 0.0, 1.0, 0.5]; 3],
    });
    // Sample 0, then the cursor before sample 1, and twice more.
    assert_eq!(
        scene.pixels()[0],
        [0.5 + 0.125, 0.25 + 0.0625, 0.25 + 0.0625 + 0.03125, 1.0 - 0.5_f64.powi(5)]
    );
    scene.blend = BlendMode::Maximum;
    assert_eq!(scene.pixels()[0], [0.125, 0.0625, 0.875, 0.0625 + 0.875]);
    scene.blend = BlendMode::Sum;
    assert_eq!(scene.pixels()[0], [0.0625, 0.03125, 0.875, 0.0625 + 0.875]);
    if let Some(cursor) = &mut scene.cursor {
        cursor.disable_crop = false;
    }
    assert_eq!(scene.pixels()[0], [0.25, 0.125, 0.5, 0.75]);
}
