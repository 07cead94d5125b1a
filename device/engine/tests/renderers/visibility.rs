//! The reference against the ideal where samples are hidden: sub-volume, block, cropping, cut plane, cursor. Without
//! light, so that [`bounds`](crate::bounds) are narrow.

use crate::bounds::{Outcome, compare};
use crate::card::Card;
use crate::grid::{Chance, Grid};
use crate::scene::{MODES, Scene, VOXEL};
use vg500_engine::frame::{Crop, Cursor, CutPlane};
use vg500_regs::Permutation;

/// A small smooth volume with a table whose opacities leave several samples of a ray visible.
fn card_and_scene() -> (Card, Scene) {
    let mut card =
        Card::with_transfer(|value| ([(value >> 4) as u8, 255 - (value >> 4) as u8, 99], value / 5));
    let scene = Scene::new(card.load(&Grid::blobs([8, 9, 7])));
    (card, scene)
}

/// A view from anywhere. `exact`: positions need no rounding.
pub fn view(scene: &Scene, exact: bool, chance: &mut Chance) -> Scene {
    let unit = if exact { VOXEL as u64 / 256 } else { 1 };
    let mut any = |least: u64, most: u64| (least + chance.below(most - least)) as i32;
    let mut view = scene.clone();
    view.start = [0; 2].map(|_| any(0, VOXEL as u64 / unit) * unit as i32);
    view.step = [0; 2].map(|_| any(0, VOXEL as u64 / unit + 1) * unit as i32);
    view.permutation = Permutation::all().nth(any(0, 48) as usize).unwrap();
    view.supersampling = if exact { 1 << any(0, 3) } else { any(1, 9) as u32 };
    view.with_all_rays()
}

/// Compares a scene from views that need no rounding, where each ray must have a bound, and from others.
fn compare_views(name: &str, scenes: impl Iterator<Item = Scene>, card: &mut Card) {
    let mut chance = Chance::new(70);
    let mut outcomes = [Outcome::default(); 2];
    for scene in scenes {
        for blend in MODES {
            for (exact, outcome) in [(true, 0), (false, 1)] {
                let scene = view(&Scene { blend, ..scene.clone() }, exact, &mut chance);
                outcomes[outcome].join(&compare(card, &scene, None));
            }
        }
    }
    let [exact, rounded] = outcomes;
    exact.print(&format!("{name}, exact positions"));
    rounded.print(&format!("{name}, rounded positions"));
    // Of a cut plane that leaves next to nothing of a sample, 8 bits leave nothing, which is ambiguous.
    assert!(exact.compared > 1000 && exact.compared > 50 * (exact.ambiguous + exact.unbounded), "{exact:?}");
    assert!(rounded.compared > 5 * (rounded.ambiguous + rounded.unbounded), "{rounded:?}");
}

#[test]
fn bounded_samples_are_within_their_bounds() {
    let (mut card, scene) = card_and_scene();
    let bounds = [[[2, 5], [0, 8], [1, 5]], [[-4, 3], [4, 4], [0, 90]], [[0, 7], [7, 8], [6, 6]]];
    let subvolumes = bounds.map(|subvolume| Scene { subvolume, ..scene.clone() });
    let blocks = bounds.map(|block| {
        let block = block.map(|[low, high]| low.max(0) as usize..high as usize + 1);
        Scene { block, ..scene.clone() }
    });
    compare_views("sub-volumes and blocks", subvolumes.into_iter().chain(blocks), &mut card);
}

#[test]
fn cropped_samples_are_within_their_bounds() {
    let (mut card, scene) = card_and_scene();
    let mut chance = Chance::new(71);
    let named = [0x0007, 0x000f, 0x1563, 0x3563, 0x1421, 0x3421];
    let scenes = (0..24).map(|place| {
        let flags = named.get(place).copied().unwrap_or_else(|| 1 + chance.below(0x3fff) as u32);
        let slabs = [0; 3].map(|_| [chance.below(800) as i32, 700 + chance.below(1000) as i32]);
        Scene { crop: Some(Crop { flags, slabs }), ..scene.clone() }
    });
    compare_views("cropping", scenes, &mut card);
}

/// A cut plane through the middle of a small volume.
pub fn cut_plane(chance: &mut Chance) -> CutPlane {
    let component = |chance: &mut Chance| chance.below(20_001) as i16 - 10_000;
    let normal = [0; 3].map(|_| component(chance));
    let middle: i64 = normal.iter().map(|a| i64::from(*a) * 4 * 256).sum();
    let thickness = chance.below(4 << 22) as i64;
    CutPlane {
        outside: chance.below(2) == 0,
        normal,
        faces: [middle - thickness, middle + thickness / 2],
        falloff: chance.pick(&[0, 1 << 13, 1 << 14, 23_456, 1 << 16, (1 << 17) - 1]),
    }
}

#[test]
fn samples_of_a_cut_plane_are_within_their_bounds() {
    let (mut card, scene) = card_and_scene();
    let mut chance = Chance::new(72);
    let scenes = (0..24).map(|_| Scene { cut: Some(cut_plane(&mut chance)), ..scene.clone() });
    compare_views("cut plane", scenes, &mut card);
}

/// A cursor in the middle of a small volume.
pub fn cursor(chance: &mut Chance) -> Cursor {
    let mut flag = || chance.below(2) == 0;
    let [planes, exclude_overlap, disable_crop, endless] = [flag(), flag(), flag(), flag()];
    Cursor {
        enabled: [true, flag(), flag()],
        planes,
        exclude_overlap,
        disable_crop,
        width: chance.pick(&[1, 3, 5, 7]),
        length: if endless { 0 } else { 1 + chance.below(9) as u32 },
        position: [0; 3].map(|_| 500 + chance.below(1000) as i32),
        color: [0; 3].map(|_| [0; 4].map(|_| chance.below(256) as u8)),
    }
}

#[test]
fn samples_of_the_cursor_are_within_their_bounds() {
    let (mut card, scene) = card_and_scene();
    let mut chance = Chance::new(73);
    let crop = Crop { flags: 0x1421, slabs: [[600, 1100]; 3] };
    let scenes = (0..24).map(|place| Scene {
        cursor: Some(cursor(&mut chance)),
        crop: (place % 2 == 0).then_some(crop),
        cut: (place % 4 == 1).then(|| cut_plane(&mut chance)),
        ..scene.clone()
    });
    compare_views("cursor", scenes, &mut card);
}
