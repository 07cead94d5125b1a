//! The process: command line, log, signals, exit code.

use std::fmt::Write as _;
use std::io::{IsTerminal, Write};
use std::os::fd::{FromRawFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use clap::error::ErrorKind;
use tokio::signal::unix::{SignalKind, signal};
use vg500_regs::pci::{ALTERNATE_VENDOR_ID, VENDOR_ID, VOXEL_MEMORY_SIZES};

use crate::config::{Config, InterruptMode, Pace, RendererError, renderer};
use crate::listener::{ListenError, Listener};
use crate::readiness::Readiness;
use crate::sandbox::{self, Mode, SandboxError, Treatment};
use crate::serve::{Handle, ServeError, prepare};

/// Exit code for an unusable command line.
const USAGE: u8 = 2;
/// Exit code for a failure later on.
const FAILURE: u8 = 1;
/// The first descriptor that a service manager hands over.
const FIRST_INHERITED: i32 = 3;

/// The VolumePro 500 volume rendering card as a vfio-user device.
#[derive(Debug, Parser)]
#[command(name = "volumepro-device", version, allow_negative_numbers = true, after_long_help = sandbox_help())]
struct Arguments {
    /// Socket at which clients connect; a service manager can hand over a listening one instead (LISTEN_FDS).
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// Name every programming mistake in trace and log, and count it in the registers.
    #[arg(long)]
    strict: bool,
    /// Write a line for each trapped access and each event of a command to a file.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Complete commands when the real card would have.
    #[arg(long, value_parser = pace, value_name = "hardware")]
    pace: Option<Pace>,
    /// Interrupts on offer: msix (with msi), msi, or intx as on the card of 1999.
    #[arg(long, default_value = "msix", value_parser = interrupts, value_name = "KIND")]
    interrupt: InterruptMode,
    /// Voxel memory in MiB: 128 or 256.
    #[arg(long, default_value = "128", value_parser = voxel_memory, value_name = "MIB")]
    voxel_memory: u64,
    /// Which renderer runs: optimised, or the reference that defines what it draws.
    #[arg(long, default_value = "optimised", value_name = "NAME")]
    renderer: String,
    /// Vector instructions of the renderer: auto, avx512, avx2 or portable.
    #[arg(long, default_value = "auto", value_name = "LEVEL")]
    simd: String,
    /// Threads that render: by default as many as there are cores.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// PCI vendor ID: 1067 or 10ba.
    #[arg(long, default_value = "1067", value_parser = vendor, value_name = "ID")]
    vendor: u16,
    /// Restrict the process to what it needs once the card is set up: on, log or off.
    ///
    /// With on, files, networks and other processes are out of reach, and a system call that is not listed below ends
    /// the process with a line that names it. With log, such calls are carried out and written to the kernel's log.
    #[arg(long, default_value = "on", value_parser = sandbox, value_name = "MODE")]
    sandbox: Mode,
}

impl Arguments {
    fn config(&self) -> Result<Config, RendererError> {
        Ok(Config {
            vendor: self.vendor,
            strict: self.strict,
            trace: self.trace.clone(),
            pace: self.pace.unwrap_or_default(),
            interrupts: self.interrupt,
            voxel_memory: self.voxel_memory,
            renderer: renderer(Some(&self.renderer), Some(&self.simd), self.threads)?,
        })
    }
}

fn pace(name: &str) -> Result<Pace, String> {
    match name {
        "hardware" => Ok(Pace::Hardware),
        _ => Err("only `hardware` is served".into()),
    }
}

fn interrupts(name: &str) -> Result<InterruptMode, String> {
    match name {
        "msix" => Ok(InterruptMode::Msix),
        "msi" => Ok(InterruptMode::Msi),
        "intx" => Ok(InterruptMode::Intx),
        _ => Err("one of msix, msi, intx".into()),
    }
}

fn voxel_memory(size: &str) -> Result<u64, String> {
    let bytes = size.parse().ok().and_then(|size: u64| size.checked_mul(1 << 20));
    bytes.filter(|bytes| VOXEL_MEMORY_SIZES.contains(bytes)).ok_or_else(|| "one of 128, 256".into())
}

fn vendor(id: &str) -> Result<u16, String> {
    let id = u16::from_str_radix(id.trim_start_matches("0x"), 16).ok();
    id.filter(|id| [VENDOR_ID, ALTERNATE_VENDOR_ID].contains(id)).ok_or_else(|| "one of 1067, 10ba".into())
}

fn sandbox(mode: &str) -> Result<Mode, String> {
    match mode {
        "on" => Ok(Mode::On),
        "log" => Ok(Mode::Log),
        "off" => Ok(Mode::Off),
        _ => Err("one of on, log, off".into()),
    }
}

/// What the sandbox leaves, for `--help`.
fn sandbox_help() -> String {
    let mut text = String::from("System calls that the sandbox leaves:\n");
    for group in sandbox::GROUPS {
        let names: Vec<_> = group.names().collect();
        let treatment = match group.treatment {
            Treatment::Allowed => "",
            Treatment::AllowedWithSocket => " (with --socket)",
            Treatment::Missing => " (answered as if the system had no such call)",
        };
        _ = writeln!(text, "  {}{treatment}:\n    {}", group.purpose, names.join(" "));
    }
    text
}

/// Why the process ends.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error("no --socket, and no listening socket handed over")]
    NoSocket,
    #[error(transparent)]
    Renderer(#[from] RendererError),
    #[error(transparent)]
    Listen(#[from] ListenError),
    #[error(transparent)]
    Serve(#[from] ServeError),
    #[error(transparent)]
    Sandbox(#[from] SandboxError),
    #[error(transparent)]
    System(#[from] std::io::Error),
}

impl Failure {
    const fn code(&self) -> u8 {
        match self {
            Self::Listen(ListenError::InUse { .. }) => FAILURE,
            Self::NoSocket | Self::Renderer(_) | Self::Listen(_) | Self::Serve(ServeError::Trace { .. }) => {
                USAGE
            }
            _ => FAILURE,
        }
    }
}

/// The `volumepro-device` command. Exit code 0 after an orderly end, 2 for an unusable command line, 1 for
/// other failures; each failure is one line on standard error.
#[must_use]
pub fn run() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return refuse(&error),
    };
    _ = tracing_subscriber::fmt()
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(std::io::stderr)
        .try_init();
    match execute(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            complain(&failure.to_string());
            ExitCode::from(failure.code())
        }
    }
}

fn refuse(error: &clap::Error) -> ExitCode {
    if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
        _ = error.print();
        return ExitCode::SUCCESS;
    }
    // The first paragraph tells what is wrong; its lines become one.
    let text = error.to_string();
    let paragraph: Vec<_> = text.lines().take_while(|line| !line.is_empty()).map(str::trim).collect();
    complain(paragraph.join(" ").trim_start_matches("error: "));
    ExitCode::from(USAGE)
}

/// One line on standard error, if that still exists.
fn complain(text: &str) {
    _ = writeln!(std::io::stderr(), "volumepro-device: {text}");
}

fn execute(arguments: Arguments) -> Result<(), Failure> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
    let result = runtime.block_on(control(arguments));
    runtime.shutdown_background();
    result
}

/// Serves until the card ends or a signal asks for the end.
async fn control(arguments: Arguments) -> Result<(), Failure> {
    // Before anybody can know that the process is ready.
    let (mut interrupt, mut terminate) = (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
    let (card, readiness) = start(arguments)?;
    let stopper = card.stopper();
    let mut ended = tokio::task::spawn_blocking(|| card.join());
    readiness.tell();
    let ended = tokio::select! {
        ended = &mut ended => ended,
        _ = interrupt.recv() => { stopper.request(); ended.await }
        _ = terminate.recv() => { stopper.request(); ended.await }
    };
    Ok(ended.map_err(std::io::Error::other)??)
}

/// Opens everything, enters the sandbox, and only then starts threads.
fn start(arguments: Arguments) -> Result<(Handle, Readiness), Failure> {
    let config = arguments.config()?;
    let (listener, place) = listener(arguments.socket.as_deref())?;
    let card = prepare(listener, &config)?;
    let readiness = Readiness::new(place);
    for gap in sandbox::enter(arguments.sandbox, arguments.socket.as_deref())? {
        if gap.matters() {
            tracing::warn!("sandbox: {gap}");
        } else {
            tracing::info!("sandbox: {gap}");
        }
    }
    Ok((card.start()?, readiness))
}

/// The socket to listen on, and what to call it.
fn listener(socket: Option<&Path>) -> Result<(Listener, String), Failure> {
    match (socket, inherited()) {
        (Some(path), _) => Ok((Listener::bind(path)?, path.display().to_string())),
        (None, Some(socket)) => Ok((Listener::inherit(socket)?, "an inherited socket".into())),
        (None, None) => Err(Failure::NoSocket),
    }
}

/// The descriptor that a service manager hands over, as systemd's `sd_listen_fds` defines it.
fn inherited() -> Option<OwnedFd> {
    let number = |name| std::env::var(name).ok()?.parse::<u32>().ok();
    if number("LISTEN_PID") != Some(std::process::id()) || number("LISTEN_FDS").unwrap_or(0) == 0 {
        return None;
    }
    // SAFETY: the environment says that the descriptor was opened for this process, which takes it here, once,
    // before it has opened any other. If that is a lie, `Listener::inherit` finds no socket.
    Some(unsafe { OwnedFd::from_raw_fd(FIRST_INHERITED) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(words: &[&str]) -> Result<Arguments, clap::Error> {
        Arguments::try_parse_from(std::iter::once(&"volumepro-device").chain(words))
    }

    #[test]
    fn values_that_are_not_served_are_named() {
        let cases: [&[&str]; 9] = [
            &["--threads", "-1"],
            &["--threads", "many"],
            &["--voxel-memory", "64"],
            &["--voxel-memory", "99999999999999999999"],
            &["--pace", "slow"],
            &["--interrupt", "irq"],
            &["--vendor", "8086"],
            &["--vendor", "xyz"],
            &["--sandbox", "maybe"],
        ];
        for words in cases {
            let error = parse(words).unwrap_err();
            assert_eq!(error.exit_code(), i32::from(USAGE));
            assert!(error.to_string().contains(words[1]), "{error}");
        }
        assert!(parse(&["--renderer", "fastest"]).unwrap().config().is_err());
        assert!(parse(&["--unknown"]).is_err());
        assert!(parse(&["leftover"]).is_err());
    }

    #[test]
    fn the_default_is_the_default_card() {
        let arguments = parse(&["--socket", "card.sock"]).unwrap();
        let default = Config::default();
        assert_eq!((arguments.vendor, arguments.voxel_memory), (default.vendor, default.voxel_memory));
        assert_eq!(
            (arguments.config().unwrap().renderer, arguments.interrupt),
            (default.renderer, default.interrupts)
        );
        assert_eq!(arguments.sandbox, Mode::On);
        assert!(!arguments.strict && arguments.pace.is_none() && arguments.trace.is_none());
    }

    #[test]
    fn every_option_is_understood() {
        let line = "--socket s --strict --trace t --pace hardware --interrupt intx --voxel-memory 256 \
                    --renderer reference --simd portable --threads 1 --vendor 10ba --sandbox log";
        let arguments = parse(&line.split_whitespace().collect::<Vec<_>>()).unwrap();
        assert!(arguments.strict);
        assert_eq!((arguments.pace, arguments.sandbox), (Some(Pace::Hardware), Mode::Log));
        assert_eq!(arguments.interrupt, InterruptMode::Intx);
        assert_eq!((arguments.vendor, arguments.voxel_memory), (0x10ba, 256 << 20));
    }
}
