//! Views that show the same must be the same, bit for bit: flips are exact in every stage, exchanged axes where
//! every sample is a voxel.

use crate::card::{Card, Store};
use crate::grid::{Chance, Grid};
use crate::scene::{LIT, MODES, Scene, UNLIT, VOXEL};
use vg500_engine::frame::{Crop, Cursor, CutPlane};
use vg500_engine::stage::composite::Ray;
use vg500_regs::{BlendMode, Permutation};

/// A scene of everything that does not depend on light.
fn furnished(store: Store, chance: &mut Chance) -> Scene {
    let mut scene = Scene::new(store);
    scene.start = [0; 2].map(|_| chance.below(VOXEL as u64) as i32);
    scene.step = [0; 2].map(|_| chance.below(VOXEL as u64 + 1) as i32);
    scene.supersampling = 1 + chance.below(8) as u32;
    scene.illumination.modulate = [chance.below(2) == 0, false, false];
    scene.subvolume =
        store.size.map(|size| [chance.below(2) as i32, size as i32 - 1 - chance.below(2) as i32]);
    scene.crop = (chance.below(2) == 0).then(|| Crop {
        // Combinations in which all axes are alike, because axes change places.
        flags: chance.pick(&[0x0007, 0x1563, 0x3421, 0x000f]),
        slabs: store.size.map(|size| [chance.below(300) as i32, 256 * size as i32 - 300]),
    });
    scene.cut = (chance.below(2) == 0).then(|| CutPlane {
        outside: chance.below(2) == 0,
        normal: [9000, -7000, 11000],
        faces: [-(1 << 22), 3 << 22],
        falloff: chance.pick(&[0, 1 << 15, 1 << 16]),
    });
    scene.with_all_rays()
}

/// The scene and its volume as they lie in object axes if `scene` shows them unpermuted.
fn permuted(scene: &Scene, grid: &Grid, permutation: Permutation, card: &mut Card) -> Scene {
    let store = card.load(&grid.unpermuted(&permutation));
    let mut other = Scene { store, permutation, block: store.size.map(|size| 0..size), ..scene.clone() };
    for (permuted, place) in permutation.axes().into_iter().enumerate() {
        let axis = place.axis;
        let last = store.size[axis] as i32 - 1;
        let mirror =
            |[min, max]: [i32; 2], last| if place.flipped { [last - max, last - min] } else { [min, max] };
        other.subvolume[axis] = mirror(scene.subvolume[permuted], last);
        if let (Some(to), Some(from)) = (&mut other.crop, &scene.crop) {
            to.slabs[axis] = mirror(from.slabs[permuted], 256 * last);
        }
        if let (Some(to), Some(from)) = (&mut other.cut, &scene.cut) {
            to.normal[axis] = if place.flipped { -from.normal[permuted] } else { from.normal[permuted] };
            let moved =
                if place.flipped { 256 * i64::from(last) * i64::from(from.normal[permuted]) } else { 0 };
            to.faces = to.faces.map(|face| face - moved);
        }
        if let (Some(to), Some(from)) = (&mut other.cursor, &scene.cursor) {
            to.position[axis] = mirror([from.position[permuted]; 2], 256 * last)[0];
            (to.enabled[axis], to.color[axis]) = (from.enabled[permuted], from.color[permuted]);
        }
        let eye = scene.illumination.eye[permuted];
        other.illumination.eye[axis] = if place.flipped { -eye } else { eye };
    }
    other
}

#[test]
fn all_permutations_show_the_same_permuted_volume() {
    let mut chance = Chance::new(1);
    for size in [[7, 5, 6], [1, 9, 4], [6, 6, 1]] {
        for _ in 0..4 {
            let mut card = Card::with_tables();
            let grid = Grid::noise(size, &mut chance);
            let scene = furnished(card.load(&grid), &mut chance);
            for permutation in Permutation::all() {
                let view = permuted(&scene, &grid, permutation, &mut card);
                for blend in MODES {
                    let expected = card.rays(&Scene { blend, ..scene.clone() });
                    let found = card.rays(&Scene { blend, ..view.clone() });
                    assert!(expected == found, "{permutation:?} {blend:?} of {scene:?}");
                }
            }
        }
    }
}

#[test]
fn flips_are_exact_in_light() {
    let mut chance = Chance::new(2);
    let flips = || Permutation::all().filter(|it| it.axes().map(|place| place.axis) == [0, 1, 2]);
    assert_eq!(flips().count(), 8);
    for _ in 0..6 {
        let mut card = Card::with_tables();
        let grid = Grid::noise([8, 6, 7], &mut chance);
        let scene = Scene { illumination: LIT, ..furnished(card.load(&grid), &mut chance) };
        for blend in MODES {
            card.set_maps(&Permutation::IDENTITY);
            let expected = card.rays(&Scene { blend, ..scene.clone() });
            for flip in flips() {
                let view = permuted(&scene, &grid, flip, &mut card);
                card.set_maps(&flip);
                assert!(expected == card.rays(&Scene { blend, ..view }), "{flip:?} {blend:?} of {scene:?}");
            }
        }
    }
}

#[test]
fn the_cursor_is_the_same_under_all_permutations() {
    let mut chance = Chance::new(3);
    let mut card = Card::with_tables();
    let grid = Grid::noise([7, 8, 6], &mut chance);
    // Its parts are half-open, so their ends must lie between samples, which are multiples of 1/8 here.
    let cursor = Cursor {
        enabled: [true; 3],
        planes: false,
        exclude_overlap: true,
        disable_crop: true,
        width: 1,
        length: 5,
        position: [805, 611, 715],
        color: [[255, 0, 0, 200], [0, 255, 0, 255], [90, 0, 255, 100]],
    };
    let crop = Crop { flags: 7, slabs: [[300, 1000]; 3] };
    let mut scene = Scene::new(card.load(&grid));
    scene = Scene { crop: Some(crop), cursor: Some(cursor), supersampling: 2, ..scene };
    scene.start = [VOXEL / 8, 3 * VOXEL / 8];
    scene.step = [VOXEL / 4, VOXEL / 8];
    scene = scene.with_all_rays();
    for planes in [false, true] {
        scene.cursor = Some(Cursor { planes, ..cursor });
        for permutation in Permutation::all() {
            let view = permuted(&scene, &grid, permutation, &mut card);
            for blend in MODES {
                let expected = card.rays(&Scene { blend, ..scene.clone() });
                let without = card.rays(&Scene { blend, cursor: None, ..scene.clone() });
                assert!(expected != without);
                let found = card.rays(&Scene { blend, ..view.clone() });
                assert!(expected == found, "{permutation:?} {blend:?}");
            }
        }
    }
}

/// A flip that is not undone mirrors the base plane: weight w becomes 256 - w.
#[test]
fn a_volume_mirrored_across_the_view_is_a_mirrored_picture() {
    let mut chance = Chance::new(4);
    for (word, axis) in [(0x214, 0), (0x250, 1)] {
        let flip = Permutation::from_word(word).unwrap();
        for _ in 0..8 {
            let mut card = Card::with_tables();
            let grid = Grid::noise([6, 7, 5], &mut chance);
            let mut scene = Scene { illumination: LIT, ..Scene::new(card.load(&grid)) };
            scene.start = [0; 2].map(|_| (1 + chance.below(255) as i32) << 14);
            scene.rays = scene.rays.map(|rays| rays - 1);
            scene.supersampling = 1 + chance.below(8) as u32;
            let mut mirrored = permuted(&scene, &grid, flip, &mut card);
            mirrored.permutation = Permutation::IDENTITY;
            mirrored.start[axis] = VOXEL - scene.start[axis];
            for blend in MODES {
                card.set_maps(&Permutation::IDENTITY);
                let expected = card.rays(&Scene { blend, ..scene.clone() });
                card.set_maps(&flip);
                let mut found = card.rays(&Scene { blend, ..mirrored.clone() });
                mirror(&mut found, scene.rays[0] as usize, axis);
                assert!(expected == found, "axis {axis} {blend:?} of {scene:?}");
            }
        }
    }
}

fn mirror(rays: &mut [Ray], width: usize, axis: usize) {
    rays.reverse();
    if axis == 0 {
        // Rows are in the wrong order now.
        let rows: Vec<Vec<Ray>> = rays.chunks(width).rev().map(<[Ray]>::to_vec).collect();
        rays.copy_from_slice(&rows.concat());
    } else {
        rays.chunks_mut(width).for_each(<[Ray]>::reverse);
    }
}

/// Seen from behind, what does not depend on the order of samples is the same.
#[test]
fn sums_and_extremes_are_the_same_from_behind() {
    let mut chance = Chance::new(5);
    let flip = Permutation::from_word(0x610).unwrap();
    for supersampling in 1..=8 {
        let mut card = Card::with_tables();
        let grid = Grid::noise([6, 5, 7], &mut chance);
        let mut scene = Scene { supersampling, ..Scene::new(card.load(&grid)) };
        scene.start = [0; 2].map(|_| chance.below(VOXEL as u64) as i32);
        for (blend, illumination) in
            [(BlendMode::Maximum, UNLIT), (BlendMode::Minimum, UNLIT), (BlendMode::Sum, LIT)]
        {
            let scene = Scene { blend, illumination, ..scene.clone() };
            let mut behind = permuted(&scene, &grid, flip, &mut card);
            behind.permutation = Permutation::IDENTITY;
            card.set_maps(&Permutation::IDENTITY);
            let expected = card.rays(&scene);
            card.set_maps(&flip);
            assert!(expected == card.rays(&behind), "{supersampling} {blend:?}");
        }
    }
}

#[test]
fn exchanged_axes_exchange_rows_and_columns_where_samples_are_voxels() {
    let mut chance = Chance::new(6);
    let mut card = Card::with_tables();
    let scene = Scene { illumination: LIT, ..Scene::new(card.load(&Grid::noise([9, 7, 8], &mut chance))) };
    let mut exchanged = Scene { permutation: Permutation::from_word(0x201).unwrap(), ..scene.clone() };
    exchanged.rays.reverse();
    for blend in MODES {
        let expected = card.rays(&Scene { blend, ..scene.clone() });
        let found = card.rays(&Scene { blend, ..exchanged.clone() });
        for (place, ray) in expected.iter().enumerate() {
            assert_eq!(*ray, found[place % 9 * 7 + place / 9], "{blend:?} ray {place}");
        }
    }
}

/// Along z gradients come from voxels, along x and y from samples; at voxels both agree.
#[test]
fn a_voxel_has_the_same_color_from_all_six_sides() {
    let mut chance = Chance::new(7);
    let mut card = Card::with_tables();
    let scene = Scene { illumination: LIT, ..Scene::new(card.load(&Grid::noise([4; 3], &mut chance))) };
    for voxel in [[0, 0, 0], [1, 2, 3], [3, 3, 1], [2, 1, 2], [0, 3, 2]] {
        let color = |permutation: Permutation, card: &mut Card| {
            let subvolume = voxel.map(|at| [at, at]);
            let rays = card.rays(&Scene { subvolume, permutation, ..scene.clone() });
            let mut colors = rays.into_iter().filter(|ray| ray.alpha > 0);
            (colors.next(), colors.next())
        };
        let expected = color(Permutation::IDENTITY, &mut card);
        assert!(expected.0.is_some() && expected.1.is_none(), "{voxel:?}: {expected:?}");
        for permutation in Permutation::all() {
            assert_eq!(color(permutation, &mut card), expected, "{voxel:?} {permutation:?}");
        }
    }
}
