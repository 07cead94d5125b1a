use crate::card::Card;
use crate::grid::{Chance, Grid};
use crate::scene::{LIT, Scene, UNLIT, VOXEL};
use std::time::Instant;
use vg500_engine::frame::Illumination;
use vg500_engine::{Cancel, Level, Renderer};
use vg500_regs::{BlendMode, Permutation};

#[test]
#[ignore = "prints times"]
fn optimised_speed() {
    let mut card = Card::with_transfer(|value| ([value as u8, 200, (value >> 4) as u8], 1 + (value >> 8)));
    card.set_gradient_magnitude(|entry| 40 + entry / 2);
    card.set_maps(&Permutation::IDENTITY);
    let mut chance = Chance::new(3);
    let grid = if std::env::var("NOISE").is_ok() { Grid::noise([256; 3], &mut chance) } else { Grid::blobs([256; 3]) };
    let store = card.load(&grid);
    let full = LIT;
    let unmod = Illumination { modulate: [false; 3], ..LIT };
    let diffuse = Illumination { specular: 0, modulate: [false; 3], ..LIT };
    for (name, light, blend) in [("none", UNLIT, BlendMode::Alpha), ("diffuse", diffuse, BlendMode::Alpha), ("full-unmod", unmod, BlendMode::Alpha), ("full", full, BlendMode::Alpha), ("mip", UNLIT, BlendMode::Maximum), ("sum", UNLIT, BlendMode::Sum)] {
        for (view, word, step) in [("head-on", 0x210, [0, 0]), ("shear z", 0x210, [VOXEL / 3, VOXEL / 5]), ("corner z", 0x210, [VOXEL, VOXEL]), ("flip z", 0x254, [VOXEL / 3, VOXEL / 5]), ("shear y", 0x120, [VOXEL / 3, VOXEL / 5]), ("shear x", 0x012, [VOXEL / 3, VOXEL / 5])] {
            let scene = Scene { illumination: light, blend, step, permutation: Permutation::from_word(word).unwrap(), ..Scene::new(store) }.with_all_rays();
            let scene = Scene { rays: scene.rays.map(|r| r.min(511)), ..scene };
            if let Ok(only) = std::env::var("ONLY") && !format!("{name} {view}").starts_with(&only) { continue; }
            let task = card.task(&scene).unwrap();
            print!("{name:>10} {view:>9}:");
            for level in Level::all().filter(|l| l.name() != "portable" || std::env::var("PORTABLE").is_ok()) {
                for threads in if std::env::var("ONE").is_ok() { vec![1] } else { vec![1, 2] } {
                    let engine = Renderer::Optimised { level, threads }.start();
                    let mut times: Vec<f64> = (0..15).map(|_| {
                        let memories = card.memories();
                        let cpu = || std::fs::read_to_string("/proc/thread-self/schedstat").unwrap().split(' ').next().unwrap().parse::<f64>().unwrap() / 1e9;
                        let begin = Instant::now(); let c = cpu();
                        engine.render(&task, memories, &Cancel::default()).unwrap();
                        { let _ = (c, cpu()); begin.elapsed().as_secs_f64() }
                    }).collect();
                    times.sort_by(f64::total_cmp);
                    print!("  {} {threads}T best {:6.0} median {:6.0}", level.name(), 16.777216 / times[0], 16.777216 / times[7]);
                }
            }
            println!();
        }
    }
}
