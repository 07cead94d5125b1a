//! How fast the renderers are. Not a test: `cargo test --release -p vg500-engine --test renderers speed --
//! --ignored --nocapture --test-threads 1` prints it.

use crate::card::Card;
use crate::grid::Grid;
use crate::scene::{Scene, UNLIT, VOXEL};
use std::time::Instant;
use vg500_engine::frame::Illumination;
use vg500_engine::ideal;
use vg500_regs::memory::Table;
use vg500_regs::{BlendMode, Permutation, SharedView};

const SIDE: usize = 256;

/// Prints the best of several times.
fn report(name: &str, card: &mut Card, scene: &Scene) {
    let run = |_| {
        let begin = Instant::now();
        (card.render(scene).unwrap().samples, begin.elapsed().as_secs_f64())
    };
    let (samples, seconds) = (0..5).map(run).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    print(name, samples, seconds);
}

fn print(name: &str, samples: u64, seconds: f64) {
    println!("{name:>24}: {seconds:7.3} s, {:7.1} M samples/s", samples as f64 / 1e6 / seconds);
}

#[test]
#[ignore = "prints times"]
fn frames_of_256_cubed() {
    let mut card = Card::with_transfer(|value| ([value as u8, 200, (value >> 4) as u8], value >> 5));
    card.set_map(Table::Diffuse, |[x, y, z]| (128 + 5 * x + 3 * y + 8 * z) as u8);
    card.set_map(Table::Specular, |[x, y, z]| (128 - 5 * x + 3 * y + 8 * z) as u8);
    let head_on = Scene::new(card.load(&Grid::blobs([SIDE; 3])));
    report("head-on", &mut card, &head_on);
    let sheared = Scene { step: [VOXEL / 3, VOXEL / 5], ..head_on.clone() }.with_all_rays();
    report("sheared", &mut card, &sheared);
    for (name, word) in [("along y", 0x120), ("along x", 0x012), ("x and y exchanged", 0x201)] {
        let permutation = Permutation::from_word(word).unwrap();
        report(name, &mut card, &Scene { permutation, ..sheared.clone() });
    }
    let task = card.task(&sheared).unwrap();
    let begin = Instant::now();
    let rays = ideal::frame::scene(&task, SharedView::of(&mut card.voxels)).unwrap().render();
    let samples = rays.iter().map(|ray| u64::from(ray.samples)).sum();
    print("ideal, sheared", samples, begin.elapsed().as_secs_f64());
    report("MIP", &mut card, &Scene { blend: BlendMode::Maximum, ..sheared.clone() });
    let lit = Illumination { emissive: 60, diffuse: 200, specular: 90, eye: [0, 0, 32767], ..UNLIT };
    report("illuminated", &mut card, &Scene { illumination: lit, ..sheared.clone() });
    card.set_transfer(|value| ([value as u8, 200, 90], if value < 2500 { 0 } else { 2000 }));
    report("illuminated surfaces", &mut card, &Scene { illumination: lit, ..sheared });
}
