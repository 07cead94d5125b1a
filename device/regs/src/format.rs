//! Codes of voxel formats, base-plane formats, pixel formats and blend modes.

/// How voxels are stored. The codes are those of the VLI.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum VoxelFormat {
    /// 8 bits; value v is 12-bit value v << 4.
    Uint8 = 1,
    /// 16-bit little-endian container, value in the low 12 bits; the upper four are ignored.
    Uint12Lower = 2,
    /// 16-bit little-endian container, value in the high 12 bits; the lower four are ignored.
    Uint12Upper = 3,
}

impl VoxelFormat {
    /// The format of a register code.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            1 => Some(Self::Uint8),
            2 => Some(Self::Uint12Lower),
            3 => Some(Self::Uint12Upper),
            _ => None,
        }
    }

    /// Bytes per voxel in voxel memory.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Uint8 => 1,
            Self::Uint12Lower | Self::Uint12Upper => 2,
        }
    }

    /// The 12-bit value of a stored voxel.
    #[must_use]
    pub const fn value(self, stored: u16) -> u16 {
        match self {
            Self::Uint8 => (stored & 0xff) << 4,
            Self::Uint12Lower => stored & 0xfff,
            Self::Uint12Upper => stored >> 4,
        }
    }
}

/// What a ray accumulates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum BlendMode {
    /// Front-to-back alpha blending.
    Alpha = 0,
    /// Colour of the sample of maximum value.
    Maximum = 1,
    /// Colour of the sample of minimum value.
    Minimum = 2,
    /// Weighted sum over the visible samples, divided by their number (course slides; an extension).
    Sum = 3,
}

impl BlendMode {
    /// The mode of a register code.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            0 => Some(Self::Alpha),
            1 => Some(Self::Maximum),
            2 => Some(Self::Minimum),
            3 => Some(Self::Sum),
            _ => None,
        }
    }
}

/// Bits of each accumulator in [`PlaneFormat::Accumulator64`].
pub const ACCUMULATOR_BITS: u32 = 12;
/// Bits of each sum in [`PlaneFormat::Sum128`].
pub const SUM_BITS: u32 = 27;

/// How a base plane is stored in pixel memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum PlaneFormat {
    /// Bytes R, G, B, A.
    Rgba8 = 0,
    /// One ray's accumulators in 64 bits: R 11..0, G 23..12, B 35..24, A 47..36, the extreme sample value
    /// 59..48, and bit 60 set once a ray of MIP or MinIP has met a visible sample.
    Accumulator64 = 1,
    /// One ray's sums in 128 bits: R 26..0, G 53..27, B 80..54, A 107..81, number of samples 127..108.
    Sum128 = 2,
}

impl PlaneFormat {
    /// The format of a register code.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            0 => Some(Self::Rgba8),
            1 => Some(Self::Accumulator64),
            2 => Some(Self::Sum128),
            _ => None,
        }
    }

    /// Bytes per ray.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Rgba8 => 4,
            Self::Accumulator64 => 8,
            Self::Sum128 => 16,
        }
    }
}

/// Pixel formats of transfers. The codes are those of the VLI; 16- and 32-bit formats of the paper (section 6)
/// and the 64-bit ones of 12 bits per channel, each of which stands in the low bits of a 16-bit word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
#[allow(missing_docs, reason = "the names are the order of channels from the lowest address or bit on")]
pub enum PixelFormat {
    Rgba8 = 0,
    Bgra8 = 1,
    Argb8 = 2,
    Abgr8 = 3,
    Rgba4 = 4,
    Bgra4 = 5,
    Argb4 = 6,
    Abgr4 = 7,
    Rgba12 = 8,
    Bgra12 = 9,
    Argb12 = 10,
    Abgr12 = 11,
}

impl PixelFormat {
    const ALL: [Self; 12] = [
        Self::Rgba8,
        Self::Bgra8,
        Self::Argb8,
        Self::Abgr8,
        Self::Rgba4,
        Self::Bgra4,
        Self::Argb4,
        Self::Abgr4,
        Self::Rgba12,
        Self::Bgra12,
        Self::Argb12,
        Self::Abgr12,
    ];

    /// The format of a register code.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.get(usize::try_from(code).ok()?).copied()
    }

    /// Bytes per pixel.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Rgba8 | Self::Bgra8 | Self::Argb8 | Self::Abgr8 => 4,
            Self::Rgba4 | Self::Bgra4 | Self::Argb4 | Self::Abgr4 => 2,
            Self::Rgba12 | Self::Bgra12 | Self::Argb12 | Self::Abgr12 => 8,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_come_back_and_unknown_ones_are_refused() {
        for code in 0..20 {
            assert_eq!(
                VoxelFormat::from_code(code).map(|it| it as u32),
                (1..4).contains(&code).then_some(code)
            );
            assert_eq!(BlendMode::from_code(code).map(|it| it as u32), (code < 4).then_some(code));
            assert_eq!(PlaneFormat::from_code(code).map(|it| it as u32), (code < 3).then_some(code));
            assert_eq!(PixelFormat::from_code(code).map(|it| it as u32), (code < 12).then_some(code));
        }
    }

    #[test]
    fn stored_voxels_become_twelve_bits() {
        assert_eq!(VoxelFormat::Uint8.value(0xff), 0xff0);
        assert_eq!(VoxelFormat::Uint12Lower.value(0xfabc), 0xabc);
        assert_eq!(VoxelFormat::Uint12Upper.value(0xabcf), 0xabc);
    }
}
