//! `--stats`.

use super::arguments::StatsFormat;
use super::error::Error;
use super::messages::print;
use serde::Serialize;
use std::time::Duration;

/// What is printed about a render.
#[derive(Debug, Serialize)]
pub struct Statistics {
    /// Voxels along x, y and z.
    pub dimensions: [u32; 3],
    /// Columns and rows of the smallest rectangle of rays with samples.
    pub base_plane: [u32; 2],
    /// Existing ray samples.
    pub samples: u64,
    /// Samples that were processed.
    pub samples_processed: u64,
    /// Time in the engine, median over frames.
    pub render_ms: f64,
    /// From submission until pixels were readable, median over frames.
    pub frame_ms: f64,
    /// Time of the warp of the base plane to the picture, median over frames.
    pub warp_ms: f64,
    /// Time to bring the volume into voxel memory.
    pub upload_ms: f64,
    /// Time in the engine of each frame.
    pub render_ms_all: Vec<f64>,
    /// Time of each frame.
    pub frame_ms_all: Vec<f64>,
    /// Time of the warp of each frame.
    pub warp_ms_all: Vec<f64>,
    /// What the engine left out.
    pub left_out: Vec<String>,
    /// Which renderer the card runs.
    pub renderer: String,
    /// Which architecture it is.
    pub architecture: String,
    /// Vector instructions that it uses.
    pub simd: String,
    /// Threads that it uses.
    pub threads: u32,
    /// Clock cycles that the real chip would have taken for a frame.
    pub modelled_cycles: u64,
}

impl Statistics {
    /// Prints the statistics on standard output.
    pub fn print(&self, format: StatsFormat) -> Result<(), Error> {
        let value = serde_json::to_value(self).map_err(Error::failure)?;
        let text = match (format, &value) {
            (StatsFormat::Text, serde_json::Value::Object(fields)) => {
                fields.iter().map(|(name, value)| format!("{name}: {value}\n")).collect()
            }
            _ => format!("{value}\n"),
        };
        print(&text)
    }
}

/// Times in milliseconds, and their median.
pub fn times<T>(frames: &[T], time: impl Fn(&T) -> Duration) -> (f64, Vec<f64>) {
    let all: Vec<f64> = frames.iter().map(|frame| milliseconds(time(frame))).collect();
    let mut sorted = all.clone();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    let median = match (sorted.get(middle.wrapping_sub(1)), sorted.get(middle)) {
        (Some(below), Some(above)) if sorted.len().is_multiple_of(2) => (below + above) / 2.0,
        (_, Some(middle)) => *middle,
        _ => 0.0,
    };
    (median, all)
}

/// A time in milliseconds.
pub fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
