//! `volumepro-smoke`: does the card in this machine draw? Without any driver: registers and memories by their
//! files in sysfs, the end of the frame by polling.

use std::process::ExitCode;

use clap::Parser;
use vg500_regs::pci::BARS;
use volumepro_driver::{Card, PciCard, PciSelector};

#[path = "volumepro-selftest/scene.rs"]
mod scene;

/// Draws one small frame on a VolumePro 500 without driver, and compares its pixels with what they must be.
#[derive(Parser)]
struct Arguments {
    /// Address of the card, as 0000:00:05.0 or 00:05.0; `auto` is the first.
    #[arg(long, value_name = "ADDRESS", default_value = "auto")]
    device: PciSelector,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err((step, error)) => {
            println!("FAIL {step}: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), (&'static str, Box<dyn std::error::Error>)> {
    let transport = PciCard::open(arguments.device).map_err(|error| ("find", error.into()))?;
    if transport.is_vfio() {
        let message =
            format!("{} is bound to vfio-pci, whose test is volumepro-selftest", transport.address());
        return Err(("find", message.into()));
    }
    println!("PASS find: {}", transport.address());
    let card = Card::open(Box::new(transport)).map_err(|error| ("open", error.into()))?;
    println!("PASS open: {} BARs, {}", BARS.len(), card.description());
    let frame = || -> Result<String, Box<dyn std::error::Error>> {
        scene::Scene::new(&card)?.check(&card)?;
        let [width, height, _] = scene::SIZE;
        Ok(format!("{width} x {height} pixels as expected, end seen by {:?}", card.completion()))
    };
    println!("PASS frame: {}", frame().map_err(|error| ("frame", error))?);
    Ok(())
}
