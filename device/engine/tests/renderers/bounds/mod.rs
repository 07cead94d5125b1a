//! How far the reference may be from the ideal. Every bound is derived, none is fitted.
//!
//! All errors are in steps of the 12-bit scale, 0..=4095. A hat marks what the ideal has, 4095 times a level;
//! u = 2^-15 is the step of the card's factors. Where a number of the reference is known within a range only, the
//! bound is the greatest difference to the ideal that the range allows.
//!
//! **Position.** It is rounded to 1/256 voxel, so it is off by at most 1/512 along an axis, unless its accumulator
//! has no finer bits. Weights are the fractions of rounded positions and add nothing. Samples that a shift so small
//! makes exist or not, visible or not, belong to no bound: rays with such a sample are counted, not compared.
//!
//! **Sample value.** A shift moves it by at most the shift times the greatest difference of neighbours along the
//! axis, because trilinear interpolation is Lipschitz with it. Each of the three interpolations rounds to 1/8, off
//! by at most 1/16, and later ones only average; the sample is rounded to 1, off by at most 1/2. So
//! `|v - v^| <= E` with `E = sum of slope / 512 + 3 / 16 + 1 / 2`.
//!
//! **Gradient** ([`truth`]). Its component along an axis is the interpolated difference of the voxels on both sides,
//! which a shift moves by at most its own slope. Along x and y it is the difference of two rounded samples, off by
//! `2 (3 / 16 + 1 / 2)`; along z half of it is rounded three times to 1/8, so the difference is off by
//! `2 * 3 / 16`. The factor 1015/32768 stands for 127/4095, and the component is rounded: 1/2. It is an integer of
//! 8 bits, so few of them are possible, and each is followed up.
//!
//! **Light** ([`light`]). A gradient's direction on the cube is off by at most one of 112 steps, and what the
//! reflectance map has there, between its 8-bit entries, is computed exactly; it differs from the light of the ideal
//! by what 8 x 8 vertices cannot show (of the order of 1 % x exponent for each axis of a face) and by 1/2 of 255.
//!
//! **Color and opacity** ([`sample`]). The reference reads entry `v`, the ideal is linear between entries. All entries
//! within `E` of `v^` can have been read. Roundings of factors and products are listed there.
//!
//! **Rays** ([`ray`]). Recurrences of the errors of accumulators.
//!
//! Where a bound exceeds a quarter of full range it says nothing: such rays are counted, not compared.

pub mod accumulate;
pub mod light;
pub mod ray;
pub mod sample;
pub mod truth;

use crate::card::Card;
use crate::scene::Scene;
use std::fmt::Debug;
use truth::{Rounding, Truth};
use vg500_engine::Task;
use vg500_engine::ideal::shading::Lighting;
use vg500_engine::ideal::{self, Ray, Transfer, Voxels};
use vg500_regs::SharedView;

/// Full range, and the quarter of it beyond which a bound says nothing.
pub const FULL: f64 = 4095.0;
const QUARTER: f64 = FULL / 4.0;

/// Lowest and highest value of a number that is not known exactly.
pub type Range = [f64; 2];

/// What came of a comparison.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    pub compared: usize,
    /// Rays with a sample that only one renderer may show.
    pub ambiguous: usize,
    /// Rays whose bound exceeds a quarter of full range.
    pub unbounded: usize,
    /// Greatest error, and greatest part of its bound that an error reached.
    pub error: f64,
    pub part: f64,
    /// Greatest bound of a ray that was compared, and of any.
    pub bound: f64,
    pub greatest: f64,
}

impl Outcome {
    pub fn print(&self, name: &str) {
        println!(
            "{name}: {} rays, error {:.1} of {:.1}, at most {:.2} of a bound; not compared {} ambiguous, {} of bounds \
             up to {:.0}",
            self.compared, self.error, self.bound, self.part, self.ambiguous, self.unbounded, self.greatest
        );
    }

    /// Adds another comparison.
    pub fn join(&mut self, other: &Self) {
        self.compared += other.compared;
        self.ambiguous += other.ambiguous;
        self.unbounded += other.unbounded;
        self.error = self.error.max(other.error);
        self.part = self.part.max(other.part);
        self.bound = self.bound.max(other.bound);
        self.greatest = self.greatest.max(other.greatest);
    }

    /// Notes the four channels of a ray.
    fn add(&mut self, bounds: [f64; 4], found: [u16; 4], expected: [f64; 4], name: &dyn Debug) {
        let bound = bounds.into_iter().fold(0.0, f64::max);
        self.greatest = self.greatest.max(bound);
        if bound > QUARTER {
            self.unbounded += 1;
            return;
        }
        self.compared += 1;
        self.bound = self.bound.max(bound);
        for ((bound, found), expected) in bounds.into_iter().zip(found).zip(expected) {
            let error = (f64::from(found) - FULL * expected).abs();
            // The ideal's own arithmetic is good for far more than a millionth of a step.
            let bound = bound + 1e-6;
            assert!(error <= bound, "{error} > {bound}: {found} for {} in {name:?}", FULL * expected);
            self.error = self.error.max(error);
            self.part = self.part.max(error / bound);
        }
    }
}

/// The frame of a scene in its blend mode's wide format.
pub fn task(card: &mut Card, scene: &Scene) -> Task {
    card.task(&Scene { format: scene.wide_format(), ..scene.clone() }).unwrap()
}

/// Compares a scene with its ideal, in `lighting` if it is lit.
pub fn compare(card: &mut Card, scene: &Scene, lighting: Option<Lighting>) -> Outcome {
    let task = task(card, scene);
    let memory = SharedView::of(&mut card.voxels);
    match lighting {
        Some(lighting) => {
            let ideal = ideal::frame::scene_in_light(&task, memory, lighting).unwrap();
            compare_with(card, scene, &task, &ideal, &ideal.render(), &truth::of_voxels(scene, &ideal))
        }
        None => {
            let ideal = ideal::frame::scene(&task, memory).unwrap();
            compare_with(card, scene, &task, &ideal, &ideal.render(), &truth::of_voxels(scene, &ideal))
        }
    }
}

/// Compares a scene with the rays `expected`, which are those of `ideal` where `truth` says what a sample is.
pub fn compare_with<V: Voxels, T: Transfer>(
    card: &mut Card,
    scene: &Scene,
    task: &Task,
    ideal: &ideal::Scene<V, T>,
    expected: &[Ray],
    truth: &dyn Fn([f64; 3]) -> Truth,
) -> Outcome {
    let mut outcome = Outcome::default();
    let view = ray::View { task, ideal, rounding: Rounding::of(scene), truth };
    for ((place, ray), expected) in (0..).zip(card.rays(scene)).zip(expected) {
        let ray_number: [u32; 2] = [place % scene.rays[0], place / scene.rays[0]];
        let start = [0, 1].map(|axis| ideal.rays.start[axis] + f64::from(ray_number[axis]));
        let Some(met) = view.along(start) else {
            outcome.ambiguous += 1;
            continue;
        };
        if let Some(value) = expected.extreme {
            let error = met
                .iter()
                .filter_map(|met| met.volume.as_ref())
                .fold(0.0, |most, it| it.value_error.max(most));
            let found = f64::from(ray.extreme);
            assert!(
                ray.valid && (found - value).abs() <= error,
                "{found} for {value}: ray {ray_number:?} of {scene:?}"
            );
        }
        let bounds = accumulate::bounds(scene.blend, &met);
        outcome.add(bounds, ray.pixel(scene.blend), expected.pixel(scene.blend), &(ray_number, scene));
    }
    outcome
}
