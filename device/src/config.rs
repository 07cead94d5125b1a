//! How a card is set up.

use std::path::PathBuf;

use vg500_engine::{Level, LevelError, Renderer};
use vg500_regs::pci::{VENDOR_ID, VOXEL_MEMORY_SIZES};

pub use crate::card::Pace;
pub use crate::interrupt::InterruptMode;

/// The set-up of a card. The default is the card of the papers, with messages for interrupts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Config {
    /// PCI vendor ID: one of the two under which the public ID lists know the card.
    pub vendor: u16,
    /// Whether programming mistakes are named and counted.
    pub strict: bool,
    /// File for the register trace.
    pub trace: Option<PathBuf>,
    /// When commands end.
    pub pace: Pace,
    /// Kinds of interrupt on offer.
    pub interrupts: InterruptMode,
    /// Bytes of voxel memory, one of [`VOXEL_MEMORY_SIZES`].
    pub voxel_memory: u64,
    /// Which renderer runs.
    pub renderer: Renderer,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            vendor: VENDOR_ID,
            strict: false,
            trace: None,
            pace: Pace::default(),
            interrupts: InterruptMode::default(),
            voxel_memory: VOXEL_MEMORY_SIZES[0],
            renderer: Renderer::default(),
        }
    }
}

/// The most threads that render.
const THREADS: usize = 256;

/// A renderer that cannot be had. Each says which option asks for it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RendererError {
    /// There is no such renderer.
    #[error("--renderer {0}: one of reference, optimised")]
    Unknown(String),
    /// There are no such instructions, or not here.
    #[error("--simd {0}: {1}")]
    Level(String, LevelError),
    /// The reference renderer uses no vector instructions.
    #[error("--simd {0}: the reference renderer is portable")]
    NoVectors(String),
    /// The reference renderer has one thread.
    #[error("--threads {0}: the reference renderer has 1 thread")]
    OneThread(usize),
    /// Not a number of threads.
    #[error("--threads {0}: from 1 to {THREADS}")]
    Threads(usize),
}

/// The renderer of a name (`optimised` if there is none), with the instructions of a level and as many threads:
/// the best and all cores where nothing is asked for.
pub fn renderer(
    name: Option<&str>,
    simd: Option<&str>,
    threads: Option<usize>,
) -> Result<Renderer, RendererError> {
    if let Some(count) = threads.filter(|count| !(1..=THREADS).contains(count)) {
        return Err(RendererError::Threads(count));
    }
    let simd = simd.unwrap_or("auto");
    match name.unwrap_or("optimised") {
        "optimised" => {
            let level = Level::named(simd).map_err(|error| RendererError::Level(simd.to_owned(), error))?;
            let threads = threads.unwrap_or_else(|| Renderer::default().threads());
            Ok(Renderer::Optimised { level, threads })
        }
        "reference" => match (Level::named(simd), threads) {
            (Err(LevelError::Unknown), _) => Err(RendererError::Level(simd.to_owned(), LevelError::Unknown)),
            _ if !["auto", "portable"].contains(&simd) => Err(RendererError::NoVectors(simd.to_owned())),
            (_, Some(count)) if count != 1 => Err(RendererError::OneThread(count)),
            _ => Ok(Renderer::Reference),
        },
        other => Err(RendererError::Unknown(other.to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_had_names_its_option() {
        let cases = [
            (Some("fastest"), None, None, "--renderer fastest: one of reference, optimised"),
            (None, Some("mmx"), None, "--simd mmx: one of auto, avx512, avx2, portable"),
            (Some("reference"), Some("mmx"), None, "--simd mmx: one of auto, avx512, avx2, portable"),
            (Some("reference"), Some("avx2"), None, "--simd avx2: the reference renderer is portable"),
            (Some("reference"), None, Some(2), "--threads 2: the reference renderer has 1 thread"),
            (None, None, Some(0), "--threads 0: from 1 to 256"),
            (None, None, Some(257), "--threads 257: from 1 to 256"),
        ];
        for (name, simd, threads, message) in cases {
            assert_eq!(renderer(name, simd, threads).unwrap_err().to_string(), message);
        }
    }

    #[test]
    fn the_default_is_the_best_there_is() {
        assert_eq!(renderer(None, None, None), Ok(Renderer::default()));
        assert_eq!(renderer(Some("reference"), Some("portable"), Some(1)), Ok(Renderer::Reference));
        let portable = renderer(Some("optimised"), Some("portable"), Some(3)).unwrap();
        assert_eq!((portable.simd_code(), portable.threads(), portable.code()), (0, 3, 2));
    }
}
