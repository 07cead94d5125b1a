//! Volumes: their stored forms, active sub-volumes, and where they lie in voxel memory.

use crate::card::Card;
use crate::grid::{Chance, Grid};
use crate::scene::{LIT, MODES, Scene, VOXEL};
use vg500_engine::frame::Crop;
use vg500_regs::{BlendMode, Permutation, VoxelFormat};

#[test]
fn stored_forms_of_the_same_value_are_the_same() {
    let mut chance = Chance::new(8);
    let eight = Grid::new(VoxelFormat::Uint8, [9, 8, 7], |_| chance.below(256) as u16);
    let mut card = Card::with_tables();
    let mut scene = Scene { illumination: LIT, ..Scene::new(card.load(&eight)) };
    scene.step = [VOXEL / 3, VOXEL / 7];
    scene = scene.with_all_rays();
    // The bits that a format does not use are rubbish.
    let lower = eight.map(VoxelFormat::Uint12Lower, |voxel| voxel << 4 | 0xb000);
    let upper = eight.map(VoxelFormat::Uint12Upper, |voxel| voxel << 8 | 0x000d);
    for grid in [lower, upper] {
        let other = Scene { store: card.load(&grid), ..scene.clone() };
        for permutation in Permutation::all() {
            for blend in MODES {
                let expected = card.rays(&Scene { blend, permutation, ..scene.clone() });
                assert!(expected == card.rays(&Scene { blend, permutation, ..other.clone() }), "{blend:?}");
            }
        }
    }
}

/// A view in which nothing is aligned.
fn oblique(scene: Scene) -> Scene {
    let scene =
        Scene { start: [VOXEL / 5, VOXEL / 9], step: [VOXEL / 3, VOXEL / 7], supersampling: 3, ..scene };
    scene.with_all_rays()
}

#[test]
fn a_sub_volume_is_what_cropping_leaves() {
    let mut chance = Chance::new(9);
    let mut card = Card::with_tables();
    let store = card.load(&Grid::noise([9, 8, 10], &mut chance));
    let whole = oblique(Scene { illumination: LIT, ..Scene::new(store) });
    for subvolume in [[[2, 5], [0, 7], [3, 9]], [[-3, 4], [3, 3], [1, 20]], [[5, 4], [0, 7], [0, 9]]] {
        let crop = Crop { flags: 7, slabs: subvolume.map(|bounds| bounds.map(|bound| bound * 256)) };
        for permutation in Permutation::all().step_by(5) {
            for blend in MODES {
                let whole = Scene { permutation, blend, ..whole.clone() };
                let expected = card.rays(&Scene { crop: Some(crop), ..whole.clone() });
                let found = card.rays(&Scene { subvolume, ..whole.clone() });
                assert!(expected == found, "{subvolume:?} {permutation:?} {blend:?}");
                assert!(expected != card.rays(&whole));
            }
        }
    }
}

/// Gradients at the faces of a sub-volume see the voxels beyond it, at the faces of a volume they do not.
#[test]
fn the_neighbours_of_a_sub_volume_are_real_voxels() {
    let mut chance = Chance::new(10);
    let grid = Grid::noise([9, 8, 10], &mut chance);
    let mut card = Card::with_tables();
    let scene = Scene { illumination: LIT, blend: BlendMode::Sum, ..Scene::new(card.load(&grid)) };
    let inner = Scene { subvolume: [[3, 6], [2, 5], [4, 7]], ..scene };
    let alone = Scene::new(card.load(&grid.window([3..7, 2..6, 4..8])));
    let with_apron = Scene::new(card.load(&grid.window([2..8, 1..7, 3..9])));
    let lit = |scene: Scene| Scene { illumination: LIT, blend: BlendMode::Sum, ..scene };
    let seen = |scene: &Scene, card: &mut Card| {
        let mut rays = card.rays(scene);
        rays.retain(|ray| ray.samples > 0);
        assert_eq!(rays.len(), 16);
        rays
    };
    let expected = seen(&inner, &mut card);
    let apron = Scene { subvolume: [[1, 4]; 3], ..lit(with_apron) };
    assert!(expected == seen(&apron, &mut card));
    assert!(expected != seen(&lit(alone), &mut card));
}

#[test]
fn a_part_of_a_larger_store_is_rendered_where_it_lies() {
    let mut chance = Chance::new(11);
    for format in [VoxelFormat::Uint8, VoxelFormat::Uint12Lower, VoxelFormat::Uint12Upper] {
        let grid = Grid::new(format, [40, 35, 9], |_| chance.word() as u16);
        let window = [7..40, 3..34, 2..9];
        let mut card = Card::with_tables();
        let whole = card.load(&grid);
        let inside = Scene { illumination: LIT, ..Scene::new(whole.window(window.clone())) };
        let own = Scene { store: card.load(&grid.window(window)), ..inside.clone() };
        for permutation in Permutation::all().step_by(7) {
            let [inside, own] = [&inside, &own].map(|scene| {
                let scene = Scene { permutation, ..scene.clone() };
                card.rays(&oblique(scene))
            });
            assert!(inside == own, "{format:?} {permutation:?}");
        }
    }
}
