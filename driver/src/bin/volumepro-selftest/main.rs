//! `volumepro-selftest`: whether a card behind vfio-pci does everything that its driver asks of it, and what it
//! costs.

mod benchmark;
mod frames;
mod identity;
mod memories;
mod meter;
mod resets;
mod rig;
mod scene;
mod sections;
mod strict;

use std::process::ExitCode;

use clap::Parser;
use serde::Serialize;
use volumepro_driver::{Error, PciSelector};

use benchmark::Benchmark;
use rig::{Failure, Rig};

/// Tests a VolumePro 500 that is bound to vfio-pci. Prints a line for each check, `PASS name: detail` or
/// `FAIL name: why`; exit code 1 if one fails.
#[derive(Parser)]
struct Arguments {
    /// Address of the card, as 0000:00:05.0 or 00:05.0; `auto` is the first.
    #[arg(long, value_name = "ADDRESS", default_value = "auto")]
    device: PciSelector,
    /// Interrupts that must not get lost.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    interrupts: u32,
    /// Fail unless the card is in strict mode.
    #[arg(long)]
    strict: bool,
    /// Measure what accesses and frames cost as well.
    #[arg(long)]
    benchmark: bool,
    /// Frames that the benchmark measures.
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Voxels along each axis of the benchmark's volume, and rays along each side of its base plane.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=256))]
    size: u32,
    /// Print one JSON object instead of lines.
    #[arg(long)]
    json: bool,
}

/// What is printed.
#[derive(Default, Serialize)]
struct Results {
    /// Which way leads to which card.
    card: String,
    passed: bool,
    checks: Vec<Check>,
    #[serde(skip_serializing_if = "Option::is_none")]
    benchmark: Option<Benchmark>,
    #[serde(skip)]
    silent: bool,
}

#[derive(Serialize)]
struct Check {
    name: &'static str,
    passed: bool,
    detail: String,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let mut results = Results { silent: arguments.json, ..Results::default() };
    run(&arguments, &mut results);
    results.passed = results.checks.iter().all(|check| check.passed);
    if arguments.json {
        match serde_json::to_string(&results) {
            Ok(text) => println!("{text}"),
            Err(error) => eprintln!("volumepro-selftest: {error}"),
        }
    }
    if results.passed { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn run(arguments: &Arguments, results: &mut Results) {
    let rig = match Rig::open(arguments.device) {
        Ok(rig) => rig,
        Err(error) => return results.note("open", Err(error)),
    };
    results.card = rig.card.description();
    results.note("open", Ok(results.card.clone()));
    let before = rig.card.trapped_accesses();
    type Checked<'a> = &'a dyn Fn(&Rig) -> Result<String, Failure>;
    let checks: [(_, Checked); _] = [
        ("identity", &identity::identity),
        ("completion", &identity::completion),
        ("memories", &memories::patterns),
        ("frame", &memories::frame),
        ("device-view", &memories::device_view),
        ("sections", &sections::records),
        ("spoiled-sections", &sections::spoiled),
        ("transfers", &frames::transfers),
        ("steady-frame", &frames::steady),
        ("interrupts", &|rig| frames::interrupts(rig, arguments.interrupts)),
        ("reset", &resets::by_system),
        ("reset-register", &resets::by_register),
        ("function-level-reset", &resets::by_function),
        ("reset-during-frames", &resets::during_frames),
    ];
    for (name, check) in checks {
        let clean = |detail| rig.expect_no_mistakes().map(|()| detail);
        results.note(name, check(&rig).and_then(clean));
        if let Err(error @ Error::CardDead { .. }) = rig.card.mistakes() {
            return results.note("alive", Err(error.into()));
        }
    }
    results.note("strict-clean", strict_clean(&rig, arguments.strict));
    // Mistakes for a card in strict mode, from here on.
    results.note("refused-frame", frames::refusal(&rig));
    results.note("unmapped-memory", frames::unmapped(&rig));
    let untrapped = || memories::untrapped(&before?, &rig.card.trapped_accesses()?);
    results.note("no-traps", untrapped());
    if arguments.benchmark {
        match benchmark::run(&rig, arguments.frames, arguments.size) {
            Ok(benchmark) => {
                if !results.silent {
                    benchmark.print();
                }
                results.benchmark = Some(benchmark);
            }
            Err(error) => results.note("benchmark", Err(error)),
        }
    }
}

/// No check so far made a mistake that the card has seen, if it looks for them.
fn strict_clean(rig: &Rig, demanded: bool) -> Result<String, Failure> {
    rig.expect_no_mistakes()?;
    match strict::deliberate_mistake(rig)? {
        true => Ok("no programming mistakes in all checks; a deliberate one is counted".into()),
        false if demanded => Err("the card is not in strict mode".into()),
        false => Ok("the card is not in strict mode and counts no mistakes".into()),
    }
}

impl Results {
    fn note(&mut self, name: &'static str, result: Result<String, Failure>) {
        let passed = result.is_ok();
        let detail = result.unwrap_or_else(|error| error.to_string());
        if !self.silent {
            println!("{} {name}: {detail}", if passed { "PASS" } else { "FAIL" });
        }
        self.checks.push(Check { name, passed, detail });
    }
}
