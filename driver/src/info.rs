//! What a card is.

use core::fmt;

use vg500_regs::pci::{ALTERNATE_VENDOR_ID, DEVICE_ID, VENDOR_ID};
use vg500_regs::table::{architecture, interface_version, renderer, simd_level, threads, voxel_memory_size};

use crate::Error;
use crate::transport::Transport;

macro_rules! codes {
    ($(#[$doc:meta])* $name:ident { $($(#[$variant_doc:meta])* $variant:ident = $code:literal $text:literal),* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name {
            $($(#[$variant_doc])* $variant,)*
            /// A code that this driver does not know.
            Other(u32),
        }

        impl $name {
            /// The meaning of a register code.
            #[must_use]
            pub const fn from_code(code: u32) -> Self {
                match code {
                    $($code => Self::$variant,)*
                    code => Self::Other(code),
                }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                match self {
                    $(Self::$variant => f.pad($text),)*
                    Self::Other(code) => write!(f, "unknown ({code})"),
                }
            }
        }
    };
}

codes! {
    /// Which renderer a card runs; displayed as on the command line.
    Renderer {
        /// The renderer that defines the card.
        Reference = 1 "reference",
        /// The fast one.
        Optimised = 2 "optimised"
    }
}

codes! {
    /// Which architecture a card is; displayed as on the command line.
    Architecture {
        /// VolumePro 500.
        Vg500 = 1 "vg500"
    }
}

codes! {
    /// Which vector instructions the engine uses; displayed as on the command line.
    SimdLevel {
        /// None in particular.
        Portable = 0 "portable",
        /// AVX2.
        Avx2 = 1 "avx2",
        /// AVX-512.
        Avx512 = 2 "avx512"
    }
}

/// How the driver learns that a command has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Completion {
    /// By interrupt; what ended stands in the card's copy of its status in host memory.
    Interrupt,
    /// By interrupt; what ended is read from the status registers.
    InterruptAndRegisters,
    /// By looking at the copy of the status in host memory again and again.
    PollCopy,
    /// By reading the status registers again and again.
    PollRegisters,
}

/// What a card is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CardInfo {
    /// PCI vendor ID.
    pub vendor: u16,
    /// PCI device ID.
    pub device: u16,
    /// PCI revision.
    pub revision: u8,
    /// Version of the programming interface, major and minor.
    pub interface: (u16, u16),
    /// Which renderer it runs.
    pub renderer: Renderer,
    /// Which architecture it is.
    pub architecture: Architecture,
    /// Which vector instructions the engine uses.
    pub simd: SimdLevel,
    /// Threads that render.
    pub threads: u32,
    /// Bytes of voxel memory.
    pub voxel_memory: u64,
}

/// What a PCI device says it is.
#[derive(Clone, Copy)]
pub(crate) struct Identity {
    vendor: u16,
    device: u16,
    revision: u8,
}

impl Identity {
    /// Reads the identity; a device that is no VolumePro 500 is refused.
    pub(crate) fn read(transport: &dyn Transport) -> Result<Self, Error> {
        let word = transport.read_config(0)?;
        let (vendor, device) = (word as u16, (word >> 16) as u16);
        if !([VENDOR_ID, ALTERNATE_VENDOR_ID].contains(&vendor) && device == DEVICE_ID) {
            return Err(Error::Identity { vendor, device });
        }
        Ok(Self { vendor, device, revision: transport.read_config(8)? as u8 })
    }
}

impl CardInfo {
    /// Reads the companions of the status registers; another interface is refused.
    pub(crate) fn read(transport: &dyn Transport, identity: Identity) -> Result<Self, Error> {
        let version = transport.read_register(interface_version::REGISTER.offset)?;
        let (major, minor) =
            (interface_version::MAJOR.get(version) as u16, interface_version::MINOR.get(version) as u16);
        let known = interface_version::MAJOR.get(interface_version::REGISTER.reset) as u16;
        if major != known {
            return Err(Error::Version { major, minor, known });
        }
        let mut words = [0; 5];
        transport.read_registers(renderer::REGISTER.offset, &mut words)?;
        let [renderer_word, architecture_word, simd_word, threads_word, memory_word] = words;
        Ok(Self {
            vendor: identity.vendor,
            device: identity.device,
            revision: identity.revision,
            interface: (major, minor),
            renderer: Renderer::from_code(renderer::KIND.get(renderer_word)),
            architecture: Architecture::from_code(architecture::KIND.get(architecture_word)),
            simd: SimdLevel::from_code(simd_level::LEVEL.get(simd_word)),
            threads: threads::COUNT.get(threads_word),
            voxel_memory: voxel_memory_size::BYTES.get(memory_word).into(),
        })
    }
}

// The five registers are read at once.
const _: () = assert!(voxel_memory_size::REGISTER.offset == renderer::REGISTER.offset + 16);
