//! Whatever the registers say, a frame ends well or with a fault.

use crate::card::Card;
use crate::grid::{Chance, Grid};
use crate::scene::{LIT, Scene, VOXEL};
use proptest::prelude::*;
use proptest::sample::select;
use vg500_engine::frame::{Crop, Cursor, CutPlane};
use vg500_engine::{Cancel, Renderer, Report};
use vg500_regs::register::{Field, Register};
use vg500_regs::table::REGISTERS;
use vg500_regs::{BlendMode, Fault, FrameRegisters, SharedView};

fn frame_registers() -> Vec<Register> {
    let registers: Vec<_> =
        REGISTERS.iter().copied().filter(|register| FrameRegisters::holds(register.offset)).collect();
    assert!(registers.len() > 50);
    registers
}

/// Values at the ends of a field and of the ranges that fields have, and anything.
fn field_value() -> impl Strategy<Value = (Field, u32)> {
    let fields: Vec<_> = frame_registers().iter().flat_map(|register| register.fields).copied().collect();
    let edges = [0, 1, 2, 3, 4, 7, 8, 31, 32, 33, 255, 256, 257, 511, 512, 513, 0x7fff, 0x8000, 0xffe0];
    let large = [1 << 22, (1 << 22) + 1, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 0xffc0_0000, 0xffff_8000];
    let value = prop_oneof![select(edges.to_vec()), select(large.to_vec()), any::<u32>()];
    (select(fields), value)
}

/// Takes and renders a frame, and checks that it has written pixels only.
fn run(card: &mut Card, registers: &FrameRegisters) -> Result<Report, Fault> {
    let (voxels, tables) = (card.voxels.clone(), card.tables.clone());
    let view = SharedView::of(&mut card.tables);
    let result = Renderer::Reference.take(registers, &view, card.voxels.len()).and_then(|task| {
        let memories = card.memories();
        Renderer::Reference.render(&task, memories, &Cancel::default())
    });
    assert!(card.voxels == voxels && card.tables == tables);
    result
}

/// A card of small memories, all rubbish, with a volume at the start of voxel memory.
fn small_card(pixel_memory: usize, chance: &mut Chance) -> (Card, Scene) {
    let mut card = Card::with_tables();
    let scene = Scene::new(card.load(&Grid::noise([5, 4, 6], chance)));
    card.pixels.truncate(pixel_memory);
    card.pixels.fill_with(|| chance.word() as u8);
    (card, scene)
}

/// A frame with everything on.
fn furnished(scene: Scene) -> Scene {
    let cursor = Cursor {
        enabled: [true; 3],
        planes: false,
        exclude_overlap: false,
        disable_crop: false,
        width: 3,
        length: 4,
        position: [600, 500, 400],
        color: [[255, 90, 0, 200]; 3],
    };
    let cut =
        CutPlane { outside: false, normal: [9000, 7000, -11000], faces: [0, 3 << 22], falloff: 1 << 14 };
    Scene {
        step: [VOXEL / 3, VOXEL / 2],
        supersampling: 2,
        rays: [7, 9],
        crop: Some(Crop { flags: 0x1563, slabs: [[200, 900]; 3] }),
        cut: Some(cut),
        cursor: Some(cursor),
        illumination: LIT,
        ..scene
    }
}

proptest! {
    #[test]
    fn random_words_never_panic(
        words in prop::collection::vec(any::<u32>(), 128),
        pixel_memory in 0..100_000usize,
        seed: u64,
    ) {
        let (mut card, _) = small_card(pixel_memory, &mut Chance::new(seed));
        let mut registers = FrameRegisters::default();
        for (register, word) in frame_registers().iter().zip(words) {
            registers.write(register.offset, word);
        }
        let _ = run(&mut card, &registers);
    }

    #[test]
    fn a_valid_frame_with_odd_fields_never_panics(
        fields in prop::collection::vec(field_value(), 0..6),
        pixel_memory in select(vec![0, 5000, 1 << 20, 16 << 20]),
        blend in 0..4u32,
        accumulate: bool,
        seed: u64,
    ) {
        let (mut card, scene) = small_card(pixel_memory, &mut Chance::new(seed));
        let mut scene = furnished(scene);
        scene.blend = BlendMode::from_code(blend).unwrap();
        scene.format = scene.wide_format();
        // Pixel memory is rubbish, so these accumulators are such as no frame has left.
        scene.accumulators = accumulate.then_some(0);
        let mut registers = scene.registers();
        for (field, value) in &fields {
            registers.set(*field, *value);
        }
        let result = run(&mut card, &registers);
        let sums = accumulate && scene.blend == BlendMode::Sum;
        prop_assert!(!fields.is_empty() || pixel_memory < 1 << 20 || sums || result.is_ok(), "{:?}", result);
    }
}

/// All combinations of the ends of what geometry can be.
#[test]
fn extreme_geometry_never_panics() {
    let (mut card, scene) = small_card(16 << 20, &mut Chance::new(60));
    let starts = [i32::MIN, i32::MIN + 1, -512 * VOXEL, -1, 0, (1 << 13) - 1, i32::MAX];
    let mut samples = 0;
    for start_x in starts {
        for start_y in starts {
            for step in [0, 1, VOXEL] {
                for (supersampling, rays) in [(1, [1, 1]), (8, [7, 3]), (8, [512, 2])] {
                    let scene = furnished(scene.clone());
                    let start = [start_x, start_y];
                    let scene = Scene { start, step: [step, VOXEL - step], supersampling, rays, ..scene };
                    samples += run(&mut card, &scene.registers()).unwrap().samples;
                }
            }
        }
    }
    assert!(samples > 0);
}

/// The same for what lies in object space.
#[test]
fn extreme_visibility_never_panics() {
    let (mut card, scene) = small_card(16 << 20, &mut Chance::new(61));
    for scene in [furnished(scene.clone()), Scene { cut: None, ..furnished(scene) }] {
        for (low, high) in
            [(i32::MIN, i32::MAX), (i32::MAX, i32::MIN), (i32::MIN, i32::MIN), (i32::MAX, i32::MAX)]
        {
            let mut scene = scene.clone();
            scene.crop = Some(Crop { flags: 0x3fff, slabs: [[low, high]; 3] });
            scene.subvolume = [[low >> 16, high >> 16]; 3];
            if let Some(cut) = &mut scene.cut {
                cut.normal = [i16::MIN, i16::MAX, i16::MIN];
                cut.faces = [low, high].map(|face| i64::from(face) << 32 | 1);
                cut.falloff = 0x1ffff;
            }
            if let Some(cursor) = &mut scene.cursor {
                cursor.position = [low, high, 0];
                cursor.length = 0xffff;
                cursor.disable_crop = true;
            }
            for blend in crate::scene::MODES {
                scene.blend = blend;
                scene.format = scene.wide_format();
                run(&mut card, &scene.registers()).unwrap();
            }
        }
    }
}

/// The largest store of the smallest volume, and the largest base plane.
#[test]
fn the_greatest_sizes_are_rendered() {
    let (mut card, mut scene) = small_card(16 << 20, &mut Chance::new(62));
    (scene.store.size, scene.store.row_pitch, scene.store.slice_rows) = ([5, 1, 1], 0xffe0, 0xffe0);
    (scene.rays, scene.block) = ([512; 2], [0..0xffff, 0..0xffff, 0..0xffff]);
    for plane in [0, 15] {
        let report = run(&mut card, &Scene { plane, ..scene.clone() }.registers()).unwrap();
        assert_eq!(report.samples, 5);
    }
    scene.store.size = [5, 1, 2];
    assert!(run(&mut card, &scene.registers()).is_err(), "the second slice lies far beyond voxel memory");
}
