//! A volume rendered block by block, each onto the accumulators of those in front of it, is the volume rendered in
//! one pass, bit for bit.

use crate::card::{Card, Store};
use crate::grid::{Chance, Grid};
use crate::scene::{LIT, MODES, Scene, UNLIT, VOXEL};
use std::ops::Range;
use std::sync::LazyLock;
use vg500_engine::frame::{Crop, Cursor, CutPlane};
use vg500_engine::{Cancel, Engine, Renderer};
use vg500_regs::{BlendMode, Permutation};

type Window = [Range<usize>; 3];

/// What draws blocks; the whole is the reference's.
static ENGINES: LazyLock<[Engine; 2]> =
    LazyLock::new(|| [Renderer::Reference, Renderer::default()].map(Renderer::start));

fn render(engine: &Engine, card: &mut Card, scene: &Scene) {
    let task = card.task(scene).unwrap();
    engine.render(&task, card.memories(), &Cancel::default()).unwrap();
}

/// The blocks between cuts along each object axis.
fn blocks(size: [usize; 3], cuts: &[Vec<usize>; 3]) -> Vec<Window> {
    let ranges = |axis: usize| -> Vec<Range<usize>> {
        let ends = cuts[axis].iter().copied().chain([size[axis]]);
        let mut begin = 0;
        ends.map(|end| core::mem::replace(&mut begin, end)..end).collect()
    };
    let [xs, ys, zs] = [0, 1, 2].map(ranges);
    let boxes = |z: &Range<usize>| {
        let z = z.clone();
        let xs = &xs;
        ys.iter().flat_map(move |y| {
            let z = z.clone();
            xs.iter().map(move |x| [x.clone(), y.clone(), z.clone()])
        })
    };
    zs.iter().flat_map(boxes).collect()
}

/// In the order in which rays meet them.
fn front_to_back(mut blocks: Vec<Window>, permutation: &Permutation) -> Vec<Window> {
    blocks.sort_by_key(|block| {
        let mut key = permutation.axes().map(|place| {
            let begin = block[place.axis].start as i64;
            if place.flipped { -begin } else { begin }
        });
        key.reverse();
        key
    });
    blocks
}

/// The voxels that a block needs: one below it and two above its own, as far as there are any.
fn with_apron(block: &Window, size: [usize; 3]) -> Window {
    [0, 1, 2].map(|axis| block[axis].start.saturating_sub(1)..(block[axis].end + 2).min(size[axis]))
}

/// The scene of a block of `whole` whose store holds the voxels of `window`.
fn scene_of(whole: &Scene, block: &Window, window: &Window, store: Store) -> Scene {
    let mut scene = Scene { store, ..whole.clone() };
    let [x, y, z] = whole.permutation.axes().map(|place| match place.flipped {
        true => whole.store.size[place.axis] - window[place.axis].end,
        false => window[place.axis].start,
    });
    for (axis, origin) in [x, y].into_iter().enumerate() {
        let sheared = whole.supersampling as i32 * z as i32 * whole.step[axis];
        scene.start[axis] = whole.start[axis] + sheared - ((origin as i32) << 22);
    }
    for axis in 0..3 {
        let origin = window[axis].start as i32;
        scene.block[axis] = block[axis].start - window[axis].start..block[axis].end - window[axis].start;
        scene.subvolume[axis] = whole.subvolume[axis].map(|bound| bound - origin);
        if let Some(crop) = &mut scene.crop {
            crop.slabs[axis] = crop.slabs[axis].map(|bound| bound - 256 * origin);
        }
        if let Some(cut) = &mut scene.cut {
            let moved = i64::from(cut.normal[axis]) * 256 * i64::from(origin);
            cut.faces = cut.faces.map(|face| face - moved);
        }
        if let Some(cursor) = &mut scene.cursor {
            cursor.position[axis] -= 256 * origin;
        }
    }
    scene
}

/// How the store of a block is made.
#[derive(Clone, Copy, Debug)]
enum Stores {
    /// Each block has a store of its own.
    Own,
    /// Blocks are rendered where they lie in the store of the whole.
    InPlace,
}

/// Pixels of the whole rendered block by block, in base plane 1.
fn block_by_block(
    engine: &Engine,
    card: &mut Card,
    grid: &Grid,
    whole: &Scene,
    blocks: &[Window],
    stores: Stores,
) -> Vec<u8> {
    let whole = Scene { plane: 1, ..whole.clone() };
    let scenes: Vec<Scene> = blocks
        .iter()
        .map(|block| {
            let window = with_apron(block, grid.size);
            let store = match stores {
                Stores::Own => card.load(&grid.window(window.clone())),
                Stores::InPlace => whole.store.window(window.clone()),
            };
            scene_of(&whole, block, &window, store)
        })
        .collect();
    // In alpha blending the cursor is blended with the volume, else over all blocks, from the back to the front.
    let late_cursor = whole.cursor.filter(|_| whole.blend != BlendMode::Alpha);
    let mut accumulators = None;
    for scene in &scenes {
        let cursor = scene.cursor.filter(|_| late_cursor.is_none());
        render(engine, card, &Scene { accumulators, cursor, ..scene.clone() });
        accumulators = Some(1);
    }
    if late_cursor.is_some() {
        for scene in scenes.iter().rev() {
            render(engine, card, &Scene { accumulators, cursor_only: true, ..scene.clone() });
        }
    }
    card.plane(&whole)
}

const SIZE: [usize; 3] = [17, 14, 19];

/// A view of the whole in which nothing is aligned.
fn oblique(store: Store, permutation: Permutation, chance: &mut Chance) -> Scene {
    let mut scene = Scene { permutation, ..Scene::new(store) };
    scene.start = [0; 2].map(|_| chance.below(VOXEL as u64) as i32);
    scene.step = [0; 2].map(|_| chance.below(VOXEL as u64 + 1) as i32);
    scene.supersampling = chance.pick(&[1, 2, 3, 7]);
    scene.with_all_rays()
}

fn check(name: &str, whole: &Scene, cuts: &[Vec<usize>; 3], stores: Stores, card: &mut Card, grid: &Grid) {
    for blend in MODES {
        let mut whole = Scene { blend, ..whole.clone() };
        whole.format = whole.wide_format();
        let expected = card.rendered(&whole);
        let blocks = front_to_back(blocks(grid.size, cuts), &whole.permutation);
        for engine in ENGINES.iter() {
            let found = block_by_block(engine, card, grid, &whole, &blocks, stores);
            assert!(expected == found, "{name}, {stores:?}, {blend:?}, {cuts:?}: {whole:?}");
        }
        let blank = card.rendered(&Scene { subvolume: [[-9, -8]; 3], ..whole.clone() });
        assert!(expected != blank);
    }
}

#[test]
fn blocks_along_each_axis_and_all_at_once_make_the_whole() {
    let mut chance = Chance::new(20);
    let grid = Grid::noise(SIZE, &mut chance);
    let cuts = [
        [vec![8], vec![], vec![]],
        [vec![], vec![1, 13], vec![]],
        [vec![], vec![], vec![6, 7, 12]],
        [vec![5, 11], vec![9], vec![10]],
    ];
    for (place, permutation) in Permutation::all().enumerate() {
        let mut card = Card::with_tables();
        let store = card.load(&grid);
        let cuts = &cuts[place % cuts.len()];
        let unlit = oblique(store, permutation, &mut chance);
        let stores = if place % 2 == 0 { Stores::Own } else { Stores::InPlace };
        check("unlit", &unlit, cuts, stores, &mut card, &grid);
        let lit = Scene { illumination: LIT, ..unlit };
        check("lit", &lit, cuts, stores, &mut card, &grid);
    }
}

#[test]
fn what_is_relative_to_the_store_moves_with_the_block() {
    let mut chance = Chance::new(21);
    let grid = Grid::noise(SIZE, &mut chance);
    let cuts = [vec![8], vec![6], vec![5, 12]];
    for permutation in Permutation::all().step_by(3) {
        let mut card = Card::with_tables();
        let mut whole = oblique(card.load(&grid), permutation, &mut chance);
        whole.subvolume = [[1, 15], [2, 11], [3, 17]];
        whole.crop = Some(Crop { flags: 0x1563, slabs: [[700, 2500]; 3] });
        whole.cut = Some(CutPlane {
            outside: false,
            normal: [9000, -7000, 11000],
            faces: [2 << 22, 9 << 22],
            falloff: 1 << 14,
        });
        whole.cursor = Some(Cursor {
            enabled: [true; 3],
            planes: false,
            exclude_overlap: false,
            disable_crop: true,
            width: 3,
            length: 9,
            position: [2100, 1600, 3000],
            color: [[255, 0, 0, 200], [0, 255, 0, 90], [0, 0, 255, 140]],
        });
        for illumination in [UNLIT, LIT] {
            let whole = Scene { illumination, ..whole.clone() };
            check("furnished", &whole, &cuts, Stores::Own, &mut card, &grid);
        }
    }
}

/// Gradients need every voxel of the apron: without any one layer of it the pictures differ.
#[test]
fn a_smaller_apron_is_not_enough() {
    let mut chance = Chance::new(22);
    let grid = Grid::noise(SIZE, &mut chance);
    let mut card = Card::with_tables();
    let mut whole = Scene { illumination: LIT, ..Scene::new(card.load(&grid)) };
    whole.start = [VOXEL / 3; 2];
    whole.step = [VOXEL / 3; 2];
    whole.supersampling = 2;
    whole.blend = BlendMode::Sum;
    whole = whole.with_all_rays();
    let block = [4..9, 5..8, 6..11];
    let full = with_apron(&block, grid.size);
    let mut rays_of = |window: &Window| {
        let store = card.load(&grid.window(window.clone()));
        card.rays(&scene_of(&whole, &block, window, store))
    };
    let expected = rays_of(&full);
    assert!(expected == rays_of(&[0..SIZE[0], 0..SIZE[1], 0..SIZE[2]]));
    for axis in 0..3 {
        for window in [full[axis].start + 1..full[axis].end, full[axis].start..full[axis].end - 1] {
            let mut smaller = full.clone();
            smaller[axis] = window;
            assert!(expected != rays_of(&smaller), "{smaller:?}");
        }
    }
}

/// A base plane may be a window of a larger one.
#[test]
fn a_window_of_rays_is_a_part_of_all_of_them() {
    let mut chance = Chance::new(23);
    let grid = Grid::noise(SIZE, &mut chance);
    let mut card = Card::with_tables();
    for permutation in Permutation::all().step_by(5) {
        let all = Scene { illumination: LIT, ..oblique(card.load(&grid), permutation, &mut chance) };
        let expected = card.rays(&all);
        let (column, row) = (all.rays[0] / 3, all.rays[1] / 4);
        let mut part = all.clone();
        part.rays = [all.rays[0] / 2, all.rays[1] / 2];
        part.start = [all.start[0] + column as i32 * VOXEL, all.start[1] + row as i32 * VOXEL];
        let rows = expected.chunks(all.rays[0] as usize).skip(row as usize).take(part.rays[1] as usize);
        let expected: Vec<_> =
            rows.flat_map(|rays| &rays[column as usize..][..part.rays[0] as usize]).copied().collect();
        assert!(expected == card.rays(&part), "{permutation:?}");
    }
}
