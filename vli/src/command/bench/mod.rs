//! `volumepro bench`: how fast the card in this process renders, beside what the machine could do.
//!
//! [`machine`] measures the machine's limits, [`measure`] frames of a [`scene`] with a [`specimen`]; [`stages`] are differences between
//! frames; [`output`] prints rows and tables.

mod arguments;
mod machine;
mod measure;
mod output;
mod scene;
mod specimen;
mod stages;

pub use arguments::Arguments;

use super::arguments::{Simd, name};
use super::error::Error;
use super::progress::{Busy, Progress};
use crate::Board;
use machine::Machine;
use measure::{BRUTE_FORCE, Setting, Timing, measure};
use output::{Output, Row};
use specimen::Specimen;
use std::collections::BTreeMap;
use std::time::Duration;
use vg500_engine::{Level, Renderer};
use vg500_regs::limit::VOLUME_SIZE;

/// How long the card may take to answer a message.
const ANSWER: Duration = Duration::from_secs(20);
/// Frames that would take less at the rate of the largest volume are small: what they cost beyond that is fixed.
const SMALL: f64 = 0.2e-3;

/// Measures and prints what the arguments ask for.
pub fn run(arguments: &Arguments) -> Result<(), Error> {
    let cards = cards(arguments)?;
    let specimens = specimens(arguments)?;
    let volumes: Vec<usize> = specimens.iter().map(Specimen::bytes).collect();
    let mut output = Output::new(arguments.json, arguments.frames);
    let settings = settings(arguments);
    let measurements =
        if arguments.stages { stages::FRAMES.len() * stages::TURNS as usize } else { settings.len() };
    let mut progress = Steps::new((cards.len() * specimens.len() * measurements) as u64);
    for renderer in cards {
        let Renderer::Optimised { level, threads } = renderer else { continue };
        let machine = {
            let _busy = Busy::new("measuring the machine");
            Machine::measure(level, threads, &volumes)
        };
        progress.pause(|| output.machine(&machine, level, threads))?;
        let config = volumepro_device::Config { renderer, ..Default::default() };
        let mut bench = Bench {
            board: Board::embedded(&config, ANSWER).map_err(Error::failure)?,
            machine,
            level,
            threads,
            frames: arguments.frames,
            full_rates: BTreeMap::new(),
        };
        for specimen in &specimens {
            if arguments.stages {
                let rows = stages::measure(&mut bench, specimen, &mut progress)?;
                progress.pause(|| output.stages(&bench, specimen, &rows))?;
                continue;
            }
            for setting in &settings {
                let row = bench.row(specimen, setting)?;
                progress.step();
                progress.pause(|| output.row(&row))?;
            }
        }
    }
    drop(progress);
    output.finish()
}

/// The renderers that are asked for; what cannot be had is refused before anything is measured.
fn cards(arguments: &Arguments) -> Result<Vec<Renderer>, Error> {
    let mut cards = Vec::new();
    for &simd in &arguments.simd {
        let threads: Vec<_> = match arguments.threads.as_slice() {
            [] => vec![None],
            counts => counts.iter().map(|&count| Some(usize::from(count))).collect(),
        };
        for threads in threads {
            let simd = Some(name(simd)).filter(|_| simd != Simd::Auto);
            let renderer = volumepro_device::config::renderer(None, simd.as_deref(), threads);
            cards.push(renderer.map_err(Error::input)?);
        }
    }
    Ok(cards)
}

/// The volumes that are asked for, large ones first: the rates of small ones are compared with theirs.
fn specimens(arguments: &Arguments) -> Result<Vec<Specimen>, Error> {
    let _busy = Busy::new("computing the volumes");
    let mut sizes = arguments.size.clone();
    sizes.sort_unstable_by(|a, b| b.cmp(a));
    let all = arguments.bits.iter().flat_map(|&bits| sizes.iter().map(move |&size| (size, bits)));
    all.map(|(size, bits)| Specimen::new(size, bits).map_err(Error::failure)).collect()
}

/// What is drawn of each volume.
fn settings(arguments: &Arguments) -> Vec<Setting> {
    let mut settings = Vec::new();
    for &axis in &arguments.axis {
        for &scene in &arguments.scene {
            for &skipping in arguments.skipping.choices() {
                settings.push(Setting { scene, axis, keep: if skipping { 0 } else { BRUTE_FORCE } });
            }
        }
    }
    settings
}

/// A card to be measured, in its machine.
struct Bench {
    board: Board,
    machine: Machine,
    level: Level,
    threads: usize,
    frames: u32,
    /// Samples per second of the largest volume, by scene, axis, skipping and bits.
    full_rates: BTreeMap<(&'static str, &'static str, bool, u32), f64>,
}

impl Bench {
    fn time(&mut self, specimen: &Specimen, setting: &Setting, frames: u32) -> Result<Timing, Error> {
        measure(&mut self.board, specimen, setting, frames)
    }

    /// Measures a scene.
    fn row(&mut self, specimen: &Specimen, setting: &Setting) -> Result<Row, Error> {
        let timing = self.time(specimen, setting, self.frames)?;
        let Setting { scene, axis, keep } = setting;
        let skipping = *keep == 0;
        let rate = timing.samples as f64 / timing.best;
        let key = (scene.name, axis.name, skipping, specimen.bits);
        if specimen.size == VOLUME_SIZE {
            self.full_rates.insert(key, rate);
        }
        let at_full_rate = self.full_rates.get(&key).map(|full| timing.samples as f64 / full);
        let limit = self.machine.limit(timing.samples, specimen.bytes(), scene.is_classified());
        Ok(Row {
            scene: scene.name,
            axis: axis.name,
            size: specimen.size,
            bits: specimen.bits,
            simd: self.level.name(),
            threads: self.threads,
            skipping,
            samples: timing.samples,
            samples_processed: timing.processed,
            msamples_per_s: rate / 1e6,
            median_msamples_per_s: timing.samples as f64 / timing.median / 1e6,
            ms: timing.best * 1e3,
            median_ms: timing.median * 1e3,
            cycles_per_sample: self.machine.cycles_per_sample(timing.best, timing.samples),
            limit: limit.name,
            limit_msamples_per_s: limit.rate / 1e6,
            fraction_of_limit: rate / limit.rate,
            frame_ms: timing.whole * 1e3,
            overhead_ms: (timing.whole - timing.median) * 1e3,
            fixed_us: at_full_rate.filter(|time| *time < SMALL).map(|time| (timing.best - time) * 1e6),
        })
    }
}

/// Progress, measurement by measurement.
struct Steps {
    progress: Progress,
    done: u64,
    total: u64,
}

impl Steps {
    fn new(total: u64) -> Self {
        Self { progress: Progress::new("measuring"), done: 0, total }
    }

    fn step(&mut self) {
        self.done += 1;
        self.progress.update(self.done, self.total);
    }

    /// Does something that prints.
    fn pause<T>(&self, print: impl FnOnce() -> T) -> T {
        self.progress.pause(print)
    }
}
