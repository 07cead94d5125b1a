//! Results, for people and for programs.

use super::machine::Machine;
use crate::command::error::Error;
use crate::command::messages::print;
use serde::Serialize;

/// A frame that would take less than this at the rate of large ones shows its fixed cost.
const SMALL_MS: f64 = 0.2;

/// A line of the results.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Scene.
    pub scene: String,
    /// View.
    pub axis: String,
    /// Voxels along each axis.
    pub size: u32,
    /// Bits of a voxel.
    pub bits: u8,
    /// Vector instructions.
    pub simd: String,
    /// Threads.
    pub threads: u32,
    /// Whether samples are left out because of the data.
    pub skipping: bool,
    /// Samples on rays.
    pub samples: u64,
    /// Samples that were processed.
    pub samples_processed: u64,
    /// Million samples on rays per second of engine time: the best frame.
    pub msamples_per_s: f64,
    /// The median frame.
    pub median_msamples_per_s: f64,
    /// Engine time of the best frame.
    pub ms: f64,
    /// Engine time of the median frame.
    pub median_ms: f64,
    /// From the submission until the pixels are readable, through the socket: median.
    pub frame_ms: f64,
    /// What that takes beside the engine: median.
    pub overhead_ms: f64,
    /// Clocks of all threads for a sample, in the best frame.
    pub cycles_per_sample: f64,
    /// Which of the machine's limits applies.
    pub limit: &'static str,
    /// That limit in million samples per second.
    pub limit_msamples_per_s: f64,
    /// Rate over limit.
    pub fraction_of_limit: f64,
}

/// Prints what the machine can do.
pub fn machine(machine: &Machine, json: bool) -> Result<(), Error> {
    if json {
        return Ok(());
    }
    let bandwidth: Vec<_> = machine
        .bandwidth
        .iter()
        .map(|(bytes, rate)| format!("{:.0} GB/s of {} KiB", rate / 1e9, bytes >> 10))
        .collect();
    print(&format!(
        "machine, {} threads: {:.2} GHz; reads {}; {:.0} million look-ups per second\n{HEAD}",
        machine.threads,
        machine.clock / 1e9,
        bandwidth.join(", "),
        machine.look_ups / 1e6,
    ))
}

const HEAD: &str = "scene            axis   size bits simd     threads skip  M samples/s (median)    ms  clocks/sample  \
                    of limit              frame ms  overhead ms\n";

/// Prints a row; earlier ones tell the rate of large frames.
pub fn row(row: &Row, earlier: &[Row], json: bool) -> Result<(), Error> {
    if json {
        let line = serde_json::to_string(row).map_err(Error::failure)?;
        return print(&format!("{line}\n"));
    }
    print(&format!(
        "{:<16} {:<6} {:>4} {:>4} {:<8} {:>7} {:<4} {:>12.0} {:>8} {:>7.2} {:>12.2}    {:>3.0} % {:<16} {:>8.2} {:>10.3}{}\n",
        row.scene,
        row.axis,
        row.size,
        row.bits,
        row.simd,
        row.threads,
        if row.skipping { "on" } else { "off" },
        row.msamples_per_s,
        format!("({:.0})", row.median_msamples_per_s),
        row.ms,
        row.cycles_per_sample,
        100.0 * row.fraction_of_limit,
        row.limit,
        row.frame_ms,
        row.overhead_ms,
        fixed_cost(row, earlier).map_or_else(String::new, |cost| format!("  fixed cost {cost:.0} us")),
    ))
}

/// What a small frame takes beyond its share of a large one, in microseconds.
fn fixed_cost(row: &Row, earlier: &[Row]) -> Option<f64> {
    let same = |other: &&Row| {
        [&other.scene, &other.axis, &other.simd] == [&row.scene, &row.axis, &row.simd]
            && (other.bits, other.threads, other.skipping) == (row.bits, row.threads, row.skipping)
    };
    let large = earlier.iter().filter(same).max_by_key(|other| other.size)?;
    let at_its_rate = row.samples as f64 / 1e3 / large.msamples_per_s;
    (large.size > row.size && at_its_rate < SMALL_MS).then_some((row.ms - at_its_rate) * 1e3)
}

/// Prints what stages cost, as differences of scenes without skipping that were measured.
pub fn stages(rows: &[Row]) -> Result<(), Error> {
    const STAGES: [(&str, &str, Option<&str>); 6] = [
        ("reading and interpolation", "mip", None),
        ("classification and blending", "none", Some("mip")),
        ("gradients and diffuse light", "diffuse", Some("none")),
        ("specular light", "full-unmodulated", Some("diffuse")),
        ("gradient magnitude and modulation", "full", Some("full-unmodulated")),
        ("adding up instead of blending", "sum", Some("none")),
    ];
    let mut text = String::new();
    let brute: Vec<_> = rows.iter().filter(|row| !row.skipping).collect();
    let Some(first) = brute.first() else { return Ok(()) };
    let of = |scene: &str| {
        let same = |row: &&&Row| {
            row.scene == scene
                && [&row.axis, &row.simd] == [&first.axis, &first.simd]
                && (row.size, row.bits, row.threads) == (first.size, first.bits, first.threads)
        };
        brute.iter().find(same).map(|row| row.cycles_per_sample)
    };
    for (stage, with, without) in STAGES {
        let difference = match without {
            Some(without) => of(with).zip(of(without)).map(|(with, without)| with - without),
            None => of(with),
        };
        if let Some(clocks) = difference {
            text += &format!("{stage:<36} {clocks:>6.2} clocks/sample\n");
        }
    }
    if text.is_empty() { Ok(()) } else { print(&format!("stages, as differences of scenes above:\n{text}")) }
}

/// The middle of some numbers.
pub fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}
