//! Extreme and stiff cases: what must come out follows from the arithmetic.

use crate::card::Card;
use crate::grid::{Chance, Grid};
use crate::scene::{LIT, MODES, Scene, VOXEL};
use std::collections::BTreeMap;
use vg500_engine::fixed::{FULL, narrow, product, widen};
use vg500_engine::stage::composite::Ray;
use vg500_engine::stage::illuminate::{Light, illuminate};
use vg500_regs::limit::VOLUME_SIZE;
use vg500_regs::{BlendMode, Permutation, PlaneFormat, VoxelFormat};

fn constant(size: [usize; 3], value: u16) -> Grid {
    Grid::new(VoxelFormat::Uint12Lower, size, |_| value)
}

/// Views that differ in direction, start, step and supersampling.
fn views(scene: &Scene, chance: &mut Chance) -> Vec<Scene> {
    let view = |permutation| {
        let mut view = Scene { permutation, ..scene.clone() };
        view.start = [0; 2].map(|_| chance.below(VOXEL as u64) as i32);
        view.step = [0; 2].map(|_| chance.below(VOXEL as u64 + 1) as i32);
        view.supersampling = 1 + chance.below(8) as u32;
        view.with_all_rays()
    };
    Permutation::all().map(view).collect()
}

/// Opacity `a` adds round(a (4095 - A) / 4096), which is nothing once a (4095 - A) < 2048. Near there the steps
/// are of 1, so fog stalls exactly at 4095 - floor(2047 / a).
#[test]
fn fog_stalls_where_the_arithmetic_says() {
    for alpha in [1, 2, 3, 8, 60, 700, 2047, 2048, 4095] {
        let mut card = Card::with_transfer(|_| ([255, 128, 0], alpha));
        let grid = constant([1, 1, VOLUME_SIZE as usize], 99);
        let mut scene = Scene { supersampling: 8, ..Scene::new(card.load(&grid)) };
        scene.format = PlaneFormat::Accumulator64;
        let mut last = Ray::default();
        for pass in 0..3 {
            let ray = card.rays(&scene)[0];
            assert!(ray.alpha >= last.alpha && ray.color[0] >= last.color[0], "{alpha}: it only grows");
            assert!(ray.color[2] == 0 && ray.color[1] <= ray.color[0]);
            // 2041 samples; of opacity 1 each adds 1.
            assert!(pass > 0 || alpha > 1 || ray.alpha == 2041);
            last = ray;
            scene.accumulators = Some(0);
        }
        assert_eq!(last.alpha, 4095 - 2047 / u32::from(alpha), "{alpha}");
    }
}

/// The first sample leaves 1 of 4095 to shine through: the second adds at most 1 to colour and opacity. Two
/// products lose at most 1 each of the colour.
#[test]
fn opaque_volumes_show_their_front() {
    let mut chance = Chance::new(50);
    let mut card = Card::with_transfer(|value| ([(value >> 4) as u8, 255, 255 - (value >> 4) as u8], 4095));
    let grid = Grid::noise([6, 7, 5], &mut chance);
    let scene = Scene::new(card.load(&grid));
    let eight_bits: Vec<_> = card.rendered(&scene).as_chunks::<4>().0.to_vec();
    for (place, (ray, pixel)) in card.rays(&scene).into_iter().zip(eight_bits).enumerate() {
        let front = (grid.at([place % 6, place / 6, 0]) >> 4) as u8;
        assert_eq!((ray.alpha, pixel[1], pixel[3]), (4095, 255, 255));
        for (found, color) in [(ray.color[0], front), (ray.color[2], 255 - front)] {
            let expected = u32::from(widen(color));
            assert!((expected.saturating_sub(2)..=expected + 1).contains(&found), "{found} for {expected}");
        }
    }
}

/// Number of samples of each ray.
fn counts(card: &mut Card, scene: &Scene) -> Vec<u32> {
    let sums = card.rays(&Scene { blend: BlendMode::Sum, ..scene.clone() });
    sums.iter().map(|ray| ray.samples).collect()
}

/// Without a gradient there is no light but emission. Means and extremes of equal samples are such a sample, and in
/// alpha blending only the number of samples counts.
#[test]
fn constant_volumes_give_constant_planes() {
    let mut chance = Chance::new(51);
    for value in [0, 1, 2047, 4095] {
        let (color, alpha) = ([20 + (value >> 5) as u8, 255, 0], 1000 + value / 2);
        let mut card = Card::with_transfer(|entry| if entry == value { (color, alpha) } else { ([9; 3], 9) });
        card.set_maps(&Permutation::IDENTITY);
        card.set_gradient_magnitude(|entry| 255 - entry);
        let [r, g, b] = illuminate(&LIT, color.map(widen), Light::default(), 255);
        let sample = [r, g, b, alpha];
        let mean = [product(r, alpha), product(g, alpha), product(b, alpha), alpha];
        let scene = Scene { illumination: LIT, ..Scene::new(card.load(&constant([7, 5, 6], value))) };
        for view in views(&scene, &mut chance) {
            let counts = counts(&mut card, &view);
            for (blend, expected) in
                [(BlendMode::Maximum, sample), (BlendMode::Minimum, sample), (BlendMode::Sum, mean)]
            {
                let pixels = card.pixels(&Scene { blend, ..view.clone() });
                for (pixel, samples) in pixels.into_iter().zip(&counts) {
                    assert_eq!(pixel, if *samples > 0 { expected } else { [0; 4] }, "{value} {blend:?}");
                }
            }
            let mut by_count = BTreeMap::from([(0, [0; 4])]);
            for (pixel, samples) in card.pixels(&view).into_iter().zip(counts) {
                assert_eq!(*by_count.entry(samples).or_insert(pixel), pixel, "{value}, {samples} samples");
            }
        }
    }
}

#[test]
fn rays_of_the_least_and_the_greatest_value_are_not_blank() {
    let mut chance = Chance::new(52);
    for value in [0, FULL] {
        let mut card = Card::with_transfer(|entry| ([(entry >> 4) as u8, 77, 1], 3000));
        let scene = Scene::new(card.load(&constant([3, 4, 5], value)));
        for view in views(&scene, &mut chance) {
            let counts = counts(&mut card, &view);
            for blend in [BlendMode::Maximum, BlendMode::Minimum] {
                let rays = card.rays(&Scene { blend, ..view.clone() });
                assert!(rays.iter().any(|ray| ray.valid));
                for (ray, samples) in rays.iter().zip(&counts) {
                    let seen = Ray {
                        color: [value, widen(77), widen(1)].map(u32::from),
                        alpha: 3000,
                        extreme: value,
                        valid: true,
                        samples: 0,
                    };
                    assert_eq!(*ray, if *samples > 0 { seen } else { Ray::default() });
                }
            }
        }
    }
}

#[test]
fn rays_that_miss_are_zero() {
    let mut card = Card::with_tables();
    let scene = Scene { illumination: LIT, ..Scene::new(card.load(&constant([5, 6, 7], 4095))) };
    for start in [[-512 * VOXEL, 0], [0, 5 * VOXEL + (1 << 13)], [-8 * VOXEL, 0], [i32::MAX, i32::MIN]] {
        for blend in MODES {
            let mut scene = Scene { start, blend, rays: [5, 6], ..scene.clone() };
            for format in [PlaneFormat::Rgba8, scene.wide_format()] {
                scene.format = if blend == BlendMode::Sum { PlaneFormat::Sum128 } else { format };
                let report = card.render(&scene).unwrap();
                assert_eq!(report.samples, 0, "{start:?}");
                assert!(card.plane(&scene).iter().all(|byte| *byte == 0), "{start:?} {blend:?}");
            }
        }
    }
}

/// The smallest volumes have one sample a ray, which is the voxel.
#[test]
fn volumes_of_one_voxel_are_rendered() {
    let mut card = Card::with_tables();
    let scene =
        Scene { supersampling: 8, step: [VOXEL; 2], ..Scene::new(card.load(&constant([1; 3], 2000))) };
    for permutation in Permutation::all() {
        let pixel = card.rendered(&Scene { permutation, blend: BlendMode::Maximum, ..scene.clone() });
        // Value 2000 is 0x7d0, of opacity 500.
        assert_eq!(pixel, [0x7d, 0xe8, 0xd0, narrow(500)]);
    }
}

/// The largest base plane of a pass: 45 degrees on both axes.
#[test]
fn the_greatest_shear_fits_into_the_base_plane() {
    let mut card = Card::with_tables();
    let mut grid = constant([VOLUME_SIZE as usize, 1, VOLUME_SIZE as usize], 100);
    *grid.voxels.last_mut().unwrap() = 4000;
    let scene = Scene { step: [VOXEL, 0], blend: BlendMode::Maximum, ..Scene::new(card.load(&grid)) };
    let scene = scene.with_all_rays();
    assert_eq!(scene.rays, [511, 1]);
    let rays = card.rays(&scene);
    let found: Vec<_> = (0..511).filter(|column| rays[*column].extreme == 4000).collect();
    assert!(rays.iter().all(|ray| ray.valid) && found == [255], "{found:?}");
}
