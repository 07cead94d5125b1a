//! What is left out changes no pixel: each omission switched off, all of them, and cases in which the last sample
//! that may be left out is next to the first that may not.

use crate::card::{Card, Store};
use crate::grid::{Chance, Grid};
use crate::optimised::{compare, random_scene};
use crate::scene::{LIT, Scene, UNLIT, VOXEL};
use vg500_engine::frame::{Cursor, Illumination};
use vg500_engine::{Cancel, Renderer, Report};
use vg500_regs::table::report_omitted as omitted;
use vg500_regs::{BlendMode, Permutation, VoxelFormat};

/// Draws a scene with the optimised renderer alone.
fn draw(card: &mut Card, scene: &Scene) -> Report {
    let task = card.task(scene).unwrap();
    Renderer::default().render(&task, card.memories(), &Cancel::default()).unwrap()
}

/// Mostly one value, with a few boxes of others.
fn sparse_grid(chance: &mut Chance) -> Grid {
    let size = [(); 3].map(|()| 20 + chance.below(60) as usize);
    let background = chance.below(4096) as u16;
    let boxes: Vec<_> = (0..chance.below(5))
        .map(|_| {
            let corner = size.map(|size| chance.below(size as u64) as usize);
            (corner, 1 + chance.below(20) as usize, chance.below(4096) as u16, 1 + chance.below(300) as u16)
        })
        .collect();
    let mut noise = Chance::new(chance.word());
    Grid::new(VoxelFormat::Uint12Lower, size, |at| {
        let inside = boxes.iter().find(|(corner, side, ..)| {
            (0..3).all(|axis| (corner[axis]..corner[axis] + side).contains(&at[axis]))
        });
        match inside {
            Some((_, _, value, range)) => (value + (noise.word() as u16) % range).min(4095),
            None => background,
        }
    })
}

/// Opaque in a band of values that may be narrow, and where rays may come to an end.
fn sparse_tables(chance: &mut Chance, card: &mut Card) {
    let opacity = chance.pick(&[4095, 4000, 2048, 300, 40, 3]);
    let [a, b] = [(); 2].map(|()| chance.below(4096) as u16);
    let band = if chance.below(3) == 0 { a..=a } else { a.min(b)..=a.max(b) };
    card.set_transfer(|value| {
        ([value as u8, 255, (value >> 4) as u8], if band.contains(&value) { opacity } else { 0 })
    });
}

/// Every switch alone, and all of them.
fn switches() -> Vec<u32> {
    let fields = omitted::REGISTER.fields.iter().map(|field| field.mask());
    fields.chain([0, u32::MAX]).collect()
}

#[test]
fn random_frames_of_sparse_volumes_with_every_switch() {
    for case in 0..60 {
        let mut chance = Chance::new(900 + case);
        let mut card = Card::with_tables();
        sparse_tables(&mut chance, &mut card);
        let grid = sparse_grid(&mut chance);
        let store = card.load(&grid);
        let mut scene = random_scene(&mut chance, store);
        if chance.below(2) == 0 {
            scene.blend = BlendMode::Alpha;
            scene.format = vg500_regs::PlaneFormat::Rgba8;
            scene.accumulators = None;
            scene.cursor_only = false;
        }
        scene.keep = chance.pick(&switches());
        println!("case {case}");
        compare(&mut card, &scene);
    }
}

#[test]
fn each_switch_draws_the_same_picture_and_says_what_it_kept() {
    let mut card = Card::with_tables();
    card.set_transfer(|value| ([value as u8, 200, 90], if value < 2500 { 0 } else { 3000 }));
    let store = card.load(&Grid::blobs([100, 90, 80]));
    for (illumination, blend) in [
        (UNLIT, BlendMode::Alpha),
        (LIT, BlendMode::Alpha),
        (Illumination { specular: 0, modulate: [false; 3], ..LIT }, BlendMode::Alpha),
        (UNLIT, BlendMode::Maximum),
        (UNLIT, BlendMode::Sum),
    ] {
        let scene = Scene { illumination, blend, step: [VOXEL / 3, 0], ..Scene::new(store) }.with_all_rays();
        let plain = draw(&mut card, &scene);
        compare(&mut card, &scene);
        for keep in switches() {
            let kept = draw(&mut card, &Scene { keep, ..scene.clone() });
            assert_eq!(kept.checksum, plain.checksum, "{blend:?} {keep:#x}");
            // What a switch cannot keep is what the frame has no stage for.
            let cannot = [omitted::CROP, omitted::CUT, omitted::CURSOR, omitted::SUBVOLUME];
            let cannot = cannot.iter().fold(0, |bits, field| bits | field.mask());
            assert_eq!(kept.omitted & keep & !cannot, 0, "{blend:?} {keep:#x} {:#x}", kept.omitted);
        }
        let nothing_left_out = draw(&mut card, &Scene { keep: u32::MAX, ..scene.clone() });
        assert_eq!(nothing_left_out.processed, nothing_left_out.samples);
        if blend != BlendMode::Sum {
            assert!(plain.processed < plain.samples, "{blend:?}: {plain:?}");
        }
    }
}

/// A volume of zeros of one cell and a bit along x, with some other voxels.
fn nearly_empty(card: &mut Card, voxels: &[([usize; 3], u16)]) -> Store {
    let mut grid = Grid::new(VoxelFormat::Uint12Lower, [80, 40, 40], |_| 0);
    for &([x, y, z], value) in voxels {
        grid.voxels[(z * 40 + y) * 80 + x] = value;
    }
    card.load(&grid)
}

#[test]
fn a_table_transparent_for_one_value_only() {
    for transparent in [0, 1, 2047, 4094, 4095] {
        let mut card = Card::with_tables();
        card.set_transfer(|value| ([value as u8, 9, 200], if value == transparent { 0 } else { 900 }));
        let grid = Grid::new(VoxelFormat::Uint12Lower, [80, 40, 40], |[x, ..]| {
            if x < 40 { transparent } else { transparent ^ 1 }
        });
        let store = card.load(&grid);
        let scene = Scene { step: [VOXEL / 2, VOXEL / 3], ..Scene::new(store) }.with_all_rays();
        compare(&mut card, &scene);
        let report = draw(&mut card, &scene);
        assert!(report.left_out.empty > 0 && report.left_out.empty < report.samples / 2, "{report:?}");
    }
}

#[test]
fn a_block_of_which_only_the_voxels_behind_are_visible() {
    // The first voxel behind a block along each axis, and its corner.
    for visible in [[32, 3, 3], [3, 8, 3], [3, 3, 1], [32, 8, 1], [64, 16, 39], [79, 39, 39]] {
        for word in [0x210, 0x201, 0x120, 0x012, 0x021, 0x102, 0x654, 0x254] {
            let mut card = Card::with_tables();
            card.set_transfer(|value| ([255, value as u8, 9], if value == 0 { 0 } else { 4095 }));
            let store = nearly_empty(&mut card, &[(visible, 4095)]);
            let permutation = Permutation::from_word(word).unwrap();
            let scene = Scene {
                permutation,
                step: [VOXEL / 2 + 7, VOXEL / 3],
                supersampling: 2,
                ..Scene::new(store)
            };
            for illumination in [UNLIT, LIT] {
                compare(&mut card, &Scene { illumination, ..scene.clone() }.with_all_rays());
            }
        }
    }
}

#[test]
fn rays_that_end_at_exactly_full_opacity_and_one_below() {
    // 4094 after one sample, 4095 after the second: then, and not before, the third may not be seen.
    for opacity in [4095, 4094, 2048, 40, 2, 1] {
        let mut card = Card::with_tables();
        card.set_transfer(|value| ([(value >> 4) as u8, 255, 0], opacity));
        let store = card.load(&Grid::noise([70, 30, 60], &mut Chance::new(4)));
        for illumination in [UNLIT, LIT] {
            let scene = Scene { illumination, ..Scene::new(store) };
            compare(&mut card, &scene);
            compare(&mut card, &Scene { supersampling: 8, ..scene.clone() });
            let report = draw(&mut card, &Scene { supersampling: 8, ..scene.clone() });
            let ends = opacity >= 40 && illumination == UNLIT;
            assert!(report.left_out.finished > 0 || !ends, "{opacity}: {report:?}");
        }
    }
}

#[test]
fn a_cursor_behind_rays_that_only_it_can_change() {
    // Thin fog is finished at 4044 when nothing more opaque than 40 is to come; the cursor is.
    let mut card = Card::with_tables();
    card.set_transfer(|_| ([255, 80, 0], 40));
    let store = card.load(&Grid::noise([40, 40, 250], &mut Chance::new(4)));
    for opacity in [255, 30, 1, 0] {
        let cursor = Cursor {
            enabled: [true, true, false],
            planes: false,
            exclude_overlap: false,
            disable_crop: false,
            width: 7,
            length: 0,
            position: [20 << 8, 20 << 8, 245 << 8],
            color: [[0, 0, 255, opacity]; 3],
        };
        let scene = Scene { supersampling: 4, ..Scene::new(store) };
        compare(&mut card, &scene);
        let with_cursor = Scene { cursor: Some(cursor), ..scene.clone() };
        compare(&mut card, &with_cursor);
        let [plain, crossed] = [&scene, &with_cursor].map(|scene| draw(&mut card, scene));
        assert!(plain.left_out.finished > 0, "{plain:?}");
        assert_eq!(crossed.checksum != plain.checksum, opacity >= 30, "{opacity}");
    }
}

#[test]
fn what_cropping_hides_is_not_computed() {
    let mut card = Card::with_tables();
    let store = card.load(&Grid::blobs([96, 64, 64]));
    let mut scene = Scene { illumination: LIT, ..Scene::new(store) };
    scene.subvolume = [[0, 31], [16, 40], [8, 60]];
    compare(&mut card, &scene);
    let report = draw(&mut card, &scene);
    // By cells of 32 samples, or by two where vectors are that long.
    let left = report.samples - report.left_out.hidden;
    assert!([32, 64].contains(&(left / 25 / 53)), "{report:?}");
    assert_ne!(report.omitted & omitted::HIDDEN_BLOCKS.mask(), 0);
    let kept = draw(&mut card, &Scene { keep: omitted::HIDDEN_BLOCKS.mask(), ..scene });
    assert_eq!((kept.left_out.hidden, kept.checksum), (0, report.checksum));
}

#[test]
fn grey_frames_have_one_colour_channel() {
    let grey_light = Illumination { specular_color: [80; 3], eye: [0, 0, 32767], ..LIT };
    let mut card = Card::with_tables();
    let store = card.load(&Grid::blobs([70, 40, 40]));
    for (visible, illumination, grey) in [
        ([9, 9, 9], grey_light, true),
        ([9, 9, 8], grey_light, false),
        ([9, 9, 9], Illumination { specular_color: [80, 80, 81], ..grey_light }, false),
        ([9, 9, 9], Illumination { specular: 0, ..grey_light }, true),
    ] {
        // Colours that nobody sees do not count.
        card.set_transfer(|value| if value < 1000 { ([1, 2, 3], 0) } else { (visible, value >> 3) });
        let scene = Scene { illumination, step: [VOXEL / 3, VOXEL / 4], ..Scene::new(store) }.with_all_rays();
        compare(&mut card, &scene);
        compare(&mut card, &Scene { format: scene.wide_format(), ..scene.clone() });
        assert_eq!(draw(&mut card, &scene).omitted & omitted::COLORS.mask() != 0, grey);
    }
}
