//! The card that the arguments ask for.

use super::arguments::{Architecture, Card as CardArguments, RendererName, Simd, name};
use super::error::Error;
use super::input::Loaded;
use super::lists::Device;
use super::messages::say;
use crate::transfer::TransferFunction;
use crate::{BasePlane, Board, Context};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;
use std::time::Duration;
use volumepro_driver::{Card, CardInfo, PciCard, Transport, VfioUser};

/// How long the card may take to answer a message.
const ANSWER: Duration = Duration::from_secs(20);

/// What renders: a card, or the ideal renderer, which has none.
pub enum Target {
    /// A card.
    Board(Box<Board>),
    /// The ideal renderer, with its transfer function of data values.
    Ideal(TransferFunction),
}

/// What renders, in the words of the command line.
pub struct Description {
    /// Which renderer.
    pub renderer: String,
    /// Which architecture.
    pub architecture: String,
    /// Vector instructions that it uses.
    pub simd: String,
    /// Threads that it uses.
    pub threads: u32,
}

impl Target {
    /// Opens what the arguments name.
    pub fn open(arguments: &CardArguments, transfer: TransferFunction) -> Result<Self, Error> {
        if arguments.renderer == Some(RendererName::Ideal) {
            return Ok(Self::Ideal(transfer));
        }
        Ok(Self::Board(Box::new(open(arguments)?)))
    }

    /// Brings the volume to where it is rendered.
    pub fn load(&mut self, loaded: &Loaded) -> Result<(), Error> {
        match self {
            Self::Board(board) => Ok(board.load(&loaded.volume)?),
            Self::Ideal(_) => Ok(()),
        }
    }

    /// Tells the card what it is not to leave out from now on: bits of the register `KEEP`.
    pub const fn keep(&mut self, omissions: u32) {
        if let Self::Board(board) = self {
            board.keep(omissions);
        }
    }

    /// Whether reports are to tell all that was left out.
    pub const fn detail(&mut self, detailed: bool) {
        if let Self::Board(board) = self {
            board.detail(detailed);
        }
    }

    /// Renders a frame.
    pub fn render(&mut self, context: &Context, loaded: &Loaded) -> Result<BasePlane, Error> {
        match self {
            Self::Board(board) => Ok(board.render(context, &loaded.volume)?),
            Self::Ideal(transfer) => ideal(context, loaded, transfer),
        }
    }

    /// What renders.
    pub fn describe(&self) -> Description {
        match self {
            Self::Board(board) => {
                let info = board.card().info();
                Description {
                    renderer: info.renderer.to_string(),
                    architecture: info.architecture.to_string(),
                    simd: info.simd.to_string(),
                    threads: info.threads,
                }
            }
            Self::Ideal(_) => Description {
                renderer: name(RendererName::Ideal),
                architecture: name(Architecture::Vg500),
                simd: "portable".into(),
                threads: std::thread::available_parallelism().map_or(1, |threads| threads.get() as u32),
            },
        }
    }
}

#[cfg(feature = "embedded")]
fn ideal(context: &Context, loaded: &Loaded, transfer: &TransferFunction) -> Result<BasePlane, Error> {
    let transfer = |entry: f64| transfer.at(loaded.mapping.value_between(entry));
    Ok(crate::ideal::render(context, &loaded.volume, &transfer)?)
}

#[cfg(not(feature = "embedded"))]
fn ideal(_: &Context, _: &Loaded, _: &TransferFunction) -> Result<BasePlane, Error> {
    Err(Error::input("--renderer ideal: this program was built without render engine"))
}

/// Opens the card that the arguments name and checks that it is what they ask for.
fn open(arguments: &CardArguments) -> Result<Board, Error> {
    let board = match &arguments.device {
        Device::Embedded => {
            let [renderer, simd] = [arguments.renderer.map(name), arguments.simd.map(name)];
            embedded_with(renderer.as_deref(), simd.as_deref(), arguments.threads)?
        }
        Device::Socket(path) => {
            check_socket(path)?;
            let transport = VfioUser::connect(path, ANSWER).map_err(Error::failure)?;
            Board::new(Card::open(Box::new(transport)).map_err(Error::failure)?)
        }
        Device::Pci(selector) => {
            let transport = PciCard::open(*selector).map_err(Error::failure)?;
            say(format_args!("card: {}", transport.description()));
            Board::new(Card::open(Box::new(transport)).map_err(Error::failure)?)
        }
    };
    check(arguments, board.card().info())?;
    Ok(board)
}

/// A path where no socket is cannot become one by waiting.
fn check_socket(path: &Path) -> Result<(), Error> {
    let what = match path.metadata() {
        Ok(metadata) if metadata.file_type().is_socket() => return Ok(()),
        Ok(_) => "is not a socket".to_owned(),
        Err(error) => error.to_string(),
    };
    Err(Error::input(format!("--device socket:{}: {what}", path.display())))
}

/// Opens a card in this process, as the device's options of these names say.
#[cfg(feature = "embedded")]
pub fn embedded_with(
    renderer: Option<&str>,
    simd: Option<&str>,
    threads: Option<u16>,
) -> Result<Board, Error> {
    let renderer = volumepro_device::config::renderer(renderer, simd, threads.map(usize::from));
    let renderer = renderer.map_err(Error::input)?;
    let config = volumepro_device::Config { renderer, ..Default::default() };
    Board::embedded(&config, ANSWER).map_err(Error::failure)
}

#[cfg(not(feature = "embedded"))]
pub fn embedded_with(_: Option<&str>, _: Option<&str>, _: Option<u16>) -> Result<Board, Error> {
    Err(Error::input("--device embedded: this program was built without the embedded card"))
}

/// Options of the device must be what the card reports.
fn check(arguments: &CardArguments, info: &CardInfo) -> Result<(), Error> {
    let asked = [
        ("renderer", arguments.renderer.map(name), info.renderer.to_string()),
        ("architecture", arguments.architecture.map(name), info.architecture.to_string()),
        ("simd", arguments.simd.filter(|level| *level != Simd::Auto).map(name), info.simd.to_string()),
        ("threads", arguments.threads.map(|threads| threads.to_string()), info.threads.to_string()),
    ];
    for (option, wanted, found) in asked {
        if let Some(wanted) = wanted.filter(|wanted| *wanted != found) {
            return Err(Error::input(format!("--{option} {wanted}: this card serves {found} only")));
        }
    }
    Ok(())
}
