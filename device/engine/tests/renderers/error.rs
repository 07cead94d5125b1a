//! The reference against the ideal where nothing is lit or hidden: sample values, classification, compositing.
//! [`bounds`](crate::bounds) derives how far they may be apart.

use crate::bounds::{Outcome, compare};
use crate::card::Card;
use crate::grid::{Chance, Grid};
use crate::scene::{MODES, Scene, VOXEL};
use vg500_regs::{Permutation, VoxelFormat};

/// A table without steps: a slope of about one step per value.
fn ramp(value: u16) -> ([u8; 3], u16) {
    ([(value >> 4) as u8, 255 - (value >> 4) as u8, 130], value / 6)
}

/// Every view that differs in what it rounds.
fn views(scene: &Scene, chance: &mut Chance) -> Vec<Scene> {
    let any = |chance: &mut Chance| chance.below(VOXEL as u64) as i32;
    let mut views = vec![scene.clone()];
    for supersampling in [1, 2, 3, 7] {
        let mut view = Scene { supersampling, ..scene.clone() };
        view.permutation = Permutation::all().nth(chance.below(48) as usize).unwrap();
        view.start = [any(chance), any(chance)];
        view.step = [any(chance), any(chance)];
        views.push(view.with_all_rays());
    }
    let mut binary = Scene { supersampling: 8, ..scene.clone() };
    binary.step = [VOXEL / 16, VOXEL / 32];
    views.push(binary.with_all_rays());
    views
}

/// A volume of which neighbours differ by no more than a few hundred.
fn hills(size: [usize; 3]) -> Grid {
    Grid::new(VoxelFormat::Uint12Lower, size, |at| {
        let [x, y, z] = at.map(|place| place as f64);
        (2040.0 + 700.0 * ((0.31 * x).sin() + (0.23 * y + 0.11 * z).sin() + (0.37 * z).cos())) as u16
    })
}

fn compare_views(name: &str, transfer: fn(u16) -> ([u8; 3], u16), grid: &Grid) -> Vec<Outcome> {
    let mut chance = Chance::new(30);
    let mut card = Card::with_transfer(transfer);
    let scene = Scene::new(card.load(grid));
    let mut outcomes = Vec::new();
    for blend in MODES {
        for view in views(&Scene { blend, ..scene.clone() }, &mut chance) {
            let outcome = compare(&mut card, &view, None);
            outcome.print(&format!("{name}, {blend:?}, k = {}", view.supersampling));
            outcomes.push(outcome);
        }
    }
    outcomes
}

#[test]
fn smooth_volumes_and_tables_are_within_their_bounds() {
    let grid = hills([24, 20, 22]);
    let eight_bits = grid.map(VoxelFormat::Uint8, |voxel| voxel >> 4);
    for (name, grid) in [("hills", grid), ("hills of 8 bits", eight_bits)] {
        for outcome in compare_views(name, ramp, &grid) {
            assert!(outcome.compared > 400 && outcome.unbounded == 0, "{outcome:?}");
            assert!(outcome.ambiguous < outcome.compared, "{outcome:?}");
        }
    }
}

#[test]
fn steep_volumes_are_within_their_bounds() {
    for outcome in compare_views("blobs", ramp, &Grid::blobs([14, 15, 13])) {
        assert!(outcome.compared > 150 && outcome.unbounded == 0, "{outcome:?}");
    }
    for outcome in compare_views("noise", ramp, &Grid::noise([8, 9, 7], &mut Chance::new(31))) {
        assert!(outcome.compared > 0, "{outcome:?}");
    }
}

/// An isosurface: nothing at all below a value, opaque above. Rays that keep away from the step are bounded.
#[test]
fn away_from_a_step_the_bound_holds() {
    let step = |value| if value < 2500 { ([0, 40, 0], 0) } else { ([250, 200, 10], 4095) };
    for outcome in compare_views("step", step, &hills([24, 20, 22])) {
        assert!(outcome.compared > 100, "{outcome:?}");
    }
}
