//! Frames and how long they took.

use super::scene::{Axis, Scene};
use super::specimen::Specimen;
use crate::command::error::Error;
use crate::command::statistics::times;
use crate::{Board, FrameReport};
use std::time::Duration;
use vg500_regs::Field;
use vg500_regs::table::report_omitted as omitted;

/// Frames that are not measured: they bring memory and threads to life.
const WARM_UP: u32 = 2;

/// What depends on the data of a frame: without these omissions every sample of every ray is processed.
const SKIPPING: [Field; 5] = [
    omitted::EMPTY_BLOCKS,
    omitted::FINISHED_RAYS,
    omitted::BEATEN_BLOCKS,
    omitted::HIDDEN_BLOCKS,
    omitted::TRANSPARENT_BLOCKS,
];

/// The bits of the register `KEEP` that forbid some omissions.
pub const fn forbid(omissions: &[Field]) -> u32 {
    let (mut bits, mut place) = (0, 0);
    while place < omissions.len() {
        bits |= omissions[place].mask();
        place += 1;
    }
    bits
}

/// The bits of the register `KEEP` of frames by brute force.
pub const BRUTE_FORCE: u32 = forbid(&SKIPPING);

/// What is measured: frames of a scene that keep what `keep` says.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// What is drawn.
    pub scene: Scene,
    /// From where.
    pub axis: Axis,
    /// The register `KEEP`.
    pub keep: u32,
}

/// How long frames took.
#[derive(Clone, Debug)]
pub struct Timing {
    /// Samples of a frame.
    pub samples: u64,
    /// Samples that were not left out.
    pub processed: u64,
    /// Engine time of the fastest, seconds.
    pub best: f64,
    /// Median of the engine times, seconds.
    pub median: f64,
    /// Median of the times from submission until pixels were readable, seconds.
    pub whole: f64,
}

/// Draws `frames` frames.
pub fn measure(
    board: &mut Board,
    specimen: &Specimen,
    setting: &Setting,
    frames: u32,
) -> Result<Timing, Error> {
    let Setting { scene, axis, keep } = setting;
    let mut context = scene.context(axis, specimen.size)?;
    board.keep(*keep);
    let mut reports = Vec::new();
    for frame in 0..WARM_UP + frames {
        scene.renew(&mut context, axis, frame)?;
        let report = board.render(&context, &specimen.volume)?.report;
        if frame >= WARM_UP {
            reports.push(report);
        }
    }
    let last = reports.last().copied().unwrap_or_default();
    let seconds = |time: fn(&FrameReport) -> Duration| times(&reports, time).0 / 1e3;
    Ok(Timing {
        samples: last.samples,
        processed: last.samples_processed,
        best: reports.iter().map(|report| report.engine_time).min().unwrap_or_default().as_secs_f64(),
        median: seconds(|report| report.engine_time),
        whole: seconds(|report| report.frame_time),
    })
}
