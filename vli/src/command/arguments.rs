//! The command line.

use super::lists::{CropList, CutPlaneList, LightList, Numbers, Size};
use crate::phantom::{DEFAULT_SIZE, Phantom};
use crate::transfer::Preset;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use std::str::FromStr;

/// Renders volumes on an emulated VolumePro 500.
#[derive(Debug, Parser)]
#[command(name = "volumepro", version, about = "Renders volumes on an emulated VolumePro 500")]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a volume, or a phantom, to a PNG picture.
    Render(Box<Render>),
    /// Say what a volume file holds and how it would be shown.
    Info {
        /// Volume file.
        volume: PathBuf,
        #[command(flatten)]
        input: Input,
    },
    /// Write a computed volume to an NRRD file.
    Phantom {
        /// Which one.
        #[arg(value_parser = Phantom::from_str)]
        name: Phantom,
        /// Voxels along each axis.
        #[arg(long = "size", value_name = "N", default_value_t = DEFAULT_SIZE)]
        size: usize,
        /// File to write.
        #[arg(short, long, value_name = "FILE.nrrd")]
        output: PathBuf,
    },
}

/// What `render` takes.
#[derive(Debug, Args)]
pub struct Render {
    /// Volume file; without one a phantom is rendered.
    pub volume: Option<PathBuf>,
    #[arg(long, help = phantom_help(), value_name = "NAME", conflicts_with = "volume", value_parser = Phantom::from_str)]
    pub phantom: Option<Phantom>,
    /// Voxels along each axis of the phantom.
    #[arg(long, value_name = "N", conflicts_with = "volume", default_value_t = DEFAULT_SIZE)]
    pub phantom_size: usize,
    /// PNG file to write.
    #[arg(short, long, value_name = "FILE.png")]
    pub output: PathBuf,
    /// Picture size in pixels.
    #[arg(long, value_name = "WxH", default_value = "512x512")]
    pub size: Size,
    #[command(flatten)]
    pub view: View,
    #[command(flatten)]
    pub look: Look,
    #[command(flatten)]
    pub card: Card,
    #[command(flatten)]
    pub input: Input,
    /// Render the same view N times; times reported are medians.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: u32,
    /// Say on standard error what the frame needed and what was left out; `=time` also measures what it saved.
    #[arg(long, value_name = "time", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    pub explain: Option<String>,
    /// Print statistics on standard output.
    #[arg(long, value_name = "FORMAT")]
    pub stats: Option<StatsFormat>,
}

fn phantom_help() -> String {
    let names = Phantom::ALL.map(|phantom| format!("{}: {}", phantom.name(), phantom.description()));
    format!("Render a computed volume instead of a file: {}", names.join("; "))
}

fn preset_help() -> String {
    let names = Preset::ALL.map(Preset::name).join(", ");
    format!("Built-in transfer function, chosen by the data if absent: {names}")
}

/// Where the picture is taken from. World units are millimetres.
#[derive(Debug, Args)]
pub struct View {
    /// Turn the camera around the volume, degrees.
    #[arg(long, value_name = "DEG", conflicts_with_all = ["position", "focal"], allow_hyphen_values = true)]
    pub azimuth: Option<f64>,
    /// Raise the camera over the volume, degrees.
    #[arg(long, value_name = "DEG", conflicts_with_all = ["position", "focal"], allow_hyphen_values = true)]
    pub elevation: Option<f64>,
    /// Where the camera is.
    #[arg(long, value_name = "X,Y,Z", requires = "focal", allow_hyphen_values = true)]
    pub position: Option<Numbers<3>>,
    /// What the camera looks at.
    #[arg(long, value_name = "X,Y,Z", requires = "position", allow_hyphen_values = true)]
    pub focal: Option<Numbers<3>>,
    /// Which direction is up in the picture.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub up: Option<Numbers<3>>,
    /// Half the height of the picture in millimetres.
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    pub parallel_scale: Option<f64>,
}

/// How the volume looks.
#[derive(Debug, Args)]
pub struct Look {
    #[arg(long, help = preset_help(), value_name = "NAME", conflicts_with = "transfer")]
    pub preset: Option<String>,
    /// CSV file with header value,red,green,blue,opacity: value in the data's units, the rest 0..1, opacity per
    /// smallest voxel spacing.
    #[arg(long, value_name = "FILE")]
    pub transfer: Option<PathBuf>,
    /// How samples along a ray become a pixel.
    #[arg(long, value_name = "MODE", default_value = "alpha")]
    pub blend: Blend,
    /// Illumination; on by default for alpha blending, else off.
    #[arg(long, value_name = "on|off")]
    pub shading: Option<Switch>,
    /// A light: direction of travel in camera space, and intensity 0..1. May be repeated.
    #[arg(long, value_name = "X,Y,Z[,I]", allow_hyphen_values = true)]
    pub light: Vec<LightList>,
    /// Emissive, diffuse and specular coefficients 0..1 and specular exponent.
    #[arg(
        long,
        allow_hyphen_values = true,
        value_name = "KE,KD,KS,EXPONENT",
        default_value = "0.2,0.9,0.3,24"
    )]
    pub material: Numbers<4>,
    /// What the gradient magnitude modulates.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub modulate: Vec<Modulated>,
    /// Eight values 0..1 of the modulation at gradient magnitudes from none to the greatest.
    #[arg(long, allow_hyphen_values = true, value_name = "V0,...,V7")]
    pub gradient_table: Option<Numbers<8>>,
    /// Sub-samples per voxel along permuted x, y and z (z along the view), integers 1..8.
    #[arg(long, allow_hyphen_values = true, value_name = "X,Y,Z", default_value = "1,1,1")]
    pub supersample: Numbers<3>,
    /// Cropping slabs in voxels, bounds inclusive; FLAGS are those of VLICrop (default 0x7).
    #[arg(long, value_name = "X0,X1,Y0,Y1,Z0,Z1[,FLAGS]", allow_hyphen_values = true)]
    pub crop: Option<CropList>,
    /// Cut plane in world space: visible where -THICKNESS <= Ax+By+Cz+D <= 0; falloff in voxels.
    #[arg(long, value_name = "A,B,C,D,THICKNESS,FALLOFF[,outside]", allow_hyphen_values = true)]
    pub cut_plane: Option<CutPlaneList>,
    /// Cursor at a voxel position.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub cursor: Option<Numbers<3>>,
    /// Colour behind the volume, 0..255 each, or `transparent`.
    #[arg(long, allow_hyphen_values = true, value_name = "R,G,B|transparent", default_value = "0,0,0")]
    pub background: super::lists::BackgroundList,
}

/// Which card renders.
#[derive(Debug, Args)]
pub struct Card {
    /// embedded, socket:PATH or pci:ADDRESS.
    #[arg(long, value_name = "DEVICE", default_value = "embedded")]
    pub device: String,
    /// Which renderer the card runs; `ideal` bypasses the card.
    #[arg(long, value_name = "NAME")]
    pub renderer: Option<RendererName>,
    /// Which architecture the card is.
    #[arg(long, value_name = "NAME")]
    pub architecture: Option<Architecture>,
    /// Vector instructions that the card's engine uses.
    #[arg(long, value_name = "LEVEL")]
    pub simd: Option<Simd>,
    /// Threads that the card's engine uses.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Render section by section, 32 voxels wide.
    #[arg(long)]
    pub sections: bool,
}

/// How samples of a file are read.
#[derive(Debug, Args)]
pub struct Input {
    /// Values that become the ends of the card's range, or of grey where values are kept.
    #[arg(long, value_name = "LO,HI", allow_hyphen_values = true)]
    pub range: Option<Numbers<2>>,
    /// Value that replaces samples that are no number or infinite.
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true)]
    pub nan: Option<f64>,
    /// Read a file without header: voxels along x, y, z.
    #[arg(long, allow_hyphen_values = true, value_name = "X,Y,Z", requires = "raw_type")]
    pub raw_shape: Option<Numbers<3>>,
    /// Scalar type of a file without header, as NRRD names it.
    #[arg(long, value_name = "T", requires = "raw_shape")]
    pub raw_type: Option<String>,
    /// Byte order of a file without header.
    #[arg(long, value_name = "E", requires = "raw_shape", default_value = "little")]
    pub raw_endian: Endian,
    /// Voxel spacing of a file without header, millimetres.
    #[arg(
        long,
        allow_hyphen_values = true,
        value_name = "X,Y,Z",
        requires = "raw_shape",
        default_value = "1,1,1"
    )]
    pub raw_spacing: Numbers<3>,
}

/// Blend modes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names are the meaning")]
pub enum Blend {
    Alpha,
    Mip,
    Minip,
    Sum,
}

/// On or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names are the meaning")]
pub enum Switch {
    On,
    Off,
}

/// What the gradient magnitude can modulate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names are the meaning")]
pub enum Modulated {
    Opacity,
    Diffuse,
    Specular,
}

/// Renderers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names are the meaning")]
pub enum RendererName {
    Ideal,
    Reference,
    Optimised,
}

/// Architectures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names are the meaning")]
pub enum Architecture {
    Vg500,
}

/// SIMD levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names are the meaning")]
pub enum Simd {
    Auto,
    Avx512,
    Avx2,
    Portable,
}

/// Byte orders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names are the meaning")]
pub enum Endian {
    Little,
    Big,
}

/// Formats of statistics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names are the meaning")]
pub enum StatsFormat {
    Json,
    Text,
}
