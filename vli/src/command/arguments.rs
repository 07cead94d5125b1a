//! The command line.

use super::lists::{
    BackgroundList, CropList, CutPlaneList, Device, LightList, Numbers, Omissions, Size, number,
};
use crate::file::ScalarType;
use crate::phantom::{DEFAULT_SIZE, MAXIMUM_SIZE, Phantom};
use crate::transfer::Preset;
use clap::{Args, Parser, Subcommand, ValueEnum, value_parser};
use std::ffi::OsString;
use std::path::PathBuf;
use std::str::FromStr;

/// Renders volumes on an emulated VolumePro 500.
#[derive(Debug, Parser)]
#[command(name = "volumepro", version, arg_required_else_help = false)]
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
        #[arg(long = "size", value_name = "N", default_value_t = DEFAULT_SIZE, value_parser = phantom_size,
            allow_negative_numbers = true)]
        size: usize,
        /// File to write.
        #[arg(short, long, value_name = "FILE.nrrd")]
        output: PathBuf,
    },
    /// Measure frame rates of the card in this process, beside the machine's own limits.
    #[cfg(feature = "embedded")]
    Bench(Box<super::bench::Arguments>),
    /// Measure frame rates of the card in this process, which this program was built without.
    #[cfg(not(feature = "embedded"))]
    Bench(NotServed),
    /// Measure error against run time over settings (not served yet).
    Report(NotServed),
    /// Install library and header for C++ programs (not served yet).
    Sdk(NotServed),
}

/// What a command takes that is not served yet.
#[derive(Debug, Args)]
pub struct NotServed {
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    _rest: Vec<OsString>,
}

fn phantom_size(text: &str) -> Result<usize, String> {
    let size = text.parse().ok().filter(|size| (1..=MAXIMUM_SIZE).contains(size));
    size.ok_or_else(|| format!("a whole number 1..={MAXIMUM_SIZE} is wanted"))
}

/// What `render` takes.
#[derive(Debug, Args)]
pub struct Render {
    /// Volume file; without one a phantom is rendered.
    pub volume: Option<PathBuf>,
    #[arg(long, help = phantom_help(), value_name = "NAME", conflicts_with = "volume", value_parser = Phantom::from_str)]
    pub phantom: Option<Phantom>,
    /// Voxels along each axis of the phantom.
    #[arg(long, value_name = "N", conflicts_with = "volume", default_value_t = DEFAULT_SIZE,
        value_parser = phantom_size, allow_negative_numbers = true)]
    pub phantom_size: usize,
    /// PNG file to write.
    #[arg(short, long, value_name = "FILE.png")]
    pub output: PathBuf,
    /// Picture size in pixels.
    #[arg(long, value_name = "WxH", default_value = "512x512", allow_hyphen_values = true)]
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
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = value_parser!(u32).range(1..=100_000),
        allow_negative_numbers = true)]
    pub frames: u32,
    /// Say on standard error what the frame needed and what was left out; `=time` also measures what that saved.
    #[arg(long, value_name = "WHAT", num_args = 0..=1, require_equals = true)]
    pub explain: Option<Option<Explained>>,
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
    #[arg(long, value_name = "DEG", value_parser = number, conflicts_with_all = ["position", "focal"],
        allow_hyphen_values = true)]
    pub azimuth: Option<f64>,
    /// Raise the camera over the volume, degrees.
    #[arg(long, value_name = "DEG", value_parser = number, conflicts_with_all = ["position", "focal"],
        allow_hyphen_values = true)]
    pub elevation: Option<f64>,
    /// Where the camera is.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub position: Option<Numbers<3>>,
    /// What the camera looks at.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub focal: Option<Numbers<3>>,
    /// Which direction is up in the picture.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub up: Option<Numbers<3>>,
    /// Half the height of the picture in millimetres.
    #[arg(long, value_name = "S", value_parser = number, allow_hyphen_values = true)]
    pub parallel_scale: Option<f64>,
}

/// How the volume looks.
#[derive(Debug, Args)]
pub struct Look {
    #[arg(long, help = preset_help(), value_name = "NAME", conflicts_with = "transfer",
        value_parser = Preset::from_str)]
    pub preset: Option<Preset>,
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
    /// Emissive, diffuse and specular coefficients 0..1 and specular exponent [default: 0.2,0.9,0.3,24].
    #[arg(long, value_name = "KE,KD,KS,EXPONENT", allow_hyphen_values = true)]
    pub material: Option<Numbers<4>>,
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
    pub background: BackgroundList,
}

/// Which card renders.
#[derive(Debug, Args)]
pub struct Card {
    /// embedded, socket:PATH or pci:ADDRESS.
    #[arg(long, value_name = "DEVICE", default_value = "embedded")]
    pub device: Device,
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
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..), allow_negative_numbers = true)]
    pub threads: Option<u16>,
    /// Render section by section, 32 voxels wide, through section memory; the picture is the same.
    #[arg(long)]
    pub sections: bool,
    /// What the engine is not to leave out: names as `--stats` lists them under left_out, or `all`; the picture is
    /// the same.
    #[arg(long, value_name = "NAME,..", default_value = "")]
    pub keep: Omissions,
}

/// How samples of a file are read.
#[derive(Debug, Args)]
pub struct Input {
    /// Values that become the ends of the card's range, or of grey where values are kept.
    #[arg(long, value_name = "LO,HI", allow_hyphen_values = true)]
    pub range: Option<Numbers<2>>,
    /// Number that replaces samples that are no number or infinite.
    #[arg(long, value_name = "VALUE", value_parser = number, allow_hyphen_values = true)]
    pub nan: Option<f64>,
    /// Read a file without header: voxels along x, y, z.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub raw_shape: Option<Numbers<3>>,
    /// Scalar type of a file without header, as NRRD names it.
    #[arg(long, value_name = "T", value_parser = ScalarType::from_str)]
    pub raw_type: Option<ScalarType>,
    /// Byte order of a file without header [default: little].
    #[arg(long, value_name = "E")]
    pub raw_endian: Option<Endian>,
    /// Voxel spacing of a file without header, millimetres [default: 1,1,1].
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub raw_spacing: Option<Numbers<3>>,
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
pub enum RendererName {
    /// 64-bit floating point, no card.
    Ideal,
    /// The card's arithmetic, stage by stage.
    Reference,
    /// The same pictures, sooner: what cards run unless told otherwise.
    Optimised,
}

/// Architectures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Architecture {
    /// The VolumePro 500's chip.
    Vg500,
    /// Cube-4 (not served yet).
    Cube4,
    /// Adaptive sampling along rays (not served yet).
    Adaptive,
    /// Texture-mapping hardware (not served yet).
    Texture,
}

/// SIMD levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Simd {
    /// The card's choice.
    Auto,
    /// AVX-512, where the processor has it.
    Avx512,
    /// AVX2, where the processor has it.
    Avx2,
    /// None beyond what every processor has.
    Portable,
}

/// What `--explain` also measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Explained {
    /// Time that was saved.
    Time,
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

/// The name of a value on the command line.
pub fn name(value: impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}
