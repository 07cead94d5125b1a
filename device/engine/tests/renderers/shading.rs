//! The reference against the ideal in light: gradients, reflectance maps, modulation, together with everything that
//! hides samples. [`bounds`](crate::bounds) derives how far they may be apart.
//!
//! The scenes are regular: tables without steps, and volumes whose gradients are of 8 and more nearly everywhere; a
//! direction made of smaller components of 8 bits is no direction. Rays that meet smaller ones have bounds beyond a
//! quarter of full range, and are counted.

use crate::bounds::light::interpolated;
use crate::bounds::{Outcome, compare};
use crate::card::Card;
use crate::grid::{Chance, Grid};
use crate::lit::{Lit, Vector, dot, unit};
use crate::scene::{LIT, MODES, Scene};
use crate::visibility::{cursor, cut_plane, view};
use vg500_engine::frame::{Crop, Illumination};
use vg500_engine::ideal;
use vg500_engine::ideal::shading::Light;
use vg500_regs::reflectance::{FACE, direction, face_axes};
use vg500_regs::table::{material, output};
use vg500_regs::{BlendMode, Fault, FaultCode, SharedView, VoxelFormat};

/// A number in `low..high`.
fn between(chance: &mut Chance, low: f64, high: f64) -> f64 {
    low + (high - low) * chance.below(1 << 32) as f64 / (1_u64 << 32) as f64
}

fn any_direction(chance: &mut Chance) -> Vector {
    unit([0; 3].map(|_| between(chance, -1.0, 1.0)))
}

/// A slope across a volume, and waves on it that do not level it. Its greatest steepness is what 12 bits allow.
fn slope(size: [usize; 3], chance: &mut Chance) -> Grid {
    let along = any_direction(chance);
    let length: f64 = (0..3).map(|axis| along[axis].abs() * (size[axis] - 1) as f64).sum();
    let steepness = 3300.0 / length;
    let (wave, phase) = (any_direction(chance), between(chance, 0.0, 6.0));
    let middle = size.map(|size| (size - 1) as f64 / 2.0);
    Grid::new(VoxelFormat::Uint12Lower, size, |at| {
        let place = [0, 1, 2].map(|axis| at[axis] as f64 - middle[axis]);
        let waves = (0.8 * dot(wave, place) + phase).sin() / 0.8;
        (2047.5 + steepness * (dot(along, place) + 0.3 * waves)).round() as u16
    })
}

/// Voxels of any shape.
fn any_axes(chance: &mut Chance) -> [Vector; 3] {
    let mut axes = [any_direction(chance), any_direction(chance), any_direction(chance)];
    for (axis, vector) in axes.iter_mut().enumerate() {
        vector[axis] += 1.5 * vector[axis].signum();
    }
    axes
}

fn any_light(chance: &mut Chance, axes: [Vector; 3]) -> Lit {
    let light = |chance: &mut Chance| Light {
        direction: any_direction(chance),
        intensity: between(chance, 0.3, 0.8),
    };
    let lights = (0..1 + chance.below(3)).map(|_| light(chance)).collect();
    let exponent = chance.pick(&[0.0, 1.0, 1.5, 3.0, 6.0]);
    Lit::new(lights, exponent, any_direction(chance), axes)
}

/// Everything a frame can have, each half of the time.
fn any_scene(scene: &Scene, eye: [i16; 3], chance: &mut Chance) -> Scene {
    let mut byte = |least: u64, most: u64| (least + chance.below(most - least)) as u8;
    let illumination = Illumination {
        emissive: byte(0, 128),
        diffuse: byte(60, 256),
        specular: byte(0, 100),
        specular_color: [byte(0, 256), byte(0, 256), byte(0, 256)],
        eye,
        modulate: [byte(0, 2) == 0, byte(0, 2) == 0, byte(0, 2) == 0],
    };
    let mut scene = Scene { illumination, ..scene.clone() };
    let mut half = || chance.below(2) == 0;
    let [bounded, cropped, cut, pointed, exact] = [half(), half(), half(), half(), half()];
    if bounded {
        scene.subvolume[0] = [1, 6];
        scene.block[1] = 0..6;
    }
    scene.crop = cropped.then(|| Crop {
        flags: chance.pick(&[0x0007, 0x000f, 0x1563, 0x3563, 0x1421, 0x3421]),
        slabs: [0; 3].map(|_| [chance.below(800) as i32, 700 + chance.below(1000) as i32]),
    });
    scene.cut = cut.then(|| cut_plane(chance));
    scene.cursor = pointed.then(|| cursor(chance));
    view(&scene, exact, chance)
}

#[test]
fn what_has_no_ideal_is_named() {
    let mut card = Card::with_tables();
    let scene = Scene::new(card.load(&slope([4, 4, 4], &mut Chance::new(79))));
    let lit = Scene { illumination: LIT, ..scene.clone() };
    let blend = BlendMode::Maximum;
    let format = Scene { blend, ..scene.clone() }.wide_format();
    let cursor_only = Scene { blend, format, accumulators: Some(0), cursor_only: true, ..scene };
    for (scene, field) in [(lit, material::DIFFUSE), (cursor_only, output::CURSOR_ONLY)] {
        let task = card.task(&scene).unwrap();
        let refused = ideal::frame::scene(&task, SharedView::of(&mut card.voxels)).err();
        assert_eq!(refused, Some(Fault::new(FaultCode::NotServed, field)));
    }
}

#[test]
fn lit_samples_are_within_their_bounds() {
    let mut chance = Chance::new(80);
    let mut outcomes = [Outcome::default(); MODES.len()];
    for _ in 0..24 {
        let mut card =
            Card::with_transfer(|value| ([(value >> 4) as u8, 255 - (value >> 4) as u8, 99], value / 3));
        let axes = any_axes(&mut chance);
        let lit = any_light(&mut chance, axes);
        lit.load(&mut card);
        let start = 20 + chance.below(60) as u8;
        card.set_gradient_magnitude(|entry| start.saturating_add(entry.saturating_mul(2)));
        let scene = Scene::new(card.load(&slope([8, 7, 9], &mut chance)));
        for (blend, outcome) in MODES.into_iter().zip(&mut outcomes) {
            let scene = any_scene(&Scene { blend, ..scene.clone() }, lit.register(), &mut chance);
            outcome.join(&compare(&mut card, &scene, Some(lit.lighting.clone())));
        }
    }
    for (blend, outcome) in MODES.into_iter().zip(outcomes) {
        outcome.print(&format!("{blend:?}"));
        assert!(outcome.compared > 5000 && outcome.compared > 20 * (outcome.ambiguous + outcome.unbounded));
    }
}

/// What 8 x 8 vertices for each face cannot show, for a light of full intensity on an isotropic volume.
///
/// A map coordinate is the tangent of an angle p on a great circle, u = d tan p with d >= 1. Along it a light is
/// f(p) = (a cos p)^n, with a <= 1, |f''| <= n for n >= 2, and |f'| <= L = sqrt(n) (1 - 1/n)^((n - 1) / 2). So
/// |f_uu| <= |cos^4 p f''| + |2 cos^3 p sin p f'| <= n + 0.65 L = C, and linear interpolation over cells of
/// h = 2/7 is off by at most C h^2 / 8 along each of two axes: about 1 % x n. Diffuse light, n = 1, ends at an edge:
/// slopes between 0 and that of the cosine, at most 1 in all, make h / 4 (1 + C h) instead. Entries of 8 bits: 1/510.
fn map_error(exponent: f64) -> f64 {
    let h = 2.0 / 7.0;
    let slope = exponent.sqrt() * (1.0 - 1.0 / exponent).powf((exponent - 1.0) / 2.0);
    let curvature = exponent + 0.65 * slope;
    let each = if exponent < 2.0 { curvature * h / 4.0 * h } else { curvature * h / 8.0 * h };
    let edge = if exponent < 2.0 { h / 4.0 * 2.0_f64.sqrt() } else { 0.0 };
    2.0 * each + edge + 0.5 / 255.0
}

#[test]
fn maps_show_what_their_resolution_can() {
    let mut chance = Chance::new(81);
    let cubes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut errors = std::collections::BTreeMap::new();
    for exponent in [2, 3, 6, 10, 20] {
        for _ in 0..20 {
            let light = Light { direction: any_direction(&mut chance), intensity: 1.0 };
            let lit = Lit::new(vec![light], f64::from(exponent), any_direction(&mut chance), cubes);
            let [mut diffuse, mut specular] = [0.0_f64; 2];
            for face in 0..6 {
                let entries = face * FACE..(face + 1) * FACE;
                let map = |light: &dyn Fn(Vector) -> f64| -> Vec<u8> {
                    entries
                        .clone()
                        .map(|entry| (light(direction(entry).map(f64::from)) * 255.0).round() as u8)
                        .collect()
                };
                let maps = [map(&|vector| lit.diffuse(vector)), map(&|vector| lit.specular(vector))];
                for (u, v) in (-28..=28).flat_map(|u| (-28..=28).map(move |v| (4 * u, 4 * v))) {
                    let mut vector = direction(entries.start).map(|corner| f64::from(corner) * 16.0);
                    let [across, down] = face_axes(face / 2);
                    [vector[across], vector[down]] = [u, v].map(f64::from);
                    let found = maps.each_ref().map(|map| interpolated(map, f64::from(u), f64::from(v)));
                    diffuse = diffuse.max((found[0] - lit.diffuse(vector)).abs());
                    specular = specular.max((found[1] - lit.specular(vector)).abs());
                }
            }
            for (exponent, error) in [(1, diffuse), (exponent, specular)] {
                let most = errors.entry(exponent).or_insert(0.0);
                *most = error.max(*most);
            }
        }
    }
    for (exponent, error) in errors {
        let bound = map_error(f64::from(exponent));
        println!("exponent {exponent}: error {error:.4} of {bound:.4}");
        assert!(error <= bound, "exponent {exponent}: {error} > {bound}");
    }
}
