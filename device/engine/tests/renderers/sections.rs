//! Frames that work in sections: the same pixels, and what section memory holds of them.

use crate::card::Card;
use crate::grid::{Chance, Grid};
use crate::optimised::{random_scene, random_tables};
use crate::scene::{LIT, MODES, Scene, UNLIT, VOXEL};
use std::sync::atomic::{AtomicBool, Ordering};
use vg500_engine::{Cancel, Level, Renderer};
use vg500_regs::memory::Table;
use vg500_regs::section::*;
use vg500_regs::table::output;
use vg500_regs::{BlendMode, Fault, FaultCode, Field, Permutation, SharedView, VoxelFormat};

/// Draws a scene without and with sections, and compares all of pixel memory.
fn compare(card: &mut Card, scene: &Scene) {
    let before = card.pixels.clone();
    let report = card.render(scene);
    let expected = std::mem::replace(&mut card.pixels, before);
    let in_sections = card.render(&Scene { sections: true, ..scene.clone() });
    assert!(card.pixels == expected, "{scene:?}");
    match (report, in_sections) {
        (Ok(report), Ok(found)) => {
            let same = |it: &vg500_engine::Report| (it.samples, it.processed, it.omitted, it.checksum);
            assert_eq!(same(&report), same(&found), "{scene:?}");
            assert!(found.cycles >= report.cycles);
        }
        (expected, found) => assert_eq!(expected.err(), found.err(), "{scene:?}"),
    }
}

#[test]
fn random_frames_are_the_same_in_sections() {
    let cases = std::env::var("VOLUMEPRO_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(200);
    let mut sections = [0; 4];
    for case in 0..cases {
        let mut chance = Chance::new(9000 + case);
        let mut card = Card::with_tables().with_sections();
        random_tables(&mut chance, &mut card);
        card.pixels.iter_mut().for_each(|byte| *byte = chance.word() as u8);
        let mut size = [0; 3].map(|_| 1 + chance.below(30) as usize);
        size[chance.below(3) as usize] += 80;
        let store = card.load(&Grid::noise(size, &mut chance));
        let scene = random_scene(&mut chance, store);
        sections[(scene.permuted_size()[0] - 1) / 32] += 1;
        compare(&mut card, &scene);
    }
    println!("frames of 1, 2, 3 and 4 sections: {sections:?}");
    assert!(cases < 100 || sections[2] + sections[3] > cases / 5, "{sections:?}");
}

/// Every place of a boundary among voxels and rays, in every blend mode, lit and not, in every permutation.
#[test]
fn widths_around_section_boundaries_are_the_same() {
    let mut chance = Chance::new(90);
    let permutations: Vec<_> = Permutation::all().collect();
    let mut permutations = permutations.into_iter().cycle();
    for width in [1, 2, 31, 32, 33, 34, 35, 36, 63, 64, 65, 66, 67, 96, 97, 98] {
        for blend in MODES {
            for illumination in [LIT, UNLIT] {
                let permutation = permutations.next().unwrap();
                let mut card = Card::with_tables().with_sections();
                let permuted = Grid::noise([width, 5, 6], &mut chance);
                let scene = Scene::new(card.load(&permuted.unpermuted(&permutation)));
                let mut scene = Scene { permutation, illumination, blend, ..scene };
                scene.rays = [width as u32, 5];
                compare(&mut card, &scene);
                scene.start = [0; 2].map(|_| chance.below(VOXEL as u64) as i32);
                scene.step = chance.pick(&[[0; 2], [VOXEL; 2], [VOXEL / 3, VOXEL / 7], [VOXEL - 1, 1]]);
                scene.supersampling = 1 + chance.below(8) as u32;
                compare(&mut card, &scene.clone().with_all_rays());
                // A window of rays that begins and ends in the midst of a section.
                let mut window = scene.with_all_rays();
                window.start[0] += chance.below(width as u64) as i32 * VOXEL;
                window.rays = [1 + chance.below(width as u64) as u32, 4];
                compare(&mut card, &window);
            }
        }
    }
}

/// The widest volume under the greatest shear: rays cross seven boundaries, one cell per slice.
#[test]
fn the_widest_and_deepest_volumes_are_the_same() {
    for (size, supersampling) in [([256, 3, 256], 1), ([256, 2, 40], 8), ([40, 256, 256], 8)] {
        for (blend, step) in [(BlendMode::Alpha, [VOXEL, 0]), (BlendMode::Sum, [VOXEL / 9, VOXEL / 8])] {
            let mut chance = Chance::new(91);
            let mut card = Card::with_tables().with_sections();
            let scene = Scene::new(card.load(&Grid::noise(size, &mut chance)));
            let step = step.map(|step| step / supersampling as i32);
            let mut scene = Scene { step, supersampling, blend, illumination: LIT, ..scene }.with_all_rays();
            scene.format = scene.wide_format();
            compare(&mut card, &scene);
        }
    }
}

#[test]
fn the_optimised_renderer_draws_sections_too() {
    let mut chance = Chance::new(92);
    let mut card = Card::with_tables().with_sections();
    let store = card.load(&Grid::noise([70, 6, 9], &mut chance));
    let scene = Scene { step: [VOXEL / 2; 2], illumination: LIT, ..Scene::new(store) }.with_all_rays();
    let expected = card.rendered(&scene);
    card.pixels.fill(0);
    card.sections.fill(0);
    let task = card.task(&Scene { sections: true, ..scene.clone() }).unwrap();
    let renderer = Renderer::Optimised { level: Level::detect(), threads: 2 };
    renderer.render(&task, card.memories(), &Cancel::default()).unwrap();
    assert!(card.plane(&scene) == expected);
    assert!(card.sections.iter().any(|byte| *byte != 0), "through section memory");
}

/// What the layout says of a small frame whose values can be told by hand: head-on, samples are voxels.
#[test]
fn spilled_words_are_those_of_the_layout() {
    let voxel = |[x, y, z]: [usize; 3]| (10 * x + 100 * y + 7 * z * z) as u16;
    let grid = Grid::new(VoxelFormat::Uint12Lower, [34, 3, 4], voxel);
    for blend in MODES {
        let mut card = Card::with_transfer(|value| ([(value & 255) as u8, 255, 0], 2048)).with_sections();
        // Light wants gradients, but there is none.
        card.set_map(Table::Diffuse, |_| 0);
        let mut scene = Scene { blend, sections: true, ..Scene::new(card.load(&grid)) };
        scene.illumination.diffuse = 255;
        card.render(&scene).unwrap();
        let words = |slice, beam| {
            let record = &card.sections[record_offset(slice, beam, 3)..][..RECORD];
            record.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect::<Vec<_>>()
        };
        let of =
            |slice, beam, field: Field| field.get_signed(words(slice, beam)[field.register as usize / 4]);
        let unsigned = |slice, beam, field: Field| field.get(words(slice, beam)[field.register as usize / 4]);
        for (slice, beam) in [(0, 0), (1, 2), (3, 1)] {
            let at = |x| i32::from(voxel([x, beam, slice]));
            assert_eq!(of(slice, beam, VOXEL_VALUE), 8 * at(31));
            let [nearer, farther] = [slice.saturating_sub(1), (slice + 1).min(3)];
            let across = i32::from(voxel([0, 0, farther])) - i32::from(voxel([0, 0, nearer]));
            assert_eq!(of(slice, beam, DIFFERENCE), 4 * across);
            assert_eq!(unsigned(slice, beam, SAMPLE) as i32, at(30));
            assert_eq!(unsigned(slice, beam, BEFORE) as i32, at(29));
            // 100 per voxel, on both sides but at the faces: 200 or 100, times 1015 / 32768.
            assert_eq!(of(slice, beam, GRADIENT_Y), if beam == 1 { 6 } else { 3 });
            assert_eq!(of(slice, beam, GRADIENT_Z), (f64::from(across) * 1015.0 / 32768.0).round() as i32);
        }
        // Along the ray of column 29 in beam 0: one sample on slice 0, four on slice 3.
        let rays: Vec<u32> = match blend {
            BlendMode::Alpha => {
                // 4095 * 2048 / 4096 = 2047.5 goes up; 2048 * 4095 / 4096 = 2047.5, too.
                assert_eq!(unsigned(0, 0, GREEN), 2048);
                [0, 3].map(|slice| unsigned(slice, 0, ALPHA)).to_vec()
            }
            BlendMode::Sum => {
                assert_eq!([0, 3].map(|slice| unsigned(slice, 0, SAMPLES)), [1, 4]);
                [0, 3].map(|slice| unsigned(slice, 0, SUM_ALPHA)).to_vec()
            }
            _ => {
                let last = if blend == BlendMode::Maximum { voxel([29, 0, 3]) } else { voxel([29, 0, 0]) };
                assert_eq!(unsigned(3, 0, EXTREME_VALUE), u32::from(last));
                assert_eq!(unsigned(0, 0, EXTREME_VALID), 1);
                [0, 3].map(|slice| unsigned(slice, 0, ALPHA)).to_vec()
            }
        };
        // 2048 of 4095; then 4095 - 4095 / 16, but for roundings of single steps.
        assert_eq!(rays[0], 2048);
        match blend {
            BlendMode::Alpha => assert!((3836..=3842).contains(&rays[1]), "{}", rays[1]),
            BlendMode::Sum => assert_eq!(rays[1], 4 * 2048),
            _ => assert_eq!(rays[1], 2048),
        }
        // Words that the blend mode does not use, and what lies behind the last record, stay as they were.
        let unused = &words(2, 1)[record_words(blend)..];
        assert!(unused.iter().all(|word| *word == 0x5a5a_5a5a));
        assert!(card.sections[record_offset(4, 0, 3)..].iter().all(|byte| *byte == 0x5a));
    }
}

#[test]
fn a_single_section_needs_no_section_memory_but_room_for_it() {
    let mut chance = Chance::new(93);
    let mut card = Card::with_tables();
    let scene = Scene { sections: true, ..Scene::new(card.load(&Grid::noise([32, 5, 7], &mut chance))) };
    let before = card.pixels.clone();
    for (bytes, fits) in [(0, false), (5 * 7 * RECORD - 1, false), (5 * 7 * RECORD, true)] {
        card.sections = vec![0x77; bytes];
        let refused = Fault::new(FaultCode::Range, output::SECTIONS);
        assert_eq!(card.render(&scene).err(), (!fits).then_some(refused), "{bytes}");
        assert!(card.sections.iter().all(|byte| *byte == 0x77));
        assert_eq!(card.pixels == before, !fits, "a refused frame draws nothing");
    }
}

/// A host may write section memory whenever it likes; its pictures are then its own affair.
#[test]
fn a_host_that_scribbles_does_no_harm() {
    let mut chance = Chance::new(94);
    let mut card = Card::with_tables().with_sections();
    let store = card.load(&Grid::noise([70, 20, 20], &mut chance));
    let scene = Scene { step: [VOXEL / 2; 2], illumination: LIT, supersampling: 2, ..Scene::new(store) };
    let mut section_memory = std::mem::take(&mut card.sections);
    let scribbled = SharedView::of(&mut section_memory);
    let (done, mut different) = (AtomicBool::new(false), 0);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut chance = Chance::new(95);
            let mut bytes = vec![0; 20 * 39 * RECORD];
            while !done.load(Ordering::Relaxed) {
                bytes.chunks_mut(8).for_each(|part| part.copy_from_slice(&chance.word().to_le_bytes()));
                scribbled.write(0, &bytes).unwrap();
            }
        });
        for blend in MODES.into_iter().cycle().take(24) {
            let scene = Scene { blend, ..scene.clone() }.with_all_rays();
            let expected = card.rendered(&scene);
            let task = card.task(&Scene { sections: true, ..scene.clone() }).unwrap();
            let memories = vg500_engine::Memories { section: scribbled, ..card.memories() };
            Renderer::Reference.render(&task, memories, &Cancel::default()).unwrap();
            different += usize::from(card.plane(&scene) != expected);
        }
        done.store(true, Ordering::Relaxed);
    });
    assert!(different > 0, "what a section leaves is read from section memory");
}
