//! What the reference may make of a sample.
//!
//! **Factors.** An 8-bit factor x / 255 is at most u less on the card. A product of two factors is rounded to u. The
//! bracket ke + Id Gd kd has 14 bits: another u. Emission of 255 without light is exact.
//!
//! **Color.** The table's 12 bits times the bracket, rounded: 1/2. The highlight is an 8-bit colour, of which
//! replication makes 12 bits, off by less than 1, times the specular factor, rounded: 1/2. The sum is clamped.
//!
//! **Opacity.** Of the table, times the gradient-magnitude table's entry, rounded; times what the cut plane leaves,
//! rounded. The magnitude is the rounded length of the gradient.
//!
//! **Premultiplied color.** `c a / 4096`, rounded. A product that is less than 1/2 is rounded to zero.

use super::light::{self, UNIT, hull};
use super::truth::Truth;
use super::{FULL, Range};
use vg500_engine::Task;
use vg500_regs::BlendMode;

/// A sample's ideal R, G, B (not premultiplied) and A in steps, and what the reference's may be.
#[derive(Clone, Copy, Debug)]
pub struct SampleRange {
    pub ideal: [f64; 4],
    pub color: [Range; 3],
    pub alpha: Range,
    pub premultiplied: [Range; 3],
}

impl SampleRange {
    fn empty(ideal: [f64; 4]) -> Self {
        let nothing = [f64::INFINITY, f64::NEG_INFINITY];
        let ideal = ideal.map(|level| level * FULL);
        Self { ideal, color: [nothing; 3], alpha: nothing, premultiplied: [nothing; 3] }
    }

    /// A sample of the volume, given its ideal colour and opacity and what the cut plane leaves of it.
    pub fn of_volume(task: &Task, truth: &Truth, ideal: [f64; 4], cut: Option<Range>) -> Self {
        let mut range = Self::empty(ideal);
        let [lowest, highest] = [truth.value - truth.value_error, truth.value + truth.value_error];
        let read = lowest.ceil().max(0.0) as usize..=(highest.floor() as usize).min(4095);
        let extreme = matches!(task.frame.output.blend, BlendMode::Maximum | BlendMode::Minimum);
        if !extreme && task.tables.opacity[read.clone()].iter().all(|alpha| *alpha == 0) {
            range.include([[0.0; 2]; 3], [0.0; 2]);
            return range;
        }
        for gradient in gradients(truth) {
            let factors = Factors::new(task, gradient);
            for entry in read.clone() {
                let color = task.tables.color[entry].map(f64::from);
                let color = [0, 1, 2].map(|channel| factors.color(color[channel], channel));
                range.include(color, factors.alpha(f64::from(task.tables.opacity[entry]), cut));
            }
        }
        range
    }

    /// A sample of the cursor: 8-bit colours, of which replication makes 12 bits.
    pub fn of_cursor(ideal: [f64; 4]) -> Self {
        let [r, g, b, a] = ideal.map(|level| replicated(level * FULL));
        let mut range = Self::empty(ideal);
        range.include([r, g, b], a);
        range
    }

    fn include(&mut self, color: [Range; 3], alpha: Range) {
        let product = |color: Range| rounded([0, 1].map(|end| color[end] * alpha[end] / 4096.0));
        self.color = [0, 1, 2].map(|channel| hull(self.color[channel], color[channel]));
        self.premultiplied =
            [0, 1, 2].map(|channel| hull(self.premultiplied[channel], product(color[channel])));
        self.alpha = hull(self.alpha, alpha);
    }

    /// Bounds of premultiplied R, G, B, and of A.
    pub fn premultiplied_errors(&self) -> [f64; 4] {
        let ideal = self.premultiplied_ideal();
        let [r, g, b] = [0, 1, 2].map(|channel| farthest(self.premultiplied[channel], ideal[channel]));
        [r, g, b, farthest(self.alpha, self.ideal[3])]
    }

    /// Ideal premultiplied R, G, B, and A.
    pub fn premultiplied_ideal(&self) -> [f64; 4] {
        let [r, g, b, a] = self.ideal;
        [r * a / FULL, g * a / FULL, b * a / FULL, a]
    }
}

/// Greatest distance of a range's values from a number.
pub const fn farthest([low, high]: Range, number: f64) -> f64 {
    (low - number).abs().max((high - number).abs())
}

/// The range of numbers that are rounded to whole ones.
fn rounded([low, high]: Range) -> Range {
    [low - low.min(0.5), high + high.min(0.5)]
}

/// What replication makes of an 8-bit colour: 16 c + c / 16 for 16 c + c / 17.
fn replicated(ideal: f64) -> Range {
    [(ideal - 1.0).max(0.0), (ideal + 1.0).min(FULL)]
}

/// All gradients within the error of the ideal one.
fn gradients(truth: &Truth) -> impl Iterator<Item = [i32; 3]> {
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let (ideal, error) = (truth.gradient[axis], truth.gradient_error[axis]);
        ((ideal - error).ceil() as i32).max(-127)..=((ideal + error).floor() as i32).min(127)
    });
    x.flat_map(move |x| {
        let z = z.clone();
        y.clone().flat_map(move |y| z.clone().map(move |z| [x, y, z]))
    })
}

/// What a gradient makes of colours and opacities.
struct Factors {
    /// ke + Id Gd kd.
    own: Range,
    /// Is Gs ks SpecularColor, in steps.
    highlight: [Range; 3],
    /// Go.
    opacity: Option<Range>,
}

impl Factors {
    fn new(task: &Task, gradient: [i32; 3]) -> Self {
        let illumination = &task.frame.illumination;
        let needs = task.frame.needs();
        let square: i32 = gradient.iter().map(|component| component * component).sum();
        let magnitude = f64::from(square).sqrt().round() as usize;
        let modulation = factor(task.tables.gradient_magnitude[magnitude]);
        let modulated = |intensity, modulate: bool, coefficient: u8| {
            let intensity = if modulate { times(intensity, modulation) } else { intensity };
            times(intensity, factor(coefficient))
        };
        let lit = square > 0;
        let mut own = factor(illumination.emissive);
        if needs.light && lit && illumination.diffuse > 0 {
            let intensity = light::diffuse(&task.tables.diffuse, gradient);
            let diffuse = modulated(intensity, illumination.modulate[1], illumination.diffuse);
            own = [own[0] + diffuse[0] - UNIT, own[1] + diffuse[1] + UNIT];
        } else if illumination.emissive == u8::MAX {
            own = [1.0; 2];
        } else {
            own = [own[0] - UNIT, own[1] + UNIT];
        }
        let mut highlight = [[0.0; 2]; 3];
        if needs.specular && lit {
            let intensity = light::specular(&task.tables.specular, gradient, illumination.eye);
            let specular = modulated(intensity, illumination.modulate[2], illumination.specular);
            highlight = illumination.specular_color.map(|channel| {
                let color = replicated(f64::from(channel) / 255.0 * FULL);
                rounded([color[0] * specular[0], color[1] * specular[1]])
            });
        }
        Self { own, highlight, opacity: needs.opacity_modulation.then_some(modulation) }
    }

    fn color(&self, color: f64, channel: usize) -> Range {
        let exact = self.own == [1.0; 2];
        let body = self.own.map(|own| own * color);
        let body = if exact { body } else { rounded(body) };
        [0, 1].map(|end| (body[end] + self.highlight[channel][end]).clamp(0.0, FULL))
    }

    fn alpha(&self, alpha: f64, cut: Option<Range>) -> Range {
        let steps = [self.opacity, cut].into_iter().flatten();
        steps.fold([alpha; 2], |alpha, factor| rounded([alpha[0] * factor[0], alpha[1] * factor[1]]))
    }
}

/// An 8-bit factor.
fn factor(byte: u8) -> Range {
    let level = f64::from(byte) / 255.0;
    [(level - UNIT).max(0.0), level]
}

/// A product of factors.
fn times(a: Range, b: Range) -> Range {
    [(a[0] * b[0] - UNIT / 2.0).max(0.0), a[1] * b[1] + UNIT / 2.0]
}
