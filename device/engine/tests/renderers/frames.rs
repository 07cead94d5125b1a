//! Frames as a whole: where pixels go, what is reported, how a frame is stopped.

use crate::card::Card;
use crate::grid::{Chance, Grid};
use crate::scene::{LIT, MODES, Scene, VOXEL};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use vg500_engine::fixed::narrow;
use vg500_engine::{Cancel, Memories, Renderer};
use vg500_regs::memory::{plane_offset, planes};
use vg500_regs::table::accumulators;
use vg500_regs::{BlendMode, Fault, FaultCode, Permutation, PlaneFormat, SharedView};

/// A small frame in which nothing is aligned.
fn oblique(card: &mut Card) -> Scene {
    let scene = Scene::new(card.load(&Grid::noise([9, 8, 7], &mut Chance::new(40))));
    let scene = Scene { start: [VOXEL / 5; 2], step: [VOXEL / 3, VOXEL / 7], illumination: LIT, ..scene };
    scene.with_all_rays()
}

#[test]
fn exactly_the_rectangle_of_rays_is_written() {
    let mut card = Card::with_tables();
    let scene = oblique(&mut card);
    for format in [PlaneFormat::Rgba8, PlaneFormat::Accumulator64, PlaneFormat::Sum128] {
        let blend = if format == PlaneFormat::Sum128 { BlendMode::Sum } else { BlendMode::Alpha };
        for plane in [0, planes(format) / 2, planes(format) - 1] {
            let scene = Scene { format, blend, plane, ..scene.clone() };
            card.pixels.fill(0x5a);
            let first = card.rendered(&scene);
            card.pixels.fill(0xc3);
            assert_eq!(card.rendered(&scene), first, "all of it depends on the frame alone");
            let [width, height] = scene.rays;
            for row in 0..height {
                let begin = plane_offset(format, plane, 0, row);
                card.pixels[begin..plane_offset(format, plane, width, row)].fill(0xc3);
            }
            assert!(card.pixels.iter().all(|byte| *byte == 0xc3), "{format:?} {plane}");
        }
    }
}

#[test]
fn the_checksum_is_that_of_the_pixels_in_memory() {
    let mut card = Card::with_tables();
    let scene = oblique(&mut card);
    let mut seen = Vec::new();
    for blend in MODES {
        for format in [PlaneFormat::Rgba8, scene.wide_format()] {
            let format = if blend == BlendMode::Sum { PlaneFormat::Sum128 } else { format };
            let scene = Scene { blend, format, plane: 2, ..scene.clone() };
            let report = card.render(&scene).unwrap();
            assert_eq!(report.checksum, crc32fast::hash(&card.plane(&scene)), "{blend:?} {format:?}");
            seen.push(report.checksum);
        }
    }
    seen.dedup();
    assert_eq!(seen.len(), 7);
}

#[test]
fn stored_bytes_are_the_nearest_to_the_accumulators() {
    let mut card = Card::with_tables();
    let scene = oblique(&mut card);
    for blend in [BlendMode::Alpha, BlendMode::Maximum, BlendMode::Minimum] {
        let scene = Scene { blend, ..scene.clone() };
        let expected: Vec<u8> = card.pixels(&scene).iter().flatten().copied().map(narrow).collect();
        assert!(card.rendered(&scene) == expected, "{blend:?}");
    }
}

/// MIP and MinIP show colours as they are lit, whatever their opacity.
#[test]
fn extremes_are_lit_even_if_they_are_transparent() {
    let mut card = Card::new();
    card.set_maps(&Permutation::IDENTITY);
    let store = card.load(&Grid::noise([9, 8, 7], &mut Chance::new(43)));
    for blend in [BlendMode::Maximum, BlendMode::Minimum] {
        let scene = Scene { blend, illumination: LIT, ..Scene::new(store) };
        let mut colors = |opacity| {
            card.set_transfer(|value| ([(value >> 4) as u8; 3], opacity));
            card.rays(&scene).iter().map(|ray| ray.color).collect::<Vec<_>>()
        };
        assert!(colors(0) == colors(4095), "{blend:?}");
    }
}

#[test]
fn samples_are_those_that_exist_visible_or_not() {
    let mut card = Card::with_tables();
    let scene = Scene { blend: BlendMode::Sum, ..oblique(&mut card) };
    let samples = |rays: Vec<vg500_engine::stage::composite::Ray>| -> u64 {
        rays.iter().map(|ray| u64::from(ray.samples)).sum()
    };
    let counted = samples(card.rays(&scene));
    let format = scene.wide_format();
    for subvolume in [scene.subvolume, [[3, 4]; 3], [[-5, -4]; 3]] {
        let report = card.render(&Scene { subvolume, format, ..scene.clone() }).unwrap();
        assert_eq!((report.samples, report.cycles), (counted, 32 * 32 * 32 / 4));
    }
    let head_on = Scene::new(scene.store);
    assert_eq!(card.render(&head_on).unwrap().samples, 9 * 8 * 7);
}

#[test]
fn accumulators_come_from_another_plane_and_leave_it_alone() {
    let mut card = Card::with_tables();
    for blend in MODES {
        let mut scene = Scene { blend, plane: 2, ..oblique(&mut card) };
        scene.format = scene.wide_format();
        let first = card.rendered(&scene);
        let onto = Scene { plane: 3, accumulators: Some(2), ..scene.clone() };
        let second = card.rendered(&onto);
        assert_eq!(card.plane(&scene), first);
        assert_eq!(first == second, matches!(blend, BlendMode::Maximum | BlendMode::Minimum), "{blend:?}");
        // In place it is the same.
        card.render(&Scene { accumulators: Some(2), ..scene.clone() }).unwrap();
        assert_eq!(card.plane(&scene), second);
    }
}

#[test]
fn a_sum_that_could_overflow_is_refused() {
    let mut card = Card::with_tables();
    let mut scene = Scene { blend: BlendMode::Sum, format: PlaneFormat::Sum128, ..oblique(&mut card) };
    scene.accumulators = Some(1);
    let slices: u128 = 7;
    for (samples, fits) in [(32768 - slices, true), (32768 - slices + 1, false), ((1 << 20) - 1, false)] {
        card.pixels.fill(0);
        let offset = plane_offset(PlaneFormat::Sum128, 1, scene.rays[0] - 1, scene.rays[1] - 1);
        card.pixels[offset..][..16].copy_from_slice(&(samples << 108_u32).to_le_bytes());
        let refused = Fault::new(FaultCode::Value, accumulators::SOURCE);
        assert_eq!(card.render(&scene).err(), (!fits).then_some(refused), "{samples}");
    }
}

/// Accumulators that the host wrote itself stay within their channels.
#[test]
fn colors_beyond_their_opacity_do_not_spill_over() {
    let mut card = Card::with_transfer(|_| ([255, 0, 255], 4095));
    let store = card.load(&Grid::noise([1, 1, 8], &mut Chance::new(41)));
    let scene = Scene { format: PlaneFormat::Accumulator64, accumulators: Some(0), ..Scene::new(store) };
    let offset = plane_offset(PlaneFormat::Accumulator64, 0, 0, 0);
    card.pixels[offset..][..8].copy_from_slice(&4095_u64.to_le_bytes());
    let [ray] = card.rays(&scene)[..] else { panic!("one ray") };
    assert_eq!((ray.color, ray.alpha), ([4095, 0, 4094], 4095));
}

#[test]
fn a_frame_cancelled_from_another_thread_stops() {
    let mut card = Card::with_tables();
    let store = card.load(&Grid::noise([128; 3], &mut Chance::new(42)));
    let scene = Scene { illumination: LIT, supersampling: 8, ..Scene::new(store) };
    let task = card.task(&scene).unwrap();
    let before = card.pixels.clone();
    let (cancel, begun) = (Cancel::default(), AtomicBool::new(false));
    let result = std::thread::scope(|scope| {
        let frame = scope.spawn(|| {
            begun.store(true, Ordering::Release);
            card.run(&task, &cancel)
        });
        while !begun.load(Ordering::Acquire) {
            std::thread::yield_now();
        }
        // The frame has sixteen million samples to go; this is time for some of them.
        std::thread::sleep(Duration::from_millis(20));
        cancel.cancel();
        frame.join().unwrap()
    });
    assert_eq!(result, Err(Fault::CANCELLED));
    assert!(card.pixels == before, "a frame that was stopped has written nothing");
}

#[test]
fn memories_that_are_too_small_are_faults() {
    let mut card = Card::with_tables();
    let scene = Scene { plane: 1, ..oblique(&mut card) };
    let task = card.task(&scene).unwrap();
    let last = plane_offset(scene.format, 1, scene.rays[0], scene.rays[1] - 1);
    let render = |voxels: &mut [u8], pixels: &mut [u8]| {
        let section = SharedView::of(&mut []);
        let memories = Memories { voxel: SharedView::of(voxels), pixel: SharedView::of(pixels), section };
        Renderer::Reference.render(&task, memories, &Cancel::default()).map_err(|fault| fault.code)
    };
    let mut voxels = card.voxels.clone();
    assert!(render(&mut voxels, &mut vec![0; last]).is_ok());
    assert_eq!(render(&mut voxels, &mut vec![0; last - 1]), Err(FaultCode::Range));
    assert_eq!(render(&mut voxels, &mut []), Err(FaultCode::Range));
    assert_eq!(render(&mut [], &mut vec![0; last]), Err(FaultCode::Range));
    card.tables.truncate(100);
    assert_eq!(card.task(&scene).err().map(|fault| fault.code), Some(FaultCode::Range));
}
