//! Transfer functions by rule: they adapt to the values of the volume.

mod adaptive;
mod classes;
mod hounsfield;
#[cfg(test)]
mod tests;

use super::{ControlPoint, TransferFunction};
use crate::values::{Histogram, ValueMapping};
use classes::Classes;
use hounsfield::Scale;
use std::fmt;
use std::str::FromStr;

/// A rule that makes transfer functions for volumes of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "each describes itself")]
pub enum Preset {
    CtBone,
    CtSoftTissue,
    CtLung,
    MrHead,
    Industrial,
    Translucent,
    Smooth,
    Grey,
    Opacity,
}

impl Preset {
    /// All presets.
    pub const ALL: [Self; 9] = [
        Self::CtBone,
        Self::CtSoftTissue,
        Self::CtLung,
        Self::MrHead,
        Self::Industrial,
        Self::Translucent,
        Self::Smooth,
        Self::Grey,
        Self::Opacity,
    ];

    /// Name, and what it shows in a line.
    const fn texts(self) -> (&'static str, &'static str) {
        match self {
            Self::CtBone => ("ct-bone", "CT in Hounsfield units: bones"),
            Self::CtSoftTissue => ("ct-soft-tissue", "CT in Hounsfield units: translucent flesh, bones"),
            Self::CtLung => ("ct-lung", "CT in Hounsfield units: lungs, their vessels, faint ribs"),
            Self::MrHead => ("mr-head", "MR: skin and brain, brighter where the signal is"),
            Self::Industrial => {
                ("industrial", "parts of several materials: the lightest like glass, denser ones golden")
            }
            Self::Translucent => {
                ("translucent", "bodies within each other: blue, orange, ivory, all translucent")
            }
            Self::Smooth => ("smooth", "smooth fields: blue, green, yellow, red"),
            Self::Grey => ("grey", "grey over the range, more opaque where lighter"),
            Self::Opacity => ("opacity", "the value v is the opacity v/255"),
        }
    }

    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.texts().0
    }

    /// What it is for, in a line.
    #[must_use]
    pub const fn description(self) -> &'static str {
        self.texts().1
    }

    /// The preset that suits a volume, by its range and histogram.
    #[must_use]
    pub fn automatic(mapping: &ValueMapping, histogram: &Histogram) -> Self {
        /// Scans of parts reach into the densest quarter of their range with this part of what is not background;
        /// in MR scans only few voxels are so bright.
        const DENSE: f64 = 0.02;
        let classes = Classes::new(mapping, histogram);
        match classes {
            _ if Scale::is_body(mapping, histogram) => Self::CtSoftTissue,
            Classes { has_peak: false, .. } => Self::Smooth,
            Classes { dense, .. } if dense < DENSE => Self::MrHead,
            _ => Self::Industrial,
        }
    }

    /// The transfer function for a volume.
    #[must_use]
    pub fn function(self, mapping: &ValueMapping, histogram: &Histogram) -> TransferFunction {
        let scale = Scale::new(mapping);
        let classes = || Classes::new(mapping, histogram);
        let points = match self {
            Self::CtBone => scale.points(&hounsfield::BONE),
            Self::CtSoftTissue => scale.points(&hounsfield::SOFT_TISSUE),
            Self::CtLung => scale.points(&hounsfield::LUNG),
            Self::MrHead => adaptive::mr_head(&classes()),
            Self::Industrial => adaptive::industrial(&classes()),
            Self::Translucent => adaptive::translucent(&classes()),
            Self::Smooth => adaptive::smooth(&classes()),
            Self::Grey => adaptive::grey(&classes()),
            Self::Opacity => adaptive::opacity(),
        };
        TransferFunction::computed(points)
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for Preset {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|preset| preset.name() == text).ok_or_else(|| {
            format!("'{text}' is no preset; there are {}", Self::ALL.map(Self::name).join(", "))
        })
    }
}
