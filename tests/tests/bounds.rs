//! The card's arithmetic against the ideal on phantoms and real scans: every ray within the bound that is derived for
//! it. What is rendered, and how the bounds are derived, is shared with the engine's own tests, which look at random
//! frames.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    dead_code,
    reason = "tests; not all that is shared is used here"
)]

#[path = "../../device/engine/tests/renderers/bounds/mod.rs"]
mod bounds;
#[path = "../../device/engine/tests/renderers/card.rs"]
mod card;
#[path = "../../device/engine/tests/renderers/grid.rs"]
mod grid;
#[path = "../../device/engine/tests/renderers/lit.rs"]
mod lit;
#[path = "../../device/engine/tests/renderers/scene.rs"]
mod scene;

use bounds::{Outcome, compare};
use card::Card;
use grid::Grid;
use lit::{Lit, Vector};
use scene::{MODES, Scene, VOXEL};
use vg500_engine::frame::Illumination;
use vg500_engine::ideal::shading::Light;
use vg500_regs::{BlendMode, Permutation};
use vli::Voxels;
use vli::file::{self, ScalarVolume};
use vli::phantom::Phantom;
use vli::values::ValueMapping;
use volumepro_tests::data;

/// Columns and rows of rays, through the middle of the base plane.
const WINDOW: u32 = 9;
/// Voxels along each axis, from the middle of the volume.
const SIDE: usize = 72;

/// A transfer function of a slope and no steps.
fn ramp(value: u16) -> ([u8; 3], u16) {
    ([(value >> 4) as u8, 255 - (value >> 4) as u8, 130], value / 8)
}

/// The voxels in the middle, as the library gives them to the card.
fn grid(volume: &ScalarVolume) -> Grid {
    let voxels = ValueMapping::new(volume, None).unwrap().voxels(volume);
    let stored = match &voxels {
        Voxels::Uint8(voxels) => voxels.iter().map(|voxel| u16::from(*voxel)).collect(),
        Voxels::Uint12Lower(voxels) | Voxels::Uint12Upper(voxels) => voxels.to_vec(),
    };
    let grid = Grid { format: voxels.format(), size: volume.dimensions(), voxels: stored };
    grid.window(volume.dimensions().map(|side| {
        let first = side.saturating_sub(SIDE) / 2;
        first..side.min(first + SIDE)
    }))
}

/// Head-on; oblique, with every position rounded; along another axis with twice the slices.
fn views(scene: &Scene) -> [(Scene, Vector); 3] {
    let oblique = Scene { start: [VOXEL / 7, VOXEL / 9], step: [VOXEL / 3, VOXEL / 5], ..scene.clone() };
    let permutation = Permutation::from_word(0x412).unwrap(); // x = z, y = y, z = -x
    let other = Scene { permutation, step: [VOXEL / 8, VOXEL / 16], supersampling: 2, ..scene.clone() };
    [(scene.clone(), [0.0, 0.0, -1.0]), (oblique, [-1.0 / 3.0, -0.2, -1.0]), (other, [1.0, -0.125, -0.25])]
        .map(|(scene, eye)| (middle(scene.with_all_rays()), eye))
}

fn middle(mut scene: Scene) -> Scene {
    for axis in 0..2 {
        let first = scene.rays[axis].saturating_sub(WINDOW) / 2;
        scene.start[axis] += first as i32 * VOXEL;
        scene.rays[axis] = scene.rays[axis].min(WINDOW);
    }
    scene
}

/// Every blend mode, lit and not, from three sides.
fn check(name: &str, volume: &ScalarVolume) {
    let mut card = Card::with_transfer(ramp);
    card.set_gradient_magnitude(|entry| 60 + entry / 2);
    let scene = Scene::new(card.load(&grid(volume)));
    let lights = || {
        vec![
            Light { direction: [0.48, 0.6, 0.64], intensity: 0.7 },
            Light { direction: [-0.8, 0.0, 0.6], intensity: 0.4 },
        ]
    };
    let cubes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut compared = 0;
    for blend in MODES {
        let mut outcomes = [Outcome::default(); 2];
        for (view, eye) in views(&Scene { blend, ..scene.clone() }) {
            outcomes[0].join(&compare(&mut card, &view, None));
            let lit = Lit::new(lights(), 4.0, eye, cubes);
            lit.load(&mut card);
            let illumination = Illumination {
                emissive: 40,
                diffuse: 150,
                specular: 60,
                specular_color: [255, 255, 128],
                eye: lit.register(),
                modulate: [blend == BlendMode::Alpha, true, false],
            };
            let view = Scene { illumination, ..view };
            outcomes[1].join(&compare(&mut card, &view, Some(lit.lighting)));
        }
        for (light, outcome) in ["unlit", "lit"].into_iter().zip(outcomes) {
            outcome.print(&format!("{name}, {blend:?}, {light}"));
            compared += outcome.compared;
        }
    }
    assert!(compared > 300, "{name}: next to nothing has a bound that says something");
}

#[test]
fn phantoms_are_within_their_bounds() {
    for phantom in Phantom::ALL {
        check(phantom.name(), &phantom.volume([48, 40, 44]).unwrap());
    }
}

#[test]
fn real_scans_are_within_their_bounds() {
    for name in ["engine", "ct_head", "mri_head", "iron_protein"] {
        let file = format!("{name}.nrrd");
        if let Some(path) = data::volume("real_scans_are_within_their_bounds", &file) {
            check(name, &file::open(&path, &mut |_, _| {}).unwrap());
        }
    }
}
