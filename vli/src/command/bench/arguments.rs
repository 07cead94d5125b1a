//! What `bench` takes.

use super::scene::{Axis, Scene};
use crate::command::arguments::Simd;
use clap::{Args, ValueEnum, value_parser};
use std::str::FromStr;
use vg500_regs::limit::VOLUME_SIZE;

/// The fewest frames: the best of fewer says little.
pub const FRAMES: u32 = 21;

/// What `bench` takes.
#[derive(Debug, Args)]
#[command(after_long_help = EXPLANATION)]
pub struct Arguments {
    #[arg(long, help = "Scenes [default: all]", long_help = scenes(), value_name = "NAME,..", value_delimiter = ',',
        value_parser = Scene::from_str, hide_default_value = true, default_values = Scene::ALL.map(|it| it.name))]
    pub scene: Vec<Scene>,
    /// Directions of view: +x, -x, +y, -y, +z, -z, corner.
    ///
    /// Rays along an axis advance 0.3 and 0.2 voxels aside per slice, those of corner 0.999 both ways: else samples would
    /// lie on voxels, and no interpolation would be measured.
    #[arg(long, value_name = "NAME,..", value_delimiter = ',', value_parser = Axis::from_str, allow_hyphen_values = true,
        default_value = "+z")]
    pub axis: Vec<Axis>,
    /// Voxels along each axis, 1..=256. The fixed cost of small frames is printed if 256 is among them.
    #[arg(long, value_name = "N,..", value_delimiter = ',', default_value = "256", allow_negative_numbers = true,
        value_parser = value_parser!(u32).range(1..=i64::from(VOLUME_SIZE)))]
    pub size: Vec<u32>,
    /// Bits of a voxel, 8 or 12.
    #[arg(long, value_name = "BITS,..", value_delimiter = ',', default_value = "12", value_parser = bits,
        allow_negative_numbers = true)]
    pub bits: Vec<u32>,
    /// Vector instructions that the engine uses.
    #[arg(long, value_name = "LEVEL,..", value_delimiter = ',', default_value = "auto")]
    pub simd: Vec<Simd>,
    /// Threads that the engine uses [default: one for each core].
    #[arg(long, value_name = "N,..", value_delimiter = ',', value_parser = value_parser!(u16).range(1..=256),
        allow_negative_numbers = true)]
    pub threads: Vec<u16>,
    /// Whether blocks of samples that no pixel depends on are left out: off is brute force, every sample of every ray.
    #[arg(long, value_name = "on|off|both", default_value = "both")]
    pub skipping: Skipping,
    /// Frames of each measurement.
    #[arg(long, value_name = "N", default_value_t = FRAMES, allow_negative_numbers = true,
        value_parser = value_parser!(u32).range(i64::from(FRAMES)..=100_000))]
    pub frames: u32,
    /// Measure the stages of the pipeline instead: what frames cost more with a stage than without it.
    #[arg(long, conflicts_with_all = ["scene", "axis", "skipping"])]
    pub stages: bool,
    /// Print a JSON object per line on standard output, the machine's limits on standard error.
    #[arg(long)]
    pub json: bool,
}

/// How figures come about.
const EXPLANATION: &str = "\
Engine times count: from taking a frame from the queue until its pixels are in pixel memory. The best of all frames is \
what the machine can do, the median what it did; what else runs on it shows in the difference. The volume is like a \
scan of a head with noise, in linear voxel memory; every frame converts it anew. Cycles are those of all cores at work, per sample; done is which part of the samples was \
processed.

frame ms is the whole path, a median: from the library's work on a view, over all tables loaded anew and the start \
command, until the pixels have been read back, through the socket. The overhead is that minus the engine's median.

The machine's limits are measured first, with the same number of threads:
  clock            additions that wait for each other, one per cycle
  table look-ups   scalar loads of 8-byte entries from a table of 32 KiB by 16-bit indices
  read bandwidth   exclusive or of all words of a working set, with the instructions of --simd
No scene is faster than its limit by brute force: a sample that is blended by opacity or added takes a look-up of \
colour and opacity; every voxel is read once per frame, which is all that mip and minip cannot do without. The lower \
limit is shown. Lights are bound by arithmetic instead, so that their fraction tells what light costs (--stages \
tells it stage by stage). With skipping a \
rate counts samples left out, too, and may exceed the limit.

The chip of 1999 processed 500 million samples per second in every scene: four pipelines at 125 MHz.

Where 256^3 voxels' rate would take less than 0.2 ms for a frame, fixed us is what the frame took more than that.";

/// Which of what can be left out is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names are the meaning")]
pub enum Skipping {
    On,
    Off,
    Both,
}

impl Skipping {
    /// Whether to skip, in each of the measurements.
    pub const fn choices(self) -> &'static [bool] {
        match self {
            Self::On => &[true],
            Self::Off => &[false],
            Self::Both => &[false, true],
        }
    }
}

fn scenes() -> String {
    let scenes = Scene::ALL.map(|scene| format!("{:17} {}", scene.name, scene.stresses));
    format!("Scenes [default: all]:\n{}", scenes.join("\n"))
}

fn bits(text: &str) -> Result<u32, String> {
    let bits = text.parse().ok().filter(|bits| [8, 12].contains(bits));
    bits.ok_or_else(|| "8 or 12 is wanted".into())
}
