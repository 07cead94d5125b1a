//! The optimised renderer draws what the reference draws, bit for bit, at every level and with any number of threads.

use crate::card::{Card, Store};
use crate::grid::{Chance, Grid};
use crate::scene::{LIT, MODES, Scene, UNLIT, VOXEL};
use std::sync::LazyLock;
use vg500_engine::frame::{Crop, Cursor, CutPlane, Illumination};
use vg500_engine::{Cancel, Engine, Level, Renderer};
use vg500_regs::limit::REFLECTANCE_ENTRIES;
use vg500_regs::memory::{Table, planes};
use vg500_regs::{Permutation, PlaneFormat, VoxelFormat};

/// Every level of this processor with 1, 2 and 3 threads.
static ENGINES: LazyLock<Vec<(String, Engine)>> = LazyLock::new(|| {
    let renderers = Level::all().flat_map(|level| {
        [1, 2, 3].map(|threads| {
            let name = format!("{} with {threads} threads", level.name());
            (name, Renderer::Optimised { level, threads }.start())
        })
    });
    renderers.collect()
});

/// Random frames to draw: a number in `VOLUMEPRO_CASES`, or few enough for every day.
fn cases() -> usize {
    std::env::var("VOLUMEPRO_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(400)
}

/// Draws a scene with the reference and with every engine, and compares pixel memory and reports.
pub fn compare(card: &mut Card, scene: &Scene) {
    let task = card.task(scene).unwrap();
    let before = card.pixels.clone();
    let expected = card.run(&task, &Cancel::default());
    let drawn = std::mem::replace(&mut card.pixels, before.clone());
    for (name, engine) in ENGINES.iter() {
        let memories = card.memories();
        let found = engine.render(&task, memories, &Cancel::default());
        match (&expected, &found) {
            (Ok(expected), Ok(found)) => {
                assert_eq!(
                    (expected.samples, expected.cycles),
                    (found.samples, found.cycles),
                    "{name}: {scene:?}"
                );
                assert_eq!(found.processed + found.left_out.samples(), found.samples, "{name}: {scene:?}");
                if card.pixels != drawn {
                    show_difference(card, scene, &drawn, name);
                }
                assert_eq!(expected.checksum, found.checksum, "{name}: {scene:?}");
            }
            _ => assert_eq!(expected.as_ref().err(), found.as_ref().err(), "{name}: {scene:?}"),
        }
        card.pixels.copy_from_slice(&before);
    }
    card.pixels = drawn;
}

fn show_difference(card: &Card, scene: &Scene, drawn: &[u8], name: &str) {
    let bytes = scene.format.bytes();
    let differing = (0..drawn.len() / bytes).filter(|&at| {
        let range = at * bytes..(at + 1) * bytes;
        drawn[range.clone()] != card.pixels[range]
    });
    let rays: Vec<_> = differing.collect();
    for &ray in rays.iter().take(6) {
        let range = ray * bytes..(ray + 1) * bytes;
        let [column, row] = [ray % 512, ray / 512 % 512];
        println!("ray ({column}, {row}): {:02x?} {:02x?}", &drawn[range.clone()], &card.pixels[range]);
    }
    panic!("{name}: {} rays differ: {scene:?}", rays.len());
}

fn below(chance: &mut Chance, bound: usize) -> usize {
    chance.below(bound as u64) as usize
}

fn one_in(chance: &mut Chance, number: usize) -> bool {
    below(chance, number) == 0
}

/// A random frame.
pub fn random_scene(chance: &mut Chance, store: Store) -> Scene {
    let mut scene = Scene::new(store);
    let permutations: Vec<_> = Permutation::all().collect();
    scene.permutation = permutations[below(chance, permutations.len())];
    scene.supersampling = if one_in(chance, 3) { 1 + below(chance, 8) as u32 } else { 1 };
    for axis in 0..2 {
        scene.step[axis] = match below(chance, 5) {
            0 => 0,
            1 => VOXEL,
            2 => VOXEL / 2,
            _ => below(chance, VOXEL as usize + 1) as i32,
        } / if one_in(chance, 2) { scene.supersampling as i32 } else { 1 };
        // Not sheared by more than a base plane can hold.
        let slices = scene.supersampling as usize * (scene.permuted_size()[2] - 1).max(1);
        scene.step[axis] = scene.step[axis].min((255 * VOXEL as usize / slices) as i32);
        if one_in(chance, 3) {
            scene.start[axis] = below(chance, VOXEL as usize) as i32;
        }
    }
    scene = scene.with_all_rays();
    scene.rays = scene.rays.map(|rays| rays.clamp(1, 512));
    if one_in(chance, 4) {
        // A window of the base plane.
        for axis in 0..2 {
            scene.start[axis] += (below(chance, 20) as i32 - 10) * VOXEL;
            scene.rays[axis] = 1 + below(chance, scene.rays[axis] as usize) as u32;
        }
    }
    scene.blend = MODES[[0, 0, 0, 1, 2, 3][below(chance, 6)]];
    scene.format = if one_in(chance, 2) { scene.wide_format() } else { PlaneFormat::Rgba8 };
    scene.plane = below(chance, planes(scene.format) as usize) as u32;
    if scene.format != PlaneFormat::Rgba8 && one_in(chance, 2) {
        scene.accumulators = Some(below(chance, planes(scene.format) as usize) as u32);
    }
    scene.illumination = random_illumination(chance);
    random_visibility(chance, &mut scene);
    if one_in(chance, 2) {
        scene.keep = chance.word() as u32;
    }
    scene
}

fn random_illumination(chance: &mut Chance) -> Illumination {
    let [emissive, diffuse, specular] = [(); 3].map(|()| chance.pick(&[0, 0, 255, 128, 17]));
    let eye = loop {
        let direction = [(); 3].map(|()| below(chance, 2001) as f64 - 1000.0);
        let direction = if one_in(chance, 4) { [0.0, 0.0, direction[2]] } else { direction };
        let length = direction.iter().map(|c| c * c).sum::<f64>().sqrt();
        if length > 100.0 {
            break direction.map(|c| (c / length * 32767.0).round() as i16);
        }
    };
    let modulate = [(); 3].map(|()| one_in(chance, 2));
    match below(chance, 4) {
        0 => UNLIT,
        1 => Illumination { eye, specular_color: chance.pick(&[LIT.specular_color, [190; 3]]), ..LIT },
        2 => Illumination { modulate: [false; 3], eye, ..LIT },
        _ => Illumination { emissive, diffuse, specular, specular_color: [255, 100, 0], eye, modulate },
    }
}

fn random_visibility(chance: &mut Chance, scene: &mut Scene) {
    let size = scene.store.size;
    let place = |chance: &mut Chance, axis: usize| below(chance, size[axis] + 4) as i32 - 2;
    for (axis, &voxels) in size.iter().enumerate() {
        if one_in(chance, 6) {
            let [a, b] = [place(chance, axis), place(chance, axis)];
            scene.subvolume[axis] = [a.min(b), a.max(b)];
        }
        if one_in(chance, 6) {
            let [a, b] = [below(chance, voxels + 1), below(chance, voxels + 1)];
            scene.block[axis] = a.min(b)..a.max(b);
        }
    }
    if one_in(chance, 4) {
        let flags = [7, 0x1563, 0x3563, 0x1421, 0x3421, 0xf, 0x3fff][below(chance, 7)];
        let slabs = [0, 1, 2].map(|axis| {
            let [a, b] = [(); 2].map(|()| (place(chance, axis) << 8) + below(chance, 256) as i32);
            [a.min(b), a.max(b)]
        });
        scene.crop = Some(Crop { flags, slabs });
    }
    if one_in(chance, 4) {
        let normal = [(); 3].map(|()| (below(chance, 40001) as i32 - 20000) as i16);
        let normal = if one_in(chance, 3) { [0, 16384, 0] } else { normal };
        let middle: i64 = (0..3).map(|axis| i64::from(normal[axis]) * (size[axis] as i64) * 128).sum();
        let half = (below(chance, 20) as i64) << 21;
        let falloff = [0, 1 << 16, 1 << 14, 5000, 100][below(chance, 5)];
        let outside = one_in(chance, 2);
        scene.cut = Some(CutPlane { outside, normal, faces: [middle - half, middle + half], falloff });
    }
    if one_in(chance, 4) {
        scene.cursor = Some(Cursor {
            enabled: [(); 3].map(|()| !one_in(chance, 3)),
            planes: one_in(chance, 2),
            exclude_overlap: one_in(chance, 3),
            disable_crop: one_in(chance, 2),
            width: [1, 3, 5, 7][below(chance, 4)],
            length: [0, 3, 10][below(chance, 3)],
            position: [0, 1, 2].map(|axis| (place(chance, axis) << 8) + below(chance, 256) as i32),
            color: [[255, 0, 30, 200], [0, 255, 0, 255], [9, 0, 255, 0]],
        });
        scene.cursor_only = scene.accumulators.is_some() && scene.blend != MODES[0] && one_in(chance, 3);
    }
}

/// Tables of all kinds: dense, sparse, steps, random.
pub fn random_tables(chance: &mut Chance, card: &mut Card) {
    let seed = chance.word();
    let mut words = Chance::new(seed);
    let dense: Vec<_> = (0..4096).map(|_| (words.word() as u32, words.word() as u16 & 4095)).collect();
    let kind = below(chance, 5);
    let threshold = below(chance, 4096) as u16;
    card.set_transfer(|value| {
        let (color, alpha) = dense[usize::from(value)];
        let [r, g, b, _] = color.to_le_bytes();
        match kind {
            0 => ([r, g, b], alpha),
            1 => ([r, g, b], if value < threshold { 0 } else { alpha >> 3 }),
            2 => ([value as u8, (value >> 4) as u8, 7], if value == threshold { 4095 } else { 0 }),
            3 => ([255; 3], 4095),
            _ => ([(value >> 4) as u8; 3], value >> 4),
        }
    });
    let maps: Vec<u8> = (0..2048).map(|_| words.word() as u8).collect();
    let faces_share_edges = one_in(chance, 2);
    for (map, shift) in [(Table::Diffuse, 0), (Table::Specular, 1000)] {
        if !faces_share_edges {
            (0..REFLECTANCE_ENTRIES).for_each(|entry| card.set_map_entry(map, entry, maps[shift + entry]));
            continue;
        }
        let value = |[x, y, z]: [i32; 3]| maps[shift + ((x + 7) * 64 + (y + 7) * 8 + z + 7) as usize % 1000];
        card.set_map(map, value);
    }
    card.set_gradient_magnitude(|entry| maps[usize::from(entry)]);
}

fn random_grid(chance: &mut Chance) -> Grid {
    let side = |chance: &mut Chance| match below(chance, 8) {
        0 => 1,
        1 => 2,
        2 => [16, 31, 32, 33, 64][below(chance, 5)],
        _ => 1 + below(chance, 48),
    };
    let mut size = [side(chance), side(chance), side(chance)];
    if one_in(chance, 10) {
        size[below(chance, 3)] = 200 + below(chance, 57);
    }
    let mut grid = match below(chance, 4) {
        0 => Grid::blobs(size),
        _ => Grid::noise(size, chance),
    };
    grid.format = [VoxelFormat::Uint8, VoxelFormat::Uint12Lower, VoxelFormat::Uint12Upper][below(chance, 3)];
    if grid.format == VoxelFormat::Uint8 {
        grid.voxels.iter_mut().for_each(|voxel| *voxel >>= 4);
    }
    grid
}

#[test]
fn random_frames_are_those_of_the_reference() {
    let seed = std::env::var("VOLUMEPRO_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(5);
    for case in 0..cases() {
        let mut chance = Chance::new(seed + case as u64);
        let mut card = Card::with_tables();
        random_tables(&mut chance, &mut card);
        card.pixels.iter_mut().for_each(|byte| *byte = chance.word() as u8);
        let grid = random_grid(&mut chance);
        let store = card.load(&grid);
        let scene = random_scene(&mut chance, store);
        println!("case {case}");
        compare(&mut card, &scene);
    }
}

#[test]
fn slabs_far_from_the_volume_crop_as_in_the_reference() {
    for case in 0..30 {
        let mut chance = Chance::new(case);
        let mut card = Card::with_tables();
        random_tables(&mut chance, &mut card);
        let grid = random_grid(&mut chance);
        let store = card.load(&grid);
        let scene = random_scene(&mut chance, store);
        let far =
            [[70_000, 80_000], [-80_000, -70_000], [i32::MIN, i32::MAX], [i32::MAX, i32::MIN], [900, 100]];
        let slabs = [(); 3].map(|()| far[below(&mut chance, far.len())]);
        let flags = [7, 0x1421, 0x3421, 0x3fff][below(&mut chance, 4)];
        compare(&mut card, &Scene { crop: Some(Crop { flags, slabs }), ..scene });
    }
}
