//! Computed volumes, the same on every machine: shapes and fields of the literature, and parts that look scanned.

mod ellipsoids;
mod engine_block;
mod grid;
mod marschner_lobb;
mod noise;
mod sphere_flake;
mod spheres;

use crate::file::{Samples, ScalarVolume};
use crate::transfer::Preset;
use grid::Grid;
use std::fmt;
use std::str::FromStr;

/// Samples along each axis unless asked otherwise: what the card renders in one pass.
pub const DEFAULT_SIZE: usize = 256;

/// Most samples along an axis.
pub const MAXIMUM_SIZE: usize = 1024;

/// A computed volume.
#[derive(Clone, Copy, Debug)]
pub struct Phantom {
    name: &'static str,
    description: &'static str,
    source: &'static str,
    preset: Preset,
    samples: fn(&Grid) -> Samples,
}

/// Why a phantom cannot be computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("phantom of {0} x {1} x {2} samples: each must be 1..={MAXIMUM_SIZE}")]
pub struct SizeError(usize, usize, usize);

impl Phantom {
    /// All phantoms; the first is shown where no volume is asked for.
    pub const ALL: [Self; 7] = [
        Self {
            name: "engine-block",
            description: "two-cylinder engine block of aluminium with steel liners, pistons and crankshaft, as a noisy CT",
            source: "our construction, after the engine scans that volume rendering papers show",
            preset: Preset::Industrial,
            samples: engine_block::samples,
        },
        Self {
            name: "ellipsoids",
            description: "head of ten ellipsoids: skull, brain, ventricles, lesions",
            source: "Shepp and Logan 1974, contrast of Toft 1996, third dimension of Schabel 2006",
            preset: Preset::Translucent,
            samples: ellipsoids::samples,
        },
        Self {
            name: "marschner-lobb",
            description: "wave pattern near the limit of what 40 samples per axis can hold",
            source: "Marschner and Lobb, An Evaluation of Reconstruction Filters for Volume Rendering, 1994",
            preset: Preset::Smooth,
            samples: marschner_lobb::samples,
        },
        Self {
            name: "sphere-flake",
            description: "820 spheres on spheres, each densest at its centre",
            source: "Haines, A Proposal for Standard Graphics Environments, 1987",
            preset: Preset::Smooth,
            samples: sphere_flake::samples,
        },
        Self {
            name: "solid",
            description: "the translucent solid: opacity 1/255 everywhere",
            source: "Dachille et al., High-Quality Volume Rendering Using Texture Mapping Hardware, 1998, section 3.1",
            preset: Preset::Opacity,
            samples: spheres::solid,
        },
        Self {
            name: "sphere",
            description: "the translucent sphere: opacity 4/255, as wide as the volume",
            source: "Dachille et al. 1998, section 3.1",
            preset: Preset::Opacity,
            samples: spheres::translucent_sphere,
        },
        Self {
            name: "opaque-sphere",
            description: "the opaque sphere: opacity 255/255, as wide as the volume",
            source: "Dachille et al. 1998, section 3.1",
            preset: Preset::Opacity,
            samples: spheres::opaque_sphere,
        },
    ];

    /// Name on the command line.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// What it shows, in a line.
    #[must_use]
    pub const fn description(&self) -> &'static str {
        self.description
    }

    /// Where it is defined.
    #[must_use]
    pub const fn source(&self) -> &'static str {
        self.source
    }

    /// The transfer function that suits it.
    #[must_use]
    pub const fn preset(&self) -> Preset {
        self.preset
    }

    /// The volume with so many samples along x, y and z. The object fills the volume whatever its size; spacings
    /// differ where sizes do, so that it keeps its shape, and are 1 mm along the longest axis.
    ///
    /// # Errors
    /// A size is zero or beyond [`MAXIMUM_SIZE`].
    pub fn volume(&self, size: [usize; 3]) -> Result<ScalarVolume, SizeError> {
        let grid = Grid::new(size);
        let valid = size.iter().all(|size| (1..=MAXIMUM_SIZE).contains(size));
        let samples = valid.then(|| (self.samples)(&grid));
        let volume = samples.and_then(|samples| ScalarVolume::new(size, samples, grid.geometry()));
        let mut volume = volume.ok_or(SizeError(size[0], size[1], size[2]))?;
        volume.content = Some(format!("phantom {}: {}", self.name, self.description));
        Ok(volume)
    }
}

impl fmt::Display for Phantom {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name)
    }
}

impl FromStr for Phantom {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|phantom| phantom.name == text).ok_or_else(|| {
            format!("'{text}' is no phantom; there are {}", Self::ALL.map(|phantom| phantom.name).join(", "))
        })
    }
}

#[cfg(test)]
mod tests;
