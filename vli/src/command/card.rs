//! The card that the arguments ask for.

use super::arguments::{Architecture, Card as CardArguments, RendererName, Simd};
use super::error::Error;
use crate::Board;
use std::path::Path;
use std::time::Duration;
use volumepro_driver::{self as driver, Card, CardInfo, VfioUser};

/// How long the card may take to answer a message.
const ANSWER: Duration = Duration::from_secs(20);

/// Opens the card that the arguments name and checks that it is what they ask for.
pub fn open(arguments: &CardArguments) -> Result<Board, Error> {
    let device = arguments.device.as_str();
    let board = if device == "embedded" {
        embedded()?
    } else if let Some(path) = device.strip_prefix("socket:") {
        let transport = VfioUser::connect(Path::new(path), ANSWER).map_err(Error::failure)?;
        Board::new(Card::open(Box::new(transport)).map_err(Error::failure)?)
    } else if device.starts_with("pci:") {
        return Err(Error::input(format!("--device {device}: this program does not serve PCI cards yet")));
    } else {
        return Err(Error::input(format!("--device {device}: none of embedded, socket:PATH, pci:ADDRESS")));
    };
    check(arguments, board.card().info())?;
    Ok(board)
}

#[cfg(feature = "embedded")]
fn embedded() -> Result<Board, Error> {
    Board::embedded(&volumepro_device::Config::default(), ANSWER).map_err(Error::failure)
}

#[cfg(not(feature = "embedded"))]
fn embedded() -> Result<Board, Error> {
    Err(Error::input("--device embedded: this program was built without the embedded card"))
}

/// Options of the device must be what the card reports; the embedded card has no others yet.
fn check(arguments: &CardArguments, info: &CardInfo) -> Result<(), Error> {
    let asked = [
        ("renderer", arguments.renderer.map(renderer), info.renderer.to_string()),
        ("architecture", arguments.architecture.map(architecture), info.architecture.to_string()),
        ("simd", arguments.simd.and_then(simd), info.simd.to_string()),
        ("threads", arguments.threads.map(|threads| threads.to_string()), info.threads.to_string()),
    ];
    for (option, wanted, found) in asked {
        if let Some(wanted) = wanted.filter(|wanted| *wanted != found) {
            return Err(Error::input(format!("--{option} {wanted}: this card serves {found} only")));
        }
    }
    Ok(())
}

fn renderer(name: RendererName) -> String {
    match name {
        RendererName::Ideal => "ideal",
        RendererName::Reference => "reference",
        RendererName::Optimised => "optimised",
    }
    .into()
}

fn architecture(name: Architecture) -> String {
    match name {
        Architecture::Vg500 => "vg500",
    }
    .into()
}

fn simd(level: Simd) -> Option<String> {
    match level {
        Simd::Auto => None,
        Simd::Avx512 => Some("avx512".into()),
        Simd::Avx2 => Some("avx2".into()),
        Simd::Portable => Some("portable".into()),
    }
}

/// What the driver says of the card, for statistics.
pub fn describe(info: &driver::CardInfo) -> [String; 3] {
    [info.renderer.to_string(), info.architecture.to_string(), info.simd.to_string()]
}
