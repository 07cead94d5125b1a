//! What each stage of the pipeline costs: frames with it minus frames without it.
//!
//! Stages are switched by scenes and by the register `KEEP`, which makes the engine compute what a frame does not
//! need. Those frames go through the general pipeline, in which every stage asks whether it is needed.

use super::measure::{BRUTE_FORCE, Setting, forbid};
use super::scene::{Axis, Scene};
use super::specimen::Specimen;
use super::{Bench, Steps};
use crate::command::error::Error;
use serde::Serialize;
use std::collections::BTreeMap;
use vg500_regs::Field;
use vg500_regs::table::report_omitted::{
    CLASSIFICATION, DECISIONS, GRADIENT, INTERPOLATION_X, INTERPOLATION_Y, INTERPOLATION_Z, MODULATION,
    PREMULTIPLICATION,
};

/// Frames that are compared: their name, a scene, a direction of view, and what is not left out.
pub const FRAMES: [(&str, &str, Axis, &[Field]); 14] = [
    ("mip", "mip", Axis::Z, &[]),
    ("mip classified", "mip", Axis::Z, &[CLASSIFICATION]),
    ("general none", "none", Axis::Z, &[DECISIONS, PREMULTIPLICATION]),
    ("general none with gradient", "none", Axis::Z, &[DECISIONS, PREMULTIPLICATION, GRADIENT]),
    ("general diffuse with magnitude", "diffuse", Axis::Z, &[DECISIONS, MODULATION]),
    ("general full-unmodulated with magnitude", "full-unmodulated", Axis::Z, &[DECISIONS, MODULATION]),
    ("general full", "full", Axis::Z, &[DECISIONS]),
    ("none", "none", Axis::Z, &[]),
    ("diffuse", "diffuse", Axis::Z, &[]),
    ("full-unmodulated", "full-unmodulated", Axis::Z, &[]),
    ("full", "full", Axis::Z, &[]),
    ("none interpolated along z", "none", Axis::Z, &[INTERPOLATION_Z]),
    ("none head-on", "none", Axis::HEAD_ON, &[]),
    ("none head-on interpolated", "none", Axis::HEAD_ON, &[INTERPOLATION_X, INTERPOLATION_Y]),
];

/// Stages, frames with them, and frames without them.
const STAGES: [(&str, &str, Option<&str>); 13] = [
    ("voxels, interpolation along x and y, maximum", "mip", None),
    ("classification", "mip classified", Some("mip")),
    ("alpha blending instead of a maximum", "general none", Some("mip classified")),
    ("gradient and its magnitude", "general none with gradient", Some("general none")),
    ("diffuse light", "general diffuse with magnitude", Some("general none with gradient")),
    ("specular light", "general full-unmodulated with magnitude", Some("general diffuse with magnitude")),
    ("modulation", "general full", Some("general full-unmodulated with magnitude")),
    ("interpolation along x and y", "none head-on interpolated", Some("none head-on")),
    ("interpolation along z", "none interpolated along z", Some("none")),
    ("classification and blending, specialised", "none", Some("mip")),
    ("gradient and diffuse light, specialised", "diffuse", Some("none")),
    ("specular light, specialised", "full-unmodulated", Some("diffuse")),
    ("magnitude and modulation, specialised", "full", Some("full-unmodulated")),
];

/// What a stage costs.
#[derive(Clone, Debug, Serialize)]
pub struct StageRow {
    /// The stage.
    pub stage: &'static str,
    /// Which frames are compared.
    pub difference: String,
    /// Voxels along each axis.
    pub size: u32,
    /// Bits of a voxel.
    pub bits: u32,
    /// Vector instructions.
    pub simd: &'static str,
    /// Threads.
    pub threads: usize,
    /// Of all threads together.
    pub ns_per_sample: f64,
    /// Of all cores together.
    pub cycles_per_sample: f64,
}

/// How often all frames are measured, each time a part of them: what disturbs one kind disturbs the others too.
pub const TURNS: u32 = 7;

/// Measures all stages. The best frames are compared.
pub fn measure(bench: &mut Bench, specimen: &Specimen, progress: &mut Steps) -> Result<Vec<StageRow>, Error> {
    let mut best: BTreeMap<&str, f64> = BTreeMap::new();
    for _ in 0..TURNS {
        for (name, scene, axis, kept) in FRAMES {
            let scene: Scene = scene.parse().map_err(Error::failure)?;
            let setting = Setting { scene, axis, keep: BRUTE_FORCE | forbid(kept) };
            let timing = bench.time(specimen, &setting, bench.frames.div_ceil(TURNS))?;
            let seconds = best.entry(name).or_insert(f64::INFINITY);
            *seconds = seconds.min(timing.best / timing.samples as f64);
            progress.step();
        }
    }
    let per_sample = |name: &str| best.get(name).copied().unwrap_or(f64::NAN);
    let row = |(stage, with, without): (&'static str, &str, Option<&str>)| {
        let seconds = per_sample(with) - without.map_or(0.0, per_sample);
        StageRow {
            stage,
            difference: without.map_or_else(|| with.to_owned(), |without| format!("{with} - {without}")),
            size: specimen.size,
            bits: specimen.bits,
            simd: bench.level.name(),
            threads: bench.threads,
            ns_per_sample: seconds * 1e9,
            cycles_per_sample: bench.machine.cycles_per_sample(seconds, 1),
        }
    };
    Ok(STAGES.map(row).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_difference_is_one_of_measured_frames() {
        let is_measured = |name: &str| FRAMES.iter().any(|(known, ..)| *known == name);
        for (stage, with, without) in STAGES {
            assert!(is_measured(with) && without.is_none_or(is_measured), "{stage}");
        }
        for (_, scene, ..) in FRAMES {
            assert!(scene.parse::<Scene>().is_ok(), "{scene}");
        }
    }
}
