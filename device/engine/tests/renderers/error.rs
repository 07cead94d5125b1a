//! The reference against the ideal. Every bound is derived, none is fitted.
//!
//! All errors are in steps of the 12-bit scale, 0..=4095. A hat marks what the ideal has, 4095 times a level.
//!
//! **Sample value.** A position is rounded to 1/256 voxel, so it is off by at most 1/512 along an axis, unless its
//! accumulator has no finer bits; it moves the value by at most that times the greatest difference of neighbours
//! along the axis, because trilinear interpolation is Lipschitz with it. Weights are the fractions of rounded
//! positions and add nothing. Each of the three interpolations rounds to 1/8, off by at most 1/16, and later ones
//! only average; the sample is rounded to 1, off by at most 1/2. So `|v - v^| <= E` with
//! `E = sum of slope / 512 + 3 / 16 + 1 / 2`.
//!
//! **Classification.** The reference reads entry `v`, the ideal is linear between entries. All entries that lie
//! within `E` of `v^` can have been read; the greatest differences among them bound opacity, `|a - a^| <= d`, and
//! colour. So the slope of the tables counts where the sample lies; at a step the bound is as high as the step.
//!
//! **Premultiplied colour.** `m = c a / 4096`, rounded; `m^ = c^ a^ / 4095`. `|m - m^| <= u` by the same entries,
//! with 1/2 for the rounding, or `m` itself where it is less than that, because it is rounded to zero then.
//!
//! **Compositing.** With `A' = A^ / 4095`, `e = A - A^` and `f = C - C^`, a sample adds
//!
//! * `a (4095 - A) / 4096` rounded: `e := e (1 - a / 4095) + (a - a^)(1 - A') + r - q`,
//! * `m (4095 - A) / 4096` rounded: `f := f + (m - m^)(1 - A') - (m / 4095) e + r - q`,
//!
//! where `|r|` is at most 1/2 and at most the product, and `q`, the product over 4095, comes from dividing by 4096
//! instead of 4095. The test follows these bounds along each ray.
//!
//! **Extremes.** `|v - v^| <= E` holds for all samples of a ray, so it holds for their extremes, and the entries
//! within `E` bound colour and opacity. **Sums** are means of `a` and `m`, rounded: 1/2 more than the mean of their
//! bounds.
//!
//! **What is left out.** A sample that lies within 1/512 voxel of a face may exist for one renderer and not for the
//! other. Rays with such a sample, and rays whose bound exceeds a quarter of full range, are counted, not
//! compared.

use crate::card::Card;
use crate::grid::{Chance, Grid};
use crate::scene::{MODES, Scene, VOXEL};
use std::ops::RangeInclusive;
use vg500_engine::plan::Plan;
use vg500_engine::{Tables, Task, ideal};
use vg500_regs::{BlendMode, Permutation, SharedView, VoxelFormat};

/// Full range, and the quarter of it beyond which a bound says nothing.
const FULL: f64 = 4095.0;
const QUARTER: f64 = FULL / 4.0;

/// `E` of a frame.
fn sample_error(scene: &Scene, grid: &Grid) -> f64 {
    let inexact = |accumulated: i32| accumulated % (1 << 14) != 0;
    let [x, y] = [0, 1].map(|axis| inexact(scene.start[axis]) || inexact(scene.step[axis]));
    let rounded = [x, y, !256u32.is_multiple_of(scene.supersampling)];
    let moved = scene.permutation.axes().into_iter().zip(rounded).filter(|(_, rounded)| *rounded);
    moved.map(|(place, _)| slope(grid, place.axis) / 512.0).sum::<f64>() + 3.0 / 16.0 + 0.5
}

/// The greatest difference of neighbours along an object axis.
fn slope(grid: &Grid, axis: usize) -> f64 {
    let mut greatest = 0;
    let value = |at| grid.format.value(grid.at(at));
    Grid::new(grid.format, grid.size, |at| {
        let mut next = at;
        next[axis] = (at[axis] + 1).min(grid.size[axis] - 1);
        greatest = greatest.max(value(at).abs_diff(value(next)));
        0
    });
    f64::from(greatest)
}

/// Bounds for one of the four channels of a sample, given its ideal value.
struct Entries<'a> {
    tables: &'a Tables,
    /// Entries that the reference can have read.
    read: RangeInclusive<usize>,
    ideal: [f64; 4],
}

impl<'a> Entries<'a> {
    fn new(tables: &'a Tables, value: f64, error: f64, ideal: [f64; 4]) -> Self {
        let read = (value - error).ceil().max(0.0) as usize..=((value + error).floor() as usize).min(4095);
        Self { tables, read, ideal: ideal.map(|level| level * FULL) }
    }

    fn alphas(&self) -> impl Iterator<Item = f64> {
        self.read.clone().map(|entry| f64::from(self.tables.opacity[entry]))
    }

    fn colors(&self, channel: usize) -> impl Iterator<Item = f64> {
        self.read.clone().map(move |entry| f64::from(self.tables.color[entry][channel]))
    }

    fn least_alpha(&self) -> f64 {
        self.alphas().fold(FULL, f64::min)
    }

    fn most_alpha(&self) -> f64 {
        self.alphas().fold(0.0, f64::max)
    }

    /// Bound of `|a - a^|`.
    fn alpha_error(&self) -> f64 {
        self.alphas().fold(0.0, |most, alpha| (alpha - self.ideal[3]).abs().max(most))
    }

    /// Bound of the difference of colours that are not premultiplied.
    fn color_error(&self, channel: usize) -> f64 {
        self.colors(channel).fold(0.0, |most, color| (color - self.ideal[channel]).abs().max(most))
    }

    /// Greatest `m`, and bound of `|m - m^|`.
    fn premultiplied(&self, channel: usize) -> [f64; 2] {
        let ideal = self.ideal[channel] * self.ideal[3] / FULL;
        self.colors(channel).zip(self.alphas()).fold([0.0; 2], |[most, error], (color, alpha)| {
            let exact = color * alpha / 4096.0;
            let rounding = exact.min(0.5);
            [most.max(exact + rounding), error.max((exact - ideal).abs() + rounding)]
        })
    }
}

/// Bounds of the four channels of a ray, given the entries of its samples.
fn bounds(blend: BlendMode, samples: &[Entries<'_>], extreme: Option<&Entries<'_>>) -> [f64; 4] {
    match blend {
        BlendMode::Alpha => composited(samples),
        BlendMode::Sum => {
            let mean = |error: &dyn Fn(&Entries<'_>) -> f64| {
                samples.iter().map(error).sum::<f64>() / samples.len().max(1) as f64 + 0.5
            };
            let [r, g, b] = [0, 1, 2].map(|channel| mean(&|entries| entries.premultiplied(channel)[1]));
            [r, g, b, mean(&|entries| entries.alpha_error())]
        }
        BlendMode::Maximum | BlendMode::Minimum => extreme.map_or([0.0; 4], |entries| {
            let [r, g, b] = [0, 1, 2].map(|channel| entries.color_error(channel));
            [r, g, b, entries.alpha_error()]
        }),
    }
}

/// The recurrences of compositing.
fn composited(samples: &[Entries<'_>]) -> [f64; 4] {
    let mut colors = [0.0; 3];
    let mut alpha = 0.0;
    let mut ideal_alpha = 0.0;
    // What rounding a product to 12 bits, and dividing by 4096 instead of 4095, can make of it.
    let product = |factor: f64, transparency: f64| {
        let exact = factor * transparency / 4096.0;
        exact.min(0.5) + exact / FULL
    };
    for entries in samples {
        let through = 1.0 - ideal_alpha / FULL;
        let transparency = (FULL - ideal_alpha + alpha).min(FULL);
        for (channel, color) in colors.iter_mut().enumerate() {
            let [most, error] = entries.premultiplied(channel);
            *color += error * through + most / FULL * alpha + product(most, transparency);
        }
        alpha = alpha * (1.0 - entries.least_alpha() / FULL)
            + entries.alpha_error() * through
            + product(entries.most_alpha(), transparency);
        ideal_alpha += entries.ideal[3] * through;
    }
    let [r, g, b] = colors;
    [r, g, b, alpha]
}

/// Whether a sample of a ray exists in one renderer only.
fn existence_differs(task: &Task, plan: &Plan, ray: [u32; 2]) -> bool {
    let size = task.frame.permuted_size();
    (0..).zip(&plan.slices).any(|(slice, rounded)| {
        [&rounded.x, &rounded.y].into_iter().enumerate().any(|(axis, rounded)| {
            let position = (i64::from(ray[axis]) << 22)
                + i64::from(task.frame.rays.start[axis])
                + slice * i64::from(task.frame.rays.step[axis]);
            let exact = (0..=i64::from(size[axis] - 1) << 22).contains(&position);
            exact != rounded.rays.contains(&ray[axis])
        })
    })
}

/// What came of a comparison.
#[derive(Debug, Default)]
struct Outcome {
    compared: usize,
    /// Rays with a sample that only one renderer has.
    at_faces: usize,
    /// Rays whose bound exceeds a quarter of full range.
    unbounded: usize,
    /// Greatest error, and greatest part of its bound that an error reached.
    error: f64,
    part: f64,
    /// Greatest bound.
    bound: f64,
}

fn compare(card: &mut Card, grid: &Grid, scene: &Scene) -> Outcome {
    let rays = card.rays(scene);
    let task = card.task(&Scene { format: scene.wide_format(), ..scene.clone() }).unwrap();
    let ideal = ideal::frame::scene(&task, SharedView::of(&mut card.voxels)).unwrap();
    let plan = Plan::new(&task.frame);
    let error = sample_error(scene, grid);
    let entries = |value| Entries::new(&task.tables, value, error, (ideal.transfer)(value));
    let mut outcome = Outcome::default();
    for (place, (ray, ideal_ray)) in rays.iter().zip(ideal.render()).enumerate() {
        let [column, row] = [place as u32 % scene.rays[0], place as u32 / scene.rays[0]];
        if existence_differs(&task, &plan, [column, row]) {
            outcome.at_faces += 1;
            continue;
        }
        let start = [ideal.rays.start[0] + f64::from(column), ideal.rays.start[1] + f64::from(row)];
        let samples: Vec<_> = ideal.samples(start).map(entries).collect();
        let extreme = ideal_ray.extreme.map(entries);
        let bounds = bounds(scene.blend, &samples, extreme.as_ref());
        outcome.bound = bounds.into_iter().fold(outcome.bound, f64::max);
        if bounds.iter().any(|bound| *bound > QUARTER) {
            outcome.unbounded += 1;
            continue;
        }
        outcome.compared += 1;
        if let Some(value) = ideal_ray.extreme {
            assert!(ray.valid && (f64::from(ray.extreme) - value).abs() <= error, "{ray:?} {ideal_ray:?}");
        }
        let pixels = ray.pixel(scene.blend).into_iter().zip(ideal_ray.pixel(scene.blend));
        for (bound, (found, expected)) in bounds.into_iter().zip(pixels) {
            let error = (f64::from(found) - FULL * expected).abs();
            // The ideal's own arithmetic is good for far more than a millionth of a step.
            assert!(error <= bound + 1e-6, "{error} > {bound}: ray {column} {row} of {scene:?}");
            outcome.error = outcome.error.max(error);
            outcome.part = outcome.part.max(error / (bound + 1e-6));
        }
    }
    outcome
}

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
            let outcome = compare(&mut card, grid, &view);
            println!(
                "{name}, {blend:?}, k = {}: {} rays, error {:.2}, {:.2} of its bound, greatest bound {:.1}, \
                 not compared {} at faces, {} unbounded",
                view.supersampling,
                outcome.compared,
                outcome.error,
                outcome.part,
                outcome.bound,
                outcome.at_faces,
                outcome.unbounded
            );
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
            assert!(outcome.at_faces < outcome.compared, "{outcome:?}");
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
