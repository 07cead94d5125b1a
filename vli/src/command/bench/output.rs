//! What is printed: rows of JSON, or tables.

use super::Bench;
use super::machine::{Machine, WorkingSet};
use super::specimen::Specimen;
use super::stages::StageRow;
use crate::command::error::Error;
use crate::command::messages::{print, say};
use serde::Serialize;
use vg500_engine::Level;

/// What is printed about a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The scene.
    pub scene: &'static str,
    /// The direction of view.
    pub axis: &'static str,
    /// Voxels along each axis.
    pub size: u32,
    /// Bits of a voxel.
    pub bits: u32,
    /// Vector instructions.
    pub simd: &'static str,
    /// Threads.
    pub threads: usize,
    /// Whether blocks of samples that no pixel depends on were left out.
    pub skipping: bool,
    /// Samples of a frame.
    pub samples: u64,
    /// Samples that were not left out.
    pub samples_processed: u64,
    /// Of the best frame.
    pub msamples_per_s: f64,
    /// Of the frame in the middle.
    pub median_msamples_per_s: f64,
    /// Engine time of the best frame.
    pub ms: f64,
    /// Engine time of the frame in the middle.
    pub median_ms: f64,
    /// Of all cores together, in the best frame.
    pub cycles_per_sample: f64,
    /// What limits the scene on this machine.
    pub limit: &'static str,
    /// How far.
    pub limit_msamples_per_s: f64,
    /// How near the best frame came.
    pub fraction_of_limit: f64,
    /// Median from submission until pixels were readable.
    pub frame_ms: f64,
    /// What of it is not the engine's median.
    pub overhead_ms: f64,
    /// What a small frame took more than at the rate of the largest volume.
    pub fixed_us: Option<f64>,
}

/// Prints what was measured, as soon as it was.
#[derive(Debug)]
pub struct Output {
    json: bool,
    frames: u32,
    heading: String,
    /// Parts by which medians are slower than the best, and of which rows.
    noise: Vec<(f64, String)>,
}

impl Output {
    /// Nothing was printed yet.
    pub const fn new(json: bool, frames: u32) -> Self {
        Self { json, frames, heading: String::new(), noise: Vec::new() }
    }

    /// Prints the limits of a machine: on standard error where standard output is for objects.
    pub fn machine(&self, machine: &Machine, level: Level, threads: usize) -> Result<(), Error> {
        let mut lines = vec![
            format!("limits of this machine, {}, {}:", count(threads, "thread"), level.name()),
            format!("  {:17}{:8.2} GHz", "clock", machine.clock / 1e9),
            format!("  {:17}{:8.0} M/s   8-byte entries, 32 KiB", "table look-ups", machine.look_ups / 1e6),
        ];
        for (set, rate) in &machine.bandwidth {
            lines.push(format!("  {:17}{:8.1} GB/s  {}", "read bandwidth", rate / 1e9, working_set(*set)));
        }
        if self.json {
            lines.iter().for_each(say);
            return Ok(());
        }
        print(&format!("{}\n", lines.join("\n")))
    }

    /// Prints a row.
    pub fn row(&mut self, row: &Row) -> Result<(), Error> {
        let name = format!("{}, {}", row.scene, row.axis);
        self.noise.push((row.median_ms / row.ms - 1.0, name));
        if self.json {
            return object(row);
        }
        let threads = count(row.threads, "thread");
        let heading = format!("{}^3 voxels of {} bits, {}, {threads}", row.size, row.bits, row.simd);
        if heading != self.heading {
            print(&format!("\n{heading}; {} frames\n{COLUMNS}\n", self.frames))?;
            self.heading = heading;
        }
        print(&format!("{}\n", line(row).trim_end()))
    }

    /// Prints what stages cost.
    pub fn stages(&self, bench: &Bench, specimen: &Specimen, rows: &[StageRow]) -> Result<(), Error> {
        if self.json {
            return rows.iter().try_for_each(object);
        }
        let (size, bits, frames) = (specimen.size, specimen.bits, self.frames);
        let (level, threads) = (bench.level.name(), count(bench.threads, "thread"));
        let mut lines = vec![
            format!("\n{size}^3 voxels of {bits} bits, {level}, {threads}; best of {frames} frames each"),
            format!("{:47}{:>10}{:>15}  {}", "stage", "ns/sample", "cycles/sample", "frames compared"),
        ];
        for StageRow { stage, difference, ns_per_sample, cycles_per_sample, .. } in rows {
            lines.push(format!("{stage:47}{ns_per_sample:10.3}{cycles_per_sample:15.2}  {difference}"));
        }
        lines.push(
            "stages overlap in the processor: their costs need not add up; small ones are noise".into(),
        );
        print(&format!("{}\n", lines.join("\n")))
    }

    /// Says how noisy the measurements were.
    pub fn finish(&self) -> Result<(), Error> {
        let worst = self.noise.iter().max_by(|(a, _), (b, _)| a.total_cmp(b));
        let Some((worst, name)) = worst else { return Ok(()) };
        let mean = self.noise.iter().map(|(part, _)| part).sum::<f64>() / self.noise.len() as f64;
        let line = format!(
            "noise: the median frame took {:.0} % longer than the best on average, {:.0} % at worst ({name})",
            100.0 * mean,
            100.0 * worst,
        );
        if self.json {
            say(line);
            return Ok(());
        }
        print(&format!("\n{line}\n"))
    }
}

/// What stands over rows.
const COLUMNS: &str = "scene            axis   skipping  M/s best   median        ms  cycles   done  \
                       limit                   frame ms overhead  fixed us";

/// A row of the table.
fn line(row: &Row) -> String {
    let limit = format!("{:3.0} % of {}", 100.0 * row.fraction_of_limit, row.limit);
    format!(
        "{:17}{:7}{:8}{:10.0}{:9.0}{:10.3}{:8.2}{:5.0} %  {limit:22}{:10.3}{:9.3}{:>10}",
        row.scene,
        row.axis,
        if row.skipping { "on" } else { "off" },
        row.msamples_per_s,
        row.median_msamples_per_s,
        row.ms,
        row.cycles_per_sample,
        100.0 * row.samples_processed as f64 / row.samples as f64,
        row.frame_ms,
        row.overhead_ms,
        row.fixed_us.map_or_else(String::new, |fixed| format!("{fixed:.0}")),
    )
}

/// Prints an object in a line.
fn object(row: &impl Serialize) -> Result<(), Error> {
    print(&format!("{}\n", serde_json::to_string(row).map_err(Error::failure)?))
}

fn count(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

fn working_set(set: WorkingSet) -> String {
    let (bytes, whose) = match set {
        WorkingSet::Each(bytes) => (bytes, "for each thread"),
        WorkingSet::All(bytes) => (bytes, "in all"),
    };
    let size = match bytes {
        0..1024 => format!("{bytes} B"),
        1024..1_048_576 => format!("{} KiB", bytes >> 10),
        _ => format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20)),
    };
    format!("{size} {whose}")
}
