//! Presets that follow the classes of values.

use super::ControlPoint;
use super::classes::Classes;
use crate::values::part_of_range;

/// R, G, B and opacity per smallest voxel spacing at a data value.
fn point(value: f64, color: [f64; 3], opacity: f64) -> ControlPoint {
    ControlPoint { value, color, opacity }
}

/// The value so far (0..=1) on the way between two.
fn between(low: f64, high: f64, part: f64) -> f64 {
    low * (1.0 - part) + high * part
}

/// The first material like bluish glass, whose surface shows more than its inside; denser ones golden.
pub fn industrial(classes: &Classes) -> Vec<ControlPoint> {
    let [edge, step] = classes.threshold;
    let [_, material, dense] = classes.mean;
    vec![
        point(edge, [0.30, 0.40, 0.58], 0.0),
        point(between(edge, material, 0.5), [0.54, 0.70, 0.95], 0.17),
        point(material, [0.60, 0.74, 0.95], 0.018),
        point(between(material, step, 0.6), [0.66, 0.77, 0.94], 0.018),
        point(step, [0.95, 0.50, 0.15], 0.08),
        point(dense, [1.0, 0.75, 0.30], 0.35),
        point(classes.range[1], [1.0, 0.95, 0.70], 0.7),
    ]
}

/// Noise hidden, dark and translucent at first, light and more opaque with brighter signal.
pub fn mr_head(classes: &Classes) -> Vec<ControlPoint> {
    let [edge, step] = classes.threshold;
    let [background, material, dense] = classes.mean;
    vec![
        point(between(background, edge, 0.6), [0.40, 0.16, 0.12], 0.0),
        point(edge, [0.66, 0.36, 0.27], 0.08),
        point(material, [0.86, 0.58, 0.45], 0.1),
        point(step, [0.94, 0.75, 0.60], 0.12),
        point(dense, [1.0, 0.90, 0.78], 0.2),
        point(classes.range[1], [1.0, 1.0, 0.96], 0.6),
    ]
}

/// All translucent: the first material blue, what is a little denser orange, the densest ivory.
pub fn translucent(classes: &Classes) -> Vec<ControlPoint> {
    let [edge, step] = classes.threshold;
    let [background, material, dense] = classes.mean;
    vec![
        point(between(background, edge, 0.2), [0.15, 0.25, 0.55], 0.0),
        point(edge, [0.22, 0.35, 0.70], 0.005),
        point(material, [0.33, 0.52, 0.85], 0.008),
        point(between(material, step, 0.25), [1.0, 0.50, 0.14], 0.08),
        point(between(material, step, 0.5), [1.0, 0.62, 0.32], 0.02),
        point(dense, [1.0, 0.96, 0.88], 0.05),
    ]
}

/// From transparent blue over green and yellow to red and white, more opaque all the way.
pub fn smooth(classes: &Classes) -> Vec<ControlPoint> {
    let [low, high] = classes.range;
    let at = |part, color, opacity| point(between(low, high, part), color, opacity);
    vec![
        at(0.04, [0.04, 0.08, 0.40], 0.0),
        at(0.15, [0.05, 0.22, 0.75], 0.015),
        at(0.35, [0.08, 0.68, 0.72], 0.035),
        at(0.6, [0.92, 0.82, 0.22], 0.1),
        at(0.85, [0.98, 0.34, 0.10], 0.3),
        at(1.0, [1.0, 0.95, 0.88], 0.6),
    ]
}

/// Grey over the range, transparent below the first material.
pub fn grey(classes: &Classes) -> Vec<ControlPoint> {
    let [low, high] = classes.range;
    let edge = classes.threshold[0];
    let grey = if low < high { part_of_range(edge, classes.range) } else { 0.0 };
    vec![point(low, [0.0; 3], 0.0), point(edge, [grey; 3], 0.0), point(high, [1.0; 3], 0.3)]
}

/// Value v, of 8 bits, has opacity v/255.
pub fn opacity() -> Vec<ControlPoint> {
    vec![point(0.0, [0.95, 0.9, 0.8], 0.0), point(255.0, [0.95, 0.9, 0.8], 1.0)]
}
