//! Which instructions the kernels use.

use super::{Portable, Simd, Work};
use core::fmt::{Display, Formatter};

/// A level of vector instructions that the processor has.
#[derive(Clone, Copy, Debug)]
pub enum Level {
    /// Portable Rust.
    Portable(Portable),
    /// AVX2: 64 lanes.
    #[cfg(target_arch = "x86_64")]
    Avx2(super::avx2::Avx2),
    /// AVX-512 with byte and word instructions and permutations of bytes: 64 lanes.
    #[cfg(target_arch = "x86_64")]
    Avx512(super::avx512::Avx512),
}

/// A level that cannot be had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LevelError {
    /// There is no such level.
    Unknown,
    /// The processor does not have its instructions.
    Missing,
}

impl Display for LevelError {
    fn fmt(&self, f: &mut Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Unknown => "one of auto, avx512, avx2, portable",
            Self::Missing => "this processor does not have it",
        })
    }
}

impl core::error::Error for LevelError {}

impl Level {
    /// The best level of the processor.
    #[must_use]
    pub fn detect() -> Self {
        Self::all().next().unwrap_or(Self::Portable(Portable))
    }

    /// The levels of the processor, the best one first.
    pub fn all() -> impl Iterator<Item = Self> {
        #[cfg(target_arch = "x86_64")]
        let vectors =
            [super::avx512::Avx512::detect().map(Self::Avx512), super::avx2::Avx2::detect().map(Self::Avx2)];
        #[cfg(not(target_arch = "x86_64"))]
        let vectors = [None, None];
        vectors.into_iter().flatten().chain([Self::Portable(Portable)])
    }

    /// The level of a name: `auto` is the best one.
    pub fn named(name: &str) -> Result<Self, LevelError> {
        if name == "auto" {
            return Ok(Self::detect());
        }
        if !["avx512", "avx2", "portable"].contains(&name) {
            return Err(LevelError::Unknown);
        }
        Self::all().find(|level| level.name() == name).ok_or(LevelError::Missing)
    }

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Portable(_) => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => "avx512",
        }
    }

    /// The code of the register `SIMD_LEVEL`.
    #[must_use]
    pub const fn code(self) -> u32 {
        match self {
            Self::Portable(_) => 0,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => 1,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => 2,
        }
    }

    /// Runs work with the level's instructions.
    pub fn run<W: Work>(self, work: W) -> W::Output {
        match self {
            Self::Portable(simd) => simd.run(work),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(simd) => simd.run(work),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(simd) => simd.run(work),
        }
    }
}

impl PartialEq for Level {
    fn eq(&self, other: &Self) -> bool {
        self.code() == other.code()
    }
}

impl Eq for Level {}
