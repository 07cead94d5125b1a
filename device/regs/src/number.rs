//! Number formats. Each one that a register or a pipeline stage uses is a constant of this type, so
//! that bits, fraction, rounding, saturation and source are written in one place.

/// A fixed-point format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NumberFormat {
    /// Name as the manual prints it.
    pub name: &'static str,
    /// Whether the value is two's complement.
    pub signed: bool,
    /// Bits in all, the sign included.
    pub bits: u32,
    /// Bits behind the binary point.
    pub fraction: u32,
    /// How a value comes into the format, what happens at the ends of its range, and the source.
    pub note: &'static str,
}

/// Whole number; out of range is refused.
pub const INTEGER: NumberFormat = NumberFormat {
    name: "integer",
    signed: false,
    bits: 32,
    fraction: 0,
    note: "whole number; out of range is refused",
};

/// Enumeration or set of flags.
pub const CODE: NumberFormat =
    NumberFormat { name: "code", signed: false, bits: 32, fraction: 0, note: "enumeration or flags" };

/// Voxel coordinate in 16 signed bits.
pub const VOXEL: NumberFormat = NumberFormat {
    name: "S15.0",
    signed: true,
    bits: 16,
    fraction: 0,
    note: "voxel coordinate relative to the bound store; our choice: a store is at most 256 voxels, but the \
           bounds of a larger volume may lie outside of it",
};

/// Ray position in the first slice.
pub const RAY_POSITION: NumberFormat = NumberFormat {
    name: "S9.22",
    signed: true,
    bits: 32,
    fraction: 22,
    note: "voxels; 22 fraction bits keep the drift of 2048 steps below 1/16 of a weight step; driver rounds to \
           nearest",
};

/// Ray step per sample slice.
pub const RAY_STEP: NumberFormat = NumberFormat {
    name: "U1.22",
    signed: false,
    bits: 23,
    fraction: 22,
    note: "voxels per sample slice, 0..=1 (the permutation makes the shear non-negative, paper section 2); driver \
           rounds to nearest",
};

/// Bound of cropping, and position of the cursor.
pub const BOUND: NumberFormat = NumberFormat {
    name: "S23.8",
    signed: true,
    bits: 32,
    fraction: 8,
    note: "voxels in object space relative to the store; compared with sample positions of 8 fraction bits",
};

/// Coefficient of the cut plane.
pub const CUT_COEFFICIENT: NumberFormat = NumberFormat {
    name: "S1.14",
    signed: true,
    bits: 16,
    fraction: 14,
    note: "component of the unit normal in object voxel space; times a position it has 22 fraction bits, exactly",
};

/// Distance of a face of the cut plane, low and high word together.
pub const CUT_DISTANCE: NumberFormat = NumberFormat {
    name: "S41.22",
    signed: true,
    bits: 64,
    fraction: 22,
    note: "voxels along the normal, two words; about 37 bits are needed",
};

/// Reciprocal of the cut plane's falloff.
pub const CUT_RECIPROCAL: NumberFormat = NumberFormat {
    name: "U1.16",
    signed: false,
    bits: 17,
    fraction: 16,
    note: "1 / falloff width in voxels, for widths of 0.5 to 65536; 0 is a hard edge",
};

/// Component of the eye vector.
pub const EYE: NumberFormat = NumberFormat {
    name: "S0.15",
    signed: true,
    bits: 16,
    fraction: 15,
    note: "component of the unit vector towards the eye in object axes; 1 saturates to 32767/32768, and -32768 means \
           -32767 (our choice: a sign that is changed stays within 16 bits)",
};

/// Coefficient or colour of 8 bits.
pub const FACTOR: NumberFormat = NumberFormat {
    name: "U0.8",
    signed: false,
    bits: 8,
    fraction: 8,
    note: "0..=255 stands for 0..=1; the pipeline scales it to (v << 7) | (v >> 1), so that 255 is an exact one",
};

/// Voxel and sample value.
pub const VALUE: NumberFormat = NumberFormat {
    name: "U12.0",
    signed: false,
    bits: 12,
    fraction: 0,
    note: "voxels and interpolated samples (paper, section 3.1: all voxel datapaths are 12 bits wide, samples are \
           rounded to 12 bits); cannot overflow, interpolation never leaves the range of its voxels",
};

/// Voxel value inside of interpolation.
pub const GUARDED: NumberFormat = NumberFormat {
    name: "S12.3",
    signed: true,
    bits: 16,
    fraction: 3,
    note: "values and differences between the three interpolations; our choice: three guard bits are the most that \
           leave differences in 16 bits",
};

/// Position of a sample.
pub const POSITION: NumberFormat = NumberFormat {
    name: "S10.8",
    signed: true,
    bits: 19,
    fraction: 8,
    note: "voxels; rounded to nearest from 22 fraction bits for each sample slice, never accumulated",
};

/// Interpolation weight.
pub const WEIGHT: NumberFormat = NumberFormat {
    name: "U0.8",
    signed: false,
    bits: 8,
    fraction: 8,
    note: "fraction of a position; always below 1",
};

/// Gradient component.
pub const GRADIENT: NumberFormat = NumberFormat {
    name: "S7.0",
    signed: true,
    bits: 8,
    fraction: 0,
    note: "-127..=127 (paper, section 3.2); a difference of 4095 over two voxels gives 127; the odd multiplier 1015 \
           leaves no ties, so rounding is symmetric",
};

/// Gradient magnitude.
pub const MAGNITUDE: NumberFormat = NumberFormat {
    name: "U8.0",
    signed: false,
    bits: 8,
    fraction: 0,
    note: "0..=220 (paper, section 3.3), the rounded square root",
};

/// Colour and opacity from classification on.
pub const COLOR: NumberFormat = NumberFormat {
    name: "U0.12",
    signed: false,
    bits: 12,
    fraction: 12,
    note: "0..=4095 stands for 0..=1 (paper, section 3.6: 12 bits for opacity, accumulators and all intermediate \
           compositing values); 8-bit colours are widened by replication",
};

/// A factor widened so that its greatest value is an exact one.
pub const UNITY: NumberFormat = NumberFormat {
    name: "U0.15",
    signed: false,
    bits: 15,
    fraction: 15,
    note: "(v << 7) | (v >> 1) of an 8-bit factor: 255 becomes 32767, which is the identity on 12 bits after \
           rounding; our choice, v << 7 would darken by 1/256",
};

/// Component of a gradient or reflection vector, stretched to the cube of the reflectance maps.
pub const CUBE: NumberFormat = NumberFormat {
    name: "S7.0",
    signed: true,
    bits: 8,
    fraction: 0,
    note: "-112..=112, half away from zero; the longest component is +-112; cells of the maps are 32 wide (our choice; \
           the paper, section 3.5, gives 384 entries on six faces)",
};

/// Product of cube vector and eye vector.
pub const COSINE: NumberFormat = NumberFormat {
    name: "S8.7",
    signed: true,
    bits: 16,
    fraction: 7,
    note: "each of three products rounded half away from zero, then added (our choice); at most 112 sqrt(3)",
};

/// Component of half the reflection vector.
pub const REFLECTION: NumberFormat = NumberFormat {
    name: "S15.0",
    signed: true,
    bits: 16,
    fraction: 0,
    note: "(n . e) n - (n . n / 2) e of the cube vector n, both products rounded half away from zero; its longest \
           component is 3600..=18820 long (our choice; paper, section 3.5: computed from gradient and eye vector)",
};

/// Weight of bilinear interpolation in a reflectance map.
pub const MAP_WEIGHT: NumberFormat = NumberFormat {
    name: "U1.5",
    signed: false,
    bits: 6,
    fraction: 5,
    note: "place in a cell, 0..=32, exact",
};

/// Light from a reflectance map.
pub const INTENSITY: NumberFormat = NumberFormat {
    name: "U0.15",
    signed: false,
    bits: 15,
    fraction: 15,
    note: "rows exact, each row times its weight cut off after 1/128 of an entry, then t + (t >> 8): an entry of 255 \
           becomes 32767, an exact one",
};

/// Emission and diffuse light together.
pub const BODY: NumberFormat = NumberFormat {
    name: "U1.14",
    signed: false,
    bits: 15,
    fraction: 14,
    note: "ke + Id Gd kd, which may reach 2 (paper, section 3.5); only the final colour is clamped",
};

/// Value of the cut plane's equation.
pub const CUT_VALUE: NumberFormat = NumberFormat {
    name: "S41.22",
    signed: true,
    bits: 64,
    fraction: 22,
    note: "Ax + By + Cz, exact for each sample, never incremented",
};

/// What the cut plane leaves of an opacity.
pub const CUT_FACTOR: NumberFormat = NumberFormat {
    name: "U1.8",
    signed: false,
    bits: 9,
    fraction: 8,
    note: "0..=256, linear in the falloff (paper, section 4.3), half goes up",
};

/// Number of samples of a weighted-sum ray.
pub const SAMPLE_COUNT: NumberFormat = NumberFormat {
    name: "U20.0",
    signed: false,
    bits: 20,
    fraction: 0,
    note: "at most 32768; a frame that could exceed it is refused",
};

/// Stored colour and opacity of an RGBA8 base plane.
pub const PIXEL: NumberFormat = NumberFormat {
    name: "U0.8",
    signed: false,
    bits: 8,
    fraction: 8,
    note: "round(255 x / 4095) of 12 bits, exactly: (x 4081 + 32768) >> 16",
};

/// Sum of a weighted-sum ray.
pub const SUM: NumberFormat = NumberFormat {
    name: "U15.12",
    signed: false,
    bits: 27,
    fraction: 12,
    note: "sum of at most 32768 values of 12 bits; an extension for the weighted sum of the course slides",
};

/// Formats of the pipeline, in its order.
pub const FORMATS: [(&str, NumberFormat); 19] = [
    ("voxel, sample, extreme value of a ray", VALUE),
    ("interpolation: voxels, and differences for the z gradient", GUARDED),
    ("sample position", POSITION),
    ("weight", WEIGHT),
    ("gradient component", GRADIENT),
    ("gradient magnitude", MAGNITUDE),
    ("direction on the cube of the maps", CUBE),
    ("direction times eye vector", COSINE),
    ("half the reflection vector", REFLECTION),
    ("weight in a reflectance map", MAP_WEIGHT),
    ("Id, Is", INTENSITY),
    ("factor: ke, kd, ks, entry of the gradient-magnitude table, and their products", UNITY),
    ("emission and diffuse light", BODY),
    ("color, opacity, premultiplied color, accumulators", COLOR),
    ("cut plane's equation", CUT_VALUE),
    ("cut plane's factor", CUT_FACTOR),
    ("weighted sum", SUM),
    ("samples of a weighted sum", SAMPLE_COUNT),
    ("stored RGBA8", PIXEL),
];
